//! Case 2. A ray that leaves a surface neither meets it again (acne) nor starts behind the next one (leaks).
//!
//! What could fail: the origin lies a rounding error below the surface; an offset that is fixed is too small for large
//! scenes and too large for small ones. Bound: origins lie above the surface by at most a few γₙ of the coordinates. The
//! twin is the fixed offset 1e-4.

use super::support::{Dice, build, ray, rest, scene, single, sphere, stage};
use glam::{Affine3A, Quat, Vec3, Vec3A};
use graeco::scene::{Mesh, Motion, Scene, Stage};
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

/// A closed box of size 2 with walls of thickness 1e-4: how many rays from the inner side of a wall into it get out.
fn through_walls(size: f32, origin: &dyn Fn(&SurfacePoint, Vec3A) -> Vec3A) -> usize {
    let mut mesh = Mesh::default();
    for half in [1.0_f32, 1.0 + 1e-4] {
        let base = u32::try_from(mesh.positions.len()).unwrap();
        mesh.positions.extend((0..8_u8).map(|i| {
            let sign = |bit: u8| if i >> bit & 1 == 1 { half } else { -half };
            Vec3::new(sign(0), sign(1), sign(2)) * size
        }));
        for q in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5_u32]] {
            mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(|i| i + base)));
        }
    }
    let (scene, stage) = single(mesh, Affine3A::from_quat(Quat::from_rotation_y(0.4) * Quat::from_rotation_x(0.7)));
    let accel = build(&scene, &stage);
    let mut dice = Dice::new(4);
    (0..2000)
        .filter(|_| {
            let first = ray(Vec3A::from(dice.vec()) * 0.5 * size, Vec3A::from(dice.vec()), 0.0);
            let hit = accel.closest(&first, |_| true).expect("the box is closed");
            let inner = accel.surface(&scene, &stage, &first, &hit);
            let direction = first.direction;
            !accel.occluded(&ray(origin(&inner, direction), direction, 0.0), |_| true)
        })
        .count()
}

#[test]
fn thin_walls_hold_light() {
    for size in [1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6] {
        assert_eq!(through_walls(size, &robust), 0, "size {size}");
    }
}

#[test]
fn the_fixed_offset_leaks_through_thin_walls() {
    assert!(through_walls(1e-2, &fixed) > 100);
}
