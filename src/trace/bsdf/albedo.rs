//! Directional albedos of the lobes: how much a lobe reflects in all, by the cosine of view and roughness.
//!
//! Computed once, at first use, by quadrature over visible normals with a rank-1 lattice; nothing is fitted. They
//! serve three purposes: light lost between facets is given back (Turquin 2019, "Practical multiple scattering
//! compensation for microfacet models"), what a layer reflects is withheld from the layers below (Kulla and Conty
//! 2017), and lobes are chosen in proportion to what they reflect.
//!
//! Every Schlick reflectance F = F₀ + (F₉₀ − F₀)(1 − cos)⁵ has the albedo F₀ S + (F₉₀ − F₀) B, with S the albedo of a
//! perfect mirror facet and B that of Schlick's weight alone; so two tables serve all materials.

#![allow(clippy::cast_possible_truncation, reason = "means are summed in f64 and rounded once")]

use super::fresnel::{dielectric, schlick_weight};
use super::ggx::{Ggx, azimuth_from_unit, reflect, refract};
use glam::{DVec4, Vec2, Vec3A, Vec4};
use std::sync::{LazyLock, OnceLock};

mod cloth;
mod mirror;
mod stretched;
use mirror::{Circle, mirror_means};
use stretched::Stretched;

/// Rows and columns of a table: an axis of cosine and one of perceptual roughness, in steps of 1/(SIDE − 1).
const SIDE: usize = 64;
/// Points of the lattice for each entry, on half of the circle of azimuths.
const POINTS: u32 = 1024;

/// Greatest measured error of the coarser tables, by which they are read high so that no lobe ever gains light: what
/// is too high an albedo leaves too little to compensate. Measured by the furnaces in this module's tests over 63 pairs of
/// angle and roughness: 0.0044 (glass from inside), 0.0017 (sheen). Those of stretched facets hold the furnaces from all
/// around.
const ANISOTROPIC_MARGIN: f32 = 0.008;
const ANISOTROPIC_GLASS_MARGIN: f32 = 0.013;
const GLASS_MARGIN: f32 = 0.005;
const SHEEN_MARGIN: f32 = 0.003;

/// How the cosine of view runs along a table.
#[derive(Debug, Clone, Copy)]
enum Axis {
    /// By its square root.
    Root,
    /// By (1 + k) c / (k + c) with k = α: shadowing sets in where the cosine falls below α, so it looks alike at
    /// every roughness on this scale.
    Shadowing,
}

impl Axis {
    /// Where `cos` lies on the axis, [0, 1], for [`Axis::k`] of the roughness.
    #[inline]
    fn place(self, cos: f32, k: f32) -> f32 {
        match self {
            Self::Root => cos.sqrt(),
            Self::Shadowing => (1.0 + k) * cos / (k + cos),
        }
    }

    fn cosine(self, x: f32, roughness: f32) -> f32 {
        match self {
            Self::Root => x * x,
            Self::Shadowing => {
                let k = Self::k(roughness);
                k * x / (1.0 + k - x)
            }
        }
    }

    /// The cosine of column `column` of `columns`.
    fn entry_cosine(self, column: usize, columns: usize, roughness: f32) -> f32 {
        self.cosine(column as f32 / (columns - 1) as f32, roughness).clamp(LEAST_COSINE, 1.0)
    }

    #[inline]
    fn k(roughness: f32) -> f32 {
        (roughness * roughness).max(super::ALPHA_SPECULAR)
    }
}

/// A function of cosine and perceptual roughness, tabulated. Its axis is [`Axis::Shadowing`] or else [`Axis::Root`]; that and
/// its size are part of its type, so that looking up has nothing to decide.
#[derive(Debug)]
pub(super) struct Table<const SHADOWING: bool, const COLUMNS: usize, const ROWS: usize> {
    values: Box<[[f32; COLUMNS]; ROWS]>,
}

impl<const SHADOWING: bool, const COLUMNS: usize, const ROWS: usize> Table<SHADOWING, COLUMNS, ROWS> {
    const AXIS: Axis = if SHADOWING { Axis::Shadowing } else { Axis::Root };

    fn build(value: impl Fn(f32, f32) -> f32 + Sync) -> Self {
        Self::of_entries(|column, row| {
            let roughness = entry_roughness(row, ROWS);
            value(Self::AXIS.entry_cosine(column, COLUMNS, roughness), roughness)
        })
    }

