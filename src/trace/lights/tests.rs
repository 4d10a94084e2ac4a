//! Light sampling against closed forms and against itself.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "indices and means of bounded values")]
#![allow(clippy::print_stdout, reason = "the measured figures that docs/materials.md quotes")]

use super::*;
use crate::numeric::unit_from_bits;
use crate::scene::{
    Geometry, Image, Instance, Light, LightShape, Material, Mesh, Motion, Pixels, Projection, StageCamera, StageLight,
    Texture, TextureRef, Wrap,
};
use crate::time::Exposure;
use crate::trace::environment::Background;
use crate::trace::texture::TextureFilter;
use glam::{Affine2, Affine3A, DVec3, Quat};
use rand_pcg::Pcg64Mcg;
use rand_pcg::rand_core::Rng;

pub(super) fn stage() -> Stage {
    let camera = StageCamera {
        motion: Motion::still(Affine3A::IDENTITY),
        projection: Projection::Perspective { yfov: 1.0, aspect: None },
        aperture_radius: 0.0,
        focus_distance: [1.0; 2],
    };
    let interval = Exposure { open: 0.0, close: 1.0 };
    Stage { interval, camera, geometries: Vec::new(), instances: Vec::new(), lights: Vec::new() }
}

fn add_mesh(scene: &mut Scene, stage: &mut Stage, positions: Vec<Vec3>, emissive: Vec3, motion: Motion) {
    let triangles = (0..positions.len() / 3).map(|i| [0, 1, 2].map(|c| u32::try_from(3 * i + c).unwrap())).collect();
    scene.materials.push(Material { emissive, ..Material::default() });
    let material = scene.materials.len() - 1;
    scene.meshes.push(Mesh { material, triangles, positions, ..Mesh::default() });
    stage.geometries.push(Geometry { mesh: scene.meshes.len() - 1, keys: Vec::new(), times: Vec::new() });
    let geometry = stage.geometries.len() - 1;
    stage.instances.push(Instance { geometry, motion, node: 0, permanent: true });
}

/// Two triangles that span corners a, b, c, d in order.
fn quad(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> Vec<Vec3> {
    vec![a, b, c, a, c, d]
}

pub(super) fn add_light(stage: &mut Stage, shape: LightShape, intensity: f32, motion: Motion) {
    let light = Light { name: String::new(), shape, intensity: Vec3::splat(intensity), range: None };
    stage.lights.push(StageLight { light, motion, node: 0 });
}

pub(super) fn at(x: f32, y: f32, z: f32) -> Motion {
    Motion::still(Affine3A::from_translation(Vec3::new(x, y, z)))
}

fn sampled(lights: &Lights<'_>, q: &LightQuery, u: Vec2) -> Option<LightSample> {
    lights.sample(&mut lights.choice(q)?, u)
}

fn query(position: Vec3, normal: Vec3) -> LightQuery {
    LightQuery { position: position.into(), normal: normal.normalize().into(), sides: Sides::Above, u_time: 0.0 }
}

struct Draws(Pcg64Mcg);

impl Draws {
    fn new(seed: u128) -> Self {
        Self(Pcg64Mcg::new(seed << 64 | 0x9e37_79b9))
    }
    fn unit(&mut self) -> f32 {
        unit_from_bits(self.0.next_u32())
    }
    fn pair(&mut self) -> Vec2 {
        Vec2::new(self.unit(), self.unit())
    }
}

/// Runs `test` on the prepared lights.
fn with_lights<T>(scene: &Scene, stage: &Stage, background: Background<'_>, test: impl FnOnce(&Lights<'_>) -> T) -> T {
    let materials = Materials::new(scene, TextureFilter::Mip);
    let environment = Environment::new(background);
    test(&Lights::build(scene, stage, &materials, &environment))
}

