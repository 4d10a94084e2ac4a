//! Analytic image functions with exact integrals: what proves designs, filters and estimators right.
//!
//! Seven kinds, each in up to seven dimensions (film x y, shutter, lens u v, light u v). A *placement* is one of a kind
//! with parameters drawn from a seed, such that its edges cross the pixel at the origin. Edges, soft shadows, products
//! and zone plates have closed forms; the disk and the wheel are closed in all but two or three dimensions, over which
//! Gauss panels integrate to about 10⁻⁵.

mod disk;
mod placement;

use super::quadrature::{half_space_volume, integrate, integrate_pieces, two_uniforms_between};
use super::{FilmPoint, ImageFunction};
use crate::design::{Factor, Point};
use disk::{MovingDisk, Plane};
use glam::Vec3;
pub use placement::{Lighting, Ranges};
use std::f64::consts::PI;

/// The factors in the order of a function's coordinates.
pub const FACTORS: [Factor; 7] = [
    Factor::FILM_X,
    Factor::FILM_Y,
    Factor::SHUTTER,
    Factor::LENS_U,
    Factor::LENS_V,
    Factor::light_u(0),
    Factor::light_v(0),
];

/// Which of the seven functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AnalyticKind {
    /// A straight edge that moves: x, y, t.
    Edge,
    /// The same out of focus, the lens a square: x, y, t, lens.
    LensEdge,
    /// The soft shadow of a moving square under a square light: x, y, t, light.
    SoftShadow,
    /// A moving disk between a thin round lens and a plane that a near square light lights: all seven.
    Disk,
    /// A product of Gaussians in all seven.
    SmoothProduct,
    /// A moving zone plate: x, y, t.
    ZonePlate,
    /// A spinning wheel of spokes and rings: x, y, t.
    Wheel,
}

impl AnalyticKind {
    /// All seven, in the order of the tables.
    pub const ALL: [Self; 7] =
        [Self::Edge, Self::LensEdge, Self::SoftShadow, Self::Disk, Self::SmoothProduct, Self::ZonePlate, Self::Wheel];

    /// A short name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Edge => "edge",
            Self::LensEdge => "lens-edge",
            Self::SoftShadow => "soft-shadow",
            Self::Disk => "disk",
            Self::SmoothProduct => "smooth",
            Self::ZonePlate => "zone-plate",
            Self::Wheel => "wheel",
        }
    }

    /// The factors that the function varies with.
    #[must_use]
    pub fn factors(self) -> Vec<Factor> {
        match self {
            Self::Edge | Self::ZonePlate | Self::Wheel => FACTORS[..3].to_vec(),
            Self::LensEdge => FACTORS[..5].to_vec(),
            Self::SoftShadow => [&FACTORS[..3], &FACTORS[5..]].concat(),
            Self::Disk | Self::SmoothProduct => FACTORS.to_vec(),
        }
    }
}

/// One function with its parameters: pixels and exposures are the units.
#[derive(Debug, Clone)]
pub struct Analytic {
    kind: AnalyticKind,
    shape: Shape,
}

#[derive(Debug, Clone)]
enum Shape {
    /// One where weights · (x, y, t, lens) < c.
    HalfSpace {
        weights: Vec<f64>,
        c: f64,
    },
    /// Zero where (x, y) + v t + b (light − ½) is within `half` of `centre` in both axes.
    Shadow {
        centre: [f64; 2],
        velocity: [f64; 2],
        penumbra: f64,
        half: f64,
    },
    Disk(MovingDisk),
    /// Π exp(−(aⱼ (pⱼ − bⱼ))²); film coordinates relative to the pixel at the origin.
    Gaussians {
        a: [f64; 7],
        b: [f64; 7],
    },
    /// ½ + ½ cos(k ((x − v t − cx)² + (y − cy)²)).
    Zone {
        k: f64,
        speed: f64,
        centre: [f64; 2],
    },
    /// Spokes: the sign of a square wave of `spokes` periods a turn, turning by `turn` periods in the exposure, times
    /// the sign of the ring.
    Wheel {
        centre: [f64; 2],
        spokes: f64,
        turn: f64,
        ring: f64,
    },
}

