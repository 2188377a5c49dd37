//! Which scenes are measured, how far occlusion reaches in them, and from where they are seen: near and far.

use glam::{DAffine3, DVec3};

use super::args::BenchAoArgs;
use crate::bench::scenes::{LookAt, SceneList, WELL_KNOWN, WellKnownScene};
use crate::error::{Error, Result};
use crate::film::camera::{self, Choice};
use crate::scene::builtin::shapes;
use crate::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, load};

/// Built-in scenes of the default list.
const BUILTIN: [&str; 2] = ["builtin:terrain:2450000", "builtin:instances:25000000"];
/// With `--quick`.
const QUICK: [&str; 3] = ["builtin:stairs", "builtin:terrain:10000", "builtin:instances:25000"];
/// Reach of any other scene, diagonals of its bounds.
pub const REACH: f64 = 0.25;
/// How much nearer than the scene's own camera, or than one that sees all of it, the near view is.
const NEARER: f64 = 0.5;
/// Side of the plane, in the greatest side of what stands on it.
const PLANE: f64 = 12.0;

/// Scenes to measure.
pub fn choose(args: &BenchAoArgs) -> SceneList {
    match args.scenes.as_slice() {
        [] if args.common.quick => SceneList::of(&QUICK),
        [] => SceneList::well_known(&WELL_KNOWN).then(SceneList::of(&BUILTIN)),
        named => SceneList::of(named),
    }
}

/// A camera, and what the one that goes round turns about.
#[derive(Clone, Debug)]
pub struct View {
    /// `near` or `far`.
    pub name: &'static str,
    /// The camera.
    pub camera: Camera,
    /// World coordinates.
    pub middle: DVec3,
}

/// A scene ready to be measured.
pub struct AoScene {
    /// The scene.
    pub scene: Scene,
    /// How far occlusion reaches, scene units.
    pub reach: f64,
    /// Near, then far.
    pub views: [View; 2],
    /// The well-known scene whose views these are.
    pub well_known: Option<&'static str>,
    /// It was put on a plane.
    pub on_plane: bool,
}

/// Loads a scene and chooses its views.
///
/// # Errors
/// Those of loading; [`Error::Scene`] for one without geometry.
pub fn load(source: &str, aspect: f64) -> Result<AoScene> {
    let mut scene = load::load(source)?;
    let known = WellKnownScene::find(&WELL_KNOWN, source);
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene(format!("{source}: nothing to look at: no geometry")))?;
    if known.is_some_and(|k| k.on_plane) {
        add_plane(&mut scene, (lo, hi));
    }
    let views = match known {
        Some(k) => {
            let view = |name, from: &LookAt| View { name, camera: from.camera(), middle: from.target.into() };
            [view("near", &k.near), view("far", &k.far)]
        }
        None => {
            let middle = (lo + hi) * 0.5;
            let mut near = camera::choose(&scene, &Choice::Auto, aspect)?;
            let eye = &mut near.camera_to_world.translation;
            *eye = middle + (*eye - middle) * NEARER;
            [View { name: "near", camera: near, middle }, View { name: "far", camera: Camera::framing(lo, hi, aspect), middle }]
        }
    };
    let reach = known.map_or(REACH * (hi - lo).length(), |k| k.reach);
    Ok(AoScene { scene, reach, views, well_known: known.map(|k| k.path), on_plane: known.is_some_and(|k| k.on_plane) })
}

/// A plane to stand on.
fn add_plane(scene: &mut Scene, (lo, hi): (DVec3, DVec3)) {
    let middle = DVec3::new(0.5 * (lo.x + hi.x), lo.y, 0.5 * (lo.z + hi.z));
    let geometry: Geometry = shapes::floor(middle, PLANE * (hi - lo).max_element());
    scene.materials.push(Material { name: "plane".into(), ..Default::default() });
    scene.meshes.push(Mesh { name: "plane".into(), geometry, material: scene.materials.len() - 1 });
    let mesh = scene.meshes.len() - 1;
    scene.instances.push(Instance { name: "plane".into(), mesh, object_to_world: DAffine3::IDENTITY });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_scene_has_two_views() {
        let s = load("builtin:stairs", 16.0 / 9.0).unwrap();
        assert!(s.well_known.is_none() && s.reach > 1.0);
        let distance = |v: &View| v.camera.camera_to_world.translation.distance(v.middle);
        assert!(s.views[0].name == "near" && distance(&s.views[0]) < distance(&s.views[1]));
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
