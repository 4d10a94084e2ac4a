//! Light sampling: which light, and which point on it.
//!
//! One pair of coordinates does both: the choice rescales it. Emissive triangles, spheres and many point lights hang
//! in a [tree](Lights) whose choice adapts to the receiving point and instant; the environment and suns stand beside
//! it. A few lights without extent are not chosen at all but visited each ([`Lights::visited`]), which draws no
//! number. Everything is evaluated at the ray's own instant.

mod emitters;
mod punctual;
mod rectangle;
mod seen;
mod spheres;
mod tree;
mod triangle;

use super::bsdf::{Bsdf, Materials};
use super::environment::{Environment, Sides};
use super::surface::SurfacePoint;
use super::texture::Footprint;
use super::warp::{Side, split};
use crate::effects::MOST_LIGHTS_VISITED;
use crate::factor::compiled;
use crate::numeric::{gamma, mix64, unit_from_bits};
use crate::scene::{Scene, Stage};
use emitters::{Emitters, attributes_at};
use glam::{Vec2, Vec3, Vec3A};
use punctual::{Lamp, Nature};
use seen::SeenShape;
use spheres::Spheres;
use tree::{Receiver, Root, Tree};

/// Where light is received.
#[derive(Debug, Clone, Copy)]
pub struct LightQuery {
    /// The receiving point, world space.
    pub position: Vec3A,
    /// Unit normal of the true surface on the viewer's side.
    pub normal: Vec3A,
    /// On which sides light can act.
    pub sides: Sides,
    /// The ray's instant within the stage's interval, [0, 1].
    pub u_time: f32,
}

impl LightQuery {
    /// For a shaded point.
    #[must_use]
    pub fn new(point: &SurfacePoint, bsdf: &Bsdf, u_time: f32) -> Self {
        let sides = if bsdf.transmits() { Sides::Both } else { Sides::Above };
        Self { position: point.position, normal: bsdf.geometric_normal(), sides, u_time }
    }

    fn receiver(&self) -> Receiver {
        Receiver { position: self.position, normal: self.normal, sides: self.sides, u_time: self.u_time }
    }
}

/// The choice of lights at one receiving point.
#[derive(Debug, Clone, Copy)]
pub struct LightChoice<'a> {
    query: LightQuery,
    root: Root,
    shares: Shares,
    /// The emitter that was drawn last, as the point sees it: likely the next one too.
    last: Option<(usize, SeenShape<'a>)>,
}

/// Light that may arrive, were nothing in the way.
#[derive(Debug, Clone, Copy)]
pub struct LightSample {
    /// Where it comes from, unit.
    pub wi: Vec3A,
    /// How far the way along `wi` from the receiving point must be free: short of the light's own surface by the rounding
    /// of its place; infinite for the sky.
    pub distance: f32,
    /// Radiance; for lights without extent the irradiance on a surface that faces them.
    pub radiance: Vec3,
    /// Density of `wi` by solid angle, the choice of the light included; for lights without extent that choice's
    /// probability alone. Divide by it.
    pub pdf_solid_angle: f32,
    /// Whether nothing else than light sampling can find it: no multiple importance sampling.
    pub is_delta: bool,
    /// Instance and triangle of an emissive surface.
    pub emitter: Option<(u32, u32)>,
}

/// How many lights of each kind there are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LightKinds {
    /// Emissive triangles.
    pub triangles: usize,
    /// Instances of them that move.
    pub moving_emitters: usize,
    /// Sphere lights.
    pub spheres: usize,
    /// Directional lights with an angle.
    pub discs: usize,
    /// Lights without extent.
    pub deltas: usize,
    /// Whether light comes from all around.
    pub environment: bool,
}

