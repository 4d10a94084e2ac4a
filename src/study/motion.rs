//! How much blur is enough: one frame under many shutters, with what each does to motion and to noise.
//!
//! A moving thing is smeared over its streak during the exposure and unseen on the way to the next one. What is seen
//! as judder is the gap: the part of its way from frame to frame that no streak covers. A wider shutter closes the gap
//! and loses sharpness; where the streak is longer the same samples are noisier.

use crate::film::{Film, Lines};
use crate::output::{Metadata, Picture, PngOptions, png};
use crate::render::{Progress, Settings, Shot, Surroundings};
use crate::scene::motion::segment_at;
use crate::scene::rig::Rig;
use crate::scene::view::{View, node_named};
use crate::scene::{Instance, NodeId, Projection, Scene, Stage, StageCamera};
use crate::time::ShutterPhase;
use crate::{Error, Result};
use glam::{DVec2, Vec3, Vec3A};
use std::fmt::Write as _;
use std::path::Path;

/// What one shutter does to a frame.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Row {
    /// Where the exposure lies.
    pub phase: ShutterPhase,
    /// Shutter angle, degrees.
    pub angle: f64,
    /// The object that the followed point belongs to.
    pub object: String,
    /// Length of its streak, pixels: the point's way on the film during the exposure.
    pub streak_px: f64,
    /// Judder: how far that point goes from one exposure's middle to the next frame's, pixels.
    pub displacement_px: f64,
    /// Distance from where its streak ends to where the next frame's begins, pixels.
    pub gap_px: f64,
    /// Root of the mean variance of the picture's pixels, over the three channels, scene-linear.
    pub noise: f64,
    /// The same over the picture's mean radiance.
    pub relative_noise: f64,
    /// Samples that were left out because they were not finite.
    pub rejected: u64,
    /// Seconds that it took to render.
    pub seconds: f64,
}

/// The most points of an object that are followed.
const POINTS: usize = 48;
/// Instants of an exposure at which they are, at least and at most.
const INSTANTS: (usize, usize) = (32, 2048);

/// Renders frame `frame` of `settings` behind a shutter of `angle` degrees at `phase`, and measures it and the way of
/// `point`.
///
/// # Errors
/// As [`Shot::new`] and [`Shot::render`].
pub fn measure(
    scene: &Scene,
    settings: &Settings,
    surroundings: &Surroundings<'_>,
    frame: i64,
    point: Option<&Point>,
    (angle, phase): (f64, ShutterPhase),
) -> Result<(Row, Picture)> {
    let settings = Settings { shutter: Some(angle / 360.0), shutter_phase: phase, ..settings.clone() };
    let stages = stages(scene, &settings, frame)?;
    let ratio = settings.pixel_aspect.ratio();
    let way = point.and_then(|p| p.way(scene, &stages, settings.size, ratio)).unwrap_or_default();
    let mut shot = Shot::new(scene, &settings, surroundings, "study motion")?;
    let rendered = shot
        .render(frame, &Progress::default())?
        .ok_or_else(|| Error::invalid("study", "the rendering was interrupted"))?;
    let (noise, mean) = noise(&rendered.film);
    let metadata = Metadata {
        frame,
        rate: settings.rate,
        exposure: rendered.exposure,
        pixel_aspect: settings.pixel_aspect,
        order: settings.field_order(),
        passes: None,
        record: std::sync::Arc::clone(shot.record()),
    };
    let row = Row {
        phase,
        angle,
        object: point.map_or_else(|| "nothing moves".to_owned(), |p| name_of(scene, p.node)),
        streak_px: way.streak,
        displacement_px: way.displacement,
        gap_px: way.gap,
        noise,
        relative_noise: if mean > 0.0 { noise / mean } else { 0.0 },
        rejected: rendered.cost.rejected,
        seconds: rendered.cost.render_s,
    };
    Ok((row, Picture::from_film(&rendered.film, metadata)))
}

