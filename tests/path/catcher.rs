//! A ground that catches shadows, against closed forms: what is behind it comes with the share of light that the scene leaves.

use super::*;
use skylit::integrators::backdrop::Backdrop;
use skylit::integrators::path::{PathIntegrator, PathKernel, PixelFilter};
use skylit::realtime::{Filter, FilterKind, Preset, Realtime, Settings};
use skylit::scene::{EnvironmentMap, Ground, Sphere};

/// A sphere of radius 1 that touches the plane y = 0 at the origin, seen from above at a point at this distance from there.
fn ball(distance: f64, environment: Environment) -> Scene {
    let at = DVec3::new(distance, 0.0, 0.0);
    let camera = Camera::look_at(at + DVec3::Y * 20.0, at, DVec3::Z, 1e-3);
    let sphere = Geometry::Spheres(vec![Sphere { center: Vec3::Y, radius: 1.0 }]);
    Scene { environment, ..scene_of(vec![(sphere, matte(0.5))], camera) }
}

/// The share of a horizontal plane's irradiance by a constant sky that such a sphere keeps: its form factor.
fn hidden_share(distance: f64) -> f64 {
    (1.0 + distance * distance).powf(-1.5)
}

fn caught(mut scene: Scene, height: f64) -> (Scene, Option<u32>) {
    scene.lay_ground(Ground::Catcher, Some(height));
    let catcher = scene.catcher();
    (scene, catcher)
}

fn film(kind: TracerKind, scene: &Scene, options: &PathOptions) -> Film {
    let flat = FlatScene::for_paths(scene);
    render(&tracer(&device(), kind, &flat), &flat, options).image.film
}

fn options(catcher: Option<u32>, spp: u32) -> PathOptions {
    PathOptions { samples: SampleSettings::new([8, 8], spp, 0), catcher, ..Default::default() }
}

fn sun(irradiance: f32, direction: DVec3) -> Light {
    Light {
        name: String::new(),
        kind: LightKind::Directional { angle: 0.0 },
        intensity: Vec3::splat(irradiance),
        position: DVec3::ZERO,
        direction: direction.normalize(),
        range: f64::INFINITY,
    }
}

fn alpha(film: &Film) -> f64 {
    film.coverage.iter().map(|a| f64::from(*a)).sum::<f64>() / film.coverage.len() as f64
}

/// A sky of seven colours.
fn colours() -> EnvironmentMap {
    let colour = |k: usize| Vec3::new(0.1, 0.2, 0.4) * (1.0 + (k % 7) as f32);
    EnvironmentMap::new("colours", [16, 8], (0..128).map(colour).collect())
}

/// Where nothing is occluded, the image is that without a ground, to the bit, before any environment and under any lights.
#[test]
fn gpu_unoccluded_catchers_show_what_is_behind() {
    let device = device();
    let map = Environment::Map(colours());
    for environment in [Environment::Uniform(Vec3::new(0.25, 0.5, 1.0)), map, Environment::Black] {
        let has_sky = environment != Environment::Black;
        let mut scene = ball(0.0, environment);
        scene.cameras[0] = Camera::look_at(DVec3::new(0.0, 9.0, 9.0), DVec3::Y * 3.0, DVec3::Y, 0.8);
        scene.lights = vec![sun(2.0, DVec3::new(1.0, -2.0, 0.5))];
        // all of the scene is below the ground; without the ground nothing is seen, either
        let below = Scene {
            instances: vec![Instance {
                object_to_world: DAffine3::from_translation(DVec3::Y * -500.0),
                ..scene.instances[0].clone()
            }],
            ..scene.clone()
        };
        let (scene, catcher) = caught(scene, 3.0);
        for kind in tracers(&device) {
            let all = [Backdrop::Map, Backdrop::Blurred, Backdrop::Transparent];
            // the others are the same code
            let is_compute = kind == TracerKind::Compute;
            for &backdrop in if is_compute { &all[..] } else { &all[..usize::from(has_sky)] } {
                let options = PathOptions { backdrop, ..options(catcher, 8) };
                let with = film(kind, &scene, &options);
                let without = film(kind, &below, &PathOptions { catcher: None, ..options });
                assert_eq!(with.mean, without.mean, "{kind} {backdrop}");
                assert!(with.coverage.iter().all(|a| *a == 0.0), "{kind} {backdrop}");
                assert_eq!(with.mean.iter().any(|v| *v > 0.0), has_sky && backdrop != Backdrop::Transparent);
            }
        }
    }
    assert_validation_clean(&device);
}

