//! Light from all around: equirectangular pictures from files, and cube maps turned into them.

use super::decode::{self, Decoded};
use super::{Image, Pixels};
use crate::{Error, Result};
use exr::prelude as exr;
use glam::{Quat, Vec3};
use rayon::prelude::*;
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// Most bytes of pixels in an environment.
const LARGEST: u64 = 1 << 30;

/// Loads an equirectangular picture as scene-linear radiance: `.hdr` and `.exr` as they are, PNG, JPEG and WebP from
/// sRGB. Negative values, which filters leave in HDR pictures, become 0.
///
/// # Errors
/// If the file cannot be read or decoded, holds values that are not finite, or is larger than 1 GiB once decoded.
pub fn load_environment(path: &Path) -> Result<Image> {
    let about = fs::metadata(path).map_err(|e| Error::io(path, "read", e))?;
    let bad = |problem: String| Error::Picture { path: path.to_path_buf(), problem };
    if !about.is_file() || about.len() > LARGEST {
        return Err(bad("expected a regular file of at most 1024 MiB".into()));
    }
    let bytes = fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    let exr_magic = [0x76, 0x2f, 0x31, 0x01];
    let decoded = if bytes.starts_with(&exr_magic) {
        decode::guarded("OpenEXR", || open_exr(&bytes))
    } else {
        decode::picture(&bytes, LARGEST / 4)
    };
    let decoded = decoded.map_err(|problem| bad(format!("cannot be decoded: {problem}")))?;
    let mut image = linear(path.file_stem().unwrap_or_default().to_string_lossy().into_owned(), decoded);
    let width = image.width as usize;
    if let Pixels::RgbF32(pixels) = &mut image.pixels {
        for (i, p) in pixels.iter_mut().enumerate() {
            if p.iter().any(|v| !v.is_finite()) {
                return Err(bad(format!("the pixel ({}, {}) is not finite", i % width, i / width)));
            }
            *p = p.map(|v| v.max(0.0));
        }
    }
    Ok(image)
}

fn open_exr(bytes: &[u8]) -> Result<Decoded, String> {
    use self::exr::{ReadChannels as _, ReadLayers as _};
    let meta = exr::MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| e.to_string())?;
    let size = meta.headers.first().ok_or("has no layer")?.layer_size;
    if size.area() as u64 > LARGEST / 16 || meta.headers.len() > 64 {
        return Err(format!("its {} x {} pixels are too many", size.width(), size.height()));
    }
    let image = exr::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.width(), vec![[0.0_f32; 3]; size.area()]),
            |(width, pixels): &mut (usize, Vec<[f32; 3]>), at, (r, g, b, _): (f32, f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let (width, pixels) = image.layer_data.channel_data.pixels;
    let height = pixels.len() / width.max(1);
    let side = |n: usize| u32::try_from(n).map_err(|e| e.to_string());
    Ok(Decoded { width: side(width)?, height: side(height)?, pixels: Pixels::RgbF32(pixels) })
}

/// A stored value in [0, 1] to linear light (IEC 61966-2-1).
fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { libm::powf((v + 0.055) / 1.055, 2.4) }
}

/// Scene-linear pixels; integers are taken as sRGB.
fn linear(name: String, decoded: Decoded) -> Image {
    let pixels = match decoded.pixels {
        Pixels::RgbF32(pixels) => pixels,
        Pixels::Rgba8(pixels) => {
            let table: Vec<f32> = (0..=255_u8).map(|v| linear_from_srgb(f32::from(v) / 255.0)).collect();
            pixels.iter().map(|p| [0, 1, 2].map(|c: usize| table[usize::from(p[c])])).collect()
        }
        Pixels::Rgba16(pixels) => {
            pixels.iter().map(|p| [0, 1, 2].map(|c: usize| linear_from_srgb(f32::from(p[c]) / 65535.0))).collect()
        }
    };
    Image { name, width: decoded.width, height: decoded.height, pixels: Pixels::RgbF32(pixels) }
}

/// How the pixels of a cube map's face are packed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Packing {
    /// sRGB.
    Plain,
    /// sRGB divided by alpha.
    DividedByAlpha,
}

/// One face of a cube map, scene-linear, square.
pub(crate) struct Face {
    side: usize,
    pixels: Vec<Vec3>,
}

impl Face {
    /// Unpacks a decoded picture; `None` if it is not square.
    pub(crate) fn unpack(decoded: Decoded, packing: Packing) -> Option<Self> {
        let side = decoded.width as usize;
        if decoded.width != decoded.height {
            return None;
        }
        let alphas: Option<Vec<f32>> = match (&decoded.pixels, packing) {
            (Pixels::Rgba8(p), Packing::DividedByAlpha) => {
                Some(p.iter().map(|p| f32::from(p[3].max(1)) / 255.0).collect())
            }
            (Pixels::Rgba16(p), Packing::DividedByAlpha) => {
                Some(p.iter().map(|p| f32::from(p[3].max(1)) / 65535.0).collect())
            }
            _ => None,
        };
        let Pixels::RgbF32(rgb) = linear(String::new(), decoded).pixels else { return None };
        let pixels = match alphas {
            Some(alphas) => rgb.iter().zip(alphas).map(|(p, a)| Vec3::from(*p) / a).collect(),
            None => rgb.into_iter().map(Vec3::from).collect(),
        };
        Some(Self { side, pixels })
    }

