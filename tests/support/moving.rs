//! Moving scenes made in code, and the dense evaluation that baked motion is measured against.

#![allow(dead_code, unreachable_pub, missing_docs, reason = "each test file uses its part")]

use glam::{Affine3A, DAffine3, DVec2, DVec3, Quat, Vec3, Vec3A};
use graeco::scene::rig::{Playback, Rig};
use graeco::scene::view::{View, ViewRequest};
use graeco::scene::{
    Animation, Camera, Channel, Interpolation, Lens, LocalTransform, Material, Mesh, Node, NodeId, Projection,
    Property, Scene, Stage, Track,
};
use graeco::time::Exposure;

pub const SIZE: (u32, u32) = (960, 540);
pub const YFOV: f32 = 0.7;

/// A track of one value a key (three for a spline).
pub fn track<T>(interpolation: Interpolation, times: &[f64], values: Vec<T>) -> Track<T> {
    Track { times: times.to_vec(), values, width: 1, interpolation }
}

/// A track that runs straight through its keys.
pub fn linear<T: Clone>(keys: &[(f64, T)]) -> Track<T> {
    track(
        Interpolation::Linear,
        &keys.iter().map(|k| k.0).collect::<Vec<_>>(),
        keys.iter().map(|k| k.1.clone()).collect(),
    )
}

/// A scene under construction.
#[derive(Default)]
pub struct Builder {
    pub scene: Scene,
    channels: Vec<Channel>,
}

impl Builder {
    /// A scene whose camera stands `distance` metres up the z axis and looks at the origin.
    pub fn new(distance: f32) -> Self {
        let mut builder = Self::default();
        builder.scene.materials.push(Material::default());
        let camera = Camera {
            name: String::new(),
            projection: Projection::Perspective { yfov: YFOV, aspect: None },
            near_far: (0.1, None),
            lens: Lens::default(),
        };
        builder.scene.cameras.push(camera);
        let eye = builder.node(None, Vec3::Z * distance);
        builder.scene.nodes[eye].camera = Some(0);
        builder
    }

    /// The camera's node.
    pub const EYE: NodeId = 0;

    pub fn node(&mut self, parent: Option<NodeId>, translation: Vec3) -> NodeId {
        let local = LocalTransform::Parts { translation, rotation: Quat::IDENTITY, scale: Vec3::ONE };
        self.scene.nodes.push(Node { parent, local, visible: true, ..Node::default() });
        self.scene.order.push(self.scene.nodes.len() - 1);
        self.scene.nodes.len() - 1
    }

    /// Hangs a mesh of these points (triangles in order) on a node.
    pub fn mesh(&mut self, node: NodeId, positions: &[Vec3]) -> usize {
        let n = u32::try_from(positions.len() / 3).unwrap();
        let triangles = (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        self.scene.meshes.push(Mesh { positions: positions.to_vec(), triangles, ..Mesh::default() });
        self.scene.nodes[node].meshes.push(self.scene.meshes.len() - 1);
        self.scene.meshes.len() - 1
    }

    pub fn drive(&mut self, node: NodeId, property: Property) {
        self.channels.push(Channel { node, property });
    }

    pub fn finish(mut self) -> Scene {
        self.scene.animations.push(Animation { name: String::new(), channels: self.channels });
        self.scene
    }
}

pub fn request(motion_error: f64) -> ViewRequest {
    ViewRequest { motion_error, size: SIZE, pixel_aspect: 1.0, ..ViewRequest::default() }
}

pub fn stage(scene: &Scene, interval: Exposure, motion_error: f64) -> Stage {
    let rig = Rig::new(scene, &Playback::default()).unwrap();
    View::new(&rig, &request(motion_error)).unwrap().stage(&rig, interval)
}

pub fn looped(scene: &Scene) -> Rig<'_> {
    Rig::new(scene, &Playback { animation: None, looped: true }).unwrap()
}

/// The instant at `u` of an object of amount `amount`: the definition, without the library's help.
pub fn own_time(interval: Exposure, amount: f64, u: f64) -> f64 {
    let middle = 0.5 * (interval.open + interval.close);
    middle + amount * (interval.open + (interval.close - interval.open) * u - middle)
}

/// World from node at an instant, by the file's curves themselves.
pub fn true_world(rig: &Rig<'_>, node: NodeId, time: f64) -> DAffine3 {
    let t = time - rig.shift((time, time));
    rig.world(node, (t, t), t)
}

/// Where a camera at `eye` sees `point`, in pixels of [`SIZE`]; `None` behind it or outside the picture.
pub fn project(eye: DAffine3, point: DVec3) -> Option<DVec2> {
    let unit = |v: DVec3| v.normalize();
    let offset = point - eye.translation;
    let m = eye.matrix3;
    let local = DVec3::new(offset.dot(unit(m.x_axis)), offset.dot(unit(m.y_axis)), offset.dot(unit(m.z_axis)));
    let scale = f64::from(SIZE.1) / (2.0 * (f64::from(YFOV) * 0.5).tan());
    let film = DVec2::new(local.x, -local.y) / -local.z * scale;
    let inside = film.x.abs() <= f64::from(SIZE.0) * 0.5 && film.y.abs() <= f64::from(SIZE.1) * 0.5;
    (local.z < 0.0 && inside).then_some(film)
}

pub fn wide(m: Affine3A) -> DAffine3 {
    let v = |a: Vec3A| DVec3::new(f64::from(a.x), f64::from(a.y), f64::from(a.z));
    DAffine3 {
        matrix3: glam::DMat3::from_cols(v(m.matrix3.x_axis), v(m.matrix3.y_axis), v(m.matrix3.z_axis)),
        translation: v(m.translation),
    }
}

/// Distances in pixels between baked and true pictures of every mesh vertex at `instants` even instants, except
/// within two steps of f32 of a jump: the largest, and how many were seen.
pub fn worst_error(rig: &Rig<'_>, stage: &Stage, instants: u32) -> (f64, usize) {
    let scene = rig.scene();
    let (mut worst, mut seen) = (0.0_f64, 0);
    for instance in &stage.instances {
        let amount = rig.blur(instance.node);
        let mesh = &scene.meshes[stage.geometries[instance.geometry].mesh];
        let eye_amount = rig.blur(Builder::EYE);
        let near_jump = |u: f32| {
            let jumps = |times: &[f32]| times.windows(2).any(|w| w[0] >= w[1] && (w[0] - u).abs() < 3.0 * f32::EPSILON);
            jumps(instance.motion.times()) || jumps(stage.camera.motion.times())
        };
        for i in 0..=instants {
            let u = i as f32 / instants as f32;
            if near_jump(u) {
                continue;
            }
            let u64 = f64::from(u);
            let truth = true_world(rig, instance.node, own_time(stage.interval, amount, u64));
            let eye = true_world(rig, Builder::EYE, own_time(stage.interval, eye_amount, u64));
            let (baked, baked_eye) = (wide(instance.motion.at(u)), wide(stage.camera.motion.at(u)));
            for p in &mesh.positions {
                let p = p.as_dvec3();
                let nearer_than_bound = truth.transform_point3(p).distance(eye.translation) < 0.1;
                if let Some(a) = project(eye, truth.transform_point3(p))
                    && !nearer_than_bound
                    && let Some(b) = project(baked_eye, baked.transform_point3(p))
                {
                    worst = worst.max(a.distance(b));
                    seen += 1;
                }
            }
        }
    }
    (worst, seen)
}

pub fn exposure(open: f64, close: f64) -> Exposure {
    Exposure { open, close }
}
