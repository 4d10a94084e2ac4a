//! The scene as an image function: path tracing with next-event estimation and multiple importance sampling.
//!
//! A path is a chain of vertices. At a vertex with a rough lobe, light is sampled directly and the lobe is sampled for
//! the next ray; what both can find is weighted by the power heuristic (Veach and Guibas 1995). Vertices that only
//! mirror or refract cost no factors and count as no bounce: the surface seen in a mirror draws the very numbers that
//! it would draw if it were seen directly. Passing through glass, rough or clear, is no bounce either.
//!
//! Without [`Caustics::Exact`] the path's later facets are regularised (Kaplanyan and Dachsbacher 2013, "Path Space
//! Regularization for Holistic and Robust Light Transport"): after a lobe of GGX width a (1 for diffuse) none is narrower
//! than half of a, so that no lamp is seen in one by a rare chance.

mod extent;

use super::accel::Accel;
use super::bsdf::{BsdfSample, Materials, Scatter, Shading, ShadingQuery, Surroundings, wavelength};
use super::camera::CameraRays;
use super::lights::{LightQuery, LightSample, Lights};
use super::media::{Boxes, Face, Media};
use super::surface::SurfacePoint;
use super::tally::count_ray;
use super::texture::Footprint;
use super::{Backs, FilmPoint, Hit, ImageFunction, Ray};
use crate::design::Point;
use crate::factor::Factor;
use crate::numeric::{self, ONE_MINUS};
use crate::scene::{Scene, Stage};
pub use extent::{Caustics, PathLengths};
use glam::{Vec2, Vec3};

/// Vertices that are no bounces, mirrors and glass, that one path may pass: enough for any real arrangement, and an end
/// for two facing mirrors.
const MOST_SPECULAR: u16 = 64;
/// Indices of [`Factor::extra`] that the path tracer draws.
const EXTRA_ALPHA: u16 = 0;
const EXTRA_WAVELENGTH: u16 = 1;
const EXTRA_SPECULAR: u16 = 2;
/// Beyond the last that [`EXTRA_SPECULAR`] reaches, two by two: texture and roulette at each vertex.
const EXTRA_VERTEX: u16 = EXTRA_SPECULAR + MOST_SPECULAR + 1;
/// Facets' least width after a lobe, as a part of that lobe's. At a half a regularised lobe's peak, 1 / (4π α²) per
/// steradian, is that of a diffuse surface, 1 / π: what is found by way of it does not stand out.
const REGULARISED: f32 = 0.5;
/// The width of an earlier lobe, as wide as roughness ¼, from which on what mirrors and glass show of lamps makes
/// caustics: in a narrower one lamps are still seen, as highlights that belong to the picture.
const BLURS: f32 = 1.0 / 16.0;
/// Light samples at a path's first rough vertex. A second costs a shadow ray, a quarter of a path without bounces, and
/// lowers the variance to .6 where light is most of it: relMSE at 16 runs, 240 x 135, without bounces, of blur_row from
/// .0018 to .0010, mirror .0044 to .0026, pool .0036 to .0022, newton .0129 to .0119.
const FIRST_LIGHTS: u8 = 2;
/// The golden ratio's fraction.
const GOLDEN: f32 = 0.618_034;
/// How many times as often as among all lobes a path's first and last vertices draw narrow ones, at full throughput. At the
/// last fewer rays than one a vertex are traced where less than an eighth of the light is reflected so. relMSE at 16 runs,
/// 240 x 135, without bounces, when all lobes were drawn there and now: blur_row .0027 and .0018, pool .0057 and .0036.
/// With four bounces, where the first vertex drew in proportion and now: pool .0112 and .0039, blur_row .0082 and .0077, mirror
/// .0122 and .0127, newton .042 and .042.
const EAGERNESS: f32 = 8.0;
/// How many times its throughput a path's chance to go on is. What came before it, camera ray, first light and all, cost
/// more than a bounce does, so that paths should end where what they may still find is small beside their whole noise. relMSE
/// at 16 runs, 160 x 90, four bounces, with a chance of the throughput itself after two bounces and with eight times that after
/// one: mirror .0102 and .0082, newton .0264 and .0220, walker .0031 and .0028, for 1.11, .93 and 1.03 of the rays; pool
/// .0034 and .0034 for .88 of them.
const PERSISTENCE: f32 = 8.0;
/// Tells shadow rays' draws from those of the path.
const SHADOW_SALT: u32 = 1 << 31;

