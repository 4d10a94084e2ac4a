//! Levels of halved resolution in linear light.

#![allow(clippy::cast_possible_truncation, reason = "tables are computed in f64 and rounded once")]

use super::ColorSpace;
use crate::scene::{Image, Pixels};
use glam::{DVec4, Vec3, Vec4};
use std::sync::LazyLock;

/// sRGB's electro-optical transfer function (IEC 61966-2-1) on [0, 1].
#[must_use]
pub(super) fn linear_from_srgb(x: f64) -> f64 {
    if x <= 0.040_45 { x / 12.92 } else { libm::pow((x + 0.055) / 1.055, 2.4) }
}

static FROM_SRGB8: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| linear_from_srgb(i as f64 / 255.0) as f32));

static FROM_SRGB16: LazyLock<Vec<f32>> =
    LazyLock::new(|| (0..=65_535).map(|i| linear_from_srgb(f64::from(i) / 65_535.0) as f32).collect());

/// Texel `i` of an image, linear.
#[inline]
pub(super) fn decode(pixels: &Pixels, i: usize, space: ColorSpace) -> Vec4 {
    match pixels {
        Pixels::Rgba8(p) => {
            let [r, g, b, a] = p[i];
            let alpha = f32::from(a) * (1.0 / 255.0);
            match space {
                ColorSpace::Srgb => {
                    let table = &*FROM_SRGB8;
                    Vec4::new(table[r as usize], table[g as usize], table[b as usize], alpha)
                }
                ColorSpace::Linear => Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a)) * (1.0 / 255.0),
            }
        }
        Pixels::Rgba16(p) => {
            let [r, g, b, a] = p[i];
            let alpha = f32::from(a) * (1.0 / 65_535.0);
            match space {
                ColorSpace::Srgb => {
                    let table = &*FROM_SRGB16;
                    Vec4::new(table[r as usize], table[g as usize], table[b as usize], alpha)
                }
                ColorSpace::Linear => {
                    Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a)) * (1.0 / 65_535.0)
                }
            }
        }
        Pixels::RgbF32(p) => Vec3::from_array(p[i]).extend(1.0),
    }
}

/// Storage of one level.
#[derive(Debug)]
enum Texels {
    /// Linear, full scale 65 535.
    Unit(Vec<[u16; 4]>),
    /// Linear, unbounded.
    Float(Vec<[f32; 3]>),
}

#[derive(Debug)]
struct Level {
    width: u32,
    height: u32,
    texels: Texels,
}

/// The levels above full resolution, each half as wide and high (rounded down, at least 1).
#[derive(Debug)]
pub(super) struct Pyramid {
    levels: Vec<Level>,
}

impl Pyramid {
    /// Filters `image` down to one texel, area-weighted, in linear light.
    pub(super) fn new(image: &Image, space: ColorSpace) -> Self {
        let float = matches!(image.pixels, Pixels::RgbF32(_));
        let mut levels: Vec<Level> = Vec::new();
        let (mut width, mut height) = (image.width, image.height);
        while width > 1 || height > 1 {
            let (w, h) = ((width / 2).max(1), (height / 2).max(1));
            let next = {
                let source: &dyn Fn(usize) -> Vec4 = match levels.last() {
                    None => &|i| decode(&image.pixels, i, space),
                    Some(level) => &|i| level.get(i),
                };
                reduce(source, (width, height), (w, h))
            };
            let texels = if float {
                Texels::Float(next.iter().map(|v| v.as_vec4().truncate().to_array()).collect())
            } else {
                Texels::Unit(next.iter().map(|v| quantised(*v)).collect())
            };
            levels.push(Level { width: w, height: h, texels });
            (width, height) = (w, h);
        }
        Self { levels }
    }

    /// The coarsest level's number.
    pub(super) fn top(&self) -> usize {
        self.levels.len()
    }

    /// Columns and rows of level `level` ≥ 1.
    pub(super) fn size(&self, level: usize) -> (u32, u32) {
        let l = &self.levels[level - 1];
        (l.width, l.height)
    }

    /// A texel of level `level` ≥ 1.
    #[inline]
    pub(super) fn texel(&self, level: usize, x: u32, y: u32) -> Vec4 {
        let l = &self.levels[level - 1];
        l.get(y as usize * l.width as usize + x as usize)
    }

    /// Bytes of all levels.
    pub(super) fn bytes(&self) -> usize {
        self.levels
            .iter()
            .map(|l| match &l.texels {
                Texels::Unit(t) => t.len() * 8,
                Texels::Float(t) => t.len() * 12,
            })
            .sum()
    }
}

impl Level {
    #[inline]
    fn get(&self, i: usize) -> Vec4 {
        match &self.texels {
            Texels::Unit(t) => {
                let [r, g, b, a] = t[i];
                Vec4::new(f32::from(r), f32::from(g), f32::from(b), f32::from(a)) * (1.0 / 65_535.0)
            }
            Texels::Float(t) => Vec3::from_array(t[i]).extend(1.0),
        }
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a mean of values in [0, 1]")]
fn quantised(v: DVec4) -> [u16; 4] {
    (v * 65_535.0 + 0.5).clamp(DVec4::ZERO, DVec4::splat(65_535.0)).to_array().map(|x| x as u16)
}

/// Area-weighted means of `from` texels into `to` texels, rows then columns folded into one pass.
fn reduce(source: &dyn Fn(usize) -> Vec4, from: (u32, u32), to: (u32, u32)) -> Vec<DVec4> {
    let columns: Vec<_> = (0..to.0).map(|x| cover(x, from.0, to.0)).collect();
    let mut out = Vec::with_capacity(to.0 as usize * to.1 as usize);
    for y in 0..to.1 {
        let rows = cover(y, from.1, to.1);
        for column in &columns {
            let mut sum = DVec4::ZERO;
            for &(sy, wy) in &rows {
                for &(sx, wx) in column {
                    sum += source(sy as usize * from.0 as usize + sx as usize).as_dvec4() * (wx * wy);
                }
            }
            out.push(sum);
        }
    }
    out
}

/// The source texels under target texel `i`, with weights that sum to 1: two for even sizes, three for odd.
fn cover(i: u32, from: u32, to: u32) -> Vec<(u32, f64)> {
    let ratio = f64::from(from) / f64::from(to);
    let (low, high) = (f64::from(i) * ratio, f64::from(i + 1) * ratio);
    let mut list = Vec::with_capacity(3);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the image's side")]
    let mut s = low.floor() as u32;
    while f64::from(s) < high && s < from {
        let part = high.min(f64::from(s + 1)) - low.max(f64::from(s));
        if part > 0.0 {
            list.push((s, part / ratio));
        }
        s += 1;
    }
    list
}
