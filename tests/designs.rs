//! What every design promises: exact strata, orthogonality, coordinates in range, addresses that mean one thing.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::unwrap_used,
    reason = "tests count small things, and fail by panicking"
)]

use graeco::design::array::OrthogonalArray;
use graeco::design::export::first_factors;
use graeco::design::{Design, DesignOptions, Dither, Factor, Kind, Mask, Over, PixelAddress, PixelDesign};
use proptest::prelude::*;

fn design(kind: Kind, runs: u32, factors: u16, seed: u64) -> Design {
    let options = DesignOptions { kind, dither: Dither::NONE, runs, seed, ..Default::default() };
    Design::new(&options, &first_factors(factors))
}

fn at(x: i32, y: i32, frame: i64) -> PixelAddress {
    PixelAddress { x, y, frame, field: 0 }
}

/// The stratum of `n` in which each run's coordinate lies.
fn strata(pixel: &PixelDesign<'_>, factor: Factor, runs: u32, n: u32) -> Vec<u32> {
    (0..runs).map(|run| (f64::from(pixel.point(run).get(factor)) * f64::from(n)) as u32).collect()
}

fn once_each(mut strata: Vec<u32>) -> bool {
    strata.sort_unstable();
    strata.iter().zip(0..).all(|(&s, i)| s == i)
}

/// Addresses near the ends of their ranges, and ordinary ones.
fn addresses() -> Vec<PixelAddress> {
    let mut all = Vec::new();
    for x in [i32::MIN, -1, 0, 7, i32::MAX] {
        for y in [i32::MIN, 3, i32::MAX] {
            all.push(PixelAddress { x, y, frame: i64::from(x) * 3, field: 1 });
        }
    }
    all.extend([at(0, 0, i64::MIN), at(0, 0, i64::MAX), at(1, 2, 1 << 32)]);
    all
}

const PRIME_POWERS: [u32; 18] = [2, 3, 4, 5, 7, 8, 9, 11, 13, 16, 17, 19, 23, 25, 27, 29, 31, 32];

#[test]
fn each_factor_alone_falls_in_every_stratum_once() {
    let mut cases = Vec::new();
    for runs in [1, 2, 3, 5, 12, 16, 48, 100, 200] {
        cases.push((Kind::LatinHypercube, runs, 13));
    }
    for bits in 0..=12 {
        cases.extend([Kind::Strong, Kind::Nested, Kind::Growing, Kind::Sobol].map(|kind| (kind, 1 << bits, 13)));
    }
    // Beyond what its beginning was tuned for.
    cases.push((Kind::Growing, 1 << 15, 13));
    for q in PRIME_POWERS {
        let factors = u16::try_from(q + 1).unwrap();
        cases.push((Kind::Orthogonal, q * q, factors));
        cases.push((Kind::OrthogonalCorrelated, q * q, factors));
    }
    for q in [3, 4, 5, 7, 9] {
        cases.push((Kind::Orthogonal, q * q, 13));
    }
    for q in [2, 3, 4, 5, 7, 8, 9] {
        cases.push((Kind::OrthogonalStrength3, q * q * q, u16::try_from(q + 1).unwrap()));
    }
    for n in [1, 2, 3, 6, 10, 33, 64] {
        cases.push((Kind::LatinSquare, n * n, 3));
        // Padded factors too.
        cases.push((Kind::LatinSquare, n * n, 13));
    }
    for (kind, runs, factors) in cases {
        let design = design(kind, runs, factors, 11);
        for address in [at(3, -4, 9), at(i32::MAX, i32::MIN, i64::MAX)] {
            let pixel = design.pixel(address);
            for &factor in design.factors() {
                assert!(once_each(strata(&pixel, factor, runs, runs)), "{kind}, {runs} runs, {factor:?}");
            }
        }
    }
}

