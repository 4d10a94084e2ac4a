//! The level above: where structures stand, and how a ray finds them.

use super::body::{Body, Form};
use super::choice::LeafRule;
use super::collapse::{self, BLOCK, NO_TRIANGLE, Shape};
use super::frame::RayFrame;
use super::guard::Guard;
use super::isa::Isa;
use super::linear::{Aabb, LinearBox};
use super::node::{MovingNode, StillNode, WideNode};
use super::sweep::swept;
use super::topology::{self, Reference};
use super::tree::Nodes;
use super::walk::{Query, Visit, WORLD, Waiting, walk, walk_triangles};
use super::world::World;
use crate::factor::compiled;
use crate::scene::motion::segment_at;
use crate::scene::{Motion, Presence};
use crate::trace::Ray;
use glam::{Affine3A, Vec3A};
use std::sync::Arc;

/// A structure in the world.
#[derive(Debug)]
pub(super) struct Place {
    pub(super) body: Arc<Body>,
    pub(super) pose: Pose,
    /// When it is there.
    pub(super) presence: Presence,
    /// Index of the stage's instance.
    pub(super) instance: u32,
}

/// How a ray comes into a structure's space.
#[derive(Debug)]
pub(super) enum Pose {
    /// It is the world's.
    World,
    /// By a matrix that does not change.
    Still {
        /// Structure from world.
        inverse: Affine3A,
        /// World from structure.
        motion: Motion,
    },
    /// By the inverse of the motion's matrix at the ray's time.
    Moving(Motion),
}

impl Pose {
    /// World from structure.
    fn motion(&self) -> Option<&Motion> {
        match self {
            Self::World => None,
            Self::Still { motion, .. } | Self::Moving(motion) => Some(motion),
        }
    }
}

/// What stands in a tree of places.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Item {
    /// The place of this number.
    Place(u32),
    /// The part of the world's structure below this node or leaf of it.
    World(u32),
}

/// A tree over places and parts of the world's structure.
#[derive(Debug)]
pub(super) struct TopTree<N> {
    pub(super) nodes: Nodes<N>,
    /// What each leaf stands for.
    pub(super) items: Vec<Item>,
    /// Bounds of the places, at all its times.
    places: Aabb,
}

/// The top level.
#[derive(Debug)]
pub(super) enum Top {
    /// Nothing but the world's structure.
    World,
    /// Nothing moves.
    Still(TopTree<StillNode>),
    /// Something moves: one tree for each of equal slabs of the exposure.
    Moving(Vec<TopTree<MovingNode>>),
}

/// One place to a leaf. Entering one costs a ray about four visits of a node: a matrix inverse, a new frame, a root.
const PLACE_LEAF: LeafRule = LeafRule { most: 1, cost: 4.0 };

/// Into how many parts the world's structure is opened at most (no more than there are places), so that places are met
/// between its parts in the order of distance (Benthin et al. 2017, *Improved Two-Level BVHs using Partial Re-Braiding*).
const MOST_PARTS: usize = 64;

/// Most slabs of time.
const MOST_SLABS: usize = 64;

/// Most references in all slabs, unless one slab alone has more.
const MOST_REFERENCES: usize = 1 << 18;

impl Top {
    /// Builds over `places` and the world's structure.
    pub(super) fn build(places: &[Place], world: Option<&World>) -> Self {
        if places.is_empty() {
            return Self::World;
        }
        let parts = world.map_or_else(Vec::new, |w| w.tree.nodes.opened(MOST_PARTS.min(places.len())));
        let still = places.iter().all(|p| p.body.motion.boxes.len() == 1 && !matches!(p.pose, Pose::Moving(_)));
        let boxes = |begin: f32, end: f32| -> Vec<(Item, LinearBox)> {
            use rayon::prelude::*;
            let place = |(i, p): (usize, &Place)| (Item::Place(index(i)), p.bounds(begin, end));
            let mut boxes: Vec<_> = places.par_iter().enumerate().map(place).collect();
            boxes.extend(parts.iter().map(|&(root, b)| (Item::World(root), LinearBox::still(b))));
            boxes.retain(|(_, b)| !b.swept().is_empty());
            boxes
        };
        if still {
            return Self::Still(TopTree::build(&boxes(0.0, 1.0)));
        }
        let slabs = slab_count(places);
        #[allow(clippy::cast_precision_loss, reason = "at most 64")]
        let border = |i: usize| i as f32 / slabs as f32;
        use rayon::prelude::*;
        let slab = |i: usize| TopTree::build(&boxes(border(i), border(i + 1)));
        Self::Moving((0..slabs).into_par_iter().map(slab).collect())
    }

