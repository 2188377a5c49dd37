//! Fingerprints of scenes change with whatever an image depends on.

use glam::Vec3;
use skylit::scene::fingerprint::{of_environment, of_scene};
use skylit::scene::{Environment, EnvironmentMap, Geometry, Scene, builtin};

/// A change to a scene.
type Change = dyn Fn(&mut Scene);

#[test]
fn whatever_an_image_depends_on_changes_it() {
    let scene = builtin::by_name("cornell-box").unwrap();
    let changed = |change: &Change| {
        let mut scene = scene.clone();
        change(&mut scene);
        of_scene(&scene)
    };
    let same = changed(&|_| ());
    assert_eq!(same.len(), 32);
    assert_eq!(changed(&|s| s.name = "other".into()), same);
    assert_eq!(changed(&|s| s.cameras.clear()), same);
    assert_eq!(changed(&|s| s.hints.spp = Some(7)), same);
    assert_eq!(changed(&|s| s.environment = Environment::Uniform(Vec3::ONE)), same);
    let changes: [&Change; 7] = [
        &|s| s.materials[0].roughness += f32::EPSILON,
        &|s| s.instances[0].object_to_world.translation.x += 1e-12,
        &|s| s.instances.swap(0, 1),
        &|s| s.meshes.iter_mut().for_each(|m| m.material = 0),
        &|s| {
            s.lights.push(skylit::scene::Light {
                name: String::new(),
                kind: skylit::scene::LightKind::Point,
                intensity: Vec3::ONE,
                position: glam::DVec3::ZERO,
                direction: glam::DVec3::Y,
                range: f64::INFINITY,
            })
        },
        &|s| {
            let edges = [glam::DVec3::X, glam::DVec3::Z];
            s.portals.push(skylit::scene::Portal { corner: glam::DVec3::ZERO, edges });
        },
        &|s| {
            let mesh = s.meshes.iter_mut().find_map(|m| match &mut m.geometry {
                Geometry::Triangles(mesh) => Some(mesh),
                Geometry::Spheres(_) => None,
            });
            mesh.unwrap().positions[0].z += 1e-3;
        },
    ];
    for (k, change) in changes.iter().enumerate() {
        assert_ne!(changed(change), same, "{k}");
    }
}

#[test]
fn environments_differ_by_their_radiance() {
    let map = |factor: f32| {
        Environment::Map(EnvironmentMap {
            name: "map".into(),
            width: 2,
            height: 1,
            radiance: [Vec3::ONE, Vec3::X].into(),
            factor: Vec3::splat(factor),
            to_map: glam::DMat3::IDENTITY,
        })
    };
    let all = [Environment::Black, Environment::Uniform(Vec3::ONE), Environment::Uniform(Vec3::X), map(1.0), map(2.0)];
    let prints: Vec<_> = all.iter().map(of_environment).collect();
    for (k, print) in prints.iter().enumerate() {
        assert_eq!(prints.iter().position(|p| p == print), Some(k));
    }
    assert_eq!(of_environment(&map(1.0)), prints[3]);
}
