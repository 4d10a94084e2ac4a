//! The pixels of one picture.

use super::PixelEstimate;
use crate::{Error, Result};

/// A rectangle of pixels: columns `x` to `x + width`, rows `y` to `y + height`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct Window {
    /// Leftmost column.
    pub x: u32,
    /// Topmost row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// All of a picture.
    #[must_use]
    pub const fn whole(width: u32, height: u32) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// Pixels in it.
    #[must_use]
    pub const fn area(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Whether it lies within a picture of `width` × `height` pixels.
    #[must_use]
    pub const fn fits(self, width: u32, height: u32) -> bool {
        self.x as u64 + self.width as u64 <= width as u64 && self.y as u64 + self.height as u64 <= height as u64
    }

    /// Where pixel (`x`, `y`) of the picture stands in row order, if it is in the window.
    #[must_use]
    pub const fn index(self, x: u32, y: u32) -> Option<usize> {
        if x < self.x || y < self.y || x - self.x >= self.width || y - self.y >= self.height {
            return None;
        }
        Some((y - self.y) as usize * self.width as usize + (x - self.x) as usize)
    }

    /// Whether the two share a pixel.
    #[must_use]
    pub const fn overlaps(self, other: Self) -> bool {
        self.x < other.x + other.width
            && other.x < self.x + self.width
            && self.y < other.y + other.height
            && other.y < self.y + self.height
    }
}

/// The estimates of a picture's pixels, or of those within a crop.
#[derive(Debug, Clone, PartialEq)]
pub struct Film {
    width: u32,
    height: u32,
    window: Window,
    pixels: Vec<PixelEstimate>,
}

impl Film {
    /// A black film of `width` × `height` pixels of which `crop` (all, if none) will be filled.
    ///
    /// # Errors
    /// If a side is zero or the crop is empty or not inside.
    pub fn new(width: u32, height: u32, crop: Option<Window>) -> Result<Self> {
        let window = crop.unwrap_or(Window::whole(width, height));
        if width == 0 || height == 0 {
            return Err(Error::invalid(format!("picture of {width}x{height}"), "both sides must be at least 1 pixel"));
        }
        if window.area() == 0 || !window.fits(width, height) {
            let Window { x, y, width: w, height: h } = window;
            return Err(Error::invalid(
                format!("crop {x},{y},{w},{h}"),
                format!("expected at least one pixel, all inside the picture of {width}x{height}"),
            ));
        }
        Ok(Self { width, height, window, pixels: vec![PixelEstimate::default(); window.area()] })
    }

    /// Size of the whole picture.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The pixels that it holds.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// Estimates in row order over [`Film::window`].
    #[must_use]
    pub fn pixels(&self) -> &[PixelEstimate] {
        &self.pixels
    }

    /// The same, to be filled; rows may be handed to threads by `chunks_mut(window.width)`.
    pub fn pixels_mut(&mut self) -> &mut [PixelEstimate] {
        &mut self.pixels
    }

    /// Copies the pixels of `part`, a film of the same picture, into this one. Pixels in neither stay black.
    ///
    /// # Errors
    /// If the sizes differ, or the part is not inside this film's window.
    pub fn place(&mut self, part: &Self) -> Result<()> {
        let (w, inner) = (self.window, part.window);
        let inside = inner.x >= w.x
            && inner.y >= w.y
            && inner.x + inner.width <= w.x + w.width
            && inner.y + inner.height <= w.y + w.height;
        if self.size() != part.size() || !inside {
            return Err(Error::invalid("merge", "a part is of another size or lies outside the picture"));
        }
        for row in 0..inner.height as usize {
            let from = row * inner.width as usize;
            let to = (row + (inner.y - w.y) as usize) * w.width as usize + (inner.x - w.x) as usize;
            let length = inner.width as usize;
            self.pixels[to..to + length].copy_from_slice(&part.pixels[from..from + length]);
        }
        Ok(())
    }

    /// Runs that were rejected as not finite, over all pixels.
    #[must_use]
    pub fn rejected(&self) -> u64 {
        self.pixels.iter().map(|pixel| u64::from(pixel.rejected)).sum()
    }

    /// Root of the mean estimated variance over pixels and channels: the picture's expected RMSE.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "a count of pixels")]
    pub fn standard_error(&self) -> f64 {
        let sum: f64 = self.pixels.iter().map(|pixel| pixel.variance.as_dvec3().element_sum()).sum();
        (sum / (3.0 * self.pixels.len() as f64)).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn tiles_placed_in_any_order_give_the_same_film() {
        let tile = |x, y, value| {
            let mut film = Film::new(8, 6, Some(Window { x, y, width: 4, height: 3 })).unwrap();
            for (i, pixel) in (0_u8..).zip(film.pixels_mut()) {
                pixel.radiance = Vec3::new(value, f32::from(i), 0.0);
            }
            film
        };
        let tiles = [tile(0, 0, 1.0), tile(4, 0, 2.0), tile(0, 3, 3.0), tile(4, 3, 4.0)];
        let (mut a, mut b) = (Film::new(8, 6, None).unwrap(), Film::new(8, 6, None).unwrap());
        for i in 0..4 {
            a.place(&tiles[i]).unwrap();
            b.place(&tiles[3 - i]).unwrap();
        }
        assert_eq!(a, b);
        assert_eq!(a.pixels()[a.window().index(5, 4).unwrap()].radiance, Vec3::new(4.0, 5.0, 0.0));
    }

    #[test]
    fn crops_outside_the_picture_are_refused() {
        for crop in [(0, 0, 9, 1), (8, 0, 1, 1), (0, 0, 0, 3), (u32::MAX, 0, 2, 2)] {
            let window = Window { x: crop.0, y: crop.1, width: crop.2, height: crop.3 };
            assert!(Film::new(8, 6, Some(window)).is_err(), "{crop:?}");
        }
        assert!(Film::new(0, 6, None).is_err());
    }
}