    /// The table whose entry in each column and row is given.
    fn of_entries(entry: impl Fn(usize, usize) -> f32 + Sync) -> Self {
        let all = in_parallel(COLUMNS * ROWS, |i| entry(i % COLUMNS, i / COLUMNS));
        let mut values = Box::new([[0.0; COLUMNS]; ROWS]);
        values.as_flattened_mut().copy_from_slice(&all);
        Self { values }
    }

    /// Bilinear in the axes.
    #[inline]
    pub(super) fn at(&self, cos: f32, roughness: f32) -> f32 {
        let roughness = roughness.clamp(0.0, 1.0);
        self.along(Self::AXIS.place(cos.clamp(0.0, 1.0), Axis::k(roughness)), cell(roughness, ROWS))
    }

    /// At place `x` of the cosine's axis, between two rows.
    #[inline]
    fn along(&self, x: f32, (row, y): (usize, f32)) -> f32 {
        let (column, x) = cell(x, COLUMNS);
        let along = |row: &[f32; COLUMNS]| row[column] * (1.0 - x) + row[column + 1] * x;
        along(&self.values[row]) * (1.0 - y) + along(&self.values[row + 1]) * y
    }
}

/// The roughness of row `row` of `rows`. The lowest stands for the narrowest lobe that is not a mirror.
fn entry_roughness(row: usize, rows: usize) -> f32 {
    (row as f32 / (rows - 1) as f32).max(super::ALPHA_SPECULAR.sqrt())
}

/// `entry` of 0 to `count` − 1, in order, computed by threads of its own: a pool's worker that waits for a table must
/// not be handed another task that waits for it too.
fn in_parallel(count: usize, entry: impl Fn(usize) -> f32 + Sync) -> Vec<f32> {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let mut values = vec![0.0_f32; count];
    let part = count.div_ceil(threads);
    std::thread::scope(|scope| {
        for (number, chunk) in values.chunks_mut(part).enumerate() {
            let entry = &entry;
            scope.spawn(move || {
                for (i, value) in chunk.iter_mut().enumerate() {
                    *value = entry(number * part + i);
                }
            });
        }
    });
    values
}

/// The cosine that stands for 0 in the tables: at 0 itself a view ray grazes every facet.
const LEAST_COSINE: f32 = 1e-5;

/// The entry below `x` in [0, 1] of an axis with `count` entries, and the way from it to the next.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a table index")]
#[inline]
fn cell(x: f32, count: usize) -> (usize, f32) {
    let x = x * (count - 1) as f32;
    // By way of 32 bits: a conversion to 64 that saturates is longer.
    let below = (x as u32).min(count as u32 - 2);
    (below as usize, x - below as f32)
}

/// The `i`-th of `points` points of a rank-1 lattice (Fibonacci-like: the golden ratio's fraction), centred.
fn lattice(i: u32, points: u32) -> Vec2 {
    let x = (f64::from(i) + 0.5) / f64::from(points);
    let y = (f64::from(i) * 0.618_033_988_749_894_9 + 0.5).fract();
    Vec2::new(x as f32, y as f32)
}

/// The lattice's points as [`Ggx::visible_normal_around`] takes them: the same for every entry of a table.
fn circle_lattice(points: u32) -> Vec<(Vec2, f32)> {
    (0..points).map(|i| lattice(i, points)).map(|u| (azimuth_from_unit(u.x), u.y)).collect()
}

fn view(cos: f32) -> Vec3A {
    Vec3A::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos)
}

/// The same of round facets.
fn ggx_means(cos: f32, roughness: f32, points: &Circle, weight: impl Fn(f32) -> f32) -> (f32, f32) {
    mirror_means(Ggx { alpha: Vec2::splat(roughness * roughness) }, view(cos), points, weight)
}

/// Of round facets that reflect `weight` of the cosine with the view, relative to a mirror's: the mean weight of what is
/// reflected.
fn share(cos: f32, roughness: f32, points: &Circle, weight: impl Fn(f32) -> f32) -> f32 {
    let (mirror, weighted) = ggx_means(cos, roughness, points, weight);
    weighted / mirror
}

