//! The arguments of `skylit render`: a scene, settings, and output files.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};

use super::tev::TevAddress;
use crate::cli::args::LoadArgs;
use crate::cli::config::ConfigArgs;
use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::integrators;
use crate::output::frames::FramePattern;
use crate::output::settings::ExrCompression;
use crate::output::{FileSettings, ImageFormat, is_animation};
use crate::realtime::display::DisplayMode;
use crate::renderer::RenderSettings;
use crate::renderer::defaults::{self, DefaultsReport};
use crate::renderer::frames::frame_settings;
use crate::settings::{AppliesTo, Capability, GivenSetting};
use crate::terminal::console::Verbosity;
use crate::tracer::DeviceSettings;

const EXAMPLES: &str = "\
Examples:
  skylit render scene.glb -o ao.png                                 ambient occlusion
  skylit render room.glb -o ao.png --ao-radius 0.5                  of a room: hits within 0.5 m
  skylit render scene.glb -o path.png --integrator path --quality good  path tracing
  skylit render scene.glb -o path.png --integrator path --denoise   path tracing, denoised
  skylit render scene.glb -o ao.png --eye 3,2,5 --target 0,1,0      from here
  skylit render scene.glb -o turn.apng --preset balanced --orbit --frames 0..240     in real time";

/// Frames whose files are compared with those that are read, and with each other, before anything
/// is rendered: over an hour of film.
const MAX_PLANNED_FRAMES: u32 = 100_000;

/// `skylit render`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES, args_override_self = true)]
pub struct RenderArgs {
    /// Scene: a .gltf, .glb, .obj or .brhan file, or builtin:NAME (`skylit scenes` lists them)
    #[arg(value_hint = ValueHint::FilePath)]
    pub scene: String,
    /// Image to write: .exr (all channels), .png, .jpg, .webp; of frames also .apng, .mp4, .webm,
    /// .gif
    ///
    /// Animations are of frames in real time. The option may be repeated, for several files of one
    /// render.
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, required = true)]
    pub output: Vec<PathBuf>,
    /// Write the image so far on Ctrl-C, too (the exit code is still 130)
    #[arg(long, hide_short_help = true)]
    pub keep_partial: bool,
    /// Also write a depth image of one ray per pixel, .png or .exr (depth.Z)
    ///
    /// In a .png near is white, far and background are black.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, hide_short_help = true)]
    pub depth_image: Option<PathBuf>,
    /// Also write the rays of the first sample to PREFIX.primary.bin and PREFIX.ao.bin
    #[arg(long, value_name = "PREFIX", hide_short_help = true, hide_long_help = true)]
    pub dump_rays: Option<PathBuf>,
    /// Print what was skipped because the scene or the options do not need it, and what that saved
    #[arg(long, hide_short_help = true)]
    pub explain: bool,
    /// Print all figures of the run, in place of three lines
    ///
    /// They are the reasons of what the scene decided, rays per second, the seconds of each part of
    /// the run, and of frames in real time the passes. --explain prints them, too.
    #[arg(long, short)]
    pub verbose: bool,
    /// Read settings from this file, .json or .toml; options replace what it says
    ///
    /// `skylit view` saves such files.
    #[arg(long = "settings", value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub settings_file: Option<PathBuf>,
    /// Send the image to the viewer tev while it renders [default port: 14158]
    ///
    /// Stills are sent at every power of two of samples, frames in real time one after another.
    #[arg(long, value_name = "HOST[:PORT]", hide_short_help = true)]
    pub tev: Option<TevAddress>,
    /// Files of the scene
    #[command(flatten)]
    pub load: LoadArgs,
    /// How files are written
    #[command(flatten)]
    pub files: FileSettings,
    /// With --frames and --spp: leave out frames that an earlier run has finished
    ///
    /// Frames are finished by what their files say of themselves.
    #[arg(long = "continue", hide_short_help = true)]
    pub continues: bool,
    /// Files of defaults.
    #[command(flatten)]
    pub config: ConfigArgs,
    /// What is rendered, and how
    #[command(flatten)]
    pub settings: RenderSettings,
    /// Device and tracer
    #[command(flatten)]
    pub device: DeviceSettings,
    /// How results are shown
    #[command(flatten)]
    pub verbosity: Verbosity,
}

