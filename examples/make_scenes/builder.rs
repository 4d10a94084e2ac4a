//! Writes binary glTF 2.0.

use super::canvas::Canvas;
use super::node::{Eye, Place};
use super::paint::Paint;
use super::shape::Shape;
use super::track::{Run, Target, Track};
use glam::{DAffine3, DQuat, DVec3};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

/// A mesh's accessors: the same geometry may be painted more than once.
#[derive(Debug, Clone)]
pub(crate) struct Geometry {
    attributes: Value,
    indices: usize,
    targets: Vec<Value>,
}
/// Index of a material.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Material(usize);
/// Index of a mesh.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mesh(usize);
/// Index of a node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Node(pub(crate) usize);
/// Index of a texture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Texture(pub(crate) usize);

/// How a texture continues outside [0, 1] and between texels.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Sampling {
    /// Tiled, blended.
    Smooth,
    /// Tiled across, clamped down: a ball's skin.
    Ball,
    /// Tiled, nearest texel: hard edges.
    Hard,
}

/// A glTF file in the making.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Map<String, Value>>,
    roots: Vec<usize>,
    materials: Vec<Value>,
    textures: Vec<Value>,
    images: Vec<Value>,
    cameras: Vec<Value>,
    lights: Vec<Value>,
    skins: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

/// What vertex data and indices are bound as.
const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
/// Component types.
const U8: u32 = 5_121;
const U16: u32 = 5_123;
const U32: u32 = 5_125;
const F32: u32 = 5_126;

/// To the file's single precision.
#[allow(clippy::cast_possible_truncation, reason = "rounding to single precision is what the file holds")]
pub(crate) fn single(x: f64) -> f32 {
    x as f32
}

/// A single-precision number as JSON, with the digits that single precision needs.
fn number(x: f64) -> f64 {
    let single = single(x);
    format!("{single}").parse().expect("a number printed is a number")
}