/// Irradiance (red) from `n` independent samples: mean and its standard error.
fn irradiance(lights: &Lights<'_>, q: &LightQuery, n: u32, seed: u128) -> (f64, f64) {
    let mut draws = Draws::new(seed);
    let (mut sum, mut sum2) = (0.0_f64, 0.0_f64);
    for _ in 0..n {
        let value = sampled(lights, q, draws.pair()).map_or(0.0, |s| {
            f64::from(s.radiance.x) * f64::from(q.normal.dot(s.wi).max(0.0)) / f64::from(s.pdf_solid_angle)
        });
        assert!(value.is_finite());
        sum += value;
        sum2 += value * value;
    }
    let n = f64::from(n);
    let mean = sum / n;
    let visited: f64 = (0..lights.visited())
        .filter_map(|i| lights.visit(i, q))
        .map(|s| f64::from(s.radiance.x * q.normal.dot(s.wi).max(0.0)))
        .sum();
    (mean + visited, ((sum2 / n - mean * mean).max(0.0) / n).sqrt())
}

/// Lambert's formula: irradiance at `p` from a polygon of unit radiance wholly above the surface.
fn polygon_irradiance(p: DVec3, n: DVec3, corners: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    for i in 0..corners.len() {
        let (a, b) = ((corners[i] - p).normalize(), (corners[(i + 1) % corners.len()] - p).normalize());
        let across = a.cross(b);
        sum += libm::atan2(across.length(), a.dot(b)) * across.normalize().dot(n);
    }
    0.5 * sum.abs()
}

fn agrees(name: &str, (mean, error): (f64, f64), exact: f64) {
    // Three standard errors, and what f32 may round.
    assert!((mean - exact).abs() <= 3.0 * error + 2e-5 * exact, "{name}: {mean} ± {error}, exactly {exact}");
}

/// n = 2¹⁴ independent samples a case, fixed seeds; each within 3 standard errors of the closed form.
#[test]
fn a_rectangle_above_a_plane_gives_lambert_s_irradiance() {
    // From all but touching to so far that it is sampled by area: both sides of the threshold.
    for (case, height) in [0.01_f32, 0.2, 1.0, 5.0, 40.0, 60.0, 500.0].into_iter().enumerate() {
        let (mut scene, mut stage) = (Scene::default(), stage());
        let corner = |x: f32, z: f32| Vec3::new(x, height, z);
        // Counter-clockwise seen from below.
        let corners = [corner(-1.0, -0.7), corner(1.0, -0.7), corner(1.0, 0.7), corner(-1.0, 0.7)];
        let [a, b, c, d] = corners;
        add_mesh(&mut scene, &mut stage, quad(a, b, c, d), Vec3::splat(3.0), at(0.0, 0.0, 0.0));
        for (x, tilt) in [(0.0_f32, 0.0_f32), (0.8, 0.0), (2.5, 0.0), (0.3, 0.004)] {
            let n = Vec3::new(tilt, 1.0, 0.0).normalize();
            let exact =
                3.0 * polygon_irradiance(DVec3::new(x.into(), 0.0, 0.0), n.as_dvec3(), &corners.map(Vec3::as_dvec3));
            let got = with_lights(&scene, &stage, Background::Black, |l| {
                irradiance(l, &query(Vec3::new(x, 0.0, 0.0), n), 1 << 14, case as u128)
            });
            agrees(&format!("height {height}, x {x}"), got, exact);
        }
    }
}

#[test]
fn the_dark_side_of_a_single_sided_emitter_stays_dark() {
    let (mut scene, mut stage) = (Scene::default(), stage());
    let up = quad(
        Vec3::new(-1.0, 1.0, 1.0),
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(1.0, 1.0, -1.0),
        Vec3::new(-1.0, 1.0, -1.0),
    );
    add_mesh(&mut scene, &mut stage, up, Vec3::ONE, at(0.0, 0.0, 0.0));
    let below = query(Vec3::ZERO, Vec3::Y);
    let above = query(Vec3::new(0.0, 2.0, 0.0), Vec3::NEG_Y);
    with_lights(&scene, &stage, Background::Black, |l| {
        assert!(irradiance(l, &below, 256, 1).0 <= 0.0);
        assert!(irradiance(l, &above, 256, 1).0 > 0.1);
    });
    // A mirroring transform keeps the front in front.
    stage.instances[0].motion = Motion::still(Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0)));
    with_lights(&scene, &stage, Background::Black, |l| {
        assert!(irradiance(l, &below, 256, 1).0 <= 0.0);
        assert!(irradiance(l, &above, 256, 1).0 > 0.1);
    });
    stage.instances[0].motion = at(0.0, 0.0, 0.0);
    scene.materials[0].double_sided = true;
    with_lights(&scene, &stage, Background::Black, |l| assert!(irradiance(l, &below, 256, 1).0 > 0.1));
}