#[test]
fn each_pair_of_factors_of_drawn_squares_is_orthogonal() {
    for kind in [Kind::Orthogonal, Kind::OrthogonalCorrelated] {
        for q in PRIME_POWERS.into_iter().filter(|&q| q <= 13) {
            let design = design(kind, q * q, u16::try_from(q + 1).unwrap(), 5);
            let pixel = design.pixel(at(1, 2, 3));
            let levels: Vec<Vec<u32>> = design.factors().iter().map(|&f| strata(&pixel, f, q * q, q)).collect();
            for (a, first) in levels.iter().enumerate() {
                for second in &levels[..a] {
                    assert!(once_each(first.iter().zip(second).map(|(a, b)| a * q + b).collect()), "{kind}, GF({q})");
                }
            }
        }
    }
}

#[test]
fn each_triple_of_factors_of_drawn_strength_three_arrays_is_orthogonal() {
    for q in [2, 3, 4, 5] {
        let design = design(Kind::OrthogonalStrength3, q * q * q, u16::try_from(q + 1).unwrap(), 5);
        let pixel = design.pixel(at(1, 2, 3));
        let levels: Vec<Vec<u32>> = design.factors().iter().map(|&f| strata(&pixel, f, q * q * q, q)).collect();
        for a in 0..levels.len() {
            for b in 0..a {
                for c in 0..b {
                    let cells = (0..levels[a].len()).map(|r| (levels[a][r] * q + levels[b][r]) * q + levels[c][r]);
                    assert!(once_each(cells.collect()), "GF({q})");
                }
            }
        }
    }
}

/// The refinement that is correlated also stratifies film x, y as q² × q and q × q² … through the partner's levels.
#[test]
fn correlated_refinement_ties_a_factors_strata_to_its_partners_levels() {
    let (q, runs) = (8, 64);
    let design = design(Kind::OrthogonalCorrelated, runs, 7, 5);
    let pixel = design.pixel(at(0, 0, 0));
    let x = strata(&pixel, Factor::FILM_X, runs, runs);
    let y = strata(&pixel, Factor::FILM_Y, runs, q);
    // Within its level, x's place is a function of y's level alone.
    let mut place = [None; 8];
    for (x, y) in x.iter().zip(y) {
        let known = place[y as usize].get_or_insert(x % q);
        assert_eq!(*known, x % q);
    }
}

#[test]
fn pairs_of_factors_of_a_jittered_design_fill_every_cell() {
    let design = design(Kind::Jittered, 36, 7, 1);
    let pixel = design.pixel(at(5, 5, 0));
    for pair in [[0, 1], [3, 4], [5, 6]] {
        let [a, b] = pair.map(|f| strata(&pixel, design.factors()[f], 36, 6));
        assert!(once_each(a.iter().zip(b).map(|(a, b)| a * 6 + b).collect()), "{pair:?}");
    }
    // Any number of runs: rows of cells as high as they are many.
    let design = self::design(Kind::Jittered, 11, 2, 1);
    let pixel = design.pixel(at(5, 5, 0));
    // Three rows of 4, 4 and 3 cells.
    let rows: Vec<u32> = strata(&pixel, Factor::FILM_Y, 11, 11);
    assert_eq!([0..4, 4..8, 8..11].map(|r| rows.iter().filter(|s| r.contains(*s)).count()), [4, 4, 3]);
}

/// H₀: film x, y, shutter's levels are permuted uniformly and independently from pixel to pixel. For each pair of
/// factors, χ² of the level pair that run 0 takes, q = 4: 16 cells, n = 65 536 pixels, seed 3, α = 0.001 a pair
/// (37.7 at 15 degrees of freedom). Finds a 5 % excess of one cell with power 0.9. Squares without permutation put
/// all in one cell.
#[test]
fn levels_are_permuted_afresh_in_every_pixel() {
    let design = design(Kind::Orthogonal, 16, 5, 3);
    let mut counts = vec![[0_u32; 16]; 10];
    for y in 0..256 {
        for x in 0..256 {
            let pixel = design.pixel(at(x, y, 0));
            let point = pixel.point(0);
            let levels: Vec<usize> = design.factors().iter().map(|&f| (point.get(f) * 4.0) as usize).collect();
            let mut pair = 0;
            for a in 0..5 {
                for b in 0..a {
                    counts[pair][levels[a] * 4 + levels[b]] += 1;
                    pair += 1;
                }
            }
        }
    }
    for count in counts {
        let chi: f64 = count.iter().map(|&c| (f64::from(c) - 4096.0).powi(2) / 4096.0).sum();
        assert!(chi < 37.7, "{chi}: {count:?}");
    }
}