/// What a path is made of, prepared for one exposure.
#[derive(Debug, Clone, Copy)]
pub struct Parts<'a> {
    /// The file's content.
    pub scene: &'a Scene,
    /// What of it this exposure sees.
    pub stage: &'a Stage,
    /// What rays meet.
    pub accel: &'a Accel,
    /// How surfaces scatter.
    pub materials: &'a Materials,
    /// What shines.
    pub lights: &'a Lights<'a>,
}

/// A scene during one exposure, as a function of film point, time, lens and lights.
#[derive(Debug)]
pub struct PathTracer<'a> {
    parts: Parts<'a>,
    camera: CameraRays,
    lengths: PathLengths,
    caustics: Caustics,
    bodies: Boxes,
}

/// A path as it grows from the camera.
struct Path {
    ray: Ray,
    throughput: Vec3,
    radiance: Vec3,
    cone_width: f32,
    cone_spread: f32,
    /// Where the ray was scattered by a rough lobe: what it meets was sampled for there too. `None` from the camera, a
    /// mirror, a refraction.
    scattered: Option<Scattered>,
    media: Media,
    /// Wavelength, nanometres, once the path has met a medium that disperses.
    wavelength_nm: Option<f32>,
    /// Index of the group of factors that the next vertex draws.
    vertex: u16,
    bounces: u16,
    specular: u16,
    /// Widest lobe that scattered the path: its GGX width, 1 for diffuse ones, 0 for none.
    spread: f32,
    /// Whether the ray comes from a wide lobe by way of mirrors or glass: what lamps it meets makes caustics.
    focused: bool,
    /// Whether the ray only looks for light that was sampled for already, and ends there.
    last: bool,
}

/// Where a rough lobe scattered a ray, and how what it meets is weighed against light sampled there.
struct Scattered {
    query: LightQuery,
    /// Density of the ray's direction by solid angle.
    pdf: f32,
    /// How many light samples were drawn there.
    lights: f32,
}

impl Scattered {
    /// Weight of light that the ray meets and that one light sample would have found with density `light_pdf`.
    fn weight(&self, light_pdf: f32) -> f32 {
        power_heuristic(self.pdf, self.lights * light_pdf)
    }
}

/// Light samples drawn at the `vertex`-th rough vertex.
fn light_samples(vertex: u16) -> u8 {
    if vertex == 0 { FIRST_LIGHTS } else { 1 }
}

impl<'a> PathTracer<'a> {
    /// The image function of a prepared scene.
    #[must_use]
    pub fn new(parts: Parts<'a>, camera: CameraRays, lengths: PathLengths, caustics: Caustics) -> Self {
        Self { bodies: Boxes::new(parts.scene, parts.stage), parts, camera, lengths, caustics }
    }

    /// Whether a surface with alpha is there for this path: with probability alpha, by a number that belongs to
    /// (sample, ray, triangle) alone, so that the order of traversal never shows.
    fn is_there(&self, hit: &Hit, ray: &Ray, point: &Point<'_>, salt: u32) -> bool {
        let Parts { scene, stage, accel, materials, .. } = self.parts;
        let surface = accel.surface(scene, stage, ray, hit);
        let footprint = Footprint::point(0.5);
        let alpha = materials.alpha(scene, surface.material, &surface.uvs, surface.color.w, footprint);
        if alpha >= 1.0 || alpha <= 0.0 {
            return alpha >= 1.0;
        }
        let sample = point.get(Factor::extra(EXTRA_ALPHA)).to_bits();
        let place = u64::from(hit.instance) << 32 | u64::from(hit.triangle);
        let bits = numeric::mix64(numeric::mix64(u64::from(sample) << 32 | u64::from(salt)) ^ place);
        unit_from_upper_bits(bits) < alpha
    }

