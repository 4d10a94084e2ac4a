//! Vertex attributes beside positions: checked against them, cleaned where they are unusable.

use super::accessors::{Component, Elements, Integers};
use super::meshes::Source;
use crate::Result;
use crate::scene::{Mesh, MorphTarget, SkinBinding};
use glam::{Vec2, Vec3, Vec4};

/// How far the squared length of a unit vector stored in 8 bits may be from 1: half a step of 1/127 in each of three
/// components changes it by up to 2 · √3 / 254.
const UNIT_SLACK: f32 = 0.014;

/// Attribute `name` if it has one element for each vertex and one of the given widths; otherwise it is dropped.
fn fitting(source: &mut Source<'_, '_>, name: &str, widths: &[usize], mesh: &Mesh) -> Result<Option<Elements>> {
    let Some(elements) = source.attribute(name)? else { return Ok(None) };
    let about = source.about(name);
    if elements.count != mesh.positions.len() {
        let problem = format!("has {} elements for {} vertices and is ignored", elements.count, mesh.positions.len());
        source.ctx.warn(about, problem);
        return Ok(None);
    }
    elements.expect(source.ctx, widths, &about).map(Some)
}

/// Unit normals, or none. Where a normal is unusable the mean of the triangles around the vertex takes its place.
pub(super) fn normals(source: &mut Source<'_, '_>, mesh: &Mesh) -> Result<Vec<Vec3>> {
    let Some(elements) = fitting(source, "NORMAL", &[3], mesh)? else { return Ok(Vec::new()) };
    let (ctx, about) = (source.ctx, source.about("NORMAL"));
    let mut normals = elements.vec3s(ctx, Integers::Unit, &about)?;
    let (mut odd, mut bad) = (0_usize, Vec::new());
    for (i, n) in normals.iter_mut().enumerate() {
        match unit(*n) {
            Some(u) => {
                odd += usize::from((n.length_squared() - 1.0).abs() > UNIT_SLACK);
                *n = u;
            }
            None => bad.push(i),
        }
    }
    if odd > 0 {
        ctx.warn(&about, format!("{odd} normals are not of unit length; they are normalised"));
    }
    if bad.len() == normals.len() {
        if !bad.is_empty() {
            ctx.warn(about, "has no usable normal; the triangles' own are used");
        }
        return Ok(Vec::new());
    }
    if !bad.is_empty() {
        ctx.warn(about, format!("{} normals are zero or not finite; the triangles' own are used", bad.len()));
        let around = face_normals(mesh);
        for i in bad {
            normals[i] = unit(around[i]).unwrap_or(Vec3::Y);
        }
    }
    Ok(normals)
}

/// The sum of the normals of the triangles around each vertex, weighted by area.
fn face_normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let n = (b - a).cross(c - a);
        for &i in t {
            sums[i as usize] += n;
        }
    }
    sums
}

/// `v` at unit length, in `f64` so that no finite vector but zero is lost.
pub(super) fn unit(v: Vec3) -> Option<Vec3> {
    let wide = v.as_dvec3();
    let length = wide.length();
    (length > 0.0 && length.is_finite()).then(|| (wide / length).as_vec3())
}

/// Unit tangents, or none: they mean nothing without normals, and unusable ones are generated anew.
pub(super) fn tangents(source: &mut Source<'_, '_>, mesh: &Mesh) -> Result<Vec<Vec4>> {
    let Some(elements) = fitting(source, "TANGENT", &[4], mesh)? else { return Ok(Vec::new()) };
    if mesh.normals.is_empty() {
        return Ok(Vec::new());
    }
    let (ctx, about) = (source.ctx, source.about("TANGENT"));
    let mut tangents = elements.vec4s(ctx, Integers::Unit, &about)?;
    for t in &mut tangents {
        let Some(direction) = unit(t.truncate()) else {
            ctx.warn(about, "has tangents that are zero or not finite; all are generated anew");
            return Ok(Vec::new());
        };
        *t = direction.extend(if t.w < 0.0 { -1.0 } else { 1.0 });
    }
    Ok(tangents)
}

/// Texture coordinate sets 0, 1, … without a gap.
pub(super) fn uvs(source: &mut Source<'_, '_>, mesh: &Mesh) -> Result<Vec<Vec<Vec2>>> {
    let mut sets = Vec::new();
    for set in 0..crate::scene::texture::MAX_UV_SETS {
        let name = format!("TEXCOORD_{set}");
        let Some(elements) = fitting(source, &name, &[2], mesh)? else { break };
        let about = source.about(&name);
        let mut uvs = elements.vec2s(source.ctx, Integers::AsStored, &about)?;
        if clean(&mut uvs, |uv| uv.is_finite(), Vec2::ZERO) {
            source.ctx.warn(about, "has coordinates that are not finite; they are taken as 0");
        }
        sets.push(uvs);
    }
    Ok(sets)
}

/// Replaces what is not `good`; says whether there was any.
fn clean<T: Copy>(values: &mut [T], good: impl Fn(&T) -> bool, instead: T) -> bool {
    let mut any = false;
    for v in values {
        if !good(v) {
            *v = instead;
            any = true;
        }
    }
    any
}

/// Linear vertex colours with alpha.
pub(super) fn colors(source: &mut Source<'_, '_>, mesh: &Mesh) -> Result<Vec<Vec4>> {
    let Some(elements) = fitting(source, "COLOR_0", &[3, 4], mesh)? else { return Ok(Vec::new()) };
    let (ctx, about) = (source.ctx, source.about("COLOR_0"));
    let mut colors = if elements.components == 4 {
        elements.vec4s(ctx, Integers::Unit, &about)?
    } else {
        elements.vec3s(ctx, Integers::Unit, &about)?.into_iter().map(|c| c.extend(1.0)).collect()
    };
    if clean(&mut colors, |c| c.is_finite() && c.min_element() >= 0.0, Vec4::ONE) {
        ctx.warn(about, "has colours that are negative or not finite; they are taken as white");
    }
    colors.iter_mut().for_each(|c| c.w = c.w.min(1.0));
    Ok(colors)
}

