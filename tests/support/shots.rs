//! Small renders for tests.
#![allow(dead_code, reason = "each test binary uses its own part")]
#![allow(clippy::unwrap_used, reason = "a test that cannot begin has failed")]

use graeco::design::DesignOptions;
use graeco::film::{Film, FilterSpec};
use graeco::output::{FieldFiles, Picture, PixelAspect};
use graeco::render::{Progress, Scanning, Settings, Shot, Surroundings};
use graeco::scene::Scene;
use graeco::scene::gltf::{self, LoadOptions};
use graeco::scene::rig::Playback;
use graeco::scene::view::ViewRequest;
use graeco::time::{FrameRate, ShutterPhase};
use graeco::trace::environment::Background;
use graeco::trace::path::Caustics;
use graeco::trace::texture::TextureFilter;
use std::path::Path;

/// Plain settings: half a period of exposure at 24 frames a second, the automatic design with seed 7.
pub(crate) fn settings(size: (u32, u32), runs: u32, bounces: u16) -> Settings {
    Settings {
        size,
        crop: None,
        pixel_aspect: PixelAspect::SQUARE,
        rate: FrameRate::CINEMA,
        shutter: Some(0.5),
        shutter_phase: ShutterPhase::Start,
        shutter_curve: "box".into(),
        scanning: Scanning::Progressive,
        line_height: 1.0,
        view: ViewRequest { motion_error: 0.0625, size, pixel_aspect: 1.0, ..ViewRequest::default() },
        playback: Playback::default(),
        blur_scale: Vec::new(),
        sampling: DesignOptions { runs, seed: 7, ..DesignOptions::default() },
        adaptive: None,
        filter: FilterSpec::BOX,
        texture_filter: TextureFilter::default(),
        bounces,
        sure_bounces: 1,
        caustics: Caustics::Blurred,
        aovs: Vec::new(),
    }
}

/// A file of the project, by its path from the root.
pub(crate) fn load(name: &str) -> Scene {
    gltf::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(name), &LoadOptions::default()).unwrap()
}

pub(crate) fn render(scene: &Scene, settings: &Settings, background: Background<'_>, frame: i64) -> Film {
    let surroundings = Surroundings { background, name: String::new() };
    let mut shot = Shot::new(scene, settings, &surroundings, "").unwrap();
    shot.render(frame, &Progress::default()).unwrap().unwrap().film
}

/// The picture with its variance planes, under the file's own light.
pub(crate) fn picture_of(scene: &Scene, settings: &Settings, frame: i64) -> Picture {
    let background = scene.environment.as_ref().map_or(Background::Black, Background::Picture);
    let surroundings = Surroundings { background, name: String::new() };
    let mut shot = Shot::new(scene, settings, &surroundings, "").unwrap();
    let rendered = shot.render(frame, &Progress::default()).unwrap().unwrap();
    let picture = shot.pictures(frame, &rendered, FieldFiles::Woven).unwrap().remove(0);
    picture.with_variance(&rendered.film)
}

/// No light from all around.
pub(crate) fn dark() -> Surroundings<'static> {
    Surroundings { background: Background::Black, name: String::new() }
}