/// The shadow of a sphere under a constant sky, by every tracer and by both schedules of paths.
#[test]
fn gpu_shadow_of_a_sphere_under_a_constant_sky() {
    let device = device();
    for distance in [1.25, 2.0, 4.0] {
        let expected = hidden_share(distance);
        let (scene, catcher) = caught(ball(distance, Environment::Uniform(Vec3::splat(2.0))), 0.0);
        for kind in tracers(&device) {
            let before = film(kind, &scene, &options(catcher, 1024));
            let (mean, error) = mean_of(&before);
            println!("{kind}, {distance}: {mean:.5} +- {error:.5}, expected {:.5}", 2.0 * (1.0 - expected));
            assert!(error < 0.01 && (mean - 2.0 * (1.0 - expected)).abs() < 5.0 * error + 1e-4, "{kind} {distance}");
            assert!((alpha(&before) - (1.0 - mean / 2.0)).abs() < 1e-4, "{kind} {distance}: alpha is what is missing");
            let hidden = PathOptions { backdrop: Backdrop::Transparent, ..options(catcher, 1024) };
            let hidden = film(kind, &scene, &hidden);
            assert!(hidden.mean.iter().all(|v| *v == 0.0) && hidden.coverage == before.coverage);
        }
        let wavefront = PathOptions { kernel: PathKernel::Wavefront, ..options(catcher, 64) };
        let [a, b] = [options(catcher, 64), wavefront].map(|o| film(TracerKind::Compute, &scene, &o));
        assert_eq!((a.mean, a.coverage), (b.mean, b.coverage), "{distance}: the megakernel and the wavefront");
    }
    assert_validation_clean(&device);
}

/// A sun that is hidden takes its share of the light with it, and the sphere that of the sky; in the light of the sun alone a shadow is black.
#[test]
fn gpu_shadow_under_sun_and_sky() {
    let device = device();
    let (distance, to_sphere) = (2.0, DVec3::new(2.0, -1.0, 0.0));
    let cosine = -to_sphere.normalize().y as f32;
    // irradiance pi by the sky, and as much by the sun
    for (sky, expected) in [(1.0, 0.5 * (1.0 - hidden_share(distance))), (0.0, 0.0)] {
        let mut scene = ball(distance, Environment::Uniform(Vec3::splat(sky)));
        scene.lights = vec![sun(std::f32::consts::PI / cosine, to_sphere)];
        let (scene, catcher) = caught(scene, 0.0);
        for kind in picked(&device) {
            let film = film(kind, &scene, &options(catcher, 1024));
            let (mean, error) = mean_of(&film);
            println!("{kind}, sky {sky}: {mean:.5} +- {error:.5}, expected {expected:.5}");
            assert!((mean - expected).abs() < 5.0 * error + 1e-3, "{kind} {sky}: {mean} +- {error}, not {expected}");
            assert!(sky > 0.0 || alpha(&film) == 1.0);
        }
    }
    assert_validation_clean(&device);
}

const FRAME: [u32; 2] = [32, 18];

/// A sphere and its shadow before a sky of colours, under a sun, seen from the side.
fn shadow() -> (Scene, Option<u32>) {
    let mut scene = ball(0.0, Environment::Map(colours()));
    scene.cameras[0] = Camera::look_at(DVec3::new(1.0, 4.0, 6.0), DVec3::Y * 0.5, DVec3::Y, 0.7);
    scene.lights = vec![sun(3.0, DVec3::new(1.0, -2.0, 0.5))];
    caught(scene, 0.0)
}

fn frame_options(catcher: Option<u32>, backdrop: Backdrop, spp: u32, filter: PixelFilter) -> PathOptions {
    let samples = SampleSettings { pixel_filter: filter, ..SampleSettings::new(FRAME, spp, 5) };
    PathOptions { samples, catcher, backdrop, ..Default::default() }
}

