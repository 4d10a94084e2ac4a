//! Furnaces, and sampling against evaluation.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "indices and means of bounded values")]
#![allow(clippy::print_stdout, reason = "the measured figures that docs/materials.md quotes")]

use super::albedo::Glass;
use super::lobes::{Boundary, CoatParameters, Parameters};
use super::tangent::Basis;
use super::*;
use glam::Vec2;

mod mixtures;

fn parameters(cos: f32) -> Parameters<'static> {
    let wo = Vec3A::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    Parameters {
        wo,
        ng: Vec3A::Z,
        basis: Basis::new(Vec3A::Z, Vec3A::X),
        base: Vec3::ONE,
        metallic: 0.0,
        alpha: Vec2::splat(0.25),
        f0: Vec3::splat(0.04),
        f90: 1.0,
        metal_f0: Vec3::ONE,
        transmission: 0.0,
        boundary: None,
        diffuse_transmission: 0.0,
        diffuse_transmission_color: Vec3::ONE,
        coat: None,
        sheen: None,
        diffuse_only: false,
    }
}

/// Mean throughput over `n` lattice points: the directional albedo as the path tracer sees it.
fn furnace(bsdf: &Bsdf, n: u32) -> Vec3 {
    let mut sum = glam::DVec3::ZERO;
    for i in 0..n {
        let u = Vec2::new(
            ((f64::from(i) + 0.5) / f64::from(n)) as f32,
            (f64::from(i) * 0.618_033_988_749_894_9 + 0.5).fract() as f32,
        );
        let extra = (f64::from(i) * 0.754_877_666_246_692_8 + 0.5).fract() as f32;
        if let Some(s) = bsdf.sample(u, extra) {
            assert!(s.throughput.is_finite() && s.throughput.min_element() >= 0.0, "{s:?}");
            sum += s.throughput.as_dvec3();
        }
    }
    (sum / f64::from(n)).as_vec3()
}

const COSINES: [f32; 7] = [1.0, 0.9, 0.7, 0.5, 0.3, 0.1, 0.02];
const ROUGHNESSES: [f32; 9] = [0.0, 1e-8, 0.02, 0.1, 0.25, 0.5, 0.7, 0.85, 1.0];
const N: u32 = 16_384;

/// Demands a furnace within `below` under 1 and 1e-3 above it over all angles and roughnesses.
fn white<'a>(name: &str, below: f32, set: impl Fn(&mut Parameters<'a>, f32)) {
    let (mut least, mut most) = ((9.0_f32, 0.0, 0.0), (0.0_f32, 0.0, 0.0));
    for r in ROUGHNESSES {
        for cos in COSINES {
            let mut p: Parameters<'a> = parameters(cos);
            p.alpha = Vec2::splat(r * r);
            set(&mut p, r);
            let n = if p.boundary.is_some() { 4 * N } else { N };
            let a = furnace(&Bsdf::new(&p), n);
            if a.min_element() < least.0 {
                least = (a.min_element(), cos, r);
            }
            if a.max_element() > most.0 {
                most = (a.max_element(), cos, r);
            }
        }
    }
    println!("{name}: least {least:?} most {most:?}");
    assert!(least.0 > 1.0 - below && most.0 <= 1.0 + 1e-3, "{name}: least {least:?} most {most:?}");
}

#[test]
fn white_conductors_reflect_everything() {
    white("conductor", 0.02, |p, _| p.metallic = 1.0);
}

#[test]
fn white_dielectrics_return_everything() {
    white("dielectric", 0.02, |_, _| ());
}

#[test]
fn half_metals_return_everything() {
    white("half metal", 0.02, |p, _| p.metallic = 0.5);
}

#[test]
fn thin_transmission_loses_nothing() {
    white("thin", 0.02, |p, _| p.transmission = 1.0);
    white("half thin", 0.02, |p, _| p.transmission = 0.5);
}

#[test]
fn diffuse_transmission_loses_nothing() {
    white("diffuse transmission", 0.02, |p, _| p.diffuse_transmission = 0.7);
}

#[test]
fn coats_lose_nothing() {
    white("coat", 0.02, |p, r| {
        p.coat = Some(CoatParameters { factor: 1.0, alpha: 0.0, basis: p.basis });
        p.sheen = None;
        p.alpha = Vec2::splat(r * r);
    });
    white("rough coat", 0.02, |p, r| {
        p.coat = Some(CoatParameters { factor: 0.7, alpha: r * r, basis: p.basis });
        p.alpha = Vec2::splat(0.16);
    });
}

#[test]
fn sheen_loses_little() {
    white("sheen", 0.03, |p, r| {
        p.sheen = Some((Vec3::ONE, r));
        p.alpha = Vec2::splat(0.36);
    });
}

