//! What a scene holds, for people and for programs.

use super::{AlphaMode, ExtensionUse, LightShape, Projection, Property, Scene, Track};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// A summary of a scene.
#[derive(Debug, Clone, Serialize)]
pub struct Info {
    /// The file.
    pub path: PathBuf,
    /// BLAKE3 over the file and all that it refers to, hexadecimal.
    pub hash: String,
    /// Nodes of the shown scene.
    pub nodes: usize,
    /// Copies of meshes that the scene shows.
    pub instances: usize,
    /// Triangle meshes.
    pub meshes: Vec<MeshInfo>,
    /// Triangles of all meshes, each counted once.
    pub triangles: usize,
    /// Triangles that the scene shows, copies counted.
    pub shown_triangles: usize,
    /// Cameras with the node that holds each.
    pub cameras: Vec<CameraInfo>,
    /// Animations.
    pub animations: Vec<AnimationInfo>,
    /// Punctual lights.
    pub lights: Vec<LightInfo>,
    /// Whether the file brings its own surroundings.
    pub environment: bool,
    /// Materials.
    pub materials: Vec<MaterialInfo>,
    /// Images.
    pub images: Vec<ImageInfo>,
    /// Skins.
    pub skins: usize,
    /// Extensions that the file names.
    pub extensions: Vec<ExtensionUse>,
    /// What was odd but not fatal.
    pub warnings: Vec<String>,
}

/// A triangle mesh.
#[derive(Debug, Clone, Serialize)]
pub struct MeshInfo {
    /// The file's name for it.
    pub name: String,
    /// Triangles.
    pub triangles: usize,
    /// Vertices.
    pub vertices: usize,
    /// Morph targets.
    pub morph_targets: usize,
    /// Whether joints move it.
    pub skinned: bool,
}

/// A camera.
#[derive(Debug, Clone, Serialize)]
pub struct CameraInfo {
    /// The file's name for it, or for its node.
    pub name: String,
    /// The node that holds it.
    pub node: usize,
    /// "perspective" or "orthographic".
    pub projection: &'static str,
    /// Vertical angle of view in degrees, or height of the view in metres.
    pub view: f32,
    /// Aperture as an f-stop, from `extras`.
    pub f_stop: Option<f32>,
    /// Aperture radius in metres, from `extras`.
    pub aperture_radius: Option<f32>,
    /// Distance of the plane in focus in metres, from `extras`.
    pub focus_distance: Option<f32>,
    /// Shutter angle in degrees, from `extras`.
    pub shutter_angle: Option<f32>,
}

/// An animation.
#[derive(Debug, Clone, Serialize)]
pub struct AnimationInfo {
    /// The file's name for it.
    pub name: String,
    /// First key, seconds.
    pub start: f64,
    /// Last key, seconds.
    pub end: f64,
    /// Curves.
    pub channels: usize,
}

/// A punctual light.
#[derive(Debug, Clone, Serialize)]
pub struct LightInfo {
    /// The file's name for it.
    pub name: String,
    /// "directional", "point" or "spot".
    pub kind: &'static str,
    /// Linear colour × intensity: candela, or lux for directional lights.
    pub intensity: [f32; 3],
    /// Radius in metres, or for directional lights in radians.
    pub radius: f32,
}

/// A material.
#[derive(Debug, Clone, Serialize)]
pub struct MaterialInfo {
    /// The file's name for it.
    pub name: String,
    /// What it has beside base colour, metalness and roughness.
    pub features: Vec<&'static str>,
}

/// An image.
#[derive(Debug, Clone, Serialize)]
pub struct ImageInfo {
    /// The file's name for it.
    pub name: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Info {
    /// Sums `scene` up.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let mut hash = String::new();
        for byte in scene.hash {
            hash.push_str(&format!("{byte:02x}"));
        }
        let copies = |n: &super::Node| n.copies.as_ref().map_or(1, Vec::len);
        let triangles = |ids: &[usize]| ids.iter().map(|&m| scene.meshes[m].triangles.len()).sum::<usize>();
        Self {
            path: scene.path.clone(),
            hash,
            nodes: scene.nodes.len(),
            instances: scene.nodes.iter().map(|n| n.meshes.len() * copies(n)).sum(),
            triangles: scene.meshes.iter().map(|m| m.triangles.len()).sum(),
            shown_triangles: scene.nodes.iter().map(|n| triangles(&n.meshes) * copies(n)).sum(),
            meshes: scene.meshes.iter().map(mesh).collect(),
            cameras: cameras(scene),
            animations: scene.animations.iter().map(animation).collect(),
            lights: scene.lights.iter().map(light).collect(),
            environment: scene.environment.is_some(),
            materials: scene.materials.iter().map(material).collect(),
            images: scene
                .images
                .iter()
                .map(|i| ImageInfo { name: i.name.clone(), width: i.width, height: i.height })
                .collect(),
            skins: scene.skins.len(),
            extensions: scene.extensions.clone(),
            warnings: scene.warnings.clone(),
        }
    }
}

