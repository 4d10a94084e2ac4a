//! `graeco study cost`: what accuracy costs in seconds, by design and by effect.

use super::shot_args::ShotArgs;
use graeco::design::{Dither, Kind, Mask};
use graeco::output::read;
use graeco::study::cost::reference::Reference;
use graeco::study::cost::report::{Price, Report};
use graeco::study::cost::without::{Effect, Without};
use graeco::study::cost::{self, Contender, Effort, Measurement, Subject};
use graeco::{Error, Result};
use std::path::PathBuf;

/// Measure error against seconds, by design and by effect, and write a report
#[derive(Debug, clap::Args)]
pub(crate) struct StudyCostArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,
    /// Frame to study, 240x135 pixels unless --size says otherwise
    #[arg(long, value_name = "N", default_value_t = 0, allow_hyphen_values = true)]
    pub(crate) frame: i64,
    /// Designs, by name, separated by commas; all: every one that the runs allow
    #[arg(long, value_name = "all|LIST", default_value = "all", value_parser = parse_designs)]
    pub(crate) designs: Designs,
    /// Structures between pixels to combine every design with, separated by commas [default: --dither's; none where that is auto, but for the design auto]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(crate) dithers: Vec<Dither>,
    /// Runs a pixel to measure at: 4,16,64, or from..to by powers of four
    #[arg(long = "runs", short = 'n', value_name = "LIST|FROM..TO", default_value = "4..256", value_parser = parse_runs)]
    pub(crate) runs_list: RunsList,
    /// Independent seeds
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(2..=1024))]
    pub(crate) seeds: u32,
    /// Judge by this picture (.exr) instead of a reference made for the purpose
    #[arg(long, value_name = "FILE.exr", conflicts_with = "reference_runs")]
    pub(crate) reference: Option<PathBuf>,
    /// Runs a pixel of each half of the reference [default: four times the most runs measured]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 22))]
    pub(crate) reference_runs: Option<u32>,
    /// Errors (relMSE) to which the seconds are asked, separated by commas; effects are priced at the first
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "1e-3,1e-4", value_parser = super::shot_args::positive)]
    pub(crate) reach: Vec<f64>,
    /// Leave out the prices of effects
    #[arg(long)]
    pub(crate) no_effects: bool,
    /// Folder for report.html, cost.csv, cost.json and the plots
    #[arg(short, long)]
    pub(crate) output: PathBuf,
}

/// What `--designs` names.
#[derive(Debug, Clone)]
pub(crate) struct Designs(Vec<Kind>);

/// What `--runs` names, ascending.
#[derive(Debug, Clone)]
pub(crate) struct RunsList(Vec<u32>);

/// `4,16,64` or `4..1024`.
fn parse_runs(text: &str) -> std::result::Result<RunsList, String> {
    const MOST: u32 = 1 << 20;
    let expected = || format!("expected numbers from 1 to {MOST} such as 4,16,64, or a range such as 4..1024");
    let number = |t: &str| t.trim().parse::<u32>().ok().filter(|n| (1..=MOST).contains(n)).ok_or_else(expected);
    if let Some((from, to)) = text.split_once("..") {
        let (from, to) = (number(from)?, number(to)?);
        if from > to {
            return Err(expected());
        }
        let mut runs: Vec<u32> =
            std::iter::successors(Some(from), |n| n.checked_mul(4)).take_while(|&n| n <= to).collect();
        if runs.last() != Some(&to) {
            runs.push(to);
        }
        return Ok(RunsList(runs));
    }
    let mut runs: Vec<u32> = text.split(',').map(number).collect::<std::result::Result<_, _>>()?;
    runs.sort_unstable();
    runs.dedup();
    Ok(RunsList(runs))
}

fn parse_designs(text: &str) -> std::result::Result<Designs, String> {
    if text == "all" {
        return Ok(Designs(Kind::ALL.to_vec()));
    }
    let kinds: std::result::Result<Vec<Kind>, _> = text.split(',').map(|name| name.trim().parse::<Kind>()).collect();
    kinds.map(Designs).map_err(|e| e.to_string())
}

