//! An emitter's shape as seen from the point that receives its light.

use super::emitters::Shape;
use super::rectangle::SeenRectangle;
use super::triangle::{SeenTriangle, ShapeSample};
use glam::{Vec2, Vec3A};

/// An emitter's shape as its receiving point sees it.
#[derive(Debug, Clone, Copy)]
pub(super) enum SeenShape<'a> {
    /// With 1 where the corners run counter-clockwise seen from the front, −1 where clockwise.
    Triangle(SeenTriangle, f32),
    Rectangle(SeenRectangle<'a>),
}

impl<'a> SeenShape<'a> {
    #[inline]
    pub(super) fn new(shape: Shape<'a>, from: Vec3A) -> Option<Self> {
        match shape {
            Shape::Triangle(corners, winding) => SeenTriangle::new(corners, from).map(|s| Self::Triangle(s, winding)),
            Shape::Rectangle(rectangle) => SeenRectangle::new(rectangle, from).map(Self::Rectangle),
        }
    }

    /// Positive where the point is before the front.
    pub(super) fn facing(&self) -> f32 {
        match self {
            Self::Triangle(seen, winding) => seen.facing() * winding,
            Self::Rectangle(seen) => seen.facing(),
        }
    }

    pub(super) fn sample(&self, u: Vec2) -> Option<ShapeSample> {
        match self {
            Self::Triangle(seen, _) => seen.sample(u),
            Self::Rectangle(seen) => seen.sample(u),
        }
    }

    pub(super) fn pdf(&self, wi: Vec3A, distance: f32) -> f32 {
        match self {
            Self::Triangle(seen, _) => seen.pdf(wi, distance),
            Self::Rectangle(seen) => seen.pdf(wi, distance),
        }
    }
}
