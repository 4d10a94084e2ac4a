//! Textures, samplers and images. Materials ask for textures; images are decoded at the end, all at once.

use super::buffers::{Buffers, View};
use super::context::{Context, LARGEST, label};
use super::schema::{Object, TextureDef, TextureInfo};
use super::uri;
use crate::scene::decode;
use crate::scene::texture::{MAX_UV_SETS, TexelFilter};
use crate::scene::{Image, Material, Pixels, Texture, TextureId, TextureRef, Wrap};
use crate::{Error, Result};
use glam::{Affine2, Mat2, Vec2};
use rayon::prelude::*;
use std::cell::RefCell;
use std::collections::HashMap;

/// What an image becomes on its way from the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Conversion {
    /// Nothing.
    Plain,
    /// Glossiness in alpha, times a factor (bits of `f32`), becomes roughness in green
    /// (`KHR_materials_pbrSpecularGlossiness`).
    RoughnessFromGlossiness(u32),
}

/// What the materials asked for so far.
#[derive(Default)]
pub(super) struct Wanted {
    textures: RefCell<Vec<Texture>>,
    images: RefCell<Vec<(usize, Conversion)>>,
    known: RefCell<HashMap<(usize, Conversion), Option<TextureId>>>,
}

/// The bytes of an encoded image.
pub(super) enum Source {
    View(View),
    Bytes(Vec<u8>),
}

impl Source {
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::View(view) => view.bytes(),
            Self::Bytes(bytes) => bytes,
        }
    }
}

impl Wanted {
    /// The texture that `info` refers to, with its transform; `None` if it has no image.
    pub(super) fn reference(
        &self,
        ctx: &Context<'_>,
        info: &TextureInfo,
        conversion: Conversion,
        object: &str,
    ) -> Result<Option<TextureRef>> {
        let Some(texture) = self.texture(ctx, info.index, conversion, object)? else { return Ok(None) };
        let (transform, over) = transform(ctx, &info.extensions, object)?;
        let uv_set = over.unwrap_or(info.tex_coord);
        if uv_set >= MAX_UV_SETS {
            ctx.warn(object, format!("reads texture coordinate set {uv_set}; sets 0 to {} are read", MAX_UV_SETS - 1));
            return Ok(None);
        }
        Ok(Some(TextureRef { texture, uv_set, transform }))
    }

    fn texture(
        &self,
        ctx: &Context<'_>,
        index: usize,
        conversion: Conversion,
        object: &str,
    ) -> Result<Option<TextureId>> {
        if let Some(&known) = self.known.borrow().get(&(index, conversion)) {
            return Ok(known);
        }
        let def = ctx.get(&ctx.doc.textures, index, "texture", object)?;
        let name = label("texture", index, "");
        let id = match source(ctx, def, &name)? {
            None => {
                ctx.warn(&name, "has no image that can be read; it counts as absent");
                None
            }
            Some(image) => {
                ctx.get(&ctx.doc.images, image, "image", &name)?;
                let mut images = self.images.borrow_mut();
                let wanted = (image, conversion);
                let slot = images.iter().position(|&i| i == wanted).unwrap_or_else(|| {
                    images.push(wanted);
                    images.len() - 1
                });
                let mut textures = self.textures.borrow_mut();
                textures.push(sampled(ctx, def, slot, &name)?);
                Some(textures.len() - 1)
            }
        };
        self.known.borrow_mut().insert((index, conversion), id);
        Ok(id)
    }

