//! Glass, metal, lacquer and fruit in the light of one window.

use super::builder::{Builder, Sampling};
use super::canvas::Canvas;
use super::colour::{lamp, srgb};
use super::dice::Dice;
use super::node::{Aperture, Eye, Place};
use super::paint::Paint;
use super::set::{area_light, mottle};
use super::shape::Shape;
use super::sweep::smooth;
use glam::{DQuat, DVec2, DVec3};
use serde_json::json;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    room(&mut b);
    glassware(&mut b);
    bowl(&mut b);
    let chrome = b.material(Paint::new("chrome", DVec3::new(0.77, 0.78, 0.80)).metal(1.0).rough(0.02));
    b.put(Place::new("chrome ball").at(-0.075, 0.032, 0.135), &Shape::ball(0.032, 64, 32).plain(), chrome);
    let lacquer = b.material(Paint::new("car paint", srgb(0xa80f1c)).metal(0.6).rough(0.45).lacquer(0.01));
    b.put(Place::new("lacquer ball").at(0.205, 0.042, 0.09), &Shape::ball(0.042, 64, 32).plain(), lacquer);
    let pearl = b.material(Paint::new("soap pearl", srgb(0xb4aca6)).metal(1.0).rough(0.1).extension(
        "KHR_materials_iridescence",
        json!({ "iridescenceFactor": 1.0, "iridescenceIor": 1.45, "iridescenceThicknessMaximum": 420.0 }),
    ));
    b.put(Place::new("pearl").at(0.035, 0.02, 0.185), &Shape::ball(0.02, 48, 24).plain(), pearl);
    let eye = Eye::new([0.03, 0.235, 0.92], [0.005, 0.098, 0.0], 25.0).lens(Aperture::FStop(5.6), [0.0, 0.05, 0.10]);
    b.camera("camera", &eye);
    b.finish("still life")
}

/// Table with a cloth, dark wall, window on the left, a dim room behind the camera.
fn room(b: &mut Builder) {
    let grain = mottle(b, "linen", 64, 0.35, 17);
    let linen = Paint::new("linen", srgb(0xc9bfae)).texture(grain).rough(0.95);
    let linen = b.material(linen);
    let cloth = Shape::block(DVec3::new(0.75, 0.02, 0.34), 0.012, 4).at(0.0, -0.02, 0.02);
    b.put(Place::new("table"), &cloth, linen);
    let plaster = mottle(b, "plaster", 128, 0.5, 3);
    let wall = b.material(Paint::new("wall", srgb(0x7d7a5c)).texture(plaster).rough(0.95));
    let quad = Shape::quad(DVec3::new(0.0, 0.4, -0.55), DVec3::X * 2.0, DVec3::Y * 1.2, DVec2::new(3.0, 2.0));
    b.put(Place::new("wall"), &quad, wall);
    let dark = b.material(Paint::new("dark room", srgb(0x5b5148)).rough(0.9));
    let mut rest = Shape::quad(DVec3::new(0.0, 0.4, 2.2), DVec3::NEG_X * 2.0, DVec3::Y * 1.2, DVec2::ONE);
    rest.join(&Shape::quad(DVec3::new(2.0, 0.4, 0.8), DVec3::Z * 1.4, DVec3::Y * 1.2, DVec2::ONE));
    rest.join(&Shape::quad(DVec3::new(0.0, -0.8, 0.8), DVec3::X * 2.0, DVec3::NEG_Z * 1.4, DVec2::ONE));
    b.put(Place::new("dark room"), &rest.plain(), dark);
    for (i, z) in [-0.12, 0.50].into_iter().enumerate() {
        let centre = [-1.15, 0.62, z];
        area_light(b, &format!("window {i}"), centre, [0.0, 0.05, z * 0.4], (0.56, 1.1), lamp(6800.0) * 9.5);
    }
    area_light(b, "candle side", [1.5, 0.7, 0.9], [0.0, 0.1, 0.0], (0.4, 0.4), lamp(2700.0) * 5.5);
    area_light(b, "ceiling", [0.2, 1.5, 0.7], [0.1, 0.0, 0.1], (1.2, 0.8), lamp(5000.0) * 1.2);
}

