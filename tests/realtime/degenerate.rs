//! Whatever is rendered, what comes out is an ambient visibility, and the frames after know nothing of what was wrong.

use glam::{DAffine3, DVec3};
use skylit::film::camera::CameraRecord;
use skylit::integrators::ao::{Hemisphere, Occlusion};
use skylit::realtime::{Preset, Settings, Technique};
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::scene::{Camera, Geometry, Projection, Scene};
use skylit::tracer::TracerKind;

use crate::common::{assert_validation_clean, device, record, scene, tracer, tracers};
use crate::{assert_sound, frames, realtime, traced};

const SMALL: [u32; 2] = [32, 18];

/// Settings whose arithmetic differs.
fn pipelines() -> Vec<Settings> {
    vec![
        Settings { occlusion: Occlusion::new(f64::INFINITY, 8.0), ..traced(Preset::Balanced) },
        Settings {
            occlusion: Occlusion { hemisphere: Hemisphere::Shading, ..Default::default() },
            rays_per_pixel: 3,
            ..traced(Preset::LarsenFixed)
        },
        Settings { technique: Technique::Gtao, ..traced(Preset::Fast) },
        traced(Preset::Larsen),
    ]
}

/// A good view, a bad one, the good one again: sound in every frame, and in the end as if the bad one had not been.
fn check(what: &str, scene: &Scene, good: &CameraRecord, bad: &[CameraRecord]) {
    let device = device();
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, scene);
        // tracers differ in what they trace, not in what is done with it
        let all = pipelines();
        let count = if kind == TracerKind::Compute { all.len() } else { 1 };
        for settings in &all[..count] {
            let what = format!("{what}, {kind}, {:?}", settings.technique);
            let mut realtime = realtime(&tracer, SMALL, settings);
            frames(&mut realtime, &tracer, good, 3);
            assert_sound(&what, &realtime);
            let seen = realtime.result().unwrap();
            for (k, camera) in bad.iter().enumerate() {
                // twice: with what is new, and with what is known of it
                for _ in 0..2 {
                    frames(&mut realtime, &tracer, camera, 1);
                    assert_sound(&format!("{what}, view {k}"), &realtime);
                }
                frames(&mut realtime, &tracer, good, 3);
                assert_sound(&format!("{what}, after view {k}"), &realtime);
            }
            let again = realtime.result().unwrap();
            let by = crate::mean(seen.iter().zip(&again).map(|(a, b)| f64::from(a - b).abs()));
            // noise of a few samples each, filtered
            assert!(by < 0.2, "{what}: afterwards the image is off by {by}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_odd_cameras_leave_nothing_behind() {
    let scene = scene("stairs");
    let good = record(&scene, &scene.cameras[0], SMALL);
    let own = &scene.cameras[0];
    let mut bad = Vec::new();
    // views without an area, and next to it
    for view in [[0.0, 0.0], [1e-30, 1e-30], [1e-6, 1e-6], [1e6, 1e6]] {
        bad.push(CameraRecord { view, ..good });
    }
    // at a vertex, on an edge, on a surface, inside what is solid
    let Geometry::Triangles(mesh) = &scene.meshes[0].geometry else { panic!() };
    let place = scene.instances[0].object_to_world;
    let corner = |k: usize| place.transform_point3(mesh.positions[mesh.indices[0][k] as usize].as_dvec3());
    for eye in [corner(0), (corner(0) + corner(1)) * 0.5, (corner(0) + corner(1) + corner(2)) / 3.0] {
        for target in [DVec3::ZERO, eye + DVec3::X, eye - DVec3::Y] {
            bad.push(record(&scene, &Camera::look_at(eye, target, DVec3::Y, 1.0), SMALL));
        }
    }
    // one that has no depth, and one that looks from afar
    let mut flat = own.clone();
    flat.camera_to_world.matrix3.z_axis = DVec3::ZERO;
    bad.push(record(&scene, &flat, SMALL));
    bad.push(record(&scene, &Camera::look_at(DVec3::new(1e7, 1e7, 1e7), DVec3::ZERO, DVec3::Y, 1e-7), SMALL));
    bad.push(record(
        &scene,
        &Camera { projection: Projection::Orthographic { half_height: 0.0 }, ..own.clone() },
        SMALL,
    ));
    check("stairs", &scene, &good, &bad);
}

#[test]
fn gpu_any_scale_and_place() {
    for (scale, offset) in
        [(1e-3, DVec3::ZERO), (1e6, DVec3::ZERO), (1.0, DVec3::new(1e6, -5e5, 1.5e6)), (1e-3, DVec3::splat(1e3))]
    {
        let place = SceneTransform { scale, offset };
        let scene = analytic::sphere_over_plane(1.0, 1.25, 60.0, place);
        let good = record(&scene, &scene.cameras[0], SMALL);
        let mut nearer = scene.cameras[0].clone();
        nearer.camera_to_world *= DAffine3::from_translation(DVec3::NEG_Z * 0.5 * scale);
        check(&format!("scale {scale}, offset {offset}"), &scene, &good, &[record(&scene, &nearer, SMALL)]);
    }
}

/// Triangles without an area, or hardly any.
#[test]
fn gpu_degenerate_shapes() {
    let mut scene = scene("cornell-spheres");
    let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry else { panic!() };
    let first = mesh.indices[0];
    mesh.indices.extend([[first[0]; 3], [first[0], first[1], first[1]]]);
    // a sliver: thinner than its own rounding
    let at = mesh.positions.len() as u32;
    let corner = mesh.positions[first[0] as usize];
    mesh.positions.extend([corner, corner + 1.0, corner + 0.5 + f32::EPSILON * 0.1]);
    if !mesh.normals.is_empty() {
        mesh.normals.extend([glam::Vec3::Y; 3]);
    }
    mesh.texcoords.iter_mut().filter(|t| !t.is_empty()).for_each(|t| t.extend([glam::Vec2::ZERO; 3]));
    mesh.indices.push([at, at + 1, at + 2]);
    let good = record(&scene, &scene.cameras[0], SMALL);
    check("degenerate shapes", &scene, &good, &[good]);
}
