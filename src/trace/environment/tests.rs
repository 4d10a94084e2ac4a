#![allow(clippy::cast_possible_truncation, reason = "fractions in [0, 1)")]

use super::*;
use crate::scene::{Image, Pixels};

fn picture(width: u32, height: u32, rotation: f32, value: impl Fn(u32, u32) -> [f32; 3]) -> scene::Environment {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| value(x, y)).collect();
    let image = Image { name: String::new(), width, height, pixels: Pixels::RgbF32(pixels) };
    scene::Environment { image, rotation, strength: 1.0 }
}

#[test]
fn the_middle_column_looks_along_minus_z_and_turns_with_the_rotation() {
    let bright = |x: u32, y: u32| if x == 8 && y == 4 { [9.0; 3] } else { [0.0; 3] };
    // Texel (8, 4) of 16 × 8 has its corner at the middle; its centre lies just right of −z and below the horizon.
    let still = Environment::new(Background::Picture(&picture(16, 8, 0.0, bright)));
    let w = Vec3A::new((PI / 16.0).sin(), -(PI / 16.0).sin(), -1.0).normalize();
    assert!(still.radiance(w).x > 8.0, "{}", still.radiance(w));
    let turned = Environment::new(Background::Picture(&picture(16, 8, 0.5 * PI, bright)));
    // A quarter turn about y takes −z to −x.
    let w = Vec3A::new(-1.0, w.y, -w.x);
    assert!(turned.radiance(w.normalize()).x > 8.0);
}

#[test]
fn densities_integrate_to_one_and_match_the_samples() {
    let env = Environment::new(Background::Picture(&picture(37, 11, 0.7, |x, y| {
        let v = if (x * 7 + y * 3) % 11 == 0 { 30.0 } else { (x % 3) as f32 * 0.2 };
        [v, 0.5 * v, 0.1 * v]
    })));
    let n = 256;
    let mut total = 0.0_f64;
    for i in 0..n {
        for j in 0..n {
            let u = Vec2::new((i as f32 + 0.5) / n as f32, (j as f32 + 0.5) / n as f32);
            let w = warp::sphere_from_square(u);
            total += f64::from(env.pdf(Vec3A::Y, Sides::Both, w)) * f64::from(4.0 * PI) / f64::from(n * n);
            let s = env.sample(Vec3A::Y, Sides::Both, u).unwrap();
            let again = env.pdf(Vec3A::Y, Sides::Both, s.wi);
            // Rounding may put a direction on the other side of a cell's border, once in thousands.
            assert!(s.radiance.is_finite() && s.pdf_solid_angle > 0.0 && again >= 0.0);
        }
    }
    // A midpoint rule over cells' edges: one cell in 37 columns by 256 points is off by at most 1 / 256 each side.
    assert!((total - 1.0).abs() < 0.02, "{total}");
}

#[test]
fn sampling_finds_the_picture_s_own_mean() {
    for (w, h) in [(1, 1), (5, 1), (1, 7), (64, 32), (2050, 3)] {
        let env = Environment::new(Background::Picture(&picture(w, h, 1.0, |x, y| {
            [((x * 31 + y * 17) % 23) as f32, 1.0, ((x + y) % 2) as f32 * 1e3]
        })));
        let n = 1 << 16;
        let mut sum = glam::DVec3::ZERO;
        for i in 0..n {
            let u = Vec2::new((i as f32 + 0.5) / n as f32, (f64::from(i) * 0.618_033_988_749_894_9).fract() as f32);
            let s = env.sample(Vec3A::Y, Sides::Both, u).unwrap();
            sum += (s.radiance / s.pdf_solid_angle).as_dvec3() / f64::from(n);
        }
        let mean = (sum / f64::from(4.0 * PI)).as_vec3();
        let error = (mean - env.mean()).abs() - env.mean() * 0.03;
        assert!(error.max_element() <= 1e-6, "{w}x{h}: {mean} {}", env.mean());
    }
}

#[test]
fn black_and_broken_pictures_give_no_light() {
    let broken = picture(4, 2, 0.0, |x, _| [f32::NAN, -1.0, if x > 2 { f32::INFINITY } else { 0.0 }]);
    assert!(Environment::new(Background::Picture(&broken)).is_black());
    assert!(Environment::new(Background::Constant(Vec3::ZERO)).is_black());
}

#[test]
fn a_gradient_s_mean_is_that_of_its_directions() {
    let env = Environment::new(Background::Gradient { zenith: Vec3::X, horizon: Vec3::Y, nadir: Vec3::Z });
    let n = 4096;
    let mut sum = Vec3::ZERO;
    for i in 0..n {
        let u = Vec2::new(0.5, (i as f32 + 0.5) / n as f32);
        let w = warp::sphere_from_square(u);
        // The sphere's warp has its pole on z: turn it up.
        sum += env.radiance(Vec3A::new(w.x, w.z, w.y)) / n as f32;
    }
    assert!((sum - env.mean()).abs().max_element() < 1e-3, "{sum}");
}
