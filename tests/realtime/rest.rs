//! At rest: the mean of all samples takes over, denoised by non-local means.

use glam::DVec3;
use skylit::film::camera::CameraRecord;
use skylit::realtime::{Preset, Resolution, Settings};
use skylit::scene::Projection;
use skylit::tracer::TracerKind;

use crate::common::{
    InterruptAt, assert_interruptions_leave_histories, assert_validation_clean, device, is_full, picked, record, scene,
    tracer,
};
use crate::{NO_FILTER, SIZE, assert_sound, bits, frames, realtime, rmse, stepped, traced};

/// With few frames it is better than the preset's filter alone with many, and it does not stay there.
#[test]
fn gpu_an_image_at_rest_is_denoised_and_converges() {
    let device = device();
    let scene = scene("stairs");
    let camera = stepped(&scene, SIZE, DVec3::ZERO);
    let holding = Settings { antialias: true, ..traced(Preset::Fast) };
    let converging = Settings { converge: true, ..holding };
    // the mean over places within the pixels, of many rays each, without any filter
    let many = Settings { rays_per_pixel: 32, history: 1, filter: NO_FILTER, seed: 77, ..holding };
    let quick = tracer(&device, TracerKind::Compute, &scene);
    let mut truth = realtime(&quick, SIZE, &many);
    frames(&mut truth, &quick, &camera, 64);
    let truth = truth.result().unwrap();
    let all = vec![1.0; truth.len()];
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let errors = [(holding, 64), (converging, 10), (converging, 64)].map(|(settings, count)| {
            let mut realtime = realtime(&tracer, SIZE, &settings);
            frames(&mut realtime, &tracer, &camera, count);
            assert_sound(&kind.to_string(), &realtime);
            rmse(&realtime.result().unwrap(), &truth, &all)
        });
        println!(
            "{kind}: the filter alone {:.4}, with the mean at rest after 10 frames {:.4}, after 64 {:.4}",
            errors[0], errors[1], errors[2]
        );
        assert!(errors[1] < 0.75 * errors[0] && errors[2] < 0.5 * errors[0], "{kind}: {errors:?}");
    }
    assert_validation_clean(&device);
}

/// What noise explains of differences is averaged, and a camera that moves has nothing of it: the first frames at rest are those of a pipeline that does not converge.
#[test]
fn gpu_the_first_frames_at_rest_are_filtered_as_others() {
    let device = device();
    let scene = scene("stairs");
    let camera = stepped(&scene, SIZE, DVec3::ZERO);
    let holding = Settings { antialias: true, ..traced(Preset::Balanced) };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let images = [false, true].map(|converge| {
            let mut realtime = realtime(&tracer, SIZE, &Settings { converge, ..holding });
            let mut images = Vec::new();
            for count in [1, 15] {
                frames(&mut realtime, &tracer, &camera, count);
                images.push(bits(&realtime.result().unwrap()));
            }
            images
        });
        assert!(images[0][0] == images[1][0], "{kind}: a first frame differs");
        assert!(images[0][1] != images[1][1], "{kind}: nothing is denoised after 16 frames");
    }
    assert_validation_clean(&device);
}

