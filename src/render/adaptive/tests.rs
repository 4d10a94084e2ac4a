use super::*;
use crate::design::{DesignOptions, Point};
use crate::film::{Filter, Footprint, Lines, PixelEstimate};
use crate::render::Forecast;
use crate::time::Parity;
use crate::trace::FilmPoint;
use glam::Vec3;

const FACTORS: [Factor; 3] = [Factor::FILM_X, Factor::FILM_Y, Factor::SHUTTER];

/// A function of place and time.
struct Shown<F>(F);

impl<F: Fn(f64, f64, f64) -> f64 + Sync> ImageFunction for Shown<F> {
    #[allow(clippy::cast_possible_truncation, reason = "radiance is f32")]
    fn radiance(&self, film: FilmPoint, _: &Point<'_>) -> Vec3 {
        Vec3::splat(self.0(film.position.x, film.position.y, f64::from(film.u_time)) as f32)
    }
}

fn asked(goal: Goal) -> Adaptive {
    Adaptive { goal, most_runs: 4096, view: View::default() }
}

fn sampled(function: &impl ImageFunction, goal: Goal, size: (u32, u32), window: Option<Window>, lines: Lines) -> Film {
    drawn_by(Kind::Auto, function, goal, size, window, lines)
}

fn drawn_by(
    kind: Kind,
    function: &impl ImageFunction,
    goal: Goal,
    size: (u32, u32),
    window: Option<Window>,
    lines: Lines,
) -> Film {
    let mut film = Film::new(size.0, size.1, window).unwrap();
    let filter = Filter::new("box".parse().unwrap());
    let pass = Pass { footprint: Footprint::PROGRESSIVE, filter: &filter, lines, number: 3 };
    let options = DesignOptions { kind, seed: 9, ..DesignOptions::default() };
    let progress = Progress::default();
    integrate(function, (&options, &FACTORS), &asked(goal), &pass, &mut film, None, &progress).unwrap();
    film
}

/// A disk that moves to the right by 8 pixels, brighter to the bottom.
fn disk(x: f64, y: f64, t: f64) -> f64 {
    let (dx, dy) = (x - 12.0 - 8.0 * t, y - 14.0);
    if dx * dx + dy * dy < 36.0 { 0.2 + 0.02 * y } else { 0.05 }
}

#[test]
fn a_crop_is_what_the_whole_picture_shows_there() {
    let window = Window { x: 5, y: 7, width: 21, height: 12 };
    for goal in [Goal::Error(0.02), Goal::Passes(24)] {
        let whole = sampled(&Shown(disk), goal, (40, 30), None, Lines::All);
        let crop = sampled(&Shown(disk), goal, (40, 30), Some(window), Lines::All);
        for y in 7..19 {
            for x in 5..26 {
                let at = |film: &Film| film.pixels()[film.window().index(x, y).unwrap()];
                assert_eq!(at(&whole), at(&crop), "{goal:?} {x} {y}");
            }
        }
    }
}

#[test]
fn pixels_draw_growing_sequences_unless_others_are_asked_for() {
    for goal in [Goal::Error(0.05), Goal::Mean(32)] {
        let film = |kind| drawn_by(kind, &Shown(disk), goal, (32, 20), None, Lines::All);
        let (usual, growing, sobol) = (film(Kind::Auto), film(Kind::Growing), film(Kind::Sobol));
        assert_eq!(usual.pixels(), growing.pixels(), "{goal:?}");
        assert_ne!(usual.pixels(), sobol.pixels(), "{goal:?}");
    }
}

#[test]
fn fields_are_sampled_on_their_lines_alone() {
    let film = sampled(&Shown(disk), Goal::Error(0.05), (32, 20), None, Lines::Field(Parity::Bottom));
    for (index, pixel) in film.pixels().iter().enumerate() {
        let exposed = index / 32 % 2 == 1;
        assert_eq!(pixel.runs >= LEAST_RUNS, exposed, "line {}", index / 32);
    }
}

#[test]
fn flat_pixels_stop_at_the_fewest_runs_and_edges_go_on_until_they_are_accurate() {
    let film = sampled(&Shown(disk), Goal::Error(0.01), (48, 32), None, Lines::All);
    let at = |x, y| film.pixels()[film.window().index(x, y).unwrap()];
    assert_eq!((at(44, 4).runs, at(44, 4).variance), (LEAST_RUNS, Vec3::ZERO));
    assert!(at(16, 8).runs > 4 * LEAST_RUNS, "{}", at(16, 8).runs);
    let visibility = Visibility::new(View::default());
    for pixel in film.pixels().iter().filter(|pixel| pixel.runs < 4096) {
        assert!(crate::film::STUDENT_T * visibility.square(pixel).sqrt() <= 0.01);
    }
}