    /// Bounds of all places throughout the exposure.
    pub(super) fn places(&self) -> Aabb {
        match self {
            Self::World => Aabb::EMPTY,
            Self::Still(t) => t.places,
            Self::Moving(slabs) => slabs.iter().fold(Aabb::EMPTY, |all, t| all.join(&t.places)),
        }
    }

    pub(super) fn stack(&self) -> usize {
        match self {
            Self::World => 0,
            Self::Still(t) => t.nodes.stack,
            Self::Moving(slabs) => slabs.iter().map(|t| t.nodes.stack).max().unwrap_or(0),
        }
    }

    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::World => 0,
            Self::Still(t) => t.nodes.bytes(),
            Self::Moving(slabs) => slabs.iter().map(|t| t.nodes.bytes()).sum(),
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "fewer places than 2^31: each is a node of the scene")]
fn index(i: usize) -> u32 {
    i as u32
}

/// How many slabs of time the top level is split into: the fewest whose boxes are within a tenth of the least total area.
///
/// One slab serves where everything moves in a line. A wheel that turns ten times fills its disc's square in every slab
/// longer than an eighth of a turn.
#[allow(clippy::cast_precision_loss, reason = "at most 64 slabs")]
fn slab_count(places: &[Place]) -> usize {
    use rayon::prelude::*;
    let bends = |p: &Place| p.body.motion.boxes.len() > 2 || p.pose.motion().is_some_and(|m| m.times().len() > 2);
    if !places.iter().any(bends) {
        return 1;
    }
    let area = |p: &Place, slabs: usize| -> f64 {
        let one = |i: usize| p.bounds(i as f32 / slabs as f32, (i + 1) as f32 / slabs as f32).middle();
        (0..slabs).map(|i| f64::from(topology::half_area(one(i).lo, one(i).hi))).sum::<f64>() / slabs as f64
    };
    let counts: Vec<usize> = std::iter::successors(Some(1), |&k| Some(2 * k))
        .take_while(|&k| k <= MOST_SLABS && (k == 1 || k * places.len() <= MOST_REFERENCES))
        .collect();
    // Summed in order: a parallel sum would depend on the number of threads.
    let cost = |&k: &usize| places.par_iter().map(|p| area(p, k)).collect::<Vec<_>>().iter().sum::<f64>();
    let costs: Vec<f64> = counts.iter().map(cost).collect();
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    counts.iter().zip(&costs).find(|(_, c)| **c <= 1.1 * least).map_or(1, |(&k, _)| k)
}

impl<N: WideNode> TopTree<N> {
    fn build(boxes: &[(Item, LinearBox)]) -> Self {
        let mut references: Vec<Reference> = boxes
            .iter()
            .enumerate()
            .map(|(i, (_, b))| {
                let Aabb { lo, hi } = b.middle();
                // How much of its box a structure fills is not known: a half, as a ball would.
                Reference::new(lo, hi, index(i), topology::half_area(lo, hi) * 0.5)
            })
            .collect();
        let tree = topology::build(&mut references, None, PLACE_LEAF);
        let shape: Shape = collapse::collapse(&tree, &references, PLACE_LEAF);
        let of_leaf = |leaf: &[u32; BLOCK]| {
            debug_assert!(leaf[0] != NO_TRIANGLE && leaf[1] == NO_TRIANGLE, "one place to a leaf");
            leaf[0] as usize
        };
        let leaves: Vec<LinearBox> = shape.leaves.iter().map(|l| boxes[of_leaf(l)].1).collect();
        let items = shape.leaves.iter().map(|l| boxes[of_leaf(l)].0).collect();
        let is_place = |(item, _): &&(Item, LinearBox)| matches!(item, Item::Place(_));
        let places = boxes.iter().filter(is_place).fold(Aabb::EMPTY, |all, (_, b)| all.join(&b.padded().swept()));
        Self { nodes: Nodes::around(&shape, &leaves), items, places }
    }
}

