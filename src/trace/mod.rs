//! The image function: a point in, radiance out.
//!
//! [`ImageFunction`] is the seam at which designs, film and tracer meet. A loaded scene is one; so are the analytic
//! functions with exact integrals that prove designs, filters and estimators right before a scene hides their faults.

pub mod accel;
pub mod analytic;
pub mod aov;
pub mod bsdf;
pub mod camera;
#[cfg(test)]
mod economy;
pub mod environment;
pub mod lights;
mod media;
pub mod path;
mod quadrature;
pub mod ray;
pub mod surface;
pub mod tally;
pub mod texture;
pub mod warp;

pub use ray::{Backs, Hit, Ray};

use crate::design::Point;
use glam::{DVec2, Vec3};

/// Where a sample lies on the film and in the exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmPoint {
    /// Position on the film in pixels: x to the right, y down, pixel (0, 0) covers [0, 1)².
    pub position: DVec2,
    /// Time within the stage's interval, [0, 1].
    pub u_time: f32,
}

/// The function that a pixel integrates: I(x, y, t, lens u v, light u v, …) (Mitchell 1990, §5.2).
pub trait ImageFunction: Sync {
    /// Scene-linear Rec. 709 radiance that arrives at `film`; further coordinates are drawn from `point` by factor.
    fn radiance(&self, film: FilmPoint, point: &Point<'_>) -> Vec3;
}
