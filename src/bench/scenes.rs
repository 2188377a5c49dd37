//! Default scenes of benchmarks: built-in ones, and well-known files where these are there.

use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::error::{Error, Result};
use crate::files;
use crate::film::camera::Choice;
use crate::scene::{Camera, Environment, EnvironmentMap, builtin, load};

/// The map with a sun in it, below the folder of shared scenes.
const SUN_MAP: &str = "env/spruit_sunrise_1k.hdr";

/// A perspective camera.
#[derive(Clone, Copy, Debug)]
pub struct LookAt {
    pub eye: [f64; 3],
    pub target: [f64; 3],
    /// Vertical field of view, degrees.
    pub fov_y: f64,
}

impl LookAt {
    /// As the option `--camera` would have it.
    pub fn choice(&self) -> Choice {
        let fov_y = self.fov_y.to_radians();
        Choice::LookAt { eye: self.eye.into(), target: self.target.into(), up: DVec3::Y, fov_y }
    }

    pub fn camera(&self) -> Camera {
        Camera::look_at(self.eye.into(), self.target.into(), DVec3::Y, self.fov_y.to_radians())
    }
}

/// A file that many measure with.
#[derive(Debug)]
pub struct WellKnownScene {
    /// Below the folder of shared scenes.
    pub path: &'static str,
    /// Camera of `bench rays` and `bench path`; `None`: as `render` would choose.
    pub view: Option<LookAt>,
    /// Near camera of `bench ao`.
    pub near: LookAt,
    /// Far camera of `bench ao`.
    pub far: LookAt,
    /// How far occlusion reaches in `bench ao`, scene units.
    pub reach: f64,
    /// Length of the ambient occlusion rays of `bench rays`, scene units; may be infinite.
    pub ao_radius: f64,
    /// Point light of the shadow rays of `bench rays`; `None`: as for any scene.
    pub point_light: Option<[f64; 3]>,
    /// Light of `bench path` as `--light` takes it, where the scene has none.
    pub area_light: Option<&'static str>,
    /// It is put on a plane in `bench ao`.
    pub on_plane: bool,
}

/// A scene that is seen and lit as any other.
const fn known(path: &'static str, near: LookAt, far: LookAt, reach: f64) -> WellKnownScene {
    let (view, point_light, area_light) = (None, None, None);
    let ao_radius = f64::INFINITY;
    WellKnownScene { path, view, near, far, reach, ao_radius, point_light, area_light, on_plane: false }
}

const fn look(eye: [f64; 3], target: [f64; 3], fov_y: f64) -> LookAt {
    LookAt { eye, target, fov_y }
}

pub const SPONZA: WellKnownScene = WellKnownScene {
    view: Some(SPONZA_NAVE),
    ao_radius: 60.0,
    // hanging in the nave: from outside, nothing of the view is lit
    point_light: Some([30.0, 70.0, -5.0]),
    // above the view: an image of a lamp has all of its error in the few pixels of the lamp's edge
    area_light: Some("sphere position=-60,95,-5 radius=4 radiance=400"),
    ..known("sponza/sponza.glb", SPONZA_NAVE, SPONZA_COURT, 60.0)
};

/// Along the nave, from inside.
const SPONZA_NAVE: LookAt = look([-120.0, 20.0, -5.0], [50.0, 35.0, 0.0], 70.0);
/// Into the courtyard, from above its roof.
const SPONZA_COURT: LookAt = look([20.0, 330.0, 60.0], [-5.0, 20.0, -4.0], 45.0);

pub const DRAGON: WellKnownScene = WellKnownScene {
    view: Some(look([0.065, 0.1857, 0.198], [-0.0059, 0.125, -0.0046], 45.0)),
    ..known("dragon/dragon.glb", DRAGON_NEAR, DRAGON_FAR, 0.1)
};

const DRAGON_NEAR: LookAt = look([0.03, 0.165, 0.12], [-0.012, 0.128, 0.0], 45.0);
const DRAGON_FAR: LookAt = look([0.12, 0.24, 0.38], [-0.006, 0.125, -0.005], 45.0);

pub const BUNNY: WellKnownScene =
    WellKnownScene { on_plane: true, ..known("bunny/bunny.glb", BUNNY_NEAR, BUNNY_FAR, 0.1) };

const BUNNY_NEAR: LookAt = look([0.01, 0.14, 0.115], [-0.02, 0.105, 0.0], 45.0);
const BUNNY_FAR: LookAt = look([0.15, 0.27, 0.42], [-0.017, 0.095, 0.0], 45.0);

pub const FLIGHT_HELMET: WellKnownScene = known("flight_helmet/FlightHelmet.gltf", HELMET_NEAR, HELMET_FAR, 0.3);

const HELMET_NEAR: LookAt = look([0.1, 0.52, 0.4], [-0.03, 0.46, 0.05], 45.0);
const HELMET_FAR: LookAt = look([0.45, 0.75, 1.25], [-0.02, 0.35, 0.01], 45.0);

