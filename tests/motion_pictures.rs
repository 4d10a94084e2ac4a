//! Motion in pictures: coverage over time against closed forms and dense quadrature, moving mirrors against frozen
//! frames, streaks of blurred things, of their reflections and shadows. Energy: `hard_cases/energy.rs`.
//!
//! Pictures are tiny and seen by a parallel camera whose pixels are one metre, so that film and world coordinates
//! agree: pixel (column, row) of a picture w × h covers x from column − w/2 and y down from h/2 − row. Independent
//! sampling where a test states a distribution: seeds are fixed.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::float_cmp,
    reason = "a test fails by panicking, prints what it measured, and holds exact values to exactness"
)]

#[path = "support/flat.rs"]
mod flat;
#[path = "support/moving.rs"]
mod moving;

use flat::{difference, disc, film, flat_scene, rectangle, reds, rushing_ball, settings};
use glam::{Quat, Vec3};
use graeco::design::Kind;
use graeco::film::Film;
use graeco::render::Settings;
use graeco::scene::{Interpolation, Material, NodeId, Property, Scene};
use graeco::time::FrameRate;
use moving::{linear, track};

/// The largest |measured − truth| in standard errors of n independent samples of a function with values 0 and 1, and
/// the part of undecided pixels that exceed three; infinite where a pixel that is certain is not exact.
fn deviations(film: &Film, n: u32, truth: impl Fn(u32, u32) -> f64) -> (f64, f64) {
    let (width, _) = film.size();
    let (mut worst, mut beyond, mut undecided) = (0.0_f64, 0.0, 0.0);
    for (i, pixel) in (0_u32..).zip(film.pixels()) {
        let (p, found) = (truth(i % width, i / width), f64::from(pixel.radiance.x));
        // Fewer than nine expected on either side: the normal law does not hold; the bound is Chebyshev's then.
        let (n, q) = (f64::from(n), p.min(1.0 - p));
        if q <= 1e-6 {
            if (found - p).abs() > 1.0 / n {
                println!("pixel {i}: {found} where {p} is certain");
                worst = f64::INFINITY;
            }
            continue;
        }
        if q * n < 9.0 {
            if (found - p).abs() > 30.0 / n {
                println!("pixel {i}: {found} where {p} is all but certain");
                worst = f64::INFINITY;
            }
            continue;
        }
        let z = (found - p).abs() / (p * (1.0 - p) / n).sqrt();
        worst = worst.max(z);
        undecided += 1.0;
        beyond += f64::from(u8::from(z > 3.0));
    }
    assert!(undecided > 10.0, "the test sees motion");
    (worst, beyond / undecided)
}

/// Mean over a pixel and the exposure by the midpoint rule, `fine` × `fine` places by `instants`.
fn quadrature(
    size: (u32, u32),
    (column, row): (u32, u32),
    (fine, instants): (u32, u32),
    inside: impl Fn(f64, f64, f64) -> bool,
) -> f64 {
    let mid = |i: u32, n: u32| (f64::from(i) + 0.5) / f64::from(n);
    let mut hits = 0_u32;
    for k in 0..instants {
        for i in 0..fine {
            for j in 0..fine {
                let x = f64::from(column) + mid(i, fine) - 0.5 * f64::from(size.0);
                let y = 0.5 * f64::from(size.1) - f64::from(row) - mid(j, fine);
                hits += u32::from(inside(x, y, mid(k, instants)));
            }
        }
    }
    f64::from(hits) / f64::from(fine * fine * instants)
}

/// What every analytic test demands: H₀, each pixel's mean is the truth. n = 4096 independent samples a pixel, seed 11;
/// all within 4.5 standard errors (α = 0.001 over 128 pixels, Šidák) and at most 3 % beyond three. The planted twin, the
/// scene at mid-exposure, must fail.
fn check(name: &str, scene: &Scene, size: (u32, u32), truth: impl Fn(u32, u32) -> f64) {
    const N: u32 = 4096;
    let (worst, beyond) = deviations(&film(scene, &settings(size, N), 0), N, &truth);
    println!("{name}: worst {worst:.2} standard errors, {:.1} % of pixels beyond three", 100.0 * beyond);
    assert!(worst < 4.5 && beyond <= 0.03, "{name}: {worst} {beyond}");
    let frozen = Settings { blur_scale: vec![("1".into(), 0.0)], ..settings(size, N) };
    assert!(deviations(&film(scene, &frozen, 0), N, &truth).0 > 10.0, "{name}: the planted twin passed");
}

