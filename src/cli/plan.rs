//! `graeco plan`.

use super::adaptive_args::AdaptiveArgs;
use super::shot_args::{ShotArgs, not_negative};
use super::view_args::ViewArgs;
use clap::Args;
use graeco::Result;
use graeco::design::{Design, Factor, PixelAddress};
use graeco::effects::EffectsPlan;
use graeco::output::View;
use graeco::render::{Adaptive, BlurExtent, Forecast, FrameList, Shot};
use graeco::study::savings::{Saving, savings};
use serde_json::{Value, json};

/// Arguments of `graeco plan`.
#[derive(Debug, Clone, Args)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    #[command(flatten)]
    pub(crate) adaptive: AdaptiveArgs,

    #[command(flatten)]
    pub(crate) shown: ViewArgs,

    /// Frame to plan for
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) frame: i64,

    /// Seconds to spend on estimating how long rendering takes, from small parts of the picture, half of them for the frame
    /// and half for the sequence, and half as much again for what each effect costs; 0 estimates nothing
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, value_parser = not_negative)]
    pub(crate) measure: f64,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// The plan of one exposure.
struct Exposure {
    effects: EffectsPlan,
    design: Design,
    extent: BlurExtent,
}

/// What rendering is expected to take.
struct Times {
    frame: Forecast,
    /// Frames of the animation, and seconds for all of them.
    sequence: (usize, f64),
    /// Frames that were measured for the sequence, the planned one included.
    measured: usize,
    /// What the frame would take without its effects.
    savings: Vec<Saving>,
}

/// Plans; gives the text to print.
pub(crate) fn run(args: &PlanArgs) -> Result<String> {
    let mut settings = args.shot.settings();
    settings.adaptive = args.adaptive.adaptive(args.shown.over(View::default()));
    args.shot.set_threads()?;
    let scene = args.shot.load()?;
    let environment = args.shot.environment()?;
    let surroundings = args.shot.surroundings(&scene, environment.as_ref());
    let mut shot = Shot::new(&scene, &settings, &surroundings, "")?;
    let plans = shot.plan(args.frame)?;
    let (extents, first) = shot.forecast(args.frame, args.measure / 4.0)?;
    let frames = FrameList::of_animation(shot.span(), settings.rate);
    let times = if args.measure > 0.0 {
        let sequence = estimate_sequence(&mut shot, frames.frames(), args.measure / 2.0)?;
        // A machine's speed wanders from one second to the next: two looks at the frame, apart, are worth more than one.
        let frame = first.mean(shot.forecast(args.frame, args.measure / 4.0)?.1);
        drop(shot);
        let savings = savings(&scene, &settings, &surroundings, args.frame, &frame, args.measure / 2.0)?;
        let (measured, seconds) = sequence.unwrap_or((1, frame.seconds()));
        Some(Times { frame, sequence: (frames.frames().len().max(1), seconds), measured, savings })
    } else {
        None
    };
    let exposures: Vec<Exposure> = plans
        .into_iter()
        .zip(extents)
        .map(|((effects, design), extent)| Exposure { effects, design, extent })
        .collect();
    Ok(if args.json {
        as_json(args.frame, &exposures, settings.adaptive, times.as_ref()).to_string()
    } else {
        as_text(args.frame, &exposures, settings.adaptive, times.as_ref())
    })
}

/// Looks at frames spread over the animation: how many, and seconds for all of it. `None` where it has one frame alone.
fn estimate_sequence(shot: &mut Shot<'_>, frames: &[i64], budget_s: f64) -> Result<Option<(usize, f64)>> {
    /// More do not sharpen the mean of what changes smoothly.
    const LOOKED_AT: usize = 5;
    if frames.len() <= 1 {
        return Ok(None);
    }
    let chosen = frames.len().min(LOOKED_AT);
    let mut sum = 0.0;
    for i in 0..chosen {
        // The middles of equal parts.
        let number = frames[(2 * i + 1) * frames.len() / (2 * chosen)];
        #[allow(clippy::cast_precision_loss, reason = "at most five")]
        let (_, forecast) = shot.forecast(number, budget_s / chosen as f64)?;
        sum += forecast.seconds();
    }
    #[allow(clippy::cast_precision_loss, reason = "at most 16 million frames")]
    let seconds = sum / chosen as f64 * frames.len() as f64;
    Ok(Some((chosen, seconds)))
}

/// Runs and the strata in which they fall, for one factor of one pixel: counted, not claimed.
fn strata(design: &Design, factor: Factor) -> usize {
    let pixel = design.pixel(PixelAddress { x: 0, y: 0, frame: 0, field: 0 });
    let runs = design.runs();
    let mut seen = vec![false; runs as usize];
    for run in 0..runs {
        let stratum = f64::from(pixel.point(run).get(factor)) * f64::from(runs);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to runs")]
        let stratum = (stratum as usize).min(seen.len() - 1);
        seen[stratum] = true;
    }
    seen.iter().filter(|s| **s).count()
}

