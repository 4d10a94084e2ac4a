//! What is done to decoded vertex streams: unit vectors, quaternions, floats and colours from packed integers.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    reason = "bit formats: each cast is a step of the specification, on numbers of 8 to 24 bits"
)]

/// Rounds to nearest, halves away from zero, as the specification does.
fn round(v: f32) -> i32 {
    (v + if v >= 0.0 { 0.5 } else { -0.5 }) as i32
}

/// A unit vector from octahedral coordinates; `z` holds the encoding of 1. Lengths of up to `most`.
fn octahedral(x: f32, y: f32, z: f32, most: f32) -> [i32; 3] {
    let z = z - x.abs() - y.abs();
    let t = z.min(0.0);
    let x = x + if x >= 0.0 { t } else { -t };
    let y = y + if y >= 0.0 { t } else { -t };
    let s = most / (x * x + y * y + z * z).sqrt();
    [round(x * s), round(y * s), round(z * s)]
}

pub(super) fn octahedral_8(data: &mut [u8]) {
    for v in data.chunks_exact_mut(4) {
        let c = |i: usize| f32::from(v[i] as i8);
        let n = octahedral(c(0), c(1), c(2), 127.0);
        for (byte, n) in v.iter_mut().zip(n) {
            *byte = n as u8;
        }
    }
}

fn halves(v: &[u8]) -> [i16; 4] {
    std::array::from_fn(|i| i16::from_le_bytes([v[2 * i], v[2 * i + 1]]))
}

fn store(v: &mut [u8], i: usize, value: i32) {
    v[2 * i..2 * i + 2].copy_from_slice(&(value as i16).to_le_bytes());
}

pub(super) fn octahedral_16(data: &mut [u8]) {
    for v in data.chunks_exact_mut(8) {
        let h = halves(v);
        let n = octahedral(f32::from(h[0]), f32::from(h[1]), f32::from(h[2]), 32767.0);
        for (i, n) in n.into_iter().enumerate() {
            store(v, i, n);
        }
    }
}

/// Three smaller components of a unit quaternion; the two lowest bits of the fourth say which one is missing.
pub(super) fn quaternion(data: &mut [u8]) {
    for v in data.chunks_exact_mut(8) {
        let h = halves(v);
        let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(h[3] | 3);
        let [x, y, z] = [h[0], h[1], h[2]].map(|c| f32::from(c) * scale);
        let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let missing = (h[3] & 3) as usize;
        for (i, c) in [w, x, y, z].into_iter().enumerate() {
            store(v, (missing + i) & 3, round(c * 32767.0));
        }
    }
}

/// 24 bits of mantissa times a power of two.
pub(super) fn exponential(data: &mut [u8]) {
    for v in data.chunks_exact_mut(4) {
        let word = u32::from_le_bytes([v[0], v[1], v[2], v[3]]);
        let mantissa = ((word << 8) as i32) >> 8;
        let exponent = (word as i32) >> 24;
        let power = f32::from_bits(((exponent + 127) as u32) << 23);
        v.copy_from_slice(&(mantissa as f32 * power).to_le_bytes());
    }
}

/// RGBA from luma, two chroma differences and alpha, whose highest bit marks the number of bits.
fn color(y: i32, co: i32, cg: i32, alpha: i32, most: f32) -> [i32; 4] {
    let mut mask = alpha;
    for shift in [1, 2, 4, 8] {
        mask |= mask >> shift;
    }
    let alpha = ((alpha << 1) & mask) | (alpha & 1);
    let scale = most / mask as f32;
    [y + co - cg, y + cg, y - co - cg, alpha].map(|c| (c as f32 * scale + 0.5) as i32)
}

pub(super) fn color_8(data: &mut [u8]) {
    for v in data.chunks_exact_mut(4) {
        let c = color(i32::from(v[0]), i32::from(v[1] as i8), i32::from(v[2] as i8), i32::from(v[3]), 255.0);
        for (byte, c) in v.iter_mut().zip(c) {
            *byte = c as u8;
        }
    }
}

pub(super) fn color_16(data: &mut [u8]) {
    for v in data.chunks_exact_mut(8) {
        let h = halves(v);
        let c = color(i32::from(h[0] as u16), i32::from(h[1]), i32::from(h[2]), i32::from(h[3] as u16), 65535.0);
        for (i, c) in c.into_iter().enumerate() {
            store(v, i, c);
        }
    }
}
