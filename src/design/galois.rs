//! Finite fields GF(q) of prime-power order q ≤ 32, as tables.
//!
//! An element is the number whose base-p digits are the coefficients of its polynomial over GF(p), so 0 and 1 are
//! themselves. Products are reduced by the first monic irreducible polynomial in that numbering, found by division.

/// Largest field order supported.
pub const MAX_ORDER: u32 = 32;

/// The field of `q` elements.
#[derive(Debug, Clone)]
pub struct Field {
    q: u8,
    sum: Vec<u8>,
    product: Vec<u8>,
}

/// (p, k) with q = pᵏ, p prime; none if q is no prime power or exceeds [`MAX_ORDER`].
#[must_use]
pub fn prime_power(q: u32) -> Option<(u32, u32)> {
    if !(2..=MAX_ORDER).contains(&q) {
        return None;
    }
    let p = (2..=q).find(|p| q.is_multiple_of(*p))?;
    let (mut rest, mut k) = (q, 0);
    while rest.is_multiple_of(p) {
        rest /= p;
        k += 1;
    }
    (rest == 1).then_some((p, k))
}

impl Field {
    /// GF(q); none if `q` is no prime power from 2 to [`MAX_ORDER`].
    #[must_use]
    pub fn new(q: u32) -> Option<Self> {
        let (p, k) = prime_power(q)?;
        let modulus = irreducible(p, k);
        let (mut sum, mut product) = (Vec::new(), Vec::new());
        for a in 0..q {
            for b in 0..q {
                let (x, y) = (digits(a, p, k), digits(b, p, k));
                let s: Vec<u32> = x.iter().zip(&y).map(|(&x, &y)| (x + y) % p).collect();
                sum.push(number(&s, p));
                product.push(number(&remainder(multiply(&x, &y, p), &modulus, p), p));
            }
        }
        let q = u8::try_from(q).ok()?;
        Some(Self { q, sum, product })
    }

    /// Number of elements.
    #[must_use]
    pub fn order(&self) -> u8 {
        self.q
    }

    /// a + b; both below the order.
    #[must_use]
    pub fn add(&self, a: u8, b: u8) -> u8 {
        self.sum[usize::from(a) * usize::from(self.q) + usize::from(b)]
    }

    /// a · b; both below the order.
    #[must_use]
    pub fn multiply(&self, a: u8, b: u8) -> u8 {
        self.product[usize::from(a) * usize::from(self.q) + usize::from(b)]
    }
}

/// The `k` base-`p` digits of `x`, lowest first.
fn digits(mut x: u32, p: u32, k: u32) -> Vec<u32> {
    (0..k)
        .map(|_| {
            let digit = x % p;
            x /= p;
            digit
        })
        .collect()
}

fn number(digits: &[u32], p: u32) -> u8 {
    let value = digits.iter().rev().fold(0, |value, &digit| value * p + digit);
    u8::try_from(value).expect("an element of a field of at most 32")
}

fn multiply(a: &[u32], b: &[u32], p: u32) -> Vec<u32> {
    let mut out = vec![0; a.len() + b.len() - 1];
    for (i, &x) in a.iter().enumerate() {
        for (j, &y) in b.iter().enumerate() {
            out[i + j] = (out[i + j] + x * y) % p;
        }
    }
    out
}

/// Remainder of `a` by the monic polynomial `modulus`, padded to the modulus's degree.
fn remainder(mut a: Vec<u32>, modulus: &[u32], p: u32) -> Vec<u32> {
    let degree = modulus.len() - 1;
    for top in (degree..a.len()).rev() {
        let lead = a[top];
        for (j, &m) in modulus.iter().enumerate() {
            let at = top - degree + j;
            a[at] = (a[at] + (p - lead) * m) % p;
        }
    }
    a.resize(degree, 0);
    a
}

/// The first monic polynomial of degree `k` over GF(p) that no monic one of degree 1 to k/2 divides.
fn irreducible(p: u32, k: u32) -> Vec<u32> {
    let monic = |code: u32, degree: u32| {
        let mut polynomial = digits(code, p, degree);
        polynomial.push(1);
        polynomial
    };
    (0..p.pow(k))
        .map(|code| monic(code, k))
        .find(|candidate| {
            (1..=k / 2).all(|degree| {
                (0..p.pow(degree))
                    .all(|code| remainder(candidate.clone(), &monic(code, degree), p).iter().any(|&digit| digit != 0))
            })
        })
        .expect("there is an irreducible polynomial of every degree")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_prime_power_to_32_is_a_field_and_nothing_else() {
        let orders: Vec<u32> = (0..=40).filter(|&q| Field::new(q).is_some()).collect();
        assert_eq!(orders, [2, 3, 4, 5, 7, 8, 9, 11, 13, 16, 17, 19, 23, 25, 27, 29, 31, 32]);
    }

    #[test]
    fn the_field_axioms_hold_in_every_order() {
        for q in 2..=32 {
            let Some(f) = Field::new(q) else { continue };
            let all = || 0..f.order();
            for a in all() {
                assert_eq!((f.add(a, 0), f.multiply(a, 1), f.multiply(a, 0)), (a, a, 0));
                assert_eq!(all().filter(|&b| f.add(a, b) == 0).count(), 1, "one negative of {a} in GF({q})");
                assert_eq!(all().filter(|&b| f.multiply(a, b) == 1).count(), usize::from(a != 0));
                for b in all() {
                    assert_eq!(f.add(a, b), f.add(b, a));
                    assert_eq!(f.multiply(a, b), f.multiply(b, a));
                    for c in all() {
                        assert_eq!(f.add(f.add(a, b), c), f.add(a, f.add(b, c)));
                        assert_eq!(f.multiply(f.multiply(a, b), c), f.multiply(a, f.multiply(b, c)));
                        assert_eq!(f.multiply(a, f.add(b, c)), f.add(f.multiply(a, b), f.multiply(a, c)));
                    }
                }
            }
        }
    }
}
