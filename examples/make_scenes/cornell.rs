//! A room after the Cornell box (Goral, Torrance, Greenberg and Battaile 1984): one lamp, two coloured walls.

use super::builder::Builder;
use super::colour::{lamp, srgb};
use super::node::{Eye, Place};
use super::paint::Paint;
use super::set::area_light;
use super::shape::Shape;
use glam::{DAffine3, DQuat, DVec2, DVec3};

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    let white = b.material(Paint::new("white", DVec3::splat(0.73)).rough(1.0));
    let red = b.material(Paint::new("red", DVec3::new(0.61, 0.058, 0.047)).rough(1.0));
    let green = b.material(Paint::new("green", DVec3::new(0.12, 0.43, 0.09)).rough(1.0));
    // 1.8 m wide, 1 m high, 1.4 m deep; open towards the camera.
    let one = DVec2::ONE;
    let mut shell = Shape::default();
    shell.join(&Shape::quad(DVec3::Z * 0.1, DVec3::X * 0.9, DVec3::NEG_Z * 0.7, one));
    shell.join(&Shape::quad(DVec3::new(0.0, 1.0, 0.1), DVec3::X * 0.9, DVec3::Z * 0.7, one));
    shell.join(&Shape::quad(DVec3::new(0.0, 0.5, -0.6), DVec3::X * 0.9, DVec3::Y * 0.5, one));
    b.put(Place::new("shell"), &shell.plain(), white);
    let left = Shape::quad(DVec3::new(-0.9, 0.5, 0.1), DVec3::NEG_Z * 0.7, DVec3::Y * 0.5, one).plain();
    b.put(Place::new("left wall"), &left, red);
    let right = Shape::quad(DVec3::new(0.9, 0.5, 0.1), DVec3::Z * 0.7, DVec3::Y * 0.5, one).plain();
    b.put(Place::new("right wall"), &right, green);
    let tall = Shape::block(DVec3::new(0.15, 0.30, 0.15), 0.004, 2).plain();
    let turn = DAffine3::from_rotation_translation(DQuat::from_rotation_y(0.32), DVec3::new(-0.30, 0.30, -0.18));
    b.put(Place::new("tall block"), &tall.moved(turn), white);
    let copper = b.material(Paint::new("copper", DVec3::new(0.926, 0.721, 0.504)).metal(1.0).rough(0.12));
    b.put(Place::new("copper ball").at(0.34, 0.17, -0.22), &Shape::ball(0.17, 96, 48).plain(), copper);
    let glass = b.material(Paint::new("glass", DVec3::ONE).glass(1.5, DVec3::new(0.85, 0.96, 0.93), 0.2));
    b.put(Place::new("glass ball").at(0.05, 0.11, 0.20), &Shape::ball(0.11, 96, 48).plain(), glass);
    area_light(&mut b, "lamp", [0.0, 0.998, -0.05], [0.0, 0.0, -0.05], (0.62, 0.44), lamp(5200.0) * 9.5);
    // What looks at the room from outside is dim, not black.
    area_light(&mut b, "fill", [0.0, 0.5, 3.2], [0.0, 0.5, 0.0], (1.6, 0.9), srgb(0xc8d4ff) * 0.35);
    b.camera("camera", &Eye::new([0.0, 0.5, 2.06], [0.0, 0.485, 0.0], 38.5));
    b.finish("cornell")
}
