//! Emissive triangles: where they are at an instant, what they emit, and how textured ones are cut up.
//!
//! A triangle whose emission is textured is cut into n² congruent pieces; each piece is a light of its own with the
//! piece's mean emission, so the choice of a light follows the texture and the point within a piece is uniform.

use super::rectangle::Rectangle;
use super::tree::Extent;
use crate::numeric::luminance;
use crate::scene::motion::segment_at;
use crate::scene::texture::MAX_UV_SETS;
use crate::scene::{AlphaMode, Scene, Stage};
use crate::trace::bsdf::Materials;
use crate::trace::texture::{ColorSpace, Footprint, mean};
use glam::{Vec2, Vec3, Vec3A};

/// The most pieces that one instance's texture is cut into, beyond one for each triangle.
const MOST_PIECES: usize = 1 << 14;

/// The least emission that a piece is chosen by, relative to the mean over its texture.
const LEAST_SHARE: f32 = 0.02;

/// One emissive triangle, a piece of one, or two that make a rectangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Emitter {
    pub(super) instance: u32,
    pub(super) triangle: u32,
    piece: Piece,
    /// What it emits, where that is the same everywhere.
    pub(super) plain: Option<Vec3>,
    /// Whether its back shines too.
    pub(super) double_sided: bool,
    place: Place,
}

/// Where an emitter is.
#[derive(Debug, Clone, Copy)]
enum Place {
    /// Where its instance is at the instant asked for.
    Moving,
    /// Always there; 1 where the instance keeps the winding of its triangles, −1 where it mirrors them.
    Triangle([Vec3A; 3], f32),
    /// Always there: its number among the rectangles, and the second triangle's.
    Rectangle(u32, u32),
}

/// Where an emitter is at an instant.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shape<'a> {
    /// Corners, and 1 if they run counter-clockwise seen from the front, −1 if clockwise.
    Triangle([Vec3A; 3], f32),
    Rectangle(&'a Rectangle),
}

/// A piece of a triangle cut into `cuts`² congruent ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Piece {
    cuts: u16,
    column: u16,
    row: u16,
    /// 1 for pieces that point down.
    inverted: u16,
}

impl Piece {
    fn all(cuts: u16) -> impl Iterator<Item = Self> {
        (0..cuts).flat_map(move |row| {
            (0..cuts - row).flat_map(move |column| {
                let most = u16::from(column + row + 1 < cuts);
                (0..=most).map(move |inverted| Self { cuts, column, row, inverted })
            })
        })
    }

    /// Its number among [`Piece::all`].
    fn number(self) -> usize {
        let (n, row) = (usize::from(self.cuts), usize::from(self.row));
        row * (2 * n - row) + 2 * usize::from(self.column) + usize::from(self.inverted)
    }

    /// The piece that holds barycentric weights `b` (of the second and third corner).
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below the number of cuts")]
    fn at(cuts: u16, b: Vec2) -> Self {
        let scaled = b.clamp(Vec2::ZERO, Vec2::ONE) * f32::from(cuts);
        let row = (scaled.y as u16).min(cuts - 1);
        let column = (scaled.x as u16).min(cuts - 1 - row);
        let part = scaled - Vec2::new(f32::from(column), f32::from(row));
        let inverted = u16::from(part.x + part.y > 1.0 && column + row + 1 < cuts);
        Self { cuts, column, row, inverted }
    }

    /// Barycentric weights of its corners in the whole triangle.
    pub(super) fn corners(self) -> [Vec2; 3] {
        let (i, j, n) = (f32::from(self.column), f32::from(self.row), f32::from(self.cuts));
        let corners = if self.inverted == 0 {
            [(i, j), (i + 1.0, j), (i, j + 1.0)]
        } else {
            [(i + 1.0, j + 1.0), (i, j + 1.0), (i + 1.0, j)]
        };
        corners.map(|(x, y)| Vec2::new(x, y) / n)
    }
}

/// Where the pieces of one instance begin in [`Emitters::numbers`], and how its triangles are cut.
#[derive(Debug, Clone, Copy)]
struct Span {
    first: u32,
    cuts: u16,
}

/// All emissive triangles of a stage.
#[derive(Debug, Default)]
pub(super) struct Emitters {
    pub(super) list: Vec<Emitter>,
    pub(super) extents: Vec<Extent>,
    rectangles: Vec<Rectangle>,
    /// By instance; `None` for those that emit nothing.
    spans: Vec<Option<Span>>,
    /// The emitter of every piece of every emissive triangle.
    numbers: Vec<u32>,
    /// Instances whose emissive triangles move.
    pub(super) moving_instances: usize,
}