fn mesh(mesh: &super::Mesh) -> MeshInfo {
    MeshInfo {
        name: mesh.name.clone(),
        triangles: mesh.triangles.len(),
        vertices: mesh.positions.len(),
        morph_targets: mesh.targets.len(),
        skinned: mesh.skin.is_some(),
    }
}

fn cameras(scene: &Scene) -> Vec<CameraInfo> {
    let mut list = Vec::new();
    for (node, holder) in scene.nodes.iter().enumerate() {
        let Some(camera) = holder.camera.map(|c| &scene.cameras[c]) else { continue };
        let (projection, view) = match camera.projection {
            Projection::Perspective { yfov, .. } => ("perspective", yfov.to_degrees()),
            Projection::Orthographic { ymag, .. } => ("orthographic", 2.0 * ymag.abs()),
        };
        list.push(CameraInfo {
            name: if camera.name.is_empty() { holder.name.clone() } else { camera.name.clone() },
            node,
            projection,
            view,
            f_stop: camera.lens.f_stop,
            aperture_radius: camera.lens.aperture_radius,
            focus_distance: camera.lens.focus_distance,
            shutter_angle: camera.lens.shutter_angle,
        });
    }
    list
}

/// First and last key of a curve.
fn span<T>(track: &Track<T>) -> (f64, f64) {
    (track.times.first().copied().unwrap_or(0.0), track.times.last().copied().unwrap_or(0.0))
}

fn animation(animation: &super::Animation) -> AnimationInfo {
    let spans = animation.channels.iter().map(|c| match &c.property {
        Property::Translation(t) | Property::Scale(t) => span(t),
        Property::Rotation(t) => span(t),
        Property::Weights(t) | Property::Visibility(t) => span(t),
    });
    let both = spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((0.0, 0.0));
    AnimationInfo { name: animation.name.clone(), start: both.0, end: both.1, channels: animation.channels.len() }
}

fn light(light: &super::Light) -> LightInfo {
    let (kind, radius) = match light.shape {
        LightShape::Directional { angular_radius } => ("directional", angular_radius),
        LightShape::Point { radius } => ("point", radius),
        LightShape::Spot { radius, .. } => ("spot", radius),
    };
    LightInfo { name: light.name.clone(), kind, intensity: light.intensity.to_array(), radius }
}

fn material(m: &super::Material) -> MaterialInfo {
    let features = [
        ("base colour texture", m.base_color_texture.is_some()),
        ("metal-roughness texture", m.metallic_roughness_texture.is_some()),
        ("normal texture", m.normal_texture.is_some()),
        ("emission", m.emissive.max_element() > 0.0),
        ("alpha mask", matches!(m.alpha_mode, AlphaMode::Mask { .. })),
        ("alpha blend", m.alpha_mode == AlphaMode::Blend),
        ("double-sided", m.double_sided),
        ("unlit", m.unlit),
        ("specular", m.specular.is_some()),
        ("transmission", m.transmission.is_some()),
        ("volume", m.transmission.is_some_and(|t| t.volume.is_some())),
        ("clearcoat", m.clearcoat.is_some()),
        ("sheen", m.sheen.is_some()),
        ("iridescence", m.iridescence.is_some()),
        ("anisotropy", m.anisotropy.is_some()),
        ("diffuse transmission", m.diffuse_transmission.is_some()),
    ];
    let features = features.into_iter().filter_map(|(name, has)| has.then_some(name)).collect();
    MaterialInfo { name: m.name.clone(), features }
}

/// A name in quotes, or a dash.
fn quoted(name: &str) -> String {
    if name.is_empty() { "–".into() } else { format!("\"{}\"", name.escape_debug()) }
}

