//! Error against cost, as SVG: both axes logarithmic, a band for each curve's interval over seeds.

use super::statistics::{Curve, CurvePoint, Interval};
use crate::design::Kind;
use crate::study::plots::colour;
use crate::{Error, Result};
use plotters::prelude::*;

/// What the horizontal axis counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cost {
    /// Processor seconds over threads.
    Seconds,
    /// Samples a pixel.
    Samples,
}

/// What the vertical axis measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Root of the mean squared error.
    Rmse,
    /// Relative mean squared error.
    RelMse,
    /// Mean ꟻLIP.
    Flip,
}

impl Measure {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rmse => "RMSE",
            Self::RelMse => "relMSE",
            Self::Flip => "FLIP",
        }
    }

    fn of(self, point: &CurvePoint) -> Interval {
        match self {
            Self::Rmse => point.rmse,
            Self::RelMse => point.rel_mse,
            Self::Flip => point.flip,
        }
    }
}

/// Colours after Okabe and Ito (2008) for curves that are no designs.
const OTHERS: [RGBColor; 6] = [
    RGBColor(0, 0, 0),
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(120, 94, 240),
];

/// The plot of `measure` over `cost`.
///
/// # Errors
/// If it cannot be drawn.
pub fn plot(curves: &[Curve], cost: Cost, measure: Measure) -> Result<String> {
    let mut svg = String::new();
    draw(curves, cost, measure, &mut svg)
        .map_err(|e| Error::invalid(format!("plot of {}", measure.name()), format!("cannot be drawn: {e}")))?;
    Ok(svg)
}

fn place(point: &CurvePoint, cost: Cost) -> f64 {
    match cost {
        Cost::Seconds => point.seconds.mean,
        Cost::Samples => f64::from(point.runs),
    }
}

/// Points that a logarithmic plot can show: place, value, low, high.
fn showable(curve: &Curve, cost: Cost, measure: Measure) -> Vec<[f64; 4]> {
    let value = |p: &CurvePoint| {
        let i = measure.of(p);
        // An interval that reaches zero goes down to a third of the mean here; the tables have its ends.
        [place(p, cost), i.mean, i.low.max(i.mean / 3.0), i.high]
    };
    curve.points.iter().map(value).filter(|v| v[0] > 0.0 && v[1] > 0.0).collect()
}

fn draw(
    curves: &[Curve],
    cost: Cost,
    measure: Measure,
    svg: &mut String,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let lines: Vec<Vec<[f64; 4]>> = curves.iter().map(|c| showable(c, cost, measure)).collect();
    let all = || lines.iter().flatten();
    let range = |low: usize, high: usize| {
        let (a, b) = all().fold((f64::INFINITY, 0.0_f64), |(a, b), p| (a.min(p[low]), b.max(p[high])));
        if a < b { (a, b) } else { (0.5 * b.max(1e-9), 2.0 * b.max(1e-9)) }
    };
    let ((left, right), (bottom, top)) = (range(0, 0), range(2, 3));
    let root = SVGBackend::with_string(svg, (760, 520)).into_drawing_area();
    root.fill(&WHITE)?;
    let beside = match cost {
        Cost::Seconds => "seconds (processor seconds over threads)",
        Cost::Samples => "samples a pixel",
    };
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .x_label_area_size(42)
        .y_label_area_size(70)
        .build_cartesian_2d((left * 0.85..right * 2.6).log_scale(), (bottom * 0.8..top * 1.2).log_scale())?;
    chart
        .configure_mesh()
        .x_desc(beside)
        .y_desc(measure.name())
        .x_label_formatter(&|x| short(*x))
        .y_label_formatter(&|y| short(*y))
        .light_line_style(RGBColor(240, 240, 240))
        .bold_line_style(RGBColor(220, 220, 220))
        .draw()?;
    for (number, (curve, line)) in curves.iter().zip(&lines).enumerate() {
        if line.is_empty() {
            continue;
        }
        let colour = curve
            .name
            .split(' ')
            .next()
            .and_then(|n| n.parse::<Kind>().ok())
            .map_or(OTHERS[number % OTHERS.len()], colour);
        let band: Vec<(f64, f64)> =
            line.iter().map(|p| (p[0], p[3])).chain(line.iter().rev().map(|p| (p[0], p[2]))).collect();
        chart.draw_series(std::iter::once(Polygon::new(band, colour.mix(0.13).filled())))?;
        let points = || line.iter().map(|p| (p[0], p[1]));
        chart
            .draw_series(LineSeries::new(points(), colour.stroke_width(2)))?
            .label(curve.name.clone())
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(points().map(|p| Circle::new(p, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.9))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 12))
        .draw()?;
    root.present()?;
    Ok(())
}

/// Three digits, without a row of zeros.
#[must_use]
pub fn short(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    match value.abs() {
        v if v < 1e-3 => format!("{value:.1e}"),
        v if v < 0.1 => format!("{value:.4}"),
        v if v < 10.0 => format!("{value:.2}"),
        _ => format!("{value:.0}"),
    }
}
