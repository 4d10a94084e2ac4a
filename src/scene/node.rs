//! The tree that places things.

use super::{MeshId, NodeId};
use glam::{DAffine3, Quat, Vec3};

/// A node's transform relative to its parent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LocalTransform {
    /// Scale, then rotation, then translation: the only form that animations move.
    Parts {
        /// Metres.
        translation: Vec3,
        /// Unit quaternion.
        rotation: Quat,
        /// Along each axis; may be zero or negative.
        scale: Vec3,
    },
    /// Any affine matrix.
    Matrix(DAffine3),
}

impl Default for LocalTransform {
    fn default() -> Self {
        Self::Parts { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE }
    }
}

/// A place in the tree, with what stands there.
#[derive(Debug, Clone, Default)]
pub struct Node {
    /// The file's name for it; may be empty.
    pub name: String,
    /// The node it hangs from.
    pub parent: Option<NodeId>,
    /// Its transform relative to the parent.
    pub local: LocalTransform,
    /// Meshes that stand here.
    pub meshes: Vec<MeshId>,
    /// Index into [`super::Scene::skins`], for meshes with a skin binding.
    pub skin: Option<usize>,
    /// Morph weights when no animation drives them; as many as its meshes have targets.
    pub weights: Vec<f32>,
    /// Index into [`super::Scene::cameras`].
    pub camera: Option<usize>,
    /// Index into [`super::Scene::lights`].
    pub light: Option<usize>,
    /// Motion-blur amount (`motion:blurScale`); `None` inherits the parent's, 1 at the root.
    pub blur_scale: Option<f32>,
    /// Copies of the meshes relative to this node (`EXT_mesh_gpu_instancing`); `None` is the single one at the
    /// node itself.
    pub copies: Option<Vec<DAffine3>>,
    /// Whether it and its descendants are seen (`KHR_node_visibility`).
    pub visible: bool,
}

/// Joints with the matrices that take a vertex to each joint's space.
#[derive(Debug, Clone, Default)]
pub struct Skin {
    /// The file's name for it; may be empty.
    pub name: String,
    /// The joint nodes.
    pub joints: Vec<NodeId>,
    /// From mesh space to joint space at rest, one per joint.
    pub inverse_bind: Vec<DAffine3>,
}
