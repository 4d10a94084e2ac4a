//! Texture lookup: wrapping, decoding, prefiltered levels and the filters over them.
//!
//! An image is prepared once for each use that the materials make of it (sRGB colour or linear data) as a pyramid of
//! box-filtered levels in linear light (Williams 1983). The full-resolution level is not copied: it is decoded from
//! the scene's own pixels by table. A lookup states its footprint in texture coordinates: the ellipse in which the
//! surface cuts the cone that the integrator carries along the ray (Akenine-Möller et al. 2021, "Improved Shader and
//! Texture Level of Detail Using Ray Cones"). The cone stays round where a flat mirror or a pane turns it; what a curved
//! mirror does to its shape is not carried along.
//!
//! Limits: levels above the first hold 16 bits a channel for 8- and 16-bit images, a rounding of at most 2⁻¹⁷ of full
//! scale; the footprint is that of texture coordinate set 0, whichever set is read.

mod ewa;
mod footprint;
mod pyramid;

pub use footprint::Footprint;

use crate::numeric::ONE_MINUS;
use crate::scene::texture::TexelFilter;
use crate::scene::{Image, Material, Pixels, Scene, Texture, TextureRef, Wrap};
use glam::{Vec2, Vec4};
use pyramid::{Pyramid, decode};

/// How texels become a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TextureFilter {
    /// The full-resolution level alone, whatever the footprint: every texel's detail, and its aliasing.
    Point,
    /// Two neighbouring levels blended by a round footprint of equal area (trilinear).
    #[default]
    Mip,
    /// One texel, drawn with the probability that [`TextureFilter::Mip`] would weigh it: the same mean for an eighth
    /// of the reads, and filtering after shading instead of before (Fajardo et al. 2023, "Stochastic Texture
    /// Filtering").
    Stochastic,
    /// One texel: of trilinear lookups side by side along the footprint's ellipse, as wide as its short axis, one is
    /// drawn, and of that one texel with the probability of its weight.
    #[serde(rename = "stochastic-ewa")]
    StochasticEwa,
    /// Every texel under the footprint's ellipse, weighted by a Gaussian (Heckbert 1989, "Fundamentals of Texture Mapping
    /// and Image Warping", §3.5.9: the elliptical weighted average).
    Ewa,
}

impl TextureFilter {
    /// Whether lookups draw a texel at random.
    #[must_use]
    pub fn draws(self) -> bool {
        matches!(self, Self::Stochastic | Self::StochasticEwa)
    }
}

/// How an image's numbers are meant: decided by the use, not the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColorSpace {
    /// IEC 61966-2-1 encoded colour with linear alpha.
    Srgb,
    /// Plain numbers.
    Linear,
}

/// All textures of a scene, prepared for lookup.
#[derive(Debug)]
pub struct Textures {
    filter: TextureFilter,
    /// By image: the pyramids for sRGB and linear use, where used.
    pyramids: Vec<[Option<Pyramid>; 2]>,
}

impl Textures {
    /// Prepares what the scene's materials use; `filter` decides whether levels are needed at all.
    #[must_use]
    pub fn new(scene: &Scene, filter: TextureFilter) -> Self {
        let mut used = vec![[false; 2]; scene.images.len()];
        for material in &scene.materials {
            for (reference, space) in references(material) {
                used[scene.textures[reference.texture].image][space as usize] = true;
            }
        }
        let pyramids = scene
            .images
            .iter()
            .zip(used)
            .map(|(image, used)| {
                let build = |space: ColorSpace| {
                    (filter != TextureFilter::Point && used[space as usize]).then(|| Pyramid::new(image, space))
                };
                [build(ColorSpace::Srgb), build(ColorSpace::Linear)]
            })
            .collect();
        Self { filter, pyramids }
    }