#[test]
fn a_factor_left_out_leaves_its_column_to_the_next() {
    for kind in [Kind::Strong, Kind::Sobol, Kind::OrthogonalCorrelated] {
        let options = DesignOptions { kind, dither: Dither::NONE, runs: 64, ..Default::default() };
        let [light_u, light_v] = [Factor::light_u(0), Factor::light_v(0)];
        let few = Design::new(&options, &[Factor::FILM_X, Factor::FILM_Y, light_u, light_v]);
        let full = Design::new(&options, &first_factors(4));
        let (few, full) = (few.pixel(at(1, 1, 1)), full.pixel(at(1, 1, 1)));
        for run in 0..64 {
            // The stratum is the column's; the place within it the factor's own.
            let stratum = |u: f32| (64.0 * u) as u32;
            let column = stratum(full.point(run).get(Factor::SHUTTER));
            assert_eq!(stratum(few.point(run).get(light_u)), column, "{kind}");
        }
    }
}

#[test]
fn further_vertices_and_extras_are_stratified_too() {
    for (kind, runs) in [(Kind::Strong, 64), (Kind::OrthogonalCorrelated, 49), (Kind::Nested, 16), (Kind::Sobol, 32)] {
        let design = design(kind, runs, 7, 2);
        let pixel = design.pixel(at(4, 4, 4));
        assert!(once_each(strata(&pixel, Factor::extra(3), runs, runs)), "{kind}: extra");
        if runs.is_power_of_two() || kind == Kind::OrthogonalCorrelated {
            for vertex in [4, 900] {
                for factor in [Factor::light_u(vertex), Factor::light_v(vertex), Factor::lobe_u(vertex)] {
                    assert!(once_each(strata(&pixel, factor, runs, runs)), "{kind}: {factor:?}");
                }
            }
        }
    }
}

/// The light's pair and the lobe's of each vertex that an array has no columns for fill √N × √N cells: the pads are columns
/// searched as pairs. (The nets from 256 runs on were searched without.)
#[test]
fn pairs_of_vertices_beyond_an_array_fill_every_cell() {
    for (runs, root) in [(16, 4), (64, 8)] {
        let design = design(Kind::Orthogonal, runs, 5, 8);
        for address in addresses() {
            let pixel = design.pixel(address);
            for vertex in 1..4 {
                let (light, lobe) = (Factor::light_u(vertex), Factor::lobe_u(vertex));
                for (u, v) in [(light, Factor::light_v(vertex)), (lobe, Factor::lobe_v(vertex))] {
                    let rows = strata(&pixel, u, runs, root);
                    let columns = strata(&pixel, v, runs, root);
                    let cells = rows.iter().zip(columns).map(|(row, column)| row * root + column).collect();
                    assert!(once_each(cells), "{runs} runs, {u} and {v}");
                }
            }
        }
    }
}

