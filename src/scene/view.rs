//! Which camera looks, through which lens: flags over the file over defaults.

use super::bake::{Baker, MotionError, affine};
use super::deform::{Deformer, cofactor};
use super::rig::{Rig, list_names};
use super::schedule::{Clock, KeyInstant};
use super::{Motion, NodeId, Projection, Scene, Stage, StageCamera};
use crate::time::Exposure;
use crate::{Error, Result};
use glam::{DAffine3, DVec3};

/// What the user asks of the camera; `None` leaves it to the file.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ViewRequest {
    /// Name of a camera or of the node that holds it, or an index into the scene's cameras.
    pub camera: Option<String>,
    /// Aperture as an f-stop.
    pub f_stop: Option<f64>,
    /// Radius of the aperture, metres; wins over `f_stop`.
    pub aperture_radius: Option<f64>,
    /// Distance to the plane in focus, metres.
    pub focus_distance: Option<f64>,
    /// Name of a node to keep in focus; wins over `focus_distance`.
    pub focus_on: Option<String>,
    /// Largest deviation from true motion, pixels.
    pub motion_error: f64,
    /// Width and height of the whole picture, pixels.
    pub size: (u32, u32),
    /// Width of a pixel over its height.
    pub pixel_aspect: f64,
}

/// The camera that was chosen: a node of the scene, or the default framing where the scene has none.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    node: Option<NodeId>,
    projection: Projection,
    place: DAffine3,
    aperture_radius: f64,
    focus: Focus,
    motion_error: MotionError,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Focus {
    At(f64),
    On(NodeId),
}

impl View {
    /// Chooses the camera and resolves its lens.
    ///
    /// # Errors
    /// If the camera or the node to focus on does not exist, or a value is out of range.
    pub fn new(rig: &Rig<'_>, request: &ViewRequest) -> Result<Self> {
        let scene = rig.scene();
        let node = camera_node(scene, request.camera.as_deref())?;
        let start = rig.span().map_or(0.0, |s| s.0);
        // Without a camera, one that sees everything, wherever it goes.
        let ball = match (node, rig.span()) {
            (None, Some(span)) => bounding_ball(rig, &evenly(span)),
            _ => bounding_ball(rig, &[start]),
        };
        let (projection, place, lens) = match node {
            Some(n) => {
                let camera = &scene.cameras[scene.nodes[n].camera.unwrap_or_default()];
                (camera.projection, rig.world(n, (start, start), start), camera.lens)
            }
            None => {
                let back = SIDES.into_iter().find(|&back| shows(rig, start, back)).unwrap_or(SIDES[0]);
                let (projection, place) = default_framing(ball, back, aspect(request));
                (projection, place, super::Lens::default())
            }
        };
        let f_stop = request.f_stop.or(lens.f_stop.map(f64::from));
        let radius = request
            .aperture_radius
            .or_else(|| request.f_stop.map(|f| radius_of_stop(projection, f)))
            .or(lens.aperture_radius.map(f64::from))
            .or_else(|| f_stop.map(|f| radius_of_stop(projection, f)));
        let focus = match &request.focus_on {
            Some(name) => Focus::On(node_named(scene, name)?),
            None => Focus::At(request.focus_distance.or(lens.focus_distance.map(f64::from)).unwrap_or_else(|| {
                let ahead = distance_ahead(place, ball.0);
                if ahead > 0.0 && ahead.is_finite() { ahead } else { ball.1.max(1.0) }
            })),
        };
        let near = node.and_then(|n| scene.nodes[n].camera).map_or(0.0, |c| f64::from(scene.cameras[c].near_far.0));
        let motion_error = measure(projection, request, near, ball.1, place.translation.distance(ball.0) + ball.1);
        Ok(Self { node, projection, place, aperture_radius: radius.unwrap_or(0.0), focus, motion_error })
    }

    /// The node that holds the camera; `None` for the default framing.
    #[must_use]
    pub fn node(&self) -> Option<NodeId> {
        self.node
    }

