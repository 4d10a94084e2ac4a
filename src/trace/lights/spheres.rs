//! Sphere lights as rays see them: a small hierarchy of boxes that move with the exposure, so that a ray among many
//! spheres looks at few.

use super::punctual::{Lamp, Nature};
use glam::{Vec3, Vec3A};

/// Spheres in a leaf.
const LEAF_SIZE: usize = 2;

#[derive(Debug, Clone, Copy)]
struct Node {
    /// Boxes (corners low, high) at `u_time` 0 and 1; their linear blend holds the spheres at every instant between.
    boxes: [[Vec3A; 2]; 2],
    /// First sphere of a leaf, else the second child; the first child follows its parent.
    next: u32,
    /// Spheres in a leaf; 0 for an inner node.
    count: u32,
}

/// The hierarchy; empty without spheres.
#[derive(Debug, Default)]
pub(super) struct Spheres {
    nodes: Vec<Node>,
    /// Stage lights in the leaves' order, with their numbers among the spheres.
    order: Vec<(u32, u32)>,
}

impl Spheres {
    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Over the lights `spheres` among `lamps`; their numbers are places in that list.
    #[allow(clippy::cast_possible_truncation, reason = "lights of a file are counted in 32 bits")]
    pub(super) fn new(lamps: &[Lamp<'_>], spheres: &[usize]) -> Self {
        debug_assert!(spheres.iter().all(|&i| lamps[i].nature() == Nature::Sphere));
        let boxes: Vec<[[Vec3; 2]; 2]> = spheres.iter().map(|&i| lamps[i].extent().boxes).collect();
        let mut all = Self { nodes: Vec::new(), order: Vec::new() };
        if spheres.is_empty() {
            return all;
        }
        let centre = |i: u32| {
            let b = &boxes[i as usize];
            b[0][0] + b[0][1] + b[1][0] + b[1][1]
        };
        let mut order: Vec<u32> = (0..spheres.len() as u32).collect();
        // Depth first; `parent` is whose second child this is.
        let mut pending = vec![(0_usize, order.len(), None::<usize>)];
        while let Some((low, high, parent)) = pending.pop() {
            let number = all.nodes.len();
            if let Some(parent) = parent {
                all.nodes[parent].next = number as u32;
            }
            let items = &mut order[low..high];
            let whole = bounds(items.iter().map(|&i| &boxes[i as usize]));
            let leaf = items.len() <= LEAF_SIZE;
            all.nodes.push(Node { boxes: whole, next: low as u32, count: if leaf { items.len() as u32 } else { 0 } });
            if leaf {
                continue;
            }
            let (least, most) = items
                .iter()
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), &i| (a.min(centre(i)), b.max(centre(i))));
            let axis = (most - least).max_position();
            let half = items.len() / 2;
            items.select_nth_unstable_by(half, |&a, &b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(&b)));
            pending.push((low + half, high, Some(number)));
            pending.push((low, low + half, None));
        }
        all.order = order.iter().map(|&i| (spheres[i as usize] as u32, i)).collect();
        all
    }

    /// Gives each sphere whose box the ray from `from` along `wi` may meet before `t_max`: the stage's light, and its
    /// number among the spheres.
    #[inline]
    pub(super) fn near(&self, from: Vec3A, wi: Vec3A, t_max: f32, u_time: f32, mut each: impl FnMut(usize, usize)) {
        if self.nodes.is_empty() {
            return;
        }
        // Held finite: along an axis of the box 0 · ∞ would say nothing.
        let inverse = wi.recip().clamp(Vec3A::splat(f32::MIN), Vec3A::splat(f32::MAX));
        // Halving at every level, no tree is deeper than the bits of a count.
        let (mut stack, mut height) = ([0_u32; 33], 1);
        while height > 0 {
            height -= 1;
            let number = stack[height];
            let node = &self.nodes[number as usize];
            if !node.meets(from, inverse, t_max, u_time) {
                continue;
            }
            if node.count == 0 {
                stack[height] = node.next;
                stack[height + 1] = number + 1;
                height += 2;
                continue;
            }
            for &(light, sphere) in &self.order[node.next as usize..(node.next + node.count) as usize] {
                each(light as usize, sphere as usize);
            }
        }
    }
}

