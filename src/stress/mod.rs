//! The numerical stress suite: checks that try to break tracers, sampling, films and filters, on
//! built-in scenes or on a scene of the user's.
//!
//! [`SECTIONS`] is the only list of sections, a file each. A [`Check`] is a measured figure with a
//! bound. Tests call the same functions with wrong scenes and answers.
//!
//! ```no_run
//! use skylit::stress::{self, Options, Quiet};
//! use skylit::tracer::DeviceSettings;
//!
//! let summary = stress::run(&Options::default(), &DeviceSettings::default(), &mut Quiet)?;
//! for check in summary.failures() {
//!     println!("{}: {}", check.name, check.sentence);
//! }
//! # Ok::<(), skylit::Error>(())
//! ```

mod check;
pub mod closed_forms;
pub mod contact;
pub mod counters;
pub mod degenerate;
pub mod determinism;
pub mod direct_light;
pub mod display;
pub mod hot_pixel;
#[cfg(feature = "report")]
pub mod html;
pub mod lengths;
pub mod long_runs;
mod options;
pub mod overlaps;
pub mod sampling;
pub mod scale;
pub mod scene;
mod session;
pub mod transparency;
pub mod watertight;

use std::time::Instant;

use serde::Serialize;

pub use check::{Bound, Check, Verdict, number};
pub use options::{Effort, Options};
pub use session::{Observer, Quiet, Section, Setup, StressSession, Watch};

use crate::error::{Error, Result};
use crate::tracer::DeviceSettings;

/// Version of the JSON record; it changes when a key changes its meaning or goes.
pub const SCHEMA: u32 = 1;

/// All sections, in the order in which they run.
pub static SECTIONS: &[Section] = &[
    scene::SECTION,
    scale::SECTION,
    watertight::SECTION,
    degenerate::SECTION,
    contact::SECTION,
    lengths::SECTION,
    transparency::SECTION,
    sampling::SECTION,
    long_runs::SECTION,
    display::SECTION,
    determinism::SECTION,
];

#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    pub schema: u32,
    /// The scene, if it was one of the user's.
    pub scene: Option<String>,
    pub effort: Effort,
    pub device: String,
    pub driver: String,
    pub checks: Vec<Check>,
    /// Warnings of the scene's loader, a sentence each.
    pub warnings: Vec<String>,
    pub seconds: f64,
}

impl Summary {
    pub fn failures(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|c| c.verdict == Verdict::Fails)
    }

    /// How many checks have an outcome.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.checks.iter().filter(|c| c.verdict == verdict).count()
    }

    /// Success if no check fails.
    ///
    /// # Errors
    /// [`Error::CheckFailed`], naming the first checks that fail.
    pub fn verdict(&self) -> Result<()> {
        let failed: Vec<String> = self.failures().map(|c| format!("{} ({})", c.name, c.tracer_name())).collect();
        if failed.is_empty() {
            return Ok(());
        }
        let more = if failed.len() > 5 { format!(", and {} more", failed.len() - 5) } else { String::new() };
        let checks = if failed.len() == 1 { "check fails" } else { "checks fail" };
        Err(Error::CheckFailed(format!(
            "{} {checks}: {}{more}",
            failed.len(),
            failed[..failed.len().min(5)].join(", ")
        )))
    }
}

/// Runs the sections that options name.
///
/// # Errors
/// [`Error::Usage`] for a section that does not exist or is about the other kind of scene, or no
/// check of a wanted name; errors of the scene and the device; interruption.
pub fn run(options: &Options, settings: &DeviceSettings, observer: &mut dyn Observer) -> Result<Summary> {
    let start = Instant::now();
    let sections = sections(options)?;
    let mut session = StressSession::new(Setup::open(options, settings)?, observer);
    session.wanted.clone_from(&options.checks);
    let mut checks = Vec::new();
    for (k, section) in sections.iter().enumerate() {
        session.observer.section(section, k, sections.len());
        checks.extend(session.run(section)?);
        session.setup.device().check_validation()?;
    }
    session.setup.device().save_pipeline_cache();
    if checks.is_empty() && !options.checks.is_empty() {
        let texts: Vec<_> = options.checks.iter().map(|text| format!("'{text}'")).collect();
        return Err(Error::Usage(format!(
            "--checks: no check of these sections has {} in its name",
            texts.join(" or ")
        )));
    }
    let info = &session.setup.device().info;
    Ok(Summary {
        schema: SCHEMA,
        scene: options.scene.clone(),
        effort: options.effort,
        device: info.name.clone(),
        driver: info.driver.clone(),
        warnings: session.setup.scene().map_or_else(Vec::new, |s| s.report.warnings.clone()),
        checks,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// The sections that options name, in the suite's order.
fn sections(options: &Options) -> Result<Vec<&'static Section>> {
    let about_scene = options.scene.is_some();
    for name in &options.sections {
        let Some(section) = SECTIONS.iter().find(|s| s.name == *name) else {
            let names: Vec<_> = SECTIONS.iter().map(|s| s.name).collect();
            return Err(Error::Usage(format!(
                "--sections: there is no section '{name}'; there are {}",
                names.join(", ")
            )));
        };
        if section.of_scene != about_scene {
            return Err(Error::Usage(if about_scene {
                format!("--sections {name}: it is about built-in scenes: leave SCENE out")
            } else {
                format!("--sections {name}: it is about a scene of yours: name one")
            }));
        }
    }
    let is_wanted = |s: &&Section| {
        s.of_scene == about_scene && (options.sections.is_empty() || options.sections.iter().any(|n| n == s.name))
    };
    Ok(SECTIONS.iter().filter(is_wanted).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracer::TracerKind;

    #[test]
    fn sections_fit_what_is_examined() {
        let of = |scene: Option<&str>, names: &[&str]| {
            let names = names.iter().map(|n| (*n).to_owned()).collect();
            let options = Options { scene: scene.map(str::to_owned), sections: names, ..Default::default() };
            sections(&options).map(|s| s.iter().map(|s| s.name).collect::<Vec<_>>())
        };
        assert_eq!(of(Some("a.glb"), &[]).unwrap(), ["scene"]);
        assert_eq!(of(None, &[]).unwrap().len(), SECTIONS.len() - 1);
        assert_eq!(of(None, &["watertight", "scale"]).unwrap(), ["scale", "watertight"]);
        for (scene, name) in [(None, "scene"), (Some("a.glb"), "scale"), (None, "nothing")] {
            assert_eq!(of(scene, &[name]).unwrap_err().exit_code(), 64, "{name}");
        }
        let mut names: Vec<_> = SECTIONS.iter().map(|s| s.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), SECTIONS.len());
    }

    #[test]
    fn a_failed_check_fails_the_run() {
        let summary = |checks: Vec<Check>| Summary {
            schema: SCHEMA,
            scene: None,
            effort: Effort::Quick,
            device: String::new(),
            driver: String::new(),
            warnings: Vec::new(),
            checks,
            seconds: 0.0,
        };
        let good = [Check::at_most("a", 0.0, "", 1.0), Check::reported("b", 9.0, ""), Check::not_applicable("c", "no")];
        assert!(summary(good.to_vec()).verdict().is_ok());
        let bad = summary(vec![Check {
            tracer: Some(TracerKind::Compute),
            ..Check::at_most("leaks of a box", 2.0, "", 0.0)
        }])
        .verdict()
        .unwrap_err();
        assert_eq!((bad.exit_code(), bad.to_string().as_str()), (1, "1 check fails: leaks of a box (compute)"));
    }
}
