//! Everything that never moves, as triangles of the world in one structure.

use super::block::StoredTriangle;
use super::body::{still_shape, tags};
use super::linear::Aabb;
use super::tree::StillTree;
use crate::numeric::UNIT_ROUNDOFF;
use crate::scene::{Geometry, Instance, Mesh, MeshId, NodeId, Scene};
use glam::{Affine3A, Vec3A};
use rayon::prelude::*;

/// A geometry used by several instances is copied into the world up to this many triangles a copy; more are instanced.
/// A copy of 256 triangles is 20 kB, an instance saves about ten node visits at the price of transforming the ray.
const COPIED: usize = 256;

/// What identifies a part from frame to frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PartKey {
    node: NodeId,
    mesh: MeshId,
    transform: Affine3A,
}

impl PartKey {
    pub(super) fn of(instance: &Instance, geometry: &Geometry) -> Self {
        Self { node: instance.node, mesh: geometry.mesh, transform: instance.motion.keys()[0] }
    }
}

/// The structure over what never moves.
#[derive(Debug)]
pub(super) struct World {
    pub(super) tree: StillTree,
    /// What is in it, in the order of the stage's instances.
    pub(super) parts: Vec<PartKey>,
    /// Where the parts lie among the triangles.
    spans: Spans,
    /// Triangles that can be hit.
    pub(super) triangles: usize,
}

/// Whether `instance` belongs into the world's structure: it never moves, is worth copying, and keeps its shape there.
pub(super) fn belongs(instance: &Instance, geometry: &Geometry, mesh: &Mesh, uses: usize) -> bool {
    let alone = uses <= 1 || mesh.triangles.len() <= COPIED;
    instance.permanent && instance.motion.is_still() && geometry.keys.len() <= 1 && alone && keeps_shape(instance, mesh)
}

/// Whether rounding world coordinates leaves the triangles' shape: half an ulp at the farthest corner is less than 2⁻⁸ of
/// a triangle's typical edge, or the transform could not be inverted anyway.
#[allow(clippy::cast_precision_loss, reason = "an estimate")]
fn keeps_shape(instance: &Instance, mesh: &Mesh) -> bool {
    let m = &instance.motion.keys()[0];
    if is_singular(m) {
        return true;
    }
    let bounds = Aabb::around(mesh.positions.iter().map(|&p| Vec3A::from(p)));
    let world = bounds.transformed(m);
    let edge = world.diagonal() / (mesh.triangles.len().max(1) as f32).sqrt();
    world.magnitude() * UNIT_ROUNDOFF <= edge / 256.0
}

/// Whether inverting `m` would lose the accuracy that intersecting in its space needs: its volume is below 2⁻¹² of the
/// volume that its columns would span at right angles.
pub(super) fn is_singular(m: &Affine3A) -> bool {
    let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis].map(|c| c.as_dvec3());
    let box_volume = x.length() * y.length() * z.length();
    let volume = x.dot(y.cross(z)).abs();
    // Column lengths may also be, or differ, so that the determinant or the inverse leaves f32.
    let determinant = m.matrix3.determinant().abs();
    volume.is_nan()
        || volume <= box_volume / 4096.0
        || !(f32::MIN_POSITIVE..=f32::MAX).contains(&determinant)
        || !m.inverse().is_finite()
}

struct Source<'a> {
    triangles: &'a [[u32; 3]],
    positions: Vec<Vec3A>,
    tags: u32,
}

impl World {
    /// Builds over `members`, in the order of the stage's instances; `None` if there are none.
    pub(super) fn build(scene: &Scene, members: &[(&Instance, &Geometry)]) -> Option<Self> {
        if members.is_empty() {
            return None;
        }
        let sources: Vec<Source<'_>> = members.par_iter().map(|(i, g)| Source::of(scene, i, g)).collect();
        let spans = Spans::of(sources.iter().map(|s| s.triangles.len()));
        let triangle = |id: u32| {
            let (part, index) = spans.locate(id);
            sources[part].triangle(index, id)
        };
        let ids: Vec<u32> =
            (0..spans.total()).into_par_iter().with_min_len(4096).filter(|&id| has_area(&triangle(id).begin)).collect();
        let shape = still_shape(&ids, |id| triangle(id).begin);
        let tree = StillTree::fill(&shape, triangle);
        let parts = members.iter().map(|(i, g)| PartKey::of(i, g)).collect();
        Some(Self { tree, parts, spans, triangles: ids.len() })
    }

