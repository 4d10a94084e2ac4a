//! Cameras: projection and thin lens.

/// How film points become directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Central projection.
    Perspective {
        /// Full vertical angle of view, radians, in (0, π).
        yfov: f32,
        /// Width over height that the author had in mind; the picture's own shape wins, this only suggests it.
        aspect: Option<f32>,
    },
    /// Parallel projection.
    Orthographic {
        /// Half the width of the view, metres, non-zero.
        xmag: f32,
        /// Half the height of the view, metres, non-zero.
        ymag: f32,
    },
}

/// What the file says of lens and shutter; `None` where it says nothing.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lens {
    /// Aperture as an f-stop on a sensor 24 mm high: radius = focal length / (2 · f-stop), focal length =
    /// 12 mm / tan(yfov / 2). Positive.
    pub f_stop: Option<f32>,
    /// Radius of the aperture, metres, ≥ 0; wins over `f_stop`.
    pub aperture_radius: Option<f32>,
    /// Distance from the lens to the plane in focus, metres along the axis, > 0.
    pub focus_distance: Option<f32>,
    /// Shutter angle in degrees, 0 to 360 (or more: exposures may overlap).
    pub shutter_angle: Option<f32>,
}

/// A camera; a node places it.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// The file's name for it; may be empty.
    pub name: String,
    /// How it projects.
    pub projection: Projection,
    /// Nearest and farthest visible distance along the axis, metres: what the file says. The tracer clips nothing
    /// by it, but the default framing and overlays use it.
    pub near_far: (f32, Option<f32>),
    /// Lens and shutter from `extras`.
    pub lens: Lens,
}
