//! The scattering function at one vertex: a sum of lobes, sampled one at a time with one density over all.

mod weights;

use super::albedo::{COAT_IOR, GgxAlbedo, Glass, Grain};
use super::fresnel::{dielectric, f0_of, schlick_weight};
use super::ggx::{Ggx, reflect, refract};
use super::sheen::Sheen;
use super::tangent::Basis;
use super::{BsdfSample, Scatter};
use crate::numeric::ONE_MINUS;
use crate::trace::warp;
use glam::{Vec2, Vec3, Vec3A};

/// What a material amounts to at one point, in plain numbers: the input of [`Bsdf::new`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Parameters<'a> {
    /// Unit direction to the viewer.
    pub(super) wo: Vec3A,
    /// Normal of the true surface, on the viewer's side.
    pub(super) ng: Vec3A,
    /// Shading basis; the viewer is above it.
    pub(super) basis: Basis,
    /// Linear base colour.
    pub(super) base: Vec3,
    pub(super) metallic: f32,
    /// GGX widths along the basis's tangents.
    pub(super) alpha: Vec2,
    /// Reflectance of the dielectric at normal and grazing incidence.
    pub(super) f0: Vec3,
    pub(super) f90: f32,
    /// Reflectance of the metal at normal incidence.
    pub(super) metal_f0: Vec3,
    pub(super) transmission: f32,
    pub(super) boundary: Option<Boundary<'a>>,
    pub(super) diffuse_transmission: f32,
    pub(super) diffuse_transmission_color: Vec3,
    pub(super) coat: Option<CoatParameters>,
    pub(super) sheen: Option<(Vec3, f32)>,
    /// Whether facets, coat and glass are left out, as if they reflected and let through nothing.
    pub(super) diffuse_only: bool,
}

/// A refracting boundary between media.
#[derive(Debug, Clone, Copy)]
pub(super) struct Boundary<'a> {
    /// Index of the far side over that of the viewer's side.
    pub(super) eta: f32,
    /// Its albedos; `None` for one that is perfectly smooth.
    pub(super) glass: Option<&'a Glass>,
}

/// A clear coat.
#[derive(Debug, Clone, Copy)]
pub(super) struct CoatParameters {
    pub(super) factor: f32,
    /// GGX width.
    pub(super) alpha: f32,
    pub(super) basis: Basis,
}

/// Number of lobes, and their order.
const LOBES: usize = 8;
const DIFFUSE: usize = 0;
const THROUGH: usize = 1;
const SPECULAR: usize = 2;
const THIN: usize = 3;
const GLASS_REFLECTION: usize = 4;
const GLASS_TRANSMISSION: usize = 5;
const COAT: usize = 6;
const SHEEN: usize = 7;

/// A GGX reflection with Fresnel term `k0 + k1 (1 − cos)⁵`.
#[derive(Debug, Clone, Copy)]
struct Facets {
    ggx: Ggx,
    smooth: bool,
    k0: Vec3,
    k1: Vec3,
}

impl Facets {
    fn fresnel(&self, cos: f32) -> Vec3 {
        (self.k0 + self.k1 * schlick_weight(cos)).max(Vec3::ZERO)
    }

    /// f · cosᵢ and density of reflection from `o` to `i`, both above the surface.
    #[inline]
    fn reflection(&self, o: Vec3A, i: Vec3A) -> (Vec3, f32) {
        let h = (o + i).normalize();
        let pdf = self.ggx.reflection_pdf(o, h);
        // f · cosᵢ = pdf · G₂ / G₁ · F.
        (self.fresnel(o.dot(h)) * (pdf * self.ggx.shadowing(o, i)), pdf)
    }
}

#[derive(Debug, Clone, Copy)]
struct GlassLobe {
    eta: f32,
    /// Multiplies reflection and transmission.
    reflected: f32,
    transmitted: Vec3,
    /// Dielectric reflectance is remapped from [exact F₀, 1] to [`f0`, `f90`].
    f0: Vec3,
    f90: f32,
    /// Whether reflection and transmission are mirror-like.
    smooth: [bool; 2],
    /// Albedo of transmission, for boundaries too weak to bend light measurably.
    straight: f32,
}

