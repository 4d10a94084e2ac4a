//! A moving disk between a lens and a lit plane: the function that varies with all seven factors.

use crate::trace::quadrature::{circle_rectangle_overlap, circles_overlap, integrate, panels};
use std::f64::consts::PI;

#[derive(Debug, Clone, Copy)]
pub(super) struct MovingDisk {
    pub(super) centre: [f64; 2],
    pub(super) velocity: [f64; 2],
    pub(super) radius: f64,
    /// Circle of confusion's radius at the disk, pixels.
    pub(super) lens: f64,
    pub(super) emitted: f64,
    pub(super) plane: Plane,
}

/// How the plane behind a disk is lit.
#[derive(Debug, Clone, Copy)]
pub(super) enum Plane {
    /// By a square light of side `light`, `height` above, whose centre is `offset` from the film's origin: brightness
    /// falls with the fourth power of the cosine, as under a small element of a light that faces the plane. The disk
    /// casts no shadow.
    Lit { light: f64, height: f64, offset: [f64; 2] },
    /// Evenly, but for the disk's shadow: `light` is the light's side projected onto the disk's plane, `offset` where
    /// its centre is projected to.
    Shadowed { light: f64, offset: [f64; 2] },
}

impl MovingDisk {
    fn at(&self, t: f64) -> [f64; 2] {
        [0, 1].map(|k| self.centre[k] + self.velocity[k] * t)
    }

    pub(super) fn value(&self, p: &[f64; 7]) -> f64 {
        let [cx, cy] = self.at(p[2]);
        let [lx, ly] = disk_from_square(p[3], p[4]).map(|l| l * self.lens);
        if (p[0] + lx - cx).powi(2) + (p[1] + ly - cy).powi(2) < self.radius * self.radius {
            return self.emitted;
        }
        match self.plane {
            Plane::Lit { light, height, offset } => {
                let [gx, gy] = [0, 1].map(|k| offset[k] - p[k] + light * (p[5 + k] - 0.5));
                let cosine_squared = height * height / (height * height + gx * gx + gy * gy);
                cosine_squared * cosine_squared
            }
            Plane::Shadowed { light, offset } => {
                let [gx, gy] = [0, 1].map(|k| p[k] + offset[k] + light * (p[5 + k] - 0.5));
                if (gx - cx).powi(2) + (gy - cy).powi(2) < self.radius * self.radius { 0.0 } else { 1.0 }
            }
        }
    }

    /// Lens and shadow in closed form; film and time by quadrature, and the lit plane's light.
    pub(super) fn mean(&self, x: f64, y: f64, fine: usize) -> f64 {
        let mut sum = 0.0;
        for (px, wx) in panels(x, x + 1.0, fine) {
            for (py, wy) in panels(y, y + 1.0, fine) {
                let lit = self.lit(px, py);
                for (t, wt) in panels(0.0, 1.0, fine) {
                    let [cx, cy] = self.at(t);
                    let shared = circles_overlap(self.radius, self.lens, (px - cx).hypot(py - cy));
                    let covered = shared / (PI * self.lens * self.lens);
                    let seen = lit * (1.0 - self.dark([px - cx, py - cy]));
                    sum += wt * wx * wy * (covered * self.emitted + (1.0 - covered) * seen);
                }
            }
        }
        sum
    }

    /// Brightness of the plane at a film position, averaged over the light.
    fn lit(&self, x: f64, y: f64) -> f64 {
        let Plane::Lit { light, height, offset } = self.plane else { return 1.0 };
        let square = height * height;
        let low = [offset[0] - x, offset[1] - y].map(|o| o - 0.5 * light);
        let sum = integrate(low[0], low[0] + light, 1, |gx| {
            integrate(low[1], low[1] + light, 1, |gy| (square / (square + gx * gx + gy * gy)).powi(2))
        });
        sum / (light * light)
    }

    /// Share of the light that the disk hides from a position relative to the disk's centre.
    fn dark(&self, at: [f64; 2]) -> f64 {
        let Plane::Shadowed { light, offset } = self.plane else { return 0.0 };
        let [x, y] = [0, 1].map(|k| at[k] + offset[k] - 0.5 * light);
        circle_rectangle_overlap(self.radius, [x, x + light], [y, y + light]) / (light * light)
    }
}

/// The concentric map of the square onto the unit disk, area for area (Shirley and Chiu 1997).
fn disk_from_square(u: f64, v: f64) -> [f64; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0; 2];
    }
    let (radius, turn) = if a.abs() > b.abs() { (a, PI / 4.0 * (b / a)) } else { (b, PI / 2.0 - PI / 4.0 * (a / b)) };
    let (s, c) = libm::sincos(turn);
    [radius * c, radius * s]
}