    /// Decodes all images. What cannot be decoded is taken out of `materials` with a warning.
    pub(super) fn decode(
        self,
        ctx: &Context<'_>,
        buffers: &Buffers,
        materials: &mut [Material],
    ) -> Result<(Vec<Texture>, Vec<Image>)> {
        let wanted = self.images.into_inner();
        let mut sources = Vec::with_capacity(wanted.len());
        for &(image, _) in &wanted {
            sources.push(fetch(ctx, buffers, image)?);
        }
        let bytes: Vec<Option<&[u8]>> = sources.iter().map(|s| s.as_ref().map(Source::bytes)).collect();
        let decoded: Vec<Option<Result<decode::Decoded, String>>> =
            bytes.par_iter().map(|bytes| bytes.map(|b| decode::picture(b, LARGEST))).collect();
        let mut images = Vec::new();
        let mut places = Vec::with_capacity(wanted.len());
        for (&(index, conversion), decoded) in wanted.iter().zip(decoded) {
            let name = label("image", index, &ctx.doc.images[index].name);
            match decoded {
                None => places.push(None),
                Some(Err(problem)) => {
                    ctx.warn(&name, format!("cannot be decoded ({problem}); its textures count as absent"));
                    places.push(None);
                }
                Some(Ok(decoded)) => {
                    places.push(Some(images.len()));
                    let image = Image {
                        name: ctx.doc.images[index].name.clone(),
                        width: decoded.width,
                        height: decoded.height,
                        pixels: decoded.pixels,
                    };
                    images.push(convert(image, conversion));
                }
            }
        }
        let mut textures = self.textures.into_inner();
        let moved = compact(&mut textures, &places);
        for material in materials {
            material.retain_textures(&mut |reference| match moved[reference.texture] {
                Some(texture) => {
                    reference.texture = texture;
                    true
                }
                None => false,
            });
        }
        Ok((textures, images))
    }
}

/// Drops textures whose image is gone; says where the others went.
fn compact(textures: &mut Vec<Texture>, places: &[Option<usize>]) -> Vec<Option<TextureId>> {
    let mut moved = Vec::with_capacity(textures.len());
    let mut kept = Vec::with_capacity(textures.len());
    for texture in textures.drain(..) {
        moved.push(places[texture.image].map(|image| {
            kept.push(Texture { image, ..texture });
            kept.len() - 1
        }));
    }
    *textures = kept;
    moved
}

/// The image of a texture: the one for readers of a better format, if there is one.
fn source(ctx: &Context<'_>, def: &TextureDef, name: &str) -> Result<Option<usize>> {
    #[derive(Default, serde::Deserialize)]
    #[serde(default)]
    struct Better {
        source: Option<usize>,
    }
    for extension in ["KHR_texture_basisu", "EXT_texture_webp"] {
        if let Some(Better { source: Some(image) }) = ctx.extension(&def.extensions, extension, name)? {
            return Ok(Some(image));
        }
    }
    Ok(def.source)
}

/// The texture with its sampler (glTF 2.0, section 5.26).
fn sampled(ctx: &Context<'_>, def: &TextureDef, image: usize, name: &str) -> Result<Texture> {
    let mut texture = Texture {
        image,
        wrap: [Wrap::Repeat; 2],
        magnify: TexelFilter::Linear,
        minify: TexelFilter::Linear,
        mipmapped: true,
    };
    let Some(index) = def.sampler else { return Ok(texture) };
    let sampler = ctx.get(&ctx.doc.samplers, index, "sampler", name)?;
    let object = label("sampler", index, "");
    let unknown = |what: &str, code: u64| ctx.warn(&object, format!("has the unknown {what} {code}"));
    for (wrap, code) in texture.wrap.iter_mut().zip([sampler.wrap_s, sampler.wrap_t]) {
        *wrap = match code {
            None | Some(10497) => Wrap::Repeat,
            Some(33071) => Wrap::Clamp,
            Some(33648) => Wrap::Mirror,
            Some(code) => {
                unknown("wrap mode", code);
                Wrap::Repeat
            }
        };
    }
    match sampler.mag_filter {
        None | Some(9729) => {}
        Some(9728) => texture.magnify = TexelFilter::Nearest,
        Some(code) => unknown("magnification filter", code),
    }
    (texture.minify, texture.mipmapped) = match sampler.min_filter {
        None | Some(9985 | 9987) => (TexelFilter::Linear, true),
        Some(9984 | 9986) => (TexelFilter::Nearest, true),
        Some(9728) => (TexelFilter::Nearest, false),
        Some(9729) => (TexelFilter::Linear, false),
        Some(code) => {
            unknown("minification filter", code);
            (TexelFilter::Linear, true)
        }
    };
    Ok(texture)
}