#[test]
fn a_sphere_light_gives_what_a_point_of_its_intensity_gives() {
    for (case, radius) in [0.0_f32, 1e-12, 1e-6, 0.01, 0.5, 0.999].into_iter().enumerate() {
        let mut stage = stage();
        add_light(&mut stage, LightShape::Point { radius }, 7.0, at(0.3, 1.0, 0.0));
        let q = query(Vec3::ZERO, Vec3::new(0.3, 1.0, 0.0));
        let exact = 7.0 / (0.3 * 0.3 + 1.0);
        let got =
            with_lights(&Scene::default(), &stage, Background::Black, |l| irradiance(l, &q, 1 << 14, case as u128));
        agrees(&format!("radius {radius}"), got, exact);
    }
}

#[test]
fn a_spot_fades_between_its_cones_as_the_extension_says() {
    let down = Affine3A::from_rotation_translation(Quat::from_rotation_x(-0.5 * std::f32::consts::PI), Vec3::Y);
    for radius in [0.0_f32, 1e-4] {
        let mut stage = stage();
        let shape = LightShape::Spot { radius, inner_cone: 0.2, outer_cone: 0.6 };
        add_light(&mut stage, shape, 5.0, Motion::still(down));
        for angle in [0.0_f32, 0.1, 0.3, 0.45, 0.59, 0.61, 1.0] {
            let q = query(Vec3::new(libm::tanf(angle), 0.0, 0.0), Vec3::Y);
            let angle = f64::from(angle);
            let x = ((angle.cos() - 0.6_f64.cos()) / (0.2_f64.cos() - 0.6_f64.cos())).clamp(0.0, 1.0);
            // cos at the plane, distance 1 / cos: cos³.
            let exact = 5.0 * x * x * angle.cos().powi(3);
            let got = with_lights(&Scene::default(), &stage, Background::Black, |l| irradiance(l, &q, 4096, 3));
            // A sphere of 1e-4 blurs the cone's edge by its own size.
            let (mean, error) = got;
            assert!((mean - exact).abs() <= 3.0 * error + 2e-5 * exact + f64::from(radius), "{angle}: {got:?} {exact}");
        }
    }
}

#[test]
fn range_fades_light_out_as_the_extension_says() {
    let mut stage = stage();
    add_light(&mut stage, LightShape::Point { radius: 0.0 }, 1.0, at(0.0, 2.0, 0.0));
    stage.lights[0].light.range = Some(4.0);
    let exact = (1.0 - 0.5_f64.powi(4)) / 4.0;
    let near = query(Vec3::ZERO, Vec3::Y);
    let far = query(Vec3::new(0.0, -3.0, 0.0), Vec3::Y);
    with_lights(&Scene::default(), &stage, Background::Black, |l| {
        agrees("within", irradiance(l, &near, 1, 1), exact);
        assert!(irradiance(l, &far, 1, 1).0 <= 0.0);
    });
}