    /// Radius of the aperture, metres.
    #[must_use]
    pub fn aperture_radius(&self) -> f64 {
        self.aperture_radius
    }

    /// The scene as `interval` sees it from here.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "metres that are f32 in the file")]
    pub fn stage(&self, rig: &Rig<'_>, interval: Exposure) -> Stage {
        let baker = Baker::new(rig, interval, self.motion_error, self.node, self.place.translation);
        let motion = match self.node {
            Some(n) => without_scale(&baker.camera_motion(n)),
            None => Motion::still(affine(self.place)),
        };
        let focus = |u: f64| match self.focus {
            Focus::At(distance) => distance as f32,
            Focus::On(target) => {
                let at = |n: NodeId| {
                    let (piece, t) = Clock::new(interval, rig.blur(n)).on_file(rig, (u, u), u);
                    rig.world(n, piece, t)
                };
                let eye = self.node.map_or(self.place, at);
                (distance_ahead(eye, at(target).translation).max(f64::from(f32::MIN_POSITIVE))) as f32
            }
        };
        baker.stage(StageCamera {
            motion,
            projection: self.projection,
            aperture_radius: self.aperture_radius as f32,
            focus_distance: [focus(0.0), focus(1.0)],
        })
    }
}

/// How far `point` lies in front of a camera at `place`, metres along its axis, whatever its scale.
fn distance_ahead(place: DAffine3, point: DVec3) -> f64 {
    -(point - place.translation).dot(place.matrix3.z_axis.normalize_or_zero())
}

/// How the camera measures motion: by the smallest that a pixel can be.
///
/// At an angle θ from the axis a turn by ε moves the picture by ε / cos²θ: the corner, where that is most, counts,
/// but no more than 75 degrees from the axis.
fn measure(projection: Projection, request: &ViewRequest, near: f64, radius: f64, farthest: f64) -> MotionError {
    const LEAST_COSINE_SQUARED: f64 = 1.0 / 16.0;
    let lines = f64::from(request.size.1);
    let narrow = request.pixel_aspect.min(1.0);
    let (pixel_size, perspective) = match projection {
        Projection::Perspective { yfov, .. } => {
            let half = libm::tan(f64::from(yfov) * 0.5);
            let corner = half * half * (1.0 + aspect(request) * aspect(request));
            (2.0 * half / lines * (1.0 / (1.0 + corner)).max(LEAST_COSINE_SQUARED), true)
        }
        Projection::Orthographic { ymag, .. } => (2.0 * f64::from(ymag).abs() / lines, false),
    };
    // Where the file names no nearest visible distance: a thousandth of the scene.
    let nearest = if near > 0.0 { near } else { 1e-3 * radius.max(f64::MIN_POSITIVE) };
    MotionError { pixels: request.motion_error, pixel_size: pixel_size * narrow, perspective, nearest, farthest }
}

/// A camera's pose has no scale (glTF 2.0, §3.10.1): the axes of every key become unit vectors.
fn without_scale(motion: &Motion) -> Motion {
    let unit = |k: &glam::Affine3A| glam::Affine3A {
        matrix3: glam::Mat3A::from_cols(
            k.matrix3.x_axis.normalize_or_zero(),
            k.matrix3.y_axis.normalize_or_zero(),
            k.matrix3.z_axis.normalize_or_zero(),
        ),
        translation: k.translation,
    };
    let keys: Vec<_> = motion.keys().iter().map(unit).collect();
    if motion.is_still() { Motion::still(keys[0]) } else { Motion::through(motion.times().to_vec(), keys) }
}

fn aspect(request: &ViewRequest) -> f64 {
    f64::from(request.size.0) * request.pixel_aspect / f64::from(request.size.1)
}

