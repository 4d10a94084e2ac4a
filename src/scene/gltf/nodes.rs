//! The node tree of the chosen scene: a forest, parents first, with what stands at each node.

use super::accessors::{self, Integers};
use super::buffers::Buffers;
use super::cameras;
use super::context::{Context, label};
use super::extras;
use super::materials::Materials;
use super::meshes::Meshes;
use super::schema::NodeDef;
use crate::scene::{Camera, Light, LocalTransform, Node, NodeId, Skin};
use crate::{Error, Result};
use glam::{DAffine3, DMat4, DQuat, Quat, Vec3, Vec4};
use serde::Deserialize;
use std::collections::HashMap;

/// The nodes that a scene shows, numbered anew.
pub(super) struct Tree {
    /// The file's index of each of our nodes, parents before children.
    pub(super) files: Vec<usize>,
    /// Our index of the file's nodes.
    pub(super) ours: Vec<Option<NodeId>>,
    /// Our index of each node's parent.
    pub(super) parents: Vec<Option<NodeId>>,
    /// How many come from the scene; the others are joints from outside, which move but show nothing.
    pub(super) shown: usize,
}

/// Everything that nodes bring into a scene.
#[derive(Default)]
pub(super) struct Stock {
    pub(super) nodes: Vec<Node>,
    pub(super) cameras: Vec<Camera>,
    pub(super) lights: Vec<Light>,
    pub(super) skins: Vec<Skin>,
    pub(super) meshes: Meshes,
    pub(super) materials: Materials,
    known_cameras: HashMap<usize, usize>,
    known_skins: HashMap<usize, usize>,
}

fn name(ctx: &Context<'_>, index: usize) -> String {
    label("node", index, &ctx.doc.nodes[index].name)
}

/// The parent of every node; refuses second parents and loops.
fn parents(ctx: &Context<'_>) -> Result<Vec<Option<usize>>> {
    let nodes = &ctx.doc.nodes;
    let mut parents = vec![None; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            ctx.get(nodes, child, "node", &name(ctx, index))?;
            if let Some(other) = parents[child].replace(index) {
                let problem = format!("is a child of node {other} and of node {index}, expected one parent");
                return Err(ctx.error(name(ctx, child), problem));
            }
        }
    }
    // Each node has at most one parent, so walking up either ends or comes back. Marks say which walk passed.
    let mut mark = vec![usize::MAX; nodes.len()];
    for start in 0..nodes.len() {
        let mut at = Some(start);
        while let Some(n) = at {
            if mark[n] == start {
                return Err(ctx.error(name(ctx, n), "is its own ancestor, expected a tree"));
            }
            if mark[n] != usize::MAX {
                break;
            }
            mark[n] = start;
            at = parents[n];
        }
    }
    Ok(parents)
}

/// The roots of the chosen scene: the default one, else the first, else every node without a parent.
fn roots(ctx: &Context<'_>, parents: &[Option<usize>]) -> Result<Vec<usize>> {
    if let Some(wanted) = ctx.options.scene
        && wanted >= ctx.doc.scenes.len()
    {
        return Err(Error::NoSuchObject {
            path: ctx.path.clone(),
            kind: "scene",
            wanted: wanted.to_string(),
            available: format!("it has {} of them", ctx.doc.scenes.len()),
        });
    }
    if ctx.doc.scenes.is_empty() {
        if let Some(scene) = ctx.doc.scene {
            ctx.warn("file", format!("names scene {scene} as its default, but has none; all nodes are shown"));
        }
        return Ok((0..parents.len()).filter(|&n| parents[n].is_none()).collect());
    }
    let index = ctx.options.scene.or(ctx.doc.scene).unwrap_or(0);
    let scene = ctx.get(&ctx.doc.scenes, index, "scene", "file")?;
    let object = label("scene", index, "");
    for &root in &scene.nodes {
        ctx.get(&ctx.doc.nodes, root, "node", &object)?;
        if parents[root].is_some() {
            ctx.warn(&object, format!("lists node {root}, which has a parent, as a root"));
        }
    }
    Ok(scene.nodes.clone())
}

