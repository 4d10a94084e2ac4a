//! Case 2. A ray that leaves a surface neither meets it again (acne) nor starts behind the next one (leaks).
//!
//! What could fail: the origin lies a rounding error below the surface; an offset that is fixed is too small for large
//! scenes and too large for small ones. Bound: origins lie above the surface by at most a few γₙ of the coordinates. The
//! twin is the fixed offset 1e-4.

use super::support::{Dice, build, ray, rest, scene, sphere, stage};
use crate::flat::{self, film, flat_scene, rectangle};
use crate::moving::Builder;
use crate::shots;
use glam::{Affine3A, Quat, Vec3, Vec3A};
use graeco::design::Kind;
use graeco::render::aovs::Aov;
use graeco::render::{Progress, Settings, Shot};
use graeco::scene::{Light, LightShape, LocalTransform, Material, Mesh, Motion, Projection, Scene, Stage};
use graeco::trace::accel::Accel;
use graeco::trace::surface::SurfacePoint;

fn plane() -> Mesh {
    Mesh {
        positions: vec![
            Vec3::new(-1.0, 0.0, -1.0),
            Vec3::new(-1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, -1.0),
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A direction within `grazing` of the surface at `surface`, on the side of its normal.
fn grazing(surface: &SurfacePoint, grazing: f32, dice: &mut Dice) -> Vec3A {
    let n = surface.geometric_normal;
    let along = n.any_orthonormal_vector();
    let turn = dice.unit() * std::f32::consts::TAU;
    (along * libm::cosf(turn) + n.cross(along) * libm::sinf(turn)) + n * grazing
}

struct Setting {
    scene: Scene,
    stage: Stage,
    accel: Accel,
    centre: Vec3A,
    size: f32,
}

impl Setting {
    fn new(mesh: Mesh, size: f32, offset: f32, permanent: bool) -> Self {
        let turned = Quat::from_rotation_x(0.3) * Quat::from_rotation_z(0.2);
        let at = Vec3::splat(offset * size);
        let transform = Affine3A::from_scale_rotation_translation(Vec3::splat(size), turned, at);
        let (scene, stage) = (scene(vec![mesh]), stage(vec![(rest(0), Motion::still(transform), permanent)]));
        let accel = build(&scene, &stage);
        Self { scene, stage, accel, centre: Vec3A::from(at), size }
    }

    /// Points where rays from a few sizes away meet the surface.
    fn points(&self, count: usize, dice: &mut Dice) -> Vec<SurfacePoint> {
        (0..count)
            .filter_map(|_| {
                let origin = self.centre + Vec3A::from(dice.vec()).normalize_or(Vec3A::Y) * 4.0 * self.size;
                let target = self.centre + Vec3A::from(dice.vec()) * 0.5 * self.size;
                let ray = ray(origin, target - origin, 0.0);
                let hit = self.accel.closest(&ray, |_| true)?;
                Some(self.accel.surface(&self.scene, &self.stage, &ray, &hit))
            })
            .collect()
    }

    /// How many of the rays that graze away from the surface meet something; the surface is convex, so none should.
    fn acne(&self, origin: &dyn Fn(&SurfacePoint, Vec3A) -> Vec3A) -> (usize, usize) {
        let mut dice = Dice::new(21);
        let points = self.points(400, &mut dice);
        let met = points
            .iter()
            .flat_map(|p| [1.0, 1e-1, 1e-2, 1e-3].map(|angle| (p, angle)))
            .filter(|(p, angle)| {
                let direction = grazing(p, *angle, &mut dice);
                self.accel.occluded(&ray(origin(p, direction), direction, 0.0), |_| true)
            })
            .count();
        (met, points.len())
    }
}

fn robust(p: &SurfacePoint, direction: Vec3A) -> Vec3A {
    p.spawn_origin(direction)
}

fn fixed(p: &SurfacePoint, direction: Vec3A) -> Vec3A {
    p.position + p.geometric_normal * 1e-4_f32.copysign(direction.dot(p.geometric_normal))
}

#[test]
fn nothing_shadows_itself_at_any_scale_or_place() {
    for size in [1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6] {
        for offset in [0.0, 1.0, 1e3, 1e6] {
            for permanent in [true, false] {
                for mesh in [plane(), sphere(3)] {
                    let (met, points) = Setting::new(mesh, size, offset, permanent).acne(&robust);
                    assert_eq!(met, 0, "acne at size {size}, offset {offset}, permanent {permanent}");
                    assert!(offset > 1e4 || points > 100, "rays meet the surface: {points}");
                }
            }
        }
    }
}

#[test]
fn the_fixed_offset_shadows_itself() {
    let (met, _) = Setting::new(plane(), 1e6, 0.0, true).acne(&fixed);
    assert!(met > 10, "the case is hard enough: {met}");
}

/// Rotation that sends −z, along which suns shine and cameras look, along `way`.
fn looking(way: Vec3) -> Quat {
    Quat::from_rotation_arc(Vec3::NEG_Z, way.normalize())
}

/// A body of `size` at `offset` sizes under a sun that grazes its top, rendered with one run a pixel: pixels whose
/// surface faces the sun but are dark (acne), pixels that face away but are lit (leaks), and those that face it.
fn rendered(body: &[Vec3], size: f32, offset: f32, sun: Vec3) -> [usize; 3] {
    let at = Vec3::splat(offset * size);
    let mut b = Builder::new(0.0);
    let parts = |translation: Vec3, rotation: Quat, scale: Vec3| LocalTransform::Parts { translation, rotation, scale };
    let eye = Vec3::new(0.2, 0.1, 1.0).normalize();
    b.scene.nodes[Builder::EYE].local = parts(at + eye * 4.0 * size, looking(-eye), Vec3::ONE);
    let half = 1.2 * size;
    b.scene.cameras[0].projection = Projection::Orthographic { xmag: half, ymag: half };
    b.scene.materials[0] = Material { metallic: 0.0, double_sided: true, ..Material::default() };
    let node = b.node(None, Vec3::ZERO);
    b.scene.nodes[node].local = parts(at, Quat::IDENTITY, Vec3::splat(size));
    b.mesh(node, body);
    let lamp = b.node(None, Vec3::ZERO);
    b.scene.nodes[lamp].local = parts(Vec3::ZERO, looking(sun), Vec3::ONE);
    b.scene.nodes[lamp].light = Some(0);
    let shape = LightShape::Directional { angular_radius: 0.0 };
    b.scene.lights.push(Light { name: String::new(), shape, intensity: Vec3::splat(1e3), range: None });
    let scene = b.finish();
    let settings = Settings { aovs: vec![Aov::Normal], ..shots::settings((48, 48), 1, 0) };
    let surroundings = shots::dark();
    let mut shot = Shot::new(&scene, &settings, &surroundings, "").unwrap();
    let frame = shot.render(0, &Progress::default()).unwrap().unwrap();
    assert_eq!(frame.film.rejected(), 0);
    let plane = |name: &str| &frame.planes.iter().find(|p| p.name == name).unwrap().samples;
    let [x, y, z] = ["normal.X", "normal.Y", "normal.Z"].map(plane);
    let mut counts = [0; 3];
    for (i, pixel) in frame.film.pixels().iter().enumerate() {
        let normal = Vec3::new(x[i], y[i], z[i]);
        if normal.length() < 0.5 {
            continue;
        }
        let facing = -normal.dot(sun.normalize());
        assert!(pixel.radiance.is_finite());
        counts[0] += usize::from(facing > 1e-5 && pixel.radiance.x <= 0.0);
        counts[1] += usize::from(facing < -1e-5 && pixel.radiance.x > 0.0);
        counts[2] += usize::from(facing > 1e-5);
    }
    counts
}

/// Bound: no dark pixel where the sun shines, at an elevation of 0.06 degrees above the plane and everywhere on a
/// sphere, at sizes of 10⁻⁴ to 10⁶ and up to 10⁶ sizes away; the sphere's corners would be rounded into dents there, so
/// that it stays within 10³.
#[test]
fn pictures_of_a_plane_and_a_sphere_under_a_grazing_sun_have_no_acne() {
    let soup =
        |mesh: &Mesh| -> Vec<Vec3> { mesh.triangles.iter().flatten().map(|&i| mesh.positions[i as usize]).collect() };
    let flat: Vec<Vec3> = soup(&plane()).iter().map(|p| Vec3::new(p.x, -p.z, p.y)).collect();
    let round = soup(&sphere(3));
    for size in [1e-4_f32, 1e-2, 1.0, 1e2, 1e4, 1e6] {
        for offset in [0.0, 1.0, 1e3, 1e6] {
            for (body, sun, farthest) in
                [(&flat, Vec3::new(1.0, 0.2, -1e-3), 1e6), (&round, Vec3::new(1.0, 0.2, -0.1), 1e3)]
            {
                if offset <= farthest {
                    let [acne, leaks, facing] = rendered(body, size, offset, sun);
                    assert_eq!((acne, leaks), (0, 0), "size {size}, offset {offset}");
                    assert!(facing > 400, "the sun shines on it: {facing}");
                }
            }
        }
    }
}

/// A lamp of 1 m a metre above a floor of triangles that are up to 10⁴ m long: their error bound lifts the shadow ray's
/// origin far more than the lamp's own place may err. Bound: the floor is as bright as a small one, to 2 %. Twin: the
/// distance from the point itself, along which a ray from the lifted origin ends behind the lamp's face.
#[test]
fn a_lamp_near_large_triangles_does_not_shadow_itself() {
    let lit = |half: f32| -> Vec<f32> {
        let mut b = flat_scene(9);
        let floor = b.node(None, Vec3::ZERO);
        let mesh = b.mesh(floor, &rectangle([-half, half], [-half, half]));
        b.scene.materials.push(Material { metallic: 0.0, ..Material::default() });
        b.scene.meshes[mesh].material = 1;
        let lamp = b.node(None, Vec3::new(0.0, 0.0, 1.0));
        let down: Vec<Vec3> = rectangle([-0.5, 0.5], [-0.5, 0.5]).chunks(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
        let mesh = b.mesh(lamp, &down);
        b.scene.materials.push(Material { emissive: Vec3::splat(40.0), ..Material::default() });
        b.scene.meshes[mesh].material = 2;
        let mut s = flat::settings((9, 9), 64);
        s.sampling.kind = Kind::Auto;
        film(&b.finish(), &s, 0).pixels().iter().map(|p| p.radiance.x).collect()
    };
    let small = lit(10.0);
    assert!(small.iter().all(|&x| x > 5e-3), "{small:?}");
    for half in [24.0, 1e2, 1e3, 1e4] {
        for (x, y) in lit(half).iter().zip(&small) {
            assert!((x / y - 1.0).abs() < 0.02, "{half}: {x} {y}");
        }
    }
    let lifted = graeco::numeric::gamma(2) * 1e3;
    let spared = graeco::numeric::gamma(16) * 2.0;
    assert!(lifted > spared, "the twin went unnoticed");
}

/// A closed box of size 2, `offset` sizes away, with walls of thickness 1e-4: how many rays from the inner side of a
/// wall into it get out.
fn through_walls(size: f32, offset: f32, permanent: bool, origin: &dyn Fn(&SurfacePoint, Vec3A) -> Vec3A) -> usize {
    let mut mesh = Mesh::default();
    for half in [1.0_f32, 1.0 + 1e-4] {
        let base = u32::try_from(mesh.positions.len()).unwrap();
        mesh.positions.extend((0..8_u8).map(|i| {
            let sign = |bit: u8| if i >> bit & 1 == 1 { half } else { -half };
            Vec3::new(sign(0), sign(1), sign(2))
        }));
        for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5_u32]] {
            mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(|i| i + base)));
        }
    }
    let turned = Quat::from_rotation_y(0.4) * Quat::from_rotation_x(0.7);
    let at = Vec3::splat(offset * size);
    let placed = Motion::still(Affine3A::from_scale_rotation_translation(Vec3::splat(size), turned, at));
    let (scene, stage) = (scene(vec![mesh]), stage(vec![(rest(0), placed, permanent)]));
    let accel = build(&scene, &stage);
    let mut dice = Dice::new(4);
    (0..2000)
        .filter(|_| {
            let first = ray(Vec3A::from(at + dice.vec() * 0.5 * size), Vec3A::from(dice.vec()), 0.0);
            let hit = accel.closest(&first, |_| true).expect("the box is closed");
            let inner = accel.surface(&scene, &stage, &first, &hit);
            let direction = first.direction;
            !accel.occluded(&ray(origin(&inner, direction), direction, 0.0), |_| true)
        })
        .count()
}

/// Ten sizes away a wall of 10⁻⁴ is 100 steps of `f32` thick. A hundred sizes away the bound itself is as wide as the wall
/// (√3 γ₉ of the place), a million away the wall's two sides are one.
#[test]
fn thin_walls_hold_light() {
    for size in [1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6] {
        for offset in [0.0, 1.0, 10.0] {
            for permanent in [true, false] {
                let leaks = through_walls(size, offset, permanent, &robust);
                assert_eq!(leaks, 0, "size {size}, offset {offset}, permanent {permanent}");
            }
        }
    }
}

#[test]
fn the_fixed_offset_leaks_through_thin_walls() {
    assert!(through_walls(1e-2, 0.0, true, &fixed) > 100);
}
