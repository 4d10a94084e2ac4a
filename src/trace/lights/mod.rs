//! See the module list in `trace`.