impl GlassLobe {
    fn fresnel(&self, cos: f32) -> Vec3 {
        let exact = dielectric(cos, self.eta);
        if exact >= 1.0 || self.eta < 1.0 {
            return Vec3::splat(exact);
        }
        let base = f0_of(self.eta);
        let share = ((exact - base) / (1.0 - base)).clamp(0.0, 1.0);
        self.f0 + (Vec3::splat(self.f90) - self.f0) * share
    }
}

/// A clear coat: GGX reflection with the exact Fresnel term.
#[derive(Debug, Clone, Copy)]
struct Coat {
    basis: Basis,
    /// The viewer's direction in `basis`.
    o: Vec3A,
    ggx: Ggx,
    smooth: bool,
    /// Multiplies its reflectance.
    factor: f32,
}

impl Coat {
    fn fresnel(&self, cos: f32) -> f32 {
        self.factor * dielectric(cos, COAT_IOR)
    }

    /// As [`Facets::reflection`], to `i` in its own basis.
    fn reflection(&self, i: Vec3A) -> (Vec3, f32) {
        let h = (self.o + i).normalize();
        let pdf = self.ggx.reflection_pdf(self.o, h);
        (Vec3::splat(self.fresnel(self.o.dot(h)) * (pdf * self.ggx.shadowing(self.o, i))), pdf)
    }
}

/// What wide and narrow lobes give towards one direction.
///
/// Narrow lobes are those that sampling the lights serves worse than sampling the lobe: see [`Bsdf::is_wide`].
#[derive(Debug, Clone, Copy, Default)]
pub struct Evaluation {
    /// f · |cosᵢ| of the wide lobes.
    pub wide: Vec3,
    /// The same of the narrow ones.
    pub narrow: Vec3,
    /// Density by solid angle of drawing the direction from a wide lobe.
    pub wide_pdf: f32,
    /// The same from a narrow one.
    pub narrow_pdf: f32,
}

impl Evaluation {
    /// f · |cosᵢ| over all lobes.
    #[must_use]
    pub fn value(&self) -> Vec3 {
        self.wide + self.narrow
    }

    /// Density by solid angle of drawing the direction from any lobe.
    #[must_use]
    pub fn pdf(&self) -> f32 {
        self.wide_pdf + self.narrow_pdf
    }
}

/// The scattering function at one vertex, for one direction to the viewer.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    ng: Vec3A,
    basis: Basis,
    /// The viewer's direction in the shading basis.
    o: Vec3A,
    /// The facets' roughness, one for both widths; 0 for mirrors.
    grain: Grain,
    /// Greatest channel of the dielectric's reflectance at normal and grazing incidence: what lies below is lit by
    /// what it lets through.
    over: (f32, f32),
    diffuse: Vec3,
    through: Vec3,
    specular: Facets,
    /// Thin transmission `t0 + t1 (1 − cos)⁵`, with the facets of `specular`.
    thin: (Vec3, Vec3),
    glass: Option<GlassLobe>,
    coat: Option<Coat>,
    sheen: Option<(Vec3, Sheen)>,
    /// Probability of each lobe; sums to 1, or to 0 for a black surface.
    chance: [f32; LOBES],
    rough: bool,
}

impl Bsdf {
    fn is_smooth(&self, lobe: usize) -> bool {
        match lobe {
            SPECULAR | THIN => self.specular.smooth,
            GLASS_REFLECTION => self.glass.is_some_and(|g| g.smooth[0]),
            GLASS_TRANSMISSION => self.glass.is_some_and(|g| g.smooth[1]),
            COAT => self.coat.is_some_and(|c| c.smooth),
            _ => false,
        }
    }

    /// Whether no lobe has a density: light sampling is pointless here.
    #[must_use]
    pub fn is_specular_only(&self) -> bool {
        !self.rough
    }

    /// Whether every lobe is so wide that sampling the lights serves it at least as well as sampling the lobe: no
    /// mirror, and no GGX width below a quarter (roughness ½), where a lobe spans about a steradian.
    #[must_use]
    pub fn is_wide(&self) -> bool {
        (0..LOBES).all(|lobe| self.chance[lobe] <= 0.0 || !self.is_narrow(lobe))
    }

