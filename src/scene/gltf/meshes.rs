//! Meshes: primitives of any topology to indexed triangles with checked attributes.

use super::accessors::{self, Elements, Integers};
use super::buffers::Buffers;
use super::context::{Context, label};
use super::draco;
use super::materials::Materials;
use super::schema::{MeshDef, PrimitiveDef};
use super::{attributes, tangents, variants};
use crate::Result;
use crate::scene::{Mesh, MeshId};
use serde_json::{Map, Value};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// What became of one mesh of the file.
#[derive(Debug)]
pub(super) struct Loaded {
    /// Its primitives that are triangles.
    pub(super) meshes: Vec<MeshId>,
    /// How many morph targets they have.
    pub(super) targets: usize,
    /// Morph weights for nodes that say none.
    pub(super) weights: Vec<f64>,
}

/// The meshes that nodes asked for so far.
#[derive(Default)]
pub(super) struct Meshes {
    list: RefCell<Vec<Mesh>>,
    known: RefCell<HashMap<usize, Rc<Loaded>>>,
}

/// What a primitive is read with.
pub(super) struct Source<'s, 'c> {
    pub(super) ctx: &'s Context<'c>,
    pub(super) buffers: &'s Buffers,
    pub(super) primitive: &'s PrimitiveDef,
    pub(super) compressed: Option<draco::Decoded>,
    pub(super) object: String,
}

impl Source<'_, '_> {
    /// The attribute `name`, if the primitive has it.
    pub(super) fn attribute(&mut self, name: &str) -> Result<Option<Elements>> {
        if let Some(elements) = self.compressed.as_mut().and_then(|c| c.attributes.remove(name)) {
            return Ok(Some(elements));
        }
        self.accessor(&self.primitive.attributes, name)
    }

    /// The accessor that `map` gives for `name`.
    pub(super) fn accessor(&self, map: &Map<String, Value>, name: &str) -> Result<Option<Elements>> {
        let Some(value) = map.get(name) else { return Ok(None) };
        let index = value.as_u64().and_then(|i| usize::try_from(i).ok()).ok_or_else(|| {
            self.ctx.error(&self.object, format!("{name} is {value}, expected the index of an accessor"))
        })?;
        accessors::read(self.ctx, self.buffers, index, &format!("{}, {name}", self.object)).map(Some)
    }

    pub(super) fn about(&self, name: &str) -> String {
        format!("{}, {name}", self.object)
    }
}

impl Meshes {
    /// Loads mesh `index` of the file, once.
    pub(super) fn get(
        &self,
        ctx: &Context<'_>,
        buffers: &Buffers,
        materials: &Materials,
        index: usize,
        object: &str,
    ) -> Result<Rc<Loaded>> {
        if let Some(known) = self.known.borrow().get(&index) {
            return Ok(Rc::clone(known));
        }
        let def = ctx.get(&ctx.doc.meshes, index, "mesh", object)?;
        let name = label("mesh", index, &def.name);
        let mut meshes = Vec::new();
        let mut targets = None;
        for (p, primitive) in def.primitives.iter().enumerate() {
            let object = format!("{name}, primitive {p}");
            if *targets.get_or_insert(primitive.targets.len()) != primitive.targets.len() {
                return Err(ctx.error(object, "has another number of morph targets than the primitive before it"));
            }
            if let Some(mesh) = load(ctx, buffers, materials, (def, primitive), object)? {
                let mut list = self.list.borrow_mut();
                list.push(mesh);
                meshes.push(list.len() - 1);
            }
        }
        if def.primitives.is_empty() {
            ctx.warn(&name, "has no primitives");
        }
        let loaded = Rc::new(Loaded { meshes, targets: targets.unwrap_or(0), weights: def.weights.clone() });
        self.known.borrow_mut().insert(index, Rc::clone(&loaded));
        Ok(loaded)
    }

    /// Looks at mesh `id`.
    pub(super) fn with<T>(&self, id: MeshId, f: impl FnOnce(&Mesh) -> T) -> T {
        f(&self.list.borrow()[id])
    }

    pub(super) fn into_list(self) -> Vec<Mesh> {
        self.list.into_inner()
    }
}

