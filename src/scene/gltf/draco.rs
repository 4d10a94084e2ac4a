//! `KHR_draco_mesh_compression`, by the crate `draco-core`.

use super::accessors::{Component, Elements};
use super::buffers::Buffers;
use super::context::{Context, LARGEST};
use super::schema::PrimitiveDef;
use crate::Result;
use crate::scene::decode::guarded;
use draco_core::{DataType, DecodeLimits, DecoderBuffer, MeshDecoder, PointAttribute, PointIndex};
use serde::Deserialize;
use std::collections::{BTreeMap, HashMap};

#[derive(Debug, Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Compressed {
    buffer_view: Option<usize>,
    attributes: BTreeMap<String, u32>,
}

/// A decompressed primitive.
pub(super) struct Decoded {
    pub(super) attributes: HashMap<String, Elements>,
    pub(super) indices: Vec<u32>,
}

/// Decompresses `primitive` if it is compressed.
pub(super) fn read(
    ctx: &Context<'_>,
    buffers: &Buffers,
    primitive: &PrimitiveDef,
    object: &str,
) -> Result<Option<Decoded>> {
    const NAME: &str = "KHR_draco_mesh_compression";
    let Some(how) = ctx.extension::<Compressed>(&primitive.extensions, NAME, object)? else { return Ok(None) };
    let view = how.buffer_view.ok_or_else(|| ctx.error(object, format!("{NAME} names no buffer view")))?;
    let view = buffers.view(ctx, view, object)?;
    let allowed = ctx.allowance_left().min(LARGEST / 2);
    let decoded = guarded("Draco", || decode(ctx, view.bytes(), &how, primitive, allowed))
        .map_err(|problem| ctx.error(object, format!("Draco: {problem}")))?;
    let bytes: usize = decoded.attributes.values().map(|e| e.bytes.len()).sum::<usize>() + decoded.indices.len() * 4;
    ctx.charge(bytes as u64, object)?;
    Ok(Some(decoded))
}

fn decode(
    ctx: &Context<'_>,
    bytes: &[u8],
    how: &Compressed,
    primitive: &PrimitiveDef,
    allowed: u64,
) -> Result<Decoded, String> {
    // A face takes about 60 bytes of connectivity while it is decoded, a point at least its position.
    let limits = DecodeLimits::default()
        .with_max_points(allowed / 12)
        .with_max_faces(allowed / 60)
        .with_max_decoded_bytes(allowed);
    let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
    let mut mesh = draco_core::Mesh::new();
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(|e| e.to_string())?;
    let points = mesh.num_points();
    let mut attributes = HashMap::new();
    let mut total = 0_u64;
    for (name, &id) in &how.attributes {
        let attribute =
            mesh.attribute_by_unique_id(id).ok_or_else(|| format!("it has no attribute {id} for {name}"))?;
        total = total.saturating_add(points as u64 * u64::from(attribute.num_components()) * 4);
        if total > allowed {
            return Err(format!("its {points} vertices take more memory than is allowed"));
        }
        let accessor = primitive.attributes.get(name).and_then(serde_json::Value::as_u64);
        let accessor = accessor.and_then(|i| usize::try_from(i).ok()).and_then(|i| ctx.doc.accessors.get(i));
        let normalized = accessor.map_or(attribute.normalized(), |a| a.normalized);
        attributes.insert(name.clone(), elements(attribute, points, normalized));
    }
    let indices = mesh.faces().iter().flat_map(|face| face.iter().map(|p| p.0)).collect();
    Ok(Decoded { attributes, indices })
}

/// An attribute's values in the order of points.
fn elements(attribute: &PointAttribute, points: usize, normalized: bool) -> Elements {
    let components = usize::from(attribute.num_components());
    let component = match attribute.data_type() {
        DataType::Int8 => Some(Component::I8),
        DataType::Uint8 => Some(Component::U8),
        DataType::Int16 => Some(Component::I16),
        DataType::Uint16 => Some(Component::U16),
        DataType::Uint32 => Some(Component::U32),
        DataType::Float32 => Some(Component::F32),
        _ => None,
    };
    let Some(component) = component else {
        let bytes = attribute.read_f32s(points, components).into_iter().flat_map(f32::to_le_bytes).collect();
        return Elements { count: points, components, component: Component::F32, normalized: false, bytes };
    };
    let size = components * component.size();
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or(size);
    let data = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(points * size);
    for point in 0..u32::try_from(points).unwrap_or(u32::MAX) {
        let start = (attribute.mapped_index(PointIndex(point)).0 as usize).saturating_mul(stride);
        match start.checked_add(size).and_then(|end| data.get(start..end)) {
            Some(value) => bytes.extend_from_slice(value),
            None => bytes.resize(bytes.len() + size, 0),
        }
    }
    Elements { count: points, components, component, normalized, bytes }
}
