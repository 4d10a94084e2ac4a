//! Small glTF files made at random: what moves, shines, blurs and mirrors is drawn from a seed.
#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(clippy::unwrap_used, clippy::cast_precision_loss, reason = "a test that cannot begin has failed")]

use graeco::numeric::mix64;
use graeco::study::cost::pictures::base64;
use serde_json::{Value, json};

/// Numbers from a seed.
pub(crate) struct Dice(u64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(mix64(seed ^ 0x7363_656e_6573))
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 11) as f64 * 2.0_f64.powi(-53)
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    fn triple(&mut self, low: f64, high: f64) -> [f64; 3] {
        [0; 3].map(|_| self.between(low, high))
    }

    /// A number below `n`.
    fn below(&mut self, n: u32) -> u32 {
        (0..n).rev().find(|&i| self.unit() * f64::from(i + 1) < 1.0).unwrap_or(0)
    }
}

/// A file as it grows.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    nodes: Vec<Value>,
    lights: Vec<Value>,
    cameras: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

/// Key times, seconds: the exposure of frame 0 ends at 1/48 s.
const DURING: [f64; 2] = [0.0, 1.0 / 48.0];
/// Only after the exposure: what is driven by these stands still within it.
const AFTERWARDS: [f64; 2] = [0.5, 1.0];

