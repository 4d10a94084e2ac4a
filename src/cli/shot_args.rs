//! Arguments that describe what is rendered: shared by every command that renders or plans.

use clap::{Args, ValueHint};
use graeco::design::{Dither, Kind};
use graeco::film::{FilterSpec, ShutterCurve};
use graeco::output::PixelAspect;
use graeco::output::video::Standard;
use graeco::render::aovs::Aov;
use graeco::time::{FrameRate, Parity, ShutterPhase};
use graeco::trace::path::Caustics;
use graeco::trace::texture::TextureFilter;
use std::path::PathBuf;

pub(crate) const PICTURE: &str = "Picture";
pub(crate) const TIME: &str = "Time and shutter";
pub(crate) const LENS: &str = "Camera and lens";
pub(crate) const SAMPLING: &str = "Sampling";
pub(crate) const LIGHT: &str = "Light";
pub(crate) const VIDEO: &str = "Video";
pub(crate) const OUTPUT: &str = "Output and progress";

/// A scene, and how it is looked at.
#[derive(Debug, Clone, Args)]
pub(crate) struct ShotArgs {
    /// glTF file to render (.gltf or .glb)
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,

    /// Frames per second: 24, 29.97, 30000/1001 [default: 24, or the video standard's]
    #[arg(long, value_name = "RATE", conflicts_with = "video", help_heading = TIME)]
    pub(crate) fps: Option<FrameRate>,

    /// Exposure as an angle (180deg) or a part of the frame's period (0.5); 0 freezes [default: the file's, else 180deg]
    #[arg(long, value_name = "ANGLE|PART", value_parser = parse_shutter, help_heading = TIME)]
    pub(crate) shutter: Option<f64>,

    /// How much each instant of the exposure counts: box, trapezoid:OPENING,CLOSING or polyline:T,W;T,W;...
    #[arg(long, value_name = "CURVE", default_value = "box", help_heading = TIME)]
    pub(crate) shutter_curve: ShutterCurve,

    /// Where the exposure lies: it opens at, is centred on, or ends at the frame's instant
    #[arg(long, value_name = "start|centre|end", default_value = "start", value_parser = parse_phase, help_heading = TIME)]
    pub(crate) shutter_phase: ShutterPhase,

    /// Play only this animation, by name or index [default: all together]
    #[arg(long, value_name = "NAME|INDEX", help_heading = TIME)]
    pub(crate) animation: Option<String>,

    /// Repeat the animation instead of holding its end
    #[arg(long = "loop", help_heading = TIME)]
    pub(crate) looped: bool,

    /// Amount of motion blur for a node and what hangs from it: 0 frozen, 1 real, 2 doubled; may be repeated
    #[arg(long, value_name = "NODE=AMOUNT", value_parser = parse_blur, help_heading = TIME)]
    pub(crate) blur_scale: Vec<(String, f64)>,

    /// Largest deviation from an object's true path, in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0625, value_parser = positive, help_heading = TIME)]
    pub(crate) motion_error: f64,

    /// Width and height of the picture in pixels [default: 960x540, or the video standard's]
    #[arg(long, value_name = "WxH", value_parser = parse_size, conflicts_with = "video", help_heading = PICTURE)]
    pub(crate) size: Option<(u32, u32)>,