/// H₀: padded factors are uncorrelated with those of the net and with each other. Correlation of (u − ½)(v − ½) over
/// 4096 pixels × 16 runs, seed 9: its standard deviation is below 1/256; 5 of them is the bound over 28 pairs
/// (α < 10⁻⁴). Two factors that share a column correlate fully.
#[test]
fn pads_are_not_tied_to_each_other() {
    let design = design(Kind::Strong, 16, 7, 9);
    let factors = [
        Factor::FILM_X,
        Factor::light_v(0),
        Factor::light_u(3),
        Factor::lobe_v(3),
        Factor::light_u(4),
        Factor::lobe_v(4),
        Factor::extra(0),
        Factor::extra(1),
    ];
    let mut sums = [[0.0; 8]; 8];
    for i in 0..4096 {
        let pixel = design.pixel(at(i, 77, 0));
        for run in 0..16 {
            let point = pixel.point(run);
            let centred = factors.map(|f| f64::from(point.get(f)) - 0.5);
            for a in 0..8 {
                for b in 0..8 {
                    sums[a][b] += centred[a] * centred[b];
                }
            }
        }
    }
    let share = |a: usize, b: usize| sums[a][b] * 12.0 / 65_536.0;
    for a in 0..8 {
        assert!((share(a, a) - 1.0).abs() < 0.05);
        for b in 0..a {
            assert!(share(a, b).abs() < 5.0 / 256.0, "{a} and {b}: {}", share(a, b));
        }
    }
}

#[test]
fn any_number_of_runs_is_drawn_and_no_array_is_truncated() {
    for runs in [12, 48, 100, 128, 200] {
        for kind in [Kind::Orthogonal, Kind::OrthogonalStrength3, Kind::Strong, Kind::Auto] {
            let design = design(kind, runs, 7, 0);
            assert_eq!(design.runs(), runs);
            assert!(matches!(design.kind(), Kind::Nested | Kind::Strong), "{kind} at {runs}: {}", design.kind());
            assert_eq!(design.kind() == Kind::Strong, runs == 128 && matches!(kind, Kind::Strong | Kind::Auto));
        }
    }
    assert_eq!(design(Kind::Auto, 49, 7, 0).kind(), Kind::OrthogonalCorrelated);
    assert_eq!(design(Kind::Auto, 49, 9, 0).kind(), Kind::Nested, "eight columns are too few for nine factors");
    assert_eq!(design(Kind::Auto, 1 << 15, 7, 0).kind(), Kind::Sobol);
}

/// Distances of positions between neighbours, one run a pixel, matrix (15): in every aligned 4 × 4 block of pixels
/// time falls once in each of 16 strata, in the matrix's order up to a turn.
#[test]
fn ordered_time_follows_the_surveys_matrix() {
    let matrix = [[0, 12, 3, 15], [8, 4, 11, 7], [2, 14, 1, 13], [10, 6, 9, 5]];
    let dither = Dither { mask: Mask::Ordered, over: Over::Time };
    let options = DesignOptions { kind: Kind::Auto, dither, runs: 1, seed: 4, ..Default::default() };
    let design = Design::new(&options, &first_factors(7));
    for frame in 0..4 {
        let level = |x: i32, y: i32| (design.pixel(at(x, y, frame)).point(0).get(Factor::SHUTTER) * 16.0) as i32;
        let turn = level(0, 0);
        for (y, row) in (0..).zip(matrix) {
            for (x, value) in (0..).zip(row) {
                assert_eq!((level(x + 8, y - 4) - turn).rem_euclid(16), value, "frame {frame}, pixel {x}, {y}");
            }
        }
    }
}

#[test]
fn masks_move_a_point_within_its_stratum_only() {
    for mask in [Mask::Ordered, Mask::Ordered8, Mask::BlueNoise, Mask::R2] {
        let plain = design(Kind::Nested, 48, 7, 6);
        let options = DesignOptions {
            kind: Kind::Nested,
            dither: Dither { mask, over: Over::All },
            runs: 48,
            seed: 6,
            ..Default::default()
        };
        let masked = Design::new(&options, &first_factors(7));
        let address = at(-5, 8, 2);
        let (plain, masked) = (plain.pixel(address), masked.pixel(address));
        for factor in first_factors(7) {
            assert_eq!(strata(&plain, factor, 48, 48), strata(&masked, factor, 48, 48), "{mask:?}");
        }
    }
}