/// All lights of a stage, prepared for sampling.
#[derive(Debug)]
pub struct Lights<'a> {
    scene: &'a Scene,
    stage: &'a Stage,
    materials: &'a Materials,
    environment: &'a Environment,
    /// The stage's lights, in its order.
    lamps: Vec<Lamp<'a>>,
    emitters: Emitters,
    /// Stage lights in the tree, after the emitters.
    near: Vec<usize>,
    tree: Tree,
    /// Stage lights from infinitely far that are chosen, not visited.
    suns: Vec<usize>,
    visited: Vec<usize>,
    /// Spheres as rays see them; each is numbered as in `near`.
    spheres: Spheres,
    /// Discs of the sky that a ray can see.
    discs: Vec<usize>,
    kinds: LightKinds,
}

impl<'a> Lights<'a> {
    /// Collects the stage's lights and builds their tree.
    #[must_use]
    pub fn build(scene: &'a Scene, stage: &'a Stage, materials: &'a Materials, environment: &'a Environment) -> Self {
        let emitters = Emitters::new(scene, stage, materials);
        let lamps: Vec<Lamp<'a>> = stage.lights.iter().map(Lamp::new).collect();
        let shines = |i: &usize| stage.lights[*i].light.intensity.max_element() > 0.0;
        let of = |wanted: &[Nature]| -> Vec<usize> {
            (0..lamps.len()).filter(|i| wanted.contains(&lamps[*i].nature()) && shines(i)).collect()
        };
        let deltas = of(&[Nature::Point, Nature::Direction]);
        let few = deltas.len() <= MOST_LIGHTS_VISITED;
        // Spheres first, so that their number among the spheres is that among the near lights.
        let mut near = of(&[Nature::Sphere]);
        if !few {
            near.extend(of(&[Nature::Point]));
        }
        let suns = if few { of(&[Nature::Disc]) } else { of(&[Nature::Disc, Nature::Direction]) };
        let mut extents = emitters.extents.clone();
        extents.extend(near.iter().map(|&i| lamps[i].extent()));
        let kinds = LightKinds {
            triangles: emitters.list.len(),
            moving_emitters: emitters.moving_instances,
            spheres: of(&[Nature::Sphere]).len(),
            discs: of(&[Nature::Disc]).len(),
            deltas: deltas.len(),
            environment: !environment.is_black(),
        };
        Self {
            scene,
            stage,
            materials,
            environment,
            tree: Tree::new(&extents),
            emitters,
            near,
            suns,
            visited: if few { deltas } else { Vec::new() },
            spheres: Spheres::new(&lamps, &of(&[Nature::Sphere])),
            discs: of(&[Nature::Disc]),
            lamps,
            kinds,
        }
    }

    /// How many lights of each kind there are.
    #[must_use]
    pub fn kinds(&self) -> LightKinds {
        self.kinds
    }

    /// Whether [`Lights::sample`] has anything to choose from; otherwise its coordinates need not be drawn.
    #[must_use]
    pub fn needs_sampling(&self) -> bool {
        compiled::LIGHT
            && (!self.environment.is_black()
                || !self.suns.is_empty()
                || !self.emitters.list.is_empty()
                || !self.near.is_empty())
    }

    /// How many lights are visited each at every vertex: see [`Lights::visit`].
    #[must_use]
    pub fn visited(&self) -> usize {
        self.visited.len()
    }

    /// The `i`-th visited light at `q`: a light without extent, with probability 1. `None` where it gives nothing.
    #[must_use]
    pub fn visit(&self, i: usize, q: &LightQuery) -> Option<LightSample> {
        self.punctual_sample(self.visited[i], q, 1.0, Vec2::splat(0.5))
    }

