//! Accessors: numbers of any type, packed or interleaved, sparse or not, as plain vectors.

use super::buffers::Buffers;
use super::context::{Context, label};
use super::schema::{AccessorDef, SparseDef};
use crate::Result;
use glam::{Vec2, Vec3, Vec4};

/// How a component is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(super) fn from_code(code: u64) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    pub(super) const fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

/// Rows and columns of an element; only matrices have more than one column, each of which starts at a multiple of
/// four bytes (glTF 2.0, section 3.6.2.4).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shape {
    rows: usize,
    columns: usize,
}

impl Shape {
    fn from_name(name: &str) -> Option<Self> {
        let (rows, columns) = match name {
            "SCALAR" => (1, 1),
            "VEC2" => (2, 1),
            "VEC3" => (3, 1),
            "VEC4" => (4, 1),
            "MAT2" => (2, 2),
            "MAT3" => (3, 3),
            "MAT4" => (4, 4),
            _ => return None,
        };
        Some(Self { rows, columns })
    }

    const fn components(self) -> usize {
        self.rows * self.columns
    }

    /// Bytes from one column to the next.
    fn column_step(self, component: Component) -> usize {
        let bytes = self.rows * component.size();
        if self.columns == 1 { bytes } else { bytes.next_multiple_of(4) }
    }
}

/// Bytes from the first component of an element to its last; `None` for unknown types.
pub(super) fn element_size(shape: &str, component_type: u64) -> Option<u64> {
    let (shape, component) = (Shape::from_name(shape)?, Component::from_code(component_type)?);
    Some((shape.column_step(component) * (shape.columns - 1) + shape.rows * component.size()) as u64)
}

/// How integers that are not marked as normalised become floats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Integers {
    /// As they are: quantised positions and texture coordinates.
    AsStored,
    /// As fractions all the same: nothing else makes sense for colours, weights and rotations.
    Unit,
}

/// Decoded elements: little-endian components without gaps.
#[derive(Debug, Clone)]
pub(super) struct Elements {
    pub(super) count: usize,
    pub(super) components: usize,
    pub(super) component: Component,
    pub(super) normalized: bool,
    pub(super) bytes: Vec<u8>,
}

/// Reads accessor `index` on behalf of `object`.
pub(super) fn read(ctx: &Context<'_>, buffers: &Buffers, index: usize, object: &str) -> Result<Elements> {
    let def = ctx.get(&ctx.doc.accessors, index, "accessor", object)?;
    let name = format!("{object}, {}", label("accessor", index, ""));
    let shape = Shape::from_name(&def.shape)
        .ok_or_else(|| ctx.error(&name, format!("has the unknown type \"{}\"", def.shape.escape_debug())))?;
    let component = Component::from_code(def.component_type)
        .ok_or_else(|| ctx.error(&name, format!("has the unknown component type {}", def.component_type)))?;
    let size = shape.components() * component.size();
    let total = def
        .count
        .checked_mul(size as u64)
        .ok_or_else(|| ctx.error(&name, format!("has {} elements, more than memory can hold", def.count)))?;
    ctx.charge(total, &name)?;
    // The charge bounds both by 1 GiB.
    let count = usize::try_from(def.count).unwrap_or(0);
    let mut bytes = match def.buffer_view {
        None => vec![0; usize::try_from(total).unwrap_or(0)],
        Some(_) if count == 0 => Vec::new(),
        Some(view) => gather(ctx, buffers, view, (def.byte_offset, count), (shape, component), &name)?,
    };
    if let Some(sparse) = &def.sparse {
        substitute(ctx, buffers, (def, sparse), (shape, component), &mut bytes, &name)?;
    }
    if count == 0 {
        ctx.warn(&name, "has no elements");
    }
    Ok(Elements { count, components: shape.components(), component, normalized: def.normalized, bytes })
}

