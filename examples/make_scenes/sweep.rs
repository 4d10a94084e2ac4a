//! Meshes swept from curves: turned on a lathe, drawn along a path.

use super::shape::{Shape, index};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Directions that differ by more than this are an edge, not a curve: 40 degrees.
const CREASE_COSINE: f64 = 0.766;

impl Shape {
    /// Turns a profile of points (radius, height) about y. The profile runs downwards with the outside on its right
    /// hand: for a vase, from the inner bottom over the lip to the foot. Corners sharper than 40 degrees stay sharp.
    pub(crate) fn lathe(profile: &[[f64; 2]], around: u32) -> Self {
        let points: Vec<DVec2> = profile.iter().map(|p| DVec2::from_array(*p)).collect();
        let slopes: Vec<DVec2> = points.windows(2).map(|w| (w[1] - w[0]).normalize()).collect();
        // Rings: (point, direction of the profile there, distance along it); a corner has two.
        let mut rings: Vec<(DVec2, DVec2, f64)> = Vec::new();
        let mut along = 0.0;
        for (i, &p) in points.iter().enumerate() {
            if i > 0 {
                along += p.distance(points[i - 1]);
            }
            match (i.checked_sub(1).map(|j| slopes[j]), slopes.get(i).copied()) {
                (Some(a), Some(b)) if a.dot(b) > CREASE_COSINE => rings.push((p, (a + b).normalize(), along)),
                (a, b) => rings.extend(a.into_iter().chain(b).map(|slope| (p, slope, along))),
            }
        }
        let mut shape = Self::default();
        for &(p, slope, distance) in &rings {
            for column in 0..=around {
                let u = f64::from(column) / f64::from(around);
                let out = DVec3::new(libm::sin(TAU * u), 0.0, libm::cos(TAU * u));
                shape.positions.push(out * p.x + DVec3::Y * p.y);
                shape.normals.push((out * -slope.y + DVec3::Y * slope.x).normalize());
                shape.uvs.push(DVec2::new(u, distance / along));
            }
        }
        shape.stitch(index(rings.len()), around);
        shape
    }

    /// A round wire along a path of at least two different points; its ends are open unless `ends` closes them with
    /// half balls.
    pub(crate) fn wire(path: &[DVec3], radius: f64, across: u32, ends: Ends) -> Self {
        let mut stations: Vec<(DVec3, DVec3, f64, f64)> = Vec::new();
        let last = path.len() - 1;
        let tangent = |i: usize| (path[(i + 1).min(last)] - path[i.saturating_sub(1)]).normalize();
        for (i, &p) in path.iter().enumerate() {
            stations.push((p, tangent(i), radius, 0.0));
        }
        if ends == Ends::Round {
            let cap = |centre: DVec3, t: DVec3, sign: f64, i: u32| {
                let angle = std::f64::consts::FRAC_PI_2 * f64::from(i) / 6.0;
                let (s, c) = (libm::sin(angle), libm::cos(angle));
                (centre + sign * radius * s * t, t, radius * c, sign * s)
            };
            let (start, end) = (tangent(0), tangent(last));
            let mut all: Vec<_> = (1..=6).rev().map(|i| cap(path[0], start, -1.0, i)).collect();
            all.append(&mut stations);
            all.extend((1..=6).map(|i| cap(path[last], end, 1.0, i)));
            stations = all;
        }
        let mut side = stations[0].1.any_orthonormal_vector();
        let mut shape = Self::default();
        let rows = stations.len();
        for (row, &(centre, t, r, lean)) in stations.iter().enumerate() {
            side = (side - t * side.dot(t)).normalize();
            let other = t.cross(side);
            for column in 0..=across {
                let u = f64::from(column) / f64::from(across);
                // Clockwise about the path, so that u runs to the right where the path runs down.
                let out = side * libm::cos(TAU * u) - other * libm::sin(TAU * u);
                let flat = libm::sqrt(1.0 - lean * lean);
                shape.positions.push(centre + r * out);
                shape.normals.push((out * flat + t * lean).normalize());
                shape.uvs.push(DVec2::new(u, row as f64 / (rows - 1) as f64));
            }
        }
        shape.stitch(index(rows), across);
        shape
    }

    /// Joins rings of `around + 1` vertices into bands.
    fn stitch(&mut self, rings: u32, around: u32) {
        let stride = around + 1;
        for row in 0..rings - 1 {
            for column in 0..around {
                let a = row * stride + column;
                for triangle in [[a, a + stride, a + stride + 1], [a, a + stride + 1, a + 1]] {
                    let [p, q, r] = triangle.map(|i| self.positions[i as usize]);
                    if (q - p).cross(r - p).length() > 1e-12 {
                        self.triangles.push(triangle);
                    }
                }
            }
        }
    }
}

/// How a wire ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ends {
    /// Open: hidden in something else.
    Open,
    /// Closed with half balls.
    Round,
}

/// Points of a smooth curve (Catmull and Rom 1974, uniform) through `knots`, `pieces` to a span.
pub(crate) fn smooth(knots: &[[f64; 2]], pieces: u32) -> Vec<[f64; 2]> {
    let k: Vec<DVec2> = knots.iter().map(|p| DVec2::from_array(*p)).collect();
    let last = k.len() - 1;
    let mut curve = Vec::new();
    for i in 0..last {
        let (a, b, c, d) = (k[i.saturating_sub(1)], k[i], k[i + 1], k[(i + 2).min(last)]);
        for step in 0..pieces {
            let s = f64::from(step) / f64::from(pieces);
            let point = 0.5
                * (2.0 * b
                    + (c - a) * s
                    + (2.0 * a - 5.0 * b + 4.0 * c - d) * (s * s)
                    + (3.0 * b - a - 3.0 * c + d) * (s * s * s));
            curve.push([point.x.max(0.0), point.y]);
        }
    }
    curve.push(knots[last]);
    curve
}
