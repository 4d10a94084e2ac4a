//! Materials.

use super::builder::Texture;
use glam::DVec3;
use serde_json::{Map, Value, json};

/// A material to be: dielectric, rough, single-sided until told otherwise.
#[derive(Debug, Clone)]
pub(crate) struct Paint {
    name: String,
    pbr: Map<String, Value>,
    top: Map<String, Value>,
    extensions: Map<String, Value>,
}

/// Numbers in the file carry six decimals: enough for any colour.
pub(crate) fn rounded(x: f64) -> f64 {
    libm::round(x * 1e6) / 1e6
}

/// A vector as a JSON array.
pub(crate) fn array(v: DVec3) -> Value {
    json!(v.to_array().map(rounded))
}

impl Paint {
    /// A rough dielectric of a linear colour.
    pub(crate) fn new(name: &str, colour: DVec3) -> Self {
        let mut paint =
            Self { name: name.into(), pbr: Map::new(), top: Map::new(), extensions: Map::new() }.metal(0.0).rough(0.6);
        paint
            .pbr
            .insert("baseColorFactor".into(), json!([rounded(colour.x), rounded(colour.y), rounded(colour.z), 1.0]));
        paint
    }

    /// A lamp: black but for its radiance `colour × strength`.
    pub(crate) fn light(name: &str, colour: DVec3, strength: f64) -> Self {
        // The factor must lie in [0, 1]; what is above goes into the strength.
        let most = colour.max_element();
        let mut paint = Self::new(name, DVec3::ZERO);
        paint.top.insert("emissiveFactor".into(), array(colour / most));
        paint.extension("KHR_materials_emissive_strength", json!({ "emissiveStrength": rounded(strength * most) }))
    }

    /// Metalness.
    pub(crate) fn metal(mut self, amount: f64) -> Self {
        self.pbr.insert("metallicFactor".into(), amount.into());
        self
    }

    /// Perceptual roughness.
    pub(crate) fn rough(mut self, amount: f64) -> Self {
        self.pbr.insert("roughnessFactor".into(), amount.into());
        self
    }

    /// Texture that multiplies the base colour.
    pub(crate) fn texture(mut self, texture: Texture) -> Self {
        self.pbr.insert("baseColorTexture".into(), json!({ "index": texture.0 }));
        self
    }

    /// Texture that multiplies the emitted radiance.
    pub(crate) fn light_texture(mut self, texture: Texture) -> Self {
        self.top.insert("emissiveTexture".into(), json!({ "index": texture.0 }));
        self
    }

    /// Any extension.
    pub(crate) fn extension(mut self, name: &str, value: Value) -> Self {
        self.extensions.insert(name.into(), value);
        self
    }

    /// A coat of clear lacquer of the given roughness.
    pub(crate) fn lacquer(self, roughness: f64) -> Self {
        self.extension(
            "KHR_materials_clearcoat",
            json!({ "clearcoatFactor": 1.0, "clearcoatRoughnessFactor": roughness }),
        )
    }

    /// Clear glass: refracts with index `ior`; what is left of white light after `depth` metres is `tint`.
    pub(crate) fn glass(self, ior: f64, tint: DVec3, depth: f64) -> Self {
        self.rough(0.0)
            .extension("KHR_materials_transmission", json!({ "transmissionFactor": 1.0 }))
            .extension("KHR_materials_ior", json!({ "ior": ior }))
            .extension(
                "KHR_materials_volume",
                json!({ "thicknessFactor": depth, "attenuationDistance": depth, "attenuationColor": array(tint) }),
            )
    }

    /// glTF's material object.
    pub(crate) fn material(mut self) -> Value {
        self.top.insert("name".into(), self.name.into());
        self.top.insert("pbrMetallicRoughness".into(), Value::Object(self.pbr));
        if !self.extensions.is_empty() {
            self.top.insert("extensions".into(), Value::Object(self.extensions));
        }
        Value::Object(self.top)
    }
}