/// One primitive; `None`, with a warning, where there is nothing to draw.
fn load(
    ctx: &Context<'_>,
    buffers: &Buffers,
    materials: &Materials,
    (def, primitive): (&MeshDef, &PrimitiveDef),
    object: String,
) -> Result<Option<Mesh>> {
    let mode = primitive.mode.unwrap_or(4);
    match mode {
        4..=6 => {}
        0..=3 => {
            ctx.warn(object, format!("draws {}, which are not rendered", if mode == 0 { "points" } else { "lines" }));
            return Ok(None);
        }
        _ => return Err(ctx.error(object, format!("has the unknown mode {mode}"))),
    }
    let compressed = draco::read(ctx, buffers, primitive, &object)?;
    let mut source = Source { ctx, buffers, primitive, compressed, object };
    let Some(positions) = source.attribute("POSITION")? else {
        ctx.warn(&source.object, "has no positions and is not drawn");
        return Ok(None);
    };
    let about = source.about("POSITION");
    let positions = positions.expect(ctx, &[3], &about)?.vec3s(ctx, Integers::AsStored, &about)?;
    if let Some(bad) = positions.iter().position(|p| !p.is_finite()) {
        return Err(ctx.error(about, format!("vertex {bad} is at {}, which is not finite", positions[bad])));
    }
    let triangles = triangles(&mut source, mode, positions.len())?;
    let wanted = variants::material(ctx, primitive, &source.object)?;
    let material = materials.get(ctx, wanted, &source.object)?;
    let mut mesh = Mesh { name: def.name.clone(), material, triangles, positions, ..Mesh::default() };
    mesh.normals = attributes::normals(&mut source, &mesh)?;
    mesh.tangents = attributes::tangents(&mut source, &mesh)?;
    mesh.uvs = attributes::uvs(&mut source, &mesh)?;
    mesh.colors = attributes::colors(&mut source, &mesh)?;
    mesh.skin = attributes::skin(&mut source, &mesh)?;
    mesh.targets = attributes::targets(&source, &mesh)?;
    match materials.with(material, |m| m.tangent_uv_set()) {
        Some(set) if mesh.tangents.is_empty() => match mesh.uvs.get(set) {
            Some(_) => tangents::generate(ctx, &mut mesh, set, &source.object)?,
            None => ctx.warn(&source.object, format!("lacks the texture coordinate set {set} that its normals need")),
        },
        Some(_) => {}
        None => {
            mesh.tangents = Vec::new();
            mesh.targets.iter_mut().for_each(|t| t.tangents = Vec::new());
        }
    }
    Ok(Some(mesh))
}

/// The primitive's triangles, every index in range.
fn triangles(source: &mut Source<'_, '_>, mode: u64, vertices: usize) -> Result<Vec<[u32; 3]>> {
    let ctx = source.ctx;
    let indices = match (source.compressed.as_mut().map(|c| std::mem::take(&mut c.indices)), source.primitive.indices) {
        (Some(indices), _) => Some(indices),
        (None, Some(index)) => {
            let about = source.about("indices");
            Some(
                accessors::read(ctx, source.buffers, index, &about)?
                    .expect(ctx, &[1], &about)?
                    .unsigned(ctx, &about)?,
            )
        }
        (None, None) => None,
    };
    if u32::try_from(vertices).is_err() {
        return Err(ctx.error(&source.object, format!("has {vertices} vertices, more than 32-bit indices reach")));
    }
    if let Some(indices) = &indices
        && let Some(bad) = indices.iter().position(|&i| i as usize >= vertices)
    {
        return Err(ctx.error(
            source.about("indices"),
            format!("index {bad} is {}, but there are {vertices} vertices", indices[bad]),
        ));
    }
    let count = indices.as_ref().map_or(vertices, Vec::len);
    ctx.charge(count as u64 * if mode == 4 { 4 } else { 12 }, &source.object)?;
    let at = |i: usize| -> u32 {
        match &indices {
            Some(indices) => indices[i],
            #[allow(clippy::cast_possible_truncation, reason = "the number of vertices fits u32, checked above")]
            None => i as u32,
        }
    };
    let rest = if mode == 4 { count % 3 } else { 0 };
    if rest != 0 || (mode != 4 && count < 3) {
        ctx.warn(
            &source.object,
            format!("has {count} indices, which do not make whole triangles; the rest is dropped"),
        );
    }
    Ok(match mode {
        4 => (0..count / 3).map(|t| [at(3 * t), at(3 * t + 1), at(3 * t + 2)]).collect(),
        5 => (0..count.saturating_sub(2)).map(|i| [at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)]).collect(),
        _ => (0..count.saturating_sub(2)).map(|i| [at(i + 1), at(i + 2), at(0)]).collect(),
    })
}
