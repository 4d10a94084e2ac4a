//! ZIP archives whose directories promise what they do not hold, and URIs.

use super::{read, read_json};
use serde_json::json;
use std::io::Write;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

const MANIFEST: &str = "graeco-pack.json";

/// An archive of one empty scene whose manifest says that it has `claimed` bytes.
fn pack(claimed: u64) -> Vec<u8> {
    let scene = br#"{"asset": {"version": "2.0"}}"#;
    let files = [json!({"name": "a.gltf", "bytes": claimed, "blake3": blake3::hash(scene).to_hex().to_string()})];
    let manifest = json!({
        "format": "graeco-pack-1", "program": "test", "scene": "a.gltf", "scene_hash": "", "files": files
    });
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, bytes) in [("a.gltf", &scene[..]), (MANIFEST, manifest.to_string().as_bytes())] {
        zip.start_file(name, options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn refusal(bytes: &[u8]) -> Result<(), String> {
    let file = tempfile::Builder::new().suffix(".zip").tempfile().unwrap();
    std::fs::write(file.path(), bytes).unwrap();
    read(file.path()).map(|_| ())
}

#[test]
fn a_manifest_cannot_promise_more_than_the_archive_holds() {
    // The archive with the right length gets as far as its scene's hash, which it leaves empty.
    let problem = refusal(&pack(29)).unwrap_err();
    assert!(problem.contains("holds a scene with the hash"), "{problem}");
    for claimed in [1_u64 << 30, 1 << 40, u64::MAX] {
        let problem = refusal(&pack(claimed)).unwrap_err();
        assert!(problem.contains("must be stored"), "{problem}");
    }
}

/// Sizes, counts and offsets of both directories, each set to ones in turn.
#[test]
fn directories_that_promise_gigabytes_are_refused_or_harmless() {
    let sound = pack(29);
    let mut refused = 0;
    for (signature, span) in [(b"PK\x03\x04", 30), (b"PK\x01\x02", 46), (b"PK\x05\x06", 22)] {
        let starts: Vec<usize> = (0..sound.len() - 4).filter(|&i| sound[i..i + 4] == signature[..]).collect();
        for start in starts {
            for at in start + 4..start + span {
                for width in [2_usize, 4] {
                    let mut bytes = sound.clone();
                    let end = (at + width).min(bytes.len());
                    bytes[at..end].fill(0xff);
                    refused += u32::from(refusal(&bytes).is_err());
                }
            }
        }
    }
    println!("{refused} refused");
    assert!(refused > 50);
}

/// Deep brackets, long lists of nothing, and a URI of nothing but percent signs.
#[test]
fn documents_are_no_bombs_either() {
    let file = tempfile::Builder::new().suffix(".gltf").tempfile().unwrap();
    for text in ["[".repeat(1 << 20), format!("{{\"extras\": {}", "{\"a\":".repeat(1 << 18)), "[0,".repeat(1 << 16)] {
        std::fs::write(file.path(), text).unwrap();
        assert!(read(file.path()).is_err());
    }
    let nodes: Vec<_> = (0..100_000).map(|i| json!({"children": [i + 1]})).collect();
    // One after another a hundred thousand deep, the last of which is missing.
    assert!(read_json(&json!({"asset": {"version": "2.0"}, "nodes": nodes})).is_err());
    for uri in ["%".repeat(1 << 20), format!("data:;base64,{}", "=".repeat(1 << 20)), "data:,".to_owned()] {
        let buffers = json!([{"uri": uri, "byteLength": 1_u64 << 40}]);
        let accessor = json!({"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 1_u64 << 36});
        let result = read_json(&json!({
            "asset": {"version": "2.0"}, "buffers": buffers,
            "bufferViews": [{"buffer": 0, "byteLength": 1_u64 << 40}], "accessors": [accessor],
            "nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        }));
        assert!(result.is_err());
    }
}