    /// Bytes that the prepared levels occupy.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.pyramids.iter().flatten().flatten().map(Pyramid::bytes).sum()
    }

    /// The value of `reference` at mesh texture coordinates `uvs` (by set), linear.
    #[must_use]
    pub fn fetch(
        &self,
        scene: &Scene,
        reference: &TextureRef,
        space: ColorSpace,
        uvs: &[Vec2],
        footprint: Footprint,
    ) -> Vec4 {
        let texture = &scene.textures[reference.texture];
        let image = &scene.images[texture.image];
        let uv = reference.transform.transform_point2(uvs.get(reference.uv_set).copied().unwrap_or_default());
        let sampler = Sampler { texture, image, space, pyramid: self.pyramids[texture.image][space as usize].as_ref() };
        if self.filter == TextureFilter::Point || !texture.mipmapped {
            // A sampler without levels asks for the full resolution at any distance.
            return match self.filter {
                TextureFilter::Stochastic | TextureFilter::StochasticEwa => {
                    sampler.drawn(0, uv, texture.magnify, footprint.u)
                }
                _ => sampler.blended(0, uv, texture.magnify),
            };
        }
        let size = Vec2::new(image.width as f32, image.height as f32);
        let ellipse = footprint.in_texels(&reference.transform.matrix2, size);
        let top = sampler.pyramid.map_or(0, Pyramid::top);
        let level_of = |texels: f32| if texels > 1.0 { libm::log2f(texels).min(top as f32) } else { 0.0 };
        match self.filter {
            TextureFilter::Mip | TextureFilter::Point => {
                let level = level_of(ellipse.round_width());
                let filter = if level > 0.0 { texture.minify } else { texture.magnify };
                let (below, share) = whole_and_part(level);
                let a = sampler.blended(below, uv, filter);
                if share > 0.0 { a.lerp(sampler.blended(below + 1, uv, filter), share) } else { a }
            }
            TextureFilter::Stochastic | TextureFilter::StochasticEwa => {
                let (level, place, u) = if self.filter == TextureFilter::Stochastic {
                    (level_of(ellipse.round_width()), Vec2::ZERO, footprint.u)
                } else {
                    let axes = ellipse.axes();
                    let (place, u) = axes.choose(footprint.u);
                    (level_of(axes.minor), place, u)
                };
                let filter = if level > 0.0 { texture.minify } else { texture.magnify };
                let (below, share) = whole_and_part(level);
                let (above, u) = choose(u, share);
                sampler.drawn(below + usize::from(above), uv + place / size, filter, u)
            }
            TextureFilter::Ewa => {
                let axes = ellipse.axes();
                if axes.major <= 1.0 {
                    return sampler.blended(0, uv, texture.magnify);
                }
                let (level, _) = whole_and_part(level_of(axes.minor));
                sampler.ewa(level, uv, &axes)
            }
        }
    }
}

/// Whether a value below `share` came up, and the coordinate rescaled within that outcome.
fn choose(u: f32, share: f32) -> (bool, f32) {
    if u < share { (true, (u / share).min(ONE_MINUS)) } else { (false, ((u - share) / (1.0 - share)).min(ONE_MINUS)) }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a level, from 0 to 31")]
fn whole_and_part(level: f32) -> (usize, f32) {
    let whole = level.floor();
    (whole as usize, level - whole)
}

/// Every texture that a material reads, with the space that its use implies.
fn references(material: &Material) -> Vec<(TextureRef, ColorSpace)> {
    use ColorSpace::{Linear, Srgb};
    let mut list: Vec<(Option<TextureRef>, ColorSpace)> = vec![
        (material.base_color_texture, Srgb),
        (material.metallic_roughness_texture, Linear),
        (material.normal_texture.map(|(t, _)| t), Linear),
        (material.emissive_texture, Srgb),
    ];
    if let Some(s) = &material.specular {
        list.extend([(s.texture, Linear), (s.color_texture, Srgb)]);
    }
    if let Some(t) = &material.transmission {
        list.push((t.texture, Linear));
    }
    if let Some(c) = &material.clearcoat {
        list.extend([(c.texture, Linear), (c.roughness_texture, Linear), (c.normal_texture.map(|(t, _)| t), Linear)]);
    }
    if let Some(s) = &material.sheen {
        list.extend([(s.color_texture, Srgb), (s.roughness_texture, Linear)]);
    }
    if let Some(i) = &material.iridescence {
        list.extend([(i.texture, Linear), (i.thickness_texture, Linear)]);
    }
    if let Some(a) = &material.anisotropy {
        list.push((a.texture, Linear));
    }
    if let Some(d) = &material.diffuse_transmission {
        list.extend([(d.texture, Linear), (d.color_texture, Srgb)]);
    }
    list.into_iter().filter_map(|(t, space)| t.map(|t| (t, space))).collect()
}

/// One texture in one use.
struct Sampler<'a> {
    texture: &'a Texture,
    image: &'a Image,
    space: ColorSpace,
    pyramid: Option<&'a Pyramid>,
}

