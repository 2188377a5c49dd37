//! Which scenes are measured, how far occlusion reaches in them, and from where they are seen: near and far.

use glam::{DAffine3, DVec3};

use super::args::BenchAoArgs;
use crate::bench::scenes::{folder, is_file};
use crate::error::{Error, Result};
use crate::film::camera::{self, Choice};
use crate::scene::builtin::shapes;
use crate::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, load};

/// From where, and at what.
type LookAt = ([f64; 3], [f64; 3]);

/// A file that many measure with.
struct Known {
    /// Below the folder of shared scenes.
    path: &'static str,
    /// World units.
    reach: f64,
    near: LookAt,
    far: LookAt,
    /// Degrees, near and far.
    fov_y: [f64; 2],
    /// It is put on a plane.
    plane: bool,
}

const KNOWN: [Known; 4] = [
    Known {
        path: "sponza/sponza.glb",
        reach: 60.0,
        // along the nave, from inside; and into the courtyard from above its roof
        near: ([-120.0, 20.0, -5.0], [50.0, 35.0, 0.0]),
        far: ([20.0, 330.0, 60.0], [-5.0, 20.0, -4.0]),
        fov_y: [70.0, 45.0],
        plane: false,
    },
    Known {
        path: "dragon/dragon.glb",
        reach: 0.1,
        near: ([0.03, 0.165, 0.12], [-0.012, 0.128, 0.0]),
        far: ([0.12, 0.24, 0.38], [-0.006, 0.125, -0.005]),
        fov_y: [45.0, 45.0],
        plane: false,
    },
    Known {
        path: "bunny/bunny.glb",
        reach: 0.1,
        near: ([0.01, 0.14, 0.115], [-0.02, 0.105, 0.0]),
        far: ([0.15, 0.27, 0.42], [-0.017, 0.095, 0.0]),
        fov_y: [45.0, 45.0],
        plane: true,
    },
    Known {
        path: "flight_helmet/FlightHelmet.gltf",
        reach: 0.3,
        near: ([0.1, 0.52, 0.4], [-0.03, 0.46, 0.05]),
        far: ([0.45, 0.75, 1.25], [-0.02, 0.35, 0.01]),
        fov_y: [45.0, 45.0],
        plane: false,
    },
];

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

/// What to measure, and what of the default list is not there.
pub fn choose(args: &BenchAoArgs) -> (Vec<String>, Vec<String>) {
    if !args.scenes.is_empty() {
        return (args.scenes.clone(), Vec::new());
    }
    if args.common.quick {
        return (QUICK.map(str::to_owned).to_vec(), Vec::new());
    }
    let folder = folder();
    let (there, absent): (Vec<_>, Vec<_>) = KNOWN.iter().map(|k| folder.join(k.path)).partition(|p| p.is_file());
    let notes = absent.iter().map(|p| format!("{}: not here, left out (SKYLIT_SHARED_SCENES names its folder)", p.display()));
    let scenes = there.iter().map(|p| p.display().to_string()).chain(BUILTIN.map(str::to_owned));
    (scenes.collect(), notes.collect())
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
pub struct Subject {
    /// The scene.
    pub scene: Scene,
    /// World units that occlusion reaches.
    pub reach: f64,
    /// Near, then far.
    pub views: [View; 2],
    /// The well-known scene whose views these are.
    pub known: Option<&'static str>,
    /// It was put on a plane.
    pub plane: bool,
}

/// Loads a scene and chooses its views.
///
/// # Errors
/// Those of loading; [`Error::Scene`] for one without geometry.
pub fn load(source: &str, aspect: f64) -> Result<Subject> {
    let mut scene = load::load(source)?;
    let known = KNOWN.iter().find(|k| is_file(source, k.path));
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene(format!("{source}: nothing to look at: no geometry")))?;
    if known.is_some_and(|k| k.plane) {
        add_plane(&mut scene, (lo, hi));
    }
    let views = match known {
        Some(k) => {
            let view = |name, (eye, target): LookAt, fov_y: f64| View {
                name,
                camera: Camera::look_at(eye.into(), target.into(), DVec3::Y, fov_y.to_radians()),
                middle: target.into(),
            };
            [view("near", k.near, k.fov_y[0]), view("far", k.far, k.fov_y[1])]
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
    Ok(Subject { scene, reach, views, known: known.map(|k| k.path), plane: known.is_some_and(|k| k.plane) })
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
        assert!(s.known.is_none() && s.reach > 1.0);
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
