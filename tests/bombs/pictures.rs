//! Pictures of a few bytes whose headers promise gigabytes, in every format that is read.

use super::{data_uri, read_json};
use graeco::scene::Scene;
use image::{ExtendedColorType, ImageEncoder};
use serde_json::json;

/// Sides: within what a small file may take, just beyond, the most that headers can say.
const SIDES: [u32; 5] = [4_000, 11_000, 16_000, 30_000, 65_535];

/// Loads a file whose one material shows `picture`.
fn show(picture: &[u8], extension: Option<&str>) -> Result<Scene, String> {
    let texture = match extension {
        Some(name) => json!({"extensions": {name: {"source": 0}}}),
        None => json!({"source": 0}),
    };
    let corners: Vec<u8> =
        [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    read_json(&json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": data_uri(&corners), "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "images": [{"uri": data_uri(picture)}],
        "textures": [texture],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    }))
}

/// A picture that claims to be large must be refused, or lose its texture with a sentence.
fn check(name: &str, side: u32, picture: &[u8], extension: Option<&str>) {
    match show(picture, extension) {
        Ok(scene) => {
            assert!(scene.images.is_empty(), "{name} of {side} was believed");
            assert!(scene.warnings.iter().any(|w| w.contains("cannot be decoded")), "{name}: {:?}", scene.warnings);
            println!("{name} {side}: {:?}", scene.warnings);
        }
        Err(problem) => println!("{name} {side}: {problem}"),
    }
}

fn encoded(write: impl FnOnce(&mut Vec<u8>, &[u8])) -> Vec<u8> {
    let pixels: Vec<u8> = (0..8 * 8 * 3).map(|i: u32| (i * 37 % 256) as u8).collect();
    let mut out = Vec::new();
    write(&mut out, &pixels);
    out
}

#[test]
fn pngs_are_not_believed() {
    for (depth, color) in
        [(png::BitDepth::Eight, png::ColorType::Rgb), (png::BitDepth::Sixteen, png::ColorType::Grayscale)]
    {
        let sound = encoded(|out, pixels| {
            let mut encoder = png::Encoder::new(out, 8, 8);
            encoder.set_color(color);
            encoder.set_depth(depth);
            let bytes = if color == png::ColorType::Rgb { pixels.len() } else { 128 };
            encoder.write_header().unwrap().write_image_data(&pixels[..bytes]).unwrap();
        });
        assert_eq!(show(&sound, None).unwrap().images.len(), 1);
        for side in SIDES {
            let mut bomb = sound.clone();
            bomb[16..20].copy_from_slice(&side.to_be_bytes());
            bomb[20..24].copy_from_slice(&side.to_be_bytes());
            let sum = crc32fast::hash(&bomb[12..29]);
            bomb[29..33].copy_from_slice(&sum.to_be_bytes());
            check("PNG", side, &bomb, None);
        }
    }
}

/// The honest bomb: zeros that deflate to a thousandth. What it holds is more than its length allows.
#[test]
fn deflated_zeros_are_bounded_by_the_files_length() {
    for side in [2_000_u32, 16_000] {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, side, side);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::One);
        let rows = vec![0; side.div_ceil(8) as usize * side as usize];
        encoder.write_header().unwrap().write_image_data(&rows).unwrap();
        let result = show(&bytes, None);
        if side == 2_000 {
            assert_eq!(result.unwrap().images.len(), 1, "16 MB are fine");
        } else {
            let problem = result.map(|_| ()).expect_err("a gigabyte of zeros was read");
            println!("zeros: {} bytes, {problem}", bytes.len());
        }
    }
}

#[test]
fn jpegs_are_not_believed() {
    let sound = encoded(|out, pixels| {
        image::codecs::jpeg::JpegEncoder::new(out).write_image(pixels, 8, 8, ExtendedColorType::Rgb8).unwrap();
    });
    assert_eq!(show(&sound, None).unwrap().images.len(), 1);
    let frame = sound.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    for side in SIDES {
        let mut bomb = sound.clone();
        let code = (side as u16).to_be_bytes();
        bomb[frame + 5..frame + 7].copy_from_slice(&code);
        bomb[frame + 7..frame + 9].copy_from_slice(&code);
        // Decoders fill up what is missing of a JPEG, as browsers do: what fits may be grey.
        match show(&bomb, None) {
            Ok(scene) if scene.images.len() == 1 => assert!(side <= 11_000, "JPEG of {side} was believed"),
            _ => check("JPEG", side, &bomb, None),
        }
    }
}

