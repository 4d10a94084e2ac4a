//! Hand-made files, each about one rule.

use super::{LoadOptions, load};
use crate::scene::{LightShape, LocalTransform, Pixels, Property, Scene};
use crate::{Error, Result};
use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::fs;

/// Bytes of a buffer with a view and an accessor for each part.
#[derive(Default)]
struct Bin {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Bin {
    /// A view of `bytes`.
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// An accessor over its own view.
    fn push(&mut self, bytes: &[u8], component: u32, shape: &str, count: usize) -> usize {
        let view = self.view(bytes);
        self.accessor(json!({"bufferView": view, "componentType": component, "type": shape, "count": count}))
    }

    fn floats(&mut self, values: &[f32], shape: &str) -> usize {
        let width = match shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        self.push(bytemuck::cast_slice(values), 5126, shape, values.len() / width)
    }

    fn accessor(&mut self, accessor: Value) -> usize {
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// Loads a file of these and the members of `more`.
    fn load(&self, more: &Value) -> Result<Scene> {
        self.load_with(more, &LoadOptions::default())
    }

    fn load_with(&self, more: &Value, options: &LoadOptions) -> Result<Scene> {
        let mut doc = json!({"asset": {"version": "2.0"}, "bufferViews": self.views, "accessors": self.accessors});
        if !self.bytes.is_empty() {
            doc["buffers"] = json!([{"uri": "a%20b.bin", "byteLength": self.bytes.len()}]);
        }
        for (key, value) in more.as_object().unwrap() {
            doc[key] = value.clone();
        }
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a b.bin"), &self.bytes).unwrap();
        let path = folder.path().join("test.gltf");
        fs::write(&path, doc.to_string()).unwrap();
        load(&path, options)
    }

    /// Loads a single primitive at one node.
    fn primitive(&self, primitive: &Value) -> Result<Scene> {
        self.load(&json!({"nodes": [{"mesh": 0}], "meshes": [{"name": "Body", "primitives": [primitive]}]}))
    }
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

fn refusal(result: Result<Scene>) -> String {
    result.unwrap_err().to_string()
}

#[test]
fn every_component_type_is_read_as_the_specification_says() {
    let cases: [(u32, bool, &[u8], f32); 9] = [
        (5120, false, &[0x80], -128.0),
        (5120, true, &[0x80], -1.0),
        (5121, false, &[255], 255.0),
        (5121, true, &[51], 0.2),
        (5122, false, &[0x00, 0x80], -32768.0),
        (5122, true, &[0x00, 0x80], -1.0),
        (5123, false, &[0xff, 0xff], 65535.0),
        (5123, true, &[0xff, 0xff], 1.0),
        (5126, false, &[0, 0, 0xc0, 0x3f], 1.5),
    ];
    for (component, normalized, bytes, expected) in cases {
        let mut bin = Bin::default();
        // Elements are padded to four bytes, as vertex data must be.
        let element = bytes.repeat(3);
        let stride = element.len().next_multiple_of(4);
        let mut data = Vec::new();
        for _ in 0..3 {
            data.extend_from_slice(&element);
            data.resize(data.len().next_multiple_of(4), 0xee);
        }
        let view = bin.view(&data);
        bin.views[view]["byteStride"] = json!(stride);
        let position = bin.accessor(json!({
            "bufferView": view, "componentType": component, "normalized": normalized, "type": "VEC3", "count": 3
        }));
        let scene = bin.primitive(&json!({"attributes": {"POSITION": position}})).unwrap();
        assert_eq!(scene.meshes[0].positions[2], Vec3::splat(expected), "type {component}, normalised {normalized}");
    }
}

#[test]
fn interleaved_and_sparse_accessors_are_taken_apart() {
    let mut bin = Bin::default();
    let vertices: [[f32; 5]; 3] = [[0.0, 0.0, 0.0, 0.1, 0.2], [1.0, 0.0, 0.0, 0.3, 0.4], [0.0, 1.0, 0.0, 0.5, 0.6]];
    let view = bin.view(bytemuck::cast_slice(&vertices));
    bin.views[view]["byteStride"] = json!(20);
    let position = bin.accessor(json!({"bufferView": view, "componentType": 5126, "type": "VEC3", "count": 3}));
    let uv =
        bin.accessor(json!({"bufferView": view, "byteOffset": 12, "componentType": 5126, "type": "VEC2", "count": 3}));
    let (indices, values) = (bin.view(&[2]), bin.view(bytemuck::cast_slice(&[0.0_f32, 7.0, 0.0])));
    let sparse = json!({
        "count": 1,
        "indices": {"bufferView": indices, "componentType": 5121},
        "values": {"bufferView": values}
    });
    let target = bin.accessor(json!({"componentType": 5126, "type": "VEC3", "count": 3, "sparse": sparse}));
    let primitive = json!({"attributes": {"POSITION": position, "TEXCOORD_0": uv}, "targets": [{"POSITION": target}]});
    let mesh = &bin.primitive(&primitive).unwrap().meshes[0];
    assert_eq!(mesh.uvs[0][2], Vec2::new(0.5, 0.6));
    assert_eq!(mesh.targets[0].positions, [Vec3::ZERO, Vec3::ZERO, Vec3::new(0.0, 7.0, 0.0)]);
    bin.bytes[60] = 3;
    assert!(refusal(bin.primitive(&primitive)).contains("replaces element 3, but it has 3"));
}

#[test]
fn strips_and_fans_keep_their_winding() {
    let mut bin = Bin::default();
    let position = bin.floats(&[0.0; 15], "VEC3");
    for (mode, expected) in [(5, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]), (6, [[1, 2, 0], [2, 3, 0], [3, 4, 0]])] {
        let scene = bin.primitive(&json!({"attributes": {"POSITION": position}, "mode": mode})).unwrap();
        assert_eq!(scene.meshes[0].triangles, expected);
    }
}

#[test]
fn broken_geometry_is_refused_by_name() {
    let mut bin = Bin::default();
    let nan = bin.floats(&[0.0, 0.0, 0.0, 1.0, f32::NAN, 0.0, 0.0, 0.0, 1.0], "VEC3");
    let message = refusal(bin.primitive(&json!({"attributes": {"POSITION": nan}})));
    assert!(message.contains("mesh 0 \"Body\", primitive 0, POSITION: vertex 1 is at [1, NaN, 0]"), "{message}");
    let position = bin.floats(&TRIANGLE, "VEC3");
    let indices = bin.push(&[0, 1, 3], 5121, "SCALAR", 3);
    let message = refusal(bin.primitive(&json!({"attributes": {"POSITION": position}, "indices": indices})));
    assert!(message.contains("index 2 is 3, but there are 3 vertices"), "{message}");
    bin.accessors[position]["count"] = json!(4);
    let message = refusal(bin.primitive(&json!({"attributes": {"POSITION": position}})));
    assert!(message.contains("has 4 elements from byte 0, more than its view of 36 bytes holds"), "{message}");
}

#[test]
fn memory_is_bounded_before_it_is_allocated() {
    for count in [1_u64 << 28, u64::MAX] {
        let mut bin = Bin::default();
        let position = bin.accessor(json!({"componentType": 5126, "type": "VEC3", "count": count}));
        let message = refusal(bin.primitive(&json!({"attributes": {"POSITION": position}})));
        assert!(message.contains("memory"), "{message}");
    }
}

#[test]
fn a_flood_of_empty_objects_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flood.gltf");
    let nodes = "{},".repeat(1_000_000) + "{}";
    fs::write(&path, format!("{{\"asset\": {{\"version\": \"2.0\"}}, \"nodes\": [{nodes}]}}")).unwrap();
    assert!(refusal(load(&path, &LoadOptions::default())).contains("memory"));
}

#[test]
fn loops_and_second_parents_are_refused() {
    let bin = Bin::default();
    let message = refusal(bin.load(&json!({"nodes": [{"children": [1]}, {"name": "B", "children": [0]}]})));
    assert!(message.contains("its own ancestor"), "{message}");
    let message = refusal(bin.load(&json!({"nodes": [{"children": [2]}, {"children": [2]}, {"name": "C"}]})));
    assert!(message.contains("node 2 \"C\": is a child of node 0 and of node 1"), "{message}");
}

#[test]
fn a_chain_of_many_nodes_does_not_exhaust_the_stack() {
    let count = 100_000;
    let nodes: Vec<Value> =
        (0..count).map(|i| if i + 1 < count { json!({"children": [i + 1]}) } else { json!({}) }).collect();
    let scene = Bin::default().load(&json!({ "nodes": nodes })).unwrap();
    assert_eq!((scene.order.len(), scene.nodes[count - 1].parent), (count, Some(count - 2)));
}

#[test]
fn references_out_of_the_folder_are_refused_by_name() {
    let bin = Bin::default();
    let file = |uri: &str| {
        json!({
            "buffers": [{"uri": uri, "byteLength": 36}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
            "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]
        })
    };
    for (uri, why) in [("../x.bin", "\"..\""), ("/etc/passwd", "absolute path"), ("http://host/x.bin", "scheme http:")]
    {
        assert!(refusal(bin.load(&file(uri))).contains(why), "{uri}");
    }
    let open = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    assert!(refusal(bin.load_with(&file("http://host/x.bin"), &open)).contains("scheme http:"));
    assert!(!refusal(bin.load_with(&file("/no/such/file"), &open)).contains("absolute path"));
}

#[test]
fn required_extensions_that_are_unknown_are_refused_and_optional_ones_noted() {
    let bin = Bin::default();
    let names = json!(["EXT_from_the_future"]);
    let error = bin.load(&json!({"extensionsUsed": names, "extensionsRequired": names})).unwrap_err();
    assert!(matches!(error, Error::UnsupportedExtension { extension, .. } if extension == "EXT_from_the_future"));
    let scene = bin.load(&json!({ "extensionsUsed": names })).unwrap();
    assert!(scene.warnings[0].contains("EXT_from_the_future") && !scene.extensions[0].supported);
}

fn animated(times: &[f32], path: &str, values: &[f32], shape: &str) -> Result<Scene> {
    let mut bin = Bin::default();
    let (input, output) = (bin.floats(times, "SCALAR"), bin.floats(values, shape));
    bin.load(&json!({
        "nodes": [{"name": "Ball"}],
        "animations": [{
            "channels": [{"sampler": 0, "target": {"node": 0, "path": path}}],
            "samplers": [{"input": input, "output": output}]
        }]
    }))
}

#[test]
fn key_times_may_repeat_but_not_descend() {
    let values = [0.0; 9];
    let message = refusal(animated(&[0.0, 2.0, 1.0], "translation", &values, "VEC3"));
    assert!(message.contains("animation 0, channel 0, key times: key 2 is at 1 s, before key 1 at 2 s"), "{message}");
    let scene = animated(&[0.0, 1.0, 1.0], "translation", &values, "VEC3").unwrap();
    let Property::Translation(track) = &scene.animations[0].channels[0].property else { panic!("a translation") };
    assert_eq!(track.times, [0.0, 1.0, 1.0]);
    assert!(refusal(animated(&[f32::NAN, 1.0, 2.0], "scale", &values, "VEC3")).contains("not finite"));
    assert!(refusal(animated(&[0.0, 1.0, 2.0, 3.0], "scale", &values, "VEC3")).contains("are 3 where 4 keys need 4"));
}

#[test]
fn rotations_without_length_become_the_identity() {
    let scene = animated(&[0.0, 1.0], "rotation", &[0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0], "VEC4").unwrap();
    let Property::Rotation(track) = &scene.animations[0].channels[0].property else { panic!("a rotation") };
    assert_eq!(track.values, [glam::Quat::IDENTITY, glam::Quat::from_xyzw(0.0, 1.0, 0.0, 0.0)]);
    assert_eq!(scene.warnings.len(), 2);
}

/// A skinned triangle whose skin's joint lies in another scene.
fn skinned(joints: [u8; 12], weights: [f32; 12]) -> Result<Scene> {
    let mut bin = Bin::default();
    let position = bin.floats(&TRIANGLE, "VEC3");
    let (joints, weights) = (bin.push(&joints, 5121, "VEC4", 3), bin.floats(&weights, "VEC4"));
    bin.load(&json!({
        "scenes": [{"nodes": [0]}, {"nodes": [1]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"children": [2], "mesh": 0}, {"name": "Joint"}],
        "skins": [{"joints": [2]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights}}]}]
    }))
}