impl Analytic {
    /// One disk as large as a picture of `side`² pixels wants it, for studies of structure between pixels; `heading`
    /// (0 to 3) chooses among four motions. With `sharp` there is neither lens nor penumbra, and it moves further.
    #[must_use]
    pub fn picture_disk(side: f64, heading: usize, sharp: bool) -> Self {
        let [vx, vy] = [[0.4, 0.15], [-0.17, 0.41], [0.28, -0.3], [-0.45, -0.02]][heading % 4];
        let speed = if sharp { side } else { 0.5 * side };
        let velocity = [vx * speed, vy * speed];
        let centre = velocity.map(|v| 0.5 * (side - v));
        let (lens, plane) = if sharp {
            (1e-3, Plane::Lit { light: 1e-3, height: 1e6, offset: [0.0; 2] })
        } else {
            (0.06 * side, Plane::Shadowed { light: 0.1 * side, offset: [0.12 * side, 0.08 * side] })
        };
        let emitted = if sharp { 0.0 } else { 0.3 };
        let disk = MovingDisk { centre, velocity, radius: 0.22 * side, lens, emitted, plane };
        Self { kind: AnalyticKind::Disk, shape: Shape::Disk(disk) }
    }

    /// The point at a film position and a time, lens and light at their centres.
    #[must_use]
    pub fn at_centre(position: [f64; 2], u_time: f64) -> [f64; 7] {
        [position[0], position[1], u_time, 0.5, 0.5, 0.5, 0.5]
    }

    /// Mean over time alone at a film position, by `steps` midpoints.
    #[must_use]
    pub fn time_mean(&self, position: [f64; 2], steps: u32) -> f64 {
        let at = |step: u32| (f64::from(step) + 0.5) / f64::from(steps);
        (0..steps).map(|step| self.value(&Self::at_centre(position, at(step)))).sum::<f64>() / f64::from(steps)
    }

    /// Which of the seven.
    #[must_use]
    pub fn kind(&self) -> AnalyticKind {
        self.kind
    }

    /// Its value at film position (x, y) in pixels, then time, lens u v, light u v in [0, 1).
    #[must_use]
    pub fn value(&self, p: &[f64; 7]) -> f64 {
        match &self.shape {
            Shape::HalfSpace { weights, c } => {
                f64::from(u8::from(weights.iter().zip(p).map(|(w, x)| w * x).sum::<f64>() < *c))
            }
            Shape::Shadow { centre, velocity, penumbra, half } => {
                let inside =
                    (0..2).all(|k| (p[k] + velocity[k] * p[2] + penumbra * (p[5 + k] - 0.5) - centre[k]).abs() < *half);
                if inside { 0.0 } else { 1.0 }
            }
            Shape::Disk(disk) => disk.value(p),
            Shape::Gaussians { a, b } => {
                let sum: f64 = (0..7).map(|k| (a[k] * (p[k] - b[k])).powi(2)).sum();
                libm::exp(-sum)
            }
            Shape::Zone { k, speed, centre } => {
                let (x, y) = (p[0] - speed * p[2] - centre[0], p[1] - centre[1]);
                0.5 + 0.5 * libm::cos(k * (x * x + y * y))
            }
            Shape::Wheel { centre, spokes, turn, ring } => {
                let (x, y) = (p[0] - centre[0], p[1] - centre[1]);
                let phase = libm::atan2(y, x) * spokes / (2.0 * PI) + turn * p[2];
                let spoke = if phase - libm::floor(phase) < 0.5 { 1.0 } else { -1.0 };
                0.5 + 0.5 * spoke * ring_sign(x.hypot(y), *ring)
            }
        }
    }

