//! The presets that are compared, all with the same occlusion settings.

use crate::error::{Error, Result};
use crate::raster::Primary;
use crate::realtime::{Preset, Settings, Technique};

/// Weight of a hit at the occlusion radius with exponential falloff: one step of an 8-bit image.
const MIN_WEIGHT: f64 = 1.0 / 255.0;
/// Falloff base c of Larsen (2019), in the units of that paper.
const THEIR_FALLOFF: f64 = 8.0;
/// Ray length of that paper, in the same units.
const THEIR_REACH: f64 = 100.0;

/// A preset that is compared.
#[derive(Debug)]
pub struct Candidate {
    /// Name on the command line and in tables.
    pub name: &'static str,
    preset: Preset,
    /// Overrides the preset's technique.
    technique: Option<Technique>,
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
    /// Its render settings with a scene's occlusion.
    pub fn settings(&self, occlusion: &Occlusion) -> Settings {
        let settings = self.preset.settings();
        let technique = self.technique.unwrap_or(settings.technique);
        // the pipeline of Larsen (2019) traces its camera rays
        let primary = if technique == Technique::Larsen { Some(Primary::Traced) } else { settings.primary };
        occlusion.of(Settings { technique, primary, ..settings })
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

    /// Settings with this occlusion. The length unit of the `larsen` pipeline is chosen so that its falloff, or its ray length, matches.
    pub fn of(&self, settings: Settings) -> Settings {
        let (radius, unit) = match self.binary {
            true => (self.reach, self.reach / THEIR_REACH),
            false => (f64::INFINITY, self.reach * THEIR_FALLOFF.ln() / -MIN_WEIGHT.ln()),
        };
        Settings { radius, falloff: self.falloff, unit, ..settings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_pipelines_fade_alike() {
        let occlusion = Occlusion::new(60.0, false).unwrap();
        let s = CANDIDATES[0].settings(&occlusion);
        assert!((s.falloff.powf(-60.0) - MIN_WEIGHT).abs() < 1e-12);
        // theirs: 8 to the distance in units of its own
        assert!((THEIR_FALLOFF.powf(-60.0 / s.unit) - MIN_WEIGHT).abs() < 1e-12);
        assert!(s.technique == Technique::Larsen && (s.unit * 2.66 / 60.0 - 1.0).abs() < 0.01);
        let binary = CANDIDATES[3].settings(&Occlusion::new(2.0, true).unwrap());
        assert_eq!((binary.radius, binary.falloff, binary.unit), (2.0, 1.0, 0.02));
        assert_eq!(CANDIDATES[5].settings(&occlusion).technique, Technique::Gtao);
    }

    #[test]
    fn what_is_too_small_is_said() {
        assert_eq!(Occlusion::new(0.001, false).unwrap_err().exit_code(), 3);
        assert!(Occlusion::new(0.001, true).is_ok());
    }
}