/// One run a pixel: every aligned block of 2ᵏ × 2ᵏ pixels is a full stratification of each factor, and so are the
/// frames of one pixel.
#[test]
fn z_order_stratifies_blocks_of_pixels_and_frames() {
    let dither = Dither { mask: Mask::ZOrder, over: Over::All };
    let options = DesignOptions { dither, runs: 1, seed: 4, frames: 16, ..Default::default() };
    let design = Design::new(&options, &first_factors(7));
    for factor in first_factors(7) {
        let frames = (0..16).map(|frame| (design.pixel(at(3, 5, frame)).point(0).get(factor) * 16.0) as u32);
        assert!(once_each(frames.collect()), "frames, {factor:?}");
    }
    let still = Design::new(&DesignOptions { frames: 1, ..options }, &first_factors(7));
    for factor in first_factors(7) {
        let block = (0..64).map(|i| (still.pixel(at(8 + i % 8, 16 + i / 8, 0)).point(0).get(factor) * 64.0) as u32);
        assert!(once_each(block.collect()), "block, {factor:?}");
    }
    // Fields: the lines of one parity are neighbours.
    let fields = Design::new(&DesignOptions { frames: 1, line_step: 2, ..options }, &first_factors(7));
    let lines = (0..16).map(|i| {
        let address = PixelAddress { x: 4 + i % 4, y: 8 + 2 * (i / 4) + 1, frame: 0, field: 1 };
        (fields.pixel(address).point(0).get(Factor::SHUTTER) * 16.0) as u32
    });
    assert!(once_each(lines.collect()));
}

/// Squares of one pixel, as the survey's eq. 13 with letters for time: fresh permutations only rename.
#[test]
fn drawn_latin_squares_are_the_surveys_up_to_names() {
    let design = design(Kind::LatinSquare, 16, 3, 8);
    let pixel = design.pixel(at(0, 0, 0));
    let square = OrthogonalArray::latin_square(4);
    for (column, factor) in first_factors(3).into_iter().enumerate() {
        let mut name = [None; 4];
        for (run, level) in (0..).zip(strata(&pixel, factor, 16, 4)) {
            assert_eq!(*name[usize::from(square.level(run, column))].get_or_insert(level), level);
        }
    }
}

fn any_dither() -> impl Strategy<Value = Dither> {
    (0..Mask::ALL.len(), any::<bool>())
        .prop_map(|(m, time)| Dither { mask: Mask::ALL[m], over: if time { Over::Time } else { Over::All } })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn coordinates_lie_in_the_unit_interval_and_depend_on_the_address_alone(
        kind in (0..Kind::ALL.len()).prop_map(|k| Kind::ALL[k]),
        dither in any_dither(),
        runs in prop_oneof![1_u32..70, Just(81), Just(256), Just(343), Just(1000), Just(5000)],
        factors in 0_u16..24,
        seed: u64,
        frames in 0_u32..40,
    ) {
        // Dart throwing is quadratic in its runs, and diffusion draws many patterns.
        prop_assume!(!matches!(kind, Kind::PoissonDisk | Kind::PointDiffusion) || runs < 100);
        let options = DesignOptions { kind, dither, runs, seed, frames, line_step: 1 };
        let design = Design::new(&options, &first_factors(factors));
        let again = Design::new(&options, &first_factors(factors));
        let mut asked = first_factors(31);
        asked.extend([Factor::extra(0), Factor::extra(0x7ffe), Factor::light_u(5000)]);
        for address in addresses() {
            let (pixel, other) = (design.pixel(address), again.pixel(address));
            for run in [0, runs / 2, runs - 1, u32::MAX] {
                let (forward, backward) = (pixel.point(run), other.point(run));
                let later: Vec<u32> = asked.iter().rev().map(|f| backward.get(*f).to_bits()).collect();
                for (factor, bits) in asked.iter().zip(later.into_iter().rev()) {
                    let coordinate = forward.get(*factor);
                    prop_assert!((0.0..1.0).contains(&coordinate), "{} {}", kind, coordinate);
                    prop_assert_eq!(coordinate.to_bits(), bits);
                }
            }
        }
    }
}
