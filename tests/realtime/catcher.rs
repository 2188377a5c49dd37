//! Frames of ambient occlusion show what a ground catches: alpha is 1 - visibility, and at rest that of a still.

use glam::{DVec3, Vec3};
use skylit::film::{NoControl, SampleSettings};
use skylit::integrators::ao::{self, AoOptions, Occlusion};
use skylit::realtime::{Preset, Realtime, Settings};
use skylit::scene::{Camera, Geometry, Ground, Scene, Sphere};
use skylit::stress::sampling::{matte, scene_of};
use skylit::tracer::TracerKind;

use crate::common::{assert_validation_clean, device, tracer, tracers};
use crate::{SIZE, frames, mean, realtime, rmse, stepped, traced};

/// Three spheres, two of which touch the ground.
fn caught() -> (Scene, Option<u32>) {
    let camera = Camera::look_at(DVec3::new(1.0, 4.0, 7.0), DVec3::Y * 0.7, DVec3::Y, 0.7);
    let sphere = |x: f32, y: f32, radius| Sphere { center: Vec3::new(x, y, 0.0), radius };
    let spheres = vec![sphere(0.0, 1.0, 1.0), sphere(2.0, 0.5, 0.5), sphere(-2.0, 1.2, 0.7)];
    let mut scene = scene_of(vec![(Geometry::Spheres(spheres), matte(0.5))], camera);
    scene.lay_ground(Ground::Catcher, None);
    let catcher = scene.catcher();
    (scene, catcher)
}

/// Alpha of the pixels that show the ground alone, of a plane that was rendered as a surface: 1 - visibility.
fn ground(realtime: &Realtime, plane: &Realtime) -> Vec<(f32, f32)> {
    let (alpha, value) = (realtime.coverage().unwrap(), realtime.result().unwrap());
    let visible = plane.result().unwrap();
    let all = alpha.into_iter().zip(value).zip(visible);
    // the ground is black, and nothing else is that is seen from outside
    all.filter(|((_, value), visible)| *value == 0.0 && *visible > 0.0)
        .map(|((alpha, _), v)| (alpha, 1.0 - v))
        .collect()
}

/// Every tracer, rasterization and the screen-space technique: in motion a catcher is what a plane is that is shown as alpha.
#[test]
fn gpu_frames_show_occlusion_of_the_ground_alone() {
    let device = device();
    let (scene, catcher) = caught();
    let occlusion = Occlusion::new(2.0, 1.0);
    let variants = [
        traced(Preset::Balanced),
        Preset::Balanced.settings(),
        Settings { technique: skylit::realtime::Technique::Gtao, ..traced(Preset::Balanced) },
    ];
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        // what comes after tracing is the same on all
        let count = if kind == TracerKind::Compute { variants.len() } else { 1 };
        for settings in &variants[..count] {
            let plane = Settings { occlusion, antialias: false, converge: false, ..*settings };
            let [mut plain, mut caught] =
                [None, catcher].map(|catcher| realtime(&tracer, SIZE, &Settings { catcher, ..plane }));
            for k in 0..6 {
                let camera = stepped(&scene, SIZE, DVec3::X * 0.01 * f64::from(k));
                frames(&mut plain, &tracer, &camera, 1);
                frames(&mut caught, &tracer, &camera, 1);
            }
            let pairs = ground(&caught, &plain);
            assert!(pairs.len() > 500, "{kind}: the ground has {} pixels", pairs.len());
            let worst = pairs.iter().map(|(alpha, hidden)| (alpha - hidden).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-5, "{kind} {:?}: {worst}", settings.technique);
            assert!(pairs.iter().any(|(alpha, _)| *alpha > 0.2) && pairs.iter().any(|(alpha, _)| *alpha < 0.05));
        }
    }
    assert_validation_clean(&device);
}

/// At rest value and alpha are those of a still, with and without a falloff; who moves on has the shadow, not a black ground.
#[test]
fn gpu_catchers_at_rest_are_those_of_a_still() {
    let device = device();
    let (scene, catcher) = caught();
    let all = vec![1.0; (SIZE[0] * SIZE[1]) as usize];
    let tracer = tracer(&device, TracerKind::Compute, &scene);
    for falloff in [1.0, 2.0] {
        let occlusion = Occlusion::new(2.0, falloff);
        let camera = stepped(&scene, SIZE, DVec3::ZERO);
        let options =
            AoOptions { samples: SampleSettings::new(SIZE, 1024, 3), occlusion, catcher, ..AoOptions::default() };
        let still = ao::render(&tracer, &camera, &options, &mut NoControl).unwrap().image.film;
        let settings = Settings { occlusion, antialias: true, converge: true, catcher, ..traced(Preset::Balanced) };
        let mut realtime = realtime(&tracer, SIZE, &settings);
        let last = realtime.frames_to_rest().unwrap();
        frames(&mut realtime, &tracer, &camera, last);
        let samples = realtime.shown_samples();
        let [value, alpha] =
            [(realtime.result().unwrap(), &still.mean), (realtime.coverage().unwrap(), &still.coverage)]
                .map(|(got, want)| rmse(&got, want, &all));
        println!("falloff {falloff}: error of the value {value:.4}, of alpha {alpha:.4}, {samples} samples");
        // noise of samples that are 0 or 1, where half of them are, would be 0.5 / sqrt(samples)
        assert!(value < 0.015 && alpha < 0.015, "falloff {falloff}: {value}, {alpha}");

        // the next frame in motion has the history of the rest
        let moved = stepped(&scene, SIZE, DVec3::X * 0.01);
        frames(&mut realtime, &tracer, &moved, 1);
        let covers = |values: &[f32]| mean(values.iter().map(|a| f64::from(*a)));
        let (before, after) = (covers(&still.coverage), covers(&realtime.coverage().unwrap()));
        assert!((before - after).abs() < 0.01, "falloff {falloff}: alpha {before} becomes {after}");
    }
    assert_validation_clean(&device);
}