#[test]
fn joints_outside_the_scene_move_but_show_nothing() {
    let mut joints = [0; 12];
    joints[7] = 200;
    let scene = skinned(joints, [1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(scene.nodes.len(), 3);
    let joint = scene.skins[0].joints[0];
    assert_eq!(scene.nodes[joint].name, "Joint");
    assert!(scene.nodes[scene.nodes[joint].parent.unwrap()].meshes.is_empty());
    let skin = scene.meshes[0].skin.as_ref().unwrap();
    // Scaled to sum to 1; without any weight the first joint takes all; joints without weight are not looked at.
    assert_eq!(skin.weights, [0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(skin.joints.iter().all(|&j| j == 0));
}

#[test]
fn joints_that_the_skin_lacks_are_refused() {
    let mut joints = [0; 12];
    joints[4] = 1;
    let message = refusal(skinned(joints, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]));
    assert!(message.contains("uses joint 1, but its skin has 1 of them"), "{message}");
}

#[test]
fn normals_without_length_are_taken_from_the_triangles() {
    let mut bin = Bin::default();
    let position = bin.floats(&TRIANGLE, "VEC3");
    let normal = bin.floats(&[0.0, 0.0, 0.0, 0.0, 3.0, 0.0, f32::NAN, 0.0, 0.0], "VEC3");
    let scene = bin.primitive(&json!({"attributes": {"POSITION": position, "NORMAL": normal}})).unwrap();
    assert_eq!(scene.meshes[0].normals, [Vec3::Z, Vec3::Y, Vec3::Z]);
    assert_eq!(scene.warnings.len(), 2);
}

#[test]
fn tangents_follow_u_and_split_mirrored_vertices() {
    let mut bin = Bin::default();
    // Two triangles that share an edge; u runs along +x on the left and along −x on the right.
    let position = bin.floats(&[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0], "VEC3");
    let normal = bin.floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0], "VEC3");
    let uv = bin.floats(&[1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0], "VEC2");
    let indices = bin.push(&[2, 0, 1, 0, 3, 1], 5121, "SCALAR", 6);
    let target = bin.floats(&[0.0; 12], "VEC3");
    let image = tiny_png();
    let view = bin.view(&image);
    let scene = bin
        .load(&json!({
            "nodes": [{"mesh": 0}],
            "images": [{"bufferView": view, "mimeType": "image/png"}],
            "textures": [{"source": 0}],
            "materials": [{"normalTexture": {"index": 0}}],
            "meshes": [{"primitives": [{
                "attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv},
                "targets": [{"POSITION": target}], "indices": indices, "material": 0
            }]}]
        }))
        .unwrap();
    let mesh = &scene.meshes[0];
    assert_eq!((mesh.positions.len(), mesh.targets[0].positions.len(), mesh.uvs[0].len()), (6, 6, 6));
    for (triangle, u) in mesh.triangles.iter().zip([Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(-1.0, 0.0, 0.0, -1.0)]) {
        for &vertex in triangle {
            assert!((mesh.tangents[vertex as usize] - u).length() < 1e-6, "{}", mesh.tangents[vertex as usize]);
        }
    }
    assert!(matches!(&scene.images[0].pixels, Pixels::Rgba8(p) if *p == [[128, 128, 255, 255]]));
}

fn tiny_png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_pixel(1, 1, image::Rgb([128, 128, 255]))
        .write_to(&mut bytes, image::ImageFormat::Png)
        .unwrap();
    bytes.into_inner()
}

