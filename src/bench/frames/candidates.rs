//! The presets that are compared; those of ambient occlusion all with the same occlusion settings.

use crate::error::{Error, Result};
use crate::raster::Primary;
use crate::realtime::{Preset, Settings, Technique};

/// Weight of a hit at the occlusion radius with exponential falloff: one step of an 8-bit image.
const MIN_WEIGHT: f64 = 1.0 / 255.0;
/// Falloff base c of Larsen (2019), in the units of that paper.
const THEIR_FALLOFF: f64 = 8.0;
/// Ray length of that paper, in the same units.
const THEIR_REACH: f64 = 100.0;

#[derive(Debug)]
pub struct Candidate {
    /// Name on the command line and in tables.
    pub name: &'static str,
    pub preset: Preset,
    /// Overrides the preset's technique.
    pub technique: Option<Technique>,
}

const fn preset(name: &'static str, preset: Preset) -> Candidate {
    Candidate { name, preset, technique: None }
}

/// All candidates, in the order of the tables.
pub const CANDIDATES: [Candidate; 7] = [
    preset("larsen", Preset::Larsen),
    preset("larsen-fixed", Preset::LarsenFixed),
    preset("fast", Preset::Fast),
    preset("balanced", Preset::Balanced),
    preset("quality", Preset::Quality),
    Candidate { name: "gtao", preset: Preset::Balanced, technique: Some(Technique::Gtao) },
    preset("reference", Preset::Reference),
];

impl Candidate {
    /// The candidate of this name, if there is one.
    pub fn find(name: &str) -> Option<&'static Self> {
        CANDIDATES.iter().find(|c| c.name == name)
    }

    /// Whether it is for ambient occlusion alone.
    pub fn is_for_occlusion_alone(&self) -> bool {
        self.technique.is_some() || self.preset.settings().technique == Technique::Larsen
    }
}

/// Occlusion settings of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Occlusion {
    /// Occlusion radius, scene units.
    pub reach: f64,
    falloff: f64,
    binary: bool,
}

impl Occlusion {
    /// Up to `reach` scene units, all alike (`binary`) or fading to [`MIN_WEIGHT`] there.
    ///
    /// # Errors
    /// [`Error::Scene`] for a scene so small that the falloff per scene unit is not finite.
    pub fn new(reach: f64, binary: bool) -> Result<Self> {
        let falloff = if binary { 1.0 } else { MIN_WEIGHT.powf(-1.0 / reach) };
        if falloff.is_finite() && reach > 0.0 {
            return Ok(Self { reach, falloff, binary });
        }
        Err(Error::Scene(format!(
            "occlusion that fades over {reach} scene units is too steep to compute: scale the scene up, or use --ao-falloff binary"
        )))
    }

    /// Settings with this occlusion. The length unit of the `larsen` pipeline is chosen so that its
    /// falloff, or its ray length, matches.
    pub fn apply_to(&self, settings: Settings) -> Settings {
        let (radius, unit) = if self.binary {
            (self.reach, self.reach / THEIR_REACH)
        } else {
            (f64::INFINITY, self.reach * THEIR_FALLOFF.ln() / -MIN_WEIGHT.ln())
        };
        let is_larsen = settings.technique == Technique::Larsen;
        let primary = if is_larsen { Some(Primary::Traced) } else { settings.primary };
        Settings { radius, falloff: self.falloff, unit, primary, ..settings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_pipelines_fade_alike() {
        let occlusion = Occlusion::new(60.0, false).unwrap();
        let s = occlusion.apply_to(CANDIDATES[0].preset.settings());
        assert!((s.falloff.powf(-60.0) - MIN_WEIGHT).abs() < 1e-12);
        // theirs: 8 to the distance in units of its own
        assert!((THEIR_FALLOFF.powf(-60.0 / s.unit) - MIN_WEIGHT).abs() < 1e-12);
        assert!(s.technique == Technique::Larsen && (s.unit * 2.66 / 60.0 - 1.0).abs() < 0.01);
        let binary = Occlusion::new(2.0, true).unwrap().apply_to(CANDIDATES[3].preset.settings());
        assert_eq!((binary.radius, binary.falloff, binary.unit), (2.0, 1.0, 0.02));
        assert_eq!(CANDIDATES[5].technique, Some(Technique::Gtao));
        assert_eq!(s.primary, Some(Primary::Traced));
    }

    #[test]
    fn what_is_too_small_is_said() {
        assert_eq!(Occlusion::new(0.001, false).unwrap_err().exit_code(), 3);
        assert!(Occlusion::new(0.001, true).is_ok());
    }
}
