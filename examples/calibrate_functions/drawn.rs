//! Points of the designs that the published table compares, drawn once for all functions.

use graeco::design::{Design as Source, DesignOptions, Dither, Factor, Kind, PixelAddress};
use graeco::trace::analytic::FACTORS;

/// A row of the published table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Design {
    /// Film positions in jittered cells, all else independent.
    JitteredFilm,
    Jittered,
    LatinHypercube,
    LatinSquare,
    Orthogonal,
    OrthogonalCorrelated,
    Sobol,
}

/// Independent draws that are kept of each design; a placement takes some of them.
pub const KEPT: u32 = 64;

/// `[draw][run]`
pub type Points = Vec<Vec<[f64; 7]>>;

/// Draws of `design` with `runs` runs over `factors`, those that a function varies with.
pub fn points(design: Design, runs: u32, factors: &[Factor], seed: u64) -> Points {
    let source = |kind| {
        let options = DesignOptions { kind, dither: Dither::NONE, runs, seed, ..Default::default() };
        Source::new(&options, factors)
    };
    let kind = match design {
        Design::JitteredFilm | Design::Jittered => Kind::Jittered,
        Design::LatinHypercube => Kind::LatinHypercube,
        Design::LatinSquare => Kind::LatinSquare,
        Design::Orthogonal => Kind::Orthogonal,
        Design::OrthogonalCorrelated => Kind::OrthogonalCorrelated,
        Design::Sobol => Kind::Sobol,
    };
    let (first, rest) = (source(kind), source(Kind::Random));
    (0..KEPT)
        .map(|draw| {
            let [first, rest] =
                [&first, &rest].map(|d| d.pixel(PixelAddress { x: draw as i32, y: 0, frame: 0, field: 0 }));
            let of = |factor: Factor, run| {
                let film = factor == Factor::FILM_X || factor == Factor::FILM_Y;
                let pixel = if design == Design::JitteredFilm && !film { &rest } else { &first };
                f64::from(pixel.point(run).get(factor))
            };
            (0..runs).map(|run| FACTORS.map(|factor| of(factor, run))).collect()
        })
        .collect()
}
