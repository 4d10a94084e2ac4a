//! A camera glides along a path through a wood of a few thousand instanced trees.

use super::builder::{Builder, Geometry, Material, Sampling};
use super::canvas::Canvas;
use super::colour::{lamp, srgb};
use super::dice::Dice;
use super::node::{Aperture, Eye, Place, facing};
use super::paint::Paint;
use super::set::area_light;
use super::shape::{Shape, direction};
use super::track::{Run, Track, beats};
use glam::{DAffine3, DQuat, DVec3};
use std::f64::consts::TAU;

/// Length, seconds, and how far the camera goes, metres.
const END: f64 = 3.0;
const WAY: f64 = 10.5;
/// Half the side of the wood, metres.
const HALF: f64 = 60.0;

pub(crate) fn make() -> Vec<u8> {
    let mut b = Builder::default();
    ground(&mut b);
    sky(&mut b);
    trees(&mut b);
    undergrowth(&mut b);
    let eye_at = |t: f64| {
        let z = 4.0 - WAY * t / END;
        DVec3::new(path(z), height(path(z), z) + 1.35, z)
    };
    let look = |t: f64| {
        let z = 4.0 - WAY * t / END - 9.0;
        DVec3::new(path(z) * 0.8, height(path(z), z) + 2.0, z) - eye_at(t)
    };
    let start = eye_at(0.0);
    let target = start + look(0.0);
    let eye = Eye::new(start.to_array(), target.to_array(), 42.0)
        .lens(Aperture::Radius(0.02), (start + 5.5 * look(0.0).normalize()).to_array())
        .shutter(180.0);
    let camera = b.camera("camera", &eye);
    let times = beats(END, 12);
    let places: Vec<_> = times.iter().map(|&t| (t, eye_at(t))).collect();
    b.animate(camera, &Track::translation(Run::Cubic, &places));
    let turns: Vec<_> = times.iter().map(|&t| (t, facing(look(t)))).collect();
    b.animate(camera, &Track::rotation(Run::Cubic, &turns));
    b.finish("forest")
}

/// Where the path runs at depth `z`.
fn path(z: f64) -> f64 {
    1.6 * libm::sin(0.22 * z + 0.4)
}

/// Height of the ground: rolling, but nearly level along the path.
fn height(x: f64, z: f64) -> f64 {
    let rolling = 0.5 * libm::sin(0.21 * x + 1.0) * libm::cos(0.17 * z) + 0.25 * libm::sin(0.5 * x - 0.4 * z);
    let away = ((x - path(z)).abs() - 1.0).clamp(0.0, 6.0) / 6.0;
    rolling * (0.15 + 0.85 * away) + 0.012 * (x - path(z)).abs().min(30.0) * away
}

/// Moss and needles, with a trodden path: colour by texture.
fn ground(b: &mut Builder) {
    let mut dice = Dice::new(41);
    let freckles: Vec<f64> = (0..4096).map(|_| dice.unit()).collect();
    let canvas = Canvas::paint(384, 384, 1, |uv| {
        let (x, z) = ((2.0 * uv.x - 1.0) * HALF, (2.0 * uv.y - 1.0) * HALF);
        let cell = |k: f64| freckles[usize::from(fold(libm::floor(x * k) * 31.0 + libm::floor(z * k) * 57.0))];
        let grain = 0.5 * cell(4.0) + 0.5 * cell(1.3);
        let moss = srgb(0x5c7a2e).lerp(srgb(0x35521f), grain);
        let trail = srgb(0xa08058).lerp(srgb(0x7d6040), grain);
        let edge = (x - path(z)).abs() + 0.35 * libm::sin(1.7 * z) * libm::sin(0.9 * z + x);
        moss.lerp(trail, ((1.05 - edge) / 0.5).clamp(0.0, 1.0))
    });
    let texture = b.texture("ground", &canvas, Sampling::Smooth);
    let material = b.material(Paint::new("ground", DVec3::ONE).texture(texture).rough(1.0));
    let shape = Shape::surface(80, 80, |u, v| {
        let (x, z) = ((2.0 * u - 1.0) * HALF, (2.0 * v - 1.0) * HALF);
        DVec3::new(x, height(x, z), z)
    });
    b.put(Place::new("ground"), &shape, material);
}

/// A whole number folded into [0, 4096).
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a whole number in [0, 4096)")]
fn fold(x: f64) -> u16 {
    x.rem_euclid(4096.0) as u16
}