/// Corners of a triangle at `u_time`, world space.
#[inline]
pub(super) fn triangle_at(scene: &Scene, stage: &Stage, instance: u32, triangle: u32, u_time: f32) -> [Vec3A; 3] {
    let instance = &stage.instances[instance as usize];
    let geometry = &stage.geometries[instance.geometry];
    let mesh = &scene.meshes[geometry.mesh];
    let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
    let local = match geometry.keys.as_slice() {
        [] => corners.map(|i| mesh.positions[i]),
        [key] => corners.map(|i| key.positions[i]),
        keys => {
            let (s, f) = segment_at(&geometry.times, u_time);
            corners.map(|i| keys[s].positions[i] * (1.0 - f) + keys[s + 1].positions[i] * f)
        }
    };
    let matrix = instance.motion.at(u_time);
    local.map(|p| matrix.transform_point3a(p.into()))
}

/// 1 where an instance keeps the winding of its triangles at `u_time`, −1 where it mirrors them.
#[inline]
pub(super) fn winding(stage: &Stage, instance: u32, u_time: f32) -> f32 {
    if stage.instances[instance as usize].motion.at(u_time).matrix3.determinant() < 0.0 { -1.0 } else { 1.0 }
}

impl Emitters {
    /// Collects the stage's emissive triangles.
    pub(super) fn new(scene: &Scene, stage: &Stage, materials: &Materials) -> Self {
        let mut all = Self::default();
        for number in 0..stage.instances.len() {
            let span = all.add_instance(scene, stage, materials, number);
            all.spans.push(span);
        }
        all
    }

    #[allow(clippy::cast_possible_truncation, reason = "instances and triangles are counted in 32 bits")]
    fn add_instance(&mut self, scene: &Scene, stage: &Stage, materials: &Materials, number: usize) -> Option<Span> {
        let instance = &stage.instances[number];
        let geometry = &stage.geometries[instance.geometry];
        let mesh = &scene.meshes[geometry.mesh];
        let material = &scene.materials[mesh.material];
        if material.unlit || material.emissive.max_element() <= 0.0 || mesh.triangles.is_empty() {
            return None;
        }
        let cuts = cuts_of(scene, mesh.material, mesh.triangles.len());
        let times = key_times(stage, number);
        self.moving_instances += usize::from(times.len() > 1);
        let span = Span { first: self.numbers.len() as u32, cuts };
        let plain = (material.emissive_texture.is_none() && material.alpha_mode == AlphaMode::Opaque)
            .then_some(material.emissive);
        let still = times.len() == 1;
        let mut taken = None;
        // A piece that looks black through its 16 points may still hold a bright texel: it keeps a small share.
        let least = LEAST_SHARE * luminance(overall_emission(scene, mesh.material));
        for triangle in 0..mesh.triangles.len() as u32 {
            if taken.take() == Some(triangle) {
                continue;
            }
            let poses: Vec<_> =
                times.iter().map(|&t| (t, triangle_at(scene, stage, number as u32, triangle, t))).collect();
            let mut emitter = Emitter {
                instance: number as u32,
                triangle,
                piece: WHOLE,
                plain,
                double_sided: material.double_sided,
                place: Place::Moving,
            };
            if still && plain.is_some() && (triangle as usize) + 1 < mesh.triangles.len() {
                let next = triangle_at(scene, stage, number as u32, triangle + 1, 0.0);
                let winding = winding(stage, number as u32, 0.0);
                if let Some(rectangle) = Rectangle::of_triangles(&poses[0].1, &next, winding) {
                    taken = Some(triangle + 1);
                    self.numbers.extend([self.list.len() as u32; 2]);
                    let place = Place::Rectangle(self.rectangles.len() as u32, triangle + 1);
                    self.rectangles.push(rectangle);
                    self.list.push(Emitter { place, ..emitter });
                    self.extents.push(rectangle.extent(luminance(material.emissive), material.double_sided));
                    continue;
                }
            }
            for piece in Piece::all(cuts) {
                let mean = mean_emission(scene, materials, mesh.material, triangle, mesh, piece);
                let emission = luminance(mean).max(least);
                if still {
                    let corners = piece.corners().map(|b| blend(&poses[0].1, b));
                    emitter.place = Place::Triangle(corners, winding(stage, number as u32, 0.0));
                }
                self.numbers.push(self.list.len() as u32);
                self.list.push(Emitter { piece, ..emitter });
                self.extents.push(extent_of(&poses, piece, emission, material.double_sided, &instance.motion));
            }
        }
        Some(span)
    }

