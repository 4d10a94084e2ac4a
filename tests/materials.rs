//! What the file says of a surface is what shading does: each texture slot reads its own channel in its own colour
//! space, normals tilt the way that the specification says, sides and alpha mean what they should.

#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "texels from fractions")]
#![allow(clippy::float_cmp, reason = "alpha and emission pass through unchanged")]

use glam::{Affine2, Vec2, Vec3, Vec3A, Vec4};
use graeco::scene::material::{
    Anisotropy, Clearcoat, DiffuseTransmission, Iridescence, Sheen, Specular, Transmission, Volume,
};
use graeco::scene::texture::MAX_UV_SETS;
use graeco::scene::{AlphaMode, Image, Material, Pixels, Scene, Texture, TextureRef, Wrap};
use graeco::trace::bsdf::{Materials, Shading, ShadingQuery, dispersed_ior};
use graeco::trace::surface::SurfacePoint;
use graeco::trace::texture::TextureFilter;
use graeco::trace::warp::sphere_from_square;

fn point() -> SurfacePoint {
    SurfacePoint {
        position: Vec3A::ZERO,
        error: Vec3A::ZERO,
        geometric_normal: Vec3A::Z,
        normal: Vec3A::Z,
        tangent: Vec4::new(1.0, 0.0, 0.0, 1.0),
        uvs: [Vec2::splat(0.5); MAX_UV_SETS],
        color: Vec4::ONE,
        material: 0,
        mesh: 0,
        instance: 0,
        triangle: 0,
        triangle_area: 1.0,
        uv_gradients: Some([Vec3A::X, Vec3A::Y]),
    }
}

/// A scene of one material; `texel` fills its one texture.
fn scene(material: Material, texel: [u8; 4]) -> Scene {
    let mut scene = Scene::default();
    let pixels = Pixels::Rgba8(vec![texel]);
    scene.images.push(Image { name: String::new(), width: 1, height: 1, pixels });
    let filter = graeco::scene::texture::TexelFilter::Nearest;
    let wrap = [Wrap::Repeat; 2];
    scene.textures.push(Texture { image: 0, wrap, magnify: filter, minify: filter, mipmapped: false });
    scene.materials.push(material);
    scene
}

fn texture() -> Option<TextureRef> {
    Some(TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY })
}

fn shaded(scene: &Scene, point: &SurfacePoint, wo: Vec3A) -> Shading {
    let materials = Materials::new(scene, TextureFilter::Mip);
    Shading::new(scene, &materials, point, wo, ShadingQuery::default())
}

fn view() -> Vec3A {
    Vec3A::new(0.5, 0.2, 0.8).normalize()
}

/// Scattering in a few directions on both sides, as one list of numbers.
fn response(scene: &Scene) -> Vec<Vec3> {
    let s = shaded(scene, &point(), view());
    let directions = [(0.1, 0.2), (0.4, 0.3), (0.7, 0.1), (0.9, 0.7), (0.3, 0.9), (0.05, 0.4)];
    let mut list: Vec<Vec3> = directions.map(|(u, v)| s.bsdf.eval(sphere_from_square(Vec2::new(u, v))).0).to_vec();
    list.push(s.emitted);
    list
}