    fn is_narrow(&self, lobe: usize) -> bool {
        const WIDE: f32 = 0.25;
        match lobe {
            SPECULAR | THIN => self.specular.smooth || self.specular.ggx.alpha.min_element() < WIDE,
            GLASS_REFLECTION | GLASS_TRANSMISSION | COAT => true,
            _ => false,
        }
    }

    /// Draws narrow lobes `eagerness` times as often, in up to half of all cases: what they show of lamps no light sample
    /// finds, while wide ones are served by both.
    pub fn favour_narrow_lobes(&mut self, eagerness: f32) {
        let narrow: f32 = (0..LOBES).filter(|&lobe| self.is_narrow(lobe)).map(|lobe| self.chance[lobe]).sum();
        let wanted = (eagerness * narrow).min(0.5).max(narrow);
        if narrow <= 0.0 || wanted <= narrow {
            return;
        }
        let (times, rest) = (wanted / narrow, (1.0 - wanted) / (1.0 - narrow));
        for lobe in 0..LOBES {
            self.chance[lobe] *= if self.is_narrow(lobe) { times } else { rest };
        }
    }

    /// The same surface with its narrow lobes alone, drawn `eagerness` times as often as among all, or always: the
    /// probability with which any is drawn, how many times as often each is, and the lobes. `None` where all are wide.
    #[must_use]
    pub fn narrow_lobes(&self, eagerness: f32) -> Option<(f32, f32, Self)> {
        let chance: [f32; LOBES] =
            std::array::from_fn(|lobe| if self.is_narrow(lobe) { self.chance[lobe] } else { 0.0 });
        let among_all: f32 = chance.iter().sum();
        let drawn = (eagerness * among_all).min(1.0);
        if drawn <= 0.0 {
            return None;
        }
        let times = drawn / among_all;
        Some((drawn, times, Self { chance: chance.map(|c| c * times), ..*self }))
    }

