//! A piecewise constant density over an equirectangular picture.

use crate::numeric::{ONE_MINUS, luminance, sin_cos};
use glam::{DVec3, Vec2, Vec3, Vec3A};
use std::f32::consts::TAU;

/// The most columns and rows of cells: finer pictures share a cell among texels.
const MOST: (u32, u32) = (1024, 512);

/// Cells of whole texels, chosen by row, then by column.
#[derive(Debug)]
pub(super) struct Grid {
    columns: usize,
    rows: usize,
    /// Picture coordinates of the cells' borders, `columns + 1` and `rows + 1`.
    u_edges: Vec<f32>,
    v_edges: Vec<f32>,
    /// Cosine of the polar angle at the rows' borders.
    cos_edges: Vec<f32>,
    /// Cumulative probability of rows, `rows + 1` from 0 to 1, and of columns within each row.
    row_sums: Vec<f32>,
    column_sums: Vec<f32>,
}

impl Grid {
    /// The grid of a picture of non-negative texels, and the picture's mean radiance over the sphere.
    #[allow(clippy::cast_possible_truncation, reason = "rounded once, from f64")]
    pub(super) fn new(texels: &[[f32; 3]], width: u32, height: u32) -> (Self, Vec3) {
        let edges = |size: u32, most: u32| -> Vec<u32> {
            let step = size.div_ceil(most);
            (0..size).step_by(step as usize).chain([size]).collect()
        };
        let (xs, ys) = (edges(width, MOST.0), edges(height, MOST.1));
        let (columns, rows) = (xs.len() - 1, ys.len() - 1);
        let cos_at = |y: u32| libm::cos(std::f64::consts::PI * f64::from(y) / f64::from(height));

        let mut weights = vec![0.0_f64; columns * rows];
        let mut mean = DVec3::ZERO;
        for y in 0..height {
            // Solid angle of the row's texels over the sphere's.
            let share = 0.5 * (cos_at(y) - cos_at(y + 1)) / f64::from(width);
            let row = ys.partition_point(|&e| e <= y) - 1;
            for x in 0..width {
                let v = smoothed(texels, width, height, x, y);
                mean += v * share;
                let column = xs.partition_point(|&e| e <= x) - 1;
                weights[row * columns + column] += f64::from(luminance(v.as_vec3())) * share;
            }
        }
        let mut row_sums = vec![0.0_f64; rows + 1];
        let mut column_sums = Vec::with_capacity(rows * (columns + 1));
        for row in 0..rows {
            let cells = &weights[row * columns..(row + 1) * columns];
            let total: f64 = cells.iter().sum();
            row_sums[row + 1] = row_sums[row] + total;
            let mut sum = 0.0;
            column_sums.push(0.0_f32);
            for (i, w) in cells.iter().enumerate() {
                sum += w;
                let even = (i + 1) as f64 / columns as f64;
                column_sums.push(if total > 0.0 { (sum / total).min(1.0) } else { even } as f32);
            }
        }
        let total = row_sums[rows];
        let row_sums = row_sums.iter().map(|s| if total > 0.0 { s / total } else { 0.0 } as f32).collect();
        let unit = |e: &[u32], size: u32| e.iter().map(|&x| (f64::from(x) / f64::from(size)) as f32).collect();
        let grid = Self {
            columns,
            rows,
            u_edges: unit(&xs, width),
            v_edges: unit(&ys, height),
            cos_edges: ys.iter().map(|&y| cos_at(y) as f32).collect(),
            row_sums,
            column_sums,
        };
        (grid, mean.as_vec3())
    }

    fn column_sums(&self, row: usize) -> &[f32] {
        &self.column_sums[row * (self.columns + 1)..(row + 1) * (self.columns + 1)]
    }

    fn density(&self, row: usize, column: usize) -> f32 {
        let sums = self.column_sums(row);
        let chance = (self.row_sums[row + 1] - self.row_sums[row]) * (sums[column + 1] - sums[column]);
        let azimuth = TAU * (self.u_edges[column + 1] - self.u_edges[column]);
        chance / (azimuth * (self.cos_edges[row] - self.cos_edges[row + 1]))
    }

    /// A direction in the picture's own axes, and its density by solid angle.
    pub(super) fn sample(&self, u: Vec2) -> (Vec3A, f32) {
        let (row, y) = pick(&self.row_sums, u.y);
        let (column, x) = pick(self.column_sums(row), u.x);
        let cos = self.cos_edges[row] * (1.0 - y) + self.cos_edges[row + 1] * y;
        let azimuth = TAU * (self.u_edges[column] * (1.0 - x) + self.u_edges[column + 1] * x - 0.5);
        let sin = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let (s, c) = sin_cos(azimuth);
        (Vec3A::new(sin * s, cos, -sin * c), self.density(row, column))
    }

    /// Density by solid angle at the picture coordinates `p`.
    pub(super) fn pdf(&self, p: Vec2) -> f32 {
        let cell = |edges: &[f32], x: f32, count: usize| edges.partition_point(|&e| e <= x).clamp(1, count) - 1;
        self.density(cell(&self.v_edges, p.y, self.rows), cell(&self.u_edges, p.x, self.columns))
    }
}

/// The cell that `u` falls on, and where in it. Cells without probability are never chosen.
fn pick(sums: &[f32], u: f32) -> (usize, f32) {
    let mut i = sums.partition_point(|&s| s <= u).clamp(1, sums.len() - 1) - 1;
    // Past the last sum (below 1 by rounding, or a tail without weight): the last cell that has any.
    while i > 0 && sums[i + 1] <= sums[i] {
        i -= 1;
    }
    let width = sums[i + 1] - sums[i];
    (i, if width > 0.0 { ((u - sums[i]) / width).clamp(0.0, ONE_MINUS) } else { 0.0 })
}

/// Mean over the texel's area of the bilinearly interpolated picture: ⅛, ¾, ⅛ along each axis. Positive wherever the
/// interpolated picture is.
#[allow(clippy::cast_possible_wrap, clippy::cast_sign_loss, reason = "texel indices")]
fn smoothed(texels: &[[f32; 3]], width: u32, height: u32, x: u32, y: u32) -> DVec3 {
    const WEIGHTS: [(i32, f64); 3] = [(-1, 0.125), (0, 0.75), (1, 0.125)];
    let mut sum = DVec3::ZERO;
    for (dy, wy) in WEIGHTS {
        let row = (y as i32 + dy).clamp(0, height as i32 - 1) as usize;
        for (dx, wx) in WEIGHTS {
            let column = (x as i32 + dx).rem_euclid(width as i32) as usize;
            sum += Vec3::from_array(texels[row * width as usize + column]).as_dvec3() * (wx * wy);
        }
    }
    sum
}
