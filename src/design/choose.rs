//! Which design is really drawn: what was asked for, or the best for the number of runs and factors, with the reason.

use super::galois::prime_power;
use super::kind::{Dither, Kind, Mask, Over};
use super::nets;

/// A design that can be drawn at the runs asked for, and why it is this one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// Never [`Kind::Auto`].
    pub kind: Kind,
    /// Never [`Mask::Auto`].
    pub dither: Dither,
    /// One sentence for the design, one for the dither.
    pub reason: String,
}

/// √`runs` where that is a whole number.
#[must_use]
pub(crate) fn square_root(runs: u32) -> Option<u32> {
    let root = runs.isqrt();
    (root * root == runs).then_some(root)
}

/// ∛`runs` where that is a prime power that Bush's array takes.
#[must_use]
pub(crate) fn cube_root(runs: u32) -> Option<u32> {
    (2..=super::galois::MAX_ORDER).find(|q| q.pow(3) == runs && prime_power(*q).is_some())
}

/// Decides for `runs` runs over `factors` factors (those of the design, extras not counted).
#[must_use]
pub fn choose(kind: Kind, dither: Dither, runs: u32, factors: usize) -> Choice {
    let (kind, why) = choose_kind(kind, runs, factors);
    let (dither, why_dither) = choose_dither(dither, runs);
    Choice { kind, dither, reason: format!("{kind}: {why}; dither {dither}: {why_dither}") }
}

/// Factors over which the squares have been measured to win although some of them find no column.
const MEASURED_FACTORS: usize = 7;

/// Whether the squares over GF(√runs) are the best known for these runs (`graeco study designs`: q odd, from 3 to 7).
///
/// Up to seven factors they win with the last ones padded too: of all functions, at 9 runs .429 against .497 of the
/// tuned sequence, at 25 runs .298 against .320.
fn squares_win(runs: u32, factors: usize) -> Option<u32> {
    square_root(runs).filter(|&q| matches!(q, 3 | 5 | 7) && factors <= MEASURED_FACTORS.max(q as usize + 1))
}

fn choose_kind(kind: Kind, runs: u32, factors: usize) -> (Kind, String) {
    let bits = runs.next_power_of_two().trailing_zeros();
    match kind {
        Kind::Auto => {
            if let Some(q) = squares_win(runs, factors) {
                return (
                    Kind::OrthogonalCorrelated,
                    format!(
                        "{runs} runs are {q} squared; {} of {factors} factors have a column",
                        factors.min(q as usize + 1)
                    ),
                );
            }
            if runs.is_power_of_two() && nets::strong(bits).is_some() {
                return (Kind::Strong, format!("a net is tuned for exactly {runs} runs"));
            }
            if nets::nested(bits).is_some() {
                return (Kind::Nested, format!("{runs} runs are a prefix of a tuned sequence"));
            }
            (Kind::Sobol, format!("no net is tuned for {runs} runs"))
        }
        Kind::Orthogonal | Kind::OrthogonalCorrelated => {
            match square_root(runs).filter(|&q| prime_power(q).is_some()) {
                Some(q) => (kind, format!("squares over GF({q}) as asked for")),
                None => fallback(runs, &format!("{runs} runs are no square of a prime power up to 32")),
            }
        }
        Kind::OrthogonalStrength3 => match cube_root(runs) {
            Some(q) => (kind, format!("Bush's array over GF({q}) as asked for")),
            None => fallback(runs, &format!("{runs} runs are no cube of a prime power up to 32")),
        },
        Kind::LatinSquare => match square_root(runs).filter(|&n| n <= 256) {
            Some(n) => (kind, format!("{n} x {n} cells as asked for")),
            None => fallback(runs, &format!("{runs} runs are no square up to 256 x 256")),
        },
        Kind::Strong if !(runs.is_power_of_two() && nets::strong(bits).is_some()) => {
            fallback(runs, &format!("no net is tuned for exactly {runs} runs"))
        }
        Kind::Nested if nets::nested(bits).is_none() => {
            (Kind::Sobol, format!("no sequence is tuned for as many as {runs} runs"))
        }
        asked => (asked, "as asked for".to_owned()),
    }
}

/// The tuned sequence, or Sobol's where none is tuned.
fn fallback(runs: u32, because: &str) -> (Kind, String) {
    let bits = runs.next_power_of_two().trailing_zeros();
    if nets::nested(bits).is_some() {
        (Kind::Nested, format!("{because}, and no array is truncated"))
    } else {
        (Kind::Sobol, format!("{because}, and no sequence is tuned for as many"))
    }
}

fn choose_dither(dither: Dither, runs: u32) -> (Dither, String) {
    match dither.mask {
        Mask::Auto if runs <= 4 => (
            Dither { mask: Mask::ZOrder, over: Over::All },
            "up to 4 runs a pixel, one net over picture and frames leaves the least visible error".to_owned(),
        ),
        Mask::Auto => (
            Dither::NONE,
            "from 5 runs a pixel on, a net tuned for one pixel leaves less error in it than one shared by the picture"
                .to_owned(),
        ),
        _ => (dither, "as asked for".to_owned()),
    }
}
