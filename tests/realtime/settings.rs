//! What settings may be, and that all of them work: sizes, cameras, numbers of rays.

use glam::DVec3;
use skylit::Error;
use skylit::integrators::ao::Occlusion;
use skylit::realtime::{Filter, Preset, Realtime, Resolution, Settings, Technique};
use skylit::sampling::Sequence;
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::scene::{Camera, Projection};
use skylit::tracer::TracerKind;

use crate::common::{assert_validation_clean, device, picked, record, scene, tracer, tracers};
use crate::{NO_FILTER, SIZE, assert_sound, frames, mean, one_tracer, realtime, reference, rmse, stepped, traced};

#[test]
fn settings_out_of_range_are_named() {
    let good = Settings::default();
    good.check().unwrap();
    for preset in Preset::ALL {
        preset.settings().check().unwrap();
    }
    let filter = |samples| Filter { samples, ..good.filter };
    for (settings, says) in [
        (Settings { rays_per_pixel: 0, ..good }, "rays per pixel"),
        (Settings { rays_per_pixel: Settings::MAX_RAYS + 1, ..good }, "rays per pixel"),
        (Settings { history: 0, ..good }, "history"),
        (Settings { occlusion: Occlusion::new(0.0, 1.0), ..good }, "radius"),
        (Settings { occlusion: Occlusion::new(f64::NAN, 1.0), ..good }, "radius"),
        (Settings { occlusion: Occlusion::new(-1.0, 1.0), ..good }, "radius"),
        (Settings { occlusion: Occlusion::new(f64::INFINITY, 0.5), ..good }, "falloff"),
        (Settings { occlusion: Occlusion::new(f64::INFINITY, f64::NAN), ..good }, "falloff"),
        (Settings { occlusion: Occlusion::new(f64::INFINITY, f64::INFINITY), ..good }, "falloff"),
        (Settings { clamp: -1.0, ..good }, "clamp"),
        (Settings { clamp: f32::NAN, ..good }, "clamp"),
        (Settings { moved_weight: -0.1, ..good }, "moved weight"),
        (Settings { filter: filter(-1.0), ..good }, "filter samples"),
        (Settings { filter: filter(f32::NAN), ..good }, "filter samples"),
    ] {
        let error = settings.check().expect_err(says);
        assert!(matches!(error, Error::Usage(_)) && error.exit_code() == 64, "{error}");
        assert!(error.to_string().contains(says) && !error.to_string().contains('\n'), "{says}: {error}");
    }
    for (history, rays, most) in [(1, 1, 1), (32, 4, 128), (1, 4096, 4096), (u32::MAX, 2, Settings::MAX_SAMPLES)] {
        assert_eq!(Settings { history, rays_per_pixel: rays, ..good }.most_samples(), most);
    }
}

#[test]
fn gpu_bad_settings_and_too_many_rays_are_refused() {
    let device = device();
    let kind = tracers(&device)[0];
    let tracer = tracer(&device, kind, &scene("plane"));
    let refused = |size, settings: &Settings, says: &str| {
        let Err(error) = Realtime::new(&tracer, size, settings, &[]) else { panic!("{says}") };
        assert!(matches!(error, Error::Usage(_)) && error.to_string().contains(says), "{error}");
    };
    refused(SIZE, &Settings { history: 0, ..traced(Preset::Fast) }, "history");
    refused([8000, 8000], &Settings { rays_per_pixel: 4096, ..traced(Preset::Fast) }, "2^32 rays");
    assert_validation_clean(&device);
}

#[test]
fn gpu_images_of_any_size() {
    let device = device();
    let scene = scene("cornell-box");
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        for size in [[1, 1], [7, 5], [1, 17], [33, 1]] {
            let all = [
                traced(Preset::Quality),
                traced(Preset::LarsenFixed),
                traced(Preset::Larsen),
                Settings { technique: Technique::Gtao, ..traced(Preset::Fast) },
            ];
            for base in &all[..if kind == TracerKind::Compute { all.len() } else { 1 }] {
                let mut realtime = realtime(&tracer, size, base);
                for frame in 0..5 {
                    let camera = stepped(&scene, size, DVec3::X * 0.01 * f64::from(frame / 2));
                    realtime.frame(&tracer, &camera, &[]).unwrap();
                    assert_sound(&format!("{kind} {size:?}"), &realtime);
                    assert_eq!(realtime.result().unwrap().len(), (size[0] * size[1]) as usize);
                }
                if base.technique != Technique::Larsen {
                    let (samples, cover) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
                    let without = samples.iter().zip(&cover).filter(|(n, c)| (**n > 0.0) != (**c > 0.0)).count();
                    // one that has just come into sight may have to wait for its turn
                    let most = if base.resolution == Resolution::Full { 0 } else { samples.len() / 3 };
                    assert!(without <= most, "{kind} {size:?}: {without} of {} pixels without samples", samples.len());
                }
                // the box is narrower than the widest of these
                let middle = (size[1] / 2 * size[0] + size[0] / 2) as usize;
                assert_eq!(realtime.coverage().unwrap()[middle], 1.0, "{kind} {size:?}");
            }
        }
    }
    assert_validation_clean(&device);
}

