//! Draws at the ends of their addresses. What blows up: a 32-bit hash as `bits / 2³²` rounds to 1 in f32; indices near
//! 2³² wrap; coordinates of pixels far from the origin collide. Coordinates keep 24 bits at most, so that 1 is never
//! reached.

use graeco::design::{Design, DesignOptions, Factor, Kind, PixelAddress};

const ENDS: [i32; 7] = [i32::MIN, i32::MIN + 1, -1, 0, 1, i32::MAX - 1, i32::MAX];

fn factors() -> Vec<Factor> {
    let mut factors = vec![Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER, Factor::LENS_U, Factor::LENS_V];
    factors.extend([Factor::light_u(0), Factor::light_v(0), Factor::lobe_u(0), Factor::lobe_v(0)]);
    factors
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
}
