//! What is left out is counted, and changes nothing.

use glam::DVec3;
use skylit::realtime::{Preset, Resolution, Settings, Technique};

use crate::common::{assert_validation_clean, device, picked, scene, tracer};
use crate::{SIZE, bits, frames, realtime, stepped, traced};

fn covered(realtime: &skylit::realtime::Realtime) -> u64 {
    realtime.coverage().unwrap().iter().filter(|c| **c > 0.0).count() as u64
}

/// Samples that move within their pixels come to rest, too: after the histories are full and their places have been averaged.
#[test]
fn gpu_an_antialiased_image_comes_to_rest() {
    let device = device();
    let scene = scene("stairs");
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    let still = stepped(&scene, SIZE, DVec3::ZERO);
    let moved = stepped(&scene, SIZE, DVec3::X * 0.01);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let settings = Settings { history: 8, antialias: true, ..traced(Preset::Fast) };
        let mut realtime = realtime(&tracer, SIZE, &settings);
        let all = settings.frames_to_rest().unwrap();
        let stats = frames(&mut realtime, &tracer, &still, all);
        // camera rays start elsewhere in each frame; full histories take no more samples
        assert!(stats.iter().all(|s| s.primary_rays == pixels), "{kind}");
        assert!(stats[0].occlusion_rays > pixels / 4, "{kind}");
        let share = stats[all as usize - 1].occlusion_rays as f64 / stats[0].occlusion_rays as f64;
        assert!(share < 0.02, "{kind}: {share} of the rays are traced when histories are full");
        let partly = realtime.coverage().unwrap().iter().filter(|c| **c > 0.01 && **c < 0.99).count();
        assert!(partly > 20, "{kind}: {partly} pixels at edges");
        let before = bits(&realtime.result().unwrap());
        for s in frames(&mut realtime, &tracer, &still, 3) {
            assert_eq!((s.primary_rays, s.occlusion_rays), (0, 0), "{kind}");
        }
        assert!(before == bits(&realtime.result().unwrap()), "{kind}: an image at rest changes");
        let s = realtime.frame(&tracer, &moved, &[]).unwrap();
        assert!(s.primary_rays == pixels && s.occlusion_rays > pixels / 4, "{kind}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_what_has_not_moved_is_not_traced_again() {
    let device = device();
    // with background, and with parts of tiles
    let scene = scene("stairs");
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    let still = stepped(&scene, SIZE, DVec3::ZERO);
    let moved = stepped(&scene, SIZE, DVec3::X * 0.01);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        for (history, rays, rest) in [(8, 1, true), (3, 4, true), (4, 1, false)] {
            let settings = Settings { history, rays_per_pixel: rays, rest, ..traced(Preset::Fast) };
            let mut realtime = realtime(&tracer, SIZE, &settings);
            let stats = frames(&mut realtime, &tracer, &still, history);
            let seen = covered(&realtime);
            assert!(seen > pixels / 4 && seen < pixels, "{seen} of {pixels}");
            for (frame, s) in stats.iter().enumerate() {
                assert_eq!(s.primary_rays, if frame == 0 { pixels } else { 0 }, "{kind}, frame {frame}");
                // background has no rays
                assert_eq!(s.occlusion_rays, seen * u64::from(rays), "{kind}, frame {frame}");
                assert_eq!(s.occlusion_rays + s.skipped_rays, pixels * u64::from(rays), "{kind}, frame {frame}");
            }
            let full = f32::from(history as u16 * rays as u16);
            let (samples, cover) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
            assert!(samples.iter().zip(&cover).all(|(n, c)| *n == full * c), "{kind}: a history that is not full");
            let before = [realtime.result().unwrap(), realtime.unfiltered().unwrap()].map(|v| bits(&v));
            for s in frames(&mut realtime, &tracer, &still, 3) {
                assert_eq!(
                    (s.primary_rays, s.occlusion_rays),
                    (0, if rest { 0 } else { seen * u64::from(rays) }),
                    "{kind}"
                );
            }
            let after = [realtime.result().unwrap(), realtime.unfiltered().unwrap()].map(|v| bits(&v));
            assert_eq!(before == after, rest, "{kind}: an image at rest changes, or one that is not does not");
            // a camera that moves wakes all of it
            let s = realtime.frame(&tracer, &moved, &[]).unwrap();
            assert_eq!((s.primary_rays, s.occlusion_rays), (pixels, covered(&realtime) * u64::from(rays)), "{kind}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_parts_of_the_pixels_are_traced_in_turn() {
    let device = device();
    let scene = scene("stairs");
    // odd sides: the parts are not of one size
    let size = [61, 35];
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        for resolution in Resolution::ALL {
            for rays in [1, 5] {
                let settings = Settings { resolution, rays_per_pixel: rays, ..traced(Preset::Fast) };
                let mut realtime = realtime(&tracer, size, &settings);
                let camera = stepped(&scene, size, DVec3::ZERO);
                let mut before = vec![0.0; (size[0] * size[1]) as usize];
                let (period, mut sum) = (resolution.period(), 0);
                for frame in 0..2 * period {
                    let stats = realtime.frame(&tracer, &camera, &[]).unwrap();
                    sum += stats.occlusion_rays;
                    let (samples, cover) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
                    let mut taken = 0u64;
                    for i in 0..samples.len() {
                        let [x, y] = [i as u32 % size[0], i as u32 / size[0]];
                        let turn = match resolution {
                            Resolution::Full => true,
                            Resolution::Checkerboard => (x + y + frame) % 2 == 0,
                            // opposite corners first
                            Resolution::Half => [[0, 0], [1, 1], [1, 0], [0, 1]][frame as usize % 4] == [x % 2, y % 2],
                        };
                        let new = if turn { rays as f32 * cover[i] } else { 0.0 };
                        assert_eq!(samples[i] - before[i], new, "{kind} {resolution:?}, frame {frame}, pixel {x} {y}");
                        taken += new as u64;
                    }
                    assert_eq!(stats.occlusion_rays, taken, "{kind} {resolution:?}, frame {frame}");
                    before = samples;
                    // where no sample is, neighbours know: no pixel of the first frame is left out
                    if frame == 0 && resolution != Resolution::Full {
                        let (result, own) = (realtime.result().unwrap(), realtime.unfiltered().unwrap());
                        let filled = (0..result.len())
                            .filter(|&i| cover[i] > 0.0 && before[i] == 0.0 && own[i] == 0.0 && result[i] > 0.0);
                        assert!(filled.count() as u64 > taken / u64::from(rays) / 2, "{kind} {resolution:?}");
                    }
                }
                assert_eq!(sum, 2 * covered(&realtime) * u64::from(rays), "{kind} {resolution:?}");
            }
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_the_screen_space_technique_traces_no_occlusion_ray() {
    let device = device();
    let scene = scene("stairs");
    let settings = Settings { technique: Technique::Gtao, ..traced(Preset::Fast) };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let mut realtime = realtime(&tracer, SIZE, &settings);
        let stats = frames(&mut realtime, &tracer, &stepped(&scene, SIZE, DVec3::ZERO), 3);
        assert!(stats.iter().all(|s| s.occlusion_rays == 0), "{kind}");
        let (samples, cover) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
        assert!(samples.iter().zip(&cover).all(|(n, c)| *n == 3.0 * c), "{kind}");
    }
    assert_validation_clean(&device);
}