/// The numbers are Khronos's TextureTransformTest: the arrow of the image points at (0.778, 0.778), and the quad's
/// marker for a correct rotation lies at (0.421, 1.016).
#[test]
fn texture_rotation_turns_the_way_that_khronos_tests() {
    let mut bin = Bin::default();
    let position = bin.floats(&TRIANGLE, "VEC3");
    let view = bin.view(&tiny_png());
    let scene = bin
        .load(&json!({
            "nodes": [{"mesh": 0}],
            "images": [{"bufferView": view}],
            "textures": [{"source": 0}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, "extensions": {
                "KHR_texture_transform": {"rotation": std::f64::consts::FRAC_PI_8, "texCoord": 1}}}}}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": position}, "material": 0}]}]
        }))
        .unwrap();
    let reference = scene.materials[0].base_color_texture.unwrap();
    assert_eq!(reference.uv_set, 1);
    let there = reference.transform.transform_point2(Vec2::new(0.420_951_8, 1.016_267_5));
    assert!((there - Vec2::splat(0.777_817)).length() < 2e-6, "{there}");
}

#[test]
fn a_broken_image_costs_its_texture_not_the_file() {
    let mut bin = Bin::default();
    let position = bin.floats(&TRIANGLE, "VEC3");
    let (good, bad) = (bin.view(&tiny_png()), bin.view(b"\x89PNG\r\n\x1a\nnonsense"));
    let scene = bin
        .load(&json!({
            "nodes": [{"mesh": 0}],
            "images": [{"bufferView": bad, "name": "Bark"}, {"bufferView": good}],
            "textures": [{"source": 0}, {"source": 1}],
            "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}, "emissiveTexture": {"index": 1}}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": position}, "material": 0}]}]
        }))
        .unwrap();
    let material = &scene.materials[0];
    assert!(material.base_color_texture.is_none());
    assert_eq!(material.emissive_texture.unwrap().texture, 0);
    assert_eq!((scene.textures.len(), scene.images.len()), (1, 1));
    assert!(scene.warnings[0].contains("image 0 \"Bark\""), "{:?}", scene.warnings);
}

