//! Arguments shared by all benchmarks: time limit, device and outputs.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::{PathBufValueParser, TypedValueParser};
use clap::{Args, ValueHint};
use serde::Serialize;

use super::baseline::BaselineReport;
use super::page::{self, ReportedRecord};
use super::record::Record;
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::report;
use crate::scene::load;
use crate::settings::parse::parse_seconds;
use crate::terminal::console::{Console, command_line, visible};

/// Options of `skylit bench` that do not depend on what is measured.
#[derive(Clone, Debug, Args)]
pub struct CommonArgs {
    /// Stop after this time and report the results so far
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_hyphen_values = true)]
    pub time_limit: Option<Duration>,
    /// Run a short version on small scenes, to check that everything works
    #[arg(long)]
    pub quick: bool,
    /// Vulkan device, by index or part of its name (`skylit doctor` lists them)
    #[arg(long, value_name = "INDEX|NAME")]
    pub device: Option<String>,
    /// Run with the Vulkan validation layer (slower); any message from it fails the run
    #[arg(long)]
    pub validation: bool,
    /// Compare with an earlier JSON record, and fail if anything is worse beyond noise
    #[arg(long, value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub baseline: Option<PathBuf>,
    /// Also write a CSV table, one row per result
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub csv: Option<PathBuf>,
    /// Outputs that saved records have as well
    #[command(flatten)]
    pub outputs: OutputArgs,
}

/// Outputs of a benchmark, and of `skylit bench report`.
#[derive(Clone, Debug, Args)]
pub struct OutputArgs {
    /// Print one JSON record on stdout instead of text; with FILE.json, write it there instead
    #[arg(long, value_name = "FILE.json", num_args = 0..=1, value_parser = record_file_parser())]
    #[arg(value_hint = ValueHint::FilePath)]
    pub json: Option<Option<PathBuf>>,
    /// Also plot the results
    #[arg(long, value_name = "FILE.svg", value_hint = ValueHint::FilePath)]
    pub plot: Option<PathBuf>,
    /// Write a report into this folder: a page that needs no network, with charts, tables, host and notes
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub html: Option<PathBuf>,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// A parser of names of records. What follows `--json` may be a scene: no scene's name ends in
/// .json, and no record takes a scene's place.
fn record_file_parser() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        if files::has_extension(&path, "json") {
            Ok(path)
        } else {
            Err("the name of a record ends in .json; without one, --json is the last option")
        }
    })
}

impl OutputArgs {
    /// The console with these options.
    pub fn console(&self) -> Console {
        Console { json: self.json == Some(None), quiet: self.quiet }
    }

    /// File for the JSON record.
    pub fn json_file(&self) -> Option<&PathBuf> {
        self.json.as_ref()?.as_ref()
    }

    /// The files that are written.
    fn plan(&self) -> FilePlan {
        let mut plan = FilePlan::default();
        self.json_file().iter().for_each(|path| plan.writes("--json", path));
        self.plot.iter().for_each(|path| plan.writes("--plot", path));
        self.html.iter().for_each(|folder| plan.writes_report("--html", folder));
        plan
    }

    /// Checks that output files can be written and replace no record that is read, before anything
    /// that takes long. The plan has made the folder of the report.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown format of plots; errors of the plan and its files.
    pub fn check(&self, records: &[PathBuf], baselines: &[PathBuf]) -> Result<FilePlan> {
        let mut plan = self.plan();
        records.iter().for_each(|path| plan.reads("a record", path));
        baselines.iter().for_each(|path| plan.reads("--baseline", path));
        plan.check()?;
        self.check_writable(&mut plan)?;
        Ok(plan)
    }

    fn check_writable(&self, plan: &mut FilePlan) -> Result<()> {
        self.plot.as_ref().map_or(Ok(()), |path| report::check_svg_name("--plot", path))?;
        self.html.as_ref().map_or(Ok(()), |dir| plan.make_folder(dir))?;
        self.json_file().into_iter().chain(&self.plot).try_for_each(|path| files::check_writable(path))
    }

