//! Faults in what the chosen scene does not show: said as warnings, since nothing depends on them.
//!
//! What is shown has been checked by then, and more strictly, so only the remaining faults appear here.

use super::accessors::{Component, element_size};
use super::buffers::Buffers;
use super::context::{Context, label};
use super::schema::{MaterialDef, MeshDef, PrimitiveDef};
use serde_json::{Map, Value};

/// Warns about every reference that leads nowhere and every range that leaves its buffer.
pub(super) fn check(ctx: &Context<'_>, buffers: &Buffers) {
    storage(ctx, buffers);
    pictures(ctx);
    for (i, mesh) in ctx.doc.meshes.iter().enumerate() {
        meshes(ctx, mesh, &label("mesh", i, &mesh.name));
    }
    tree(ctx);
}

/// Warns unless `index` is below `count`.
fn reference(ctx: &Context<'_>, index: Option<usize>, count: usize, kind: &str, object: &str) {
    if let Some(index) = index.filter(|&i| i >= count) {
        ctx.warn(object, format!("refers to {kind} {index}, but there are only {count}"));
    }
}

fn storage(ctx: &Context<'_>, buffers: &Buffers) {
    let doc = &ctx.doc;
    for (i, view) in doc.buffer_views.iter().enumerate() {
        let object = label("buffer view", i, "");
        reference(ctx, Some(view.buffer), doc.buffers.len(), "buffer", &object);
        let end = view.byte_offset.checked_add(view.byte_length);
        let room = buffers.length(view.buffer).or(doc.buffers.get(view.buffer).map(|b| b.byte_length));
        if view.byte_length == 0 || room.is_some_and(|room| end.is_none_or(|end| end > room)) {
            ctx.warn(&object, format!("covers {} bytes from byte {}", view.byte_length, view.byte_offset));
        }
        if view.byte_stride.is_some_and(|s| !(4..=252).contains(&s) || s % 4 != 0) {
            ctx.warn(&object, "has a stride that is not a multiple of 4 from 4 to 252");
        }
    }
    for (i, accessor) in doc.accessors.iter().enumerate() {
        let object = label("accessor", i, "");
        reference(ctx, accessor.buffer_view, doc.buffer_views.len(), "buffer view", &object);
        let Some(size) = element_size(&accessor.shape, accessor.component_type) else {
            ctx.warn(&object, "has an unknown type or component type");
            continue;
        };
        if accessor.normalized && Component::from_code(accessor.component_type) == Some(Component::F32) {
            ctx.warn(&object, "marks floats as normalised, which means nothing");
        }
        let Some(view) = accessor.buffer_view.and_then(|v| doc.buffer_views.get(v)) else {
            if accessor.byte_offset > 0 {
                ctx.warn(&object, "has an offset but no buffer view");
            }
            continue;
        };
        let stride = view.byte_stride.unwrap_or(size);
        let end = accessor.count.saturating_sub(1).checked_mul(stride);
        let end = end.and_then(|bytes| bytes.checked_add(accessor.byte_offset)?.checked_add(size));
        if view.extensions.is_empty() && accessor.count > 0 && end.is_none_or(|end| end > view.byte_length) {
            ctx.warn(&object, format!("has {} elements, more than its buffer view holds", accessor.count));
        }
    }
}

fn pictures(ctx: &Context<'_>) {
    let doc = &ctx.doc;
    for (i, image) in doc.images.iter().enumerate() {
        let object = label("image", i, &image.name);
        reference(ctx, image.buffer_view, doc.buffer_views.len(), "buffer view", &object);
        if image.uri.is_none() && image.buffer_view.is_none() {
            ctx.warn(&object, "has neither a uri nor a buffer view");
        }
    }
    for (i, texture) in doc.textures.iter().enumerate() {
        let object = label("texture", i, "");
        reference(ctx, texture.sampler, doc.samplers.len(), "sampler", &object);
        reference(ctx, texture.source, doc.images.len(), "image", &object);
    }
    for (i, material) in doc.materials.iter().enumerate() {
        let object = label("material", i, &material.name);
        for texture in textures(material) {
            reference(ctx, Some(texture), doc.textures.len(), "texture", &object);
        }
    }
}

/// The textures of a material's core and, by their form, of its extensions.
fn textures(material: &MaterialDef) -> Vec<usize> {
    let pbr = &material.pbr_metallic_roughness;
    let core = [
        &pbr.base_color_texture,
        &pbr.metallic_roughness_texture,
        &material.normal_texture,
        &material.occlusion_texture,
        &material.emissive_texture,
    ];
    let mut found: Vec<usize> = core.into_iter().flatten().map(|t| t.index).collect();
    for (key, value) in material.extensions.values().filter_map(Value::as_object).flatten() {
        let index = value.get("index").and_then(Value::as_u64).and_then(|i| usize::try_from(i).ok());
        if key.ends_with("Texture") {
            found.extend(index);
        }
    }
    found
}