impl Builder {
    /// Appends bytes as a buffer view and returns its index.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.binary.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    fn accessor(&mut self, view: usize, component: u32, count: usize, kind: &str) -> usize {
        self.accessors.push(json!({ "bufferView": view, "componentType": component, "count": count, "type": kind }));
        self.accessors.len() - 1
    }

    /// Rows of `width` numbers as floats.
    fn floats(&mut self, numbers: &[f64], kind: &str, target: Option<u32>) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = numbers.iter().flat_map(|&x| single(x).to_le_bytes()).collect();
        let view = self.view(&bytes, target);
        self.accessor(view, F32, numbers.len() / width, kind)
    }

    /// Adds the least and greatest entries, which glTF wants of positions and key times.
    fn bounds(&mut self, accessor: usize, numbers: &[f64], width: usize) {
        for (key, pick) in [("min", f64::min as fn(f64, f64) -> f64), ("max", f64::max)] {
            let extreme: Vec<f64> = (0..width)
                .map(|axis| number(numbers.iter().skip(axis).step_by(width).copied().reduce(pick).unwrap_or(0.0)))
                .collect();
            self.accessors[accessor][key] = json!(extreme);
        }
    }

    fn points(&mut self, points: &[DVec3], bounded: bool) -> usize {
        let numbers: Vec<f64> = points.iter().flat_map(|p| p.to_array()).collect();
        let accessor = self.floats(&numbers, "VEC3", Some(ARRAY_BUFFER));
        if bounded {
            self.bounds(accessor, &numbers, 3);
        }
        accessor
    }

    /// Stores a shape.
    pub(crate) fn geometry(&mut self, shape: &Shape) -> Geometry {
        let mut attributes = json!({
            "POSITION": self.points(&shape.positions, true),
            "NORMAL": self.points(&shape.normals, false),
        });
        if !shape.uvs.is_empty() {
            let numbers: Vec<f64> = shape.uvs.iter().flat_map(|p| p.to_array()).collect();
            attributes["TEXCOORD_0"] = self.floats(&numbers, "VEC2", Some(ARRAY_BUFFER)).into();
        }
        if !shape.joints.is_empty() {
            let view = self.view(&shape.joints.concat(), Some(ARRAY_BUFFER));
            attributes["JOINTS_0"] = self.accessor(view, U8, shape.joints.len(), "VEC4").into();
            let numbers = shape.weights.concat();
            attributes["WEIGHTS_0"] = self.floats(&numbers, "VEC4", Some(ARRAY_BUFFER)).into();
        }
        let flat = shape.triangles.concat();
        let short = shape.positions.len() < usize::from(u16::MAX);
        let bytes: Vec<u8> = if short {
            flat.iter().flat_map(|i| u16::try_from(*i).unwrap_or(u16::MAX).to_le_bytes()).collect()
        } else {
            flat.iter().flat_map(|i| i.to_le_bytes()).collect()
        };
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        let indices = self.accessor(view, if short { U16 } else { U32 }, flat.len(), "SCALAR");
        let differences =
            |a: &[DVec3], b: &[DVec3]| -> Vec<DVec3> { a.iter().zip(b).map(|(moved, rest)| *moved - *rest).collect() };
        let targets = shape
            .targets
            .iter()
            .map(|(positions, normals)| {
                let positions = differences(positions, &shape.positions);
                let normals = differences(normals, &shape.normals);
                json!({ "POSITION": self.points(&positions, true), "NORMAL": self.points(&normals, false) })
            })
            .collect();
        Geometry { attributes, indices, targets }
    }

    /// Stores a picture as a texture.
    pub(crate) fn texture(&mut self, name: &str, canvas: &Canvas, sampling: Sampling) -> Texture {
        let view = self.view(&canvas.png(), None);
        self.images.push(json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        let sampler = match sampling {
            Sampling::Smooth => 0,
            Sampling::Ball => 1,
            Sampling::Hard => 2,
        };
        self.textures.push(json!({ "source": self.images.len() - 1, "sampler": sampler }));
        Texture(self.textures.len() - 1)
    }

    /// Stores a material.
    pub(crate) fn material(&mut self, paint: Paint) -> Material {
        self.materials.push(paint.material());
        Material(self.materials.len() - 1)
    }

    /// A mesh of painted geometries.
    pub(crate) fn mesh(&mut self, name: &str, parts: &[(&Geometry, Material)]) -> Mesh {
        let primitives: Vec<Value> = parts
            .iter()
            .map(|(geometry, material)| {
                let mut primitive = json!({
                    "attributes": geometry.attributes,
                    "indices": geometry.indices,
                    "material": material.0,
                });
                if !geometry.targets.is_empty() {
                    primitive["targets"] = json!(geometry.targets);
                }
                primitive
            })
            .collect();
        self.meshes.push(json!({ "name": name, "primitives": primitives }));
        Mesh(self.meshes.len() - 1)
    }

    /// Adds a node.
    pub(crate) fn add(&mut self, place: Place) -> Node {
        let mut node = place.other;
        node.insert("name".into(), place.name.into());
        if place.translation != DVec3::ZERO {
            node.insert("translation".into(), json!(place.translation.to_array().map(number)));
        }
        if place.rotation != DQuat::IDENTITY {
            node.insert("rotation".into(), json!(place.rotation.to_array().map(number)));
        }
        if let Some(Mesh(mesh)) = place.mesh {
            node.insert("mesh".into(), mesh.into());
        }
        let id = self.nodes.len();
        self.nodes.push(node);
        match place.parent {
            None => self.roots.push(id),
            Some(Node(parent)) => match self.nodes[parent].entry("children").or_insert_with(|| json!([])) {
                Value::Array(children) => children.push(id.into()),
                _ => unreachable!("children are always a list"),
            },
        }
        Node(id)
    }

    /// Stores one shape with one material and places it.
    pub(crate) fn put(&mut self, place: Place, shape: &Shape, material: Material) -> Node {
        let geometry = self.geometry(shape);
        let mesh = self.mesh(&place.name, &[(&geometry, material)]);
        self.add(place.with(mesh))
    }

    /// Adds a camera.
    pub(crate) fn camera(&mut self, name: &str, eye: &Eye) -> Node {
        let mut camera = eye.camera();
        camera["name"] = name.into();
        self.cameras.push(camera);
        let [x, y, z] = eye.eye.to_array();
        self.add(Place::new(name).at(x, y, z).turned(eye.rotation()).set("camera", (self.cameras.len() - 1).into()))
    }

    /// Adds a punctual light (`KHR_lights_punctual`); `light` is the extension's object.
    pub(crate) fn light(&mut self, place: Place, light: Value) -> Node {
        self.lights.push(light);
        self.add(place.set("extensions", json!({ "KHR_lights_punctual": { "light": self.lights.len() - 1 } })))
    }

    /// Adds copies of a mesh (`EXT_mesh_gpu_instancing`): translation, rotation, uniform scale of each.
    pub(crate) fn copies(&mut self, place: Place, copies: &[(DVec3, DQuat, f64)]) -> Node {
        let translations: Vec<f64> = copies.iter().flat_map(|c| c.0.to_array()).collect();
        let rotations: Vec<f64> = copies.iter().flat_map(|c| c.1.to_array()).collect();
        let scales: Vec<f64> = copies.iter().flat_map(|c| [c.2; 3]).collect();
        let attributes = json!({
            "TRANSLATION": self.floats(&translations, "VEC3", None),
            "ROTATION": self.floats(&rotations, "VEC4", None),
            "SCALE": self.floats(&scales, "VEC3", None),
        });
        self.add(place.set("extensions", json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } })))
    }

    /// Adds a skin: joints with the world transforms in which the mesh was modelled.
    pub(crate) fn skin(&mut self, name: &str, joints: &[(Node, DAffine3)]) -> Value {
        let matrices: Vec<f64> =
            joints.iter().flat_map(|(_, world)| glam::DMat4::from(world.inverse()).to_cols_array()).collect();
        let accessor = self.floats(&matrices, "MAT4", None);
        let list: Vec<usize> = joints.iter().map(|(node, _)| node.0).collect();
        self.skins.push(json!({ "name": name, "joints": list, "inverseBindMatrices": accessor }));
        (self.skins.len() - 1).into()
    }

    /// Lets a track drive a node.
    pub(crate) fn animate(&mut self, node: Node, track: &Track) {
        let input = self.floats(&track.times, "SCALAR", None);
        self.bounds(input, &track.times, 1);
        let (path, kind) = match track.target {
            Target::Translation => ("translation", "VEC3"),
            Target::Rotation => ("rotation", "VEC4"),
            Target::Weights => ("weights", "SCALAR"),
        };
        let output = self.floats(&track.stored(), kind, None);
        let interpolation = match track.run {
            Run::Linear => "LINEAR",
            Run::Cubic => "CUBICSPLINE",
        };
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        self.channels.push(json!({ "sampler": self.samplers.len() - 1, "target": { "node": node.0, "path": path } }));
    }

    /// The finished file.
    pub(crate) fn finish(mut self, name: &str) -> Vec<u8> {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "Graeco make_scenes" },
            "scene": 0,
            "scenes": [{ "name": name, "nodes": self.roots }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.binary.len() }],
        });
        if !self.textures.is_empty() {
            root["textures"] = json!(self.textures);
            root["images"] = json!(self.images);
            root["samplers"] = json!([
                { "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 },
                { "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 33071 },
                { "magFilter": 9728, "minFilter": 9728, "wrapS": 10497, "wrapT": 10497 },
            ]);
        }
        for (key, list) in [("cameras", &self.cameras), ("skins", &self.skins)] {
            if !list.is_empty() {
                root[key] = json!(list);
            }
        }
        if !self.channels.is_empty() {
            root["animations"] = json!([{ "name": name, "samplers": self.samplers, "channels": self.channels }]);
        }
        if !self.lights.is_empty() {
            root["extensions"] = json!({ "KHR_lights_punctual": { "lights": self.lights } });
        }
        let mut used = BTreeSet::new();
        collect_extensions(&root, &mut used);
        if !used.is_empty() {
            root["extensionsUsed"] = json!(used);
        }
        // The order of keys must not depend on how a dependency configures `serde_json`.
        root.sort_all_objects();
        container(&root, &self.binary)
    }
}

/// Names of all extensions that occur anywhere below `value`.
fn collect_extensions(value: &Value, used: &mut BTreeSet<String>) {
    match value {
        Value::Array(list) => list.iter().for_each(|v| collect_extensions(v, used)),
        Value::Object(map) => {
            for (key, v) in map {
                if let (true, Value::Object(extensions)) = (key == "extensions", v) {
                    used.extend(extensions.keys().cloned());
                }
                collect_extensions(v, used);
            }
        }
        _ => {}
    }
}

/// The GLB container: header, JSON chunk padded with blanks, binary chunk padded with zeros.
fn container(root: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = root.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let size = |n: usize| u32::try_from(n).expect("files made here are small").to_le_bytes();
    let mut out = Vec::with_capacity(json.len() + binary.len() + 28);
    out.extend(b"glTF");
    out.extend(2_u32.to_le_bytes());
    out.extend(size(12 + 8 + json.len() + 8 + binary.len()));
    for (chunk, kind) in [(json.as_slice(), b"JSON"), (binary, b"BIN\0")] {
        out.extend(size(chunk.len()));
        out.extend(kind);
        out.extend(chunk);
    }
    out
}
