//! What frames in real time keep of what is no longer so: thin shadows that move, and what something in front uncovers.

use super::*;
use skylit::integrators::path::{PathIntegrator, PixelFilter};
use skylit::realtime::{Preset, Realtime, Settings};
use skylit::scene::builtin::shapes;
use skylit::scene::{LightKind, Motion};
use skylit::tracer::Changes;

const SIZE: [u32; 2] = [96, 54];

/// A floor, a wall behind it, and thin poles before both, in the sun.
fn poles(width: f64, places: &[f64], sun: DVec3) -> Scene {
    let surface = |color: [f32; 3]| Material { base_color: Vec3::from(color).extend(1.0), ..matte(0.5) };
    let half = 0.5 * width;
    let wall = [
        DVec3::new(-6.0, 0.0, -3.0),
        DVec3::new(6.0, 0.0, -3.0),
        DVec3::new(6.0, 5.0, -3.0),
        DVec3::new(-6.0, 5.0, -3.0),
    ];
    let pole = |x: &f64| {
        let shape = shapes::cuboid(DVec3::new(x - half, 0.0, -half), DVec3::new(x + half, 2.0, half));
        (shape, surface([0.2, 0.3, 0.7]))
    };
    let mut parts = vec![
        (shapes::floor(DVec3::ZERO, 12.0), surface([0.7, 0.7, 0.7])),
        (shapes::quads(&[wall]), surface([0.5, 0.3, 0.2])),
    ];
    parts.extend(places.iter().map(pole));
    let eye = DVec3::new(0.0, 2.2, 6.0);
    let mut scene = scene_of(parts, Camera::look_at(eye, eye + DVec3::new(0.0, -0.2, -1.0), DVec3::Y, 0.785));
    scene.lights.push(Light {
        name: "sun".into(),
        kind: LightKind::Directional { angle: 0.0 },
        intensity: Vec3::splat(3.0),
        position: DVec3::ZERO,
        direction: sun.normalize(),
        range: f64::INFINITY,
    });
    scene
}

fn record(scene: &Scene) -> CameraRecord {
    CameraRecord::new(&scene.cameras[0], scene.origin(), f64::from(SIZE[0]) / f64::from(SIZE[1]))
}

/// The red of a still, filtered as frames are.
fn still(tracer: &Tracer, flat: &FlatScene) -> Vec<f32> {
    let options = PathOptions {
        samples: SampleSettings { pixel_filter: PixelFilter::Box, ..SampleSettings::new(SIZE, 256, 9) },
        ..Default::default()
    };
    let camera = record(flat.scene);
    let mut integrator = PathIntegrator::new(tracer, flat, &options).unwrap();
    red(&integrator
        .render(tracer, &camera, options.samples.spp, options.samples.seed, &mut NoControl)
        .unwrap()
        .image
        .film
        .mean)
}

fn red(values: &[f32]) -> Vec<f32> {
    values.iter().step_by(3).copied().collect()
}

fn frames(tracer: &Tracer, flat: &FlatScene, preset: Preset, seed: u32) -> Realtime {
    let settings = Settings { antialias: true, converge: true, seed, ..preset.settings() };
    let options =
        PathOptions { samples: SampleSettings::new(SIZE, settings.rays_per_pixel, seed), ..Default::default() };
    Realtime::radiance(tracer, flat, SIZE, &settings, &options).unwrap()
}

/// The shadow of a pole is two pixels wide, and moves by as much from frame to frame: where it has come it is nearly as dark as in a still.
#[test]
fn gpu_frames_thin_shadows_move() {
    const LAST: u32 = 15;
    let device = device();
    // sun and pole of a defect: a fifth of the contrast was kept
    let at = |frame: u32| {
        let turn = DMat3::from_rotation_y(-1.0 + f64::from(frame) / 12.0);
        let angle = f64::to_radians(50.0);
        let mut scene = poles(0.12, &[0.0], turn * DVec3::new(0.0, -angle.sin(), -angle.cos()));
        scene.cameras[0] = Camera::look_at(DVec3::new(0.0, 2.2, 6.0), DVec3::new(-0.2, 0.0, -0.8), DVec3::Y, 0.41);
        scene
    };
    let (scene, last, before) = (at(0), at(LAST), at(LAST - 2));
    let [flat, last, before] = [&scene, &last, &before].map(FlatScene::for_paths);
    let [now, past] = [&last, &before].map(|flat| still(&tracer(&device, TracerKind::Compute, flat), flat));
    let darkened: Vec<usize> = (0..now.len()).filter(|&k| now[k] > 0.0 && now[k] < 0.5 * past[k]).collect();
    assert!(darkened.len() >= 8, "{} pixels", darkened.len());
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    for preset in [Preset::Fast, Preset::Balanced, Preset::Quality] {
        let kept = (1..=3).map(|seed| {
            let mut frames = frames(&tracer, &flat, preset, seed);
            for frame in 0..=LAST {
                let posed = at(frame);
                if frame > 0 {
                    frames.move_lights(&tracer, &posed).unwrap();
                }
                frames.frame(&tracer, &record(&posed), &[]).unwrap();
            }
            let image = red(&frames.result().unwrap());
            let sum = |a: &[f32], b: &[f32]| darkened.iter().map(|&k| f64::from(a[k] - b[k])).sum::<f64>();
            sum(&past, &image) / sum(&past, &now)
        });
        let kept = kept.sum::<f64>() / 3.0;
        println!("{preset}: {kept:.2} of the contrast of a shadow in {} pixels", darkened.len());
        assert!((0.7..1.3).contains(&kept), "{preset}: {kept}");
    }
    assert_validation_clean(&device);
}