#[test]
fn webps_are_not_believed() {
    let sound = encoded(|out, pixels| {
        image::codecs::webp::WebPEncoder::new_lossless(out).write_image(pixels, 8, 8, ExtendedColorType::Rgb8).unwrap();
    });
    assert_eq!(show(&sound, Some("EXT_texture_webp")).unwrap().images.len(), 1);
    let data = sound.windows(4).position(|w| w == b"VP8L").unwrap() + 9;
    for side in [4_000_u32, 11_000, 16_384] {
        let mut bomb = sound.clone();
        // Two fields of 14 bits, less one each.
        let sizes =
            (side - 1) | (side - 1) << 14 | u32::from_le_bytes(sound[data..data + 4].try_into().unwrap()) & 0xf000_0000;
        bomb[data..data + 4].copy_from_slice(&sizes.to_le_bytes());
        check("WebP", side, &bomb, Some("EXT_texture_webp"));
    }
}

/// Formats that glTF does not name but that are read where a file holds them: twelve bytes a pixel, palettes, strips.
#[test]
fn other_formats_are_not_believed() {
    for side in SIDES {
        let radiance = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {side} +X {side}\n\x02\x02");
        check("HDR", side, radiance.as_bytes(), None);
        let mut bmp = encoded(|out, pixels| {
            image::codecs::bmp::BmpEncoder::new(out).write_image(pixels, 8, 8, ExtendedColorType::Rgb8).unwrap();
        });
        bmp[18..22].copy_from_slice(&side.to_le_bytes());
        bmp[22..26].copy_from_slice(&side.to_le_bytes());
        check("BMP", side, &bmp, None);
        let mut gif = b"GIF89a".to_vec();
        gif.extend([(side as u16).to_le_bytes(), (side as u16).to_le_bytes()].concat());
        gif.extend([0, 0, 0, b',', 0, 0, 0, 0]);
        gif.extend([(side as u16).to_le_bytes(), (side as u16).to_le_bytes()].concat());
        gif.extend([0, 2, 1, 0x2c, 0]);
        check("GIF", side, &gif, None);
        let mut tiff = std::io::Cursor::new(Vec::new());
        let floats: Vec<u8> = (0..8 * 8 * 3_u16).flat_map(|i| f32::from(i).to_le_bytes()).collect();
        image::codecs::tiff::TiffEncoder::new(&mut tiff).write_image(&floats, 8, 8, ExtendedColorType::Rgb32F).unwrap();
        let mut tiff = tiff.into_inner();
        // Width and height (tags 256 and 257) of the one directory, as entries of type LONG.
        for tag in [256_u16, 257] {
            let entry =
                [&tag.to_le_bytes()[..], &4_u16.to_le_bytes(), &1_u32.to_le_bytes(), &8_u32.to_le_bytes()].concat();
            let at = tiff.windows(12).position(|w| w == entry).expect("an entry of the directory");
            tiff[at + 8..at + 12].copy_from_slice(&side.to_le_bytes());
        }
        check("TIFF", side, &tiff, None);
    }
}

/// KTX2: level lengths, layers and sides beyond what the pixels take.
#[test]
fn ktx2_files_are_not_believed() {
    let mut sound = vec![0_u8; 400];
    sound[..12].copy_from_slice(b"\xabKTX 20\xbb\r\n\x1a\n");
    let mut set = |at: usize, value: u32| sound[at..at + 4].copy_from_slice(&value.to_le_bytes());
    // UASTC, four by four texels, one level of 16 bytes at 384, its descriptor of 44 bytes at 120.
    for (at, value) in [(16, 1), (20, 4), (24, 4), (36, 1), (40, 1), (48, 120), (52, 44), (80, 384), (88, 16), (96, 16)]
    {
        set(at, value);
    }
    for (at, value) in [(120, 44), (132, 166 | 1 << 8 | 1 << 16), (136, 3 | 3 << 8), (148, 3 << 24)] {
        set(at, value);
    }
    for side in SIDES {
        let mut bomb = sound.clone();
        bomb[20..24].copy_from_slice(&side.to_le_bytes());
        bomb[24..28].copy_from_slice(&side.to_le_bytes());
        check("KTX2", side, &bomb, Some("KHR_texture_basisu"));
    }
    for (scheme, length) in [(0_u32, 1_u64 << 20), (2, 1 << 20), (2, 1 << 29), (2, 1 << 50)] {
        let mut bomb = sound.clone();
        bomb[44..48].copy_from_slice(&scheme.to_le_bytes());
        bomb[96..104].copy_from_slice(&length.to_le_bytes());
        if scheme == 0 {
            bomb[88..96].copy_from_slice(&length.to_le_bytes());
        }
        check("KTX2 level", 4, &bomb, Some("KHR_texture_basisu"));
    }
}
