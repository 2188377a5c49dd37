//! All settings of a render. The same structs are the command line of `skylit render`, the metadata of images, and settings files.

use glam::DVec3;
use std::path::PathBuf;

use crate::error::{Error, Result};
use crate::film::camera::{self, Choice};
use crate::integrators::aov::Aov;
use crate::integrators::lighting::LightingSettings;
use crate::integrators::{self, IntegratorName, IntegratorSettings, PictureOptions};
#[cfg(feature = "cli")]
use crate::output::parse_size;
use crate::output::tone_map::ToneMap;
use crate::realtime::frame_settings::FrameSettings;
use crate::scene::{Camera, Projection, Scene};
#[cfg(feature = "cli")]
use crate::settings::parse::{parse_fov, parse_number, parse_target, parse_time, parse_vector};
use crate::settings::{AppliesTo, Capability, GivenSetting, settings};

/// Samples per pixel when neither the settings nor the scene give them.
pub const DEFAULT_SPP: u32 = 16;
/// Image size in pixels when neither the settings nor the scene give it.
pub const DEFAULT_SIZE: [u32; 2] = [1280, 720];
/// Vertical field of view of cameras given by --eye, degrees.
pub const DEFAULT_FOV_Y: f64 = 45.0;

/// Integrators to whose images tone mapping and exposure apply.
const TONE_MAPPED: AppliesTo = AppliesTo::stills_of(Capability::ToneMapping);

settings! {
    /// The image.
    "Image"
    pub struct ImageSettings {
        /// Samples per pixel [default: the scene's, or 16]
        spp: Option<u32>, option(value_parser = clap::value_parser!(u32).range(1..=1 << 24)), applies(AppliesTo::STILLS);
        /// Image size in pixels [default: the scene's, or 1280x720]
        size: Option<[u32; 2]>, option(value_name = "WxH", value_parser = parse_size), applies(AppliesTo::ALL);
        /// Seed of the sampler [default: 0]
        seed: Option<u32>, option(value_name = "N"), applies(AppliesTo::ALL);
        /// Stop after this time and keep the image so far (at least one sample per pixel)
        time_limit: Option<f64>,
            option(value_name = "SECONDS", value_parser = parse_time, allow_hyphen_values = true), applies(AppliesTo::STILLS);
        /// Auxiliary outputs to add to the .exr, separated by commas
        aov: Vec<Aov>, option(value_name = "LIST", value_enum, value_delimiter = ','), applies(AppliesTo::ALL);
    }
}

settings! {
    /// The camera.
    "Camera"
    pub struct CameraSettings {
        /// Camera of the scene, by index or name [default: the first one, or one that sees the whole scene]
        camera: Option<String>, option(value_name = "INDEX|NAME", conflicts_with = "eye"), applies(AppliesTo::ALL);
        /// Camera position
        eye: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, requires = "target", allow_hyphen_values = true), applies(AppliesTo::ALL);
        /// Point that the camera looks at
        target: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, requires = "eye", allow_hyphen_values = true), applies(AppliesTo::ALL);
        /// Up vector [default: 0,1,0]
        up: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, requires = "eye", allow_hyphen_values = true), applies(AppliesTo::ALL);
        /// Vertical field of view in degrees [default: the camera's, or 45]
        fov_y: Option<f64>, option(value_name = "DEG", value_parser = parse_fov, allow_hyphen_values = true), applies(AppliesTo::ALL);
    }
}

impl CameraSettings {
    /// Checks conditions on more than one setting.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self) -> Result<()> {
        if self.eye.is_some() && self.eye == self.target {
            return Err(Error::Usage("--eye and --target are the same point: move one of them".into()));
        }
        if self.up == Some(DVec3::ZERO) {
            return Err(Error::Usage("--up 0,0,0 has no direction: give a vector of another length than 0".into()));
        }
        Ok(())
    }

    /// Chooses the camera for images of `aspect` = width / height.
    ///
    /// # Errors
    /// [`Error::Usage`] for a camera that the scene does not have, [`Error::Scene`] if the scene has neither a camera nor geometry.
    pub fn choose(&self, scene: &Scene, aspect: f64) -> Result<Camera> {
        let choice = match (self.eye, self.target, &self.camera) {
            (Some(eye), Some(target), _) => Choice::LookAt {
                eye,
                target,
                up: self.up.unwrap_or(DVec3::Y),
                fov_y: self.fov_y.unwrap_or(DEFAULT_FOV_Y).to_radians(),
            },
            (_, _, Some(name)) => Choice::Named(name.clone()),
            _ => Choice::Auto,
        };
        let mut camera = camera::choose(scene, &choice, aspect)?;
        if let Some(degrees) = self.fov_y {
            match &mut camera.projection {
                Projection::Perspective { fov_y } => *fov_y = degrees.to_radians(),
                Projection::Orthographic { .. } => {
                    return Err(Error::Usage("--fov-y: the camera is orthographic and has no field of view".into()));
                }
            }
        }
        Ok(camera)
    }
}