/// Chooses and numbers the nodes.
pub(super) fn tree(ctx: &Context<'_>) -> Result<Tree> {
    let above = parents(ctx)?;
    let mut tree = Tree { files: Vec::new(), ours: vec![None; ctx.doc.nodes.len()], parents: Vec::new(), shown: 0 };
    let mut stack: Vec<(usize, Option<NodeId>)> = roots(ctx, &above)?.into_iter().rev().map(|r| (r, None)).collect();
    while let Some((file, parent)) = stack.pop() {
        if tree.ours[file].is_none() {
            let id = tree.add(file, parent);
            stack.extend(ctx.doc.nodes[file].children.iter().rev().map(|&c| (c, Some(id))));
        }
    }
    tree.shown = tree.files.len();
    for shown in 0..tree.shown {
        let file = tree.files[shown];
        if let Some(skin) = ctx.doc.nodes[file].skin {
            for &joint in &ctx.get(&ctx.doc.skins, skin, "skin", &name(ctx, file))?.joints {
                ctx.get(&ctx.doc.nodes, joint, "node", &label("skin", skin, ""))?;
                tree.add_with_ancestors(joint, &above);
            }
        }
    }
    Ok(tree)
}

impl Tree {
    fn add(&mut self, file: usize, parent: Option<NodeId>) -> NodeId {
        let id = self.files.len();
        self.files.push(file);
        self.parents.push(parent);
        self.ours[file] = Some(id);
        id
    }

    /// Adds a joint from outside the scene, and the nodes that it hangs from.
    fn add_with_ancestors(&mut self, file: usize, above: &[Option<usize>]) {
        let mut chain = Vec::new();
        let mut at = Some(file);
        while let Some(n) = at.filter(|&n| self.ours[n].is_none()) {
            chain.push(n);
            at = above[n];
        }
        let mut parent = at.and_then(|n| self.ours[n]);
        for n in chain.into_iter().rev() {
            parent = Some(self.add(n, parent));
        }
    }
}

/// Loads every node of `tree` with all that stands there.
pub(super) fn load(ctx: &Context<'_>, buffers: &Buffers, tree: &Tree) -> Result<Stock> {
    let mut stock = Stock::default();
    for (id, &file) in tree.files.iter().enumerate() {
        let def = &ctx.doc.nodes[file];
        let object = name(ctx, file);
        let mut node = Node {
            name: def.name.clone(),
            parent: tree.parents[id],
            local: local(ctx, def, &object)?,
            blur_scale: extras::blur_scale(ctx, &def.extras, &object)?,
            visible: visible(ctx, def, &object)?,
            ..Node::default()
        };
        if id < tree.shown {
            stock.furnish(ctx, buffers, (def, &object), &mut node, tree)?;
        }
        stock.nodes.push(node);
    }
    Ok(stock)
}

fn visible(ctx: &Context<'_>, def: &NodeDef, object: &str) -> Result<bool> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Visibility {
        visible: Option<bool>,
    }
    let said = ctx.extension::<Visibility>(&def.extensions, "KHR_node_visibility", object)?;
    Ok(said.and_then(|v| v.visible).unwrap_or(true))
}

/// A unit quaternion; one without length becomes the identity, with a warning.
pub(super) fn rotation(ctx: &Context<'_>, q: Vec4, object: &str) -> Quat {
    // Quaternions of normalised 8-bit integers are this far from unit length.
    const SLACK: f64 = 0.02;
    let wide = q.as_dvec4();
    let length = wide.length();
    if length > 0.0 && length.is_finite() {
        if (length - 1.0).abs() > SLACK {
            ctx.warn(object, "has rotations that are not of unit length; they are normalised");
        }
        Quat::from_vec4((wide / length).as_vec4())
    } else {
        ctx.warn(object, "has a rotation without length; it is taken as none");
        Quat::IDENTITY
    }
}