/// A green bottle, a glass of wine, an amber block.
fn glassware(b: &mut Builder) {
    let green = b.material(Paint::new("green glass", DVec3::ONE).glass(1.5, srgb(0x3f8a5c), 0.012));
    // Inside first: from the bottom's middle up the inner wall, over the lip, down the outside.
    let mut bottle = smooth(&[[0.0, 0.014], [0.030, 0.014], [0.0375, 0.022], [0.0385, 0.06], [0.0385, 0.15]], 4);
    bottle.extend(smooth(&[[0.0385, 0.16], [0.034, 0.185], [0.018, 0.215], [0.0115, 0.24], [0.011, 0.29]], 4));
    bottle.extend([[0.0115, 0.298], [0.0135, 0.300], [0.0165, 0.298], [0.0168, 0.286], [0.0155, 0.280]]);
    bottle.extend(smooth(&[[0.0150, 0.278], [0.0155, 0.245], [0.022, 0.218], [0.038, 0.19], [0.043, 0.16]], 4));
    bottle.extend(smooth(&[[0.043, 0.155], [0.043, 0.06], [0.0425, 0.012], [0.038, 0.002]], 4));
    bottle.extend([[0.034, 0.0], [0.0, 0.004]]);
    b.put(Place::new("bottle").at(-0.185, 0.0005, -0.06), &Shape::lathe(&bottle, 72).plain(), green);

    let clear = b.material(Paint::new("crystal", DVec3::ONE).glass(1.52, DVec3::new(0.97, 0.99, 0.98), 0.05));
    let mut goblet =
        smooth(&[[0.0, 0.0905], [0.012, 0.0925], [0.028, 0.106], [0.0355, 0.13], [0.0335, 0.16], [0.0295, 0.186]], 4);
    goblet.extend([[0.0300, 0.1868], [0.0307, 0.186]]);
    goblet.extend(smooth(
        &[[0.0310, 0.184], [0.0352, 0.159], [0.0372, 0.129], [0.0295, 0.103], [0.0125, 0.088], [0.0050, 0.082]],
        4,
    ));
    goblet.extend(smooth(
        &[[0.0042, 0.078], [0.0034, 0.05], [0.0040, 0.02], [0.0075, 0.008], [0.020, 0.0045], [0.034, 0.0022]],
        4,
    ));
    goblet.extend([[0.0350, 0.0012], [0.0345, 0.0], [0.0, 0.0]]);
    b.put(Place::new("goblet").at(0.125, 0.0005, 0.02), &Shape::lathe(&goblet, 72).plain(), clear);
    // Wine reaches half a millimetre into the crystal, so that no film of air is left between them.
    let red = b.material(Paint::new("wine", DVec3::ONE).glass(1.345, srgb(0xb0182c), 0.02));
    let mut wine = vec![[0.0, 0.148], [0.0345, 0.148], [0.0352, 0.1476]];
    wine.extend(smooth(&[[0.0354, 0.146], [0.0363, 0.13], [0.0286, 0.1052], [0.0123, 0.0915], [0.0, 0.0895]], 4));
    b.put(Place::new("wine").at(0.125, 0.0005, 0.02), &Shape::lathe(&wine, 60).plain(), red);

    let amber = b.material(Paint::new("amber", DVec3::ONE).glass(1.54, srgb(0xe8912a), 0.03));
    let block = Shape::block(DVec3::new(0.026, 0.018, 0.02), 0.003, 4).plain();
    b.put(Place::new("amber").at(-0.165, 0.0185, 0.125).turned(DQuat::from_rotation_y(0.55)), &block, amber);
}

/// A copper bowl of oranges, and one beside it.
fn bowl(b: &mut Builder) {
    let copper = b.material(Paint::new("copper", DVec3::new(0.955, 0.638, 0.538)).metal(1.0).rough(0.18));
    let mut profile = smooth(&[[0.0, 0.010], [0.03, 0.012], [0.06, 0.028], [0.082, 0.055], [0.092, 0.072]], 7);
    profile.extend([[0.0935, 0.0735], [0.0955, 0.073]]);
    profile.extend(smooth(&[[0.095, 0.070], [0.0845, 0.0525], [0.063, 0.026], [0.036, 0.010], [0.034, 0.0]], 7));
    profile.push([0.0, 0.002]);
    b.put(Place::new("bowl").at(-0.03, 0.0005, -0.06), &Shape::lathe(&profile, 96).plain(), copper);
    let peel = peel(b);
    let peel = b.material(Paint::new("orange", DVec3::ONE).texture(peel).rough(0.42));
    let orange = b.geometry(&Shape::ball(0.036, 64, 32));
    let places = [
        (-0.066, 0.063, -0.045, 0.4),
        (0.008, 0.064, -0.040, 1.7),
        (-0.030, 0.066, -0.105, 2.9),
        (-0.028, 0.118, -0.060, 0.9),
        (0.098, 0.036, 0.115, 2.2),
    ];
    for (i, (x, y, z, turn)) in places.into_iter().enumerate() {
        let mesh = b.mesh("orange", &[(&orange, peel)]);
        let rotation = DQuat::from_euler(glam::EulerRot::YXZ, turn, 0.5 * turn, 0.3);
        b.add(Place::new(&format!("orange {i}")).at(x, y, z).turned(rotation).with(mesh));
    }
}

/// Orange peel: deep orange with pores, a green stalk at the pole.
fn peel(b: &mut Builder) -> super::builder::Texture {
    let mut dice = Dice::new(5);
    let pores: Vec<DVec2> = (0..900).map(|_| DVec2::new(dice.unit(), dice.unit())).collect();
    let canvas = Canvas::paint(256, 128, 1, |p| {
        let ring = libm::sin(std::f64::consts::PI * p.y);
        let near = pores
            .iter()
            .map(|q| {
                let dx = (p.x - q.x + 0.5).rem_euclid(1.0) - 0.5;
                DVec2::new(2.0 * dx * ring, p.y - q.y).length()
            })
            .fold(f64::INFINITY, f64::min);
        let depth = (1.0 - near / 0.012).clamp(0.0, 1.0);
        let skin = srgb(0xf08a1c).lerp(srgb(0xd06c0c), 0.7 * depth);
        if p.y < 0.035 { srgb(0x5d6a2a) } else { skin }
    });
    b.texture("peel", &canvas, Sampling::Ball)
}
