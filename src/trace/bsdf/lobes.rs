//! The scattering function at one vertex: a sum of lobes, sampled one at a time with one density over all.

use super::albedo::{self, GgxAlbedo, Glass};
use super::fresnel::{dielectric, f0_of, schlick_weight};
use super::ggx::{Ggx, reflect, refract};
use super::tangent::Basis;
use super::{ALPHA_SPECULAR, BsdfSample, Scatter, sheen};
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
    pub(super) roughness: f32,
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

#[derive(Debug, Clone, Copy)]
struct Coat {
    basis: Basis,
    o: Vec3A,
    facets: Facets,
}

/// The scattering function at one vertex, for one direction to the viewer.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    ng: Vec3A,
    basis: Basis,
    /// The viewer's direction in the shading basis.
    o: Vec3A,
    roughness: f32,
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
    sheen: Option<(Vec3, f32)>,
    /// Probability of each lobe; sums to 1, or to 0 for a black surface.
    chance: [f32; LOBES],
    rough: bool,
}

/// Widths as sampled: below the limit in both axes a mirror, in one a clamped highlight.
fn widths(alpha: Vec2) -> (Ggx, bool) {
    let smooth = alpha.max_element() < ALPHA_SPECULAR;
    (Ggx { alpha: alpha.max(Vec2::splat(ALPHA_SPECULAR)) }, smooth)
}

impl Bsdf {
    /// Weighs the lobes for `p`.
    pub(super) fn new(p: &Parameters<'_>) -> Self {
        let o = {
            let o = p.basis.local(p.wo);
            Vec3A::new(o.x, o.y, o.z.max(f32::MIN_POSITIVE))
        };
        let (ggx, smooth) = widths(p.alpha);
        // Tables are isotropic: the geometric mean of the widths stands for both.
        let roughness = if smooth { 0.0 } else { (ggx.alpha.x * ggx.alpha.y).sqrt().sqrt() };
        let e = GgxAlbedo::seen(ggx.alpha, roughness, o);
        let over = (p.f0.max_element(), p.f90.max(p.f0.max_element()));

        let (coat, coat_albedo) = Self::coat_of(p);
        let sheen_albedo = p.sheen.map_or(0.0, |(_, r)| albedo::sheen_albedo(o.z, r));
        let sheen_most = p.sheen.map_or(0.0, |(c, _)| c.max_element()) * sheen_albedo;
        let under_coat = (1.0 - coat_albedo).max(0.0);
        let under = under_coat * (1.0 - sheen_most).max(0.0);
        // Sheen at grazing views reflects more than it receives; then it is scaled to reflect all.
        let sheen = p.sheen.map(|(c, r)| (c * (under_coat / sheen_most.max(1.0)), sheen::alpha(r)));

        let (metal, body) = (under * p.metallic, under * (1.0 - p.metallic));
        let (solid, clear) = (body * (1.0 - p.transmission), body * p.transmission);

        // Dielectric and metal reflect with the same facets; glass with its own, exact Fresnel term.
        let film = if p.boundary.is_some() { solid } else { body };
        let dielectric_scale = Vec3::ONE + p.f0 * e.lost();
        let metal_scale = Vec3::ONE + p.metal_f0 * e.lost();
        let specular = Facets {
            ggx,
            smooth,
            k0: metal * metal_scale * p.metal_f0 + film * dielectric_scale * p.f0,
            k1: metal * metal_scale * (Vec3::ONE - p.metal_f0) + film * dielectric_scale * (Vec3::splat(p.f90) - p.f0),
        };

        let below = 1.0 - albedo::mean_compensated(roughness, over.0, over.1);
        let lit = (1.0 - e.compensated(over.0, over.1)).max(0.0);
        // A dielectric that reflects all but rounding has nothing below it.
        let diffuse_scale = if below > crate::numeric::gamma(1024) { solid * lit / below } else { 0.0 };
        let diffuse = p.base * (diffuse_scale * (1.0 - p.diffuse_transmission));
        let through = p.diffuse_transmission_color * (diffuse_scale * p.diffuse_transmission);

        let thin = if p.boundary.is_none() { Self::thin_of(p, e, clear) } else { (Vec3::ZERO, Vec3::ZERO) };
        let glass = p.boundary.map(|b| Self::glass_of(p, b, o.z, roughness, smooth, clear));

        let mut bsdf = Self {
            ng: p.ng,
            basis: p.basis,
            o,
            roughness,
            over,
            diffuse,
            through,
            specular,
            thin,
            glass: glass.map(|(lobe, _)| lobe),
            coat,
            sheen,
            chance: [0.0; LOBES],
            rough: false,
        };
        let mean = |v: Vec3| v.element_sum() / 3.0;
        let glass_albedo = glass.map_or((0.0, 0.0), |(_, albedo)| albedo);
        bsdf.weigh([
            mean(diffuse) * below,
            mean(through) * below,
            mean(specular.k0 * e.mirror + specular.k1 * e.schlick),
            mean(thin.0 * e.mirror + thin.1 * e.schlick),
            glass_albedo.0,
            glass_albedo.1,
            coat_albedo,
            sheen.map_or(0.0, |(c, _)| mean(c)) * sheen_albedo,
        ]);
        bsdf
    }

