//! Hard cases stay numerically stable: each module names what could blow up, the bound that holds and why, and plants
//! the naive formula, which its data must catch. `docs/numerics.md` tabulates them.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::float_cmp,
    reason = "a test fails by panicking, prints what it measured, and holds exact values to exactness"
)]

mod designs;
mod estimation;
mod geometry;
mod lens;
mod light;
mod materials;
mod motion_bounds;
#[path = "../support/moving.rs"]
mod moving;
mod paths;
mod pictures;
mod self_intersection;
#[path = "../support/shots.rs"]
mod shots;
mod support;
mod time;
mod transforms;
mod watertight;
