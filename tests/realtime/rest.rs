//! At rest: the mean of all samples takes over, denoised by non-local means.

use glam::DVec3;
use skylit::realtime::{Preset, Settings};
use skylit::tracer::TracerKind;

use crate::common::{assert_validation_clean, device, scene, tracer, tracers};
use crate::{NO_FILTER, SIZE, assert_sound, bits, frames, realtime, rmse, stepped, traced};

/// With few frames it is better than the preset's filter alone, and it does not stay there.
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
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let errors = [(holding, 64), (converging, 64), (converging, 256)].map(|(settings, count)| {
            let mut realtime = realtime(&tracer, SIZE, &settings);
            frames(&mut realtime, &tracer, &camera, count);
            assert_sound(&kind.to_string(), &realtime);
            rmse(&realtime.result().unwrap(), &truth, &all)
        });
        println!(
            "{kind}: the filter alone {:.4}, with the mean at rest {:.4}, after 256 frames {:.4}",
            errors[0], errors[1], errors[2]
        );
        assert!(errors[1] < 0.85 * errors[0], "{kind}: {errors:?}");
        assert!(errors[2] < 0.7 * errors[1], "{kind}: {errors:?}");
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
    for kind in tracers(&device) {
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
