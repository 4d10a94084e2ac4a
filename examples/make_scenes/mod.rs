//! The shots and the small toolkit that they are made of.
//!
//! `builder` writes glTF; `node`, `paint` and `track` describe what goes into it; `shape` and `sweep` make meshes;
//! `canvas` and `digits` make pictures. Every elementary function goes through `libm`, so that the bytes do not depend
//! on the platform's mathematics.

mod builder;
mod canvas;
mod colour;
mod dice;
mod digits;
mod node;
mod paint;
mod set;
mod shape;
mod sweep;
mod track;

mod blur_row;
mod cornell;
mod fan;
mod field;
mod forest;
mod hard_lights;
mod lens;
mod mirror;
mod newton;
mod pool;
mod still_life;
mod walker;

/// A file that the generator writes.
pub(crate) struct Shot {
    /// Where, relative to the crate's root.
    pub(crate) path: &'static str,
    /// Its bytes: a binary glTF file.
    pub(crate) make: fn() -> Vec<u8>,
}

/// Every file, in the order of the READMEs.
pub(crate) const SHOTS: &[Shot] = &[
    Shot { path: "scenes/still_life.glb", make: still_life::make },
    Shot { path: "scenes/cornell.glb", make: cornell::make },
    Shot { path: "scenes/lens.glb", make: lens::make },
    Shot { path: "scenes/hard_lights.glb", make: hard_lights::make },
    Shot { path: "animations/pool.glb", make: pool::make },
    Shot { path: "animations/fan.glb", make: fan::make },
    Shot { path: "animations/mirror.glb", make: mirror::make },
    Shot { path: "animations/walker.glb", make: walker::make },
    Shot { path: "animations/forest.glb", make: forest::make },
    Shot { path: "animations/blur_row.glb", make: blur_row::make },
    Shot { path: "animations/newton.glb", make: newton::make },
    Shot { path: "animations/field.glb", make: field::make },
];