/// The transform of `KHR_texture_transform`, and the coordinate set that it chooses.
///
/// Scale, then rotation, then offset. The rotation turns counter-clockwise as seen, and v points down, so its matrix
/// is that of the negative angle.
fn transform(ctx: &Context<'_>, extensions: &Object, object: &str) -> Result<(Affine2, Option<usize>)> {
    #[derive(Default, serde::Deserialize)]
    #[serde(rename_all = "camelCase", default)]
    struct Transform {
        offset: Option<[f64; 2]>,
        rotation: f64,
        scale: Option<[f64; 2]>,
        tex_coord: Option<usize>,
    }
    let Some(t) = ctx.extension::<Transform>(extensions, "KHR_texture_transform", object)? else {
        return Ok((Affine2::IDENTITY, None));
    };
    let offset = Vec2::from(ctx.finite_array(t.offset.unwrap_or_default(), "the texture offset", object)?);
    let scale = Vec2::from(ctx.finite_array(t.scale.unwrap_or([1.0; 2]), "the texture scale", object)?);
    let (sin, cos) = libm::sincosf(ctx.finite(t.rotation, "the texture rotation", object)?);
    let turn = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
    Ok((Affine2::from_mat2_translation(turn * Mat2::from_diagonal(scale), offset), t.tex_coord))
}

/// The encoded bytes of an image, with the memory for its pixels paid for. `None`, with a warning, where the file
/// brings no usable image; a reference that is forbidden is an error.
pub(super) fn fetch(ctx: &Context<'_>, buffers: &Buffers, index: usize) -> Result<Option<Source>> {
    let def = &ctx.doc.images[index];
    let name = label("image", index, &def.name);
    let source = match (&def.uri, def.buffer_view) {
        (_, Some(view)) => match buffers.view(ctx, view, &name) {
            Ok(view) => Source::View(view),
            Err(Error::Scene { object, problem, .. }) => {
                ctx.warn(&name, format!("cannot be read ({object}: {problem}); its textures count as absent"));
                return Ok(None);
            }
            Err(e) => return Err(e),
        },
        (Some(uri), None) => match uri::read(ctx, uri, &name) {
            Ok(bytes) => {
                ctx.charge(bytes.len() as u64, &name)?;
                Source::Bytes(bytes)
            }
            Err(Error::Io { path, source, .. }) => {
                ctx.warn(&name, format!("{} cannot be read ({source}); its textures count as absent", path.display()));
                return Ok(None);
            }
            Err(e) => return Err(e),
        },
        (None, None) => {
            ctx.warn(&name, "has neither a uri nor a buffer view; its textures count as absent");
            return Ok(None);
        }
    };
    match decode::size(source.bytes()) {
        Ok(size) => {
            ctx.charge(size, &name)?;
            Ok(Some(source))
        }
        Err(problem) => {
            ctx.warn(&name, format!("cannot be decoded ({problem}); its textures count as absent"));
            Ok(None)
        }
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "fractions of the integer's own range")]
fn convert(mut image: Image, conversion: Conversion) -> Image {
    if let Conversion::RoughnessFromGlossiness(bits) = conversion {
        let factor = f32::from_bits(bits);
        let rough = |glossiness: f32, most: f32| (most - factor * glossiness + 0.5).clamp(0.0, most);
        match &mut image.pixels {
            Pixels::Rgba8(pixels) => {
                pixels.iter_mut().for_each(|p| *p = [0, rough(f32::from(p[3]), 255.0) as u8, 0, 255]);
            }
            Pixels::Rgba16(pixels) => {
                pixels.iter_mut().for_each(|p| *p = [0, rough(f32::from(p[3]), 65535.0) as u16, 0, u16::MAX]);
            }
            // Without an alpha channel the glossiness is 1 everywhere.
            Pixels::RgbF32(pixels) => pixels.fill([0.0, 1.0 - factor, 0.0]),
        }
    }
    image
}
