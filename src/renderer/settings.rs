//! All settings of a render: command line of `skylit render`, metadata of images, and files.

use glam::DVec3;
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::quality::Quality;
pub use super::shell::quoted;
use super::survey::Survey;
use super::survey::framing::{self, ChosenCamera, ViewName};
use crate::denoise::DenoiseChoice;
use crate::error::{Error, Result};
use crate::files;
use crate::film::SampleSettings;
use crate::film::camera::{self, Choice};
use crate::integrators::aov::Aov;
use crate::integrators::backdrop::Backdrop;
use crate::integrators::lighting::LightingSettings;
use crate::integrators::path::PixelFilter;
use crate::integrators::{self, IntegratorName, IntegratorSettings, PictureOptions, RenderJob};
#[cfg(feature = "cli")]
use crate::output::parse_size;
use crate::output::tone_map::ToneMap;
use crate::realtime::Preset;
use crate::realtime::frame_settings::FrameSettings;
use crate::scene::camera::ViewHeight;
use crate::scene::{Camera, ClipPlanes, Ground, Projection, Scene, SceneSettings};
#[cfg(feature = "cli")]
use crate::settings::parse::{
    parse_args, parse_fov, parse_number, parse_target, parse_time, parse_vector, usage_message,
};
use crate::settings::{AppliesTo, Capability, GivenSetting, Setting, settings};

/// Samples per pixel when neither the settings nor the scene give them.
pub const DEFAULT_SPP: u32 = 16;
/// Image size in pixels when neither the settings nor the scene give it.
pub const DEFAULT_SIZE: [u32; 2] = [1280, 720];
/// Vertical field of view of cameras given by --eye, degrees.
pub const DEFAULT_FOV_Y: f64 = 45.0;

/// Integrators whose images can be denoised.
const DENOISED: AppliesTo = AppliesTo::stills_of(Capability::Denoising);
/// Integrators to whose images tone mapping and exposure apply.
const TONE_MAPPED: AppliesTo = AppliesTo::all_of(Capability::ToneMapping);

settings! {
    /// The image.
    "Image"
    pub struct ImageSettings {
        /// Samples per pixel [default: the scene's, or 16]
        spp: Option<u32>, option(value_parser = clap::value_parser!(u32).range(1..=1 << 24)), applies(AppliesTo::STILLS), basic;
        /// Image size in pixels [default: the scene's, or 1280x720]
        ///
        /// Where the scene's camera has an aspect ratio, the default has about as many pixels in
        /// that ratio.
        size: Option<[u32; 2]>, option(value_name = "WxH", value_parser = parse_size), applies(AppliesTo::ALL), basic;
        /// Seed of the sampler [default: 0]
        seed: Option<u32>, option(value_name = "N"), applies(AppliesTo::ALL);
        /// Stop after this time and keep the image so far (at least one sample per pixel)
        time_limit: Option<f64>,
            option(value_name = "SECONDS", value_parser = parse_time, allow_hyphen_values = true), applies(AppliesTo::STILLS);
        /// Pixel reconstruction filter, by importance sampling [default: box]
        ///
        /// Frames in real time have `box`, or `centre` with --antialias off.
        pixel_filter: Option<PixelFilter>, option(value_enum), applies(AppliesTo::STILLS);
        /// Denoise the final image (biased) [default: off; without METHOD: auto]
        ///
        /// An .exr keeps the noisy image as noisy.Y, or noisy.R, noisy.G, noisy.B.
        denoise: Option<DenoiseChoice>,
            option(value_name = "METHOD", value_enum, num_args = 0..=1, require_equals = false, default_missing_value = "auto"), applies(DENOISED), basic;
        /// What is behind the scene, apart from what lights it [default: map]
        ///
        /// The environment map as it is (`map`) or `blurred`; a linear colour R,G,B from 0 to 1; or
        /// nothing (`transparent`), which leaves alpha in .png and .webp outputs. A colour is for
        /// pictures: an .exr keeps alpha. Mirrors, glass and light keep the map. Without an
        /// environment the default is black, without alpha.
        background: Option<Backdrop>, option(value_name = "map|blurred|R,G,B|transparent", alias = "backdrop"), applies(AppliesTo::ALL);
        /// Put a ground under the scene: a grey plane, or a catcher of its shadows [default: none]
        ///
        /// A catcher shows what is behind the scene, darkened by the share of light that the scene
        /// keeps from it; before a colour or nothing, its alpha is that share. Other surfaces see a
        /// grey plane in its place. It is for stills of `ao` and of integrators of light.
        ground: Option<Ground>, option(value_enum), applies(AppliesTo::ALL);
        /// Height (y) of the ground, scene units [default: that of the scene's lowest point]
        ground_height: Option<f64>, option(value_name = "Y", value_parser = parse_number, allow_hyphen_values = true), applies(AppliesTo::ALL);
        /// Auxiliary outputs to add to the .exr, separated by commas
        aov: Vec<Aov>, option(value_name = "LIST", value_enum, value_delimiter = ','), applies(AppliesTo::ALL);
    }
}

