//! Walking a tree front to back.

use super::block::{Block, Candidate, decide, tag, test};
use super::collapse::LEAF;
use super::frame::RayFrame;
use super::isa::Isa;
use super::node::WideNode;
use super::tree::{Nodes, Tree};
use std::cell::Cell;

/// A hit by the names that the structure uses.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub(super) candidate: Candidate,
    /// Which structure: the number of an instance, or [`WORLD`].
    pub(super) space: u32,
    /// The triangle's index there.
    pub(super) index: u32,
}

/// The space of triangles that stand in the world structure.
pub(super) const WORLD: u32 = u32::MAX;

/// The state of one query.
pub(super) struct Query<'a> {
    /// Farthest t of interest.
    pub(super) limit: f32,
    /// The best hit so far.
    pub(super) found: Option<Found>,
    /// The tags for skipping that this ray honours.
    pub(super) skips: u32,
    /// Whether a tagged candidate counts.
    pub(super) accept: &'a dyn Fn(&Found) -> bool,
    /// The order of hits at equal t.
    pub(super) precedes: &'a dyn Fn(&Found, &Found) -> bool,
}

impl Query<'_> {
    /// Considers a hit; whether it became the best.
    #[inline(always)]
    fn offer(&mut self, candidate: Candidate, id: u32, space: u32) -> bool {
        let skip = if candidate.front { tag::SKIP_FRONT } else { tag::SKIP_BACK };
        if id & skip & self.skips != 0 {
            return false;
        }
        let found = Found { candidate, space, index: id & tag::INDEX };
        if candidate.t >= self.limit && self.found.as_ref().is_some_and(|best| !(self.precedes)(&found, best)) {
            return false;
        }
        if id & tag::ASK != 0 && !(self.accept)(&found) {
            return false;
        }
        self.limit = candidate.t;
        self.found = Some(found);
        true
    }
}

/// Room for what a walk leaves for later. Cells: a thread's own room is lent to one walk after another without a flag that
/// says so.
pub(super) type Waiting = [Cell<u64>];

