//! Texture filters: error against seconds on a tilted checker, seen directly and in a mirror.
//!
//! The reference reads textures at full resolution with many runs: what the pixel's own filter makes of them, with no
//! other filter before it. Curves, intervals and seconds are those of [`super::cost`].

use super::cost::pictures::narrow;
use super::cost::plots::{Cost, Measure, plot};
use super::cost::reference::Reference;
use super::cost::statistics::{Curve, curves};
use super::cost::{Contender, Measurement, Rendered, Subject};
use super::poster::{LETTER, LINE, Poster};
use crate::design::{Dither, Kind};
use crate::output::view::View;
use crate::render::Settings;
use crate::scene::texture::TexelFilter;
use crate::scene::{
    Camera, Image, Lens, LocalTransform, Material, Mesh, Node, Pixels, Projection, Scene, Texture, TextureRef, Wrap,
};
use crate::trace::texture::TextureFilter;
use crate::{Error, Result};
use glam::{Affine2, DAffine3, DVec3, Vec2, Vec3};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// The filters with their names.
pub const FILTERS: [(&str, TextureFilter); 5] = [
    ("point", TextureFilter::Point),
    ("mip", TextureFilter::Mip),
    ("stochastic", TextureFilter::Stochastic),
    ("stochastic-ewa", TextureFilter::StochasticEwa),
    ("ewa", TextureFilter::Ewa),
];

/// How much to measure.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Effort {
    /// Runs a pixel, ascending.
    pub runs: Vec<u32>,
    /// Independent seeds.
    pub seeds: u32,
    /// Runs a pixel of each half of the reference.
    pub reference_runs: u32,
}

/// One scene's measurements.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// What was looked at.
    pub name: String,
    /// Every picture.
    pub measurements: Vec<Measurement>,
    /// Error against cost, by filter.
    pub curves: Vec<Curve>,
    /// The reference's own relMSE, which was subtracted.
    pub reference_rel_mse: Option<f64>,
    /// One picture of every filter, at the fewest runs but one.
    #[serde(skip)]
    shown: Vec<(String, Rendered)>,
    #[serde(skip)]
    reference: Reference,
}

/// Measures every filter on a frame, the filters taking turns.
///
/// # Errors
/// If the settings do not fit the scene.
pub fn study(name: &str, subject: &Subject<'_>, effort: &Effort, say: &mut dyn FnMut(&Measurement)) -> Result<Study> {
    let with = |filter| Settings { texture_filter: filter, ..subject.settings.clone() };
    let sharp = with(TextureFilter::Point);
    let reference = Subject { settings: &sharp, ..*subject }.reference(effort.reference_runs)?;
    let auto = Contender { design: Kind::Auto, dither: Dither::NONE };
    let shown_runs = *effort.runs.get(1).or(effort.runs.first()).unwrap_or(&4);
    let (mut measurements, mut shown) = (Vec::new(), Vec::new());
    for index in 0..effort.seeds {
        for &runs in &effort.runs {
            for (filter_name, filter) in FILTERS {
                let settings = with(filter);
                let seed = settings.sampling.seed.wrapping_add(u64::from(index));
                let picture = Subject { settings: &settings, ..*subject }.render(auto, runs, seed)?;
                let measurement = Measurement {
                    name: filter_name.to_owned(),
                    runs,
                    seed,
                    samples: picture.samples,
                    rays: picture.rays,
                    seconds: picture.seconds,
                    wall_s: picture.wall_s,
                    build_s: picture.build_s,
                    errors: reference.errors(&picture)?,
                };
                say(&measurement);
                measurements.push(measurement);
                if index == 0 && runs == shown_runs {
                    shown.push((format!("{filter_name}, {runs} runs"), picture));
                }
            }
        }
    }
    let curves = curves(&measurements, &[]);
    let reference_rel_mse = reference.own_rel_mse();
    Ok(Study { name: name.to_owned(), measurements, curves, reference_rel_mse, shown, reference })
}

