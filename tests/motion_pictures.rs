//! Motion in pictures: coverage over time against closed forms and dense quadrature, moving mirrors against frozen
//! frames, streaks of blurred things, of their reflections and shadows, and the physics of an exposure.
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

#[path = "support/moving.rs"]
mod moving;

use glam::{Quat, Vec3, Vec4};
use graeco::design::{DesignOptions, Kind};
use graeco::film::{Film, FilterSpec};
use graeco::output::PixelAspect;
use graeco::render::{Progress, Scanning, Settings, Shot, Surroundings};
use graeco::scene::rig::Playback;
use graeco::scene::view::ViewRequest;
use graeco::scene::{Interpolation, Light, LightShape, Material, NodeId, Projection, Property, Scene};
use graeco::time::{FrameRate, ShutterPhase};
use graeco::trace::environment::Background;
use graeco::trace::texture::TextureFilter;
use moving::{Builder, linear, track};

/// One exposure of a second from instant 0: independent sampling, no bounce.
fn settings(size: (u32, u32), runs: u32) -> Settings {
    Settings {
        size,
        crop: None,
        pixel_aspect: PixelAspect::SQUARE,
        rate: FrameRate::new(1, 1).unwrap(),
        shutter: Some(1.0),
        shutter_phase: ShutterPhase::Start,
        shutter_curve: "box".into(),
        scanning: Scanning::Progressive,
        line_height: 1.0,
        view: ViewRequest { motion_error: 1e-3, size, pixel_aspect: 1.0, ..ViewRequest::default() },
        playback: Playback::default(),
        blur_scale: Vec::new(),
        sampling: DesignOptions { kind: Kind::Random, runs, seed: 11, ..DesignOptions::default() },
        adaptive: None,
        filter: FilterSpec::BOX,
        texture_filter: TextureFilter::Point,
        bounces: 0,
        sure_bounces: 2,
        caustics: graeco::trace::path::Caustics::default(),
        aovs: Default::default(),
    }
}

fn film(scene: &Scene, settings: &Settings, frame: i64) -> Film {
    let surroundings = Surroundings { background: Background::Black, name: "black".into() };
    let mut shot = Shot::new(scene, settings, &surroundings, "test").unwrap();
    let film = shot.render(frame, &Progress::default()).unwrap().unwrap().film;
    assert_eq!(film.rejected(), 0, "no sample is rejected");
    film
}

/// A scene seen by a parallel camera `height` metres high, with a white material that shows as it is.
fn flat_scene(height: u16) -> Builder {
    let mut b = Builder::new(20.0);
    let ymag = f32::from(height) / 2.0;
    b.scene.cameras[0].projection = Projection::Orthographic { xmag: ymag, ymag };
    b.scene.materials[0] = white();
    b
}

fn white() -> Material {
    Material { unlit: true, double_sided: true, ..Material::default() }
}

/// A rectangle in the plane z = 0.
fn rectangle(x: [f32; 2], y: [f32; 2]) -> Vec<Vec3> {
    let p = |i: usize, j: usize| Vec3::new(x[i], y[j], 0.0);
    vec![p(0, 0), p(1, 0), p(1, 1), p(0, 0), p(1, 1), p(0, 1)]
}

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

