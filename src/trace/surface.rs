//! What a ray met: position with its error bound, normals, texture coordinates.

use super::accel::absolute;
use super::ray::Hit;
use crate::numeric::gamma;
use crate::scene::texture::MAX_UV_SETS;
use crate::scene::{MaterialId, Mesh, MeshId};
use glam::{Affine3A, DVec2, DVec3, Mat3A, Vec2, Vec3A, Vec4};

/// A point on a surface at the ray's instant, in world space.
#[derive(Debug, Clone, Copy)]
pub struct SurfacePoint {
    /// The point.
    pub position: Vec3A,
    /// Bound on the absolute rounding error of each coordinate of `position`.
    pub error: Vec3A,
    /// Unit normal of the triangle, on its front side (counter-clockwise winding after the instance's transform,
    /// mirrored transforms included).
    pub geometric_normal: Vec3A,
    /// Unit interpolated normal, on the same side as `geometric_normal`.
    pub normal: Vec3A,
    /// Interpolated tangent with handedness in w; zero where the mesh has none.
    pub tangent: Vec4,
    /// Texture coordinates by set; sets that the mesh lacks are zero.
    pub uvs: [Vec2; MAX_UV_SETS],
    /// Vertex colour (linear), white where the mesh has none.
    pub color: Vec4,
    /// The surface's material.
    pub material: MaterialId,
    /// The mesh it belongs to.
    pub mesh: MeshId,
    /// Index into [`crate::scene::Stage::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
    /// Area of the triangle in world space at this instant, m²: for the density of light sampling.
    pub triangle_area: f32,
    /// How the texture coordinates of set 0 change along the surface: their gradients in world space, 1/m, which lie in
    /// the triangle's plane. `None` if there are none, or the material reads no texture.
    pub uv_gradients: Option<[Vec3A; 2]>,
}

/// A triangle's corners at the ray's instant.
pub(super) struct Corners {
    /// In the space in which it was intersected.
    pub(super) space: [Vec3A; 3],
    /// World from that space; `None` if it is the world's.
    pub(super) transform: Option<Affine3A>,
    /// World from the geometry's space: where normals and tangents are given.
    pub(super) matrix: Affine3A,
}

/// What varies over a triangle and with time, in the geometry's space; zero where the mesh has none.
pub(super) struct Vertex {
    pub(super) normal: Vec3A,
    pub(super) tangent: Vec4,
}

impl SurfacePoint {
    /// The point at `hit` of a triangle of `mesh`, whose material reads textures or does not.
    #[allow(clippy::cast_possible_truncation, reason = "results are stored as f32")]
    pub(super) fn new(
        mesh: &Mesh,
        id: MeshId,
        hit: &Hit,
        corners: &Corners,
        vertices: &[Vertex; 3],
        textured: bool,
    ) -> Self {
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let (position, error) = located(&corners.space, weights, corners.transform.as_ref());
        let linear = balanced(corners.matrix.matrix3);
        let side = if linear.determinant() < 0.0 { -1.0 } else { 1.0 };
        let cofactors = cofactors(&linear) * side;
        let (geometric_normal, edges) = face(corners, &cofactors, side);
        let across = edges[0].cross(edges[1]).length();
        let blended = |value: &dyn Fn(&Vertex) -> Vec3A| {
            value(&vertices[0]) * weights[0] + value(&vertices[1]) * weights[1] + value(&vertices[2]) * weights[2]
        };
        let normal = unit(cofactors * blended(&|v| v.normal))
            .map_or(geometric_normal, |n| if n.dot(geometric_normal) < 0.0 { -n } else { n });
        let along = corners.matrix.matrix3 * blended(&|v| Vec3A::from_vec4(v.tangent));
        // A mirrored frame has the other handedness.
        let tangent = unit(along).map_or(Vec4::ZERO, |t| t.extend(vertices[0].tangent.w * side));
        let indices = mesh.triangles[hit.triangle as usize].map(|i| i as usize);
        let mut uvs = [Vec2::ZERO; MAX_UV_SETS];
        for (uv, set) in uvs.iter_mut().zip(&mesh.uvs) {
            *uv = set[indices[0]] * weights[0] + set[indices[1]] * weights[1] + set[indices[2]] * weights[2];
        }
        let uv_gradients = mesh.uvs.first().filter(|_| textured).map(|set| {
            let [a, b, c] = indices.map(|i| set[i].as_dvec2());
            gradients(edges, [b - a, c - a], geometric_normal.as_dvec3(), across)
        });
        let color = if mesh.colors.is_empty() {
            Vec4::ONE
        } else {
            let [a, b, c] = indices.map(|i| mesh.colors[i]);
            a * weights[0] + b * weights[1] + c * weights[2]
        };
        Self {
            position,
            error,
            geometric_normal,
            normal,
            tangent,
            uvs,
            color,
            material: mesh.material,
            mesh: id,
            instance: hit.instance,
            triangle: hit.triangle,
            triangle_area: (0.5 * across) as f32,
            uv_gradients,
        }
    }