impl File {
    fn floats(&mut self, numbers: &[f64], kind: &str, count: usize) -> usize {
        let start = self.bytes.len();
        #[allow(clippy::cast_possible_truncation, reason = "files hold f32")]
        self.bytes.extend(numbers.iter().flat_map(|&x| (x as f32).to_le_bytes()));
        self.views.push(json!({ "buffer": 0, "byteOffset": start, "byteLength": 4 * numbers.len() }));
        let width = numbers.len() / count;
        let end = |pick: fn(f64, f64) -> f64| -> Vec<f64> {
            (0..width).map(|i| numbers.iter().skip(i).step_by(width).copied().reduce(pick).unwrap()).collect()
        };
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": 5126, "count": count, "type": kind,
            "min": end(f64::min), "max": end(f64::max),
        }));
        self.accessors.len() - 1
    }

    /// A mesh of triangles in order; with `target`, a morph target that moves its points so far.
    fn mesh(&mut self, points: &[[f64; 3]], material: usize, target: Option<[f64; 3]>) -> usize {
        let flat = |p: &[[f64; 3]]| p.iter().flatten().copied().collect::<Vec<_>>();
        let position = self.floats(&flat(points), "VEC3", points.len());
        let mut primitive = json!({ "attributes": { "POSITION": position }, "material": material });
        let mut mesh = json!({});
        if let Some(by) = target {
            let moved = self.floats(&flat(&vec![by; points.len()]), "VEC3", points.len());
            primitive["targets"] = json!([{ "POSITION": moved }]);
            mesh["weights"] = json!([0.0]);
        }
        mesh["primitives"] = json!([primitive]);
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    fn node(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    fn drive(&mut self, node: usize, path: &str, times: [f64; 2], values: &[f64]) {
        let kind = match (path, values.len()) {
            ("weights", _) => "SCALAR",
            ("rotation", _) => "VEC4",
            _ => "VEC3",
        };
        let (input, output) = (self.floats(&times, "SCALAR", 2), self.floats(values, kind, 2));
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": "LINEAR" }));
        let sampler = self.samplers.len() - 1;
        self.channels.push(json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }

    fn finish(self) -> String {
        let mut root = json!({
            "asset": { "version": "2.0" }, "scene": 0,
            "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_unlit", "KHR_materials_transmission"],
            "extensions": { "KHR_lights_punctual": { "lights": self.lights } },
            "scenes": [{ "nodes": (0..self.nodes.len()).filter(|n| !is_child(&self.nodes, *n)).collect::<Vec<_>>() }],
            "nodes": self.nodes, "meshes": self.meshes, "materials": self.materials, "cameras": self.cameras,
            "accessors": self.accessors, "bufferViews": self.views,
            "buffers": [{
                "byteLength": self.bytes.len(),
                "uri": format!("data:application/octet-stream;base64,{}", base64(&self.bytes)),
            }],
        });
        if !self.channels.is_empty() {
            root["animations"] = json!([{ "samplers": self.samplers, "channels": self.channels }]);
        }
        if self.lights.is_empty() {
            root.as_object_mut().unwrap().remove("extensions");
        }
        root.to_string()
    }
}

fn is_child(nodes: &[Value], n: usize) -> bool {
    nodes.iter().any(|node| node["children"].as_array().is_some_and(|c| c.iter().any(|c| c.as_u64() == Some(n as u64))))
}

fn quad(side: f64) -> Vec<[f64; 3]> {
    let p = |x: f64, y: f64| [x * side, y * side, 0.0];
    vec![p(-1., -1.), p(1., -1.), p(1., 1.), p(-1., -1.), p(1., 1.), p(-1., 1.)]
}

fn cube(side: f64) -> Vec<[f64; 3]> {
    let face = |turn: fn([f64; 3]) -> [f64; 3]| quad(side).into_iter().map(move |[x, y, _]| turn([x, y, side]));
    face(|p| p)
        .chain(face(|[x, y, z]| [-x, y, -z]))
        .chain(face(|[x, y, z]| [y, z, x]))
        .chain(face(|[x, y, z]| [-y, -z, x]))
        .chain(face(|[x, y, z]| [z, x, y]))
        .chain(face(|[x, y, z]| [-z, -x, y]))
        .collect()
}

fn turned(axis: usize, degrees: f64) -> [f64; 4] {
    let half = degrees.to_radians() * 0.5;
    let mut q = [0.0, 0.0, 0.0, half.cos()];
    q[axis] = half.sin();
    q
}

/// Everything that the seed draws.
pub(crate) struct RandomScene {
    /// The file.
    pub(crate) gltf: String,
    /// Light from all around, grey.
    pub(crate) background: f32,
    /// Bounces to render with.
    pub(crate) bounces: u16,
}

/// The scene of `seed`: one camera five metres before a floor, a wall and some objects.
pub(crate) fn random_scene(seed: u64) -> RandomScene {
    let mut d = Dice::new(seed);
    let mut file = File::default();
    camera(&mut file, &mut d);
    let moves = d.chance(0.6);
    for tilt in [-90.0, 0.0] {
        let material = material(&mut file, &mut d);
        let mesh = file.mesh(&quad(4.0), material, None);
        let at = if tilt < 0.0 { [0.0, -1.0, 0.0] } else { [0.0, 0.0, -3.0] };
        file.node(json!({ "mesh": mesh, "translation": at, "rotation": turned(0, tilt) }));
    }
    for _ in 0..=d.below(4) {
        object(&mut file, &mut d, moves);
    }
    for _ in 0..d.below(3) {
        light(&mut file, &mut d, moves);
    }
    let lamp = d.chance(0.2);
    if lamp {
        file.materials.push(json!({ "emissiveFactor": [1.0, 0.9, 0.7], "doubleSided": true }));
        let glowing = file.materials.len() - 1;
        let mesh = file.mesh(&quad(0.6), glowing, None);
        file.node(json!({ "mesh": mesh, "translation": [0.0, 2.0, 0.5], "rotation": turned(0, 90.0) }));
    }
    let background = if file.lights.is_empty() && !lamp || d.chance(0.15) { d.between(0.3, 1.0) } else { 0.0 };
    #[allow(clippy::cast_possible_truncation, reason = "two digits")]
    let (background, bounces) = (background as f32, [0, 0, 1, 2][d.below(4) as usize]);
    RandomScene { gltf: file.finish(), background, bounces }
}

fn camera(file: &mut File, d: &mut Dice) {
    let mut camera = if d.chance(0.8) {
        json!({ "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } })
    } else {
        json!({ "type": "orthographic", "orthographic": { "xmag": 2.5, "ymag": 2.0, "znear": 0.1, "zfar": 50.0 } })
    };
    if d.chance(0.4) {
        camera["extras"] = json!({ "aperture_radius": d.between(0.02, 0.3), "focus_distance": d.between(2.0, 8.0) });
    }
    file.cameras.push(camera);
    let node = file.node(json!({ "camera": 0, "translation": [0.0, 0.0, 5.0] }));
    if d.chance(0.12) {
        let [x, y, _] = d.triple(-0.6, 0.6);
        file.drive(node, "translation", DURING, &[0.0, 0.0, 5.0, x, y, 5.0]);
    }
}

fn material(file: &mut File, d: &mut Dice) -> usize {
    let [r, g, b] = d.triple(0.2, 0.9);
    let (metallic, roughness) = match d.below(4) {
        0 => (1.0, 0.0),
        1 => (1.0, d.between(0.1, 0.6)),
        2 => (0.0, d.between(0.0, 0.5)),
        _ => (0.0, 1.0),
    };
    let mut material = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": [r, g, b, 1.0], "metallicFactor": metallic, "roughnessFactor": roughness
        },
        "doubleSided": true,
    });
    if d.chance(0.15) {
        material["extensions"] = json!({ "KHR_materials_unlit": {} });
    } else if d.chance(0.1) {
        material["extensions"] = json!({ "KHR_materials_transmission": { "transmissionFactor": 1.0 } });
    }
    if d.chance(0.1) {
        material["alphaMode"] = json!("BLEND");
        material["pbrMetallicRoughness"]["baseColorFactor"] = json!([r, g, b, 0.5]);
    }
    file.materials.push(material);
    file.materials.len() - 1
}

