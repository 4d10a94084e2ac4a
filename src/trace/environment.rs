//! Light from infinitely far away: constant, a vertical gradient, or an equirectangular picture.
//!
//! A picture is sampled in proportion to its luminance times solid angle: piecewise constant over cells of whole
//! texels, whose weights are the exact means of the bilinearly interpolated picture. Within a cell directions are
//! uniform by solid angle, so nothing diverges at the poles. Constant and gradient fields are sampled by the cosine at
//! the receiving surface, which is all that varies there.

mod grid;

use super::warp;
use crate::numeric::{self, sin_cos};
use crate::scene;
use crate::trace::texture::decode_linear;
use glam::{Vec2, Vec3, Vec3A};
use grid::Grid;
use std::f32::consts::{FRAC_1_PI, PI, TAU};

/// What surrounds the scene.
#[derive(Debug, Clone, Copy)]
pub enum Background<'a> {
    /// Nothing.
    Black,
    /// The same radiance from everywhere.
    Constant(Vec3),
    /// Radiance straight up, at the horizon and straight down, linear in the sine of elevation between them.
    Gradient {
        /// From straight up.
        zenith: Vec3,
        /// From the horizon.
        horizon: Vec3,
        /// From straight down.
        nadir: Vec3,
    },
    /// An equirectangular picture.
    Picture(&'a scene::Environment),
}

/// Light from all around, prepared for sampling.
#[derive(Debug)]
pub struct Environment {
    field: Field,
    /// Cosine and sine of the rotation about y.
    turn: (f32, f32),
    mean: Vec3,
}

#[derive(Debug)]
enum Field {
    Black,
    Gradient([Vec3; 3]),
    Picture { width: u32, height: u32, texels: Vec<[f32; 3]>, grid: Grid },
}

/// A direction drawn towards the environment.
#[derive(Debug, Clone, Copy)]
pub struct EnvironmentSample {
    /// Where the light comes from, unit.
    pub wi: Vec3A,
    /// What arrives.
    pub radiance: Vec3,
    /// Density by solid angle.
    pub pdf_solid_angle: f32,
}

/// On which sides of a surface light can act.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// Only where the normal points.
    Above,
    /// On both: the surface lets light through.
    Both,
}

impl Environment {
    /// Prepares `background`.
    #[must_use]
    pub fn new(background: Background<'_>) -> Self {
        match background {
            Background::Black => Self { field: Field::Black, turn: (1.0, 0.0), mean: Vec3::ZERO },
            Background::Constant(c) => Self::gradient([c; 3]),
            Background::Gradient { zenith, horizon, nadir } => Self::gradient([zenith, horizon, nadir]),
            Background::Picture(picture) => Self::picture(picture),
        }
    }

    fn gradient(colors: [Vec3; 3]) -> Self {
        if colors.iter().all(|&c| c == Vec3::ZERO) {
            return Self::new(Background::Black);
        }
        // The sine of elevation is uniform over the sphere, so the mean is that of two straight lines.
        let mean = 0.25 * colors[0] + 0.5 * colors[1] + 0.25 * colors[2];
        Self { field: Field::Gradient(colors), turn: (1.0, 0.0), mean }
    }

