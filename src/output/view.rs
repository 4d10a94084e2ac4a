//! Display transforms: scene-linear Rec. 709 radiance → R'G'B' in [0, 1] for PNG and video.

use crate::{Error, Result};
use glam::{DMat3, DVec3};
use std::fmt;
use std::str::FromStr;

/// How radiance becomes what a screen shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ViewTransform {
    /// The sRGB curve (IEC 61966-2-1), clipped at 1.
    #[default]
    Standard,
    /// AgX, base look (Sobotka 2022): a log₂ curve over 16.5 stops in slightly desaturated primaries.
    Agx,
    /// Khronos PBR Neutral (Khronos Group 2024): base colours unchanged up to 0.8, highlights compressed.
    KhronosNeutral,
    /// The camera curve of BT.709 (and BT.601), clipped at 1: what the standards' own cameras would have recorded.
    Bt709,
}

impl ViewTransform {
    /// All of them with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("standard", Self::Standard),
        ("agx", Self::Agx),
        ("khronos-neutral", Self::KhronosNeutral),
        ("bt709", Self::Bt709),
    ];
}

impl fmt::Display for ViewTransform {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL.iter().find(|(_, view)| view == self).map_or("standard", |(name, _)| name))
    }
}

impl FromStr for ViewTransform {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.iter().find(|(name, _)| *name == text).map(|&(_, view)| view).ok_or_else(|| {
            Error::invalid(format!("view \"{text}\""), "expected standard, agx, khronos-neutral or bt709")
        })
    }
}

/// A display transform with an exposure before it.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
pub struct View {
    /// The transform.
    pub transform: ViewTransform,
    /// Stops added before it: +1 doubles.
    pub exposure_ev: f64,
}

impl View {
    /// R'G'B' of scene-linear `rgb`, each from 0 to 1. What is negative or not a number shows black.
    #[must_use]
    pub fn encode(&self, rgb: [f32; 3]) -> DVec3 {
        let scale = libm::exp2(self.exposure_ev);
        let linear = DVec3::from_array(rgb.map(f64::from)) * scale;
        let linear = DVec3::from_array(linear.to_array().map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1e9) }));
        match self.transform {
            ViewTransform::Standard => map(linear, srgb_from_linear),
            ViewTransform::Agx => agx(linear),
            ViewTransform::KhronosNeutral => map(khronos_neutral(linear), srgb_from_linear),
            ViewTransform::Bt709 => map(linear, bt709_from_linear),
        }
    }
}

fn map(v: DVec3, f: fn(f64) -> f64) -> DVec3 {
    DVec3::from_array(v.to_array().map(|c| f(c).clamp(0.0, 1.0)))
}

/// The sRGB curve (IEC 61966-2-1) from [0, 1] to [0, 1].
#[must_use]
pub fn srgb_from_linear(linear: f64) -> f64 {
    let x = linear.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 }
}

/// The inverse of [`srgb_from_linear`].
#[must_use]
pub fn linear_from_srgb(encoded: f64) -> f64 {
    let x = encoded.clamp(0.0, 1.0);
    if x <= 0.040_45 { x / 12.92 } else { libm::pow((x + 0.055) / 1.055, 2.4) }
}

/// BT.709-6 §1.2, the same curve as BT.601-7 §2.6.4.
fn bt709_from_linear(linear: f64) -> f64 {
    let x = linear.clamp(0.0, 1.0);
    if x < 0.018 { 4.5 * x } else { 1.099 * libm::pow(x, 0.45) - 0.099 }
}

/// The AgX base: inset, log₂ from 10 stops below middle grey to 6.5 above, a sigmoid through (p, ½) with slope 2 and
/// powers 3 (toe) and 3.25 (shoulder), outset; the result is for a display of exponent 2.2.
fn agx(linear: DVec3) -> DVec3 {
    const STOPS: f64 = 16.5;
    /// Each of the rows sums to 1: grey stays grey.
    const INSET: DMat3 = DMat3::from_cols(
        DVec3::new(0.842_401_070_950_468_6, 0.042_401_070_950_468_54, 0.042_401_070_950_468_54),
        DVec3::new(0.078_436_501_561_802_76, 0.878_436_501_561_802_8, 0.078_436_501_561_802_76),
        DVec3::new(0.079_162_427_487_728_7, 0.079_162_427_487_728_7, 0.879_162_427_487_728_7),
    );
    let lowest = libm::log2(0.18) - 10.0;
    let curved = (INSET * linear).to_array().map(|c| {
        let log = if c > 0.0 { libm::log2(c) } else { lowest };
        agx_sigmoid(((log - lowest) / STOPS).clamp(0.0, 1.0))
    });
    let display = INSET.inverse() * DVec3::from_array(curved);
    map(display, |c| srgb_from_linear(libm::pow(c.clamp(0.0, 1.0), 2.2)))
}