/// Root mean variance, and mean radiance, over pixels and channels; pixels whose variance nobody knows are left out.
fn noise(film: &Film) -> (f64, f64) {
    let known = || film.pixels().iter().filter(|p| p.variance.is_finite());
    let count = known().count().max(1);
    #[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
    let mean = |sum: f64| sum / (3.0 * count as f64);
    let total = |v: Vec3| f64::from(v.x) + f64::from(v.y) + f64::from(v.z);
    let variance = mean(known().map(|p| total(p.variance)).sum());
    (variance.sqrt(), mean(known().map(|p| total(p.radiance)).sum()))
}

/// The way of one point on the film, pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Way {
    streak: f64,
    displacement: f64,
    gap: f64,
}

/// A point of an object that is followed through a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Point {
    /// Which of the stage's instances.
    instance: usize,
    node: NodeId,
    vertex: usize,
}

/// The frame as `settings` expose it, and the next one.
fn stages(scene: &Scene, settings: &Settings, frame: i64) -> Result<[Stage; 2]> {
    let mut rig = Rig::new(scene, &settings.playback)?;
    for (node, amount) in &settings.blur_scale {
        rig.set_blur(node_named(scene, node)?, *amount);
    }
    let view = View::new(&rig, &settings.view)?;
    let at = |frame| -> Result<Stage> { Ok(view.stage(&rig, settings.passes(frame, None)?[0].interval)) };
    Ok([at(frame)?, at(frame + 1)?])
}

/// The point in the picture that goes farthest on the film from this frame to the next; `None` where nothing moves.
///
/// Up to 48 vertices of each object are looked at.
///
/// # Errors
/// If the camera or a node that the settings name does not exist.
pub fn fastest(scene: &Scene, settings: &Settings, frame: i64) -> Result<Option<Point>> {
    let whole = Settings { shutter: Some(1.0), shutter_phase: ShutterPhase::Start, ..settings.clone() };
    let stages = stages(scene, &whole, frame)?;
    let ratio = settings.pixel_aspect.ratio();
    let mut best: Option<(f64, Point)> = None;
    for (instance, placed) in stages[0].instances.iter().enumerate() {
        let vertices = scene.meshes[stages[0].geometries[placed.geometry].mesh].positions.len();
        for vertex in (0..vertices).step_by(vertices.div_ceil(POINTS).max(1)) {
            let point = Point { instance, node: placed.node, vertex };
            let streak = point.way(scene, &stages, settings.size, ratio).map_or(0.0, |w| w.streak);
            if streak > best.map_or(0.0, |b| b.0) {
                best = Some((streak, point));
            }
        }
    }
    Ok(best.map(|b| b.1))
}

impl Point {
    /// Its way over an exposure and to the next; `None` where it is not in the picture, or not there.
    fn way(&self, scene: &Scene, [now, next]: &[Stage; 2], size: (u32, u32), pixel_aspect: f64) -> Option<Way> {
        // The same thing; where visibility changed it is looked for.
        let find = |stage: &Stage| {
            let here = stage.instances.get(self.instance).filter(|i| i.node == self.node);
            here.or_else(|| stage.instances.iter().find(|i| i.node == self.node)).cloned()
        };
        let placed = [find(now)?, find(next)?];
        let keys = placed[0].motion.keys().len().max(now.camera.motion.keys().len());
        let shapes = now.geometries[placed[0].geometry].keys.len();
        let moves = keys > 1 || shapes > 1;
        let instants = if moves { (4 * keys.max(shapes)).clamp(INSTANTS.0, INSTANTS.1) } else { 1 };
        let cameras = [now, next].map(|s| Projector::new(&s.camera, size, pixel_aspect));
        let on_film = |which: usize, u: f32| {
            let stage = [now, next][which];
            cameras[which].film(world(scene, stage, &placed[which], self.vertex, u), u)
        };
        way(on_film, instants, size)
    }
}

