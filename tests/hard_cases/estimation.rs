//! Sums over many runs. What blows up: a running sum in f32 stops growing at 2²⁴ equal terms; E[x²] − E[x]² cancels
//! where the mean is large; Σ w L / Σ w divides by nearly nothing under negative lobes. Pixels are summed pairwise in
//! f64 (error ≤ log₂ n roundings), variances from differences of means, weights by regression.

use super::support::count;
use glam::{Vec2, Vec3};
use graeco::film::{Filter, FilterSpec, PixelAccumulator};

/// Sample i as a whole number of 2⁻²⁰, so that sums of integers are exact; even, to fit f32 with 16 before the point.
fn sample(i: u64) -> u64 {
    i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 44
}

/// A hundred million in an optimised build. Bound: half an ulp of the mean as `f32`. Twin: a running sum in `f32`.
#[test]
fn a_hundred_million_samples_sum_without_drift() {
    let n = count(100_000_000, 4_000_000) as u64;
    let mut pixel = PixelAccumulator::new(0);
    let (mut exact, mut naive) = (0_u64, 0.0_f32);
    for i in 0..n {
        let whole = (16 << 20) + (sample(i) >> 1 << 1);
        let x = whole as f32 / 1_048_576.0;
        pixel.add(Vec3::splat(x), 1.0);
        exact += whole;
        naive += x;
    }
    let mean = exact as f64 / 1_048_576.0 / n as f64;
    let error = (f64::from(pixel.estimate().radiance.x) - mean).abs();
    // The mean is rounded to f32 once; all before is below 27 roundings of f64.
    assert!(error <= f64::from(f32::EPSILON) * 0.5 * mean, "{error}");
    let naive_error = (f64::from(naive) / n as f64 - mean).abs() / mean;
    println!("{n} samples: error {error:e}, running f32 sum off by {naive_error:e}");
    assert!(naive_error > 1e-3, "the planted twin is {naive_error} off");
}

/// Bound: 0 exactly, and the true variance within the sampling error of its estimate. Twin: E[x²] − E[x]².
#[test]
fn a_constant_has_no_variance_and_a_huge_offset_hides_none() {
    for n in [1_u32, 5, 16, 64, 100] {
        let mut pixel = PixelAccumulator::new(0);
        (0..n).for_each(|_| pixel.add(Vec3::splat(0.1), 1.0));
        let estimate = pixel.estimate();
        assert_eq!(estimate.radiance, Vec3::splat(0.1));
        assert!(n == 1 || estimate.variance == Vec3::ZERO, "{n}: {}", estimate.variance);
    }
    // 10⁶ ± ½, independent: the mean of n has variance 1 / (4 n).
    let signs = |i: u64| if graeco::numeric::mix64(i + 1) & 1024 == 0 { -0.5_f32 } else { 0.5 };
    let (n, offset) = (4096_u64, 1e6_f32);
    let mut sum = 0.0;
    for trial in 0..64 {
        let mut pixel = PixelAccumulator::new(0);
        (0..n).for_each(|i| pixel.add(Vec3::splat(offset + signs(trial * n + i)), 1.0));
        sum += f64::from(pixel.estimate().variance.x);
    }
    let ratio = sum / 64.0 * 4.0 * n as f64;
    // From four quarters each: χ² with 3 · 64 degrees of freedom has a relative standard deviation of 0.10.
    assert!((ratio - 1.0).abs() < 0.4, "{ratio}");
    // The planted twin, in f32.
    let (mut s, mut q) = (0.0_f32, 0.0_f32);
    (0..n).for_each(|i| {
        let x = offset + signs(i);
        s += x;
        q += x * x;
    });
    let naive = (q / n as f32 - (s / n as f32).powi(2)) / n as f32;
    assert!((f64::from(naive) * 4.0 * n as f64 - 1.0).abs() > 10.0, "the twin reads {naive}");
}

/// Bound: 4, of radiance in [0, 1]. Twin: Σ w L ÷ Σ w.
#[test]
fn negative_lobes_never_divide_by_little() {
    for name in ["lanczos", "mitchell:0,1", "sharpened-gaussian"] {
        let filter = Filter::new(name.parse::<FilterSpec>().unwrap());
        let mut worst_naive = 0.0_f64;
        for seed in 0..4096_u64 {
            let u = |k: u64| sample(seed * 8 + k) as f32 / 1_048_576.0;
            let mut pixel = PixelAccumulator::new(0);
            let (mut weights, mut weighted) = (0.0_f64, 0.0_f64);
            for run in 0..2 {
                let (_, weight) = filter.sample(Vec2::new(u(3 * run), u(3 * run + 1)));
                let radiance = u(3 * run + 2);
                pixel.add(Vec3::splat(radiance), weight);
                weights += f64::from(weight);
                weighted += f64::from(weight * radiance);
            }
            // Two runs in [0, 1] with |w| ≤ 2 stay within a small multiple of that.
            let estimate = pixel.estimate().radiance.x;
            assert!(estimate.is_finite() && estimate.abs() <= 4.0, "{name}: {estimate}");
            worst_naive = worst_naive.max((weighted / weights).abs());
        }
        assert!(worst_naive > 100.0, "{name}: the ratio estimator reads {worst_naive} at worst");
    }
}

/// Bound: one run is the pixel to the last bit but three, and its variance unknown, not 0; a pixel that no run reached,
/// or none that is a number, is black and says so. Twins: quotients by the runs less one, and by none.
#[test]
fn one_run_is_its_own_estimate_and_none_is_black() {
    let mut pixel = PixelAccumulator::new(0);
    assert_eq!((pixel.estimate().radiance, pixel.estimate().runs), (Vec3::ZERO, 0));
    pixel.add(Vec3::new(1e30, 1e-30, 0.5), -1.3);
    let radiance = pixel.estimate().radiance;
    assert!((radiance - Vec3::new(1e30, 1e-30, 0.5)).abs().cmple(Vec3::new(1e24, 1e-36, 1e-6)).all(), "{radiance}");
    pixel.reset(0);
    pixel.add(Vec3::new(f32::NAN, 0.0, 0.0), 1.0);
    assert_eq!((pixel.estimate().rejected, pixel.estimate().runs), (1, 0));
    assert_eq!((pixel.estimate().radiance, pixel.estimate().variance), (Vec3::ZERO, Vec3::INFINITY));
    let runs = |n: f32| ((0.0 / n).is_nan(), (0.0 / (n - 1.0)).is_nan());
    assert_eq!((runs(0.0).0, runs(1.0).1), (true, true), "a twin went unnoticed");
}