/// Pairs of a textured material and the plain one that it must equal.
fn pairs() -> Vec<(&'static str, [u8; 4], Material, Material)> {
    // sRGB 188 is 0.502886 linear; 51 is 0.2 as it stands.
    let (grey, fifth) = (0.502_886_5_f32, 0.2_f32);
    let base = Material { metallic: 0.0, roughness: 0.6, ..Material::default() };
    let mut list = vec![
        (
            "base colour",
            [188, 255, 0, 255],
            Material { base_color_texture: texture(), ..base.clone() },
            Material { base_color: Vec4::new(grey, 1.0, 0.0, 1.0), ..base.clone() },
        ),
        (
            "metallic and roughness",
            [7, 51, 102, 9],
            Material { metallic: 1.0, roughness: 1.0, metallic_roughness_texture: texture(), ..base.clone() },
            Material { metallic: 0.4, roughness: fifth, ..base.clone() },
        ),
        (
            "emission",
            [188, 0, 255, 9],
            Material { emissive: Vec3::splat(3.0), emissive_texture: texture(), ..base.clone() },
            Material { emissive: Vec3::new(3.0 * grey, 0.0, 3.0), ..base.clone() },
        ),
    ];
    let specular = |factor, texture, color, color_texture| Material {
        specular: Some(Specular { factor, texture, color, color_texture }),
        ..base.clone()
    };
    list.push((
        "specular",
        [1, 2, 3, 51],
        specular(1.0, texture(), Vec3::ONE, None),
        specular(fifth, None, Vec3::ONE, None),
    ));
    let tint = Vec3::new(grey, 0.0, 1.0);
    list.push((
        "specular colour",
        [188, 0, 255, 3],
        specular(1.0, None, Vec3::ONE, texture()),
        specular(1.0, None, tint, None),
    ));
    let clear = |factor, texture| Material {
        transmission: Some(Transmission { factor, texture, volume: None, dispersion: 0.0 }),
        ..base.clone()
    };
    list.push(("transmission", [51, 2, 3, 4], clear(1.0, texture()), clear(fifth, None)));
    let coat = |factor, texture, roughness, roughness_texture| Material {
        clearcoat: Some(Clearcoat { factor, texture, roughness, roughness_texture, normal_texture: None }),
        ..base.clone()
    };
    list.push(("coat", [51, 2, 3, 4], coat(1.0, texture(), 0.5, None), coat(fifth, None, 0.5, None)));
    list.push(("coat roughness", [1, 51, 3, 4], coat(1.0, None, 1.0, texture()), coat(1.0, None, fifth, None)));
    let sheen = |color, color_texture, roughness, roughness_texture| Material {
        sheen: Some(Sheen { color, color_texture, roughness, roughness_texture }),
        ..base.clone()
    };
    list.push(("sheen colour", [188, 0, 255, 4], sheen(Vec3::ONE, texture(), 0.5, None), sheen(tint, None, 0.5, None)));
    list.push((
        "sheen roughness",
        [1, 2, 3, 51],
        sheen(Vec3::ONE, None, 1.0, texture()),
        sheen(Vec3::ONE, None, fifth, None),
    ));
    let film = |factor, texture, thickness_nm, thickness_texture| Material {
        iridescence: Some(Iridescence { factor, texture, ior: 1.4, thickness_nm, thickness_texture }),
        ..base.clone()
    };
    list.push(("film", [51, 2, 3, 4], film(1.0, texture(), (0.0, 400.0), None), film(fifth, None, (0.0, 400.0), None)));
    list.push((
        "film thickness",
        [1, 51, 3, 4],
        film(1.0, None, (200.0, 700.0), texture()),
        film(1.0, None, (0.0, 300.0), None),
    ));
    let through = |factor, texture, color, color_texture| Material {
        diffuse_transmission: Some(DiffuseTransmission { factor, texture, color, color_texture }),
        ..base.clone()
    };
    list.push((
        "diffuse transmission",
        [1, 2, 3, 51],
        through(1.0, texture(), Vec3::ONE, None),
        through(fifth, None, Vec3::ONE, None),
    ));
    list.push((
        "diffuse transmission colour",
        [188, 0, 255, 4],
        through(1.0, None, Vec3::ONE, texture()),
        through(1.0, None, tint, None),
    ));
    let brushed = |strength, rotation, texture| Material {
        metallic: 1.0,
        anisotropy: Some(Anisotropy { strength, rotation, texture }),
        ..base.clone()
    };
    // Red and green 0.5, 1 point along the bitangent: a quarter turn.
    let quarter = std::f32::consts::FRAC_PI_2;
    list.push(("anisotropy", [128, 255, 204, 4], brushed(1.0, 0.3, texture()), brushed(0.8, 0.3 + quarter, None)));
    list
}

#[test]
fn every_texture_is_read_from_its_channel_in_its_space() {
    for (name, texel, textured, plain) in pairs() {
        let (a, b) = (response(&scene(textured.clone(), texel)), response(&scene(plain, texel)));
        // 8-bit texels miss the round values by up to 1/510 of full scale where they are not exact.
        let close = a.iter().zip(&b).all(|(a, b)| (*a - *b).abs().max_element() <= 0.02 * b.max_element().max(0.01));
        assert!(close, "{name}: {a:?} {b:?}");
        let other = response(&scene(textured, [250, 250, 250, 250]));
        let same = a.iter().zip(&other).all(|(a, b)| (*a - *b).abs().max_element() <= 1e-4);
        assert!(!same, "{name}: the texture has no effect");
    }
}

/// Red tilts the normal along the tangent, green along the bitangent (handedness · n × t), with either handedness and
/// on the back alike.
#[test]
fn normal_maps_tilt_as_the_specification_says() {
    let lambert = Some(Specular { factor: 0.0, texture: None, color: Vec3::ONE, color_texture: None });
    for handedness in [1.0_f32, -1.0] {
        for (texel, along) in [([200, 128, 220, 255], Vec3A::X), ([128, 200, 220, 255], Vec3A::Y * handedness)] {
            let material = Material {
                metallic: 0.0,
                specular: lambert,
                double_sided: true,
                normal_texture: Some((texture().unwrap(), 1.0)),
                ..Material::default()
            };
            let scene = scene(material, texel);
            let surface = SurfacePoint { tangent: Vec4::new(1.0, 0.0, 0.0, handedness), ..point() };
            for wo in [Vec3A::Z, Vec3A::NEG_Z] {
                let s = shaded(&scene, &surface, wo);
                let lit = |side: f32| s.bsdf.eval((wo + along * (side * wo.z)).normalize()).0.x;
                assert!(lit(1.0) > 1.3 * lit(-1.0), "{texel:?} {handedness} {wo}: {} {}", lit(1.0), lit(-1.0));
            }
        }
    }
}

