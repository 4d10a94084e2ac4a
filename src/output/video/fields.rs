//! Weaving fields into frames, taking frames apart, and 2:3 pulldown.

use crate::output::{FieldOrder, Picture, Plane};
use crate::time::{Exposure, FrameRate, Parity};
use crate::{Error, Result};

/// The parity of line `line` of a frame.
const fn parity_of(line: u32) -> Parity {
    if line.is_multiple_of(2) { Parity::Top } else { Parity::Bottom }
}

/// The other one.
#[must_use]
pub const fn opposite(parity: Parity) -> Parity {
    match parity {
        Parity::Top => Parity::Bottom,
        Parity::Bottom => Parity::Top,
    }
}

/// The frame of two fields, given in the order of time. Its exposure is the earlier field's.
///
/// # Errors
/// If the two are not the fields of one frame: of opposite parity, equal width, heights that interleave, equal planes.
pub fn weave(earlier: &Picture, later: &Picture) -> Result<Picture> {
    let bad = |problem: &str| {
        Error::invalid(format!("weaving the fields of frame {}", earlier.metadata.frame), problem.to_owned())
    };
    let (FieldOrder::Separate { parity, first }, FieldOrder::Separate { parity: other, first: other_first }) =
        (earlier.metadata.order, later.metadata.order)
    else {
        return Err(bad("expected two single fields"));
    };
    if parity != first || other_first != first || other == parity || earlier.metadata.frame != later.metadata.frame {
        return Err(bad("expected the earlier and the later field of one frame"));
    }
    if !earlier.is_whole() || !later.is_whole() {
        return Err(bad("a crop cannot be woven; expected whole fields"));
    }
    let (top, bottom) = if parity == Parity::Top { (earlier, later) } else { (later, earlier) };
    let height = top.size.1 + bottom.size.1;
    if top.size.0 != bottom.size.0 || top.size.1 != height.div_ceil(2) {
        return Err(bad("the fields' sizes do not fit one frame"));
    }
    let mut woven = assemble(top, bottom, height, |line| (parity_of(line), line / 2))
        .ok_or_else(|| bad("expected the same planes in both fields"))?;
    woven.metadata = earlier.metadata.clone();
    woven.metadata.order = FieldOrder::Interlaced { first };
    Ok(woven)
}

/// The fields of a woven frame in the order of time. The later field's exposure is half a frame after the earlier's.
///
/// # Errors
/// If the picture is not interlaced or is a crop.
pub fn separate(frame: &Picture) -> Result<[Picture; 2]> {
    let FieldOrder::Interlaced { first } = frame.metadata.order else {
        return Err(Error::invalid(
            format!("separating the fields of frame {}", frame.metadata.frame),
            "the picture is not interlaced",
        ));
    };
    if !frame.is_whole() {
        return Err(Error::invalid(
            format!("separating the fields of frame {}", frame.metadata.frame),
            "a crop has no whole fields",
        ));
    }
    let field = |parity: Parity| {
        let order = FieldOrder::Separate { parity, first };
        let lines = order.lines();
        let (width, rows) = (frame.size.0, lines.rows(frame.size.1));
        let step = width as usize;
        let start = |row: u32| (2 * row + u32::from(parity == Parity::Bottom)) as usize * step;
        let mut picture = frame.clone();
        picture.size = (width, rows);
        picture.window = crate::film::Window::whole(width, rows);
        picture.rgb = (0..rows).flat_map(|row| &frame.rgb[start(row)..start(row) + step]).copied().collect();
        let pick = |samples: &Vec<f32>| -> Vec<f32> {
            (0..rows).flat_map(|row| &samples[start(row)..start(row) + step]).copied().collect()
        };
        picture.alpha = frame.alpha.as_ref().map(pick);
        for (plane, whole) in picture.planes.iter_mut().zip(&frame.planes) {
            plane.samples = pick(&whole.samples);
        }
        picture.metadata.order = order;
        if parity != first {
            let half = 0.5 * frame.metadata.rate.period();
            let Exposure { open, close } = frame.metadata.exposure;
            picture.metadata.exposure = Exposure { open: open + half, close: close + half };
        }
        picture
    };
    Ok([field(first), field(opposite(first))])
}

