//! Which scenes are measured, and from where they are looked at.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::rays::BenchRaysArgs;
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::scene::{AlphaMode, Camera, Scene, builtin, load};

/// A view of a scene that many measure with.
struct View {
    eye: [f64; 3],
    target: [f64; 3],
    /// Degrees.
    fov_y: f64,
}

/// A file that many measure with.
struct Known {
    /// Below the folder of shared scenes.
    path: &'static str,
    /// `None`: as `render` would.
    view: Option<View>,
    /// Length of its ambient occlusion rays, world units.
    ao_radius: f64,
    /// Where the light of its shadow rays is; `None`: as for any scene.
    light: Option<[f64; 3]>,
}

/// Towards the light, from the middle of the scene: low enough for long shadows.
const TOWARDS_LIGHT: DVec3 = DVec3::new(0.75, 0.45, 0.5);

const KNOWN: [Known; 4] = [
    Known {
        path: "sponza/sponza.glb",
        // along the nave, from inside
        view: Some(View { eye: [-120.0, 20.0, -5.0], target: [50.0, 35.0, 0.0], fov_y: 70.0 }),
        ao_radius: 60.0,
        // a lamp that hangs in the nave: from outside, nothing of the view is lit
        light: Some([30.0, 70.0, -5.0]),
    },
    Known {
        path: "dragon/dragon.glb",
        view: Some(View { eye: [0.065, 0.1857, 0.198], target: [-0.0059, 0.125, -0.0046], fov_y: 45.0 }),
        ao_radius: f64::INFINITY,
        light: None,
    },
    Known { path: "bunny/bunny.glb", view: None, ao_radius: f64::INFINITY, light: None },
    Known { path: "flight_helmet/FlightHelmet.gltf", view: None, ao_radius: f64::INFINITY, light: None },
];

/// Built-in scenes of the default list.
const BUILTIN: [&str; 9] = [
    "builtin:terrain:10000",
    "builtin:terrain:100000",
    "builtin:terrain:1000000",
    "builtin:terrain:10000000",
    "builtin:spheres:10000",
    "builtin:spheres:100000",
    "builtin:spheres:1000000",
    "builtin:spheres:10000000",
    "builtin:instances:25000000",
];

/// With `--quick`.
const QUICK: [&str; 5] = [
    "builtin:terrain:1000",
    "builtin:terrain:10000",
    "builtin:terrain:100000",
    "builtin:spheres:1000",
    "builtin:instances:25000",
];

/// What to measure, and what of the default list is not there.
pub fn choose(args: &BenchRaysArgs) -> (Vec<String>, Vec<String>) {
    if !args.scenes.is_empty() {
        return (args.scenes.clone(), Vec::new());
    }
    if args.common.quick {
        return (QUICK.map(str::to_owned).to_vec(), Vec::new());
    }
    let folder = folder();
    let (there, absent): (Vec<PathBuf>, Vec<PathBuf>) = KNOWN.iter().map(|k| folder.join(k.path)).partition(|p| p.is_file());
    let notes = absent.iter().map(|p| format!("{}: not here, left out (SKYLIT_SHARED_SCENES names its folder)", p.display()));
    let scenes = there.iter().map(|p| p.display().to_string()).chain(BUILTIN.map(str::to_owned));
    (scenes.collect(), notes.collect())
}

/// Fails for a scene that is not there, or that no built-in scene becomes with its parameter, without loading those that are.
pub fn check_there(source: &str) -> Result<()> {
    let made = builtin::exists(source.strip_prefix("builtin:").unwrap_or(source));
    if made || (Path::new(source).exists() && !source.starts_with("builtin:")) {
        return Ok(());
    }
    // says what is wrong with it
    load::load(source).map(drop)
}

/// Where the well-known scenes are.
pub(super) fn folder() -> PathBuf {
    std::env::var_os("SKYLIT_SHARED_SCENES").map_or_else(|| Path::new("../shared/scenes").to_owned(), PathBuf::from)
}

/// A scene ready to be measured.
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// From where it is looked at.
    pub camera: Camera,
    /// Length of ambient occlusion rays, world units; may be infinite.
    pub ao_radius: f64,
    /// Point light of the shadow rays, world coordinates.
    pub light: DVec3,
    /// The well-known scene whose view and light these are, if they are not those of any scene.
    pub view: Option<&'static str>,
}

/// Loads a scene and chooses its view.
pub fn load(source: &str, args: &BenchRaysArgs, aspect: f64) -> Result<Subject> {
    let mut scene = load::load(source)?;
    if !args.alpha {
        scene.materials.iter_mut().for_each(|m| m.alpha_mode = AlphaMode::Opaque);
    }
    let known = known(source);
    let choice = match known.and_then(|k| k.view.as_ref()) {
        Some(v) => Choice::LookAt { eye: v.eye.into(), target: v.target.into(), up: DVec3::Y, fov_y: v.fov_y.to_radians() },
        None => Choice::Auto,
    };
    let camera = camera::choose(&scene, &choice, aspect)?;
    let ao_radius = args.ao_radius.or(known.map(|k| k.ao_radius)).unwrap_or(f64::INFINITY);
    let (lo, hi) = scene.bounds().unwrap_or_default();
    // outside of the scene, near enough to make rays of different directions
    let outside = || (lo + hi) * 0.5 + TOWARDS_LIGHT.normalize() * (hi - lo).length();
    let light = known.and_then(|k| k.light).map_or_else(outside, DVec3::from);
    let view = known.filter(|k| k.view.is_some() || k.light.is_some()).map(|k| k.path);
    Ok(Subject { scene, camera, ao_radius, light, view })
}

/// The well-known scene that a file is, by its name and that of its folder: there are many a scene.glb.
fn known(source: &str) -> Option<&'static Known> {
    KNOWN.iter().find(|k| is_file(source, k.path))
}

/// Do a file and its folder have the names of `path`'s?
pub(super) fn is_file(source: &str, path: &str) -> bool {
    let tail = |path: &Path| path.components().rev().take(2).map(|c| c.as_os_str().to_owned()).collect::<Vec<_>>();
    // a path without a folder has one all the same
    let source = std::path::absolute(source).unwrap_or_else(|_| PathBuf::from(source));
    tail(Path::new(path)) == tail(&source)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn well_known_scenes_by_folder_and_name() {
        let found = |source: &str| known(source).map(|k| k.path);
        assert_eq!(found("../shared/scenes/sponza/sponza.glb"), Some("sponza/sponza.glb"));
        assert_eq!(found("dragon/dragon.glb"), Some("dragon/dragon.glb"));
        for other in ["sponza.glb", "mine/sponza.glb", "sponza/sponza.gltf", "builtin:plane", "dragon", ""] {
            assert_eq!(found(other), None, "{other}");
        }
    }

    #[test]
    fn parameters_are_checked_before_anything_is_made() {
        for there in QUICK.iter().chain(&BUILTIN).chain(&["plane", "builtin:terrain:100000000"]) {
            assert!(check_there(there).is_ok(), "{there}");
        }
        for (absent, code) in [("builtin:terrain:1", 64), ("builtin:grid:1000", 64), ("builtin:plane:3", 64), ("terrain:x", 3)]
        {
            assert_eq!(check_there(absent).unwrap_err().exit_code(), code, "{absent}");
        }
    }
}