/// What a walk does at a leaf. A trait and not a closure: its method is compiled into the loop that calls it, with the
/// loop's processor features.
pub(super) trait Visit {
    /// Visits leaf `leaf`; `stack` is free for its use. Returns whether the walk is over.
    fn visit(&self, leaf: u32, query: &mut Query<'_>, stack: &Waiting) -> bool;

    /// Says that leaf `leaf` may be visited soon.
    fn prefetch<I: Isa>(&self, leaf: u32);
}

/// Walks what lies below `root` of `nodes`: front to back, or, where `ANY` hit will do, in the order of the children's
/// slots, which puts first what is likely to end the walk soon (`occlusion`). Returns whether `leaves` ended it.
#[inline(always)]
pub(super) fn walk<I: Isa, N: WideNode, V: Visit, const ANY: bool>(
    nodes: &Nodes<N>,
    root: u32,
    ray: &RayFrame,
    time: f32,
    leaves: &V,
    query: &mut Query<'_>,
    stack: &Waiting,
) -> bool {
    let mut waiting = 0;
    let mut current = root;
    if nodes.bounds.is_empty() {
        return false;
    }
    loop {
        if current & LEAF == 0 {
            let node = &nodes.nodes[current as usize];
            let opened = node.open::<I>(ray, time, query.limit);
            let mut mask = opened.mask;
            if mask != 0 {
                let children = node.children();
                let first = take(&mut mask);
                if mask == 0 {
                    current = children[first];
                    continue;
                }
                announce::<I, _, _>(nodes, leaves, children[first]);
                if ANY {
                    while mask != 0 {
                        let last = (31 - mask.leading_zeros()) as usize & 7;
                        mask ^= 1 << last;
                        stack[waiting].set(u64::from(children[last]));
                        waiting += 1;
                    }
                    current = children[first];
                    continue;
                }
                let key = |child: usize| u64::from(opened.near.0[child].to_bits()) << 32 | u64::from(children[child]);
                let second = take(&mut mask);
                announce::<I, _, _>(nodes, leaves, children[second]);
                let (a, b) = sorted(key(first), key(second));
                if mask == 0 {
                    // Two are the most common.
                    stack[waiting].set(b);
                    waiting += 1;
                    current = lower_half(a);
                    continue;
                }
                let third = take(&mut mask);
                announce::<I, _, _>(nodes, leaves, children[third]);
                let (b, c) = sorted(b, key(third));
                let (a, b) = sorted(a, b);
                let from = waiting;
                stack[waiting].set(c);
                stack[waiting + 1].set(b);
                if mask == 0 {
                    waiting += 2;
                    current = lower_half(a);
                    continue;
                }
                stack[waiting + 2].set(a);
                waiting += 3;
                while mask != 0 {
                    let more = take(&mut mask);
                    announce::<I, _, _>(nodes, leaves, children[more]);
                    insert(stack, from, waiting, key(more));
                    waiting += 1;
                }
                waiting -= 1;
                current = lower_half(stack[waiting].get());
                continue;
            }
        } else if leaves.visit(current & !LEAF, query, &stack[waiting..]) {
            return true;
        }
        loop {
            if waiting == 0 {
                return false;
            }
            waiting -= 1;
            let key = stack[waiting].get();
            if ANY || f32::from_bits(lower_half(key >> 32)) <= query.limit {
                current = lower_half(key);
                break;
            }
        }
    }
}

/// Takes the first child out of `mask`, which has one.
#[inline(always)]
fn take(mask: &mut u32) -> usize {
    let child = mask.trailing_zeros() as usize & 7;
    *mask &= *mask - 1;
    child
}

/// Says that `child` may be visited soon.
#[inline(always)]
fn announce<I: Isa, N: WideNode, V: Visit>(nodes: &Nodes<N>, leaves: &V, child: u32) {
    if child & LEAF == 0 {
        I::prefetch(nodes.nodes.as_ptr().wrapping_add(child as usize));
    } else {
        leaves.prefetch::<I>(child & !LEAF);
    }
}

#[inline(always)]
#[allow(clippy::cast_possible_truncation, reason = "takes the lower half")]
fn lower_half(key: u64) -> u32 {
    key as u32
}

/// The lesser and the greater.
#[inline(always)]
fn sorted(a: u64, b: u64) -> (u64, u64) {
    (a.min(b), a.max(b))
}

/// Inserts `key` into the descending run `stack[from..to]`.
#[inline(always)]
fn insert(stack: &Waiting, from: usize, to: usize, key: u64) {
    let mut at = to;
    while at > from && stack[at - 1].get() < key {
        stack[at].set(stack[at - 1].get());
        at -= 1;
    }
    stack[at].set(key);
}

/// The triangles of a tree as leaves.
struct Triangles<'a, B, const ANY: bool> {
    blocks: &'a [B],
    ray: &'a RayFrame,
    time: f32,
    space: u32,
}

impl<B: Block, const ANY: bool> Visit for Triangles<'_, B, ANY> {
    #[inline(always)]
    fn visit(&self, leaf: u32, query: &mut Query<'_>, _: &Waiting) -> bool {
        let block = &self.blocks[leaf as usize];
        let hits = test(block, self.time, self.ray, query.limit);
        let mut mask = hits.mask;
        while mask != 0 {
            let lane = mask.trailing_zeros() as usize & 3;
            mask &= mask - 1;
            if let Some(candidate) = decide(&block.triangle(lane, self.time), &hits, lane, self.ray, query.limit)
                && query.offer(candidate, block.ids()[lane], self.space)
                && ANY
            {
                return true;
            }
        }
        false
    }

    #[inline(always)]
    fn prefetch<I: Isa>(&self, leaf: u32) {
        I::prefetch(self.blocks.as_ptr().wrapping_add(leaf as usize));
    }
}

/// Walks what lies below `root` of a tree of triangles in space `space`. Returns whether a hit ended the walk (`ANY` only).
#[inline(always)]
pub(super) fn walk_triangles<I: Isa, N: WideNode, B: Block, const ANY: bool>(
    tree: &Tree<N, B>,
    root: u32,
    ray: &RayFrame,
    time: f32,
    space: u32,
    query: &mut Query<'_>,
    stack: &Waiting,
) -> bool {
    let leaves = Triangles::<B, ANY> { blocks: &tree.blocks, ray, time, space };
    walk::<I, N, _, ANY>(&tree.nodes, root, ray, time, &leaves, query, stack)
}