#[test]
fn glass_loses_nothing_from_either_side() {
    for eta in [1.5_f32, 1.0 / 1.5, 1.0, 1.001, 1.0 / 2.4, 1e3] {
        let glass = Glass::new(eta);
        let boundary = Some(Boundary { eta, glass: Some(&glass) });
        white(&format!("glass {eta}"), 0.02, |p, _| {
            p.transmission = 1.0;
            p.f0 = Vec3::splat(super::fresnel::f0_of(eta));
            // The borrow ends with the call: the parameters are used up inside.
            p.boundary = boundary;
        });
    }
}

#[test]
fn anisotropic_conductors_reflect_everything() {
    white("anisotropic", 0.02, |p, r| {
        p.metallic = 1.0;
        p.alpha.x += (1.0 - p.alpha.x) * r;
    });
}

/// Sampled directions against the density, over 12 × 24 cells of equal solid angle and one for absorbed paths. The
/// cells' pole lies along y, away from all peaks.
///
/// `drawn` is sampled, `stated` evaluated: the same, but for planted defects. Returns the p-value.
fn chi_squared(drawn: &Bsdf, stated: &Bsdf, n: u32, seed: u64) -> f64 {
    use rand_pcg::rand_core::Rng;
    use statrs::distribution::{ChiSquared, ContinuousCDF};
    const ROWS: usize = 12;
    const COLUMNS: usize = 24;
    const SUB: usize = 48;
    let cell_of = |w: Vec3A| {
        let u = crate::trace::warp::square_from_sphere(Vec3A::new(w.z, w.x, w.y));
        (((u.y * ROWS as f32) as usize).min(ROWS - 1)) * COLUMNS + ((u.x * COLUMNS as f32) as usize).min(COLUMNS - 1)
    };
    let mut observed = vec![0_u32; ROWS * COLUMNS + 1];
    let mut rng = rand_pcg::Pcg64Mcg::new(u128::from(seed) << 64 | 0xcafe_f00d);
    let mut unit = || crate::numeric::unit_from_bits(rng.next_u32());
    for _ in 0..n {
        let u = Vec2::new(unit(), unit());
        let extra = unit();
        match drawn.sample(u, extra) {
            Some(s) => observed[cell_of(s.wi)] += 1,
            None => observed[ROWS * COLUMNS] += 1,
        }
    }
    let mut expected = vec![0.0_f64; ROWS * COLUMNS + 1];
    let area = f64::from(4.0 * std::f32::consts::PI) / (ROWS * COLUMNS * SUB * SUB) as f64;
    for row in 0..ROWS * SUB {
        for column in 0..COLUMNS * SUB {
            let u = Vec2::new((column as f32 + 0.5) / (COLUMNS * SUB) as f32, (row as f32 + 0.5) / (ROWS * SUB) as f32);
            let w = crate::trace::warp::sphere_from_square(u);
            let w = Vec3A::new(w.y, w.z, w.x);
            let (value, pdf) = stated.eval(w);
            // Directions that carry nothing are drawn but reported as absorbed.
            if value != Vec3::ZERO {
                expected[(row / SUB) * COLUMNS + column / SUB] += f64::from(pdf) * area * f64::from(n);
            }
        }
    }
    let total: f64 = expected.iter().sum();
    assert!(total <= f64::from(n) * 1.003, "the density integrates to {}", total / f64::from(n));
    expected[ROWS * COLUMNS] = (f64::from(n) - total).max(0.0);
    // Cells with fewer than 10 expected are pooled.
    let (mut statistic, mut cells) = (0.0, 0_u32);
    let (mut pooled_o, mut pooled_e) = (0.0, 0.0);
    for (&o, &e) in observed.iter().zip(&expected) {
        if e < 10.0 {
            pooled_o += f64::from(o);
            pooled_e += e;
        } else {
            statistic += (f64::from(o) - e) * (f64::from(o) - e) / e;
            cells += 1;
        }
    }
    // The pool is tested against its own scatter, with one more for what the quadrature may miss.
    statistic += (pooled_o - pooled_e) * (pooled_o - pooled_e) / (pooled_e + 1.0);
    1.0 - ChiSquared::new(f64::from(cells)).unwrap().cdf(statistic)
}

