//! Rounding bounds, ulp steps, reproducible sums and elementary functions: every tolerance, named and derived.
//!
//! Elementary functions come from the crate `libm`, not from the operating system's C library: glibc picks other
//! code paths on processors with FMA, and a picture must not depend on the machine that computed it.

use glam::Vec3;

/// Unit roundoff of `f32`: half the distance from 1 to the next number.
pub const UNIT_ROUNDOFF: f32 = f32::EPSILON * 0.5;

/// The largest `f32` below one: what a coordinate in [0, 1) is clamped to.
pub const ONE_MINUS: f32 = 1.0 - UNIT_ROUNDOFF;

/// γₙ = n u / (1 − n u): bounds the relative error of n successive roundings (Higham 2002, lemma 3.1).
#[must_use]
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * UNIT_ROUNDOFF;
    nu / (1.0 - nu)
}

/// Sine and cosine of `x` radians, the same on every machine.
#[must_use]
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    libm::sincosf(x)
}

/// The interval of a 32-bit hash as a coordinate in [0, 1): its upper 24 bits, so that no rounding reaches 1.
#[must_use]
#[inline]
#[allow(clippy::cast_precision_loss, reason = "24 bits are exact in f32")]
pub fn unit_from_bits(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// A mixing of 64 bits in which every input bit moves every output bit (the finaliser of SplitMix64,
/// Steele, Lea and Flood 2014).
#[must_use]
#[inline]
pub const fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Luminance of linear Rec. 709 radiance.
#[must_use]
#[inline]
pub fn luminance(rgb: Vec3) -> f32 {
    rgb.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_hash_maps_to_one() {
        assert!(unit_from_bits(u32::MAX) < 1.0);
        assert_eq!(unit_from_bits(0).to_bits(), 0.0_f32.to_bits());
    }
}
