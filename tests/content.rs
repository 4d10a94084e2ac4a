//! The project's own glTF files: they are what the generator writes, they are sound, and they are small.

#[path = "../examples/make_scenes/mod.rs"]
mod make;

use make::{SHOTS, Shot};
use std::collections::BTreeSet;
use std::path::Path;

/// A file's bytes as committed.
fn committed(shot: &Shot) -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(shot.path);
    std::fs::read(&path)
        .unwrap_or_else(|e| panic!("{}: {e}; run `cargo run --release --example make_scenes`", shot.path))
}

/// An accessor's bytes: the generator packs each tightly into a view of its own.
fn bytes<'a>(accessor: &gltf::Accessor<'_>, blob: &'a [u8]) -> &'a [u8] {
    let view = accessor.view().expect("a view");
    assert_eq!((accessor.offset(), view.stride()), (0, None));
    assert_eq!(view.length(), accessor.count() * accessor.size());
    &blob[view.offset()..view.offset() + view.length()]
}

/// An accessor's floats in rows of `N`.
fn floats<const N: usize>(accessor: &gltf::Accessor<'_>, blob: &[u8]) -> Vec<[f32; N]> {
    assert_eq!(accessor.data_type(), gltf::accessor::DataType::F32);
    let flat: Vec<f32> =
        bytes(accessor, blob).chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    assert!(flat.iter().all(|x| x.is_finite()));
    flat.chunks_exact(N).map(|row| row.try_into().expect("N floats")).collect()
}

/// An accessor's indices, in threes.
fn triangles(accessor: &gltf::Accessor<'_>, blob: &[u8]) -> Vec<[usize; 3]> {
    let bytes = bytes(accessor, blob);
    let flat: Vec<usize> = match accessor.data_type() {
        gltf::accessor::DataType::U16 => {
            bytes.chunks_exact(2).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]]))).collect()
        }
        other => panic!("indices of type {other:?}"),
    };
    assert_eq!(flat.len() % 3, 0);
    flat.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}

#[test]
fn committed_files_are_what_the_generator_writes() {
    for shot in SHOTS {
        let fresh = (shot.make)();
        assert!(committed(shot) == fresh, "{} differs: run `cargo run --release --example make_scenes`", shot.path);
    }
}

#[test]
fn no_other_scene_files_lie_about() {
    let mut found = BTreeSet::new();
    for folder in ["scenes", "animations"] {
        for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).unwrap() {
            let name = entry.unwrap().file_name().into_string().unwrap();
            if name != "README.md" {
                found.insert(format!("{folder}/{name}"));
            }
        }
    }
    let made: BTreeSet<String> = SHOTS.iter().map(|s| s.path.to_owned()).collect();
    assert_eq!(found, made);
}

#[test]
fn files_are_small() {
    let sizes: Vec<usize> = SHOTS.iter().map(|s| committed(s).len()).collect();
    assert!(sizes.iter().all(|&n| n <= 1 << 20), "one is above 1 MiB: {sizes:?}");
    assert!(sizes.iter().sum::<usize>() <= 6 << 20, "all together are above 6 MiB: {sizes:?}");
}

#[test]
fn every_file_passes_the_gltf_crates_validation() {
    for shot in SHOTS {
        let gltf = gltf::Gltf::from_slice(&committed(shot)).unwrap_or_else(|e| panic!("{}: {e}", shot.path));
        assert!(gltf.blob.is_some(), "{}: no binary chunk", shot.path);
        assert_eq!(gltf.cameras().count(), 1, "{}: one camera", shot.path);
    }
}

