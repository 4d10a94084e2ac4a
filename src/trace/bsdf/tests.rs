//! Furnaces, and sampling against evaluation.
