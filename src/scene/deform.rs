//! Meshes that change shape: morph targets, then skins (glTF 2.0, §3.7.2.2 and §3.7.3.3).

use super::curve::Jet;
use super::limbs::Limbs;
use super::rig::{Rig, spectral_norm};
use super::schedule::{Clock, KeyInstant};
use super::stage::VertexKey;
use super::{Mesh, MeshId, NodeId, Skin, SkinBinding};
use crate::time::Exposure;
use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};

/// Whether anything can ever bend `mesh` at `node` out of its rest pose: a skin, or morph weights.
#[must_use]
pub fn deforms(rig: &Rig<'_>, mesh: MeshId, node: NodeId) -> bool {
    let (holder, mesh) = (&rig.scene().nodes[node], &rig.scene().meshes[mesh]);
    let weighted = rig.weights(node).is_some() || holder.weights.iter().any(|&w| w.abs() > 0.0);
    (mesh.skin.is_some() && holder.skin.is_some()) || (!mesh.targets.is_empty() && weighted)
}

/// What deforms one mesh at one node over one exposure.
#[derive(Debug, Clone)]
pub struct Deformer<'r, 'a> {
    rig: &'r Rig<'a>,
    mesh: &'a Mesh,
    node: NodeId,
    skin: Option<(&'a Skin, &'a SkinBinding)>,
    limbs: Limbs<'r, 'a>,
    /// Each joint's slot among the limbs.
    slots: Vec<usize>,
}

/// A ball around vertices, and their largest distance from the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Centre of the vertices' box.
    pub centre: DVec3,
    /// Largest distance of a vertex from it.
    pub radius: f64,
    /// Largest distance of a vertex from the origin; negative where there is none.
    pub from_origin: f64,
}

impl Reach {
    /// Around `points`.
    #[must_use]
    pub fn of(points: impl Iterator<Item = DVec3> + Clone) -> Self {
        let (low, high) =
            points.clone().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        if low.x > high.x {
            return Self { centre: DVec3::ZERO, radius: 0.0, from_origin: -1.0 };
        }
        let centre = (low + high) * 0.5;
        let furthest = |from: DVec3| points.clone().map(|p| p.distance_squared(from)).fold(0.0, f64::max).sqrt();
        Self { centre, radius: furthest(centre), from_origin: furthest(DVec3::ZERO) }
    }
}

/// How far a deforming mesh's vertices lie from what moves them.
#[derive(Debug, Clone)]
pub struct Reaches {
    /// Of the rest pose, in mesh space; or, where there is a skin, of each joint's vertices in the joint's space.
    bodies: Vec<Reach>,
    /// Largest displacement by each morph target at weight 1.
    targets: Vec<f64>,
}

impl<'r, 'a> Deformer<'r, 'a> {
    /// The deformer of `mesh` at `node` in `interval`, or `None` where the mesh keeps its rest pose for ever.
    #[must_use]
    pub fn new(rig: &'r Rig<'a>, mesh: MeshId, node: NodeId, interval: Exposure) -> Option<Self> {
        if !deforms(rig, mesh, node) {
            return None;
        }
        let scene = rig.scene();
        let (holder, mesh) = (&scene.nodes[node], &scene.meshes[mesh]);
        let skin = holder.skin.map(|s| &scene.skins[s]).zip(mesh.skin.as_ref());
        let joints: &[NodeId] = skin.map_or(&[], |(s, _)| &s.joints);
        let amounts = rig.joint_blurs(joints, node);
        let clocks = joints.iter().zip(amounts).map(|(&j, amount)| (j, Clock::new(interval, amount)));
        let (limbs, slots) = Limbs::new(rig, clocks);
        let limbs = limbs.with_weights(node, Clock::new(interval, rig.blur(node)));
        Some(Self { rig, mesh, node, skin, limbs, slots })
    }

    /// Whether its vertices land in world space whatever the node's own transform: skins do.
    #[must_use]
    pub fn lands_in_world(&self) -> bool {
        self.skin.is_some()
    }