    /// Render only this window of the picture: pixels from the left and top, width, height
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_crop, help_heading = PICTURE)]
    pub(crate) crop: Option<[u32; 4]>,

    /// Width of a pixel over its height: 1, 10:11
    #[arg(long, value_name = "RATIO", conflicts_with = "video", help_heading = PICTURE)]
    pub(crate) pixel_aspect: Option<PixelAspect>,

    /// An interlaced standard: size, rate, field order and pixel shape at once; --shutter then counts in field periods
    #[arg(long, value_name = "480i|480i-dv|576i|576i-dv|1080i50|1080i59.94", value_parser = parse_standard,
          conflicts_with_all = ["interlace", "scan"], help_heading = VIDEO)]
    pub(crate) video: Option<Standard>,

    /// With --video: pixels for a 16:9 picture instead of 4:3
    #[arg(long, requires = "video", help_heading = VIDEO)]
    pub(crate) wide: bool,

    /// Render two fields a frame, the one with these lines first
    #[arg(long, value_name = "top|bottom", value_parser = parse_parity, conflicts_with = "scan", help_heading = VIDEO)]
    pub(crate) interlace: Option<Parity>,

    /// Lines of the frame that a pixel averages over: 2 does not flicker, 1 is sharper [default: 2 for fields, else 1]
    #[arg(long, value_name = "1..2", value_parser = number, help_heading = VIDEO)]
    pub(crate) line_height: Option<f64>,

    /// Spread film frames over video fields by 2:3 pulldown: 24000/1001 becomes 30000/1001 interlaced
    #[arg(long, conflicts_with_all = ["video", "interlace"], help_heading = VIDEO)]
    pub(crate) pulldown: bool,

    /// Expose all lines together, or one after another from the top
    #[arg(long, value_name = "global|rolling", default_value = "global", value_parser = ["global", "rolling"], help_heading = VIDEO)]
    pub(crate) scan: String,

    /// With --scan rolling: how long the read-out takes, as a part of the frame's period
    #[arg(long, value_name = "PART", default_value_t = 1.0, value_parser = not_negative, help_heading = VIDEO)]
    pub(crate) readout: f64,

    /// Camera by name or index [default: the file's first; without any, one that sees everything]
    #[arg(long, value_name = "NAME|INDEX", help_heading = LENS)]
    pub(crate) camera: Option<String>,

    /// Aperture as an f-stop, on a sensor 24 mm high with the metre as unit
    #[arg(long, value_name = "N", value_parser = positive, help_heading = LENS)]
    pub(crate) f_stop: Option<f64>,

    /// Radius of the aperture in metres, 0 for a pinhole; wins over --f-stop
    #[arg(long, value_name = "METRES", value_parser = not_negative, help_heading = LENS)]
    pub(crate) aperture_radius: Option<f64>,

    /// Distance to the plane in focus in metres
    #[arg(long, value_name = "METRES", value_parser = positive, help_heading = LENS)]
    pub(crate) focus_distance: Option<f64>,

    /// Keep this node in focus, wherever it moves
    #[arg(long, value_name = "NODE", help_heading = LENS)]
    pub(crate) focus_on: Option<String>,

    /// Samples a pixel
    #[arg(short = 'n', long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=1 << 24), help_heading = SAMPLING)]
    pub(crate) runs: u32,

    /// How runs are placed inside a pixel
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = SAMPLING)]
    pub(crate) design: Kind,

    /// Structure between pixels: none, ordered, ordered-8x8, blue-noise, r2, z-order or auto; NAME:time on time alone
    #[arg(long, value_name = "NAME", default_value = "auto", help_heading = SAMPLING)]
    pub(crate) dither: Dither,

    /// Chooses among equally good pictures: one seed gives one picture, bit for bit
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = SAMPLING)]
    pub(crate) seed: u64,

    /// box, tent, gaussian, sharpened-gaussian, mitchell:B,C, lanczos or blackman-harris; NAME:WIDTH in pixels
    #[arg(long, value_name = "NAME", default_value = "box", help_heading = SAMPLING)]
    pub(crate) filter: FilterSpec,

    /// How textures are read: point (full resolution), mip (trilinear), stochastic (one texel drawn by mip's weights), ewa
    /// (every texel under the pixel's ellipse), stochastic-ewa (one texel drawn along that ellipse)
    #[arg(long, value_name = "NAME", default_value = "mip", value_parser = parse_texture_filter, help_heading = SAMPLING)]
    pub(crate) texture_filter: TextureFilter,

    /// Diffuse and rough bounces after the first hit; 0 is direct light and what mirrors and glass show
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u16).range(0..=1024), help_heading = LIGHT)]
    pub(crate) bounces: u16,

    /// Bounces that every path makes; with more allowed, dim paths then end by chance and the others carry their light
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(0..=1024), help_heading = LIGHT)]
    pub(crate) sure_bounces: u16,

    /// Light from lamps that mirrors and glass focus onto other surfaces: exact (noisy), blurred (what polished metal and
    /// lacquer focus is blurred, what glass focuses is left out) or dropped (diffuse surfaces are lit by lamps and diffuse
    /// surfaces alone)
    #[arg(long, value_name = "HOW", default_value = "blurred", value_parser = parse_caustics, help_heading = LIGHT)]
    pub(crate) caustics: Caustics,

    /// Light from all around: an equirectangular picture (.hdr, .exr)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "background", help_heading = LIGHT)]
    pub(crate) environment: Option<PathBuf>,

    /// Turns the environment about the vertical axis, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_hyphen_values = true, value_parser = number, help_heading = LIGHT)]
    pub(crate) environment_rotation: f64,

    /// Multiplies the environment's light
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = not_negative, help_heading = LIGHT)]
    pub(crate) environment_strength: f64,

    /// Light from all around: none, a colour R,G,B, or a gradient R,G,B:R,G,B from top to bottom [default: the file's;
    /// a soft sky where the file has no light at all]
    #[arg(long, value_name = "COLOUR", value_parser = parse_background, help_heading = LIGHT)]
    pub(crate) background: Option<Backdrop>,

    /// Threads [default: one a processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = OUTPUT)]
    pub(crate) threads: Option<u16>,

    /// EXR planes beside the picture: depth, normal, albedo, motion, time, samples, variance, object-id
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = PICTURE)]
    pub(crate) aov: Vec<Aov>,

    /// Material variant to wear, by name
    #[arg(long, value_name = "NAME", help_heading = PICTURE)]
    pub(crate) variant: Option<String>,

    /// Let the scene refer to files outside its own folder
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) allow_outside: bool,
}