    /// Light that arrives directly at a vertex and is scattered towards the viewer, weighed against what `finds`.
    fn direct(&self, path: &Path, surface: &SurfacePoint, shading: &Shading, point: &Point<'_>, finds: Finds) -> Vec3 {
        let lights = self.parts.lights;
        let query = LightQuery::new(surface, &shading.bsdf, path.ray.u_time);
        let mut sum = Vec3::ZERO;
        for i in 0..lights.visited() {
            if let Some(light) = lights.visit(i, &query) {
                sum += self.lit(path, surface, shading, point, &light, Finds::Nothing);
            }
        }
        if lights.needs_sampling()
            && let Some(mut choice) = lights.choice(&query)
        {
            let u = Vec2::new(point.get(Factor::light_u(path.vertex)), point.get(Factor::light_v(path.vertex)));
            let count = light_samples(path.vertex);
            let part = 1.0 / f32::from(count);
            for i in 0..count {
                // Strata of the first coordinate, and turns of the second by the golden ratio, keep runs stratified.
                let x = ((u.x + f32::from(i)) * part).min(ONE_MINUS);
                let u = Vec2::new(x, (u.y + f32::from(i) * GOLDEN).fract());
                if let Some(light) = lights.sample(&mut choice, u) {
                    sum += self.lit(path, surface, shading, point, &light, finds) * part;
                }
            }
        }
        sum
    }

    /// What one light sample gives.
    fn lit(
        &self,
        path: &Path,
        surface: &SurfacePoint,
        shading: &Shading,
        point: &Point<'_>,
        light: &LightSample,
        finds: Finds,
    ) -> Vec3 {
        let e = shading.bsdf.evaluate(light.wi);
        if light.pdf_solid_angle <= 0.0 {
            return Vec3::ZERO;
        }
        let light_pdf = f32::from(light_samples(path.vertex)) * light.pdf_solid_angle;
        let value = match finds {
            Finds::Everything if !light.is_delta => e.value() * power_heuristic(light_pdf, e.pdf()),
            Finds::Narrow { times } if !light.is_delta => {
                e.wide + e.narrow * power_heuristic(light_pdf, times * e.narrow_pdf)
            }
            _ => e.value(),
        };
        if value == Vec3::ZERO {
            return Vec3::ZERO;
        }
        let contribution = value * light.radiance / light.pdf_solid_angle;
        if contribution.max_element() <= 0.0 {
            return Vec3::ZERO;
        }
        let origin = surface.spawn_origin(light.wi);
        // To the very point on the light: `distance` along `wi` from here, which is off the surface, would overshoot a
        // light that the surface faces and meet it from where it shines.
        let (direction, t_max) = if light.distance.is_finite() {
            (surface.position + light.wi * light.distance - origin, 1.0)
        } else {
            (light.wi, f32::INFINITY)
        };
        let ray = Ray { origin, direction, t_max, u_time: path.ray.u_time, backs: Backs::Stop };
        count_ray();
        let salt = SHADOW_SALT | u32::from(path.vertex);
        if self.parts.accel.occluded(&ray, |hit| self.is_there(hit, &ray, point, salt)) {
            Vec3::ZERO
        } else {
            contribution
        }
    }
}

/// What light a vertex's scattered ray may find besides sampled light.
#[derive(Debug, Clone, Copy)]
enum Finds {
    /// None.
    Nothing,
    /// Any that a lobe scatters.
    Everything,
    /// That which narrow lobes scatter; these are drawn so many times as often as among all.
    Narrow {
        /// How many times as often.
        times: f32,
    },
}

/// What a vertex does with the path.
enum Next {
    /// The path goes on with its new ray.
    On,
    /// Nothing more can come.
    End,
}

