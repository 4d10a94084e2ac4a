//! `graeco plan`.

use super::shot_args::ShotArgs;
use clap::Args;
use graeco::Result;
use graeco::render::Shot;

/// Arguments of `graeco plan`.
#[derive(Debug, Clone, Args)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    /// Frame to plan for
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) frame: i64,

    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Plans; gives the text to print.
pub(crate) fn run(args: &PlanArgs) -> Result<String> {
    let settings = args.shot.settings();
    let scene = args.shot.load()?;
    let environment = args.shot.environment()?;
    let surroundings = args.shot.surroundings(&scene, environment.as_ref());
    let shot = Shot::new(&scene, &settings, &surroundings, "")?;
    let plans = shot.plan(args.frame)?;
    if args.json {
        let list: Vec<_> = plans
            .iter()
            .map(|(effects, design)| {
                serde_json::json!({
                    "effects": effects,
                    "factors": design.factors().iter().map(ToString::to_string).collect::<Vec<_>>(),
                    "design": design.kind().to_string(),
                    "dither": design.dither().to_string(),
                    "runs": design.runs(),
                    "reason": design.reason(),
                })
            })
            .collect();
        return Ok(serde_json::json!({ "frame": args.frame, "exposures": list }).to_string());
    }
    let mut lines = Vec::new();
    for (index, (effects, design)) in plans.iter().enumerate() {
        if plans.len() > 1 {
            lines.push(format!("field {} of frame {}", index + 1, args.frame));
        } else {
            lines.push(format!("frame {}", args.frame));
        }
        lines.push(effects.to_string());
        let factors: Vec<String> = design.factors().iter().map(ToString::to_string).collect();
        lines.push(format!("factors: {} ({})", factors.len(), factors.join(", ")));
        lines.push(format!("design:  {}, {} runs a pixel; {}", design.kind(), design.runs(), design.reason()));
        lines.push(format!("dither:  {}", design.dither()));
    }
    Ok(lines.join("\n"))
}
