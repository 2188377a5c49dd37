//! Settings of ambient occlusion, for stills and real-time frames.

use super::Hemisphere;
#[cfg(feature = "cli")]
use crate::settings::parse::parse_falloff;
use crate::settings::{AppliesTo, Capability, Length, settings};

/// Integrators that these settings apply to.
const AO: AppliesTo = AppliesTo::all_of(Capability::AmbientOcclusion);

settings! {
    /// Ambient occlusion.
    "Ambient occlusion"
    pub struct AoSettings {
        /// AO radius: hits beyond do not occlude [default: inf, or auto where hardly a ray would get out]
        ///
        /// In scene units; as a share of the scene's diagonal, such as 5%; `inf` for no limit; or `auto`, at which surfaces in view are 60 % open on average.
        ao_radius: Option<Length>,
            option(value_name = "R|PERCENT%|auto", value_parser = str::parse::<Length>, allow_hyphen_values = true), applies(AO), basic;
        /// AO falloff: a hit at distance d occludes by C^-d; 1 is binary [default: 1; 8 with --preset larsen]
        ao_falloff: Option<f64>, option(value_name = "C", value_parser = parse_falloff, allow_hyphen_values = true), applies(AO);
        /// Normal of the hemisphere that AO samples [default: geometric]
        ao_normal: Option<Hemisphere>, option(value_enum), applies(AO), research;
    }
}

impl AoSettings {
    /// AO radius in scene units; infinite for no limit, and before the scene has chosen one.
    pub fn radius(&self) -> f64 {
        match self.ao_radius {
            Some(Length::Units(units)) => units,
            _ => f64::INFINITY,
        }
    }

    /// Axis of the hemisphere.
    pub fn hemisphere(&self) -> Hemisphere {
        self.ao_normal.unwrap_or_default()
    }
}