    /// Whether nothing is scattered at all.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.chance.iter().all(|&c| c <= 0.0)
    }

    /// Whether any lobe crosses the surface.
    #[must_use]
    pub fn transmits(&self) -> bool {
        [THROUGH, THIN, GLASS_TRANSMISSION].iter().any(|&lobe| self.chance[lobe] > 0.0)
    }

    /// The normal of the true surface, on the viewer's side.
    #[must_use]
    pub fn geometric_normal(&self) -> Vec3A {
        self.ng
    }

    /// The shading normal, on the viewer's side.
    #[must_use]
    pub fn shading_normal(&self) -> Vec3A {
        self.basis.n
    }

    /// f · |cosᵢ| and the density of sampling `wi` by solid angle, over all lobes that have one.
    #[must_use]
    pub fn eval(&self, wi: Vec3A) -> (Vec3, f32) {
        let e = self.evaluate(wi);
        (e.value(), e.pdf())
    }

    /// As [`Bsdf::eval`], wide and narrow lobes apart.
    #[must_use]
    pub fn evaluate(&self, wi: Vec3A) -> Evaluation {
        let i = self.basis.local(wi);
        let mut sum = Evaluation::default();
        let mut add = |lobe: usize, (v, density): (Vec3, f32)| {
            if self.is_narrow(lobe) {
                sum.narrow += v;
                sum.narrow_pdf += self.chance[lobe] * density;
            } else {
                sum.wide += v;
                sum.wide_pdf += self.chance[lobe] * density;
            }
        };
        if wi.dot(self.ng) > 0.0 {
            if i.z > 0.0 {
                if self.chance[DIFFUSE] > 0.0 {
                    add(DIFFUSE, self.diffuse_value(self.diffuse, i.z));
                }
                if self.chance[SPECULAR] > 0.0 && !self.specular.smooth {
                    add(SPECULAR, self.specular.reflection(self.o, i));
                }
                if let Some(g) = self.glass.filter(|g| self.chance[GLASS_REFLECTION] > 0.0 && !g.smooth[0]) {
                    add(GLASS_REFLECTION, self.glass_reflection(&g, i));
                }
                if let Some((color, sheen)) = self.sheen.filter(|_| self.chance[SHEEN] > 0.0) {
                    add(SHEEN, (color * sheen.value(self.o, i), warp::uniform_hemisphere_pdf()));
                }
            }
            if let Some(coat) = self.coat.filter(|c| self.chance[COAT] > 0.0 && !c.smooth) {
                let i = coat.basis.local(wi);
                if i.z > 0.0 {
                    add(COAT, coat.reflection(i));
                }
            }
        } else if i.z < 0.0 {
            if self.chance[THROUGH] > 0.0 {
                add(THROUGH, self.diffuse_value(self.through, -i.z));
            }
            if self.chance[THIN] > 0.0 && !self.specular.smooth {
                add(THIN, self.thin_transmission(i));
            }
            if let Some(g) = self.glass.filter(|g| self.chance[GLASS_TRANSMISSION] > 0.0 && !g.smooth[1]) {
                add(GLASS_TRANSMISSION, self.glass_transmission(&g, i));
            }
        }
        debug_assert!(sum.value().is_finite() && sum.pdf().is_finite(), "{sum:?}");
        sum
    }

    fn diffuse_value(&self, color: Vec3, cos: f32) -> (Vec3, f32) {
        let lit = 1.0 - GgxAlbedo::at(cos, self.grain).compensated(self.over.0, self.over.1);
        let pdf = warp::cosine_hemisphere_pdf(cos);
        (color * (lit.max(0.0) * pdf), pdf)
    }

    fn thin_transmission(&self, i: Vec3A) -> (Vec3, f32) {
        let mirrored = Vec3A::new(i.x, i.y, -i.z);
        let h = (self.o + mirrored).normalize();
        let pdf = self.specular.ggx.reflection_pdf(self.o, h);
        let color = (self.thin.0 + self.thin.1 * schlick_weight(self.o.dot(h))).max(Vec3::ZERO);
        (color * (pdf * self.specular.ggx.shadowing(self.o, mirrored)), pdf)
    }

    fn glass_reflection(&self, g: &GlassLobe, i: Vec3A) -> (Vec3, f32) {
        let h = (self.o + i).normalize();
        let pdf = self.specular.ggx.reflection_pdf(self.o, h);
        (g.fresnel(self.o.dot(h)) * (g.reflected * pdf * self.specular.ggx.shadowing(self.o, i)), pdf)
    }

    /// Refraction through facets (Walter et al. 2007, eq. 17 and 21), with h from o + η i.
    fn glass_transmission(&self, g: &GlassLobe, i: Vec3A) -> (Vec3, f32) {
        let Some(h) = (self.o + g.eta * i).try_normalize() else { return (Vec3::ZERO, 0.0) };
        let h = if h.z < 0.0 { -h } else { h };
        let (oh, ih) = (self.o.dot(h), i.dot(h));
        if oh <= 0.0 || ih >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let root = oh + g.eta * ih;
        let jacobian = g.eta * g.eta * -ih / (root * root);
        let pdf = self.specular.ggx.visible_density(self.o, h) * oh * jacobian;
        if !pdf.is_finite() {
            // The singular direction that nothing bends: of measure zero.
            return (Vec3::ZERO, 0.0);
        }
        let passed = Vec3::ONE - g.fresnel(oh);
        (passed * g.transmitted * (pdf * self.specular.ggx.shadowing(self.o, i)), pdf)
    }

    /// Draws a direction.
    ///
    /// `u` places it within its lobe; the lobe is chosen by rescaling `u.x`, or by `extra` at vertices that are
    /// specular only, whose lobes need no placing. `None` is an absorbed path.
    #[must_use]
    pub fn sample(&self, u: Vec2, extra: f32) -> Option<BsdfSample> {
        let (lobe, u_lobe) = self.choose(if self.rough { u.x } else { extra })?;
        let u = if self.rough { Vec2::new(u_lobe, u.y) } else { u };
        let (ggx, o) = (self.specular.ggx, self.o);
        if self.is_smooth(lobe) {
            return self.specular_sample(lobe);
        }
        let (local, alpha) = match lobe {
            DIFFUSE => (warp::cosine_hemisphere_from_square(u), 1.0),
            THROUGH => (-warp::cosine_hemisphere_from_square(u), 1.0),
            SHEEN => (warp::uniform_hemisphere_from_square(u), 1.0),
            SPECULAR | GLASS_REFLECTION => (reflect(o, ggx.visible_normal(o, u)), ggx.alpha.max_element()),
            THIN => {
                let r = reflect(o, ggx.visible_normal(o, u));
                (Vec3A::new(r.x, r.y, -r.z), ggx.alpha.max_element())
            }
            GLASS_TRANSMISSION => {
                let eta = self.glass?.eta;
                let t = refract(o, ggx.visible_normal(o, u), eta)?;
                (t, ggx.alpha.max_element() * (eta - 1.0).abs().min(1.0))
            }
            _ => {
                let coat = self.coat?;
                (reflect(coat.o, coat.ggx.visible_normal(coat.o, u)), coat.ggx.alpha.max_element())
            }
        };
        let basis = if lobe == COAT { &self.coat?.basis } else { &self.basis };
        let wi = basis.world(local).normalize();
        let transmitted = wi.dot(self.ng) <= 0.0;
        // Light that would leave on the lobe's wrong side, by its own normal or the true one, is lost between facets, not
        // another lobe's: none of them says how often it is drawn.
        let crosses = matches!(lobe, THROUGH | THIN | GLASS_TRANSMISSION);
        if transmitted != crosses || (local.z <= 0.0) != crosses {
            return None;
        }
        let e = self.evaluate(wi);
        let (value, pdf) = (e.value(), e.pdf());
        if pdf <= 0.0 || value == Vec3::ZERO {
            return None;
        }
        Some(BsdfSample {
            wi,
            throughput: value / pdf,
            pdf_solid_angle: pdf,
            scatter: Scatter::Rough,
            transmitted,
            refracted: transmitted && self.glass.is_some(),
            alpha,
        })
    }

    /// The lobe that `u` falls on, and `u` rescaled within it.
    fn choose(&self, u: f32) -> Option<(usize, f32)> {
        let mut below = 0.0;
        let mut last = None;
        for (lobe, &chance) in self.chance.iter().enumerate() {
            if chance <= 0.0 {
                continue;
            }
            if u < below + chance {
                return Some((lobe, ((u - below) / chance).clamp(0.0, ONE_MINUS)));
            }
            below += chance;
            last = Some((lobe, ONE_MINUS));
        }
        // The chances' sum may round to just below 1.
        last
    }

    fn specular_sample(&self, lobe: usize) -> Option<BsdfSample> {
        let o = self.o;
        let mirrored = || self.basis.world(Vec3A::new(-o.x, -o.y, o.z));
        let (wi, weight) = match lobe {
            SPECULAR => (mirrored(), self.specular.fresnel(o.z)),
            THIN => (self.basis.world(-o), (self.thin.0 + self.thin.1 * schlick_weight(o.z)).max(Vec3::ZERO)),
            GLASS_REFLECTION => {
                let g = self.glass?;
                (mirrored(), g.fresnel(o.z) * g.reflected)
            }
            GLASS_TRANSMISSION => {
                let g = self.glass?;
                let t = refract(o, Vec3A::Z, g.eta)?;
                let passed = if g.smooth[0] { Vec3::ONE - g.fresnel(o.z) } else { Vec3::splat(g.straight) };
                (self.basis.world(t), passed * g.transmitted)
            }
            _ => {
                let c = self.coat?;
                (c.basis.world(Vec3A::new(-c.o.x, -c.o.y, c.o.z)), Vec3::splat(c.fresnel(c.o.z)))
            }
        };
        let wi = wi.normalize();
        let crosses = matches!(lobe, THIN | GLASS_TRANSMISSION);
        if (wi.dot(self.ng) <= 0.0) != crosses || weight == Vec3::ZERO {
            return None;
        }
        Some(BsdfSample {
            wi,
            throughput: weight / self.chance[lobe],
            pdf_solid_angle: 0.0,
            scatter: Scatter::Specular,
            transmitted: crosses,
            refracted: lobe == GLASS_TRANSMISSION,
            alpha: 0.0,
        })
    }
}