fn local(ctx: &Context<'_>, def: &NodeDef, object: &str) -> Result<LocalTransform> {
    if let Some(matrix) = def.matrix {
        if def.translation.is_some() || def.rotation.is_some() || def.scale.is_some() {
            ctx.warn(object, "has a matrix and separate parts; the matrix is used");
        }
        ctx.finite_array(matrix, "the matrix", object)?;
        let matrix = DMat4::from_cols_array(&matrix);
        let last = matrix.row(3).to_array();
        if last.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(a, b)| (a - b).abs() > f64::from(f32::EPSILON)) {
            ctx.warn(object, "has a matrix whose last row is not 0 0 0 1; that row is ignored");
        }
        return Ok(LocalTransform::Matrix(DAffine3::from_mat4(matrix)));
    }
    let translation = ctx.finite_array(def.translation.unwrap_or_default(), "the translation", object)?;
    let turn = ctx.finite_array(def.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]), "the rotation", object)?;
    let scale = ctx.finite_array(def.scale.unwrap_or([1.0; 3]), "the scale", object)?;
    Ok(LocalTransform::Parts {
        translation: Vec3::from(translation),
        rotation: rotation(ctx, Vec4::from(turn), object),
        scale: Vec3::from(scale),
    })
}

impl Stock {
    /// Puts meshes, skin, camera, light and copies at a node.
    fn furnish(
        &mut self,
        ctx: &Context<'_>,
        buffers: &Buffers,
        (def, object): (&NodeDef, &str),
        node: &mut Node,
        tree: &Tree,
    ) -> Result<()> {
        #[derive(Default, Deserialize)]
        #[serde(default)]
        struct LightRef {
            light: usize,
        }
        if let Some(mesh) = def.mesh {
            let loaded = self.meshes.get(ctx, buffers, &self.materials, mesh, object)?;
            node.meshes.clone_from(&loaded.meshes);
            node.weights = weights(ctx, def, &loaded, object)?;
            node.copies = copies(ctx, buffers, def, object)?;
        }
        if let Some(skin) = def.skin {
            let id = self.skin(ctx, buffers, skin, tree)?;
            if def.mesh.is_some() {
                self.check_joints(ctx, node, id, object)?;
                node.skin = Some(id);
            } else {
                ctx.warn(object, "has a skin but no mesh");
            }
        }
        if let Some(camera) = def.camera {
            let own = cameras::has_lens(ctx, &def.extras, object)?;
            let known = self.known_cameras.get(&camera).copied().filter(|_| !own);
            node.camera = match known {
                Some(id) => Some(id),
                None => {
                    self.cameras.push(cameras::camera(ctx, camera, (&def.extras, object))?);
                    let id = self.cameras.len() - 1;
                    if !own {
                        self.known_cameras.insert(camera, id);
                    }
                    Some(id)
                }
            };
        }
        if let Some(LightRef { light }) = ctx.extension(&def.extensions, "KHR_lights_punctual", object)?
            && let Some(light) = cameras::light(ctx, light, (&def.extras, object))?
        {
            self.lights.push(light);
            node.light = Some(self.lights.len() - 1);
        }
        Ok(())
    }

    fn skin(&mut self, ctx: &Context<'_>, buffers: &Buffers, index: usize, tree: &Tree) -> Result<usize> {
        if let Some(&id) = self.known_skins.get(&index) {
            return Ok(id);
        }
        let def = &ctx.doc.skins[index];
        let object = label("skin", index, &def.name);
        if def.joints.is_empty() {
            return Err(ctx.error(object, "has no joints"));
        }
        let joints: Vec<NodeId> = def.joints.iter().filter_map(|&j| tree.ours[j]).collect();
        let mut inverse_bind = vec![DAffine3::IDENTITY; joints.len()];
        if let Some(accessor) = def.inverse_bind_matrices {
            let about = format!("{object}, inverse bind matrices");
            let elements = accessors::read(ctx, buffers, accessor, &about)?.expect(ctx, &[16], &about)?;
            if elements.count < joints.len() {
                let problem = format!("are {} for {} joints", elements.count, joints.len());
                return Err(ctx.error(about, problem));
            }
            let floats = elements.floats(ctx, Integers::AsStored, &about)?;
            for ((j, matrix), m) in inverse_bind.iter_mut().enumerate().zip(floats.chunks_exact(16)) {
                if m.iter().any(|v| !v.is_finite()) {
                    return Err(ctx.error(about, format!("matrix {j} is not finite")));
                }
                *matrix = DAffine3::from_mat4(DMat4::from_cols_array(&std::array::from_fn(|i| f64::from(m[i]))));
            }
        }
        self.skins.push(Skin { name: def.name.clone(), joints, inverse_bind });
        self.known_skins.insert(index, self.skins.len() - 1);
        Ok(self.skins.len() - 1)
    }

