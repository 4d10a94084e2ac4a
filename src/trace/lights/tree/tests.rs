//! The tree: probabilities.