/// A pole that moves before the edge between floor and wall, whose values are far apart: no clip to values nearby tells that it was there.
#[test]
fn gpu_frames_what_is_uncovered_at_an_edge_has_no_ghost() {
    let device = device();
    let scene = poles(0.2, &[0.0], DVec3::new(0.0, -0.866, -0.5));
    let motion = Motion { instances: vec![2], meshes: Vec::new(), ..Motion::default() };
    let place = |frame: u32| DAffine3::from_translation(DVec3::X * (-1.5 + 0.15 * f64::from(frame)));
    let mut posed = scene.clone();
    posed.instances[2].object_to_world = place(15);
    let flat = FlatScene::for_paths(&posed);
    let truth = still(&tracer(&device, TracerKind::Compute, &flat), &flat);
    // where the pole was, of which column 55 is the edge now
    let behind = (29..32).flat_map(|y| (14..53).map(move |x| y * SIZE[0] as usize + x));
    let flat = FlatScene::with_motion(&scene, motion).unwrap();
    for (preset, kind) in [Preset::Fast, Preset::Balanced, Preset::Quality].into_iter().zip(tracers(&device)) {
        let mut tracer = tracer(&device, kind, &flat);
        let mut frames = frames(&tracer, &flat, preset, 1);
        for frame in 0..16 {
            let moved =
                tracer.update(&Changes { instances: vec![(2, place(frame))], ..Changes::default() }).unwrap().moved;
            frames.frame(&tracer, &record(&scene), &moved).unwrap();
        }
        let image = red(&frames.result().unwrap());
        let worst = behind.clone().map(|k| (image[k] - truth[k]).abs()).fold(0.0, f32::max);
        println!("{kind}, {preset}: off by {worst:.3} at most along the edge");
        assert!(worst < 0.08, "{kind}, {preset}: {worst}");
    }
    assert_validation_clean(&device);
}

/// From a cut on, frames are those of an image that begins there: where it is declared, and where the camera shows other surfaces than before. A small step is no cut.
#[test]
fn gpu_frames_after_a_cut_are_those_of_a_fresh_start() {
    let device = device();
    let scene = poles(0.2, &[0.0], DVec3::new(0.0, -0.866, -0.5));
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let from = DVec3::new(0.0, 1.0, 5.0);
    let view = |eye: DVec3, target: DVec3| {
        CameraRecord::new(
            &Camera::look_at(eye, target, DVec3::Y, 0.7),
            scene.origin(),
            f64::from(SIZE[0]) / f64::from(SIZE[1]),
        )
    };
    let [wall, step] = [0.0, 0.05].map(|x| view(from, DVec3::new(x, 1.5, -3.0)));
    let floor = view(from, DVec3::new(-3.0, 0.0, 4.0));
    for preset in [Preset::Balanced, Preset::Quality] {
        let shown = |frames: &mut Realtime, camera: &CameraRecord, count: u32| -> Vec<Vec<f32>> {
            let one = |_| {
                frames.frame(&tracer, camera, &[]).unwrap();
                frames.result().unwrap()
            };
            (0..count).map(one).collect()
        };
        let after_wall = |declared: bool, camera: &CameraRecord| {
            let mut frames = frames(&tracer, &flat, preset, 3);
            shown(&mut frames, &wall, 6);
            if declared {
                frames.rewind();
            }
            shown(&mut frames, camera, 3)
        };
        let fresh = |camera: &CameraRecord| shown(&mut frames(&tracer, &flat, preset, 3), camera, 3);
        assert!(after_wall(true, &step) == fresh(&step), "{preset}: a cut that is declared");
        assert!(after_wall(false, &floor) == fresh(&floor), "{preset}: a jump to other surfaces");
        assert!(after_wall(false, &step) != fresh(&step), "{preset}: a step is no cut");
    }
    assert_validation_clean(&device);
}
