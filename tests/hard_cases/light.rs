//! Case 8. Light at its limits. What could blow up is the solid angle (cancellation), the distance squared (underflow,
//! overflow) and sums of power; irradiance by light sampling must stay within the stated bound of its closed form.
//! Twins: the solid angle by unit vectors in `f32`, sampling by area, unsigned cosines, sums in `f32`.

use glam::{Affine3A, DVec3, Vec2, Vec3, Vec3A};
use graeco::scene::{
    Geometry, Instance, Light, LightShape, Material, Mesh, Motion, Projection, Scene, Stage, StageCamera, StageLight,
};
use graeco::time::Exposure;
use graeco::trace::bsdf::Materials;
use graeco::trace::environment::{Background, Environment, Sides};
use graeco::trace::lights::{LightQuery, Lights};
use graeco::trace::texture::TextureFilter;

fn stage() -> Stage {
    let camera = StageCamera {
        motion: Motion::still(Affine3A::IDENTITY),
        projection: Projection::Perspective { yfov: 1.0, aspect: None },
        aperture_radius: 0.0,
        focus_distance: [1.0; 2],
    };
    let interval = Exposure { open: 0.0, close: 1.0 };
    Stage { interval, camera, geometries: Vec::new(), instances: Vec::new(), lights: Vec::new() }
}

/// A scene whose one emitter is `positions`, three a triangle, seen from both sides.
fn emitter(positions: Vec<Vec3>, emissive: f32) -> (Scene, Stage) {
    let (mut scene, mut stage) = (Scene::default(), stage());
    let count = u32::try_from(positions.len() / 3).expect("tests stay below four thousand million");
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    scene.materials.push(Material { emissive: Vec3::splat(emissive), double_sided: true, ..Material::default() });
    scene.meshes.push(Mesh { material: 0, triangles, positions, ..Mesh::default() });
    stage.geometries.push(Geometry { mesh: 0, keys: Vec::new(), times: Vec::new() });
    let motion = Motion::still(Affine3A::IDENTITY);
    stage.instances.push(Instance { geometry: 0, motion, node: 0, permanent: true });
    (scene, stage)
}

/// A square of half side `half` about the origin, in the plane y = 0.
fn square(half: f32) -> Vec<Vec3> {
    let at = |x: f32, z: f32| Vec3::new(x * half, 0.0, z * half);
    vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)]
}

/// Irradiance at `p` on normal `n` over an n × n midpoint grid of the light's pair. Everything drawn must be finite.
fn irradiance((scene, stage): &(Scene, Stage), p: Vec3, n: Vec3, grid: u16) -> f64 {
    let materials = Materials::new(scene, TextureFilter::Mip);
    let environment = Environment::new(Background::Black);
    let lights = Lights::build(scene, stage, &materials, &environment);
    let q = LightQuery { position: p.into(), normal: n.into(), sides: Sides::Above, u_time: 0.0 };
    let mut sum = 0.0;
    for i in 0..grid {
        for j in 0..grid {
            let u = (Vec2::new(f32::from(i), f32::from(j)) + 0.5) / f32::from(grid);
            if let Some(s) = lights.choice(&q).and_then(|mut choice| lights.sample(&mut choice, u)) {
                assert!(s.pdf_solid_angle.is_finite() && s.pdf_solid_angle > 0.0 && s.radiance.is_finite(), "{s:?}");
                assert!(s.wi.is_normalized() && s.distance >= 0.0, "{s:?}");
                sum += f64::from(s.radiance.x) * f64::from(q.normal.dot(s.wi).max(0.0)) / f64::from(s.pdf_solid_angle);
            }
        }
    }
    sum / (f64::from(grid) * f64::from(grid))
}

/// Lambert's polygon formula for the square of [`square`], unit radiance, the whole of it above the surface.
fn exact(half: f32, p: Vec3, n: Vec3) -> f64 {
    let h = f64::from(half);
    let corners = [(-h, -h), (h, -h), (h, h), (-h, h)].map(|(x, z)| DVec3::new(x, 0.0, z) - p.as_dvec3());
    let mut sum = 0.0;
    for i in 0..4 {
        let (a, b) = (corners[i].normalize(), corners[(i + 1) % 4].normalize());
        let across = a.cross(b);
        sum += across.length().atan2(a.dot(b)) * across.normalize().dot(n.as_dvec3());
    }
    0.5 * sum.abs()
}

