//! Scenes of the project as they stand at one instant: every triangle in the world, in one mesh for both sides.

use super::scenes::{Case, Placed, Shape};
use glam::{Affine3A, Vec3};
use graeco::scene::Projection;
use graeco::scene::gltf::{LoadOptions, load};
use graeco::scene::rig::{Playback, Rig};
use graeco::scene::view::{View, ViewRequest};
use graeco::time::Exposure;
use std::path::Path;

/// The scene in `file`, a path from the project's folder, in the middle of its animation, seen through its own camera.
pub fn frozen(name: &'static str, file: &str) -> Case {
    let scene = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(file), &LoadOptions::default()).unwrap();
    let rig = Rig::new(&scene, &Playback::default()).unwrap();
    let request = ViewRequest { motion_error: 1.0, size: (512, 512), pixel_aspect: 1.0, ..ViewRequest::default() };
    let middle = rig.span().map_or(0.0, |(a, b)| 0.5 * (a + b));
    let stage = View::new(&rig, &request).unwrap().stage(&rig, Exposure { open: middle, close: middle });
    let mut all = Shape { triangles: Vec::new(), keys: vec![Vec::new()] };
    for instance in &stage.instances {
        let geometry = &stage.geometries[instance.geometry];
        let mesh = &scene.meshes[geometry.mesh];
        let rest = geometry.keys.first().map_or(&mesh.positions, |k| &k.positions);
        let place = instance.motion.keys()[0];
        let key = rest.iter().map(|&p| place.transform_point3(p)).collect();
        all.append(&Shape { triangles: mesh.triangles.clone(), keys: vec![key] });
    }
    let camera = stage.camera.motion.keys()[0];
    let eye = Vec3::from(camera.translation);
    let reach = match stage.camera.projection {
        Projection::Perspective { yfov, .. } => libm::tanf(0.5 * yfov),
        Projection::Orthographic { .. } => panic!("the scenes of the project have perspective cameras"),
    };
    let placed = vec![Placed { shape: 0, keys: vec![Affine3A::IDENTITY] }];
    let target = eye - Vec3::from(camera.matrix3.z_axis);
    Case { name, shapes: vec![all], placed, turns: false, eye, target, reach }
}