impl Place {
    /// Linear bounds in the world over times from `begin` to `end`.
    fn bounds(&self, begin: f32, end: f32) -> LinearBox {
        let still = Motion::still(Affine3A::IDENTITY);
        swept(self.pose.motion().unwrap_or(&still), &self.body.motion, begin, end)
    }

    /// The ray in the structure's space; `None` where it is not there at that instant or its matrix is singular.
    #[inline(always)]
    fn enter(&self, ray: &Ray) -> Option<(Vec3A, Vec3A)> {
        if !self.presence.holds(ray.u_time) {
            return None;
        }
        match &self.pose {
            Pose::World => Some((ray.origin, ray.direction)),
            Pose::Still { inverse, .. } => {
                Some((inverse.transform_point3a(ray.origin), inverse.transform_vector3a(ray.direction)))
            }
            Pose::Moving(_) if !compiled::TIME => None,
            Pose::Moving(motion) => {
                let (origin, direction) = solved(&motion.at(ray.u_time), ray.origin, ray.direction);
                (origin.is_finite() && direction.is_finite()).then_some((origin, direction))
            }
        }
    }
}

/// What a query walks through.
#[derive(Debug)]
pub(super) struct Structures {
    /// What never moves, as one tree.
    pub(super) world: Option<Arc<World>>,
    pub(super) places: Vec<Place>,
    pub(super) top: Top,
    /// Around the places, where that spares rays the top level.
    pub(super) guard: Option<Guard>,
    /// Of everything.
    pub(super) bounds: Aabb,
}

impl Structures {
    /// Over `places` and the world's structure.
    pub(super) fn new(world: Option<Arc<World>>, places: Vec<Place>) -> Self {
        let top = Top::build(&places, world.as_deref());
        let own = world.as_ref().map_or(Aabb::EMPTY, |w| w.tree.nodes.bounds);
        let bounds = match &top {
            Top::World => own,
            Top::Still(t) => t.nodes.bounds,
            Top::Moving(slabs) => slabs.iter().fold(Aabb::EMPTY, |all, t| all.join(&t.nodes.bounds)),
        };
        Self { guard: Guard::around(&top.places(), &own), bounds, world, places, top }
    }
}

/// `origin` and `direction` before `m`, by Cramer's rule: half the work of an inverse.
#[inline(always)]
fn solved(m: &Affine3A, origin: Vec3A, direction: Vec3A) -> (Vec3A, Vec3A) {
    let [x, y, z] = [m.matrix3.x_axis, m.matrix3.y_axis, m.matrix3.z_axis];
    let rows = [y.cross(z), z.cross(x), x.cross(y)];
    let scale = 1.0 / x.dot(rows[0]);
    let before = |v: Vec3A| Vec3A::new(rows[0].dot(v), rows[1].dot(v), rows[2].dot(v)) * scale;
    (before(origin - m.translation), before(direction))
}

/// Places and parts of the world as leaves.
struct Places<'a, I, const ANY: bool> {
    all: &'a Structures,
    items: &'a [Item],
    ray: &'a Ray,
    /// The ray in the world. The bounds that it was made for enclose everything.
    frame: &'a RayFrame,
    isa: std::marker::PhantomData<I>,
}

