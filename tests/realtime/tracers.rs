//! Three tracers, one image; rasterized or traced, one image; the same run, the same bits.

use glam::DVec3;
use skylit::integrators::ao::Occlusion;
use skylit::raster::Primary;
use skylit::realtime::{Preset, Realtime, Settings};
use skylit::scene::Scene;
use skylit::tracer::Tracer;

use crate::common::{assert_validation_clean, device, scene, tracer, tracers};
use crate::{NO_FILTER, SIZE, bits, mean, realtime, stepped, traced};

/// Histories and results of two frames from one place and four from others.
fn run(tracer: &Tracer, scene: &Scene, settings: &Settings) -> Vec<[Vec<f32>; 3]> {
    let mut realtime = realtime(tracer, SIZE, settings);
    (0..6)
        .map(|frame| {
            let step = f64::from(u32::saturating_sub(frame, 1)) * 0.02;
            realtime.frame(tracer, &stepped(scene, SIZE, DVec3::new(1.0, 0.4, -0.7) * step), &[]).unwrap();
            let samples = realtime.samples().unwrap();
            [realtime.unfiltered().unwrap(), realtime.result().unwrap(), samples]
        })
        .collect()
}

/// Share of pixels that differ by more than rounding, of histories and of results, and difference of the means of results.
fn differences(a: &[[Vec<f32>; 3]], b: &[[Vec<f32>; 3]]) -> ([f64; 2], f64) {
    let share = |k: usize| {
        let pairs = || a.iter().zip(b).flat_map(|(a, b)| a[k].iter().zip(&b[k]));
        mean(pairs().map(|(a, b)| if (a - b).abs() > 1e-4 { 1.0 } else { 0.0 }))
    };
    let pairs = a.iter().zip(b).flat_map(|(a, b)| a[1].iter().zip(&b[1]));
    ([share(0), share(1)], mean(pairs.map(|(a, b)| f64::from(a - b))).abs())
}

/// A ray that passes an edge within rounding is turned: one sample of a pixel, which its history and its filter's box of 7x7 keep. Up to
/// one pixel of 2000 in the histories of six frames may have one, and one of 200 in the results; on Mesa 25 none has.
#[test]
fn gpu_three_tracers_one_image() {
    let device = device();
    let kinds = tracers(&device);
    for (name, falloff) in [("leaf-cards", 1.0), ("cornell-spheres", 4.0), ("grid:2", 1.0), ("stairs", 4.0)] {
        let scene = scene(name);
        let settings = Settings { occlusion: Occlusion::new(3.0, falloff), ..traced(Preset::Balanced) };
        let runs: Vec<_> = kinds.iter().map(|&kind| run(&tracer(&device, kind, &scene), &scene, &settings)).collect();
        for (kind, other) in kinds.iter().zip(&runs).skip(1) {
            let (shares, by) = differences(&runs[0], other);
            println!("{name}, falloff {falloff}: {} and {kind}: shares {shares:.5?}, means by {by:.1e}", kinds[0]);
            assert!(
                shares[0] <= 5e-4 && shares[1] <= 5e-3 && by <= 2e-5,
                "{name}: {} and {kind}: {shares:?} {by}",
                kinds[0]
            );
        }
        // another seed is another image, so the comparison sees something
        let other = run(&tracer(&device, kinds[0], &scene), &scene, &Settings { seed: 1, ..settings });
        assert!(differences(&runs[0], &other).0[0] > 0.1);
    }
    assert_validation_clean(&device);
}

/// Edges are rasterized within a fraction of a pixel of where rays find them: a pixel of 500 shows another surface, and one of 100 has such a
/// pixel in its filter's box.
#[test]
fn gpu_rasterized_and_traced_images_agree() {
    skylit::gpu::environment::prefer_vector_bits(256);
    let device = device();
    if !device.info.can_rasterise() {
        println!("skipped: the device lacks {:?}", device.info.missing_raster);
        return;
    }
    let kind = *tracers(&device).last().unwrap();
    for name in ["cornell-box", "leaf-cards", "cornell-spheres", "grid:2"] {
        let scene = scene(name);
        let tracer = tracer(&device, kind, &scene);
        let [a, b] = [Primary::Traced, Primary::Raster]
            .map(|primary| run(&tracer, &scene, &Settings { primary: Some(primary), ..Preset::Balanced.settings() }));
        let (shares, by) = differences(&a, &b);
        println!("{name}: drawn and traced: shares {shares:.5?}, means by {by:.1e}");
        assert!(shares[0] <= 2e-3 && shares[1] <= 0.01 && by <= 2e-4, "{name}: {shares:?} {by}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_the_same_run_has_the_same_bits_and_another_seed_other_noise() {
    let device = device();
    let scene = scene("stairs");
    let whole = |run: &[[Vec<f32>; 3]]| run.iter().flatten().map(|v| bits(v)).collect::<Vec<_>>();
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        for settings in [
            traced(Preset::Fast),
            Settings { occlusion: Occlusion::new(f64::INFINITY, 3.0), ..traced(Preset::Quality) },
        ] {
            let first = run(&tracer, &scene, &settings);
            assert!(whole(&first) == whole(&run(&tracer, &scene, &settings)), "{kind}: other bits");
            let other = run(&tracer, &scene, &Settings { seed: 5, ..settings });
            let (shares, by) = differences(&first, &other);
            println!("{kind}: another seed changes {shares:.3?} of the pixels and the mean by {by:.1e}");
            // half a pixel's noise of six frames in each of 5184 pixels would be 3e-3
            assert!(shares[0] > 0.1 && by < 3e-3, "{kind}: {shares:?} {by}");
        }
    }
    assert_validation_clean(&device);
}

/// A renderer that starts again forgets all.
#[test]
fn gpu_after_a_reset_nothing_is_known() {
    let device = device();
    let scene = scene("stairs");
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let settings = Settings { filter: NO_FILTER, ..traced(Preset::Fast) };
        let mut realtime: Realtime = realtime(&tracer, SIZE, &settings);
        let camera = stepped(&scene, SIZE, DVec3::ZERO);
        crate::frames(&mut realtime, &tracer, &camera, 3);
        realtime.reset();
        let stats = realtime.frame(&tracer, &camera, &[]).unwrap();
        assert_eq!(stats.primary_rays, u64::from(SIZE[0] * SIZE[1]));
        let (samples, covered) = (realtime.samples().unwrap(), realtime.coverage().unwrap());
        assert_eq!(samples, covered, "{kind}: a sample each");
        assert!(realtime.unfiltered().unwrap().iter().all(|v| *v == 0.0 || *v == 1.0), "{kind}");
    }
    assert_validation_clean(&device);
}
