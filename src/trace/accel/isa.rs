//! The inner loops, compiled for any processor and for those with AVX2 and FMA.
//!
//! [`Isa`] names what differs: the test of a ray against eight boxes, and functions whose whole body is compiled with the
//! processor's features. Tests of triangles are the same IEEE operations in the same order on either, without fused
//! multiply-add. Tests of boxes fuse where they can; both ways are conservative ([`RayFrame`]), so no hit depends on them:
//! both answer alike bit for bit and a picture does not depend on the processor.

use super::frame::RayFrame;
use super::node::{MovingNode, Offset, Opened, Planes, StillNode};
use super::tree::{MovingTree, StillTree};
use super::walk::{Query, Waiting, walk_triangles};
use glam::Vec3A;

/// A way to compile the inner loops.
pub(super) trait Isa {
    /// Tests the boxes of a still node.
    fn open_still(node: &StillNode, ray: &RayFrame, limit: f32) -> Opened;

    /// Tests the boxes of a moving node at fraction `time` of its segment.
    fn open_moving(node: &MovingNode, ray: &RayFrame, time: f32, limit: f32) -> Opened;

    /// Says that as much as a `T` at `place`, if anything stands there, is read soon.
    fn prefetch<T>(place: *const T);

    /// Walks what lies below `root` of a tree of still triangles.
    fn walk_still<const ANY: bool>(
        tree: &StillTree,
        root: u32,
        ray: &RayFrame,
        space: u32,
        query: &mut Query<'_>,
        stack: &Waiting,
    ) -> bool;

    /// Walks a tree of moving triangles.
    fn walk_moving<const ANY: bool>(
        tree: &MovingTree,
        ray: &RayFrame,
        time: f32,
        space: u32,
        query: &mut Query<'_>,
        stack: &Waiting,
    ) -> bool;
}

/// Any processor.
pub(super) struct Portable;

impl Isa for Portable {
    #[inline(always)]
    fn prefetch<T>(_place: *const T) {}

    #[inline(always)]
    fn open_still(node: &StillNode, ray: &RayFrame, limit: f32) -> Opened {
        slabs(|at| at.plane(&node.bounds).0, ray, limit)
    }

    #[inline(always)]
    fn open_moving(node: &MovingNode, ray: &RayFrame, time: f32, limit: f32) -> Opened {
        let plane = |at: Offset| {
            let (bounds, deltas) = (&at.plane(&node.bounds).0, &at.plane(&node.deltas).0);
            std::array::from_fn(|c| bounds[c] + time * deltas[c])
        };
        slabs(plane, ray, limit)
    }

    fn walk_still<const ANY: bool>(
        tree: &StillTree,
        root: u32,
        ray: &RayFrame,
        space: u32,
        query: &mut Query<'_>,
        stack: &Waiting,
    ) -> bool {
        walk_triangles::<Self, _, _, ANY>(tree, root, ray, 0.0, space, query, stack)
    }

    fn walk_moving<const ANY: bool>(
        tree: &MovingTree,
        ray: &RayFrame,
        time: f32,
        space: u32,
        query: &mut Query<'_>,
        stack: &Waiting,
    ) -> bool {
        walk_triangles::<Self, _, _, ANY>(tree, tree.nodes.root, ray, time, space, query, stack)
    }
}

