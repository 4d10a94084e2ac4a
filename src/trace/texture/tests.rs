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
    Textures::new(scene, filter).fetch(scene, &reference(), ColorSpace::Srgb, &[uv], Footprint { width, u }).x
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
            let footprint = Footprint { width, u: (i as f32 + 0.5) / n as f32 };
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
        for filter in [TextureFilter::Point, TextureFilter::Mip, TextureFilter::Stochastic] {
            let value = red(&scene, filter, Vec2::new(0.77, 0.5), width, 0.4);
            assert!((0.0..=1.0).contains(&value));
        }
    }
}
