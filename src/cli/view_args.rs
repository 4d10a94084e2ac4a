//! Flags for how pictures will be shown.

use super::shot_args::{OUTPUT, number};
use clap::Args;
use graeco::output::{View, ViewTransform};

/// How a PNG shows scene light.
#[derive(Debug, Clone, Args)]
pub(crate) struct ViewArgs {
    /// Brightens a PNG by this many stops [default: 0]
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = number, help_heading = OUTPUT)]
    exposure: Option<f64>,

    /// How a PNG shows scene light: standard (sRGB, clipped), agx, khronos-neutral [default: standard]
    #[arg(long, value_name = "NAME", help_heading = OUTPUT)]
    view: Option<ViewTransform>,
}

impl ViewArgs {
    /// The flags, over what was chosen before them.
    pub(crate) fn over(&self, before: View) -> View {
        View {
            transform: self.view.unwrap_or(before.transform),
            exposure_ev: self.exposure.unwrap_or(before.exposure_ev),
        }
    }
}