    /// The choice of lights at `q`, to draw from as often as need be. `None` where none can reach it.
    #[must_use]
    pub fn choice(&self, q: &LightQuery) -> Option<LightChoice<'_>> {
        let root = self.tree.root(q.receiver());
        Some(LightChoice { query: *q, root, shares: self.shares(q, || root)?, last: None })
    }

    /// Chooses a light and a point on it.
    #[must_use]
    pub fn sample<'s>(&'s self, choice: &mut LightChoice<'s>, u: Vec2) -> Option<LightSample> {
        let LightChoice { query: q, root, shares, last } = choice;
        let (group, x) = split(u.x, shares.tree);
        let mut u = Vec2::new(x, u.y);
        if group == Side::First {
            let (light, chance, u) = self.tree.choose(root, u)?;
            let chance = chance * shares.tree;
            return match light.checked_sub(self.emitters.list.len()) {
                Some(i) => self.punctual_sample(self.near[i], q, chance, u),
                None => self.emitter_sample(light, q, last, chance, u),
            };
        }
        let (group, x) = split(u.x, (shares.environment / (1.0 - shares.tree)).min(1.0));
        u.x = x;
        if group == Side::First {
            return self.environment.sample(q.normal, q.sides, u).map(|s| LightSample {
                wi: s.wi,
                distance: f32::INFINITY,
                radiance: s.radiance,
                pdf_solid_angle: s.pdf_solid_angle * shares.environment,
                is_delta: false,
                emitter: None,
            });
        }
        let mut left = shares.suns;
        for &sun in &self.suns {
            let chance = shares.of_sun(self.sun_irradiance(sun, q));
            let (side, x) = split(u.x, if left > chance { chance / left } else { 1.0 });
            u.x = x;
            if side == Side::First && chance > 0.0 {
                return self.punctual_sample(sun, q, chance, u);
            }
            left -= chance;
        }
        None
    }

    fn sun_irradiance(&self, sun: usize, q: &LightQuery) -> f32 {
        self.lamps[sun].far_irradiance(q.normal, q.sides == Sides::Both, q.u_time).min(MOST_ESTIMATE)
    }

    fn punctual_sample(&self, i: usize, q: &LightQuery, chance: f32, u: Vec2) -> Option<LightSample> {
        let lamp = &self.lamps[i];
        let a = lamp.sample(q.position, q.u_time, u)?;
        Some(LightSample {
            wi: a.wi,
            distance: shortened(a.distance, q.position),
            radiance: a.light,
            pdf_solid_angle: a.pdf_solid_angle * chance,
            is_delta: matches!(lamp.nature(), Nature::Point | Nature::Direction),
            emitter: None,
        })
    }

    fn emitter_sample<'s>(
        &'s self,
        number: usize,
        q: &LightQuery,
        last: &mut Option<(usize, SeenShape<'s>)>,
        chance: f32,
        u: Vec2,
    ) -> Option<LightSample> {
        let emitter = &self.emitters.list[number];
        let seen = match last {
            Some((same, seen)) if *same == number => seen,
            _ => &mut last.insert((number, self.seen_emitter(number, q)?)).1,
        };
        let s = seen.sample(u)?;
        let radiance = emitter.plain.unwrap_or_else(|| self.textured_emission(number, s.place, unrelated(u)));
        (radiance != Vec3::ZERO).then(|| LightSample {
            wi: s.wi,
            distance: shortened(s.distance, q.position),
            radiance,
            pdf_solid_angle: s.pdf_solid_angle * chance,
            is_delta: false,
            emitter: Some((emitter.instance, self.emitters.triangle_of(number, s.place))),
        })
    }

    /// Emitter `number` as `q` sees it; `None` where it shows nothing bright.
    fn seen_emitter(&self, number: usize, q: &LightQuery) -> Option<SeenShape<'_>> {
        let emitter = &self.emitters.list[number];
        if !self.stage.instances[emitter.instance as usize].motion.presence().holds(q.u_time) {
            return None;
        }
        let seen = SeenShape::new(self.emitters.shape(self.scene, self.stage, number, q.u_time), q.position)?;
        (emitter.double_sided || seen.facing() > 0.0).then_some(seen)
    }

    /// What emitter `number` emits at `barycentric` weights of its own.
    fn textured_emission(&self, number: usize, barycentric: Vec2, u: f32) -> Vec3 {
        let emitter = &self.emitters.list[number];
        let mesh =
            &self.scene.meshes[self.stage.geometries[self.stage.instances[emitter.instance as usize].geometry].mesh];
        let b = self.emitters.whole_barycentric(number, barycentric);
        let (uvs, alpha) = attributes_at(mesh, emitter.triangle, b);
        let footprint = Footprint::point(u);
        self.materials.emission(self.scene, mesh.material, &uvs, footprint)
            * self.materials.alpha(self.scene, mesh.material, &uvs, alpha, footprint)
    }

    /// Density by solid angle with which [`Lights::sample`] would have drawn `wi` towards the emissive triangle that
    /// a ray from `q.position` met at `distance` with barycentric weights `barycentric` (of the second and third
    /// vertex). 0 for triangles that do not emit.
    #[must_use]
    pub fn emitter_pdf(
        &self,
        q: &LightQuery,
        wi: Vec3A,
        distance: f32,
        (instance, triangle): (u32, u32),
        barycentric: Vec2,
    ) -> f32 {
        let Some(number) = self.emitters.find(instance, triangle, barycentric) else { return 0.0 };
        let r = q.receiver();
        let Some(shares) = self.shares(q, || self.tree.root(r)) else { return 0.0 };
        let chance = shares.tree * self.tree.chance(number, &r);
        if chance <= 0.0 {
            return 0.0;
        }
        let shape = self.emitters.shape(self.scene, self.stage, number, q.u_time);
        SeenShape::new(shape, q.position).map_or(0.0, |seen| chance * seen.pdf(wi, distance))
    }

    /// What a ray from `q.position` along `wi` sees beside surfaces before `t_max` (infinite for one that escapes):
    /// each light's radiance, with the density by solid angle with which [`Lights::sample`] would have found it.
    pub fn seen(&self, q: &LightQuery, wi: Vec3A, t_max: f32, mut each: impl FnMut(Vec3, f32)) {
        if !compiled::LIGHT {
            return;
        }
        let escaped = t_max == f32::INFINITY;
        let seen = |i: usize| self.lamps[i].seen(q.position, wi, q.u_time);
        let r = q.receiver();
        self.spheres.near(q.position, wi, t_max, q.u_time, |light, number| {
            if let Some((_, radiance, pdf)) = seen(light).filter(|s| s.0 <= t_max) {
                let share = self.shares(q, || self.tree.root(r)).map_or(0.0, |s| s.tree);
                each(radiance, pdf * share * self.tree.chance(self.emitters.list.len() + number, &r));
            }
        });
        if !escaped || (self.discs.is_empty() && self.environment.is_black()) {
            return;
        }
        let shares = self.shares(q, || self.tree.root(r));
        if !self.environment.is_black() {
            let share = shares.as_ref().map_or(0.0, |s| s.environment);
            each(self.environment.radiance(wi), share * self.environment.pdf(q.normal, q.sides, wi));
        }
        for &i in &self.discs {
            if let Some((_, radiance, pdf)) = seen(i) {
                each(radiance, pdf * shares.as_ref().map_or(0.0, |s| s.of_sun(self.sun_irradiance(i, q))));
            }
        }
    }

    /// Radiance of the environment alone along `wi`.
    #[must_use]
    pub fn environment(&self, wi: Vec3A) -> Vec3 {
        self.environment.radiance(wi)
    }

    /// Radiance from beyond all surfaces along `wi`: environment and the discs of suns, as mirrors and the camera see
    /// them.
    #[must_use]
    pub fn sky(&self, wi: Vec3A, u_time: f32) -> Vec3 {
        let mut sum = self.environment.radiance(wi);
        for &i in &self.discs {
            if let Some((_, radiance, _)) = self.lamps[i].seen(Vec3A::ZERO, wi, u_time) {
                sum += radiance;
            }
        }
        sum
    }

    /// Radiance of sphere lights that a mirror-like ray from `from` along `wi` passes before `t_max`.
    #[must_use]
    #[inline]
    pub fn spheres(&self, from: Vec3A, wi: Vec3A, t_max: f32, u_time: f32) -> Vec3 {
        if !compiled::LIGHT || self.spheres.is_empty() { Vec3::ZERO } else { self.passed(from, wi, t_max, u_time) }
    }

    fn passed(&self, from: Vec3A, wi: Vec3A, t_max: f32, u_time: f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        self.spheres.near(from, wi, t_max, u_time, |i, _| {
            if let Some((distance, radiance, _)) = self.lamps[i].seen(from, wi, u_time)
                && distance < t_max
            {
                sum += radiance;
            }
        });
        sum
    }

    /// With which probability each group is chosen at `q`; `None` where none can reach it.
    fn shares(&self, q: &LightQuery, root: impl Fn() -> Root) -> Option<Shares> {
        if self.suns.is_empty() && self.environment.is_black() {
            // Nothing to weigh the tree against: it finds out itself whether anything can arrive.
            return Some(Shares { tree: 1.0, environment: 0.0, suns: 0.0, sun_total: 0.0 });
        }
        let tree = self.tree.importance(&root()).min(MOST_ESTIMATE);
        let environment = self.environment.irradiance().min(MOST_ESTIMATE);
        let suns: f32 = self.suns.iter().map(|&sun| self.sun_irradiance(sun, q)).sum();
        let total = tree + environment + suns;
        if total <= 0.0 {
            return None;
        }
        // Estimates may err; each group that can contribute keeps a tenth of an even share.
        let groups = [tree, environment, suns].iter().filter(|&&x| x > 0.0).count();
        let share = |x: f32| if x > 0.0 { 0.9 * (x / total) + 0.1 / groups as f32 } else { 0.0 };
        let mut shares =
            Shares { tree: share(tree), environment: share(environment), suns: share(suns), sun_total: suns };
        if groups == 1 {
            // Exactly 1, not 0.9 + 0.1: the choice must not lose a rounding.
            let only = |x: f32| f32::from(u8::from(x > 0.0));
            (shares.tree, shares.environment, shares.suns) = (only(tree), only(environment), only(suns));
        }
        Some(shares)
    }
}