/// However wild the normal map, nothing leaks through an opaque surface and no view of its front is black.
#[test]
fn wild_normals_neither_leak_nor_blacken() {
    for step in 0..200_u16 {
        let u = |k: f32| (f32::from(step) * k).fract();
        let texel = [u(0.618), u(0.755), u(0.569) * 0.5].map(|x| (x * 255.0) as u8);
        let material = Material {
            metallic: u(0.33).round(),
            roughness: u(0.77),
            normal_texture: Some((texture().unwrap(), 3.0)),
            ..Material::default()
        };
        let scene = scene(material, [texel[0], texel[1], texel[2], 255]);
        let cos = 0.02 + 0.98 * u(0.41);
        let wo = Vec3A::new((1.0 - cos * cos).sqrt(), 0.0, cos).normalize();
        let s = shaded(&scene, &point(), wo);
        let mut reflected = 0;
        for i in 0..64_u8 {
            let pair = Vec2::new(f32::from(i) / 64.0, (f32::from(i) * 0.618).fract());
            if let Some(sample) = s.bsdf.sample(pair, pair.y) {
                assert!(!sample.transmitted && sample.wi.z > 0.0);
                reflected += 1;
            }
            let down = -sphere_from_square(pair).abs();
            assert!(s.bsdf.eval(down).0 == Vec3::ZERO);
        }
        assert!(reflected > 0, "black from {wo} with {texel:?}");
    }
}

#[test]
fn sides_emission_and_alpha_mean_what_they_say() {
    let emissive = Material { emissive: Vec3::ONE, base_color: Vec4::new(1.0, 1.0, 1.0, 0.4), ..Material::default() };
    let seen = |m: &Material, wo: Vec3A| {
        let s = shaded(&scene(m.clone(), [255; 4]), &point(), wo);
        (s.emitted.x, s.opacity)
    };
    assert_eq!(seen(&emissive, Vec3A::Z), (1.0, 1.0));
    assert_eq!(seen(&emissive, Vec3A::NEG_Z), (0.0, 0.0));
    let double = Material { double_sided: true, ..emissive.clone() };
    assert_eq!(seen(&double, Vec3A::NEG_Z), (1.0, 1.0));
    for (alpha_mode, opacity) in [
        (AlphaMode::Blend, 0.4),
        (AlphaMode::Mask { cutoff: 0.4 }, 1.0),
        (AlphaMode::Mask { cutoff: 0.41 }, 0.0),
        (AlphaMode::Opaque, 1.0),
    ] {
        assert_eq!(seen(&Material { alpha_mode, ..emissive.clone() }, Vec3A::Z).1, opacity);
    }
}

/// Beer and Lambert: at the attenuation distance white light has the attenuation colour.
#[test]
fn media_absorb_as_their_volume_says() {
    let attenuation_color = Vec3::new(0.2, 0.5, 1.0);
    let volume = Some(Volume { thickness: 1.0, attenuation_distance: 0.25, attenuation_color });
    let transmission = Some(Transmission { factor: 1.0, texture: None, volume, dispersion: 0.0 });
    let scene = scene(Material { metallic: 0.0, transmission, ..Material::default() }, [255; 4]);
    let medium = Materials::new(&scene, TextureFilter::Point).medium(0).unwrap();
    assert!((medium.transmittance(0.25) - attenuation_color).abs().max_element() < 1e-6);
    assert!((medium.transmittance(0.5) - attenuation_color * attenuation_color).abs().max_element() < 1e-6);
}

/// Abbe's number by its definition from the three Fraunhofer lines.
#[test]
fn dispersion_has_the_abbe_number_that_it_states() {
    for (ior, abbe) in [(1.5_f32, 55.0_f32), (2.42, 55.3), (1.52, 30.0)] {
        let n = |nm: f32| f64::from(dispersed_ior(ior, 20.0 / abbe, nm));
        let got = (n(587.6) - 1.0) / (n(486.1) - n(656.3));
        assert!((n(587.6) - f64::from(ior)).abs() < 1e-4, "{}", n(587.6));
        assert!((got / f64::from(abbe) - 1.0).abs() < 0.02, "{got} {abbe}");
    }
}
