//! Settings of ambient occlusion, for stills and real-time frames.

use super::{Hemisphere, Occlusion};
#[cfg(feature = "cli")]
use crate::settings::parse::parse_falloff;
use crate::settings::{AppliesTo, Capability, Length, settings};

/// Integrators that these settings apply to.
const AO: AppliesTo = AppliesTo::all_of(Capability::AmbientOcclusion);

/// Maximum number of occlusion rays per camera ray.
#[cfg(feature = "cli")]
const MAX_RAYS: u32 = 16;

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
        /// Occlusion rays per camera ray: a power of two up to 16 [default: 2 from 64 samples on,
        /// else 1]
        ///
        /// With --resumable the default is 1.
        ///
        /// So many samples of a pixel share a camera ray and the surface point that it meets. Fewer camera rays take less time; edges need them.
        ao_rays: Option<u32>, option(value_name = "N", value_parser = parse_rays), applies(AppliesTo::stills_of(Capability::AmbientOcclusion));
    }
}

/// A number of occlusion rays per camera ray.
#[cfg(feature = "cli")]
fn parse_rays(text: &str) -> Result<u32, String> {
    let rays = text.trim().parse().ok().filter(|n: &u32| n.is_power_of_two() && *n <= MAX_RAYS);
    rays.ok_or_else(|| format!("must be a power of two from 1 to {MAX_RAYS}"))
}

impl AoSettings {
    /// AO radius in scene units; infinite for no limit, and before the scene has chosen one.
    pub fn radius(&self) -> f64 {
        match self.ao_radius {
            Some(Length::Units(units)) => units,
            _ => f64::INFINITY,
        }
    }

    /// Which hits occlude, binary where the falloff is left open.
    pub fn occlusion(&self) -> Occlusion {
        self.occlusion_with(1.0)
    }

    /// As [`AoSettings::occlusion`], with the falloff where it is left open.
    pub fn occlusion_with(&self, falloff: f64) -> Occlusion {
        Occlusion {
            radius: self.radius(),
            falloff: self.ao_falloff.unwrap_or(falloff),
            hemisphere: self.ao_normal.unwrap_or_default(),
        }
    }
}