/// The lattice on half of a turn, its even steps in height: the albedo's edge, where facets begin to reflect downwards, runs
/// across them (on 105 pairs of cosine and roughness the greatest error is 0.0009; with even steps in azimuth 0.0013).
fn half_turn() -> impl Iterator<Item = Vec2> {
    (0..POINTS).map(|i| lattice(i, POINTS)).map(|u| Vec2::new(0.5 * u.y, u.x))
}

static MIRROR: LazyLock<Table<true, SIDE, SIDE>> = LazyLock::new(|| {
    let points = Circle::new(half_turn());
    Table::build(|cos, r| ggx_means(cos, r, &points, |_| 0.0).0)
});
/// Albedo of Schlick's weight relative to that of a mirror.
static SCHLICK: LazyLock<Table<false, SIDE, SIDE>> = LazyLock::new(|| {
    let points = Circle::new(half_turn());
    Table::build(|cos, r| share(cos, r, &points, schlick_weight))
});
/// Points of the lattice for each entry of a [`Stretched`], and azimuths of one for mirrors and for glass.
const STRETCHED_POINTS: u32 = 512;
static STRETCHED_LATTICE: LazyLock<Vec<(Vec2, f32)>> = LazyLock::new(|| circle_lattice(STRETCHED_POINTS));
static STRETCHED_CIRCLE: LazyLock<Circle> =
    LazyLock::new(|| Circle::new((0..STRETCHED_POINTS).map(|i| lattice(i, STRETCHED_POINTS))));
const MIRROR_AZIMUTHS: usize = 32;
const GLASS_AZIMUTHS: usize = 64;
/// How often reflection and transmission are drawn on stretched glass at least.
const LEAST_SHARE: f32 = 0.02;

/// Albedo of stretched mirror facets, and that of Schlick's weight relative to it.
static ANISOTROPIC_MIRROR: LazyLock<Stretched> = LazyLock::new(|| {
    Stretched::new(MIRROR_AZIMUTHS, 1.0, |ggx, wo, _| {
        let (mirror, schlick) = mirror_means(ggx, wo, &STRETCHED_CIRCLE, schlick_weight);
        [mirror, schlick / mirror]
    })
});

static SHEEN: LazyLock<cloth::Cloth> = LazyLock::new(cloth::table);

/// Index of refraction of the clear coat, as `KHR_materials_clearcoat` fixes it.
pub(super) const COAT_IOR: f32 = 1.5;

/// Albedo of the clear coat relative to that of a mirror.
static COAT: LazyLock<Table<false, SIDE, { SIDE / 2 }>> = LazyLock::new(|| {
    let points = Circle::new(half_turn());
    Table::build(|cos, r| share(cos, r, &points, |d| dielectric(d, COAT_IOR)))
});

/// Albedo of a whole clear coat.
#[inline]
pub(super) fn coat_albedo(cos: f32, roughness: f32) -> f32 {
    if roughness * roughness < super::ALPHA_SPECULAR {
        return dielectric(cos, COAT_IOR);
    }
    MIRROR.at(cos, roughness) * COAT.at(cos, roughness)
}

/// Means over the hemisphere, ∫ 2 cos E dcos, of the four functions that a Schlick lobe's compensated albedo is made
/// of; by roughness.
static MEANS: LazyLock<[Vec4; SIDE]> = LazyLock::new(|| {
    const STEPS: u32 = 256;
    std::array::from_fn(|row| {
        let grain = Grain::new(row as f32 / (SIDE - 1) as f32);
        let mut sum = DVec4::ZERO;
        for i in 0..STEPS {
            let cos = (f64::from(i) + 0.5) / f64::from(STEPS);
            let g = GgxAlbedo::at(cos as f32, grain);
            let lost = g.lost();
            let all = Vec4::new(g.mirror, g.schlick, g.mirror * lost, g.schlick * lost);
            sum += 2.0 * cos * all.as_dvec4() / f64::from(STEPS);
        }
        sum.as_vec4()
    })
});

/// A roughness as the tables of GGX take it, for any number of cosines.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grain {
    /// [`Axis::k`] of it, 0 for a mirror.
    k: f32,
    /// The row below it, and the way to the next.
    row: u32,
    between: f32,
}

impl Grain {
    /// Of perceptual roughness `roughness`.
    #[inline]
    pub(super) fn new(roughness: f32) -> Self {
        let roughness = roughness.clamp(0.0, 1.0);
        let (row, between) = cell(roughness, SIDE);
        let k = if roughness * roughness < super::ALPHA_SPECULAR { 0.0 } else { Axis::k(roughness) };
        Self { k, row: row as u32, between }
    }

