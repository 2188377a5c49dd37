//! The arguments of `skylit render`: a scene, settings, and output files.

use std::path::{Path, PathBuf};

use clap::{Args, ValueHint};

use crate::error::{Error, Result};
use crate::output::{ImageFormat, apng};
use crate::renderer::RenderSettings;
use crate::terminal::console::Verbosity;
use crate::tracer::DeviceSettings;

/// `skylit render`.
#[derive(Clone, Debug, Args)]
pub struct RenderArgs {
    /// Scene: a .gltf, .glb, .obj or .brhan file, or builtin:NAME (`skylit scenes` lists them)
    pub scene: String,
    /// Image to write: .exr (all channels, metadata) or .png (8-bit sRGB); may be given more than once
    #[arg(long, short, value_name = "FILE", value_hint = ValueHint::FilePath, required = true)]
    pub output: Vec<PathBuf>,
    /// Write the image so far on Ctrl-C, too (the exit code is still 130)
    #[arg(long)]
    pub keep_partial: bool,
    /// Also write a depth image of one ray per pixel: .png (near is white, far and background black) or .exr (depth.Z)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub depth_image: Option<PathBuf>,
    /// Also write the rays of the first sample to PREFIX.primary.bin and PREFIX.ao.bin
    #[arg(long, value_name = "PREFIX")]
    pub dump_rays: Option<PathBuf>,
    /// Print what was skipped because the scene or the options do not need it, and what that saved
    #[arg(long)]
    pub explain: bool,
    /// Read settings from this file, which `skylit view` or a person has written; options given here replace what it says
    #[arg(long = "settings", value_name = "FILE.json", value_hint = ValueHint::FilePath)]
    pub settings_file: Option<PathBuf>,
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
    /// Returns true if an .exr is written.
    pub fn writes_exr(&self) -> bool {
        self.output.iter().any(|p| ImageFormat::of(p).is_ok_and(|f| f == ImageFormat::Exr))
    }

    /// Returns true if an 8-bit image or animation is written.
    pub fn writes_picture(&self) -> bool {
        self.output.iter().any(|p| apng::is_apng(p) || ImageFormat::of(p).is_ok_and(|f| f == ImageFormat::Png))
    }

    /// These arguments with the settings of [`RenderArgs::settings_file`] where none were given.
    ///
    /// # Errors
    /// Those of [`RenderSettings::load`].
    pub fn with_settings_file(&self) -> Result<Self> {
        Ok(Self { settings: self.settings.over_file(self.settings_file.as_deref())?, ..self.clone() })
    }

    /// Checks conditions on more than one option.
    pub fn check(&self) -> Result<()> {
        self.device.check()?;
        self.settings.check()?;
        let wrong = |text: String| Err(Error::Usage(text));
        if self.settings.frames.show.is_some() && !self.writes_picture() {
            return wrong("--show is for .png and .apng outputs: for an .exr use --aov".into());
        }
        let frames = self.settings.realtime_setting();
        let images = self.output.iter().filter(|p| frames.is_none() || !apng::is_apng(p));
        let formats = images.map(|p| ImageFormat::of(p)).collect::<Result<Vec<_>>>()?;
        let of_stills = [
            (self.keep_partial, "--keep-partial", "leave it out"),
            (self.depth_image.is_some(), "--depth-image", "use --aov depth"),
            (self.dump_rays.is_some(), "--dump-rays", "leave it out"),
        ];
        if let (Some(frames), Some((_, option, remedy))) = (frames, of_stills.iter().find(|o| o.0)) {
            return wrong(format!("{option} is for stills, and {} selects frames in real time: {remedy}", frames.option()));
        }
        if self.dump_rays.is_some() && self.settings.integrator().name() != "ao" {
            let name = self.settings.integrator().name();
            return wrong(format!("--dump-rays has no effect on --integrator {name}: leave it out, or use --integrator ao"));
        }
        if !self.settings.image.aov.is_empty() && !formats.contains(&ImageFormat::Exr) {
            return wrong("--aov needs an .exr output: PNG holds colour only".into());
        }
        if let Some(path) = &self.depth_image {
            ImageFormat::of(path)?;
        }
        self.check_film()
    }

    fn check_film(&self) -> Result<()> {
        let film = &self.settings.film;
        let wrong = |text: String| Err(Error::Usage(text));
        if film.resume.is_some() && self.dump_rays.is_some() {
            return wrong("--resume: the rays of the first sample are not traced again; leave --dump-rays out".into());
        }
        if film.resumable && !self.writes_exr() {
            return wrong("--resumable needs an .exr output: PNG holds colour only".into());
        }
        match &film.resume {
            Some(path) if ImageFormat::of(path).ok() != Some(ImageFormat::Exr) => {
                wrong(format!("--resume {}: only an .exr that was rendered with --resumable can be resumed", path.display()))
            }
            _ => Ok(()),
        }
    }

    /// All files that will be written.
    pub fn outputs(&self) -> Vec<PathBuf> {
        let dumps = self.dump_rays.iter().flat_map(|p| [dump_path(p, "primary"), dump_path(p, "ao")]);
        self.output.iter().chain(&self.depth_image).cloned().chain(dumps).collect()
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
