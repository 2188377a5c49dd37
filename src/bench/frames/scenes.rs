//! The measured scenes, with their lights, views, and the centres of moving cameras.

use glam::{DAffine3, DVec3};

use super::args::{BenchFramesArgs, ViewChoice};
use crate::bench::scenes::{
    FLIGHT_HELMET, SPONZA, SceneList, WELL_KNOWN, WellKnownScene, check_exists, environment_text, sun_map, table_name,
};
use crate::error::{Error, Result};
use crate::film::camera::{self, Choice};
use crate::integrators::Integrator;
use crate::scene::builtin::moving_box::{self, Mover};
use crate::scene::builtin::shapes;
use crate::scene::{Camera, Environment, Geometry, Instance, Material, Mesh, Scene, light_spec, load};
use crate::settings::Capability;

/// The built-in atrium at night, with one lamp.
const INTERIOR: &str = "interior";
/// The lamp of a scene: a small emitter.
const LAMP: &str = "sphere position=-4,2.6,0.6 radius=0.12 radiance=600";
/// A room in which a box is moved about.
const ROOM: &str = "room";
/// Built-in scenes of the default list.
const BUILTIN: [&str; 5] =
    ["builtin:cornell-box", "builtin:cornell-mirror", "builtin:cornell-glass-sphere", INTERIOR, "builtin:parade"];
const QUICK: [&str; 2] = ["builtin:cornell-box", "builtin:parade"];
/// Scenes of ambient occlusion, after the well-known ones.
const OCCLUSION: [&str; 4] = ["builtin:terrain:2450000", "builtin:instances:25000000", ROOM, "builtin:parade"];
const QUICK_OCCLUSION: [&str; 3] = ["builtin:stairs", "builtin:instances:25000", ROOM];
/// Well-known scenes of the default list.
const FILES: [&WellKnownScene; 2] = [&SPONZA, &FLIGHT_HELMET];
/// Material of the surface that covers Sponza's court: it is left out, so that the sun gets in.
const COVER: &str = "None";
/// Distance to the point that a camera within its scene goes round, in diagonals: clear of walls.
const AHEAD: f64 = 0.05;

/// Scenes to measure.
pub fn choose(args: &BenchFramesArgs) -> SceneList {
    match args.scenes.as_slice() {
        [] if args.common.quick && args.is_occlusion() => SceneList::from_sources(&QUICK_OCCLUSION),
        [] if args.common.quick => SceneList::from_sources(&QUICK),
        [] if args.is_occlusion() => SceneList::well_known(&WELL_KNOWN).then(SceneList::from_sources(&OCCLUSION)),
        [] => SceneList::from_sources(&BUILTIN).then(SceneList::well_known(&FILES)),
        named => SceneList::from_sources(named),
    }
}

/// Fails for a scene that is not there.
pub fn check(source: &str) -> Result<()> {
    if [INTERIOR, ROOM].contains(&source) { Ok(()) } else { check_exists(source) }
}

pub struct FramesScene {
    pub name: String,
    pub scene: Scene,
    /// The camera.
    pub views: Vec<CameraView>,
    /// The lights, in words.
    pub light: String,
    /// How far ambient occlusion reaches, scene units.
    pub reach: f64,
    /// The box that moves, in the room.
    pub mover: Option<Mover>,
}

pub struct CameraView {
    /// In tables, the name of the scene included.
    pub name: String,
    pub camera: Camera,
    /// The centre of the moving camera.
    pub middle: DVec3,
}

impl FramesScene {
    /// Triangles and spheres over all instances.
    pub fn primitives(&self) -> u64 {
        self.scene.triangle_count() + self.scene.sphere_count()
    }
}

/// Length of occlusion rays, diagonals of the bounds.
const REACH: f64 = 0.25;

/// Side of the plane that a scene is put on, in the greatest side of the scene.
const PLANE: f64 = 12.0;

