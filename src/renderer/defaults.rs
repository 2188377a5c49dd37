//! Defaults of settings from files called `skylit.toml`: one in the user's configuration folder,
//! one beside the scene. docs/reference/settings.md describes them.
//!
//! A default is not a choice: one without effect is left out, where the same setting on the command
//! line would be an error, and none turns a still into frames in real time.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::RenderSettings;
use super::settings::CameraSettings;
use crate::error::{Error, Result};
use crate::files;
use crate::scene::load::{Confine, confine};
use crate::settings::parse::usage_message;
use crate::tracer::DeviceSettings;

/// Name of the files.
pub const FILE_NAME: &str = "skylit.toml";

/// Settings that a file beside a scene may have: how the scene is seen, lit and sampled. An entry
/// that ends with a dot is a table with all that is in it. Such a file comes from strangers: it
/// does not choose what is written, what is loaded besides images and camera paths, or a device.
const SCENE_SETTINGS: [&str; 13] = [
    "integrator",
    "scene.",
    "image.spp",
    "image.size",
    "image.seed",
    "image.pixel_filter",
    "camera.",
    "integrators.",
    "lighting.",
    "picture.",
    "film.target_rmse",
    "film.quality",
    "frames.",
];

/// A file of defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DefaultsFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Settings of renders, by the keys of settings files.
    pub settings: RenderSettings,
    /// Device and tracer: the table `[device]`.
    pub device: DeviceSettings,
}

/// The defaults taken from a file.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct DefaultsReport {
    /// The file.
    #[serde(serialize_with = "crate::files::serialize_lossy")]
    pub file: PathBuf,
    /// The settings that hold, by their keys: `image.spp`.
    pub settings: BTreeMap<String, Value>,
    /// Keys of settings that have no effect on what is rendered.
    pub unused: Vec<String>,
}

impl DefaultsReport {
    /// The report in a line; `None` if nothing was taken or left out.
    pub fn line(&self) -> Option<String> {
        let file = self.file.display();
        let taken: Vec<_> = self.settings.iter().map(|(key, value)| format!("{key} = {value}")).collect();
        let unused = match self.unused.as_slice() {
            [] => String::new(),
            keys => format!("without effect here: {}", keys.join(", ")),
        };
        match (taken.is_empty(), unused.is_empty()) {
            (true, true) => None,
            (true, false) => Some(format!("no defaults from {file}; {unused}")),
            (false, true) => Some(format!("defaults from {file}: {}", taken.join(", "))),
            (false, false) => Some(format!("defaults from {file}: {}; {unused}", taken.join(", "))),
        }
    }
}

/// Settings that files of defaults have filled in.
#[derive(Clone, Debug)]
pub struct Resolved {
    /// Settings of the render.
    pub settings: RenderSettings,
    /// Device and tracer.
    pub device: DeviceSettings,
    /// The defaults taken from each file, in the order of the files.
    pub reports: Vec<DefaultsReport>,
}

/// The files of defaults that exist: of the configuration folder, then of the folder of `scene`,
/// which prevails. `confine` says where the latter, and files that it names, must lie.
///
/// # Errors
/// [`Error::Input`] for files that cannot be read, unknown settings and wrong values, a setting
/// that a scene's folder may not choose, and a file that lies elsewhere.
pub fn find(scene: Option<&str>, confine: Confine) -> Result<Vec<DefaultsFile>> {
    let folder = |scene: &str| Path::new(scene).parent().map(Path::to_owned);
    let beside = scene.filter(|s| !s.starts_with("builtin:")).and_then(folder);
    let load = |folder: PathBuf| DefaultsFile::load_if_exists(&folder.join(FILE_NAME));
    let own = files::config_folder().map(load).transpose()?.flatten();
    let confine = match (scene, &beside) {
        (Some(scene), Some(_)) => confine.folder_for(Path::new(scene))?,
        _ => None,
    };
    if let (Some(confine), Some(folder)) = (&confine, &beside) {
        let file = folder.join(FILE_NAME);
        confine::check(confine, &file, &file)?;
    }
    let of_scene = beside.map(load).transpose()?.flatten();
    if let Some(file) = &of_scene {
        file.check_scene_settings()?;
        file.check_confined(confine.as_deref())?;
    }
    Ok(own.into_iter().chain(of_scene).collect())
}