    fn coat_of(p: &Parameters<'_>) -> (Option<Coat>, f32) {
        let Some(c) = p.coat.filter(|c| c.factor > 0.0) else { return (None, 0.0) };
        let alpha = c.roughness * c.roughness;
        let (ggx, smooth) = widths(Vec2::splat(alpha));
        let o = c.basis.local(p.wo);
        let o = Vec3A::new(o.x, o.y, o.z.max(f32::MIN_POSITIVE));
        let e = GgxAlbedo::at(o.z, if smooth { 0.0 } else { c.roughness });
        let (k0, k1) = (c.factor * COAT_F0, c.factor * (1.0 - COAT_F0));
        let facets = Facets { ggx, smooth, k0: Vec3::splat(k0), k1: Vec3::splat(k1) };
        (Some(Coat { basis: c.basis, o, facets }), k0 * e.mirror + k1 * e.schlick)
    }

    /// What thin transmission multiplies 1 and Schlick's weight with: all that reflection leaves goes through.
    fn thin_of(p: &Parameters<'_>, e: GgxAlbedo, clear: f32) -> (Vec3, Vec3) {
        let f90 = Vec3::splat(p.f90);
        let reflected = p.f0 * e.mirror + (f90 - p.f0) * e.schlick;
        let available = Vec3::splat(e.mirror) - reflected;
        let wanted = (Vec3::ONE - reflected * (Vec3::ONE + p.f0 * e.lost())).max(Vec3::ZERO);
        // Where facets reflect all but rounding, nothing goes through.
        let least = crate::numeric::gamma(64);
        let scale = Vec3::from_array(std::array::from_fn(|c| {
            if available[c] > least { clear * p.base[c] * wanted[c] / available[c] } else { 0.0 }
        }));
        (scale * (Vec3::ONE - p.f0), scale * (p.f0 - f90))
    }