fn every_lobe(cos: f32, roughness: f32) -> Vec<(&'static str, Parameters<'static>)> {
    let base = Parameters { alpha: Vec2::splat(roughness * roughness), ..parameters(cos) };
    let coat = CoatParameters { factor: 1.0, alpha: 0.36, basis: base.basis };
    let tilted = Basis::new(Vec3A::new(0.2, 0.1, 1.0).normalize(), Vec3A::X);
    vec![
        ("dielectric", base),
        ("metal", Parameters { metallic: 1.0, ..base }),
        ("anisotropic", Parameters { metallic: 1.0, alpha: Vec2::new(0.5, roughness * roughness), ..base }),
        ("thin", Parameters { transmission: 1.0, ..base }),
        ("glass", Parameters { transmission: 1.0, boundary: Some(Boundary { eta: 1.5, glass: None }), ..base }),
        ("glass inside", Parameters { transmission: 1.0, boundary: Some(Boundary { eta: 0.7, glass: None }), ..base }),
        ("diffuse transmission", Parameters { diffuse_transmission: 0.6, ..base }),
        ("coat", Parameters { coat: Some(coat), ..base }),
        ("sheen", Parameters { sheen: Some((Vec3::ONE, 0.5)), ..base }),
        ("mapped normal", Parameters { basis: tilted, ..base }),
        ("coat with its own normal", Parameters { coat: Some(CoatParameters { basis: tilted, ..coat }), ..base }),
        (
            "anisotropic glass",
            Parameters {
                transmission: 1.0,
                alpha: Vec2::new(0.6, roughness * roughness),
                boundary: Some(Boundary { eta: 1.5, glass: None }),
                ..base
            },
        ),
        (
            "everything",
            Parameters {
                metallic: 0.3,
                transmission: 0.4,
                diffuse_transmission: 0.3,
                coat: Some(coat),
                sheen: Some((Vec3::splat(0.5), 0.4)),
                ..base
            },
        ),
    ]
}

/// H₀: each lobe's samples follow its density. χ² over up to 289 cells, n = 2¹⁷ independent points (Pcg64Mcg), 13 lobes
/// × 3 views × 2 roughnesses, α = 0.01 over all (1.3e-4 each, Šidák). The planted defect, the same lobe about a normal
/// that leans by a twentieth, must be rejected for every lobe at every view; a density 5 % too wide wherever facets
/// alone are sampled.
#[test]
fn samples_follow_the_density() {
    let level = 1.0 - 0.99_f64.powf(1.0 / 78.0);
    for (view, cos) in [0.95_f32, 0.6, 0.25].into_iter().enumerate() {
        for (step, roughness) in [0.4_f32, 0.8].into_iter().enumerate() {
            for (lobe, (name, p)) in every_lobe(cos, roughness).into_iter().enumerate() {
                let bsdf = Bsdf::new(&p);
                let seed = (view * 100 + step * 50 + lobe) as u64;
                let p_value = chi_squared(&bsdf, &bsdf, 1 << 17, seed);
                assert!(p_value > level, "{name} at {cos}, roughness {roughness}: p = {p_value:e}");
                let basis = Basis::new((p.basis.n + Vec3A::new(0.0, 0.05, 0.0)).normalize(), Vec3A::X);
                let coat = p.coat.map(|c| CoatParameters { basis, ..c });
                let mut planted = vec![Parameters { basis, coat, ..p }];
                if name == "metal" {
                    planted.push(Parameters { alpha: p.alpha * 1.05, ..p });
                }
                for (defect, p) in planted.iter().enumerate() {
                    let p_value = chi_squared(&bsdf, &Bsdf::new(p), 1 << 17, seed);
                    assert!(p_value < level, "{name}: defect {defect} passed at {cos}, {roughness}: p = {p_value}");
                }
            }
        }
    }
}

/// Light given back for scattering between facets depends on the view alone (Turquin 2019), so a conductor is
/// reciprocal after division by it, and everything else is as it stands.
#[test]
fn what_should_be_reciprocal_is() {
    let direction = |u: f32, v: f32| crate::trace::warp::cosine_hemisphere_from_square(Vec2::new(u, v));
    for i in 0..50_u16 {
        let t = f32::from(i) / 50.0;
        let (a, b) = (direction(t, (t * 7.3).fract()), direction((t * 3.1).fract(), (t * 5.7).fract()));
        let both = |p: Parameters<'static>, scale: &dyn Fn(f32) -> f32| {
            let f = |wo: Vec3A, wi: Vec3A| Bsdf::new(&Parameters { wo, ..p }).eval(wi).0.x / wi.z * scale(wo.z);
            (f(a, b), f(b, a))
        };
        let roughness = 0.7_f32;
        let p = Parameters { alpha: Vec2::splat(roughness * roughness), ..parameters(0.5) };
        let mirror = |cos: f32| super::albedo::GgxAlbedo::at(cos, super::albedo::Grain::new(roughness)).mirror;
        let lambert = Parameters { f0: Vec3::ZERO, f90: 0.0, ..p };
        let sheen = Parameters { base: Vec3::ZERO, sheen: Some((Vec3::splat(0.3), 0.6)), ..lambert };
        type Case<'a> = (&'a str, Parameters<'static>, &'a dyn Fn(f32) -> f32);
        let cases: [Case<'_>; 3] = [
            ("conductor", Parameters { metallic: 1.0, ..p }, &mirror),
            ("lambert", lambert, &|_| 1.0),
            ("sheen", sheen, &|_| 1.0),
        ];
        for (name, p, scale) in cases {
            let (ab, ba) = both(p, scale);
            assert!((ab - ba).abs() <= 2e-5 * ab.max(ba), "{name}: {ab} {ba}");
        }
    }
}

