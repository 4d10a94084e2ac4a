//! Lights of `KHR_lights_punctual`, with the extents that `extras` give them: points, spheres, spots, suns.
//!
//! Units are the extension's: candela for points and spots, lux for directional lights. A radius spreads the same
//! intensity over a sphere of uniform radiance I / (π r²); an angular radius the same illuminance over a disc of the
//! sky of uniform radiance E / (π sin² r).

use super::tree::Extent;
use crate::numeric::luminance;
use crate::scene::{LightShape, StageLight};
use crate::trace::warp;
use glam::{Vec2, Vec3, Vec3A};
use std::f32::consts::PI;

/// Spheres smaller than this, metres, are points: the square of what their radius is to a kilometre must not be lost
/// to underflow (10⁻³⁰ of the least normal number's 10⁻³⁸).
const LEAST_RADIUS: f32 = 1e-12;
/// Discs of the sky narrower than this, radians, are points: half the square must be a normal number, and no picture
/// resolves a millionth of an arc second.
const LEAST_ANGLE: f32 = 5e-12;

/// How a light is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Nature {
    /// At one place: no other way than light sampling finds it.
    Point,
    /// From one direction.
    Direction,
    /// A sphere.
    Sphere,
    /// A disc of the sky.
    Disc,
}

/// Which way a light sampled at a point arrives.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    pub(super) wi: Vec3A,
    pub(super) distance: f32,
    /// Radiance; for points and directions irradiance on a surface that faces the light.
    pub(super) light: Vec3,
    /// Density by solid angle; 1 for points and directions.
    pub(super) pdf_solid_angle: f32,
}

/// Where a light is, and its axis (−z).
type Pose = (Vec3A, Vec3A);

/// A light of the stage, with what follows from it once for all points that it lights.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lamp<'a> {
    of: &'a StageLight,
    nature: Nature,
    /// Its pose where that is one and the same throughout the exposure.
    still: Option<Pose>,
    /// Cosines of a spot's inner and outer cone.
    cones: Option<[f32; 2]>,
}

/// The light's pose at `u_time`.
fn pose(light: &StageLight, u_time: f32) -> Pose {
    let m = light.motion.at(u_time);
    (m.translation, (-m.matrix3.z_axis).try_normalize().unwrap_or(Vec3A::NEG_Z))
}

/// The way to the centre of a sphere at `place`, and its length. `None` from inside: it has no surface that shines inwards.
fn outside(radius: f32, place: Vec3A, from: Vec3A) -> Option<(Vec3A, f32)> {
    let to = place - from;
    let distance = to.length();
    (distance > radius && distance.is_finite()).then_some((to, distance))
}

/// 1 − cos of the half angle under which a sphere of `radius` is seen from `distance` > `radius`.
fn sphere_one_minus_cos(radius: f32, distance: f32) -> f32 {
    let s = radius / distance;
    let s2 = s * s;
    s2 / (1.0 + (1.0 - s2).max(0.0).sqrt())
}

impl<'a> Lamp<'a> {
    pub(super) fn new(of: &'a StageLight) -> Self {
        let nature = match of.light.shape {
            LightShape::Directional { angular_radius } if angular_radius > LEAST_ANGLE => Nature::Disc,
            LightShape::Directional { .. } => Nature::Direction,
            LightShape::Point { radius } | LightShape::Spot { radius, .. } if radius > LEAST_RADIUS => Nature::Sphere,
            LightShape::Point { .. } | LightShape::Spot { .. } => Nature::Point,
        };
        let cones = match of.light.shape {
            LightShape::Spot { inner_cone, outer_cone, .. } => Some([inner_cone, outer_cone].map(libm::cosf)),
            _ => None,
        };
        Self { of, nature, still: of.motion.is_still().then(|| pose(of, 0.0)), cones }
    }

    pub(super) fn nature(&self) -> Nature {
        self.nature
    }

    /// Its pose at `u_time`, if it is there then.
    fn pose(&self, u_time: f32) -> Option<Pose> {
        let there = self.of.motion.presence().holds(u_time);
        there.then(|| self.still.unwrap_or_else(|| pose(self.of, u_time)))
    }

    fn radius(&self) -> f32 {
        match self.of.light.shape {
            LightShape::Point { radius } | LightShape::Spot { radius, .. } => radius,
            LightShape::Directional { .. } => 0.0,
        }
    }

    /// Intensity towards a point at `distance` from the light's centre in the unit direction `away`: cone and range of
    /// the extension.
    fn intensity(&self, axis: Vec3A, away: Vec3A, distance: f32) -> Vec3 {
        let mut intensity = self.of.light.intensity;
        if let Some(range) = self.of.light.range {
            let x = distance / range;
            intensity *= (1.0 - x * x * x * x).clamp(0.0, 1.0);
        }
        if let Some([inner, outer]) = self.cones {
            // The extension's recommended falloff, with its guard against equal cones.
            let x = ((axis.dot(away) - outer) / (inner - outer).max(0.001)).clamp(0.0, 1.0);
            intensity *= x * x;
        }
        intensity
    }

    /// 1 − cos of the half angle of a disc of the sky, and the radiance over it.
    fn disc(&self) -> (f32, Vec3) {
        let LightShape::Directional { angular_radius } = self.of.light.shape else { return (0.0, Vec3::ZERO) };
        let half = angular_radius.min(0.5 * PI);
        let sin_half = libm::sinf(0.5 * half);
        let sin = libm::sinf(half);
        (2.0 * sin_half * sin_half, self.of.light.intensity / (PI * sin * sin))
    }