/// A lamp that travels from one side to the other is where it should be at each instant: as a point is it visited, as a
/// sphere seen.
#[test]
fn a_lamp_shines_from_where_it_is_at_an_instant() {
    let ends = [Vec3::new(-3.0, 2.0, 0.0), Vec3::new(5.0, 2.0, 0.0)];
    let mut stage = stage();
    for radius in [0.0, 0.1] {
        let travel = Motion::through(vec![0.0, 1.0], ends.map(Affine3A::from_translation).into());
        add_light(&mut stage, LightShape::Point { radius }, 1.0, travel);
    }
    with_lights(&Scene::default(), &stage, Background::Black, |lights| {
        for u_time in [0.0, 0.25, 0.5, 1.0] {
            let q = LightQuery { u_time, ..query(Vec3::ZERO, Vec3::Y) };
            let to = Vec3A::from(ends[0].lerp(ends[1], u_time));
            let visited = lights.visit(0, &q).unwrap();
            assert!(visited.wi.distance(to.normalize()) < 1e-6, "{u_time}: {visited:?}");
            assert!((visited.radiance.x * to.length_squared() - 1.0).abs() < 1e-5, "{u_time}: {visited:?}");
            let shows = |wi: Vec3A| lights.spheres(Vec3A::ZERO, wi, f32::INFINITY, u_time) != Vec3::ZERO;
            let elsewhere = Vec3A::from(ends[0].lerp(ends[1], u_time - 0.125));
            assert!(shows(to.normalize()) && !shows(elsewhere.normalize()), "{u_time}");
        }
    });
}

#[test]
fn a_sun_gives_its_illuminance_at_any_size() {
    let down = Affine3A::from_rotation_translation(Quat::from_rotation_x(-0.9), Vec3::ZERO);
    let to_sun = Vec3::from(down.matrix3.z_axis);
    for (case, angular_radius) in [0.0_f32, 1e-12, 0.004_65, 0.3].into_iter().enumerate() {
        let mut stage = stage();
        add_light(&mut stage, LightShape::Directional { angular_radius }, 2.0, Motion::still(down));
        let q = query(Vec3::ZERO, Vec3::Y);
        let got =
            with_lights(&Scene::default(), &stage, Background::Black, |l| irradiance(l, &q, 1 << 14, case as u128));
        agrees(&format!("angle {angular_radius}"), got, 2.0 * f64::from(to_sun.y));
    }
}

#[test]
fn a_constant_environment_gives_pi_times_its_radiance() {
    let q = query(Vec3::ZERO, Vec3::new(0.3, 0.2, -1.0));
    let got = with_lights(&Scene::default(), &stage(), Background::Constant(Vec3::splat(0.5)), |l| {
        irradiance(l, &q, 1024, 1)
    });
    agrees("constant", got, 0.5 * std::f64::consts::PI);
}

/// A bit of everything: emissive triangles, spheres, many points, suns, sky, all at once.
fn crowd() -> (Scene, Stage) {
    let (mut scene, mut stage) = (Scene::default(), stage());
    let mut draws = Draws::new(99);
    let mut positions = Vec::new();
    for _ in 0..40 {
        let p = Vec3::new(draws.unit(), draws.unit(), draws.unit()) * 4.0 - 2.0;
        for _ in 0..3 {
            positions.push(p + Vec3::new(draws.unit(), draws.unit(), draws.unit()) * 0.7);
        }
    }
    let moved = Affine3A::from_translation(Vec3::new(1.0, 0.5, -2.0)) * Affine3A::from_rotation_y(0.4);
    add_mesh(
        &mut scene,
        &mut stage,
        positions,
        Vec3::new(2.0, 1.0, 0.5),
        Motion::through(vec![0.0, 1.0], vec![Affine3A::IDENTITY, moved]),
    );
    for i in 0..6_u8 {
        add_light(
            &mut stage,
            LightShape::Point { radius: 0.05 * f32::from(i % 2) },
            1.0,
            at(f32::from(i) - 2.0, 1.5, 1.0),
        );
    }
    add_light(&mut stage, LightShape::Point { radius: 0.0 }, 3.0, at(-3.0, 1.0, 0.0));
    add_light(&mut stage, LightShape::Point { radius: 0.0 }, 2.0, at(0.0, 3.0, -1.0));
    let tilt = |x: f32| Motion::still(Affine3A::from_rotation_x(x));
    add_light(&mut stage, LightShape::Directional { angular_radius: 0.1 }, 0.4, tilt(-1.0));
    add_light(&mut stage, LightShape::Directional { angular_radius: 0.0 }, 0.2, tilt(-2.0));
    (scene, stage)
}

