//! `KHR_materials_variants`: which material a primitive wears.

use super::context::Context;
use super::schema::PrimitiveDef;
use crate::{Error, Result};
use serde::Deserialize;

const NAME: &str = "KHR_materials_variants";

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Variants {
    variants: Vec<Variant>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Variant {
    name: String,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Mappings {
    mappings: Vec<Mapping>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Mapping {
    material: Option<usize>,
    variants: Vec<usize>,
}

/// Refuses a variant that the file does not have.
pub(super) fn check(ctx: &Context<'_>) -> Result<()> {
    let Some(wanted) = &ctx.options.variant else { return Ok(()) };
    if chosen(ctx)?.is_some() {
        return Ok(());
    }
    let names: Vec<String> = all(ctx)?.variants.into_iter().map(|v| format!("\"{}\"", v.name)).collect();
    let available = if names.is_empty() { "it has none".into() } else { format!("it has {}", names.join(", ")) };
    Err(Error::NoSuchObject { path: ctx.path.clone(), kind: "variant", wanted: format!("\"{wanted}\""), available })
}

fn all(ctx: &Context<'_>) -> Result<Variants> {
    Ok(ctx.extension(&ctx.doc.extensions, NAME, "file")?.unwrap_or_default())
}

fn chosen(ctx: &Context<'_>) -> Result<Option<usize>> {
    let Some(wanted) = &ctx.options.variant else { return Ok(None) };
    Ok(all(ctx)?.variants.iter().position(|v| v.name == *wanted))
}

/// The material of `primitive` under the chosen variant.
pub(super) fn material(ctx: &Context<'_>, primitive: &PrimitiveDef, object: &str) -> Result<Option<usize>> {
    if let Some(variant) = chosen(ctx)?
        && let Some(mappings) = ctx.extension::<Mappings>(&primitive.extensions, NAME, object)?
        && let Some(mapping) = mappings.mappings.iter().find(|m| m.variants.contains(&variant))
    {
        return Ok(mapping.material);
    }
    Ok(primitive.material)
}