    /// The emitter at barycentric weights `b` of a triangle, if it emits.
    #[inline]
    pub(super) fn find(&self, instance: u32, triangle: u32, b: Vec2) -> Option<usize> {
        let span = self.spans.get(instance as usize).copied().flatten()?;
        let cuts = usize::from(span.cuts);
        let piece = triangle as usize * cuts * cuts + Piece::at(span.cuts, b).number();
        Some(self.numbers[span.first as usize + piece] as usize)
    }

    /// Where emitter `number` is at `u_time`.
    #[inline]
    pub(super) fn shape(&self, scene: &Scene, stage: &Stage, number: usize, u_time: f32) -> Shape<'_> {
        let e = &self.list[number];
        match e.place {
            Place::Triangle(corners, winding) => Shape::Triangle(corners, winding),
            Place::Rectangle(rectangle, _) => Shape::Rectangle(&self.rectangles[rectangle as usize]),
            Place::Moving => {
                let whole = triangle_at(scene, stage, e.instance, e.triangle, u_time);
                let corners = if e.piece == WHOLE { whole } else { e.piece.corners().map(|b| blend(&whole, b)) };
                Shape::Triangle(corners, winding(stage, e.instance, u_time))
            }
        }
    }

    /// The triangle of emitter `number` that holds `place`, a sample's.
    pub(super) fn triangle_of(&self, number: usize, place: Vec2) -> u32 {
        let e = &self.list[number];
        match e.place {
            Place::Rectangle(_, second) if place.x + place.y > 1.0 => second,
            _ => e.triangle,
        }
    }

    /// Barycentric weights in the whole triangle of weights `b` in the emitter's own piece.
    pub(super) fn whole_barycentric(&self, number: usize, b: Vec2) -> Vec2 {
        let [p, q, r] = self.list[number].piece.corners();
        p * (1.0 - b.x - b.y) + q * b.x + r * b.y
    }
}

/// A triangle that is not cut.
const WHOLE: Piece = Piece { cuts: 1, column: 0, row: 0, inverted: 0 };

fn blend(corners: &[Vec3A; 3], b: Vec2) -> Vec3A {
    corners[0] * (1.0 - b.x - b.y) + corners[1] * b.x + corners[2] * b.y
}

/// Texture coordinates of every set, and vertex alpha, at barycentric weights `b`.
pub(super) fn attributes_at(mesh: &crate::scene::Mesh, triangle: u32, b: Vec2) -> ([Vec2; MAX_UV_SETS], f32) {
    let corners = mesh.triangles[triangle as usize].map(|i| i as usize);
    let weights = [1.0 - b.x - b.y, b.x, b.y];
    let mut uvs = [Vec2::ZERO; MAX_UV_SETS];
    for (uv, set) in uvs.iter_mut().zip(&mesh.uvs) {
        *uv = corners.iter().zip(weights).map(|(&i, w)| set[i] * w).sum();
    }
    let alpha = if mesh.colors.is_empty() {
        1.0
    } else {
        corners.iter().zip(weights).map(|(&i, w)| mesh.colors[i].w * w).sum()
    };
    (uvs, alpha)
}

/// How finely textured emission is cut: a piece for every four texels, within bounds.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bounded by 128")]
fn cuts_of(scene: &Scene, material: usize, triangles: usize) -> u16 {
    let Some(reference) = &scene.materials[material].emissive_texture else { return 1 };
    let image = &scene.images[scene.textures[reference.texture].image];
    let texels = image.width as usize * image.height as usize;
    let pieces = (texels / 4).min(MOST_PIECES) / triangles;
    ((pieces as f32).sqrt() as u16).clamp(1, 128)
}

/// Mean emitted radiance over the whole texture.
fn overall_emission(scene: &Scene, material: usize) -> Vec3 {
    let material = &scene.materials[material];
    let texture = material.emissive_texture.map(|reference| {
        let image = &scene.images[scene.textures[reference.texture].image];
        mean(image, ColorSpace::Srgb).truncate()
    });
    material.emissive * texture.unwrap_or(Vec3::ONE)
}

