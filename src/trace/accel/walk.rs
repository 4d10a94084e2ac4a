//! Walking a tree front to back.

use super::block::{Block, Candidate, decide, tag, test};
use super::collapse::{LEAF, WIDTH};
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

    /// Where what a visit of leaf `leaf` reads begins.
    fn place(&self, leaf: u32) -> *const u8;
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
    let all = nodes.nodes.as_slice();
    let mut waiting = 0;
    let mut current = root;
    if nodes.bounds.is_empty() {
        return false;
    }
    loop {
        // From node to node until a leaf is met: in here the query does not change and the ray stays in registers.
        let limit = query.limit;
        while current & LEAF == 0 {
            let node = &all[current as usize];
            let opened = node.open::<I>(ray, time, limit);
            if opened.mask == 0 {
                let Some(next) = resume::<ANY>(stack, &mut waiting, limit) else { return false };
                current = next;
                continue;
            }
            let children = node.children();
            let mut mask = opened.mask;
            let first = take(&mut mask);
            current = children[first];
            if mask == 0 {
                continue;
            }
            let room = stack[waiting..].first_chunk().expect("a walk's room was counted");
            if ANY {
                waiting += leave(mask, |child| announced::<I, _, _>(all, leaves, children[child]), room);
                continue;
            }
            let key = |child: usize| {
                let met = u64::from(opened.near.0[child].to_bits());
                met << 32 | u64::from(announced::<I, _, _>(all, leaves, children[child]))
            };
            let (nearest, others) = leave_farther(key(first), mask, key, room);
            current = nearest;
            waiting += others;
        }
        if leaves.visit(current & !LEAF, query, &stack[waiting..]) {
            return true;
        }
        let Some(next) = resume::<ANY>(stack, &mut waiting, query.limit) else { return false };
        current = next;
    }
}

/// Takes the first child out of `mask`, which has one.
#[inline(always)]
fn take(mask: &mut u32) -> usize {
    let child = mask.trailing_zeros() as usize & 7;
    *mask &= *mask - 1;
    child
}

/// The next of the `waiting` that is met within `limit`.
#[inline(always)]
fn resume<const ANY: bool>(stack: &Waiting, waiting: &mut usize, limit: f32) -> Option<u32> {
    while *waiting > 0 {
        *waiting -= 1;
        let key = stack[*waiting].get();
        if ANY || f32::from_bits(lower_half(key >> 32)) <= limit {
            return Some(lower_half(key));
        }
    }
    None
}

/// `child`, after saying that it may be visited soon.
#[inline(always)]
fn announced<I: Isa, N: WideNode, V: Visit>(nodes: &[N], leaves: &V, child: u32) -> u32 {
    let node = nodes.as_ptr().wrapping_add(child as usize);
    I::prefetch(if child & LEAF == 0 { node } else { leaves.place(child & !LEAF).cast() });
    child
}

/// Leaves the children in `mask` for later, the last of them first; how many.
#[inline(always)]
fn leave(mut mask: u32, child: impl Fn(usize) -> u32, room: &[Cell<u64>; WIDTH]) -> usize {
    let mut count = 0;
    while mask != 0 {
        let last = (31 - mask.leading_zeros()) as usize & 7;
        mask ^= 1 << last;
        room[count & 7].set(u64::from(child(last)));
        count += 1;
    }
    count
}

/// Of the children with `first` and those in `mask`, one at least, the nearest; the others are left for later, the
/// farthest first. How many were left.
#[inline(always)]
fn leave_farther(first: u64, mut mask: u32, key: impl Fn(usize) -> u64, room: &[Cell<u64>; WIDTH]) -> (u32, usize) {
    let (a, b) = sorted(first, key(take(&mut mask)));
    if mask == 0 {
        // Two are the most common.
        room[0].set(b);
        return (lower_half(a), 1);
    }
    let (b, c) = sorted(b, key(take(&mut mask)));
    let (a, b) = sorted(a, b);
    room[0].set(c);
    room[1].set(b);
    if mask == 0 {
        return (lower_half(a), 2);
    }
    room[2].set(a);
    let mut count = 3;
    while mask != 0 {
        insert(room, count, key(take(&mut mask)));
        count += 1;
    }
    (lower_half(room[(count - 1) & 7].get()), count - 1)
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

/// Inserts `key` into the descending first `count` of `room`, fewer than all.
#[inline(always)]
fn insert(room: &[Cell<u64>; WIDTH], count: usize, key: u64) {
    let mut at = count;
    while at > 0 && room[(at - 1) & 7].get() < key {
        room[at & 7].set(room[(at - 1) & 7].get());
        at -= 1;
    }
    room[at & 7].set(key);
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
    fn place(&self, leaf: u32) -> *const u8 {
        self.blocks.as_ptr().wrapping_add(leaf as usize).cast()
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
