//! Triangle meshes as loaded: rest pose, with what deforms it.

use super::MaterialId;
use glam::{Vec2, Vec3, Vec4};

/// Differences that one morph target adds at weight 1; an empty list leaves that attribute alone.
#[derive(Debug, Clone, Default)]
pub struct MorphTarget {
    /// One per vertex, or empty.
    pub positions: Vec<Vec3>,
    /// One per vertex, or empty.
    pub normals: Vec<Vec3>,
    /// One per vertex (no handedness), or empty.
    pub tangents: Vec<Vec3>,
}

/// Which joints move a vertex, and how much.
#[derive(Debug, Clone, Default)]
pub struct SkinBinding {
    /// Influences a vertex: 4 or 8.
    pub influences: usize,
    /// `vertices × influences` indices into the skin's joints.
    pub joints: Vec<u16>,
    /// `vertices × influences` weights, non-negative, summing to 1 for each vertex.
    pub weights: Vec<f32>,
}

/// A triangle mesh of one material.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// The file's name for it; may be empty.
    pub name: String,
    /// Its material.
    pub material: MaterialId,
    /// Vertex indices, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Positions in mesh space, finite.
    pub positions: Vec<Vec3>,
    /// Unit normals, one per vertex; empty: flat, the triangle's own.
    pub normals: Vec<Vec3>,
    /// Unit tangents with handedness in w, one per vertex; empty where no texture needs them.
    pub tangents: Vec<Vec4>,
    /// Texture coordinate sets, each one per vertex.
    pub uvs: Vec<Vec<Vec2>>,
    /// Linear colour and alpha that multiply the base colour, one per vertex; empty: white.
    pub colors: Vec<Vec4>,
    /// Skinning, if any.
    pub skin: Option<SkinBinding>,
    /// Morph targets.
    pub targets: Vec<MorphTarget>,
}
