//! Plots of the studies, as SVG.

use super::designs::Row;
use crate::design::Kind;
use crate::{Error, Result};
use plotters::prelude::*;

/// Colours that stay apart for most eyes (after Okabe and Ito 2008), and greys for what is no contender.
pub(super) const fn colour(kind: Kind) -> RGBColor {
    match kind {
        Kind::Random => RGBColor(150, 150, 150),
        Kind::Jittered => RGBColor(204, 121, 167),
        Kind::LatinHypercube => RGBColor(120, 94, 240),
        Kind::LatinSquare => RGBColor(230, 159, 0),
        Kind::Orthogonal => RGBColor(213, 94, 0),
        Kind::OrthogonalCorrelated => RGBColor(160, 60, 0),
        Kind::OrthogonalStrength3 => RGBColor(110, 70, 40),
        Kind::Sobol => RGBColor(0, 114, 178),
        Kind::PointDiffusion => RGBColor(150, 150, 60),
        Kind::PoissonDisk => RGBColor(100, 100, 60),
        Kind::Strong => RGBColor(0, 158, 115),
        Kind::Nested => RGBColor(86, 180, 233),
        Kind::Growing => RGBColor(0, 90, 140),
        Kind::Auto => RGBColor(0, 0, 0),
    }
}

/// The logarithmic mean of the variance ratio against runs, a line a design.
///
/// # Errors
/// If the plot cannot be drawn.
pub fn ratios(rows: &[Row]) -> Result<String> {
    let mut svg = String::new();
    draw(rows, &mut svg)
        .map_err(|e| Error::Invalid { what: "designs.svg".into(), problem: format!("cannot be drawn: {e}") })?;
    Ok(svg)
}

fn draw(rows: &[Row], svg: &mut String) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let runs = |f: fn(f64, f64) -> f64, start: f64| rows.iter().map(|r| f64::from(r.runs)).fold(start, f);
    let (few, many) = (runs(f64::min, f64::INFINITY), runs(f64::max, 1.0));
    let lowest = rows.iter().map(Row::log_mean).fold(1.0, f64::min);
    let root = SVGBackend::with_string(svg, (960, 600)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption("Variance relative to independent sampling (seven image functions)", ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((few * 0.9..many * 2.6).log_scale(), (lowest * 0.8..1.2).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("runs a pixel")
        .y_desc("variance ratio, logarithmic mean")
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.2}"))
        .light_line_style(RGBColor(240, 240, 240))
        .draw()?;
    for kind in Kind::ALL {
        let points: Vec<(f64, f64)> =
            rows.iter().filter(|r| r.kind == kind).map(|r| (f64::from(r.runs), r.log_mean())).collect();
        if points.is_empty() {
            continue;
        }
        let colour = colour(kind);
        let line = LineSeries::new(points.iter().copied(), colour.stroke_width(2));
        chart
            .draw_series(line)?
            .label(kind.name())
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(points.iter().map(|&p| Circle::new(p, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.9))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    root.present()?;
    Ok(())
}

/// Radial averages of power spectra: power over frequency for each design.
///
/// # Errors
/// If the plot cannot be drawn.
pub fn radial(title: &str, curves: &[(Kind, Vec<f64>)]) -> Result<String> {
    let mut svg = String::new();
    draw_radial(title, curves, &mut svg)
        .map_err(|e| Error::Invalid { what: "radial averages".into(), problem: format!("cannot be drawn: {e}") })?;
    Ok(svg)
}

fn draw_radial(
    title: &str,
    curves: &[(Kind, Vec<f64>)],
    svg: &mut String,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    /// Independent points have 1; nets peak beyond, and what is beyond this is cut.
    const HIGHEST_POWER: f64 = 2.5;
    let longest = curves.iter().map(|c| c.1.len()).max().unwrap_or(1);
    let root = SVGBackend::with_string(svg, (760, 420)).into_drawing_area();
    root.fill(&WHITE)?;
    #[allow(clippy::cast_precision_loss, reason = "a frequency")]
    let right = longest as f64;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(50)
        .build_cartesian_2d(0.0..right * 1.45, 0.0..HIGHEST_POWER)?;
    chart
        .configure_mesh()
        .x_desc("cycles a window")
        .y_desc("mean power (independent points: 1)")
        .x_label_formatter(&|x| if *x <= right { format!("{x:.0}") } else { String::new() })
        .light_line_style(RGBColor(244, 244, 244))
        .bold_line_style(RGBColor(226, 226, 226))
        .draw()?;
    for (kind, powers) in curves {
        let colour = colour(*kind);
        let points = (1_u32..).zip(powers).map(|(f, p)| (f64::from(f), p.min(HIGHEST_POWER)));
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
            .label(kind.name())
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
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