/// A line a tenth of a pixel wide crosses ten pixels: a hundredth of a pixel's runs see it, and the first sixteen miss it in
/// five of six pixels, which then show no variance at all. Neighbours that did see it keep them alive.
#[test]
fn a_thin_moving_object_that_the_first_runs_miss_is_found() {
    let line = |x: f64, _: f64, t: f64| if (x - 3.0 - 10.0 * t).abs() < 0.05 { 2.0 } else { 0.01 };
    let film = sampled(&Shown(line), Goal::Error(0.01), (16, 16), None, Lines::All);
    let truth = 0.01 + 1.99 * 0.1 / 10.0;
    let (mut found, mut sum, mut count) = (0, 0.0, 0_u32);
    for y in 0..16 {
        for x in 4..12 {
            let pixel = film.pixels()[film.window().index(x, y).unwrap()];
            found += u32::from(pixel.variance.x > 0.0);
            sum += f64::from(pixel.radiance.x) / truth;
            count += 1;
        }
    }
    assert_eq!(found, count);
    let mean: f64 = sum / f64::from(count);
    assert!((mean - 1.0).abs() < 0.02, "{mean}");
}

/// Motion-blurred edges and ramps of many slopes, whose integrals are known: (pixel's estimate, truth).
fn slopes(goal: Goal) -> Vec<(PixelEstimate, f64)> {
    // Each pixel is lit for a part of the exposure that depends on its place.
    let part = |x: f64, y: f64| 0.1 + 0.8 * ((x.floor() * 0.137 + y.floor() * 0.311) % 1.0);
    let lit =
        move |x: f64, y: f64, t: f64| if t < part(x, y) * (0.5 + x.fract()) { 0.3 + 0.4 * y.fract() } else { 0.02 };
    let film = sampled(&Shown(lit), goal, (128, 128), None, Lines::All);
    let truths = (0..128 * 128_u32).map(|i| {
        let p = part(f64::from(i % 128), f64::from(i / 128));
        // The part of the exposure: min(1, p (½ + u)), u uniform.
        let full = (1.0 / p - 0.5).clamp(0.0, 1.0);
        let lit = p * (0.5 * full + 0.5 * full * full) + (1.0 - full);
        0.02 + lit * 0.48
    });
    film.pixels().iter().copied().zip(truths).collect()
}

/// 16 384 pixels: the standard deviation of the share is 0.17 %.
#[test]
fn intervals_of_pixels_that_stopped_hold_the_truth_in_93_to_97_of_100() {
    let pixels = slopes(Goal::Error(0.04));
    let held = pixels.iter().filter(|(pixel, truth)| {
        (f64::from(pixel.radiance.x) - truth).abs() <= crate::film::STUDENT_T * f64::from(pixel.variance.x).sqrt()
    });
    let share = held.count() as f64 / pixels.len() as f64;
    assert!((0.93..=0.97).contains(&share), "{share}");
}

/// Squared errors over stated variances, 16 384 pixels: 1 within a sixth where twins calibrate the quarters' spread, which by
/// itself overstates them by more than that, 3.4 times at the 28th pass.
#[test]
fn twins_tell_what_the_spread_of_quarters_stands_for() {
    let ratio = |goal: Goal| {
        let pixels = slopes(goal);
        let square: f64 = pixels.iter().map(|(p, truth)| (f64::from(p.radiance.x) - truth).powi(2)).sum();
        square / pixels.iter().map(|(p, _)| f64::from(p.variance.x)).sum::<f64>()
    };
    let (held, loose) = (ratio(Goal::Error(0.04)), ratio(Goal::Passes(28)));
    assert!((held - 1.0).abs() < 1.0 / 6.0 && loose < 5.0 / 6.0, "{held} {loose}");
}

/// Stopping when the spread happens to be small favours values that go with small spreads. The mean of the errors in
/// units of the standard error, over 16 384 pixels, has a standard deviation of 0.0135 where there is no bias.
#[test]
fn stopping_biases_pixels_by_less_than_a_tenth_of_their_standard_error() {
    let pixels = slopes(Goal::Error(0.04));
    let difference: f64 = pixels.iter().map(|(p, truth)| f64::from(p.radiance.x) - truth).sum();
    let square: f64 = pixels.iter().map(|(p, truth)| (f64::from(p.radiance.x) - truth).powi(2)).sum();
    let n = pixels.len() as f64;
    let bias = difference / n / (square / n).sqrt();
    assert!(bias.abs() < 0.1, "{bias}");
}