/// `180deg`, `0.5`, `50%`: as a part of the period.
fn parse_shutter(text: &str) -> Result<f64, String> {
    let (number, scale) = if let Some(angle) = text.strip_suffix("deg").or_else(|| text.strip_suffix('°')) {
        (angle, 1.0 / 360.0)
    } else if let Some(percent) = text.strip_suffix('%') {
        (percent, 0.01)
    } else {
        (text, 1.0)
    };
    let value: f64 = number.trim().parse().map_err(|_| "expected an angle such as 180deg or a part such as 0.5")?;
    let part = value * scale;
    match part {
        p if !p.is_finite() || p < 0.0 => Err("an exposure cannot be negative or infinite".into()),
        p if p > 16.0 => Err(format!("{text} is {p} periods long; an angle is written {text}deg")),
        p => Ok(p),
    }
}

pub(crate) fn parse_phase(text: &str) -> Result<ShutterPhase, String> {
    match text {
        "start" => Ok(ShutterPhase::Start),
        "centre" | "center" => Ok(ShutterPhase::Centre),
        "end" => Ok(ShutterPhase::End),
        _ => Err("expected start, centre or end".into()),
    }
}

pub(crate) fn number(text: &str) -> Result<f64, String> {
    text.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| "expected a number".into())
}

pub(crate) fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("expected a number above 0".into()) })
}

pub(crate) fn not_negative(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v >= 0.0 { Ok(v) } else { Err("expected 0 or more".into()) })
}

/// The most pixels that a picture may have on a side.
const MOST_SIDE: u32 = 65_536;

fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let expected = || format!("expected width x height such as 1280x720, each from 1 to {MOST_SIDE}");
    let (w, h) = text.split_once(['x', 'X', '×']).ok_or_else(expected)?;
    let side = |t: &str| t.trim().parse::<u32>().ok().filter(|v| (1..=MOST_SIDE).contains(v)).ok_or_else(expected);
    let (w, h) = (side(w)?, side(h)?);
    if u64::from(w) * u64::from(h) > 1 << 28 {
        return Err(format!("{w}x{h} is more than 268 million pixels"));
    }
    Ok((w, h))
}

fn parse_crop(text: &str) -> Result<[u32; 4], String> {
    let expected = || "expected X,Y,WIDTH,HEIGHT in pixels".to_owned();
    let parts: Vec<u32> =
        text.split(',').map(|p| p.trim().parse().map_err(|_| expected())).collect::<Result<_, _>>()?;
    let crop: [u32; 4] = parts.try_into().map_err(|_| expected())?;
    if crop[2] == 0 || crop[3] == 0 { Err("a crop of nothing renders nothing".into()) } else { Ok(crop) }
}

fn parse_standard(text: &str) -> Result<Standard, String> {
    text.parse().map_err(|e: graeco::Error| e.to_string())
}

fn parse_parity(text: &str) -> Result<Parity, String> {
    match text {
        "top" | "tff" => Ok(Parity::Top),
        "bottom" | "bff" => Ok(Parity::Bottom),
        _ => Err("expected top or bottom: the field that comes first".into()),
    }
}

fn parse_blur(text: &str) -> Result<(String, f64), String> {
    let (node, amount) = text.rsplit_once('=').ok_or("expected NODE=AMOUNT, such as Wheel=0.5")?;
    Ok((node.to_owned(), not_negative(amount)?))
}

/// A background without a picture: linear colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Backdrop {
    /// The same all around.
    Constant([f32; 3]),
    /// From straight up to straight down.
    Gradient([f32; 3], [f32; 3]),
}

fn parse_background(text: &str) -> Result<Backdrop, String> {
    let expected = || "expected none, R,G,B or R,G,B:R,G,B with linear values of 0 or more".to_owned();
    let colour = |t: &str| -> Result<[f32; 3], String> {
        let parts: Vec<f32> =
            t.split(',').map(|p| p.trim().parse().map_err(|_| expected())).collect::<Result<_, _>>()?;
        match parts[..] {
            [r, g, b] if parts.iter().all(|v| v.is_finite() && *v >= 0.0) => Ok([r, g, b]),
            [grey] if grey.is_finite() && grey >= 0.0 => Ok([grey; 3]),
            _ => Err(expected()),
        }
    };
    match (text, text.split_once(':')) {
        ("none", _) => Ok(Backdrop::Constant([0.0; 3])),
        (_, Some((top, bottom))) => Ok(Backdrop::Gradient(colour(top)?, colour(bottom)?)),
        (_, None) => Ok(Backdrop::Constant(colour(text)?)),
    }
}

fn parse_caustics(text: &str) -> Result<Caustics, String> {
    match text {
        "dropped" => Ok(Caustics::Dropped),
        "blurred" => Ok(Caustics::Blurred),
        "exact" => Ok(Caustics::Exact),
        _ => Err("expected dropped, blurred or exact".into()),
    }
}

fn parse_texture_filter(text: &str) -> Result<TextureFilter, String> {
    match text {
        "point" => Ok(TextureFilter::Point),
        "mip" => Ok(TextureFilter::Mip),
        "stochastic" => Ok(TextureFilter::Stochastic),
        "ewa" => Ok(TextureFilter::Ewa),
        "stochastic-ewa" => Ok(TextureFilter::StochasticEwa),
        _ => Err("expected point, mip, stochastic, ewa or stochastic-ewa".into()),
    }
}
