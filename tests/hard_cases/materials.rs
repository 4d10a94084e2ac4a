//! Materials at their limits: roughness 0, 1e-8 and 1, index 1 and 1000, grazing views to 1 − 1e-7, total internal
//! reflection, black and white, textures of one texel and of 16 384 × 1. What could blow up are the tangents of grazing
//! angles, the density of narrow lobes and ratios of vanishing cosines.

use glam::{Affine2, Vec2, Vec3, Vec3A, Vec4};
use graeco::scene::material::{Anisotropy, Clearcoat, Iridescence, Sheen, Specular, Transmission, Volume};
use graeco::scene::texture::{MAX_UV_SETS, TexelFilter};
use graeco::scene::{AlphaMode, Image, Material, Pixels, Scene, Texture, TextureRef, Wrap};
use graeco::trace::bsdf::{Materials, Scatter, Shading, ShadingQuery};
use graeco::trace::surface::SurfacePoint;
use graeco::trace::texture::TextureFilter;

fn point(material: usize) -> SurfacePoint {
    SurfacePoint {
        position: Vec3A::ZERO,
        error: Vec3A::ZERO,
        geometric_normal: Vec3A::Z,
        normal: Vec3A::new(0.1, 0.0, 1.0).normalize(),
        tangent: Vec4::new(1.0, 0.0, 0.0, 1.0),
        uvs: [Vec2::new(0.3, 0.6); MAX_UV_SETS],
        color: Vec4::ONE,
        material,
        mesh: 0,
        instance: 0,
        triangle: 0,
        triangle_area: 1.0,
        uv_gradients: Some([Vec3A::X, Vec3A::Y]),
    }
}

fn view(cos: f32) -> Vec3A {
    Vec3A::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos).normalize()
}

fn glass(ior: f32) -> Material {
    let volume =
        Some(Volume { thickness: 1.0, attenuation_distance: 1e-3, attenuation_color: Vec3::new(0.0, 0.5, 1.0) });
    let transmission = Some(Transmission { factor: 1.0, texture: None, volume, dispersion: 0.5 });
    Material { metallic: 0.0, ior, transmission, double_sided: true, ..Material::default() }
}

/// One material for each lobe, and one with all of them.
fn every_material() -> Vec<Material> {
    let plain = Material { metallic: 0.0, double_sided: true, ..Material::default() };
    let thin = Some(Transmission { factor: 1.0, texture: None, volume: None, dispersion: 0.0 });
    let coat =
        Some(Clearcoat { factor: 1.0, texture: None, roughness: 0.0, roughness_texture: None, normal_texture: None });
    let sheen = Some(Sheen { color: Vec3::ONE, color_texture: None, roughness: 0.0, roughness_texture: None });
    let film = |nm: f32| {
        Some(Iridescence { factor: 1.0, texture: None, ior: 1.3, thickness_nm: (0.0, nm), thickness_texture: None })
    };
    let brushed = Some(Anisotropy { strength: 1.0, rotation: 1.0, texture: None });
    let specular = |factor: f32, color: f32| {
        Some(Specular { factor, texture: None, color: Vec3::splat(color), color_texture: None })
    };
    vec![
        plain.clone(),
        Material { metallic: 1.0, ..plain.clone() },
        Material { base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), ..plain.clone() },
        Material { transmission: thin, ..plain.clone() },
        Material { clearcoat: coat, ..plain.clone() },
        Material { sheen, ..plain.clone() },
        Material { iridescence: film(400.0), ..plain.clone() },
        Material { iridescence: film(0.0), metallic: 1.0, ..plain.clone() },
        Material { anisotropy: brushed, metallic: 1.0, ..plain.clone() },
        Material { specular: specular(0.0, 0.0), ..plain.clone() },
        Material { specular: specular(1.0, 1e6), ..plain.clone() },
        Material { ior: 0.0, ..plain.clone() },
        Material { ior: 1.0, ..plain.clone() },
        Material { ior: 1e3, ..plain.clone() },
        glass(1.0),
        glass(1.5),
        glass(1e3),
        Material { clearcoat: coat, sheen, iridescence: film(300.0), anisotropy: brushed, ..glass(1.3) },
        Material { unlit: true, ..plain },
    ]
}