    /// Where a ray that leaves in `direction` starts: off the surface by the error bound of the point, along the
    /// geometric normal towards the direction's side, and rounded away from it (Pharr, Jakob and Humphreys 2023, §6.8.6).
    #[must_use]
    pub fn spawn_origin(&self, direction: Vec3A) -> Vec3A {
        let n = self.geometric_normal;
        let distance = n.abs().dot(self.error);
        let offset = if direction.dot(n) < 0.0 { n * -distance } else { n * distance };
        let moved = self.position + offset;
        // At least to the next number, which is at most 2⁻²³ of this one away.
        let step = (moved.abs() * f32::EPSILON + Vec3A::splat(f32::MIN_POSITIVE)).copysign(offset);
        moved + Vec3A::select(offset.cmpeq(Vec3A::ZERO), Vec3A::ZERO, step)
    }
}

/// The point with weights `weights`, in the world, and a bound on its error.
///
/// Blending three corners makes three roundings a coordinate, and the weights sum to one within one more: γ₇ of the sum of
/// absolute values bounds all (Pharr, Jakob and Humphreys 2023, §6.8.5). γ₂ of the greatest coordinate is added so that a
/// plane at exactly zero is left by more than a denormal number, which a processor may take for zero. A transform adds γ₄ of its own absolute sum. A ray
/// that starts there is taken back by the inverse, whose entries carry a few roundings each: γ₁₂ of the absolute sum in
/// the geometry's space, seen from the world.
fn located(corners: &[Vec3A; 3], weights: [f32; 3], transform: Option<&Affine3A>) -> (Vec3A, Vec3A) {
    let parts = [corners[0] * weights[0], corners[1] * weights[1], corners[2] * weights[2]];
    let p = parts[0] + parts[1] + parts[2];
    let size = corners[0].abs().max(corners[1].abs()).max(corners[2].abs());
    let error = (parts[0].abs() + parts[1].abs() + parts[2].abs()) * gamma(7) + size.max_element() * gamma(2);
    let Some(m) = transform else { return (p, error) };
    let world = m.transform_point3a(p);
    let size = absolute(m);
    let forward = size.transform_vector3a(error) * (1.0 + gamma(4)) + size.transform_point3a(p.abs()) * gamma(4);
    let inverse = m.inverse();
    let back = absolute(&inverse).transform_point3a(world.abs()) * gamma(12);
    let back = size.transform_vector3a(back);
    (world, forward + if back.is_finite() { back } else { Vec3A::ZERO })
}

/// Unit normal of the front side, and the two edges from the first corner, in the world.
fn face(corners: &Corners, cofactors: &Mat3A, side: f32) -> (Vec3A, [DVec3; 2]) {
    let space = corners.space.map(|p| p.as_dvec3());
    let edges = [space[1] - space[0], space[2] - space[0]];
    let n = edges[0].cross(edges[1]);
    let Some(m) = &corners.transform else {
        // Winding in the world is the geometry's, reversed by a mirror.
        return (unit64(n * f64::from(side)), edges);
    };
    let linear = m.matrix3;
    let edges =
        edges.map(|e| linear.x_axis.as_dvec3() * e.x + linear.y_axis.as_dvec3() * e.y + linear.z_axis.as_dvec3() * e.z);
    let n = cofactors.x_axis.as_dvec3() * n.x + cofactors.y_axis.as_dvec3() * n.y + cofactors.z_axis.as_dvec3() * n.z;
    (unit64(n), edges)
}

/// Gradients in the plane with unit normal `n` of two functions that change by `changes` along `edges`; `across` is the
/// length of the edges' cross product.
fn gradients(edges: [DVec3; 2], changes: [DVec2; 2], n: DVec3, across: f64) -> [Vec3A; 2] {
    let (a, b) = (edges[1].cross(n), n.cross(edges[0]));
    let gradient = |first: f64, second: f64| ((a * first + b * second) / across).as_vec3a();
    let both = [gradient(changes[0].x, changes[1].x), gradient(changes[0].y, changes[1].y)];
    if both.iter().all(|g| g.is_finite()) { both } else { [Vec3A::ZERO; 2] }
}

/// `m`, or a positive multiple of it whose cofactors and determinant neither overflow nor vanish.
fn balanced(m: Mat3A) -> Mat3A {
    const PLAIN: std::ops::Range<f32> = 1e-12..1e12;
    let size = m.x_axis.abs().max(m.y_axis.abs()).max(m.z_axis.abs()).max_element();
    if PLAIN.contains(&size) || !(size > 0.0 && size.is_finite()) { m } else { m * (1.0 / size) }
}

/// The matrix of cofactors, det(m) m⁻ᵀ: takes normals along, singular matrices of rank two included.
fn cofactors(m: &Mat3A) -> Mat3A {
    Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// `v` at length one; up where it has no direction (a triangle without area, which no ray hits).
fn unit64(v: DVec3) -> Vec3A {
    let length2 = v.length_squared();
    if (1e-200..1e200).contains(&length2) {
        return (v / length2.sqrt()).as_vec3a();
    }
    // Scaled first: squares of 1e-200 vanish.
    let size = v.abs().max_element();
    if size > 0.0 && size.is_finite() { (v / size).normalize().as_vec3a() } else { Vec3A::Y }
}

/// `v` at length one, if it has a direction.
fn unit(v: Vec3A) -> Option<Vec3A> {
    let length2 = v.length_squared();
    if (1e-25..1e25).contains(&length2) {
        return Some(v / length2.sqrt());
    }
    let size = v.abs().max_element();
    (size > 0.0 && size.is_finite()).then(|| (v / size).normalize())
}
