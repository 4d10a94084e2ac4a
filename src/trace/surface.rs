//! What a ray met: position with its error bound, normals, texture coordinates.

use crate::scene::{MaterialId, MeshId};
use glam::{Vec2, Vec3A, Vec4};

/// The most texture coordinate sets that a material may read.
pub const MAX_UV_SETS: usize = 4;

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
    /// Area of the triangle in texture space (set 0) over its area in world space: for texture filtering; 0 if none.
    pub uv_density: f32,
}