impl DefaultsFile {
    fn load_if_exists(path: &Path) -> Result<Option<Self>> {
        match files::read_regular_text(path) {
            Ok(text) => Self::parse(path, &text).map(Some),
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(None),
            Err(e) => Err(Error::read(path, &e)),
        }
    }

    /// Checks that a file beside a scene has no settings but [`SCENE_SETTINGS`].
    fn check_scene_settings(&self) -> Result<()> {
        let may =
            |key: &str| SCENE_SETTINGS.iter().any(|s| if s.ends_with('.') { key.starts_with(s) } else { key == *s });
        let refused: Vec<_> = leaves(&self.settings, &self.device).into_keys().filter(|key| !may(key)).collect();
        if refused.is_empty() {
            return Ok(());
        }
        let what = refused.join(", ");
        Err(Error::input(
            &self.path,
            format!(
                "a file beside a scene cannot set {what}: take it out, give it as an option or in your own {FILE_NAME}, or ignore this file with --no-config"
            ),
        ))
    }

    /// Checks that the files that it names lie below a folder.
    fn check_confined(&self, folder: Option<&Path>) -> Result<()> {
        let Some(folder) = folder else { return Ok(()) };
        let environment = self.settings.lighting.environment_file();
        let mut files = environment.iter().chain(&self.settings.frames.camera_path);
        files.try_for_each(|path| confine::check(folder, &self.path, path))
    }

    /// A file with this text. Relative paths in it start at its folder.
    fn parse(path: &Path, text: &str) -> Result<Self> {
        let mut table = table(path, text)?;
        let device =
            table.remove("device").map(|device| device.try_into()).transpose().map_err(|e| wrong(path, text, &e))?;
        let settings = settings(path, text, table)?;
        let mut file = Self { path: path.to_owned(), settings, device: device.unwrap_or_default() };
        file.resolve_paths();
        Ok(file)
    }

    fn resolve_paths(&mut self) {
        let Some(folder) = self.path.parent() else { return };
        let s = &mut self.settings;
        for path in [&mut s.frames.camera_path, &mut s.film.resume, &mut self.device.bvh_cache].into_iter().flatten() {
            *path = folder.join(&*path);
        }
        if let Some(path) = self.device.areas_file() {
            self.device.build_areas = Some(folder.join(path).to_string_lossy().into_owned());
        }
        if let Some(path) = s.lighting.environment_file() {
            s.lighting.environment = Some(folder.join(path).to_string_lossy().into_owned());
        }
    }
}

fn table(path: &Path, text: &str) -> Result<toml::Table> {
    toml::from_str(text).map_err(|e| wrong(path, text, &e))
}

fn settings(path: &Path, text: &str, table: toml::Table) -> Result<RenderSettings> {
    let settings: RenderSettings = table.try_into().map_err(|e| wrong(path, text, &e))?;
    check_values(&settings).map_err(|message| Error::input(path, message))?;
    Ok(settings)
}

/// Reads settings of a render in TOML.
pub(super) fn parse_settings(path: &Path, text: &str) -> Result<RenderSettings> {
    settings(path, text, table(path, text)?)
}

/// An error of the parser in one line, with the line of the file or the key that it is about.
fn wrong(path: &Path, text: &str, error: &toml::de::Error) -> Error {
    let line = error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
    let message = match line {
        Some(line) => format!("line {line}: {}", error.message()),
        None => error.to_string().split_whitespace().collect::<Vec<_>>().join(" "),
    };
    Error::input(path, message)
}

/// Checks each value as the command line does.
fn check_values(settings: &RenderSettings) -> Result<(), String> {
    #[derive(clap::Parser)]
    #[command(no_binary_name = true, disable_help_flag = true, disable_version_flag = true)]
    struct Flags {
        #[command(flatten)]
        _settings: RenderSettings,
    }
    <Flags as clap::Parser>::try_parse_from(settings.flags()).map(drop).map_err(|e| usage_message(&e))
}