    /// Samples the light from `from`.
    pub(super) fn sample(&self, from: Vec3A, u_time: f32, u: Vec2) -> Option<Arrival> {
        let (place, axis) = self.pose(u_time)?;
        let arrival = match self.nature {
            Nature::Direction => {
                Arrival { wi: -axis, distance: f32::INFINITY, light: self.of.light.intensity, pdf_solid_angle: 1.0 }
            }
            Nature::Disc => {
                let (one_minus_cos, radiance) = self.disc();
                let w = warp::cone_from_square(u, one_minus_cos);
                let (t, b) = warp::tangents_of(-axis);
                let wi = (t * w.x + b * w.y - axis * w.z).normalize();
                Arrival { wi, distance: f32::INFINITY, light: radiance, pdf_solid_angle: warp::cone_pdf(one_minus_cos) }
            }
            Nature::Point => {
                let to = place - from;
                let distance = to.length();
                if distance <= 0.0 || !distance.is_finite() {
                    return None;
                }
                let wi = to / distance;
                let light = self.intensity(axis, -wi, distance) / (distance * distance);
                // At its very place a point light has no finite irradiance.
                if !light.is_finite() {
                    return None;
                }
                Arrival { wi, distance, light, pdf_solid_angle: 1.0 }
            }
            Nature::Sphere => {
                let radius = self.radius();
                let (to, distance) = outside(radius, place, from)?;
                let towards = to / distance;
                let one_minus_cos = sphere_one_minus_cos(radius, distance);
                let w = warp::cone_from_square(u, one_minus_cos);
                let (t, b) = warp::tangents_of(towards);
                let wi = (t * w.x + b * w.y + towards * w.z).normalize();
                let light = self.intensity(axis, -towards, distance) / (PI * radius * radius);
                let sin2 = w.x * w.x + w.y * w.y;
                let along = distance * w.z - (radius * radius - distance * distance * sin2).max(0.0).sqrt();
                Arrival { wi, distance: along.max(0.0), light, pdf_solid_angle: warp::cone_pdf(one_minus_cos) }
            }
        };
        (arrival.light != Vec3::ZERO).then_some(arrival)
    }

    /// What a ray from `from` along `wi` sees of a light with extent: distance, radiance, and the density by solid angle
    /// with which [`Lamp::sample`] finds it.
    pub(super) fn seen(&self, from: Vec3A, wi: Vec3A, u_time: f32) -> Option<(f32, Vec3, f32)> {
        let (place, axis) = self.pose(u_time)?;
        match self.nature {
            Nature::Point | Nature::Direction => None,
            Nature::Disc => {
                let (one_minus_cos, radiance) = self.disc();
                // 1 − cos of two near directions from their distance, which does not cancel.
                let away = 0.5 * (wi + axis).length_squared();
                (away <= one_minus_cos).then(|| (f32::INFINITY, radiance, warp::cone_pdf(one_minus_cos)))
            }
            Nature::Sphere => {
                let radius = self.radius();
                let (to, distance) = outside(radius, place, from)?;
                let along = to.dot(wi);
                let miss2 = (to - wi * along).length_squared();
                if along <= 0.0 || miss2 > radius * radius {
                    return None;
                }
                let towards = to / distance;
                let radiance = self.intensity(axis, -towards, distance) / (PI * radius * radius);
                let one_minus_cos = sphere_one_minus_cos(radius, distance);
                Some((along - (radius * radius - miss2).sqrt(), radiance, warp::cone_pdf(one_minus_cos)))
            }
        }
    }

    /// An estimate of the irradiance that a light from infinitely far gives at normal `n`.
    pub(super) fn far_irradiance(&self, n: Vec3A, both_sides: bool, u_time: f32) -> f32 {
        let Some((_, axis)) = self.pose(u_time) else { return 0.0 };
        let cos = -n.dot(axis);
        let cos = if both_sides { cos.abs() } else { cos };
        let spread = match self.of.light.shape {
            LightShape::Directional { angular_radius } => libm::sinf(angular_radius.min(0.5 * PI)),
            _ => 0.0,
        };
        // A disc reaches over the horizon by its own radius.
        if cos <= -spread { 0.0 } else { luminance(self.of.light.intensity) * cos.max(0.5 * spread).max(1e-3) }
    }

    /// How a near light looks in the tree.
    pub(super) fn extent(&self) -> Extent {
        let light = self.of;
        let r = Vec3::splat(self.radius());
        let at = |t: f32| {
            let p = Vec3::from(pose(light, t).0);
            (t, [p - r, p + r])
        };
        let boxes: Vec<_> =
            if light.motion.is_still() { vec![at(0.0)] } else { light.motion.times().iter().map(|&t| at(t)).collect() };
        let (cos_normals, cos_emission) = match self.cones {
            Some([_, outer]) if light.motion.is_still() => (1.0, outer),
            _ => (-1.0, 0.0),
        };
        let strength = luminance(light.light.intensity);
        Extent {
            boxes: super::emitters::enclosing(&boxes),
            axis: pose(light, 0.0).1.into(),
            cos_normals,
            cos_emission,
            strength: if strength.is_finite() { strength } else { f32::MAX },
        }
    }
}
