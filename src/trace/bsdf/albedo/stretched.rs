//! Albedos of facets that are wider one way than the other.

use super::super::ALPHA_SPECULAR;
use super::super::ggx::Ggx;
use super::{Axis, LEAST_COSINE, cell};
use glam::{Vec2, Vec3A};
use std::f32::consts::FRAC_PI_2;
use std::sync::OnceLock;

/// An albedo and a part's share of it by the view, on stretched facets of widths α + (1 − α) s² and α, tabulated by cosine,
/// azimuth, roughness and strength s of anisotropy.
///
/// Each pair of roughness and strength is a slice of its own, made when a path first needs it: a material without textures
/// asks for four.
#[derive(Debug)]
pub(super) struct Stretched {
    /// Both, for facets and the view in their own basis.
    means: Means,
    /// What [`Means`] takes beside them.
    eta: f32,
    azimuths: usize,
    slices: Box<[OnceLock<Slice>]>,
}

/// Albedo and share, by facets, view and the far side's index over that of the near side.
type Means = fn(Ggx, Vec3A, f32) -> [f32; 2];

/// Both means by azimuth and cosine.
type Slice = Box<[[f32; 2]]>;

const COSINES: usize = 32;
const ROUGHNESSES: usize = 40;
const STRENGTHS: usize = 24;

/// What lies around a view: the cell of each slice, and the slices' own.
struct Place {
    cosine: (usize, f32),
    azimuth: (usize, f32),
    roughness: (usize, f32),
    strength: (usize, f32),
}

impl Stretched {
    pub(super) fn new(azimuths: usize, eta: f32, means: Means) -> Self {
        Self { means, eta, azimuths, slices: (0..ROUGHNESSES * STRENGTHS).map(|_| OnceLock::new()).collect() }
    }

    fn slice(&self, roughness: usize, strength: usize) -> &[[f32; 2]] {
        self.slices[strength * ROUGHNESSES + roughness].get_or_init(|| {
            let along = |i: usize, count: usize| i as f32 / (count - 1) as f32;
            let (r, s) = (along(roughness, ROUGHNESSES).max(ALPHA_SPECULAR.sqrt()), along(strength, STRENGTHS));
            let narrow = r * r;
            let ggx = Ggx { alpha: Vec2::new(narrow + (1.0 - narrow) * s * s, narrow) };
            let mut values = Vec::with_capacity(COSINES * self.azimuths);
            for azimuth in 0..self.azimuths {
                let direction = direction(along(azimuth, self.azimuths), ggx.alpha);
                let met = (direction * ggx.alpha).length();
                values.extend((0..COSINES).map(|i| {
                    let cos = cosine(along(i, COSINES), met).clamp(LEAST_COSINE, 1.0);
                    let side = (1.0 - cos * cos).max(0.0).sqrt();
                    (self.means)(ggx, Vec3A::new(direction.x * side, direction.y * side, cos), self.eta)
                }));
            }
            values.into()
        })
    }

    fn place(&self, alpha: Vec2, o: Vec3A) -> Place {
        let (alpha, side) = if alpha.x >= alpha.y {
            (alpha, Vec2::new(o.x, o.y))
        } else {
            (Vec2::new(alpha.y, alpha.x), Vec2::new(o.y, o.x))
        };
        let direction = side.abs().try_normalize().unwrap_or(Vec2::X);
        let met = (direction * alpha).length();
        let strength = if alpha.y < 1.0 { ((alpha.x - alpha.y) / (1.0 - alpha.y)).sqrt() } else { 0.0 };
        let within = |x: f32, count: usize| cell(x.clamp(0.0, 1.0), count);
        Place {
            cosine: within(cosine_place(o.z.clamp(0.0, 1.0), met), COSINES),
            azimuth: within(azimuth_place(direction, alpha), self.azimuths),
            roughness: within(alpha.y.sqrt(), ROUGHNESSES),
            strength: within(strength, STRENGTHS),
        }
    }

    /// Albedo and share for facets of widths `alpha` as seen from `o` in their own basis, interpolated in all four axes.
    pub(super) fn at(&self, alpha: Vec2, o: Vec3A) -> [f32; 2] {
        let place = self.place(alpha, o);
        [0, 1].map(|part| self.read(&place, |values| values[part], mix))
    }

    /// The same, but the greater albedo of the azimuths around.
    pub(super) fn most_at(&self, alpha: Vec2, o: Vec3A) -> [f32; 2] {
        let place = self.place(alpha, o);
        let most = self.read(&place, |values| values[0], |below, above, _| below.max(above));
        [most, self.read(&place, |values| values[1], mix)]
    }

    fn read(&self, place: &Place, part: impl Fn(&[f32; 2]) -> f32, between: impl Fn(f32, f32, f32) -> f32) -> f32 {
        let ((cosine, c), (azimuth, a)) = (place.cosine, place.azimuth);
        let ((row, r), (column, s)) = (place.roughness, place.strength);
        let slice = |roughness: usize, strength: usize| {
            let values = self.slice(roughness, strength);
            let at = |azimuth: usize| {
                let i = azimuth * COSINES + cosine;
                mix(part(&values[i]), part(&values[i + 1]), c)
            };
            between(at(azimuth), at(azimuth + 1), a)
        };
        let rows = |column: usize| mix(slice(row, column), slice(row + 1, column), r);
        mix(rows(column), rows(column + 1), s)
    }
}

fn mix(a: f32, b: f32, t: f32) -> f32 {
    a * (1.0 - t) + b * t
}

/// Where cosine `cos` lies for facets whose width the view meets as `met`: shadowing of what comes sets in below that
/// width, of what leaves, which the other width spreads, at any cosine; so the mean of both axes.
fn cosine_place(cos: f32, met: f32) -> f32 {
    0.5 * (Axis::Shadowing.place(cos, Axis::k(met.sqrt())) + Axis::Root.place(cos, 0.0))
}

/// Where the azimuth of `direction`, in the first quadrant, lies: facets see it turned by (α_y / α_x)½ and more, while the
/// surface below them, which they shadow, sees it as it is; so the mean of both angles.
fn azimuth_place(direction: Vec2, alpha: Vec2) -> f32 {
    let turned = libm::atan2f(direction.y, direction.x * (alpha.x / alpha.y).sqrt());
    (turned + libm::atan2f(direction.y, direction.x)) / (2.0 * FRAC_PI_2)
}

/// The inverse of [`cosine_place`].
fn cosine(place: f32, met: f32) -> f32 {
    inverse(place, (0.0, 1.0), |cos| cosine_place(cos, met))
}

/// The inverse of [`azimuth_place`].
fn direction(place: f32, alpha: Vec2) -> Vec2 {
    if place <= 0.0 {
        return Vec2::X;
    }
    if place >= 1.0 {
        return Vec2::Y;
    }
    // The wanted tangents span many powers of two.
    let of = |log: f32| Vec2::new(1.0, libm::exp2f(log)).normalize();
    of(inverse(place, (-30.0, 30.0), |log| azimuth_place(of(log), alpha)))
}

/// The argument in `range` for which the rising function `f` is `value`, by bisection.
fn inverse(value: f32, (mut low, mut high): (f32, f32), f: impl Fn(f32) -> f32) -> f32 {
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if f(middle) < value { low = middle } else { high = middle }
    }
    high
}