/// A dome that shines from warm at the horizon to blue above, and a low sun.
fn sky(b: &mut Builder) {
    let canvas = Canvas::paint(1, 64, 2, |p| {
        let rise = (1.0 - p.y).clamp(0.0, 1.0);
        let low = srgb(0xffe3b0).lerp(srgb(0xbcd8ee), libm::sqrt(rise).min(0.6) / 0.6);
        low.lerp(srgb(0x5d93cf), ((rise - 0.15) / 0.85).clamp(0.0, 1.0))
    });
    let texture = b.texture("sky", &canvas, Sampling::Ball);
    let material = b.material(Paint::light("sky", DVec3::ONE, 1.15).light_texture(texture).rough(1.0));
    // From inside: u runs the other way round.
    let dome = Shape::surface(32, 12, |u, v| 150.0 * direction(-u, 0.5 * v) - DVec3::Y * 6.0);
    b.put(Place::new("sky"), &dome, material);
    // A disc would shine no better than this square; the dome would hide a light at infinity.
    area_light(b, "sun", [-98.0, 74.0, 72.0], [0.0, 0.0, -8.0], (9.0, 9.0), lamp(4300.0) * 1700.0);
}

/// Firs, birches and maples, each kind in three shapes.
fn trees(b: &mut Builder) {
    let bark = b.material(Paint::new("bark", srgb(0x4f3726)).rough(1.0));
    let birch_bark = b.material(Paint::new("birch bark", srgb(0xe6e0d4)).rough(0.9));
    let trunk = b.geometry(&trunk(0.11, 1.3));
    let slim = b.geometry(&trunk_shape_slim());
    let mut dice = Dice::new(1990);
    let mut taken: Vec<(f64, f64)> = Vec::new();
    let kinds: [(&str, u32, usize); 6] = [
        ("fir", 0x2f5d34, 1200),
        ("fir", 0x3e7040, 1100),
        ("fir", 0x24493a, 900),
        ("birch", 0xe0a92c, 420),
        ("maple", 0xc2481f, 300),
        ("birch", 0xa8b53c, 280),
    ];
    for (i, (kind, code, count)) in kinds.into_iter().enumerate() {
        let leaves = b.material(Paint::new(kind, srgb(code)).rough(0.9));
        let seed = 100 + i as u64;
        let crown: Geometry = b.geometry(&if kind == "fir" { fir(seed) } else { crown(seed) });
        let (stem, wood): (&Geometry, Material) =
            if kind == "fir" { (&trunk, bark) } else { (&slim, if kind == "birch" { birch_bark } else { bark }) };
        let mesh = b.mesh(kind, &[(&crown, leaves), (stem, wood)]);
        let copies = plant(&mut dice, &mut taken, count, if kind == "fir" { 1.9 } else { 1.6 });
        b.copies(Place::new(&format!("{kind} {i}")).with(mesh), &copies);
    }
}

/// Random places off the path and at least `apart`-ish metres from each other, with turn, lean and size.
fn plant(dice: &mut Dice, taken: &mut Vec<(f64, f64)>, count: usize, clear: f64) -> Vec<(DVec3, DQuat, f64)> {
    let mut copies = Vec::with_capacity(count);
    let mut tries = 0;
    while copies.len() < count && tries < 60 * count {
        tries += 1;
        // More of them where the camera passes.
        let (x, z) = (dice.between(-HALF, HALF) * 0.9, dice.between(-HALF * 0.97, 12.0));
        let off = (x - path(z)).abs();
        if off < clear || taken.iter().any(|&(p, q)| (p - x).abs() + (q - z).abs() < 0.75) {
            continue;
        }
        taken.push((x, z));
        let turn = DQuat::from_rotation_y(dice.between(0.0, TAU));
        let lean = DQuat::from_rotation_x(dice.between(-0.05, 0.05));
        let size = dice.between(0.7, 1.45);
        copies.push((DVec3::new(x, height(x, z) - 0.05, z), turn * lean, size));
    }
    copies
}

