//! The squares that a picture is divided into: the same ones however it is cut up.

use super::{Lines, Window};
use std::ops::Range;

/// Blocks are squares of this many pixels: small enough to balance two to many threads, large enough that neighbours
/// share the part of the scene that they see.
pub const SIDE: u32 = 16;

/// The blocks of a window, row by row. They are aligned to the whole picture's origin, so that those at a window's border
/// may be smaller, and all others are those of the whole picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blocks {
    window: Window,
}

impl Blocks {
    /// Those of `window`.
    #[must_use]
    pub const fn new(window: Window) -> Self {
        Self { window }
    }

    /// Blocks in a row.
    #[must_use]
    pub const fn columns(self) -> u32 {
        (self.window.x + self.window.width).div_ceil(SIDE) - self.window.x / SIDE
    }

    /// All of them.
    #[must_use]
    pub const fn count(self) -> u32 {
        let rows = (self.window.y + self.window.height).div_ceil(SIDE) - self.window.y / SIDE;
        self.columns() * rows
    }

    /// The pixels of block `index`, which is below [`Blocks::count`].
    #[must_use]
    pub fn window(self, index: u32) -> Window {
        let span = |from: u32, length: u32, cell: u32| {
            let start = from.max((from / SIDE + cell) * SIDE);
            (start, (from + length).min((from / SIDE + cell + 1) * SIDE) - start)
        };
        let w = self.window;
        let (x, width) = span(w.x, w.width, index % self.columns());
        let (y, height) = span(w.y, w.height, index / self.columns());
        Window { x, y, width, height }
    }

    /// The pixels of all blocks, in order.
    pub fn windows(self) -> impl Iterator<Item = Window> {
        (0..self.count()).map(move |index| self.window(index))
    }

    /// The `index`-th (from 0) of `count` runs of blocks, whose lengths differ by one at most.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "no more than the blocks")]
    pub fn share(self, index: u32, count: u32) -> Range<u32> {
        let bound = |i: u32| (u64::from(self.count()) * u64::from(i) / u64::from(count)) as u32;
        bound(index)..bound(index + 1)
    }
}

/// Pixels of a block whose lines are exposed, row by row.
pub fn pixels(block: Window, lines: Lines) -> impl Iterator<Item = (u32, u32)> {
    (block.y..block.y + block.height)
        .filter(move |&y| lines.holds(y))
        .flat_map(move |y| (block.x..block.x + block.width).map(move |x| (x, y)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn blocks_cover_a_window_once_and_lie_on_the_pictures_grid(
            x in 0_u32..40, y in 0_u32..40, width in 1_u32..70, height in 1_u32..70, shares in 1_u32..40,
        ) {
            let window = Window { x, y, width, height };
            let blocks = Blocks::new(window);
            let mut seen = vec![false; window.area()];
            let divided = (0..shares).flat_map(|i| blocks.share(i, shares));
            for block in divided.map(|index| blocks.window(index)) {
                prop_assert_eq!((block.x / SIDE, block.y / SIDE),
                    ((block.x + block.width - 1) / SIDE, (block.y + block.height - 1) / SIDE));
                for (x, y) in pixels(block, Lines::All) {
                    let index = window.index(x, y).unwrap();
                    prop_assert!(!std::mem::replace(&mut seen[index], true));
                }
            }
            prop_assert!(seen.into_iter().all(|s| s));
        }
    }
}
