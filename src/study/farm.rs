//! How the time to deliver a shot falls with machines: a simulation of a farm, from costs measured on one machine.
//!
//! Tasks go, in order, to whichever machine is free first. A task starts, loads the scene from shared storage, prepares
//! its frames and samples them; when all have ended, parts are merged, or whole frames looked through, in the same way.
//! Machines differ in speed, frames in what they cost, and machines fail. The division into tasks is the one that
//! `graeco farm` makes. What is not modelled: other jobs on the farm, and duplicates of tasks that are late.

use crate::design::hash::subkey;
use crate::farm::{Cost, Division, Slicing, Wish};
use crate::{Error, Result};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

/// What one machine was measured to take; processor seconds are those of one core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// Frames of the shot.
    pub frames: usize,
    /// Seconds to start and load the scene; more cores do not shorten it.
    pub load_s: f64,
    /// Seconds to prepare a frame; more cores do not shorten it.
    pub build_s: f64,
    /// Processor seconds to sample a frame.
    pub render_core_s: f64,
    /// Seconds to merge a frame's parts and write the picture.
    pub merge_s: f64,
    /// Seconds to look whether a finished frame is whole.
    pub check_s: f64,
    /// Standard deviation of what frames cost, relative to the mean.
    pub variation: f64,
    /// Bytes of the scene.
    pub scene_bytes: f64,
    /// Bytes of a frame's parts together.
    pub part_bytes: f64,
    /// Bytes of a finished frame.
    pub frame_bytes: f64,
}

/// What is assumed of a farm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Farm {
    /// Cores of a machine.
    pub cores: f64,
    /// Seconds from the manager's decision to the program's start.
    pub start_s: f64,
    /// Tasks that the manager can start a second.
    pub dispatch: f64,
    /// Bytes a second that the shared storage serves to all machines together.
    pub storage: f64,
    /// Standard deviation of the machines' logarithmic speed.
    pub speed: f64,
    /// Part of the machines that are three times slower than they should be.
    pub slow: f64,
    /// Failures an hour of one machine.
    pub failures: f64,
    /// Seconds until a task that failed starts again; it goes on from its last complete block.
    pub retry_s: f64,
    /// Chooses speeds, costs and failures.
    pub seed: u64,
}

/// How one shot went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delivery {
    /// Machines.
    pub machines: usize,
    /// Seconds that tasks were asked to take.
    pub task_s: f64,
    /// How frames were cut.
    pub division: Division,
    /// Seconds from the first task's start to the last picture.
    pub total_s: f64,
    /// Seconds until all samples were taken.
    pub rendered_s: f64,
    /// Seconds between the mean machine's last sample and the last machine's: waiting for stragglers.
    pub tail_s: f64,
    /// Part of the machines' working time that is not samples: starts, loads, preparing frames, failures.
    pub overhead: f64,
    /// Hours of machines, working or waiting for the end.
    pub machine_hours: f64,
}

/// A number in (0, 1) at an address.
fn uniform(seed: u64, what: u64, index: u64) -> f64 {
    #[allow(clippy::cast_precision_loss, reason = "53 bits")]
    let u = ((subkey(subkey(subkey(0, seed), what), index) >> 11) as f64 + 0.5) / 9_007_199_254_740_992.0;
    u
}

/// A number of the standard normal distribution at an address (Box and Muller 1958).
fn normal(seed: u64, what: u64, index: u64) -> f64 {
    let (u, v) = (uniform(seed, what, 2 * index), uniform(seed, what, 2 * index + 1));
    (-2.0 * libm::log(u)).sqrt() * libm::cos(TAU * v)
}

/// A number of the lognormal distribution of mean 1 and this relative standard deviation, at an address.
fn spread(deviation: f64, seed: u64, what: u64, index: u64) -> f64 {
    let variance = libm::log1p(deviation * deviation);
    libm::exp(variance.sqrt() * normal(seed, what, index) - 0.5 * variance)
}

/// Time as an integer of nanoseconds, for a heap.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates after 584 years")]
fn ticks(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}

#[allow(clippy::cast_precision_loss, reason = "simulated time needs no more than 53 bits")]
fn seconds(ticks: u64) -> f64 {
    ticks as f64 * 1e-9
}

/// Machines that take tasks in order.
struct Machines<'a> {
    farm: &'a Farm,
    free: BinaryHeap<Reverse<(u64, usize)>>,
    speeds: Vec<f64>,
    next_dispatch: f64,
    storage_free: f64,
    tasks: u64,
    /// Working seconds, and those of them that are samples.
    worked: f64,
    sampled: f64,
    last: f64,
}