settings! {
    /// Conversion to 8-bit images.
    "Pictures"
    pub struct PictureSettings {
        /// Tone mapping operator of .png outputs [default: linear]
        tone_map: Option<ToneMap>, option(value_enum), applies(TONE_MAPPED);
        /// Exposure of .png outputs, in stops [default: 0]
        exposure: Option<f64>, option(value_name = "EV", value_parser = parse_number, allow_hyphen_values = true), applies(TONE_MAPPED);
    }
}

impl PictureSettings {
    /// The options, with defaults for settings that were not given.
    pub fn options(&self) -> PictureOptions {
        PictureOptions { tone_map: self.tone_map.unwrap_or_default(), exposure: self.exposure.unwrap_or(0.0) as f32 }
    }
}

settings! {
    /// The film: what it starts from, when it is saved, when it is good enough.
    "Film of stills"
    pub struct FilmSettings {
        /// Resume a render that was saved with --resumable, up to --spp samples in all; the result is bit-identical to an uninterrupted render. All other settings
        /// must be the same
        resume: Option<PathBuf>, option(value_name = "FILE.exr", value_hint = clap::ValueHint::FilePath), applies(AppliesTo::STILLS);
        /// Save the state of the film in .exr outputs (layer `state`), for --resume; implied by --resume and --intervals
        resumable: bool, option(), applies(AppliesTo::STILLS);
        /// Also save intermediate images, as NAME.0016.exr, at every power of two of samples and at those that the scene names
        intervals: bool, option(), applies(AppliesTo::STILLS);
        /// Adaptive sampling: stop sampling an 8x8 tile once its estimated standard error and its neighbours' are at most E (radiance), tested at powers of two
        /// from 64 samples on. --spp is then the maximum
        target_rmse: Option<f64>, option(value_name = "E", value_parser = parse_target, allow_hyphen_values = true), applies(AppliesTo::STILLS);
    }
}

impl FilmSettings {
    /// Returns true if images will contain the film's sums.
    pub fn keeps_state(&self) -> bool {
        self.resumable || self.intervals || self.resume.is_some()
    }
}

/// All settings of a render.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct RenderSettings {
    /// What to render [default: ao]
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", value_parser = crate::integrators::parser()))]
    pub integrator: Option<IntegratorName>,
    /// The image.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub image: ImageSettings,
    /// The camera.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub camera: CameraSettings,
    /// Settings of integrators.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub integrators: IntegratorSettings,
    /// Lights in addition to the scene's.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub lighting: LightingSettings,
    /// Conversion to 8 bits per channel.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub picture: PictureSettings,
    /// The film of stills.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub film: FilmSettings,
    /// Settings of real-time frames.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub frames: FrameSettings,
}

impl RenderSettings {
    /// The integrator.
    pub fn integrator(&self) -> IntegratorName {
        self.integrator.unwrap_or_default()
    }

    /// The settings that were given.
    pub fn given(&self) -> Vec<GivenSetting> {
        [
            self.image.given(),
            self.camera.given(),
            self.integrators.given(),
            self.lighting.given(),
            self.picture.given(),
            self.film.given(),
            self.frames.given(),
        ]
        .concat()
    }

    /// The first setting given that only real-time frames have, if any: its presence selects real-time frames.
    pub fn realtime_setting(&self) -> Option<GivenSetting> {
        self.frames.given().into_iter().next()
    }

    /// Checks conditions on more than one setting: none may be given that would have no effect.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the setting and what to do about it.
    pub fn check(&self) -> Result<()> {
        let frames = self.realtime_setting();
        integrators::check(&self.given(), self.integrator(), frames.as_ref())?;
        if frames.is_none() && Aov::Bent.is_in(&self.image.aov) {
            return Err(Error::Usage("--aov bent is for frames in real time: add --preset".into()));
        }
        self.camera.check()
    }

    /// Image size in pixels, of a scene.
    pub fn size(&self, scene: &Scene) -> [u32; 2] {
        self.image.size.or(scene.hints.size).unwrap_or(DEFAULT_SIZE)
    }

    /// Samples per pixel, of a scene.
    pub fn spp(&self, scene: &Scene) -> u32 {
        self.image.spp.or(scene.hints.spp).unwrap_or(DEFAULT_SPP).max(1)
    }

    /// Seed of the sampler.
    pub fn seed(&self) -> u32 {
        self.image.seed.unwrap_or_default()
    }
}