    /// The joints' motion, with the morph weights.
    #[must_use]
    pub fn limbs(&self) -> &Limbs<'r, 'a> {
        &self.limbs
    }

    /// Whether no animation ever changes the shape.
    #[must_use]
    pub fn is_permanent(&self) -> bool {
        self.rig.weights(self.node).is_none()
            && self.skin.is_none_or(|(s, _)| s.joints.iter().all(|&j| !self.rig.is_carried(j)))
    }

    /// Weight of morph target `k` where nothing drives it.
    fn rest_weight(&self, k: usize) -> f64 {
        self.rig.scene().nodes[self.node].weights.get(k).copied().map_or(0.0, f64::from)
    }

    /// Measures the mesh: once an exposure.
    #[must_use]
    pub fn reaches(&self) -> Reaches {
        let targets = self.mesh.targets.iter().map(|t| Reach::of(t.positions.iter().map(|p| p.as_dvec3())));
        let bodies = match self.skin {
            None => vec![Reach::of(self.mesh.positions.iter().map(|p| p.as_dvec3()))],
            Some((skin, binding)) => {
                let mut of_joint = vec![Vec::new(); skin.joints.len()];
                for (v, p) in self.mesh.positions.iter().enumerate() {
                    for i in v * binding.influences..(v + 1) * binding.influences {
                        let j = usize::from(binding.joints[i]);
                        if binding.weights[i] > 0.0 && j < of_joint.len() {
                            of_joint[j].push(skin.inverse_bind[j].transform_point3(p.as_dvec3()));
                        }
                    }
                }
                of_joint.iter().map(|points| Reach::of(points.iter().copied())).collect()
            }
        };
        Reaches { bodies, targets: targets.map(|r| r.from_origin.max(0.0)).collect() }
    }

    /// Bounds of the displacement by all morph targets over a stretch, per unit of u.
    fn morph_jet(&self, reaches: &Reaches, piece: (f64, f64)) -> Jet {
        reaches.targets.iter().enumerate().fold(Jet::constant(0.0), |sum, (k, &furthest)| {
            sum.sum(self.limbs.weight_jet(k, self.rest_weight(k), piece).product(Jet::constant(furthest)))
        })
    }

    /// Joints that move vertices: (slot, what they reach, stretch of their bind matrix).
    fn bodies<'s>(&'s self, reaches: &'s Reaches) -> impl Iterator<Item = (usize, Reach, f64)> + 's {
        let bind = |j: usize| self.skin.map_or(1.0, |(s, _)| spectral_norm(s.inverse_bind[j].matrix3));
        let slots = self.slots.iter().zip(&reaches.bodies).enumerate();
        slots.filter(|(_, (_, body))| body.from_origin >= 0.0).map(move |(j, (&slot, &body))| (slot, body, bind(j)))
    }

    /// Bound of the second derivative by u of any vertex's path over a stretch, in the space that the vertices land
    /// in.
    ///
    /// A morphed vertex is a sum over targets of weight × displacement; a skinned one is a convex combination of its
    /// joints' paths, so bends no more than the one that bends most.
    #[must_use]
    pub fn acceleration(&self, reaches: &Reaches, piece: (f64, f64)) -> f64 {
        let morph = self.morph_jet(reaches, piece);
        if self.skin.is_none() {
            return morph.second;
        }
        let jets = self.limbs.jets(piece.0, piece.1);
        self.bodies(reaches)
            .map(|(slot, body, bind)| {
                let point = Jet::constant(body.from_origin).sum(morph.product(Jet::constant(bind)));
                jets[slot].point(point).second
            })
            .fold(0.0, f64::max)
    }

