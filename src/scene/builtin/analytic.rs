//! Scenes whose ambient occlusion has a closed form ([`crate::oracle::closed_form`]). Lengths are
//! in the scene's own units, before the [`SceneTransform`].

use super::shapes;
use super::transform::SceneTransform;
use crate::scene::{Geometry, Scene};
use glam::{DVec3, Vec3};

const GREY: Vec3 = Vec3::new(0.73, 0.73, 0.73);

fn scene_of(
    name: &str,
    parts: Vec<(&str, Geometry)>,
    eye: DVec3,
    target: DVec3,
    fov_y: f64,
    at: SceneTransform,
) -> Scene {
    let mut scene = Scene { name: name.to_owned(), ..Scene::default() };
    let grey = scene.add_matte("grey", GREY);
    for (part, geometry) in parts {
        scene.add_object(part, geometry, grey, at.transform());
    }
    scene.add_camera(at.point(eye), at.point(target), fov_y);
    scene
}

/// A horizontal square at height 0 with the given side.
pub fn plane(side: f64, at: SceneTransform) -> Scene {
    let floor = shapes::floor(DVec3::ZERO, side);
    scene_of("plane", vec![("plane", floor)], DVec3::new(0.0, 0.3, 0.6) * side, DVec3::ZERO, 45.0, at)
}

/// A closed cube of the given size around the origin; the camera is inside.
pub fn closed_box(size: f64, at: SceneTransform) -> Scene {
    let h = DVec3::splat(size * 0.5);
    let eye = DVec3::new(0.30, 0.20, 0.40) * size;
    scene_of("closed-box", vec![("box", shapes::cuboid(-h, h))], eye, -eye, 70.0, at)
}

/// Two rectangles that meet in the z axis at `angle` radians and open upwards, mirror images in x.
/// `length` is the extent of each along its slope, `width` along z. A point of a wall lies at
/// `distance * (±sin(angle/2), cos(angle/2), 0)`.
pub fn v_groove(angle: f64, length: f64, width: f64, at: SceneTransform) -> Scene {
    let (s, c) = (angle * 0.5).sin_cos();
    let wall = |side: f64| {
        let up = DVec3::new(side * s, c, 0.0) * length;
        shapes::rectangle(up * 0.5, if side > 0.0 { DVec3::Z } else { DVec3::NEG_Z } * width, up)
    };
    let eye = DVec3::new(0.6 * length * s, 2.5 * length, 0.5 * width + 0.8 * length);
    let parts = vec![("left", wall(-1.0)), ("right", wall(1.0))];
    scene_of("v-groove", parts, eye, DVec3::new(0.0, 0.45 * c * length, 0.0), 40.0, at)
}

/// An analytic sphere with its centre `height` above the middle of a horizontal square of side
/// `side`.
pub fn sphere_over_plane(radius: f64, height: f64, side: f64, at: SceneTransform) -> Scene {
    let parts = vec![
        ("plane", shapes::floor(DVec3::ZERO, side)),
        ("sphere", shapes::sphere(DVec3::new(0.0, height, 0.0), radius)),
    ];
    let eye = DVec3::new(1.5 * radius, height + 1.5 * radius, 5.5 * radius);
    scene_of("sphere-over-plane", parts, eye, DVec3::new(0.0, height * 0.6, 0.0), 40.0, at)
}

/// Two horizontal rectangles, `width` in x by `depth` in z, at heights 0 and `gap`.
pub fn parallel_planes(width: f64, depth: f64, gap: f64, at: SceneTransform) -> Scene {
    let floor = shapes::rectangle(DVec3::ZERO, DVec3::Z * depth, DVec3::X * width);
    let ceiling = shapes::rectangle(DVec3::Y * gap, DVec3::X * width, DVec3::Z * depth);
    let eye = DVec3::new(0.1 * width, 0.7 * gap, 0.5 * depth + 0.5 * gap);
    let target = DVec3::new(0.0, 0.35 * gap, 0.0);
    scene_of("parallel-planes", vec![("floor", floor), ("ceiling", ceiling)], eye, target, 50.0, at)
}
