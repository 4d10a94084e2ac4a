//! Index streams: triangles by the edges and vertices seen last, sequences by differences.

/// Vertices and edges seen last; reads and writes wrap.
struct Recent {
    edges: [[u32; 2]; 16],
    edge: usize,
    vertices: [u32; 16],
    vertex: usize,
}

impl Recent {
    fn push_edge(&mut self, a: u32, b: u32) {
        self.edges[self.edge] = [a, b];
        self.edge = (self.edge + 1) & 15;
    }

    fn push_vertex(&mut self, v: u32, keep: bool) {
        self.vertices[self.vertex] = v;
        self.vertex = (self.vertex + usize::from(keep)) & 15;
    }

    fn edge_back(&self, n: usize) -> [u32; 2] {
        self.edges[self.edge.wrapping_sub(n) & 15]
    }

    fn vertex_back(&self, n: usize) -> u32 {
        self.vertices[self.vertex.wrapping_sub(n) & 15]
    }
}

/// Bytes up to a fixed end.
struct Bytes<'a> {
    data: &'a [u8],
    at: usize,
}

impl Bytes<'_> {
    fn next(&mut self) -> Result<u8, String> {
        let byte = *self.data.get(self.at).ok_or("ends within its data")?;
        self.at += 1;
        Ok(byte)
    }

    /// Seven bits a byte, lowest first, at most five bytes.
    fn varint(&mut self) -> Result<u32, String> {
        let mut value = 0_u32;
        for shift in [0, 7, 14, 21, 28] {
            let byte = self.next()?;
            value |= u32::from(byte & 127) << shift;
            if byte < 128 {
                break;
            }
        }
        Ok(value)
    }

    /// The index that differs from `last` by a zigzag-coded number.
    fn index(&mut self, last: u32) -> Result<u32, String> {
        Ok(last.wrapping_add(unzigzag(self.varint()?)))
    }
}

fn unzigzag(v: u32) -> u32 {
    (v >> 1) ^ (v & 1).wrapping_neg()
}

fn push(out: &mut Vec<u8>, index: u32, stride: usize) {
    out.extend_from_slice(&index.to_le_bytes()[..stride]);
}

/// Decodes `count` indices, a multiple of three, of `stride` bytes each.
pub(super) fn triangles(source: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let (&header, body) = source.split_first().ok_or("is empty")?;
    let version = header & 0x0f;
    if header & 0xf0 != 0xe0 || version > 1 {
        return Err(format!("starts with {header:#04x}, expected a triangle stream of version 0 or 1"));
    }
    if body.len() < count / 3 + 16 {
        return Err("is too short for its triangles".into());
    }
    let (codes, rest) = body.split_at(count / 3);
    let (data, table) = rest.split_at(rest.len() - 16);
    let mut data = Bytes { data, at: 0 };
    let mut recent = Recent { edges: [[u32::MAX; 2]; 16], edge: 0, vertices: [u32::MAX; 16], vertex: 0 };
    let (mut next, mut last) = (0_u32, 0_u32);
    let vertex_codes = if version >= 1 { 13 } else { 15 };
    let mut out = Vec::with_capacity(count * stride);
    for &code in codes {
        let triangle = if code < 0xf0 {
            continue_strip(code, vertex_codes, &mut recent, &mut data, &mut next, &mut last)?
        } else {
            start_strip(code, table, &mut recent, &mut data, &mut next, &mut last)?
        };
        for index in triangle {
            push(&mut out, index, stride);
        }
    }
    if data.at == data.data.len() { Ok(out) } else { Err("does not end where its data does".into()) }
}

/// A triangle on a recent edge.
fn continue_strip(
    code: u8,
    vertex_codes: u8,
    recent: &mut Recent,
    data: &mut Bytes<'_>,
    next: &mut u32,
    last: &mut u32,
) -> Result<[u32; 3], String> {
    let [a, b] = recent.edge_back(1 + usize::from(code >> 4));
    let third = code & 15;
    let (c, keep) = if third == 0 {
        *next = next.wrapping_add(1);
        (next.wrapping_sub(1), true)
    } else if third < vertex_codes {
        (recent.vertex_back(1 + usize::from(third)), false)
    } else {
        *last = match third {
            13 => last.wrapping_sub(1),
            14 => last.wrapping_add(1),
            _ => data.index(*last)?,
        };
        (*last, true)
    };
    recent.push_vertex(c, keep);
    recent.push_edge(c, b);
    recent.push_edge(a, c);
    Ok([a, b, c])
}

/// A triangle that shares no recent edge.
fn start_strip(
    code: u8,
    table: &[u8],
    recent: &mut Recent,
    data: &mut Bytes<'_>,
    next: &mut u32,
    last: &mut u32,
) -> Result<[u32; 3], String> {
    let (first, aux) = match code {
        0xfe => (0, data.next()?),
        0xff => (15, data.next()?),
        _ => (0, table[usize::from(code & 15)]),
    };
    if code >= 0xfe && aux == 0 {
        *next = 0;
    }
    let parts = [first, aux >> 4, aux & 15];
    let mut triangle = [0_u32; 3];
    for (corner, part) in triangle.iter_mut().zip(parts) {
        *corner = match part {
            0 => {
                *next = next.wrapping_add(1);
                next.wrapping_sub(1)
            }
            15 => 0,
            n => recent.vertex_back(usize::from(n)),
        };
    }
    for (corner, part) in triangle.iter_mut().zip(parts) {
        if part == 15 {
            *last = data.index(*last)?;
            *corner = *last;
        }
    }
    for (corner, part) in triangle.into_iter().zip(parts) {
        recent.push_vertex(corner, matches!(part, 0 | 15));
    }
    let [a, b, c] = triangle;
    recent.push_edge(b, a);
    recent.push_edge(c, b);
    recent.push_edge(a, c);
    Ok(triangle)
}

/// Decodes `count` indices of `stride` bytes each, in any order.
pub(super) fn sequence(source: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let (&header, body) = source.split_first().ok_or("is empty")?;
    if header & 0xf0 != 0xd0 || header & 0x0f > 1 {
        return Err(format!("starts with {header:#04x}, expected an index stream of version 0 or 1"));
    }
    if body.len() < count.saturating_add(4) {
        return Err("is too short for its indices".into());
    }
    let mut data = Bytes { data: &body[..body.len() - 4], at: 0 };
    let mut last = [0_u32; 2];
    let mut out = Vec::with_capacity(count * stride);
    for _ in 0..count {
        let code = data.varint()?;
        let base = &mut last[(code & 1) as usize];
        *base = base.wrapping_add(unzigzag(code >> 1));
        push(&mut out, *base, stride);
    }
    if data.at == data.data.len() { Ok(out) } else { Err("does not end where its data does".into()) }
}
