//! Options of `skylit render` that are about the film: what it starts from, when it is saved, when it is good enough.

use std::path::PathBuf;

use clap::{Args, ValueHint};

use crate::cli::args::RenderArgs;
use crate::error::{Error, Result};
use crate::output::ImageFormat;
use crate::terminal::parse::parse_where;

/// The film.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Film of stills")]
pub struct FilmArgs {
    /// Resume a render that was saved with --resumable, up to --spp samples in all; the result is bit-identical to an uninterrupted render. All other settings
    /// must be the same
    #[arg(long, value_name = "FILE.exr", value_hint = ValueHint::FilePath)]
    pub resume: Option<PathBuf>,
    /// Save the state of the film in .exr outputs (layer `state`), for --resume; implied by --resume and --intervals
    #[arg(long)]
    pub resumable: bool,
    /// Also save intermediate images, as NAME.0016.exr, at every power of two of samples and at those that the scene names
    #[arg(long)]
    pub intervals: bool,
    /// Adaptive sampling: stop sampling an 8x8 tile once its estimated standard error and its neighbours' are at most E (radiance), tested at powers of two
    /// from 64 samples on. --spp is then the maximum
    #[arg(long, value_name = "E", value_parser = parse_target, allow_hyphen_values = true)]
    pub target_rmse: Option<f64>,
}

fn parse_target(text: &str) -> std::result::Result<f64, String> {
    parse_where(text, |v| v > 0.0 && v.is_finite(), "must be finite and above 0")
}

impl FilmArgs {
    /// Will .exr outputs have the film's sums?
    pub fn keeps_state(&self) -> bool {
        self.resumable || self.intervals || self.resume.is_some()
    }

    /// Checks what concerns more than one option: none may be given that would have no effect.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the option and what to do about it.
    pub fn check(&self, args: &RenderArgs) -> Result<()> {
        let given = [
            (self.resume.is_some(), "--resume"),
            (self.resumable, "--resumable"),
            (self.intervals, "--intervals"),
            (self.target_rmse.is_some(), "--target-rmse"),
        ];
        let wrong = |what: String| Err(Error::Usage(what));
        let Some((_, option)) = given.into_iter().find(|g| g.0) else { return Ok(()) };
        if let Some(frames) = args.frames.wanted() {
            return wrong(format!("{option} is of stills: leave it out, or {frames}"));
        }
        if self.resume.is_some() && args.dump_rays.is_some() {
            return wrong("--resume: the rays of the first sample are not traced again; leave --dump-rays out".into());
        }
        if self.resumable && !args.writes_exr() {
            return wrong("--resumable needs an .exr output: PNG holds colour only".into());
        }
        match &self.resume {
            Some(path) if ImageFormat::of(path).ok() != Some(ImageFormat::Exr) => {
                wrong(format!("--resume {}: only an .exr that was rendered with --resumable can be resumed", path.display()))
            }
            _ => Ok(()),
        }
    }
}
