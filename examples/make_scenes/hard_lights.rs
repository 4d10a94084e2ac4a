//! A pinhole camera, point, spot and directional lights, matt surfaces: nothing to sample but the pixel.

use super::builder::Builder;
use super::colour::{lamp, srgb};
use super::node::{Eye, Place};
use super::paint::{Paint, array};
use super::set::sweep;
use super::shape::Shape;
use super::sweep::smooth;
use glam::{DQuat, DVec3};
use serde_json::json;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    let ground = b.material(Paint::new("ground", srgb(0xcfc8bb)).rough(1.0));
    b.put(Place::new("ground"), &sweep(6.0, 4.0, -2.2, 0.8, 4.0).plain(), ground);
    stairs(&mut b);
    let blue = b.material(Paint::new("blue", srgb(0x3f6fa8)).rough(1.0));
    let ochre = b.material(Paint::new("ochre", srgb(0xd79a3c)).rough(1.0));
    let rose = b.material(Paint::new("rose", srgb(0xc8574e)).rough(1.0));
    let bone = b.material(Paint::new("bone", srgb(0xe8e1d2)).rough(1.0));
    b.put(Place::new("ball").at(0.55, 0.28, 0.35), &Shape::ball(0.28, 96, 48).plain(), rose);
    b.put(
        Place::new("ring").at(1.32, 0.42, -0.15).turned(DQuat::from_euler(glam::EulerRot::YXZ, -0.7, 1.45, 0.0)),
        &Shape::torus(0.34, 0.08, 96, 32).plain(),
        blue,
    );
    let cone = Shape::lathe(&[[0.0, 0.8], [0.24, 0.0], [0.0, 0.0]], 96).plain();
    b.put(Place::new("cone").at(0.12, 0.0, -0.55), &cone, ochre);
    let spindle = smooth(
        &[
            [0.0, 0.62],
            [0.075, 0.60],
            [0.10, 0.53],
            [0.07, 0.46],
            [0.04, 0.43],
            [0.055, 0.38],
            [0.09, 0.30],
            [0.06, 0.20],
            [0.045, 0.14],
            [0.10, 0.08],
            [0.13, 0.04],
            [0.13, 0.0],
        ],
        6,
    );
    let mut spindle = spindle;
    spindle.push([0.0, 0.0]);
    b.put(Place::new("spindle").at(-0.25, 0.0, 0.75), &Shape::lathe(&spindle, 64).plain(), bone);

    let light = |kind: &str, kelvin: f64, intensity: f64| {
        let hue = lamp(kelvin);
        json!({ "name": kind, "type": kind, "color": array(hue / hue.max_element()), "intensity": intensity })
    };
    // A low sun from the left, a lamp behind the stairs, a spot on the ball.
    let sun = super::node::facing(DVec3::new(0.85, -0.75, -0.55));
    b.light(Place::new("sun").turned(sun), light("directional", 5200.0, 3.8));
    b.light(Place::new("lamp").at(-0.35, 1.5, -1.1), light("point", 3600.0, 2.4));
    let mut spot = light("spot", 8000.0, 10.0);
    spot["spot"] = json!({ "innerConeAngle": 0.17, "outerConeAngle": 0.27 });
    let aim = super::node::facing(DVec3::new(0.6, 0.15, 0.2) - DVec3::new(2.2, 2.4, 1.9));
    b.light(Place::new("spot").at(2.2, 2.4, 1.9).turned(aim), spot);
    b.camera("camera", &Eye::new([0.5, 1.35, 4.3], [0.03, 0.60, 0.0], 30.0));
    b.finish("hard lights")
}

/// A flight of stairs to nowhere, on the left.
fn stairs(b: &mut Builder) {
    let stone = b.material(Paint::new("stone", srgb(0x8d96a0)).rough(1.0));
    for i in 0..5 {
        let height = 0.09 * f64::from(i + 1);
        let step = Shape::block(DVec3::new(0.11, height, 0.38), 0.006, 2).plain();
        b.put(Place::new(&format!("step {i}")).at(-0.55 - 0.22 * f64::from(i), height, -0.15), &step, stone);
    }
    let bone = b.material(Paint::new("pale stone", srgb(0xe2d9c6)).rough(1.0));
    let mut column =
        smooth(&[[0.088, 0.5], [0.088, 0.475], [0.062, 0.45], [0.058, 0.28], [0.068, 0.07], [0.094, 0.03]], 6);
    column.insert(0, [0.0, 0.5]);
    column.extend([[0.10, 0.0], [0.0, 0.0]]);
    let column = Shape::lathe(&column, 64).plain();
    for (x, z) in [(-1.43, 0.06), (-1.43, -0.36)] {
        b.put(Place::new("column").at(x, 0.9, z), &column, bone);
    }
    let beam = Shape::block(DVec3::new(0.13, 0.05, 0.36), 0.008, 2).plain();
    b.put(Place::new("lintel").at(-1.43, 1.45, -0.15), &beam, bone);
}
