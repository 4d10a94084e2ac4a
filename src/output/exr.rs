//! OpenEXR files: scene-linear, half or float, with planes, windows and the record of what made them.
//!
//! Bytes depend on the picture alone: scan lines in order, ZIP, and header attributes sorted by name.

use super::picture::{FieldOrder, Picture};
use super::quantise::ascii_json;
use crate::time::FrameRate;
use crate::{Error, Result};
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, Text, TimeCode};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, ImageAttributes, Layer,
    LayerAttributes, LineOrder, Vec2, WritableImage,
};
use std::path::Path;

/// How colour is stored. Planes are always stored as float: depths and motions need it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ExrDepth {
    /// 16 bits: 11 significant bits up to 65 504.
    #[default]
    Half,
    /// 32 bits: exactly what was computed.
    Float,
}

/// Names of our attributes; all hold text.
pub(super) mod names {
    pub(crate) const SETTINGS: &str = "graeco.settings";
    pub(crate) const SETTINGS_HASH: &str = "graeco.settingsHash";
    pub(crate) const SCENE_HASH: &str = "graeco.sceneHash";
    pub(crate) const SEED: &str = "graeco.seed";
    pub(crate) const FRAME: &str = "graeco.frame";
    pub(crate) const FIELDS: &str = "graeco.fields";
    pub(crate) const OPEN: &str = "graeco.exposureOpen";
    pub(crate) const CLOSE: &str = "graeco.exposureClose";
    pub(crate) const PASSES: &str = "graeco.passes";
}

/// The file's bytes.
///
/// # Errors
/// If the picture is inconsistent, or a plane's name is no legal channel name.
pub fn encode(picture: &Picture, depth: ExrDepth, path: &Path) -> Result<Vec<u8>> {
    picture.validate()?;
    let bad = |problem: String| Error::Picture { path: path.to_path_buf(), problem };
    let mut channels = exr::prelude::SmallVec::new();
    let colour = |values: Vec<f32>| match depth {
        ExrDepth::Float => FlatSamples::F32(values),
        ExrDepth::Half => FlatSamples::F16(values.into_iter().map(half::f16::from_f32).collect()),
    };
    for (index, name) in ["R", "G", "B"].into_iter().enumerate() {
        let values = picture.rgb.iter().map(|rgb| rgb[index]).collect();
        channels.push(AnyChannel::new(name, colour(values)));
    }
    if let Some(alpha) = &picture.alpha {
        channels.push(AnyChannel::new("A", colour(alpha.clone())));
    }
    for plane in &picture.planes {
        let name = Text::new_or_none(&plane.name).filter(|_| !plane.name.is_empty() && plane.name.len() <= 31);
        let name = name.ok_or_else(|| bad(format!("\"{}\" is no channel name of 1 to 31 letters", plane.name)))?;
        channels.push(AnyChannel::new(name, FlatSamples::F32(plane.samples.clone())));
    }
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = (picture.window.width as usize, picture.window.height as usize);
    let layer = Layer::new(size, layer_attributes(picture)?, encoding, AnyChannels::sort(channels));
    let image = Image::new(image_attributes(picture), layer);
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).map_err(|error| bad(format!("cannot encode: {error}")))?;
    let mut bytes = bytes.into_inner();
    sort_header(&mut bytes).ok_or_else(|| bad("the encoder wrote an unexpected header".to_owned()))?;
    Ok(bytes)
}

#[allow(clippy::cast_possible_truncation, reason = "the format holds these in f32")]
fn image_attributes(picture: &Picture) -> ImageAttributes {
    let (width, height) = picture.size;
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions((width as usize, height as usize)));
    attributes.pixel_aspect = picture.metadata.pixel_aspect.ratio() as f32;
    // BT.709-6 §1.3 and D65: the primaries that radiance is in.
    attributes.chromaticities = Some(Chromaticities {
        red: Vec2(0.64, 0.33),
        green: Vec2(0.30, 0.60),
        blue: Vec2(0.15, 0.06),
        white: Vec2(0.3127, 0.3290),
    });
    let second = picture.metadata.order.is_second_field();
    attributes.time_code = time_code(picture.metadata.frame, picture.metadata.rate, second);
    attributes
}