    /// Balls around the vertices over the whole exposure: slot, centre and radius in the slot's space; the slot means
    /// nothing without a skin.
    #[must_use]
    pub fn balls(&self, reaches: &Reaches) -> Vec<(usize, DVec3, f64)> {
        let mut from = 0.0;
        let mut displaced = 0.0_f64;
        for (to, _) in self.limbs.breaks().into_iter().chain([(1.0, false)]) {
            displaced = displaced.max(self.morph_jet(reaches, (from, to)).value);
            from = to;
        }
        if self.skin.is_none() {
            return reaches.bodies.iter().map(|body| (0, body.centre, body.radius + displaced)).collect();
        }
        self.bodies(reaches).map(|(slot, body, bind)| (slot, body.centre, body.radius + bind * displaced)).collect()
    }

    /// The vertices at a key instant.
    #[must_use]
    pub fn vertices(&self, key: &KeyInstant) -> VertexKey {
        let mut shape = VertexKey {
            positions: self.mesh.positions.clone(),
            normals: self.mesh.normals.clone(),
            tangents: self.mesh.tangents.clone(),
        };
        for (k, target) in self.mesh.targets.iter().enumerate() {
            #[allow(clippy::cast_possible_truncation, reason = "weights are f32 in the file")]
            let w = self.limbs.weight(k, self.rest_weight(k), key) as f32;
            if w.abs() > 0.0 {
                add(&mut shape.positions, &target.positions, w);
                add(&mut shape.normals, &target.normals, w);
                for (tangent, d) in shape.tangents.iter_mut().zip(&target.tangents) {
                    *tangent += (*d * w).extend(0.0);
                }
            }
        }
        if let Some((skin, binding)) = self.skin {
            let worlds = self.limbs.worlds(key);
            let palette: Vec<DAffine3> =
                self.slots.iter().zip(&skin.inverse_bind).map(|(&slot, bind)| worlds[slot] * *bind).collect();
            pose(&mut shape, binding, &palette);
        }
        tidy(&mut shape);
        shape
    }
}

/// Moves every vertex by the blend of its joints' matrices.
fn pose(shape: &mut VertexKey, binding: &SkinBinding, palette: &[DAffine3]) {
    for v in 0..shape.positions.len() {
        let range = v * binding.influences..(v + 1) * binding.influences;
        let blend = blend(palette, &binding.joints[range.clone()], &binding.weights[range]);
        shape.positions[v] = blend.transform_point3(shape.positions[v].as_dvec3()).as_vec3();
        if let Some(n) = shape.normals.get_mut(v) {
            *n = (cofactor(blend.matrix3) * n.as_dvec3()).normalize_or_zero().as_vec3();
        }
        if let Some(tangent) = shape.tangents.get_mut(v) {
            let along = (blend.matrix3 * tangent.truncate().as_dvec3()).normalize_or_zero().as_vec3();
            *tangent = along.extend(tangent.w);
        }
    }
}

fn add(values: &mut [Vec3], deltas: &[Vec3], weight: f32) {
    for (value, delta) in values.iter_mut().zip(deltas) {
        *value += *delta * weight;
    }
}

fn blend(palette: &[DAffine3], joints: &[u16], weights: &[f32]) -> DAffine3 {
    let mut matrix3 = DMat3::ZERO;
    let mut translation = DVec3::ZERO;
    for (&j, &w) in joints.iter().zip(weights) {
        if w > 0.0
            && let Some(joint) = palette.get(usize::from(j))
        {
            matrix3 += joint.matrix3 * f64::from(w);
            translation += joint.translation * f64::from(w);
        }
    }
    DAffine3 { matrix3, translation }
}

/// The matrix that carries normals: the inverse transpose times the determinant, which exists even where the inverse
/// does not.
#[must_use]
pub fn cofactor(m: DMat3) -> DMat3 {
    DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}

/// Normals and tangents become unit vectors; where nothing is left of one, zero says so.
fn tidy(key: &mut VertexKey) {
    for n in &mut key.normals {
        *n = n.normalize_or_zero();
    }
    for t in &mut key.tangents {
        let along = t.truncate().normalize_or_zero();
        *t = Vec4::new(along.x, along.y, along.z, t.w);
    }
}
