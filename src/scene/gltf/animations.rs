//! Animation channels: checked curves on our nodes.

use super::accessors::{self, Integers};
use super::buffers::Buffers;
use super::context::{Context, label};
use super::nodes::{self, Tree};
use super::schema::{AnimationDef, AnimationSamplerDef, ChannelDef};
use crate::Result;
use crate::scene::{Animation, Channel, Interpolation, LocalTransform, Node, NodeId, Property, Track};
use glam::{Quat, Vec3, Vec4};
use serde::Deserialize;
use std::collections::BTreeSet;

/// What a channel drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Path {
    Translation,
    Rotation,
    Scale,
    Weights,
    Visibility,
}

impl Path {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "translation" => Self::Translation,
            "rotation" => Self::Rotation,
            "scale" => Self::Scale,
            "weights" => Self::Weights,
            _ => return None,
        })
    }
}

/// All animations of the file, with the channels that move our nodes.
pub(super) fn load(
    ctx: &Context<'_>,
    buffers: &Buffers,
    tree: &Tree,
    nodes: &mut [Node],
    targets: impl Fn(&Node) -> usize,
) -> Result<Vec<Animation>> {
    let mut animations = Vec::new();
    for (index, def) in ctx.doc.animations.iter().enumerate() {
        let object = label("animation", index, &def.name);
        let mut animation = Animation { name: def.name.clone(), channels: Vec::new() };
        let mut seen = BTreeSet::new();
        for (c, channel) in def.channels.iter().enumerate() {
            let object = format!("{object}, channel {c}");
            let Some((node, path)) = target(ctx, channel, tree, &object)? else { continue };
            if !seen.insert((node, path)) {
                ctx.warn(object, "drives what an earlier channel drives already, and is ignored");
                continue;
            }
            let width = if path == Path::Weights { targets(&nodes[node]) } else { 1 };
            if width == 0 {
                ctx.warn(object, format!("drives morph weights of {}, which has none", called(nodes, node)));
                continue;
            }
            if matches!(path, Path::Translation | Path::Rotation | Path::Scale)
                && !separate(ctx, &mut nodes[node], &object)
            {
                continue;
            }
            let sampler = sampler(ctx, def, channel, &object)?;
            if let Some(property) = property(ctx, buffers, sampler, (path, width), &object)? {
                animation.channels.push(Channel { node, property });
            }
        }
        animations.push(animation);
    }
    Ok(animations)
}

fn called(nodes: &[Node], node: NodeId) -> String {
    label("node", node, &nodes[node].name)
}

fn sampler<'d>(
    ctx: &Context<'_>,
    def: &'d AnimationDef,
    channel: &ChannelDef,
    object: &str,
) -> Result<&'d AnimationSamplerDef> {
    let index = channel.sampler.ok_or_else(|| ctx.error(object, "names no sampler"))?;
    ctx.get(&def.samplers, index, "sampler", object)
}

/// The node and what of it moves; `None` where nothing of ours does.
fn target(ctx: &Context<'_>, channel: &ChannelDef, tree: &Tree, object: &str) -> Result<Option<(NodeId, Path)>> {
    let (file, path) = if channel.target.path == "pointer" {
        match pointer(ctx, channel, object)? {
            Some(found) => found,
            None => return Ok(None),
        }
    } else {
        let Some(node) = channel.target.node else { return Ok(None) };
        let Some(path) = Path::from_name(&channel.target.path) else {
            ctx.warn(object, format!("drives the unknown \"{}\"", channel.target.path.escape_debug()));
            return Ok(None);
        };
        (node, path)
    };
    let ours = ctx.get(&tree.ours, file, "node", object)?;
    Ok(ours.map(|node| (node, path)))
}

/// What a channel of `KHR_animation_pointer` drives, if it is something of a node.
fn pointer(ctx: &Context<'_>, channel: &ChannelDef, object: &str) -> Result<Option<(usize, Path)>> {
    #[derive(Default, Deserialize)]
    #[serde(default)]
    struct Pointer {
        pointer: String,
    }
    let Pointer { pointer } =
        ctx.extension(&channel.target.extensions, "KHR_animation_pointer", object)?.unwrap_or_default();
    let parts: Vec<&str> = pointer.split('/').collect();
    let found = match parts.as_slice() {
        ["", "nodes", node, "extensions", "KHR_node_visibility", "visible"] => Some((*node, Path::Visibility)),
        ["", "nodes", node, path] => Path::from_name(path).map(|path| (*node, path)),
        _ => None,
    };
    match found.and_then(|(node, path)| Some((node.parse().ok()?, path))) {
        Some(found) => Ok(Some(found)),
        None => {
            ctx.warn(object, format!("drives \"{}\", which cannot be animated", pointer.escape_debug()));
            Ok(None)
        }
    }
}

/// Takes a matrix apart so that its parts can move; `false` where that is impossible.
fn separate(ctx: &Context<'_>, node: &mut Node, object: &str) -> bool {
    let LocalTransform::Matrix(matrix) = node.local else { return true };
    let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
    if !(scale.is_finite() && rotation.is_finite() && rotation.length_squared() > 0.5 && translation.is_finite()) {
        ctx.warn(object, "drives a node whose matrix cannot be taken apart, and is ignored");
        return false;
    }
    ctx.warn(object, "drives a node that has a matrix; it is taken apart");
    let rotation = rotation.normalize().as_quat();
    node.local = LocalTransform::Parts { translation: translation.as_vec3(), rotation, scale: scale.as_vec3() };
    true
}

