//! Keeps luma detail out of the band in which a composite decoder takes it for colour.
//!
//! NTSC's colour subcarrier lies at 0.2652 cycles per pixel at 13.5 MHz (Mitchell 1990, §6); luma between 0.20 and 0.33
//! comes out of a simple decoder as false colour. The filter is a linear-phase band-stop of 31 taps, equiripple
//! (Parks and McClellan 1972). Response in cycles per pixel:
//!
//! | band | gain |
//! |---|---|
//! | 0 | exactly 1 |
//! | 0 to 0.15 | 0.955 to 1.000 |
//! | 0.15 to 0.20 | falling |
//! | 0.20 to 0.33 | at most 0.0224 (−33 dB) |
//! | 0.33 to 0.40 | rising |
//! | 0.40 to 0.50 | 0.955 to 1.000 |

/// The centre tap and those to one side, in units of 2⁻¹⁶; the other side mirrors it. They sum to 2¹⁶ exactly.
pub const COEFFICIENTS: [i32; 16] =
    [40_658, 2318, 17_889, -3939, -6549, 837, -1272, 2478, 2580, -2131, -903, -9, 30, 1338, 664, -892];

/// Filters one line of luma in place. Beyond its ends the line is mirrored about its end pixels.
pub fn filter_line(line: &mut [f64]) {
    let source = line.to_vec();
    let last = source.len().saturating_sub(1);
    for (x, value) in line.iter_mut().enumerate() {
        let mut sum = source[x] * f64::from(COEFFICIENTS[0]);
        for (k, &coefficient) in COEFFICIENTS.iter().enumerate().skip(1) {
            let left = mirror(x.abs_diff(k), last);
            let right = mirror(x + k, last);
            sum += (source[left] + source[right]) * f64::from(coefficient);
        }
        *value = sum / 65_536.0;
    }
}

/// `x`, already mirrored at 0, mirrored at `last` as often as it takes.
fn mirror(x: usize, last: usize) -> usize {
    if last == 0 {
        return 0;
    }
    let period = 2 * last;
    let x = x % period;
    if x > last { period - x } else { x }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustfft::{FftPlanner, num_complex::Complex};

    /// The response as the discrete Fourier transform of the impulse response on 4096 points.
    fn response() -> Vec<f64> {
        let n = 4096;
        let mut line = vec![0.0; n];
        line[n / 2] = 1.0;
        filter_line(&mut line);
        let mut spectrum: Vec<_> = line.into_iter().map(|x| Complex::new(x, 0.0)).collect();
        FftPlanner::new().plan_fft_forward(n).process(&mut spectrum);
        spectrum.iter().take(n / 2 + 1).map(|z| z.norm()).collect()
    }

    #[test]
    fn the_response_is_as_documented() {
        for (bin, gain) in response().into_iter().enumerate() {
            let frequency = bin as f64 / 4096.0;
            if frequency <= 0.15 || frequency >= 0.40 {
                assert!((0.955..=1.0001).contains(&gain), "{frequency}: {gain}");
            } else if (0.20..=0.33).contains(&frequency) {
                assert!(gain <= 0.0224, "{frequency}: {gain}");
            }
        }
    }

    #[test]
    fn constants_pass_exactly_and_edges_do_not_ring() {
        assert_eq!(COEFFICIENTS[0] + 2 * COEFFICIENTS[1..].iter().sum::<i32>(), 65_536);
        for length in [1, 2, 7, 720] {
            let mut line = vec![0.75; length];
            filter_line(&mut line);
            assert!(line.iter().all(|&x| x.to_bits() == 0.75_f64.to_bits()), "{length}");
        }
    }
}
