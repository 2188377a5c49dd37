//! Settings of ambient occlusion, for stills and real-time frames.

use super::Hemisphere;
#[cfg(feature = "cli")]
use crate::settings::parse::{parse_falloff, parse_radius};
use crate::settings::{AppliesTo, Capability, settings};

/// Integrators that these settings apply to.
const AO: AppliesTo = AppliesTo::of(Capability::AmbientOcclusion);

settings! {
    /// Ambient occlusion.
    "Ambient occlusion"
    pub struct AoSettings {
        /// AO radius in scene units: hits beyond do not occlude [default: inf]
        ao_radius: Option<f64>, option(value_name = "R", value_parser = parse_radius, allow_hyphen_values = true), applies(AO);
        /// AO falloff: a hit at distance d occludes by C^-d; 1 is binary [default: 1; 8 with --preset larsen]
        ao_falloff: Option<f64>, option(value_name = "C", value_parser = parse_falloff, allow_hyphen_values = true), applies(AO);
        /// Normal of the hemisphere that AO samples [default: geometric]
        ao_normal: Option<Hemisphere>, option(value_enum), applies(AO);
    }
}

impl AoSettings {
    /// AO radius in scene units; infinite for no limit.
    pub fn radius(&self) -> f64 {
        self.ao_radius.unwrap_or(f64::INFINITY)
    }

    /// Axis of the hemisphere.
    pub fn hemisphere(&self) -> Hemisphere {
        self.ao_normal.unwrap_or_default()
    }
}
