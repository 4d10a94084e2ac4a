//! How much of an error is seen.
//!
//! The eye sees contrast, ΔL/L, and sees it best in green, least in blue (Mitchell 1990, §3.1). A view transform's curve
//! is made to the same end: equal steps of what it gives look about equal. So an error is multiplied by the slope of that
//! curve at the pixel's value.

use crate::film::PixelEstimate;
use crate::output::View;
use glam::DVec3;

/// Sensitivity of red, green and blue: inverse to the contrasts 0.4, 0.3 and 0.6 from which on Mitchell (1987, §4) takes
/// further samples, green's as the unit.
const CHANNELS: DVec3 = DVec3::new(0.75, 1.0, 0.5);

/// Slopes are stored at eighths of a stop from 2^LOWEST on.
const LOWEST: f64 = -14.0;
const STEPS: usize = 8 * 14 + 1;

/// Slopes of a view transform.
#[derive(Debug, Clone)]
pub struct Visibility {
    /// Of the grey response, at 2^(LOWEST + i/8) of the view's unit.
    slopes: Vec<f64>,
    scale: f64,
}

impl Visibility {
    /// Of `view`'s response to grey, exposure included.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "radiance is f32")]
    pub fn new(view: View) -> Self {
        let plain = View { exposure_ev: 0.0, ..view };
        let shown = |level: f64| plain.encode([level as f32; 3]).y;
        // Steps of an eighth of a stop to both sides, below white: a curve's corners are rounded off, nothing else.
        let slope_at = |i: usize| {
            #[allow(clippy::cast_precision_loss, reason = "at most 113")]
            let at = libm::exp2((i as f64 / 8.0 + LOWEST).min(-0.125));
            let (low, high) = (at * libm::exp2(-0.125), at * libm::exp2(0.125));
            (shown(high) - shown(low)) / (high - low)
        };
        let slopes = (0..STEPS).map(slope_at).collect();
        Self { slopes, scale: libm::exp2(view.exposure_ev) }
    }

    /// What a screen shows more, as a part of what lies between black and white, for a little more light where there is
    /// `radiance`. Above 1, where screens clip, contrast counts as at 1: another exposure may show it.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss, reason = "a place")]
    pub fn slope(&self, radiance: f64) -> f64 {
        let level = radiance * self.scale;
        if level >= 1.0 {
            return self.scale * self.slopes[STEPS - 1] / level;
        }
        if level.is_nan() || level <= libm::exp2(LOWEST) {
            return self.scale * self.slopes[0];
        }
        let place = (libm::log2(level) - LOWEST) * 8.0;
        let i = (place as usize).min(STEPS - 2);
        let part = place - i as f64;
        self.scale * (self.slopes[i] * (1.0 - part) + self.slopes[i + 1] * part)
    }

    /// Largest over the channels of the estimate's squared standard error, as it is seen.
    #[must_use]
    pub fn square(&self, estimate: &PixelEstimate) -> f64 {
        let slope = DVec3::from_array(estimate.radiance.to_array().map(|c| self.slope(f64::from(c)))) * CHANNELS;
        (estimate.variance.as_dvec3() * slope * slope).max_element()
    }
}

/// What the square of dark values is raised by in relMSE.
pub(super) const DARK: f64 = 0.01;

/// Mean over the channels of the estimate's squared error over (value² + 0.01), a pixel's share of relMSE (Rousselle,
/// Knaus and Zwicker 2011).
pub(super) fn relative_square(estimate: &PixelEstimate) -> f64 {
    let value = estimate.radiance.as_dvec3();
    (estimate.variance.as_dvec3() / (value * value + DARK)).element_sum() / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::ViewTransform;
    use glam::Vec3;

    /// sRGB's slope is 12.92 near black, and (1.055/2.4)·x^(1/2.4 − 1) above; differences over a quarter of a stop are
    /// within 1 % of it.
    #[test]
    fn slopes_are_those_of_the_curve() {
        let visibility = Visibility::new(View::default());
        assert!((visibility.slope(1e-3) / 12.92 - 1.0).abs() < 1e-6);
        for level in [0.01_f64, 0.18, 0.6] {
            let slope = 1.055 / 2.4 * level.powf(1.0 / 2.4 - 1.0);
            assert!((visibility.slope(level) / slope - 1.0).abs() < 0.01, "{level}");
        }
    }

    #[test]
    fn more_exposure_shows_more_of_the_dark_and_contrast_stays_beyond_white() {
        let brighter = Visibility::new(View { exposure_ev: 2.0, ..View::default() });
        let plain = Visibility::new(View::default());
        assert!((brighter.slope(0.01) / (4.0 * plain.slope(0.04)) - 1.0).abs() < 1e-9);
        for (_, transform) in ViewTransform::ALL {
            let view = Visibility::new(View { transform, exposure_ev: 0.0 });
            assert!(view.slope(4.0) > 0.0 && (view.slope(8.0) * 2.0 / view.slope(4.0) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn green_counts_more_than_red_and_red_more_than_blue() {
        let visibility = Visibility::new(View::default());
        let seen = |variance| {
            visibility.square(&PixelEstimate { radiance: Vec3::splat(0.3), variance, ..PixelEstimate::default() })
        };
        assert!(seen(Vec3::Y) > seen(Vec3::X) && seen(Vec3::X) > seen(Vec3::Z));
    }
}
