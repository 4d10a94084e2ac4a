//! Loading, posing and building, and one frame, on the project's pool table: seconds, and samples a second.
#![allow(
    clippy::unwrap_used,
    missing_docs,
    reason = "a bench that cannot begin has failed; criterion's macros document nothing"
)]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use graeco::render::Progress;
use graeco::scene::gltf::{self, LoadOptions};
use std::path::Path;

#[path = "../tests/support/shots.rs"]
mod shots;

const SIZE: (u32, u32) = (96, 54);
const RUNS: u32 = 16;

fn frames(c: &mut Criterion) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("animations/pool.glb");
    c.bench_function("load pool.glb", |b| b.iter(|| gltf::load(&path, &LoadOptions::default()).unwrap()));

    let scene = shots::load("animations/pool.glb");
    let surroundings = shots::dark();
    let mut group = c.benchmark_group("frame 10 of pool.glb");
    group.sample_size(10);
    for bounces in [0, 2] {
        let settings = shots::settings(SIZE, RUNS, bounces);
        let mut shot = graeco::render::Shot::new(&scene, &settings, &surroundings, "").unwrap();
        group.throughput(Throughput::Elements(u64::from(SIZE.0 * SIZE.1 * RUNS)));
        group.bench_function(format!("{bounces} bounces"), |b| {
            b.iter(|| shot.render(10, &Progress::default()).unwrap().unwrap().film);
        });
    }
    group.finish();
}

criterion_group!(benches, frames);
criterion_main!(benches);
