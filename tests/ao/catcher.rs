//! A ground that catches shadows shows what a scene occludes of it: alpha is 1 - visibility, in closed form.

use glam::{DVec3, Vec3};
use skylit::film::SampleSettings;
use skylit::integrators::ao::Occlusion;
use skylit::scene::{Camera, Geometry, Ground, Scene, Sphere};
use skylit::stress::sampling::{matte, scene_of};

use crate::common::{assert_validation_clean, device, tracer, tracers};
use crate::{AoOptions, render};

/// A sphere of radius 1 on a ground, and a camera above the point at this distance from where it touches.
fn ball(distance: f64) -> (Scene, Camera) {
    let at = DVec3::new(distance, 0.0, 0.0);
    let camera = Camera::look_at(at + DVec3::Y * 20.0, at, DVec3::Z, 1e-3);
    let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::Y, radius: 1.0 }]);
    let mut scene = scene_of(vec![(sphere, matte(0.5))], camera.clone());
    scene.lay_ground(Ground::Catcher, None);
    (scene, camera)
}

#[test]
fn gpu_alpha_is_what_is_occluded() {
    let device = device();
    for (distance, rays) in [(1.25, 1), (2.0, 4), (4.0, 1)] {
        let (scene, camera) = ball(distance);
        let expected = (1.0f64 + distance * distance).powf(-1.5);
        let spp = 4096;
        let samples = SampleSettings::new([8, 8], spp, 0);
        let options = AoOptions { samples, rays, catcher: scene.catcher(), ..AoOptions::default() };
        for kind in tracers(&device) {
            let film = render(&tracer(&device, kind, &scene), &scene, &camera, &options).image.film;
            let alpha = film.coverage.iter().map(|a| f64::from(*a)).sum::<f64>() / 64.0;
            let error = (expected * (1.0 - expected) / f64::from(64 * spp)).sqrt();
            println!("{kind}, {distance}: alpha {alpha:.5}, expected {expected:.5} +- {error:.5}");
            assert!((alpha - expected).abs() < 4.0 * error, "{kind}, {distance}: {alpha} is not {expected}");
            assert!(film.mean.iter().all(|v| *v == 0.0), "{kind}: a shadow is black");
        }
    }
    assert_validation_clean(&device);
}

/// With a falloff the mean is that of the same plane as a surface, and far from everything there is nothing.
#[test]
fn gpu_falloff_fades_into_nothing() {
    let device = device();
    let occlusion = Occlusion::new(f64::INFINITY, 3.0);
    let options = |catcher| AoOptions {
        samples: SampleSettings::new([8, 8], 2048, 0),
        occlusion,
        catcher,
        ..AoOptions::default()
    };
    for distance in [1.25, 2.0, 500.0] {
        let (scene, camera) = ball(distance);
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &scene);
            let plane = render(&tracer, &scene, &camera, &options(None)).image.film;
            let caught = render(&tracer, &scene, &camera, &options(scene.catcher())).image.film;
            let mean = |values: &[f32]| values.iter().map(|v| f64::from(*v)).sum::<f64>() / 64.0;
            let (visible, alpha) = (mean(&plane.mean), mean(&caught.coverage));
            println!("{kind}, {distance}: visibility {visible:.5}, alpha {alpha:.5}");
            assert!((1.0 - visible - alpha).abs() < 3e-3, "{kind}, {distance}: {visible} {alpha}");
            assert!(distance < 100.0 || alpha == 0.0 && plane.coverage[0] == 1.0);
        }
    }
    assert_validation_clean(&device);
}
