//! Colours: written as sRGB hexadecimal, kept linear.

use glam::DVec3;

/// Linear colour of an sRGB code such as `0x336699`.
pub(crate) fn srgb(code: u32) -> DVec3 {
    let channel = |shift: u32| decode(f64::from((code >> shift) & 0xff) / 255.0);
    DVec3::new(channel(16), channel(8), channel(0))
}

/// From an sRGB value in [0, 1] to linear (IEC 61966-2-1).
fn decode(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
}

/// From linear in [0, 1] to an sRGB value in [0, 1].
pub(crate) fn encode(v: f64) -> f64 {
    if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * libm::pow(v, 1.0 / 2.4) - 0.055 }
}

/// Linear colour of a black body's hue, luminance about 1, for the temperatures of lamps and daylight in kelvin.
///
/// Tanner Helland's fit would do for pictures; this is coarser still: interpolation between five D/A-like whites in
/// linear sRGB, enough for lights that are warm or cool on purpose.
pub(crate) fn lamp(kelvin: f64) -> DVec3 {
    const TABLE: [(f64, [f64; 3]); 5] = [
        (2000.0, [2.45, 0.67, 0.04]),
        (3000.0, [1.78, 0.86, 0.25]),
        (4500.0, [1.30, 0.96, 0.62]),
        (6500.0, [1.00, 1.00, 1.00]),
        (10000.0, [0.78, 1.00, 1.45]),
    ];
    let last = TABLE.len() - 1;
    let k = kelvin.clamp(TABLE[0].0, TABLE[last].0);
    let i = TABLE.iter().rposition(|&(t, _)| t <= k).map_or(0, |i| i.min(last - 1));
    let ((t0, c0), (t1, c1)) = (TABLE[i], TABLE[i + 1]);
    DVec3::from_array(c0).lerp(DVec3::from_array(c1), (k - t0) / (t1 - t0))
}
