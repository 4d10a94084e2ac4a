//! The scenes that are measured: made here, each with the effects that it is named by and no others.

use crate::flat::{ball, rectangle};
use crate::moving::{Builder, linear};
use glam::{Quat, Vec3};
use graeco::scene::{Light, LightShape, LocalTransform, Material, Property, Scene};

/// One effect that a scene may call for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// A ball moves.
    Time,
    /// The lens has an aperture.
    Lens,
    /// The lamp has an extent.
    Light,
}

impl Effect {
    pub const ALL: [Self; 3] = [Self::Time, Self::Lens, Self::Light];

    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Lens => "lens",
            Self::Light => "light",
        }
    }
}

fn matt() -> Material {
    Material { metallic: 0.0, double_sided: true, ..Material::default() }
}

fn lamp(b: &mut Builder, at: Vec3, radius: f32, intensity: f32) {
    let node = b.node(None, at);
    b.scene.nodes[node].light = Some(b.scene.lights.len());
    let shape = LightShape::Point { radius };
    b.scene.lights.push(Light { name: String::new(), shape, intensity: Vec3::splat(intensity), range: None });
}

fn floor(b: &mut Builder, side: f32) {
    let node = b.node(None, Vec3::NEG_Y);
    b.scene.nodes[node].local = LocalTransform::Parts {
        translation: Vec3::NEG_Y,
        rotation: Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2),
        scale: Vec3::ONE,
    };
    b.mesh(node, &rectangle([-side, side], [-side, side]));
}

/// Three balls on a floor under a lamp, matt; with one effect.
pub fn balls(effect: Effect) -> Scene {
    let mut b = Builder::new(9.0);
    b.scene.materials[0] = matt();
    floor(&mut b, 12.0);
    for (i, x) in [-2.5_f32, 0.0, 2.5].into_iter().enumerate() {
        let at = Vec3::new(x, 0.0, -2.0 * x);
        let node = b.node(None, at);
        b.mesh(node, &ball(1.0, 24));
        if i == 1 && effect == Effect::Time {
            b.drive(node, Property::Translation(linear(&[(0.0, at), (1.0, at + Vec3::new(1.0, 1.0, 0.0))])));
        }
    }
    lamp(&mut b, Vec3::new(3.0, 6.0, 4.0), if effect == Effect::Light { 1.0 } else { 0.0 }, 150.0);
    if effect == Effect::Lens {
        (b.scene.cameras[0].lens.aperture_radius, b.scene.cameras[0].lens.focus_distance) = (Some(0.2), Some(9.0));
    }
    b.finish()
}

/// 10 000 boxes on a floor, and one ball more that may move.
pub fn crowd(moves: bool) -> Scene {
    let mut b = Builder::new(40.0);
    b.scene.materials[0] = matt();
    floor(&mut b, 60.0);
    let first = b.node(None, Vec3::ZERO);
    let mesh = b.mesh(first, &ball(0.25, 2));
    b.scene.nodes[first].meshes.clear();
    for i in 0..10_000_u16 {
        let (row, column) = (f32::from(i / 100), f32::from(i % 100));
        let node = b.node(None, Vec3::new(column * 0.5 - 25.0, -0.75, row * 0.5 - 35.0));
        b.scene.nodes[node].meshes.push(mesh);
    }
    let at = Vec3::new(0.0, 1.5, 20.0);
    let node = b.node(None, at);
    b.mesh(node, &ball(1.0, 16));
    if moves {
        b.drive(node, Property::Translation(linear(&[(0.0, at), (1.0, at + Vec3::X)])));
    }
    lamp(&mut b, Vec3::new(10.0, 30.0, 30.0), 0.0, 3000.0);
    b.finish()
}