/// What light sampling draws, the density asked of the same direction confirms: the basis of multiple importance
/// sampling.
#[test]
fn densities_agree_with_what_was_drawn() {
    let (scene, stage) = crowd();
    with_lights(&scene, &stage, Background::Constant(Vec3::splat(0.1)), |lights| {
        assert!(lights.visited() == 0 && lights.needs_sampling(), "many points are chosen from");
        let mut draws = Draws::new(5);
        let mut checked = [0_u32; 3];
        for i in 0..20_000_u32 {
            let position = Vec3::new(draws.unit(), draws.unit(), draws.unit()) * 6.0 - 3.0;
            let n = crate::trace::warp::sphere_from_square(draws.pair());
            let sides = if i % 3 == 0 { Sides::Both } else { Sides::Above };
            let q = LightQuery { position: position.into(), normal: n, sides, u_time: draws.unit() };
            let Some(s) = sampled(lights, &q, draws.pair()) else { continue };
            assert!(s.pdf_solid_angle > 0.0 && s.radiance.is_finite() && s.wi.is_normalized(), "{s:?}");
            if s.is_delta {
                continue;
            }
            let Some(emitter) = s.emitter else {
                // The sky and spheres: one of what the direction sees has the very density.
                let mut found = false;
                lights.seen(&q, s.wi, f32::INFINITY, |_, pdf| found |= (pdf / s.pdf_solid_angle - 1.0).abs() < 1e-3);
                checked[0] += u32::from(found);
                checked[1] += u32::from(!found);
                continue;
            };
            let corners = emitters::triangle_at(&scene, &stage, emitter.0, emitter.1, q.u_time);
            // Seen from an exact point, distances and weights come from the plane.
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let t = normal.dot(corners[0] - q.position) / normal.dot(s.wi);
            let pdf = lights.emitter_pdf(&q, s.wi, t, emitter, Vec2::splat(0.3));
            if t.is_finite() && t > 0.05 {
                assert!((pdf / s.pdf_solid_angle - 1.0).abs() < 0.01, "{pdf} {s:?} {t}");
                checked[2] += 1;
            }
        }
        // Directions on a rim may round to either side of it.
        assert!(checked[0] > 3000 && checked[1] < checked[0] / 500 && checked[2] > 1000, "{checked:?}");
    });
}

/// H₀: a light is drawn as often as the tree says. Pearson's χ² over the lights expected at least 10 times, n = 2¹⁶
/// independent draws at each of 4 points, α = 0.01 over all (0.0025 each); probabilities sum to 1.
#[test]
fn the_tree_chooses_as_often_as_it_says() {
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    let (scene, stage) = crowd();
    with_lights(&scene, &stage, Background::Black, |lights| {
        let mut draws = Draws::new(11);
        for case in 0..4 {
            let position = Vec3::new(draws.unit(), draws.unit(), draws.unit()) * 5.0 - 2.5;
            let normal = crate::trace::warp::sphere_from_square(draws.pair());
            let r = Receiver { position: position.into(), normal, sides: Sides::Above, u_time: draws.unit() };
            let count = lights.emitters.list.len() + lights.near.len();
            let chances: Vec<f64> = (0..count).map(|i| f64::from(lights.tree.chance(i, &r))).collect();
            let n = 1 << 16;
            let mut seen = vec![0.0_f64; count];
            let mut lost = 0.0;
            for _ in 0..n {
                match lights.tree.choose(&lights.tree.root(r), draws.pair()) {
                    Some((light, chance, _)) => {
                        assert!((f64::from(chance) / chances[light] - 1.0).abs() < 1e-5);
                        seen[light] += 1.0;
                    }
                    None => lost += 1.0,
                }
            }
            let total: f64 = chances.iter().sum();
            assert!(total <= 1.0 + 1e-5 && (total - (1.0 - lost / f64::from(n))).abs() < 0.01, "{total} {lost}");
            let mut statistic = 0.0;
            let mut cells = 0_u32;
            for (o, c) in seen.iter().zip(&chances) {
                let e = c * f64::from(n);
                if e >= 10.0 {
                    statistic += (o - e) * (o - e) / e;
                    cells += 1;
                }
            }
            let p = 1.0 - ChiSquared::new(f64::from(cells)).unwrap().cdf(statistic);
            assert!(p > 0.0025, "case {case}: p = {p}");
        }
    });
}

