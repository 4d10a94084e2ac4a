//! Tangents by MikkTSpace (Mikkelsen 2008), which is what normal maps are baked for.

use super::context::Context;
use crate::Result;
use crate::scene::Mesh;
use crate::scene::decode::guarded;
use bevy_mikktspace::{Geometry, Ops, TangentSpace, generate_tangents};
use glam::{Vec3, Vec4};
use std::collections::HashMap;

/// Elementary functions that agree on every machine.
struct Portable;

impl Ops for Portable {
    fn sqrt(x: f32) -> f32 {
        libm::sqrtf(x)
    }

    fn acos(x: f32) -> f32 {
        libm::acosf(x)
    }
}

struct Corners<'m> {
    mesh: &'m Mesh,
    set: usize,
    tangents: Vec<Vec4>,
}

impl Corners<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.triangles[face][corner] as usize
    }
}

/// The normal at a corner: the vertex's, or the triangle's where the mesh is flat.
fn normal(mesh: &Mesh, face: usize, corner: usize) -> Vec3 {
    match mesh.normals.get(mesh.triangles[face][corner] as usize) {
        Some(&n) => n,
        None => {
            let [a, b, c] = mesh.triangles[face].map(|i| mesh.positions[i as usize]);
            super::attributes::unit((b - a).cross(c - a)).unwrap_or(Vec3::Y)
        }
    }
}

impl Geometry<Portable> for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        normal(self.mesh, face, corner).to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        // MikkTSpace counts v upwards, glTF downwards.
        let uv = self.mesh.uvs[self.set][self.vertex(face, corner)];
        [uv.x, -uv.y]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(space) = space {
            let [x, y, z, w] = space.tangent_encoded();
            self.tangents[face * 3 + corner] = Vec4::new(x, y, z, w);
        }
    }
}

/// Gives `mesh` tangents along texture coordinate set `set`. A vertex whose corners disagree is split, with all that
/// it carries.
pub(super) fn generate(ctx: &Context<'_>, mesh: &mut Mesh, set: usize, object: &str) -> Result<()> {
    let corners = mesh.triangles.len() * 3;
    // MikkTSpace holds about 200 bytes a corner while it works; 16 stay.
    ctx.check_transient(corners as u64 * 200, object)?;
    ctx.charge(corners as u64 * 16, object)?;
    let mut geometry = Corners { mesh, set, tangents: vec![Vec4::ZERO; corners] };
    if let Err(problem) = guarded("tangent", || generate_tangents(&mut geometry).map_err(|e| e.to_string())) {
        ctx.warn(object, format!("has no tangents: {problem}"));
        return Ok(());
    }
    let mut tangents = geometry.tangents;
    for (i, t) in tangents.iter_mut().enumerate() {
        *t = match super::attributes::unit(t.truncate()) {
            Some(direction) => direction.extend(t.w),
            None => normal(mesh, i / 3, i % 3).any_orthonormal_vector().extend(1.0),
        };
    }
    split(ctx, mesh, &tangents, object)
}

/// Assigns a tangent to each vertex, adding vertices where corners disagree.
fn split(ctx: &Context<'_>, mesh: &mut Mesh, corners: &[Vec4], object: &str) -> Result<()> {
    let old = mesh.positions.len();
    let mut assigned: Vec<Option<Vec4>> = vec![None; old];
    let mut added: HashMap<(u32, [u32; 4]), u32> = HashMap::new();
    let mut origin: Vec<u32> = Vec::new();
    for (corner, &tangent) in corners.iter().enumerate() {
        let slot = &mut mesh.triangles[corner / 3][corner % 3];
        match &mut assigned[*slot as usize] {
            empty @ None => *empty = Some(tangent),
            Some(t) if *t == tangent => {}
            Some(_) => {
                let key = (*slot, tangent.to_array().map(f32::to_bits));
                let next = u32::try_from(old + origin.len())
                    .map_err(|_| ctx.error(object, "has too many vertices once tangents split them"))?;
                *slot = *added.entry(key).or_insert_with(|| {
                    origin.push(key.0);
                    next
                });
            }
        }
    }
    mesh.tangents = assigned.into_iter().map(|t| t.unwrap_or(Vec4::new(1.0, 0.0, 0.0, 1.0))).collect();
    let mut fresh = vec![Vec4::ZERO; origin.len()];
    for ((_, bits), index) in added {
        fresh[index as usize - old] = Vec4::from_array(bits.map(f32::from_bits));
    }
    mesh.tangents.extend(fresh);
    let bytes = 64 + 36 * mesh.targets.len() as u64 + 8 * mesh.uvs.len() as u64;
    ctx.charge(origin.len() as u64 * bytes, object)?;
    copy(&mut mesh.positions, &origin);
    copy(&mut mesh.normals, &origin);
    copy(&mut mesh.colors, &origin);
    mesh.uvs.iter_mut().for_each(|uvs| copy(uvs, &origin));
    for target in &mut mesh.targets {
        copy(&mut target.positions, &origin);
        copy(&mut target.normals, &origin);
        copy(&mut target.tangents, &origin);
    }
    if let Some(skin) = &mut mesh.skin {
        for &from in &origin {
            let range = from as usize * skin.influences..(from as usize + 1) * skin.influences;
            skin.joints.extend_from_within(range.clone());
            skin.weights.extend_from_within(range);
        }
    }
    Ok(())
}

/// Appends copies of the elements at `origin`, unless the attribute is absent.
fn copy<T: Copy>(values: &mut Vec<T>, origin: &[u32]) {
    if !values.is_empty() {
        values.reserve(origin.len());
        for &from in origin {
            values.push(values[from as usize]);
        }
    }
}
