//! Meshes that change shape: morph targets, then skins (glTF 2.0, §3.7.2.2 and §3.7.3.3).

use super::curve::Jet;
use super::rig::{Piece, Rig, frobenius};
use super::stage::VertexKey;
use super::{Mesh, MeshId, NodeId, Skin};
use glam::{DAffine3, DMat3, DVec3, Vec3, Vec4};

/// What deforms one mesh at one node.
#[derive(Debug, Clone, Copy)]
pub struct Deformer<'r, 'a> {
    rig: &'r Rig<'a>,
    mesh: &'a Mesh,
    node: NodeId,
    skin: Option<&'a Skin>,
}

impl<'r, 'a> Deformer<'r, 'a> {
    /// The deformer of `mesh` at `node`, or `None` where the mesh keeps its rest pose for ever.
    #[must_use]
    pub fn new(rig: &'r Rig<'a>, mesh: MeshId, node: NodeId) -> Option<Self> {
        let scene = rig.scene();
        let (holder, mesh) = (&scene.nodes[node], &scene.meshes[mesh]);
        let skin = mesh.skin.as_ref().and(holder.skin).map(|s| &scene.skins[s]);
        let morphs =
            !mesh.targets.is_empty() && (rig.weights(node).is_some() || holder.weights.iter().any(|&w| w.abs() > 0.0));
        (skin.is_some() || morphs).then_some(Self { rig, mesh, node, skin })
    }

    /// Whether its vertices land in world space whatever the node's own transform: skins do.
    #[must_use]
    pub fn lands_in_world(&self) -> bool {
        self.skin.is_some()
    }

    /// The nodes whose motion bends the mesh.
    #[must_use]
    pub fn joints(&self) -> &'a [NodeId] {
        self.skin.map_or(&[], |s| &s.joints)
    }

    /// Whether no animation ever changes the shape.
    #[must_use]
    pub fn is_permanent(&self) -> bool {
        self.rig.weights(self.node).is_none() && self.joints().iter().all(|&j| !self.rig.is_carried(j))
    }

    /// Whether the shape is exactly constant on [`a`, `b`).
    #[must_use]
    pub fn is_still(&self, a: f64, b: f64) -> bool {
        self.rig.weights_still(self.node, a, b) && self.joints().iter().all(|&j| self.rig.is_still(j, a, b))
    }

    /// Weight of morph target `k` at time `t` of `piece`.
    fn weight(&self, k: usize, piece: Piece, t: f64) -> f64 {
        match self.rig.weights(self.node) {
            Some(track) if k < track.width => track.value(k, piece, t),
            _ => self.rig.scene().nodes[self.node].weights.get(k).copied().map_or(0.0, f64::from),
        }
    }

    /// Bound of the acceleration of any vertex over the piece (m/s², of the space that the vertices land in).
    ///
    /// A morphed vertex is a sum over targets of weight × displacement; a skinned one is a convex combination of its
    /// joints' paths, so no faster than the fastest of them.
    #[must_use]
    pub fn acceleration(&self, piece: Piece) -> f64 {
        let length = |v: &Vec3| f64::from(v.length());
        let largest = |list: &[Vec3]| list.iter().map(length).fold(0.0, f64::max);
        let morph = self.mesh.targets.iter().enumerate().fold(Jet::constant(0.0), |sum, (k, target)| {
            let weight = match self.rig.weights(self.node) {
                Some(track) if k < track.width => track.jet(k, piece.0, piece.1),
                _ => Jet::constant(self.weight(k, piece, piece.0).abs()),
            };
            sum.sum(weight.product(Jet::constant(largest(&target.positions))))
        });
        let (Some(skin), Some(binding)) = (self.skin, &self.mesh.skin) else {
            return morph.second;
        };
        let mut reach = vec![0.0_f64; skin.joints.len()];
        for (v, p) in self.mesh.positions.iter().enumerate() {
            for i in v * binding.influences..(v + 1) * binding.influences {
                let j = usize::from(binding.joints[i]);
                if binding.weights[i] > 0.0 && j < reach.len() {
                    reach[j] = reach[j].max(skin.inverse_bind[j].transform_point3(p.as_dvec3()).length());
                }
            }
        }
        (0..reach.len())
            .filter(|&j| reach[j] > 0.0)
            .map(|j| {
                let bend = morph.product(Jet::constant(frobenius(skin.inverse_bind[j].matrix3)));
                self.rig.path_jet(skin.joints[j], piece, Jet::constant(reach[j]).sum(bend)).second
            })
            .fold(0.0, f64::max)
    }

    /// The vertices at time `t` of `piece` (file's clock).
    #[must_use]
    pub fn vertices(&self, piece: Piece, t: f64) -> VertexKey {
        let mut key = VertexKey {
            positions: self.mesh.positions.clone(),
            normals: self.mesh.normals.clone(),
            tangents: self.mesh.tangents.clone(),
        };
        for (k, target) in self.mesh.targets.iter().enumerate() {
            #[allow(clippy::cast_possible_truncation, reason = "weights are f32 in the file")]
            let w = self.weight(k, piece, t) as f32;
            if w.abs() > 0.0 {
                add(&mut key.positions, &target.positions, w);
                add(&mut key.normals, &target.normals, w);
                for (tangent, d) in key.tangents.iter_mut().zip(&target.tangents) {
                    *tangent += (*d * w).extend(0.0);
                }
            }
        }
        if let (Some(skin), Some(binding)) = (self.skin, &self.mesh.skin) {
            let palette: Vec<DAffine3> = skin
                .joints
                .iter()
                .zip(&skin.inverse_bind)
                .map(|(&j, bind)| self.rig.world(j, piece, t) * *bind)
                .collect();
            for v in 0..key.positions.len() {
                let range = v * binding.influences..(v + 1) * binding.influences;
                let blend = blend(&palette, &binding.joints[range.clone()], &binding.weights[range]);
                key.positions[v] = blend.transform_point3(key.positions[v].as_dvec3()).as_vec3();
                if let Some(n) = key.normals.get_mut(v) {
                    *n = (cofactor(blend.matrix3) * n.as_dvec3()).as_vec3();
                }
                if let Some(tangent) = key.tangents.get_mut(v) {
                    let along = (blend.matrix3 * tangent.truncate().as_dvec3()).as_vec3();
                    *tangent = along.extend(tangent.w);
                }
            }
        }
        tidy(&mut key);
        key
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
