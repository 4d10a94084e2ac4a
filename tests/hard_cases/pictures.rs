//! Case 12. Pictures of odd shapes and values. What blows up: a picture of one pixel or one column, an odd number of lines for
//! fields, a crop of nothing, denormal numbers and negative zero on their way through a file. Twins: sides that are added
//! up in 32 bits, halves of an odd number, a file of half floats.

use super::shots::{load, picture_of, render, settings};
use graeco::film::{Film, Window};
use graeco::output::{ExrDepth, exr, file, read};
use graeco::render::{Progress, Scanning, Settings, Shot, Surroundings};
use graeco::time::Parity;
use graeco::trace::environment::Background;

#[test]
fn one_pixel_and_one_column_render() {
    let scene = load("scenes/cornell.glb");
    for size in [(1, 1), (1, 65_536), (65_536, 1)] {
        let film = render(&scene, &settings(size, 1, 0), Background::Black, 0);
        assert_eq!(film.pixels().len(), (size.0 * size.1) as usize);
        assert!(film.pixels().iter().all(|p| p.rejected == 0 && p.radiance.is_finite()));
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let scene = load("scenes/cornell.glb");
    let surroundings = Surroundings { background: Background::Black, name: String::new() };
    let refused = |settings: &Settings| Shot::new(&scene, settings, &surroundings, "").is_err();
    let odd = Settings { scanning: Scanning::Interlaced { first: Parity::Top }, ..settings((8, 7), 1, 0) };
    assert!(refused(&odd), "an odd number of lines has no two equal fields");
    for crop in [[0, 0, 0, 1], [0, 0, 1, 0], [7, 0, 2, 1], [0, 8, 1, 1], [u32::MAX, 0, 2, 1]] {
        assert!(refused(&Settings { crop: Some(crop), ..settings((8, 8), 1, 0) }), "{crop:?}");
    }
    assert!(Film::new(0, 5, None).is_err());
    assert!(Film::new(5, 5, Some(Window { x: 4, y: 0, width: 2, height: 1 })).is_err());
    let within = |x: u32, width: u32, whole: u32| x.wrapping_add(width) <= whole;
    assert!(within(u32::MAX, 2, 8), "the twin went unnoticed");
    assert_ne!(7_u32 / 2 * 2, 7, "the twin went unnoticed: two fields of three lines are not seven");
}

#[test]
fn denormals_and_negative_zero_come_back() {
    let scene = load("scenes/cornell.glb");
    let mut picture = picture_of(&scene, &settings((4, 1), 1, 0), 0);
    picture.rgb =
        vec![[-0.0, 0.0, f32::from_bits(1)], [f32::MIN_POSITIVE, 1e-41, -1e-42], [1e30, -1e30, 65504.0], [0.1; 3]];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("odd.exr");
    file::write_whole(&path, &exr::encode(&picture, ExrDepth::Float, &path).unwrap()).unwrap();
    let back = read::read(&path).unwrap().rgb;
    let bits = |rgb: &[[f32; 3]]| rgb.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&back), bits(&picture.rgb));
    // The twin goes through half floats.
    let path = folder.path().join("half.exr");
    file::write_whole(&path, &exr::encode(&picture, ExrDepth::Half, &path).unwrap()).unwrap();
    assert_ne!(bits(&read::read(&path).unwrap().rgb), bits(&picture.rgb), "the twin went unnoticed");
}

#[test]
fn a_cancelled_frame_is_no_frame() {
    let scene = load("scenes/cornell.glb");
    let settings = settings((16, 16), 1, 0);
    let surroundings = Surroundings { background: Background::Black, name: String::new() };
    let mut shot = Shot::new(&scene, &settings, &surroundings, "").unwrap();
    let progress = Progress::default();
    progress.cancel();
    assert!(shot.render(0, &progress).unwrap().is_none());
}