/// The way of a point whose place on the film is `on_film(exposure, u)`, if it is in the picture.
#[allow(clippy::cast_precision_loss, reason = "at most 2048 instants")]
fn way(on_film: impl Fn(usize, f32) -> Option<DVec2>, instants: usize, size: (u32, u32)) -> Option<Way> {
    let middle = on_film(0, 0.5)?;
    let inside = middle.cmpge(DVec2::ZERO).all() && middle.x < f64::from(size.0) && middle.y < f64::from(size.1);
    if !inside {
        return None;
    }
    let mut streak = 0.0;
    let mut last = on_film(0, 0.0)?;
    for i in 1..=instants {
        let here = on_film(0, i as f32 / instants as f32)?;
        streak += here.distance(last);
        last = here;
    }
    let displacement = on_film(1, 0.5)?.distance(middle);
    Some(Way { streak, displacement, gap: on_film(1, 0.0)?.distance(last) })
}

fn name_of(scene: &Scene, node: usize) -> String {
    match scene.nodes[node].name.as_str() {
        "" => format!("node {node}"),
        name => name.to_owned(),
    }
}

/// A vertex in the world at `u` of the exposure.
fn world(scene: &Scene, stage: &Stage, instance: &Instance, vertex: usize, u: f32) -> Vec3A {
    let geometry = &stage.geometries[instance.geometry];
    let at =
        |key: usize| geometry.keys.get(key).map_or(&scene.meshes[geometry.mesh].positions, |k| &k.positions)[vertex];
    let place = if geometry.keys.len() > 1 {
        let (segment, f) = segment_at(&geometry.times, u);
        at(segment).lerp(at(segment + 1), f)
    } else {
        at(0)
    };
    instance.motion.at(u).transform_point3a(Vec3A::from(place))
}

/// From the world to the film.
struct Projector<'a> {
    camera: &'a StageCamera,
    /// Pixels for a unit of view coordinates, across and down.
    scale: DVec2,
    centre: DVec2,
}

impl<'a> Projector<'a> {
    fn new(camera: &'a StageCamera, size: (u32, u32), pixel_aspect: f64) -> Self {
        let half = match camera.projection {
            Projection::Perspective { yfov, .. } => libm::tan(f64::from(yfov) * 0.5),
            Projection::Orthographic { ymag, .. } => f64::from(ymag.abs()),
        };
        let down = f64::from(size.1) / (2.0 * half);
        let centre = DVec2::new(f64::from(size.0), f64::from(size.1)) * 0.5;
        Self { camera, scale: DVec2::new(down / pixel_aspect, down), centre }
    }

    /// Where `point` is on the film at `u`, pixels; `None` behind the camera.
    fn film(&self, point: Vec3A, u: f32) -> Option<DVec2> {
        let local = self.camera.motion.at(u).inverse().transform_point3a(point);
        let depth = match self.camera.projection {
            Projection::Perspective { .. } => -f64::from(local.z),
            Projection::Orthographic { .. } => 1.0,
        };
        let film = DVec2::new(f64::from(local.x), -f64::from(local.y)) / depth * self.scale + self.centre;
        (depth > 0.0 && film.is_finite()).then_some(film)
    }
}

/// The table as CSV.
#[must_use]
pub fn csv(rows: &[Row]) -> String {
    let mut out =
        String::from("phase,angle_deg,streak_px,displacement_px,gap_px,noise,relative_noise,rejected,seconds,object\n");
    for r in rows {
        let _ = writeln!(
            out,
            "{},{},{:.3},{:.3},{:.3},{:.6},{:.5},{},{:.3},\"{}\"",
            phase_name(r.phase),
            r.angle,
            r.streak_px,
            r.displacement_px,
            r.gap_px,
            r.noise,
            r.relative_noise,
            r.rejected,
            r.seconds,
            r.object.replace('"', "\"\"")
        );
    }
    out
}

/// What the command line calls a phase.
#[must_use]
pub const fn phase_name(phase: ShutterPhase) -> &'static str {
    match phase {
        ShutterPhase::Start => "start",
        ShutterPhase::Centre => "centre",
        ShutterPhase::End => "end",
    }
}