#[test]
fn a_picture_within_a_time_is_repeated_by_its_passes() {
    let mut film = Film::new(40, 30, None).unwrap();
    let filter = Filter::new("box".parse().unwrap());
    let pass = Pass { footprint: Footprint::PROGRESSIVE, filter: &filter, lines: Lines::All, number: 3 };
    let options = DesignOptions { seed: 9, ..DesignOptions::default() };
    let deadline = Instant::now().checked_add(std::time::Duration::from_millis(50));
    let goal = asked(Goal::Within(0.05));
    let passes =
        integrate(&Shown(disk), (&options, &FACTORS), &goal, &pass, &mut film, deadline, &Progress::default()).unwrap();
    assert_eq!(film, sampled(&Shown(disk), Goal::Passes(passes), (40, 30), None, Lines::All));
}

/// Runs go where they help, and their mean is what was asked for, but for the last pass, which would exceed it.
#[test]
fn a_mean_of_runs_is_spent_where_it_lowers_the_error_most() {
    let mean = |film: &Film| film.pixels().iter().map(|p| f64::from(p.runs)).sum::<f64>() / film.pixels().len() as f64;
    let film = sampled(&Shown(disk), Goal::Mean(32), (64, 48), None, Lines::All);
    assert!((25.0..=34.0).contains(&mean(&film)), "{}", mean(&film));
    let at = |x, y| film.pixels()[film.window().index(x, y).unwrap()].runs;
    assert!(at(60, 4) == LEAST_RUNS && at(16, 8) >= 4 * LEAST_RUNS, "{} {}", at(60, 4), at(16, 8));
    let even = sampled(&Shown(disk), Goal::Mean(16), (64, 48), None, Lines::All);
    assert!(even.pixels().iter().all(|pixel| pixel.runs == LEAST_RUNS));
    // A fixed number of runs has several times the error.
    let fine = sampled(&Shown(disk), Goal::Passes(70), (64, 48), None, Lines::All);
    let error = |film: &Film| -> f64 {
        let pairs = film.pixels().iter().zip(fine.pixels());
        pairs.map(|(a, b)| f64::from(a.radiance.x - b.radiance.x).powi(2)).sum()
    };
    assert!(error(&film) < 0.2 * error(&even), "{} {}", error(&film), error(&even));
}

/// Were pixels that miss what is rare at first left as they are, the mean would be too low: light of a hundredth of each
/// pixel's time, at 64 runs on average, lost a third. With a say of their neighbours alone it loses 7 %, by way of
/// neighbours whose further runs were due to the pixel's own. 40 000 pixels: the mean's standard error is below 1.3 %.
#[test]
fn spending_runs_where_they_help_keeps_rare_light() {
    let rare = |x: f64, y: f64, t: f64| {
        let phase = (x.floor() * 0.618_034 + y.floor() * 0.414_214).fract();
        if (t - phase).rem_euclid(1.0) < 0.01 { 10.0 } else { 0.0 }
    };
    let film = sampled(&Shown(rare), Goal::Mean(64), (200, 200), None, Lines::All);
    let mean = film.pixels().iter().map(|p| f64::from(p.radiance.x)).sum::<f64>() / 40_000.0;
    assert!((mean / 0.1 - 1.0).abs() < 0.12, "{mean}");
}

#[test]
fn a_picture_stops_when_its_relative_error_is_small_enough_and_not_much_later() {
    let film = sampled(&Shown(disk), Goal::Until(0.01), (64, 48), None, Lines::All);
    let reached = relative_error(&film);
    assert!(reached <= 0.01 && reached > 0.006, "{reached}");
    // The estimate is honest: the true error is near it. Some 300 pixels of the rim vary.
    let fine = sampled(&Shown(disk), Goal::Passes(70), (64, 48), None, Lines::All);
    let squares = film.pixels().iter().zip(fine.pixels()).map(|(a, b)| {
        let (a, b) = (f64::from(a.radiance.x), f64::from(b.radiance.x));
        (a - b).powi(2) / (b * b + 0.01)
    });
    let truth = (squares.sum::<f64>() / (64.0 * 48.0)).sqrt();
    assert!((0.5..1.5).contains(&(truth / reached)), "{truth} {reached}");
}

#[test]
fn what_is_never_finite_costs_no_more_than_the_fewest_runs() {
    let film = sampled(&Shown(|_, _, _| f64::NAN), Goal::Error(0.01), (16, 16), None, Lines::All);
    assert!(film.pixels().iter().all(|pixel| pixel.rejected == LEAST_RUNS && pixel.runs == 0));
}

