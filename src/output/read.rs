//! Pictures read back: for comparison, for checking, and to know whether a frame is already done.

use super::exr::{field_order_from_text, names as exr_names};
use super::picture::{FieldOrder, Plane};
use super::png::names as png_names;
use super::view::linear_from_srgb;
use crate::film::Window;
use crate::{Error, Result};
use exr::meta::attribute::AttributeValue;
use exr::prelude::{ReadChannels, ReadLayers};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A picture from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// Columns and rows of the whole picture (EXR: the display window).
    pub size: (u32, u32),
    /// The pixels that the file holds, relative to the display window.
    pub window: Window,
    /// Scene-linear Rec. 709, row order over the window. PNG codes are taken through the inverse of the sRGB curve
    /// whatever view made them.
    pub rgb: Vec<[f32; 3]>,
    /// Coverage, if the file has it.
    pub alpha: Option<Vec<f32>>,
    /// Further channels of an EXR.
    pub planes: Vec<Plane>,
    /// Whether values are display-referred (PNG): at most 1.
    pub display_referred: bool,
    /// What it says of its making.
    pub stored: Stored,
}

/// What a picture of ours says of its making; other programs' pictures say none of it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Stored {
    /// [`super::Record::settings_hash`].
    pub settings_hash: Option<String>,
    /// Frame number.
    pub frame: Option<i64>,
    /// Field order.
    pub order: Option<FieldOrder>,
    /// The settings as JSON.
    pub settings: Option<String>,
}

/// Reads an EXR (its first layer that has R, G and B, or Y) or a PNG, whole: any damage is found.
///
/// # Errors
/// [`Error::Io`] if it cannot be read, [`Error::Picture`] if it is truncated, damaged, of another format, or would need
/// unreasonable memory.
pub fn read(path: &Path) -> Result<Loaded> {
    match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
        Some("exr") => read_exr(path),
        Some("png") => read_png(path),
        _ => Err(Error::Picture { path: path.to_path_buf(), problem: "expected a file named .exr or .png".to_owned() }),
    }
}

fn open(path: &Path) -> Result<(BufReader<File>, u64)> {
    let file = File::open(path).map_err(|source| Error::io(path, "open", source))?;
    let length = file.metadata().map_err(|source| Error::io(path, "read", source))?.len();
    Ok((BufReader::new(file), length))
}

/// Refuses sizes that the file's length makes impossible: deflate compresses at most 1032 to 1.
fn plausible(path: &Path, samples: u64, bytes_each: u64, length: u64) -> Result<()> {
    const MOST_SAMPLES: u64 = 1 << 30;
    if samples > MOST_SAMPLES || samples.saturating_mul(bytes_each) > length.saturating_mul(1100).saturating_add(4096) {
        return Err(Error::Picture {
            path: path.to_path_buf(),
            problem: format!("it claims {samples} values, which its {length} bytes cannot hold"),
        });
    }
    Ok(())
}