settings! {
    /// The camera.
    "Camera"
    pub struct CameraSettings {
        /// Camera of the scene, by index or name [default: the first, or one that shows the scene]
        ///
        /// Where the scene has no camera, one is chosen that shows most of the scene, or of a room
        /// from inside.
        camera: Option<String>, option(value_name = "INDEX|NAME", conflicts_with = "eye"), applies(AppliesTo::ALL), basic;
        /// Look at the whole scene from one side, or at a room from inside, whatever cameras the scene has
        view: Option<ViewName>, option(value_enum, conflicts_with_all = ["eye", "camera"]), applies(AppliesTo::ALL), basic;
        /// Camera position
        eye: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, requires = "target", allow_hyphen_values = true), applies(AppliesTo::ALL), basic;
        /// Point that the camera looks at
        target: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, requires = "eye", allow_hyphen_values = true), applies(AppliesTo::ALL), basic;
        /// Up vector [default: 0,1,0]
        up: Option<DVec3>,
            option(value_name = "X,Y,Z", value_parser = parse_vector, requires = "eye", allow_hyphen_values = true), applies(AppliesTo::ALL);
        /// Vertical field of view in degrees [default: the camera's, or 45]
        fov_y: Option<f64>, option(value_name = "DEG", value_parser = parse_fov, allow_hyphen_values = true), applies(AppliesTo::ALL), basic;
        /// Parallel rays instead of perspective: HEIGHT of the view in scene units, or `fit`
        ///
        /// `fit` shows all of a scene that is seen from outside; else it shows as much as the
        /// camera's field of view does of what it looks at. Rays start at the camera.
        orthographic: Option<ViewHeight>, option(value_name = "HEIGHT|fit", conflicts_with = "fov_y"), applies(AppliesTo::ALL);
        /// Clipping planes, in scene units; FAR may be `inf` [default: those of the camera, or
        /// none]
        ///
        /// The camera sees what lies between these distances along the view direction. `none` clips
        /// nothing.
        clip: Option<ClipPlanes>, option(value_name = "NEAR,FAR"), applies(AppliesTo::ALL);
    }
}

impl crate::settings::Editable for Option<ViewHeight> {
    fn value(&mut self) -> crate::settings::Value<'_> {
        crate::settings::Value::Other
    }
}

impl crate::settings::Editable for Option<ClipPlanes> {
    fn value(&mut self) -> crate::settings::Value<'_> {
        crate::settings::Value::Other
    }
}

impl CameraSettings {
    /// Whether they say which camera: without, the scene's first one, or an automatic one.
    pub fn chooses(&self) -> bool {
        self.camera.is_some() || self.eye.is_some() || self.view.is_some()
    }

