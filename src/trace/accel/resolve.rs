//! From a hit back to the scene: corners as traversal saw them, and the surface there.

use super::block::moved;
use super::{Accel, Route};
use crate::factor::compiled;
use crate::scene::motion::segment_at;
use crate::scene::{Geometry, Instance, Mesh, Scene, Stage};
use crate::trace::surface::{Corners, SurfacePoint, Vertex};
use crate::trace::{Hit, Ray};
use glam::{Affine3A, Vec3A, Vec4};

/// A triangle's corners in the space in which it is intersected.
struct Placed {
    corners: [Vec3A; 3],
    /// World from that space.
    transform: Option<Affine3A>,
}

impl Accel {
    /// The world-space corners of triangle `triangle` of the stage's instance `instance` at `u_time`: what a ray at that
    /// time meets.
    ///
    /// # Panics
    /// If the indices are out of range, or the stage is not the one built from.
    #[must_use]
    pub fn triangle(&self, scene: &Scene, stage: &Stage, instance: u32, triangle: u32, u_time: f32) -> [Vec3A; 3] {
        let placed = self.placed(scene, stage, instance, triangle, u_time);
        match placed.transform {
            None => placed.corners,
            Some(m) => placed.corners.map(|p| m.transform_point3a(p)),
        }
    }

    /// The surface where `ray` made `hit`.
    ///
    /// # Panics
    /// If the hit is not one of this structure's, or the stage is not the one built from.
    #[must_use]
    pub fn surface(&self, scene: &Scene, stage: &Stage, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let instance = &stage.instances[hit.instance as usize];
        let geometry = &stage.geometries[instance.geometry];
        let mesh = &scene.meshes[geometry.mesh];
        let placed = self.placed(scene, stage, hit.instance, hit.triangle, ray.u_time);
        let matrix = instance.motion.at(ray.u_time);
        let corners = Corners { space: placed.corners, transform: placed.transform, matrix };
        let vertices = mesh.triangles[hit.triangle as usize].map(|i| vertex(mesh, geometry, i as usize, ray.u_time));
        SurfacePoint::new(mesh, geometry.mesh, hit, &corners, &vertices, self.textured[mesh.material])
    }

    fn placed(&self, scene: &Scene, stage: &Stage, instance: u32, triangle: u32, u_time: f32) -> Placed {
        let route = self.routes[instance as usize];
        let instance: &Instance = &stage.instances[instance as usize];
        let geometry = &stage.geometries[instance.geometry];
        let mesh = &scene.meshes[geometry.mesh];
        let indices = mesh.triangles[triangle as usize].map(|i| i as usize);
        let at_key = |key: usize| {
            let positions = geometry.keys.get(key).map_or(&mesh.positions, |k| &k.positions);
            indices.map(|i| Vec3A::from(positions[i]))
        };
        let motion = &instance.motion;
        let deforms = compiled::TIME && geometry.keys.len() > 1;
        let between = |times: &[f32], corners: &dyn Fn(usize) -> [Vec3A; 3]| {
            let (segment, f) = segment_at(times, u_time);
            let (a, b) = (corners(segment), corners(segment + 1));
            std::array::from_fn(|c| moved(a[c], b[c], f))
        };
        if route == Route::Baked {
            let m = motion.keys();
            let place = |key: usize, shape: usize| at_key(shape).map(|p| m[key].transform_point3a(p));
            let corners = if !motion.is_still() {
                between(motion.times(), &|key| place(key, 0))
            } else if deforms {
                between(&geometry.times, &|key| place(0, key))
            } else {
                place(0, 0)
            };
            return Placed { corners, transform: None };
        }
        let corners = if deforms { between(&geometry.times, &at_key) } else { at_key(0) };
        Placed { corners, transform: (route == Route::Posed).then(|| motion.at(u_time)) }
    }
}

/// Normal and tangent of vertex `i` at `u_time`, in the geometry's space.
fn vertex(mesh: &Mesh, geometry: &Geometry, i: usize, u_time: f32) -> Vertex {
    let of = |normals: &[glam::Vec3], tangents: &[Vec4]| Vertex {
        normal: normals.get(i).map_or(Vec3A::ZERO, |&n| Vec3A::from(n)),
        tangent: tangents.get(i).copied().unwrap_or(Vec4::ZERO),
    };
    match geometry.keys.as_slice() {
        [] => of(&mesh.normals, &mesh.tangents),
        [key] => of(&key.normals, &key.tangents),
        [key, ..] if !compiled::TIME => of(&key.normals, &key.tangents),
        keys => {
            let (segment, f) = segment_at(&geometry.times, u_time);
            let (a, b) = (&keys[segment], &keys[segment + 1]);
            let (a, b) = (of(&a.normals, &a.tangents), of(&b.normals, &b.tangents));
            let tangent = (a.tangent * (1.0 - f) + b.tangent * f).truncate().extend(a.tangent.w);
            Vertex { normal: a.normal * (1.0 - f) + b.normal * f, tangent }
        }
    }
}
