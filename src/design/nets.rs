//! Digital nets over GF(2): generator matrices, their tables, Sobol's sequence.
//!
//! A matrix is held by columns: `matrix[b]` is what bit b of the run's index adds (exclusive or) to the coordinate's
//! binary digits, the first digit in the most significant bit.

use super::nets_data;

/// Factors that the tuned sets cover: film x y, shutter, lens u v, then light u v, lobe u v, light u v, lobe u v.
pub const TUNED_FACTORS: usize = 13;

/// Index bits up to which sets are tuned (4096 runs).
pub const TUNED_BITS: u32 = 12;

/// One factor's generator matrix by columns, digits from the most significant bit.
pub type Matrix = Vec<u32>;

/// Primitive polynomials and initial direction numbers of dimensions 2 to 21: (degree, inner coefficients, mᵢ)
/// (Joe and Kuo 2008, the set new-joe-kuo-6).
const JOE_KUO: [(u32, u32, &[u32]); 20] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
    (4, 1, &[1, 1, 3, 3]),
    (4, 4, &[1, 3, 5, 13]),
    (5, 2, &[1, 1, 5, 5, 17]),
    (5, 4, &[1, 1, 5, 5, 5]),
    (5, 7, &[1, 1, 7, 11, 19]),
    (5, 11, &[1, 1, 5, 1, 1]),
    (5, 13, &[1, 1, 1, 3, 11]),
    (5, 14, &[1, 3, 5, 5, 31]),
    (6, 1, &[1, 3, 3, 9, 7, 49]),
    (6, 13, &[1, 1, 1, 15, 21, 21]),
    (6, 16, &[1, 3, 1, 13, 27, 49]),
    (6, 19, &[1, 1, 1, 15, 7, 5]),
    (6, 22, &[1, 3, 1, 15, 13, 25]),
    (6, 25, &[1, 1, 5, 5, 19, 61]),
    (7, 1, &[1, 3, 7, 11, 23, 15, 103]),
    (7, 4, &[1, 3, 7, 13, 13, 15, 69]),
];

/// Dimensions that [`sobol`] has.
pub const SOBOL_DIMENSIONS: usize = JOE_KUO.len() + 1;

/// Sobol's matrices in the first `dimensions` dimensions for indices of `bits` bits (at most 32).
#[must_use]
pub fn sobol(dimensions: usize, bits: u32) -> Vec<Matrix> {
    let van_der_corput = (0..bits).map(|b| 1 << (31 - b)).collect();
    let rest = JOE_KUO.iter().map(|&(degree, coefficients, initial)| {
        let s = degree as usize;
        let mut v: Vec<u32> = initial.iter().zip(0..).map(|(&m, b)| m << (31 - b)).collect();
        for b in s..bits as usize {
            let mut next = v[b - s] ^ (v[b - s] >> s);
            for k in 1..s {
                if coefficients >> (s - 1 - k) & 1 == 1 {
                    next ^= v[b - k];
                }
            }
            v.push(next);
        }
        v.truncate(bits as usize);
        v
    });
    std::iter::once(van_der_corput).chain(rest).take(dimensions).collect()
}

/// The matrices tuned for exactly 2^`bits` runs, if there are such.
#[must_use]
pub fn strong(bits: u32) -> Option<Vec<Matrix>> {
    unpack(nets_data::STRONG.iter().find(|set| set.bits == bits)?)
}

/// The smallest set tuned for all prefixes of at least 2^`bits` runs, if there is one.
#[must_use]
pub fn nested(bits: u32) -> Option<Vec<Matrix>> {
    unpack(nets_data::NESTED.iter().filter(|set| set.bits >= bits).min_by_key(|set| set.bits)?)
}

/// Bits of the tuned set that [`growing`] goes on from.
const GROWING_FROM: u32 = 7;

/// The set tuned for the prefixes of 2⁷ runs, for indices of `bits` bits: what comes after are Sobol's columns, so that each
/// prefix of 2ᵏ runs remains a full stratification of each factor.
#[must_use]
pub fn growing(bits: u32) -> Vec<Matrix> {
    let tuned = nested(GROWING_FROM).unwrap_or_default();
    let on = sobol(TUNED_FACTORS, bits.max(GROWING_FROM));
    tuned.into_iter().zip(on).map(|(matrix, on)| [&matrix[..], &on[matrix.len()..]].concat()).collect()
}

fn unpack(set: &nets_data::Set) -> Option<Vec<Matrix>> {
    let bits = set.bits as usize;
    Some(set.columns.chunks_exact(bits).map(|matrix| matrix.iter().map(|&c| u32::from(c) << 16).collect()).collect())
}

/// Matrices turned into tables by bytes of the index; values are bit-reversed, ready to be scrambled.
#[derive(Debug, Clone)]
pub(crate) struct NetTables {
    bytes: usize,
    bits: u32,
    /// `[matrix][byte of the index]`
    tables: Vec<[u32; 256]>,
}

impl NetTables {
    /// Tables of `matrices`, all with `bits` columns.
    pub(crate) fn new(matrices: &[Matrix], bits: u32) -> Self {
        let bytes = (bits.max(1) as usize).div_ceil(8);
        let mut tables = Vec::with_capacity(matrices.len() * bytes);
        for matrix in matrices {
            for byte in 0..bytes {
                let mut table = [0_u32; 256];
                for value in 1..256_usize {
                    let bit = value.trailing_zeros() as usize;
                    let column = matrix.get(byte * 8 + bit).copied().unwrap_or(0);
                    table[value] = table[value & (value - 1)] ^ column.reverse_bits();
                }
                tables.push(table);
            }
        }
        Self { bytes, bits, tables }
    }

    /// The same for indices whose `bits` bits are reversed.
    pub(crate) fn of_reversed_index(matrices: &[Matrix], bits: u32) -> Self {
        let turned: Vec<Matrix> = matrices
            .iter()
            .map(|matrix| (0..bits as usize).rev().map(|b| matrix.get(b).copied().unwrap_or(0)).collect())
            .collect();
        Self::new(&turned, bits)
    }

    /// Bits of an index.
    pub(crate) fn bits(&self) -> u32 {
        self.bits
    }

    /// Matrices.
    pub(crate) fn columns(&self) -> usize {
        self.tables.len() / self.bytes
    }

    /// The bit-reversed coordinate of `column` at `index`, whose bits above the tables' are ignored.
    #[inline]
    pub(crate) fn reversed(&self, column: usize, index: u32) -> u32 {
        let tables = &self.tables[column * self.bytes..(column + 1) * self.bytes];
        let mut value = tables[0][(index & 255) as usize];
        let mut rest = index >> 8;
        for table in &tables[1..] {
            if rest == 0 {
                break;
            }
            value ^= table[(rest & 255) as usize];
            rest >>= 8;
        }
        value
    }
}
