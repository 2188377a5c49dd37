//! Built-in scenes, for tests and for a first image without any file.
//!
//! [`by_name`] makes the scenes by their names on the command line; [`analytic`] has those with a
//! known ambient occlusion, with parameters for tests; [`shapes`] has their meshes.

pub mod analytic;
mod assemble;
pub mod atrium;
pub mod city;
pub mod cornell;
pub mod many;
pub mod moving_box;
pub mod parade;
pub mod pendulum;
mod random;
pub mod room;
pub mod shapes;
pub mod sun_map;
pub mod terrain;
mod transform;

pub use transform::SceneTransform;

use super::{Geometry, Scene};
use glam::{DAffine3, DVec3};

/// Name and one-line description of a built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltinInfo {
    /// Name that [`by_name`] takes, before any `:PARAMETER`.
    pub name: &'static str,
    /// Contents, and the parameter with default and range, if it has one.
    pub description: &'static str,
}

const fn info(name: &'static str, description: &'static str) -> BuiltinInfo {
    BuiltinInfo { name, description }
}

const NAMES: &[BuiltinInfo] = &[
    info("cornell-box", "the Cornell box with its two blocks"),
    info("cornell-empty", "the Cornell box without blocks"),
    info("cornell-mirror", "the Cornell box, its tall block a mirror"),
    info("cornell-glass-sphere", "the Cornell box with a tall block and an analytic sphere of glass"),
    info("cornell-spheres", "the Cornell box with analytic spheres: mirror, glass and matte"),
    info(
        "coello",
        "the Cornell boxes of Coello (2024) under a white sky: matte, with a box of metal, glossy (coello:N, 1 to 3, default 1)",
    ),
    info("sphere-over-plane", "an analytic sphere that floats over a plane; AO has a closed form"),
    info(
        "v-groove",
        "two walls that meet at ANGLE degrees (v-groove:ANGLE, 1 to 180, default 90); AO is (1 - cos ANGLE) / 2",
    ),
    info("closed-box", "the inside of a closed box; AO is 0 everywhere"),
    info("parallel-planes", "a floor and a ceiling; AO has a closed form"),
    info("plane", "a single plane; AO is 1 everywhere"),
    info("grid", "N x N x N rotated and scaled instances of a torus over a floor (grid:N, 1 to 128, default 6)"),
    info("spheres", "N random analytic spheres over a floor (spheres:N, 1 to 10000000, default 1000)"),
    info("terrain", "a fractal landscape of N triangles (terrain:N, 2 to 100000000, default 100000)"),
    info("city", "quarters of houses, about N triangles in boxes (city:N, 100 to 20000000, default 100000)"),
    info(
        "instances",
        "125 instances of 15 landscapes, N triangles in all (instances:N, 250 to 500000000, default 1000000)",
    ),
    info("leaf-cards", "bushes of leaves cut from quads by alpha masks, some of them blended"),
    info("atrium", "an arcaded courtyard of two storeys, open to the sky: about as many triangles as Sponza"),
    info(
        "room",
        "a furnished room of about N triangles, closed but for a window (room:N, 10000 to 5000000, default 40000)",
    ),
    info("stairs", "stairs, a column and a rail: contact detail"),
    info("parade", "an animation of two seconds: moving blocks, a rotor, a skinned column, a ball with morph targets"),
    info("pendulum", "an animation of two seconds: the Cornell box, whose lamp swings on a rod"),
    info("far-away", "the stairs, more than a million units from the origin"),
];

/// All built-in scenes.
pub fn names() -> &'static [BuiltinInfo] {
    NAMES
}

/// The built-in scene `name`, which may end in `:PARAMETER` where its description says so. `None`
/// when there is no such scene or the parameter is out of its range.
pub fn by_name(name: &str) -> Option<Scene> {
    let mut scene = recipe(name)?();
    scene.name = name.to_owned();
    Some(scene)
}

/// Whether [`by_name`] would make a scene of this name; the scene is not made.
pub fn exists(name: &str) -> bool {
    recipe(name).is_some()
}

