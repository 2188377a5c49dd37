//! Ambient light: its radiance, and which occlusion keeps it from surfaces.

use glam::Vec3;

use crate::integrators::IntegratorSettings;
use crate::integrators::ao::Occlusion;
use crate::settings::choices;

choices! {
    /// How the environment lights surfaces.
    pub enum EnvironmentLight {
        /// As a light: shadow rays find what of it a surface sees
        Traced = "traced",
        /// As part of the ambient light; it is visible behind the scene only
        Ambient = "ambient",
    }
}

choices! {
    /// Which light ambient occlusion darkens.
    pub enum OccludedLight {
        /// Ambient light: what is physically meant
        Ambient = "ambient",
        /// All light of a surface, direct light too: shading times (1 - AO), as Larsen (2019) has it
        All = "all",
    }
}

/// Ambient light, and what keeps it from surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ambient {
    /// Radiance, linear RGB.
    pub color: Vec3,
    /// Which hits keep it from a surface.
    pub occlusion: Occlusion,
    /// The light that ambient occlusion darkens.
    pub occluded: OccludedLight,
}

impl Ambient {
    /// The ambient light that settings describe.
    pub(super) fn new(settings: &IntegratorSettings) -> Self {
        Self {
            color: settings.path.ambient.map_or(Vec3::ONE, |c| c.as_vec3()),
            occlusion: settings.ao.occlusion(),
            occluded: settings.path.occluded_light.unwrap_or_default(),
        }
    }
}

impl std::fmt::Display for Ambient {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Occlusion { radius, falloff, hemisphere } = self.occlusion;
        let [r, g, b] = self.color.to_array();
        write!(f, "{r}, {g}, {b}; AO radius {radius}, falloff {falloff}, {hemisphere} normal")?;
        match self.occluded {
            OccludedLight::Ambient => Ok(()),
            OccludedLight::All => f.write_str(", of all light"),
        }
    }
}

impl serde::Serialize for Ambient {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let Occlusion { radius, falloff, hemisphere } = self.occlusion;
        serde_json::json!({
            "color": self.color.to_array(),
            "radius": radius.is_finite().then_some(radius),
            "falloff": falloff,
            "occluded_light": self.occluded,
            "normal": hemisphere,
        })
        .serialize(serializer)
    }
}
