//! Which scenes are measured, what lights them, from where they are seen, and what the moving camera goes round.

use std::path::Path;

use glam::DVec3;

use super::args::BenchFramesArgs;
use crate::bench::scenes::{FLIGHT_HELMET, SPONZA, SceneList, WELL_KNOWN, WellKnownScene, check_exists, sun_map};
use crate::error::{Error, Result};
use crate::film::camera::{self, Choice};
use crate::integrators::Integrator;
use crate::scene::{Camera, Environment, Scene, light_spec, load};
use crate::settings::Capability;

/// The built-in atrium at night, with one lamp.
const INTERIOR: &str = "interior";
/// Its lamp: a small emitter.
const LAMP: &str = "sphere position=-4,2.6,0.6 radius=0.12 radiance=600";
/// Built-in scenes of the default list.
const BUILTIN: [&str; 5] =
    ["builtin:cornell-box", "builtin:cornell-mirror", "builtin:cornell-glass-sphere", INTERIOR, "builtin:parade"];
/// With `--quick`.
const QUICK: [&str; 2] = ["builtin:cornell-box", "builtin:parade"];
/// Well-known scenes of the default list.
const FILES: [&WellKnownScene; 2] = [&SPONZA, &FLIGHT_HELMET];
/// Material of the surface that covers Sponza's court: it is left out, so that the sun gets in.
const COVER: &str = "None";
/// How far ahead of a camera inside of its scene the point is that it goes round, diagonals of the scene's bounds: it is to stay clear of walls.
const AHEAD: f64 = 0.05;

/// Scenes to measure.
pub fn choose(args: &BenchFramesArgs) -> SceneList {
    match args.scenes.as_slice() {
        [] if args.common.quick => SceneList::of(&QUICK),
        [] => SceneList::of(&BUILTIN).then(SceneList::well_known(&FILES)),
        named => SceneList::of(named),
    }
}

/// Fails for a scene that is not there.
///
/// # Errors
/// Those of [`check_exists`].
pub fn check(source: &str) -> Result<()> {
    if source == INTERIOR { Ok(()) } else { check_exists(source) }
}

/// A scene ready to be measured.
pub struct FramesScene {
    /// In tables.
    pub name: String,
    /// The scene, lit.
    pub scene: Scene,
    /// From where it is seen.
    pub camera: Camera,
    /// What the moving camera goes round.
    pub middle: DVec3,
    /// What lights it, in words.
    pub light: String,
    /// How far ambient occlusion reaches, scene units.
    pub reach: f64,
}

/// Length of occlusion rays, diagonals of the bounds.
const REACH: f64 = 0.25;

/// Loads a scene, lights it where it is dark, and chooses its view.
///
/// # Errors
/// Those of loading the scene or the environment.
pub fn load(source: &str, args: &BenchFramesArgs) -> Result<FramesScene> {
    let is_interior = source == INTERIOR;
    let mut scene = load::load(if is_interior { "builtin:atrium" } else { source })?;
    let known = WellKnownScene::find(&WELL_KNOWN, source);
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene(format!("{source}: nothing to look at: no geometry")))?;
    if known.is_some_and(|k| k.path == SPONZA.path) {
        let Scene { instances, meshes, materials, .. } = &mut scene;
        instances.retain(|i| materials[meshes[i.mesh].material].name != COVER);
    }
    let light = light(&mut scene, is_interior, args)?;
    let choice = known.map_or(Choice::Auto, |k| k.near.choice());
    let camera = camera::choose(&scene, &choice, args.aspect())?;
    let to_world = camera.camera_to_world;
    let eye = to_world.translation;
    let diagonal = (hi - lo).length();
    let is_inside = eye.cmpgt(lo).all() && eye.cmplt(hi).all();
    let middle = match known.filter(|_| !is_inside) {
        Some(known) => known.near.target.into(),
        None if is_inside => eye - to_world.matrix3.z_axis.normalize_or_zero() * (AHEAD * diagonal),
        None => (lo + hi) * 0.5,
    };
    let reach = known.map_or(REACH * diagonal, |k| k.reach);
    Ok(FramesScene { name: name(source), scene, camera, middle, light, reach })
}

/// Lights a scene that is dark. Returns what lights it, in words.
fn light(scene: &mut Scene, is_interior: bool, args: &BenchFramesArgs) -> Result<String> {
    let integrator: &dyn Integrator = args.integrator.get();
    if !integrator.capabilities().contains(&Capability::SceneLights) {
        return Ok("none, it is not seen".into());
    }
    if is_interior {
        light_spec::parse(LAMP).map_err(Error::Usage)?.add(scene);
        return Ok("a lamp".into());
    }
    if scene.is_dark() || args.environment.is_some() {
        scene.environment = Environment::Map(sun_map(args.environment.as_deref(), args.common.quick)?);
    }
    Ok(match &scene.environment {
        Environment::Black => "its own".to_owned(),
        Environment::Uniform(c) => format!("constant environment {},{},{}", c.x, c.y, c.z),
        Environment::Map(map) => format!("{} ({}x{})", map.name, map.width, map.height),
    })
}

/// In tables.
fn name(source: &str) -> String {
    let stem = WellKnownScene::find(&WELL_KNOWN, source).and_then(|_| Path::new(source).file_stem());
    stem.map_or_else(|| source.to_owned(), |s| s.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Alone {
        #[command(flatten)]
        args: BenchFramesArgs,
    }

    #[test]
    fn every_scene_is_lit_and_has_something_to_go_round() {
        let args = Alone::try_parse_from(["bench", "--quick"]).unwrap().args;
        for source in [INTERIOR, "builtin:parade", "builtin:cornell-box"] {
            check(source).unwrap();
            let loaded = load(source, &args).unwrap();
            assert!(!loaded.scene.is_dark(), "{source}");
            let eye = loaded.camera.camera_to_world.translation;
            assert!(eye.distance(loaded.middle) > 0.1, "{source}");
        }
        let interior = load(INTERIOR, &args).unwrap();
        assert!(interior.scene.environment == Environment::Black && interior.light == "a lamp");
        // in the court, clear of its columns
        assert!(interior.middle.distance(interior.camera.camera_to_world.translation) < 6.0);
    }
}