/// Mushrooms and stones along the path.
fn undergrowth(b: &mut Builder) {
    let red = b.material(Paint::new("cap", srgb(0xc92a1e)).rough(0.35).lacquer(0.1));
    let pale = b.material(Paint::new("stalk", srgb(0xeee4d0)).rough(0.8));
    let stone = b.material(Paint::new("stone", srgb(0x8b8a86)).rough(0.95));
    let cap =
        b.geometry(&Shape::lathe(&[[0.0, 0.13], [0.05, 0.12], [0.085, 0.09], [0.1, 0.055], [0.0, 0.075]], 20).plain());
    let stalk = b.geometry(&Shape::lathe(&[[0.02, 0.08], [0.018, 0.04], [0.028, -0.03]], 12).plain());
    let mushroom = b.mesh("mushroom", &[(&cap, red), (&stalk, pale)]);
    let rock = b.geometry(&lump(7, 0.3, 0.72, 0.0));
    let rock = b.mesh("stone", &[(&rock, stone)]);
    let mut dice = Dice::new(12);
    for (name, mesh, count, near, far) in [("mushrooms", mushroom, 260, 0.75, 2.6), ("stones", rock, 240, 1.0, 4.5)] {
        let copies: Vec<_> = (0..count)
            .map(|_| {
                let z = dice.between(-24.0, 5.0);
                let side = if dice.unit() < 0.5 { -1.0 } else { 1.0 };
                let x = path(z) + side * dice.between(near, far);
                let turn = DQuat::from_rotation_y(dice.between(0.0, TAU));
                (DVec3::new(x, height(x, z), z), turn, dice.between(0.5, 1.5))
            })
            .collect();
        b.copies(Place::new(name).with(mesh), &copies);
    }
}

/// A tapering trunk.
fn trunk(radius: f64, top: f64) -> Shape {
    Shape::lathe(&[[0.6 * radius, top], [radius, 0.25], [1.5 * radius, -0.1]], 9).plain()
}

/// The trunk of a leaf tree.
fn trunk_shape_slim() -> Shape {
    trunk(0.085, 2.3)
}

/// Four tiers of branches, each a jagged cone, facetted like cut paper.
fn fir(seed: u64) -> Shape {
    let mut dice = Dice::new(seed);
    let mut shape = Shape::default();
    for tier in 0..4 {
        let level = f64::from(tier);
        let (base, tip) = (0.55 + 0.72 * level, 1.75 + 0.82 * level);
        let radius = 1.12 - 0.25 * level;
        let jags: Vec<f64> = (0..12).map(|i| if i % 2 == 0 { 1.0 } else { 0.78 } * dice.between(0.92, 1.1)).collect();
        let twist = dice.between(0.0, TAU);
        let rim = |i: u32| {
            let angle = twist + TAU * f64::from(i) / 12.0;
            let r = radius * jags[(i % 12) as usize];
            DVec3::new(r * libm::sin(angle), base - 0.22 * r, r * libm::cos(angle))
        };
        let mut cone = Shape::default();
        for i in 0..12 {
            let start = super::shape::index(cone.positions.len());
            cone.positions.extend([DVec3::Y * tip, rim(i), rim(i + 1), DVec3::Y * (base + 0.12)]);
            cone.triangles.extend([[start, start + 1, start + 2], [start + 3, start + 2, start + 1]]);
        }
        cone.normals = vec![DVec3::Y; cone.positions.len()];
        cone.uvs = vec![glam::DVec2::ZERO; cone.positions.len()];
        shape.join(&cone);
    }
    shape.faceted().plain()
}

/// The crown of a leaf tree: three lumps.
fn crown(seed: u64) -> Shape {
    let mut shape = lump(seed, 0.85, 1.05, 2.6);
    shape.join(&lump(seed + 50, 0.6, 0.8, 2.1).at(0.45, 0.0, 0.2));
    shape.join(&lump(seed + 90, 0.55, 0.85, 2.25).at(-0.4, 0.0, -0.25));
    shape
}

/// A facetted, dented ball of radius `radius`, `squash` times as high, at `height`.
fn lump(seed: u64, radius: f64, squash: f64, height: f64) -> Shape {
    let mut dice = Dice::new(seed);
    let phases: [f64; 4] = std::array::from_fn(|_| dice.between(0.0, TAU));
    let shape = Shape::surface(10, 7, |u, v| {
        let d = direction(u, v);
        let bump = 1.0
            + 0.11 * libm::sin(3.1 * d.x + phases[0]) * libm::cos(3.7 * d.z + phases[1])
            + 0.10 * libm::sin(4.3 * d.y + phases[2]) * libm::cos(4.1 * d.x + phases[3]);
        radius * bump * d
    });
    shape.faceted().plain().moved(DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, squash, 1.0),
        DQuat::IDENTITY,
        DVec3::Y * height,
    ))
}
