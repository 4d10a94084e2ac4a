//! The axes of the integral: what effects ask for, designs stratify and the tracer draws.

/// One sampled axis of the integral.
///
/// Five factors belong to the camera. Then every vertex of a light path that is not purely specular has a group of
/// four: the light's pair and the lobe's pair; which light, and which lobe, is chosen by rescaling the same pair.
/// Further independent numbers (transparency, Russian roulette, the choice between reflection and refraction at a
/// mirror-like vertex) are [`Factor::extra`]: stratified alone where a design can, never tied to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Factor(pub(crate) u16);

impl Factor {
    /// Horizontal position within the pixel's footprint.
    pub const FILM_X: Self = Self(0);
    /// Vertical position within the pixel's footprint.
    pub const FILM_Y: Self = Self(1);
    /// Time within the exposure.
    pub const SHUTTER: Self = Self(2);
    /// First coordinate on the lens.
    pub const LENS_U: Self = Self(3);
    /// Second coordinate on the lens.
    pub const LENS_V: Self = Self(4);
    /// Factors in each path vertex's group.
    pub const PER_VERTEX: u16 = 4;
    pub(crate) const FIRST_VERTEX: u16 = 5;
    const FIRST_EXTRA: u16 = 0x8000;

    /// First coordinate on the light, at the `vertex`-th rough vertex from the camera (from 0).
    #[must_use]
    pub const fn light_u(vertex: u16) -> Self {
        Self(Self::FIRST_VERTEX + Self::PER_VERTEX * vertex)
    }
    /// Second coordinate on the light.
    #[must_use]
    pub const fn light_v(vertex: u16) -> Self {
        Self(Self::light_u(vertex).0 + 1)
    }
    /// First coordinate of the scattered direction.
    #[must_use]
    pub const fn lobe_u(vertex: u16) -> Self {
        Self(Self::light_u(vertex).0 + 2)
    }
    /// Second coordinate of the scattered direction.
    #[must_use]
    pub const fn lobe_v(vertex: u16) -> Self {
        Self(Self::light_u(vertex).0 + 3)
    }
    /// The `n`-th further number, independent of all else.
    #[must_use]
    pub const fn extra(n: u16) -> Self {
        Self(Self::FIRST_EXTRA + n)
    }

    /// Its place in the fixed order film x, film y, shutter, lens u, lens v, light u, light v, lobe u, lobe v, …
    #[must_use]
    pub const fn index(self) -> u16 {
        self.0
    }

    /// Whether it is one of [`Factor::extra`].
    #[must_use]
    pub const fn is_extra(self) -> bool {
        self.0 >= Self::FIRST_EXTRA
    }
}

/// What a build of the program can sample at all: everything, but for benches/presence, which weighs what the mere
/// presence of an effect's code costs and compiles it out.
pub(crate) mod compiled {
    /// Time: things move within an exposure.
    pub(crate) const TIME: bool = !cfg!(feature = "without-motion");
    /// A lens with an aperture.
    pub(crate) const LENS: bool = !cfg!(feature = "without-lens");
    /// Lights that must be sampled: those with an extent, and many without.
    pub(crate) const LIGHT: bool = !cfg!(feature = "without-area-lights");
}

impl std::fmt::Display for Factor {
    /// `film x`, `shutter`, `light 0 u`, …: vertices are counted from the camera.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match *self {
            Self::FILM_X => f.write_str("film x"),
            Self::FILM_Y => f.write_str("film y"),
            Self::SHUTTER => f.write_str("shutter"),
            Self::LENS_U => f.write_str("lens u"),
            Self::LENS_V => f.write_str("lens v"),
            Self(i) if self.is_extra() => write!(f, "extra {}", i - Self::FIRST_EXTRA),
            Self(i) => {
                let (vertex, axis) =
                    ((i - Self::FIRST_VERTEX) / Self::PER_VERTEX, (i - Self::FIRST_VERTEX) % Self::PER_VERTEX);
                write!(f, "{} {vertex}", ["light u", "light v", "lobe u", "lobe v"][usize::from(axis)])
            }
        }
    }
}
