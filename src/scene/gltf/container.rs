//! The outermost layer: GLB chunks, JSON, version and required extensions.

use super::context::{Context, plain};
use super::schema::{Document, MaterialDef, NodeDef};
use crate::{Error, Result};

/// Extensions that the import honours: wholly, or as far as they touch the picture.
pub(super) const SUPPORTED: &[&str] = &[
    "EXT_lights_image_based",
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_basisu",
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
];

/// Bytes that one JSON object may take in memory: a material, the largest, has 0.9 KiB. `{}` is two bytes of text, so
/// that a few megabytes of them would fill the machine.
const OBJECT: u64 = 1024;
const _: () = assert!(size_of::<MaterialDef>() as u64 <= OBJECT && size_of::<NodeDef>() as u64 <= OBJECT);

/// Splits `bytes` into the document and the binary chunk of a GLB.
pub(super) fn open(ctx: &Context<'_>, bytes: &[u8]) -> Result<(Document, Option<Vec<u8>>)> {
    let (json, binary) = if bytes.starts_with(b"glTF") { glb(ctx, bytes)? } else { (bytes, None) };
    let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
    if json.iter().all(u8::is_ascii_whitespace) {
        return Err(ctx.error("file", "is empty, expected glTF 2.0"));
    }
    #[allow(clippy::naive_bytecount, reason = "a crate for this is not worth its gain: 0.1 s a GiB")]
    let objects = json.iter().filter(|&&b| b == b'{').count();
    ctx.check_transient(objects as u64 * OBJECT, "file")?;
    let doc = serde_json::from_slice(json).map_err(|e| {
        let what = if e.is_data() { "the JSON does not follow glTF's schema" } else { "is not valid JSON" };
        ctx.error("file", format!("{what}: {}", plain(&e)))
    })?;
    Ok((doc, binary.map(<[u8]>::to_vec)))
}

/// The JSON and the binary chunk of a GLB (glTF 2.0, section 4).
fn glb<'b>(ctx: &Context<'_>, bytes: &'b [u8]) -> Result<(&'b [u8], Option<&'b [u8]>)> {
    let word = |at: usize| -> Option<u32> { bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes) };
    let bad = |problem: String| ctx.error("GLB container", problem);
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(bad(format!("ends after {} bytes, within its 12-byte header", bytes.len())));
    };
    if version != 2 {
        return Err(bad(format!("has version {version}, expected 2")));
    }
    let length = length as usize;
    if length > bytes.len() {
        return Err(bad(format!("says it has {length} bytes, but the file has {}", bytes.len())));
    }
    if length < bytes.len() {
        ctx.warn("GLB container", format!("{} bytes after its end are ignored", bytes.len() - length));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at + 8 <= length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else { break };
        let end = (at + 8).checked_add(size as usize).filter(|&end| end <= length);
        let Some(end) = end else {
            return Err(bad(format!("its chunk at byte {at} has {size} bytes, more than the container holds")));
        };
        let chunk = &bytes[at + 8..end];
        match (kind, &json) {
            (0x4E4F_534A, None) => json = Some(chunk),
            (0x4E4F_534A, Some(_)) => return Err(bad("has two JSON chunks".into())),
            (_, None) => return Err(bad("its first chunk is not JSON".into())),
            (0x004E_4942, _) if binary.is_none() => binary = Some(chunk),
            _ => ctx.warn("GLB container", format!("the chunk of unknown kind {kind:#010x} is ignored")),
        }
        at = end;
    }
    json.map(|json| (json, binary)).ok_or_else(|| bad("has no JSON chunk".into()))
}

/// Refuses versions and required extensions that are not understood; notes optional ones.
pub(super) fn check(ctx: &Context<'_>) -> Result<()> {
    let asset = &ctx.doc.asset;
    let version = asset.version.as_deref().unwrap_or_default();
    let parts = |v: &str| -> Option<(u32, u32)> {
        let (major, minor) = v.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    };
    match parts(version) {
        Some((2, minor)) if minor > 0 => {
            ctx.warn("asset", format!("has version {version}; it is read as 2.0"));
        }
        Some((2, _)) => {}
        Some(_) => return Err(ctx.error("asset", format!("has glTF version {version}, expected 2.0"))),
        None => return Err(ctx.error("asset", format!("has the version \"{}\", expected 2.0", version.escape_debug()))),
    }
    if let Some(least) = asset.min_version.as_deref()
        && parts(least).is_none_or(|v| v > (2, 0))
    {
        return Err(ctx.error("asset", format!("needs at least glTF {}, expected 2.0", least.escape_debug())));
    }
    for name in &ctx.doc.extensions_required {
        if !SUPPORTED.contains(&name.as_str()) {
            return Err(Error::UnsupportedExtension { path: ctx.path.clone(), extension: name.clone() });
        }
    }
    for name in &ctx.doc.extensions_used {
        if !SUPPORTED.contains(&name.as_str()) {
            ctx.warn(format!("extension {name}"), "is not supported and has no effect");
        }
    }
    Ok(())
}