fn as_json(frame: i64, exposures: &[Exposure], adaptive: Option<Adaptive>, times: Option<&Times>) -> Value {
    let list: Vec<Value> = exposures
        .iter()
        .map(|e| {
            let factors: Vec<Value> = e
                .design
                .factors()
                .iter()
                .map(|&f| json!({ "factor": f.to_string(), "runs": e.design.runs(), "strata": strata(&e.design, f) }))
                .collect();
            json!({
                "effects": e.effects,
                "blur": e.extent,
                "factors": factors,
                "design": e.design.kind().to_string(),
                "dither": e.design.dither().to_string(),
                "runs": e.design.runs(),
                "reason": e.design.reason(),
            })
        })
        .collect();
    let estimate = times.map(|t| {
        json!({
            "frame": t.frame,
            "frame_s": t.frame.seconds(),
            "sequence_frames": t.sequence.0,
            "sequence_s": t.sequence.1,
            "frames_measured": t.measured,
            "effects": t.savings,
        })
    });
    json!({ "frame": frame, "exposures": list, "adaptive": adaptive, "estimate": estimate })
}

fn as_text(frame: i64, exposures: &[Exposure], adaptive: Option<Adaptive>, times: Option<&Times>) -> String {
    let mut lines = Vec::new();
    for (index, e) in exposures.iter().enumerate() {
        lines.push(if exposures.len() > 1 {
            format!("field {} of frame {frame}", index + 1)
        } else {
            format!("frame {frame}")
        });
        lines.push(e.effects.time_line() + &motion_text(e));
        let blur = if e.effects.samples_lens() {
            format!(", at most {:.1} px out of focus", e.extent.defocus_px)
        } else {
            String::new()
        };
        lines.push(e.effects.lens_line() + &blur);
        lines.push(e.effects.light_line());
        lines.push(e.effects.gloss_line());
        lines.push(design_line(&e.design, adaptive.is_some()));
        lines.push(format!("dither:  {}", e.design.dither()));
        lines.push(format!("factors: {}; every run draws all of them", e.design.factors().len()));
        lines.extend(strata_lines(&e.design));
    }
    if let Some(t) = times {
        lines.extend(times_text(t));
    }
    lines.join("\n")
}

fn design_line(design: &Design, stops_by_itself: bool) -> String {
    let (kind, runs) = (design.kind(), design.runs());
    if stops_by_itself {
        format!("design:  {kind}, at most {runs} runs a pixel: as many as it needs, a power of two")
    } else {
        format!("design:  {kind}, {runs} runs a pixel; {}", design.reason())
    }
}

/// Factors that fall in as many strata, together.
fn strata_lines(design: &Design) -> Vec<String> {
    let mut groups: Vec<(usize, Vec<String>)> = Vec::new();
    for &factor in design.factors() {
        let count = strata(design, factor);
        match groups.iter_mut().find(|g| g.0 == count) {
            Some(group) => group.1.push(factor.to_string()),
            None => groups.push((count, vec![factor.to_string()])),
        }
    }
    let runs = design.runs();
    let line = |(count, names): &(usize, Vec<String>)| {
        format!("         {runs} runs in {count} of {runs} strata: {}", names.join(", "))
    };
    groups.iter().map(line).collect()
}

fn motion_text(e: &Exposure) -> String {
    match (e.effects.samples_time(), e.extent.motion_node.as_str()) {
        (false, _) => String::new(),
        (true, "") => format!(", at most {:.1} px", e.extent.motion_px),
        (true, node) => format!(", at most {:.1} px ({node})", e.extent.motion_px),
    }
}

fn times_text(t: &Times) -> Vec<String> {
    let (f, (frames, all)) = (&t.frame, t.sequence);
    #[allow(clippy::cast_precision_loss, reason = "a share to be shown")]
    let share = 100.0 * f.samples_tried as f64 / f.samples.max(1) as f64;
    let mut lines = vec![
        format!("time to render (an estimate from {share:.1} % of the samples, for this machine as it is loaded now):",),
        format!(
            "         frame     {} ± {} ({} to build, {} samples)",
            duration(f.seconds()),
            duration(f.standard_error_s),
            duration(f.build_s),
            f.samples
        ),
        match frames {
            1 => format!("         sequence  {} for its one frame", duration(all)),
            _ => format!("         sequence  {} for {frames} frames, from {} of them", duration(all), t.measured),
        },
    ];
    if !t.savings.is_empty() {
        lines.push("what each effect costs (estimates of the frame without it):".to_owned());
        lines.extend(t.savings.iter().map(saving_line));
    }
    lines
}

/// `time  0.61 s of the frame at the same runs; 2.19 s to the same error`.
fn saving_line(saving: &Saving) -> String {
    let names: Vec<&str> = saving.without.iter().map(|e| e.name()).collect();
    let cost = |seconds: f64| {
        if seconds < 0.0 { format!("nothing ({} less)", duration(-seconds)) } else { duration(seconds) }
    };
    let same_error = saving.saves_s_at_same_error.map_or("not known".to_owned(), cost);
    format!(
        "         {:22} {} at the same runs, {same_error} at the same error",
        names.join(" + "),
        cost(saving.saves_s)
    )
}

pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.2} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