/// A disc as a polygon of `n` sides.
fn disc(radius: f32, n: u16) -> Vec<Vec3> {
    let at = |i: u16| {
        let a = std::f32::consts::TAU * f32::from(i) / f32::from(n);
        Vec3::new(radius * libm::cosf(a), radius * libm::sinf(a), 0.0)
    };
    (0..n).flat_map(|i| [Vec3::ZERO, at(i), at(i + 1)]).collect()
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

/// Largest difference of two films of `n` runs or more in standard errors, and how many standard deviations the sum of
/// all their squares (χ² of as many degrees as pixels) lies above its mean. Pixels of which fewer than nine runs decide
/// know their variance too badly for that: they may differ by thirty runs.
fn difference(a: &[(f64, f64)], b: &[(f64, f64)], n: f64) -> (f64, f64) {
    let (mut worst, mut squares, mut noisy) = (0.0_f64, 0.0, 0.0);
    for (&(x, vx), &(y, vy)) in a.iter().zip(b) {
        if vx.min(vy) >= 9.0 / (n * n) {
            let z = (x - y).abs() / (vx + vy).sqrt();
            worst = worst.max(z);
            noisy += 1.0;
            squares += z * z;
        } else if (x - y).abs() > 30.0 / n {
            worst = f64::INFINITY;
        }
    }
    assert!(noisy > 10.0, "the test sees motion");
    (worst, (squares - noisy) / (2.0_f64 * noisy).sqrt())
}

fn reds(film: &Film) -> Vec<(f64, f64)> {
    film.pixels().iter().map(|p| (f64::from(p.radiance.x), f64::from(p.variance.x))).collect()
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
        for (sum, (mean, variance)) in sums.iter_mut().zip(reds(&film(&scene, &frozen, 2 * i64::from(frame) + 1))) {
            *sum = (sum.0 + mean / f64::from(FRAMES), sum.1 + variance / f64::from(FRAMES).powi(2));
        }
    }
    let mut blurred = settings(SIZE, 4096);
    // The mirror magnifies its own error by the way of the reflected ray.
    blurred.view.motion_error = 1e-5;
    let (worst, chi) = difference(&reds(&film(&scene, &blurred, 0)), &sums, 4096.0);
    println!("moving mirror: worst {worst:.2} standard errors, sum of squares {chi:.2} deviations up");
    assert!(worst < 4.5 && chi < 4.0, "{worst} {chi}");
    let twin = Settings { blur_scale: vec![("1".into(), 0.0)], ..settings(SIZE, 4096) };
    assert!(difference(&reds(&film(&scene, &twin, 0)), &sums, 4096.0).0 > 10.0, "the planted twin passed");
}

/// A ball (of `rings` × 2 `rings` facets).
fn ball(radius: f32, rings: u16) -> Vec<Vec3> {
    let at = |i: u16, j: u16| {
        let (a, e) = (
            std::f32::consts::PI * f32::from(j) / f32::from(rings),
            std::f32::consts::PI * (f32::from(i) / f32::from(rings) - 0.5),
        );
        radius * Vec3::new(libm::cosf(e) * libm::cosf(a), libm::sinf(e), libm::cosf(e) * libm::sinf(a))
    };
    let quads = (0..rings).flat_map(|i| (0..2 * rings).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j + 1), at(i, j + 1), at(i, j), at(i + 1, j), at(i + 1, j + 1)])
        .collect()
}