    /// Texels along an edge.
    pub(crate) fn side(&self) -> usize {
        self.side
    }

    /// Bilinear lookup at (s, t) in [0, 1]², clamped at the edges.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "texel coordinates, clamped to the face"
    )]
    fn at(&self, s: f32, t: f32) -> Vec3 {
        let most = (self.side - 1) as f32;
        let (x, y) = ((s * self.side as f32 - 0.5).clamp(0.0, most), (t * self.side as f32 - 0.5).clamp(0.0, most));
        let (x0, y0) = (x as usize, y as usize);
        let (x1, y1) = ((x0 + 1).min(self.side - 1), (y0 + 1).min(self.side - 1));
        let pixel = |x: usize, y: usize| self.pixels[y * self.side + x];
        let (fx, fy) = (x - x0 as f32, y - y0 as f32);
        pixel(x0, y0).lerp(pixel(x1, y0), fx).lerp(pixel(x0, y1).lerp(pixel(x1, y1), fx), fy)
    }
}

/// An equirectangular picture of a cube map whose faces stand in the order +x, −x, +y, −y, +z, −z with the
/// orientation of OpenGL's cube maps; `rotation` turns the surroundings.
///
/// As [`super::Environment`] asks, the middle column looks along −z, and columns to the right look to +x.
#[allow(clippy::cast_precision_loss, reason = "pixel coordinates are far below 2²⁴")]
pub(crate) fn from_cube(name: String, faces: &[Face; 6], rotation: Quat) -> Image {
    // A quarter of the width spans what one face does.
    let side = faces[0].side.min(4096);
    let (width, height) = (4 * side, 2 * side);
    let unturn = rotation.inverse();
    let mut pixels = vec![[0.0_f32; 3]; width * height];
    pixels.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
        let (sin_theta, cos_theta) = libm::sincosf((y as f32 + 0.5) / height as f32 * std::f32::consts::PI);
        for (x, pixel) in row.iter_mut().enumerate() {
            let phi = ((x as f32 + 0.5) / width as f32 - 0.5) * std::f32::consts::TAU;
            let (sin_phi, cos_phi) = libm::sincosf(phi);
            let direction = Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
            *pixel = look(faces, unturn * direction).to_array();
        }
    });
    let side = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    Image { name, width: side(width), height: side(height), pixels: Pixels::RgbF32(pixels) }
}

/// What a cube map shows in a direction (OpenGL 4.6, section 8.13).
fn look(faces: &[Face; 6], d: Vec3) -> Vec3 {
    let a = d.abs();
    let (face, s, t, m) = if a.x >= a.y && a.x >= a.z {
        if d.x > 0.0 { (0, -d.z, -d.y, a.x) } else { (1, d.z, -d.y, a.x) }
    } else if a.y >= a.z {
        if d.y > 0.0 { (2, d.x, d.z, a.y) } else { (3, d.x, -d.z, a.y) }
    } else if d.z > 0.0 {
        (4, d.x, -d.y, a.z)
    } else {
        (5, -d.x, -d.y, a.z)
    };
    faces[face].at(0.5 * (s / m + 1.0), 0.5 * (t / m + 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cube_of_six_colours_lies_where_its_axes_point() {
        let colours = [Vec3::X, Vec3::ONE - Vec3::X, Vec3::Y, Vec3::ONE - Vec3::Y, Vec3::Z, Vec3::ONE - Vec3::Z];
        let faces = colours.map(|c| Face { side: 8, pixels: vec![c; 64] });
        let image = from_cube(String::new(), &faces, Quat::IDENTITY);
        let Pixels::RgbF32(pixels) = &image.pixels else { panic!("floats") };
        let at = |x: usize, y: usize| Vec3::from(pixels[y * 32 + x]);
        assert_eq!(at(16, 8), colours[5], "the middle looks along −z");
        assert_eq!(at(24, 8), colours[0], "a quarter to the right along +x");
        assert_eq!(at(8, 8), colours[1]);
        assert_eq!(at(0, 8), colours[4]);
        assert_eq!((at(5, 0), at(5, 15)), (colours[2], colours[3]), "row 0 is up");
    }

    #[test]
    fn values_that_are_not_finite_are_refused_by_pixel() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sky.exr");
        let pixel = |x: usize, y: usize| if (x, y) == (2, 1) { (f32::NAN, 0.0, 0.0) } else { (-1.0, 0.5, 2.0) };
        exr::write_rgb_file(&path, 4, 2, pixel).unwrap();
        assert!(load_environment(&path).unwrap_err().to_string().contains("(2, 1)"));
        exr::write_rgb_file(&path, 4, 2, |_, _| (-1.0_f32, 0.5_f32, 2.0_f32)).unwrap();
        let image = load_environment(&path).unwrap();
        let Pixels::RgbF32(pixels) = &image.pixels else { panic!("floats") };
        assert_eq!((image.width, image.height, pixels[7]), (4, 2, [0.0, 0.5, 2.0]));
    }
}
