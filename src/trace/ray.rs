//! Rays and hits.

use glam::Vec3A;

/// What a ray does at the back of a single-sided surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backs {
    /// It passes: so the author's viewer shows it. For rays from the eye, straight or by mirrors.
    Pass,
    /// It stops: a wall is a wall. For rays that carry light, so that no lamp shines through a room from outside.
    #[default]
    Stop,
}

/// A half-line in space at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Where it starts, world space.
    pub origin: Vec3A,
    /// Where it goes; need not be a unit vector: `t` counts in its lengths.
    pub direction: Vec3A,
    /// Farthest `t` of interest, > 0; may be infinite.
    pub t_max: f32,
    /// Time within the stage's interval, [0, 1].
    pub u_time: f32,
    /// What it does at the back of a single-sided surface.
    pub backs: Backs,
}

/// Where a ray met a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Barycentric weight of the triangle's second vertex.
    pub u: f32,
    /// Barycentric weight of the triangle's third vertex.
    pub v: f32,
    /// Index into [`crate::scene::Stage::instances`].
    pub instance: u32,
    /// Index into the mesh's triangles.
    pub triangle: u32,
}
