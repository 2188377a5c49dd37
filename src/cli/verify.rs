//! `skylit verify`: reference frames in continuous integration.

use std::io::Read;
use std::path::PathBuf;

use clap::{Args, ValueHint};
use serde_json::json;

use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::report;
use crate::terminal::console::{Failure, Verbosity, command_line, one_line};
use crate::terminal::interrupt;
use crate::terminal::lines::Lines;
use crate::tracer::DeviceSettings;
use crate::verify::bless::Change;
use crate::verify::manifest::{self, Frame, Manifest, Tracers, parse_tracers};
use crate::verify::selection::{Selection, Shard};
use crate::verify::{Action, FrameResult, Observer, Options, Outcome, Summary, html, junit, plural};

/// Ends `--help` of the command.
const AFTER_HELP: &str = "\
Exit codes:
  0    all frames hold
  1    a frame differs from its golden image
  2    a frame, or all of them, could not be rendered or judged; the others were
  4    the results (--junit, --html) or a golden image cannot be written

docs/reference/frames.md describes the manifest, frames.toml, and what makes images differ between machines.
Files of defaults (skylit.toml) are not read: golden images do not depend on them.";

const EXAMPLES: &str = "\
Examples:
  skylit verify tests/frames                                 # render all frames and judge them
  skylit verify tests/frames --filter atrium --html report   # some of them, with a report of those that differ
  skylit verify tests/frames --update-missing                # make golden images for new frames";

/// `skylit verify`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES, after_help = AFTER_HELP)]
pub struct VerifyArgs {
    /// Folder with the manifest, frames.toml, and the golden images
    #[arg(value_hint = ValueHint::DirPath)]
    pub folder: PathBuf,
    /// Only frames whose name contains this; may be given more than once
    #[arg(long, value_name = "TEXT")]
    pub filter: Vec<String>,
    /// Only the I-th of N parts of the frames, for machines that share the work
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Tracers in place of the manifest's: auto, all, or some of pipeline, query, compute, by
    /// commas
    ///
    /// The device must have them.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub tracers: Vec<String>,
    /// Seed of frames that have a Z-test alone: their verdict must not depend on it
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Make the golden images anew and say what changed; only on a driver that the manifest pins
    #[arg(long)]
    pub bless: bool,
    /// Make the golden images that are missing; only on a driver that the manifest pins
    #[arg(long, conflicts_with = "bless")]
    pub update_missing: bool,
    /// Make golden images on whatever driver there is
    #[arg(long)]
    pub force: bool,
    /// Write the results as JUnit XML
    #[arg(long, value_name = "FILE.xml", value_hint = ValueHint::FilePath)]
    pub junit: Option<PathBuf>,
    /// Write a report into this folder: a page that needs no network
    ///
    /// It has frames that differ beside their golden images.
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub html: Option<PathBuf>,
    /// Refuse frames with files outside of the manifest's folder: for manifests of strangers
    ///
    /// Scenes, settings, environments, camera paths and golden images count, and the files that
    /// scenes refer to.
    #[arg(long)]
    pub confine: bool,
    /// Device
    #[command(flatten)]
    pub device: DeviceSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

impl VerifyArgs {
    fn action(&self) -> Result<Action> {
        if self.force && !(self.bless || self.update_missing) {
            return Err(Error::Usage("--force is for --bless and --update-missing: leave it out".into()));
        }
        let makes = self.bless || self.update_missing;
        if makes && self.seed.is_some() {
            return Err(Error::Usage("--seed has no effect on golden images: leave it out".into()));
        }
        if makes && !self.tracers.is_empty() {
            return Err(Error::Usage("--tracers has no effect on golden images: leave it out".into()));
        }
        if self.device.tracer.is_some() {
            return Err(Error::Usage("--tracer is for one image: use --tracers".into()));
        }
        Ok(if makes { Action::Bless { missing: self.update_missing, force: self.force } } else { Action::Verify })
    }

    fn options(&self) -> Result<Options> {
        let tracers: Option<Tracers> = if self.tracers.is_empty() {
            None
        } else {
            Some(parse_tracers(&self.tracers).map_err(|e| Error::Usage(format!("--tracers: {e}")))?)
        };
        let selection = Selection { filters: self.filter.clone(), shard: self.shard };
        Ok(Options { selection, action: self.action()?, tracers, seed: self.seed, keep_images: self.html.is_some() })
    }
}

/// Renders, compares or blesses, and reports. Whatever ends the run early is in the results, too:
/// those of an earlier run must not stay.
pub fn run(args: &VerifyArgs) -> Result<(), Failure> {
    let loaded = Manifest::load_with(&args.folder, args.confine);
    check_outputs(args, loaded.as_ref().ok())?;
    if let Some(path) = &args.junit {
        files::check_writable(path)?;
        // a pipe takes one document; a file says what became of the run, however it ends
        if path.is_file() || !path.exists() {
            junit::write_failure("the run did not end: it was killed, or is not done", &suite(args), path)?;
        }
    }
    let (manifest, summary) = match judge(args, loaded) {
        Ok(judged) => judged,
        Err(error) => {
            let summary = Summary::of_failure(&one_line(&error.to_string()));
            write(args, &[], &summary)?;
            return Err(exit_error(error).into());
        }
    };
    let console = args.verbosity.console();
    let report = write(args, &manifest.frames, &summary)?;
    console.line(&total(&summary))?;
    if let Some(index) = &report {
        console.line(&format!("report: {}", report::address(index)))?;
    }
    let mut record = json!(summary);
    record["folder"] = json!(args.folder.to_string_lossy());
    record["report"] = json!(report.as_ref().map(|path| path.to_string_lossy()));
    console.close(&record, summary.verdict())
}

/// Checks that results replace nothing that frames are made of or compared with, before a file is
/// touched.
fn check_outputs(args: &VerifyArgs, manifest: Option<&Manifest>) -> Result<()> {
    let mut plan = FilePlan::default();
    plan.reads("the manifest", args.folder.join(manifest::NAME));
    manifest.iter().for_each(|manifest| manifest.add_inputs(&mut plan, true));
    args.junit.iter().for_each(|path| plan.writes("--junit", path));
    args.html.iter().for_each(|folder| plan.writes_report("--html", folder));
    plan.check()?;
    // which files scenes refer to is known only later: none of them is XML
    if let Some(path) = args.junit.as_ref().filter(|path| path.is_file()) {
        let mut start = Vec::new();
        files::open_regular(path)
            .and_then(|file| file.take(64).read_to_end(&mut start))
            .map_err(|e| Error::read(path, &e))?;
        let text = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&start).trim_ascii_start();
        if !text.is_empty() && !text.starts_with(b"<") {
            let message = "--junit would replace a file that is not XML: choose another name, or remove it";
            return Err(Error::Usage(format!("{}: {message}", path.display())));
        }
    }
    Ok(())
}

