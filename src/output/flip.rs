//! ꟻLIP: how different two pictures look when one is flipped for the other.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström and Fairchild (2020) for display-referred pictures; Andersson,
//! Nilsson, Shirley and Akenine-Möller (2021) for scene-linear ones: the largest error over exposures from where the
//! reference's brightest pixel is just not white to where its median is, a stop apart, each tone-mapped by the ACES
//! approximation of Narkowicz (2015). 0 is no visible difference, 1 the greatest. The viewing distance is the authors'
//! default: a 3840-pixel screen 0.7 m wide seen from 0.7 m, 67 pixels a degree.

use rayon::prelude::*;
use std::f64::consts::PI;

/// Pixels per degree of visual angle.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * PI / 180.0;

/// Errors of display-referred pictures, per pixel in row order, each from 0 to 1. Pictures are linear, in [0, 1] (more
/// is clipped), `width` pixels wide and of equal size.
#[must_use]
pub fn ldr(test: &[[f64; 3]], reference: &[[f64; 3]], width: usize) -> Vec<f64> {
    let (a, b) = (Prepared::new(test, width), Prepared::new(reference, width));
    /// Exponents of colour and feature differences, and the knee of the former's redistribution (2020, §4).
    const QC: f64 = 0.7;
    const PC: f64 = 0.4;
    const PT: f64 = 0.95;
    let largest = libm::pow(hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])), QC);
    let knee = PC * largest;
    (0..test.len())
        .into_par_iter()
        .map(|i| {
            let colour = libm::pow(hyab(a.colour[i], b.colour[i]), QC);
            let colour =
                if colour < knee { PT / knee * colour } else { PT + (colour - knee) / (largest - knee) * (1.0 - PT) };
            let feature = (a.edges[i] - b.edges[i]).abs().max((a.points[i] - b.points[i]).abs());
            let feature = (feature * std::f64::consts::FRAC_1_SQRT_2).sqrt();
            libm::pow(colour, 1.0 - feature)
        })
        .collect()
}

/// Errors of scene-linear pictures, per pixel in row order, each from 0 to 1.
#[must_use]
pub fn hdr(test: &[[f64; 3]], reference: &[[f64; 3]], width: usize) -> Vec<f64> {
    let mut worst = vec![0.0_f64; test.len()];
    for exposure in exposures(reference) {
        let scale = libm::exp2(exposure);
        let shown = |picture: &[[f64; 3]]| -> Vec<[f64; 3]> {
            picture.iter().map(|rgb| rgb.map(|c| aces(scale * c.max(0.0)))).collect()
        };
        for (most, error) in worst.iter_mut().zip(ldr(&shown(test), &shown(reference), width)) {
            *most = most.max(error);
        }
    }
    worst
}

/// Coefficients of the ACES approximation with its pre-exposure of 0.6 worked in: (k0 x² + k1 x)/(k3 x² + k4 x + k5).
const ACES: [f64; 5] = [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

fn aces(x: f64) -> f64 {
    let [k0, k1, k3, k4, k5] = ACES;
    // Beyond this the curve is 1 to the last bit, and squares stay finite.
    let x = x.min(1e12);
    ((k0 * x * x + k1 * x) / (k3 * x * x + k4 * x + k5)).clamp(0.0, 1.0)
}

/// The exposures in EV that HDR-ꟻLIP looks at (2021, §3): from the brightest luminance to the median at 0.85.
fn exposures(reference: &[[f64; 3]]) -> Vec<f64> {
    const SHOWN: f64 = 0.85;
    let mut luminances: Vec<f64> =
        reference.iter().map(|rgb| 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]).collect();
    luminances.sort_by(f64::total_cmp);
    let Some(&brightest) = luminances.last().filter(|&&brightest| brightest > 0.0) else { return vec![0.0] };
    // Of an even number of pixels the brighter of the middle two, as in the authors' program.
    let median = luminances[luminances.len() / 2];
    let [k0, k1, k3, k4, k5] = ACES;
    let (c0, c1) = ((k1 - k4 * SHOWN) / (k0 - k3 * SHOWN), -k5 * SHOWN / (k0 - k3 * SHOWN));
    let x = -0.5 * c0 + (0.25 * c0 * c0 - c1).sqrt();
    let start = libm::log2(x / brightest);
    // A median of zero would ask for infinite exposure: 16 stops up is beyond what any display tells apart.
    let stop = if median > 0.0 { libm::log2(x / median).min(start + 16.0) } else { start + 16.0 };
    let count = ceil(stop - start).max(2);
    (0..count).map(|index| start + f64::from(index) * (stop - start) / f64::from(count - 1)).collect()
}