/// Every lobe at every limit: throughput finite, non-negative, and at most what a furnace allows on average; densities
/// finite; directions unit vectors on the side that they claim.
#[test]
fn every_lobe_stays_finite_at_its_limits() {
    let edges = [0.0_f32, 1e-7, 0.3, 0.5, 0.8, 1.0 - f32::EPSILON / 2.0];
    let mut scene = Scene::default();
    for roughness in [0.0_f32, 1e-8, 1e-3, 0.0138, 0.2, 1.0] {
        scene.materials.extend(every_material().into_iter().map(|m| Material { roughness, ..m }));
    }
    let materials = Materials::new(&scene, TextureFilter::Stochastic);
    for material in 0..scene.materials.len() {
        for cos in [1.0_f32, 1.0 - 1e-7, 0.7, 0.3, 1e-3, 1e-7, 0.0, -1e-7, -0.2, -0.8, -1.0] {
            let wo = view(cos);
            let surface = point(material);
            let query =
                ShadingQuery { cone_width: 0.01, u_texture: 0.5, wavelength_nm: Some(450.0), ..Default::default() };
            let shading = Shading::new(&scene, &materials, &surface, wo, query);
            let ng = shading.bsdf.geometric_normal();
            for u in edges {
                for v in edges {
                    if let Some(s) = shading.bsdf.sample(Vec2::new(u, v), u) {
                        let name = || format!("{material} at {cos}: {s:?}");
                        assert!(s.throughput.is_finite() && s.throughput.min_element() >= 0.0, "{}", name());
                        assert!(s.pdf_solid_angle.is_finite() && s.wi.is_normalized(), "{}", name());
                        assert_eq!(s.wi.dot(ng) <= 0.0, s.transmitted, "{}", name());
                        assert!((s.scatter == Scatter::Specular) == (s.pdf_solid_angle <= 0.0), "{}", name());
                    }
                    let (value, pdf) = shading.bsdf.eval(view(2.0 * u - 1.0));
                    assert!(value.is_finite() && pdf.is_finite() && value.min_element() >= 0.0 && pdf >= 0.0);
                }
            }
            for distance in [0.0_f32, 1e-30, 1.0, 1e30, f32::INFINITY] {
                let kept = shading.medium.map_or(Vec3::ONE, |m| m.transmittance(distance));
                assert!(kept.min_element() >= 0.0 && kept.max_element() <= 1.0, "{kept}");
            }
        }
    }
}

/// G₂ / G₁, by which every reflected sample is weighed, at a view so grazing that both vanish: as a quotient it has no
/// value; in the tracer's form, cosᵢ (cosₒ + sₒ) / (cosᵢ sₒ + cosₒ sᵢ), it has.
#[test]
fn masking_as_a_quotient_breaks_where_ours_does_not() {
    let stretched = |cos: f32, alpha: f32| (cos * cos + alpha * alpha * (1.0 - cos * cos)).sqrt();
    let naive = |co: f32, ci: f32, alpha: f32| {
        let lambda = |cos: f32| {
            let tan2 = (1.0 - cos * cos) / (cos * cos);
            0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
        };
        (1.0 / (1.0 + lambda(co) + lambda(ci))) / (1.0 / (1.0 + lambda(co)))
    };
    let ours = |co: f32, ci: f32, alpha: f32| {
        let (so, si) = (stretched(co, alpha), stretched(ci, alpha));
        ci * (co + so) / (ci * so + co * si)
    };
    let check = |g: f32| g.is_finite() && (0.0..=1.0).contains(&g);
    assert!(!check(naive(1e-30, 0.5, 0.5)), "the naive quotient should have failed");
    for alpha in [2e-4_f32, 0.5, 1.0] {
        assert!(check(ours(1e-30, 0.5, alpha)) && check(ours(1e-30, 1e-30, alpha)) && check(ours(0.5, 1e-30, alpha)));
    }
}

