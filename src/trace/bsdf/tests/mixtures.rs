//! Materials of many lobes at once: none gains, and what is evaluated is what is sampled.

use super::*;
use crate::numeric::{mix64, unit_from_bits};

/// Independent numbers in [0, 1), where 0 and 1 themselves are common.
struct Draws(u64);

impl Draws {
    fn unit(&mut self) -> f32 {
        self.0 += 1;
        let bits = mix64(self.0);
        match bits & 7 {
            0 => 0.0,
            1 => 1.0,
            _ => unit_from_bits((bits >> 32) as u32),
        }
    }
    fn color(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }
}

/// A material drawn from all that files can ask for; `glass` is its boundary with `eta`, if it has one.
fn drawn<'a>(d: &mut Draws, eta: f32, glass: Option<&'a Glass>) -> Parameters<'a> {
    let cos = COSINES[(d.unit() * 6.99) as usize];
    let azimuth = std::f32::consts::TAU * d.unit();
    let (side, roughness) = ((1.0 - cos * cos).max(0.0).sqrt(), d.unit());
    let alpha = roughness * roughness;
    let specular = d.unit();
    let p = parameters(cos);
    Parameters {
        wo: Vec3A::new(side * azimuth.cos(), side * azimuth.sin(), cos),
        base: d.color(),
        metallic: d.unit(),
        alpha: Vec2::new(alpha + (1.0 - alpha) * d.unit() * d.unit(), alpha),
        f0: d.color() * specular,
        f90: specular,
        metal_f0: d.color(),
        transmission: d.unit(),
        boundary: glass.map(|g| Boundary { eta, glass: Some(g) }),
        diffuse_transmission: d.unit(),
        diffuse_transmission_color: d.color(),
        coat: (d.unit() < 0.5).then(|| CoatParameters { factor: d.unit(), alpha: d.unit().powi(4), basis: p.basis }),
        sheen: (d.unit() < 0.5).then(|| (d.color(), d.unit())),
        ..p
    }
}

/// Whatever lobes lie over one another, with any colour (which is what iridescence makes of a reflectance), no channel
/// returns more than it got: at most 1 + 1e-3, 400 materials without a volume and 200 with.
#[test]
fn no_mixture_of_lobes_gains() {
    let mut worst = (0.0_f32, String::new());
    let glass = [1.5_f32, 1.0 / 1.5].map(|eta| (eta, Glass::new(eta)));
    for i in 0..600_u64 {
        let mut d = Draws(i << 8);
        let chosen = &glass[(i % 2) as usize];
        let p = drawn(&mut d, chosen.0, (i >= 400).then_some(&chosen.1));
        let a = furnace(&Bsdf::new(&p), 4 * N).max_element();
        if a > worst.0 {
            worst = (a, format!("{i}: {p:?}"));
        }
    }
    println!("mixtures: most {}", worst.0);
    assert!(worst.0 <= 1.0 + 1e-3, "{} by {}", worst.0, worst.1);
}

/// Twin of the furnace above: a coat that takes nothing from what lies below it.
#[test]
fn a_layer_that_takes_nothing_away_is_noticed() {
    let p = Parameters { metallic: 1.0, ..parameters(0.3) };
    let coat = Some(CoatParameters { factor: 1.0, alpha: 0.04, basis: p.basis });
    let (bare, black) = (furnace(&Bsdf::new(&p), N), Parameters { metal_f0: Vec3::ZERO, base: Vec3::ZERO, coat, ..p });
    let coat_alone = furnace(&Bsdf::new(&Parameters { metallic: 0.0, f0: Vec3::ZERO, f90: 0.0, ..black }), N);
    assert!((bare + coat_alone).max_element() > 1.01, "the twin went unnoticed: {bare} {coat_alone}");
}