/// What is compared of a picture.
struct Prepared {
    /// Hunt-adjusted L*a*b* after the eye's contrast sensitivity.
    colour: Vec<[f64; 3]>,
    /// Strength of edges and of points in luminance.
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Prepared {
    fn new(linear: &[[f64; 3]], width: usize) -> Self {
        let opponent: Vec<[f64; 3]> =
            linear.iter().map(|&rgb| opponent_from_linear(rgb.map(|c| c.clamp(0.0, 1.0)))).collect();
        let channel = |index: usize| -> Vec<f64> { opponent.iter().map(|c| c[index]).collect() };
        let filtered = [
            sensitivity(&channel(0), width, &[(1.0, 0.0047)]),
            sensitivity(&channel(1), width, &[(1.0, 0.0053)]),
            sensitivity(&channel(2), width, &[(34.1, 0.04), (13.5, 0.025)]),
        ];
        let colour = (0..linear.len())
            .into_par_iter()
            .map(|i| {
                let rgb = linear_from_opponent([filtered[0][i], filtered[1][i], filtered[2][i]]);
                hunt_lab(rgb.map(|c| c.clamp(0.0, 1.0)))
            })
            .collect();
        let luminance: Vec<f64> = opponent.iter().map(|c| (c[0] + 16.0) / 116.0).collect();
        let (edges, points) = features(&luminance, width);
        Self { colour, edges, points }
    }
}

/// White of the matrix below: D65.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];

fn xyz_from_linear(rgb: [f64; 3]) -> [f64; 3] {
    let [r, g, b] = rgb;
    [
        (10_135_552.0 * r + 8_788_810.0 * g + 4_435_075.0 * b) / 24_577_794.0,
        (2_613_072.0 * r + 8_788_810.0 * g + 887_015.0 * b) / 12_288_897.0,
        (1_425_312.0 * r + 8_788_810.0 * g + 70_074_185.0 * b) / 73_733_382.0,
    ]
}

fn linear_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = xyz;
    [
        3.241_003_275 * x - 1.537_398_934 * y - 0.498_615_861 * z,
        -0.969_224_334 * x + 1.875_930_071 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_202 * y + 1.057_148_933 * z,
    ]
}