    /// The integral over the pixel whose corner is (x, y), the whole exposure, lens and light: `value`'s mean there.
    /// `fine` Gauss panels (of eight nodes) a dimension where there is no closed form; 4 give about 10⁻⁵.
    #[must_use]
    pub fn mean(&self, x: f64, y: f64, fine: usize) -> f64 {
        match &self.shape {
            Shape::HalfSpace { weights, c } => half_space_volume(weights, c - weights[0] * x - weights[1] * y),
            Shape::Shadow { centre, velocity, penumbra, half } => {
                let corner = [x, y];
                let at = |k: usize, t: f64| corner[k] + 0.5 + velocity[k] * t - centre[k];
                // Both axes' shares are polynomials in t between these times.
                let mut breaks = Vec::new();
                for (k, speed) in velocity.iter().enumerate() {
                    for edge in [-half, *half] {
                        for bend in [-1.0 - penumbra, -1.0 + penumbra, 1.0 - penumbra, 1.0 + penumbra] {
                            breaks.push((edge + 0.5 * bend - at(k, 0.0)) / speed);
                        }
                    }
                }
                let share = |k: usize, t: f64| two_uniforms_between(1.0, *penumbra, -half - at(k, t), half - at(k, t));
                1.0 - integrate_pieces(0.0, 1.0, &mut breaks, 1, |t| share(0, t) * share(1, t))
            }
            Shape::Disk(disk) => disk.mean(x, y, fine),
            Shape::Gaussians { a, b } => (0..7)
                .map(|k| {
                    let low = [x, y, 0.0, 0.0, 0.0, 0.0, 0.0][k];
                    let erf = |p: f64| libm::erf(a[k] * (p - b[k]));
                    (erf(low + 1.0) - erf(low)) * PI.sqrt() / (2.0 * a[k])
                })
                .product(),
            Shape::Zone { k, speed, centre } => zone_mean(*k, *speed, [x - centre[0], y - centre[1]]),
            Shape::Wheel { centre, spokes, turn, ring } => {
                wheel_mean([x - centre[0], y - centre[1]], *spokes, *turn, *ring, fine)
            }
        }
    }
}

impl ImageFunction for Analytic {
    fn radiance(&self, film: FilmPoint, point: &Point<'_>) -> Vec3 {
        let mut p = [film.position.x, film.position.y, f64::from(film.u_time), 0.0, 0.0, 0.0, 0.0];
        for factor in self.kind.factors() {
            if let Some(at) = FACTORS.iter().position(|f| *f == factor).filter(|&at| at > 2) {
                p[at] = f64::from(point.get(factor));
            }
        }
        #[allow(clippy::cast_possible_truncation, reason = "radiance is f32")]
        let value = self.value(&p) as f32;
        Vec3::splat(value)
    }
}

/// Mean of the zone plate over a pixel whose corner is `low` from the centre: Fresnel's integrals of first and second
/// order, E₁(z) = ∫₀ᶻ exp(i k s²) ds and E₂ = ∫ E₁ = z E₁(z) − (exp(i k z²) − 1) / (2 i k).
fn zone_mean(k: f64, speed: f64, low: [f64; 2]) -> f64 {
    let first = |z: f64| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few turns of phase")]
        let count = 2 + (k * z * z / 4.0) as usize;
        [integrate(0.0, z, count, |s| libm::cos(k * s * s)), integrate(0.0, z, count, |s| libm::sin(k * s * s))]
    };
    let second = |z: f64| {
        let [c, s] = first(z);
        let (sin, cos) = libm::sincos(k * z * z);
        [z * c - sin / (2.0 * k), z * s - (1.0 - cos) / (2.0 * k)]
    };
    let along = |part: usize| {
        let e = |z: f64| second(z)[part];
        (e(low[0] + 1.0) - e(low[0] + 1.0 - speed) - e(low[0]) + e(low[0] - speed)) / speed
    };
    let across = |part: usize| first(low[1] + 1.0)[part] - first(low[1])[part];
    0.5 + 0.5 * (along(0) * across(0) - along(1) * across(1))
}