#[test]
fn a_moving_edge_has_the_coverage_of_its_closed_form() {
    const SIZE: (u32, u32) = (16, 4);
    let (from, speed) = (-5.3_f32, 9.1_f32);
    let mut b = flat_scene(4);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &rectangle([-40.0, 0.0], [-40.0, 40.0]));
    b.drive(n, Property::Translation(linear(&[(0.0, Vec3::X * from), (1.0, Vec3::X * (from + speed))])));
    // ∫ clamp(e(t) − x, 0, 1) dt, by its antiderivative.
    let (from, speed) = (f64::from(from), f64::from(speed));
    let integral = |z: f64| {
        if z <= 0.0 {
            0.0
        } else if z < 1.0 {
            0.5 * z * z
        } else {
            z - 0.5
        }
    };
    check("moving edge", &b.finish(), SIZE, |column, _| {
        let x = f64::from(column) - 8.0;
        (integral(from + speed - x) - integral(from - x)) / speed
    });
}

#[test]
fn a_rotating_bar_has_the_coverage_of_dense_quadrature() {
    const SIZE: (u32, u32) = (12, 10);
    let mut b = flat_scene(10);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &rectangle([-4.5, 4.5], [-0.6, 0.6]));
    let quarter = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    b.drive(n, Property::Rotation(linear(&[(0.0, Quat::IDENTITY), (1.0, quarter)])));
    check("rotating bar", &b.finish(), SIZE, |column, row| {
        quadrature(SIZE, (column, row), (16, 512), |x, y, t| {
            let (s, c) = (t * std::f64::consts::FRAC_PI_2).sin_cos();
            (c * x + s * y).abs() < 4.5 && (c * y - s * x).abs() < 0.6
        })
    });
}

#[test]
fn a_ball_falling_along_a_cubic_spline_has_the_coverage_of_dense_quadrature() {
    const SIZE: (u32, u32) = (8, 16);
    let mut b = flat_scene(16);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &disc(2.0, 96));
    let v = |y: f32| Vec3::new(0.0, y, 0.0);
    let keys = vec![v(0.0), v(5.0), v(0.0), v(-20.0), v(-5.0), v(0.0)];
    b.drive(n, Property::Translation(track(Interpolation::CubicSpline, &[0.0, 1.0], keys)));
    check("falling ball", &b.finish(), SIZE, |column, row| {
        quadrature(SIZE, (column, row), (16, 512), |x, y, t| {
            let (t2, t3) = (t * t, t * t * t);
            let height = 5.0 * (2.0 * t3 - 3.0 * t2 + 1.0) - 5.0 * (3.0 * t2 - 2.0 * t3) - 20.0 * (t3 - t2);
            x.hypot(y - height) < 2.0
        })
    });
}