pub const WELL_KNOWN: [&WellKnownScene; 4] = [&SPONZA, &DRAGON, &BUNNY, &FLIGHT_HELMET];

impl WellKnownScene {
    /// The one of `scenes` that a file is, by its name and its folder's: many are called scene.glb.
    pub fn find(scenes: &[&'static Self], source: &str) -> Option<&'static Self> {
        let tail = |path: &Path| path.components().rev().take(2).map(|c| c.as_os_str().to_owned()).collect::<Vec<_>>();
        // a path without a folder has one all the same
        let file = std::path::absolute(source).unwrap_or_else(|_| PathBuf::from(source));
        let file = tail(&file);
        scenes.iter().find(|s| tail(Path::new(s.path)) == file).copied()
    }
}

/// Scenes to measure.
#[derive(Debug, Default)]
pub struct SceneList {
    pub sources: Vec<String>,
    /// Scenes of the default list that are unavailable.
    pub notes: Vec<String>,
}

impl SceneList {
    /// These, and nothing else.
    pub fn from_sources<S: AsRef<str>>(sources: &[S]) -> Self {
        Self { sources: sources.iter().map(|s| s.as_ref().to_owned()).collect(), notes: Vec::new() }
    }

    /// The well-known scenes of `scenes` whose files exist.
    pub fn well_known(scenes: &[&WellKnownScene]) -> Self {
        let folder = shared_folder();
        let (present, absent): (Vec<PathBuf>, Vec<PathBuf>) =
            scenes.iter().map(|k| folder.join(k.path)).partition(|p| p.is_file());
        let note =
            |p: &PathBuf| format!("{}: file not found, skipped (set SKYLIT_SHARED_SCENES to its folder)", p.display());
        Self {
            sources: present.iter().map(|p| p.display().to_string()).collect(),
            notes: absent.iter().map(note).collect(),
        }
    }

    /// Two lists, one after the other.
    pub fn then(mut self, other: Self) -> Self {
        self.sources.extend(other.sources);
        self.notes.extend(other.notes);
        self
    }
}

/// Fails for a scene that does not exist, or for a wrong parameter of a built-in one.
pub fn check_exists(source: &str) -> Result<()> {
    if files::has_extension(Path::new(source), "json") {
        return Err(Error::Usage(format!(
            "{source}: a JSON file is no scene; to write the record there, use --json={source}"
        )));
    }
    let made = builtin::exists(source.strip_prefix("builtin:").unwrap_or(source));
    if made || (Path::new(source).exists() && !source.starts_with("builtin:")) {
        return Ok(());
    }
    // says what is wrong with it
    load::load(source).map(drop)
}

/// Name of a scene in tables: well-known scenes have that of their file.
pub fn table_name(known: &[&'static WellKnownScene], source: &str) -> String {
    let stem = WellKnownScene::find(known, source).and_then(|_| Path::new(source).file_stem());
    stem.map_or_else(|| source.to_owned(), |s| s.to_string_lossy().into_owned())
}

/// An environment in words; one that is black as `black`.
pub fn environment_text(environment: &Environment, black: &str) -> String {
    match environment {
        Environment::Black => black.to_owned(),
        Environment::Uniform(c) => format!("constant environment {},{},{}", c.x, c.y, c.z),
        Environment::Map(map) => format!("{} ({}x{})", map.name, map.width, map.height),
    }
}

/// Where the well-known scenes are.
pub fn shared_folder() -> PathBuf {
    std::env::var_os("SKYLIT_SHARED_SCENES").map_or_else(|| Path::new("../shared/scenes").to_owned(), PathBuf::from)
}

/// An environment map with a sun: the given one, the shared one if there and not `quick`, or ours.
pub fn sun_map(given: Option<&Path>, quick: bool) -> Result<EnvironmentMap> {
    let shared = shared_folder().join(SUN_MAP);
    match given {
        Some(path) => load::load_environment(path),
        None if shared.is_file() && !quick => load::load_environment(&shared),
        None => Ok(builtin::sun_map::sun_map()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn well_known_scenes_by_folder_and_name() {
        let found = |source: &str| WellKnownScene::find(&WELL_KNOWN, source).map(|k| k.path);
        assert_eq!(found("../shared/scenes/sponza/sponza.glb"), Some("sponza/sponza.glb"));
        assert_eq!(found("dragon/dragon.glb"), Some("dragon/dragon.glb"));
        for other in ["sponza.glb", "mine/sponza.glb", "sponza/sponza.gltf", "builtin:plane", "dragon", ""] {
            assert_eq!(found(other), None, "{other}");
        }
    }

    #[test]
    fn parameters_are_checked_before_anything_is_made() {
        for there in ["plane", "builtin:terrain:1000", "builtin:terrain:100000000"] {
            assert!(check_exists(there).is_ok(), "{there}");
        }
        for (absent, code) in
            [("builtin:terrain:1", 64), ("builtin:grid:1000", 64), ("builtin:plane:3", 64), ("terrain:x", 3)]
        {
            assert_eq!(check_exists(absent).unwrap_err().exit_code(), code, "{absent}");
        }
    }
}
