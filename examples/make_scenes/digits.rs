//! Digits as strokes: distance from a point to a figure's skeleton, so that they can be drawn at any size and weight.

use glam::DVec2;
use std::f64::consts::PI;

/// A part of a figure's skeleton, in a box 0.6 wide and 1 high, y up.
enum Stroke {
    /// From point to point.
    Line([f64; 4]),
    /// Centre, radii, start and end angle in half turns, counter-clockwise from +x.
    Arc([f64; 6]),
}
use Stroke::{Arc, Line};

/// Skeleton of a character: a digit or a decimal point.
fn strokes(c: char) -> &'static [Stroke] {
    match c {
        '0' => &[Arc([0.3, 0.5, 0.25, 0.5, 0.0, 2.0])],
        '1' => &[Line([0.36, 0.0, 0.36, 1.0]), Line([0.36, 1.0, 0.14, 0.80])],
        '2' => {
            &[Arc([0.3, 0.72, 0.26, 0.28, -0.15, 0.95]), Line([0.532, 0.593, 0.04, 0.0]), Line([0.04, 0.0, 0.58, 0.0])]
        }
        '3' => &[Arc([0.28, 0.75, 0.25, 0.25, -0.5, 0.85]), Arc([0.28, 0.25, 0.29, 0.25, -0.85, 0.5])],
        '4' => &[Line([0.42, 0.0, 0.42, 1.0]), Line([0.42, 1.0, 0.0, 0.30]), Line([0.0, 0.30, 0.58, 0.30])],
        '5' => {
            &[Line([0.52, 1.0, 0.12, 1.0]), Line([0.12, 1.0, 0.08, 0.56]), Arc([0.28, 0.32, 0.29, 0.32, -0.8, 0.75])]
        }
        '6' => &[Arc([0.3, 0.3, 0.27, 0.3, 0.0, 2.0]), Arc([0.58, 0.3, 0.55, 0.7, 0.5, 1.0])],
        '7' => &[Line([0.02, 1.0, 0.57, 1.0]), Line([0.57, 1.0, 0.22, 0.0])],
        '8' => &[Arc([0.3, 0.755, 0.22, 0.245, 0.0, 2.0]), Arc([0.3, 0.27, 0.27, 0.27, 0.0, 2.0])],
        '9' => &[Arc([0.3, 0.7, 0.27, 0.3, 0.0, 2.0]), Arc([0.02, 0.7, 0.55, 0.7, -0.5, 0.0])],
        '.' => &[Line([0.1, 0.0, 0.1, 0.01])],
        _ => &[],
    }
}

/// Width that a character takes, in heights of a digit.
fn advance(c: char) -> f64 {
    if c == '.' { 0.36 } else { 0.82 }
}

/// Distance from `p` to the text's skeleton, in heights of a digit; the text is centred on the origin, y up.
pub(crate) fn distance(text: &str, p: DVec2) -> f64 {
    let width: f64 = text.chars().map(advance).sum::<f64>() - 0.22;
    let mut left = -0.5 * width;
    let mut nearest = f64::INFINITY;
    for c in text.chars() {
        let local = p - DVec2::new(left, -0.5);
        for stroke in strokes(c) {
            nearest = nearest.min(stroke_distance(stroke, local));
        }
        left += advance(c);
    }
    nearest
}

fn stroke_distance(stroke: &Stroke, p: DVec2) -> f64 {
    match *stroke {
        Line([ax, ay, bx, by]) => segment_distance(p, DVec2::new(ax, ay), DVec2::new(bx, by)),
        Arc([cx, cy, rx, ry, from, to]) => {
            const PIECES: u32 = 24;
            let at = |i: u32| {
                let angle = PI * (from + (to - from) * f64::from(i) / f64::from(PIECES));
                DVec2::new(cx + rx * libm::cos(angle), cy + ry * libm::sin(angle))
            };
            (0..PIECES).map(|i| segment_distance(p, at(i), at(i + 1))).fold(f64::INFINITY, f64::min)
        }
    }
}

fn segment_distance(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a + along * (b - a))
}
