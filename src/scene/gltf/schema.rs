//! The JSON part of a glTF 2.0 file, as it is written: nothing is checked beyond JSON types.
//!
//! A reader of our own, not the `gltf` crate's: that one refuses legal files (scenes without nodes, unknown required
//! extensions) and trusts indices. Extensions stay raw JSON until the code that knows them asks.

use serde::Deserialize;
use serde_json::{Map, Value};

/// Extension objects by name, or anything else that is keyed.
pub(super) type Object = Map<String, Value>;

/// The root object.
#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Document {
    pub(super) asset: Asset,
    pub(super) scene: Option<usize>,
    pub(super) scenes: Vec<SceneDef>,
    pub(super) nodes: Vec<NodeDef>,
    pub(super) meshes: Vec<MeshDef>,
    pub(super) accessors: Vec<AccessorDef>,
    pub(super) buffer_views: Vec<BufferViewDef>,
    pub(super) buffers: Vec<BufferDef>,
    pub(super) images: Vec<ImageDef>,
    pub(super) samplers: Vec<SamplerDef>,
    pub(super) textures: Vec<TextureDef>,
    pub(super) materials: Vec<MaterialDef>,
    pub(super) skins: Vec<SkinDef>,
    pub(super) cameras: Vec<CameraDef>,
    pub(super) animations: Vec<AnimationDef>,
    pub(super) extensions: Object,
    pub(super) extensions_used: Vec<String>,
    pub(super) extensions_required: Vec<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Asset {
    pub(super) version: Option<String>,
    pub(super) min_version: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct SceneDef {
    pub(super) nodes: Vec<usize>,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct NodeDef {
    pub(super) name: String,
    pub(super) children: Vec<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) mesh: Option<usize>,
    pub(super) skin: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) weights: Vec<f64>,
    pub(super) extensions: Object,
    pub(super) extras: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct MeshDef {
    pub(super) name: String,
    pub(super) primitives: Vec<PrimitiveDef>,
    pub(super) weights: Vec<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct PrimitiveDef {
    pub(super) attributes: Map<String, Value>,
    pub(super) indices: Option<usize>,
    pub(super) material: Option<usize>,
    pub(super) mode: Option<u64>,
    pub(super) targets: Vec<Map<String, Value>>,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct AccessorDef {
    pub(super) buffer_view: Option<usize>,
    pub(super) byte_offset: u64,
    pub(super) component_type: u64,
    pub(super) normalized: bool,
    pub(super) count: u64,
    #[serde(rename = "type")]
    pub(super) shape: String,
    pub(super) sparse: Option<SparseDef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct SparseDef {
    pub(super) count: u64,
    pub(super) indices: SparsePart,
    pub(super) values: SparsePart,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SparsePart {
    pub(super) buffer_view: usize,
    pub(super) byte_offset: u64,
    pub(super) component_type: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct BufferViewDef {
    pub(super) buffer: usize,
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    pub(super) byte_stride: Option<u64>,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct BufferDef {
    pub(super) uri: Option<String>,
    pub(super) byte_length: u64,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct ImageDef {
    pub(super) name: String,
    pub(super) uri: Option<String>,
    pub(super) buffer_view: Option<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SamplerDef {
    pub(super) mag_filter: Option<u64>,
    pub(super) min_filter: Option<u64>,
    pub(super) wrap_s: Option<u64>,
    pub(super) wrap_t: Option<u64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TextureDef {
    pub(super) sampler: Option<usize>,
    pub(super) source: Option<usize>,
    pub(super) extensions: Object,
}

/// A reference to a texture, with the members of its uses in one: `scale` of normal, `strength` of occlusion.
#[derive(Debug, Default, Clone, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct TextureInfo {
    pub(super) index: usize,
    pub(super) tex_coord: usize,
    pub(super) scale: Option<f64>,
    pub(super) strength: Option<f64>,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct MaterialDef {
    pub(super) name: String,
    pub(super) pbr_metallic_roughness: PbrDef,
    pub(super) normal_texture: Option<TextureInfo>,
    pub(super) occlusion_texture: Option<TextureInfo>,
    pub(super) emissive_texture: Option<TextureInfo>,
    pub(super) emissive_factor: Option<[f64; 3]>,
    pub(super) alpha_mode: Option<String>,
    pub(super) alpha_cutoff: Option<f64>,
    pub(super) double_sided: bool,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct PbrDef {
    pub(super) base_color_factor: Option<[f64; 4]>,
    pub(super) base_color_texture: Option<TextureInfo>,
    pub(super) metallic_factor: Option<f64>,
    pub(super) roughness_factor: Option<f64>,
    pub(super) metallic_roughness_texture: Option<TextureInfo>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct SkinDef {
    pub(super) name: String,
    pub(super) inverse_bind_matrices: Option<usize>,
    pub(super) skeleton: Option<usize>,
    pub(super) joints: Vec<usize>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct CameraDef {
    pub(super) name: String,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) perspective: Option<PerspectiveDef>,
    pub(super) orthographic: Option<OrthographicDef>,
    pub(super) extras: Value,
}

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct PerspectiveDef {
    pub(super) aspect_ratio: Option<f64>,
    pub(super) yfov: Option<f64>,
    pub(super) znear: Option<f64>,
    pub(super) zfar: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct OrthographicDef {
    pub(super) xmag: Option<f64>,
    pub(super) ymag: Option<f64>,
    pub(super) znear: Option<f64>,
    pub(super) zfar: Option<f64>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct AnimationDef {
    pub(super) name: String,
    pub(super) channels: Vec<ChannelDef>,
    pub(super) samplers: Vec<AnimationSamplerDef>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct ChannelDef {
    pub(super) sampler: Option<usize>,
    pub(super) target: TargetDef,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct TargetDef {
    pub(super) node: Option<usize>,
    pub(super) path: String,
    pub(super) extensions: Object,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
pub(super) struct AnimationSamplerDef {
    pub(super) input: Option<usize>,
    pub(super) output: Option<usize>,
    pub(super) interpolation: Option<String>,
}
