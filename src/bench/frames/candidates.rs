//! The presets that are compared; those of ambient occlusion all with the same occlusion settings.

use crate::error::{Error, Result};
use crate::integrators::ao::Occlusion;
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

/// Occlusion settings of a scene, the same for all pipelines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonOcclusion {
    occlusion: Occlusion,
    /// Length unit of the `larsen` pipeline, with which its falloff, or its ray length, matches.
    unit: f64,
}

impl CommonOcclusion {
    /// Up to `reach` scene units, all alike (`binary`) or fading to [`MIN_WEIGHT`] there.
    ///
    /// # Errors
    /// [`Error::Scene`] for a scene so small that the falloff per scene unit is not finite.
    pub fn new(reach: f64, binary: bool) -> Result<Self> {
        let (occlusion, unit) = if binary {
            (Occlusion::new(reach, 1.0), reach / THEIR_REACH)
        } else {
            let fading = Occlusion::new(f64::INFINITY, MIN_WEIGHT.powf(-1.0 / reach));
            (fading, reach * THEIR_FALLOFF.ln() / -MIN_WEIGHT.ln())
        };
        if occlusion.falloff.is_finite() && reach > 0.0 {
            return Ok(Self { occlusion, unit });
        }
        Err(Error::Scene(format!(
            "occlusion that fades over {reach} scene units is too steep to compute: scale the scene up, or use --ao-falloff binary"
        )))
    }

    /// Settings with this occlusion.
    pub fn apply_to(&self, settings: Settings) -> Settings {
        let is_larsen = settings.technique == Technique::Larsen;
        let primary = if is_larsen { Some(Primary::Traced) } else { settings.primary };
        Settings { occlusion: self.occlusion, unit: self.unit, primary, ..settings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_pipelines_fade_alike() {
        let occlusion = CommonOcclusion::new(60.0, false).unwrap();
        let s = occlusion.apply_to(CANDIDATES[0].preset.settings());
        assert!((s.occlusion.falloff.powf(-60.0) - MIN_WEIGHT).abs() < 1e-12);
        // theirs: 8 to the distance in units of its own
        assert!((THEIR_FALLOFF.powf(-60.0 / s.unit) - MIN_WEIGHT).abs() < 1e-12);
        assert!(s.technique == Technique::Larsen && (s.unit * 2.66 / 60.0 - 1.0).abs() < 0.01);
        let binary = CommonOcclusion::new(2.0, true).unwrap().apply_to(CANDIDATES[3].preset.settings());
        assert_eq!((binary.occlusion, binary.unit), (Occlusion::new(2.0, 1.0), 0.02));
        assert_eq!(CANDIDATES[5].technique, Some(Technique::Gtao));
        assert_eq!(s.primary, Some(Primary::Traced));
    }

    #[test]
    fn what_is_too_small_is_said() {
        assert_eq!(CommonOcclusion::new(0.001, false).unwrap_err().exit_code(), 3);
        assert!(CommonOcclusion::new(0.001, true).is_ok());
    }
}