impl RenderArgs {
    /// Returns true if all figures are printed for people.
    pub fn prints_all(&self) -> bool {
        self.verbose || self.explain
    }

    /// Returns true if an .exr is written.
    pub fn writes_exr(&self) -> bool {
        self.output.iter().any(|p| ImageFormat::from_path(p).is_ok_and(|f| f == ImageFormat::Exr))
    }

    /// Returns true if a picture or an animation is written.
    pub fn writes_picture(&self) -> bool {
        self.output.iter().any(|p| is_animation(p) || ImageFormat::from_path(p).is_ok_and(ImageFormat::is_picture))
    }

    /// Returns true if channels of frames in real time are needed, not only what they display.
    pub fn needs_channels(&self) -> bool {
        self.writes_exr() || self.files.has_deep_png() || self.tev.is_some()
    }

    /// These arguments with the settings of [`RenderArgs::settings_file`] where none were given,
    /// and with defaults where neither gives any.
    ///
    /// # Errors
    /// Those of [`RenderSettings::load`] and [`ConfigArgs::files`].
    pub fn with_files(&self) -> Result<(Self, Vec<DefaultsReport>)> {
        let settings = self.settings.over_file(self.settings_file.as_deref())?;
        let files = self.config.files(Some(&self.scene), self.load.confine())?;
        let is_frames = settings.realtime_setting().is_some();
        let holds = |settings: &RenderSettings| {
            let is_same_kind = settings.realtime_setting().is_some() == is_frames;
            is_same_kind
                && Self { settings: settings.clone(), ..self.clone() }.check().is_ok()
                && (!is_frames || frame_settings(settings).is_ok())
        };
        let resolved = defaults::resolve(&files, &settings, &self.device, &holds);
        Ok((Self { settings: resolved.settings, device: resolved.device, ..self.clone() }, resolved.reports))
    }

    /// Checks conditions on more than one option.
    pub fn check(&self) -> Result<()> {
        self.device.check_with_files()?;
        self.settings.check()?;
        let wrong = |text: String| Err(Error::Usage(text));

        // options that need a certain kind of file
        if self.settings.frames.show.is_some() && !self.writes_picture() {
            return wrong("--show is for pictures (.png, .jpg, .webp, .apng): for an .exr use --aov".into());
        }
        if self.settings.is_still_sequence() {
            if let Some(path) = self.output.iter().find(|p| is_animation(p)) {
                let path = path.display();
                return wrong(format!(
                    "{path}: an animation is of frames in real time; stills need numbered files, like out.####.png"
                ));
            }
        } else if self.continues {
            return wrong(
                "--continue is for stills of several frames: add --frames A..B and --spp N, or leave it out".into(),
            );
        }

        // options of stills alone
        let frames = self.settings.realtime_setting();
        let images = self.output.iter().filter(|p| frames.is_none() || !is_animation(p));
        let formats = images.map(|p| ImageFormat::from_path(p)).collect::<Result<Vec<_>>>()?;
        let of_stills = [
            (self.keep_partial, "--keep-partial", "leave it out"),
            (self.depth_image.is_some(), "--depth-image", "use --aov depth"),
            (self.dump_rays.is_some(), "--dump-rays", "leave it out"),
        ];
        if let (Some(frames), Some((_, option, remedy))) = (frames, of_stills.iter().find(|o| o.0)) {
            return wrong(format!(
                "{option} is for stills, and {} selects frames in real time: {remedy}",
                frames.option()
            ));
        }

        // options that need a certain integrator or channel
        if self.dump_rays.is_some() {
            let applies = AppliesTo::stills_of(Capability::KeptRays);
            let dump_rays = GivenSetting { name: "dump_rays", applies };
            integrators::check(&[dump_rays], self.settings.integrator(), None)?;
        }
        if !self.settings.image.aov.is_empty() && !formats.contains(&ImageFormat::Exr) {
            return wrong("--aov needs an .exr output: pictures hold colour only".into());
        }
        if let Some(path) = &self.depth_image
            && !matches!(ImageFormat::from_path(path)?, ImageFormat::Png | ImageFormat::Exr)
        {
            return wrong(format!("--depth-image {}: the name must end in .png or .exr", path.display()));
        }

        self.check_files()?;
        self.check_film()
    }