/// ½ + 2 (v − p) (1 + a |v − p|^b)^(−1/b), with a chosen on each side so that 0 ↦ 0 and 1 ↦ 1.
fn agx_sigmoid(v: f64) -> f64 {
    const PIVOT: f64 = 10.0 / 16.5;
    let (reach, power) = if v < PIVOT { (PIVOT, 3.0) } else { (1.0 - PIVOT, 3.25) };
    let a = (libm::pow(4.0 * reach, power) - 1.0) / libm::pow(reach, power);
    0.5 + 2.0 * (v - PIVOT) * libm::pow(1.0 + a * libm::pow((v - PIVOT).abs(), power), -1.0 / power)
}

/// Khronos PBR Neutral tone mapper, specification 1.0; linear in, linear out.
fn khronos_neutral(linear: DVec3) -> DVec3 {
    /// Fresnel reflectance that a white base colour adds: taken off so that base colours come out as they went in.
    const F90: f64 = 0.04;
    const START: f64 = 0.8 - F90;
    const DESATURATION: f64 = 0.15;
    let low = linear.min_element();
    let offset = if low < 2.0 * F90 { low - low * low / (4.0 * F90) } else { F90 };
    let color = linear - offset;
    let peak = color.max_element();
    if peak < START {
        return color;
    }
    let room = 1.0 - START;
    let new_peak = 1.0 - room * room / (peak + room - START);
    let whiten = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    (color * (new_peak / peak)).lerp(DVec3::splat(new_peak), whiten)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encode(transform: ViewTransform, rgb: [f32; 3]) -> DVec3 {
        View { transform, exposure_ev: 0.0 }.encode(rgb)
    }

    #[test]
    fn the_srgb_curve_and_its_inverse_agree() {
        for i in 0..=1000 {
            let x = f64::from(i) / 1000.0;
            // The standard's two pieces meet to 3e-8 only.
            assert!((linear_from_srgb(srgb_from_linear(x)) - x).abs() < 1e-7, "{x}");
        }
        assert!((srgb_from_linear(0.5) - 0.735_356_983_052_449).abs() < 1e-12);
    }

    #[test]
    fn every_view_keeps_grey_grey_and_ascends() {
        for (name, view) in ViewTransform::ALL {
            let mut last = -1.0;
            for i in 0..200_i16 {
                let value = libm::exp2f(f32::from(i) * 0.1 - 13.0);
                let out = encode(view, [value; 3]);
                assert!((out.x - out.y).abs() < 1e-9 && (out.y - out.z).abs() < 1e-9, "{name} {value} {out}");
                assert!(out.x >= last - 1e-12 && (0.0..=1.0).contains(&out.x), "{name} {value}");
                last = out.x;
            }
            for odd in [f32::NAN, f32::INFINITY, -1.0, f32::NEG_INFINITY] {
                let out = encode(view, [odd, 0.0, odd]);
                assert!(out.to_array().iter().all(|c| (0.0..=1.0).contains(c)), "{name} {odd}");
            }
        }
    }

    /// Middle grey lies at the sigmoid's pivot, which is ½ on a display of exponent 2.2.
    #[test]
    fn agx_puts_middle_grey_at_half() {
        let grey = encode(ViewTransform::Agx, [0.18; 3]);
        let want = srgb_from_linear(libm::pow(0.5, 2.2));
        assert!((grey.x - want).abs() < 1e-6, "{}", grey.x);
        assert!(agx_sigmoid(0.0).abs() < 1e-12 && (agx_sigmoid(1.0) - 1.0).abs() < 1e-12);
    }

    /// The specification's own claims: base colours pass but for the Fresnel offset, and the compression starts smooth.
    #[test]
    fn khronos_neutral_passes_base_colours() {
        let out = khronos_neutral(DVec3::new(0.5, 0.3, 0.2));
        assert!((out - DVec3::new(0.46, 0.26, 0.16)).abs().max_element() < 1e-12);
        let (below, above) = (khronos_neutral(DVec3::splat(0.8 - 1e-7)), khronos_neutral(DVec3::splat(0.8 + 1e-7)));
        assert!((above - below).abs().max_element() < 3e-7);
        assert!(khronos_neutral(DVec3::splat(1e6)).max_element() < 1.0);
    }

    #[test]
    fn a_stop_doubles() {
        let view = View { transform: ViewTransform::Standard, exposure_ev: 1.0 };
        assert_eq!(view.encode([0.2, 0.1, 0.05]), View::default().encode([0.4, 0.2, 0.1]));
    }

    #[test]
    fn names_read_back() {
        for (name, view) in ViewTransform::ALL {
            assert_eq!(name.parse::<ViewTransform>().unwrap(), view);
            assert_eq!(view.to_string(), name);
        }
    }
}
