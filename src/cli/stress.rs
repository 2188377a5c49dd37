//! `skylit stress`: the numerical stress suite, on built-in scenes or on a scene of the user's.

use std::path::PathBuf;

use clap::{Args, ValueHint};
use serde_json::json;

use super::args::LoadArgs;
use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::stress::{self, Check, Effort, Observer, Options, SECTIONS, Section, Summary, Verdict};
use crate::terminal::console::{Failure, Verbosity, one_line};
use crate::terminal::interrupt;
use crate::terminal::lines::Lines;
use crate::tracer::DeviceSettings;

const EXAMPLES: &str = "\
Examples:
  skylit stress                                   # try to break the tracers, sampling, films and filters, in a minute
  skylit stress scene.glb                         # find out what single precision does to a scene of yours
  skylit stress --sections watertight --full      # a hundred million rays at edges
  skylit stress --checks \"needle fans\"            # one of the checks again
  skylit stress scene.glb --tracer compute --html report";

/// Ends `--help` of the command.
const AFTER_HELP: &str = "\
Exit codes:
  0    all checks hold
  1    a check fails

What a file holds is reported, and never fails; what skylit does with it is held against bounds.
docs/results/stress.md has every check, its bound, and its figure on each tracer.";

/// `skylit stress`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES, after_help = AFTER_HELP)]
pub struct StressArgs {
    /// Scene file (.gltf, .glb, .obj, .brhan) or builtin:NAME [default: the built-in scenes of the suite]
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: Option<String>,
    /// Less than a minute on a CPU driver; the default
    #[arg(long, conflicts_with = "full")]
    pub quick: bool,
    /// A hundred times as many rays and samples, on all tracers: takes hours on a CPU driver
    #[arg(long)]
    pub full: bool,
    /// Only these sections, separated by commas [default: all]
    ///
    /// Sections are scale, watertight, degenerate, contact, lengths, transparency, sampling,
    /// long-runs, display and determinism.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub sections: Vec<String>,
    /// Only checks whose name contains this text; may be given several times
    ///
    /// A line of the output has the name.
    #[arg(long, value_name = "TEXT")]
    pub checks: Vec<String>,
    /// Write a report, an HTML page that needs no network, into this folder
    #[cfg(feature = "report")]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub html: Option<PathBuf>,
    /// Files of the scene
    #[command(flatten)]
    pub load: LoadArgs,
    /// Device and tracer [default: all tracers that the device has]
    #[command(flatten)]
    pub device: DeviceSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

impl StressArgs {
    fn options(&self) -> Result<Options> {
        if let Some(option) = self.device.compute_only_option() {
            return Err(Error::Usage(format!(
                "{option} has no effect on the suite, which runs tracers as they are by default: leave it out"
            )));
        }
        Ok(Options {
            scene: self.scene.clone(),
            effort: if self.full { Effort::Full } else { Effort::Quick },
            sections: self.sections.clone(),
            checks: self.checks.clone(),
            program: std::env::current_exe().ok(),
            confine: self.load.confine,
            geometry: self.load.geometry(),
        })
    }

    fn html(&self) -> Option<&PathBuf> {
        #[cfg(feature = "report")]
        return self.html.as_ref();
        #[cfg(not(feature = "report"))]
        None
    }
}

/// Runs the suite and reports.
pub fn run(args: &StressArgs) -> Result<(), Failure> {
    let options = args.options()?;
    let mut plan = FilePlan::default();
    if let Some(folder) = args.html() {
        args.scene.iter().for_each(|scene| plan.reads("the scene", scene));
        plan.writes_report("--html", folder);
        plan.check()?;
        plan.make_folder(folder)?;
    }
    interrupt::install();
    let console = args.verbosity.console();
    let mut observer = Lines::new("stress", console);
    let summary = stress::run(&options, &args.device, &mut observer)?;
    drop(observer);
    summary.warnings.iter().for_each(|w| console.warning(w));
    console.line(&total(&summary))?;
    let mut record = json!(summary);
    #[cfg(feature = "report")]
    if let Some(dir) = &args.html {
        let index = stress::html::write(&summary, &crate::terminal::console::command_line(), dir)?;
        console.line(&format!("report: {}", crate::report::address(&index)))?;
        record["report"] = json!(index);
    }
    record["sections"] =
        SECTIONS.iter().map(|s| json!({ "name": s.name, "title": s.title, "about": s.about })).collect();
    console.close(&record, summary.verdict())
}

impl Observer for Lines {
    fn check(&mut self, check: &Check) -> Result<()> {
        self.print(&line(check))
    }

    fn section(&mut self, section: &'static Section, done: usize, total: usize) {
        self.phase(section.name);
        self.set(done, total);
    }
}

/// A check in a line.
fn line(check: &Check) -> String {
    let word = match check.verdict {
        Verdict::Holds => "holds",
        Verdict::Fails => "FAILS",
        Verdict::NotApplicable => "-",
        Verdict::Reported => "figure",
    };
    let (tracer, bound) = (check.tracer_name(), check.bound_text());
    let mut figure = check.figure();
    if !bound.is_empty() {
        figure += &format!(" ({bound})");
    }
    let figure = if check.value.is_nan() && check.bound.is_none() { String::new() } else { format!("{figure}; ") };
    let line = format!("{word:6} {tracer:8} {}: {figure}{}", check.name, one_line(&check.sentence));
    line.trim_end().trim_end_matches(';').trim_end_matches(':').to_owned()
}

/// All checks in a line.
fn total(summary: &Summary) -> String {
    let count = |verdict| summary.count(verdict);
    let parts = [
        (count(Verdict::Holds), "hold"),
        (count(Verdict::Fails), "fail"),
        (count(Verdict::Reported), "figures without a bound"),
        (count(Verdict::NotApplicable), "not applicable"),
    ];
    let parts: Vec<_> = parts.iter().filter(|p| p.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
    let checks = summary.checks.len();
    format!(
        "{checks} checks: {} (on {}, {}, {:.1} s)",
        parts.join(", "),
        summary.device,
        summary.driver,
        summary.seconds
    )
}