/// YCxCz: a linear relative of L*a*b*.
fn opponent_from_linear(rgb: [f64; 3]) -> [f64; 3] {
    let xyz = xyz_from_linear(rgb);
    let [x, y, z] = [xyz[0] / WHITE[0], xyz[1] / WHITE[1], xyz[2] / WHITE[2]];
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn linear_from_opponent(ycxcz: [f64; 3]) -> [f64; 3] {
    let y = (ycxcz[0] + 16.0) / 116.0;
    let (x, z) = (y + ycxcz[1] / 500.0, y - ycxcz[2] / 200.0);
    linear_from_xyz([x * WHITE[0], y * WHITE[1], z * WHITE[2]])
}

/// L*a*b* with a* and b* scaled by lightness: colours are stronger in bright light (Hunt 1952).
fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let xyz = xyz_from_linear(rgb);
    let f = |index: usize| {
        let t = xyz[index] / WHITE[index];
        if t > DELTA * DELTA * DELTA { libm::cbrt(t) } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let (x, y, z) = (f(0), f(1), f(2));
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// City-block in lightness, Euclidean in colour (Abasi, Amani Tehran and Fairchild 2020).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

/// Filters with a sum of Gaussians of amplitudes and widths (a, b): a √(π/b) exp(−π² r²/b), r in degrees.
fn sensitivity(plane: &[f64], width: usize, terms: &[(f64, f64)]) -> Vec<f64> {
    // All channels use the widest one's radius, as the authors do.
    let radius = ceil(3.0 * (0.04 / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE);
    let kernels: Vec<(f64, Vec<f64>)> = terms
        .iter()
        .map(|&(a, b)| {
            let kernel = symmetric(radius, |x| libm::exp(-PI * PI * (x / PIXELS_PER_DEGREE).powi(2) / b));
            let sum: f64 = kernel.iter().sum();
            (a * (PI / b).sqrt() * sum * sum, kernel.iter().map(|k| k / sum).collect())
        })
        .collect();
    let total: f64 = kernels.iter().map(|(share, _)| share).sum();
    let mut out = vec![0.0; plane.len()];
    for (share, kernel) in &kernels {
        for (sum, value) in out.iter_mut().zip(convolve(plane, width, kernel, kernel)) {
            *sum += share / total * value;
        }
    }
    out
}

/// Strength of edges (first derivative) and points (second derivative), each over both axes.
fn features(luminance: &[f64], width: usize) -> (Vec<f64>, Vec<f64>) {
    /// Width of the eye's edge detector in degrees (2020, §3.2).
    const DETECTOR: f64 = 0.082;
    let deviation = 0.5 * DETECTOR * PIXELS_PER_DEGREE;
    let radius = ceil(3.0 * deviation);
    let gauss = symmetric(radius, |x| libm::exp(-x * x / (2.0 * deviation * deviation)));
    let sum: f64 = gauss.iter().sum();
    let smooth: Vec<f64> = gauss.iter().map(|g| g / sum).collect();
    let weighted = |f: &dyn Fn(f64) -> f64| {
        let raw = symmetric(radius, |x| f(x) * libm::exp(-x * x / (2.0 * deviation * deviation)));
        let positive: f64 = raw.iter().filter(|&&v| v > 0.0).sum();
        let negative: f64 = -raw.iter().filter(|&&v| v < 0.0).sum::<f64>();
        raw.into_iter().map(|v| if v > 0.0 { v / positive } else { v / negative }).collect::<Vec<_>>()
    };
    let strength = |detector: &[f64]| {
        let across = convolve(luminance, width, detector, &smooth);
        let down = convolve(luminance, width, &smooth, detector);
        across.into_iter().zip(down).map(|(x, y)| x.hypot(y)).collect::<Vec<_>>()
    };
    let edges = strength(&weighted(&|x| -x));
    let points = strength(&weighted(&|x| x * x / (deviation * deviation) - 1.0));
    (edges, points)
}

#[allow(clippy::cast_possible_truncation, reason = "radii are some pixels")]
fn ceil(x: f64) -> i32 {
    x.ceil() as i32
}

/// `f` at −radius … radius.
fn symmetric(radius: i32, f: impl Fn(f64) -> f64) -> Vec<f64> {
    (-radius..=radius).map(|x| f(f64::from(x))).collect()
}

/// Correlates rows with `across` and columns with `down`; beyond its edges the picture's edge is repeated.
fn convolve(plane: &[f64], width: usize, across: &[f64], down: &[f64]) -> Vec<f64> {
    let height = plane.len() / width;
    let reach = |centre: usize, k: usize, radius: usize, last: usize| (centre + k).saturating_sub(radius).min(last);
    let mut rows = vec![0.0; plane.len()];
    rows.par_chunks_mut(width).zip(plane.par_chunks(width)).for_each(|(out, line)| {
        for (x, value) in out.iter_mut().enumerate() {
            let terms = across.iter().enumerate().map(|(k, c)| c * line[reach(x, k, across.len() / 2, width - 1)]);
            *value = terms.sum();
        }
    });
    let mut all = vec![0.0; plane.len()];
    all.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        for (k, c) in down.iter().enumerate() {
            let from = reach(y, k, down.len() / 2, height - 1) * width;
            for (sum, value) in out.iter_mut().zip(&rows[from..from + width]) {
                *sum += c * value;
            }
        }
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_have_no_error_and_black_on_white_the_greatest() {
        let grey = vec![[0.3; 3]; 400];
        assert!(ldr(&grey, &grey, 20).iter().all(|&e| e.abs() < 1e-12));
        assert!(hdr(&grey, &grey, 20).iter().all(|&e| e.abs() < 1e-12));
        let (black, white) = (vec![[0.0; 3]; 400], vec![[1.0; 3]; 400]);
        let errors = ldr(&black, &white, 20);
        assert!(errors.iter().all(|&e| e > 0.9 && e <= 1.0), "{}", errors[0]);
    }

    #[test]
    fn colour_conversions_invert() {
        for rgb in [[0.2, 0.5, 0.9], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]] {
            let back = linear_from_opponent(opponent_from_linear(rgb));
            for (a, b) in rgb.into_iter().zip(back) {
                assert!((a - b).abs() < 1e-7, "{rgb:?} {back:?}");
            }
        }
    }

    /// Means and single pixels of the authors' own program (flip-evaluator 1.7, in f32) on the same pictures.
    #[test]
    fn errors_are_those_of_the_authors_program() {
        let codes = |second: bool| -> Vec<[f64; 3]> {
            let places = (0..24_u32).flat_map(|y| (0..32_u32).map(move |x| (x, y)));
            let (step, shift) = if second { (13, 4) } else { (11, 0) };
            places.map(|(x, y)| [x * 37 + y * step, x * 8 + shift, y * 10].map(|code| f64::from(code % 256))).collect()
        };
        let (reference, test) = (codes(false), codes(true));
        let display = |picture: &[[f64; 3]]| -> Vec<[f64; 3]> {
            picture.iter().map(|rgb| rgb.map(|code| super::super::view::linear_from_srgb(code / 255.0))).collect()
        };
        let scene = |picture: &[[f64; 3]]| -> Vec<[f64; 3]> {
            picture.iter().map(|rgb| rgb.map(|code| (code / 64.0) * (code / 64.0))).collect()
        };
        let low = ldr(&display(&test), &display(&reference), 32);
        let high = hdr(&scene(&test), &scene(&reference), 32);
        for (errors, mean, pixels) in [
            (low, 0.222_830_25, [0.070_382_15, 0.060_193_98, 0.146_971_18, 0.350_864_44]),
            (high, 0.242_278_95, [0.089_546_97, 0.217_924_77, 0.267_760_52, 0.428_393_57]),
        ] {
            assert!((errors.iter().sum::<f64>() / 768.0 - mean).abs() < 1e-6, "{mean}");
            for (index, wanted) in [0, 100, 400, 767].into_iter().zip(pixels) {
                assert!((errors[index] - wanted).abs() < 2e-6, "{index}: {} {wanted}", errors[index]);
            }
        }
    }

    #[test]
    fn errors_grow_with_the_difference() {
        let reference: Vec<[f64; 3]> = (0..900).map(|i| [f64::from(i % 30) / 30.0; 3]).collect();
        let mean = |scale: f64| {
            let test: Vec<[f64; 3]> = reference.iter().map(|rgb| rgb.map(|c| c * scale)).collect();
            ldr(&test, &reference, 30).iter().sum::<f64>() / 900.0
        };
        assert!(mean(0.99) < mean(0.9) && mean(0.9) < mean(0.5));
    }
}
