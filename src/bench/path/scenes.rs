//! Which scenes are measured, what lights them, and from where they are seen.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::args::BenchPathArgs;
use crate::bench::scenes::{check_there, folder, is_file};
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::scene::builtin::shapes;
use crate::scene::material::MaterialKind;
use crate::scene::{Camera, Environment, EnvironmentMap, Instance, Material, Mesh, Scene, load};
use crate::terminal::lights;

/// The map with a sun in it, below the folder of shared scenes.
const SUN_MAP: &str = "env/spruit_sunrise_1k.hdr";
/// Pixels of our own map: a texel is 0.7 degrees, about the sun.
const OWN_MAP: [u32; 2] = [512, 256];

/// A file that many measure with.
struct Known {
    /// Below the folder of shared scenes.
    path: &'static str,
    /// Eye, target, degrees; `None`: as `render` would.
    view: Option<([f64; 3], [f64; 3], f64)>,
    /// As `--light` takes it.
    light: Option<&'static str>,
}

const KNOWN: [Known; 2] = [
    Known { path: "flight_helmet/FlightHelmet.gltf", view: None, light: None },
    Known {
        path: "sponza/sponza.glb",
        // along the nave, from inside, where next to no sky is seen: a lamp hangs in it
        view: Some(([-120.0, 20.0, -5.0], [50.0, 35.0, 0.0], 70.0)),
        light: Some("sphere position=30,70,-5 radius=4 radiance=400"),
    },
];

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

/// What to measure, and what of the default list is not there.
pub fn choose(args: &BenchPathArgs) -> (Vec<String>, Vec<String>) {
    if !args.scenes.is_empty() {
        return (args.scenes.clone(), Vec::new());
    }
    let cornell = CORNELL.to_owned();
    if args.common.quick {
        return (vec![cornell, BALLS[0].name.to_owned()], Vec::new());
    }
    let folder = folder();
    let (there, absent): (Vec<_>, Vec<_>) = KNOWN.iter().map(|k| folder.join(k.path)).partition(|p| p.is_file());
    let notes = absent.iter().map(|p| format!("{}: not here, left out (SKYLIT_SHARED_SCENES names its folder)", p.display()));
    let balls = BALLS[..DEFAULT_BALLS].iter().map(|b| b.name.to_owned());
    let scenes = std::iter::once(cornell).chain(there.iter().map(|p| p.display().to_string())).chain(balls);
    (scenes.collect(), notes.collect())
}

/// Fails for a scene that is not there.
pub fn check(source: &str) -> Result<()> {
    let own = source == CORNELL || BALLS.iter().any(|b| b.name == source);
    if own { Ok(()) } else { check_there(source) }
}

/// A scene ready to be measured.
pub struct Subject {
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
pub fn load(source: &str, args: &BenchPathArgs, aspect: f64) -> Result<Subject> {
    let mut scene = match BALLS.iter().find(|b| b.name == source) {
        Some(ball) => ball_scene(ball),
        None if source == CORNELL => {
            let mut scene = load::load("builtin:cornell-box")?;
            scene.materials.iter_mut().for_each(|m| m.kind = MaterialKind::Matte);
            scene
        }
        None => load::load(source)?,
    };
    let known = KNOWN.iter().find(|k| is_file(source, k.path));
    let shines = |m: &Mesh| scene.materials[m.material].emissive != Vec3::ZERO;
    let dark = scene.environment == Environment::Black && scene.lights.is_empty() && !scene.meshes.iter().any(shines);
    if dark || args.environment.is_some() {
        scene.environment = Environment::Map(map(args)?);
    }
    if let Some(Ok(light)) = known.and_then(|k| k.light).map(lights::parse) {
        light.add(&mut scene);
    }
    let choice = match known.and_then(|k| k.view) {
        Some((eye, target, fov_y)) => {
            Choice::LookAt { eye: eye.into(), target: target.into(), up: DVec3::Y, fov_y: fov_y.to_radians() }
        }
        None => Choice::Auto,
    };
    let camera = camera::choose(&scene, &choice, aspect)?;
    let environment = match &scene.environment {
        Environment::Black => "black".to_owned(),
        Environment::Uniform(c) => format!("{},{},{}", c.x, c.y, c.z),
        Environment::Map(map) => format!("{} ({}x{})", map.name, map.width, map.height),
    };
    Ok(Subject { scene, camera, environment })
}

/// The environment that is asked for, the shared one, or our own.
fn map(args: &BenchPathArgs) -> Result<EnvironmentMap> {
    let shared = folder().join(SUN_MAP);
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
    let named = KNOWN.iter().find(|k| is_file(source, k.path)).and_then(|_| path.file_stem());
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
        for light in KNOWN.iter().filter_map(|k| k.light) {
            assert!(lights::parse(light).is_ok(), "{light}");
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