/// `a` if it is the greater, else `b`: `b` where either is not a number, as the processor's own instruction does.
#[inline(always)]
fn greater(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `a` if it is the lesser, else `b`.
#[inline(always)]
fn lesser(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The slab test (Kay and Kajiya 1986), made conservative as [`RayFrame`] says. What is no number (∞ − ∞, of sizes that
/// leave `f32`) never decides: a comparison falls to its second side, in the end to 0 and `limit`.
#[inline(always)]
fn slabs(plane: impl Fn(Offset) -> [f32; 8], ray: &RayFrame, limit: f32) -> Opened {
    let distances = |at: &[Offset; 3], inverse: Vec3A, shift: Vec3A| -> [[f32; 8]; 3] {
        std::array::from_fn(|axis| plane(at[axis]).map(|p| p * inverse[axis] + shift[axis]))
    };
    let entries = distances(&ray.planes.near, ray.near_inverse, ray.near_shift);
    let exits = distances(&ray.planes.far, ray.far_inverse, ray.far_shift);
    let mut near = [0.0_f32; 8];
    let mut mask = 0;
    for c in 0..8 {
        near[c] = greater(greater(entries[0][c], entries[1][c]), greater(entries[2][c], 0.0));
        let far = lesser(lesser(exits[0][c], exits[1][c]), lesser(exits[2][c], limit));
        mask |= u32::from(near[c] <= far) << c;
    }
    Opened { mask, near: Planes(near) }
}

#[cfg(target_arch = "x86_64")]
pub(super) use avx2::Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    #![allow(
        unsafe_code,
        reason = "the only way to call code compiled for features found at run time; 1.5 times the portable speed; \
                  `tests::compare` holds it to the portable twin bit for bit"
    )]

    use super::{
        Isa, MovingNode, MovingTree, Offset, Opened, Planes, Query, RayFrame, StillNode, StillTree, Waiting,
        walk_triangles,
    };
    use crate::trace::accel::node::Sides;
    use std::arch::x86_64::{
        __m256, _CMP_LE_OQ, _MM_HINT_T0, _mm_prefetch, _mm256_cmp_ps, _mm256_fmadd_ps, _mm256_max_ps, _mm256_min_ps,
        _mm256_movemask_ps, _mm256_set1_ps, _mm256_setzero_ps,
    };

    /// A processor with AVX2 and FMA. Code for it is reached only after the processor was asked: see `Kernel::detect`.
    pub(in crate::trace::accel) struct Avx2;

    impl Avx2 {
        /// Whether this processor has all that the functions here are compiled for.
        pub(in crate::trace::accel) fn is_present() -> bool {
            use std::arch::is_x86_feature_detected as has;
            has!("avx2") && has!("fma") && has!("bmi1") && has!("bmi2") && has!("lzcnt") && has!("popcnt")
        }
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline]
    fn load(sides: &Sides, at: Offset) -> __m256 {
        // SAFETY: an `Offset` is that of a `Planes` in `Sides`, which holds nothing else and is aligned as `__m256` is.
        unsafe { std::ptr::from_ref(sides).byte_add(at.bytes()).cast::<__m256>().read() }
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline]
    fn distance(plane: __m256, inverse: f32, shift: f32) -> __m256 {
        _mm256_fmadd_ps(plane, _mm256_set1_ps(inverse), _mm256_set1_ps(shift))
    }

    /// As the portable twin: in pairs, since each comparison waits for the one before.
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline]
    fn slabs(plane: impl Fn(Offset) -> __m256, ray: &RayFrame, limit: f32) -> Opened {
        let entry = |axis: usize| distance(plane(ray.planes.near[axis]), ray.near_inverse[axis], ray.near_shift[axis]);
        let exit = |axis: usize| distance(plane(ray.planes.far[axis]), ray.far_inverse[axis], ray.far_shift[axis]);
        let near = _mm256_max_ps(_mm256_max_ps(entry(0), entry(1)), _mm256_max_ps(entry(2), _mm256_setzero_ps()));
        let far = _mm256_min_ps(_mm256_min_ps(exit(0), exit(1)), _mm256_min_ps(exit(2), _mm256_set1_ps(limit)));
        let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(near, far)).cast_unsigned();
        Opened { mask, near: Planes(bytemuck::cast(near)) }
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline]
    fn open_still(node: &StillNode, ray: &RayFrame, limit: f32) -> Opened {
        slabs(|at| load(&node.bounds, at), ray, limit)
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline]
    fn open_moving(node: &MovingNode, ray: &RayFrame, time: f32, limit: f32) -> Opened {
        let time = _mm256_set1_ps(time);
        slabs(|at| _mm256_fmadd_ps(time, load(&node.deltas, at), load(&node.bounds, at)), ray, limit)
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn walk_still<const ANY: bool>(
        tree: &StillTree,
        root: u32,
        ray: &RayFrame,
        space: u32,
        query: &mut Query<'_>,
        stack: &Waiting,
    ) -> bool {
        walk_triangles::<Avx2, _, _, ANY>(tree, root, ray, 0.0, space, query, stack)
    }

    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn walk_moving<const ANY: bool>(
        tree: &MovingTree,
        ray: &RayFrame,
        time: f32,
        space: u32,
        query: &mut Query<'_>,
        stack: &Waiting,
    ) -> bool {
        walk_triangles::<Avx2, _, _, ANY>(tree, tree.nodes.root, ray, time, space, query, stack)
    }

    impl Isa for Avx2 {
        #[inline(always)]
        fn prefetch<T>(place: *const T) {
            for line in 0..size_of::<T>().div_ceil(64) {
                // SAFETY: SSE is part of every x86-64; a prefetch reads nothing, whatever the address.
                unsafe { _mm_prefetch::<_MM_HINT_T0>(place.cast::<i8>().wrapping_add(64 * line)) };
            }
        }

        #[inline(always)]
        fn open_still(node: &StillNode, ray: &RayFrame, limit: f32) -> Opened {
            debug_assert!(Avx2::is_present());
            // SAFETY: the processor has the features, see `Avx2`.
            unsafe { open_still(node, ray, limit) }
        }

        #[inline(always)]
        fn open_moving(node: &MovingNode, ray: &RayFrame, time: f32, limit: f32) -> Opened {
            debug_assert!(Avx2::is_present());
            // SAFETY: the processor has the features, see `Avx2`.
            unsafe { open_moving(node, ray, time, limit) }
        }

        fn walk_still<const ANY: bool>(
            tree: &StillTree,
            root: u32,
            ray: &RayFrame,
            space: u32,
            query: &mut Query<'_>,
            stack: &Waiting,
        ) -> bool {
            debug_assert!(Avx2::is_present());
            // SAFETY: the processor has the features, see `Avx2`.
            unsafe { walk_still::<ANY>(tree, root, ray, space, query, stack) }
        }

        fn walk_moving<const ANY: bool>(
            tree: &MovingTree,
            ray: &RayFrame,
            time: f32,
            space: u32,
            query: &mut Query<'_>,
            stack: &Waiting,
        ) -> bool {
            debug_assert!(Avx2::is_present());
            // SAFETY: the processor has the features, see `Avx2`.
            unsafe { walk_moving::<ANY>(tree, ray, time, space, query, stack) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::collapse::{LEAF, NO_CHILD, WIDTH};
    use super::super::linear::{Aabb, LinearBox};
    use super::super::node::WideNode;
    use super::*;
    use glam::Vec3A;
    use proptest::prelude::*;

    fn vector(reach: f32) -> impl Strategy<Value = Vec3A> {
        prop::array::uniform3(-reach..reach).prop_map(Vec3A::from_array)
    }

    /// What every kernel of this processor finds at a node whose first child is `child`.
    fn opened(child: &Aabb, ray: &RayFrame) -> Vec<Opened> {
        let mut boxes = [LinearBox::EMPTY; WIDTH];
        boxes[0] = LinearBox::still(*child);
        let mut children = [NO_CHILD; WIDTH];
        children[0] = LEAF;
        let node = StillNode::new(&boxes, children);
        let mut all = vec![Portable::open_still(&node, ray, f32::INFINITY)];
        #[cfg(target_arch = "x86_64")]
        if Avx2::is_present() {
            all.push(Avx2::open_still(&node, ray, f32::INFINITY));
        }
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(10_000))]

        /// However a test of boxes is rounded: what a ray is aimed at is met, also in planes of its box and along axes, and
        /// none that encloses a triangle's own box is entered later than that.
        #[test]
        fn boxes_are_met_and_entered_early_enough(
            corners in (vector(1.0), vector(1.0)), at in prop::array::uniform3(0_u8..=4), origin in vector(4.0),
            along in 0_u8..7, grown in vector(1.0), grow in any::<bool>(), shift in prop_oneof![Just(0.0_f32), Just(1e4), Just(1e6)],
            scale in prop_oneof![Just(1.0_f32), Just(1e-6), Just(1e6)], speed in prop_oneof![Just(1.0_f32), Just(1e-6), Just(1e6)],
        ) {
            let place = |p: Vec3A| p * scale + Vec3A::new(shift, -shift, shift) * scale;
            let (a, b) = (place(corners.0), place(corners.1));
            let (lo, hi) = (a.min(b), a.max(b));
            let aim = lo + (hi - lo) * Vec3A::from_array(at.map(|n| f32::from(n) / 4.0));
            let mut origin = place(origin);
            for axis in 0..3 {
                if along >> axis & 1 == 1 {
                    origin[axis] = aim[axis];
                }
            }
            let direction = (aim - origin) * (speed / scale);
            prop_assume!(direction.abs().max_element() > 0.0);
            let more = if grow { grown.abs() * scale } else { Vec3A::ZERO };
            let child = Aabb { lo: lo - more, hi: hi + more };
            let ray = RayFrame::new(origin, direction, &child);
            prop_assert!(ray.meets(&child, f32::INFINITY), "missed by itself");
            for found in opened(&child, &ray) {
                prop_assert!(found.mask & 1 == 1, "missed");
                prop_assert!(found.near.0[0] <= ray.entry(lo, hi), "{} after {}", found.near.0[0], ray.entry(lo, hi));
            }
        }
    }
}
