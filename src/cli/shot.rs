//! From arguments to settings and scene.

use super::shot_args::{Backdrop, ShotArgs};
use glam::Vec3;
use graeco::Result;
use graeco::design::DesignOptions;
use graeco::output::PixelAspect;
use graeco::output::video::{Shape, Standard};
use graeco::render::{Scanning, Settings, Surroundings};
use graeco::scene::gltf::{self, LoadOptions};
use graeco::scene::rig::Playback;
use graeco::scene::view::ViewRequest;
use graeco::scene::{Environment, Image, Pixels, Scene, texture};
use graeco::time::FrameRate;
use graeco::trace::environment::Background;

impl ShotArgs {
    /// Reads the scene.
    pub(crate) fn load(&self) -> Result<Scene> {
        let variant = self.variant.clone();
        gltf::load(&self.scene, &LoadOptions { allow_outside: self.allow_outside, variant, ..LoadOptions::default() })
    }

    /// Takes as many threads as asked.
    pub(crate) fn set_threads(&self) -> Result<()> {
        set_threads(self.threads)
    }

    /// The settings that decide what pictures show.
    pub(crate) fn settings(&self) -> Settings {
        let shape = if self.wide { Shape::Wide } else { Shape::Normal };
        let pixel_aspect =
            self.pixel_aspect.or(self.video.map(|v| v.pixel_aspect(shape))).unwrap_or(PixelAspect::SQUARE);
        let size = self.size.or(self.video.map(Standard::size)).unwrap_or((960, 540));
        let scanning = match (self.interlace.or(self.video.map(Standard::first)), self.scan.as_str()) {
            (Some(first), _) => Scanning::Interlaced { first },
            (None, "rolling") => Scanning::Rolling { readout: self.readout },
            (None, _) => Scanning::Progressive,
        };
        let interlaced = matches!(scanning, Scanning::Interlaced { .. });
        Settings {
            size,
            crop: self.crop,
            pixel_aspect,
            rate: self.fps.or(self.video.map(Standard::rate)).unwrap_or(if self.pulldown {
                FrameRate::NTSC_FILM
            } else {
                FrameRate::CINEMA
            }),
            shutter: self.shutter,
            shutter_phase: self.shutter_phase,
            shutter_curve: self.shutter_curve.to_string(),
            scanning,
            line_height: self.line_height.unwrap_or(if interlaced { 2.0 } else { 1.0 }),
            view: ViewRequest {
                camera: self.camera.clone(),
                f_stop: self.f_stop,
                aperture_radius: self.aperture_radius,
                focus_distance: self.focus_distance,
                focus_on: self.focus_on.clone(),
                motion_error: self.motion_error,
                size,
                pixel_aspect: pixel_aspect.ratio(),
            },
            playback: Playback { animation: self.animation.clone(), looped: self.looped },
            blur_scale: self.blur_scale.clone(),
            sampling: DesignOptions {
                kind: self.design,
                dither: self.dither,
                runs: self.runs,
                seed: self.seed,
                ..DesignOptions::default()
            },
            adaptive: None,
            filter: self.filter,
            texture_filter: self.texture_filter,
            bounces: self.bounces,
            sure_bounces: self.sure_bounces,
            caustics: self.caustics,
            aovs: self.aov.clone(),
        }
    }

    /// What surrounds the scene: the flags' over the file's; a soft sky where there is no light at all.
    #[allow(clippy::cast_possible_truncation, reason = "angles and factors that are f32 in the scene")]
    pub(crate) fn surroundings<'s>(&self, scene: &'s Scene, environment: Option<&'s Environment>) -> Surroundings<'s> {
        let sky = |zenith: [f32; 3], nadir: [f32; 3]| {
            let (zenith, nadir) = (Vec3::from(zenith), Vec3::from(nadir));
            Background::Gradient { zenith, horizon: 0.5 * (zenith + nadir), nadir }
        };
        let background = match (environment, &self.background, &scene.environment) {
            (Some(picture), _, _) | (None, None, Some(picture)) => Background::Picture(picture),
            (None, Some(Backdrop::Constant(c)), _) => Background::Constant(Vec3::from(*c)),
            (None, Some(Backdrop::Gradient(top, bottom)), _) => sky(*top, *bottom),
            (None, None, None) if scene.has_light() => Background::Black,
            (None, None, None) => sky([1.0; 3], [0.35; 3]),
        };
        // What the picture shows counts, not where it lies: machines keep it in different places.
        let picture = environment.map_or_else(String::new, |e| hash_of(&e.image));
        let name = format!(
            "{picture} {:?} {} {} {:?}",
            self.background, self.environment_rotation, self.environment_strength, self.variant
        );
        Surroundings { background, name }
    }

    /// The picture that `--environment` names.
    #[allow(clippy::cast_possible_truncation, reason = "angles and factors that are f32 in the scene")]
    pub(crate) fn environment(&self) -> Result<Option<Environment>> {
        let Some(path) = &self.environment else { return Ok(None) };
        Ok(Some(Environment {
            image: texture::load_environment(path)?,
            rotation: self.environment_rotation.to_radians() as f32,
            strength: self.environment_strength as f32,
        }))
    }
}

/// Takes as many threads as asked.
pub(crate) fn set_threads(threads: Option<u16>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(threads))
        .build_global()
        .map_err(|e| graeco::Error::invalid(format!("--threads {threads}"), e.to_string()))
}

/// Hex BLAKE3 of what an environment shows.
fn hash_of(image: &Image) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&image.width.to_le_bytes());
    if let Pixels::RgbF32(pixels) = &image.pixels {
        hasher.update(bytemuck::cast_slice(pixels));
    }
    hasher.finalize().to_hex().to_string()
}