/// Measures, prints the rows as they are finished, writes the files.
pub(crate) fn run(args: &StudyCostArgs) -> Result<()> {
    let mut settings = args.shot.settings();
    if args.shot.size.is_none() && args.shot.video.is_none() {
        settings.size = (240, 135);
        settings.view.size = settings.size;
    }
    settings.aovs.clear();
    args.shot.set_threads()?;
    let effort = args.effort();
    let environment = args.shot.environment()?;
    let scene = args.shot.load()?;
    let surroundings = args.shot.surroundings(&scene, environment.as_ref());
    let subject = Subject { scene: &scene, settings: &settings, surroundings: &surroundings, frame: args.frame };
    let (reference, from) = match &args.reference {
        Some(path) => (Reference::of_file(&read::read(path)?), path.display().to_string()),
        None => {
            let runs = effort.reference_runs;
            (subject.reference(runs)?, format!("two halves of {runs} samples a pixel, with seeds of their own"))
        }
    };
    let error = match reference.own_rel_mse() {
        Some(own) => format!("{from}; its own relMSE, {own:.2e}, is subtracted"),
        None => format!("{from}; its own error is not known and not subtracted"),
    };
    println!("Reference: {error}\n");
    println!("{:34} {:>6} {:>5} {:>9} {:>11} {:>11} {:>8}", "", "runs", "seed", "seconds", "RMSE", "relMSE", "FLIP");
    let designs = cost::study(&subject, &effort, &|c| c.name(), reference, &mut row)?;
    let prices = if args.no_effects { Vec::new() } else { args.prices(&subject, &effort)? };
    let file = args.shot.scene.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let report = Report {
        scene: file,
        frame: args.frame,
        size: settings.size,
        threads: rayon::current_num_threads(),
        reference: error,
        effort,
        designs,
        prices,
    };
    report.save(&args.output)?;
    summary(&report);
    println!("\n{}: written", args.output.join("report.html").display());
    Ok(())
}

fn row(m: &Measurement) {
    let e = &m.errors;
    println!(
        "{:34} {:>6} {:>5} {:>9.4} {:>11.3e} {:>11.3e} {:>8.4}",
        m.name, m.runs, m.seed, m.seconds, e.rmse, e.rel_mse, e.flip
    );
}

fn summary(report: &Report) {
    let whole = report.designs.curves.iter().map(|c| (c.name.clone(), c));
    let priced = report.prices.iter().flat_map(|p| p.study.curves.iter().map(|c| (p.name(), c)));
    println!("\n{:34} {:>22}  seconds to relMSE (95 %)", "", "slope (95 %)");
    for (name, curve) in whole.chain(priced) {
        let slope = curve.slope_samples.map_or("-".into(), |s| format!("{:.2} [{:.2}, {:.2}]", s.mean, s.low, s.high));
        let reach: Vec<String> = curve
            .reach
            .iter()
            .map(|r| {
                let beyond = if r.extrapolated { "*" } else { "" };
                let s = &r.seconds;
                format!("{:.0e}: {:.3}{beyond} [{:.3}, {:.3}]", r.rel_mse, s.mean, s.low, s.high)
            })
            .collect();
        println!("{name:34} {slope:>22}  {}", reach.join("   "));
    }
    println!("* continued beyond what was measured");
}

impl StudyCostArgs {
    fn effort(&self) -> Effort {
        let runs = self.runs_list.0.clone();
        let dithers = if self.dithers.is_empty() { vec![self.shot.dither] } else { self.dithers.clone() };
        // What the program chooses by itself between pixels, up to 4 runs, replaces the design: then all would be one.
        let fit = |design: Kind, dither: Dither| match (design, dither.mask) {
            (Kind::Auto, _) => dither,
            (_, Mask::Auto) => Dither::NONE,
            _ => dither,
        };
        let contenders = dithers
            .iter()
            .flat_map(|&dither| self.designs.0.iter().map(move |&d| Contender { design: d, dither: fit(d, dither) }))
            .collect();
        let most = runs.last().copied().unwrap_or(1);
        Effort {
            contenders,
            runs,
            seeds: self.seeds,
            reference_runs: self.reference_runs.unwrap_or(most.saturating_mul(4)),
            reach: self.reach.clone(),
        }
    }

    /// The scene whole, without each effect that it has, and without all of them; by the design and dither asked for.
    fn prices(&self, subject: &Subject<'_>, effort: &Effort) -> Result<Vec<Price>> {
        let Subject { scene, settings, surroundings, frame } = *subject;
        let there = Effect::of_frame(scene, settings, surroundings, frame)?;
        let contenders = vec![Contender { design: self.shot.design, dither: self.shot.dither }];
        let effort = Effort { contenders, ..effort.clone() };
        variants(&there).into_iter().map(|without| price(subject, &effort, without)).collect()
    }
}

/// Nothing left out, each effect alone, and all together.
fn variants(there: &[Effect]) -> Vec<Vec<Effect>> {
    let mut variants: Vec<Vec<Effect>> = vec![Vec::new()];
    variants.extend(there.iter().map(|&e| vec![e]));
    if there.len() > 1 {
        variants.push(there.to_vec());
    }
    variants
}

fn price(subject: &Subject<'_>, effort: &Effort, without: Vec<Effect>) -> Result<Price> {
    let rest = Without::new(subject.scene, subject.settings, subject.surroundings, &without);
    let subject =
        Subject { scene: &rest.scene, settings: &rest.settings, surroundings: &rest.surroundings, ..*subject };
    let reference = subject.reference(effort.reference_runs)?;
    let name = Price::name_of(&without);
    if reference.rgb.iter().flatten().all(|v| *v <= 0.0) {
        return Err(Error::invalid(format!("the scene {name}"), "is black: nothing can be measured (--no-effects)"));
    }
    let study = cost::study(&subject, effort, &|_| name.clone(), reference, &mut row)?;
    Ok(Price { without, study })
}