/// From inside glass beyond the critical angle, everything is reflected and nothing is lost. Twin: Schlick's
/// approximation, which lets most of it out.
#[test]
fn total_internal_reflection_is_total() {
    let mut scene = Scene::default();
    scene.materials.push(Material { roughness: 0.0, ..glass(1.5) });
    let materials = Materials::new(&scene, TextureFilter::Point);
    let surface = SurfacePoint { normal: Vec3A::Z, ..point(0) };
    // Critical: cos = √(1 − 1/1.5²) = 0.745.
    for cos in [0.74_f32, 0.5, 0.1, 1e-3] {
        let shading = Shading::new(&scene, &materials, &surface, view(-cos), ShadingQuery::default());
        assert!(shading.bsdf.is_specular_only());
        for extra in [0.0_f32, 0.5, 0.999] {
            let s = shading.bsdf.sample(Vec2::splat(0.5), extra).unwrap();
            assert!(!s.transmitted && (s.throughput - Vec3::ONE).abs().max_element() < 1e-5, "{cos}: {s:?}");
        }
    }
    let shading = Shading::new(&scene, &materials, &surface, view(-0.76), ShadingQuery::default());
    assert!(shading.bsdf.sample(Vec2::splat(0.5), 0.9999).unwrap().refracted);
    let schlick = |cos: f32| 0.04 + 0.96 * (1.0 - cos).powi(5);
    assert!(schlick(0.5) < 1.0 - 1e-5, "the twin went unnoticed");
}

/// The density of a lobe of roughness 10⁻⁸ (α = 10⁻¹⁶) across its whole width: GGX's formula in `f32` is 0 ÷ 0 there.
/// Ours takes lobes so narrow for mirrors, whose throughput is that of the Fresnel term alone.
#[test]
fn lobes_too_narrow_for_a_density_are_mirrors() {
    let mut scene = Scene::default();
    for roughness in [0.0_f32, 1e-8, 1e-3] {
        scene.materials.push(Material { roughness, ..Material::default() });
    }
    let materials = Materials::new(&scene, TextureFilter::Point);
    let mut mirrored = Vec::new();
    for material in 0..3 {
        for cos in [1.0_f32, 1.0 - 1e-7, 0.5, 1e-3] {
            let surface = SurfacePoint { normal: Vec3A::Z, ..point(material) };
            let shading = Shading::new(&scene, &materials, &surface, view(cos), ShadingQuery::default());
            let s = shading.bsdf.sample(Vec2::splat(0.4), 0.5).unwrap();
            assert!(s.scatter == Scatter::Specular && (s.throughput - 1.0).abs().max_element() < 1e-5, "{s:?}");
            assert!((s.wi - Vec3A::new(-view(cos).x, 0.0, view(cos).z)).length() < 1e-6, "{s:?}");
            mirrored.push(s.wi);
        }
    }
    let ggx = |cos: f32, alpha: f32| {
        let d = cos * cos * (alpha * alpha - 1.0) + 1.0;
        alpha * alpha / (std::f32::consts::PI * d * d)
    };
    assert!(!ggx(1.0, 1e-16).is_finite() || ggx(1.0, 1e-16) <= 0.0, "the twin went unnoticed");
}