#[test]
fn extras_bring_lens_blur_and_sizes_of_lights() {
    let file = |node: Value| {
        json!({
            "extensionsUsed": ["KHR_lights_punctual"],
            "extensions": {"KHR_lights_punctual": {"lights": [
                {"type": "directional", "intensity": 2.0, "extras": {"angle": 1.0}}]}},
            "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1},
                         "extras": {"f_stop": 2.8, "unknown": "left alone"}}],
            "nodes": [{"name": "Hero", "camera": 0, "extras": node,
                       "extensions": {"KHR_lights_punctual": {"light": 0}}}]
        })
    };
    let bin = Bin::default();
    let scene = bin.load(&file(json!({"motion:blurScale": 0.5, "focus_distance": 3.0, "f_stop": 4.0}))).unwrap();
    let lens = scene.cameras[0].lens;
    assert_eq!((lens.f_stop, lens.focus_distance, scene.nodes[0].blur_scale), (Some(4.0), Some(3.0), Some(0.5)));
    assert!(matches!(scene.lights[0].shape, LightShape::Directional { angular_radius }
        if (angular_radius - 0.5_f32.to_radians()).abs() < 1e-7));
    assert!(scene.nodes[0].visible);
    for (extras, why) in [
        (json!({"f_stop": "wide"}), "extras.f_stop is \"wide\", expected a number"),
        (json!({"focus_distance": 0.0}), "extras.focus_distance is 0.0, expected a number above 0"),
        (json!({"motion:blurScale": -1}), "extras.motion:blurScale is -1, expected a number of at least 0"),
    ] {
        let message = refusal(bin.load(&file(extras)));
        assert!(message.contains("node 0 \"Hero\"") && message.contains(why), "{message}");
    }
}

#[test]
fn matrices_of_animated_nodes_are_taken_apart() {
    let mut bin = Bin::default();
    let (input, output) = (bin.floats(&[0.0], "SCALAR"), bin.floats(&[1.0, 2.0, 3.0], "VEC3"));
    let file = |matrix: [f32; 16]| {
        json!({
            "nodes": [{"matrix": matrix}],
            "animations": [{
                "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
                "samplers": [{"input": input, "output": output}]
            }]
        })
    };
    let mut matrix = glam::Mat4::from_scale(Vec3::new(2.0, 3.0, -4.0)).to_cols_array();
    let scene = bin.load(&file(matrix)).unwrap();
    let LocalTransform::Parts { scale, rotation, .. } = scene.nodes[0].local else { panic!("parts") };
    assert!((rotation * (scale * Vec3::ONE) - Vec3::new(2.0, 3.0, -4.0)).length() < 1e-6);
    matrix[0] = 0.0;
    let scene = bin.load(&file(matrix)).unwrap();
    assert!(scene.animations[0].channels.is_empty() && scene.warnings.len() == 1);
}
