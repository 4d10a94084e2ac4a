//! Light from infinitely far away.
