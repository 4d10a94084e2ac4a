//! What each lobe weighs for one view, and how often it is drawn.

use super::super::ALPHA_SPECULAR;
use super::super::albedo::{self, GgxAlbedo, Grain};
use super::super::fresnel::dielectric;
use super::super::ggx::{Ggx, refract};
use super::super::sheen::{self, Sheen};
use super::{Boundary, Bsdf, Coat, Facets, GlassLobe, LOBES, Parameters};
use glam::{Vec2, Vec3, Vec3A};

/// Widths as sampled: below the limit in both axes a mirror, in one a clamped highlight.
fn widths(alpha: Vec2) -> (Ggx, bool) {
    let smooth = alpha.max_element() < ALPHA_SPECULAR;
    (Ggx { alpha: alpha.max(Vec2::splat(ALPHA_SPECULAR)) }, smooth)
}

impl Bsdf {
    /// Weighs the lobes for `p`.
    pub(in crate::trace::bsdf) fn new(p: &Parameters<'_>) -> Self {
        let o = {
            let o = p.basis.local(p.wo);
            Vec3A::new(o.x, o.y, o.z.max(f32::MIN_POSITIVE))
        };
        let (ggx, smooth) = widths(p.alpha);
        // Tables are isotropic: the geometric mean of the widths stands for both.
        let roughness = if smooth { 0.0 } else { (ggx.alpha.x * ggx.alpha.y).sqrt().sqrt() };
        let grain = Grain::new(roughness);
        let e = GgxAlbedo::seen(ggx.alpha, grain, o);
        let over = (p.f0.max_element(), p.f90.max(p.f0.max_element()));

        let (coat, coat_albedo) = Self::coat_of(p);
        let sheen_albedo = p.sheen.map_or(0.0, |(_, r)| albedo::sheen_albedo(o.z, r));
        let sheen_most = p.sheen.map_or(0.0, |(c, _)| c.max_element()) * sheen_albedo;
        let under_coat = (1.0 - coat_albedo).max(0.0);
        let under = under_coat * (1.0 - sheen_most).max(0.0);
        // Sheen at grazing views reflects more than it receives; then it is scaled to reflect all.
        let sheen = p.sheen.map(|(c, r)| (c * (under_coat / sheen_most.max(1.0)), Sheen::new(sheen::alpha(r), o.z)));

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

        let below = 1.0 - albedo::mean_compensated(grain, over.0, over.1);
        let lit = (1.0 - e.compensated(over.0, over.1)).max(0.0);
        // A dielectric that reflects all but rounding has nothing below it.
        let diffuse_scale = if below > crate::numeric::gamma(1024) { solid * lit / below } else { 0.0 };
        let diffuse = p.base * (diffuse_scale * (1.0 - p.diffuse_transmission));
        let through = p.diffuse_transmission_color * (diffuse_scale * p.diffuse_transmission);

        let is_thin = p.boundary.is_none() && clear > 0.0;
        let thin = if is_thin { Self::thin_of(p, e, clear) } else { (Vec3::ZERO, Vec3::ZERO) };
        let glass = p.boundary.map(|b| Self::glass_of(p, b, o, (ggx, roughness, smooth), clear));

        let mut bsdf = Self {
            ng: p.ng,
            basis: p.basis,
            o,
            grain,
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
        let facets = if p.diffuse_only { 0.0 } else { 1.0 };
        bsdf.weigh([
            mean(diffuse) * below,
            mean(through) * below,
            facets * mean(specular.k0 * e.mirror + specular.k1 * e.schlick),
            facets * mean(thin.0 * e.mirror + thin.1 * e.schlick),
            facets * glass_albedo.0,
            facets * glass_albedo.1,
            facets * coat_albedo,
            sheen.map_or(0.0, |(c, _)| mean(c)) * sheen_albedo,
        ]);
        bsdf
    }

    fn coat_of(p: &Parameters<'_>) -> (Option<Coat>, f32) {
        let Some(c) = p.coat.filter(|c| c.factor > 0.0) else { return (None, 0.0) };
        let (ggx, smooth) = widths(Vec2::splat(c.alpha));
        let o = c.basis.local(p.wo);
        let o = Vec3A::new(o.x, o.y, o.z.max(f32::MIN_POSITIVE));
        let albedo = c.factor * albedo::coat_albedo(o.z, if smooth { 0.0 } else { c.alpha.sqrt() });
        (Some(Coat { basis: c.basis, o, ggx, smooth, factor: c.factor }), albedo)
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
        o: Vec3A,
        (ggx, roughness, smooth): (Ggx, f32, bool),
        clear: f32,
    ) -> (GlassLobe, (f32, f32)) {
        let cos = o.z;
        let exact = dielectric(cos, b.eta);
        let (r, t) = match b.glass {
            Some(glass) if !smooth => glass.seen(ggx.alpha, roughness, o),
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
}
