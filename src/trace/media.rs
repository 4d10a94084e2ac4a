//! Which media a path is in: bodies of glass in bodies of water.
//!
//! A body with a volume is entered by its front and left by its back. Bodies may be nested or overlap (a drink that
//! reaches into the wall of its glass): what fills a point is the body entered last, and the others wait below it. So
//! the boundary of a body that lies inside another, later one is not there, and what surrounds a body decides how its
//! surface bends light. Two bodies of one material are one body. This is the stack of Schmidt and Budge (2002, "Simple
//! Nested Dielectrics in Ray Traced Images") with the order of entering in place of stated priorities.
//!
//! Files are not always closed where they should be: a pane that is one square is entered and never left. A body is
//! therefore forgotten where the path meets a volume outside the box that holds the body, and where it enters the same
//! one again.

use super::accel::Aabb;
use super::bsdf::{Medium, Surroundings};
use crate::numeric::gamma;
use crate::scene::{MaterialId, Scene, Stage};
use glam::Vec3A;

/// Bodies that a path can be in at once; the one entered first is forgotten for one more.
const MOST: usize = 4;

/// From where a path meets a body's surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Face {
    /// From outside.
    Front,
    /// From inside.
    Back,
}

/// A body that the path is in.
#[derive(Debug, Clone, Copy)]
struct Body {
    instance: u32,
    material: MaterialId,
    medium: Medium,
}

/// The bodies that a path is in, in the order in which it entered them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Media {
    bodies: [Option<Body>; MOST],
    count: usize,
}

impl Media {
    /// What the path goes through; `None` is air.
    pub(super) fn current(&self) -> Option<&Medium> {
        self.top().map(|b| &b.medium)
    }

    fn top(&self) -> Option<&Body> {
        self.count.checked_sub(1).and_then(|i| self.bodies[i].as_ref())
    }

    fn entered(&self) -> impl DoubleEndedIterator<Item = (usize, &Body)> {
        self.bodies[..self.count].iter().enumerate().filter_map(|(i, b)| b.as_ref().map(|b| (i, b)))
    }

    fn remove(&mut self, at: usize) {
        self.bodies.copy_within(at + 1..self.count, at);
        self.count -= 1;
    }

    fn place_of(&self, instance: u32) -> Option<usize> {
        self.entered().find(|(_, b)| b.instance == instance).map(|(i, _)| i)
    }

    /// The body that is left by the back of `instance`: that, or the last of its `material` where a body has several parts.
    fn left(&self, instance: u32, material: MaterialId) -> Option<usize> {
        let alike = || self.entered().rev().find(|(_, b)| b.material == material).map(|(i, _)| i);
        self.place_of(instance).or_else(alike)
    }

    /// Drops the bodies that cannot hold `position`, where the path meets the boundary of a volume.
    pub(super) fn forget_beyond(&mut self, boxes: &Boxes, position: Vec3A) {
        for i in (0..self.count).rev() {
            if self.bodies[i].is_some_and(|b| !boxes.may_hold(b.instance, position)) {
                self.remove(i);
            }
        }
    }

    /// What lies on the other side of the boundary of `instance` from its `material`, for a path that meets it from `side`.
    pub(super) fn beyond(&self, instance: u32, material: MaterialId, side: Face) -> Surroundings {
        let around = |b: Option<&Body>| match b {
            None => Surroundings::Air,
            Some(b) if b.material == material => Surroundings::Same,
            Some(b) => Surroundings::Body(b.material, b.medium.ior),
        };
        if side == Face::Front {
            return around(self.top());
        }
        match self.left(instance, material) {
            // The path began inside.
            None => around(self.top()),
            Some(i) if i + 1 == self.count => around(self.entered().rev().nth(1).map(|(_, b)| b)),
            // A later body fills the place on both sides.
            Some(_) => Surroundings::Same,
        }
    }

    /// The path goes into `instance`.
    pub(super) fn enter(&mut self, instance: u32, material: MaterialId, medium: Medium) {
        if let Some(i) = self.place_of(instance) {
            self.remove(i);
        }
        if self.count == MOST {
            self.remove(0);
        }
        self.bodies[self.count] = Some(Body { instance, material, medium });
        self.count += 1;
    }

    /// The path goes out of `instance`, of `material`.
    pub(super) fn leave(&mut self, instance: u32, material: MaterialId) {
        if let Some(i) = self.left(instance, material) {
            self.remove(i);
        }
    }
}

/// Boxes around the bodies with a volume over the whole exposure.
#[derive(Debug, Default)]
pub(super) struct Boxes(Vec<Aabb>);