/// relMSE of `curve` after `seconds`, along straight lines between the logarithms of its points, continued at the ends;
/// `None` where it has fewer than two.
#[must_use]
pub fn at_seconds(curve: &Curve, seconds: f64) -> Option<f64> {
    let points: Vec<[f64; 2]> = curve
        .points
        .iter()
        .filter(|p| p.rel_mse.mean > 0.0 && p.seconds.mean > 0.0)
        .map(|p| [libm::log(p.seconds.mean), libm::log(p.rel_mse.mean)])
        .collect();
    let x = libm::log(seconds);
    let last = points.len().checked_sub(2)?;
    let i = points.iter().skip(1).take(last).filter(|p| p[0] < x).count();
    let ([x0, y0], [x1, y1]) = (points[i], points[i + 1]);
    Some(libm::exp(y0 + (y1 - y0) * (x - x0) / (x1 - x0)))
}

impl Study {
    /// relMSE, FLIP and seconds by filter and runs, and relMSE at equal time: after the seconds that the stochastic filter
    /// takes. Markdown.
    #[must_use]
    pub fn table(&self) -> String {
        let mut out = format!(
            "{}\n\n| runs | filter | seconds | relMSE | FLIP | relMSE at equal time |\n|-|-|-|-|-|-|\n",
            self.name
        );
        let stochastic = self.curves.iter().find(|c| c.name == "stochastic");
        for i in 0..self.curves.first().map_or(0, |c| c.points.len()) {
            for curve in &self.curves {
                let p = &curve.points[i];
                let equal = stochastic.and_then(|s| at_seconds(curve, s.points[i].seconds.mean));
                let _ = writeln!(
                    out,
                    "| {} | {} | {:.4} | {:.3e} | {:.4} | {} |",
                    p.runs,
                    curve.name,
                    p.seconds.mean,
                    p.rel_mse.mean,
                    p.flip.mean,
                    equal.map_or_else(String::new, |e| format!("{e:.3e}"))
                );
            }
        }
        out
    }

    /// Writes NAME.csv, NAME.json, NAME.svg (relMSE against seconds) and NAME.png (the filters' pictures beside the
    /// reference) into `folder`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn save(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let save = |kind: &str, bytes: &[u8]| {
            let path = folder.join(format!("{}.{kind}", self.name));
            std::fs::write(&path, bytes).map_err(|e| Error::io(&path, "write", e))
        };
        let mut csv = String::from("filter,runs,seed,seconds,rmse,rel_mse,flip\n");
        for m in &self.measurements {
            let e = &m.errors;
            let _ = writeln!(
                csv,
                "{},{},{},{:.6},{:e},{:e},{:.6}",
                m.name, m.runs, m.seed, m.seconds, e.rmse, e.rel_mse, e.flip
            );
        }
        let json = serde_json::to_string_pretty(self)
            .map_err(|e| Error::invalid(&self.name, format!("cannot be written as JSON: {e}")))?;
        save("csv", csv.as_bytes())?;
        save("json", json.as_bytes())?;
        save("svg", plot(&self.curves, Cost::Seconds, Measure::RelMse)?.as_bytes())?;
        save("png", &self.strip()?)
    }

    /// The reference and one picture of every filter, each with its name.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes from 0 to 255")]
    fn strip(&self) -> Result<Vec<u8>> {
        const GAP: usize = 8;
        let width = self.reference.width;
        let height = self.reference.rgb.len() / width.max(1);
        let codes = |rgb: &[[f32; 3]]| -> Vec<[u8; 3]> {
            rgb.iter().map(|&p| View::default().encode(p).to_array().map(|c| (c * 255.0 + 0.5) as u8)).collect()
        };
        let mut pictures = vec![("reference".to_owned(), codes(&narrow(&self.reference)))];
        pictures.extend(self.shown.iter().map(|(name, p)| (name.clone(), codes(&p.rgb))));
        let pitch = width.max(20 * LETTER) + GAP;
        let mut poster = Poster::new(pictures.len() * pitch + GAP, height + LINE + 2 * GAP, [255; 3]);
        for (i, (name, codes)) in pictures.iter().enumerate() {
            let x = GAP + i * pitch;
            poster.paste(codes, width, [x, GAP], 1);
            poster.write(name, [x, GAP + height], [20; 3]);
        }
        poster.png()
    }
}

