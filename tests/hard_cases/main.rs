//! Hard cases stay numerically stable: each module names what could blow up, the bound that holds and why, and plants
//! the naive formula, which its data must catch. `docs/numerics.md` tabulates them.
//!
//! An optimised build takes the numbers of the table (10⁷ rays, 10⁸ samples), one with debug assertions and overflow
//! checks a part of them.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a test fails by panicking, prints what it measured, holds exact values to exactness, and counts little"
)]

mod designs;
mod energy;
mod estimation;
#[path = "../support/flat.rs"]
mod flat;
mod geometry;
mod lens;
mod light;
mod materials;
mod media;
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
