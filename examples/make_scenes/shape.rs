//! Triangle meshes: closed, counter-clockwise from outside, with normals and texture coordinates.

use glam::{DAffine3, DMat3, DVec2, DVec3};
use std::f64::consts::TAU;

/// A triangle mesh; lists that are not empty have one entry per vertex.
#[derive(Debug, Clone, Default)]
pub(crate) struct Shape {
    /// Metres.
    pub(crate) positions: Vec<DVec3>,
    /// Unit length.
    pub(crate) normals: Vec<DVec3>,
    /// u to the right, v down (glTF's way) as seen from outside.
    pub(crate) uvs: Vec<DVec2>,
    /// Counter-clockwise from outside.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Joint numbers, four a vertex; empty when nothing bends it.
    pub(crate) joints: Vec<[u8; 4]>,
    /// Weights of the joints, summing to 1.
    pub(crate) weights: Vec<[f64; 4]>,
    /// Morph targets: displaced positions and normals (absolute; the file stores differences).
    pub(crate) targets: Vec<(Vec<DVec3>, Vec<DVec3>)>,
}

/// A count as glTF stores it.
pub(crate) fn index(n: usize) -> u32 {
    u32::try_from(n).expect("meshes made here are small")
}

impl Shape {
    /// A surface over the unit square: `at(u, v)` with u to the right and v down as seen from outside, in
    /// `columns × rows` cells; normals by the surface's own differences. Cells may collapse at poles.
    pub(crate) fn surface(columns: u32, rows: u32, at: impl Fn(f64, f64) -> DVec3) -> Self {
        let mut shape = Self::default();
        let h = 1e-5;
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
                // Differences taken a hair inside the square, where poles have a tangent.
                let (iu, iv) = (u.clamp(2.0 * h, 1.0 - 2.0 * h), v.clamp(2.0 * h, 1.0 - 2.0 * h));
                let right = at(iu + h, iv) - at(iu - h, iv);
                let down = at(iu, iv + h) - at(iu, iv - h);
                shape.positions.push(at(u, v));
                shape.normals.push(down.cross(right).normalize_or(DVec3::Y));
                shape.uvs.push(DVec2::new(u, v));
            }
        }
        let stride = columns + 1;
        for row in 0..rows {
            for column in 0..columns {
                let a = row * stride + column;
                shape.push_cell([a, a + stride, a + stride + 1, a + 1]);
            }
        }
        shape
    }

    /// Two triangles for a cell given counter-clockwise, leaving out those without area.
    fn push_cell(&mut self, [a, b, c, d]: [u32; 4]) {
        for triangle in [[a, b, c], [a, c, d]] {
            let [p, q, r] = triangle.map(|i| self.positions[i as usize]);
            if (q - p).cross(r - p).length() > 1e-12 {
                self.triangles.push(triangle);
            }
        }
    }

    /// A ball about the origin, poles on y; texture column 1/2 faces −z, column 0 faces +z.
    pub(crate) fn ball(radius: f64, around: u32, down: u32) -> Self {
        let mut shape = Self::surface(around, down, |u, v| radius * direction(u, v));
        for (normal, position) in shape.normals.iter_mut().zip(&shape.positions) {
            *normal = *position / radius;
        }
        shape
    }

    /// A ring about y through the circle of radius `ring` with a wire of radius `wire`.
    pub(crate) fn torus(ring: f64, wire: f64, around: u32, across: u32) -> Self {
        Self::surface(around, across, |u, v| {
            let out = DVec3::new(libm::sin(TAU * u), 0.0, libm::cos(TAU * u));
            let turn = -TAU * v;
            out * (ring + wire * libm::cos(turn)) + DVec3::Y * (wire * libm::sin(turn))
        })
    }

    /// A rectangle about `centre` with half axes `right` and `up`; it faces `right × up`. Texture coordinates run from
    /// 0 to `tiles`.
    pub(crate) fn quad(centre: DVec3, right: DVec3, up: DVec3, tiles: DVec2) -> Self {
        let n = right.cross(up).normalize();
        let corner = |x: f64, y: f64| centre + x * right + y * up;
        Self {
            positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            normals: vec![n; 4],
            uvs: [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)].map(|(u, v)| DVec2::new(u, v) * tiles).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Self::default()
        }
    }

    /// A box of the given half sizes whose edges are rounded with radius `bevel` in `steps` steps.
    pub(crate) fn block(half: DVec3, bevel: f64, steps: u32) -> Self {
        let mut shape = Self::default();
        let faces = [
            (DVec3::X, DVec3::NEG_Z),
            (DVec3::NEG_X, DVec3::Z),
            (DVec3::Y, DVec3::X),
            (DVec3::NEG_Y, DVec3::X),
            (DVec3::Z, DVec3::X),
            (DVec3::NEG_Z, DVec3::NEG_X),
        ];
        for (out, right) in faces {
            shape.join(&block_face(half, bevel, steps, out, right));
        }
        shape
    }

    /// Moves it by an affine transform without reflection.
    pub(crate) fn moved(mut self, transform: DAffine3) -> Self {
        let normal_matrix: DMat3 = transform.matrix3.inverse().transpose();
        for p in &mut self.positions {
            *p = transform.transform_point3(*p);
        }
        for n in &mut self.normals {
            *n = (normal_matrix * *n).normalize();
        }
        self
    }

    /// Moves it by a vector.
    pub(crate) fn at(self, x: f64, y: f64, z: f64) -> Self {
        self.moved(DAffine3::from_translation(DVec3::new(x, y, z)))
    }

    /// Adds another mesh's triangles.
    pub(crate) fn join(&mut self, other: &Self) {
        let base = index(self.positions.len());
        self.positions.extend(&other.positions);
        self.normals.extend(&other.normals);
        self.uvs.extend(&other.uvs);
        self.joints.extend(&other.joints);
        self.weights.extend(&other.weights);
        self.triangles.extend(other.triangles.iter().map(|t| t.map(|i| i + base)));
    }

    /// Flat: every triangle with corners and a normal of its own.
    pub(crate) fn faceted(&self) -> Self {
        let mut shape = Self::default();
        for t in &self.triangles {
            let corners = t.map(|i| self.positions[i as usize]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
            let base = index(shape.positions.len());
            shape.positions.extend(corners);
            shape.normals.extend([normal; 3]);
            shape.uvs.extend(t.map(|i| self.uvs[i as usize]));
            shape.triangles.push([base, base + 1, base + 2]);
        }
        shape
    }

    /// Without texture coordinates: nothing reads them.
    pub(crate) fn plain(mut self) -> Self {
        self.uvs.clear();
        self
    }

    /// With joints and weights by position.
    pub(crate) fn bound(mut self, binding: impl Fn(DVec3) -> ([u8; 4], [f64; 4])) -> Self {
        (self.joints, self.weights) = self.positions.iter().map(|&p| binding(p)).unzip();
        self
    }
}

