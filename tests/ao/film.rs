//! The film: its digits, its variance, and what it does not depend on.

use std::sync::Arc;
use std::time::Duration;

use glam::{DAffine3, DVec3};
use skylit::accel::flatten::FlatScene;
use skylit::film::SampleSettings;
use skylit::film::tile_mask::TileMask;
use skylit::integrators::ao::Occlusion;
use skylit::oracle::Oracle;
use skylit::scene::builtin::{SceneTransform, analytic};
use skylit::scene::{Camera, Projection, Scene};
use skylit::tracer::{Kernel, Needs, Tracer, TracerKind};

use crate::common::{assert_validation_clean, device, picked, record, scene, tracer};
use crate::{AoOptions, differences, oracle_image, render};

/// 20 000 samples of a smooth quantity: sums in single precision would be off by some 1e-5 (each addition to a sum of 1e4
/// rounds to 1e-3), compensated ones are not. The variance is that of single samples, unbiased.
#[test]
fn gpu_film_sums_are_compensated() {
    let device = device();
    // a small floor: rays start above it by a few ulp of its size, and that much less is met
    let scene = analytic::sphere_over_plane(1.0, 1.5, 0.25, SceneTransform::default());
    let camera = Camera::look_at(DVec3::new(1.0, 0.2, 0.0), DVec3::ZERO, DVec3::Y, 0.02);
    let options = AoOptions {
        samples: SampleSettings::new([3, 2], 20_000, 0),
        occlusion: Occlusion::new(f64::INFINITY, 1.7),
        ..Default::default()
    };
    let oracle = Oracle::new(&scene, scene.origin());
    let want = oracle_image(&oracle, &camera, &options);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let image = render(&tracer, &scene, &camera, &options);
        let (_, greatest, mean) = differences(&image.image.film.mean, &want.ambient_visibility, 0.0);
        let relative: Vec<f64> = image
            .image
            .film
            .variance
            .iter()
            .zip(&want.variance)
            .map(|(a, b)| (*a as f64 / *b as f64 - 1.0).abs())
            .collect();
        let worst = relative.iter().fold(0.0f64, |a, b| a.max(*b));
        println!(
            "{kind}: means differ by at most {greatest:.1e}, on average {mean:+.1e}; variances by a share of {worst:.1e}"
        );
        assert!(image.image.film.samples.iter().all(|&s| s == 20_000));
        assert!(want.variance.iter().all(|v| *v > 1e-3));
        assert!(greatest <= 4e-7, "{kind}: means differ by {greatest}");
        assert!(worst <= 1e-4, "{kind}: variances differ by a share of {worst}");
    }
    assert_validation_clean(&device);
}

/// For samples of 0 and 1 the unbiased variance follows from the mean: n / (n - 1) * m * (1 - m).
#[test]
fn gpu_film_variance_and_seeds() {
    let device = device();
    let scene = scene("stairs");
    let camera = &scene.cameras[0];
    let options = AoOptions { samples: SampleSettings::new([64, 48], 6, 0), ..Default::default() };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let first = render(&tracer, &scene, camera, &options);
        let (mut mixed, n) = (0, options.samples.spp as f64);
        for (&m, &v) in first.image.film.mean.iter().zip(&first.image.film.variance) {
            let m = m as f64;
            assert!((v as f64 - n / (n - 1.0) * m * (1.0 - m)).abs() < 1e-6, "{kind}: mean {m}, variance {v}");
            mixed += (v > 0.0) as u32;
        }
        assert!(mixed > 500, "{kind}: {mixed} pixels with a variance");
        let again = render(&tracer, &scene, camera, &options);
        assert_eq!(first.image.film.mean, again.image.film.mean, "{kind}: the same seed, other bits");
        assert_eq!(first.image.film.variance, again.image.film.variance, "{kind}: the same seed, other bits");
        let other = render(&tracer, &scene, camera, &options.clone().with_samples(|s| s.seed = 1));
        let (count, _, mean) = differences(&first.image.film.mean, &other.image.film.mean, 1e-3);
        let (_, error) = first.image.film.mean_and_error();
        println!("{kind}: another seed changes {count} pixels and the mean by {mean:+.1e}, standard error {error:.1e}");
        assert!(count > 500, "{kind}: another seed changes {count} pixels only");
        assert!(mean.abs() < 4.0 * 2f64.sqrt() * error, "{kind}: another seed changes the mean by {mean}");
        // a single sample has no variance, and is 0 or 1
        let single = render(&tracer, &scene, camera, &options.clone().with_samples(|s| s.spp = 1));
        assert!(single.image.film.variance.iter().all(|&v| v == 0.0));
        assert!(single.image.film.mean.iter().all(|&m| m == 0.0 || m == 1.0));
    }
    assert_validation_clean(&device);
}