/// Focal length 12 mm / tan(yfov / 2) on a sensor 24 mm high, over twice the f-stop. A parallel projection has no
/// focal length; a stop means nothing there.
fn radius_of_stop(projection: Projection, f_stop: f64) -> f64 {
    match projection {
        Projection::Perspective { yfov, .. } => 0.012 / libm::tan(f64::from(yfov) * 0.5) / (2.0 * f_stop),
        Projection::Orthographic { .. } => 0.0,
    }
}

fn camera_node(scene: &Scene, wanted: Option<&str>) -> Result<Option<NodeId>> {
    let holders: Vec<NodeId> = scene.order.iter().copied().filter(|&n| scene.nodes[n].camera.is_some()).collect();
    let Some(wanted) = wanted else {
        return Ok(holders.first().copied());
    };
    let camera_name = |n: NodeId| scene.nodes[n].camera.map_or("", |c| scene.cameras[c].name.as_str());
    let by_name = holders.iter().find(|&&n| camera_name(n) == wanted || scene.nodes[n].name == wanted);
    let by_index = wanted.parse::<usize>().ok().and_then(|i| holders.get(i));
    by_name.or(by_index).copied().map(Some).ok_or_else(|| Error::NoSuchObject {
        path: scene.path.clone(),
        kind: "camera",
        wanted: format!("\"{wanted}\""),
        available: list_names(holders.iter().map(|&n| match camera_name(n) {
            "" => scene.nodes[n].name.as_str(),
            name => name,
        })),
    })
}

/// The node of a name, or of an index.
///
/// # Errors
/// If there is none.
pub fn node_named(scene: &Scene, wanted: &str) -> Result<NodeId> {
    let by_name = scene.nodes.iter().position(|n| n.name == wanted);
    let by_index = wanted.parse::<usize>().ok().filter(|&i| i < scene.nodes.len());
    by_name.or(by_index).ok_or_else(|| Error::NoSuchObject {
        path: scene.path.clone(),
        kind: "node",
        wanted: format!("\"{wanted}\""),
        available: list_names(scene.nodes.iter().map(|n| n.name.as_str())),
    })
}

/// Seventeen instants from the first to the last: between them an animation that is worth looking at goes no great way
/// beyond what they show.
fn evenly((first, last): (f64, f64)) -> [f64; 17] {
    std::array::from_fn(|i| first + (last - first) * (i as f64 / 16.0))
}

/// Centre and radius of a ball around everything visible at any of `times`, seconds.
#[must_use]
pub fn bounding_ball(rig: &Rig<'_>, times: &[f64]) -> (DVec3, f64) {
    let scene = rig.scene();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let mut meet = |p: DVec3| {
        if p.is_finite() {
            (low, high) = (low.min(p), high.max(p));
        }
    };
    let everywhere =
        times.iter().flat_map(|&time| scene.nodes.iter().enumerate().map(move |(n, node)| (time, n, node)));
    for (time, n, node) in everywhere {
        if node.meshes.is_empty() || !rig.is_visible(n, time) {
            continue;
        }
        let world = rig.world(n, (time, time), time);
        for &mesh in &node.meshes {
            let start = KeyInstant { u: 0.0, at: 0.0, piece: (0.0, 0.0) };
            let instant = Exposure { open: time, close: time };
            let deformed = Deformer::new(rig, mesh, n, instant).map(|d| (d.vertices(&start), d.lands_in_world()));
            let places = match &deformed {
                Some((_, true)) => vec![DAffine3::IDENTITY],
                _ => node.copies.as_ref().map_or_else(|| vec![world], |c| c.iter().map(|m| world * *m).collect()),
            };
            let positions = deformed.as_ref().map_or(&scene.meshes[mesh].positions, |(key, _)| &key.positions);
            let (a, b) = positions
                .iter()
                .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(p.as_dvec3()), b.max(p.as_dvec3())));
            if positions.is_empty() {
                continue;
            }
            for place in places {
                for corner in 0..8 {
                    let pick = |bit: u32, lo: f64, hi: f64| if corner >> bit & 1 == 0 { lo } else { hi };
                    meet(place.transform_point3(DVec3::new(pick(0, a.x, b.x), pick(1, a.y, b.y), pick(2, a.z, b.z))));
                }
            }
        }
    }
    if low.x > high.x { (DVec3::ZERO, 1.0) } else { ((low + high) * 0.5, low.distance(high) * 0.5) }
}