/// A ball that rushes by at y = 6, its shadow on a wall behind at y = 0, its reflection in a slanted mirror at y = −7.
fn rushing_ball(amount: Option<f32>) -> Scene {
    let mut b = flat_scene(20);
    let n = b.node(None, Vec3::ZERO);
    b.mesh(n, &ball(1.0, 12));
    // Six metres in the exposure, and on beyond it: amounts above 1 reach there.
    let keys = [(-1.0, Vec3::new(-9.0, 6.0, 0.0)), (2.0, Vec3::new(9.0, 6.0, 0.0))];
    b.drive(n, Property::Translation(linear(&keys)));
    b.scene.nodes[n].blur_scale = amount;
    let wall = b.node(None, Vec3::new(0.0, 0.0, -6.0));
    let mesh = b.mesh(wall, &rectangle([-12.0, 12.0], [-3.0, 3.0]));
    b.scene.materials.push(Material { metallic: 0.0, double_sided: true, ..Material::default() });
    b.scene.meshes[mesh].material = 1;
    let mirror = b.node(None, Vec3::new(0.0, -7.0, 0.0));
    let slanted: Vec<Vec3> = rectangle([-12.0, 12.0], [-2.0, 2.0]).iter().map(|p| Vec3::new(p.x, p.y, -p.y)).collect();
    let mesh = b.mesh(mirror, &slanted);
    b.scene.materials.push(Material { roughness: 0.0, double_sided: true, ..Material::default() });
    b.scene.meshes[mesh].material = 2;
    let sun = b.node(None, Vec3::ZERO);
    b.scene.nodes[sun].local = graeco::scene::LocalTransform::Parts {
        translation: Vec3::ZERO,
        rotation: Quat::from_rotation_x(-std::f32::consts::FRAC_PI_4),
        scale: Vec3::ONE,
    };
    b.scene.nodes[sun].light = Some(0);
    let shape = LightShape::Directional { angular_radius: 0.0 };
    b.scene.lights.push(Light { name: String::new(), shape, intensity: Vec3::splat(3.0), range: None });
    b.finish()
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

#[test]
fn amount_zero_is_the_frozen_picture_and_amount_one_is_none_bit_for_bit() {
    const SIZE: (u32, u32) = (24, 20);
    // Centred on instant 0, so that the frozen picture is the same frame.
    let centred = |shutter| {
        let mut s = settings(SIZE, 32);
        (s.shutter, s.shutter_phase) = (Some(shutter), ShutterPhase::Centre);
        s
    };
    let bits = |scene: &Scene, s: &Settings| -> Vec<[u32; 3]> {
        film(scene, s, 0).pixels().iter().map(|p| p.radiance.to_array().map(f32::to_bits)).collect()
    };
    let frozen = bits(&rushing_ball(None), &centred(0.0));
    assert_eq!(bits(&rushing_ball(Some(0.0)), &centred(1.0)), frozen);
    let plain = bits(&rushing_ball(None), &centred(1.0));
    assert_eq!(bits(&rushing_ball(Some(1.0)), &centred(1.0)), plain);
    assert_ne!(plain, frozen);
    let overridden = Settings { blur_scale: vec![("1".into(), 0.0)], ..centred(1.0) };
    assert_eq!(bits(&rushing_ball(None), &overridden), frozen);
}

/// H₀: the exposure [0, 1) is 0.3 [0, 0.3) + 0.7 [0.3, 1). n = 2048 independent samples a pixel each, seeds 11 to 13;
/// α as above. Planted twin: equal weights.
#[test]
fn an_exposure_is_the_mean_of_its_parts_by_length() {
    const SIZE: (u32, u32) = (24, 20);
    let scene = rushing_ball(None);
    let part = |frame: i64, length: f64, seed: u64| {
        let mut s = settings(SIZE, 2048);
        (s.rate, s.shutter) = (FrameRate::new(10, 1).unwrap(), Some(length));
        s.sampling.seed = seed;
        reds(&film(&scene, &s, frame))
    };
    let (whole, first, second) = (part(0, 10.0, 11), part(0, 3.0, 12), part(3, 7.0, 13));
    let join = |a: f64, b: f64| -> Vec<(f64, f64)> {
        let parts = first.iter().zip(&second);
        parts.map(|(x, y)| (a * x.0 + b * y.0, a * a * x.1 + b * b * y.1)).collect()
    };
    let (worst, chi) = difference(&whole, &join(0.3, 0.7), 2048.0);
    println!("sum of exposures: worst {worst:.2} standard errors, sum of squares {chi:.2} deviations up");
    assert!(worst < 4.8 && chi < 4.0, "{worst} {chi}");
    assert!(difference(&whole, &join(0.5, 0.5), 2048.0).0 > 10.0, "the planted twin passed");
}

/// H₀: the light of a moving thing, over the picture, is that of the still one (its area) at any speed. n = 4096
/// independent samples a pixel, seed 11, 160 pixels; within 3.3 standard errors (α = 0.004 over 4 speeds, Šidák).
/// Planted twin: normalisation by the streak's area.
#[test]
fn a_thing_gives_the_same_light_however_fast_it_moves() {
    const SIZE: (u32, u32) = (20, 8);
    for speed in [0.0_f32, 0.7, 5.0, 12.0] {
        let mut b = flat_scene(8);
        let n = b.node(None, Vec3::ZERO);
        b.mesh(n, &disc(2.0, 64));
        let keys = [(0.0, Vec3::NEG_X * speed / 2.0), (1.0, Vec3::X * speed / 2.0)];
        b.drive(n, Property::Translation(linear(&keys)));
        b.scene.materials[0].base_color = Vec4::new(0.5, 0.5, 0.5, 1.0);
        let estimates = reds(&film(&b.finish(), &settings(SIZE, 4096), 0));
        let (light, variance) = estimates.iter().fold((0.0, 0.0), |(s, v), e| (s + e.0, v + e.1));
        let truth = 0.5 * 64.0 * 0.5 * 4.0 * (std::f64::consts::TAU / 64.0).sin();
        let z = (light - truth) / variance.sqrt();
        println!("light at speed {speed}: {light:.4} of {truth:.4}, {z:.2} standard errors");
        assert!(z.abs() < 3.3, "{speed}: {light} {truth} {z}");
        let twin = light * 2.0 / (2.0 + f64::from(speed));
        assert!(speed < 0.5 || ((twin - truth) / variance.sqrt()).abs() > 10.0, "the planted twin passed");
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