/// After a few frames at rest each pixel has several samples a frame, wherever in the pixel they lie: they are as good as those of frames, and all are counted.
#[test]
fn gpu_long_frames_at_rest_converge_to_what_short_ones_do() {
    let device = device();
    let scene = scene("stairs");
    let mut flat = scene.cameras[0].clone();
    flat.projection = Projection::Orthographic { half_height: 2.0 };
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    let perspective = stepped(&scene, SIZE, DVec3::ZERO);
    for camera in [perspective, record(&scene, &flat, SIZE)] {
        let settings = Settings { antialias: true, converge: true, rest_samples: 256, ..traced(Preset::Fast) };
        let many =
            Settings { rays_per_pixel: 64, history: 1, filter: NO_FILTER, seed: 77, converge: false, ..settings };
        let quick = tracer(&device, TracerKind::Compute, &scene);
        let mut truth = realtime(&quick, SIZE, &many);
        // the mean over places within the pixels
        frames(&mut truth, &quick, &camera, 64);
        let (truth, all) = (truth.result().unwrap(), vec![1.0; pixels as usize]);
        for kind in picked(&device) {
            let tracer = tracer(&device, kind, &scene);
            for settings in [settings, Settings { resolution: Resolution::Half, ..settings }] {
                // what is seen is one image on all tracers; the other cases on one of them
                let is_first = settings.resolution == Resolution::Full && camera == perspective;
                if !is_first && kind != TracerKind::Compute && !is_full() {
                    continue;
                }
                let mut realtime = realtime(&tracer, SIZE, &settings);
                let last = realtime.frames_to_rest().unwrap();
                assert!(last < settings.frames_to_rest().unwrap() / 4, "{kind}: {last} frames");
                let stats = frames(&mut realtime, &tracer, &camera, last);
                let end = &stats[last as usize - 1];
                assert!(end.primary_rays >= 8 * pixels && end.primary_rays.is_multiple_of(pixels), "{kind}: {end:?}");
                assert_eq!(end.occlusion_rays + end.skipped_rays, end.primary_rays, "{kind}");
                assert!(end.occlusion_rays > end.primary_rays / 4, "{kind}: {end:?}");
                assert!((240..300).contains(&realtime.shown_samples()), "{kind}: {}", realtime.shown_samples());
                assert_sound(&kind.to_string(), &realtime);
                let error = rmse(&realtime.result().unwrap(), &truth, &all);
                println!("{kind}: {error:.4} after {last} frames");
                // a mean over places cuts fine steps of coverage
                assert!(error < 0.012, "{kind}, {:?}: {error}", settings.resolution);
                let s = realtime.frame(&tracer, &camera, &[]).unwrap();
                assert_eq!((s.primary_rays, s.occlusion_rays), (0, 0), "{kind}: it is not at rest");
            }
        }
    }
    assert_validation_clean(&device);
}

/// How frames are cut into launches changes nothing, and an image that rests again starts anew.
#[test]
fn gpu_long_frames_do_not_depend_on_launches() {
    let device = device();
    let scene = scene("stairs");
    let camera = stepped(&scene, SIZE, DVec3::ZERO);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let settings = Settings { antialias: true, converge: true, ..traced(Preset::Balanced) };
        let images = [settings.launch_rays, 1000].map(|launch_rays| {
            let mut realtime = realtime(&tracer, SIZE, &Settings { launch_rays, ..settings });
            frames(&mut realtime, &tracer, &camera, 8);
            bits(&realtime.result().unwrap())
        });
        assert!(images[0] == images[1], "{kind}");
    }
    assert_validation_clean(&device);
}

/// Who moves after a rest has the histories of all samples at rest, not of the first frames alone.
#[test]
fn gpu_samples_at_rest_are_histories_in_motion() {
    let device = device();
    let scene = scene("stairs");
    let [camera, moved]: [CameraRecord; 2] = [0.0, 0.01].map(|x| stepped(&scene, SIZE, DVec3::X * x));
    let settings = Settings { filter: NO_FILTER, converge: true, ..traced(Preset::Balanced) };
    let quick = tracer(&device, TracerKind::Compute, &scene);
    let truth = crate::reference(&quick, SIZE, &settings, &moved);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let errors = [(true, 3), (true, 30), (false, 30)].map(|(converge, at_rest)| {
            let mut realtime = realtime(&tracer, SIZE, &Settings { converge, ..settings });
            frames(&mut realtime, &tracer, &camera, at_rest);
            frames(&mut realtime, &tracer, &moved, 1);
            let covered = realtime.coverage().unwrap();
            rmse(&realtime.unfiltered().unwrap(), &truth, &covered)
        });
        println!(
            "{kind}: the first frame in motion, after 3 frames at rest {:.4}, after 30 {:.4}, after 30 short ones {:.4}",
            errors[0], errors[1], errors[2]
        );
        assert!(errors[1] < 0.6 * errors[0] && errors[1] < 1.05 * errors[2], "{kind}: {errors:?}");
    }
    assert_validation_clean(&device);
}

