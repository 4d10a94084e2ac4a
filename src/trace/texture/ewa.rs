//! The elliptical weighted average (Heckbert 1989, §3.5.9).

use super::footprint::Axes;
use super::{Sampler, index};
use crate::scene::Wrap;
use glam::{Vec2, Vec4};

impl Sampler<'_> {
    /// The mean of the texels of `level` under the ellipse `axes` (texels of the full resolution) about `uv`, weighted by
    /// a Gaussian whose standard deviation is half the ellipse's diameters, cut off at twice that; a texel's own width is
    /// added to the ellipse, so that it always covers some.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "places on a texture, bounded below"
    )]
    pub(super) fn ewa(&self, level: usize, uv: Vec2, axes: &Axes) -> Vec4 {
        let (width, height) = self.size(level);
        let scale = Vec2::new(width as f32 / self.image.width as f32, height as f32 / self.image.height as f32);
        let (along, across) = (axes.along * axes.major * scale, axes.along.perp() * axes.minor * scale);
        // Squares of the ellipse's half extents, twice the standard deviation each way.
        let xx = along.x * along.x + across.x * across.x + 1.0;
        let yy = along.y * along.y + across.y * across.y + 1.0;
        let xy = along.x * along.y + across.x * across.y;
        let reach = Vec2::new(xx.sqrt(), yy.sqrt()).min(Vec2::splat(MOST_REACH));
        let determinant = xx * yy - xy * xy;
        let wrap = self.texture.wrap;
        let x = unfolded(uv.x, wrap[0]) * width as f32 - 0.5;
        let y = unfolded(uv.y, wrap[1]) * height as f32 - 0.5;
        let (mut sum, mut total) = (Vec4::ZERO, 0.0);
        for row in (y - reach.y).ceil() as i32..=(y + reach.y).floor() as i32 {
            let dy = row as f32 - y;
            let ty = index(row, height, wrap[1]);
            for column in (x - reach.x).ceil() as i32..=(x + reach.x).floor() as i32 {
                let dx = column as f32 - x;
                let r2 = (dx * dx * yy - 2.0 * dx * dy * xy + dy * dy * xx) / determinant;
                if r2 < 1.0 {
                    let weight = libm::expf(-2.0 * r2);
                    sum += self.texel(level, index(column, width, wrap[0]), ty) * weight;
                    total += weight;
                }
            }
        }
        // The ellipse has a half extent of a texel at least, so the nearest texel is in it unless it is as far as the
        // rounding of huge coordinates puts it.
        if total > 0.0 { sum / total } else { self.blended(level, uv, crate::scene::texture::TexelFilter::Nearest) }
    }
}

/// The level is chosen so that the short axis has fewer than two texels (but at the top, where there is one in all), and the
/// long one is at most sixteen times that.
const MOST_REACH: f32 = 33.0;

/// The coordinate moved by whole periods into one period: what is left can be walked on from in either direction.
fn unfolded(coordinate: f32, wrap: Wrap) -> f32 {
    if !coordinate.is_finite() {
        return 0.0;
    }
    match wrap {
        Wrap::Clamp => coordinate.clamp(0.0, 1.0),
        Wrap::Repeat => coordinate - coordinate.floor(),
        Wrap::Mirror => 2.0 * (0.5 * coordinate - (0.5 * coordinate).floor()),
    }
}
