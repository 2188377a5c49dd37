//! Bent normals of frames against what mathematics knows.

use std::f64::consts::PI;

use glam::DVec3;
use skylit::Error;
use skylit::film::camera::CameraRecord;
use skylit::integrators::ao::Occlusion;
use skylit::realtime::{Filter, FilterKind, Preset, Realtime, Settings, Technique};
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::scene::{Camera, Scene};
use skylit::tracer::Tracer;

use crate::common::{assert_validation_clean, device, picked, tracer, tracers};

const SIZE: [u32; 2] = [40, 32];

fn settings() -> Settings {
    Settings { bent: true, ..Preset::Balanced.settings() }
}

/// Makes a frame with each camera, and the last one again until histories are full.
fn settle(tracer: &Tracer, scene: &Scene, cameras: &[Camera], settings: &Settings) -> Realtime {
    let mut realtime = Realtime::new(tracer, SIZE, settings, &[]).unwrap();
    let last = cameras.last().into_iter().cycle().take(settings.history as usize);
    for camera in cameras.iter().chain(last) {
        let record = CameraRecord::new(camera, scene.origin(), f64::from(SIZE[0]) / f64::from(SIZE[1]));
        realtime.frame(tracer, &record, &[]).unwrap();
    }
    realtime
}

/// Mean over the image, and the largest distance of a pixel from `expected`. All pixels must show something.
fn compare(realtime: &Realtime, expected: DVec3) -> (DVec3, f64) {
    assert!(realtime.coverage().unwrap().iter().all(|c| *c == 1.0));
    let bent: Vec<DVec3> = realtime.bent().unwrap().iter().map(|b| DVec3::from_array(b.map(f64::from))).collect();
    let mean = bent.iter().sum::<DVec3>() / bent.len() as f64;
    (mean, bent.iter().map(|b| b.distance(expected)).fold(0.0, f64::max))
}

/// Ways to make frames whose bent normals should not differ.
fn ways() -> [(&'static str, Settings); 5] {
    let filtered = |kind, radius| Settings { filter: Filter { kind, radius, samples: 1024.0 }, ..settings() };
    [
        ("one ray a pixel", settings()),
        ("four rays a pixel", Settings { rays_per_pixel: 4, history: 16, ..settings() }),
        ("with a falloff", Settings { occlusion: Occlusion::new(f64::INFINITY, 1.5), ..settings() }),
        ("not filtered", filtered(FilterKind::None, 0)),
        ("in three steps", filtered(FilterKind::Atrous, 7)),
    ]
}

#[test]
fn gpu_bent_normals_of_a_plane() {
    let device = device();
    let scene = analytic::plane(1e4, SceneTransform::default());
    let expected = DVec3::Y * (2.0 / 3.0);
    // the camera moves for a while: histories are reprojected
    let cameras: Vec<_> = (0..20)
        .map(|k| {
            let eye = DVec3::new(0.02 * f64::from(k), 3.0, 2.0);
            Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.8)
        })
        .collect();
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        for (way, settings) in ways() {
            let (mean, worst) = compare(&settle(&tracer, &scene, &cameras, &settings), expected);
            println!("plane, {kind}, {way}: mean {mean:.5}, worst {worst:.4}");
            assert!(mean.distance(expected) < 2e-3 && worst < 0.1, "{kind}, {way}: mean {mean}, worst {worst}");
        }
    }
    assert_validation_clean(&device);
}

/// In a groove of angle a, the open directions of a wall's cross-section are those from the wall itself (0) to the other one (a). Over
/// the cosine-weighted hemisphere, what lies along the groove integrated, that is 2 / (3 pi) (sin^2 a, a - sin a cos a) along the wall
/// and its normal. Of both walls together it is along the bisector.
#[test]
fn gpu_bent_normals_of_grooves() {
    let device = device();
    for degrees in [60.0f64, 90.0, 130.0] {
        let angle = degrees.to_radians();
        let scene = analytic::v_groove(angle, 1e4, 3e4, SceneTransform::default());
        let (s, c) = (angle * 0.5).sin_cos();
        for kind in picked(&device) {
            let tracer = tracer(&device, kind, &scene);
            let mut sum = DVec3::ZERO;
            for side in [1.0, -1.0] {
                let (up, normal) = (DVec3::new(side * s, c, 0.0), DVec3::new(-side * c, s, 0.0));
                let along = angle.sin().powi(2) * up + (angle - angle.sin() * angle.cos()) * normal;
                let expected = along * (2.0 / (3.0 * PI));
                let point = up + DVec3::Z * 0.5;
                let eye = point + normal * (0.6 * angle.tan().abs().min(1.0));
                let camera = Camera::look_at(eye, point, DVec3::Z, 0.6);
                let (mean, worst) = compare(&settle(&tracer, &scene, &[camera], &settings()), expected);
                println!("groove of {degrees}, {kind}: mean {mean:.5}, expected {expected:.5}, worst {worst:.4}");
                assert!(
                    mean.distance(expected) < 3e-3 && worst < 0.08,
                    "{degrees}, {kind}: {mean} is not {expected}, {worst}"
                );
                sum += mean;
            }
            let bisector = sum.normalize();
            assert!(bisector.distance(DVec3::Y) < 3e-3, "{degrees}, {kind}: {bisector}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_bent_normals_of_a_closed_box() {
    let device = device();
    let scene = analytic::closed_box(2.0, SceneTransform::default());
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let realtime = settle(&tracer, &scene, &scene.cameras[..1], &settings());
        assert!(realtime.bent().unwrap().iter().all(|b| *b == [0.0; 3]), "{kind}");
    }
    assert_validation_clean(&device);
}

/// A feature that is not enabled costs nothing and changes nothing; what is there is 0 where nothing is.
#[test]
fn gpu_bent_normals_are_a_choice() {
    let device = device();
    let scene = skylit::scene::builtin::by_name("stairs").unwrap();
    let kind = tracers(&device)[0];
    let tracer = tracer(&device, kind, &scene);
    let with = settle(&tracer, &scene, &scene.cameras[..1], &settings());
    let without = settle(&tracer, &scene, &scene.cameras[..1], &Settings { bent: false, ..settings() });
    assert_eq!(with.result().unwrap(), without.result().unwrap());
    assert!(matches!(without.bent(), Err(Error::Usage(_))));
    let (bent, coverage, open) = (with.bent().unwrap(), with.coverage().unwrap(), with.result().unwrap());
    for ((b, c), a) in bent.iter().zip(coverage).zip(open) {
        let length = b.iter().map(|x| x * x).sum::<f32>().sqrt();
        assert!(if c == 0.0 { length == 0.0 } else { length <= a + 1e-5 }, "{b:?} is longer than {a}");
    }
    let gtao = Settings { technique: Technique::Gtao, ..settings() };
    assert!(matches!(Realtime::new(&tracer, SIZE, &gtao, &[]), Err(Error::Usage(_))));
    assert_validation_clean(&device);
}