impl Sampler<'_> {
    fn size(&self, level: usize) -> (u32, u32) {
        match self.pyramid {
            Some(p) if level > 0 => p.size(level),
            _ => (self.image.width, self.image.height),
        }
    }

    fn texel(&self, level: usize, x: u32, y: u32) -> Vec4 {
        match self.pyramid {
            Some(p) if level > 0 => p.texel(level, x, y),
            _ => decode(&self.image.pixels, y as usize * self.image.width as usize + x as usize, self.space),
        }
    }

    /// The value under the texture's own filter, all taps read.
    fn blended(&self, level: usize, uv: Vec2, filter: TexelFilter) -> Vec4 {
        let (width, height) = self.size(level);
        match filter {
            TexelFilter::Nearest => self.texel(
                level,
                nearest(uv.x, width, self.texture.wrap[0]),
                nearest(uv.y, height, self.texture.wrap[1]),
            ),
            TexelFilter::Linear => {
                let x = Taps::new(uv.x, width, self.texture.wrap[0]);
                let y = Taps::new(uv.y, height, self.texture.wrap[1]);
                let upper = self.texel(level, x.first, y.first).lerp(self.texel(level, x.second, y.first), x.share);
                let lower = self.texel(level, x.first, y.second).lerp(self.texel(level, x.second, y.second), x.share);
                upper.lerp(lower, y.share)
            }
        }
    }

    /// One of the taps of [`Sampler::blended`], drawn by `u` with the tap's weight.
    fn drawn(&self, level: usize, uv: Vec2, filter: TexelFilter, u: f32) -> Vec4 {
        let (width, height) = self.size(level);
        match filter {
            TexelFilter::Nearest => self.blended(level, uv, filter),
            TexelFilter::Linear => {
                let x = Taps::new(uv.x, width, self.texture.wrap[0]);
                let y = Taps::new(uv.y, height, self.texture.wrap[1]);
                let (right, u) = choose(u, x.share);
                let (down, _) = choose(u, y.share);
                self.texel(level, if right { x.second } else { x.first }, if down { y.second } else { y.first })
            }
        }
    }
}

/// The two texels of one axis that surround a coordinate.
struct Taps {
    first: u32,
    second: u32,
    share: f32,
}

impl Taps {
    fn new(coordinate: f32, size: u32, wrap: Wrap) -> Self {
        let x = wrapped(coordinate, wrap) * size as f32 - 0.5;
        let below = x.floor();
        #[allow(clippy::cast_possible_truncation, reason = "from −1 to 65 536 after wrapping")]
        let first = below as i32;
        Self { first: index(first, size, wrap), second: index(first + 1, size, wrap), share: x - below }
    }
}

/// The coordinate folded into [0, 1] as the wrap mode says.
fn wrapped(coordinate: f32, wrap: Wrap) -> f32 {
    if !coordinate.is_finite() {
        return 0.0;
    }
    match wrap {
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::Mirror => {
            let half = 0.5 * coordinate;
            1.0 - (1.0 - 2.0 * (half - half.floor())).abs()
        }
    }
}

/// Any texel index, folded into range as the wrap mode says.
#[allow(
    clippy::cast_possible_wrap,
    clippy::cast_sign_loss,
    reason = "image sides are bounded by 2³¹ and the result is in range"
)]
fn index(i: i32, size: u32, wrap: Wrap) -> u32 {
    let size = size as i32;
    (match wrap {
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::Clamp => i.clamp(0, size - 1),
        // Two periods make one of the mirrored picture; the neighbour across an edge is the edge texel itself.
        Wrap::Mirror => {
            let place = i.rem_euclid(2 * size);
            place.min(2 * size - 1 - place)
        }
    }) as u32
}

#[allow(clippy::cast_possible_truncation, reason = "from 0 to the image's side")]
fn nearest(coordinate: f32, size: u32, wrap: Wrap) -> u32 {
    index(
        ((wrapped(coordinate, wrap) * size as f32).floor() as i32).min(i32::MAX - 1),
        size,
        match wrap {
            // Rounding may put a coordinate just below 1 on the far edge, which repeats to the near one.
            Wrap::Repeat | Wrap::Clamp | Wrap::Mirror => Wrap::Clamp,
        },
    )
}

/// The mean of `image` over all of its texels, linear in `space`.
#[must_use]
pub fn mean(image: &Image, space: ColorSpace) -> Vec4 {
    let count = image.width as usize * image.height as usize;
    let mut sum = glam::DVec4::ZERO;
    for i in 0..count {
        sum += decode(&image.pixels, i, space).as_dvec4();
    }
    (sum / count as f64).as_vec4()
}

/// Texel `i` (row by row) of a picture of light: 8- and 16-bit pixels are sRGB, floats are radiance.
#[must_use]
pub fn decode_linear(image: &Image, i: usize) -> glam::Vec3 {
    decode(&image.pixels, i, ColorSpace::Srgb).truncate()
}

/// Whether every texel is usable: no NaN, no infinity, nothing negative.
#[must_use]
pub fn is_sound(image: &Image) -> bool {
    match &image.pixels {
        Pixels::Rgba8(_) | Pixels::Rgba16(_) => true,
        Pixels::RgbF32(p) => p.iter().flatten().all(|x| x.is_finite() && *x >= 0.0),
    }
}

#[cfg(test)]
mod tests;
