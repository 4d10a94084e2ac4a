//! Which light paths look for: how many bounces, and caustics.

/// How long paths are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PathLengths {
    /// The most diffuse and rough bounces after the first hit; 0 leaves direct light, and what mirrors and glass show.
    pub bounces: u16,
    /// Bounces that every path makes. After those it goes on with a probability of eight times its throughput, and carries
    /// the light of those that ended (Russian roulette, Arvo and Kirk 1990, "Particle Transport and Image Synthesis").
    pub sure: u16,
}

/// Whether lamps light surfaces by way of mirrors and glass.
///
/// Such light is found by chance alone, when a scattered ray happens to meet the lamp: a few samples carry all of it,
/// and it takes thousands to even them out. Most renderers leave it out or blur it unless asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Caustics {
    /// Left out, and with it all other light that facets throw on diffuse surfaces: what a diffuse lobe looks at is
    /// diffuse too. Least noise; rooms with polished floors are darker than they should be.
    Dropped,
    /// Reflected light spreads over a wide patch instead of a sharp one: opaque facets narrower than half of the widest
    /// lobe before them are widened to it. What lets light through stays sharp, and lamps seen by way of it after such a
    /// lobe are left out; what surrounds the scene still shines through glass.
    #[default]
    Blurred,
    /// Computed, without bias.
    Exact,
}