    /// Checks conditions on more than one setting.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check(&self) -> Result<()> {
        if self.eye.is_some() != self.target.is_some() {
            return Err(Error::Usage("--eye and --target belong together: give both".into()));
        }
        if self.eye.is_some() && self.camera.is_some() {
            return Err(Error::Usage("--camera and --eye both choose the camera: leave one of them out".into()));
        }
        if self.view.is_some() && (self.eye.is_some() || self.camera.is_some()) {
            let other = if self.eye.is_some() { "--eye" } else { "--camera" };
            return Err(Error::Usage(format!("--view and {other} both choose the camera: leave one of them out")));
        }
        if self.eye.is_some() && self.eye == self.target {
            return Err(Error::Usage("--eye and --target are the same point: move one of them".into()));
        }
        if self.fov_y.is_some() && self.orthographic.is_some() {
            return Err(Error::Usage(
                "--orthographic: a view of parallel rays has no field of view: leave out --fov-y".into(),
            ));
        }
        if self.up == Some(DVec3::ZERO) {
            return Err(Error::Usage("--up 0,0,0 has no direction: give a vector of another length than 0".into()));
        }
        Ok(())
    }

    /// The camera for images of `aspect` = width / height that is chosen by what it would see,
    /// because settings and scene leave it open, or name a view; else `None`.
    ///
    /// # Errors
    /// [`Error::Scene`] if the scene has no geometry.
    pub fn automatic(&self, survey: &Survey, aspect: f64) -> Result<Option<ChosenCamera>> {
        let fov_y = self.fov_y.map(f64::to_radians);
        let is_automatic = self.eye.is_none() && self.camera.is_none() && survey.scene().cameras.is_empty();
        let chosen = match self.view {
            Some(name) => framing::named(survey, name, aspect, fov_y)?,
            None if is_automatic => framing::choose_on_host(survey, aspect, fov_y)?,
            None => return Ok(None),
        };
        Ok(Some(match self.orthographic {
            Some(height) => chosen.orthographic(height, survey, aspect)?,
            None => chosen,
        }))
    }

    /// The scene's camera that they choose, if it is one.
    pub fn scene_camera<'s>(&self, scene: &'s Scene) -> Option<&'s Camera> {
        match &self.camera {
            _ if self.eye.is_some() || self.view.is_some() => None,
            Some(name) => camera::named(scene, name),
            None => scene.cameras.first(),
        }
    }

    /// Chooses the camera for images of `aspect` = width / height.
    ///
    /// # Errors
    /// [`Error::Usage`] for a camera that does not exist, [`Error::Scene`] without any geometry.
    pub fn choose(&self, survey: &Survey, aspect: f64) -> Result<Camera> {
        let camera = self.choose_unclipped(survey, aspect)?;
        Ok(Camera { clip: self.clip.unwrap_or(camera.clip), ..camera })
    }

    /// The camera with clipping planes of its own, if it is one of the scene's.
    fn choose_unclipped(&self, survey: &Survey, aspect: f64) -> Result<Camera> {
        let scene = survey.scene();
        let fov_y = self.fov_y.map(f64::to_radians);
        if let Some(chosen) = self.automatic(survey, aspect)? {
            return Ok(chosen.camera());
        }
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
        if let Some(angle) = fov_y {
            match &mut camera.projection {
                Projection::Perspective { fov_y } => *fov_y = angle,
                Projection::Orthographic { .. } => {
                    return Err(Error::Usage("--fov-y: the camera is orthographic and has no field of view".into()));
                }
            }
        }
        if let Some(height) = self.orthographic {
            let eye = camera.camera_to_world.translation;
            let half_height = match (height, self.target) {
                (ViewHeight::Units(height), _) => 0.5 * height,
                (ViewHeight::Fit, Some(target)) => camera.half_height_at(target.distance(eye)),
                (ViewHeight::Fit, None) => camera.half_height_at(framing::distance_ahead(&camera, survey.bounds()?)),
            };
            camera.projection = Projection::Orthographic { half_height };
        }
        Ok(camera)
    }
}

settings! {
    /// Conversion to 8-bit images.
    "Pictures"
    pub struct PictureSettings {
        /// Tone mapping operator of .png outputs [default: linear]
        tone_map: Option<ToneMap>, option(value_enum), applies(TONE_MAPPED), basic;
        /// Exposure of .png outputs, in stops [default: 0, or chosen for scenes far from middle
        /// grey]
        ///
        /// It is chosen for a still that shows the scene's own light, if that is far from what a
        /// display shows.
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
        /// Resume a render that was saved with --resumable, up to --spp samples in all
        ///
        /// The result is bit-identical to an uninterrupted render. All other settings must be the
        /// same.
        resume: Option<PathBuf>, option(value_name = "FILE.exr", value_hint = clap::ValueHint::FilePath), applies(AppliesTo::STILLS);
        /// Save the state of the film in .exr outputs (layer `state`), for --resume
        ///
        /// --resume and --intervals imply it.
        resumable: bool, option(), applies(AppliesTo::STILLS);
        /// Also save intermediate images, as NAME.0016.exr, at every power of two of samples
        ///
        /// They are saved at the samples that the scene names, too.
        intervals: bool, option(), applies(AppliesTo::STILLS);
        /// Adaptive sampling: stop where the standard error is at most E, in radiance
        ///
        /// A tile of 8x8 pixels is finished once its estimated standard error and its neighbours'
        /// are at most E, tested at powers of two from 64 samples on. --spp is then the maximum.
        target_rmse: Option<f64>, option(value_name = "E", value_parser = parse_target, allow_hyphen_values = true), applies(AppliesTo::STILLS);
        /// As many samples as a display needs: draft, good or final
        ///
        /// Tiles of 8x8 pixels are sampled until the noise that a display shows of them is at most 4/255 (draft), 2/255 (good) or 1/255 (final) of sRGB values,
        /// with at most 256, 1024 or 4096 samples per pixel; --spp is left out. The error that was reached is printed.
        quality: Option<Quality>, option(value_name = "NAME", value_enum, hide_possible_values = true, help_heading = "Image"), applies(DENOISED), basic;
    }
}

