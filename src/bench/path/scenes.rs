//! Which scenes are measured, what lights them, and from where they are seen.

use glam::{DAffine3, DVec3, Vec3};

use super::args::BenchPathArgs;
use crate::bench::scenes::{FLIGHT_HELMET, SPONZA, SceneList, WellKnownScene, check_exists, environment_text, sun_map};
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::scene::builtin::shapes;
use crate::scene::light_spec;
use crate::scene::material::MaterialKind;
use crate::scene::{Camera, Environment, Instance, Material, Mesh, Scene, load};

/// Well-known scenes that are measured.
pub const FILES: [&WellKnownScene; 2] = [&FLIGHT_HELMET, &SPONZA];

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
/// Scenes of balls in the default list: nobody here finds a caustic of the sun through glass.
const DEFAULT_BALLS: usize = 3;

/// The built-in Cornell box, all Lambertian: engines agree about it to the last digit above noise.
const CORNELL: &str = "cornell";

/// Scenes to measure.
pub fn choose(args: &BenchPathArgs) -> SceneList {
    let balls = |count: usize| SceneList::from_sources(&BALLS[..count].iter().map(|b| b.name).collect::<Vec<_>>());
    let cornell = SceneList::from_sources(&[CORNELL]);
    match args.scenes.as_slice() {
        [] if args.common.quick => cornell.then(balls(1)),
        [] => cornell.then(SceneList::well_known(&FILES)).then(balls(DEFAULT_BALLS)),
        named => SceneList::from_sources(named),
    }
}

/// Fails for a scene that is not there.
pub fn check(source: &str) -> Result<()> {
    let own = source == CORNELL || BALLS.iter().any(|b| b.name == source);
    if own { Ok(()) } else { check_exists(source) }
}

pub struct PathScene {
    pub scene: Scene,
    pub camera: Camera,
    /// The surroundings, in words.
    pub environment: String,
}

/// Loads a scene, lights it where it is dark, and chooses its view.
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
    let lamp = known.and_then(|k| k.area_light);
    let dark =
        scene.environment == Environment::Black && scene.lights.is_empty() && !scene.meshes.iter().any(is_emissive);
    // a sky that does not reach a room would take most of the light samples
    if (dark && lamp.is_none()) || args.environment.is_some() {
        scene.environment = Environment::Map(sun_map(args.environment.as_deref(), args.common.quick)?);
    }
    if let Some(Ok(light)) = lamp.map(light_spec::parse) {
        light.add(&mut scene);
    }
    let choice = known.and_then(|k| k.view).map_or(Choice::Auto, |view| view.choice());
    let camera = camera::choose(&scene, &choice, aspect)?;
    let environment = environment_text(&scene.environment, "black");
    Ok(PathScene { scene, camera, environment })
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
        meshes: vec![Mesh {
            name: ball.name.into(),
            geometry: shapes::sphere(DVec3::ZERO, 1.0),
            material: 0,
            source: None,
        }],
        instances: vec![Instance { name: ball.name.into(), mesh: 0, object_to_world: DAffine3::IDENTITY }],
        materials: vec![material],
        cameras: vec![Camera::look_at(DVec3::new(0.0, 0.6, 3.2), DVec3::ZERO, DVec3::Y, 45f64.to_radians())],
        ..Scene::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