/// Unit direction at texture coordinates of a latitude-longitude picture seen from outside: v = 0 is +y, u = 0 is +z.
pub(crate) fn direction(u: f64, v: f64) -> DVec3 {
    let (theta, phi) = (std::f64::consts::PI * v, TAU * u);
    let ring = libm::sin(theta);
    DVec3::new(ring * libm::sin(phi), libm::cos(theta), ring * libm::cos(phi))
}

/// One face of a rounded box, seen along −`out` with `right` to the right.
fn block_face(half: DVec3, bevel: f64, steps: u32, out: DVec3, right: DVec3) -> Shape {
    let up = out.cross(right);
    let (w, h, d) = (half.dot(right.abs()), half.dot(up.abs()), half.dot(out.abs()));
    // Grid lines that divide the rounded quarter circle into equal angles up to 45 degrees, then the flat middle.
    let lines = |extent: f64| -> Vec<f64> {
        let mut list: Vec<f64> = (0..=steps)
            .map(|i| {
                let angle = std::f64::consts::FRAC_PI_4 * f64::from(steps - i) / f64::from(steps);
                -(extent - bevel) - bevel * libm::tan(angle)
            })
            .collect();
        list.extend(list.clone().iter().rev().map(|x| -x));
        list
    };
    let (xs, ys) = (lines(w), lines(h));
    let mut shape = Shape::default();
    for &y in ys.iter().rev() {
        for &x in &xs {
            let on_cube = x * right + y * up + d * out;
            let inner = half - DVec3::splat(bevel);
            let core = on_cube.clamp(-inner, inner);
            let normal = (on_cube - core).normalize();
            shape.positions.push(core + bevel * normal);
            shape.normals.push(normal);
            shape.uvs.push(DVec2::new(0.5 + 0.5 * x / w, 0.5 - 0.5 * y / h));
        }
    }
    let stride = index(xs.len());
    for row in 0..index(ys.len()) - 1 {
        for column in 0..stride - 1 {
            let a = row * stride + column;
            shape.push_cell([a, a + stride, a + stride + 1, a + 1]);
        }
    }
    shape
}
