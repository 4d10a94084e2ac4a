//! The comparison's files: a labelled strip of pictures, the table as CSV and JSON, and a page.

use super::{Method, Study};
use crate::output::compare::map_codes;
use crate::output::flip;
use crate::output::view::View;
use crate::study::cost::pictures::base64;
use crate::study::poster::{LETTER, LINE, Poster, wrapped};
use crate::study::sheet::exposure;
use crate::{Error, Result};
use std::fmt::Write as _;
use std::path::Path;

const GAP: usize = 8;

impl Study {
    /// Writes mirror.png, mirror.csv, mirror.json and mirror.html into `folder`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn save(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        let save = |name: &str, bytes: &[u8]| {
            let path = folder.join(name);
            std::fs::write(&path, bytes).map_err(|e| Error::io(&path, "write", e))
        };
        let json = serde_json::to_string_pretty(self)
            .map_err(|e| Error::invalid("mirror.json", format!("cannot be written: {e}")))?;
        let strip = self.strip()?;
        save("mirror.csv", self.csv().as_bytes())?;
        save("mirror.json", json.as_bytes())?;
        save("mirror.png", &strip)?;
        save("mirror.html", self.page(&strip).as_bytes())
    }

    /// The way called `kind`, at the runs that the study is about.
    fn shown(&self, kind: &str) -> Option<&Method> {
        self.methods.iter().find(|m| m.name.starts_with(kind) && m.runs == self.effort.runs)
    }

    /// Above: reference, time sampled, post-filter, frozen. Below: where each differs, as ꟻLIP from 0 (dark) to 1.
    ///
    /// # Errors
    /// If the encoder refuses.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes from 0 to 255")]
    pub fn strip(&self) -> Result<Vec<u8>> {
        let view = View { exposure_ev: exposure(&self.reference), ..View::default() };
        let codes = |rgb: &[[f32; 3]]| -> Vec<[u8; 3]> {
            rgb.iter().map(|&p| view.encode(p).to_array().map(|c| (c * 255.0 + 0.5) as u8)).collect()
        };
        let wide = |rgb: &[[f32; 3]]| -> Vec<[f64; 3]> { rgb.iter().map(|p| p.map(f64::from)).collect() };
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let ways: Vec<&Method> =
            ["time sampled", "post-filter", "frozen"].iter().filter_map(|k| self.shown(k)).collect();
        let row = height + LINE + GAP;
        let across = (width.max(LETTER * 24) + GAP) * (ways.len() + 1) + GAP;
        let mut poster = Poster::new(across, 2 * row + GAP, [255; 3]);
        let words = format!("mean of {} frozen pictures", self.effort.instants);
        let label = |poster: &mut Poster, text: &str, at: [usize; 2]| {
            for line in wrapped(text, width.max(LETTER * 24) / LETTER, 1) {
                poster.write(&line, at, [20; 3]);
            }
        };
        poster.paste(&codes(&self.reference), width, [GAP, GAP], 1);
        label(&mut poster, &words, [GAP, GAP + height]);
        label(&mut poster, "below: FLIP of each,", [GAP, GAP + row]);
        label(&mut poster, "dark 0, pale 1", [GAP, GAP + row + LINE]);
        for (i, way) in ways.iter().enumerate() {
            let x = GAP + (i + 1) * (width.max(LETTER * 24) + GAP);
            poster.paste(&codes(&way.rgb), width, [x, GAP], 1);
            label(&mut poster, &way.name, [x, GAP + height]);
            let map = flip::hdr(&wide(&way.rgb), &wide(&self.reference), width);
            poster.paste(&map_codes(&map, 1.0), width, [x, GAP + row], 1);
            label(&mut poster, &format!("mean {:.4}", way.errors.flip), [x, GAP + row + height]);
        }
        poster.png()
    }

    /// The table, a row a way; errors over each object's pixels at the end.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut out = String::from("method,runs,seconds,rmse,rel_mse,flip");
        for (name, _) in &self.objects {
            let _ = write!(out, ",\"rmse {}\"", name.replace('"', "\"\""));
        }
        out.push('\n');
        for m in &self.methods {
            let e = &m.errors;
            let name = &m.name;
            let _ = write!(out, "\"{name}\",{},{:.4},{:e},{:e},{:.6}", m.runs, m.seconds, e.rmse, e.rel_mse, e.flip);
            for rmse in &m.by_object {
                let _ = write!(out, ",{rmse:e}");
            }
            out.push('\n');
        }
        out
    }

    /// The table in Markdown, as it is printed.
    #[must_use]
    pub fn table(&self) -> String {
        let mut out = String::from("| | RMSE | relMSE | FLIP |");
        for (name, share) in &self.objects {
            let _ = write!(out, " RMSE, {name} ({:.0} %) |", 100.0 * share);
        }
        let _ = write!(out, "\n|-|{}\n", "-|".repeat(3 + self.objects.len()));
        for m in &self.methods {
            let e = &m.errors;
            let _ = write!(out, "| {} | {:.5} | {:.6} | {:.4} |", m.name, e.rmse, e.rel_mse, e.flip);
            for rmse in &m.by_object {
                let _ = write!(out, " {rmse:.5} |");
            }
            out.push('\n');
        }
        out
    }

    fn page(&self, strip: &[u8]) -> String {
        let escaped = |t: &str| t.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let mut rows = String::new();
        for (i, line) in self.table().lines().enumerate().filter(|(i, _)| *i != 1) {
            let cell = if i == 0 { "th" } else { "td" };
            let cells = line.trim_matches('|').split('|').map(|c| format!("<{cell}>{}", escaped(c.trim())));
            let _ = writeln!(rows, "<tr>{}</tr>", cells.collect::<String>());
        }
        format!(
            "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Moving mirrors: {0}</title>\n\
             <style>{STYLE}</style>\n<h1>Moving mirrors: {0}, frame {1}</h1>\n<p>{EXPLANATION}</p>\n\
             <img alt=\"reference, time sampled, post-filter, frozen; FLIP maps below\" \
             src=\"data:image/png;base64,{2}\">\n<table>{rows}</table>\n<p>The reference is the mean of two halves of {3} \
             frozen pictures, {4} runs a pixel each; its own RMSE, {5:.5}, is subtracted in quadrature, and FLIP between \
             the halves is {6:.4}. Columns on the right: the pixels that show each object in the middle of the \
             exposure.</p>\n</html>\n",
            escaped(&self.scene),
            self.frame,
            base64(strip),
            self.effort.instants,
            self.effort.instant_runs,
            self.reference_rmse,
            self.reference_flip
        )
    }
}

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;margin:2rem;color:#222;background:#fff}img{max-width:100%}\
    table{border-collapse:collapse}th,td{padding:.2rem .7rem;text-align:right;border-bottom:1px solid #ddd}\
    td:first-child,th:first-child{text-align:left}p{max-width:46rem}";

const EXPLANATION: &str = "One frame made three ways. <b>Time sampled</b>: every sample has its own instant. \
    <b>Post-filter</b>: a frozen picture, each object blurred along its own motion vectors and laid over what is behind \
    it (Potmesil and Chakravarty 1983). <b>Frozen</b>: no blur. What a mirror shows moves otherwise than the mirror, and \
    the filter cannot know: its error there stays, however many samples it gets.";