/// ∫ f |cos| dω by quadrature is the mean throughput of samples, for every lobe and what of forty mixtures is seen from above, wherever lobes are
/// wide enough for the quadrature: within 1 % of 1.
#[test]
fn evaluation_integrates_to_what_sampling_returns() {
    const GRID: u32 = 512;
    let integral = |bsdf: &Bsdf| {
        let mut sum = glam::DVec3::ZERO;
        for row in 0..GRID {
            for column in 0..GRID {
                let u = Vec2::new((column as f32 + 0.5) / GRID as f32, (row as f32 + 0.5) / GRID as f32);
                sum += bsdf.eval(crate::trace::warp::sphere_from_square(u)).0.as_dvec3();
            }
        }
        (sum * (4.0 * std::f64::consts::PI / f64::from(GRID * GRID))).as_vec3()
    };
    let mut cases: Vec<(String, Parameters<'_>)> = Vec::new();
    for cos in [0.95_f32, 0.6, 0.25] {
        cases.extend(every_lobe(cos, 0.6).into_iter().map(|(name, p)| (format!("{name} at {cos}"), p)));
    }
    for i in 0..40_u64 {
        let mut p = drawn(&mut Draws(i << 20), 1.5, None);
        // Peaks at grazing views are narrower than the quadrature's cells.
        if p.wo.z < 0.25 {
            continue;
        }
        p.alpha = p.alpha.max(Vec2::splat(0.09));
        p.coat = p.coat.map(|c| CoatParameters { alpha: c.alpha.max(0.09), ..c });
        cases.push((format!("mixture {i}"), p));
    }
    let mut worst = 0.0_f32;
    for (name, p) in cases {
        let bsdf = Bsdf::new(&p);
        let (sampled, evaluated) = (furnace(&bsdf, 4 * N), integral(&bsdf));
        let off = (sampled - evaluated).abs().max_element();
        worst = worst.max(off);
        assert!(off < 0.01, "{name}: {sampled} sampled, {evaluated} evaluated");
    }
    println!("sampled against evaluated: at most {worst} apart");
}

/// Rough bodies whose facets are stretched, seen from all around, from outside and inside: at most 1 + 1e-3 comes back, and
/// no less than nine tenths.
#[test]
fn anisotropic_glass_never_gains() {
    let mut bad = false;
    for eta in [1.5_f32, 1.0 / 1.5, 1.33, 2.4] {
        let glass = Glass::new(eta);
        let (mut least, mut most) = ((9.0_f32, String::new()), (0.0_f32, String::new()));
        for azimuth in 0..5_u8 {
            let turn = f32::from(azimuth) * std::f32::consts::FRAC_PI_8;
            for strength in [0.2_f32, 0.6, 1.0] {
                for r in ROUGHNESSES {
                    for cos in COSINES {
                        let mut p = parameters(cos);
                        let side = (1.0 - cos * cos).max(0.0).sqrt();
                        p.wo = Vec3A::new(side * turn.cos(), side * turn.sin(), cos);
                        p.transmission = 1.0;
                        p.f0 = Vec3::splat(super::super::fresnel::f0_of(eta));
                        let alpha = r * r;
                        p.alpha = Vec2::new(alpha + (1.0 - alpha) * strength * strength, alpha);
                        p.boundary = Some(Boundary { eta, glass: Some(&glass) });
                        let a = furnace(&Bsdf::new(&p), N);
                        let place = format!("cosine {cos}, roughness {r}, strength {strength}, azimuth {turn}");
                        if a.min_element() < least.0 {
                            least = (a.min_element(), place.clone());
                        }
                        if a.max_element() > most.0 {
                            most = (a.max_element(), place);
                        }
                    }
                }
            }
        }
        println!("anisotropic glass {eta}: least {least:?}, most {most:?}");
        bad |= most.0 > 1.0 + 1e-3 || least.0 < 0.9;
    }
    assert!(!bad);
}

/// Conductors seen from all around the stretched facets, not along them alone.
#[test]
fn anisotropic_conductors_reflect_everything_from_all_around() {
    for azimuth in 0..9_u8 {
        let turn = f32::from(azimuth) * std::f32::consts::FRAC_PI_8;
        for strength in [0.3_f32, 1.0] {
            white(&format!("anisotropic conductor at {turn:.2}, strength {strength}"), 0.02, |p, r| {
                let side = (1.0 - p.wo.z * p.wo.z).max(0.0).sqrt();
                p.wo = Vec3A::new(side * turn.cos(), side * turn.sin(), p.wo.z);
                p.metallic = 1.0;
                let alpha = r * r;
                p.alpha = Vec2::new(alpha + (1.0 - alpha) * strength * strength, alpha);
            });
        }
    }
}

/// Metalness from 0 to 1: white dielectrics and metals and all between return everything.
#[test]
fn any_metalness_returns_everything() {
    for metallic in [0.1_f32, 0.25, 0.75, 0.9] {
        white(&format!("metalness {metallic}"), 0.02, |p, _| p.metallic = metallic);
    }
    for f in [0.0_f32, 0.3, 1.0] {
        white(&format!("coat {f} over half a metal"), 0.02, |p, r| {
            p.metallic = 0.5;
            p.coat = Some(CoatParameters { factor: f, alpha: r * r, basis: p.basis });
        });
    }
}
