//! `graeco study cost`: what accuracy costs in seconds, by design and by effect.

use super::shot_args::ShotArgs;
use graeco::design::{Dither, Kind, Mask};
use graeco::output::read;
use graeco::render::{Settings, Surroundings};
use graeco::scene::Environment;
use graeco::study::cost::reference::Reference;
use graeco::study::cost::report::{Price, Report};
use graeco::study::cost::without::{Effect, add_sun};
use graeco::study::cost::{self, Contender, Effort, Measurement, Subject};
use graeco::trace::environment::Background;
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
    /// Runs a pixel to measure at, separated by commas
    #[arg(long = "runs", short = 'n', value_name = "LIST", value_delimiter = ',', default_value = "4,16,64,256",
          value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    pub(crate) runs_list: Vec<u32>,
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
    let prices = if args.no_effects { Vec::new() } else { args.prices(&settings, &effort, environment.as_ref())? };
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
        let mut runs = self.runs_list.clone();
        runs.sort_unstable();
        runs.dedup();
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
    fn prices(&self, settings: &Settings, effort: &Effort, environment: Option<&Environment>) -> Result<Vec<Price>> {
        let there = self.effects_there(settings, environment)?;
        let mut variants: Vec<Vec<Effect>> = vec![Vec::new()];
        variants.extend(there.iter().map(|&e| vec![e]));
        if there.len() > 1 {
            variants.push(there);
        }
        let contenders = vec![Contender { design: self.shot.design, dither: self.shot.dither }];
        let effort = Effort { contenders, ..effort.clone() };
        variants.into_iter().map(|without| self.price(settings, &effort, environment, without)).collect()
    }

    /// Effects that the frame samples.
    fn effects_there(&self, settings: &Settings, environment: Option<&Environment>) -> Result<Vec<Effect>> {
        let scene = self.shot.load()?;
        let surroundings = self.shot.surroundings(&scene, environment);
        let shot = graeco::render::Shot::new(&scene, settings, &surroundings, "")?;
        let plans = shot.plan(self.frame)?;
        let any = |test: &dyn Fn(&graeco::effects::EffectsPlan) -> bool| plans.iter().any(|(p, _)| test(p));
        let shows = |effect: &Effect| match effect {
            Effect::Time => any(&|p| p.samples_time()),
            Effect::Lens => any(&|p| p.samples_lens()),
            Effect::Light => any(&|p| p.has_extended_light()),
            Effect::Gloss => any(&|p| p.samples_gloss()),
        };
        Ok(Effect::ALL.into_iter().filter(shows).collect())
    }

    fn price(
        &self,
        settings: &Settings,
        effort: &Effort,
        environment: Option<&Environment>,
        without: Vec<Effect>,
    ) -> Result<Price> {
        let (mut scene, mut settings) = (self.shot.load()?, settings.clone());
        let light = match self.shot.surroundings(&scene, environment).background {
            Background::Black => None,
            Background::Constant(c) => Some(c),
            Background::Gradient { horizon, .. } => Some(horizon),
            // A sun as bright as a white sky: of a picture only the order of magnitude matters here.
            Background::Picture(picture) => Some(glam::Vec3::splat(picture.strength)),
        };
        for effect in &without {
            effect.leave_out(&mut scene, &mut settings);
        }
        let dark = without.contains(&Effect::Light);
        if let Some(radiance) = light.filter(|_| dark) {
            add_sun(&mut scene, radiance * std::f32::consts::PI);
        }
        let surroundings = if dark {
            Surroundings { background: Background::Black, name: String::new() }
        } else {
            self.shot.surroundings(&scene, environment)
        };
        let subject = Subject { scene: &scene, settings: &settings, surroundings: &surroundings, frame: self.frame };
        let reference = subject.reference(effort.reference_runs)?;
        let price = |study| Price { without: without.clone(), study };
        let name = Price::name_of(&without);
        if reference.rgb.iter().flatten().all(|v| *v <= 0.0) {
            return Err(Error::invalid(
                format!("the scene {name}"),
                "is black: nothing can be measured (--no-effects)",
            ));
        }
        Ok(price(cost::study(&subject, effort, &|_| name.clone(), reference, &mut row)?))
    }
}
