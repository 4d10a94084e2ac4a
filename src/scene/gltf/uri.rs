//! References out of the file: `data:` payloads and paths that must stay inside the file's folder.

use super::context::Context;
use crate::{Error, Result};
use percent_encoding::percent_decode_str;
use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

/// Reads what `uri` refers to, on behalf of `object`.
pub(super) fn read(ctx: &Context<'_>, uri: &str, object: &str) -> Result<Vec<u8>> {
    if let Some(rest) = strip_scheme(uri, "data") {
        return data(ctx, rest, object);
    }
    let (path, _) = resolve(ctx, uri, object)?;
    let bytes = read_bounded(ctx, &path, object)?;
    ctx.count_file(&path, &bytes);
    Ok(bytes)
}

/// Reads a regular file that is no larger than one decoded thing may be.
pub(super) fn read_bounded(ctx: &Context<'_>, path: &Path, object: &str) -> Result<Vec<u8>> {
    if let Some(pack) = &ctx.pack {
        let name = path.to_string_lossy();
        let length = pack.length(&name).unwrap_or(0);
        return if length > super::context::LARGEST {
            Err(too_long(ctx, path, length, object))
        } else {
            pack.read(&name)
        };
    }
    let about = fs::metadata(path).map_err(|e| Error::io(path, "read", e))?;
    if !about.is_file() {
        return Err(ctx.error(object, format!("{} is not a regular file", path.display())));
    }
    if about.len() > super::context::LARGEST {
        return Err(too_long(ctx, path, about.len(), object));
    }
    let file = fs::File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let mut bytes = Vec::new();
    file.take(super::context::LARGEST).read_to_end(&mut bytes).map_err(|e| Error::io(path, "read", e))?;
    Ok(bytes)
}

fn too_long(ctx: &Context<'_>, path: &Path, length: u64, object: &str) -> Error {
    let problem = format!("{} has {} MiB, more than the 1024 MiB that are read", path.display(), length >> 20);
    ctx.error(object, problem)
}

/// Whether `uri` carries its data itself.
pub(super) fn is_data(uri: &str) -> bool {
    strip_scheme(uri, "data").is_some()
}

/// The text after `scheme:`, whatever the scheme's case.
fn strip_scheme<'u>(uri: &'u str, scheme: &str) -> Option<&'u str> {
    let (head, rest) = uri.split_once(':')?;
    head.eq_ignore_ascii_case(scheme).then_some(rest)
}

/// The scheme of a URI (RFC 3986, section 3.1). One letter is a drive, not a scheme.
fn scheme(uri: &str) -> Option<&str> {
    let (head, _) = uri.split_once(':')?;
    let mut letters = head.chars();
    let first = letters.next()?;
    (first.is_ascii_alphabetic()
        && head.len() > 1
        && letters.all(|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.')))
    .then_some(head)
}

/// The file that `uri` names, and its name as the scene writes it.
pub(super) fn resolve(ctx: &Context<'_>, uri: &str, object: &str) -> Result<(PathBuf, String)> {
    let refuse = |why: &str| ctx.error(object, format!("the reference \"{}\" {why}", shortened(uri)));
    if let Some(scheme) = scheme(uri) {
        return Err(refuse(&format!("uses the scheme {scheme}:, but only data: and files beside the scene are read")));
    }
    if uri.starts_with("//") {
        return Err(refuse("names a network host, but only files beside the scene are read"));
    }
    let mut decoded =
        percent_decode_str(uri).decode_utf8().map_err(|_| refuse("is not UTF-8 once percent-decoded"))?.into_owned();
    if decoded.is_empty() || decoded.contains('\0') {
        return Err(refuse("is no file name"));
    }
    // A pack has no outside.
    if !ctx.options.allow_outside || ctx.pack.is_some() {
        if decoded.starts_with(['/', '\\']) || decoded.get(1..2) == Some(":") || Path::new(&decoded).is_absolute() {
            return Err(refuse("is an absolute path; only files in the scene's folder are read"));
        }
        if leaves_folder(&decoded) {
            return Err(refuse("leads out of the scene's folder by \"..\""));
        }
    }
    if let Some(pack) = &ctx.pack {
        let name = [without_detours(&decoded), without_detours(&decoded.replace('\\', "/"))]
            .into_iter()
            .find(|name| pack.length(name).is_some())
            .ok_or_else(|| refuse("names no file in the archive"))?;
        return Ok((PathBuf::from(&name), name));
    }
    let folder = folder_of(&ctx.path);
    let mut path = folder.join(&decoded);
    if !path.exists() && decoded.contains('\\') {
        decoded = decoded.replace('\\', "/");
        path = folder.join(&decoded);
    }
    let real = path.canonicalize().map_err(|e| Error::io(&path, "read", e))?;
    if !ctx.options.allow_outside {
        let real_folder = folder.canonicalize().map_err(|e| Error::io(&folder, "read", e))?;
        if !real.starts_with(&real_folder) {
            return Err(refuse("leads out of the scene's folder by a link"));
        }
    }
    Ok((real, without_detours(&decoded)))
}

/// A relative path without `.` and without `..` after a folder.
fn without_detours(path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match (part, parts.last()) {
            ("" | ".", Some(_)) | (".", None) => {}
            ("..", Some(last)) if !matches!(*last, "" | "..") => {
                parts.pop();
            }
            _ => parts.push(part),
        }
    }
    parts.join("/")
}

/// Whether a relative path ever climbs above where it starts; `/` and `\` both separate.
fn leaves_folder(path: &str) -> bool {
    let mut depth = 0_usize;
    for part in path.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => match depth.checked_sub(1) {
                Some(d) => depth = d,
                None => return true,
            },
            _ => depth += 1,
        }
    }
    false
}