/// A heading and a line for each item, of which `most` are shown.
fn section<T>(
    f: &mut fmt::Formatter<'_>,
    title: &str,
    items: &[T],
    most: usize,
    line: impl Fn(usize, &T) -> String,
) -> fmt::Result {
    if items.is_empty() {
        return Ok(());
    }
    writeln!(f, "\n{title}")?;
    for (i, item) in items.iter().take(most).enumerate() {
        writeln!(f, "  {}", line(i, item))?;
    }
    if items.len() > most {
        writeln!(f, "  … and {} more", items.len() - most)?;
    }
    Ok(())
}

/// Items of a section that are shown.
const MOST: usize = 20;

impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.path.display())?;
        writeln!(f, "  nodes      {}", self.nodes)?;
        writeln!(f, "  meshes     {}, {} triangles", self.meshes.len(), self.triangles)?;
        writeln!(f, "  instances  {}, {} triangles", self.instances, self.shown_triangles)?;
        writeln!(f, "  materials  {}", self.materials.len())?;
        writeln!(f, "  images     {}", self.images.len())?;
        if self.skins > 0 {
            writeln!(f, "  skins      {}", self.skins)?;
        }
        if self.environment {
            writeln!(f, "  surroundings from the file")?;
        }
        writeln!(f, "  hash       {}", &self.hash[..16])?;
        section(f, "Cameras", &self.cameras, MOST, |i, c| format!("{i}  {}", camera_line(c)))?;
        section(f, "Animations", &self.animations, MOST, |i, a| {
            format!("{i}  {}  {:.3} s to {:.3} s, {} channels", quoted(&a.name), a.start, a.end, a.channels)
        })?;
        section(f, "Lights", &self.lights, MOST, |i, l| format!("{i}  {}", light_line(l)))?;
        section(f, "Meshes", &self.meshes, MOST, |i, m| format!("{i}  {}", mesh_line(m)))?;
        section(f, "Materials", &self.materials, MOST, |i, m| {
            format!("{i}  {}  {}", quoted(&m.name), m.features.join(", "))
        })?;
        section(f, "Images", &self.images, MOST, |i, m| {
            format!("{i}  {}  {} x {}", quoted(&m.name), m.width, m.height)
        })?;
        section(f, "Extensions", &self.extensions, usize::MAX, |_, e| {
            let required = if e.required { ", required" } else { "" };
            format!("{}  {}{required}", e.name, if e.supported { "supported" } else { "not supported" })
        })?;
        section(f, "Warnings", &self.warnings, MOST, |_, w| w.clone())
    }
}

fn camera_line(c: &CameraInfo) -> String {
    let unit = if c.projection == "perspective" { "°" } else { " m" };
    let mut text = format!("{}  {}, {:.1}{unit} high, at node {}", quoted(&c.name), c.projection, c.view, c.node);
    for (name, value, unit) in [
        ("f/", c.f_stop, ""),
        ("aperture radius ", c.aperture_radius, " m"),
        ("focus at ", c.focus_distance, " m"),
        ("shutter ", c.shutter_angle, "°"),
    ] {
        if let Some(value) = value {
            text.push_str(&format!(", {name}{value}{unit}"));
        }
    }
    text
}

fn light_line(l: &LightInfo) -> String {
    let unit = if l.kind == "directional" { "lx" } else { "cd" };
    let [r, g, b] = l.intensity;
    let size = match (l.radius > 0.0, l.kind) {
        (false, _) => String::new(),
        (true, "directional") => format!(", {:.3}° across", 2.0 * l.radius.to_degrees()),
        (true, _) => format!(", radius {} m", l.radius),
    };
    format!("{}  {}, {r:.4} {g:.4} {b:.4} {unit}{size}", quoted(&l.name), l.kind)
}

fn mesh_line(m: &MeshInfo) -> String {
    let mut text = format!("{}  {} triangles, {} vertices", quoted(&m.name), m.triangles, m.vertices);
    if m.morph_targets > 0 {
        text.push_str(&format!(", {} morph targets", m.morph_targets));
    }
    if m.skinned {
        text.push_str(", skinned");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_scene_has_a_summary() {
        let text = Info::of(&Scene::default()).to_string();
        assert!(text.contains("meshes     0, 0 triangles") && !text.contains("Warnings"));
    }
}