fn meshes(ctx: &Context<'_>, mesh: &MeshDef, object: &str) {
    let targets = mesh.primitives.first().map_or(0, |p| p.targets.len());
    if !mesh.weights.is_empty() && mesh.weights.len() != targets {
        ctx.warn(object, format!("has {} morph weights for {targets} targets", mesh.weights.len()));
    }
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let object = format!("{object}, primitive {i}");
        reference(ctx, primitive.indices, ctx.doc.accessors.len(), "accessor", &object);
        reference(ctx, primitive.material, ctx.doc.materials.len(), "material", &object);
        let mut counts = accessors(ctx, &primitive.attributes, &object);
        for target in &primitive.targets {
            counts.extend(accessors(ctx, target, &object));
            if target.keys().any(|name| !primitive.attributes.contains_key(name)) {
                ctx.warn(&object, "morphs an attribute that it does not have");
            }
        }
        if counts.windows(2).any(|w| w[0] != w[1]) {
            ctx.warn(&object, "has attributes of different lengths");
        }
        if primitive.targets.len() != targets {
            ctx.warn(&object, "has another number of morph targets than the first primitive");
        }
        attributes(ctx, primitive, &object);
    }
}

/// Numbers of elements of the accessors in `map`.
fn accessors(ctx: &Context<'_>, map: &Map<String, Value>, object: &str) -> Vec<u64> {
    let mut counts = Vec::new();
    for (name, value) in map {
        let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
        match index.map(|i| ctx.doc.accessors.get(i)) {
            Some(Some(accessor)) => counts.push(accessor.count),
            Some(None) => reference(ctx, index, ctx.doc.accessors.len(), "accessor", object),
            None => ctx.warn(object, format!("{name} is {value}, expected the index of an accessor")),
        }
    }
    counts
}

/// Warns about attributes of forms that the specification does not know.
fn attributes(ctx: &Context<'_>, primitive: &PrimitiveDef, object: &str) {
    let joints = primitive.attributes.keys().filter(|n| n.starts_with("JOINTS_")).count();
    let weights = primitive.attributes.keys().filter(|n| n.starts_with("WEIGHTS_")).count();
    if joints != weights {
        ctx.warn(object, format!("has {joints} sets of joints and {weights} of weights"));
    }
    let quantised = ctx.doc.extensions_used.iter().any(|n| n == "KHR_mesh_quantization");
    for (name, value) in &primitive.attributes {
        let shapes: &[&str] = match name.as_str() {
            "POSITION" | "NORMAL" => &["VEC3"],
            "TANGENT" => &["VEC4"],
            n if n.starts_with("TEXCOORD_") => &["VEC2"],
            n if n.starts_with("COLOR_") => &["VEC3", "VEC4"],
            n if n.starts_with("JOINTS_") || n.starts_with("WEIGHTS_") => &["VEC4"],
            n if n.starts_with('_') => continue,
            _ => {
                ctx.warn(object, format!("has the unknown attribute \"{}\"", name.escape_debug()));
                continue;
            }
        };
        let index = value.as_u64().and_then(|i| usize::try_from(i).ok());
        let Some(accessor) = index.and_then(|i| ctx.doc.accessors.get(i)) else { continue };
        let float = Component::from_code(accessor.component_type) == Some(Component::F32);
        if !shapes.contains(&accessor.shape.as_str())
            || (!float && !quantised && matches!(name.as_str(), "POSITION" | "NORMAL" | "TANGENT"))
        {
            ctx.warn(object, format!("has a {name} of another form than the specification says"));
        }
    }
}

fn tree(ctx: &Context<'_>) {
    let doc = &ctx.doc;
    for (i, scene) in doc.scenes.iter().enumerate() {
        for &node in &scene.nodes {
            reference(ctx, Some(node), doc.nodes.len(), "node", &label("scene", i, ""));
        }
    }
    reference(ctx, doc.scene, doc.scenes.len(), "scene", "file");
    for (i, node) in doc.nodes.iter().enumerate() {
        let object = label("node", i, &node.name);
        reference(ctx, node.mesh, doc.meshes.len(), "mesh", &object);
        reference(ctx, node.camera, doc.cameras.len(), "camera", &object);
        reference(ctx, node.skin, doc.skins.len(), "skin", &object);
    }
    for (i, skin) in doc.skins.iter().enumerate() {
        let object = label("skin", i, &skin.name);
        reference(ctx, skin.inverse_bind_matrices, doc.accessors.len(), "accessor", &object);
        reference(ctx, skin.skeleton, doc.nodes.len(), "node", &object);
        for &joint in &skin.joints {
            reference(ctx, Some(joint), doc.nodes.len(), "node", &object);
        }
    }
    for (i, camera) in doc.cameras.iter().enumerate() {
        let object = label("camera", i, &camera.name);
        if !matches!(camera.kind.as_str(), "perspective" | "orthographic") {
            ctx.warn(&object, format!("has the unknown type \"{}\"", camera.kind.escape_debug()));
        }
        if camera.perspective.is_some() && camera.orthographic.is_some() {
            ctx.warn(&object, "is both perspective and orthographic");
        }
    }
    let unused = |name: &String| !doc.extensions_used.contains(name);
    for name in doc.extensions_required.iter().filter(|n| unused(n)) {
        ctx.warn("file", format!("requires the extension {} but does not list it as used", name.escape_debug()));
    }
}
