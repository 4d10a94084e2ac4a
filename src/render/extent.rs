//! How large blur is on the picture, before anything is rendered: pixels that moving things cover in an exposure, and
//! the diameter of what is out of focus.
//!
//! Motion is measured along the baked paths, which are straight between keys: at the vertices of everything that moves,
//! and at surface points seen through a grid of pixels, which find large surfaces that the picture cuts.

use crate::scene::{Projection, Scene, Stage};
use crate::trace::FilmPoint;
use crate::trace::accel::Accel;
use crate::trace::camera::CameraRays;
use glam::{DVec2, Vec3A};
use serde::Serialize;

/// The largest blur on the picture.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct BlurExtent {
    /// The greatest distance between two places of one surface point within the exposure, pixels; 0 where nothing moves.
    pub motion_px: f64,
    /// Name of the node that moves so far; empty if it has none or nothing moves.
    pub motion_node: String,
    /// Diameter of the largest disk that a seen point is spread to by the lens, pixels; 0 for a pinhole.
    pub defocus_px: f64,
}

/// Columns and lines of the grid of pixels looked through.
const GRID: (u32, u32) = (48, 27);
/// Of a mesh with more vertices every nth is followed.
const MOST_VERTICES: usize = 1 << 14;
/// Instants at which a path is looked at, at most; evenly chosen among more keys.
const MOST_INSTANTS: usize = 33;

/// Measures `stage` as `camera` sees it over a picture of `size` pixels.
#[must_use]
pub fn measure(scene: &Scene, stage: &Stage, accel: &Accel, camera: &CameraRays, size: (u32, u32)) -> BlurExtent {
    let frame = DVec2::new(f64::from(size.0), f64::from(size.1));
    let mut extent = BlurExtent::default();
    let camera_moves = !stage.camera.motion.is_still();
    let mut farthest: Option<usize> = None;
    for (index, instance) in stage.instances.iter().enumerate() {
        let geometry = &stage.geometries[instance.geometry];
        if !camera_moves && instance.motion.is_still() && geometry.keys.len() <= 1 {
            continue;
        }
        let times = instants(stage, index);
        let count = geometry.keys.first().map_or(scene.meshes[geometry.mesh].positions.len(), |k| k.positions.len());
        for vertex in (0..count).step_by(count.div_ceil(MOST_VERTICES).max(1)) {
            let pixels = path_length(camera, frame, &times, &|u| local(scene, stage, index, vertex, u));
            if pixels > extent.motion_px {
                (extent.motion_px, farthest) = (pixels, Some(index));
            }
        }
    }
    look_through_grid(scene, stage, accel, camera, frame, &mut extent, &mut farthest);
    if let Some(index) = farthest {
        extent.motion_node.clone_from(&scene.nodes[stage.instances[index].node].name);
    }
    extent
}

/// What is seen through the grid's pixels at the middle of the exposure.
fn look_through_grid(
    scene: &Scene,
    stage: &Stage,
    accel: &Accel,
    camera: &CameraRays,
    frame: DVec2,
    extent: &mut BlurExtent,
    farthest: &mut Option<usize>,
) {
    for row in 0..GRID.1 {
        for column in 0..GRID.0 {
            let cell = DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5);
            let position = cell / DVec2::new(f64::from(GRID.0), f64::from(GRID.1)) * frame;
            let ray = camera.middle_ray(FilmPoint { position, u_time: 0.5 }).ray;
            let Some(hit) = accel.closest(&ray, |_| true) else { continue };
            let index = hit.instance as usize;
            let geometry = &stage.geometries[stage.instances[index].geometry];
            let corners = scene.meshes[geometry.mesh].triangles[hit.triangle as usize].map(|v| v as usize);
            let point = |u: f32| {
                let [a, b, c] = corners.map(|v| local(scene, stage, index, v, u));
                a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v
            };
            let pixels = path_length(camera, frame, &instants(stage, index), &point);
            if pixels > extent.motion_px {
                (extent.motion_px, *farthest) = (pixels, Some(index));
            }
            let axis = -stage.camera.motion.at(0.5).matrix3.z_axis;
            let depth = f64::from(hit.t * ray.direction.dot(axis));
            extent.defocus_px = extent.defocus_px.max(disk(stage, frame.y, depth));
        }
    }
}

/// World position of a vertex of an instance.
fn local(scene: &Scene, stage: &Stage, index: usize, vertex: usize, u: f32) -> Vec3A {
    let instance = &stage.instances[index];
    let geometry = &stage.geometries[instance.geometry];
    let at = match &geometry.keys[..] {
        [] => scene.meshes[geometry.mesh].positions[vertex],
        [only] => only.positions[vertex],
        keys => {
            let (segment, f) = crate::scene::motion::segment_at(&geometry.times, u);
            keys[segment].positions[vertex].lerp(keys[segment + 1].positions[vertex], f)
        }
    };
    instance.motion.at(u).transform_point3a(Vec3A::from(at))
}

/// Key times of everything that moves an instance on the picture.
fn instants(stage: &Stage, index: usize) -> Vec<f32> {
    let instance = &stage.instances[index];
    let mut times = vec![0.0, 1.0];
    if !instance.motion.is_still() {
        times.extend(instance.motion.times());
    }
    times.extend(&stage.geometries[instance.geometry].times);
    if !stage.camera.motion.is_still() {
        times.extend(stage.camera.motion.times());
    }
    times.sort_by(f32::total_cmp);
    times.dedup();
    if times.len() <= MOST_INSTANTS {
        return times;
    }
    (0..MOST_INSTANTS).map(|i| times[i * (times.len() - 1) / (MOST_INSTANTS - 1)]).collect()
}

/// The greatest distance between two places of a point on the picture; 0 if it is at no instant on it.
fn path_length(camera: &CameraRays, frame: DVec2, times: &[f32], world: &dyn Fn(f32) -> Vec3A) -> f64 {
    let places: Vec<DVec2> = times.iter().filter_map(|&u| camera.project(world(u), u)).collect();
    let on_picture = |p: &DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(frame).all();
    if !places.iter().any(on_picture) {
        return 0.0;
    }
    // What leaves the picture is cut: a streak is no longer than what can be seen of it.
    let places: Vec<DVec2> = places.iter().map(|p| p.clamp(DVec2::ZERO, frame)).collect();
    let mut longest = 0.0_f64;
    for (i, a) in places.iter().enumerate() {
        for b in &places[i + 1..] {
            longest = longest.max(a.distance(*b));
        }
    }
    longest
}

/// Diameter of the disk of confusion at `depth` metres, pixels: 2 r |1/depth − 1/focus| over a pixel's height in view
/// units, at whichever end of the exposure it is larger.
fn disk(stage: &Stage, lines: f64, depth: f64) -> f64 {
    let radius = f64::from(stage.camera.aperture_radius);
    if radius <= 0.0 || depth <= 0.0 {
        return 0.0;
    }
    let disk_at = |focus: f32| match stage.camera.projection {
        Projection::Perspective { yfov, .. } => {
            let pixel = 2.0 * libm::tan(f64::from(yfov) * 0.5) / lines;
            2.0 * radius * (1.0 / depth - 1.0 / f64::from(focus)).abs() / pixel
        }
        Projection::Orthographic { ymag, .. } => {
            let pixel = 2.0 * f64::from(ymag).abs() / lines;
            2.0 * radius * (1.0 - depth / f64::from(focus)).abs() / pixel
        }
    };
    stage.camera.focus_distance.map(disk_at).into_iter().fold(0.0, f64::max)
}
