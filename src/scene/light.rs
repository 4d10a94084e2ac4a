//! Lights other than emissive surfaces.

use super::texture::Image;
use glam::Vec3;

/// Where a punctual light shines from and to (`KHR_lights_punctual`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightShape {
    /// From infinitely far along the node's −z axis.
    Directional {
        /// Angular radius of the source in radians, ≥ 0; 0 is a point at infinity.
        angular_radius: f32,
    },
    /// From the node's origin in all directions.
    Point {
        /// Radius of the luminous sphere, metres, ≥ 0; 0 is a point.
        radius: f32,
    },
    /// From the node's origin in a cone about its −z axis.
    Spot {
        /// Radius of the luminous sphere, metres, ≥ 0; 0 is a point.
        radius: f32,
        /// Full brightness up to this angle from the axis, radians.
        inner_cone: f32,
        /// Dark from this angle on, radians, at most π / 2.
        outer_cone: f32,
    },
}

/// A punctual light; a node places it.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// The file's name for it; may be empty.
    pub name: String,
    /// Its shape.
    pub shape: LightShape,
    /// Linear colour × intensity: candela for point and spot (lm/sr), lux for directional (lm/m²). Non-negative.
    pub intensity: Vec3,
    /// Distance beyond which it gives nothing, metres; `None` is unlimited.
    pub range: Option<f32>,
}

/// Light from all around, as an equirectangular picture.
#[derive(Debug, Clone)]
pub struct Environment {
    /// Latitude-longitude picture, scene-linear; the middle column looks along −z (before rotation), row 0 is up.
    pub image: Image,
    /// Rotation about the y axis, radians.
    pub rotation: f32,
    /// Multiplies the picture.
    pub strength: f32,
}
