//! Rays shared out by what pixels know: as many as they should be, and means that stay right.

use glam::DVec3;
use skylit::Error;
use skylit::realtime::{Budget, Preset, Realtime, Resolution, Settings, Technique};
use skylit::sampling::Sequence;
use skylit::scene::builtin::{SceneTransform, analytic, by_name};
use skylit::scene::{Camera, Orbit};

use crate::common::{assert_validation_clean, device, record, tracer, tracers};

const SIZE: [u32; 2] = [96, 64];

fn settings() -> Settings {
    Settings { budget: Budget::Variance, ..Preset::Balanced.settings() }
}

fn covered(realtime: &Realtime) -> f64 {
    realtime.coverage().unwrap().iter().map(|c| f64::from(*c)).sum()
}

#[test]
fn gpu_budgets_are_met() {
    let device = device();
    let scene = by_name("stairs").unwrap();
    let orbit = Orbit::vertical(DVec3::ZERO, 360.0).unwrap();
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        for (rays, resolution) in [(1, Resolution::Full), (1, Resolution::Checkerboard), (3, Resolution::Full)] {
            let settings = Settings { rays_per_pixel: rays, resolution, history: 16, ..settings() };
            let mut realtime = Realtime::new(&tracer, SIZE, &settings, &[]).unwrap();
            let (mut sum, mut wanted) = (0.0, 0.0);
            for frame in 0..24 {
                let camera = record(&scene, &orbit.camera_at(&scene.cameras[0], f64::from(frame)), SIZE);
                let found = realtime.frame(&tracer, &camera, &[]).unwrap().occlusion_rays as f64;
                let budget = covered(&realtime) * f64::from(rays) / f64::from(resolution.period());
                // what is wished for is estimated from a sixteenth of the pixels, of which a small image has few
                assert!((found / budget - 1.0).abs() < 0.25, "{kind}, {rays} rays, frame {frame}: {found} of {budget}");
                (sum, wanted) = (sum + found, wanted + budget);
            }
            let known = realtime.samples().unwrap().iter().map(|n| f64::from(*n)).sum::<f64>() / covered(&realtime);
            println!("{kind}, {rays} rays, {resolution:?}: {:.4} of the budget, {known:.1} samples", sum / wanted);
            assert!(known > 8.0 * f64::from(rays), "{kind}, {rays} rays: histories of {known} samples");
            assert!((sum / wanted - 1.0f64).abs() < 0.04, "{kind}, {rays} rays: {sum} of {wanted}");
        }
        // while nothing moves, until histories are full: as many as a uniform budget takes. With `sobol` some go on: docs/realtime.md
        let blue = Settings { sequence: Sequence::Blue, history: 16, ..settings() };
        let mut realtime = Realtime::new(&tracer, SIZE, &blue, &[]).unwrap();
        let camera = record(&scene, &scene.cameras[0], SIZE);
        let counts: Vec<u64> = (0..60).map(|_| realtime.frame(&tracer, &camera, &[]).unwrap().occlusion_rays).collect();
        let share = counts.iter().sum::<u64>() as f64 / (16.0 * covered(&realtime));
        assert!((share - 1.0).abs() < 0.25, "{kind}: {share} of the budget at rest");
        assert!((counts[59] as f64) < 0.05 * covered(&realtime), "{kind}: {} rays at rest", counts[59]);
    }
    assert_validation_clean(&device);
}

/// A groove of a right angle: each point of it sees half of what it would, and its samples have the most variance there is.
#[test]
fn gpu_budgets_keep_means() {
    let device = device();
    let angle = 90f64.to_radians();
    let (s, c) = (angle * 0.5).sin_cos();
    let scene = analytic::v_groove(angle, 1e4, 3e4, SceneTransform::default());
    let point = DVec3::new(s, c, 0.5);
    let camera = record(&scene, &Camera::look_at(point + DVec3::new(-c, s, 0.0) * 0.6, point, DVec3::Z, 0.6), SIZE);
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        for sequence in [Sequence::Blue, Sequence::White] {
            let mut realtime = Realtime::new(&tracer, SIZE, &Settings { sequence, bent: true, ..settings() }, &[]).unwrap();
            (0..48).for_each(|_| drop(realtime.frame(&tracer, &camera, &[]).unwrap()));
            let result = realtime.result().unwrap();
            let mean = result.iter().map(|v| f64::from(*v)).sum::<f64>() / result.len() as f64;
            println!("{kind}, {}: {mean:.5}", sequence.name());
            assert!((mean - 0.5).abs() < 4e-3, "{kind}, {}: {mean}", sequence.name());
            // 2 / (3 pi) (sin^2 a, a - sin a cos a) along the wall and its normal
            let bent = realtime.bent().unwrap();
            let bent: DVec3 = bent.iter().map(|b| DVec3::from_array(b.map(f64::from))).sum::<DVec3>() / bent.len() as f64;
            let along = DVec3::new(s, c, 0.0) + DVec3::new(-c, s, 0.0) * angle;
            let expected = along * (2.0 / (3.0 * std::f64::consts::PI));
            assert!(bent.distance(expected) < 5e-3, "{kind}, {}: {bent}, not {expected}", sequence.name());
        }
    }
    assert_validation_clean(&device);
}

/// Rays are listed in any order, and end in the same image.
#[test]
fn gpu_budgets_give_the_same_image_again() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let orbit = Orbit::vertical(DVec3::new(0.0, 1.0, 0.0), 360.0).unwrap();
    let tracer = tracer(&device, tracers(&device)[0], &scene);
    let run = || {
        let mut realtime = Realtime::new(&tracer, SIZE, &settings(), &[]).unwrap();
        for frame in 0..12 {
            let camera = record(&scene, &orbit.camera_at(&scene.cameras[0], f64::from(frame / 2)), SIZE);
            realtime.frame(&tracer, &camera, &[]).unwrap();
        }
        (realtime.result().unwrap(), realtime.samples().unwrap())
    };
    assert!(run() == run());
    assert_validation_clean(&device);
}

#[test]
fn gpu_budgets_that_make_no_sense() {
    let device = device();
    let scene = by_name("plane").unwrap();
    let tracer = tracer(&device, tracers(&device)[0], &scene);
    for wrong in [
        Settings { rays_per_pixel: 5, ..settings() },
        Settings { history: 1, ..settings() },
        Settings { technique: Technique::Gtao, ..settings() },
    ] {
        assert!(matches!(Realtime::new(&tracer, SIZE, &wrong, &[]), Err(Error::Usage(_))));
    }
}
