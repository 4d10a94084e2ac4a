//! Which triangle a ray meets, and when: the structures of one exposure and their traversal.
//!
//! In: a [`Scene`] and the [`Stage`] of an exposure. Out: the nearest hit, or whether there is one, for rays at any time
//! in [0, 1] of the exposure. Two levels: what never moves is one tree of triangles in the world; everything else is a
//! tree of its own under a tree of places. Still and moving trees share their code and differ in whether bounds and
//! corners are interpolated at the ray's time; a stage in which nothing moves runs none of the code for time.
//!
//! Hits do not depend on the shape of the trees, the order of traversal or the processor: the triangle test decides alone
//! (`block`), boxes only spare it work and are conservative for it (`frame`), and equal distances go to the first
//! instance and triangle.

mod block;
mod body;
mod choice;
mod collapse;
mod frame;
mod guard;
mod isa;
mod linear;
mod memory;
mod node;
mod occlusion;
mod resolve;
mod spatial;
mod sweep;
#[cfg(test)]
mod tests;
mod top;
mod topology;
mod tree;
mod walk;
mod world;

pub use linear::Aabb;
pub(in crate::trace) use linear::absolute;

use crate::scene::{Geometry, Instance, Material, MeshId, Motion, NodeId, Scene, Stage};
use crate::trace::{Backs, Hit, Ray};
use body::{Body, Form, Vertices};
use glam::Affine3A;
use rayon::prelude::*;
use std::cell::Cell;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;
use top::{Place, Pose, Structures, Top};
use walk::{Found, Query, WORLD, Waiting};
use world::{PartKey, World};

/// What a build made, and what it cost.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stats {
    /// Bytes of all structures, shared ones once.
    pub bytes: usize,
    /// Triangles stored in structures that stand still.
    pub still_triangles: usize,
    /// Triangles stored in deforming structures.
    pub moving_triangles: usize,
    /// Instances that are not part of the world's structure.
    pub places: usize,
    /// Slabs of time of the top level.
    pub slabs: usize,
    /// Structures taken over from the previous frame.
    pub reused: usize,
    /// Structures refitted or built.
    pub built: usize,
    /// Seconds that the build took.
    pub seconds: f64,
}

/// What identifies a structure from frame to frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum BodyKey {
    /// A mesh at rest.
    Rest(MeshId),
    /// A mesh deformed or baked for the instance of a node, the n-th there.
    Own(MeshId, NodeId, usize),
}

type Bodies = HashMap<BodyKey, Arc<Body>>;

/// In which space an instance's triangles are intersected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Route {
    /// The world's: vertices are placed there once, key by key.
    Baked,
    /// The geometry's own, which rays are transformed to.
    Posed,
    /// The geometry's own, which is the world's.
    Same,
}

/// The structures of one exposure.
#[derive(Debug)]
pub struct Accel {
    structures: Structures,
    /// The stage's instance of each part of the world's structure.
    world_instances: Vec<u32>,
    /// Of each of the stage's instances.
    routes: Vec<Route>,
    /// By the scene's materials: whether they read textures.
    textured: Vec<bool>,
    bodies: Bodies,
    /// Most entries that a walk leaves waiting.
    waiting: usize,
    stats: Stats,
    kernel: Kernel,
}

/// Which compilation of the traversal runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kernel {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Kernel {
    fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if isa::Avx2::is_present() {
            return Self::Avx2;
        }
        Self::Portable
    }
}

/// [`top::search`] for any processor. Apart, so that its callers stay small where another is called.
#[inline(never)]
fn search_portable<const ANY: bool>(all: &Structures, ray: &Ray, query: &mut Query<'_>, stack: &Waiting) {
    top::search::<isa::Portable, ANY>(all, ray, query, stack);
}

/// [`top::search`] compiled for processors with AVX2.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn search_avx2<const ANY: bool>(all: &Structures, ray: &Ray, query: &mut Query<'_>, stack: &Waiting) {
    top::search::<isa::Avx2, ANY>(all, ray, query, stack);
}

/// Entries that a thread has room for; what is deeper gets room of its own for each ray.
const ROOM: usize = 1024;

thread_local! {
    /// What the walks of one thread leave waiting. (An array on the machine's own stack would have to be cleared for each
    /// ray, and one that grows has to be asked each time whether it is borrowed and whether it is still there.)
    static WAITING: [Cell<u64>; ROOM] = const { [const { Cell::new(0) }; ROOM] };
}