    /// Writes the JSON record, if a file is given for it.
    pub fn write_json(&self, value: &impl Serialize) -> Result<()> {
        let Some(path) = self.json_file() else { return Ok(()) };
        let text = serde_json::to_string_pretty(value)
            .map_err(|e| Error::CheckFailed(format!("cannot express the result as JSON: {e}")))?;
        files::write_atomically(path, |f| f.write_all(text.as_bytes()).and_then(|()| f.write_all(b"\n")))
    }

    /// Writes the plot and the page of records if requested, the page even if the plot fails.
    /// Returns the page's address.
    pub fn write_pictures(&self, records: &[ReportedRecord]) -> Result<Option<String>> {
        let plot = self.plot.as_ref().map_or(Ok(()), |path| page::write_plot(path, records));
        let write = |dir: &PathBuf| {
            report::write(dir, &page::page(records, &command_line())).map(|index| report::address(&index))
        };
        let address = self.html.as_ref().map(write).transpose();
        plot.and(address)
    }
}

/// Prints the address of a page, if one was written. Returns it, and what went wrong.
pub fn show_address(pictures: Result<Option<String>>, console: Console) -> (Option<String>, Result<()>) {
    match pictures {
        Ok(address) => {
            let shown = address.as_ref().map_or(Ok(()), |a| console.line(&format!("report: {a}")));
            (address, shown)
        }
        Err(e) => (None, Err(e)),
    }
}

/// A record as JSON, with how it compares with its baseline.
#[derive(Serialize)]
pub struct JsonRecord<'a> {
    #[serde(flatten)]
    pub record: &'a Record,
    /// The comparison with an earlier record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baseline: Option<&'a BaselineReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub report: Option<String>,
}

impl CommonArgs {
    /// Checks before anything that takes long that outputs can be written, and that none replaces a
    /// scene, its files, the environment, or the list of peers. Makes the report's folder.
    ///
    /// # Errors
    /// [`Error::Usage`], naming both files; errors of scenes, read where files may be replaced.
    pub fn check(&self, scenes: &[String], environment: Option<&Path>, peers: Option<&str>) -> Result<FilePlan> {
        let mut plan = self.outputs.plan();
        self.csv.iter().for_each(|path| plan.writes("--csv", path));
        self.baseline.iter().for_each(|path| plan.reads("--baseline", path));
        scenes.iter().for_each(|scene| plan.reads("the scene", scene));
        environment.iter().for_each(|path| plan.reads_images("--environment", path));
        peers.iter().for_each(|path| plan.reads("--peers", path));
        plan.check()?;
        if plan.replaces_files() {
            let mut files = scenes.iter().filter(|scene| Path::new(scene).is_file());
            files.try_for_each(|scene| plan.check_scene(&load::files_of(scene)?))?;
        }
        self.outputs.check_writable(&mut plan)?;
        self.csv.as_deref().map_or(Ok(()), files::check_writable)?;
        Ok(plan)
    }

    /// Writes the JSON record and the CSV table if requested, each even if the other fails.
    pub fn write_tables(&self, json: &JsonRecord) -> Result<()> {
        let write_csv = |path: &Path| {
            let mut text = Vec::new();
            json.record.write_csv(&mut text).map_err(|e| Error::write(path, &std::io::Error::other(e)))?;
            // names of others have no control characters
            let text = visible(&String::from_utf8_lossy(&text), &['\n']);
            files::write_atomically(path, |f| f.write_all(text.as_bytes()))
        };
        let csv = self.csv.as_deref().map_or(Ok(()), write_csv);
        self.outputs.write_json(json).and(csv)
    }

    /// The `given` value, or the default, or with `--quick` the `quick` default.
    pub fn setting<T>(&self, given: Option<T>, [default, quick]: [T; 2]) -> T {
        given.unwrap_or(if self.quick { quick } else { default })
    }
}