/// Where a light can act, the tree gives it a chance: at every instant of its motion.
#[test]
fn no_light_that_acts_is_left_out() {
    let (scene, stage) = crowd();
    with_lights(&scene, &stage, Background::Black, |lights| {
        let mut draws = Draws::new(17);
        let mut acting = 0;
        for _ in 0..3000 {
            let position = Vec3::new(draws.unit(), draws.unit(), draws.unit()) * 8.0 - 4.0;
            let normal = crate::trace::warp::sphere_from_square(draws.pair());
            let q = LightQuery { position: position.into(), normal, sides: Sides::Above, u_time: draws.unit() };
            let light = (draws.unit() * lights.emitters.list.len() as f32) as usize;
            let Some(s) = lights.emitter_sample(light, &q, &mut None, 1.0, draws.pair()) else { continue };
            if s.wi.dot(normal) > 1e-4 {
                acting += 1;
                assert!(lights.tree.chance(light, &q.receiver()) > 0.0, "light {light} at {q:?}");
            }
        }
        assert!(acting > 300, "{acting}");
    });
}

/// A moving emitter gives over an exposure the mean of what it gives at each instant.
#[test]
fn moving_emitters_are_sampled_where_they_are() {
    let (mut scene, mut stage) = (Scene::default(), stage());
    let square = quad(
        Vec3::new(-0.5, 0.0, -0.5),
        Vec3::new(0.5, 0.0, -0.5),
        Vec3::new(0.5, 0.0, 0.5),
        Vec3::new(-0.5, 0.0, 0.5),
    );
    let keys = [Vec3::new(-2.0, 1.0, 0.0), Vec3::new(0.0, 2.0, 0.0), Vec3::new(2.0, 0.5, 0.0)];
    let motion = Motion::through(vec![0.0, 0.3, 1.0], keys.map(Affine3A::from_translation).to_vec());
    add_mesh(&mut scene, &mut stage, square.clone(), Vec3::ONE, motion.clone());
    with_lights(&scene, &stage, Background::Black, |lights| {
        for i in 0..=10_u8 {
            let u_time = f32::from(i) / 10.0;
            let shift = motion.at(u_time).translation.as_dvec3();
            let corners: Vec<DVec3> = [0, 1, 2, 5].iter().map(|&c| square[c].as_dvec3() + shift).collect();
            let q = LightQuery { u_time, ..query(Vec3::new(0.2, 0.0, 0.1), Vec3::Y) };
            let exact = polygon_irradiance(q.position.as_dvec3(), DVec3::Y, &corners);
            agrees(&format!("instant {u_time}"), irradiance(lights, &q, 1 << 13, 4), exact);
        }
    });
}

/// Textured emission is sampled in proportion: its noise is far below that of even sampling, its mean the same.
#[test]
fn textured_emission_is_sampled_where_it_is_bright() {
    let (mut scene, mut stage) = (Scene::default(), stage());
    let corners =
        [Vec3::new(-1.0, 1.0, -1.0), Vec3::new(1.0, 1.0, -1.0), Vec3::new(1.0, 1.0, 1.0), Vec3::new(-1.0, 1.0, 1.0)];
    add_mesh(
        &mut scene,
        &mut stage,
        quad(corners[0], corners[1], corners[2], corners[3]),
        Vec3::splat(10.0),
        at(0.0, 0.0, 0.0),
    );
    let uv = |p: &Vec3| Vec2::new(0.5 * (p.x + 1.0), 0.5 * (p.z + 1.0));
    scene.meshes[0].uvs = vec![scene.meshes[0].positions.iter().map(uv).collect()];
    // One bright square in 64 texels a side.
    let side = 64_usize;
    let bright = |x: usize, y: usize| (40..48).contains(&x) && (8..16).contains(&y);
    let pixels = (0..side * side).map(|i| if bright(i % side, i / side) { [255; 4] } else { [0, 0, 0, 255] }).collect();
    let size = u32::try_from(side).unwrap();
    scene.images.push(Image { name: String::new(), width: size, height: size, pixels: Pixels::Rgba8(pixels) });
    let nearest = crate::scene::texture::TexelFilter::Nearest;
    scene.textures.push(Texture {
        image: 0,
        wrap: [Wrap::Clamp; 2],
        magnify: nearest,
        minify: nearest,
        mipmapped: true,
    });
    scene.materials[0].emissive_texture = Some(TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY });
    let place = |x: f64, z: f64| DVec3::new(x / 32.0 - 1.0, 1.0, z / 32.0 - 1.0);
    let lit = [place(40.0, 8.0), place(48.0, 8.0), place(48.0, 16.0), place(40.0, 16.0)];
    let q = query(Vec3::new(0.1, 0.0, 0.2), Vec3::Y);
    let exact = 10.0 * polygon_irradiance(q.position.as_dvec3(), DVec3::Y, &lit);
    let n = 1 << 14;
    let (mean, error) = with_lights(&scene, &stage, Background::Black, |l| irradiance(l, &q, n, 2));
    agrees("textured", (mean, error), exact);
    // Even sampling finds 1 point in 64: its standard error is √(63 / n) of the mean.
    let even = exact * (63.0 / f64::from(n)).sqrt();
    assert!(error < 0.25 * even, "{error} against {even}");
}