pub(super) fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent.components().next().is_some() => parent.to_path_buf(),
        _ => Component::CurDir.as_os_str().into(),
    }
}

/// The payload of a `data:` URI (RFC 2397), which is given without its scheme.
fn data(ctx: &Context<'_>, rest: &str, object: &str) -> Result<Vec<u8>> {
    let (kind, payload) =
        rest.split_once(',').ok_or_else(|| ctx.error(object, "its data: reference has no comma before the data"))?;
    if kind.trim_end().to_ascii_lowercase().ends_with(";base64") {
        base64(payload).ok_or_else(|| ctx.error(object, "its data: reference is not valid base64"))
    } else {
        Ok(percent_decode_str(payload).collect())
    }
}

/// Decodes base64 (RFC 4648), either alphabet; padding and white space may be missing or percent-encoded.
fn base64(text: &str) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut held, mut padded) = (0_u32, 0_u32, false);
    for byte in percent_decode_str(text) {
        let six = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            b'=' => {
                padded = true;
                continue;
            }
            b' ' | b'\t' | b'\r' | b'\n' => continue,
            _ => return None,
        };
        if padded {
            return None;
        }
        bits = (bits << 6) | u32::from(six);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push(((bits >> held) & 0xff) as u8);
        }
    }
    // One left-over character carries fewer than eight bits: the text was cut.
    (held != 6).then_some(out)
}

/// The first part of a reference, for messages.
fn shortened(uri: &str) -> String {
    let mut text: String = uri.chars().take(80).collect();
    if text.len() < uri.len() {
        text.push('…');
    }
    text.escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::gltf::LoadOptions;

    fn refusal(uri: &str) -> String {
        let options = LoadOptions::default();
        let ctx = Context::new(PathBuf::from("shots/scene.gltf"), &options);
        read(&ctx, uri, "buffer 0").unwrap_err().to_string()
    }

    #[test]
    fn ways_out_are_refused_by_name() {
        for (uri, why) in [
            ("/etc/passwd", "absolute"),
            ("%2Fetc%2Fpasswd", "absolute"),
            ("C:\\secret.bin", "absolute"),
            ("../other.bin", "\"..\""),
            ("a/%2e%2e/../other.bin", "\"..\""),
            ("a\\..\\..\\other.bin", "\"..\""),
            ("https://host/x.bin", "scheme https:"),
            ("file:///etc/passwd", "scheme file:"),
            ("//host/share/x.bin", "network host"),
            ("x%00.bin", "no file name"),
        ] {
            let message = refusal(uri);
            assert!(message.contains(why), "{uri}: {message}");
        }
    }

    #[test]
    fn names_take_the_short_way() {
        for (long, short) in [("a/./b//c.bin", "a/b/c.bin"), ("./a/../b", "b"), ("../x", "../x"), ("/a/../b", "/b")] {
            assert_eq!(without_detours(long), short);
        }
    }

    #[test]
    fn climbing_within_the_folder_is_allowed() {
        assert!(!leaves_folder("a/b/../../c.bin"));
        assert!(leaves_folder("a/../../a/c.bin"));
    }

    #[cfg(unix)]
    #[test]
    fn links_that_lead_out_are_refused_unless_allowed() {
        let outside = tempfile::tempdir().unwrap();
        let inside = tempfile::tempdir().unwrap();
        fs::write(outside.path().join("x.bin"), b"secret").unwrap();
        std::os::unix::fs::symlink(outside.path().join("x.bin"), inside.path().join("x.bin")).unwrap();
        let mut options = LoadOptions::default();
        {
            let ctx = Context::new(inside.path().join("scene.gltf"), &options);
            assert!(read(&ctx, "x.bin", "buffer 0").unwrap_err().to_string().contains("by a link"));
        }
        options.allow_outside = true;
        let ctx = Context::new(inside.path().join("scene.gltf"), &options);
        assert_eq!(read(&ctx, "x.bin", "buffer 0").unwrap(), b"secret");
    }

    #[test]
    fn base64_follows_rfc_4648() {
        for (text, bytes) in [("", ""), ("Zg==", "f"), ("Zm8", "fo"), ("Zm9v", "foo"), ("Zm9vYmE=", "fooba")] {
            assert_eq!(base64(text).unwrap(), bytes.as_bytes());
        }
        assert!(base64("Zm9v=Zg").is_none() && base64("Z").is_none() && base64("Z!==").is_none());
    }
}