/// Which of the built-in scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checker {
    /// A checkered floor up to the horizon.
    Tilted,
    /// The same floor, seen in a mirror that fills the picture.
    Mirrored,
}

/// The scene: a floor of 40 × 40 m, one metre below the eye, whose texture of 256 × 256 texels repeats every metre, with
/// checks of 32 texels in two colours. It needs no light: the floor is unlit.
#[must_use]
pub fn checker(which: Checker) -> Scene {
    let texels = (0..256_u32).flat_map(|y| (0..256_u32).map(move |x| (x / 32 + y / 32) % 2));
    let pixels = texels.map(|odd| if odd == 1 { [235, 226, 200, 255] } else { [30, 52, 110, 255] }).collect();
    let linear = TexelFilter::Linear;
    let floor = Material {
        base_color_texture: Some(TextureRef {
            texture: 0,
            uv_set: 0,
            transform: Affine2::from_scale(Vec2::splat(40.0)),
        }),
        unlit: true,
        double_sided: true,
        ..Material::default()
    };
    let mirror = Material { roughness: 0.0, double_sided: true, ..Material::default() };
    let square = |material: usize, positions: [Vec3; 4]| Mesh {
        material,
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        positions: positions.to_vec(),
        uvs: vec![vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y]],
        ..Mesh::default()
    };
    let along = match which {
        Checker::Tilted => -1.0,
        Checker::Mirrored => 1.0,
    };
    let corner = |x: f32, z: f32| Vec3::new(20.0 * x, -1.0, along * (1.5 + 40.0 * z));
    let mut meshes = vec![square(0, [corner(-1.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(-1.0, 1.0)])];
    if which == Checker::Mirrored {
        let at = |x: f32, y: f32| Vec3::new(4.0 * x, 4.0 * y, -1.0);
        meshes.push(square(1, [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]));
    }
    let down = DAffine3::from_rotation_x(-0.25);
    let eye = LocalTransform::Matrix(DAffine3::from_translation(DVec3::ZERO) * down);
    let camera = Node { camera: Some(0), visible: true, local: eye, ..Node::default() };
    let things = Node { meshes: (0..meshes.len()).collect(), visible: true, ..Node::default() };
    Scene {
        path: "checker".into(),
        nodes: vec![camera, things],
        order: vec![0, 1],
        meshes,
        materials: vec![floor, mirror],
        textures: vec![Texture { image: 0, wrap: [Wrap::Repeat; 2], magnify: linear, minify: linear, mipmapped: true }],
        images: vec![Image { name: String::new(), width: 256, height: 256, pixels: Pixels::Rgba8(pixels) }],
        cameras: vec![Camera {
            name: String::new(),
            projection: Projection::Perspective { yfov: 0.9, aspect: None },
            near_far: (0.01, None),
            lens: Lens::default(),
        }],
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::cost::statistics::{CurvePoint, Interval};

    #[test]
    fn error_at_a_time_lies_on_the_line_through_its_neighbours() {
        let at = |mean: f64| Interval { mean, low: mean, high: mean };
        let point = |s: f64| {
            let [seconds, error] = [s, 1.0 / s].map(at);
            CurvePoint { runs: 1, samples: 1.0, seconds, rmse: error, rel_mse: error, flip: error }
        };
        let points = [1.0, 4.0, 16.0].map(point).to_vec();
        let curve = Curve { name: String::new(), points, slope_samples: None, slope_seconds: None, reach: Vec::new() };
        for s in [0.5, 1.0, 2.0, 8.0, 16.0, 40.0] {
            assert!((at_seconds(&curve, s).unwrap() * s - 1.0).abs() < 1e-9, "{s}");
        }
    }
}