    #[inline]
    fn is_mirror(self) -> bool {
        self.k <= 0.0
    }

    #[inline]
    fn place(self) -> (usize, f32) {
        (self.row as usize, self.between)
    }
}

/// The two GGX albedos at one cosine and roughness.
#[derive(Debug, Clone, Copy)]
pub(super) struct GgxAlbedo {
    /// Of facets that reflect everything.
    pub(super) mirror: f32,
    /// Of facets that reflect Schlick's weight.
    pub(super) schlick: f32,
}

impl GgxAlbedo {
    #[inline]
    pub(super) fn at(cos: f32, grain: Grain) -> Self {
        if grain.is_mirror() {
            return Self { mirror: 1.0, schlick: schlick_weight(cos) };
        }
        let cos = cos.clamp(0.0, 1.0);
        let mirror = MIRROR.along(Axis::Shadowing.place(cos, grain.k), grain.place());
        Self { mirror, schlick: mirror * SCHLICK.along(Axis::Root.place(cos, grain.k), grain.place()) }
    }

    /// Of facets of the given widths, as seen from `o` in the lobe's own basis; `grain` stands for both widths.
    #[inline]
    pub(super) fn seen(alpha: Vec2, grain: Grain, o: Vec3A) -> Self {
        if grain.is_mirror() || (alpha.x - alpha.y).abs() <= f32::EPSILON * alpha.x {
            return Self::at(o.z, grain);
        }
        let [mirror, share] = ANISOTROPIC_MIRROR.at(alpha, o);
        let mirror = (mirror * (1.0 + ANISOTROPIC_MARGIN)).min(1.0);
        Self { mirror, schlick: mirror * share }
    }

    /// Light lost between facets, relative to what is reflected: 1 / S − 1.
    #[inline]
    pub(super) fn lost(self) -> f32 {
        1.0 / self.mirror - 1.0
    }

    /// Albedo of a Schlick lobe after compensation: (F₀ S + (F₉₀ − F₀) B)(1 + F₀ (1/S − 1)).
    #[inline]
    pub(super) fn compensated(self, f0: f32, f90: f32) -> f32 {
        (f0 * self.mirror + (f90 - f0) * self.schlick) * (1.0 + f0 * self.lost())
    }
}

/// Mean over the hemisphere of [`GgxAlbedo::compensated`].
#[inline]
pub(super) fn mean_compensated(grain: Grain, f0: f32, f90: f32) -> f32 {
    let [s, b, s_lost, b_lost] = if grain.is_mirror() {
        // ∫ 2 c (1 − c)⁵ dc = 2 (1/6 − 1/7) = 1/21.
        [1.0, 1.0 / 21.0, 0.0, 0.0]
    } else {
        let ((row, y), means) = (grain.place(), &*MEANS);
        (means[row] * (1.0 - y) + means[row + 1] * y).to_array()
    };
    f0 * s + (f90 - f0) * b + f0 * (f0 * s_lost + (f90 - f0) * b_lost)
}

/// What some materials of a scene ask for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wanted {
    pub(super) sheen: bool,
    pub(super) coat: bool,
}

/// Computes what every material reads, before rendering starts, and what is `wanted`.
pub(super) fn prepare(wanted: Wanted) {
    let Wanted { sheen, coat } = wanted;
    LazyLock::force(&MEANS);
    if coat {
        LazyLock::force(&COAT);
    }
    if sheen {
        LazyLock::force(&SHEEN);
    }
}

/// Albedo of white sheen.
#[inline]
pub(super) fn sheen_albedo(cos: f32, roughness: f32) -> f32 {
    SHEEN.at(cos, roughness) * (1.0 + SHEEN_MARGIN)
}

/// Albedos of a rough dielectric boundary of one index ratio, by cosine and roughness.
#[derive(Debug)]
pub(super) struct Glass {
    eta: f32,
    total: Table<true, 40, 24>,
    /// Reflection's share of the total.
    reflected: Table<false, 16, 12>,
    /// The total on stretched facets; made where they are met.
    stretched: OnceLock<Stretched>,
}