/// Fills in defaults: `settings` and `device` replace those of files, a later file an earlier one.
/// A default is left out where `holds` returns false: settings without effect together.
pub fn resolve(
    files: &[DefaultsFile],
    settings: &RenderSettings,
    device: &DeviceSettings,
    holds: &dyn Fn(&RenderSettings) -> bool,
) -> Resolved {
    let mut resolved = Resolved { settings: settings.clone(), device: device.clone(), reports: Vec::new() };
    // the integrator decides what else has an effect; other defaults do not decide whether it has
    let with = |integrator| RenderSettings { integrator, ..settings.clone() };
    let is_given = settings.integrator.is_some();
    let offers = |file: &DefaultsFile| file.settings.integrator.is_some() && !is_given;
    let chosen = files.iter().rposition(|file| offers(file) && holds(&with(file.settings.integrator)));
    if let Some(k) = chosen {
        resolved.settings.integrator = files[k].settings.integrator;
    }
    for (k, file) in files.iter().enumerate().rev() {
        let before = leaves(&resolved.settings, &resolved.device);
        let own = RenderSettings { integrator: None, ..file.settings.without_replaced(&resolved.settings) };
        let kept = holding_settings(&own, &resolved.settings, holds);
        let kept_device = holding_device(&file.device, &resolved.device);
        let is_new = |key: &String| !before.contains_key(key);
        let mut taken: BTreeMap<_, _> =
            leaves(&kept, &kept_device).into_iter().filter(|(key, _)| is_new(key)).collect();
        let offered = leaves(&own, &file.device).into_keys().filter(|key| is_new(key));
        let mut unused: Vec<_> = offered.filter(|key| !taken.contains_key(key)).collect();
        let integrator = file.settings.integrator.filter(|_| offers(file));
        match integrator {
            Some(name) if chosen == Some(k) => drop(taken.insert("integrator".into(), name.name().into())),
            Some(_) if chosen.is_none_or(|c| c < k) => unused.push("integrator".into()),
            _ => {}
        }
        resolved.settings = kept.overridden_by(&resolved.settings);
        let mut device = kept_device;
        device.override_with(&resolved.device);
        resolved.device = device;
        resolved.reports.push(DefaultsReport { file: file.path.clone(), settings: taken, unused });
    }
    resolved.reports.reverse();
    resolved
}

/// The settings of `own` that hold together with those `above`, which replace them.
fn holding_settings(
    own: &RenderSettings,
    above: &RenderSettings,
    holds: &dyn Fn(&RenderSettings) -> bool,
) -> RenderSettings {
    if holds(&own.overridden_by(above)) {
        return own.clone();
    }
    let names: Vec<_> = own.given().iter().map(|s| s.name).filter(|name| !is_camera(name)).collect();
    // position and target of a camera mean nothing alone
    let camera = RenderSettings { camera: own.camera.clone(), ..Default::default() };
    let single = |name: &&str| {
        let mut one = own.clone();
        one.retain(&|n| n == *name);
        one
    };
    let parts = std::iter::once(camera).chain(names.iter().map(single));
    parts.fold(RenderSettings::default(), |kept, part| {
        let candidate = kept.overridden_by(&part);
        if holds(&candidate.overridden_by(above)) { candidate } else { kept }
    })
}

fn is_camera(name: &str) -> bool {
    let mut all = CameraSettings::default();
    all.editable().iter().any(|s| s.name == name)
}

/// The settings of `own` that hold with those `above`; none chooses the compute tracer by itself.
fn holding_device(own: &DeviceSettings, above: &DeviceSettings) -> DeviceSettings {
    let holds = |device: &DeviceSettings| {
        let chooses = above.compute_only_option().is_none() && device.compute_only_option().is_some();
        device.check().is_ok() && (!chooses || device.is_compute())
    };
    own.given().iter().fold(DeviceSettings::default(), |kept, setting| {
        let mut candidate = own.clone();
        candidate.retain(&|name, _| name == setting.name || kept.given().iter().any(|k| k.name == name));
        let mut all = candidate.clone();
        all.override_with(above);
        if holds(&all) { candidate } else { kept }
    })
}