impl PathTracer<'_> {
    /// Follows the path to its end.
    fn follow(&self, mut path: Path, point: &Point<'_>) -> Vec3 {
        loop {
            count_ray();
            let salt = u32::from(path.vertex) << 8 | u32::from(path.specular);
            let hit = self.parts.accel.closest(&path.ray, |hit| self.is_there(hit, &path.ray, point, salt));
            self.meet_lights(&mut path, hit.map_or(f32::INFINITY, |h| h.t));
            let next = hit.map_or(Next::End, |hit| self.meet_surface(&mut path, &hit, point));
            if matches!(next, Next::End) {
                return path.radiance;
            }
        }
    }

    /// Lights that are no surfaces: the sky if nothing is met before `t`, and spheres on the way.
    fn meet_lights(&self, path: &mut Path, t: f32) {
        let (lights, ray) = (self.parts.lights, path.ray);
        let mut sum = Vec3::ZERO;
        match &path.scattered {
            Some(at) => {
                lights.seen(&at.query, ray.direction, t, |radiance, light_pdf| sum += radiance * at.weight(light_pdf));
            }
            None if path.focused && self.caustics != Caustics::Exact => {
                if t == f32::INFINITY {
                    sum = lights.environment(ray.direction);
                }
            }
            None => {
                sum = lights.spheres(ray.origin, ray.direction, t, ray.u_time);
                if t == f32::INFINITY {
                    sum += lights.sky(ray.direction, ray.u_time);
                }
            }
        }
        path.radiance += path.throughput * sum;
    }

    fn meet_surface(&self, path: &mut Path, hit: &Hit, point: &Point<'_>) -> Next {
        let Parts { scene, stage, accel, materials, .. } = self.parts;
        let surface = accel.surface(scene, stage, &path.ray, hit);
        path.cone_width += path.cone_spread * hit.t;
        if let Some(medium) = path.media.current() {
            path.throughput *= medium.transmittance(hit.t);
        }
        let wo = -path.ray.direction;
        if path.wavelength_nm.is_none() && materials.disperses(scene, surface.material) {
            let drawn = wavelength(point.get(Factor::extra(EXTRA_WAVELENGTH)));
            path.wavelength_nm = Some(drawn.nm);
            path.throughput *= drawn.weight;
        }
        let surroundings = if materials.medium(surface.material).is_some() {
            path.media.forget_beyond(&self.bodies, surface.position);
            let face = if wo.dot(surface.geometric_normal) >= 0.0 { Face::Front } else { Face::Back };
            path.media.beyond(surface.instance, surface.material, face)
        } else {
            Surroundings::Air
        };
        let query = ShadingQuery {
            surroundings,
            cone_width: path.cone_width,
            u_texture: if materials.draws_texels() && surface.uv_gradients.is_some() {
                point.get(Factor::extra(EXTRA_VERTEX + 2 * (path.vertex + path.specular)))
            } else {
                0.5
            },
            wavelength_nm: path.wavelength_nm,
            least_alpha: if self.caustics == Caustics::Exact { 0.0 } else { REGULARISED * path.spread },
            diffuse_only: self.caustics == Caustics::Dropped && path.spread >= 1.0,
        };
        let mut shading = Shading::new(scene, materials, &surface, wo, query);
        if let Some(color) = shading.unlit {
            if !path.last {
                path.radiance += path.throughput * color;
            }
            return Next::End;
        }
        if shading.emitted != Vec3::ZERO && !(path.focused && self.caustics != Caustics::Exact) {
            path.radiance += path.throughput * shading.emitted * self.emitter_weight(path, hit);
        }
        if path.last || shading.bsdf.is_black() {
            return Next::End;
        }
        if path.bounces == 0 && self.lengths.bounces > 0 {
            shading.bsdf.favour_narrow_lobes(EAGERNESS);
        }
        self.scatter(path, &surface, &shading, point)
    }

    /// Weight of an emissive surface that the path met, against having sampled it as a light.
    fn emitter_weight(&self, path: &Path, hit: &Hit) -> f32 {
        let Some(at) = &path.scattered else { return 1.0 };
        let emitter = (hit.instance, hit.triangle);
        let barycentric = Vec2::new(hit.u, hit.v);
        at.weight(self.parts.lights.emitter_pdf(&at.query, path.ray.direction, hit.t, emitter, barycentric))
    }

    /// Samples light and the next direction at a vertex.
    fn scatter(&self, path: &mut Path, surface: &SurfacePoint, shading: &Shading, point: &Point<'_>) -> Next {
        let rough = !shading.bsdf.is_specular_only();
        let last = path.bounces >= self.lengths.bounces;
        let narrow = if rough && last {
            // Wide lobes are lit by sampled light alone at the path's end: a scattered ray would find the same light no
            // better. So only narrow ones are drawn, the more often the more they may show.
            shading.bsdf.narrow_lobes(EAGERNESS * path.throughput.max_element())
        } else {
            None
        };
        if rough {
            let finds = match &narrow {
                _ if !self.parts.lights.needs_sampling() => Finds::Nothing,
                Some((_, times, _)) => Finds::Narrow { times: *times },
                None if last => Finds::Nothing,
                None => Finds::Everything,
            };
            path.radiance += path.throughput * self.direct(path, surface, shading, point, finds);
            if last && narrow.is_none() {
                return Next::End;
            }
        }
        let u = if rough {
            Vec2::new(point.get(Factor::lobe_u(path.vertex)), point.get(Factor::lobe_v(path.vertex)))
        } else {
            Vec2::splat(0.5)
        };
        let extra = || point.get(Factor::extra(EXTRA_SPECULAR + path.specular));
        let bsdf = match &narrow {
            Some((drawn, _, _)) if u.x >= *drawn => return Next::End,
            Some((_, _, bsdf)) => bsdf,
            None => &shading.bsdf,
        };
        let Some(sample) = bsdf.sample(u, if rough { 0.5 } else { extra() }) else { return Next::End };
        if path.specular >= MOST_SPECULAR {
            return Next::End;
        }
        self.go_on(path, surface, shading, &sample, point)
    }

    /// Sets the path's next ray.
    fn go_on(
        &self,
        path: &mut Path,
        surface: &SurfacePoint,
        shading: &Shading,
        sample: &BsdfSample,
        point: &Point<'_>,
    ) -> Next {
        path.throughput *= sample.throughput;
        if path.throughput.max_element() <= 0.0 {
            return Next::End;
        }
        if sample.refracted {
            match shading.medium {
                Some(medium) if sample.wi.dot(surface.geometric_normal) < 0.0 => {
                    path.media.enter(surface.instance, surface.material, medium);
                }
                _ => path.media.leave(surface.instance, surface.material),
            }
        }
        let number = path.vertex + path.specular;
        let lights = f32::from(light_samples(path.vertex));
        path.vertex += u16::from(!shading.bsdf.is_specular_only());
        match sample.scatter {
            Scatter::Specular => {
                path.specular += 1;
                path.scattered = None;
                path.focused = path.spread >= BLURS;
            }
            Scatter::Rough => {
                if sample.refracted {
                    path.specular += 1;
                } else {
                    if path.bounces >= self.lengths.bounces {
                        if !self.parts.lights.needs_sampling() {
                            return Next::End;
                        }
                        path.last = true;
                    }
                    path.bounces += 1;
                }
                let going_on = PERSISTENCE * path.throughput.max_element();
                if path.bounces > self.lengths.sure && going_on < 1.0 {
                    if point.get(Factor::extra(EXTRA_VERTEX + 2 * number + 1)) >= going_on {
                        return Next::End;
                    }
                    path.throughput /= going_on;
                }
                path.focused = false;
                path.spread = path.spread.max(sample.alpha);
                let query = LightQuery::new(surface, &shading.bsdf, path.ray.u_time);
                path.scattered = Some(Scattered { query, pdf: sample.pdf_solid_angle, lights });
            }
        }
        // A lobe of GGX width α spreads a pixel's cone by about α: a texel's worth of blur, not a measured constant.
        path.cone_spread += sample.alpha;
        path.ray = Ray {
            origin: surface.spawn_origin(sample.wi),
            direction: sample.wi,
            t_max: f32::INFINITY,
            u_time: path.ray.u_time,
            backs: if path.scattered.is_none() { path.ray.backs } else { Backs::Stop },
        };
        Next::On
    }
}

