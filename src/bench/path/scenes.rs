//! Which scenes are measured, what lights them, and from where they are seen.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::args::BenchPathArgs;
use crate::bench::scenes::{FLIGHT_HELMET, SPONZA, SceneList, WellKnownScene, check_exists, shared_folder};
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::scene::builtin::shapes;
use crate::scene::light_spec;
use crate::scene::material::MaterialKind;
use crate::scene::{Camera, Environment, EnvironmentMap, Instance, Material, Mesh, Scene, load};

/// The map with a sun in it, below the folder of shared scenes.
const SUN_MAP: &str = "env/spruit_sunrise_1k.hdr";
/// Pixels of our own map: a texel is 0.7 degrees, about the sun.
const OWN_MAP: [u32; 2] = [512, 256];

/// Well-known scenes that are measured.
const FILES: [&WellKnownScene; 2] = [&FLIGHT_HELMET, &SPONZA];

/// A sphere under the sun map.
struct Ball {
    name: &'static str,
    kind: MaterialKind,
    metallic: f32,
    roughness: f32,
    color: f32,
}

/// The cases at which sampling without importance fails (Zetti 2024).
const BALLS: [Ball; 4] = [
    Ball { name: "sphere-diffuse", kind: MaterialKind::Matte, metallic: 0.0, roughness: 1.0, color: 0.8 },
    Ball { name: "sphere-metal", kind: MaterialKind::MetallicRoughness, metallic: 1.0, roughness: 0.1, color: 0.9 },
    Ball { name: "sphere-mirror", kind: MaterialKind::MetallicRoughness, metallic: 1.0, roughness: 0.0, color: 1.0 },
    Ball { name: "sphere-glass", kind: MaterialKind::Glass, metallic: 0.0, roughness: 0.0, color: 1.0 },
];
/// Of the default list: a caustic of the sun through glass is what nobody here finds.
const DEFAULT_BALLS: usize = 3;

/// The built-in Cornell box, all of it Lambert's: engines agree about it to the last digit that noise lets them see.
const CORNELL: &str = "cornell";

/// Scenes to measure.
pub fn choose(args: &BenchPathArgs) -> SceneList {
    let balls = |count: usize| SceneList::of(&BALLS[..count].iter().map(|b| b.name).collect::<Vec<_>>());
    let cornell = SceneList::of(&[CORNELL]);
    match args.scenes.as_slice() {
        [] if args.common.quick => cornell.then(balls(1)),
        [] => cornell.then(SceneList::well_known(&FILES)).then(balls(DEFAULT_BALLS)),
        named => SceneList::of(named),
    }
}

/// Fails for a scene that is not there.
pub fn check(source: &str) -> Result<()> {
    let own = source == CORNELL || BALLS.iter().any(|b| b.name == source);
    if own { Ok(()) } else { check_exists(source) }
}

/// A scene ready to be measured.
pub struct PathScene {
    /// The scene, lit.
    pub scene: Scene,
    /// From where it is seen.
    pub camera: Camera,
    /// What surrounds it, in words.
    pub environment: String,
}

/// Loads a scene, lights it where it is dark, and chooses its view.
///
/// # Errors
/// Those of loading the scene or the environment.
pub fn load(source: &str, args: &BenchPathArgs, aspect: f64) -> Result<PathScene> {
    let mut scene = match BALLS.iter().find(|b| b.name == source) {
        Some(ball) => ball_scene(ball),
        None if source == CORNELL => {
            let mut scene = load::load("builtin:cornell-box")?;
            scene.materials.iter_mut().for_each(|m| m.kind = MaterialKind::Matte);
            scene
        }
        None => load::load(source)?,
    };
    let known = WellKnownScene::find(&FILES, source);
    let is_emissive = |m: &Mesh| scene.materials[m.material].emissive != Vec3::ZERO;
    let dark = scene.environment == Environment::Black && scene.lights.is_empty() && !scene.meshes.iter().any(is_emissive);
    if dark || args.environment.is_some() {
        scene.environment = Environment::Map(map(args)?);
    }
    if let Some(Ok(light)) = known.and_then(|k| k.area_light).map(light_spec::parse) {
        light.add(&mut scene);
    }
    let choice = known.and_then(|k| k.view).map_or(Choice::Auto, |view| view.choice());
    let camera = camera::choose(&scene, &choice, aspect)?;
    let environment = match &scene.environment {
        Environment::Black => "black".to_owned(),
        Environment::Uniform(c) => format!("{},{},{}", c.x, c.y, c.z),
        Environment::Map(map) => format!("{} ({}x{})", map.name, map.width, map.height),
    };
    Ok(PathScene { scene, camera, environment })
}