/// One page that holds everything: a strip of pictures a phase, and the table.
///
/// # Errors
/// If a picture cannot be encoded.
pub fn page(title: &str, trials: &[(Row, Picture)]) -> Result<String> {
    let escaped = |t: &str| t.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title>\n<style>{STYLE}</style>\n\
         <h1>{0}</h1>\n<p>{EXPLANATION}</p>\n",
        escaped(title)
    );
    let mut phases: Vec<ShutterPhase> = trials.iter().map(|t| t.0.phase).collect();
    phases.dedup();
    for phase in phases {
        let _ = writeln!(out, "<h2>Phase: {}</h2>\n<div class=\"strip\">", phase_name(phase));
        for (row, picture) in trials.iter().filter(|t| t.0.phase == phase) {
            let png = png::encode(picture, PngOptions::default(), Path::new("study.png"))?;
            let _ = writeln!(
                out,
                "<figure><img alt=\"{0}°\" src=\"data:image/png;base64,{1}\"><figcaption><b>{0}°</b> streak {2:.1} px, \
                 gap {3:.1} px, noise {4:.2} %</figcaption></figure>",
                row.angle,
                base64(&png),
                row.streak_px,
                row.gap_px,
                100.0 * row.relative_noise
            );
        }
        out.push_str("</div>\n");
    }
    out.push_str(
        "<h2>Table</h2>\n<table><tr><th>phase<th>angle<th>streak<th>displacement<th>gap<th>noise<th>noise / mean\
         <th>rejected<th>fastest object</tr>\n",
    );
    for (r, _) in trials {
        let _ = writeln!(
            out,
            "<tr><td>{}<td>{}°<td>{:.2} px<td>{:.2} px<td>{:.2} px<td>{:.5}<td>{:.2} %<td>{}<td>{}</tr>",
            phase_name(r.phase),
            r.angle,
            r.streak_px,
            r.displacement_px,
            r.gap_px,
            r.noise,
            100.0 * r.relative_noise,
            r.rejected,
            escaped(&r.object)
        );
    }
    out.push_str("</table>\n</html>\n");
    Ok(out)
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2rem;color:#222;background:#fff}\
    .strip{display:flex;gap:.6rem;overflow-x:auto;padding-bottom:.6rem}figure{margin:0}img{display:block;width:320px}\
    figcaption{font-size:.85rem;padding-top:.25rem}table{border-collapse:collapse}th,td{padding:.2rem .7rem;\
    text-align:right;border-bottom:1px solid #ddd}td:last-child,th:last-child,td:first-child,th:first-child\
    {text-align:left}p{max-width:46rem}";

const EXPLANATION: &str = "One frame under many shutters. The <b>streak</b> is the way of the fastest visible point on \
    the film while the shutter is open; the <b>displacement</b> is its way from one exposure's middle to the next \
    frame's; the <b>gap</b> is what no streak covers: a gap many times an object's width reads as judder, none as \
    softness. <b>Noise</b> is the root mean variance of the pixels, at the same number of samples.";

/// Base64 (RFC 4648, §4).
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let word = group.iter().chain(&[0, 0]).take(3).fold(0_u32, |w, &b| w << 8 | u32::from(b));
        for digit in 0..4 {
            let index = (word >> (18 - 6 * digit) & 63) as usize;
            out.push(if digit <= group.len() { char::from(DIGITS[index]) } else { '=' });
        }
    }
    out
}

/// Whether a study makes sense of `settings`: fields and rolling shutters have exposures of their own.
///
/// # Errors
/// If it does not.
pub fn check(settings: &Settings) -> Result<()> {
    let passes = settings.passes(0, None)?;
    if passes.len() == 1 && passes[0].lines == Lines::All && !passes[0].is_rolling() {
        Ok(())
    } else {
        Err(Error::invalid("study motion", "expected whole frames: neither --interlace, --video nor --scan rolling"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        let pairs = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")];
        for (text, code) in pairs {
            assert_eq!(base64(text.as_bytes()), code);
        }
    }

    #[test]
    fn a_straight_way_is_streak_and_gap() {
        // 40 pixels a frame behind a shutter of 90 degrees.
        let on_film =
            |exposure: usize, u: f32| Some(DVec2::new(100.0 + 40.0 * exposure as f64 + 10.0 * f64::from(u), 50.0));
        let way = way(on_film, 32, (320, 180)).unwrap();
        assert!((way.streak - 10.0).abs() < 1e-6 && (way.displacement - 40.0).abs() < 1e-6);
        assert!((way.gap - 30.0).abs() < 1e-6);
    }
}
