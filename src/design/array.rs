//! Orthogonal arrays: Latin squares, Bose's and Bush's constructions.
//!
//! An array of strength s over q levels has, in any s of its columns, every combination of levels equally often
//! (Rao 1947). Columns are ordered film x, film y, shutter, …: with the pixel's rows down and its columns across, the
//! third, fourth and fifth columns of Bose's array over GF(4) are the Latin letters, Greek letters and numerals of the
//! survey's square (Mitchell 1990, eq. 13 and 14).

use super::galois::Field;

/// Levels of factors (columns) for runs (rows).
#[derive(Debug, Clone)]
pub struct OrthogonalArray {
    levels: u32,
    strength: u32,
    columns: usize,
    /// `[run][column]`
    table: Vec<u16>,
}

impl OrthogonalArray {
    /// Bose's array of strength 2: q² runs, q + 1 columns; none unless `q` is a prime power from 2 to 32.
    ///
    /// Run i·q + j is the cell in row i and column j; the columns are j, i and a·i + j for each a ≠ 0 of GF(q).
    #[must_use]
    pub fn bose(q: u32) -> Option<Self> {
        let field = Field::new(q)?;
        let mut table = Vec::with_capacity((q * q * (q + 1)) as usize);
        for i in 0..field.order() {
            for j in 0..field.order() {
                table.push(u16::from(j));
                table.push(u16::from(i));
                table.extend((1..field.order()).map(|a| u16::from(field.add(field.multiply(a, i), j))));
            }
        }
        Some(Self { levels: q, strength: 2, columns: q as usize + 1, table })
    }

    /// Bush's array of strength 3: q³ runs, q + 1 columns (q + 2 where q is even); none unless `q` is a prime power
    /// from 2 to 32.
    ///
    /// Runs are the polynomials c₀ + c₁e + c₂e²; columns their values at each e of GF(q), then c₂, then c₁ for even q.
    #[must_use]
    pub fn bush(q: u32) -> Option<Self> {
        let field = Field::new(q)?;
        let columns = q as usize + if q.is_multiple_of(2) { 2 } else { 1 };
        let mut table = Vec::with_capacity(q.pow(3) as usize * columns);
        for c2 in 0..field.order() {
            for c1 in 0..field.order() {
                for c0 in 0..field.order() {
                    table.extend((0..field.order()).map(|e| {
                        let linear = field.add(c1, field.multiply(c2, e));
                        u16::from(field.add(c0, field.multiply(linear, e)))
                    }));
                    table.push(u16::from(c2));
                    if q.is_multiple_of(2) {
                        table.push(u16::from(c1));
                    }
                }
            }
        }
        Some(Self { levels: q, strength: 3, columns, table })
    }

    /// One Latin square over the n × n cells: columns j, i and the letter, i + j over GF(n) or else modulo n.
    ///
    /// # Panics
    /// Unless 1 ≤ n ≤ 4096.
    #[must_use]
    pub fn latin_square(n: u32) -> Self {
        assert!((1..=4096).contains(&n), "squares of 1 to 4096 rows");
        let field = Field::new(n);
        let letter = |i: u16, j: u16| match &field {
            #[allow(clippy::cast_possible_truncation, reason = "a field has at most 32 elements")]
            Some(field) => u16::from(field.add(i as u8, j as u8)),
            None => ((u32::from(i) + u32::from(j)) % n).try_into().unwrap_or(0),
        };
        let n16 = u16::try_from(n).unwrap_or(u16::MAX);
        let mut table = Vec::with_capacity(3 * (n * n) as usize);
        for i in 0..n16 {
            for j in 0..n16 {
                table.extend([j, i, letter(i, j)]);
            }
        }
        Self { levels: n, strength: 2, columns: 3, table }
    }

    /// Levels of each factor.
    #[must_use]
    pub fn levels(&self) -> u32 {
        self.levels
    }

