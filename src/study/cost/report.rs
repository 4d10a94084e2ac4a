//! The study's files: raw numbers as CSV and JSON, plots as SVG, and one HTML page that needs no network.

use super::pictures::{base64, difference, exposure, narrow, shown};
use super::plots::{Cost, Measure, plot, short};
use super::statistics::{Curve, Interval, Reach};
use super::without::Effect;
use super::{Effort, Measurement, Study};
use crate::{Error, Result};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// What the scene costs without some effects.
#[derive(Debug, Clone, Serialize)]
pub struct Price {
    /// Effects left out; none of them for the whole scene.
    pub without: Vec<Effect>,
    /// Error against cost.
    pub study: Study,
}

impl Price {
    /// What is left out, in words.
    #[must_use]
    pub fn name(&self) -> String {
        Self::name_of(&self.without)
    }

    /// The same of a list of effects.
    #[must_use]
    pub fn name_of(without: &[Effect]) -> String {
        let names: Vec<&str> = without.iter().map(|e| e.name()).collect();
        if names.is_empty() { "everything".to_owned() } else { format!("without {}", names.join(", ")) }
    }
}

/// All that was measured, with what it was measured of.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The scene's file name.
    pub scene: String,
    /// The frame.
    pub frame: i64,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Threads.
    pub threads: usize,
    /// How the reference came about, one sentence.
    pub reference: String,
    /// How much was measured.
    pub effort: Effort,
    /// By design.
    pub designs: Study,
    /// By effect; the whole scene first. Empty if it was not asked for.
    pub prices: Vec<Price>,
}

impl Report {
    /// Writes cost.csv, cost.json, the plots and report.html into `folder`.
    ///
    /// # Errors
    /// If a file cannot be written or a picture not be encoded.
    pub fn save(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let save = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|e| Error::io(&path, "write", e))
        };
        save("cost.csv", &self.csv())?;
        let json = serde_json::to_string_pretty(self)
            .map_err(|e| Error::invalid("cost.json", format!("cannot be written: {e}")))?;
        save("cost.json", &json)?;
        let mut plots = Vec::new();
        for measure in [Measure::RelMse, Measure::Rmse, Measure::Flip] {
            for (cost, word) in [(Cost::Seconds, "seconds"), (Cost::Samples, "samples")] {
                let svg = plot(&self.designs.curves, cost, measure)?;
                save(&format!("{}-{word}.svg", measure.name().to_lowercase()), &svg)?;
                plots.push(svg);
            }
        }
        let effects = self.price_curves();
        let priced = if effects.is_empty() { None } else { Some(plot(&effects, Cost::Seconds, Measure::RelMse)?) };
        if let Some(svg) = &priced {
            save("effects.svg", svg)?;
        }
        save("report.html", &self.html(&plots, priced.as_deref())?)
    }

    fn price_curves(&self) -> Vec<Curve> {
        let named =
            |p: &Price| p.study.curves.iter().map(|c| Curve { name: p.name(), ..c.clone() }).collect::<Vec<_>>();
        self.prices.iter().flat_map(named).collect()
    }

    fn csv(&self) -> String {
        let mut out =
            String::from("part,name,runs,seed,samples,rays,seconds,wall_s,build_s,mse,rmse,rel_mse,rel_mse_raw,flip\n");
        let mut row = |part: &str, name: &str, m: &Measurement| {
            let e = &m.errors;
            let _ = writeln!(
                out,
                "{part},{name},{},{},{},{},{:.6},{:.6},{:.6},{:e},{:e},{:e},{:e},{:.6}",
                m.runs,
                m.seed,
                m.samples,
                m.rays,
                m.seconds,
                m.wall_s,
                m.build_s,
                e.mse,
                e.rmse,
                e.rel_mse,
                e.rel_mse_raw,
                e.flip
            );
        };
        for m in &self.designs.measurements {
            row("design", &m.name, m);
        }
        for price in &self.prices {
            let name = price.name().replace(", ", "+");
            for m in &price.study.measurements {
                row("effect", &name, m);
            }
        }
        out
    }

    fn html(&self, plots: &[String], priced: Option<&str>) -> Result<String> {
        let mut page = String::from(include_str!("head.html"));
        let (w, h) = self.size;
        let scene = escaped(&self.scene);
        let _ = write!(
            page,
            "<h1>What accuracy costs: {scene}</h1><p class=lead>Frame {} at {w} × {h}, {} threads, {} seeds. \
             Reference: {}. Seconds are processor seconds over threads; bands and intervals are 95 % (Student) over \
             seeds.</p>",
            self.frame,
            self.threads,
            self.effort.seeds,
            escaped(&self.reference)
        );
        page.push_str("<h2>Error against cost</h2>");
        page.push_str(&tabs(&[
            ("relMSE / seconds", &plots[0]),
            ("relMSE / samples", &plots[1]),
            ("RMSE / seconds", &plots[2]),
            ("RMSE / samples", &plots[3]),
            ("FLIP / seconds", &plots[4]),
            ("FLIP / samples", &plots[5]),
        ]));
        page.push_str(&curve_table(&self.designs.curves, &self.effort.reach));
        if let Some(svg) = priced {
            page.push_str("<h2>What each effect costs</h2>");
            page.push_str(&self.price_table());
            page.push_str(svg);
        }
        page.push_str("<h2>Pictures</h2>");
        page.push_str(&self.slider()?);
        page.push_str("</main></body></html>\n");
        Ok(page)
    }

    fn price_table(&self) -> String {
        let target = self.effort.reach.first().copied().unwrap_or(1e-3);
        let reach = |p: &Price| p.study.curves.first().and_then(|c| c.reach.first().copied());
        let Some(whole) = self.prices.first().and_then(reach) else {
            return "<p>The measured errors do not fall: no price can be given.</p>".to_owned();
        };
        let mut out = format!(
            "<p>Seconds to relMSE {}, each scene against a reference of its own. The price is what leaving the effect \
             out saves.</p><table><tr><th>scene</th><th>seconds</th><th>95 %</th><th>samples a pixel</th>\
             <th>price, seconds</th><th class=bar></th></tr>",
            short(target)
        );
        let most = self.prices.iter().filter_map(reach).map(|r| r.seconds.mean).fold(whole.seconds.mean, f64::max);
        for (index, price) in self.prices.iter().enumerate() {
            let name = price.name();
            let Some(r) = reach(price) else {
                let _ = write!(out, "<tr><td>{name}</td><td colspan=5>cannot be given</td></tr>");
                continue;
            };
            let saved = if index == 0 { String::new() } else { short(whole.seconds.mean - r.seconds.mean) };
            let _ = write!(
                out,
                "<tr><td>{name}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{saved}</td>\
                 <td class=bar><i style='width:{:.1}%'></i></td></tr>",
                reach_text(&r),
                ends(&r.seconds),
                short(r.runs.mean),
                100.0 * r.seconds.mean / most
            );
        }
        out + "</table>"
    }

    /// Two pictures over each other with a slider between them, as pictures or as errors.
    fn slider(&self) -> Result<String> {
        let reference = &self.designs.reference;
        let stops = exposure(reference);
        let uri = |png: &[u8]| format!("data:image/png;base64,{}", base64(png));
        let original = uri(&shown(&narrow(reference), reference.width, stops)?);
        let mut list = vec![serde_json::json!({ "name": "reference", "picture": original, "error": original })];
        /// Relative error shown brightest: a quarter of a pixel's own value.
        const BRIGHTEST: f64 = 0.25;
        for (name, runs, picture) in &self.designs.shown {
            list.push(serde_json::json!({
                "name": format!("{name}, {runs} samples a pixel"),
                "picture": uri(&shown(&picture.rgb, picture.width, stops)?),
                "error": uri(&difference(picture, reference, BRIGHTEST)?),
            }));
        }
        let data = serde_json::Value::Array(list).to_string().replace('<', "\\u003c");
        Ok(format!(
            "<p>Drag to uncover. Errors are relative to the reference, from black (none) to pale yellow (25 %).</p>{}\
             <script>const pictures={data};\n{}</script>",
            include_str!("slider.html"),
            include_str!("slider.js")
        ))
    }
}

