//! Counts: accessors, sparse accessors, instances, meshopt and Draco streams.

use super::{data_uri, read_json};
use draco_core::{
    DataType, EncoderBuffer, EncoderOptions, GeometryAttributeType, Mesh, MeshEncoder, PointAttribute, PointIndex,
};
use graeco::numeric::mix64;
use serde_json::{Value, json};

/// Counts from what may just be allowed to what no machine holds.
const COUNTS: [u64; 7] = [1 << 22, 40_000_000, 1 << 27, 1 << 31, 1 << 32, 1 << 40, u64::MAX];

/// A document with a mesh whose positions are accessor 0 and whose buffer view 0 covers `bytes`.
fn document(bytes: &[u8], view: &Value, accessor: &Value) -> Value {
    let mut first = json!({"buffer": 0, "byteLength": bytes.len()});
    first.as_object_mut().unwrap().extend(view.as_object().unwrap().clone());
    json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": data_uri(bytes), "byteLength": bytes.len()}],
        "bufferViews": [first],
        "accessors": [accessor],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
    })
}

#[test]
fn accessors_that_promise_gigabytes_are_refused() {
    for count in COUNTS {
        for shape in ["SCALAR", "VEC3", "MAT4"] {
            let bare = json!({"componentType": 5126, "type": shape, "count": count});
            let viewed = json!({"bufferView": 0, "componentType": 5126, "type": shape, "count": count});
            let sparse = json!({
                "componentType": 5126, "type": shape, "count": count,
                "sparse": {
                    "count": count,
                    "indices": {"bufferView": 0, "componentType": 5125},
                    "values": {"bufferView": 0}
                }
            });
            for (name, accessor) in [("bare", bare), ("viewed", viewed), ("sparse", sparse)] {
                let result = read_json(&document(&[0; 64], &json!({}), &accessor));
                // Zeros that fit are the file's right.
                assert!(result.is_err() || (name == "bare" && count <= 40_000_000), "{name} {shape} {count}");
            }
        }
    }
}

#[test]
fn instances_that_promise_gigabytes_are_refused() {
    for count in COUNTS {
        let mut file = document(
            &[0; 36],
            &json!({}),
            &json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}),
        );
        file["accessors"].as_array_mut().unwrap().push(json!({"componentType": 5126, "type": "VEC3", "count": count}));
        file["nodes"][0]["extensions"] = json!({"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}});
        let result = read_json(&file);
        // Four million instances take some hundred bytes each.
        assert!(result.is_err() || count <= 1 << 22, "{count} instances were made");
    }
}

/// Streams that end at once, for every count and mode.
#[test]
fn meshopt_streams_that_promise_gigabytes_are_refused() {
    let streams: [(&str, u64, Vec<u8>); 4] = [
        ("ATTRIBUTES", 16, [&[0xa0][..], &[0; 400]].concat()),
        ("ATTRIBUTES", 256, [&[0xa1][..], &[0xaa; 64], &[0; 400]].concat()),
        ("TRIANGLES", 4, [&[0xe1][..], &[0; 400]].concat()),
        ("INDICES", 4, [&[0xd1][..], &[0; 400]].concat()),
    ];
    for extension in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        for (mode, stride, bytes) in &streams {
            for count in COUNTS.map(|c| c / 3 * 3) {
                let how = json!({
                    "buffer": 0, "byteLength": bytes.len(), "byteStride": stride, "count": count, "mode": mode
                });
                let accessor = json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3});
                let file = document(bytes, &json!({"extensions": {extension: how}}), &accessor);
                let problem = read_json(&file).map(|_| ()).expect_err("the stream was believed");
                println!("{mode} of {count}: {problem}");
            }
        }
    }
}

/// A grid of `side`² quads.
fn grid(side: u32, method: i32) -> Vec<u8> {
    let mut mesh = Mesh::new();
    let points = (side + 1) * (side + 1);
    let mut positions = PointAttribute::new();
    positions.init(GeometryAttributeType::Position, 3, DataType::Float32, false, points as usize);
    for i in 0..points {
        let place = [i % (side + 1), i / (side + 1), i % 7].map(|v| v as f32);
        for (k, v) in place.iter().enumerate() {
            positions.buffer_mut().write(i as usize * 12 + 4 * k, &v.to_le_bytes());
        }
    }
    mesh.add_attribute(positions);
    for i in 0..side * side {
        let a = i / side * (side + 1) + i % side;
        for face in [[a, a + 1, a + side + 2], [a, a + side + 2, a + side + 1]] {
            mesh.add_face(face.map(PointIndex));
        }
    }
    let mut options = EncoderOptions::new();
    options.set_global_int("encoding_method", method);
    options.set_attribute_int(0, "quantization_bits", 11);
    let (mut encoder, mut out) = (MeshEncoder::new(), EncoderBuffer::new());
    encoder.set_mesh(mesh);
    encoder.encode(&options, &mut out).unwrap();
    out.data().to_vec()
}

fn draco(bytes: &[u8]) -> Value {
    let accessor = json!({"componentType": 5126, "type": "VEC3", "count": 3});
    let mut file = document(bytes, &json!({}), &accessor);
    file["meshes"][0]["primitives"][0]["extensions"] =
        json!({"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}});
    file
}

/// LEB128, as Draco writes its counts.
fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    loop {
        let low = (value & 127) as u8;
        value >>= 7;
        bytes.push(if value > 0 { low | 128 } else { low });
        if value == 0 {
            return bytes;
        }
    }
}

/// A sound stream whose header promises more: every byte of its first sixty-four in turn becomes a count.
#[test]
fn draco_streams_that_promise_gigabytes_are_refused() {
    for method in [0, 1] {
        let sound = grid(12, method);
        assert!(read_json(&draco(&sound)).is_ok(), "the sound stream loads");
        let (mut refused, mut loaded) = (0, 0);
        for at in 11..64.min(sound.len()) {
            for count in [1_u64 << 20, 10_000_000, 1 << 28, (1 << 32) - 1, 1 << 40] {
                let mut bytes = sound[..at].to_vec();
                bytes.extend(varint(count));
                bytes.extend(&sound[at + 1..]);
                match read_json(&draco(&bytes)) {
                    Ok(_) => loaded += 1,
                    Err(problem) => {
                        refused += 1;
                        assert!(problem.contains("Draco"), "{problem}");
                    }
                }
            }
        }
        println!("Draco method {method}: {refused} refused, {loaded} loaded");
        assert!(refused > loaded, "most such streams are nonsense");
    }
}

/// Random harm to sound streams, in bounded memory.
#[test]
fn damaged_draco_streams_stay_within_bounds() {
    let streams = [grid(5, 0), grid(5, 1), grid(40, 1)];
    for i in 0..600_u64 {
        let mut bytes = streams[(i % 3) as usize].clone();
        for k in 0..1 + mix64(i) % 4 {
            let draw = mix64(i << 8 | k);
            let at = 11 + (draw >> 8) as usize % (bytes.len() - 11);
            bytes[at] = if draw & 1 == 0 { 0xff } else { (draw >> 40) as u8 };
        }
        let _ = read_json(&draco(&bytes));
    }
}
