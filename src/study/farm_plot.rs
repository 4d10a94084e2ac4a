//! The plot of `graeco study farm`: time to deliver against machines, a line a length of task.

use super::farm::{Delivery, Farm};
use crate::{Error, Result};
use plotters::prelude::*;
use std::collections::BTreeMap;

/// Numbers of machines to plot: four to the decade.
#[must_use]
pub fn counts(most: u32) -> Vec<usize> {
    let mut out: Vec<usize> = Vec::new();
    for quarter in 0.. {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below most")]
        let count = libm::pow(10.0, f64::from(quarter) / 4.0).round().min(f64::from(most)) as usize;
        if out.last() != Some(&count) {
            out.push(count);
        }
        if count >= most as usize {
            break;
        }
    }
    out
}

/// Draws all deliveries as an SVG.
///
/// # Errors
/// If the plot cannot be drawn, or there is nothing to draw.
pub fn draw(all: &[Delivery], farm: &Farm) -> Result<String> {
    let mut svg = String::new();
    plot(all, farm, &mut svg).map_err(|e| Error::invalid("farm.svg", format!("cannot be drawn: {e}")))?;
    Ok(svg)
}

/// A length of time in the unit that suits it.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.0} s"),
        s if s < 3600.0 => format!("{:.0} min", s / 60.0),
        s if s < 2.0 * 86_400.0 => format!("{:.0} h", s / 3600.0),
        s => format!("{:.0} days", s / 86_400.0),
    }
}

/// Lengths that stand apart on a logarithmic axis.
const TICKS: [f64; 10] = [1.0, 10.0, 60.0, 600.0, 3600.0, 36_000.0, 86_400.0, 864_000.0, 8_640_000.0, 86_400_000.0];

#[allow(clippy::cast_precision_loss, reason = "counts of machines")]
fn plot(all: &[Delivery], farm: &Farm, svg: &mut String) -> std::result::Result<(), Box<dyn std::error::Error>> {
    const COLOURS: [RGBColor; 6] = [
        RGBColor(213, 94, 0),
        RGBColor(230, 159, 0),
        RGBColor(0, 158, 115),
        RGBColor(86, 180, 233),
        RGBColor(0, 114, 178),
        RGBColor(120, 94, 240),
    ];
    let mut lines: BTreeMap<u64, Vec<(f64, f64)>> = BTreeMap::new();
    let mut fastest: BTreeMap<usize, f64> = BTreeMap::new();
    for d in all {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "milliseconds order the lines")]
        lines.entry((d.task_s * 1e3) as u64).or_default().push((d.machines as f64, d.total_s));
        let least = fastest.entry(d.machines).or_insert(f64::INFINITY);
        *least = least.min(d.total_s);
    }
    let most = all.iter().map(|d| d.machines).max().ok_or("nothing to draw")? as f64;
    let longest = all.iter().map(|d| d.total_s).fold(0.0, f64::max);
    let shortest = fastest.values().copied().fold(longest, f64::min);
    let one = fastest.first_key_value().map_or(longest, |(n, s)| *n as f64 * s);
    let root = SVGBackend::with_string(svg, (960, 620)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(format!("Time to deliver the shot, by machines of {} cores", farm.cores), ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d((1.0..most * 1.2).log_scale(), (shortest * 0.5..longest * 1.6).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("machines")
        .y_desc("time to deliver")
        .y_label_formatter(&|y| time(*y))
        .light_line_style(RGBColor(244, 244, 244))
        .draw()?;
    // Round lengths of time, which a decimal axis does not have.
    for tick in TICKS.into_iter().filter(|t| (shortest..longest).contains(t)) {
        let at = [(1.0, tick), (most * 1.2, tick)];
        chart.draw_series(LineSeries::new(at, RGBColor(215, 215, 215).stroke_width(1)))?;
        let label =
            Text::new(time(tick), (most * 0.72, tick), ("sans-serif", 12).into_font().color(&RGBColor(130, 130, 130)));
        chart.draw_series(std::iter::once(label))?;
    }
    let grey = RGBColor(150, 150, 150);
    let ideal = fastest.keys().map(|&n| (n as f64, one / n as f64)).filter(|p| p.1 > shortest * 0.5);
    chart
        .draw_series(LineSeries::new(ideal, grey.stroke_width(1)))?
        .label("one machine's time / machines")
        .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], grey.stroke_width(1)));
    let shown: Vec<(&u64, &Vec<(f64, f64)>)> =
        lines.iter().step_by(lines.len().div_ceil(COLOURS.len()).max(1)).collect();
    for ((&task, points), colour) in shown.into_iter().zip(COLOURS) {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?
            .label(format!("tasks of {}", time(task as f64 / 1e3)))
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    let points = fastest.iter().map(|(&n, &s)| (n as f64, s));
    chart
        .draw_series(points.map(|p| Circle::new(p, 4, BLACK.filled())))?
        .label("the best of all lengths tried")
        .legend(|(x, y)| Circle::new((x + 9, y), 4, BLACK.filled()));
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.9))
        .border_style(RGBColor(200, 200, 200))
        .draw()?;
    root.present()?;
    Ok(())
}