/// Where the default framing looks from, the first that shows anything: a little above and to the right; the same from
/// below; from behind.
const SIDES: [DVec3; 4] = [
    DVec3::new(0.45, 0.35, 1.0),
    DVec3::new(0.45, -0.35, 1.0),
    DVec3::new(-0.45, 0.35, -1.0),
    DVec3::new(-0.45, -0.35, -1.0),
];

/// Whether from direction `back` anything of the scene is seen at `time` that is not culled: a face's front, or what has
/// two sides. What deforms or is copied is taken to show itself.
fn shows(rig: &Rig<'_>, time: f64, back: DVec3) -> bool {
    let scene = rig.scene();
    scene.nodes.iter().enumerate().filter(|(n, node)| !node.meshes.is_empty() && rig.is_visible(*n, time)).any(
        |(n, node)| {
            let world = rig.world(n, (time, time), time).matrix3;
            // Normals go with the cofactors; a mirror turns the winding.
            let side = if world.determinant() < 0.0 { -1.0 } else { 1.0 };
            let back = cofactor(world).transpose() * back * side;
            let instant = Exposure { open: time, close: time };
            node.meshes.iter().any(|&m| {
                let mesh = &scene.meshes[m];
                let front = |t: &[u32; 3]| {
                    let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
                    (b - a).cross(c - a).dot(back) > 0.0
                };
                node.copies.is_some()
                    || scene.materials.get(mesh.material).is_none_or(|m| m.double_sided)
                    || Deformer::new(rig, m, n, instant).is_some()
                    || mesh.triangles.iter().any(front)
            })
        },
    )
}

/// A perspective camera in direction `back` of the ball that sees the whole of it.
fn default_framing((centre, radius): (DVec3, f64), back: DVec3, aspect: f64) -> (Projection, DAffine3) {
    const YFOV: f64 = 0.69; // about 40 degrees: a normal lens
    let radius = if radius > 0.0 { radius } else { 1.0 };
    let half = if aspect < 1.0 { libm::atan(libm::tan(YFOV / 2.0) * aspect) } else { YFOV / 2.0 };
    let back = back.normalize();
    let eye = centre + back * (radius / libm::sin(half));
    let right = DVec3::Y.cross(back).normalize();
    let place = DAffine3 { matrix3: glam::DMat3::from_cols(right, back.cross(right), back), translation: eye };
    #[allow(clippy::cast_possible_truncation, reason = "a constant")]
    (Projection::Perspective { yfov: YFOV as f32, aspect: None }, place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::rig::Playback;
    use crate::scene::{Material, Mesh, Node};
    use glam::Vec3;

    /// A floor that faces down is looked at from below; one that faces up, or both ways, from above.
    #[test]
    fn the_default_framing_sees_a_front() {
        for (triangle, double_sided, above) in
            [([0, 1, 2], false, false), ([0, 2, 1], false, true), ([0, 1, 2], true, true)]
        {
            let mesh =
                Mesh { positions: vec![Vec3::ZERO, Vec3::X, Vec3::Z], triangles: vec![triangle], ..Mesh::default() };
            let scene = Scene {
                nodes: vec![Node { meshes: vec![0], visible: true, ..Node::default() }],
                order: vec![0],
                meshes: vec![mesh],
                materials: vec![Material { double_sided, ..Material::default() }],
                ..Scene::default()
            };
            let rig = Rig::new(&scene, &Playback::default()).unwrap();
            let request = ViewRequest { size: (4, 3), pixel_aspect: 1.0, motion_error: 1.0, ..ViewRequest::default() };
            let view = View::new(&rig, &request).unwrap();
            assert_eq!(view.place.translation.y > 0.0, above, "{triangle:?} {double_sided}");
        }
    }
}
