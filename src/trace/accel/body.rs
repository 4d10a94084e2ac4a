//! Structures over one geometry, in its own space (or baked into the world's).

use super::block::{StoredTriangle, tag};
use super::choice::LeafRule;
use super::collapse::{self, Shape};
use super::linear::{Aabb, LinearBox};
use super::sweep::ShapeMotion;
use super::topology::{self, Reference};
use super::tree::{MovingTree, StillTree};
use super::{memory, spatial};
use crate::scene::{AlphaMode, Geometry, Mesh, Motion, Scene};
use glam::Vec3A;
use rayon::prelude::*;

/// Leaves of triangles: one block, costing 0.6 of a node's visit (measured; flat between 0.5 and 0.8).
#[allow(clippy::cast_possible_truncation, reason = "four")]
pub(super) const TRIANGLE_LEAF: LeafRule = LeafRule { most: collapse::BLOCK as u32, cost: 0.6 };

/// A geometry's triangles in a structure.
#[derive(Debug)]
pub(super) struct Body {
    pub(super) form: Form,
    /// How its bounds change.
    pub(super) motion: ShapeMotion,
    /// Triangles that can be hit.
    pub(super) triangles: usize,
}

/// Still or deforming.
#[derive(Debug)]
pub(super) enum Form {
    /// Vertices stand still.
    Still(StillTree),
    /// Vertices move linearly from key to key.
    Moving(Deforming),
}

/// Trees of one shape, one a segment.
#[derive(Debug)]
pub(super) struct Deforming {
    /// Key times, one more than segments.
    pub(super) times: Vec<f32>,
    pub(super) segments: Vec<MovingTree>,
    /// The shape, kept to refit it in the next frame.
    pub(super) shape: Shape,
    /// Cost of the shape when it was built, relative to the area of its bounds: how good it was.
    pub(super) built_cost: f32,
}

/// Positions of a geometry's vertices, key by key.
pub(super) struct Vertices {
    /// Key times; one where it stands still.
    pub(super) times: Vec<f32>,
    pub(super) keys: Vec<Vec<Vec3A>>,
}

impl Vertices {
    /// Of `geometry` in its own space.
    pub(super) fn of(mesh: &Mesh, geometry: &Geometry) -> Self {
        let converted = |p: &[glam::Vec3]| p.iter().map(|&v| Vec3A::from(v)).collect::<Vec<_>>();
        match geometry.keys.len() {
            0 => Self { times: vec![0.0], keys: vec![converted(&mesh.positions)] },
            1 => Self { times: vec![0.0], keys: vec![converted(&geometry.keys[0].positions)] },
            _ => Self {
                times: geometry.times.clone(),
                keys: geometry.keys.par_iter().map(|k| converted(&k.positions)).collect(),
            },
        }
    }

    /// The same in the world. Exact where at most one of the two moves: a product of both is not linear.
    pub(super) fn placed(self, motion: &Motion) -> Self {
        if motion.is_still() {
            let m = motion.keys()[0];
            let place = |key: Vec<Vec3A>| key.into_iter().map(|p| m.transform_point3a(p)).collect();
            return Self { times: self.times, keys: self.keys.into_iter().map(place).collect() };
        }
        let rest = &self.keys[0];
        let keys = motion.keys().par_iter().map(|m| rest.iter().map(|&p| m.transform_point3a(p)).collect());
        Self { times: motion.times().to_vec(), keys: keys.collect() }
    }

    fn bounds(&self) -> ShapeMotion {
        let boxes = self.keys.iter().map(|k| Aabb::around(k.iter().copied())).collect();
        let reach = self
            .keys
            .windows(2)
            .map(|w| w[0].iter().zip(&w[1]).fold(Vec3A::ZERO, |most, (a, b)| most.max((*b - *a).abs())));
        ShapeMotion { times: self.times.clone(), reach: reach.collect(), boxes }
    }

    /// Whether triangle `t` has an area at some key: exactly degenerate ones are never hit.
    fn has_area(&self, t: [u32; 3]) -> bool {
        self.keys.iter().any(|key| {
            let [a, b, c] = t.map(|i| key[i as usize].as_dvec3());
            let n = (b - a).cross(c - a);
            n.is_finite() && n.length_squared() > 0.0
        })
    }
}

/// Tags for triangles of `mesh`: who decides about its hits. `mirrored` if winding is reversed in the structure's space.
pub(super) fn tags(scene: &Scene, mesh: &Mesh, mirrored: bool) -> u32 {
    let material = &scene.materials[mesh.material];
    let uncertain = material.base_color_texture.is_some() || material.base_color.w < 1.0 || !mesh.colors.is_empty();
    let mut tags = if material.alpha_mode != AlphaMode::Opaque && uncertain { tag::ASK } else { 0 };
    // The boundary of a volume is met from both sides (`KHR_materials_volume`).
    let volume = material.transmission.as_ref().is_some_and(|t| t.volume.is_some());
    if !material.double_sided && !volume {
        tags |= if mirrored { tag::SKIP_FRONT } else { tag::SKIP_BACK };
    }
    tags
}

