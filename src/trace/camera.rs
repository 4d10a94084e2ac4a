//! From film points to rays: projection and thin lens (Cook, Porter and Carpenter 1984, §4.2).

use super::{Backs, FilmPoint, Ray};
use crate::design::{Factor, Point};
use crate::factor::compiled;
use crate::scene::{Projection, StageCamera};
use glam::{DVec2, Vec3A};

/// A ray with the cone that its pixel spans, for texture filtering.
#[derive(Debug, Clone, Copy)]
pub struct CameraRay {
    /// The ray; its direction is a unit vector.
    pub ray: Ray,
    /// Width of the pixel's cone at the origin, metres.
    pub cone_width: f32,
    /// By how much the cone widens a metre.
    pub cone_spread: f32,
}

/// A camera with a picture's size.
#[derive(Debug, Clone)]
pub struct CameraRays {
    camera: StageCamera,
    /// Half extents of the view: at unit distance (perspective) or anywhere (orthographic), metres.
    half: DVec2,
    /// Pixels.
    size: DVec2,
    /// Height of a pixel in view units.
    pixel: f32,
}

impl CameraRays {
    /// `size` in pixels of the whole picture, `pixel_aspect` a pixel's width over its height. The vertical view angle
    /// is the camera's; the horizontal one follows from the picture's shape.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a pixel's size needs no more")]
    pub fn new(camera: &StageCamera, size: (u32, u32), pixel_aspect: f64) -> Self {
        let size = DVec2::new(f64::from(size.0), f64::from(size.1));
        let half_height = match camera.projection {
            Projection::Perspective { yfov, .. } => libm::tan(f64::from(yfov) * 0.5),
            Projection::Orthographic { ymag, .. } => f64::from(ymag.abs()),
        };
        let half = DVec2::new(half_height * size.x * pixel_aspect / size.y, half_height);
        Self { camera: camera.clone(), half, size, pixel: (2.0 * half_height / size.y) as f32 }
    }