/// Nothing breaks at the model's limits: finite, non-negative, no lobe gains.
#[test]
fn limits_stay_finite() {
    let edges = [0.0_f32, 1e-7, 0.25, 0.5, 0.75, crate::numeric::ONE_MINUS];
    for roughness in [0.0_f32, 1e-8, 0.013, 0.0145, 1e-3, 0.5, 1.0] {
        for cos in [1.0_f32, 1.0 - 1e-7, 0.5, 1e-3, 1e-7, 1e-20] {
            let mut cases = every_lobe(cos, roughness);
            for eta in [1.0_f32, 1.0 + 1e-6, 0.999_99, 1e3, 1e-3] {
                let base = Parameters { alpha: Vec2::splat(roughness * roughness), ..parameters(cos) };
                let boundary = Some(Boundary { eta, glass: None });
                cases.push(("glass", Parameters { transmission: 1.0, boundary, ..base }));
            }
            for (name, p) in cases {
                let bsdf = Bsdf::new(&p);
                for u in edges {
                    for v in edges {
                        if let Some(s) = bsdf.sample(Vec2::new(u, v), u) {
                            let t = s.throughput;
                            let fine = t.is_finite() && t.min_element() >= 0.0 && s.pdf_solid_angle.is_finite();
                            assert!(fine && s.wi.is_normalized(), "{name} {roughness} {cos}: {s:?}");
                        }
                        let w = crate::trace::warp::sphere_from_square(Vec2::new(u, v));
                        let (value, pdf) = bsdf.eval(w);
                        assert!(value.is_finite() && value.min_element() >= 0.0 && pdf >= 0.0);
                    }
                }
            }
        }
    }
}

/// What narrow lobes alone reflect, however often they are drawn, and what wide ones reflect make up the whole. The
/// narrow part is some 0.08 here; with eagerness 0.5 half of its draws are left out and the rest counts twice.
#[test]
fn narrow_lobes_and_wide_ones_make_up_the_whole() {
    for coat in [false, true] {
        let mut p = Parameters { alpha: Vec2::splat(0.04), ..parameters(0.7) };
        if coat {
            p.coat = Some(CoatParameters { factor: 1.0, alpha: 0.01, basis: p.basis });
            p.alpha = Vec2::splat(0.5);
        }
        let bsdf = Bsdf::new(&p);
        let wide: f64 = (0..N)
            .map(|i| {
                let u = Vec2::new((i as f32 + 0.5) / N as f32, (f64::from(i) * 0.618_033_988_749_894_9).fract() as f32);
                let w = crate::trace::warp::uniform_hemisphere_from_square(u);
                let e = bsdf.evaluate(w);
                assert!(e.wide.min_element() >= 0.0 && e.narrow.min_element() >= 0.0);
                f64::from(e.wide.x) * std::f64::consts::TAU / f64::from(N)
            })
            .sum();
        let whole = f64::from(furnace(&bsdf, N).x);
        for eagerness in [0.5, 1.0, 8.0, 1e3] {
            let (drawn, times, narrow) = bsdf.narrow_lobes(eagerness).unwrap();
            assert!(drawn <= 1.0 && (eagerness > 8.0 || (times - eagerness).abs() < 1e-5));
            let part: f64 = (0..N)
                .map(|i| {
                    Vec2::new((i as f32 + 0.5) / N as f32, (f64::from(i) * 0.618_033_988_749_894_9).fract() as f32)
                })
                .filter(|u| u.x < drawn)
                .filter_map(|u| narrow.sample(u, 0.5))
                .map(|s| f64::from(s.throughput.x) / f64::from(N))
                .sum();
            assert!(part > 0.03 && (wide + part - whole).abs() < 4e-3, "{coat} {eagerness}: {wide} {part} {whole}");
        }
    }
    assert!(Bsdf::new(&parameters(0.7)).narrow_lobes(1.0).is_none(), "a width of a quarter is wide");
}