impl Node {
    /// Whether a ray may meet the box before `t_max`: never false for one that does.
    #[inline]
    fn meets(&self, from: Vec3A, inverse: Vec3A, t_max: f32, u_time: f32) -> bool {
        let [a, b] = &self.boxes;
        let blend = |i: usize| a[i] * (1.0 - u_time) + b[i] * u_time;
        // The blend and the subtraction round by γ₃ of the coordinates; a sphere touches its box in points alone, and
        // those are put inside.
        let wider =
            (a[0].abs().max(a[1].abs()).max(b[0].abs()).max(b[1].abs()) + from.abs()) * crate::numeric::gamma(4);
        let (low, high) = ((blend(0) - wider - from) * inverse, (blend(1) + wider - from) * inverse);
        let (near, far) = (low.min(high).max_element(), low.max(high).min_element());
        near * (1.0 - crate::numeric::gamma(4)) <= far * (1.0 + crate::numeric::gamma(4)) && far >= 0.0 && near <= t_max
    }
}

fn bounds<'a>(boxes: impl Iterator<Item = &'a [[Vec3; 2]; 2]>) -> [[Vec3A; 2]; 2] {
    let nothing = [[Vec3A::INFINITY, Vec3A::NEG_INFINITY]; 2];
    boxes
        .fold(nothing, |sum, b| std::array::from_fn(|t| [sum[t][0].min(b[t][0].into()), sum[t][1].max(b[t][1].into())]))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{add_light, at, stage};
    use super::*;
    use crate::numeric::unit_from_bits;
    use crate::scene::{LightShape, Motion};
    use crate::trace::warp::sphere_from_square;
    use glam::{Affine3A, Vec2};
    use rand_pcg::Pcg64Mcg;
    use rand_pcg::rand_core::Rng;

    /// Every sphere that a ray meets is among those that the hierarchy gives: 300 spheres, some moving, some inside
    /// others, 20 000 rays, one in three along an axis.
    #[test]
    fn no_sphere_that_a_ray_meets_is_left_out() {
        let mut random = Pcg64Mcg::new(9);
        let mut unit = || unit_from_bits(random.next_u32());
        let mut stage = stage();
        for i in 0..300_u32 {
            let p = Vec3::new(unit(), unit(), unit()) * 20.0 - 10.0;
            let there = |p: Vec3| Affine3A::from_translation(p);
            let motion = if i % 3 == 0 {
                let q = Vec3::new(unit(), unit(), unit()) * 4.0;
                Motion::through(vec![0.0, 0.4, 1.0], vec![there(p), there(p + q), there(p - q)])
            } else {
                at(p.x, p.y, p.z)
            };
            add_light(&mut stage, LightShape::Point { radius: 0.05 + unit() }, 1.0, motion);
        }
        let list: Vec<usize> = (0..300).collect();
        let lamps: Vec<Lamp<'_>> = stage.lights.iter().map(Lamp::new).collect();
        let spheres = Spheres::new(&lamps, &list);
        let (mut met, mut given) = (0_u32, 0_u32);
        for i in 0..20_000_u32 {
            let from = Vec3A::new(unit(), unit(), unit()) * 30.0 - 15.0;
            let wi = if i % 3 == 0 { Vec3A::NEG_Z } else { sphere_from_square(Vec2::new(unit(), unit())) };
            let u_time = unit();
            let mut near = vec![false; 300];
            spheres.near(from, wi, f32::INFINITY, u_time, |light, number| {
                assert_eq!(light, list[number]);
                near[number] = true;
                given += 1;
            });
            for (lamp, near) in lamps.iter().zip(near) {
                let seen = lamp.seen(from, wi, u_time).is_some();
                met += u32::from(seen);
                assert!(near || !seen);
            }
        }
        // 6 million pairs: most are never looked at.
        assert!(met > 3000 && given < 300_000, "{met} met, {given} looked at");
    }
}