/// A black surface returns exactly nothing, a white one never more than it got and, where it only scatters, all of it.
/// Twin: diffuse light beside the specular as if that took none away.
#[test]
fn black_and_white_furnaces_hold_at_the_limits() {
    let mut scene = Scene::default();
    let plain = Material { metallic: 0.0, double_sided: true, ..Material::default() };
    let dull = Some(Specular { factor: 0.0, texture: None, color: Vec3::ZERO, color_texture: None });
    scene.materials.push(Material { base_color: Vec4::new(0.0, 0.0, 0.0, 1.0), specular: dull, ..plain.clone() });
    for roughness in [0.0_f32, 1e-8, 0.1, 1.0] {
        for metallic in [0.0, 1.0] {
            scene.materials.push(Material { roughness, metallic, ..plain.clone() });
        }
    }
    let materials = Materials::new(&scene, TextureFilter::Point);
    let (mut least, mut most, mut twin) = (f64::INFINITY, 0.0_f64, 0.0_f64);
    for material in 0..scene.materials.len() {
        for cos in [1.0_f32, 0.5, 0.05, 1e-3, 1e-6] {
            let surface = SurfacePoint { normal: Vec3A::Z, ..point(material) };
            let shading = Shading::new(&scene, &materials, &surface, view(cos), ShadingQuery::default());
            let mut sum = 0.0;
            const GRID: u16 = 64;
            for i in 0..GRID {
                for j in 0..GRID {
                    let u = (Vec2::new(f32::from(i), f32::from(j)) + 0.5) / f32::from(GRID);
                    // The choice of a lobe runs through its own stratum in every row and column.
                    let choice = (f32::from((i * 37 + j * 11) % GRID) + 0.5) / f32::from(GRID);
                    sum += shading.bsdf.sample(u, choice).map_or(0.0, |s| f64::from(s.throughput.x));
                }
            }
            let albedo = sum / (f64::from(GRID) * f64::from(GRID));
            if material == 0 {
                assert!(albedo <= 0.0, "black returns {albedo}");
            } else {
                (least, most) = (least.min(albedo), most.max(albedo));
                assert!((0.95..1.01).contains(&albedo), "{material} at {cos}: {albedo}");
                // Fresnel's term of index 1.5 at this angle, beside a whole diffuse albedo.
                twin = twin.max(1.0 + 0.04 + 0.96 * f64::from(1.0 - cos).powi(5));
            }
        }
    }
    println!("white furnaces: {least:.4} to {most:.4}");
    assert!(twin > 1.01, "the twin went unnoticed");
}

/// Glass of index 1 is not there.
#[test]
fn glass_of_index_one_passes_light_straight_on() {
    let mut scene = Scene::default();
    scene.materials.push(Material { roughness: 0.0, ..glass(1.0) });
    let materials = Materials::new(&scene, TextureFilter::Point);
    let surface = SurfacePoint { normal: Vec3A::Z, ..point(0) };
    for cos in [1.0_f32, 0.5, 1e-2, -0.3] {
        let wo = view(cos);
        let shading = Shading::new(&scene, &materials, &surface, wo, ShadingQuery::default());
        let s = shading.bsdf.sample(Vec2::splat(0.5), 0.7).unwrap();
        assert!(s.refracted && (s.wi + wo).length() < 1e-6 && (s.throughput - 1.0).abs().max_element() < 1e-5, "{s:?}");
    }
}

/// Twin: a coordinate wrapped by `fract`, which rounds up to 1 and so reads past the last texel.
#[test]
fn textures_of_one_texel_and_of_a_strip_are_read_everywhere() {
    for (width, height) in [(1_u32, 1_u32), (16_384, 1), (1, 16_384)] {
        let count = width as usize * height as usize;
        let mut scene = Scene::default();
        scene.images.push(Image {
            name: String::new(),
            width,
            height,
            pixels: Pixels::Rgba8(vec![[188, 128, 255, 255]; count]),
        });
        let filter = TexelFilter::Linear;
        scene.textures.push(Texture {
            image: 0,
            wrap: [Wrap::Repeat; 2],
            magnify: filter,
            minify: filter,
            mipmapped: true,
        });
        let texture = Some(TextureRef { texture: 0, uv_set: 0, transform: Affine2::from_scale(Vec2::new(1e6, -3.0)) });
        scene.materials.push(Material {
            base_color_texture: texture,
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..Material::default()
        });
        for filter in [TextureFilter::Point, TextureFilter::Mip, TextureFilter::Stochastic] {
            let materials = Materials::new(&scene, filter);
            for cone_width in [0.0_f32, 1e-9, 1.0, 1e9, f32::MAX] {
                let query = ShadingQuery { cone_width, u_texture: 0.9, wavelength_nm: None, ..Default::default() };
                let shading = Shading::new(&scene, &materials, &point(0), Vec3A::Z, query);
                // sRGB 188 is 0.502886; levels round to 16 bits.
                let red = shading.unlit.unwrap().x;
                assert!((red - 0.502_886).abs() < 2e-5 && shading.opacity >= 1.0, "{width} {cone_width}: {red}");
            }
        }
    }
    let wrapped = -1e-9_f32 - (-1e-9_f32).floor();
    assert!(wrapped >= 1.0, "the twin went unnoticed");
}