/// A cube or a quad, perhaps on a parent, perhaps out of the camera's sight, perhaps driven by one of its properties.
fn object(file: &mut File, d: &mut Dice, moves: bool) {
    let material = material(file, d);
    let side = d.between(0.3, 0.8);
    let shape = if d.chance(0.5) { cube(side) } else { quad(side) };
    let morphs = d.chance(0.2);
    let target = morphs.then(|| d.triple(-1.0, 1.0));
    let mesh = file.mesh(&shape, material, target);
    let mut at = [d.between(-1.8, 1.8), d.between(-0.6, 1.2), d.between(-2.0, 2.0)];
    if d.chance(0.2) {
        // Seen in mirrors and by its shadow alone.
        at = [d.between(-2.0, 2.0), d.between(2.2, 3.0), d.between(0.0, 7.0)];
    }
    let own = file.node(json!({
        "mesh": mesh, "translation": at, "rotation": turned(d.below(3) as usize, d.between(-60.0, 60.0))
    }));
    let driven = if d.chance(0.3) { file.node(json!({ "children": [own] })) } else { own };
    let base = if driven == own { at } else { [0.0; 3] };
    if !d.chance(0.6) {
        return;
    }
    let times = if moves { DURING } else { AFTERWARDS };
    let by = d.triple(-1.5, 1.5);
    match d.below(3) {
        _ if morphs && d.chance(0.7) => file.drive(own, "weights", times, &[0.0, 1.0]),
        0 => {
            let end: Vec<f64> = base.iter().zip(by).map(|(a, b)| a + b).collect();
            file.drive(driven, "translation", times, &[&base[..], &end[..]].concat());
        }
        1 => {
            let axis = d.below(3) as usize;
            file.drive(driven, "rotation", times, &[turned(axis, 0.0), turned(axis, d.between(20.0, 150.0))].concat());
        }
        _ => {
            let grown = d.between(1.3, 2.5);
            file.drive(driven, "scale", times, &[1.0, 1.0, 1.0, grown, grown, grown]);
        }
    }
}

fn light(file: &mut File, d: &mut Dice, moves: bool) {
    let sized = d.chance(0.35);
    let mut light = match d.below(3) {
        0 => json!({ "type": "point", "intensity": d.between(8.0, 30.0) }),
        1 => json!({ "type": "directional", "intensity": d.between(0.5, 3.0) }),
        _ => json!({ "type": "spot", "intensity": d.between(10.0, 40.0), "spot": { "outerConeAngle": 1.0 } }),
    };
    if sized && light["type"] == "directional" {
        light["extras"] = json!({ "angle": d.between(1.0, 20.0) });
    } else if sized {
        light["extras"] = json!({ "radius": d.between(0.05, 0.4) });
    }
    file.lights.push(light);
    let at = [d.between(-2.0, 2.0), d.between(1.5, 3.0), d.between(0.0, 4.0)];
    let node = file.node(json!({
        "translation": at, "rotation": turned(0, d.between(-70.0, -20.0)),
        "extensions": { "KHR_lights_punctual": { "light": file.lights.len() - 1 } },
    }));
    if d.chance(0.25) {
        let by = d.triple(-1.5, 1.5);
        let end: Vec<f64> = at.iter().zip(by).map(|(a, b)| a + b).collect();
        let times = if moves { DURING } else { AFTERWARDS };
        file.drive(node, "translation", times, &[&at[..], &end[..]].concat());
    }
}