impl<'a, I: Isa, const ANY: bool> Places<'a, I, ANY> {
    #[inline(always)]
    fn new(all: &'a Structures, items: &'a [Item], ray: &'a Ray, frame: &'a RayFrame) -> Self {
        Self { all, items, ray, frame, isa: std::marker::PhantomData }
    }
}

impl<I: Isa, const ANY: bool> Visit for Places<'_, I, ANY> {
    #[inline(always)]
    fn visit(&self, leaf: u32, query: &mut Query<'_>, stack: &Waiting) -> bool {
        let item = match self.items[leaf as usize] {
            Item::Place(item) => item,
            Item::World(root) => {
                let Some(World { tree, .. }) = self.all.world.as_deref() else { return false };
                return I::walk_still::<ANY>(tree, root, self.frame, WORLD, query, stack);
            }
        };
        let place = &self.all.places[item as usize];
        let Some((origin, direction)) = place.enter(self.ray) else { return false };
        match &place.body.form {
            Form::Still(tree) => {
                let frame = RayFrame::new(origin, direction, &tree.nodes.bounds);
                I::walk_still::<ANY>(tree, tree.nodes.root, &frame, item, query, stack)
            }
            Form::Moving(_) if !compiled::TIME => false,
            Form::Moving(deforming) => {
                let (segment, f) = segment_at(&deforming.times, self.ray.u_time);
                let tree = &deforming.segments[segment];
                // Where it deforms in the world itself, the ray is ready.
                let own;
                let frame = if matches!(place.pose, Pose::World) {
                    self.frame
                } else {
                    own = RayFrame::new(origin, direction, &tree.nodes.bounds);
                    &own
                };
                I::walk_moving::<ANY>(tree, frame, f, item, query, stack)
            }
        }
    }

    #[inline(always)]
    fn place(&self, leaf: u32) -> *const u8 {
        match self.items[leaf as usize] {
            Item::Place(place) => self.all.places.as_ptr().wrapping_add(place as usize).cast(),
            Item::World(root) => match &self.all.world {
                Some(world) => world.tree.nodes.nodes.as_ptr().wrapping_add(root as usize).cast(),
                None => std::ptr::null(),
            },
        }
    }
}

/// Walks everything.
#[inline(always)]
pub(super) fn search<I: Isa, const ANY: bool>(all: &Structures, ray: &Ray, query: &mut Query<'_>, stack: &Waiting) {
    let frame = RayFrame::new(ray.origin, ray.direction, &all.bounds);
    if all.guard.as_ref().is_none_or(|guard| guard.is_met(&frame, query.limit)) {
        match &all.top {
            Top::World => {}
            Top::Still(top) => {
                let places = Places::<I, ANY>::new(all, &top.items, ray, &frame);
                walk::<I, _, _, ANY>(&top.nodes, top.nodes.root, &frame, 0.0, &places, query, stack);
                return;
            }
            Top::Moving(_) if !compiled::TIME => return,
            Top::Moving(slabs) => {
                let (top, f) = slab_at(slabs, ray.u_time);
                let places = Places::<I, ANY>::new(all, &top.items, ray, &frame);
                walk::<I, _, _, ANY>(&top.nodes, top.nodes.root, &frame, f, &places, query, stack);
                return;
            }
        }
    }
    if let Some(World { tree, .. }) = all.world.as_deref() {
        walk_triangles::<I, _, _, ANY>(tree, tree.nodes.root, &frame, 0.0, WORLD, query, stack);
    }
}

/// The slab that holds `u_time`, and where in it.
#[inline(always)]
#[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 64")]
fn slab_at(slabs: &[TopTree<MovingNode>], u_time: f32) -> (&TopTree<MovingNode>, f32) {
    // The count is a power of two: the product is exact, and so is the fraction.
    let scaled = u_time.clamp(0.0, 1.0) * slabs.len() as f32;
    let i = (scaled as usize).min(slabs.len() - 1);
    (&slabs[i], scaled - i as f32)
}