/// Mean emitted radiance over a piece: 16 points, each prefiltered over its share.
fn mean_emission(
    scene: &Scene,
    materials: &Materials,
    material: usize,
    triangle: u32,
    mesh: &crate::scene::Mesh,
    piece: Piece,
) -> Vec3 {
    let Some(reference) = &scene.materials[material].emissive_texture else {
        return scene.materials[material].emissive;
    };
    let corners = piece.corners();
    let uv_of = |b: Vec2| attributes_at(mesh, triangle, b).0;
    let set = reference.uv_set;
    let at = |b: Vec2| uv_of(b).get(set).copied().unwrap_or_default();
    let [p, q, r] = corners.map(at);
    let width = (0.5 * (q - p).perp_dot(r - p).abs() / 16.0).sqrt();
    let mut sum = Vec3::ZERO;
    for small in Piece::all(4) {
        let inner: Vec2 = small.corners().into_iter().sum::<Vec2>() / 3.0;
        let b = corners[0] * (1.0 - inner.x - inner.y) + corners[1] * inner.x + corners[2] * inner.y;
        // The mean over the stochastic filter's choices comes from its middle; every level keeps the mean.
        sum += materials.emission(scene, material, &uv_of(b), Footprint::round(width, 0.5));
    }
    sum / 16.0
}

/// The union of an instance's own key times and its geometry's; a single 0 if nothing moves.
fn key_times(stage: &Stage, number: usize) -> Vec<f32> {
    let instance = &stage.instances[number];
    let geometry = &stage.geometries[instance.geometry];
    let mut times: Vec<f32> = Vec::new();
    if !instance.motion.is_still() {
        times.extend(instance.motion.times());
    }
    if geometry.keys.len() > 1 {
        times.extend(&geometry.times);
    }
    if times.is_empty() {
        return vec![0.0];
    }
    times.extend([0.0, 1.0]);
    times.sort_by(f32::total_cmp);
    // Where matrix and vertices both move, the path between keys is quadratic: its middle shows its whole bulge.
    let middles: Vec<f32> = times.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
    times.extend(middles);
    times.sort_by(f32::total_cmp);
    times.dedup();
    times
}

fn extent_of(
    poses: &[(f32, [Vec3A; 3])],
    piece: Piece,
    emission: f32,
    double_sided: bool,
    motion: &crate::scene::Motion,
) -> Extent {
    let boxes: Vec<(f32, [Vec3; 2])> = poses
        .iter()
        .map(|(t, corners)| {
            let p = piece.corners().map(|b| Vec3::from(blend(corners, b)));
            (*t, [p[0].min(p[1]).min(p[2]), p[0].max(p[1]).max(p[2])])
        })
        .collect();
    let mut strength = 0.0_f32;
    let (mut axis, mut cos_normals): (Option<Vec3>, f32) = (None, 1.0);
    let shares = f32::from(piece.cuts) * f32::from(piece.cuts);
    for (t, c) in poses {
        let normal2 = Vec3::from((c[1] - c[0]).cross(c[2] - c[0]));
        strength = strength.max(0.5 * normal2.length() / shares * emission);
        // A mirroring transform turns the winding, not the front.
        let mirrored = motion.at(*t).matrix3.determinant() < 0.0;
        if let Some(n) = (if mirrored { -normal2 } else { normal2 }).try_normalize() {
            let axis = *axis.get_or_insert(n);
            cos_normals = cos_normals.min(axis.dot(n));
        }
    }
    // A normal that turns at all is taken to face everywhere: what it does between the poses is not known here.
    let turns = cos_normals < 1.0 - crate::numeric::gamma(16);
    let all = double_sided || turns;
    Extent {
        boxes: enclosing(&boxes),
        axis: axis.unwrap_or(Vec3::Y),
        cos_normals: if all { -1.0 } else { 1.0 },
        cos_emission: 0.0,
        strength: if strength.is_finite() { strength } else { f32::MAX },
    }
}

/// Two boxes whose linear blend encloses all of `boxes` at their times, and what a quadratic path does between.
pub(super) fn enclosing(boxes: &[(f32, [Vec3; 2])]) -> [[Vec3; 2]; 2] {
    let (first, last) = (boxes[0].1, boxes[boxes.len() - 1].1);
    let (mut below, mut above) = (Vec3::ZERO, Vec3::ZERO);
    for (t, b) in boxes {
        let blend = |i: usize| first[i] * (1.0 - t) + last[i] * *t;
        below = below.max(blend(0) - b[0]);
        above = above.max(b[1] - blend(1));
    }
    // A parabola through three looked-at instants leaves their polyline by at most a quarter of its bulge.
    let (below, above) = (below * 1.25, above * 1.25);
    [[first[0] - below, first[1] + above], [last[0] - below, last[1] + above]]
}