impl Boxes {
    /// By instance; empty for those without a volume, and for all where there is but one body: it has nothing around
    /// it.
    pub(super) fn new(scene: &Scene, stage: &Stage) -> Self {
        let is_body = |i: &crate::scene::Instance| {
            let mesh = &scene.meshes[stage.geometries[i.geometry].mesh];
            scene.materials[mesh.material].transmission.is_some_and(|t| t.volume.is_some())
        };
        if stage.instances.iter().filter(|i| is_body(i)).count() < 2 {
            return Self::default();
        }
        let of = |i: &crate::scene::Instance| {
            if !is_body(i) {
                return Aabb::EMPTY;
            }
            let geometry = &stage.geometries[i.geometry];
            let rest = &scene.meshes[geometry.mesh].positions;
            let poses = geometry.keys.iter().map(|k| &k.positions).chain(geometry.keys.is_empty().then_some(rest));
            let around = |p: &Vec<glam::Vec3>| Aabb::around(p.iter().map(|&v| v.into()));
            let local = poses.map(around).fold(Aabb::EMPTY, |a, b| a.join(&b));
            i.motion.keys().iter().fold(Aabb::EMPTY, |a, m| a.join(&local.transformed(m)))
        };
        // A point on the body errs by γ₁₆ of its magnitude at most (see `surface::located`); sixteen times that costs
        // nothing.
        Self(stage.instances.iter().map(of).map(|b| b.widened(Vec3A::splat(b.magnitude() * gamma(256)))).collect())
    }

    fn may_hold(&self, instance: u32, p: Vec3A) -> bool {
        self.0.get(instance as usize).is_none_or(|b| b.lo.cmple(p).all() && b.hi.cmpge(p).all())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Material and instance of either body.
    const WATER: MaterialId = 0;
    const GLASS: MaterialId = 1;
    const POOL: u32 = 10;
    const TUMBLER: u32 = 11;

    fn medium(ior: f32) -> Medium {
        Medium { ior, absorption: Vec3::ZERO }
    }

    #[test]
    fn a_ball_in_water_is_surrounded_by_water_and_leaves_it_behind() {
        let mut media = Media::default();
        assert_eq!(media.beyond(POOL, WATER, Face::Front), Surroundings::Air);
        media.enter(POOL, WATER, medium(1.33));
        assert_eq!(media.beyond(TUMBLER, GLASS, Face::Front), Surroundings::Body(WATER, 1.33));
        media.enter(TUMBLER, GLASS, medium(1.5));
        assert_eq!(media.beyond(TUMBLER, GLASS, Face::Back), Surroundings::Body(WATER, 1.33));
        media.leave(TUMBLER, GLASS);
        assert_eq!(media.current(), Some(&medium(1.33)));
        assert_eq!(media.beyond(POOL, WATER, Face::Back), Surroundings::Air);
        media.leave(POOL, WATER);
        assert_eq!(media.current(), None);
    }

    /// A drink that reaches into the wall of its glass, from without and from within: two boundaries bend, the drink's
    /// or the wall's, and never both.
    #[test]
    fn a_drink_may_reach_into_the_wall_of_its_glass() {
        let mut media = Media::default();
        media.enter(TUMBLER, GLASS, medium(1.5));
        assert_eq!(media.beyond(POOL, WATER, Face::Front), Surroundings::Body(GLASS, 1.5));
        media.enter(POOL, WATER, medium(1.33));
        assert_eq!(media.beyond(TUMBLER, GLASS, Face::Back), Surroundings::Same);
        media.leave(TUMBLER, GLASS);
        assert_eq!(media.current(), Some(&medium(1.33)));
        assert_eq!(media.beyond(TUMBLER, GLASS, Face::Front), Surroundings::Body(WATER, 1.33));
        media.enter(TUMBLER, GLASS, medium(1.5));
        assert_eq!(media.beyond(POOL, WATER, Face::Back), Surroundings::Same);
        media.leave(POOL, WATER);
        assert_eq!(media.beyond(TUMBLER, GLASS, Face::Back), Surroundings::Air);
    }

    #[test]
    fn a_path_that_began_inside_leaves_into_air() {
        let mut media = Media::default();
        assert_eq!(media.beyond(POOL, WATER, Face::Back), Surroundings::Air);
        media.leave(POOL, WATER);
        assert_eq!(media.current(), None);
    }

    /// One square of glass after another: each is entered from air, and the stack does not grow.
    #[test]
    fn panes_that_are_never_left_are_forgotten() {
        let at = |z: f32| Aabb { lo: Vec3A::new(-1.0, -1.0, z), hi: Vec3A::new(1.0, 1.0, z) };
        let boxes = Boxes((0..8_u16).map(|i| at(f32::from(i))).collect());
        let mut media = Media::default();
        for i in 0..8_u16 {
            media.forget_beyond(&boxes, Vec3A::new(0.0, 0.0, f32::from(i)));
            assert_eq!(media.beyond(u32::from(i), GLASS, Face::Front), Surroundings::Air);
            media.enter(u32::from(i), GLASS, medium(1.5));
        }
        assert_eq!(media.count, 1);
        // The same pane again.
        media.enter(7, GLASS, medium(1.5));
        assert_eq!(media.count, 1);
    }

    #[test]
    fn the_first_of_too_many_bodies_is_forgotten() {
        let mut media = Media::default();
        for i in 0..7_u16 {
            media.enter(u32::from(i), usize::from(i), medium(1.0 + f32::from(i)));
        }
        assert_eq!(media.count, MOST);
        assert_eq!(media.current(), Some(&medium(7.0)));
        media.leave(0, 0);
        assert_eq!(media.count, MOST);
    }
}
