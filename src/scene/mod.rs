//! What exists, and how it changes with time: the file's content in our own words.
//!
//! A [`Scene`] is a whole shot: node tree, meshes, materials, lights, cameras and animation curves. It knows nothing
//! of frames or exposures. [`Stage`] is the scene as one exposure sees it: every motion baked to a sequence of linear
//! segments. glTF's own vocabulary stops at [`gltf`].

pub mod animation;
pub mod bake;
pub mod camera;
pub mod curve;
pub(crate) mod decode;
pub mod deform;
pub mod environment;
pub mod gltf;
pub mod info;
pub mod light;
pub mod limbs;
pub mod material;
pub mod mesh;
pub mod motion;
pub mod node;
pub mod pack;
pub mod rig;
pub mod schedule;
pub mod sources;
pub mod stage;
pub mod texture;
pub mod view;

pub use animation::{Animation, Channel, Interpolation, Property, Track};
pub use camera::{Camera, Lens, Projection};
pub use decode::in_guarded_decoder;
pub use info::Info;
pub use light::{Environment, Light, LightShape};
pub use material::{AlphaMode, Material, Specular, TextureRef};
pub use mesh::{Mesh, MorphTarget, SkinBinding};
pub use motion::{Motion, Presence};
pub use node::{LocalTransform, Node, Skin};
pub use sources::{SourceFile, Sources, sources};
pub use stage::{Geometry, Instance, Stage, StageCamera, StageLight};
pub use texture::{Image, Pixels, Texture, Wrap};

use std::path::PathBuf;

/// Index into [`Scene::nodes`].
pub type NodeId = usize;
/// Index into [`Scene::meshes`].
pub type MeshId = usize;
/// Index into [`Scene::materials`].
pub type MaterialId = usize;
/// Index into [`Scene::textures`].
pub type TextureId = usize;

/// An extension that a file uses.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct ExtensionUse {
    /// Its registered name.
    pub name: String,
    /// Whether the file cannot be shown without it.
    pub required: bool,
    /// Whether it has its effect here.
    pub supported: bool,
}

/// A whole shot as loaded from a file.
///
/// Right-handed, y up, metres, seconds; cameras look down their −z axis. Invariants that the loader establishes and
/// every later stage relies on: all indices are in range, the node graph is a forest, key times ascend, and every
/// number is finite.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The file it came from, for messages.
    pub path: PathBuf,
    /// Nodes of the chosen scene and their descendants. A node's parent need not stand before it: see
    /// [`Scene::order`].
    pub nodes: Vec<Node>,
    /// Every node exactly once, parents before children.
    pub order: Vec<NodeId>,
    /// Triangle meshes, one per glTF primitive.
    pub meshes: Vec<Mesh>,
    /// Materials; meshes always refer to one (the loader appends glTF's default material where a mesh has none).
    pub materials: Vec<Material>,
    /// Images with their samplers.
    pub textures: Vec<Texture>,
    /// Decoded images.
    pub images: Vec<Image>,
    /// Punctual lights; a node places them.
    pub lights: Vec<Light>,
    /// Cameras; a node places them.
    pub cameras: Vec<Camera>,
    /// Skins; a node with a skinned mesh refers to one.
    pub skins: Vec<Skin>,
    /// Animations, in file order.
    pub animations: Vec<Animation>,
    /// Light from all around, if the file brings it (`EXT_lights_image_based`); a flag may replace it.
    pub environment: Option<Environment>,
    /// Extensions that the file names, by name.
    pub extensions: Vec<ExtensionUse>,
    /// What was odd but not fatal, as one sentence each.
    pub warnings: Vec<String>,
    /// BLAKE3 over the scene file and everything it refers to: [`Sources::hash`].
    pub hash: [u8; 32],
}

impl Scene {
    /// Whether the file brings lamps of its own: a punctual light, an environment, or a surface that shines brighter
    /// than white paper in full light, as only `KHR_materials_emissive_strength` allows. Emission up to 1 is paint:
    /// glowing labels and displays that viewers show under their own light.
    #[must_use]
    pub fn has_light(&self) -> bool {
        let emits = |mesh: &MeshId| {
            let material = &self.materials[self.meshes[*mesh].material];
            material.emissive.max_element() > 1.0 && !material.unlit
        };
        self.environment.is_some() || self.nodes.iter().any(|n| n.light.is_some() || n.meshes.iter().any(emits))
    }
}