/// The sign of the ring of width `ring` at distance `r` from the wheel's centre.
fn ring_sign(r: f64, ring: f64) -> f64 {
    let place = r / ring * 0.5;
    if place - libm::floor(place) < 0.5 { 1.0 } else { -1.0 }
}

/// Mean of the wheel over a pixel whose corner is `low` from the centre: time in closed form, rows cut at the rings.
fn wheel_mean(low: [f64; 2], spokes: f64, turn: f64, ring: f64, fine: usize) -> f64 {
    // Antiderivative of the square wave: a triangle.
    let triangle = |phase: f64| {
        let f = phase - libm::floor(phase);
        if f < 0.5 { f } else { 1.0 - f }
    };
    let over_time = |phase: f64| (triangle(phase + turn) - triangle(phase)) / turn;
    let signed = integrate(low[0], low[0] + 1.0, 8 * fine, |x| {
        let mut cuts = Vec::new();
        let furthest = x.abs().hypot(low[1].abs() + 1.0);
        let mut edge = ring;
        while edge < furthest {
            let square = edge * edge - x * x;
            if square > 0.0 {
                cuts.extend([square.sqrt(), -square.sqrt()]);
            }
            edge += ring;
        }
        integrate_pieces(low[1], low[1] + 1.0, &mut cuts, fine, |y| {
            over_time(libm::atan2(y, x) * spokes / (2.0 * PI)) * ring_sign(x.hypot(y), ring)
        })
    });
    0.5 + 0.5 * signed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::nets;

    /// Exact means against 2¹⁶ points of Sobol's sequence, 6 placements a kind, also in a pixel away from the origin.
    /// A sequence of that length errs by less than 2·10⁻³ on functions of bounded extent in seven dimensions; leaving
    /// any one factor out of an integral changes some placement by more than 0.02.
    #[test]
    fn means_agree_with_long_sequences() {
        let net = nets::sobol(7, 16);
        let mut points = vec![[0.0; 7]; 1 << 16];
        for (n, p) in points.iter_mut().enumerate() {
            for (k, c) in p.iter_mut().enumerate() {
                let bits = (0..16).filter(|b| n >> b & 1 == 1).fold(0, |x, b| x ^ net[k][b]);
                *c = (f64::from(bits) + 0.5 * 65_536.0) / 4_294_967_296.0;
            }
        }
        for kind in AnalyticKind::ALL {
            for placement in 0..6 {
                let f = Analytic::placement(kind, placement, 1);
                for [x, y] in [[0.0, 0.0], [2.0, -1.0]] {
                    let sum: f64 =
                        points.iter().map(|p| f.value(&[p[0] + x, p[1] + y, p[2], p[3], p[4], p[5], p[6]])).sum();
                    let (counted, exact) = (sum / points.len() as f64, f.mean(x, y, 3));
                    assert!((counted - exact).abs() < 2e-3, "{} {placement}: {counted} is not {exact}", kind.name());
                }
            }
        }
    }

    #[test]
    fn quadrature_has_converged() {
        for kind in [AnalyticKind::Disk, AnalyticKind::Wheel] {
            for placement in 0..4 {
                let f = Analytic::placement(kind, placement, 2);
                let (coarse, fine) = (f.mean(0.0, 0.0, 4), f.mean(0.0, 0.0, 7));
                assert!((coarse - fine).abs() < 2e-4, "{} {placement}: {coarse} {fine}", kind.name());
            }
        }
    }

    #[test]
    fn every_placement_crosses_its_pixel() {
        for kind in [AnalyticKind::Edge, AnalyticKind::SoftShadow, AnalyticKind::Disk] {
            for placement in 0..16 {
                let mean = Analytic::placement(kind, placement, 3).mean(0.0, 0.0, 2);
                assert!(mean > 0.0 && mean < 1.0, "{} {placement}: {mean}", kind.name());
            }
        }
    }
}
