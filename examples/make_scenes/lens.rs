//! A study in depth of field: pawns in two ranks, one of them sharp, and beads of light far behind.

use super::builder::{Builder, Material};
use super::colour::{lamp, srgb};
use super::dice::Dice;
use super::node::{Aperture, Eye, Place};
use super::paint::Paint;
use super::set::{area_light, checker};
use super::shape::Shape;
use super::sweep::smooth;
use glam::{DQuat, DVec2, DVec3};

/// Side of a square of the board, metres.
const SQUARE: f64 = 0.05;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    board(&mut b);
    let ivory = b.material(Paint::new("ivory", srgb(0xeadfc4)).rough(0.35).lacquer(0.08));
    let ebony = b.material(Paint::new("ebony", srgb(0x1d1512)).rough(0.35).lacquer(0.06));
    let red = b.material(Paint::new("red", srgb(0xb02018)).rough(0.3).lacquer(0.03));
    let pawn = b.geometry(&pawn());
    for file in 0..8 {
        let z = SQUARE * (3.5 - f64::from(file));
        for (x, paint) in [(-0.5, ivory), (1.5, ebony)] {
            // The fourth ivory pawn is the one in focus; it wears red.
            let paint: Material = if file == 3 && x < 0.0 { red } else { paint };
            let mesh = b.mesh("pawn", &[(&pawn, paint)]);
            let name = format!("pawn {file}");
            let turn = DQuat::from_rotation_y(0.7 * f64::from(file));
            b.add(Place::new(&name).at(x * SQUARE, 0.0, z).turned(turn).with(mesh));
        }
    }
    beads(&mut b);
    area_light(&mut b, "key", [-0.5, 0.55, 0.25], [0.0, 0.02, 0.0], (0.4, 0.4), lamp(4000.0) * 9.0);
    area_light(&mut b, "fill", [0.7, 0.35, 0.35], [0.0, 0.02, 0.0], (0.3, 0.5), lamp(9000.0) * 3.0);
    area_light(&mut b, "rim", [0.25, 0.5, -0.55], [0.0, 0.02, 0.0], (0.6, 0.2), lamp(5500.0) * 6.0);
    let sharp = [-0.5 * SQUARE, 0.03, SQUARE * 0.5];
    let eye = Eye::new([0.115, 0.088, 0.36], [0.010, 0.026, 0.0], 22.0).lens(Aperture::Radius(0.011), sharp);
    b.camera("camera", &eye);
    b.finish("lens")
}

/// The board and a dark wall far behind.
fn board(b: &mut Builder) {
    let squares = checker(b, srgb(0xd8c6a0), srgb(0x3a2418));
    let inlay = b.material(Paint::new("squares", DVec3::ONE).texture(squares).rough(0.25));
    let top = Shape::quad(DVec3::ZERO, DVec3::X * (4.0 * SQUARE), DVec3::NEG_Z * (4.0 * SQUARE), DVec2::splat(4.0));
    b.put(Place::new("squares"), &top, inlay);
    let wood = b.material(Paint::new("board", srgb(0x3b1d10)).rough(0.4).lacquer(0.05));
    let frame = Shape::block(DVec3::new(0.235, 0.012, 0.235), 0.005, 4).plain().at(0.0, -0.0125, 0.0);
    b.put(Place::new("board"), &frame, wood);
    let cloth = b.material(Paint::new("cloth", srgb(0x26323c)).rough(0.9));
    let floor = Shape::quad(DVec3::new(0.0, -0.0245, 0.0), DVec3::X * 4.0, DVec3::NEG_Z * 4.0, DVec2::ONE);
    b.put(Place::new("cloth"), &floor.plain(), cloth);
    let wall = Shape::quad(DVec3::new(0.0, 1.0, -2.2), DVec3::X * 4.0, DVec3::Y * 1.5, DVec2::ONE);
    let night = b.material(Paint::new("wall", srgb(0x2b3440)).rough(0.9));
    b.put(Place::new("wall"), &wall.plain(), night);
}

/// Small lamps far out of focus: each becomes an image of the aperture.
fn beads(b: &mut Builder) {
    let mut dice = Dice::new(77);
    let bead = b.geometry(&Shape::ball(0.006, 16, 8).plain());
    let paints = [2600.0, 3400.0, 5200.0, 9500.0].map(|k| {
        let hue = lamp(k);
        Paint::light("bead", hue, 26.0)
    });
    let paints = paints.map(|p| b.material(p));
    let meshes = paints.map(|p| b.mesh("bead", &[(&bead, p)]));
    for i in 0..30 {
        let place = DVec3::new(dice.between(-0.75, 0.55) - 0.12, dice.between(-0.01, 0.30), dice.between(-1.9, -1.0));
        let name = format!("bead {i}");
        b.add(Place::new(&name).at(place.x, place.y, place.z).with(meshes[i % 4]));
    }
}

/// A Staunton pawn, 52 mm high.
fn pawn() -> Shape {
    let head: Vec<[f64; 2]> = (0..=14)
        .map(|i| {
            let angle = std::f64::consts::PI * f64::from(i) / 14.0 * 0.84;
            [0.0085 * libm::sin(angle), 0.0435 + 0.0085 * libm::cos(angle)]
        })
        .collect();
    let mut profile = head;
    profile.extend([[0.0045, 0.0355], [0.0095, 0.0345], [0.0100, 0.0335], [0.0095, 0.0325], [0.0062, 0.0315]]);
    profile.extend(smooth(&[[0.0060, 0.031], [0.0062, 0.024], [0.0085, 0.015], [0.0118, 0.0105]], 6));
    profile.extend([[0.0130, 0.0100], [0.0135, 0.0090], [0.0130, 0.0080], [0.0125, 0.0075]]);
    profile.extend(smooth(&[[0.0140, 0.0070], [0.0158, 0.0050], [0.0160, 0.0025], [0.0158, 0.0010]], 4));
    profile.extend([[0.0155, 0.0], [0.0, 0.0]]);
    Shape::lathe(&profile, 48).plain()
}
