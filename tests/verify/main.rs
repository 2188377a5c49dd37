//! Reference frames: what `verify` finds, what it must not find, and the program from outside.

#[path = "../common/mod.rs"]
mod common;

mod chosen;
mod defects;
mod program;
mod tolerance;

use std::path::Path;

use skylit::film::Control;
use skylit::tracer::DeviceSettings;
use skylit::verify::manifest::Manifest;
use skylit::verify::{Action, FrameResult, Observer, Options, Outcome, Summary};

/// Follows nothing.
struct Silent;

impl Control for Silent {}

impl Observer for Silent {
    fn result(&mut self, _: &FrameResult, _: usize, _: usize) -> skylit::Result<()> {
        Ok(())
    }
}

/// The frames of a folder with these options; with the validation layer where golden images are made, which all frames of a test begin with.
fn run(folder: &Path, options: &Options) -> Summary {
    let validation = matches!(options.action, Action::Bless { .. }) && common::validated().validation;
    let device = DeviceSettings { validation, ..Default::default() };
    skylit::verify::run(&Manifest::load(folder).unwrap(), options, &device, &mut Silent).unwrap()
}

fn verify(folder: &Path) -> Summary {
    run(folder, &Options::default())
}

fn bless(folder: &Path) {
    let options = Options { action: Action::Bless { missing: false, force: true }, ..Default::default() };
    let summary = run(folder, &options);
    assert!(summary.frames.iter().all(|f| matches!(f.outcome, Outcome::Blessed(_))), "{summary:?}");
}

/// What was found of the frames that differ, in lines; every other frame has to hold.
fn differing(summary: &Summary) -> Vec<String> {
    let of = |f: &FrameResult| match &f.outcome {
        Outcome::Holds(_) => None,
        Outcome::Differs(judgement) => Some(format!("{}: {}", f.frame, judgement.text())),
        other => panic!("{}: {other:?}", f.frame),
    };
    summary.frames.iter().filter_map(of).collect()
}
