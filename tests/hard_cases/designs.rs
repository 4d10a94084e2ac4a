//! Case 11. Draws at the ends of their addresses. What blows up: a 32-bit hash as `bits / 2³²` rounds to 1 in f32; indices near
//! 2³² wrap; coordinates of pixels far from the origin collide. Coordinates keep 24 bits at most, so that 1 is never
//! reached. Twins: that quotient; strata by a product in `f32`; addresses by sums. Indices near 2³², which no public
//! design reaches alone, are in the unit tests of `design::hash`.

use graeco::design::array::OrthogonalArray;
use graeco::design::{Design, DesignOptions, Dither, Factor, Kind, Mask, Over, PixelAddress};

const ENDS: [i32; 7] = [i32::MIN, i32::MIN + 1, -1, 0, 1, i32::MAX - 1, i32::MAX];

fn factors() -> [Factor; 9] {
    let [light_u, light_v] = [Factor::light_u(0), Factor::light_v(0)];
    let camera = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER, Factor::LENS_U, Factor::LENS_V];
    let [x, y, shutter, lens_u, lens_v] = camera;
    [x, y, shutter, lens_u, lens_v, light_u, light_v, Factor::lobe_u(0), Factor::lobe_v(0)]
}

#[test]
fn coordinates_stay_below_one_at_every_address() {
    let factors = factors();
    let beyond = [Factor::light_u(7), Factor::lobe_v(4000), Factor::extra(0), Factor::extra(30_000)];
    for (_, kind) in Kind::ALL.iter().map(|k| (k.name(), *k)) {
        for runs in [1, 16, 49, 64] {
            let design =
                Design::new(&DesignOptions { kind, runs, seed: u64::MAX, ..DesignOptions::default() }, &factors);
            for (x, y) in ENDS.iter().flat_map(|x| ENDS.iter().map(move |y| (*x, *y))) {
                let pixel = design.pixel(PixelAddress { x, y, frame: i64::from(x) << 20, field: 1 });
                for run in [0, runs - 1] {
                    let point = pixel.point(run);
                    for factor in factors.iter().chain(&beyond) {
                        let u = point.get(*factor);
                        assert!((0.0..1.0).contains(&u), "{kind}, {runs} runs, {factor} at {x},{y}: {u}");
                    }
                }
            }
        }
    }
    // The planted twin: the usual quotient.
    #[allow(clippy::cast_precision_loss, reason = "the fault itself")]
    let naive = |bits: u32| bits as f32 / 4_294_967_296.0;
    assert!(naive(u32::MAX) >= 1.0);
    assert!(graeco::numeric::unit_from_bits(u32::MAX) < 1.0);
}

#[test]
fn pixels_at_the_ends_draw_differently() {
    let design = Design::new(&DesignOptions { runs: 4, ..DesignOptions::default() }, &factors());
    let mut seen = std::collections::HashSet::new();
    let mut count = 0;
    for (x, y) in ENDS.iter().flat_map(|x| ENDS.iter().map(move |y| (*x, *y))) {
        for frame in [i64::from(i32::MIN), -1, 0, i64::from(i32::MAX)] {
            let pixel = design.pixel(PixelAddress { x, y, frame, field: 0 });
            seen.insert(factors().iter().map(|f| pixel.point(1).get(*f).to_bits()).collect::<Vec<_>>());
            count += 1;
        }
    }
    assert_eq!(seen.len(), count, "two addresses draw alike");
    // The planted twin: a hash of the sum, as of a picture's pixels in order.
    let naive: std::collections::HashSet<i64> = ENDS
        .iter()
        .flat_map(|x| ENDS.iter().map(move |y| (i64::from(*x) + 65_536 * i64::from(*y)) & 0xffff_ffff))
        .collect();
    assert!(naive.len() < 49, "the twin went unnoticed");
}

/// Every number of levels up to 32: the n² runs of a Latin square, and where n is the power of a prime those of Bose's
/// array and of its correlated refinement, fall into each of the n² strata of each factor once, by exact arithmetic, at
/// the ends of the addresses. Twin: level plus jitter over levels, in `f32`, which rounds into the next stratum.
#[test]
fn levels_are_exact_at_the_borders_of_strata_for_every_number_up_to_32() {
    let mut arrays = 0;
    for n in 1..=32_u32 {
        let runs = n * n;
        let mut kinds = vec![Kind::LatinSquare];
        if OrthogonalArray::bose(n).is_some() {
            kinds.extend([Kind::Orthogonal, Kind::OrthogonalCorrelated]);
            arrays += 1;
        }
        for kind in kinds {
            let count = if kind == Kind::LatinSquare { 3 } else { (n as usize + 1).min(9) };
            let options = DesignOptions { kind, dither: Dither::NONE, runs, seed: 3, ..DesignOptions::default() };
            let design = Design::new(&options, &factors()[..count]);
            assert_eq!(design.kind(), kind, "{n}");
            for (x, y) in [(i32::MIN, i32::MAX), (i32::MAX, i32::MIN), (0, -1)] {
                let pixel = design.pixel(PixelAddress { x, y, frame: i64::MAX >> 2, field: 1 });
                for &factor in design.factors() {
                    let mut seen = vec![false; runs as usize];
                    for run in 0..runs {
                        // 24 bits times n² below 2¹¹: exact in f64, and so is its whole part.
                        let stratum = (f64::from(pixel.point(run).get(factor)) * f64::from(runs)) as usize;
                        assert!(!std::mem::replace(&mut seen[stratum], true), "{kind}, {n} levels, {factor}");
                    }
                }
            }
        }
    }
    assert_eq!(arrays, 18, "the powers of primes up to 32");
    let last = 1.0 - f32::EPSILON / 2.0;
    let off = (1..=1024_u16).filter(|&n| {
        (0..n).any(|k| {
            let u = (f32::from(k) + last) / f32::from(n);
            (f64::from(u) * f64::from(n)) as u16 != k
        })
    });
    assert!(off.count() > 100, "the twin went unnoticed");
}

/// One sequence over the whole picture and time numbers its points modulo 2³²: pixels and frames at the ends of their
/// ranges reach and pass it. Bound: coordinates stay in [0, 1), and neighbours draw apart.
#[test]
fn a_sequence_over_the_picture_passes_the_end_of_its_indices() {
    let over = Dither { mask: Mask::ZOrder, over: Over::All };
    for (runs, frames) in [(1, 1), (16, 24), (49, 1000), (1 << 20, 1 << 16)] {
        let options = DesignOptions { dither: over, runs, frames, seed: 9, ..DesignOptions::default() };
        let design = Design::new(&options, &factors());
        let mut seen = std::collections::HashSet::new();
        for (x, y) in ENDS.iter().flat_map(|x| ENDS.iter().map(move |y| (*x, *y))) {
            let pixel = design.pixel(PixelAddress { x, y, frame: i64::from(x), field: 0 });
            for run in [0, runs - 1] {
                let point = pixel.point(run);
                let u = factors().map(|f| point.get(f));
                assert!(u.iter().all(|u| (0.0..1.0).contains(u)), "{u:?}");
                seen.insert(u.map(f32::to_bits));
            }
        }
        assert!(seen.len() >= 49, "{runs}: only {} different points", seen.len());
    }
}
