//! Writes the project's own glTF files: `cargo run --release --example make_scenes [folder]`.
//!
//! The folder (by default the current one) receives `scenes/*.glb` and `animations/*.glb`. The files are a pure
//! function of this program: running it again gives the same bytes, which `tests/content.rs` checks.

#[path = "make_scenes/mod.rs"]
mod make;

use std::path::PathBuf;

#[allow(clippy::print_stdout, reason = "a command-line tool reports what it wrote")]
fn main() -> std::io::Result<()> {
    let root = PathBuf::from(std::env::args_os().nth(1).unwrap_or_else(|| ".".into()));
    let only = std::env::args().nth(2);
    for shot in make::SHOTS {
        if only.as_ref().is_some_and(|name| !shot.path.contains(name.as_str())) {
            continue;
        }
        let path = root.join(shot.path);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let bytes = (shot.make)();
        std::fs::write(&path, &bytes)?;
        println!("{:8} bytes  {}", bytes.len(), shot.path);
    }
    Ok(())
}