    /// In how many columns together every combination occurs equally often.
    #[must_use]
    pub fn strength(&self) -> u32 {
        self.strength
    }

    /// Factors.
    #[must_use]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Runs.
    #[must_use]
    pub fn runs(&self) -> u32 {
        self.levels.pow(self.strength)
    }

    /// The level of `column` in `run`.
    #[must_use]
    #[inline]
    pub fn level(&self, run: u32, column: usize) -> u16 {
        self.table[run as usize * self.columns + column]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::galois::prime_power;

    /// Every combination of levels occurs equally often in any `strength` of the columns.
    fn has_strength(array: &OrthogonalArray, strength: usize, columns: &[usize]) -> bool {
        let q = array.levels() as usize;
        let mut count = vec![0_u32; q.pow(u32::try_from(strength).unwrap())];
        for run in 0..array.runs() {
            count[columns.iter().fold(0, |cell, &c| cell * q + usize::from(array.level(run, c)))] += 1;
        }
        count.iter().all(|&c| c == count[0])
    }

    #[test]
    fn every_pair_of_every_bose_array_is_orthogonal() {
        for q in (2..=32).filter(|&q| prime_power(q).is_some()) {
            let array = OrthogonalArray::bose(q).unwrap();
            assert_eq!((array.runs(), array.columns()), (q * q, q as usize + 1));
            for a in 0..array.columns() {
                for b in 0..a {
                    assert!(has_strength(&array, 2, &[a, b]), "GF({q}), columns {b} and {a}");
                }
            }
        }
    }

    #[test]
    fn every_triple_of_every_bush_array_to_sixteen_levels_is_orthogonal() {
        for q in (2..=16).filter(|&q| prime_power(q).is_some()) {
            let array = OrthogonalArray::bush(q).unwrap();
            assert_eq!(array.runs(), q.pow(3));
            for a in 0..array.columns() {
                for b in 0..a {
                    for c in 0..b {
                        assert!(has_strength(&array, 3, &[a, b, c]), "GF({q}), columns {c}, {b} and {a}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_square_is_latin() {
        for n in 1..=40 {
            let square = OrthogonalArray::latin_square(n);
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                assert!(has_strength(&square, 2, &[a, b]), "{n}, columns {a} and {b}");
            }
        }
    }

    /// Mitchell 1990, eq. 13.
    #[test]
    fn the_surveys_latin_square_is_the_square_of_four() {
        let survey = ["ABCD", "BADC", "CDAB", "DCBA"];
        for array in [OrthogonalArray::latin_square(4), OrthogonalArray::bose(4).unwrap()] {
            for (i, row) in (0..).zip(survey) {
                for (j, letter) in (0..).zip(row.chars()) {
                    assert_eq!("ABCD".chars().nth(array.level(i * 4 + j, 2).into()), Some(letter));
                }
            }
        }
    }

    /// Mitchell 1990, eq. 14.
    #[test]
    fn the_surveys_three_orthogonal_squares_are_boses_over_gf4() {
        let survey = [
            ["Aα1", "Bβ2", "Cγ3", "Dδ4"],
            ["Bγ4", "Aδ3", "Dα2", "Cβ1"],
            ["Cδ2", "Dγ1", "Aβ4", "Bα3"],
            ["Dβ3", "Cα4", "Bδ1", "Aγ2"],
        ];
        let array = OrthogonalArray::bose(4).unwrap();
        for (i, row) in (0..).zip(survey) {
            for (j, cell) in (0..).zip(row) {
                let run = i * 4 + j;
                assert_eq!((array.level(run, 0), array.level(run, 1)), (j.try_into().unwrap(), i.try_into().unwrap()));
                let labels: String = ["ABCD", "αβγδ", "1234"]
                    .iter()
                    .zip(2..)
                    .map(|(alphabet, column)| alphabet.chars().nth(array.level(run, column).into()).unwrap())
                    .collect();
                assert_eq!(labels, cell, "row {i}, column {j}");
            }
        }
    }
}