#[test]
fn triangles_face_where_their_normals_point() {
    for shot in SHOTS {
        let gltf = gltf::Gltf::from_slice(&committed(shot)).unwrap();
        let blob = gltf.blob.as_deref().unwrap();
        for (mesh, primitive) in gltf.meshes().flat_map(|m| m.primitives().map(move |p| (m.index(), p))) {
            let positions = floats::<3>(&primitive.get(&gltf::Semantic::Positions).unwrap(), blob);
            let normals = floats::<3>(&primitive.get(&gltf::Semantic::Normals).unwrap(), blob);
            let triangles = triangles(&primitive.indices().unwrap(), blob);
            assert!(!triangles.is_empty(), "{} mesh {mesh}: no triangles", shot.path);
            for n in &normals {
                let length = glam::Vec3::from_array(*n).length();
                assert!((length - 1.0).abs() < 1e-5, "{} mesh {mesh}: a normal of length {length}", shot.path);
            }
            for t in &triangles {
                let [a, b, c] = t.map(|i| glam::Vec3::from_array(positions[i]).as_dvec3());
                let face = (b - a).cross(c - a).normalize_or_zero();
                let shading: glam::DVec3 = t.iter().map(|&i| glam::Vec3::from_array(normals[i]).as_dvec3()).sum();
                let name = gltf.meshes().nth(mesh).and_then(|m| m.name().map(str::to_owned));
                assert!(
                    face.dot(shading) > 0.0,
                    "{} mesh {mesh} {name:?}: triangle {t:?} at {a} faces {face}, its normals sum to {shading}",
                    shot.path
                );
            }
        }
    }
}

#[test]
fn animations_start_at_zero_and_turn_less_than_half_round_between_keys() {
    for shot in SHOTS.iter().filter(|s| s.path.starts_with("animations/")) {
        let gltf = gltf::Gltf::from_slice(&committed(shot)).unwrap();
        let blob = gltf.blob.as_deref().unwrap();
        let mut end = 0.0_f32;
        for channel in gltf.animations().flat_map(|a| a.channels().collect::<Vec<_>>()) {
            let sampler = channel.sampler();
            let times: Vec<f32> = floats::<1>(&sampler.input(), blob).concat();
            assert!(times[0].abs() < 1e-9, "{}: first key at {} s", shot.path, times[0]);
            assert!(times.windows(2).all(|w| w[0] < w[1]), "{}: times must ascend", shot.path);
            end = end.max(times[times.len() - 1]);
            let linear = sampler.interpolation() == gltf::animation::Interpolation::Linear;
            if linear && channel.target().property() == gltf::animation::Property::Rotation {
                let keys = floats::<4>(&sampler.output(), blob);
                assert_eq!(keys.len(), times.len());
                for pair in keys.windows(2) {
                    // The cosine of half the angle between neighbours: 0 would be half a turn.
                    let cosine = glam::Quat::from_array(pair[0]).dot(glam::Quat::from_array(pair[1])).abs();
                    assert!(cosine > 0.3, "{}: keys too far apart", shot.path);
                }
            }
        }
        assert!((1.0..=3.0).contains(&end), "{}: {end} s long", shot.path);
    }
}

#[test]
fn extras_hold_what_the_renderer_reads() {
    let known = ["f_stop", "aperture_radius", "focus_distance", "shutter_angle"];
    for shot in SHOTS {
        let gltf = gltf::Gltf::from_slice(&committed(shot)).unwrap();
        for camera in gltf.cameras() {
            let Some(extras) = camera.extras() else { continue };
            let extras: serde_json::Map<String, serde_json::Value> = serde_json::from_str(extras.get()).unwrap();
            for (key, value) in &extras {
                assert!(known.contains(&key.as_str()), "{}: camera extra {key}", shot.path);
                assert!(value.as_f64().is_some_and(|x| x > 0.0), "{}: {key} = {value}", shot.path);
            }
        }
    }
    let row = SHOTS.iter().find(|s| s.path.ends_with("blur_row.glb")).unwrap();
    let gltf = gltf::Gltf::from_slice(&committed(row)).unwrap();
    let amounts: Vec<f64> = gltf
        .nodes()
        .filter_map(|n| n.extras().as_ref().map(|e| serde_json::from_str::<serde_json::Value>(e.get()).unwrap()))
        .filter_map(|e| e["motion:blurScale"].as_f64())
        .collect();
    assert_eq!(amounts, [0.0, 0.5, 1.0, 1.5, 2.0]);
}