/// A coordinate that is fixed by `u` and yet tells nothing of the place that `u` chose: what draws a texel must not depend
/// on where in it the point lies.
#[allow(clippy::cast_possible_truncation, reason = "the upper half is what is wanted")]
fn unrelated(u: Vec2) -> f32 {
    unit_from_bits((mix64(u64::from(u.x.to_bits()) << 32 | u64::from(u.y.to_bits())) >> 32) as u32)
}

/// Estimates of irradiance are held below this, so that sums and ratios stay finite.
const MOST_ESTIMATE: f32 = 1e36;

/// Probabilities of the groups.
#[derive(Debug, Clone, Copy)]
struct Shares {
    tree: f32,
    environment: f32,
    suns: f32,
    /// Sum of the suns' estimates.
    sun_total: f32,
}

impl Shares {
    /// Probability of a sun of the given estimate.
    fn of_sun(&self, irradiance: f32) -> f32 {
        if self.sun_total > 0.0 { self.suns * (irradiance / self.sun_total) } else { 0.0 }
    }
}

/// A distance to a light, less what its place and the receiver's may err by, so that a shadow ray stops short of it.
fn shortened(distance: f32, from: Vec3A) -> f32 {
    if distance == f32::INFINITY {
        return distance;
    }
    // Corners pass a transform (γ₄ of their magnitude), an interpolation and a subtraction; magnitudes are at most
    // the receiver's plus the distance.
    let error = gamma(16) * (from.abs().max_element() + distance);
    (distance - error).max(0.0)
}

#[cfg(test)]
mod tests;