#[allow(clippy::cast_possible_truncation, reason = "window positions are within the display window's i32 range")]
fn read_exr(path: &Path) -> Result<Loaded> {
    let bad = |problem: String| Error::Picture { path: path.to_path_buf(), problem };
    let (mut reader, length) = open(path)?;
    let meta = exr::meta::MetaData::read_from_buffered(&mut reader, false)
        .map_err(|error| bad(format!("no complete EXR header: {error}")))?;
    let samples = meta.headers.iter().map(|h| h.layer_size.area() as u64 * h.channels.list.len() as u64).sum();
    plausible(path, samples, 2, length)?;
    let (reader, _) = open(path)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(reader)
        .map_err(|error| bad(format!("truncated or damaged: {error}")))?;
    let display = image.attributes.display_window;
    let layer = image.layer_data;
    let data = layer.absolute_bounds();
    let offset = data.position - display.position;
    let inside = |start: i32, length: usize, whole: usize| {
        let start = u32::try_from(start).ok()?;
        (start as usize + length <= whole).then_some(start)
    };
    // A data window that reaches outside the display window is read as a picture of its own.
    let placed = inside(offset.x(), data.size.width(), display.size.width()).zip(inside(
        offset.y(),
        data.size.height(),
        display.size.height(),
    ));
    let (width, height) = (data.size.width() as u32, data.size.height() as u32);
    let (size, (x, y)) = match placed {
        Some(at) => ((display.size.width() as u32, display.size.height() as u32), at),
        None => ((width, height), (0, 0)),
    };
    let mut colour: [Option<Vec<f32>>; 3] = [None, None, None];
    let (mut alpha, mut planes) = (None, Vec::new());
    for channel in layer.channel_data.list {
        let samples: Vec<f32> = channel.sample_data.values_as_f32().collect();
        match channel.name.to_string().as_str() {
            "R" => colour[0] = Some(samples),
            "G" => colour[1] = Some(samples),
            "B" => colour[2] = Some(samples),
            "Y" if colour.iter().all(Option::is_none) => {
                colour = [Some(samples.clone()), Some(samples.clone()), Some(samples)];
            }
            "A" => alpha = Some(samples),
            name => planes.push(Plane { name: name.to_owned(), samples }),
        }
    }
    let [Some(red), Some(green), Some(blue)] = colour else {
        return Err(bad("it has no channels R, G and B".to_owned()));
    };
    let rgb = red.into_iter().zip(green).zip(blue).map(|((r, g), b)| [r, g, b]).collect();
    let text = |name: &str| {
        layer.attributes.other.iter().find(|(key, _)| **key == *name).and_then(|(_, value)| match value {
            AttributeValue::Text(text) => Some(text.to_string()),
            _ => None,
        })
    };
    let stored = Stored {
        settings_hash: text(exr_names::SETTINGS_HASH),
        frame: text(exr_names::FRAME).and_then(|text| text.parse().ok()),
        order: text(exr_names::FIELDS).and_then(|text| field_order_from_text(&text)),
        settings: text(exr_names::SETTINGS),
    };
    let window = Window { x, y, width, height };
    Ok(Loaded { size, window, rgb, alpha, planes, display_referred: false, stored })
}

#[allow(clippy::cast_possible_truncation, reason = "the result is f32 by contract")]
fn read_png(path: &Path) -> Result<Loaded> {
    let bad = |error: png::DecodingError| Error::Picture {
        path: path.to_path_buf(),
        problem: format!("truncated or damaged: {error}"),
    };
    let (reader, length) = open(path)?;
    let mut decoder = png::Decoder::new(reader);
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(bad)?;
    let (width, height) = (reader.info().width, reader.info().height);
    plausible(path, u64::from(width) * u64::from(height) * 4, 1, length)?;
    let wanted = reader
        .output_buffer_size()
        .ok_or_else(|| Error::Picture { path: path.to_path_buf(), problem: "too large to be read".to_owned() })?;
    let mut bytes = vec![0; wanted];
    let frame = reader.next_frame(&mut bytes).map_err(bad)?;
    reader.finish().map_err(bad)?;
    bytes.truncate(frame.buffer_size());
    let values: Vec<f64> = match frame.bit_depth {
        png::BitDepth::Sixteen => {
            bytes.chunks_exact(2).map(|pair| f64::from(u16::from_be_bytes([pair[0], pair[1]])) / 65_535.0).collect()
        }
        _ => bytes.iter().map(|&byte| f64::from(byte) / 255.0).collect(),
    };
    let channels = frame.color_type.samples();
    let linear = |value: f64| linear_from_srgb(value) as f32;
    let rgb = values
        .chunks_exact(channels)
        .map(|p| if channels < 3 { [linear(p[0]); 3] } else { [linear(p[0]), linear(p[1]), linear(p[2])] })
        .collect();
    let alpha =
        (channels % 2 == 0).then(|| values.chunks_exact(channels).map(|pixel| pixel[channels - 1] as f32).collect());
    let texts = &reader.info().uncompressed_latin1_text;
    let text = |keyword: &str| texts.iter().find(|chunk| chunk.keyword == keyword).map(|chunk| chunk.text.clone());
    let stored = Stored {
        settings_hash: text(png_names::SETTINGS_HASH),
        frame: text(png_names::FRAME).and_then(|text| text.parse().ok()),
        order: None,
        settings: text(png_names::SETTINGS),
    };
    let window = Window::whole(width, height);
    Ok(Loaded { size: (width, height), window, rgb, alpha, planes: Vec::new(), display_referred: true, stored })
}

/// Whether the file `path` is a whole picture that settings of hash `settings_hash` made: what a resumed render may
/// skip. A missing, damaged or different file is simply not finished.
#[must_use]
pub fn is_finished(path: &Path, settings_hash: &str) -> bool {
    path.exists() && read(path).is_ok_and(|loaded| loaded.stored.settings_hash.as_deref() == Some(settings_hash))
}