#[test]
fn designs_that_cannot_grow_and_parts_out_of_range_are_refused() {
    assert!(asked(Goal::Error(0.01)).check(Kind::Auto, Dither::default()).is_ok());
    assert!(asked(Goal::Error(0.0)).check(Kind::Auto, Dither::default()).is_err());
    assert!(asked(Goal::Error(0.01)).check(Kind::Orthogonal, Dither::default()).is_err());
    assert!(Adaptive { most_runs: 8, ..asked(Goal::Error(0.01)) }.check(Kind::Auto, Dither::NONE).is_err());
    let ordered = Dither { mask: Mask::Ordered, ..Dither::default() };
    assert!(asked(Goal::Error(0.01)).check(Kind::Auto, ordered).is_err());
}

/// With time for all blocks a forecast has sampled what the picture takes, and knows it; with none it says nothing.
#[test]
fn a_forecast_of_all_blocks_is_what_the_picture_takes() {
    let filter = Filter::new("box".parse().unwrap());
    let pass = Pass { footprint: Footprint::PROGRESSIVE, filter: &filter, lines: Lines::All, number: 3 };
    let options = DesignOptions { seed: 9, ..DesignOptions::default() };
    let size = (200, 90);
    let crop = Window { x: 21, y: 3, width: 170, height: 80 };
    let look = |goal, window, budget_s| {
        let drawn = (&options, &FACTORS[..]);
        outlook::forecast(&Shown(disk), drawn, &asked(goal), &pass, (window, size), budget_s)
    };
    for goal in [Goal::Error(0.02), Goal::Mean(32), Goal::Until(0.05), Goal::Passes(9)] {
        for window in [Window::whole(size.0, size.1), crop] {
            let mut film = Film::new(size.0, size.1, Some(window)).unwrap();
            let progress = Progress::default();
            integrate(&Shown(disk), (&options, &FACTORS), &asked(goal), &pass, &mut film, None, &progress).unwrap();
            let all = look(goal, window, 1e6);
            assert_eq!((all.samples, all.samples_tried), (progress.samples(), progress.samples()), "{goal:?}");
            assert!(all.render_s > 0.0 && all.standard_error_s <= 0.0, "{goal:?} {all:?}");
            // Eight blocks of 78 or 66: most of them do not see the disk.
            let few = look(goal, window, 1e-9);
            assert!(few.samples_tried < few.samples && few.standard_error_s > 0.0, "{goal:?} {few:?}");
            assert_eq!(look(goal, window, 0.0), Forecast::default());
        }
    }
    // A single block is all of its picture.
    let one = look(Goal::Error(0.02), Window { x: 17, y: 17, width: 8, height: 9 }, 1e6);
    assert!(one.samples > 0 && one.standard_error_s <= 0.0, "{one:?}");
    let in_time = look(Goal::Within(7.0), crop, 1e-9);
    assert!(in_time.samples > 0 && (in_time.render_s - 7.0).abs() < 1e-9, "{in_time:?}");
}

/// A hundredth of the picture holds most of its work: two dozen draws among 512 cells, where the work is, tell it nearly.
#[test]
fn a_forecast_finds_the_few_places_that_hold_the_work() {
    let fine = |x: f64, y: f64, _: f64| {
        let seen = (x - 70.0).powi(2) + (y - 30.0).powi(2) < 36.0;
        if seen && (7.0 * x).sin() * (9.0 * y).sin() > 0.0 { 0.8 } else { 0.1 }
    };
    let filter = Filter::new("box".parse().unwrap());
    let pass = Pass { footprint: Footprint::PROGRESSIVE, filter: &filter, lines: Lines::All, number: 3 };
    let (options, size) = (DesignOptions { seed: 9, ..DesignOptions::default() }, (128, 64));
    let asked = asked(Goal::Error(0.004));
    let shown = Window::whole(size.0, size.1);
    let mut film = Film::new(size.0, size.1, None).unwrap();
    let progress = Progress::default();
    integrate(&Shown(fine), (&options, &FACTORS), &asked, &pass, &mut film, None, &progress).unwrap();
    let told = outlook::forecast(&Shown(fine), (&options, &FACTORS), &asked, &pass, (shown, size), 1e-9);
    #[allow(clippy::cast_precision_loss, reason = "counts of samples")]
    let ratio = told.samples as f64 / progress.samples() as f64;
    assert!(progress.samples() > 2 * u64::from(LEAST_RUNS) * 128 * 64, "the disk is to hold most of the work");
    assert!(told.standard_error_s > 0.0 && (0.75..1.33).contains(&ratio), "{ratio} {told:?}");
}
