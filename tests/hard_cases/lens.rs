//! Lenses at their limits. What blows up: a point in focus infinitely far away (∞ − lens is no direction), a lens that
//! touches the plane in focus, a lens around the scene. The camera aims by `direction − lens / focus`, whose terms stay
//! finite for every focus from the least normal number to infinity.

use super::shots::{load, render, settings};
use glam::{Affine3A, DVec2, Vec3A};
use graeco::design::{Design, DesignOptions, Factor, PixelAddress};
use graeco::scene::{Motion, Projection, StageCamera};
use graeco::trace::FilmPoint;
use graeco::trace::camera::CameraRays;
use graeco::trace::environment::Background;

fn camera(projection: Projection, aperture_radius: f32, focus: f32) -> CameraRays {
    let camera = StageCamera {
        motion: Motion::still(Affine3A::IDENTITY),
        projection,
        aperture_radius,
        focus_distance: [focus; 2],
    };
    CameraRays::new(&camera, (64, 48), 1.0)
}

const PERSPECTIVE: Projection = Projection::Perspective { yfov: 0.8, aspect: None };
const PARALLEL: Projection = Projection::Orthographic { xmag: 2.0, ymag: 1.5 };

/// Rays through many film and lens points.
fn rays(camera: &CameraRays) -> Vec<(Vec3A, Vec3A)> {
    let design = Design::new(
        &DesignOptions { runs: 64, seed: 5, ..DesignOptions::default() },
        &[Factor::LENS_U, Factor::LENS_V],
    );
    let mut rays = Vec::new();
    for x in [-20, 0, 31, 64] {
        let pixel = design.pixel(PixelAddress { x, y: x / 2, frame: 0, field: 0 });
        for run in 0..64 {
            let position = DVec2::new(f64::from(x) + 0.3, f64::from(x) * 0.5 + 0.7);
            let ray = camera.ray(FilmPoint { position, u_time: 0.5 }, &pixel.point(run)).ray;
            rays.push((ray.origin, ray.direction));
        }
    }
    rays
}

/// Bound: none. Twin: the general formula at a focus of nearly nothing, lens ÷ focus being 0 ÷ 0.
#[test]
fn a_closed_aperture_is_a_pinhole_bit_for_bit() {
    for projection in [PERSPECTIVE, PARALLEL] {
        for focus in [f32::MIN_POSITIVE, 1.0, f32::INFINITY] {
            assert_eq!(rays(&camera(projection, 0.0, focus)), rays(&camera(projection, 0.0, 1.0)));
        }
    }
    let (lens, focus) = (0.0_f32, 0.0_f32);
    assert!((lens / focus).is_nan(), "the twin went unnoticed");
}

/// The plane in focus may be as near as an object can be: rays from all over the lens meet there in one point, to eight
/// roundings of the greater of lens and focus. Could blow up: the aim at a point so near, or a million times farther
/// than the lens is wide. Twin: the distance taken along the ray, which bends the plane in focus into a sphere.
#[test]
fn rays_through_the_lens_meet_in_the_plane_in_focus() {
    let mut bent = 0;
    for focus in [1e-6_f32, 1e-3, 0.1, 1.0, 1e3, 1e6] {
        for aperture in [1e-6_f32, 1e-2, 1.0] {
            let bundles = rays(&camera(PERSPECTIVE, aperture, focus));
            let slack = 8.0 * f32::EPSILON * (focus + aperture) * 3.0;
            for pixel in bundles.chunks(64) {
                let on = |(origin, way): (Vec3A, Vec3A), t: f32| origin + way * t;
                let plane = |ray: (Vec3A, Vec3A)| on(ray, (-focus - ray.0.z) / ray.1.z);
                let middle = pixel.iter().map(|&ray| plane(ray)).sum::<Vec3A>() / 64.0;
                let worst = pixel.iter().map(|&ray| plane(ray).distance(middle)).fold(0.0, f32::max);
                // A ray from a lens wider than its focus grazes the plane: its rounding is magnified by its slope.
                let slope = pixel.iter().map(|ray| 1.0 / ray.1.z.abs()).fold(1.0, f32::max);
                assert!(worst <= slack * slope * slope, "focus {focus}, aperture {aperture}: {worst} over {slack}");
                let sphere = pixel.iter().map(|&ray| on(ray, focus).distance(middle)).fold(0.0, f32::max);
                bent += usize::from(sphere > slack * slope * slope);
            }
        }
    }
    assert!(bent > 10, "the twin went unnoticed: {bent}");
}

#[test]
fn every_focus_and_aperture_gives_unit_directions() {
    for projection in [PERSPECTIVE, PARALLEL] {
        for focus in [f32::MIN_POSITIVE, 1e-20, 1e-3, 1.0, 1e20, f32::MAX, f32::INFINITY] {
            for aperture in [1e-30_f32, 1e-3, 1.0, 1e6] {
                for (origin, direction) in rays(&camera(projection, aperture, focus)) {
                    // A lens of 10⁶ m focused at 10⁻³⁸ m aims along the lens itself: lens / focus exceeds f32.
                    if aperture / focus < 1e18 {
                        assert!((direction.length() - 1.0).abs() < 1e-5, "{focus} {aperture}: {direction}");
                    }
                    assert!(origin.is_finite(), "{focus} {aperture}");
                    assert!(!direction.is_nan(), "{focus} {aperture}: {direction}");
                }
            }
        }
    }
}

#[test]
fn a_lens_focused_at_infinity_sends_parallel_rays() {
    let rays = rays(&camera(PERSPECTIVE, 0.2, f32::INFINITY));
    for pixel in rays.chunks(64) {
        assert!(pixel.iter().all(|(_, d)| d.distance(pixel[0].1) < 1e-6));
    }
    // The planted twin aims at the point in focus itself: at infinity that is no point.
    let naive = |lens: Vec3A, focus: f32| (Vec3A::new(0.1, 0.2, -1.0) * focus - lens).normalize();
    assert!(!naive(Vec3A::new(0.1, 0.0, 0.0), f32::INFINITY).is_finite());
    assert!((naive(Vec3A::new(0.1, 0.0, 0.0), 1e30).length() - 1.0).abs() > 0.5, "squares overflow long before");
}

#[test]
fn a_lens_larger_than_the_scene_renders_finite_pictures() {
    let scene = load("scenes/lens.glb");
    let mut settings = settings((24, 16), 16, 1);
    settings.view.aperture_radius = Some(1000.0);
    for focus in [1e-6, 1.0, 1e30] {
        settings.view.focus_distance = Some(focus);
        let film = render(&scene, &settings, Background::Black, 0);
        assert!(film.pixels().iter().all(|p| p.rejected == 0 && p.radiance.is_finite()), "{focus}");
    }
}