    fn check_files(&self) -> Result<()> {
        let (files, film) = (&self.files, &self.settings.film);
        files.check(&self.output, self.depth_image.as_deref())?;
        self.settings.backdrop().check_files(&self.output, self.settings.integrator().get().sees_environment())?;
        let shown = self.settings.frames.show.unwrap_or_default();
        if self.settings.realtime_setting().is_some() && files.has_deep_png() && shown != DisplayMode::Result {
            return Err(Error::Usage(format!(
                "--show {shown} is converted to 8-bit sRGB by the device: leave --png-bits 16 and --png-encoding linear out, or write --aov to an .exr"
            )));
        }
        if files.exr_compression == Some(ExrCompression::Pxr24) && film.keeps_state() {
            return Err(Error::Usage(
                "--exr-compression pxr24 rounds 32-bit floats, and the film's state needs all bits to be resumed: choose zip or piz".into(),
            ));
        }
        Ok(())
    }

    fn check_film(&self) -> Result<()> {
        let film = &self.settings.film;
        let wrong = |text: String| Err(Error::Usage(text));
        if film.resume.is_some() && self.dump_rays.is_some() {
            return wrong("--resume: the rays of the first sample are not traced again; leave --dump-rays out".into());
        }
        if film.resumable && !self.writes_exr() {
            return wrong("--resumable needs an .exr output: pictures hold colour only".into());
        }
        match &film.resume {
            Some(path) if ImageFormat::from_path(path).ok() != Some(ImageFormat::Exr) => wrong(format!(
                "--resume {}: only an .exr that was rendered with --resumable can be resumed",
                path.display()
            )),
            _ => Ok(()),
        }
    }

    /// The files that it reads, as far as the command line tells, and those that it will write.
    ///
    /// # Errors
    /// Those of [`FramePattern::from_path`], and [`Error::Usage`] for a file that would replace the
    /// one of `--resume` and is no image.
    pub fn plan(&self, defaults: &[DefaultsReport]) -> Result<FilePlan> {
        let (mut plan, settings) = (FilePlan::default(), &self.settings);

        // what is read
        plan.reads("the scene", &self.scene);
        self.settings_file.iter().for_each(|path| plan.reads("--settings", path));
        defaults.iter().for_each(|report| plan.reads("a file of defaults", &report.file));
        settings.lighting.environment_file().iter().for_each(|path| plan.reads_images("--environment", path));
        settings.frames.camera_path.iter().for_each(|path| plan.reads("--camera-path", path));
        self.device.areas_file().iter().for_each(|path| plan.reads("--build-areas", path));

        // what is written beside the image
        self.depth_image.iter().for_each(|path| plan.writes("--depth-image", path));
        self.dump_files().iter().for_each(|path| plan.writes("--dump-rays", path));
        // an image may take the place of the one that it goes on from, and nothing else may
        let mut beside = plan.clone();
        settings.film.resume.iter().for_each(|path| beside.reads("--resume", path));
        beside.check()?;

        // images: one, or one a frame
        let range = settings.frames.range();
        let last = range.end.min(range.first.saturating_add(MAX_PLANNED_FRAMES));
        let is_sequence = settings.realtime_setting().is_some() || settings.is_still_sequence();
        for path in &self.output {
            match FramePattern::from_path(path)?.filter(|_| is_sequence) {
                Some(pattern) => (range.first..last).for_each(|n| plan.writes("-o", pattern.path(u64::from(n)))),
                None => plan.writes("-o", path),
            }
        }
        Ok(plan)
    }

    fn dump_files(&self) -> Vec<PathBuf> {
        self.dump_rays.iter().flat_map(|p| [dump_path(p, "primary"), dump_path(p, "ao")]).collect()
    }

    /// All files that will be written.
    pub fn outputs(&self) -> Vec<PathBuf> {
        self.output.iter().chain(&self.depth_image).cloned().chain(self.dump_files()).collect()
    }
}

/// PREFIX.KIND.bin; the prefix may contain dots.
pub fn dump_path(prefix: &Path, kind: &str) -> PathBuf {
    let mut name = prefix.as_os_str().to_owned();
    name.push(format!(".{kind}.bin"));
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dump_names_keep_dots() {
        assert_eq!(dump_path("a/b.c".as_ref(), "ao"), PathBuf::from("a/b.c.ao.bin"));
    }
}
