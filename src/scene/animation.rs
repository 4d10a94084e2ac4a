//! Keyframed curves.

use super::NodeId;
use glam::{Quat, Vec3};

/// How a curve runs between its keys (glTF 2.0, appendix C).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// Holds a key's value until the next key: a jump, never a smear.
    Step,
    /// Straight line; for rotations the shorter great arc at constant speed (slerp).
    Linear,
    /// Cubic Hermite with a tangent on each side of each key.
    CubicSpline,
}

/// One curve: `width` numbers a key.
///
/// Before the first and after the last key the end values hold.
#[derive(Debug, Clone)]
pub struct Track<T> {
    /// Key times in seconds of the file's clock, ascending (equal neighbours are a jump), finite, at least one.
    pub times: Vec<f64>,
    /// Values: `times.len() × width`; for [`Interpolation::CubicSpline`] three times that, glTF's order within each
    /// key: in-tangents, values, out-tangents (each `width` long).
    pub values: Vec<T>,
    /// How many values make one key: 1, or the number of morph targets.
    pub width: usize,
    /// How the curve runs between keys.
    pub interpolation: Interpolation,
}

/// What a channel drives, with its curve.
#[derive(Debug, Clone)]
pub enum Property {
    /// The node's translation, metres.
    Translation(Track<Vec3>),
    /// The node's rotation; keys are unit quaternions.
    Rotation(Track<Quat>),
    /// The node's scale.
    Scale(Track<Vec3>),
    /// The node's morph weights.
    Weights(Track<f32>),
    /// Visibility of the node and its descendants (`KHR_node_visibility` by `KHR_animation_pointer`): 0 or 1, STEP.
    Visibility(Track<f32>),
}

/// One curve on one node.
#[derive(Debug, Clone)]
pub struct Channel {
    /// The node that it moves.
    pub node: NodeId,
    /// What of it moves, and how.
    pub property: Property,
}

/// A named set of curves.
#[derive(Debug, Clone, Default)]
pub struct Animation {
    /// The file's name for it; may be empty.
    pub name: String,
    /// Its curves.
    pub channels: Vec<Channel>,
}
