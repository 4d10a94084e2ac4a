//! The designs and the inter-pixel structures by name.

use std::fmt;
use std::str::FromStr;

/// How runs are placed inside a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Independent uniform draws: the yardstick.
    Random,
    /// Each natural pair of factors stratified in equal cells, the pairs shuffled against each other (Cook, Porter
    /// and Carpenter 1984, §3).
    Jittered,
    /// Each factor stratified in N strata, shuffled against all others (McKay, Beckman and Conover 1979).
    LatinHypercube,
    /// Time's letters over the n × n pixel cells, each letter once in each row and column (Mitchell 1990, eq. 13);
    /// further factors padded. n² runs for any n.
    LatinSquare,
    /// Every pair of factors meets in every combination of levels once (Mitchell 1990, eq. 14), by Bose's construction
    /// (1938) over GF(q): q + 1 factors in q² runs; refined so that each factor falls in q² strata.
    Orthogonal,
    /// The same, the refinement of each factor being tied to the level of its partner, so that the pair is also
    /// stratified q² × q and q × q² (after Kensler 2013).
    OrthogonalCorrelated,
    /// Every triple of factors meets in every combination of levels once (Bush 1952): q³ runs.
    #[serde(rename = "orthogonal-3")]
    OrthogonalStrength3,
    /// Sobol's sequence (direction numbers of Joe and Kuo 2008), Owen-scrambled.
    Sobol,
    /// Film positions by dart throwing, other factors independent: for study.
    PoissonDisk,
    /// Film positions by point diffusion (Mitchell 1987), other factors independent: for study.
    PointDiffusion,
    /// A digital net tuned by search for one number of runs (a power of two), Owen-scrambled.
    Strong,
    /// A digital sequence tuned by search for all its prefixes, Owen-scrambled.
    Nested,
    /// The sequence tuned for the prefixes of 128 runs, which goes on as Sobol's: for pixels that stop at any power of two.
    Growing,
    /// Chosen by the number of runs and of factors.
    #[default]
    Auto,
}

impl Kind {
    /// Every kind, [`Kind::Auto`] last.
    pub const ALL: [Self; 14] = [
        Self::Random,
        Self::Jittered,
        Self::LatinHypercube,
        Self::LatinSquare,
        Self::Orthogonal,
        Self::OrthogonalCorrelated,
        Self::OrthogonalStrength3,
        Self::Sobol,
        Self::PoissonDisk,
        Self::PointDiffusion,
        Self::Strong,
        Self::Nested,
        Self::Growing,
        Self::Auto,
    ];

    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Jittered => "jittered",
            Self::LatinHypercube => "latin-hypercube",
            Self::LatinSquare => "latin-square",
            Self::Orthogonal => "orthogonal",
            Self::OrthogonalCorrelated => "orthogonal-correlated",
            Self::OrthogonalStrength3 => "orthogonal-3",
            Self::Sobol => "sobol",
            Self::PoissonDisk => "poisson-disk",
            Self::PointDiffusion => "point-diffusion",
            Self::Strong => "strong",
            Self::Nested => "nested",
            Self::Growing => "growing",
            Self::Auto => "auto",
        }
    }
}

/// What structures the draws of neighbouring pixels and frames against each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mask {
    /// Nothing: pixels are independent.
    None,
    /// The 4 × 4 ordered-dither matrix (Mitchell 1990, eq. 15; Limb 1969).
    Ordered,
    /// The 8 × 8 ordered-dither matrix (Bayer 1973).
    #[serde(rename = "ordered-8x8")]
    Ordered8,
    /// A 64 × 64 blue-noise mask (void and cluster, Ulichney 1993).
    BlueNoise,
    /// An additive-recurrence lattice over the pixels (Roberts 2018).
    R2,
    /// One net over the whole picture in shuffled Z-order, frames included (Ahmed and Wonka 2020).
    ZOrder,
    /// Chosen by the number of runs.
    #[default]
    Auto,
}

impl Mask {
    /// Every mask, [`Mask::Auto`] last.
    pub const ALL: [Self; 7] =
        [Self::None, Self::Ordered, Self::Ordered8, Self::BlueNoise, Self::R2, Self::ZOrder, Self::Auto];

    /// Its name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Ordered => "ordered",
            Self::Ordered8 => "ordered-8x8",
            Self::BlueNoise => "blue-noise",
            Self::R2 => "r2",
            Self::ZOrder => "z-order",
            Self::Auto => "auto",
        }
    }
}

/// A structure between pixels and the factors it governs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
pub struct Dither {
    /// The structure.
    pub mask: Mask,
    /// The factors.
    pub over: Over,
}

/// Which factors a [`Dither`] governs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Over {
    /// Time alone, as the survey has it.
    Time,
    /// Every factor of the design, with decorrelated masks.
    #[default]
    All,
}

impl Dither {
    /// No structure between pixels.
    pub const NONE: Self = Self { mask: Mask::None, over: Over::All };
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl fmt::Display for Dither {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.mask, self.over) {
            (Mask::None | Mask::Auto, _) => f.write_str(self.mask.name()),
            (mask, Over::Time) => write!(f, "{}:time", mask.name()),
            (mask, Over::All) => write!(f, "{}:all", mask.name()),
        }
    }
}

/// A name that is none of a closed set's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("\"{given}\" is none of {known}")]
pub struct UnknownName {
    given: String,
    known: String,
}

impl UnknownName {
    fn new<'a>(given: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        Self { given: given.to_owned(), known: known.into_iter().collect::<Vec<_>>().join(", ") }
    }
}

impl FromStr for Kind {
    type Err = UnknownName;

    fn from_str(s: &str) -> Result<Self, UnknownName> {
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == s)
            .ok_or_else(|| UnknownName::new(s, Self::ALL.map(Self::name)))
    }
}

impl FromStr for Dither {
    type Err = UnknownName;

    /// A mask's name, then optionally `:time` or `:all` (the default; the ordered masks default to time, as in the
    /// survey).
    fn from_str(s: &str) -> Result<Self, UnknownName> {
        let (name, over) = s.split_once(':').map_or((s, None), |(name, over)| (name, Some(over)));
        let mask = Mask::ALL
            .into_iter()
            .find(|mask| mask.name() == name)
            .ok_or_else(|| UnknownName::new(name, Mask::ALL.map(Mask::name)))?;
        let over = match over {
            Some("time") => Over::Time,
            Some("all") => Over::All,
            Some(other) => return Err(UnknownName::new(other, ["time", "all"])),
            None if matches!(mask, Mask::Ordered | Mask::Ordered8) => Over::Time,
            None => Over::All,
        };
        Ok(Self { mask, over })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_parse_back() {
        for kind in Kind::ALL {
            assert_eq!(kind.name().parse(), Ok(kind));
        }
        for mask in Mask::ALL {
            for over in [Over::Time, Over::All] {
                let parsed: Dither = Dither { mask, over }.to_string().parse().unwrap();
                assert_eq!(parsed.mask, mask);
                assert!(matches!(mask, Mask::None | Mask::Auto) || parsed.over == over);
            }
        }
    }

    #[test]
    fn unknown_names_are_answered_with_the_known_ones() {
        let message = "sobl".parse::<Kind>().unwrap_err().to_string();
        assert!(message.starts_with("\"sobl\" is none of random, jittered"), "{message}");
        assert!("r2:lens".parse::<Dither>().is_err());
    }
}