/// Loads a scene, lights it where it is dark, and chooses its views.
pub fn load(source: &str, args: &BenchFramesArgs) -> Result<FramesScene> {
    // the scene, without what would cover it and with what it stands on
    let is_interior = source == INTERIOR;
    let (mut scene, mover) = if source == ROOM {
        let (scene, mover) = moving_box::build_room();
        (scene, Some(mover))
    } else {
        (load::load(if is_interior { "builtin:atrium" } else { source })?, None)
    };
    let known = WellKnownScene::find(&WELL_KNOWN, source);
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene(format!("{source}: nothing to look at: no geometry")))?;
    if known.is_some_and(|k| k.path == SPONZA.path) && !args.is_occlusion() {
        let Scene { instances, meshes, materials, .. } = &mut scene;
        instances.retain(|i| materials[meshes[i.mesh].material].name != COVER);
        // whose numbers are those of before
        scene.nodes = Default::default();
    }
    if known.is_some_and(|k| k.on_plane) {
        add_plane(&mut scene, (lo, hi));
    }
    let light = light(&mut scene, is_interior, args)?;

    // where it is seen from
    let name = table_name(&WELL_KNOWN, source);
    let mut views = Vec::new();
    for choice in args.views() {
        let camera = match (choice, known) {
            (ViewChoice::Near, _) => {
                let near = known.map_or(Choice::Auto, |k| k.near.choice());
                camera::choose(&scene, &near, args.aspect())?
            }
            (ViewChoice::Far, Some(known)) => known.far.camera(),
            (ViewChoice::Far, None) => Camera::framing(lo, hi, args.aspect()),
        };
        let to_world = camera.camera_to_world;
        let eye = to_world.translation;
        let is_inside = eye.cmpgt(lo).all() && eye.cmplt(hi).all();
        let looked_at = known.filter(|_| !is_inside);
        let middle = match looked_at.map(|k| if choice == ViewChoice::Near { k.near } else { k.far }) {
            Some(view) => view.target.into(),
            None if is_inside => eye - to_world.matrix3.z_axis.normalize_or_zero() * (AHEAD * (hi - lo).length()),
            None => (lo + hi) * 0.5,
        };
        let has_several = args.views().len() > 1;
        let name = if has_several { format!("{name}, {}", choice.name()) } else { name.clone() };
        views.push(CameraView { name, camera, middle });
    }
    let reach = if mover.is_some() { moving_box::REACH } else { known.map_or(REACH * (hi - lo).length(), |k| k.reach) };
    Ok(FramesScene { name, scene, views, light, reach, mover })
}

/// Puts a scene with these bounds on a plane.
fn add_plane(scene: &mut Scene, (lo, hi): (DVec3, DVec3)) {
    let middle = DVec3::new(0.5 * (lo.x + hi.x), lo.y, 0.5 * (lo.z + hi.z));
    let geometry: Geometry = shapes::floor(middle, PLANE * (hi - lo).max_element());
    scene.materials.push(Material { name: "plane".into(), ..Default::default() });
    scene.meshes.push(Mesh { name: "plane".into(), geometry, material: scene.materials.len() - 1, source: None });
    let mesh = scene.meshes.len() - 1;
    scene.instances.push(Instance { name: "plane".into(), mesh, object_to_world: DAffine3::IDENTITY });
}

/// Lights a scene that is dark. Returns what lights it, in words.
fn light(scene: &mut Scene, is_interior: bool, args: &BenchFramesArgs) -> Result<String> {
    let integrator: &dyn Integrator = args.integrator().get();
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
    Ok(environment_text(&scene.environment, "its own"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::parse::parse_args;

    #[test]
    fn every_scene_is_lit_and_has_something_to_go_round() {
        let args: BenchFramesArgs = parse_args(&["--quick"]).unwrap();
        for source in [INTERIOR, "builtin:parade", "builtin:cornell-box", ROOM] {
            check(source).unwrap();
            let loaded = load(source, &args).unwrap();
            assert!(!loaded.scene.is_dark(), "{source}");
            let view = &loaded.views[0];
            assert!(view.camera.camera_to_world.translation.distance(view.middle) > 0.1, "{source}");
        }
        let interior = load(INTERIOR, &args).unwrap();
        assert!(interior.scene.environment == Environment::Black && interior.light == "a lamp");
        // in the court, clear of its columns
        let view = &interior.views[0];
        assert!(view.middle.distance(view.camera.camera_to_world.translation) < 6.0);
    }

    #[test]
    fn any_scene_has_two_views_of_ambient_occlusion() {
        let args = parse_args::<BenchFramesArgs>(&["--quick"]).unwrap().of_ambient_occlusion();
        let loaded = load("builtin:stairs", &args).unwrap();
        let names: Vec<_> = loaded.views.iter().map(|v| v.name.as_str()).collect();
        assert_eq!(names, ["builtin:stairs, near", "builtin:stairs, far"]);
        assert!(loaded.mover.is_none() && load(ROOM, &args).unwrap().mover.is_some());
    }

    #[test]
    fn a_plane_is_under_everything() {
        let mut scene = crate::scene::builtin::by_name("grid:2").unwrap();
        let before = scene.bounds().unwrap();
        add_plane(&mut scene, before);
        let after = scene.bounds().unwrap();
        assert_eq!(after.0.y, before.0.y);
        assert!(after.1.x > before.1.x && scene.instances.len() == 10 && scene.meshes.len() == 3);
    }
}
