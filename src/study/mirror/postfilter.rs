//! Motion blur as a spatial filter after rendering: Potmesil and Chakravarty 1983, "Modeling Motion Blur in
//! Computer-Generated Images".
//!
//! In: sample points of one frozen picture, each with the object that it shows, its depth, and its way on the film. Every
//! object's samples are spread along their ways (the point-spread function of §3, one for each sample point, so that
//! turning objects are served as well as sliding ones); the blurred objects are laid over one another from near to
//! far by their coverage (§4). Where an object moved away from what nobody saw in the frozen picture, the
//! layers that are known are scaled up.
//!
//! Limit, and the point of showing it: a sample's way is that of the surface that it lies on. What a mirror shows moves
//! otherwise.

use glam::{DVec2, Vec3};

/// One sample point of the frozen picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Scene-linear radiance.
    pub radiance: Vec3,
    /// Number of the object; 0 is what lies behind everything.
    pub object: u32,
    /// Distance along the camera's axis, metres.
    pub depth: f32,
    /// Where its surface point is one frame earlier and one later, relative to here, sample spacings.
    pub motion: [DVec2; 2],
}

impl Sample {
    /// Where it is `s` frames later (or earlier, below 0): on the parabola through the three known places.
    fn place(&self, s: f64) -> DVec2 {
        let [before, after] = self.motion;
        (after - before) * (0.5 * s) + (after + before) * (0.5 * s * s)
    }
}

/// The picture, `width` samples across, of an exposure of `shutter` frames whose middle the samples show.
#[must_use]
pub fn post_filter(samples: &[Sample], width: usize, shutter: f64) -> Vec<Vec3> {
    let mut picture = vec![Vec3::ZERO; samples.len()];
    let mut clear = vec![1.0_f32; samples.len()];
    let mut layer = Layer { sums: vec![(Vec3::ZERO, 0.0); samples.len()], touched: Vec::new() };
    for members in objects(samples) {
        for &i in &members {
            layer.spread(&samples[i], i, width, shutter);
        }
        for &i in &layer.touched {
            let (sum, weight) = std::mem::take(&mut layer.sums[i]);
            let cover = clear[i] * weight.min(1.0);
            picture[i] += sum * (cover / weight);
            clear[i] -= cover;
        }
        layer.touched.clear();
    }
    for (pixel, clear) in picture.iter_mut().zip(&clear) {
        if *clear < 1.0 {
            *pixel /= 1.0 - clear;
        }
    }
    picture
}

/// Indices of each object's samples, objects from near to far by their median depth.
fn objects(samples: &[Sample]) -> Vec<Vec<usize>> {
    let mut indices: Vec<usize> = (0..samples.len()).collect();
    indices.sort_by_key(|&i| samples[i].object);
    let mut groups: Vec<(f32, Vec<usize>)> = indices
        .chunk_by(|&a, &b| samples[a].object == samples[b].object)
        .map(|group| {
            let mut depths: Vec<f32> = group.iter().map(|&i| samples[i].depth).collect();
            depths.sort_by(f32::total_cmp);
            let behind_all = samples[group[0]].object == 0;
            (if behind_all { f32::INFINITY } else { depths[depths.len() / 2] }, group.to_vec())
        })
        .collect();
    groups.sort_by(|a, b| a.0.total_cmp(&b.0));
    groups.into_iter().map(|g| g.1).collect()
}

/// One object, blurred: radiance times weight, and weight.
struct Layer {
    sums: Vec<(Vec3, f32)>,
    /// Where the weight is not zero, each once.
    touched: Vec<usize>,
}

impl Layer {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        clippy::cast_possible_wrap,
        reason = "places on a picture, checked to be inside it"
    )]
    fn spread(&mut self, sample: &Sample, index: usize, width: usize, shutter: f64) {
        /// No way has more steps: it would cross any picture.
        const MOST: f64 = 65_536.0;
        let height = self.sums.len() / width;
        let here = DVec2::new((index % width) as f64, (index / width) as f64);
        let ends = [-0.5, 0.0, 0.5].map(|s| sample.place(s * shutter));
        let length = ends[0].distance(ends[1]) + ends[1].distance(ends[2]);
        // Two steps for each sample spacing: no sample on the way is missed.
        let steps = (2.0 * length).ceil().clamp(1.0, MOST) as usize;
        let weight = 1.0 / steps as f32;
        for step in 0..steps {
            let s = ((step as f64 + 0.5) / steps as f64 - 0.5) * shutter;
            let place = (here + sample.place(s)).round();
            if place.x < 0.0 || place.y < 0.0 || place.x >= width as f64 || place.y >= height as f64 {
                continue;
            }
            let at = place.y as usize * width + place.x as usize;
            if self.sums[at].1 <= 0.0 {
                self.touched.push(at);
            }
            self.sums[at].0 += sample.radiance * weight;
            self.sums[at].1 += weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(radiance: f32) -> Sample {
        Sample { radiance: Vec3::splat(radiance), object: 1, depth: 9.0, motion: [DVec2::ZERO; 2] }
    }

    #[test]
    fn what_stands_still_stays_as_it_is() {
        let samples: Vec<Sample> = (0..12).map(|i| still(i as f32)).collect();
        let out = post_filter(&samples, 4, 0.5);
        assert!(out.iter().zip(&samples).all(|(a, b)| *a == b.radiance));
    }

    /// A matt bar 8 wide slides by 16 a frame over black behind a shutter of half a frame: its smear is a trapezoid of
    /// base 16 and height 1, the convolution of two boxes of 8; but where the bar hid the ground, which nobody saw, it is
    /// the bar alone.
    #[test]
    fn a_sliding_bar_becomes_the_convolution_of_two_boxes() {
        let step = DVec2::new(16.0, 0.0);
        let samples: Vec<Sample> = (0..40)
            .map(|x| match x {
                16..24 => Sample { radiance: Vec3::ONE, object: 2, depth: 1.0, motion: [-step, step] },
                _ => still(0.0),
            })
            .collect();
        let out = post_filter(&samples, 40, 0.5);
        for (x, pixel) in out.iter().enumerate() {
            let distance = (x as f64 + 0.5 - 20.0).abs();
            let expected = if (16..24).contains(&x) { 1.0 } else { (1.0 - distance / 8.0).max(0.0) };
            // Places are rounded to samples: an eighth of the smear's length each way.
            assert!((f64::from(pixel.x) - expected).abs() <= 0.125, "{x}: {} for {expected}", pixel.x);
        }
    }

    #[test]
    fn a_parabola_passes_through_the_three_places() {
        let sample = Sample { motion: [DVec2::new(-3.0, 1.0), DVec2::new(5.0, 2.0)], ..still(1.0) };
        assert_eq!(sample.place(-1.0), DVec2::new(-3.0, 1.0));
        assert_eq!(sample.place(1.0), DVec2::new(5.0, 2.0));
        assert_eq!(sample.place(0.0), DVec2::ZERO);
    }
}