#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "the format's own types; windows fit")]
fn layer_attributes(picture: &Picture) -> Result<LayerAttributes> {
    let meta = &picture.metadata;
    let (frames, seconds) = meta.rate.parts();
    let mut attributes = LayerAttributes {
        layer_position: Vec2(picture.window.x as i32, picture.window.y as i32),
        screen_window_width: 1.0,
        frames_per_second: Some((frames as i32, seconds)),
        exposure: Some(meta.exposure.duration() as f32),
        software_name: Text::new_or_none(&meta.record.program),
        ..LayerAttributes::default()
    };
    let fields = serde_json::to_string(&meta.order)
        .map_err(|error| Error::invalid("field order", format!("cannot be stored: {error}")))?;
    for (name, value) in [
        (names::SETTINGS, ascii_json(&meta.record.settings)),
        (names::SETTINGS_HASH, meta.record.settings_hash.clone()),
        (names::SCENE_HASH, meta.record.scene_hash.clone()),
        (names::SEED, meta.record.seed.to_string()),
        (names::FRAME, meta.frame.to_string()),
        (names::FIELDS, fields),
        (names::OPEN, meta.exposure.open.to_string()),
        (names::CLOSE, meta.exposure.close.to_string()),
    ]
    .into_iter()
    .chain(meta.passes.map(|passes| (names::PASSES, passes.to_string())))
    {
        let text = Text::new_or_none(&value)
            .ok_or_else(|| Error::invalid(name, "holds a character that EXR text cannot store"))?;
        attributes.other.insert(Text::from(name), AttributeValue::Text(text));
    }
    Ok(attributes)
}

/// SMPTE 12M time code, never drop-frame, wrapping at 24 hours either way. Rates above 30 count pairs of frames, told
/// apart by the field phase, as SMPTE 12-1 does for 50 and 60 frames a second; none above 60.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "each part is reduced to its range")]
fn time_code(frame: i64, rate: FrameRate, second_field: bool) -> Option<TimeCode> {
    let nominal = rate.per_second().round() as i64;
    let (counted, nominal, phase) = match nominal {
        1..=30 => (frame, nominal, second_field),
        31..=60 if nominal % 2 == 0 => (frame.div_euclid(2), nominal / 2, frame.rem_euclid(2) == 1),
        _ => return None,
    };
    let frame = counted.rem_euclid(nominal * 86_400);
    let seconds = frame / nominal;
    Some(TimeCode {
        hours: (seconds / 3600) as u8,
        minutes: (seconds / 60 % 60) as u8,
        seconds: (seconds % 60) as u8,
        frame: (frame % nominal) as u8,
        field_phase: phase,
        ..TimeCode::default()
    })
}

/// Puts the header's attributes in order of their names: the encoder keeps some in a hash map, whose order changes
/// from run to run. Offsets stay right, since the header's length does. None if this is no single-part file.
pub(super) fn sort_header(bytes: &mut [u8]) -> Option<()> {
    const MULTI_PART: u32 = 0x1000;
    let version = u32::from_le_bytes(bytes.get(4..8)?.try_into().ok()?);
    if version & MULTI_PART != 0 {
        return None;
    }
    let text_end = |from: usize| Some(from + bytes.get(from..)?.iter().position(|&b| b == 0)? + 1);
    let mut spans = Vec::new();
    let mut at = 8;
    while *bytes.get(at)? != 0 {
        let value = text_end(text_end(at)?)?;
        let length = u32::from_le_bytes(bytes.get(value..value + 4)?.try_into().ok()?);
        let end = value + 4 + usize::try_from(length).ok()?;
        bytes.get(at..end)?;
        spans.push(at..end);
        at = end;
    }
    let mut attributes: Vec<Vec<u8>> = spans.into_iter().map(|span| bytes[span].to_vec()).collect();
    attributes.sort();
    bytes.get_mut(8..at)?.copy_from_slice(&attributes.concat());
    Some(())
}

/// The text by which [`super::read`] knows how a picture's lines are ordered.
pub(super) fn field_order_from_text(text: &str) -> Option<FieldOrder> {
    serde_json::from_str(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_codes_count_frames_from_the_clocks_zero() {
        let rate = FrameRate::new(30_000, 1001).unwrap();
        let code = time_code(30 * 3600 + 30 * 61 + 7, rate, true).unwrap();
        assert_eq!((code.hours, code.minutes, code.seconds, code.frame, code.field_phase), (1, 1, 1, 7, true));
        let code = time_code(-1, rate, false).unwrap();
        assert_eq!((code.hours, code.minutes, code.seconds, code.frame), (23, 59, 59, 29));
        let code = time_code(61, FrameRate::new(60, 1).unwrap(), false).unwrap();
        assert_eq!((code.seconds, code.frame, code.field_phase), (1, 0, true));
        assert_eq!(time_code(1, FrameRate::new(120, 1).unwrap(), false), None);
    }
}