/// Packs `count` elements of a buffer view from byte `offset` on.
fn gather(
    ctx: &Context<'_>,
    buffers: &Buffers,
    view: usize,
    (offset, count): (u64, usize),
    (shape, component): (Shape, Component),
    name: &str,
) -> Result<Vec<u8>> {
    let view = buffers.view(ctx, view, name)?;
    let source = view.bytes();
    let (column, step) = (shape.rows * component.size(), shape.column_step(component));
    let span = step * (shape.columns - 1) + column;
    let stride = view.stride.map_or(step * shape.columns, |s| usize::try_from(s).unwrap_or(usize::MAX));
    if stride < span {
        return Err(ctx.error(name, format!("needs {span} bytes an element, but its view's stride is {stride}")));
    }
    let end = (count as u64 - 1)
        .checked_mul(stride as u64)
        .and_then(|bytes| bytes.checked_add(offset)?.checked_add(span as u64))
        .filter(|&end| end <= source.len() as u64);
    if end.is_none() {
        return Err(ctx.error(
            name,
            format!("has {count} elements from byte {offset}, more than its view of {} bytes holds", source.len()),
        ));
    }
    let offset = usize::try_from(offset).unwrap_or(usize::MAX);
    if stride == span && shape.columns == 1 {
        return Ok(source[offset..offset + count * span].to_vec());
    }
    let mut out = Vec::with_capacity(count * shape.columns * column);
    for element in 0..count {
        for c in 0..shape.columns {
            let at = offset + element * stride + c * step;
            out.extend_from_slice(&source[at..at + column]);
        }
    }
    Ok(out)
}

/// Replaces the elements that a sparse accessor lists.
fn substitute(
    ctx: &Context<'_>,
    buffers: &Buffers,
    (def, sparse): (&AccessorDef, &SparseDef),
    (shape, component): (Shape, Component),
    bytes: &mut [u8],
    name: &str,
) -> Result<()> {
    if sparse.count > def.count {
        return Err(ctx.error(name, format!("replaces {} of its {} elements", sparse.count, def.count)));
    }
    if sparse.count == 0 {
        return Ok(());
    }
    let count = usize::try_from(sparse.count).unwrap_or(0);
    let kind = Component::from_code(sparse.indices.component_type)
        .filter(|k| matches!(k, Component::U8 | Component::U16 | Component::U32))
        .ok_or_else(|| {
            ctx.error(name, format!("has sparse indices of component type {}", sparse.indices.component_type))
        })?;
    let part = format!("{name}, sparse indices");
    let scalar = Shape { rows: 1, columns: 1 };
    let indices =
        gather(ctx, buffers, sparse.indices.buffer_view, (sparse.indices.byte_offset, count), (scalar, kind), &part)?;
    let part = format!("{name}, sparse values");
    let values =
        gather(ctx, buffers, sparse.values.buffer_view, (sparse.values.byte_offset, count), (shape, component), &part)?;
    let size = shape.components() * component.size();
    let mut before = None;
    for (index, value) in unsigned(&indices, kind).zip(values.chunks_exact(size)) {
        if u64::from(index) >= def.count {
            return Err(ctx.error(name, format!("replaces element {index}, but it has {} of them", def.count)));
        }
        if before.is_some_and(|b| b >= index) {
            ctx.warn(name, "its sparse indices do not ascend");
        }
        before = Some(index);
        bytes[index as usize * size..][..size].copy_from_slice(value);
    }
    Ok(())
}

/// Little-endian unsigned integers.
fn unsigned(bytes: &[u8], kind: Component) -> Box<dyn Iterator<Item = u32> + '_> {
    match kind {
        Component::U16 | Component::I16 => {
            Box::new(bytes.chunks_exact(2).map(|c| u32::from(u16::from_le_bytes([c[0], c[1]]))))
        }
        Component::U32 | Component::F32 => {
            Box::new(bytes.chunks_exact(4).map(|c| u32::from_le_bytes([c[0], c[1], c[2], c[3]])))
        }
        Component::U8 | Component::I8 => Box::new(bytes.iter().map(|&b| u32::from(b))),
    }
}