impl Glass {
    /// Tabulates the boundary behind which the medium is `eta` times as dense.
    pub(super) fn new(eta: f32) -> Self {
        let part = |(r, t): (f32, f32)| if r + t > 0.0 { r / (r + t) } else { 1.0 };
        let round = |r: f32| Ggx { alpha: Vec2::splat(r * r) };
        let (many, few) = (circle_lattice(512), circle_lattice(128));
        Self {
            eta,
            total: Table::build(|cos, r| {
                let (reflected, transmitted) = glass_mean(round(r), view(cos), eta, &many);
                reflected + transmitted
            }),
            // The share only decides how often either is sampled.
            reflected: Table::build(|cos, r| part(glass_mean(round(r), view(cos), eta, &few))),
            stretched: OnceLock::new(),
        }
    }

    /// What single scattering reflects and transmits at facets of widths `alpha`, seen from `o` in their own basis;
    /// `roughness` stands for both widths.
    ///
    /// From within, stretched facets begin to reflect totally at some azimuth, where the albedo has an edge: the greater of
    /// the entries around is taken, so that what is lost between facets may be given back too little, never too much.
    pub(super) fn seen(&self, alpha: Vec2, roughness: f32, o: Vec3A) -> (f32, f32) {
        let (total, share) = if (alpha.x - alpha.y).abs() <= f32::EPSILON * alpha.x {
            (self.total.at(o.z, roughness) * (1.0 + GLASS_MARGIN), self.reflected.at(o.z, roughness))
        } else {
            let table = self.stretched.get_or_init(|| {
                Stretched::new(GLASS_AZIMUTHS, self.eta, |ggx, wo, eta| {
                    let (reflected, transmitted) = glass_mean(ggx, wo, eta, &STRETCHED_LATTICE);
                    let total = reflected + transmitted;
                    [total, if total > 0.0 { reflected / total } else { 1.0 }]
                })
            });
            let [total, share] = table.most_at(alpha, o);
            // Beside the edge some views transmit though no entry around does.
            (total * (1.0 + ANISOTROPIC_GLASS_MARGIN), share.clamp(LEAST_SHARE, 1.0 - LEAST_SHARE))
        };
        let total = total.min(1.0);
        (total * share, total * (1.0 - share))
    }
}

/// What a rough boundary reflects and transmits, as means over visible normals at `points`.
fn glass_mean(ggx: Ggx, wo: Vec3A, eta: f32, points: &[(Vec2, f32)]) -> (f32, f32) {
    let count = points.len() as f64;
    let (mut reflected, mut transmitted) = (0.0_f64, 0.0_f64);
    for &(azimuth, v) in points {
        let h = ggx.visible_normal_around(wo, azimuth, v);
        let f = dielectric(wo.dot(h), eta);
        let r = reflect(wo, h);
        if r.z > 0.0 {
            reflected += f64::from(f * ggx.shadowing(wo, r));
        }
        if let Some(t) = refract(wo, h, eta)
            && t.z < 0.0
        {
            transmitted += f64::from((1.0 - f) * ggx.shadowing(wo, t));
        }
    }
    ((reflected / count) as f32, (transmitted / count) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tables against quadrature between their entries: the error that a white furnace can show.
    #[test]
    fn interpolated_albedos_are_within_two_thousandths() {
        let (mut worst, points) = ((0.0_f32, 0.0, 0.0), Circle::new(half_turn()));
        for i in 0..40_u16 {
            for j in 0..40_u16 {
                let (cos, r) = ((f32::from(i) + 0.37) / 40.0, (f32::from(j) + 0.61) / 40.0);
                let error = (GgxAlbedo::at(cos, Grain::new(r)).mirror - ggx_means(cos, r, &points, |_| 0.0).0).abs();
                if error > worst.0 {
                    worst = (error, cos, r);
                }
            }
        }
        assert!(worst.0 < 2e-3, "{worst:?}");
    }

    #[test]
    fn a_compensated_mirror_reflects_everything() {
        for i in 1..=20_u16 {
            for j in 0..=20_u16 {
                let g = GgxAlbedo::at(f32::from(i) / 20.0, Grain::new(f32::from(j) / 20.0));
                assert!((g.compensated(1.0, 1.0) - 1.0).abs() < 1e-5);
                assert!(g.compensated(0.04, 1.0) <= 1.0);
            }
        }
    }
}