impl Accel {
    /// Builds the structures for `stage`. What `previous` (of the same scene) already holds is shared: structures of
    /// meshes at rest, the world's if its members are the same; deforming ones are refitted while that serves.
    ///
    /// The result is the same for any number of threads, with one exception that no hit can show: a refitted tree has
    /// another shape than a new one.
    ///
    /// # Panics
    /// If the stage holds more than 2²⁹ triangles in one structure.
    #[must_use]
    pub fn build(scene: &Scene, stage: &Stage, previous: Option<&Self>) -> Self {
        let started = Instant::now();
        let mut uses = vec![0_usize; stage.geometries.len()];
        for i in &stage.instances {
            uses[i.geometry] += 1;
        }
        let (mut members, mut others) = (Vec::new(), Vec::new());
        for (number, instance) in (0_u32..).zip(&stage.instances) {
            let geometry = &stage.geometries[instance.geometry];
            let mesh = &scene.meshes[geometry.mesh];
            assert!(mesh.triangles.len() < block::tag::INDEX as usize, "a mesh has fewer than 2^29 triangles");
            let list = if world::belongs(instance, geometry, mesh, uses[instance.geometry]) {
                &mut members
            } else {
                &mut others
            };
            list.push((number, instance, geometry));
        }
        let mut stats = Stats::default();
        let (world, world_instances) = build_world(scene, &members, previous, &mut stats);
        let (places, bodies) = build_places(scene, &others, previous, &mut stats);
        let mut routes = vec![Route::Baked; stage.instances.len()];
        for (place, baked) in &places {
            routes[place.instance as usize] = match (&place.pose, baked) {
                (_, true) => Route::Baked,
                (Pose::World, false) => Route::Same,
                _ => Route::Posed,
            };
        }
        let structures = Structures::new(world, places.into_iter().map(|(place, _)| place).collect());
        let kernel = Kernel::detect();
        let textured = scene.materials.iter().map(Material::is_textured).collect();
        let mut accel = Self { structures, world_instances, routes, textured, bodies, waiting: 0, stats, kernel };
        accel.summarize();
        accel.stats.seconds = started.elapsed().as_secs_f64();
        accel
    }

    /// Fills in what follows from the structures.
    fn summarize(&mut self) {
        let Structures { world, places, top, .. } = &self.structures;
        let below = self.bodies.values().map(|b| b.stack()).chain(world.iter().map(|w| w.tree.nodes.stack)).max();
        self.waiting = top.stack() + below.unwrap_or(0);
        let stats = &mut self.stats;
        stats.places = places.len();
        stats.slabs = if let Top::Moving(slabs) = top { slabs.len() } else { 0 };
        stats.bytes = top.bytes();
        if let Some(world) = world {
            stats.bytes += world.tree.bytes();
            stats.still_triangles += world.triangles;
        }
        for body in self.bodies.values() {
            stats.bytes += body.bytes();
            match body.form {
                Form::Still(_) => stats.still_triangles += body.triangles,
                Form::Moving(_) => stats.moving_triangles += body.triangles,
            }
        }
    }

    /// The nearest hit with 0 < t ≤ `ray.t_max`; at equal t that of the first instance and triangle.
    ///
    /// `accept` decides about hits of surfaces with alpha (mask or blend); it must depend on the hit alone and trace no ray
    /// itself, whose walk would use the same room. What happens at the back of a single-sided surface is the ray's choice
    /// ([`Ray::backs`]).
    #[must_use]
    pub fn closest(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> Option<Hit> {
        self.run::<false>(ray, &|found| accept(&self.hit(found))).map(|found| self.hit(&found))
    }

    /// Whether anything accepted lies at 0 < t ≤ `ray.t_max`.
    #[must_use]
    pub fn occluded(&self, ray: &Ray, accept: impl Fn(&Hit) -> bool) -> bool {
        self.run::<true>(ray, &|found| accept(&self.hit(found))).is_some()
    }

    #[inline]
    fn run<const ANY: bool>(&self, ray: &Ray, accept: &dyn Fn(&Found) -> bool) -> Option<Found> {
        if self.waiting > ROOM {
            return self.run_on::<ANY>(ray, accept, &vec![Cell::new(0); self.waiting]);
        }
        WAITING.with(|waiting| self.run_on::<ANY>(ray, accept, waiting))
    }

    /// The nearest hit, or any, with `waiting` as the room for what waits.
    #[inline]
    #[allow(unsafe_code, reason = "the only way to call code compiled for a processor feature found at run time")]
    fn run_on<const ANY: bool>(&self, ray: &Ray, accept: &dyn Fn(&Found) -> bool, waiting: &Waiting) -> Option<Found> {
        let precedes = |a: &Found, b: &Found| {
            let (a, b) = (self.hit(a), self.hit(b));
            (a.instance, a.triangle) < (b.instance, b.triangle)
        };
        let skips = match ray.backs {
            Backs::Pass => block::tag::SKIP_FRONT | block::tag::SKIP_BACK,
            Backs::Stop => 0,
        };
        let mut query = Query { limit: ray.t_max, found: None, skips, accept, precedes: &precedes };
        match self.kernel {
            Kernel::Portable => search_portable::<ANY>(&self.structures, ray, &mut query, waiting),
            #[cfg(target_arch = "x86_64")]
            Kernel::Avx2 => {
                debug_assert!(isa::Avx2::is_present());
                // SAFETY: `Kernel::Avx2` is only made by `Kernel::detect`, after the processor was asked.
                unsafe { search_avx2::<ANY>(&self.structures, ray, &mut query, waiting) }
            }
        }
        query.found
    }

    /// The hit by the stage's names.
    fn hit(&self, found: &Found) -> Hit {
        let (instance, triangle) = if found.space == WORLD {
            let (part, triangle) = self.structures.world.as_ref().map_or((0, 0), |w| w.locate(found.index));
            (self.world_instances[part], triangle)
        } else {
            (self.structures.places[found.space as usize].instance, found.index)
        };
        Hit { t: found.candidate.t, u: found.candidate.u, v: found.candidate.v, instance, triangle }
    }

    /// Bounds of everything over the whole exposure; empty where there is nothing.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.structures.bounds
    }