impl<'a> Machines<'a> {
    fn new(farm: &'a Farm, count: usize) -> Self {
        let speed = |i: usize| {
            let usual = libm::exp(farm.speed * normal(farm.seed, 1, i as u64));
            if uniform(farm.seed, 2, i as u64) < farm.slow { usual / 3.0 } else { usual }
        };
        Self {
            farm,
            free: (0..count).map(|i| Reverse((0, i))).collect(),
            speeds: (0..count).map(speed).collect(),
            next_dispatch: 0.0,
            storage_free: 0.0,
            tasks: 0,
            worked: 0.0,
            sampled: 0.0,
            last: 0.0,
        }
    }

    /// Runs a task that reads `bytes` first, then takes `fixed_s` and `sample_s` on a machine of usual speed.
    fn run(&mut self, bytes: f64, fixed_s: f64, sample_s: f64) {
        let Some(Reverse((free, machine))) = self.free.pop() else { return };
        let farm = self.farm;
        let begin = seconds(free).max(self.next_dispatch);
        self.next_dispatch = begin + 1.0 / farm.dispatch;
        // Reads come in order of dispatch, so the storage serves them one after another.
        let ready = begin + farm.start_s;
        self.storage_free = self.storage_free.max(ready) + bytes / farm.storage;
        let speed = self.speeds[machine];
        let work = (fixed_s + sample_s) / speed;
        let mut end = self.storage_free + work;
        let fails = -libm::expm1(-work * farm.failures / 3600.0);
        if uniform(farm.seed, 3, self.tasks) < fails {
            end += farm.retry_s + farm.start_s + fixed_s / speed;
        }
        self.tasks += 1;
        self.worked += end - begin;
        self.sampled += sample_s / speed;
        self.last = self.last.max(end);
        self.free.push(Reverse((ticks(end), machine)));
    }

    /// Seconds when the mean machine of those that had work became free.
    fn mean_end(&self) -> f64 {
        let ends: Vec<f64> = self.free.iter().filter(|m| m.0.0 > 0).map(|m| seconds(m.0.0)).collect();
        #[allow(clippy::cast_precision_loss, reason = "a count of machines")]
        let count = ends.len().max(1) as f64;
        ends.iter().sum::<f64>() / count
    }

    /// A barrier: all go on from `time`, at which no machine is busy.
    fn wait_until(&mut self, time: f64) {
        let at = ticks(time);
        self.free = (0..self.speeds.len()).map(|i| Reverse((at, i))).collect();
        (self.next_dispatch, self.storage_free, self.last) = (time, time, time);
    }
}

/// Delivers the shot with `count` machines and tasks that should take `task_s`.
///
/// # Errors
/// If there are no machines, or a number is out of range.
#[allow(clippy::cast_precision_loss, reason = "counts far below 2^52")]
pub fn deliver(shot: &Measured, farm: &Farm, count: usize, task_s: f64) -> Result<Delivery> {
    let numbers = [farm.cores, farm.dispatch, farm.storage, task_s];
    if count == 0 || shot.frames == 0 || numbers.iter().any(|v| !v.is_finite() || *v <= 0.0) {
        return Err(Error::invalid(
            "the farm",
            "needs machines, frames, cores, starts a second, bytes a second and a task time",
        ));
    }
    let cost =
        Cost { load_s: shot.load_s + farm.start_s, build_s: shot.build_s, render_s: shot.render_core_s / farm.cores };
    let wish = Wish { task_s, slicing: Slicing::Tiles, parts: None, frames_per_task: None, most_parts: 1024 };
    let division = Division::new(cost, shot.frames, &wish)?;
    let mut machines = Machines::new(farm, count);
    let parts = u64::from(division.parts);
    for group in 0..division.groups(shot.frames) {
        let frames = (group * division.frames_per_task..shot.frames).take(division.frames_per_task);
        let costs: f64 = frames.clone().map(|f| spread(shot.variation, farm.seed, 4, f as u64)).sum();
        for part in 0..parts {
            // Tiles of a frame differ as frames do.
            let own = if parts == 1 { 1.0 } else { spread(shot.variation, farm.seed, 5, group as u64 * parts + part) };
            let fixed = shot.load_s + shot.build_s * frames.len() as f64;
            machines.run(shot.scene_bytes, fixed, cost.render_s * costs * own / parts as f64);
        }
    }
    let (worked, sampled) = (machines.worked, machines.sampled);
    let written = shot.frames as f64 * if parts > 1 { shot.part_bytes } else { shot.frame_bytes };
    let rendered_s = machines.last.max(written / farm.storage);
    let tail_s = machines.last - machines.mean_end();
    machines.wait_until(rendered_s);
    // A task of the merge takes as long as one of the rendering, if there is so much to merge.
    let (bytes, gather_s) = if parts > 1 { (shot.part_bytes, shot.merge_s) } else { (shot.frame_bytes, shot.check_s) };
    let each = (task_s / gather_s).clamp(1.0, shot.frames as f64);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, at most the frames")]
    let each = each as usize;
    for group in 0..shot.frames.div_ceil(each) {
        let n = each.min(shot.frames - group * each) as f64;
        machines.run(bytes * n, gather_s * n, 0.0);
    }
    let total_s = machines.last.max(rendered_s);
    Ok(Delivery {
        machines: count,
        task_s,
        division,
        total_s,
        rendered_s,
        tail_s,
        overhead: 1.0 - sampled / worked,
        machine_hours: count as f64 * total_s / 3600.0,
    })
}

