//! Arguments shared by all benchmarks: time limit, device and outputs.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueHint};

use super::plot::chart::Picture;
use super::record::BenchRecord;
use crate::error::{Error, Result};
use crate::files;
use crate::output;
use crate::settings::parse::parse_seconds;
use crate::terminal::console::Console;

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
    /// Print one JSON record on stdout instead of text; with =FILE, also write it to that file
    #[arg(long, value_name = "FILE", num_args = 0..=1, require_equals = true, value_hint = ValueHint::FilePath)]
    pub json: Option<Option<PathBuf>>,
    /// Also write a CSV table, one row per result
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub csv: Option<PathBuf>,
    /// Also plot the results
    #[arg(long, value_name = "FILE.png", value_hint = ValueHint::FilePath)]
    pub plot: Option<PathBuf>,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

impl CommonArgs {
    /// The console with these options.
    pub fn console(&self) -> Console {
        Console { json: self.json == Some(None), quiet: self.quiet }
    }

    /// File for the JSON record.
    pub fn json_file(&self) -> Option<&PathBuf> {
        self.json.as_ref()?.as_ref()
    }

    /// Every file that will be written.
    pub fn outputs(&self) -> impl Iterator<Item = &PathBuf> {
        self.json_file().into_iter().chain(&self.csv).chain(&self.plot)
    }

    /// Validates the arguments and checks that every output file can be written.
    ///
    /// # Errors
    /// [`Error::Usage`]; those of [`files::check_writable`].
    pub fn check(&self) -> Result<()> {
        match &self.plot {
            Some(p) if p.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) => {
                Err(Error::Usage(format!("--plot {}: the name must end in .png", p.display())))
            }
            _ => self.outputs().try_for_each(|path| files::check_writable(path)),
        }
    }

    /// Writes the requested files; one that cannot be written does not prevent the others.
    ///
    /// # Errors
    /// The first error.
    pub fn write(&self, record: &impl BenchRecord, picture: impl Fn() -> Result<Picture>) -> Result<()> {
        let json = self.json_file().map_or(Ok(()), |path| {
            let text = serde_json::to_string_pretty(record)
                .map_err(|e| Error::CheckFailed(format!("cannot express the result as JSON: {e}")))?;
            files::write_atomically(path, |f| f.write_all(text.as_bytes()).and_then(|()| f.write_all(b"\n")))
        });
        let csv = self
            .csv
            .as_ref()
            .map_or(Ok(()), |path| files::write_atomically(path, |f| record.write_csv(f).map_err(std::io::Error::other)));
        let plot = self.plot.as_ref().map_or(Ok(()), |path| {
            let picture = picture()?;
            output::png::write_rgb(path, &picture.rgb, picture.width, picture.height)
        });
        json.and(csv).and(plot)
    }

    /// The `given` value, or the default, or with `--quick` the `quick` default.
    pub fn setting<T>(&self, given: Option<T>, default: T, quick: T) -> T {
        given.unwrap_or(if self.quick { quick } else { default })
    }
}