    /// Refuses meshes that refer to joints which the skin lacks.
    fn check_joints(&self, ctx: &Context<'_>, node: &Node, skin: usize, object: &str) -> Result<()> {
        let joints = self.skins[skin].joints.len();
        for &mesh in &node.meshes {
            let most = self.meshes.with(mesh, |m| m.skin.as_ref().and_then(|s| s.joints.iter().max().copied()));
            if let Some(most) = most.filter(|&m| usize::from(m) >= joints) {
                return Err(ctx.error(object, format!("its mesh uses joint {most}, but its skin has {joints} of them")));
            }
        }
        Ok(())
    }
}

/// Morph weights at rest, as many as there are targets.
fn weights(ctx: &Context<'_>, def: &NodeDef, loaded: &super::meshes::Loaded, object: &str) -> Result<Vec<f32>> {
    let said = if def.weights.is_empty() { &loaded.weights } else { &def.weights };
    if !said.is_empty() && said.len() != loaded.targets {
        ctx.warn(object, format!("has {} morph weights for {} targets", said.len(), loaded.targets));
    }
    let mut weights = vec![0.0; loaded.targets];
    for (w, &s) in weights.iter_mut().zip(said) {
        *w = ctx.finite(s, "a morph weight", object)?;
    }
    Ok(weights)
}

/// The copies of `EXT_mesh_gpu_instancing`.
fn copies(ctx: &Context<'_>, buffers: &Buffers, def: &NodeDef, object: &str) -> Result<Option<Vec<DAffine3>>> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Instancing {
        attributes: HashMap<String, usize>,
    }
    let Some(how) = ctx.extension::<Instancing>(&def.extensions, "EXT_mesh_gpu_instancing", object)? else {
        return Ok(None);
    };
    let mut count = None;
    let mut read = |name: &str, width: usize, integers: Integers| -> Result<Option<Vec<f32>>> {
        let Some(&accessor) = how.attributes.get(name) else { return Ok(None) };
        let about = format!("{object}, instances, {name}");
        let elements = accessors::read(ctx, buffers, accessor, &about)?.expect(ctx, &[width], &about)?;
        if *count.get_or_insert(elements.count) != elements.count {
            return Err(ctx.error(about, format!("has {} elements, unlike the others", elements.count)));
        }
        let values = elements.floats(ctx, integers, &about)?;
        match values.iter().position(|v| !v.is_finite()) {
            Some(bad) => Err(ctx.error(about, format!("instance {} is not finite", bad / width))),
            None => Ok(Some(values)),
        }
    };
    let translations = read("TRANSLATION", 3, Integers::AsStored)?;
    let rotations = read("ROTATION", 4, Integers::Unit)?;
    let scales = read("SCALE", 3, Integers::AsStored)?;
    let Some(count) = count else {
        ctx.warn(object, "has instances without translations, rotations or scales; its mesh is shown once");
        return Ok(None);
    };
    ctx.charge(count as u64 * size_of::<DAffine3>() as u64, object)?;
    let vec3 = |list: &Option<Vec<f32>>, i: usize, default: Vec3| -> Vec3 {
        list.as_ref().map_or(default, |l| Vec3::from_slice(&l[3 * i..]))
    };
    let copies = (0..count).map(|i| {
        let turn = rotations.as_ref().map_or(Quat::IDENTITY, |r| rotation(ctx, Vec4::from_slice(&r[4 * i..]), object));
        DAffine3::from_scale_rotation_translation(
            vec3(&scales, i, Vec3::ONE).as_dvec3(),
            DQuat::from_xyzw(turn.x.into(), turn.y.into(), turn.z.into(), turn.w.into()).normalize(),
            vec3(&translations, i, Vec3::ZERO).as_dvec3(),
        )
    });
    Ok(Some(copies.collect()))
}
