//! What stands where: nodes and cameras.

use super::builder::{Mesh, Node};
use glam::{DMat3, DQuat, DVec3};
use serde_json::{Map, Value, json};

/// A node to be.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    pub(crate) name: String,
    pub(crate) parent: Option<Node>,
    pub(crate) translation: DVec3,
    pub(crate) rotation: DQuat,
    pub(crate) mesh: Option<Mesh>,
    pub(crate) other: Map<String, Value>,
}

impl Place {
    /// A node at the origin of its parent.
    pub(crate) fn new(name: &str) -> Self {
        Self {
            name: name.into(),
            parent: None,
            translation: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            mesh: None,
            other: Map::new(),
        }
    }

    /// Hangs it from `parent`.
    pub(crate) fn under(mut self, parent: Node) -> Self {
        self.parent = Some(parent);
        self
    }

    /// Moves it to a place relative to its parent.
    pub(crate) fn at(mut self, x: f64, y: f64, z: f64) -> Self {
        self.translation = DVec3::new(x, y, z);
        self
    }

    /// Turns it.
    pub(crate) fn turned(mut self, rotation: DQuat) -> Self {
        self.rotation = rotation;
        self
    }

    /// Puts a mesh there.
    pub(crate) fn with(mut self, mesh: Mesh) -> Self {
        self.mesh = Some(mesh);
        self
    }

    /// Sets its motion-blur amount (`motion:blurScale`).
    pub(crate) fn blur_scale(mut self, amount: f64) -> Self {
        self.other.insert("extras".into(), json!({ "motion:blurScale": amount }));
        self
    }

    /// Sets any other member of the node.
    pub(crate) fn set(mut self, key: &str, value: Value) -> Self {
        self.other.insert(key.into(), value);
        self
    }
}

/// A camera and where it looks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Eye {
    /// Where it stands.
    pub(crate) eye: DVec3,
    /// What stands in the middle of the picture.
    pub(crate) target: DVec3,
    /// Vertical angle of view, degrees.
    pub(crate) yfov: f64,
    /// f-stop, aperture radius in metres, or neither: a pinhole.
    pub(crate) aperture: Aperture,
    /// A point in the plane that is in focus.
    pub(crate) focus: DVec3,
    /// Shutter angle in degrees, if the file says so.
    pub(crate) shutter_angle: Option<f64>,
}

/// How wide the lens is open.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Aperture {
    /// Not at all.
    Pinhole,
    /// f-stop on a sensor 24 mm high.
    FStop(f64),
    /// Radius in metres.
    Radius(f64),
}

impl Eye {
    /// A pinhole camera that looks from `eye` to `target`.
    pub(crate) fn new(eye: [f64; 3], target: [f64; 3], yfov: f64) -> Self {
        let (eye, target) = (DVec3::from_array(eye), DVec3::from_array(target));
        Self { eye, target, yfov, aperture: Aperture::Pinhole, focus: target, shutter_angle: None }
    }

    /// Opens the lens and focuses on the plane through `focus`.
    pub(crate) fn lens(mut self, aperture: Aperture, focus: [f64; 3]) -> Self {
        self.aperture = aperture;
        self.focus = DVec3::from_array(focus);
        self
    }

    /// Sets the shutter angle.
    pub(crate) fn shutter(mut self, degrees: f64) -> Self {
        self.shutter_angle = Some(degrees);
        self
    }

    /// World from camera.
    pub(crate) fn rotation(&self) -> DQuat {
        facing(self.target - self.eye)
    }

    /// glTF's camera object.
    pub(crate) fn camera(&self) -> Value {
        let mut extras = Map::new();
        match self.aperture {
            Aperture::Pinhole => {}
            Aperture::FStop(n) => drop(extras.insert("f_stop".into(), n.into())),
            Aperture::Radius(r) => drop(extras.insert("aperture_radius".into(), r.into())),
        }
        if !matches!(self.aperture, Aperture::Pinhole) {
            let axis = (self.target - self.eye).normalize();
            // To the micrometre: digits beyond say nothing.
            let distance = libm::round((self.focus - self.eye).dot(axis) * 1e6) / 1e6;
            extras.insert("focus_distance".into(), distance.into());
        }
        if let Some(angle) = self.shutter_angle {
            extras.insert("shutter_angle".into(), angle.into());
        }
        let yfov = libm::round(self.yfov.to_radians() * 1e9) / 1e9;
        let mut camera = json!({
            "type": "perspective",
            "perspective": { "yfov": yfov, "znear": 0.01, "aspectRatio": 1.777_777_8 },
        });
        if !extras.is_empty() {
            camera["extras"] = Value::Object(extras);
        }
        camera
    }
}

/// The rotation that turns −z to `direction` and keeps x level.
pub(crate) fn facing(direction: DVec3) -> DQuat {
    let back = -direction.normalize();
    let right = if back.cross(DVec3::Y).length() > 1e-6 { DVec3::Y.cross(back).normalize() } else { DVec3::X };
    DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back))
}