/// Every setting that is given, by its keys: `image.spp`.
fn leaves(settings: &RenderSettings, device: &DeviceSettings) -> BTreeMap<String, Value> {
    fn add(out: &mut BTreeMap<String, Value>, key: &str, value: Value) {
        match value {
            Value::Object(map) => {
                let dot = if key.is_empty() { "" } else { "." };
                map.into_iter().for_each(|(name, value)| add(out, &format!("{key}{dot}{name}"), value));
            }
            Value::Null => {}
            value => {
                out.insert(key.to_owned(), value);
            }
        }
    }
    let mut out = BTreeMap::new();
    // maps of plain values: writing them does not fail
    add(&mut out, "", serde_json::to_value(settings).unwrap_or_default());
    add(&mut out, "device", serde_json::to_value(device).unwrap_or_default());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, text: &str) -> DefaultsFile {
        DefaultsFile::parse(Path::new(name), text).unwrap()
    }

    fn words(line: &str) -> RenderSettings {
        RenderSettings::from_words(line).unwrap()
    }

    /// Settings that `render` would accept, of the same kind as `line`.
    fn resolved(files: &[DefaultsFile], line: &str) -> Resolved {
        let given = words(line);
        let is_frames = given.realtime_setting().is_some();
        let holds = |s: &RenderSettings| s.realtime_setting().is_some() == is_frames && s.check().is_ok();
        resolve(files, &given, &DeviceSettings::default(), &holds)
    }

    #[test]
    fn only_files_have_a_folder() {
        let environment = |text: &str| {
            let file = file("/u/skylit.toml", &format!("[lighting]\nenvironment = \"{text}\""));
            file.settings.lighting.environment.unwrap()
        };
        for text in ["none", "1,2,3", "sky", "sky:20,90"] {
            assert_eq!(environment(text), text);
        }
        assert_eq!(environment("./sky"), "/u/./sky");
        let wrong = DefaultsFile::parse(Path::new("/u/skylit.toml"), "[lighting]\nenvironment = \"sky:99\"");
        assert!(wrong.unwrap_err().to_string().contains("elevation '99'"));
    }

    #[test]
    fn later_files_and_options_replace_earlier_files() {
        let user = file(
            "/u/skylit.toml",
            "integrator = \"path\"\n[image]\nspp = 4\nseed = 1\nsize = [64, 48]\n[integrators.ao]\nao_radius = 2",
        );
        let scene = file(
            "/s/skylit.toml",
            "[image]\nspp = 8\nseed = 2\n[lighting]\nenvironment = \"sky.hdr\"\n[frames]\nhistory = 8",
        );
        let files = [user, scene];
        let r = resolved(&files, "--seed 3");
        let expected = words("path --spp 8 --seed 3 --size 64x48 --environment /s/sky.hdr");
        assert_eq!(r.settings, expected);
        assert_eq!(r.reports[0].settings.keys().collect::<Vec<_>>(), ["image.size", "integrator"]);
        // an option of another integrator, and one that frames in real time alone have
        assert_eq!(r.reports[0].unused, ["integrators.ao.ao_radius"]);
        assert_eq!(r.reports[1].unused, ["frames.history"]);
        assert_eq!(
            r.reports[1].line().unwrap(),
            "defaults from /s/skylit.toml: image.spp = 8, lighting.environment = \"/s/sky.hdr\"; without effect here: frames.history"
        );
        // frames are of the same integrator, and have no samples per pixel
        let r = resolved(&files, "fast");
        let expected = words("fast --integrator path --history 8 --seed 2 --size 64x48 --environment /s/sky.hdr");
        assert_eq!(r.settings, expected);
        // a default of another integrator does not decide which it is
        let radius = file("/s/skylit.toml", "[integrators.ao]\nao_radius = 1");
        let r = resolved(&[files[0].clone(), radius], "");
        assert_eq!(
            (r.settings.integrator().name(), r.reports[1].unused.as_slice()),
            ("path", &["integrators.ao.ao_radius".to_owned()][..])
        );
        // an option that says more than the default of another
        let r = resolved(&files, "--ao-radius inf");
        assert_eq!((r.settings.integrator, r.settings.integrators.ao.radius()), (None, f64::INFINITY));
    }

    #[test]
    fn a_default_that_does_not_go_together_is_left_out() {
        let files = [file(
            "/u/skylit.toml",
            "[camera]\neye = [1, 2, 3]\ntarget = [0, 0, 0]\n[frames]\nhistory = 4\norbit = 9\n",
        )];
        let r = resolved(&files, "--camera 1");
        assert_eq!((r.settings.camera.camera.as_deref(), r.settings.camera.eye), (Some("1"), None));
        let r = resolved(&files, "fast --camera-path p.toml");
        assert_eq!((r.settings.frames.orbit, r.settings.camera.eye, r.settings.frames.history), (None, None, Some(4)));
    }

    #[test]
    fn samples_per_pixel_and_a_quality_replace_each_other() {
        let spp = file("/u/skylit.toml", "[image]\nspp = 8");
        let quality = file("/s/skylit.toml", "[film]\nquality = \"good\"");
        let both = [spp.clone(), quality.clone()];
        assert_eq!(resolved(&both, "").settings, words("--quality good"));
        assert_eq!(resolved(&[quality.clone(), spp], "").settings, words("--spp 8"));
        assert_eq!(resolved(&both, "--spp 4").settings, words("--spp 4"));
        // a default makes no stills of frames in real time
        let r = resolved(&both, "--orbit");
        assert_eq!((r.settings.film.quality, r.settings.image.spp), (None, None));
        assert!(r.settings.realtime_setting().is_some());
    }

    #[test]
    fn options_of_the_compute_tracer_do_not_choose_it() {
        let files = [file("/u/skylit.toml", "[device]\nbvh_cache = \"bvh\"\nvalidation = true")];
        let none = RenderSettings::default();
        let device = |tracer: Option<&str>| {
            let tracer =
                tracer.map(|t| <crate::tracer::settings::TracerChoice as clap::ValueEnum>::from_str(t, false).unwrap());
            resolve(&files, &none, &DeviceSettings { tracer, ..Default::default() }, &|_| true).device
        };
        assert_eq!((device(None).bvh_cache, device(None).validation), (None, true));
        assert_eq!(device(Some("compute")).bvh_cache, Some("/u/bvh".into()));
        assert_eq!(device(Some("query")).bvh_cache, None);
    }

    #[test]
    fn a_scene_chooses_how_it_looks_and_no_more() {
        let allowed = "integrator = \"path\"\n[image]\nspp = 4\nsize = [8, 8]\nseed = 1\npixel_filter = \"box\"\n[camera]\neye = [1, 2, 3]\ntarget = [0, 0, 0]\n\
            [integrators.ao]\nao_radius = 1\n[lighting]\nenvironment = \"sky.hdr\"\n[picture]\nexposure = 1\n[film]\ntarget_rmse = 0.1\nquality = \"good\"\n[frames]\nhistory = 4";
        assert!(file("/s/skylit.toml", allowed).check_scene_settings().is_ok());
        for (text, key) in [
            ("[device]\nbvh_cache = \".\"", "device.bvh_cache"),
            ("[device]\ndevice = \"1\"", "device.device"),
            ("[device]\nvalidation = true", "device.validation"),
            ("[film]\nintervals = true", "film.intervals"),
            ("[film]\nresume = \"a.exr\"", "film.resume"),
            ("[film]\nresumable = true", "film.resumable"),
            ("[image]\ndenoise = \"oidn\"", "image.denoise"),
            ("[image]\naov = [\"depth\"]", "image.aov"),
            ("[image]\ntime_limit = 1", "image.time_limit"),
        ] {
            let error = file("/s/skylit.toml", text).check_scene_settings().unwrap_err();
            let message = error.to_string();
            assert!(message.contains(key) && message.contains("--no-config") && !message.contains('\n'), "{message}");
            assert_eq!(error.exit_code(), 3);
        }
    }

    #[test]
    fn errors_name_the_key() {
        for (text, says) in [
            ("[image]\nsppp = 3", "unknown field `sppp`"),
            ("spp = 3", "unknown field `spp`"),
            ("[device]\ntracr = \"query\"", "unknown field `tracr`"),
            ("[image]\nspp = 0", "'--spp <SPP>'"),
            ("[camera]\neye = [1, 2, 3]", "--target"),
            ("[image\n", "line 1: "),
            ("[image]\nspp = \"many\"", "many"),
        ] {
            let error = DefaultsFile::parse(Path::new("dir/skylit.toml"), text).unwrap_err();
            let message = error.to_string();
            assert!(
                message.starts_with("dir/skylit.toml: ") && message.contains(says) && !message.contains('\n'),
                "{message}"
            );
            assert_eq!(error.exit_code(), 3);
        }
    }
}