/// Parallel rays: the history is found as well as with others, and the image is right.
#[test]
fn gpu_orthographic_cameras_keep_their_histories() {
    let device = device();
    let scene = scene("stairs");
    let settings = Settings { filter: NO_FILTER, ..traced(Preset::Fast) };
    for kind in one_tracer(&device) {
        let tracer = tracer(&device, kind, &scene);
        let mut realtime = realtime(&tracer, SIZE, &settings);
        let at = |frame: u32| {
            let mut camera =
                Camera { projection: Projection::Orthographic { half_height: 1.7 }, ..scene.cameras[0].clone() };
            let step = DVec3::new(0.012, 0.02, -0.05) * f64::from(frame);
            camera.camera_to_world *= glam::DAffine3::from_translation(step);
            record(&scene, &camera, SIZE)
        };
        for frame in 0..32 {
            realtime.frame(&tracer, &at(frame), &[]).unwrap();
        }
        let (cover, samples) = (realtime.coverage().unwrap(), realtime.samples().unwrap());
        let error = rmse(&realtime.result().unwrap(), &reference(&tracer, SIZE, &settings, &at(31)), &cover);
        let kept = mean((0..samples.len()).filter(|&i| cover[i] > 0.0).map(|i| f64::from(samples[i])));
        println!("{kind}: {kept:.1} samples of 32, error {error:.4}");
        // independent samples of 0 and 1 would be 0.07 off
        assert!(kept > 24.0 && error < 0.08, "{kind}: {kept} samples, error {error}");
    }
    assert_validation_clean(&device);
}

/// A sequence continues from frame to frame: so many rays in one frame are the same rays as in several, and make the same mean.
#[test]
fn gpu_rays_of_one_frame_or_of_many_are_the_same_rays() {
    let device = device();
    let scene = scene("stairs");
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        // any hit, and nearest hits
        let falloffs = if kind == TracerKind::Compute { &[1.0, 5.0][..] } else { &[5.0] };
        for &falloff in falloffs {
            let occlusion = Occlusion::new(f64::INFINITY, falloff);
            let base = Settings {
                sequence: Sequence::Sobol,
                filter: NO_FILTER,
                occlusion,
                history: 64,
                ..traced(Preset::Fast)
            };
            let run = |rays: u32, count: u32| {
                let mut realtime = realtime(&tracer, SIZE, &Settings { rays_per_pixel: rays, ..base });
                frames(&mut realtime, &tracer, &stepped(&scene, SIZE, DVec3::ZERO), count);
                (realtime.result().unwrap(), realtime.samples().unwrap())
            };
            let one = run(12, 1);
            for (rays, count) in [(1, 12), (3, 4), (6, 2)] {
                let many = run(rays, count);
                assert_eq!(one.1, many.1, "{kind}: samples");
                let worst = one.0.iter().zip(&many.0).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                // a dozen additions of numbers up to 12
                assert!(worst < 2e-6, "{kind}, falloff {falloff}: {count} frames of {rays} rays are {worst} off");
            }
        }
    }
    assert_validation_clean(&device);
}

/// More rays than a launch and a submission take: parts are put together rightly.
#[test]
fn gpu_a_thousand_rays_a_pixel() {
    let device = device();
    let scene = analytic::v_groove(1.3, 4.0, 12.0, SceneTransform::default());
    let camera = Camera::look_at(DVec3::new(0.5, 4.0, 0.3), DVec3::Y, DVec3::Z, 0.8);
    // nine launches of 2^19 rays, eight of which are one submission
    let size = [72, 64];
    for kind in one_tracer(&device) {
        let tracer = tracer(&device, kind, &scene);
        let at = record(&scene, &camera, size);
        let run = |rays: u32, seed: u32| {
            let settings = Settings {
                rays_per_pixel: rays,
                history: 1,
                seed,
                filter: NO_FILTER,
                sequence: Sequence::Sobol,
                ..traced(Preset::Fast)
            };
            let mut realtime = realtime(&tracer, size, &settings);
            let stats = frames(&mut realtime, &tracer, &at, 1);
            assert_eq!(stats[0].occlusion_rays, u64::from(size[0] * size[1] * rays), "{kind}");
            assert!(realtime.samples().unwrap().iter().all(|n| *n == rays as f32), "{kind}, {rays} rays");
            realtime.result().unwrap()
        };
        let (many, few) = (run(1000, 0), run(64, 1));
        let error = rmse(&many, &few, &vec![1.0; many.len()]);
        println!("{kind}: 1000 and 64 rays differ by {error:.4}");
        // those of 64 well distributed rays; independent ones would be 0.05 off
        assert!(error > 1e-4 && error < 0.03, "{kind}: {error}");
    }
    assert_validation_clean(&device);
}
