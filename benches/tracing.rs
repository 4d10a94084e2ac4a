//! Rays a second and triangles a second, by kind of scene. To compare with Embree see `benches/embree/`.

#![allow(missing_docs, reason = "not a library")]

#[allow(dead_code, unreachable_pub, clippy::unwrap_used, reason = "shared with the comparison")]
#[path = "embree/scenes.rs"]
mod scenes;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use graeco::trace::Ray;
use graeco::trace::accel::Accel;
use scenes::Case;

/// Every `STRIDE`-th of a million rays: 65 536.
const STRIDE: usize = 16;

fn rays(c: &mut Criterion, case: &Case) {
    let (scene, stage) = case.stage();
    let accel = Accel::build(&scene, &stage, None);
    let primary = case.primary();
    // Whole tiles of 256, so that neighbours stay neighbours.
    let primary: Vec<Ray> = primary.chunks(256).step_by(STRIDE).flatten().copied().collect();
    let [bounces, shadows] = case.secondary(&accel, &scene, &stage, &primary);
    let mut group = c.benchmark_group(case.name);
    let closest = |rays: &[Ray]| rays.iter().filter(|r| accel.closest(r, |_| true).is_some()).count();
    let any = |rays: &[Ray]| rays.iter().filter(|r| accel.occluded(r, |_| true)).count();
    group.throughput(Throughput::Elements(primary.len() as u64));
    group.bench_function("primary", |b| b.iter(|| closest(&primary)));
    group.throughput(Throughput::Elements(bounces.len() as u64));
    group.bench_function("bounce", |b| b.iter(|| closest(&bounces)));
    group.bench_function("bounce, any hit", |b| b.iter(|| any(&bounces)));
    group.throughput(Throughput::Elements(shadows.len() as u64));
    group.bench_function("shadow, any hit", |b| b.iter(|| any(&shadows)));
    group.finish();
}

fn builds(c: &mut Criterion, case: &Case) {
    let (scene, stage) = case.stage();
    let triangles: usize = case.shapes.iter().map(|s| s.triangles.len()).sum();
    let mut group = c.benchmark_group(case.name);
    group.sample_size(10).throughput(Throughput::Elements(triangles as u64));
    group.bench_function("build", |b| b.iter(|| Accel::build(&scene, &stage, None)));
    let previous = Accel::build(&scene, &stage, None);
    group.bench_function("next frame", |b| b.iter(|| Accel::build(&scene, &stage, Some(&previous))));
    group.finish();
}

fn tracing(c: &mut Criterion) {
    for case in [
        scenes::one_mesh("still mesh", 1),
        scenes::one_mesh("deforming mesh", 2),
        scenes::instanced("still instances", 1),
        scenes::instanced("moving instances", 2),
        scenes::instanced("turning instances", 5),
    ] {
        builds(c, &case);
        rays(c, &case);
    }
}

criterion_group!(benches, tracing);
criterion_main!(benches);