/// Joints and weights of one or two sets; weights are made to sum to 1.
pub(super) fn skin(source: &mut Source<'_, '_>, mesh: &Mesh) -> Result<Option<SkinBinding>> {
    let vertices = mesh.positions.len();
    let mut sets = Vec::new();
    for set in 0..2 {
        let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
        let joints = fitting(source, &names[0], &[4], mesh)?;
        let weights = fitting(source, &names[1], &[4], mesh)?;
        let (joints, weights) = match (joints, weights) {
            (Some(joints), Some(weights)) => (joints, weights),
            (None, None) => break,
            _ => {
                source.ctx.warn(&source.object, format!("has only one of {} and {}", names[0], names[1]));
                break;
            }
        };
        if matches!(joints.component, Component::U32) {
            source.ctx.warn(source.about(&names[0]), "has 32-bit joints, expected 8 or 16 bits");
        }
        let joints = joints.unsigned(source.ctx, &source.about(&names[0]))?;
        sets.push((joints, weights.floats(source.ctx, Integers::Unit, &source.about(&names[1]))?));
    }
    if source.primitive.attributes.contains_key("JOINTS_2") {
        source.ctx.warn(&source.object, "has more than 8 influences a vertex; the first 8 are used");
    }
    if sets.is_empty() {
        return Ok(None);
    }
    let influences = 4 * sets.len();
    source.ctx.charge(vertices as u64 * influences as u64 * 6, &source.object)?;
    let mut binding = SkinBinding { influences, joints: Vec::new(), weights: Vec::new() };
    for vertex in 0..vertices {
        for (joints, weights) in &sets {
            for k in vertex * 4..vertex * 4 + 4 {
                let weight = weights[k];
                let joint = u16::try_from(joints[k]).map_err(|_| {
                    let problem = format!("vertex {vertex} has joint {}, expected at most 65535", joints[k]);
                    source.ctx.error(&source.object, problem)
                })?;
                // A joint without weight is often out of range in real files and must not be looked at.
                let used = weight.is_finite() && weight > 0.0;
                binding.joints.push(if used { joint } else { 0 });
                binding.weights.push(if used || weight.is_nan() { weight } else { weight.min(0.0) });
            }
        }
    }
    normalise_weights(source, &mut binding);
    Ok(Some(binding))
}

/// Makes each vertex's weights non-negative with sum 1.
fn normalise_weights(source: &Source<'_, '_>, binding: &mut SkinBinding) {
    // Weights of 8 bits may be off by half a step each.
    const SLACK: f64 = 0.5 / 255.0;
    let (mut odd, mut empty) = (0_usize, 0_usize);
    for weights in binding.weights.chunks_exact_mut(binding.influences) {
        let broken = clean(weights, |w| w.is_finite() && *w >= 0.0, 0.0);
        let sum: f64 = weights.iter().map(|&w| f64::from(w)).sum();
        if sum > 0.0 {
            odd += usize::from(broken || (sum - 1.0).abs() > SLACK * 8.0);
            #[allow(clippy::cast_possible_truncation, reason = "a fraction is rounded to f32 by meaning")]
            weights.iter_mut().for_each(|w| *w = (f64::from(*w) / sum) as f32);
        } else {
            empty += 1;
            weights[0] = 1.0;
        }
    }
    if odd > 0 {
        source.ctx.warn(&source.object, format!("{odd} vertices have weights that do not sum to 1; they are scaled"));
    }
    if empty > 0 {
        source.ctx.warn(&source.object, format!("{empty} vertices have no weights; they follow their first joint"));
    }
}

/// Morph targets: differences of positions, normals and tangents.
pub(super) fn targets(source: &Source<'_, '_>, mesh: &Mesh) -> Result<Vec<MorphTarget>> {
    let mut targets = Vec::new();
    for (t, map) in source.primitive.targets.iter().enumerate() {
        let read = |name: &str, wanted: bool| -> Result<Vec<Vec3>> {
            let about = format!("{}, target {t}, {name}", source.object);
            match source.accessor(map, name)? {
                Some(elements) if wanted => {
                    let count = elements.count;
                    let values =
                        elements.expect(source.ctx, &[3], &about)?.vec3s(source.ctx, Integers::AsStored, &about)?;
                    if count != mesh.positions.len() {
                        let problem = format!("has {count} elements for {} vertices", mesh.positions.len());
                        return Err(source.ctx.error(about, problem));
                    }
                    match values.iter().position(|v| !v.is_finite()) {
                        Some(bad) => Err(source.ctx.error(about, format!("vertex {bad} moves by {}", values[bad]))),
                        None => Ok(values),
                    }
                }
                _ => Ok(Vec::new()),
            }
        };
        targets.push(MorphTarget {
            positions: read("POSITION", true)?,
            normals: read("NORMAL", !mesh.normals.is_empty())?,
            tangents: read("TANGENT", !mesh.tangents.is_empty())?,
        });
        if map.keys().any(|k| !matches!(k.as_str(), "POSITION" | "NORMAL" | "TANGENT")) {
            source.ctx.warn(&source.object, "morphs attributes other than positions, normals and tangents: no effect");
        }
    }
    Ok(targets)
}
