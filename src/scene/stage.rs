//! The scene as one exposure sees it: motions baked to linear segments.

use super::{Light, MeshId, Motion, NodeId, Projection};
use crate::time::Exposure;
use glam::{Vec3, Vec4};

/// Vertices of a mesh at one instant.
#[derive(Debug, Clone, Default)]
pub struct VertexKey {
    /// Positions, as many as the mesh has.
    pub positions: Vec<Vec3>,
    /// Normals, as many as the mesh has (empty: flat).
    pub normals: Vec<Vec3>,
    /// Tangents, as many as the mesh has (empty: none).
    pub tangents: Vec<Vec4>,
}

/// A mesh's shape over the exposure.
#[derive(Debug, Clone)]
pub struct Geometry {
    /// The mesh it came from: topology, texture coordinates, colours and material are the mesh's.
    pub mesh: MeshId,
    /// Empty: the mesh's own rest pose. One key: deformed, but still in this exposure. More: vertices move linearly
    /// from key to key at [`Geometry::times`].
    pub keys: Vec<VertexKey>,
    /// Key times in [0, 1], ascending, as many as keys where there are two or more.
    pub times: Vec<f32>,
}

/// A geometry placed in the world.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Index into [`Stage::geometries`].
    pub geometry: usize,
    /// World from geometry, and when it is visible.
    pub motion: Motion,
    /// The node it came from.
    pub node: NodeId,
    /// Whether no animation can ever move or deform it: it may be kept between frames.
    pub permanent: bool,
}

/// The camera of this exposure.
#[derive(Debug, Clone)]
pub struct StageCamera {
    /// World from camera; looks down −z, y up.
    pub motion: Motion,
    /// How it projects.
    pub projection: Projection,
    /// Radius of the aperture, metres; 0 is a pinhole.
    pub aperture_radius: f32,
    /// Distance to the plane in focus, metres along the axis, when the exposure opens and when it closes.
    pub focus_distance: [f32; 2],
}

/// A punctual light of this exposure.
#[derive(Debug, Clone)]
pub struct StageLight {
    /// What shines.
    pub light: Light,
    /// World from light: position, and direction along −z; and when it shines.
    pub motion: Motion,
    /// The node it came from.
    pub node: NodeId,
}

/// Everything that one exposure sees. `u_time` in [0, 1] runs from `interval.open` to `interval.close`.
#[derive(Debug, Clone)]
pub struct Stage {
    /// The span of time that it covers.
    pub interval: Exposure,
    /// The eye.
    pub camera: StageCamera,
    /// Shapes; several instances may share one.
    pub geometries: Vec<Geometry>,
    /// Shapes placed in the world. Only what is visible at some time ([`Motion::presence`]).
    pub instances: Vec<Instance>,
    /// Punctual lights placed in the world.
    pub lights: Vec<StageLight>,
}