fn tabs(pages: &[(&str, &String)]) -> String {
    let mut out = String::from("<div class=tabs>");
    for (index, (name, svg)) in pages.iter().enumerate() {
        let checked = if index == 0 { " checked" } else { "" };
        let _ = write!(
            out,
            "<input type=radio name=plot id=plot{index}{checked}><label for=plot{index}>{name}</label><figure>{svg}\
             </figure>"
        );
    }
    out + "</div>"
}

fn curve_table(curves: &[Curve], reach: &[f64]) -> String {
    let mut out = String::from("<table><tr><th>design</th><th>slope in samples</th><th>slope in seconds</th>");
    for target in reach {
        let _ = write!(out, "<th>seconds to relMSE {}</th><th>95 %</th>", short(*target));
    }
    out.push_str("</tr>");
    for curve in curves {
        let slope = |s: Option<Interval>| {
            s.map_or("–".to_owned(), |i| format!("{:.2} <small>[{:.2}, {:.2}]</small>", i.mean, i.low, i.high))
        };
        let _ = write!(
            out,
            "<tr><td>{}</td><td class=n>{}</td><td class=n>{}</td>",
            escaped(&curve.name),
            slope(curve.slope_samples),
            slope(curve.slope_seconds)
        );
        for target in reach {
            match curve.reach.iter().find(|r| r.rel_mse.to_bits() == target.to_bits()) {
                Some(r) => {
                    let _ = write!(out, "<td class=n>{}</td><td class=n>{}</td>", reach_text(r), ends(&r.seconds));
                }
                None => out.push_str("<td>–</td><td></td>"),
            }
        }
        out.push_str("</tr>");
    }
    out + "</table><p><small>* continued beyond what was measured along the fitted slope.</small></p>"
}

fn reach_text(r: &Reach) -> String {
    format!("{}{}", short(r.seconds.mean), if r.extrapolated { "*" } else { "" })
}

fn ends(i: &Interval) -> String {
    // Beyond three powers of ten either way the seeds agree on nothing.
    if i.high > 1e3 * i.mean {
        return "<small>not known</small>".to_owned();
    }
    format!("<small>{} – {}</small>", short(i.low), short(i.high))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