    /// The same camera with cones for one of `runs` samples that share a pixel: each covers its part of the pixel's area,
    /// so that textures are not blurred over the pixel twice, and ever less as runs grow.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "a pixel's size needs no more")]
    pub fn shared_by(mut self, runs: u32) -> Self {
        self.pixel /= f64::from(runs.max(1)).sqrt() as f32;
        self
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &StageCamera {
        &self.camera
    }

    /// Where a world point is seen through the middle of the lens at `u_time`, pixels; `None` behind the camera.
    #[must_use]
    pub fn project(&self, point: Vec3A, u_time: f32) -> Option<DVec2> {
        let local = self.camera.motion.at(u_time).inverse().transform_point3a(point).as_dvec3();
        let view = match self.camera.projection {
            Projection::Perspective { .. } if local.z < 0.0 => DVec2::new(local.x, local.y) / -local.z,
            Projection::Perspective { .. } => return None,
            Projection::Orthographic { .. } => DVec2::new(local.x, local.y),
        };
        let unit = view / self.half;
        let position = DVec2::new(1.0 + unit.x, 1.0 - unit.y) * 0.5 * self.size;
        position.is_finite().then_some(position)
    }

    /// The ray through a film point, at its time, through the lens point that `point` draws. A pinhole draws nothing.
    #[must_use]
    #[inline]
    pub fn ray(&self, film: FilmPoint, point: &Point<'_>) -> CameraRay {
        let lens = if compiled::LENS && self.camera.aperture_radius > 0.0 {
            let (x, y) = disk_from_square(point.get(Factor::LENS_U), point.get(Factor::LENS_V));
            Some(Vec3A::new(x, y, 0.0) * self.camera.aperture_radius)
        } else {
            None
        };
        self.ray_through(film, lens)
    }

    /// The ray through a film point, at its time, through the middle of the lens.
    #[must_use]
    pub fn middle_ray(&self, film: FilmPoint) -> CameraRay {
        self.ray_through(film, None)
    }

    #[allow(clippy::cast_possible_truncation, reason = "view coordinates near 1")]
    #[inline]
    fn ray_through(&self, film: FilmPoint, lens: Option<Vec3A>) -> CameraRay {
        let x = ((2.0 * film.position.x / self.size.x - 1.0) * self.half.x) as f32;
        let y = ((1.0 - 2.0 * film.position.y / self.size.y) * self.half.y) as f32;
        let (mut origin, mut direction) = match self.camera.projection {
            Projection::Perspective { .. } => (Vec3A::ZERO, Vec3A::new(x, y, -1.0)),
            Projection::Orthographic { .. } => (Vec3A::new(x, y, 0.0), Vec3A::NEG_Z),
        };
        if let Some(lens) = lens.filter(|_| compiled::LENS) {
            let [open, close] = self.camera.focus_distance;
            // A blend of two infinities is none.
            let focus = if open.to_bits() == close.to_bits() { open } else { open + (close - open) * film.u_time };
            // Towards the point in focus, at a scale on which neither a focus at infinity nor one within the lens
            // overflows.
            let reach = lens.abs().max_element();
            if focus >= reach {
                direction -= lens / focus;
            } else {
                direction = direction * (focus / reach) - lens / reach;
            }
            origin += lens;
        }
        let world = self.camera.motion.at(film.u_time);
        let direction = (world.matrix3 * direction).normalize();
        let (cone_width, cone_spread) = match self.camera.projection {
            Projection::Perspective { .. } => (0.0, self.pixel),
            Projection::Orthographic { .. } => (self.pixel, 0.0),
        };
        let origin = world.transform_point3a(origin);
        let ray = Ray { origin, direction, t_max: f32::INFINITY, u_time: film.u_time, backs: Backs::Pass };
        CameraRay { ray, cone_width, cone_spread }
    }
}

/// The concentric map of Shirley and Chiu (1997): areas, neighbourhoods and strata are kept.
#[must_use]
#[inline]
pub fn disk_from_square(u: f32, v: f32) -> (f32, f32) {
    const QUARTER_PI: f32 = std::f32::consts::FRAC_PI_4;
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (r, angle) =
        if a.abs() > b.abs() { (a, QUARTER_PI * (b / a)) } else { (b, 2.0 * QUARTER_PI - QUARTER_PI * (a / b)) };
    let (sine, cosine) = crate::numeric::sin_cos(angle);
    (r * cosine, r * sine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::{Design, DesignOptions, PixelAddress};
    use crate::scene::Motion;
    use glam::Affine3A;

    fn camera(aperture_radius: f32, focus: f32) -> CameraRays {
        let camera = StageCamera {
            motion: Motion::still(Affine3A::IDENTITY),
            projection: Projection::Perspective { yfov: 1.0, aspect: None },
            aperture_radius,
            focus_distance: [focus; 2],
        };
        CameraRays::new(&camera, (64, 48), 1.0)
    }

    #[test]
    fn rays_through_any_lens_point_meet_in_the_plane_of_focus() {
        let (pinhole, lens) = (camera(0.0, 1.0), camera(0.3, 5.0));
        let design =
            Design::new(&DesignOptions { runs: 64, seed: 3, ..Default::default() }, &[Factor::LENS_U, Factor::LENS_V]);
        let pixel = design.pixel(PixelAddress { x: 0, y: 0, frame: 0, field: 0 });
        let film = FilmPoint { position: DVec2::new(11.3, 40.2), u_time: 0.0 };
        for run in 0..64 {
            let point = pixel.point(run);
            let (p, q) = (pinhole.ray(film, &point).ray, lens.ray(film, &point).ray);
            let at_focus = |r: &Ray| r.origin + r.direction * ((-5.0 - r.origin.z) / r.direction.z);
            assert!(at_focus(&p).distance(at_focus(&q)) < 2e-5);
        }
    }

    #[test]
    fn projection_undoes_the_pinhole() {
        let camera = camera(0.0, 1.0);
        let design = Design::new(&DesignOptions::default(), &[]);
        let pixel = design.pixel(PixelAddress { x: 0, y: 0, frame: 0, field: 0 });
        let point = pixel.point(0);
        let position = DVec2::new(11.3, 40.2);
        let ray = camera.ray(FilmPoint { position, u_time: 0.0 }, &point).ray;
        let seen = camera.project(ray.origin + ray.direction * 7.0, 0.0).unwrap();
        assert!(seen.distance(position) < 1e-4, "{seen}");
        assert!(camera.project(ray.origin - ray.direction, 0.0).is_none());
    }

    #[test]
    fn the_picture_is_upright_and_its_pixels_square() {
        let camera = camera(0.0, 1.0);
        let design = Design::new(&DesignOptions { runs: 1, ..Default::default() }, &[]);
        let pixel = design.pixel(PixelAddress { x: 0, y: 0, frame: 0, field: 0 });
        let point = pixel.point(0);
        let at =
            |x: f64, y: f64| camera.ray(FilmPoint { position: DVec2::new(x, y), u_time: 0.0 }, &point).ray.direction;
        let (centre, right, up) = (at(32.0, 24.0), at(33.0, 24.0), at(32.0, 23.0));
        assert!((centre - Vec3A::NEG_Z).length() < 1e-6);
        assert!(right.x > 0.0 && up.y > 0.0 && (right.x - up.y).abs() < 1e-6);
        assert!((at(32.0, 0.0).y / -at(32.0, 0.0).z - libm::tanf(0.5)).abs() < 1e-6);
    }
}