/// The fastest of deliveries with tasks of different lengths.
///
/// # Errors
/// As [`deliver`], and if there are no lengths.
pub fn best(shot: &Measured, farm: &Farm, count: usize, lengths: &[f64]) -> Result<Delivery> {
    let all: Vec<Delivery> = lengths.iter().map(|&s| deliver(shot, farm, count, s)).collect::<Result<_>>()?;
    all.into_iter()
        .min_by(|a, b| a.total_s.total_cmp(&b.total_s))
        .ok_or_else(|| Error::invalid("--tasks", "names no length of a task"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHOT: Measured = Measured {
        frames: 600,
        load_s: 1.0,
        build_s: 0.5,
        render_core_s: 320.0,
        merge_s: 1.0,
        check_s: 1e-9,
        variation: 0.0,
        scene_bytes: 0.0,
        part_bytes: 0.0,
        frame_bytes: 0.0,
    };
    /// No chance, no limits.
    const IDEAL: Farm = Farm {
        cores: 16.0,
        start_s: 0.0,
        dispatch: 1e12,
        storage: 1e18,
        speed: 0.0,
        slow: 0.0,
        failures: 0.0,
        retry_s: 0.0,
        seed: 1,
    };

    #[test]
    fn without_chance_the_time_is_the_sum_over_machines() {
        // 600 frames of 20.5 s in groups of 29 (1 s to load) on one machine.
        let d = deliver(&SHOT, &IDEAL, 1, 600.0).unwrap();
        assert_eq!((d.division.parts, d.division.frames_per_task), (1, 29));
        assert!((d.total_s - (600.0 * 20.5 + 21.0)).abs() < 1e-3, "{d:?}");
        let ten = deliver(&SHOT, &IDEAL, 10, 41.0).unwrap();
        assert!(ten.total_s / d.total_s < 0.12 && ten.tail_s < 43.0, "{ten:?}");
    }

    /// 16 core-minutes a frame stay whole up to 600 machines; more machines than frames need parts.
    #[test]
    fn more_machines_than_frames_need_parts() {
        let whole = deliver(&SHOT, &IDEAL, 10_000, 60.0).unwrap();
        let cut = deliver(&SHOT, &IDEAL, 10_000, 3.0).unwrap();
        assert!(whole.division.parts == 1 && cut.division.parts > 8);
        assert!(cut.total_s < 0.4 * whole.total_s, "{cut:?} {whole:?}");
        assert!(best(&SHOT, &IDEAL, 10_000, &[60.0, 3.0]).unwrap() == cut);
    }

    #[test]
    fn every_limit_costs_time() {
        let base = deliver(&SHOT, &IDEAL, 100, 60.0).unwrap().total_s;
        for (name, farm) in [
            ("start", Farm { start_s: 5.0, ..IDEAL }),
            ("dispatch", Farm { dispatch: 0.5, ..IDEAL }),
            ("slow machines", Farm { slow: 0.05, ..IDEAL }),
            ("failures", Farm { failures: 50.0, retry_s: 60.0, ..IDEAL }),
        ] {
            assert!(deliver(&SHOT, &farm, 100, 60.0).unwrap().total_s > base, "{name}");
        }
        let heavy = Measured { scene_bytes: 1e9, frame_bytes: 1e8, ..SHOT };
        assert!(deliver(&heavy, &Farm { storage: 1e9, ..IDEAL }, 100, 60.0).unwrap().total_s > base);
        assert!(deliver(&SHOT, &IDEAL, 0, 60.0).is_err());
    }

    /// H0: the numbers are standard normal: mean and variance of 10 000 within 5 standard errors.
    #[test]
    fn chance_has_the_moments_it_should() {
        let n = 10_000;
        let z: Vec<f64> = (0..n).map(|i| normal(7, 9, i)).collect();
        let mean = z.iter().sum::<f64>() / 1e4;
        let variance = z.iter().map(|v| v * v).sum::<f64>() / 1e4;
        assert!(mean.abs() < 0.05 && (variance - 1.0).abs() < 0.071, "{mean} {variance}");
        let s: f64 = (0..n).map(|i| spread(0.3, 7, 9, i)).sum::<f64>() / 1e4;
        assert!((s - 1.0).abs() < 0.015, "{s}");
    }
}
