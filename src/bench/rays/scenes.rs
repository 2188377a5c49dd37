//! Scenes of `skylit bench rays`, from where they are seen, and where their light is.

use glam::DVec3;

use crate::bench::scenes::{SceneList, WELL_KNOWN, WellKnownScene};
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::scene::{AlphaMode, Camera, Scene, load};

/// Towards the light, from the middle of the scene: low enough for long shadows.
const TOWARDS_LIGHT: DVec3 = DVec3::new(0.75, 0.45, 0.5);

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

const QUICK: [&str; 5] = [
    "builtin:terrain:1000",
    "builtin:terrain:10000",
    "builtin:terrain:100000",
    "builtin:spheres:1000",
    "builtin:instances:25000",
];

/// Scenes to measure: those that are named, else the default ones; fewer if it is to be `quick`.
pub fn choose(named: &[String], quick: bool) -> SceneList {
    match named {
        [] if quick => SceneList::from_sources(&QUICK),
        [] => SceneList::well_known(&WELL_KNOWN).then(SceneList::from_sources(&BUILTIN)),
        named => SceneList::from_sources(named),
    }
}

pub struct RayScene {
    pub scene: Scene,
    pub camera: Camera,
    /// Length of ambient occlusion rays, scene units; may be infinite.
    pub ao_radius: f64,
    /// Point light of the shadow rays, world coordinates.
    pub light: DVec3,
    /// The well-known scene whose view and light these are, if they are not those of any scene.
    pub well_known: Option<&'static str>,
}

/// Loads a scene and chooses its view. `keep_alpha`: alpha masks do not count as opaque;
/// `ao_radius`: instead of the scene's.
pub fn load(source: &str, keep_alpha: bool, ao_radius: Option<f64>, aspect: f64) -> Result<RayScene> {
    let mut scene = load::load(source)?;
    if !keep_alpha {
        scene.materials.iter_mut().for_each(|m| m.alpha_mode = AlphaMode::Opaque);
    }
    let known = WellKnownScene::find(&WELL_KNOWN, source);
    let choice = known.and_then(|k| k.view).map_or(Choice::Auto, |view| view.choice());
    let camera = camera::choose(&scene, &choice, aspect)?;
    let ao_radius = ao_radius.or(known.map(|k| k.ao_radius)).unwrap_or(f64::INFINITY);
    let (lo, hi) = scene.bounds().unwrap_or_default();
    // outside of the scene, near enough to make rays of different directions
    let outside = || (lo + hi) * 0.5 + TOWARDS_LIGHT.normalize() * (hi - lo).length();
    let light = known.and_then(|k| k.point_light).map_or_else(outside, DVec3::from);
    let well_known = known.filter(|k| k.view.is_some() || k.point_light.is_some()).map(|k| k.path);
    Ok(RayScene { scene, camera, ao_radius, light, well_known })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::scenes::check_exists;

    #[test]
    fn built_in_scenes_exist() {
        for source in QUICK.iter().chain(&BUILTIN) {
            assert!(check_exists(source).is_ok(), "{source}");
        }
    }
}
