//! `graeco sheet`: a folder of files in, contact sheets out.

use super::shot_args::{ShotArgs, number};
use clap::{Args, ValueHint};
use graeco::output::{FieldFiles, Picture, file};
use graeco::render::{FrameList, Progress, Shot};
use graeco::study::sheet::{Cell, Layout, cell, files, page_path};
use graeco::{Error, Result};
use std::path::{Path, PathBuf};

/// Arguments of `graeco sheet`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:
  graeco sheet models/ -o sheet.png
  graeco sheet models/ -o sheet.png --columns 4 --cell 320x240 --runs 64 --environment studio.hdr

Each cell shows the file's own camera, or one that sees everything, in the middle of its animation, exposed so that the
95th percentile of the lit pixels' luminance is 0.8 (the stops that this took stand below it), through the view
khronos-neutral. A file that cannot be shown gets its cell with the reason.")]
pub(crate) struct SheetArgs {
    #[command(flatten)]
    pub(crate) shot: ShotArgs,

    /// The sheet, a PNG; where it takes several pages they are numbered: sheet-01.png
    #[arg(short, long, value_name = "FILE.png", value_hint = ValueHint::FilePath)]
    pub(crate) output: PathBuf,

    /// Cells in a row
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) columns: u16,

    /// Rows of a page
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) rows: u16,

    /// Frame to show [default: the middle of each animation]
    #[arg(long, value_name = "N", allow_hyphen_values = true)]
    pub(crate) frame: Option<i64>,

    /// Brightens every cell by this many stops [default: each as it needs]
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = number)]
    pub(crate) exposure: Option<f64>,
}

/// Makes the sheets; files that fail are named on the error stream and shown with their sentence.
pub(crate) fn run(args: &SheetArgs) -> Result<()> {
    let cell_size = args.shot.size.unwrap_or((160, 120));
    let layout = Layout { columns: usize::from(args.columns), rows: usize::from(args.rows), cell: cell_size };
    if cell_size.0.max(cell_size.1) > 4096 {
        return Err(Error::invalid("--cell", "expected at most 4096 pixels a side"));
    }
    if !args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) {
        return Err(Error::invalid(args.output.display().to_string(), "expected a file named .png"));
    }
    args.shot.set_threads()?;
    let folder = &args.shot.scene;
    let found = files(folder)?;
    if found.is_empty() {
        return Err(Error::invalid(folder.display().to_string(), "there is no .gltf or .glb file in it"));
    }
    let pages = found.len().div_ceil(layout.page());
    let (mut failed, mut done) = (0, 0);
    for (page, paths) in found.chunks(layout.page()).enumerate() {
        let cells: Vec<Cell> = paths
            .iter()
            .map(|path| {
                let cell = cell(folder, path, args.exposure, || args.render(path, cell_size));
                if let Err(sentence) = &cell.content {
                    failed += 1;
                    eprintln!("{}: {sentence}", cell.name);
                }
                cell
            })
            .collect();
        let title = format!(
            "{}: {} to {} of {} files",
            folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy(),
            done + 1,
            done + cells.len(),
            found.len()
        );
        done += cells.len();
        let path = page_path(&args.output, page, pages);
        file::make_folder_of(&path)?;
        file::write_whole(&path, &layout.draw(&cells, &title)?)?;
        eprintln!("{}: {title}", path.display());
    }
    if failed > 0 {
        eprintln!("{failed} of {} files cannot be shown", found.len());
    }
    Ok(())
}

impl SheetArgs {
    fn render(&self, path: &Path, size: (u32, u32)) -> Result<Picture> {
        let shot = ShotArgs { scene: path.to_path_buf(), size: Some(size), ..self.shot.clone() };
        let (settings, scene, environment) = (shot.settings(), shot.load()?, shot.environment()?);
        let surroundings = shot.surroundings(&scene, environment.as_ref());
        let mut shot = Shot::new(&scene, &settings, &surroundings, "sheet")?;
        let frames = FrameList::of_animation(shot.span(), settings.rate);
        let number = self.frame.unwrap_or(frames.frames()[frames.frames().len() / 2]);
        let stopped = || Error::invalid("sheet", "the rendering was interrupted");
        let frame = shot.render(number, &Progress::default())?.ok_or_else(stopped)?;
        shot.pictures(number, &frame, FieldFiles::Woven)?.pop().ok_or_else(stopped)
    }
}