fn rmse(a: &[f32], b: &[f32]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Without history and filter a frame in real time is the still of its samples, alpha included, by every tracer.
#[test]
fn gpu_frames_catch_what_stills_do() {
    let device = device();
    let (scene, catcher) = shadow();
    let flat = FlatScene::for_paths(&scene);
    let camera = CameraRecord::new(&scene.cameras[0], flat.origin, 16.0 / 9.0);
    let filter = Filter { kind: FilterKind::None, radius: 0, samples: 0.0 };
    let settings = Settings { rays_per_pixel: 12, history: 1, filter, seed: 5, ..Preset::Balanced.settings() };
    for backdrop in [Backdrop::Map, Backdrop::Transparent] {
        let options = frame_options(catcher, backdrop, 12, PixelFilter::Centre);
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &flat);
            let still = render(&tracer, &flat, &options).image.film;
            let mut frames = Realtime::radiance(&tracer, &flat, FRAME, &settings, &options).unwrap();
            frames.frame(&tracer, &camera, &[]).unwrap();
            let (image, coverage) = (frames.result().unwrap(), frames.coverage().unwrap());
            for (k, (got, want)) in image.iter().zip(&still.mean).enumerate() {
                let limit = 2e-5 * want.abs().max(0.01);
                assert!((got - want).abs() <= limit, "{kind} {backdrop}: value {k} is {got}, of a still {want}");
            }
            for (k, (got, want)) in coverage.iter().zip(&still.coverage).enumerate() {
                assert!((got - want).abs() <= 1e-5, "{kind} {backdrop}: alpha {k} is {got}, of a still {want}");
            }
            let partly = coverage.iter().filter(|a| (0.1..0.9).contains(*a)).count();
            assert!(partly > 20, "{kind}: {partly} pixels are in the shadow");
        }
    }
    assert_validation_clean(&device);
}

/// At rest the filtered shadow becomes that of a still of as many samples, before a sky and before nothing; a camera that moves has a shadow with little noise.
#[test]
fn gpu_frames_at_rest_catch_what_a_still_does() {
    let device = device();
    let (scene, catcher) = shadow();
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let at = |x: f64| {
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world = DAffine3::from_translation(DVec3::X * x) * camera.camera_to_world;
        CameraRecord::new(&camera, flat.origin, 16.0 / 9.0)
    };
    let settings = Settings { antialias: true, converge: true, ..Preset::Balanced.settings() };
    for backdrop in [Backdrop::Map, Backdrop::Transparent] {
        let options = frame_options(catcher, backdrop, 4096, PixelFilter::Box);
        let mut integrator = PathIntegrator::new(&tracer, &flat, &options).unwrap();
        let mut still = |camera: &CameraRecord, spp, seed| {
            let film = integrator.render(&tracer, camera, spp, seed, &mut NoControl).unwrap().image.film;
            (film.mean, film.coverage)
        };
        let mut frames = Realtime::radiance(&tracer, &flat, FRAME, &settings, &options).unwrap();

        // in motion: noise of one path a pixel would be an error of 0.3 in the shadow
        for k in 0..24 {
            frames.frame(&tracer, &at(0.01 * f64::from(k)), &[]).unwrap();
        }
        let last = at(0.23);
        let (truth, truth_alpha) = still(&last, 4096, 1);
        let moving = rmse(&frames.coverage().unwrap(), &truth_alpha);
        assert!(frames.coverage().unwrap().iter().all(|a| (0.0..=1.0).contains(a)));

        // at rest
        for _ in 0..64 {
            frames.frame(&tracer, &last, &[]).unwrap();
        }
        let samples = frames.shown_samples();
        let (same, same_alpha) = still(&last, samples, 2);
        let errors = [rmse(&frames.result().unwrap(), &truth), rmse(&frames.coverage().unwrap(), &truth_alpha)];
        let expected = [rmse(&same, &truth), rmse(&same_alpha, &truth_alpha)];
        println!(
            "{backdrop}: alpha in motion {moving:.4}; at rest {errors:.5?}, of a still of {samples} samples {expected:.5?}"
        );
        assert!(moving < 0.06, "{backdrop}: {moving}");
        // as for light on surfaces: the mean of frames weighs later ones more than earlier ones
        assert!(
            (0..2).all(|k| errors[k] <= 1.6 * expected[k] + 1e-5),
            "{backdrop}: {errors:?}, of a still {expected:?}"
        );
    }
    assert_validation_clean(&device);
}
