//! Colour sheets with words on them: pictures side by side, each with its label.

use crate::Result;
use crate::output::png;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Pixels from one line of text to the next.
pub const LINE: usize = RasterHeight::Size16.val();
/// Pixels of one character across: all are equally wide.
pub const LETTER: usize = get_raster_width(FontWeight::Regular, RasterHeight::Size16);

/// An 8-bit colour picture (sRGB codes).
#[derive(Debug, Clone)]
pub struct Poster {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl Poster {
    /// A picture of `width` × `height` pixels in one colour.
    #[must_use]
    pub fn new(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// Fills `width` × `height` pixels from (x, y), as far as they are inside.
    pub fn fill(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], colour: [u8; 3]) {
        for row in y..(y + height).min(self.height) {
            for column in x..(x + width).min(self.width) {
                self.pixels[row * self.width + column] = colour;
            }
        }
    }

    /// Copies a picture, `width` across, to (x, y), each of its pixels `zoom` wide; what lies outside is left out.
    pub fn paste(&mut self, codes: &[[u8; 3]], width: usize, [x, y]: [usize; 2], zoom: usize) {
        for (i, &code) in codes.iter().enumerate() {
            self.fill([x + i % width * zoom, y + i / width * zoom], [zoom; 2], code);
        }
    }

    /// Writes `text` with its upper left corner at (x, y); what lies outside is left out. Characters beyond Latin-1 show
    /// as a question mark.
    pub fn write(&mut self, text: &str, [x, y]: [usize; 2], ink: [u8; 3]) {
        let raster = |c| get_raster(c, FontWeight::Regular, RasterHeight::Size16);
        for (i, letter) in text.chars().enumerate() {
            let Some(letter) = raster(letter).or_else(|| raster('?')) else { continue };
            for (dy, row) in letter.rows().enumerate() {
                for (dx, &cover) in row.iter().enumerate() {
                    let (px, py) = (x + i * LETTER + dx, y + dy);
                    if px < self.width && py < self.height {
                        let paper = &mut self.pixels[py * self.width + px];
                        *paper = std::array::from_fn(|c| mixed(paper[c], ink[c], cover));
                    }
                }
            }
        }
    }

    /// The picture as a PNG file's bytes.
    ///
    /// # Errors
    /// If the encoder refuses.
    #[allow(clippy::cast_possible_truncation, reason = "a picture's sides")]
    pub fn png(&self) -> Result<Vec<u8>> {
        png::encode_codes(&self.pixels, (self.width as u32, self.height as u32))
    }
}

/// From `paper` to `ink` by `cover` of 255.
#[allow(clippy::cast_possible_truncation, reason = "a mean of bytes is a byte")]
fn mixed(paper: u8, ink: u8, cover: u8) -> u8 {
    let cover = u32::from(cover);
    ((u32::from(paper) * (255 - cover) + u32::from(ink) * cover + 127) / 255) as u8
}

/// `text` in at most `most` lines of at most `width` characters. Lines end after a blank or a slash where there is one
/// in their later half; what is too long loses its end to two dots.
#[must_use]
pub fn wrapped(text: &str, width: usize, most: usize) -> Vec<String> {
    let width = width.max(3);
    let mut rest: Vec<char> = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut lines = Vec::new();
    while !rest.is_empty() && lines.len() < most {
        let mut end = rest.len().min(width);
        if end < rest.len() {
            let seam = rest[..end].iter().rposition(|c| " /\\".contains(*c)).map(|i| i + 1);
            end = seam.filter(|&i| 2 * i > width).unwrap_or(end);
        }
        let tail = rest.split_off(end);
        let mut line: String = rest.iter().collect();
        if lines.len() + 1 == most && !tail.is_empty() {
            line = rest[..rest.len().min(width - 2)].iter().chain(&['.', '.']).collect();
        }
        lines.push(line.trim().to_owned());
        rest = tail;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn text_is_ink_on_paper_and_never_beyond_the_edge() {
        let mut poster = Poster::new(40, 20, [255; 3]);
        poster.write("Hä→ and far beyond", [1, 2], [0; 3]);
        let dark = poster.pixels.iter().filter(|p| p[0] < 128).count();
        assert!((40..300).contains(&dark), "{dark} dark pixels");
        poster.paste(&[[9; 3]; 4], 2, [39, 19], 3);
        assert_eq!(poster.pixels[19 * 40 + 39], [9; 3]);
        assert_eq!(&poster.png().unwrap()[1..4], b"PNG");
    }

    #[test]
    fn lines_break_at_slashes_and_say_what_they_lose() {
        assert_eq!(wrapped("static/BoomBox/BoomBox.gltf", 16, 2), ["static/BoomBox/", "BoomBox.gltf"]);
        assert_eq!(wrapped("abcdefghij", 4, 2), ["abcd", "ef.."]);
        assert_eq!(wrapped("short", 16, 2), ["short"]);
    }

    proptest! {
        #[test]
        fn no_text_panics_or_overflows(text in "\\PC{0,80}", width in 0_usize..20, most in 0_usize..4) {
            let lines = wrapped(&text, width, most);
            prop_assert!(lines.len() <= most && lines.iter().all(|l| l.chars().count() <= width.max(3)));
        }
    }
}
