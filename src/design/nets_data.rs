//! Generator matrices found by search.

/// Matrices of one set, one after the other.
pub(crate) struct Set {
    /// Bits of the run's index, columns of each matrix.
    pub(crate) bits: u32,
    /// Columns of all matrices, the first digit in bit 15.
    pub(crate) columns: &'static [u16],
}

/// Sets tuned each for 2^bits runs alone.
pub(crate) static STRONG: &[Set] = &[];

/// Sets tuned for all prefixes up to 2^bits runs.
pub(crate) static NESTED: &[Set] = &[];