/// Key times in seconds: finite, ascending, at least one.
fn times(ctx: &Context<'_>, buffers: &Buffers, sampler: &AnimationSamplerDef, object: &str) -> Result<Vec<f64>> {
    let about = format!("{object}, key times");
    let input = sampler.input.ok_or_else(|| ctx.error(object, "its sampler names no input"))?;
    let elements = accessors::read(ctx, buffers, input, &about)?.expect(ctx, &[1], &about)?;
    let times = elements.floats(ctx, Integers::AsStored, &about)?;
    if let Some(bad) = times.iter().position(|t| !t.is_finite()) {
        return Err(ctx.error(about, format!("key {bad} is at {}, which is not finite", times[bad])));
    }
    if let Some(bad) = times.windows(2).position(|w| w[1] < w[0]) {
        let problem = format!(
            "key {} is at {} s, before key {bad} at {} s; keys must ascend",
            bad + 1,
            times[bad + 1],
            times[bad]
        );
        return Err(ctx.error(about, problem));
    }
    ctx.charge(times.len() as u64 * 8, &about)?;
    Ok(times.into_iter().map(f64::from).collect())
}

/// The curve of a channel; `None`, with a warning, where it has no keys.
fn property(
    ctx: &Context<'_>,
    buffers: &Buffers,
    sampler: &AnimationSamplerDef,
    (path, width): (Path, usize),
    object: &str,
) -> Result<Option<Property>> {
    let mut interpolation = match sampler.interpolation.as_deref() {
        None | Some("LINEAR") => Interpolation::Linear,
        Some("STEP") => Interpolation::Step,
        Some("CUBICSPLINE") => Interpolation::CubicSpline,
        Some(other) => {
            ctx.warn(object, format!("has the unknown interpolation \"{}\"; it is linear", other.escape_debug()));
            Interpolation::Linear
        }
    };
    let times = times(ctx, buffers, sampler, object)?;
    if times.is_empty() {
        ctx.warn(object, "has no keys");
        return Ok(None);
    }
    let components = match path {
        Path::Translation | Path::Scale => 3,
        Path::Rotation => 4,
        Path::Weights | Path::Visibility => 1,
    };
    let integers = if matches!(path, Path::Rotation | Path::Weights) { Integers::Unit } else { Integers::AsStored };
    let values = values(ctx, buffers, sampler, (&times, width, interpolation), (components, integers), object)?;
    let vec3s = || values.chunks_exact(3).map(Vec3::from_slice).collect();
    let property = match path {
        Path::Translation => Property::Translation(Track { times, values: vec3s(), width, interpolation }),
        Path::Scale => Property::Scale(Track { times, values: vec3s(), width, interpolation }),
        Path::Rotation => {
            let values = rotations(ctx, &values, interpolation, object);
            Property::Rotation(Track { times, values, width, interpolation })
        }
        Path::Weights => Property::Weights(Track { times, values, width, interpolation }),
        Path::Visibility => {
            interpolation = Interpolation::Step;
            let values = values.iter().map(|&v| if v > 0.0 { 1.0 } else { 0.0 }).collect();
            Property::Visibility(Track { times, values, width, interpolation })
        }
    };
    Ok(Some(property))
}

/// The key values as floats, as many as the keys need.
fn values(
    ctx: &Context<'_>,
    buffers: &Buffers,
    sampler: &AnimationSamplerDef,
    (times, width, interpolation): (&[f64], usize, Interpolation),
    (components, integers): (usize, Integers),
    object: &str,
) -> Result<Vec<f32>> {
    let about = format!("{object}, key values");
    let output = sampler.output.ok_or_else(|| ctx.error(object, "its sampler names no output"))?;
    let elements = accessors::read(ctx, buffers, output, &about)?.expect(ctx, &[components], &about)?;
    let per_key = width * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
    let wanted = times.len().saturating_mul(per_key);
    if elements.count < wanted {
        let problem = format!("are {} where {} keys need {wanted}", elements.count, times.len());
        return Err(ctx.error(about, problem));
    }
    if elements.count > wanted {
        ctx.warn(
            &about,
            format!("are {} where {} keys need {wanted}; the rest is ignored", elements.count, times.len()),
        );
    }
    let mut values = elements.floats(ctx, integers, &about)?;
    values.truncate(wanted * components);
    match values.iter().position(|v| !v.is_finite()) {
        Some(bad) => {
            let key = bad / (components * per_key);
            Err(ctx.error(about, format!("key {key} holds {}, which is not finite", values[bad])))
        }
        None => Ok(values),
    }
}

/// Unit quaternions; tangents of cubic curves stay as they are.
fn rotations(ctx: &Context<'_>, values: &[f32], interpolation: Interpolation, object: &str) -> Vec<Quat> {
    values
        .chunks_exact(4)
        .enumerate()
        .map(|(i, q)| {
            let q = Vec4::from_slice(q);
            if interpolation == Interpolation::CubicSpline && i % 3 != 1 {
                Quat::from_vec4(q)
            } else {
                nodes::rotation(ctx, q, object)
            }
        })
        .collect()
}