impl FilmSettings {
    /// Returns true if images will contain the film's sums.
    pub fn keeps_state(&self) -> bool {
        self.resumable || self.intervals || self.resume.is_some()
    }

    /// Checks that nothing else decides how many samples a quality takes.
    fn check(&self, spp: Option<u32>) -> Result<()> {
        if self.quality.is_none() {
            return Ok(());
        }
        let others = [
            (spp.is_some(), "--spp", "both say how many samples there are: leave one of them out"),
            (self.target_rmse.is_some(), "--target-rmse", "are two bounds of the error: leave one of them out"),
            (self.resume.is_some(), "--resume", RESUMED),
            (self.resumable, "--resumable", RESUMED),
            (self.intervals, "--intervals", RESUMED),
        ];
        match others.iter().find(|(is_given, ..)| *is_given) {
            Some((_, option, why)) => Err(Error::Usage(format!("--quality and {option} {why}"))),
            None => Ok(()),
        }
    }
}

/// Why films of a quality are not resumed.
const RESUMED: &str = "do not go together, for a film that is saved does not keep the halves of its samples: \
    leave one of them out, or use --target-rmse";

/// Aspect ratios from which image sizes follow: others are mistakes.
const ASPECTS: std::ops::RangeInclusive<f64> = 1.0 / 64.0..=64.0;

/// The image size of an aspect ratio (width over height) with about as many pixels as
/// [`DEFAULT_SIZE`], within three per cent of a side; `None` for a ratio that no image has.
pub fn size_of_aspect(aspect: f64) -> Option<[u32; 2]> {
    let pixels = DEFAULT_SIZE.iter().map(|&n| f64::from(n)).product::<f64>();
    let height = ASPECTS.contains(&aspect).then(|| (pixels / aspect).sqrt())?;
    let size = |height: f64| [(height * aspect).round(), height];
    let error = |[width, height]: [f64; 2]| (width / height / aspect - 1.0).abs();
    // the nearest first, of equal ones
    let mut best = size(height.round());
    for step in 1..=(0.03 * height) as u32 {
        for other in [height.round() + f64::from(step), height.round() - f64::from(step)].map(size) {
            if error(other) < error(best) - 1e-6 {
                best = other;
            }
        }
    }
    Some(best.map(|n| n.max(1.0) as u32))
}

/// Settings as options of `skylit render`, quoted for a shell, with numbers like `2`, not `2.0`.
pub fn options_text(settings: &RenderSettings) -> String {
    let short = |flag: String| {
        let numbers: Option<Vec<f64>> = flag.split(',').map(|n| n.parse().ok()).collect();
        let is_plain = flag.chars().all(|c| c.is_ascii_digit() || "+-.,e".contains(c));
        match numbers.filter(|_| is_plain) {
            Some(numbers) => numbers.iter().map(|x| number_text(*x)).collect::<Vec<_>>().join(","),
            None => flag,
        }
    };
    settings.flags().into_iter().map(|flag| quoted(&short(flag))).collect::<Vec<_>>().join(" ")
}

/// A number with all its digits, as a power of ten where it would have many zeros.
fn number_text(x: f64) -> String {
    let plain = x.to_string();
    if plain.len() > 12 {
        Some(format!("{x:e}")).filter(|text| text.len() < plain.len()).unwrap_or(plain)
    } else {
        plain
    }
}

/// Values of an option for each time that it is given; `None` for one without a value.
fn flag_values(name: &str, value: &serde_json::Value) -> Vec<Option<String>> {
    use serde_json::Value;
    let text = |v: &Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
    let joined = |all: &[Value], by: &str| Some(all.iter().map(text).collect::<Vec<_>>().join(by));
    match value {
        Value::Null | Value::Bool(false) => Vec::new(),
        Value::Bool(true) => vec![None],
        Value::Array(all) if name == "size" => vec![joined(all, "x")],
        Value::Array(all) if ["light", "material", "hide", "only"].contains(&name) => {
            all.iter().map(|v| Some(text(v))).collect()
        }
        Value::Array(all) => vec![joined(all, ",")],
        value => vec![Some(text(value))],
    }
}

