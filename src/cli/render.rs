//! `graeco render`.

use clap::{Args, ValueHint};
use graeco::time::{FrameRate, ShutterPhase};
use std::path::PathBuf;

const PICTURE: &str = "Picture";
const TIME: &str = "Time and shutter";
const LENS: &str = "Camera and lens";
const SAMPLING: &str = "Sampling";
const LIGHT: &str = "Light";
const OUTPUT: &str = "Output and progress";

/// Arguments of `graeco render`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:
  graeco render animations/pool.glb -o out/pool.####.exr
  graeco render shot.glb -o shot.png --frames 12 --size 1280x720 --runs 256
  graeco render shot.glb -o out/shot.####.png --shutter 90deg --f-stop 2.8 --focus-on Hero

Exit codes: 0 done, 1 permanent failure, 2 wrong usage, 75 worth retrying, 130 interrupted.")]
pub(crate) struct RenderArgs {
    /// glTF file to render (.gltf or .glb)
    #[arg(value_hint = ValueHint::FilePath)]
    pub(crate) scene: PathBuf,

    /// Where pictures go: out/shot.####.exr, shot.png, out/%04d.png; the extension decides the format
    #[arg(short, long, value_name = "PATTERN", value_hint = ValueHint::AnyPath, help_heading = OUTPUT)]
    pub(crate) output: PathBuf,

    /// Frames: 7, 1-48, 1-48x2, 1-48:2 or 3,7,9; frame n stands at n / fps seconds [default: first to last key]
    #[arg(long, value_name = "LIST", allow_hyphen_values = true, help_heading = TIME)]
    pub(crate) frames: Option<graeco::render::FrameList>,

    /// Frames per second: 24, 29.97, 30000/1001
    #[arg(long, value_name = "RATE", default_value = "24", help_heading = TIME)]
    pub(crate) fps: FrameRate,

    /// Exposure as an angle (180deg) or a part of the frame's period (0.5); 0 freezes [default: the file's, else 180deg]
    #[arg(long, value_name = "ANGLE|PART", value_parser = parse_shutter, help_heading = TIME)]
    pub(crate) shutter: Option<f64>,

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

    /// Width and height of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "960x540", value_parser = parse_size, help_heading = PICTURE)]
    pub(crate) size: (u32, u32),

    /// Render only this window of the picture: pixels from the left and top, width, height
    #[arg(long, value_name = "X,Y,W,H", value_parser = parse_crop, help_heading = PICTURE)]
    pub(crate) crop: Option<[u32; 4]>,

    /// Width of a pixel over its height: 1, 10:11
    #[arg(long, value_name = "RATIO", default_value = "1", value_parser = parse_ratio, help_heading = PICTURE)]
    pub(crate) pixel_aspect: (u32, u32),

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
        p if p > 1000.0 => Err(format!("{text} is {p} frame periods; write an angle as {text}deg")),
        p => Ok(p),
    }
}

fn parse_phase(text: &str) -> Result<ShutterPhase, String> {
    match text {
        "start" => Ok(ShutterPhase::Start),
        "centre" | "center" => Ok(ShutterPhase::Centre),
        "end" => Ok(ShutterPhase::End),
        _ => Err("expected start, centre or end".into()),
    }
}

fn number(text: &str) -> Result<f64, String> {
    text.trim().parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| "expected a number".into())
}

fn positive(text: &str) -> Result<f64, String> {
    number(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err("expected a number above 0".into()) })
}

fn not_negative(text: &str) -> Result<f64, String> {
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
    let parts: Vec<u32> = text.split(',').map(|p| p.trim().parse().map_err(|_| expected())).collect::<Result<_, _>>()?;
    let crop: [u32; 4] = parts.try_into().map_err(|_| expected())?;
    if crop[2] == 0 || crop[3] == 0 { Err("a crop of nothing renders nothing".into()) } else { Ok(crop) }
}

fn parse_ratio(text: &str) -> Result<(u32, u32), String> {
    let expected = || "expected a ratio such as 1 or 10:11".to_owned();
    let part = |t: &str| t.trim().parse::<u32>().ok().filter(|v| (1..=10_000).contains(v)).ok_or_else(expected);
    match text.split_once([':', '/']) {
        Some((a, b)) => Ok((part(a)?, part(b)?)),
        None => Ok((part(text)?, 1)),
    }
}

fn parse_blur(text: &str) -> Result<(String, f64), String> {
    let (node, amount) = text.rsplit_once('=').ok_or("expected NODE=AMOUNT, such as Wheel=0.5")?;
    Ok((node.to_owned(), not_negative(amount)?))
}
