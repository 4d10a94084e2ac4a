//! Buffers and views of them: every range is checked before it is used.

use super::context::{Context, label};
use super::meshopt;
use super::uri;
use crate::{Error, Result};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// The bytes of one buffer view.
#[derive(Clone)]
pub(super) struct View {
    bytes: Rc<Vec<u8>>,
    start: usize,
    end: usize,
    /// Distance between elements, if the view says one.
    pub(super) stride: Option<u64>,
}

impl View {
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[self.start..self.end]
    }
}

/// All buffers. One that cannot be read is an error only when something needs it.
pub(super) struct Buffers {
    buffers: Vec<Result<Rc<Vec<u8>>, String>>,
    decoded: RefCell<HashMap<usize, Rc<Vec<u8>>>>,
}

impl Buffers {
    /// Reads every buffer; `binary` is the GLB's.
    pub(super) fn read(ctx: &Context<'_>, binary: Option<Vec<u8>>) -> Result<Self> {
        let mut binary = binary;
        let mut buffers = Vec::new();
        for (index, def) in ctx.doc.buffers.iter().enumerate() {
            let object = label("buffer", index, "");
            let bytes = match (&def.uri, index) {
                (Some(uri), _) => match uri::read(ctx, uri, &object) {
                    Ok(bytes) => Ok(bytes),
                    Err(Error::Scene { problem, .. }) => Err(problem),
                    Err(e) => Err(e.to_string()),
                },
                (None, 0) if binary.is_some() => Ok(binary.take().unwrap_or_default()),
                (None, _) => Err("has neither a uri nor a binary chunk".to_owned()),
            };
            let bytes = bytes.and_then(|bytes| {
                if (bytes.len() as u64) < def.byte_length {
                    ctx.warn(&object, format!("has {} bytes, expected {}", bytes.len(), def.byte_length));
                }
                if bytes.is_empty() { Err("is empty".to_owned()) } else { Ok(bytes) }
            });
            match &bytes {
                Ok(bytes) => ctx.charge(bytes.len() as u64, &object)?,
                // A fallback for readers without the decompressor has no bytes of its own.
                Err(_) if def.extensions.keys().any(|name| name.ends_with("meshopt_compression")) => {}
                Err(problem) => ctx.warn(&object, problem),
            }
            buffers.push(bytes.map(Rc::new));
        }
        Ok(Self { buffers, decoded: RefCell::default() })
    }

    /// Bytes in buffer `index`, if it could be read.
    pub(super) fn length(&self, index: usize) -> Option<u64> {
        self.buffers.get(index)?.as_ref().ok().map(|b| b.len() as u64)
    }

    /// The bytes of buffer `index` from `offset`, `length` of them.
    pub(super) fn range(
        &self,
        ctx: &Context<'_>,
        index: usize,
        range: (u64, u64),
        object: &str,
    ) -> Result<(Rc<Vec<u8>>, usize, usize)> {
        let buffer = match ctx.get(&self.buffers, index, "buffer", object)? {
            Ok(bytes) => bytes,
            Err(problem) => return Err(ctx.error(label("buffer", index, ""), problem)),
        };
        let (offset, length) = range;
        let end = offset.checked_add(length).filter(|&end| end <= buffer.len() as u64).ok_or_else(|| {
            ctx.error(
                object,
                format!("covers {length} bytes from byte {offset}, but buffer {index} ends at byte {}", buffer.len()),
            )
        })?;
        // Both are at most the length of a slice in memory.
        let (start, end) = (usize::try_from(offset).unwrap_or(usize::MAX), usize::try_from(end).unwrap_or(usize::MAX));
        Ok((Rc::clone(buffer), start, end))
    }

    /// The buffer view `index`, decompressed if it is compressed.
    pub(super) fn view(&self, ctx: &Context<'_>, index: usize, object: &str) -> Result<View> {
        let def = ctx.get(&ctx.doc.buffer_views, index, "buffer view", object)?;
        let name = label("buffer view", index, "");
        if let Some(stride) = def.byte_stride
            && (stride == 0 || stride > 1 << 16)
        {
            return Err(ctx.error(name, format!("has a stride of {stride} bytes, expected 4 to 252")));
        }
        for extension in ["KHR_meshopt_compression", "EXT_meshopt_compression"] {
            if let Some(how) = ctx.extension::<meshopt::Compressed>(&def.extensions, extension, &name)? {
                return self.meshopt(ctx, index, &how, &name);
            }
        }
        let (bytes, start, end) = self.range(ctx, def.buffer, (def.byte_offset, def.byte_length), &name)?;
        Ok(View { bytes, start, end, stride: def.byte_stride })
    }

    fn meshopt(&self, ctx: &Context<'_>, index: usize, how: &meshopt::Compressed, name: &str) -> Result<View> {
        let known = self.decoded.borrow().get(&index).cloned();
        let bytes = match known {
            Some(bytes) => bytes,
            None => {
                let (source, start, end) = self.range(ctx, how.buffer, (how.byte_offset, how.byte_length), name)?;
                let size = how.size().ok_or_else(|| ctx.error(name, "its compressed size overflows"))?;
                ctx.charge(size, name)?;
                let decoded = meshopt::decode(how, &source[start..end])
                    .map_err(|problem| ctx.error(name, format!("meshopt: {problem}")))?;
                let decoded = Rc::new(decoded);
                self.decoded.borrow_mut().insert(index, Rc::clone(&decoded));
                decoded
            }
        };
        let end = bytes.len();
        Ok(View { bytes, start: 0, end, stride: Some(how.byte_stride) })
    }
}
