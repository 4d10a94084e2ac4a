//! Vertex streams: bytes transposed, delta-coded and packed in groups of sixteen.

const GROUP: usize = 16;

/// Decodes `count` vertices of `stride` bytes.
pub(super) fn decode(source: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let (&header, body) = source.split_first().ok_or("is empty")?;
    let version = header & 0x0f;
    if header & 0xf0 != 0xa0 || version > 1 {
        return Err(format!("starts with {header:#04x}, expected a vertex stream of version 0 or 1"));
    }
    let channels = if version == 0 { 0 } else { stride / 4 };
    let padded = (stride + channels).max(if version == 0 { 32 } else { 24 });
    let blocks_end = body.len().checked_sub(padded).ok_or("ends within its tail")?;
    let tail = &body[body.len() - stride - channels..];
    let mut last: Vec<u8> = tail[..stride].to_vec();
    let mut stream = Stream { data: body, at: 0 };
    let mut out = vec![0; count * stride];
    let block = ((8192 / stride) & !(GROUP - 1)).min(256);
    for vertices in out.chunks_mut(block * stride) {
        decode_block(&mut stream, vertices, &mut last, &tail[stride..], version)?;
    }
    if stream.at == blocks_end { Ok(out) } else { Err("does not end where its data does".into()) }
}

struct Stream<'a> {
    data: &'a [u8],
    at: usize,
}

impl<'a> Stream<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let bytes = self.data.get(self.at..self.at + n).ok_or("ends within a block")?;
        self.at += n;
        Ok(bytes)
    }
}

fn decode_block(
    stream: &mut Stream<'_>,
    vertices: &mut [u8],
    last: &mut [u8],
    channels: &[u8],
    version: u8,
) -> Result<(), String> {
    let stride = last.len();
    let count = vertices.len() / stride;
    let control = stream.take(if version == 0 { 0 } else { stride / 4 })?;
    let mut planes = [[0_u8; 256]; 4];
    for word in 0..stride / 4 {
        for (byte, plane) in planes.iter_mut().enumerate() {
            let mode = if version == 0 { None } else { Some((control[word] >> (byte * 2)) & 3) };
            match mode {
                None => decode_bytes(stream, &mut plane[..count.next_multiple_of(GROUP)], [0, 2, 4, 8])?,
                Some(0) => decode_bytes(stream, &mut plane[..count.next_multiple_of(GROUP)], [0, 1, 2, 4])?,
                Some(1) => decode_bytes(stream, &mut plane[..count.next_multiple_of(GROUP)], [1, 2, 4, 8])?,
                Some(2) => plane.fill(0),
                _ => plane[..count].copy_from_slice(stream.take(count)?),
            }
        }
        let channel = if version == 0 { 0 } else { channels[word] };
        undo_deltas(&planes, vertices, last, word * 4, channel)?;
    }
    last.copy_from_slice(&vertices[(count - 1) * stride..]);
    Ok(())
}

/// Adds up differences of bytes, of 16-bit halves, or by exclusive or of rotated 32-bit words.
fn undo_deltas(
    planes: &[[u8; 256]; 4],
    vertices: &mut [u8],
    last: &[u8],
    at: usize,
    channel: u8,
) -> Result<(), String> {
    let mut before = [last[at], last[at + 1], last[at + 2], last[at + 3]];
    for (i, vertex) in vertices.chunks_exact_mut(last.len()).enumerate() {
        let delta = [planes[0][i], planes[1][i], planes[2][i], planes[3][i]];
        before = match channel & 3 {
            0 => std::array::from_fn(|k| {
                let d = delta[k];
                before[k].wrapping_add((d >> 1) ^ (d & 1).wrapping_neg())
            }),
            1 => {
                let half = |k: usize| {
                    let d = u16::from_le_bytes([delta[k], delta[k + 1]]);
                    let b = u16::from_le_bytes([before[k], before[k + 1]]);
                    b.wrapping_add((d >> 1) ^ (d & 1).wrapping_neg()).to_le_bytes()
                };
                let (low, high) = (half(0), half(2));
                [low[0], low[1], high[0], high[1]]
            }
            2 => {
                let turned = u32::from_le_bytes(delta).rotate_right(u32::from(channel >> 4));
                (turned ^ u32::from_le_bytes(before)).to_le_bytes()
            }
            _ => return Err("has an unknown channel type".into()),
        };
        vertex[at..at + 4].copy_from_slice(&before);
    }
    Ok(())
}

/// Unpacks whole groups; two bits a group choose among four `widths`.
fn decode_bytes(stream: &mut Stream<'_>, out: &mut [u8], widths: [u32; 4]) -> Result<(), String> {
    let header = stream.take((out.len() / GROUP).div_ceil(4))?;
    for (g, group) in out.chunks_exact_mut(GROUP).enumerate() {
        match widths[usize::from((header[g / 4] >> (g % 4 * 2)) & 3)] {
            0 => group.fill(0),
            8 => group.copy_from_slice(stream.take(GROUP)?),
            bits => {
                let packed = stream.take(GROUP * bits as usize / 8)?;
                let escape = (1_u8 << bits) - 1;
                for (i, value) in group.iter_mut().enumerate() {
                    let bit = i * bits as usize;
                    // Wider codes fill a byte from its top, single bits from its bottom.
                    let shift = if bits == 1 { bit % 8 } else { 8 - bits as usize - bit % 8 };
                    let code = (packed[bit / 8] >> shift) & escape;
                    *value = if code == escape { stream.take(1)?[0] } else { code };
                }
            }
        }
    }
    Ok(())
}
