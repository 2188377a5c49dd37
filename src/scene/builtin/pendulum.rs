//! Light that moves: the Cornell box, whose lamp is a ball on a rod that swings. It loops
//! seamlessly after two seconds.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec3, Vec3};

use super::{cornell, shapes};
use crate::scene::animation::{Animation, Channel, Interpolation, LocalTransform, Node, Property, RigParts, Sampler};
use crate::scene::{AnimationRig, Material, Scene};

/// Duration of the loop in seconds.
const DURATION: f64 = 2.0;
/// Greatest angle to the vertical, in radians.
const SWING: f64 = 0.7;
/// Keys of the animation, the last one beginning again.
const KEYS: u32 = 33;
/// Distance from the ceiling to the middle of the lamp, and the lamp's radius, scene units (of 100
/// mm, as in the box).
const LENGTH: f64 = 2.2;
const RADIUS: f64 = 0.25;
/// Radiance of the lamp: as much power as that of the box.
const LIGHT: Vec3 = Vec3::new(51.0, 36.0, 12.0);

/// The box with its two blocks. Animation 0 swings the lamp.
pub fn pendulum() -> Scene {
    let mut scene = cornell::cornell_box();
    // the lamp below the ceiling
    scene.instances.retain(|i| i.name != "light");
    let mut parts = RigParts {
        instances: vec![None; scene.instances.len()],
        cameras: vec![None; scene.cameras.len()],
        ..RigParts::default()
    };
    let hook = scene
        .bounds()
        .map_or(DVec3::ZERO, |(lo, hi)| DVec3::new(0.5 * (lo.x + hi.x), hi.y, lo.z + 0.4 * (hi.z - lo.z)));
    let local = LocalTransform::Trs { translation: hook, rotation: DQuat::IDENTITY, scale: DVec3::ONE };
    parts.nodes.push(Node { name: "pendulum".to_owned(), local, ..Node::default() });
    let light = scene.add_material(Material { name: "lamp".to_owned(), emissive: LIGHT, ..Material::default() });
    let metal = scene.add_matte("rod", Vec3::splat(0.3));
    let rod = shapes::cuboid(DVec3::new(-0.03, RADIUS - LENGTH, -0.03), DVec3::new(0.03, -0.05, 0.03));
    let ball = shapes::sphere(DVec3::new(0.0, -LENGTH, 0.0), RADIUS);
    for (name, geometry, material) in [("rod", rod, metal), ("lamp", ball, light)] {
        scene.add_object(name, geometry, material, DAffine3::IDENTITY);
        parts.instances.push(Some(0));
    }
    let time = |k: u32| DURATION * f64::from(k) / f64::from(KEYS - 1);
    let turn = |k: u32| DQuat::from_rotation_z(SWING * (TAU * time(k) / DURATION).sin()).as_quat().to_array();
    let sampler = Sampler {
        interpolation: Interpolation::Linear,
        times: (0..KEYS).map(|k| time(k) as f32).collect(),
        values: (0..KEYS).flat_map(turn).collect(),
    };
    let channels = vec![Channel { node: 0, property: Property::Rotation, sampler }];
    parts.animations =
        vec![Animation { name: "swing".to_owned(), duration: DURATION, channels, ..Animation::default() }];
    // valid by construction; otherwise the scene has no rig, and tests fail
    let _ = AnimationRig::attach(&mut scene, parts);
    scene
}