/// Renders the frames and judges them.
fn judge(args: &VerifyArgs, manifest: Result<Manifest>) -> Result<(Manifest, Summary)> {
    let options = args.options()?;
    if let Some(folder) = &args.html {
        std::fs::create_dir_all(folder).map_err(|e| Error::write(folder, &e))?;
    }
    let manifest = manifest?;
    interrupt::install();
    let console = args.verbosity.console();
    for orphan in manifest.orphans() {
        console.warning(&format!("{}: an image of no frame; remove it", orphan.display()));
    }
    let mut observer = Lines::new("verifying", console);
    let summary = crate::verify::run(&manifest, &options, &args.device, &mut observer)?;
    Ok((manifest, summary))
}

/// Writes the results as JUnit XML and as a report, as far as they are asked for; returns the
/// report's page.
fn write(args: &VerifyArgs, frames: &[Frame], summary: &Summary) -> Result<Option<PathBuf>> {
    if let Some(path) = &args.junit {
        junit::write(summary, &suite(args), path)?;
    }
    args.html.as_ref().map(|dir| html::write(summary, frames, &args.folder, &command_line(), dir)).transpose()
}

fn suite(args: &VerifyArgs) -> String {
    args.folder.display().to_string()
}

/// Whatever keeps frames from being judged has one exit code for scripts.
fn exit_error(error: Error) -> Error {
    match error {
        Error::Usage(_) | Error::CheckFailed(_) | Error::NotVerified(_) | Error::Interrupted | Error::Output { .. } => {
            error
        }
        error => Error::NotVerified(error.to_string()),
    }
}

impl Observer for Lines {
    fn result(&mut self, result: &FrameResult, done: usize, total: usize) -> Result<()> {
        self.set(done, total);
        self.print(&line(result))
    }
}

/// A frame's result in a line.
fn line(result: &FrameResult) -> String {
    let (word, text) = match &result.outcome {
        Outcome::Holds(judgement) => ("holds", judgement.text()),
        Outcome::Differs(judgement) => ("DIFFERS", judgement.text()),
        Outcome::Skipped(why) => ("skipped", why.clone()),
        Outcome::Failed(why) => ("FAILED", why.clone()),
        Outcome::Blessed(Change::New) => ("blessed", "new".to_owned()),
        Outcome::Blessed(Change::Unchanged) => ("blessed", "unchanged".to_owned()),
        Outcome::Blessed(Change::Changed { text }) => ("blessed", text.clone()),
    };
    let tracer = result.tracer.map(|t| t.name()).unwrap_or_default();
    let note = result.note.as_ref().map_or_else(String::new, |note| format!("; {note}"));
    let line = format!("{word:8} {:28} {tracer:8} {:6.2} s  {}{note}", result.frame, result.seconds, one_line(&text));
    line.trim_end().to_owned()
}

/// All results in a line.
fn total(summary: &Summary) -> String {
    let count = |is: fn(&Outcome) -> bool| summary.count(is);
    let parts = [
        (count(|o| matches!(o, Outcome::Holds(_))), "hold"),
        (count(|o| matches!(o, Outcome::Differs(_))), "differ"),
        (count(|o| matches!(o, Outcome::Failed(_))), "failed"),
        (count(|o| matches!(o, Outcome::Skipped(_))), "skipped"),
        (count(|o| matches!(o, Outcome::Blessed(_))), "blessed"),
    ];
    let parts: Vec<_> = parts.iter().filter(|p| p.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
    let parts = if parts.is_empty() { "nothing to do".to_owned() } else { parts.join(", ") };
    let renders = plural(summary.frames.len(), "render", "renders");
    if summary.device.is_empty() {
        format!("{renders}: {parts} (no device was needed)")
    } else {
        let pinned = if summary.pinned == Some(false) { ", which is not pinned" } else { "" };
        format!("{renders}: {parts} (on {}, {}{pinned}, {:.1} s)", summary.device, summary.driver, summary.seconds)
    }
}
