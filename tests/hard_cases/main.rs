//! Hard cases stay numerically stable: each module names what could blow up, the bound that holds and why, and plants
//! the naive formula, which its data must catch. `docs/numerics.md` tabulates them.

mod geometry;
mod light;
mod materials;
mod motion_bounds;
#[path = "../support/moving.rs"]
mod moving;
mod self_intersection;
mod support;
mod time;
mod transforms;
mod watertight;