/// The function that makes a scene.
fn recipe(name: &str) -> Option<Box<dyn FnOnce() -> Scene>> {
    let (base, parameter) = match name.split_once(':') {
        Some((base, parameter)) => (base, Some(parameter)),
        None => (name, None),
    };

    // a parameter that is missing takes the default; one that does not parse, or is not wanted, is
    // an error
    let number = |default: f64, lo: f64, hi: f64| match parameter {
        None => Some(default),
        Some(p) => p.parse::<f64>().ok().filter(|v| (lo..=hi).contains(v)),
    };
    let between = |default: u32, lo: u32, hi: u32| match parameter {
        None => Some(default),
        Some(p) => p.parse::<u32>().ok().filter(|v| (lo..=hi).contains(v)),
    };
    let with =
        |make: fn(u32) -> Scene, n: Option<u32>| n.map(|n| Box::new(move || make(n)) as Box<dyn FnOnce() -> Scene>);

    // scenes that take a parameter
    match base {
        "v-groove" => {
            let angle = number(90.0, 1.0, 180.0)?.to_radians();
            return Some(Box::new(move || analytic::v_groove(angle, 4.0, 12.0, SceneTransform::default())));
        }
        "coello" => return with(cornell::coello, between(1, 1, 3)),
        "grid" => return with(many::grid, between(6, 1, 128)),
        "room" => return with(room::room, between(40_000, 10_000, 5_000_000)),
        "spheres" => return with(many::spheres, between(1000, 1, 10_000_000)),
        "terrain" => return with(terrain::terrain, between(100_000, 2, 100_000_000)),
        "city" => return with(city::city, between(100_000, 100, 20_000_000)),
        "instances" => return with(terrain::instances, between(1_000_000, 250, 500_000_000)),
        _ if parameter.is_some() => return None,
        _ => {}
    }

    // scenes that take none
    let make: fn() -> Scene = match base {
        "cornell-box" => cornell::cornell_box,
        "cornell-empty" => cornell::cornell_empty,
        "cornell-mirror" => cornell::cornell_mirror,
        "cornell-glass-sphere" => cornell::cornell_glass_sphere,
        "cornell-spheres" => cornell::cornell_spheres,
        "sphere-over-plane" => || analytic::sphere_over_plane(1.0, 1.25, 60.0, SceneTransform::default()),
        "closed-box" => || analytic::closed_box(2.0, SceneTransform::default()),
        "parallel-planes" => || analytic::parallel_planes(8.0, 6.0, 1.0, SceneTransform::default()),
        "plane" => || analytic::plane(20.0, SceneTransform::default()),
        "leaf-cards" => many::leaf_cards,
        "parade" => parade::parade,
        "pendulum" => pendulum::pendulum,
        "atrium" => atrium::atrium,
        "stairs" => || many::stairs(DVec3::ZERO),
        "far-away" => || many::stairs(DVec3::new(1.0e6, -5.0e5, 1.5e6)),
        _ => return None,
    };
    Some(Box::new(make))
}

/// Applies every instance's transform to its vertices, rounded to `f32`: the scene that a file
/// without transforms would hold. Sphere meshes keep their instance's transform (it may make
/// ellipsoids of them). Nothing moves in it.
pub fn bake(scene: &Scene) -> Scene {
    let mut out = scene.clone();
    out.rig = None;
    out.meshes.clear();
    for instance in &mut out.instances {
        let mut mesh = scene.meshes[instance.mesh].clone();
        if let Geometry::Triangles(t) = &mut mesh.geometry {
            for p in &mut t.positions {
                *p = instance.object_to_world.transform_point3(p.as_dvec3()).as_vec3();
            }
            let normal_matrix = instance.object_to_world.matrix3.inverse().transpose();
            for n in &mut t.normals {
                *n = (normal_matrix * n.as_dvec3()).normalize_or_zero().as_vec3();
            }
            instance.object_to_world = DAffine3::IDENTITY;
        }
        instance.mesh = out.meshes.len();
        out.meshes.push(mesh);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_exists_is_known_without_making_it() {
        assert!(names().iter().all(|b| exists(b.name)));
        for name in ["terrain:100000000", "spheres:10000000", "instances:250", "v-groove:1", "grid:128"] {
            assert!(exists(name), "{name}");
        }
        for name in
            ["", "nothing", "plane:1", "terrain:1", "terrain:", "terrain:1e3", "grid:129", "v-groove:nan", "spheres:0"]
        {
            assert!(!exists(name), "{name}");
            assert!(by_name(name).is_none(), "{name}");
        }
    }
}