    fn picture(picture: &scene::Environment) -> Self {
        let image = &picture.image;
        let count = image.width as usize * image.height as usize;
        let texels: Vec<[f32; 3]> = (0..count)
            .map(|i| {
                let v = decode_linear(image, i) * picture.strength;
                // A picture may hold what no light can be: negative, infinite or no numbers.
                v.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 }).to_array()
            })
            .collect();
        let (grid, mean) = Grid::new(&texels, image.width, image.height);
        if mean == Vec3::ZERO {
            return Self::new(Background::Black);
        }
        let (sin, cos) = sin_cos(picture.rotation);
        let (width, height) = (image.width, image.height);
        Self { field: Field::Picture { width, height, texels, grid }, turn: (cos, sin), mean }
    }

    /// Whether nothing comes from it.
    #[must_use]
    pub fn is_black(&self) -> bool {
        matches!(self.field, Field::Black)
    }

    /// Mean radiance over all directions.
    #[must_use]
    pub fn mean(&self) -> Vec3 {
        self.mean
    }

    /// Radiance from the unit direction `wi`.
    #[must_use]
    pub fn radiance(&self, wi: Vec3A) -> Vec3 {
        match &self.field {
            Field::Black => Vec3::ZERO,
            Field::Gradient([zenith, horizon, nadir]) => {
                let end = if wi.y >= 0.0 { zenith } else { nadir };
                horizon.lerp(*end, wi.y.abs().min(1.0))
            }
            Field::Picture { width, height, texels, .. } => {
                let p = square_from_direction(self.turned(wi, -1.0));
                bilinear(texels, *width, *height, p)
            }
        }
    }

    /// Draws a direction for a surface with unit normal `n`.
    #[must_use]
    pub fn sample(&self, n: Vec3A, sides: Sides, u: Vec2) -> Option<EnvironmentSample> {
        let (wi, pdf) = match &self.field {
            Field::Black => return None,
            Field::Gradient(_) => {
                let (side, u) = match sides {
                    Sides::Above => (1.0, u),
                    Sides::Both => match warp::split(u.x, 0.5) {
                        (warp::Side::First, x) => (1.0, Vec2::new(x, u.y)),
                        (warp::Side::Second, x) => (-1.0, Vec2::new(x, u.y)),
                    },
                };
                let (t, b) = warp::tangents_of(n);
                let w = warp::cosine_hemisphere_from_square(u);
                let wi = t * w.x + b * w.y + n * (w.z * side);
                (wi.normalize(), self.pdf(n, sides, wi))
            }
            Field::Picture { grid, .. } => {
                let (w, pdf) = grid.sample(u);
                (self.turned(w, 1.0), pdf)
            }
        };
        (pdf > 0.0).then(|| EnvironmentSample { wi, radiance: self.radiance(wi), pdf_solid_angle: pdf })
    }

    /// Density by solid angle with which [`Environment::sample`] draws `wi`.
    #[must_use]
    pub fn pdf(&self, n: Vec3A, sides: Sides, wi: Vec3A) -> f32 {
        match &self.field {
            Field::Black => 0.0,
            Field::Gradient(_) => {
                let cos = n.dot(wi);
                match sides {
                    Sides::Above => cos.max(0.0) * FRAC_1_PI,
                    Sides::Both => cos.abs() * (0.5 * FRAC_1_PI),
                }
            }
            Field::Picture { grid, .. } => grid.pdf(square_from_direction(self.turned(wi, -1.0))),
        }
    }

    /// An estimate of the irradiance that it gives a surface.
    #[must_use]
    pub fn irradiance(&self) -> f32 {
        PI * numeric::luminance(self.mean)
    }

    /// `w` turned about y: world from picture for `sign` 1, the inverse for −1.
    fn turned(&self, w: Vec3A, sign: f32) -> Vec3A {
        let (cos, sin) = (self.turn.0, self.turn.1 * sign);
        Vec3A::new(cos * w.x + sin * w.z, w.y, cos * w.z - sin * w.x)
    }
}

/// Place in the picture, [0, 1]², of a direction: the middle column looks along −z, the top row up.
fn square_from_direction(w: Vec3A) -> Vec2 {
    let u = 0.5 + libm::atan2f(w.x, -w.z) / TAU;
    let v = libm::atan2f((w.x * w.x + w.z * w.z).sqrt(), w.y) * FRAC_1_PI;
    Vec2::new(u, v)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss, reason = "texel indices")]
fn bilinear(texels: &[[f32; 3]], width: u32, height: u32, p: Vec2) -> Vec3 {
    let (x, y) = (p.x * width as f32 - 0.5, p.y * height as f32 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let columns = [0, 1].map(|d| (x0 as i32 + d).rem_euclid(width as i32) as usize);
    let rows = [0, 1].map(|d| (y0 as i32 + d).clamp(0, height as i32 - 1) as usize);
    let at = |r: usize, c: usize| Vec3::from_array(texels[rows[r] * width as usize + columns[c]]);
    let upper = at(0, 0).lerp(at(0, 1), x - x0);
    let lower = at(1, 0).lerp(at(1, 1), x - x0);
    upper.lerp(lower, y - y0)
}

#[cfg(test)]
mod tests;