impl Elements {
    /// Refuses elements of another number of components.
    pub(super) fn expect(self, ctx: &Context<'_>, components: &[usize], object: &str) -> Result<Self> {
        if components.contains(&self.components) {
            Ok(self)
        } else {
            let wanted: Vec<String> = components.iter().map(ToString::to_string).collect();
            Err(ctx.error(
                object,
                format!("has {} components an element, expected {}", self.components, wanted.join(" or ")),
            ))
        }
    }

    /// The components as unsigned integers.
    pub(super) fn unsigned(&self, ctx: &Context<'_>, object: &str) -> Result<Vec<u32>> {
        if !matches!(self.component, Component::U8 | Component::U16 | Component::U32) {
            return Err(ctx.error(object, "expected unsigned integers"));
        }
        ctx.charge(self.count as u64 * self.components as u64 * 4, object)?;
        Ok(unsigned(&self.bytes, self.component).collect())
    }

    /// The components as floats (glTF 2.0, section 3.11, for normalised integers).
    pub(super) fn floats(&self, ctx: &Context<'_>, integers: Integers, object: &str) -> Result<Vec<f32>> {
        ctx.charge(self.count as u64 * self.components as u64 * 4, object)?;
        let integral = self.component != Component::F32;
        if integral && !self.normalized && integers == Integers::Unit {
            ctx.warn(object, "holds integers that are not marked as normalised; they are read as fractions");
        }
        if !integral && self.normalized {
            ctx.warn(object, "marks floats as normalised, which means nothing");
        }
        let unit = integral && (self.normalized || integers == Integers::Unit);
        let bytes = &self.bytes;
        let pairs = || bytes.chunks_exact(2).map(|c| [c[0], c[1]]);
        let words = || bytes.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]);
        Ok(match (self.component, unit) {
            (Component::F32, _) => words().map(f32::from_le_bytes).collect(),
            (Component::I8, false) => bytes.iter().map(|&b| f32::from(i8::from_le_bytes([b]))).collect(),
            (Component::I8, true) => {
                bytes.iter().map(|&b| (f32::from(i8::from_le_bytes([b])) / 127.0).max(-1.0)).collect()
            }
            (Component::U8, false) => bytes.iter().map(|&b| f32::from(b)).collect(),
            (Component::U8, true) => bytes.iter().map(|&b| f32::from(b) / 255.0).collect(),
            (Component::I16, false) => pairs().map(|c| f32::from(i16::from_le_bytes(c))).collect(),
            (Component::I16, true) => pairs().map(|c| (f32::from(i16::from_le_bytes(c)) / 32767.0).max(-1.0)).collect(),
            (Component::U16, false) => pairs().map(|c| f32::from(u16::from_le_bytes(c))).collect(),
            (Component::U16, true) => pairs().map(|c| f32::from(u16::from_le_bytes(c)) / 65535.0).collect(),
            #[allow(clippy::cast_precision_loss, reason = "32-bit integers are rounded to f32 by meaning")]
            (Component::U32, false) => words().map(|c| u32::from_le_bytes(c) as f32).collect(),
            #[allow(clippy::cast_possible_truncation, reason = "a fraction is rounded to f32 by meaning")]
            (Component::U32, true) => {
                words().map(|c| (f64::from(u32::from_le_bytes(c)) / f64::from(u32::MAX)) as f32).collect()
            }
        })
    }

    pub(super) fn vec2s(&self, ctx: &Context<'_>, integers: Integers, object: &str) -> Result<Vec<Vec2>> {
        Ok(self.floats(ctx, integers, object)?.chunks_exact(2).map(Vec2::from_slice).collect())
    }

    pub(super) fn vec3s(&self, ctx: &Context<'_>, integers: Integers, object: &str) -> Result<Vec<Vec3>> {
        Ok(self.floats(ctx, integers, object)?.chunks_exact(3).map(Vec3::from_slice).collect())
    }

    pub(super) fn vec4s(&self, ctx: &Context<'_>, integers: Integers, object: &str) -> Result<Vec<Vec4>> {
        Ok(self.floats(ctx, integers, object)?.chunks_exact(4).map(Vec4::from_slice).collect())
    }
}
