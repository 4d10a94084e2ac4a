#![allow(clippy::cast_possible_truncation, reason = "values in [0, 1]")]

use super::*;
use glam::Affine2;

fn scene_with(image: Image, wrap: Wrap, filter: TexelFilter) -> Scene {
    let mut scene = Scene::default();
    scene.images.push(image);
    scene.textures.push(Texture { image: 0, wrap: [wrap; 2], magnify: filter, minify: filter, mipmapped: true });
    scene.materials.push(Material { base_color_texture: Some(reference()), ..Material::default() });
    scene
}

fn reference() -> TextureRef {
    TextureRef { texture: 0, uv_set: 0, transform: Affine2::IDENTITY }
}

fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Image {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| [value(x, y), 0, 0, 255]);
    Image { name: String::new(), width, height, pixels: Pixels::Rgba8(pixels.collect()) }
}

fn red(scene: &Scene, filter: TextureFilter, uv: Vec2, width: f32, u: f32) -> f32 {
    Textures::new(scene, filter).fetch(scene, &reference(), ColorSpace::Srgb, &[uv], Footprint::round(width, u)).x
}

#[test]
fn the_middle_of_a_texel_is_its_decoded_value() {
    let scene = scene_with(grey(4, 1, |x, _| u8::try_from(x * 60).unwrap()), Wrap::Repeat, TexelFilter::Linear);
    for x in 0..4_u32 {
        let expected = pyramid::linear_from_srgb(f64::from(x * 60) / 255.0) as f32;
        let got = red(&scene, TextureFilter::Point, Vec2::new((x as f32 + 0.5) / 4.0, 0.5), 0.0, 0.0);
        assert!((got - expected).abs() < 1e-6, "{got} {expected}");
    }
}

#[test]
fn wrap_modes_continue_as_the_specification_says() {
    let image = || grey(4, 1, |x, _| u8::try_from(x * 80).unwrap());
    let at = |wrap, u: f32| {
        red(&scene_with(image(), wrap, TexelFilter::Nearest), TextureFilter::Point, Vec2::new(u, 0.5), 0.0, 0.0)
    };
    let inside = |x: f32| at(Wrap::Clamp, (x + 0.5) / 4.0);
    assert_eq!(at(Wrap::Clamp, 7.3).to_bits(), inside(3.0).to_bits());
    assert_eq!(at(Wrap::Clamp, -7.3).to_bits(), inside(0.0).to_bits());
    assert_eq!(at(Wrap::Repeat, 1.125).to_bits(), inside(0.0).to_bits());
    assert_eq!(at(Wrap::Repeat, -0.125).to_bits(), inside(3.0).to_bits());
    assert_eq!(at(Wrap::Mirror, 1.125).to_bits(), inside(3.0).to_bits());
    assert_eq!(at(Wrap::Mirror, -0.375).to_bits(), inside(1.0).to_bits());
    for hostile in [1e30, -1e30, f32::MAX, f32::INFINITY, f32::NAN, -0.0, 1.0, 0.999_999_94] {
        for wrap in [Wrap::Clamp, Wrap::Repeat, Wrap::Mirror] {
            assert!(at(wrap, hostile).is_finite());
            assert!(
                red(
                    &scene_with(image(), wrap, TexelFilter::Linear),
                    TextureFilter::Point,
                    Vec2::splat(hostile),
                    0.0,
                    0.0
                )
                .is_finite()
            );
        }
    }
}

#[test]
fn every_level_keeps_the_mean_of_any_size() {
    for (w, h) in [(1, 1), (2, 2), (7, 5), (33, 1), (1, 9), (16, 3)] {
        let image = grey(w, h, |x, y| u8::try_from((x * 37 + y * 91) % 256).unwrap());
        let expected = mean(&image, ColorSpace::Srgb).x;
        let scene = scene_with(image, Wrap::Clamp, TexelFilter::Linear);
        // A footprint as wide as the image reads the single texel of the top level.
        let got = red(&scene, TextureFilter::Mip, Vec2::splat(0.5), 1e6, 0.0);
        // Levels round to 16 bits: half a step each, at most 6 levels.
        assert!((got - expected).abs() < 6.0 * 0.5 / 65_535.0 + 1e-6, "{w}x{h}: {got} {expected}");
    }
}

#[test]
fn one_drawn_texel_has_the_mean_of_all_blended_ones() {
    let scene = scene_with(
        grey(16, 16, |x, y| u8::try_from((x * 97 + y * 61) % 256).unwrap()),
        Wrap::Repeat,
        TexelFilter::Linear,
    );
    let textures = Textures::new(&scene, TextureFilter::Stochastic);
    for (uv, width) in [(Vec2::new(0.33, 0.71), 0.0), (Vec2::new(0.33, 0.71), 0.17), (Vec2::new(0.02, 0.97), 0.3)] {
        let blended = red(&scene, TextureFilter::Mip, uv, width, 0.0);
        let n = 1 << 14;
        let draw = |i: i32| {
            let footprint = Footprint::round(width, (i as f32 + 0.5) / n as f32);
            textures.fetch(&scene, &reference(), ColorSpace::Srgb, &[uv], footprint).x
        };
        let drawn = (0..n).map(draw).sum::<f32>() / n as f32;
        // A midpoint rule over at most 8 steps: each step's edge is off by at most one point in n.
        assert!((blended - drawn).abs() < 8.0 / n as f32 + 1e-4, "{blended} {drawn}");
    }
}

