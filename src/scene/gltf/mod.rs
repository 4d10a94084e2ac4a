//! Import of glTF 2.0.