    /// The part that triangle `index` belongs to, and its index there.
    #[inline]
    pub(super) fn locate(&self, index: u32) -> (usize, u32) {
        self.spans.locate(index)
    }
}

/// Consecutive spans of numbers, one a part.
#[derive(Debug)]
struct Spans {
    /// First number of each, and one past the last of all.
    first: Vec<u32>,
    /// The part of every 2^`shift`-th number, and that of the last: between two of them few parts begin.
    marks: Vec<u32>,
    shift: u32,
}

impl Spans {
    fn of(lengths: impl Iterator<Item = usize>) -> Self {
        let mut first = vec![0_u32];
        for length in lengths {
            let last = first[first.len() - 1];
            first.push(last.saturating_add(u32::try_from(length).unwrap_or(u32::MAX)));
        }
        let (parts, total) = (first.len() - 1, first[first.len() - 1]);
        let last = total.saturating_sub(1);
        let part_of = |number: u32| first.partition_point(|&f| f <= number) - 1;
        #[allow(
            clippy::cast_possible_truncation,
            reason = "there are fewer parts than numbers, and no number is above `last`"
        )]
        let (shift, mark) = (
            // About two marks a part.
            (total / (2 * parts.max(1) as u32)).max(1).ilog2(),
            |number: u64| part_of(number.min(u64::from(last)) as u32) as u32,
        );
        let marks = (0..=u64::from(last >> shift) + 1).map(|i| mark(i << shift)).collect();
        Self { first, marks, shift }
    }

    /// One past the last number.
    fn total(&self) -> u32 {
        self.first[self.first.len() - 1]
    }

    /// The part that holds `number`, and which of its numbers that is.
    #[inline]
    fn locate(&self, number: u32) -> (usize, u32) {
        let mark = (number >> self.shift) as usize;
        let (low, high) = (self.marks[mark] as usize, self.marks[mark + 1] as usize);
        // Of parts that begin at one number all but the last are empty.
        let part = low + self.first[low + 1..=high].partition_point(|&f| f <= number);
        (part, number - self.first[part])
    }
}

impl<'a> Source<'a> {
    fn of(scene: &'a Scene, instance: &Instance, geometry: &Geometry) -> Self {
        let mesh = &scene.meshes[geometry.mesh];
        let m = &instance.motion.keys()[0];
        let rest = geometry.keys.first().map_or(&mesh.positions, |k| &k.positions);
        let positions = rest.iter().map(|&p| m.transform_point3a(Vec3A::from(p))).collect();
        let mirrored = m.matrix3.determinant() < 0.0;
        Self { triangles: &mesh.triangles, positions, tags: tags(scene, mesh, mirrored) }
    }

    fn triangle(&self, index: u32, id: u32) -> StoredTriangle {
        let corners = self.triangles[index as usize].map(|v| self.positions[v as usize]);
        StoredTriangle { begin: corners, end: corners, id: id | self.tags }
    }
}

/// Whether a triangle is finite and not exactly degenerate.
fn has_area(corners: &[Vec3A; 3]) -> bool {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let n = (b - a).cross(c - a);
    n.is_finite() && n.length_squared() > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_number_is_found_in_its_part(
            lengths in prop::collection::vec(prop_oneof![0_usize..4, 0_usize..200, Just(5000_usize)], 1..60)
        ) {
            let spans = Spans::of(lengths.iter().copied());
            let mut number = 0;
            for (part, &length) in lengths.iter().enumerate() {
                for index in 0..u32::try_from(length).unwrap() {
                    prop_assert_eq!(spans.locate(number), (part, index));
                    number += 1;
                }
            }
            prop_assert_eq!(spans.total(), number);
        }
    }
}
