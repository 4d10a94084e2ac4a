//! `graeco study farm`: how the time to deliver a shot falls with machines.

use super::shot_args::{not_negative, positive};
use graeco::farm::Slicing;
use graeco::output::file;
use graeco::study::farm::{Delivery, Farm, Measured, best, deliver};
use graeco::study::farm_plot;
use graeco::{Error, Result};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Simulate how the time to deliver a shot falls with machines, and which task size is best
#[derive(Debug, clap::Args)]
pub(crate) struct StudyFarmArgs {
    /// Machines, separated by commas
    #[arg(long, value_delimiter = ',', default_value = "1,10,100,1000,10000,100000",
          value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    machines: Vec<u32>,
    /// Lengths of a task to try, seconds, separated by commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = positive,
          default_value = "2,4,8,15,30,60,120,300,600,1200,3600,14400")]
    tasks: Vec<f64>,
    /// Frames of the shot [default: ten minutes at 30000/1001]
    #[arg(long, default_value_t = 17_982, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    frames: u32,
    /// Processor seconds to sample a frame, on one core: cpu_s of `graeco render --stats`
    #[arg(long, value_name = "SECONDS", default_value_t = 600.0, value_parser = positive)]
    render: f64,
    /// Seconds to load the scene: load_s of --stats
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0, value_parser = not_negative)]
    load: f64,
    /// Seconds to prepare a frame: build_s of --stats
    #[arg(long, value_name = "SECONDS", default_value_t = 0.5, value_parser = not_negative)]
    build: f64,
    /// Seconds to merge a frame's parts and write it
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = positive)]
    merge: f64,
    /// Seconds of `graeco check` for a frame
    #[arg(long, value_name = "SECONDS", default_value_t = 0.2, value_parser = positive)]
    check: f64,
    /// Standard deviation of what frames cost, relative to the mean
    #[arg(long, value_name = "PART", default_value_t = 0.2, value_parser = not_negative)]
    variation: f64,
    /// Bytes of the scene, of a frame's parts, and of a finished frame
    #[arg(long, value_name = "SCENE,PARTS,FRAME", value_delimiter = ',', num_args = 1.., value_parser = not_negative,
          default_value = "1e8,2e8,1e7")]
    bytes: Vec<f64>,
    /// Cores of a machine
    #[arg(long, default_value_t = 16.0, value_parser = positive)]
    cores: f64,
    /// Seconds from the manager's decision to the program's start
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = not_negative)]
    start: f64,
    /// Tasks that the manager can start a second
    #[arg(long, value_name = "N", default_value_t = 200.0, value_parser = positive)]
    dispatch: f64,
    /// Bytes a second that the storage serves to all machines together
    #[arg(long, value_name = "BYTES", default_value_t = 20e9, value_parser = positive)]
    storage: f64,
    /// Standard deviation of the machines' logarithmic speed
    #[arg(long, value_name = "PART", default_value_t = 0.1, value_parser = not_negative)]
    speed: f64,
    /// Part of the machines that are three times slower than they should be
    #[arg(long, value_name = "PART", default_value_t = 0.005, value_parser = not_negative)]
    slow: f64,
    /// Failures an hour of a machine
    #[arg(long, value_name = "N", default_value_t = 0.001, value_parser = not_negative)]
    failures: f64,
    /// Seconds until a failed task starts again
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = not_negative)]
    retry: f64,
    /// Chooses speeds, costs and failures
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for farm.csv and farm.svg; without it only the table is printed
    #[arg(short, long)]
    output: Option<PathBuf>,
}

impl StudyFarmArgs {
    fn shot(&self) -> Result<Measured> {
        let [scene_bytes, part_bytes, frame_bytes] = self.bytes[..] else {
            return Err(Error::invalid("--bytes", "expected three numbers: scene, parts of a frame, finished frame"));
        };
        Ok(Measured {
            frames: self.frames as usize,
            load_s: self.load,
            build_s: self.build,
            render_core_s: self.render,
            merge_s: self.merge,
            check_s: self.check,
            variation: self.variation,
            scene_bytes,
            part_bytes,
            frame_bytes,
        })
    }

    fn farm(&self) -> Farm {
        Farm {
            cores: self.cores,
            start_s: self.start,
            dispatch: self.dispatch,
            storage: self.storage,
            speed: self.speed,
            slow: self.slow,
            failures: self.failures,
            retry_s: self.retry,
            seed: self.seed,
        }
    }
}

/// Prints the table as it grows, writes the files.
pub(crate) fn run(args: &StudyFarmArgs) -> Result<()> {
    let (shot, farm) = (args.shot()?, args.farm());
    println!(
        "| machines | task | cut into | delivered after | of which merge | waiting for the last | not samples | machine hours |"
    );
    println!("|-|-|-|-|-|-|-|-|");
    let mut chosen = Vec::new();
    for &machines in &args.machines {
        let d = best(&shot, &farm, machines as usize, &args.tasks)?;
        println!("{}", row(&d));
        chosen.push(d);
    }
    let Some(folder) = &args.output else { return Ok(()) };
    let mut all = Vec::new();
    let counts = farm_plot::counts(args.machines.iter().copied().max().unwrap_or(1));
    for &task_s in &args.tasks {
        for &count in &counts {
            all.push(deliver(&shot, &farm, count, task_s)?);
        }
    }
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    file::write_whole(&folder.join("farm.csv"), csv(&all).as_bytes())?;
    file::write_whole(&folder.join("farm.svg"), farm_plot::draw(&all, &farm)?.as_bytes())?;
    println!("\n{0}/farm.csv, {0}/farm.svg: written", folder.display());
    Ok(())
}

fn row(d: &Delivery) -> String {
    let cut = match (d.division.parts, d.division.frames_per_task) {
        (1, 1) => "frames".to_owned(),
        (1, n) => format!("{n} frames"),
        (n, _) => format!("{n} tiles of a frame"),
    };
    format!(
        "| {} | {} | {cut} | {} | {} | {} | {:.0} % | {:.0} |",
        d.machines,
        super::plan::duration(d.task_s),
        super::plan::duration(d.total_s),
        super::plan::duration(d.total_s - d.rendered_s),
        super::plan::duration(d.tail_s),
        100.0 * d.overhead,
        d.machine_hours,
    )
}

fn csv(all: &[Delivery]) -> String {
    let mut out = String::from(
        "machines,task_s,parts,frames_per_task,slicing,total_s,rendered_s,tail_s,overhead,machine_hours\n",
    );
    for d in all {
        let slicing = if d.division.slicing == Slicing::Tiles { "tiles" } else { "runs" };
        let _ = writeln!(
            out,
            "{},{},{},{},{slicing},{:.3},{:.3},{:.3},{:.5},{:.3}",
            d.machines,
            d.task_s,
            d.division.parts,
            d.division.frames_per_task,
            d.total_s,
            d.rendered_s,
            d.tail_s,
            d.overhead,
            d.machine_hours
        );
    }
    out
}