/// 10 000 small emissive triangles over a plane: at equal samples the tree's mean squared error relative to the
/// squared truth, against choosing in proportion to power. Must be at least 5 times lower.
#[test]
fn the_tree_beats_choice_by_power_on_ten_thousand_triangles() {
    let (mut scene, mut stage) = (Scene::default(), stage());
    let mut draws = Draws::new(23);
    let mut positions = Vec::new();
    for _ in 0..10_000 {
        let p = Vec3::new(20.0 * draws.unit() - 10.0, 0.3 + 2.0 * draws.unit(), 20.0 * draws.unit() - 10.0);
        for _ in 0..3 {
            positions.push(p + 0.05 * Vec3::new(draws.unit(), draws.unit(), draws.unit()));
        }
    }
    add_mesh(&mut scene, &mut stage, positions, Vec3::ONE, at(0.0, 0.0, 0.0));
    scene.materials[0].double_sided = true;
    with_lights(&scene, &stage, Background::Black, |lights| {
        let power: Vec<f64> = lights.emitters.extents.iter().map(|e| f64::from(e.strength)).collect();
        let total: f64 = power.iter().sum();
        let sums: Vec<f64> = power
            .iter()
            .scan(0.0, |s, p| {
                *s += p / total;
                Some(*s)
            })
            .collect();
        let (mut by_tree, mut by_power) = (0.0_f64, 0.0_f64);
        for _ in 0..24 {
            let q = query(Vec3::new(16.0 * draws.unit() - 8.0, 0.0, 16.0 * draws.unit() - 8.0), Vec3::Y);
            let value = |s: Option<LightSample>| {
                s.map_or(0.0, |s| f64::from(s.radiance.x * q.normal.dot(s.wi).max(0.0) / s.pdf_solid_angle))
            };
            let n = 2000;
            let mut moments = [[0.0_f64; 2]; 2];
            for _ in 0..n {
                let tree = value(sampled(lights, &q, draws.pair()));
                let chosen = f64::from(draws.unit());
                let light = sums.partition_point(|&s| s <= chosen).min(sums.len() - 1);
                let power =
                    value(lights.emitter_sample(light, &q, &mut None, (power[light] / total) as f32, draws.pair()));
                for (m, v) in moments.iter_mut().zip([tree, power]) {
                    m[0] += v / f64::from(n);
                    m[1] += v * v / f64::from(n);
                }
            }
            let truth = moments[0][0];
            by_tree += (moments[0][1] - truth * truth) / (truth * truth);
            by_power += (moments[1][1] - moments[1][0] * moments[1][0]) / (truth * truth);
        }
        println!("relMSE of one sample: tree {:.3}, power {:.3}", by_tree / 24.0, by_power / 24.0);
        assert!(by_power > 5.0 * by_tree, "{by_power} {by_tree}");
    });
}