impl ImageFunction for PathTracer<'_> {
    fn radiance(&self, film: FilmPoint, point: &Point<'_>) -> Vec3 {
        let seen = self.camera.ray(film, point);
        let path = Path {
            ray: seen.ray,
            throughput: Vec3::ONE,
            radiance: Vec3::ZERO,
            cone_width: seen.cone_width,
            cone_spread: seen.cone_spread,
            scattered: None,
            media: Media::default(),
            wavelength_nm: None,
            vertex: 0,
            bounces: 0,
            specular: 0,
            spread: 0.0,
            focused: false,
            last: false,
        };
        self.follow(path, point)
    }
}

/// The upper 24 bits as a coordinate in [0, 1).
#[allow(clippy::cast_possible_truncation, reason = "the upper half is what is wanted")]
fn unit_from_upper_bits(bits: u64) -> f32 {
    numeric::unit_from_bits((bits >> 32) as u32)
}

/// The power heuristic with β = 2 (Veach and Guibas 1995, §4.2) of two techniques' densities, each times the number of
/// samples that the technique draws; guarded against densities whose square would overflow.
fn power_heuristic(own: f32, other: f32) -> f32 {
    if own <= 0.0 {
        return 0.0;
    }
    let ratio = other / own;
    1.0 / (1.0 + ratio * ratio)
}