/// However samples are cut into batches, and in whatever order occlusion rays come back: the same sums, bit for bit.
#[test]
fn gpu_film_does_not_depend_on_batches() {
    let device = device();
    let scene = scene("leaf-cards");
    let camera = &scene.cameras[0];
    let options = AoOptions {
        samples: SampleSettings::new([70, 45], 23, 0),
        occlusion: Occlusion::new(f64::INFINITY, 3.0),
        ..Default::default()
    };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        // 16 + 4 + 2 + 1 samples
        let whole = render(&tracer, &scene, camera, &options);
        // 1 + 16 + 4 + 2
        let kept = render(&tracer, &scene, camera, &options.clone().with_samples(|s| s.keep_rays = true));
        // 1 at a time at first, more later
        let paced = render(
            &tracer,
            &scene,
            camera,
            &options.clone().with_samples(|s| s.time_limit = Some(Duration::from_secs(3600))),
        );
        for other in [&kept, &paced] {
            assert_eq!(whole.image.film.mean, other.image.film.mean, "{kind}");
            assert_eq!(whole.image.film.variance, other.image.film.variance, "{kind}");
            assert_eq!(whole.image.film.coverage, other.image.film.coverage, "{kind}");
            assert_eq!(whole.occlusion_rays, other.occlusion_rays, "{kind}");
        }
        assert!(
            whole.image.film.mean.iter().any(|m| *m > 0.0) && whole.occlusion_rays > 1000,
            "{kind}: nothing to see"
        );
    }
    assert_validation_clean(&device);
}

/// Every kernel of the compute tracer stops where the queue of occlusion rays ends: what an earlier launch left there is not traced.
#[test]
fn gpu_kernels_stop_at_the_end_of_the_queue() {
    let device = device();
    // much background: the queue of one launch is longer than that of the next
    let scene = scene("cornell-box");
    let camera = &scene.cameras[0];
    let far = Camera {
        camera_to_world: DAffine3::from_translation(DVec3::Z * 4.0) * camera.camera_to_world,
        ..camera.clone()
    };
    let camera =
        [camera.clone(), far].into_iter().max_by_key(|c| (c.camera_to_world.translation.z.abs() * 1e6) as i64).unwrap();
    let flat = FlatScene::new(&scene);
    let options = AoOptions { samples: SampleSettings::new([96, 96], 8, 0), ..Default::default() };
    let images: Vec<_> = [Kernel::Wide, Kernel::Nearest, Kernel::Direction, Kernel::Brute]
        .into_iter()
        .map(|kernel| {
            let tracer = Tracer::with_options(&device, TracerKind::Compute, &flat, Needs::default(), kernel).unwrap();
            (kernel, render(&tracer, &scene, &camera, &options))
        })
        .collect();
    let (_, wide) = &images[0];
    assert!(wide.occlusion_rays > 1000 && wide.skipped_rays > 1000, "{} {}", wide.occlusion_rays, wide.skipped_rays);
    for (kernel, image) in &images {
        let (count, greatest, _) = differences(&wide.image.film.mean, &image.image.film.mean, 1e-6);
        println!("{kernel:?}: {} occlusion rays, {count} pixels differ, by {greatest} at most", image.occlusion_rays);
        assert!(image.occlusion_rays.abs_diff(wide.occlusion_rays) <= 4, "{kernel:?}: {} rays", image.occlusion_rays);
        // rounding flips a sample here and there
        assert!(count <= 96 * 96 / 500, "{kernel:?}: {count} pixels differ");
    }
    assert_validation_clean(&device);
}