#[test]
fn a_wheel_of_ten_turns_is_as_grey_as_its_spokes_are_wide() {
    const SIZE: (u32, u32) = (10, 10);
    let (spokes, width, radius) = (5_u16, 0.4_f32, 5.0_f32);
    let mut b = flat_scene(10);
    let n = b.node(None, Vec3::ZERO);
    let at = |a: f32| Vec3::new(radius * libm::cosf(a), radius * libm::sinf(a), 0.0);
    let start = |i: u16| std::f32::consts::TAU * f32::from(i) / f32::from(spokes);
    let blades: Vec<Vec3> = (0..spokes).flat_map(|i| [Vec3::ZERO, at(start(i)), at(start(i) + width)]).collect();
    b.mesh(n, &blades);
    let keys: Vec<_> = (0..=80_u16)
        .map(|i| (f64::from(i) / 80.0, Quat::from_rotation_z(std::f32::consts::FRAC_PI_4 * f32::from(i % 8))))
        .collect();
    b.drive(n, Property::Rotation(linear(&keys)));
    // Whole turns: every point nearer than the chord is covered for the spokes' part of the circle; beyond the chord,
    // at radius r, a blade reaches an angle of 2 acos(chord / r) less.
    let (spokes, width, radius) = (f64::from(spokes), f64::from(width), f64::from(radius));
    let chord = radius * (0.5 * width).cos();
    check("wheel of ten turns", &b.finish(), SIZE, |column, row| {
        const FINE: u32 = 64;
        let mut sum = 0.0;
        for i in 0..FINE {
            for j in 0..FINE {
                let x = f64::from(column) - 5.0 + (f64::from(i) + 0.5) / f64::from(FINE);
                let y = f64::from(row) - 5.0 + (f64::from(j) + 0.5) / f64::from(FINE);
                let r = x.hypot(y);
                let hidden = if r <= chord { 0.0 } else { 2.0 * (chord / r).acos() };
                sum += spokes * (width - hidden).max(0.0) / std::f64::consts::TAU;
            }
        }
        sum / f64::from(FINE * FINE)
    });
}

/// A mirror that turns and rises while it shows still bars above it, by rays that go straight ahead and up.
fn moving_mirror() -> Scene {
    let mut b = flat_scene(10);
    let mirror = b.node(None, Vec3::ZERO);
    let slab: Vec<Vec3> = rectangle([-4.0, 4.0], [-4.0, 4.0]);
    let mesh = b.mesh(mirror, &slab);
    b.scene.materials.push(Material { roughness: 0.0, double_sided: true, ..Material::default() });
    b.scene.meshes[mesh].material = 1;
    let tilt = |a: f32| Quat::from_rotation_x(-std::f32::consts::FRAC_PI_4) * Quat::from_rotation_y(a);
    b.drive(mirror, Property::Rotation(linear(&[(0.0, tilt(-0.15)), (1.0, tilt(0.2))])));
    b.drive(mirror, Property::Translation(linear(&[(0.0, Vec3::ZERO), (1.0, Vec3::new(0.0, 1.5, 0.0))])));
    let bars = b.node(None, Vec3::new(0.0, 9.0, 0.0));
    let lay = |p: Vec3| Vec3::new(p.x, 0.0, p.y);
    for i in 0..5_u8 {
        let x = -5.0 + 2.0 * f32::from(i);
        let bar: Vec<Vec3> = rectangle([x, x + 1.0], [-9.0, 9.0]).into_iter().map(lay).collect();
        b.mesh(bars, &bar);
    }
    b.finish()
}

/// H₀: the blurred picture is the mean of frozen ones. n = 4096 independent samples a pixel against 1024 frames of 16,
/// seeds 11 and 100 + frame; 120 pixels, all within 4.5 standard errors (α = 0.001, Šidák), χ² of all within 4 standard
/// deviations of its mean. Planted twin: the mirror frozen at mid-exposure.
#[test]
fn a_moving_mirror_shows_the_mean_of_1024_frozen_frames() {
    const SIZE: (u32, u32) = (12, 10);
    const FRAMES: u16 = 1024;
    let scene = moving_mirror();
    let mut sums = vec![(0.0, 0.0); 120];
    for frame in 0..FRAMES {
        let mut frozen = settings(SIZE, 16);
        (frozen.rate, frozen.shutter) = (FrameRate::new(2048, 1).unwrap(), Some(0.0));
        frozen.sampling.seed = 100 + u64::from(frame);
        for (sum, (mean, variance)) in sums.iter_mut().zip(reds(&film(&scene, &frozen, 2 * i64::from(frame) + 1), 16)) {
            *sum = (sum.0 + mean / f64::from(FRAMES), sum.1 + variance / f64::from(FRAMES).powi(2));
        }
    }
    let mut blurred = settings(SIZE, 4096);
    // The mirror magnifies its own error by the way of the reflected ray.
    blurred.view.motion_error = 1e-5;
    let (worst, chi) = difference(&reds(&film(&scene, &blurred, 0), 4096), &sums, 4096.0);
    println!("moving mirror: worst {worst:.2} standard errors, sum of squares {chi:.2} deviations up");
    assert!(worst < 4.5 && chi < 4.0, "{worst} {chi}");
    let twin = Settings { blur_scale: vec![("1".into(), 0.0)], ..settings(SIZE, 4096) };
    assert!(difference(&reds(&film(&scene, &twin, 0), 4096), &sums, 4096.0).0 > 10.0, "the planted twin passed");
}