/// The formula that the twin gets wrong: the triple product of unit vectors.
fn naive_solid_angle(corners: [Vec3; 3]) -> f32 {
    let [a, b, c] = corners.map(Vec3::normalize);
    let volume = a.dot(b.cross(c)).abs();
    2.0 * libm::atan2f(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// The same of both triangles of [`square`], seen from `p`.
fn naive_square(half: f32, p: Vec3) -> f32 {
    square(half).chunks(3).map(|t| naive_solid_angle([t[0] - p, t[1] - p, t[2] - p])).sum()
}

/// The twin of [`irradiance`] that draws points evenly over the area of [`square`], `grid`² of them.
fn by_area(half: f32, p: Vec3, n: Vec3, grid: u16) -> f64 {
    let mut sum = 0.0;
    for i in 0..grid {
        for j in 0..grid {
            let at = |k: u16| half * (2.0 * (f32::from(k) + 0.5) / f32::from(grid) - 1.0);
            let way = Vec3::new(at(i), 0.0, at(j)) - p;
            let (d2, wi) = (way.length_squared(), way.normalize());
            sum += f64::from(n.dot(wi).max(0.0) * wi.y.abs() * 4.0 * half * half / d2);
        }
    }
    sum / (f64::from(grid) * f64::from(grid))
}

/// Bound: a square of half side h at distance 1 has A / (1 + O(h²)); rounding of sampled directions and densities
/// adds γ₆₄; a 24 × 24 midpoint grid leaves 2e-3. Twin: unit vectors.
#[test]
fn a_light_that_shrinks_to_a_point_keeps_its_irradiance() {
    let (mut worst, mut twin) = (0.0_f64, 0.0_f64);
    for step in 0..30_u8 {
        let half = libm::powf(2.0, -f32::from(step));
        let got = irradiance(&emitter(square(half), 1.0), Vec3::new(0.0, -1.0, 0.0), Vec3::Y, 24);
        let want = f64::from(4.0 * half * half);
        let closed = if step < 10 { exact(half, Vec3::new(0.0, -1.0, 0.0), Vec3::Y) } else { want };
        assert!((got / closed - 1.0).abs() < 2e-3, "half side {half}: {got} {closed}");
        worst = worst.max((got / closed - 1.0).abs());
        if step >= 6 {
            let from = Vec3::new(3.0, 1.0, 2.0);
            let naive = f64::from(naive_square(half, from));
            let angle = want * f64::from(from.y) / f64::from(from.length()).powi(3);
            twin = twin.max((naive / angle - 1.0).abs());
        }
    }
    println!("shrinking to a point: {worst:.1e}, its naive twin {twin:.1e}");
    assert!(twin > 0.1, "the twin went unnoticed: {twin}");
}

/// A tiny solid angle must be right to 1e-3. Seen obliquely from (3, 1, 2), a triangle of 2⁻¹⁴: its solid angle is
/// 7e-11 sr; unit vectors cancel to γ, larger than that.
#[test]
fn a_tiny_solid_angle_keeps_its_digits_and_the_naive_formula_does_not() {
    let s = libm::powf(2.0, -14.0);
    let from = Vec3::new(3.0, 1.0, 2.0);
    let triangle = vec![Vec3::ZERO, Vec3::new(s, 0.0, 0.0), Vec3::new(0.0, 0.0, s)];
    let n = -from.normalize();
    let d2 = from.as_dvec3().length_squared();
    let solid_angle = 0.5 * f64::from(s) * f64::from(s) * (1.0 / d2.sqrt()) / d2;
    let check = |got: f64| (got / solid_angle - 1.0).abs() < 1e-3;
    let got = irradiance(&emitter(triangle.clone(), 1.0), from, n, 16);
    assert!(check(got), "{got} {solid_angle}");
    println!("tiny solid angle: {:.1e}", (got / solid_angle - 1.0).abs());
    let naive = naive_solid_angle([triangle[0] - from, triangle[1] - from, triangle[2] - from]);
    println!("its naive twin: {:.1e}", (f64::from(naive) / solid_angle - 1.0).abs());
    assert!(!check(f64::from(naive)), "the naive formula should have failed: {naive}");
}

/// Bound: 10⁻⁶. Twin: unit vectors, whose arc tangent of nothing and less than nothing is half the sphere.
#[test]
fn a_light_seen_edge_on_gives_nothing() {
    let light = emitter(square(1.0), 1.0);
    let mut twin = 0.0_f32;
    for x in [1.0_f32, 1.000_000_1, 2.0, 1e3] {
        let p = Vec3::new(x, 0.0, 0.0);
        assert!(irradiance(&light, p, Vec3::NEG_X, 16) <= 1e-6);
        twin = twin.max(naive_square(1.0, p));
        // Nearly edge-on.
        let p = Vec3::new(x, 1e-7, 0.1);
        twin = twin.max((f64::from(naive_square(1.0, p)) - exact(1.0, p, Vec3::NEG_X)).abs() as f32);
        assert!(irradiance(&light, p, Vec3::NEG_X, 64) <= exact(1.0, p, Vec3::NEG_X) * 1.05 + 1e-6, "{x}");
    }
    assert!(twin > 1e-3, "the twin went unnoticed: {twin}");
}

/// Bound: at height h over a square of half side 1 all but h of the hemisphere is filled: π (1 − O(h)); to 1 %. Twin:
/// points drawn by area, of which hardly one is near.
#[test]
fn a_light_that_touches_the_surface_fills_the_hemisphere() {
    let light = emitter(square(1.0), 1.0);
    let mut worst = 0.0_f64;
    for height in [1e-2_f32, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7] {
        let p = Vec3::new(0.125, -height, 0.25);
        let (got, want) = (irradiance(&light, p, Vec3::Y, 64), exact(1.0, p, Vec3::Y));
        // Both triangles meet in an edge near the point, where neither angle is smooth: the grid leaves 1 %.
        assert!((got / want - 1.0).abs() < 0.01, "height {height}: {got} {want}");
        worst = worst.max((got / want - 1.0).abs());
    }
    let near = Vec3::new(0.125, -1e-3, 0.25);
    let twin = (by_area(1.0, near, Vec3::Y, 64) / exact(1.0, near, Vec3::Y) - 1.0).abs();
    println!("touching: {worst:.1e}, sampling by area {twin:.1e}");
    assert!(twin > 0.01, "the twin went unnoticed: {twin}");
    let inside = irradiance(&light, Vec3::new(0.125, 0.0, 0.25), Vec3::Y, 16);
    assert!(inside.is_finite());
}

/// Bound: exactly nothing. Twin: the cosine without its sign.
#[test]
fn a_light_behind_the_surface_gives_nothing() {
    let light = emitter(square(1.0), 1.0);
    assert!(irradiance(&light, Vec3::new(0.0, -1.0, 0.0), Vec3::NEG_Y, 16) <= 0.0);
    assert!(Vec3::NEG_Y.dot(Vec3::Y).abs() > 0.0, "the twin went unnoticed");
}

/// Bound: π to 1 %. Twin: unit vectors in `f32`, whose corners are opposite one another.
#[test]
fn a_light_larger_than_the_scene_is_a_sky() {
    let mut worst = 0.0_f64;
    for half in [1e3_f32, 1e6, 1e9, 1e12] {
        let got = irradiance(&emitter(square(half), 1.0), Vec3::new(0.3, -1.0, 0.2), Vec3::Y, 64);
        assert!((got / std::f64::consts::PI - 1.0).abs() < 0.01, "half side {half}: {got}");
        worst = worst.max((got / std::f64::consts::PI - 1.0).abs());
    }
    // Nearly a hemisphere.
    let twin = [1e6_f32, 1e9, 1e12]
        .map(|half| (f64::from(naive_square(half, Vec3::new(0.3, -1.0, 0.2))) / std::f64::consts::TAU - 1.0).abs());
    println!("larger than the scene: {worst:.1e}, its naive twin {twin:.1?}");
    assert!(twin.iter().any(|off| *off > 0.01), "the twin went unnoticed: {twin:?}");
}

/// Radiance is linear bit for bit: scaled by a power of two, every sample is; no power overflows the tree. Twin: powers
/// squared on the way, and the share of the weak one by a quotient of powers.
#[test]
fn radiance_of_1e30_and_1e_minus_30_scales_exactly() {
    let unit = irradiance(&emitter(square(0.7), 1.0), Vec3::new(0.2, -1.0, 0.4), Vec3::Y, 16);
    for exponent in [-100_i16, -60, 60, 100] {
        let scale = libm::ldexpf(1.0, exponent.into());
        let got = irradiance(&emitter(square(0.7), scale), Vec3::new(0.2, -1.0, 0.4), Vec3::Y, 16);
        assert_eq!((got / f64::from(scale)).to_bits(), unit.to_bits(), "2^{exponent}");
    }
    // Beside each other: the strong one is found, the weak one does no harm.
    let (mut scene, mut stage) = emitter(square(0.5), 1e30);
    let weak = emitter(square(0.5), 1e-30);
    scene.materials.push(weak.0.materials[0].clone());
    scene.meshes.push(Mesh { material: 1, ..weak.0.meshes[0].clone() });
    stage.geometries.push(Geometry { mesh: 1, keys: Vec::new(), times: Vec::new() });
    let motion = Motion::still(Affine3A::from_translation(Vec3::X * 3.0));
    stage.instances.push(Instance { geometry: 1, motion, node: 0, permanent: true });
    let got = irradiance(&(scene, stage), Vec3::new(0.0, -1.0, 0.0), Vec3::Y, 24);
    assert!((got / (1e30 * exact(0.5, Vec3::new(0.0, -1.0, 0.0), Vec3::Y)) - 1.0).abs() < 5e-3, "{got}");
    let (strong, weak) = (1e30_f32, 1e-30_f32);
    assert!(!(strong * strong).is_finite() && weak / (strong + weak) <= 0.0, "the twin went unnoticed");
}

/// Bound: nothing, and no number that is none. Twin: shares of no power.
#[test]
fn lights_without_power_or_size_do_nothing() {
    let dark = emitter(square(1.0), 0.0);
    assert!(irradiance(&dark, Vec3::new(0.0, -1.0, 0.0), Vec3::Y, 4) <= 0.0);
    let p = Vec3::new(1.0, 2.0, 3.0);
    let degenerate = emitter(vec![p, p, p, p, p * 2.0, p * 3.0], 1.0);
    assert!(irradiance(&degenerate, Vec3::new(0.0, -1.0, 0.0), Vec3::Y, 4) <= 0.0);
    let mut lamp = (Scene::default(), stage());
    for (shape, intensity) in [
        (LightShape::Point { radius: 0.0 }, 0.0),
        (LightShape::Point { radius: 1e-30 }, 1.0),
        (LightShape::Spot { radius: 0.0, inner_cone: 0.5, outer_cone: 0.5 }, 1.0),
        (LightShape::Directional { angular_radius: 3.0 }, 1e-30),
    ] {
        let light = Light { name: String::new(), shape, intensity: Vec3::splat(intensity), range: Some(1e-20) };
        lamp.1.lights.push(StageLight { light, motion: Motion::still(Affine3A::IDENTITY), node: 0 });
    }
    // At the lamps' very place, and away from them.
    for p in [Vec3::ZERO, Vec3::NEG_Y, Vec3::splat(1e-22)] {
        assert!(irradiance(&lamp, p, Vec3::Y, 8).is_finite());
    }
    let (power, all) = (0.0_f32, 0.0_f32);
    assert!((power / all).is_nan(), "the twin went unnoticed");
}

/// A plane of 10⁶ triangles is the same light as two. Twin: a running sum of their powers in `f32`.
#[test]
fn a_million_triangles_are_one_light() {
    let n = 707_u16;
    let mut positions = Vec::new();
    let at = |i: u16, j: u16| {
        let place = |k: u16| 2.0 * f32::from(k) / f32::from(n) - 1.0;
        Vec3::new(place(i), 0.0, place(j))
    };
    for i in 0..n {
        for j in 0..n {
            positions.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    assert!(positions.len() > 2_990_000);
    let p = Vec3::new(0.2, -0.5, 0.1);
    let got = irradiance(&emitter(positions, 1.0), p, Vec3::Y, 128);
    let want = exact(1.0, p, Vec3::Y);
    // 2¹⁴ points of a relative deviation of about 1: 0.8 %, three times that.
    assert!((got / want - 1.0).abs() < 0.025, "{got} {want}");
    let power = 4.0 / f32::from(n).powi(2) / 2.0;
    let sum = (0..2 * u32::from(n).pow(2)).fold(0.0_f32, |sum, _| sum + power);
    let twin = f64::from((sum / 4.0 - 1.0).abs());
    println!("a million triangles: {:.1e}, a running sum {twin:.1e}", (got / want - 1.0).abs());
    assert!(twin > (got / want - 1.0).abs(), "the twin went unnoticed: {twin}");
}

/// Queries at hostile places draw nothing that is not a number. Twin: one over the distance squared.
#[test]
fn far_and_coincident_points_stay_finite() {
    let light = emitter(square(1.0), 1.0);
    for p in [Vec3::splat(1e18), Vec3::splat(-1e18), Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::splat(1e-30)] {
        for n in [Vec3A::Y, Vec3A::X, Vec3A::NEG_Z] {
            assert!(irradiance(&light, p, n.into(), 8).is_finite());
        }
    }
    assert!(!(1.0 / Vec3::splat(1e-30).length_squared()).is_finite(), "the twin went unnoticed");
}