/// The tree's shape over triangles that stand still, given by index; large ones may be cut.
pub(super) fn still_shape(ids: &[u32], corners: impl Fn(u32) -> [Vec3A; 3] + Sync) -> Shape {
    let reference = |&id: &u32| {
        let [a, b, c] = corners(id);
        Reference::new(a.min(b).min(c), a.max(b).max(c), id, area(a, b, c))
    };
    let mut references = memory::large(ids.len() + spatial::spare(ids.len()));
    ids.par_iter().with_min_len(4096).map(reference).collect_into_vec(&mut references);
    let tree = topology::build(&mut references, Some(&corners), TRIANGLE_LEAF);
    collapse::collapse(&tree, &references, TRIANGLE_LEAF)
}

/// The tree's shape over triangles given by index, as they are at mid-exposure.
fn moving_shape(ids: &[u32], triangle: impl Fn(u32) -> StoredTriangle + Sync) -> Shape {
    let reference = |&id: &u32| {
        let t = triangle(id);
        let (begin, end) = (Aabb::around(t.begin), Aabb::around(t.end));
        let middle = LinearBox { begin, end }.middle();
        let [a, b, c] = [0, 1, 2].map(|i| t.begin[i] * 0.5 + t.end[i] * 0.5);
        Reference::new(middle.lo, middle.hi, id, area(a, b, c))
    };
    let mut references = memory::large(ids.len());
    ids.par_iter().with_min_len(4096).map(reference).collect_into_vec(&mut references);
    let tree = topology::build(&mut references, None, TRIANGLE_LEAF);
    Shape { boxes: Vec::new(), ..collapse::collapse(&tree, &references, TRIANGLE_LEAF) }
}

fn area(a: Vec3A, b: Vec3A, c: Vec3A) -> f32 {
    (b - a).cross(c - a).length() * 0.5
}

#[allow(clippy::cast_possible_truncation, reason = "triangle counts are checked against 2^29 before building")]
fn triangle_ids(triangles: &[[u32; 3]], keep: impl Fn([u32; 3]) -> bool + Sync) -> Vec<u32> {
    (0..triangles.len() as u32).into_par_iter().with_min_len(4096).filter(|&i| keep(triangles[i as usize])).collect()
}

/// Most that the relative cost of a refitted shape may grow before it is rebuilt.
const WORN: f32 = 1.3;

impl Body {
    /// Builds over `vertices`; `previous` is refitted if it is over the same triangles and still good.
    pub(super) fn build(mesh: &Mesh, tags: u32, vertices: &Vertices, previous: Option<&Self>) -> Self {
        let triangles = &mesh.triangles;
        let stored = |begin: &[Vec3A], end: &[Vec3A], id: u32| StoredTriangle {
            begin: triangles[id as usize].map(|v| begin[v as usize]),
            end: triangles[id as usize].map(|v| end[v as usize]),
            id: id | tags,
        };
        let motion = vertices.bounds();
        if vertices.keys.len() == 1 {
            let key = &vertices.keys[0];
            let ids = triangle_ids(triangles, |t| vertices.has_area(t));
            let shape = still_shape(&ids, |id| stored(key, key, id).begin);
            let tree = StillTree::fill(&shape, |id| stored(key, key, id));
            return Self { form: Form::Still(tree), motion, triangles: ids.len() };
        }
        let fill = |shape: &Shape| -> Vec<MovingTree> {
            let keys: Vec<_> = vertices.keys.windows(2).collect();
            keys.par_iter().map(|w| MovingTree::fill(shape, |id| stored(&w[0], &w[1], id))).collect()
        };
        if let Some(Self { form: Form::Moving(old), triangles: count, .. }) = previous {
            let segments = fill(&old.shape);
            if relative_cost(&segments) <= WORN * old.built_cost {
                let (shape, built_cost) = (old.shape.clone(), old.built_cost);
                let form = Form::Moving(Deforming { times: vertices.times.clone(), segments, shape, built_cost });
                return Self { form, motion, triangles: *count };
            }
        }
        // Whether a triangle has an area may differ in the next frame: those that never can, by index, are left out.
        let ids = triangle_ids(triangles, |t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0]);
        let middle = (vertices.keys.len() - 1) / 2;
        let (a, b) = (&vertices.keys[middle], &vertices.keys[middle + 1]);
        let shape = moving_shape(&ids, |id| stored(a, b, id));
        let segments = fill(&shape);
        let built_cost = relative_cost(&segments);
        let form = Form::Moving(Deforming { times: vertices.times.clone(), segments, shape, built_cost });
        Self { form, motion, triangles: ids.len() }
    }

    /// Most entries a traversal needs on its stack.
    pub(super) fn stack(&self) -> usize {
        match &self.form {
            Form::Still(tree) => tree.nodes.stack,
            Form::Moving(d) => d.shape.stack,
        }
    }

    /// Bytes that it occupies.
    pub(super) fn bytes(&self) -> usize {
        match &self.form {
            Form::Still(tree) => tree.bytes(),
            Form::Moving(d) => d.segments.iter().map(MovingTree::bytes).sum(),
        }
    }
}

/// Expected visits of a ray that meets the bounds, mean over segments: what decides whether refitting still serves.
fn relative_cost(segments: &[MovingTree]) -> f32 {
    let costs = segments.iter().map(|s| s.nodes.relative_cost);
    #[allow(clippy::cast_precision_loss, reason = "few segments")]
    let count = segments.len().max(1) as f32;
    costs.sum::<f32>() / count
}