/// Horizontal second moment of what rows `rows` show (or hide, against `lit`).
fn spread(film: &Film, rows: std::ops::Range<u32>, lit: Option<f64>) -> f64 {
    let (width, _) = film.size();
    let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
    for row in rows {
        for column in 0..width {
            let value = f64::from(film.pixels()[(row * width + column) as usize].radiance.x);
            let w = lit.map_or(value, |lit| lit - value);
            let x = f64::from(column) + 0.5;
            (mass, first, second) = (mass + w, first + w * x, second + w * x * x);
        }
    }
    second / mass - (first / mass).powi(2)
}

/// A uniform smear of length L adds L²/12 to a thing's second moment: L = √(12 (m − m₀)), m₀ that of the frozen thing.
/// Bound: 1 %. 400 runs a pixel of the automatic design, four pixels a metre: the streaks' own error is about 0.2 %, and
/// what pixels add to second moments, 1/12, is the same in both to less than that.
#[test]
fn streaks_of_ball_reflection_and_shadow_are_as_long_as_their_amounts() {
    const SIZE: (u32, u32) = (96, 80);
    let picture = |amount: f32| {
        let mut s = settings(SIZE, 400);
        s.sampling.kind = Kind::Auto;
        film(&rushing_ball(Some(amount)), &s, 0)
    };
    let still = picture(0.0);
    let lit = f64::from(still.pixels()[40 * 96 + 1].radiance.x);
    assert!(lit > 0.1, "the wall is lit");
    let views = [("ball", 0..28, None), ("shadow", 29..51, Some(lit)), ("reflection", 56..80, None)];
    for amount in [0.5, 1.0, 1.5, 2.0] {
        let moved = picture(amount);
        for (name, rows, lit) in views.clone() {
            let length = (12.0 * (spread(&moved, rows.clone(), lit) - spread(&still, rows, lit))).sqrt();
            let want = 24.0 * f64::from(amount);
            println!("streak of the {name} at amount {amount}: {length:.3} of {want} pixels");
            assert!((length / want - 1.0).abs() < 0.01, "{name} {amount}: {length} {want}");
        }
    }
}

/// Two things of different amounts in one picture: neither takes the other's time.
#[test]
fn each_thing_keeps_its_own_time() {
    let mut b = flat_scene(8);
    let mut nodes: Vec<NodeId> = Vec::new();
    for (y, amount) in [(2.0, Some(0.0)), (-2.0, Some(2.0))] {
        let n = b.node(None, Vec3::ZERO);
        b.mesh(n, &rectangle([-0.5, 0.5], [-0.5, 0.5]));
        b.drive(n, Property::Translation(linear(&[(-1.0, Vec3::new(-6.0, y, 0.0)), (2.0, Vec3::new(6.0, y, 0.0))])));
        b.scene.nodes[n].blur_scale = amount;
        nodes.push(n);
    }
    let picture = film(&b.finish(), &settings((16, 8), 1024), 0);
    let row = |y: usize| picture.pixels()[y * 16..(y + 1) * 16].iter().filter(|p| p.radiance.x > 0.0).count();
    assert!(row(2) <= 2, "the frozen thing covers no more than it is wide: {}", row(2));
    assert!(row(6) >= 8, "the other is smeared over eight pixels: {}", row(6));
}