    /// What the build made and cost.
    #[must_use]
    pub fn stats(&self) -> Stats {
        self.stats
    }
}

type Member<'a> = (u32, &'a Instance, &'a Geometry);

fn build_world(
    scene: &Scene,
    members: &[Member<'_>],
    previous: Option<&Accel>,
    stats: &mut Stats,
) -> (Option<Arc<World>>, Vec<u32>) {
    let keys = || members.iter().map(|(_, i, g)| PartKey::of(i, g));
    let instances = members.iter().map(|m| m.0).collect();
    if let Some(old) = previous.and_then(|p| p.structures.world.as_ref())
        && old.parts.iter().copied().eq(keys())
    {
        stats.reused += 1;
        return (Some(Arc::clone(old)), instances);
    }
    let members: Vec<_> = members.iter().map(|(_, i, g)| (*i, *g)).collect();
    let world = World::build(scene, &members).map(Arc::new);
    stats.built += usize::from(world.is_some());
    (world, instances)
}

/// How an instance outside the world's structure is stored.
struct Plan<'a> {
    key: BodyKey,
    /// Baked: vertices are placed in the world.
    baked: bool,
    instance: &'a Instance,
    geometry: &'a Geometry,
    number: u32,
}

fn plans<'a>(others: &[Member<'a>]) -> Vec<Plan<'a>> {
    let mut owned: HashMap<usize, BodyKey> = HashMap::new();
    let mut copies: HashMap<(MeshId, NodeId), usize> = HashMap::new();
    let mut own = |mesh: MeshId, node: NodeId| {
        let count = copies.entry((mesh, node)).or_default();
        *count += 1;
        BodyKey::Own(mesh, node, *count)
    };
    let plan = |&(number, instance, geometry): &Member<'a>| {
        let linear = instance.motion.is_still() || geometry.keys.len() <= 1;
        // A matrix that cannot be inverted flattens the geometry: it is intersected where it stands.
        let baked = linear && instance.motion.keys().iter().any(world::is_singular);
        let key = if baked {
            own(geometry.mesh, instance.node)
        } else if geometry.keys.is_empty() {
            BodyKey::Rest(geometry.mesh)
        } else {
            *owned.entry(instance.geometry).or_insert_with(|| own(geometry.mesh, instance.node))
        };
        Plan { key, baked, instance, geometry, number }
    };
    others.iter().map(plan).collect()
}

/// The places of `others` (whether each is baked) and the structures that they share.
fn build_places(
    scene: &Scene,
    others: &[Member<'_>],
    previous: Option<&Accel>,
    stats: &mut Stats,
) -> (Vec<(Place, bool)>, Bodies) {
    let plans = plans(others);
    let mut wanted: Vec<&Plan<'_>> = Vec::new();
    let mut seen = std::collections::HashSet::new();
    for plan in &plans {
        if seen.insert(plan.key) {
            wanted.push(plan);
        }
    }
    let made: Vec<(BodyKey, Arc<Body>, bool)> = wanted
        .par_iter()
        .map(|plan| {
            let old = previous.and_then(|p| p.bodies.get(&plan.key));
            if let (Some(old), BodyKey::Rest(_)) = (old, plan.key) {
                return (plan.key, Arc::clone(old), true);
            }
            let mesh = &scene.meshes[plan.geometry.mesh];
            let motion = &plan.instance.motion;
            let vertices = Vertices::of(mesh, plan.geometry);
            let vertices = if plan.baked { vertices.placed(motion) } else { vertices };
            let mirrored = plan.baked && motion.keys()[0].matrix3.determinant() < 0.0;
            let tags = body::tags(scene, mesh, mirrored);
            (plan.key, Arc::new(Body::build(mesh, tags, &vertices, old.map(|b| &**b))), false)
        })
        .collect();
    stats.reused += made.iter().filter(|m| m.2).count();
    stats.built += made.iter().filter(|m| !m.2).count();
    let bodies: Bodies = made.into_iter().map(|(key, body, _)| (key, body)).collect();
    let place = |plan: &Plan<'_>| {
        let motion = &plan.instance.motion;
        let pose = match (plan.baked, motion.is_still()) {
            (true, _) => Pose::World,
            (false, true) => still_pose(motion),
            (false, false) => Pose::Moving(motion.clone()),
        };
        let (body, presence) = (Arc::clone(&bodies[&plan.key]), motion.presence().clone());
        (Place { body, pose, presence, instance: plan.number }, plan.baked)
    };
    (plans.iter().map(place).collect(), bodies)
}

fn still_pose(motion: &Motion) -> Pose {
    let transform = motion.keys()[0];
    if transform == Affine3A::IDENTITY {
        return Pose::World;
    }
    Pose::Still { inverse: transform.inverse(), motion: motion.clone() }
}
