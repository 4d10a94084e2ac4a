//! Hard cases stay numerically stable: each module names what could blow up, the bound that holds and why, and plants
//! the naive formula, which its data must catch.

mod geometry;
mod light;
mod materials;
mod motion_bounds;
mod self_intersection;
mod support;
mod watertight;
