//! Stage furniture that several shots share: area lights, rooms, checked floors.

use super::builder::{Builder, Material, Sampling, Texture};
use super::canvas::Canvas;
use super::dice::Dice;
use super::node::Place;
use super::paint::Paint;
use super::shape::Shape;
use glam::{DVec2, DVec3};

/// A rectangular area light at `centre` that faces `target`, `width × height` metres, level with the horizon.
pub(crate) fn area_light(
    b: &mut Builder,
    name: &str,
    centre: [f64; 3],
    target: [f64; 3],
    (width, height): (f64, f64),
    radiance: DVec3,
) {
    let centre = DVec3::from_array(centre);
    let out = (DVec3::from_array(target) - centre).normalize();
    let right = if out.cross(DVec3::Y).length() > 1e-6 { DVec3::Y.cross(out).normalize() } else { DVec3::X };
    let up = out.cross(right);
    let quad = Shape::quad(centre, right * (0.5 * width), up * (0.5 * height), DVec2::ONE).plain();
    let material = b.material(Paint::light(name, radiance, 1.0));
    b.put(Place::new(name), &quad, material);
}

/// A checkerboard of two linear colours: 2 × 2 texels, tiled.
pub(crate) fn checker(b: &mut Builder, one: DVec3, other: DVec3) -> Texture {
    let canvas = Canvas::paint(2, 2, 1, |p| if (p.x < 0.5) == (p.y < 0.5) { one } else { other });
    b.texture("checker", &canvas, Sampling::Hard)
}

/// A level floor at height `y`, `2 half × 2 half` metres, with the texture's tiles `tile` metres wide.
pub(crate) fn floor(b: &mut Builder, y: f64, half: f64, tile: f64, material: Material) {
    let quad = Shape::quad(DVec3::Y * y, DVec3::X * half, DVec3::NEG_Z * half, DVec2::splat(2.0 * half / tile));
    b.put(Place::new("floor"), &quad, material);
}

/// A photographer's sweep: a floor that curves up into a wall at `z = back`, rounded with `radius`; its upper edge is
/// at `height`.
pub(crate) fn sweep(half: f64, front: f64, back: f64, radius: f64, height: f64) -> Shape {
    let straight = front - (back + radius);
    let arc = radius * std::f64::consts::FRAC_PI_2;
    let wall = height - radius;
    let rows = 48;
    let total = straight + arc + wall;
    let mut shape = Shape::surface(1, rows, |u, v| {
        // v runs down the picture: from the wall's upper edge to the floor's front.
        let s = total * (1.0 - v);
        let x = half * (2.0 * u - 1.0);
        if s < straight {
            DVec3::new(x, 0.0, front - s)
        } else if s < straight + arc {
            let angle = (s - straight) / radius;
            DVec3::new(x, radius * (1.0 - libm::cos(angle)), back + radius - radius * libm::sin(angle))
        } else {
            DVec3::new(x, radius + (s - straight - arc), back)
        }
    });
    // Exact normals: differences straddle the seams of the three parts.
    for (normal, p) in shape.normals.iter_mut().zip(&shape.positions) {
        let up = ((radius - p.y) / radius).clamp(0.0, 1.0);
        *normal = DVec3::new(0.0, up, libm::sqrt(1.0 - up * up));
        if p.z >= back + radius {
            *normal = DVec3::Y;
        }
    }
    shape
}

/// Seamless mottling about 1: cloth, plaster, wood fibre. `grain` is its depth.
pub(crate) fn mottle(b: &mut Builder, name: &str, size: u32, grain: f64, seed: u64) -> Texture {
    let mut dice = Dice::new(seed);
    let count = (size * size) as usize;
    let noise: Vec<f64> = (0..count).map(|_| dice.unit()).collect();
    let wrap = |i: f64| libm::floor(i).rem_euclid(f64::from(size));
    let canvas = Canvas::paint(size, size, 1, |p| {
        let q = p * f64::from(size);
        let mut sum = 0.0;
        for dy in -1..=1 {
            for dx in -1..=1 {
                let (x, y) = (wrap(q.x + f64::from(dx)), wrap(q.y + f64::from(dy)));
                sum += noise[texel(x, y, size)] / 9.0;
            }
        }
        DVec3::splat(1.0 - grain * sum)
    });
    b.texture(name, &canvas, Sampling::Smooth)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers in [0, size)")]
fn texel(x: f64, y: f64, size: u32) -> usize {
    y as usize * size as usize + x as usize
}