/// A picture of `height` lines, each from the row of `top` or `bottom` that `source` names.
fn assemble(top: &Picture, bottom: &Picture, height: u32, source: impl Fn(u32) -> (Parity, u32)) -> Option<Picture> {
    let width = top.size.0 as usize;
    let matching = top.planes.len() == bottom.planes.len()
        && top.planes.iter().zip(&bottom.planes).all(|(a, b)| a.name == b.name)
        && top.alpha.is_some() == bottom.alpha.is_some();
    if !matching {
        return None;
    }
    let of = |parity| if parity == Parity::Top { top } else { bottom };
    let gather = |samples: &dyn Fn(&Picture) -> Vec<f32>| -> Vec<f32> {
        let (a, b) = (samples(top), samples(bottom));
        let mut out = Vec::with_capacity(width * height as usize);
        for line in 0..height {
            let (parity, row) = source(line);
            let start = row as usize * width;
            out.extend_from_slice(&(if parity == Parity::Top { &a } else { &b })[start..start + width]);
        }
        out
    };
    let mut rgb = Vec::with_capacity(width * height as usize);
    for line in 0..height {
        let (parity, row) = source(line);
        let start = row as usize * width;
        rgb.extend_from_slice(&of(parity).rgb[start..start + width]);
    }
    let planes = (0..top.planes.len())
        .map(|index| Plane {
            name: top.planes[index].name.clone(),
            samples: gather(&|picture| picture.planes[index].samples.clone()),
        })
        .collect();
    Some(Picture {
        size: (top.size.0, height),
        window: crate::film::Window::whole(top.size.0, height),
        rgb,
        alpha: top.alpha.is_some().then(|| gather(&|picture| picture.alpha.clone().unwrap_or_default())),
        planes,
        metadata: top.metadata.clone(),
    })
}

/// 2:3 pulldown: film at 24000/1001 as interlaced video at 30000/1001.
///
/// Four film frames A B C D become five video frames whose earlier and later fields are AA BB BC CD DD: A is seen for
/// two fields, B for three, C for two, D for three. Each film frame is rendered once.
#[derive(Debug)]
pub struct Pulldown {
    first: Parity,
    /// Film frames taken.
    taken: u64,
    /// Number of the first video frame of this run's first group.
    base: Option<i64>,
    /// Video frames given.
    given: i64,
    previous: Option<Picture>,
}

impl Pulldown {
    /// Video frames begin with the field `first`.
    #[must_use]
    pub fn new(first: Parity) -> Self {
        Self { first, taken: 0, base: None, given: 0, previous: None }
    }

    /// The rate of video made of film at `film`: five quarters of it.
    ///
    /// # Errors
    /// If that is no usable rate.
    pub fn rate(film: FrameRate) -> Result<FrameRate> {
        let (frames, seconds) = film.parts();
        let (frames, seconds) = if frames % 4 == 0 {
            (frames / 4 * 5, seconds)
        } else {
            (frames.saturating_mul(5), seconds.saturating_mul(4))
        };
        FrameRate::new(frames, seconds)
    }

    /// Takes the next film frame; gives the video frames that it completes.
    ///
    /// # Errors
    /// If the picture is not progressive and whole, or differs in size from the one before.
    pub fn push(&mut self, film: Picture) -> Result<Vec<Picture>> {
        if film.metadata.order != FieldOrder::Progressive || !film.is_whole() {
            return Err(Error::invalid("pulldown", "expected whole progressive pictures"));
        }
        if let Some(previous) = self.previous.as_ref().filter(|previous| previous.size != film.size) {
            let ((a, b), (c, d)) = (previous.size, film.size);
            return Err(Error::invalid("pulldown", format!("a picture of {c}x{d} follows one of {a}x{b}")));
        }
        if self.base.is_none() {
            self.base = Some(film.metadata.frame.div_euclid(4) * 5 + film.metadata.frame.rem_euclid(4));
        }
        let phase = self.taken % 4;
        self.taken += 1;
        let pairs: Vec<Picture> = match (phase, self.previous.take()) {
            // B again with C; then C with D, and D alone.
            (2, Some(previous)) => vec![self.frame(&previous, &film)?],
            (3, Some(previous)) => vec![self.frame(&previous, &film)?, self.frame(&film, &film)?],
            _ => vec![self.frame(&film, &film)?],
        };
        self.previous = Some(film);
        Ok(pairs)
    }

    /// The last video frame, if the last film frame has been seen for less than two fields: after a C.
    ///
    /// # Errors
    /// As [`Pulldown::push`].
    pub fn finish(&mut self) -> Result<Option<Picture>> {
        let unfinished = self.taken % 4 == 3;
        match self.previous.take() {
            Some(film) if unfinished => self.frame(&film, &film).map(Some),
            _ => Ok(None),
        }
    }

    fn frame(&mut self, earlier: &Picture, later: &Picture) -> Result<Picture> {
        let (top, bottom) = if self.first == Parity::Top { (earlier, later) } else { (later, earlier) };
        let height = top.size.1;
        let mut woven = assemble(top, bottom, height, |line| (parity_of(line), line))
            .ok_or_else(|| Error::invalid("pulldown", "expected the same planes in all pictures"))?;
        woven.metadata = earlier.metadata.clone();
        woven.metadata.rate = Self::rate(earlier.metadata.rate)?;
        woven.metadata.order = FieldOrder::Interlaced { first: self.first };
        woven.metadata.frame = self.base.unwrap_or(0) + self.given;
        self.given += 1;
        Ok(woven)
    }
}