#[test]
fn a_strip_of_16384_by_1_filters_without_overflow() {
    let scene = scene_with(grey(16_384, 1, |x, _| u8::try_from(x % 256).unwrap()), Wrap::Repeat, TexelFilter::Linear);
    for width in [0.0, 1e-6, 1e-3, 1.0, 1e30, f32::MAX] {
        for filter in [
            TextureFilter::Point,
            TextureFilter::Mip,
            TextureFilter::Stochastic,
            TextureFilter::StochasticEwa,
            TextureFilter::Ewa,
        ] {
            let value = red(&scene, filter, Vec2::new(0.77, 0.5), width, 0.4);
            assert!((0.0..=1.0).contains(&value));
        }
    }
}

/// Codes and their linear values from IEC 61966-2-1, computed by hand: 10/255/12.92 below the knee, and above it
/// ((c/255 + 0.055)/1.055)^2.4.
#[test]
fn colour_is_decoded_and_data_is_not() {
    for (code, srgb) in [(0, 0.0), (10, 0.003_035_27), (128, 0.215_860_5), (188, 0.502_886_5), (255, 1.0)] {
        let scene = scene_with(grey(1, 1, |_, _| code), Wrap::Repeat, TexelFilter::Linear);
        let textures = Textures::new(&scene, TextureFilter::Point);
        let fetch = |space| textures.fetch(&scene, &reference(), space, &[Vec2::ZERO], Footprint::point(0.0)).x;
        assert!((fetch(ColorSpace::Srgb) - srgb).abs() < 1e-6, "{code}");
        assert!((fetch(ColorSpace::Linear) - f32::from(code) / 255.0).abs() < 1e-6, "{code}");
    }
}

/// Stripes along v, 1 texel wide: an ellipse that is long across them sees their mean, one along them sees the stripe.
#[test]
fn filters_along_the_ellipse_average_along_it_only() {
    let stripes = grey(64, 64, |x, _| if x % 2 == 0 { 255 } else { 0 });
    let scene = scene_with(stripes, Wrap::Repeat, TexelFilter::Linear);
    let uv = Vec2::new(32.5 / 64.0, 0.5);
    let (long, short) = ((16.0_f32 / 64.0).powi(2), (0.5_f32 / 64.0).powi(2));
    let mean_of = |filter, ellipse: [f32; 3]| {
        let textures = Textures::new(&scene, filter);
        let fetch = |i: u16| {
            let footprint = Footprint::ellipse(ellipse, (f32::from(i) + 0.5) / 1024.0);
            textures.fetch(&scene, &reference(), ColorSpace::Srgb, &[uv], footprint).x
        };
        (0..1024).map(fetch).sum::<f32>() / 1024.0
    };
    for filter in [TextureFilter::Ewa, TextureFilter::StochasticEwa] {
        let across = mean_of(filter, [long, 0.0, short]);
        assert!((across - 0.5).abs() < 0.06, "{filter:?}: {across}");
    }
    // The ellipse along a stripe is a texel wide (16 to 1 is the most), to which the average adds a texel's own width: the
    // neighbours at r² = 1/2 have e⁻¹ of the stripe's weight.
    let along = mean_of(TextureFilter::StochasticEwa, [short, 0.0, long]);
    assert!(along > 0.99, "{along}");
    let along = mean_of(TextureFilter::Ewa, [short, 0.0, long]);
    assert!(along > 0.57, "{along}");
    // A round footprint of the same area cannot tell the two apart.
    let (a, b) = (mean_of(TextureFilter::Mip, [long, 0.0, short]), mean_of(TextureFilter::Mip, [short, 0.0, long]));
    assert!((a - b).abs() < 1e-6 && (a - 0.5).abs() < 0.06, "{a} {b}");
}

#[test]
fn a_constant_texture_is_constant_under_every_filter_and_footprint() {
    for wrap in [Wrap::Clamp, Wrap::Repeat, Wrap::Mirror] {
        let scene = scene_with(grey(9, 5, |_, _| 255), wrap, TexelFilter::Linear);
        for filter in [TextureFilter::Mip, TextureFilter::Stochastic, TextureFilter::StochasticEwa, TextureFilter::Ewa]
        {
            for ellipse in [[0.0; 3], [0.3, 0.1, 0.2], [1e6, 0.0, 1e-6], [f32::NAN; 3], [1e-9, 0.0, 40.0]] {
                let textures = Textures::new(&scene, filter);
                for uv in [Vec2::new(0.2, 0.9), Vec2::new(-7.3, 1e9), Vec2::new(1e30, f32::NAN)] {
                    let footprint = Footprint::ellipse(ellipse, 0.37);
                    let value = textures.fetch(&scene, &reference(), ColorSpace::Srgb, &[uv], footprint).x;
                    assert!((value - 1.0).abs() < 1e-5, "{filter:?} {wrap:?} {ellipse:?} {uv}: {value}");
                }
            }
        }
    }
}

#[test]
fn a_mirrored_texture_goes_on_mirrored_under_a_wide_ellipse() {
    let ramp = || grey(16, 1, |x, _| u8::try_from(x * 16).unwrap());
    let scene = scene_with(ramp(), Wrap::Mirror, TexelFilter::Linear);
    let at = |u: f32| {
        let textures = Textures::new(&scene, TextureFilter::Ewa);
        let footprint = Footprint::ellipse([0.04, 0.0, 1e-4], 0.0);
        textures.fetch(&scene, &reference(), ColorSpace::Linear, &[Vec2::new(u, 0.5)], footprint).x
    };
    for u in [0.03, 0.2, 0.5, 0.97] {
        assert!((at(u) - at(-u)).abs() < 1e-5 && (at(u) - at(2.0 - u)).abs() < 1e-5, "{u}");
    }
}