/// The environment that is asked for, the shared one, or our own.
fn map(args: &BenchPathArgs) -> Result<EnvironmentMap> {
    let shared = shared_folder().join(SUN_MAP);
    match &args.environment {
        Some(path) => load::load_environment(path),
        None if shared.is_file() && !args.common.quick => load::load_environment(&shared),
        None => Ok(own_map()),
    }
}

/// A sky of our own: blue above, brown below, and a sun that is 10^4 times as bright as both.
fn own_map() -> EnvironmentMap {
    let [width, height] = OWN_MAP;
    let sun = DVec3::new(0.5, 0.6, 0.62).normalize();
    let texel = |k: u32| {
        let (x, y) = (f64::from(k % width) + 0.5, f64::from(k / width) + 0.5);
        let (phi, theta) = (std::f64::consts::TAU * (x / f64::from(width) - 0.5), std::f64::consts::PI * y / f64::from(height));
        let d = DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos());
        let sky = if d.y > 0.0 { Vec3::new(0.5, 0.7, 1.0) } else { Vec3::new(0.3, 0.25, 0.2) };
        // half a degree across, and no less than a texel
        if d.dot(sun) > 0.4f64.to_radians().cos() { Vec3::new(1.0e4, 9.0e3, 7.0e3) } else { sky }
    };
    let radiance: Arc<[Vec3]> = (0..width * height).map(texel).collect();
    EnvironmentMap { name: "own sun map".into(), width, height, radiance, factor: Vec3::ONE, to_map: DMat3::IDENTITY }
}

fn ball_scene(ball: &Ball) -> Scene {
    let material = Material {
        kind: ball.kind,
        base_color: Vec3::splat(ball.color).extend(1.0),
        metallic: ball.metallic,
        roughness: ball.roughness,
        specular_color: Vec3::ONE,
        transmittance: Vec3::ONE,
        ..Material::default()
    };
    Scene {
        name: ball.name.into(),
        meshes: vec![Mesh { name: ball.name.into(), geometry: shapes::sphere(DVec3::ZERO, 1.0), material: 0 }],
        instances: vec![Instance { name: ball.name.into(), mesh: 0, object_to_world: DAffine3::IDENTITY }],
        materials: vec![material],
        cameras: vec![Camera::look_at(DVec3::new(0.0, 0.6, 3.2), DVec3::ZERO, DVec3::Y, 45f64.to_radians())],
        ..Scene::default()
    }
}

/// In tables.
pub fn name(source: &str) -> String {
    let path = Path::new(source);
    let named = WellKnownScene::find(&FILES, source).and_then(|_| path.file_stem());
    named.map_or_else(|| source.to_owned(), |s| s.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn our_own_map_has_one_sun() {
        let map = own_map();
        let bright = map.radiance.iter().filter(|r| r.x > 100.0).count();
        assert!((1..=4).contains(&bright), "{bright} texels of sun");
        // seen upwards
        let at = map.radiance.iter().position(|r| r.x > 100.0).unwrap();
        assert!(at / (OWN_MAP[0] as usize) < OWN_MAP[1] as usize / 2);
    }

    #[test]
    fn lights_of_known_scenes_are_lights() {
        for light in FILES.iter().filter_map(|k| k.area_light) {
            assert!(light_spec::parse(light).is_ok(), "{light}");
        }
    }

    #[test]
    fn balls_are_scenes() {
        for ball in &BALLS {
            check(ball.name).unwrap();
            assert!(ball_scene(ball).bounds().is_some());
        }
        assert!(check("sphere-nothing").is_err());
    }
}