/// Who moves while a frame at rest is computed, which is then interrupted, sees what they would have seen without it.
#[test]
fn gpu_interrupted_frames_leave_histories() {
    let device = device();
    let scene = scene("stairs");
    let cameras = [0.0, 0.01, 0.02].map(|x| stepped(&scene, SIZE, DVec3::X * x));
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let settings = Settings { antialias: true, converge: true, launch_rays: 30_000, ..traced(Preset::Fast) };
        let make = || realtime(&tracer, SIZE, &settings);
        let launches = assert_interruptions_leave_histories(&tracer, &cameras, &make);
        println!("{kind}: {launches} launches");
        assert!(launches > 4, "{kind}: {launches}");
    }
    assert_validation_clean(&device);
}

/// An image that goes on to rest after interruptions counts no sample twice, and becomes what it would have become.
#[test]
fn gpu_an_interrupted_image_converges() {
    let device = device();
    let scene = scene("stairs");
    let camera = stepped(&scene, SIZE, DVec3::ZERO);
    let settings =
        Settings { antialias: true, converge: true, launch_rays: 20_000, rest_samples: 256, ..traced(Preset::Fast) };
    let many = Settings { rays_per_pixel: 64, history: 1, filter: NO_FILTER, seed: 77, converge: false, ..settings };
    let quick = tracer(&device, TracerKind::Compute, &scene);
    let mut truth = realtime(&quick, SIZE, &many);
    frames(&mut truth, &quick, &camera, 64);
    let (truth, all) = (truth.result().unwrap(), vec![1.0; (SIZE[0] * SIZE[1]) as usize]);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let errors = [false, true].map(|is_interrupted| {
            let mut realtime = realtime(&tracer, SIZE, &settings);
            frames(&mut realtime, &tracer, &camera, 8);
            if is_interrupted {
                // in the middle: half of the pixels have this frame's samples
                let outcome = realtime.frame_with(&tracer, &camera, &[], Some(&mut InterruptAt { at: 3, asked: 0 }));
                assert!(outcome.is_err(), "{kind}");
                frames(&mut realtime, &tracer, &camera, 1);
                assert!(realtime.shown_samples() < 8, "{kind}: {} samples", realtime.shown_samples());
            }
            let to_rest = realtime.frames_to_rest().unwrap();
            frames(&mut realtime, &tracer, &camera, to_rest);
            let samples = realtime.shown_samples();
            assert!((240..300).contains(&samples), "{kind}: {samples}");
            assert_sound(&kind.to_string(), &realtime);
            rmse(&realtime.result().unwrap(), &truth, &all)
        });
        println!("{kind}: {:.4} without an interruption, {:.4} after one", errors[0], errors[1]);
        assert!(errors[1] < 1.1 * errors[0], "{kind}: {errors:?}");
    }
    assert_validation_clean(&device);
}

/// An image whose resolution changes goes on with the histories of the one before it.
#[test]
fn gpu_an_image_continues_in_another_size() {
    let device = device();
    let scene = scene("stairs");
    let half = SIZE.map(|n| n / 2);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let settings = Settings { antialias: true, converge: true, bent: true, ..traced(Preset::Fast) };
        let at_rest = |size: [u32; 2], seed, step, count| {
            let mut realtime = realtime(&tracer, size, &Settings { seed, ..settings });
            frames(&mut realtime, &tracer, &stepped(&scene, size, DVec3::X * step), count);
            realtime
        };
        for (from, to) in [(SIZE, half), (half, SIZE)] {
            let (truth, before) = (at_rest(to, 77, 0.01, 64).result().unwrap(), at_rest(from, 0, 0.0, 30));
            let all = vec![1.0; truth.len()];
            let errors = [false, true].map(|continues| {
                let mut realtime = realtime(&tracer, to, &settings);
                assert!(!continues || realtime.continue_from(&tracer, &before, true).unwrap());
                frames(&mut realtime, &tracer, &stepped(&scene, to, DVec3::X * 0.01), 1);
                assert_sound(&kind.to_string(), &realtime);
                rmse(&realtime.result().unwrap(), &truth, &all)
            });
            println!("{kind}, {to:?}: {:.4} without histories, {:.4} continued", errors[0], errors[1]);
            assert!(errors[1] < 0.6 * errors[0], "{kind}, {to:?}: {errors:?}");
        }
        // of another kind
        let mut larsen = realtime(&tracer, SIZE, &Preset::Larsen.settings());
        assert!(!larsen.continue_from(&tracer, &at_rest(half, 0, 0.0, 1), false).unwrap(), "{kind}");
    }
    assert_validation_clean(&device);
}
