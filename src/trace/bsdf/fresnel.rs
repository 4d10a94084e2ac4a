//! Fresnel reflectance: exact for dielectrics, Schlick's for the specification's formulas, and thin films.

use glam::{Mat3, Vec3};
use std::f32::consts::PI;

/// Schlick's weight (1 − cos)⁵.
#[inline]
pub(super) fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

/// Reflectance at normal incidence between media whose indices have ratio `eta`.
#[inline]
pub(super) fn f0_of(eta: f32) -> f32 {
    if eta <= 0.0 {
        // KHR_materials_ior's special value 0: full reflectance.
        return 1.0;
    }
    let r = (eta - 1.0) / (eta + 1.0);
    r * r
}

/// Exact unpolarised reflectance of a dielectric, `eta` times as dense behind as before; 1 at total reflection.
#[inline]
pub(super) fn dielectric(cos: f32, eta: f32) -> f32 {
    let cos = cos.clamp(0.0, 1.0);
    let g2 = eta * eta - (1.0 - cos * cos);
    if g2 <= 0.0 {
        return 1.0;
    }
    let g = g2.sqrt();
    // Fresnel's two polarisations with g = eta cos_t.
    let s = (cos - g) / (cos + g);
    let p = (eta * eta * cos - g) / (eta * eta * cos + g);
    (0.5 * (s * s + p * p)).min(1.0)
}

/// Reflectance of a thin film of index `film` and `thickness_nm` over a base of normal reflectance `base_f0` (Belcour
/// and Barla 2017, in the spectral form of `KHR_materials_iridescence`), seen from air at cosine `cos`.
pub(super) fn thin_film(cos: f32, film: f32, thickness_nm: f32, base_f0: Vec3) -> Vec3 {
    // The film fades out below 0.03 nm, so that thickness 0 is no film (the extension's own ramp).
    let ramp = (thickness_nm / 0.03).clamp(0.0, 1.0);
    let film = 1.0 + (film - 1.0) * (ramp * ramp * (3.0 - 2.0 * ramp));
    let sin2 = (1.0 - cos * cos).max(0.0) / (film * film);
    if sin2 >= 1.0 {
        return Vec3::ONE;
    }
    let cos2 = (1.0 - sin2).sqrt();
    let r0 = f0_of(film);
    let r12 = r0 + (1.0 - r0) * schlick_weight(cos);
    let t121 = 1.0 - r12;
    let phi21 = if film < 1.0 { 0.0 } else { PI };
    // The base's index from its reflectance, which must stay below total.
    let root = base_f0.clamp(Vec3::ZERO, Vec3::splat(0.9999)).map(f32::sqrt);
    let base = (Vec3::ONE + root) / (Vec3::ONE - root);
    let r1 = base.map(|b| f0_of(b / film));
    let r23 = r1 + (Vec3::ONE - r1) * schlick_weight(cos2);
    let phi23 = base.map(|b| if b < film { PI } else { 0.0 });
    let path = 2.0 * film * thickness_nm * cos2;
    let phi = Vec3::splat(phi21) + phi23;

    let r123 = (r12 * r23).clamp(Vec3::splat(1e-5), Vec3::splat(0.9999));
    let root123 = r123.map(f32::sqrt);
    let rs = t121 * t121 * r23 / (Vec3::ONE - r123);
    let mut sum = rs + r12;
    let mut cm = rs - t121;
    for order in 1..=2_u8 {
        cm *= root123;
        sum += 2.0 * cm * film_sensitivity(f32::from(order) * path, f32::from(order) * phi);
    }
    sum.clamp(Vec3::ZERO, Vec3::ONE)
}

/// The eye's response to a cosine of wavelength with optical path `path_nm`: the CIE matching curves as Gaussians,
/// whose Fourier transforms are Gaussians too (Belcour and Barla 2017, supplementary code).
fn film_sensitivity(path_nm: f32, shift: Vec3) -> Vec3 {
    let phase = 2.0 * PI * path_nm * 1e-9;
    let value = Vec3::new(5.4856e-13, 4.4201e-13, 5.2481e-13);
    let position = Vec3::new(1.6810e6, 1.7953e6, 2.2084e6);
    let variance = Vec3::new(4.3278e9, 9.3046e9, 6.6121e9);
    let cosine = |x: f32| libm::cosf(x);
    let gauss = |v: f32| libm::expf(-phase * phase * v);
    let mut xyz =
        value * (2.0 * PI * variance).map(f32::sqrt) * (position * phase + shift).map(cosine) * variance.map(gauss);
    xyz.x += 9.7470e-14 * (2.0 * PI * 4.5282e9_f32).sqrt() * cosine(2.2399e6 * phase + shift.x) * gauss(4.5282e9);
    xyz /= 1.0685e-7;
    RGB_FROM_XYZ * xyz
}

/// Linear Rec. 709 from CIE XYZ (columns), IEC 61966-2-1.
pub(super) const RGB_FROM_XYZ: Mat3 = Mat3::from_cols(
    Vec3::new(3.240_454_2, -0.969_266, 0.055_643_4),
    Vec3::new(-1.537_138_5, 1.876_010_8, -0.204_025_9),
    Vec3::new(-0.498_531_4, 0.041_556, 1.057_225_2),
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dielectric_reflectance_at_normal_incidence_is_f0() {
        for eta in [1.0_f32, 1.000_1, 1.33, 1.5, 2.4, 1e3, 1.0 / 1.5] {
            assert!((dielectric(1.0, eta) - f0_of(eta)).abs() < 1e-6, "{eta}");
        }
    }

    #[test]
    fn equal_media_reflect_nothing_at_any_angle() {
        for i in 1..=1000_u16 {
            let cos = f32::from(i) / 1000.0;
            // g² = 1 − (1 − cos²) rounds by one unit in 1, so g errs by u / cos and s by u / (2 cos²).
            let bound = crate::numeric::gamma(2) / (cos * cos);
            assert!(dielectric(cos, 1.0) <= bound * bound + 1e-12);
        }
    }

    #[test]
    fn beyond_the_critical_angle_everything_is_reflected() {
        let critical = (1.0_f32 - 1.0 / (1.5 * 1.5)).sqrt();
        assert!(dielectric(critical * 0.999, 1.0 / 1.5) >= 1.0);
        assert!(dielectric(critical * 1.01, 1.0 / 1.5) < 1.0);
    }

    #[test]
    fn a_film_of_no_thickness_is_the_bare_base() {
        for f0 in [0.04_f32, 0.5, 0.9] {
            let film = thin_film(1.0, 1.3, 0.0, Vec3::splat(f0));
            assert!((film - Vec3::splat(f0)).abs().max_element() < 0.02, "{f0}: {film}");
        }
    }

    #[test]
    fn films_stay_between_black_and_white() {
        for t in 0..200_u16 {
            for c in 0..=20_u16 {
                let f = thin_film(f32::from(c) / 20.0, 1.3, f32::from(t) * 10.0, Vec3::new(0.04, 0.5, 1.0));
                assert!(f.min_element() >= 0.0 && f.max_element() <= 1.0);
            }
        }
    }
}