/// All settings of a render.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct RenderSettings {
    /// What to render [default: ao]
    #[cfg_attr(feature = "cli", arg(long, value_name = "NAME", help_heading = "Image", value_parser = crate::integrators::parser()))]
    pub integrator: Option<IntegratorName>,
    /// The image.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub image: ImageSettings,
    /// Meaning of the scene's file.
    #[serde(skip_serializing_if = "crate::settings::is_default")]
    #[cfg_attr(feature = "cli", command(flatten))]
    pub scene: SceneSettings,
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
    /// Reads a file of settings: JSON, as the viewer saves it, or .toml.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be read, or with a setting that does not exist.
    pub fn load(path: &Path) -> Result<Self> {
        #[cfg(feature = "cli")]
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
            return super::defaults::parse_settings(path, &files::read_text(path)?);
        }
        serde_json::from_slice(&files::read(path)?)
            .map_err(|e| Error::input(path, format!("not a file of settings: {e}")))
    }

    /// Reads a line of a person: the name of an integrator or of a preset of frames in real time,
    /// then options of `skylit render`, with `'` or `"` around spaces: `ao --ao-radius 2 --spp 64`,
    /// `balanced --frames 8`. `--settings FILE` reads a file, too.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the line, and those of [`RenderSettings::load`].
    #[cfg(feature = "cli")]
    pub fn from_words(line: &str) -> Result<Self> {
        #[derive(clap::Args)]
        struct Words {
            #[arg(long = "settings")]
            file: Option<PathBuf>,
            #[command(flatten)]
            settings: RenderSettings,
        }
        let wrong = |what: String| Error::Usage(format!("\"{line}\": {what}"));
        let mut words = shlex::split(line).ok_or_else(|| wrong("a quotation mark is not closed".into()))?;
        if let Some(name) = words.first().filter(|w| !w.starts_with('-')).cloned() {
            let option = match (name.parse::<IntegratorName>(), <Preset as clap::ValueEnum>::from_str(&name, false)) {
                (Ok(_), _) => "--integrator",
                (_, Ok(_)) => "--preset",
                (Err(e), _) => {
                    let presets = <Preset as clap::ValueEnum>::value_variants().iter().map(Preset::to_string);
                    return Err(wrong(format!("{e}, or of the presets {}", presets.collect::<Vec<_>>().join(", "))));
                }
            };
            words.insert(0, option.to_owned());
        }
        let words: Words = parse_args(&words).map_err(|e| wrong(usage_message(&e)))?;
        words.settings.over_file(words.file.as_deref())
    }

    /// These settings over those of a file, if one is given.
    ///
    /// # Errors
    /// Those of [`RenderSettings::load`].
    pub fn over_file(&self, path: Option<&Path>) -> Result<Self> {
        path.map_or_else(|| Ok(self.clone()), |path| Ok(Self::load(path)?.overridden_by(self)))
    }

    /// These settings, replaced by those that `other` gives.
    pub fn overridden_by(&self, other: &Self) -> Self {
        let mut out = self.without_replaced(other);
        out.integrator = other.integrator.or(out.integrator);
        out.image.override_with(&other.image);
        out.scene.override_with(&other.scene);
        out.camera.override_with(&other.camera);
        out.integrators.ao.override_with(&other.integrators.ao);
        out.integrators.path.override_with(&other.integrators.path);
        out.lighting.override_with(&other.lighting);
        out.picture.override_with(&other.picture);
        out.film.override_with(&other.film);
        out.frames.override_with(&other.frames);
        out
    }

    /// These settings without those that `other` gives; cameras, motion, environments and what
    /// decides the number of samples go whole.
    pub(super) fn without_replaced(&self, other: &Self) -> Self {
        let mut out = self.clone();
        let (camera, motion) = (&other.camera, &other.frames);
        if camera.chooses() {
            let CameraSettings { fov_y, orthographic, .. } = out.camera;
            out.camera = CameraSettings { fov_y, orthographic, ..Default::default() };
        }
        match (other.image.spp, other.film.quality) {
            (Some(_), _) => out.film.quality = None,
            (_, Some(_)) => (out.image.spp, out.film.target_rmse) = (None, None),
            (None, None) => {}
        }
        // a view is of one kind
        match (camera.fov_y, camera.orthographic) {
            (Some(_), _) => out.camera.orthographic = None,
            (None, Some(_)) => out.camera.fov_y = None,
            (None, None) => {}
        }
        if camera.chooses() || camera.fov_y.is_some() || camera.orthographic.is_some() {
            out.frames.camera_path = None;
        }
        if motion.camera_path.is_some() {
            out.camera = CameraSettings::default();
        }
        if motion.camera_path.is_some() || motion.orbit.is_some() {
            (out.frames.camera_path, out.frames.orbit) = (None, None);
        }
        if other.lighting.environment.is_some() {
            (out.lighting.environment_turn, out.lighting.environment_scale) = (None, None);
        }
        out
    }

    /// Removes the settings whose names `keeps` returns false for; the integrator stays.
    #[cfg(feature = "cli")]
    pub(crate) fn retain(&mut self, keeps: &dyn Fn(&str) -> bool) {
        let keeps = |name: &str, _: AppliesTo| keeps(name);
        self.image.retain(&keeps);
        self.scene.retain(&keeps);
        self.camera.retain(&keeps);
        self.integrators.ao.retain(&keeps);
        self.integrators.path.retain(&keeps);
        self.lighting.retain(&keeps);
        self.picture.retain(&keeps);
        self.film.retain(&keeps);
        self.frames.retain(&keeps);
    }

    /// The integrator.
    pub fn integrator(&self) -> IntegratorName {
        self.integrator.unwrap_or_default()
    }

    /// The settings that were given.
    pub fn given(&self) -> Vec<GivenSetting> {
        [
            self.image.given(),
            self.scene.given(),
            self.camera.given(),
            self.integrators.given(),
            self.lighting.given(),
            self.picture.given(),
            self.film.given(),
            self.frames.given(),
        ]
        .concat()
    }

    /// The first given setting that only real-time frames have, which selects them.
    pub fn realtime_setting(&self) -> Option<GivenSetting> {
        if self.is_still_sequence() { None } else { self.frames.given().into_iter().next() }
    }

    /// Returns true for stills, one per frame: `spp` or a quality, and nothing that only real-time
    /// frames have.
    pub fn is_still_sequence(&self) -> bool {
        let given = self.frames.given();
        (self.image.spp.is_some() || self.film.quality.is_some())
            && !given.is_empty()
            && given.iter().all(|s| s.applies.stills)
    }

    /// Checks conditions on more than one setting: none may be given that would have no effect.
    ///
    /// # Errors
    /// [`Error::Usage`], naming the setting and what to do about it.
    pub fn check(&self) -> Result<()> {
        let frames = self.realtime_setting();
        integrators::check(&self.given(), self.integrator(), frames.as_ref())?;
        if let Some(setting) =
            frames.filter(|_| !self.integrator().get().capabilities().contains(&Capability::RealTimeFrames))
        {
            return Err(Error::Usage(format!(
                "--integrator {} has no frames in real time: add --spp N for stills, one per frame, or leave {} out",
                self.integrator().name(),
                setting.option()
            )));
        }
        self.film.check(self.image.spp)?;
        self.check_ground(frames.is_some())?;
        if let Some(backdrop) = self.image.background {
            let integrator = self.integrator().get();
            backdrop.check(integrator.sees_environment(), integrator.name())?;
        }
        if frames.is_none() && Aov::Bent.is_in(&self.image.aov) {
            return Err(Error::Usage("--aov bent is for frames in real time: add --preset".into()));
        }
        self.camera.check()
    }

    /// Checks that images have the ground. `is_frames`: they are frames in real time.
    fn check_ground(&self, is_frames: bool) -> Result<()> {
        let integrator = self.integrator().get();
        let wrong = |text: String| Err(Error::Usage(text));
        match self.image.ground.unwrap_or_default() {
            Ground::None if self.image.ground_height.is_some() => {
                wrong("--ground-height: there is no ground; add --ground plane, or leave it out".into())
            }
            Ground::Catcher if is_frames && self.frames.preset == Some(Preset::Larsen) => {
                wrong("--ground catcher: --preset larsen has none; use --ground plane, or choose another preset".into())
            }
            Ground::Catcher
                if !integrator.can(Capability::LightTransport) && !integrator.can(Capability::AmbientVisibility) =>
            {
                wrong(format!(
                    "--ground catcher: --integrator {} shows no light that could be caught; use --ground plane, or --integrator path",
                    integrator.name()
                ))
            }
            Ground::None | Ground::Plane | Ground::Catcher => Ok(()),
        }
    }

    /// All settings but the integrator, for editors.
    pub fn editable(&mut self) -> Vec<Setting<'_>> {
        let mut all = self.image.editable();
        all.extend(self.scene.editable());
        all.extend(self.camera.editable());
        all.extend(self.integrators.ao.editable());
        all.extend(self.integrators.path.editable());
        all.extend(self.lighting.editable());
        all.extend(self.picture.editable());
        all.extend(self.film.editable());
        all.extend(self.frames.editable());
        all
    }

    /// Clears settings without effect, but [`crate::settings::Value::Other`], which editors lack.
    pub fn clear_unused(&mut self) {
        let name = self.integrator();
        let integrator = (name.name(), name.get().capabilities());
        let is_frames = self.realtime_setting().is_some();
        for mut setting in self.editable() {
            let applies = if is_frames { setting.applies.frames } else { setting.applies.stills };
            if !applies || !setting.applies.includes(&integrator) {
                setting.clear();
            }
        }
    }

    /// The settings as options of `skylit render`: `--integrator`, `path`, ...
    pub fn flags(&self) -> Vec<String> {
        let mut flags = Vec::new();
        if let Some(integrator) = self.integrator {
            flags.extend(["--integrator".to_owned(), integrator.name().to_owned()]);
        }
        // groups of settings, by name
        let groups = serde_json::to_value(self).unwrap_or_default();
        let mut groups: Vec<_> =
            groups.as_object().into_iter().flatten().filter_map(|(_, group)| group.as_object()).collect();
        while !groups.is_empty() {
            for (name, value) in std::mem::take(&mut groups).into_iter().flatten() {
                if let Some(group) = value.as_object() {
                    groups.push(group);
                    continue;
                }
                let flag = format!("--{}", name.replace('_', "-"));
                for text in flag_values(name, value) {
                    flags.push(flag.clone());
                    flags.extend(text);
                }
            }
        }
        flags
    }

    /// Image size in pixels: the settings' own, the scene's, or by the camera ([`size_of_aspect`]).
    pub fn size(&self, scene: &Scene) -> [u32; 2] {
        self.image.size.or(scene.hints.size).unwrap_or(DEFAULT_SIZE)
    }

    /// Samples per pixel, of a scene; the maximum, if sampling adapts.
    pub fn spp(&self, scene: &Scene) -> u32 {
        if let Some(quality) = self.film.quality {
            return quality.max_spp();
        }
        self.image.spp.or(scene.hints.spp).unwrap_or(DEFAULT_SPP).max(1)
    }

    /// Pixel reconstruction filter.
    pub fn pixel_filter(&self) -> PixelFilter {
        self.image.pixel_filter.unwrap_or_default()
    }

    /// The background of camera rays that leave the scene.
    pub fn backdrop(&self) -> Backdrop {
        self.image.background.unwrap_or_default()
    }

    /// Seed of the sampler.
    pub fn seed(&self) -> u32 {
        self.image.seed.unwrap_or_default()
    }

    /// The job of a still of these settings, with all of its samples.
    pub(super) fn job<'a>(&'a self, scene: &'a Scene, camera: &'a Camera) -> RenderJob<'a> {
        RenderJob {
            scene,
            camera,
            samples: SampleSettings {
                size: self.size(scene),
                spp: self.spp(scene),
                seed: self.seed(),
                pixel_filter: self.pixel_filter(),
                time_limit: self.image.time_limit.map(Duration::from_secs_f64),
                ..SampleSettings::default()
            },
            settings: &self.integrators,
            backdrop: self.backdrop(),
        }
    }
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;

    #[test]
    fn options_are_as_people_write_them() {
        let text = |line: &str| options_text(&RenderSettings::from_words(line).unwrap());
        assert_eq!(text("ao --eye 1.0,-2.50,0 --target 0,0,1e-3"), "--integrator ao --eye 1,-2.5,0 --target 0,0,0.001");
        assert_eq!(
            text("ao --ao-falloff 6.763e26 --ao-radius 5.0"),
            "--integrator ao --ao-falloff 6.763e26 --ao-radius 5"
        );
        assert_eq!(
            text("path --light 'sun direction=0,-1,0 irradiance=2'"),
            "--integrator path --light 'sun direction=0,-1,0 irradiance=2'"
        );
        assert_eq!(text(""), "");
    }

    #[test]
    fn lines_of_words() {
        let of = |line: &str| RenderSettings::from_words(line).unwrap();
        let ao = of("ao --ao-radius 2 --spp 64");
        assert_eq!((ao.integrator().name(), ao.integrators.ao.radius(), ao.image.spp), ("ao", 2.0, Some(64)));
        let frames = of("balanced --frames 8");
        assert_eq!(frames.frames.preset, Some(Preset::Balanced));
        let lit = of("path --light 'sun direction=0,-1,0 irradiance=2'");
        assert_eq!(lit, of("--integrator path --light \"sun direction=0,-1,0 irradiance=2\""));
        assert_eq!(of(""), RenderSettings::default());
        for (line, part) in [
            ("oa --spp 3", "choose one of ao"),
            ("oa --spp 3", "balanced"),
            ("ao --ssp 3", "--ssp"),
            ("ao --spp", "--spp"),
            ("path --light 'sun", "quotation mark"),
            ("ao --help", "--help"),
            ("ao --settings /no/such/file.json", "/no/such/file.json"),
        ] {
            let error = RenderSettings::from_words(line).unwrap_err().to_string();
            assert!(error.contains(part) && !error.contains('\n'), "{line}: {error}");
        }
    }

    #[test]
    fn sizes_have_the_aspect_ratio_of_cameras() {
        assert_eq!(size_of_aspect(16.0 / 9.0), Some(DEFAULT_SIZE));
        assert_eq!([size_of_aspect(1.0), size_of_aspect(4.0)], [Some([960, 960]), Some([1920, 480])]);
        for aspect in [0.1, 0.5625, 4.0 / 3.0, 1.618, 2.39, 21.0 / 9.0, 60.0] {
            let [width, height] = size_of_aspect(aspect).unwrap().map(f64::from);
            assert!((width / height / aspect - 1.0).abs() < 1e-3, "{aspect}: {width}x{height}");
            assert!((width * height / 921_600.0 - 1.0).abs() < 0.07, "{aspect}: {width}x{height}");
        }
        for aspect in [0.0, -1.0, 1e-3, 1e9, f64::INFINITY, f64::NAN] {
            assert_eq!(size_of_aspect(aspect), None);
        }
    }

    #[test]
    fn flags_are_those_of_the_command_line() {
        let parse = |args: &[String]| -> RenderSettings { parse_args(args).unwrap() };
        let given = "--integrator path --spp 3 --size 20x10 --aov depth,ids --eye -1,2.5,3e-7 --target 0,0,0 --fov-y 30 --max-depth 4 \
            --energy-compensation --tone-map agx --exposure -1.5 --environment 1,1,1 --resumable --ao-radius 1.25 --preset fast --frames 2..5 --show depth --mtl-dissolve glass";
        let mut given: Vec<String> = given.split_whitespace().map(str::to_owned).collect();
        for light in ["sphere position=1,2,3 radius=0.5 radiance=4", "sun direction=0,-1,0 irradiance=2"] {
            given.extend(["--light".to_owned(), light.to_owned()]);
        }
        let settings = parse(&given);
        assert_eq!(parse(&settings.flags()), settings, "{:?}", settings.flags());
        assert!(RenderSettings::default().flags().is_empty());
        for height in ["fit", "2.5"] {
            let view = RenderSettings::from_words(&format!("ao --view top --orthographic {height}")).unwrap();
            assert_eq!(parse(&view.flags()), view, "{:?}", view.flags());
            let text = serde_json::to_string(&view).unwrap();
            assert_eq!(serde_json::from_str::<RenderSettings>(&text).unwrap(), view, "{text}");
        }
        // a file, and options that replace what it says
        let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
        let other = parse(&words("--camera 1 --spp 9 --integrator direct"));
        let merged = settings.overridden_by(&other);
        let expected = RenderSettings {
            integrator: other.integrator,
            image: ImageSettings { spp: Some(9), ..settings.image.clone() },
            camera: CameraSettings { camera: Some("1".into()), fov_y: Some(30.0), ..Default::default() },
            ..settings.clone()
        };
        assert_eq!(merged, expected);
        assert_eq!(settings.overridden_by(&RenderSettings::default()), settings);
    }
}
