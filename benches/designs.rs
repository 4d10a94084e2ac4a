//! Nanoseconds a seven-dimensional sample, one thread, the pixel's set-up included.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use graeco::design::{Design, DesignOptions, Dither, Kind, Mask, Over, PixelAddress};
use graeco::trace::analytic::FACTORS;
use std::hint::black_box;

/// Pixels of one measurement.
const PIXELS: i32 = 64;

fn sum_of_all(design: &Design) -> f32 {
    let mut sum = 0.0;
    for x in 0..PIXELS {
        let pixel = design.pixel(PixelAddress { x, y: 17, frame: 3, field: 0 });
        for run in 0..design.runs() {
            let point = pixel.point(run);
            for factor in FACTORS {
                sum += point.get(factor);
            }
        }
    }
    sum
}

fn samples(c: &mut Criterion) {
    let mut group = c.benchmark_group("samples");
    for (kind, runs) in [
        (Kind::Random, 16),
        (Kind::Jittered, 16),
        (Kind::LatinHypercube, 16),
        (Kind::Orthogonal, 16),
        (Kind::Orthogonal, 64),
        (Kind::OrthogonalCorrelated, 49),
        (Kind::OrthogonalCorrelated, 64),
        (Kind::Sobol, 64),
        (Kind::Nested, 16),
        (Kind::Nested, 256),
        (Kind::Strong, 16),
        (Kind::Strong, 64),
        (Kind::Strong, 1024),
    ] {
        let options = DesignOptions { kind, dither: Dither::NONE, runs, ..Default::default() };
        bench(&mut group, &format!("{kind}"), &options);
    }
    for (mask, over, runs) in [
        (Mask::Ordered, Over::Time, 1),
        (Mask::R2, Over::All, 1),
        (Mask::BlueNoise, Over::Time, 1),
        (Mask::ZOrder, Over::All, 1),
        (Mask::ZOrder, Over::All, 4),
    ] {
        let options = DesignOptions { dither: Dither { mask, over }, runs, ..Default::default() };
        bench(&mut group, &options.dither.to_string(), &options);
    }
    group.finish();
}

fn bench(
    group: &mut criterion::BenchmarkGroup<'_, criterion::measurement::WallTime>,
    name: &str,
    options: &DesignOptions,
) {
    let design = Design::new(options, &FACTORS);
    group.throughput(Throughput::Elements(u64::from(options.runs) * PIXELS.unsigned_abs() as u64));
    group.bench_with_input(BenchmarkId::new(name, options.runs), &design, |b, design| {
        b.iter(|| sum_of_all(black_box(design)));
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).measurement_time(std::time::Duration::from_secs(1))
        .warm_up_time(std::time::Duration::from_millis(300));
    targets = samples
}
criterion_main!(benches);