    fn glass_of(
        p: &Parameters<'_>,
        b: Boundary<'_>,
        cos: f32,
        roughness: f32,
        smooth: bool,
        clear: f32,
    ) -> (GlassLobe, (f32, f32)) {
        let exact = dielectric(cos, b.eta);
        let (r, t) = match b.glass {
            Some(glass) if !smooth => glass.at(cos, roughness),
            _ => (exact, 1.0 - exact),
        };
        // What single scattering loses between facets goes on in the same proportion.
        let scale = clear / (r + t).max(0.25);
        // Entering and leaving each tint by the root, so that a body's colour is its base colour.
        let tint = p.base.max(Vec3::ZERO).map(f32::sqrt);
        // An index step too small for the facets' slopes to bend light measurably sends it straight on.
        let straight = smooth || (b.eta - 1.0).abs() * p.alpha.max_element() < ALPHA_SPECULAR;
        let blocked =
            straight && refract(Vec3A::new((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos), Vec3A::Z, b.eta).is_none();
        let transmitted = if blocked { Vec3::ZERO } else { tint * scale };
        let lobe = GlassLobe {
            eta: b.eta,
            reflected: scale,
            transmitted,
            f0: p.f0,
            f90: p.f90,
            smooth: [smooth, straight],
            straight: t,
        };
        let at_normal = lobe.fresnel(cos).element_sum() / 3.0;
        let (r, t) = if smooth { (at_normal, 1.0 - at_normal) } else { (r.max(1e-3 * at_normal), t) };
        (lobe, (scale * r, transmitted.element_sum() / 3.0 * t))
    }

    /// Sets the lobes' probabilities in proportion to `albedos`.
    fn weigh(&mut self, albedos: [f32; LOBES]) {
        let albedos = albedos.map(|a| if a.is_finite() { a.max(0.0) } else { 0.0 });
        let total: f32 = albedos.iter().sum();
        if total > 0.0 {
            self.chance = albedos.map(|a| a / total);
        }
        self.rough = (0..LOBES).any(|lobe| self.chance[lobe] > 0.0 && !self.is_smooth(lobe));
    }

    fn is_smooth(&self, lobe: usize) -> bool {
        match lobe {
            SPECULAR | THIN => self.specular.smooth,
            GLASS_REFLECTION => self.glass.is_some_and(|g| g.smooth[0]),
            GLASS_TRANSMISSION => self.glass.is_some_and(|g| g.smooth[1]),
            COAT => self.coat.is_some_and(|c| c.facets.smooth),
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
        const WIDE: f32 = 0.25;
        let narrow = |lobe: usize| match lobe {
            SPECULAR | THIN => self.specular.smooth || self.specular.ggx.alpha.min_element() < WIDE,
            GLASS_REFLECTION | GLASS_TRANSMISSION | COAT => true,
            _ => false,
        };
        (0..LOBES).all(|lobe| self.chance[lobe] <= 0.0 || !narrow(lobe))
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
        let i = self.basis.local(wi);
        let (mut value, mut pdf) = (Vec3::ZERO, 0.0);
        let mut add = |lobe: usize, (v, density): (Vec3, f32)| {
            value += v;
            pdf += self.chance[lobe] * density;
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
                if let Some((color, alpha)) = self.sheen {
                    add(SHEEN, (color * sheen::value(alpha, self.o, i), warp::uniform_hemisphere_pdf()));
                }
            }
            if let Some(coat) = self.coat.filter(|c| !c.facets.smooth) {
                let i = coat.basis.local(wi);
                if i.z > 0.0 {
                    add(COAT, coat.facets.reflection(coat.o, i));
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
        debug_assert!(value.is_finite() && pdf.is_finite(), "{value} {pdf}");
        (value, pdf)
    }

    fn diffuse_value(&self, color: Vec3, cos: f32) -> (Vec3, f32) {
        let lit = 1.0 - GgxAlbedo::at(cos, self.roughness).compensated(self.over.0, self.over.1);
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
        let (wi, alpha) = match lobe {
            DIFFUSE => (self.basis.world(warp::cosine_hemisphere_from_square(u)), 1.0),
            THROUGH => (self.basis.world(-warp::cosine_hemisphere_from_square(u)), 1.0),
            SHEEN => (self.basis.world(warp::uniform_hemisphere_from_square(u)), 1.0),
            SPECULAR | GLASS_REFLECTION => {
                (self.basis.world(reflect(o, ggx.visible_normal(o, u))), ggx.alpha.max_element())
            }
            THIN => {
                let r = reflect(o, ggx.visible_normal(o, u));
                (self.basis.world(Vec3A::new(r.x, r.y, -r.z)), ggx.alpha.max_element())
            }
            GLASS_TRANSMISSION => {
                let eta = self.glass?.eta;
                let t = refract(o, ggx.visible_normal(o, u), eta)?;
                (self.basis.world(t), ggx.alpha.max_element() * (eta - 1.0).abs().min(1.0))
            }
            _ => {
                let coat = self.coat?;
                let i = reflect(coat.o, coat.facets.ggx.visible_normal(coat.o, u));
                (coat.basis.world(i), coat.facets.ggx.alpha.max_element())
            }
        };
        let wi = wi.normalize();
        let transmitted = wi.dot(self.ng) <= 0.0;
        // Light that would leave on the lobe's wrong side is lost between facets, not another lobe's.
        if transmitted != matches!(lobe, THROUGH | THIN | GLASS_TRANSMISSION) {
            return None;
        }
        let (value, pdf) = self.eval(wi);
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
                (c.basis.world(Vec3A::new(-c.o.x, -c.o.y, c.o.z)), c.facets.fresnel(c.o.z))
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

/// Reflectance of the clear coat at normal incidence: index 1.5, as `KHR_materials_clearcoat` fixes it.
const COAT_F0: f32 = 0.04;