/// What is left out of an image is empty: with and without, the same image bit for bit; and something is left out.
#[test]
fn gpu_cover_leaves_out_nothing_that_is_seen() {
    let device = device();
    let cases: Vec<(&str, Scene, Camera)> = [("stairs", 40.0), ("leaf-cards", 30.0), ("cornell-box", 20.0)]
        .into_iter()
        .map(|(name, distance)| {
            let scene = scene(name);
            let (lo, hi) = scene.bounds().unwrap();
            let (middle, reach) = ((lo + hi) * 0.5, (hi - lo).length());
            let eye = middle + DVec3::new(0.5, 0.4, 0.77) * reach * distance / 10.0;
            // off the middle, so that the image's edge cuts the scene
            let camera = Camera::look_at(eye, middle + DVec3::X * reach * 0.5, DVec3::Y, 0.6);
            (name, scene, camera)
        })
        .chain([("spheres", analytic::sphere_over_plane(1.0, 1.5, 0.25, SceneTransform::default()))].map(
            |(name, scene)| {
                let camera = Camera::look_at(DVec3::new(40.0, 30.0, 50.0), DVec3::ZERO, DVec3::Y, 0.5);
                (name, scene, camera)
            },
        ))
        .collect();
    for (name, scene, camera) in &cases {
        let flat = FlatScene::new(scene);
        for (orthographic, size, spp) in [(false, [203, 149], 4), (true, [160, 96], 4), (false, [64, 64], 1)] {
            let camera = match orthographic {
                false => camera.clone(),
                true => Camera { projection: Projection::Orthographic { half_height: 12.0 }, ..camera.clone() },
            };
            let options = AoOptions { samples: SampleSettings::new(size, spp, 0), ..Default::default() };
            let tile_mask = TileMask::new(&flat, &record(scene, &camera, size), size, spp).map(Arc::new);
            let (live, all) = tile_mask.as_ref().map_or((1, 1), |c| c.count());
            for kind in picked(&device) {
                let tracer = tracer(&device, kind, scene);
                let whole = render(&tracer, scene, &camera, &options);
                let image =
                    render(&tracer, scene, &camera, &options.clone().with_samples(|s| s.tile_mask = tile_mask.clone()));
                assert_eq!(whole.image.film.mean, image.image.film.mean, "{name} {kind}");
                assert_eq!(whole.image.film.coverage, image.image.film.coverage, "{name} {kind}");
                assert_eq!(whole.image.film.samples, image.image.film.samples, "{name} {kind}");
                assert_eq!(whole.occlusion_rays, image.occlusion_rays, "{name} {kind}");
                assert_eq!(whole.skipped_rays, image.skipped_rays, "{name} {kind}");
                assert_eq!(
                    whole.image.primary_rays,
                    image.image.primary_rays + image.image.skipped_primary_rays,
                    "{name} {kind}"
                );
                assert_eq!(image.image.skipped_primary_rays > 0, live < all, "{name} {kind}");
                assert!(image.occlusion_rays > 0, "{name} {kind}: nothing to see");
            }
            println!("{name}, orthographic {orthographic}: {live} of {all} tiles");
            assert!(live < all, "{name}: nothing was left out");
        }
        // from within, anything may be seen anywhere
        let (lo, hi) = scene.bounds().unwrap();
        let within = Camera::look_at((lo + hi) * 0.5, hi, DVec3::Y, 0.6);
        assert!(TileMask::new(&flat, &record(scene, &within, [64, 64]), [64, 64], 1).is_none(), "{name}");
    }
    assert_validation_clean(&device);
}
