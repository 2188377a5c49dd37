//! Images against the double-precision oracle's, and against each other.

use std::sync::Arc;
use std::time::Duration;

use rayon::prelude::*;
use skylit::accel::flatten::FlatScene;
use skylit::film::SampleSettings;
use skylit::film::block::Block;
use skylit::gpu::Device;
use skylit::integrators::ao::Occlusion;
use skylit::interface::PixelFilter;
use skylit::oracle::Oracle;
use skylit::oracle::ao as oracle_ao;
use skylit::oracle::camera::camera_ray;
use skylit::sampling::sobol::hash_combine;
use skylit::sampling::{CAMERA_FILM, Sampler, to_unit};
use skylit::scene::{Camera, ClipPlanes, Projection, Scene};
use skylit::tracer::{Kernel, Needs, Tracer, TracerKind};

use crate::common::{assert_validation_clean, device, scene, tracer, tracers};
use crate::{AoOptions, differences, oracle_image, render, settings};

/// Samples are the same points on both sides, so an image differs from the oracle's only where rounding flips a sample: a ray
/// that passes an edge within rounding. Of a thousand pixels, at most two.
fn compare_with_oracle(device: &Arc<Device>, what: &str, scene: &Scene, camera: &Camera, options: &AoOptions) {
    let oracle = Oracle::new(scene, scene.origin());
    let want = oracle_image(&oracle, camera, options);
    let pixels = want.ambient_visibility.len();
    let allowed = pixels.div_ceil(500);
    // a flipped sample moves a pixel by up to 1/spp; rounding alone by far less
    let threshold = 1e-4;
    let mut images: Vec<(skylit::tracer::TracerKind, Vec<f32>)> = Vec::new();
    for kind in tracers(device) {
        let tracer = tracer(device, kind, scene);
        let image = render(&tracer, scene, camera, options);
        assert!(
            image.image.film.samples.iter().all(|&s| s == options.samples.spp),
            "{what} {kind}: samples are missing"
        );
        let (count, greatest, mean) = differences(&image.image.film.mean, &want.ambient_visibility, threshold);
        let (covers, ..) = differences(&image.image.film.coverage, &want.coverage, 1e-6);
        println!(
            "{what} {kind} and the oracle: {count} of {pixels} pixels differ (at most {greatest:.1e}), {covers} in coverage; means by {mean:+.1e}"
        );
        assert!(count <= allowed && covers <= allowed, "{what} {kind}: {count} pixels differ, {covers} in coverage");
        assert!(mean.abs() <= 1e-4, "{what} {kind}: means differ by {mean}");
        for (other, pixels_of_other) in &images {
            let (count, greatest, mean) = differences(&image.image.film.mean, pixels_of_other, threshold);
            println!(
                "{what} {kind} and {other}: {count} of {pixels} pixels differ (at most {greatest:.1e}); means by {mean:+.1e}"
            );
            assert!(
                count <= allowed && mean.abs() <= 1e-4,
                "{what} {kind} and {other}: {count} pixels differ, means by {mean}"
            );
        }
        images.push((kind, image.image.film.mean));
    }
}

#[test]
fn gpu_images_equal_the_oracles() {
    let device = device();
    for name in ["cornell-box", "stairs", "leaf-cards", "spheres:300", "grid:4", "far-away", "cornell-spheres"] {
        let scene = scene(name);
        let options = AoOptions { samples: SampleSettings::new([96, 72], 8, 3), ..Default::default() };
        compare_with_oracle(&device, name, &scene, &scene.cameras[0], &options);
    }
    for (name, falloff, radius) in [("stairs", 8.0, f64::INFINITY), ("leaf-cards", 2.0, 0.6), ("spheres:300", 1.0, 0.5)]
    {
        let scene = scene(name);
        let options = AoOptions {
            samples: SampleSettings::new([96, 72], 8, 4),
            occlusion: Occlusion::new(radius, falloff),
            ..Default::default()
        };
        let what = format!("{name}, falloff {falloff}, radius {radius}");
        compare_with_oracle(&device, &what, &scene, &scene.cameras[0], &options);
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_images_of_any_size() {
    let device = device();
    let scene = scene("cornell-box");
    for size in [[1, 1], [1, 2], [7, 3], [8, 8], [9, 17], [65, 33], [1, 300], [300, 1]] {
        for spp in [1, 3] {
            let options = AoOptions { samples: SampleSettings::new(size, spp, 0), ..Default::default() };
            compare_with_oracle(&device, &format!("{size:?} at {spp}"), &scene, &scene.cameras[0], &options);
        }
    }
    assert_validation_clean(&device);
}

/// Samples that share camera rays are those of the oracle, however they are launched: all in one launch, or fewer at a time than share a ray.
#[test]
fn gpu_shared_camera_rays() {
    let device = device();
    for (name, spp, rays, falloff) in
        [("stairs", 13, 4, 1.0), ("leaf-cards", 8, 2, 2.0), ("spheres:300", 5, 16, 1.0), ("grid:4", 16, 8, 1.0)]
    {
        let scene = scene(name);
        let camera = &scene.cameras[0];
        let samples = SampleSettings::new([96, 72], spp, 3);
        let options =
            AoOptions { samples, occlusion: Occlusion::new(f64::INFINITY, falloff), rays, ..Default::default() };
        compare_with_oracle(&device, &format!("{name}, {rays} rays"), &scene, camera, &options);
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &scene);
            let whole = render(&tracer, &scene, camera, &options);
            let paced = options.clone().with_samples(|s| s.time_limit = Some(Duration::from_secs(3600)));
            let kept = options.clone().with_samples(|s| s.keep_rays = true);
            for other in [paced, kept] {
                let other = render(&tracer, &scene, camera, &other);
                assert!(whole.image.film.mean == other.image.film.mean, "{name} {kind}");
                assert_eq!(whole.occlusion_rays, other.occlusion_rays, "{name} {kind}");
            }
            let all = whole.image.primary_rays;
            assert!(whole.camera_rays < all && whole.camera_rays >= all / u64::from(rays), "{name} {kind}");
        }
    }
    assert_validation_clean(&device);
}

/// Geometry before the near plane and beyond the far one is not there for the camera, and shades what is.
#[test]
fn gpu_clipped_images() {
    let device = device();
    for name in ["leaf-cards", "cornell-spheres"] {
        let scene = scene(name);
        let camera = &scene.cameras[0];
        let flat = Camera { projection: Projection::Orthographic { half_height: 2.0 }, ..camera.clone() };
        let options = AoOptions { samples: SampleSettings::new([48, 36], 4, 5), ..Default::default() };
        let oracle = Oracle::new(&scene, scene.origin());
        let middle = oracle.closest(camera_ray(camera, scene.origin(), [1, 1], [0.5, 0.5])).t;
        assert!(middle.is_finite());
        for (camera, planes) in [
            (camera, ClipPlanes { near: 0.97 * middle, far: f64::INFINITY }),
            (camera, ClipPlanes { near: 0.1 * middle, far: 1.02 * middle }),
            (&flat, ClipPlanes { near: 0.97 * middle, far: 1.1 * middle }),
        ] {
            let camera = Camera { clip: planes, ..camera.clone() };
            compare_with_oracle(&device, &format!("{name}, {planes}"), &scene, &camera, &options);
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_orthographic_images() {
    let device = device();
    let scene = scene("stairs");
    let mut camera = scene.cameras[0].clone();
    camera.projection = Projection::Orthographic { half_height: 1.7 };
    let options = AoOptions { samples: SampleSettings::new([90, 60], 8, 0), ..Default::default() };
    compare_with_oracle(&device, "stairs, orthographic", &scene, &camera, &options);
    assert_validation_clean(&device);
}

/// An image of more than one block: blocks are numbered, sized and put together rightly. Judged on a few thousand of its
/// pixels, those on both sides of the seam among them.
#[test]
fn gpu_images_of_several_blocks() {
    let device = device();
    let scene = scene("cornell-box");
    let camera = &scene.cameras[0];
    let oracle = Oracle::new(&scene, scene.origin());
    let options = AoOptions { samples: SampleSettings::new([3000, 1000], 1, 11), ..Default::default() };
    let blocks = Block::cut(options.samples.size);
    assert!(blocks.len() > 1);
    let seam = blocks[1].origin[1];
    assert!(seam > 0 && blocks[1].origin[0] == 0);
    let mut pixels: Vec<[u32; 2]> = (0..4000)
        .map(|i| [0, 1].map(|k| (to_unit(hash_combine(i, k)) * options.samples.size[k as usize] as f32) as u32))
        .collect();
    pixels.extend((0..3000).step_by(5).flat_map(|x| [[x, seam - 1], [x, seam]]));
    let sampler = Sampler { seed: options.samples.seed };
    let want: Vec<f32> = pixels
        .par_iter()
        .map(|&pixel| {
            let u = sampler.get_2d_unit(pixel, 0, CAMERA_FILM);
            let ray = camera_ray(
                camera,
                oracle.origin(),
                options.samples.size,
                [0, 1].map(|k| pixel[k] as f64 + u[k] as f64),
            );
            let hit = oracle.closest(ray);
            if !hit.is_hit() {
                return 0.0;
            }
            let normal = oracle.facing_normal(&ray, &hit);
            let direction = oracle_ao::ao_direction(sampler, pixel, 0, normal);
            1.0 - oracle_ao::ray_occlusion(&oracle, ray.at(hit.t), normal, direction, &settings(&options)) as f32
        })
        .collect();
    assert!(want.iter().filter(|&&w| w == 1.0).count() > pixels.len() / 50);
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let image = render(&tracer, &scene, camera, &options);
        assert!(image.image.film.samples.iter().all(|&s| s == 1), "{kind}: pixels without their sample");
        let got: Vec<f32> =
            pixels.iter().map(|&[x, y]| image.image.film.mean[(y * options.samples.size[0] + x) as usize]).collect();
        let (count, ..) = differences(&got, &want, 1e-4);
        println!(
            "{kind}: {count} of {} pixels differ; {} + {} rays, {} skipped, in {:.2} s; the longest launch took {:.3} s",
            pixels.len(),
            image.image.primary_rays,
            image.occlusion_rays,
            image.skipped_rays,
            image.image.trace_seconds,
            image.image.longest_launch
        );
        assert!(count <= pixels.len() / 1000, "{kind}: {count} of {} pixels differ", pixels.len());
        assert_eq!(image.image.primary_rays, 3_000_000);
        assert_eq!(image.occlusion_rays + image.skipped_rays, 3_000_000);
        // no time at all: every block still gets one sample, or there would be no image
        let hurried = options.clone().with_samples(|s| (s.spp, s.time_limit) = (4, Some(Duration::ZERO)));
        let image = render(&tracer, &scene, camera, &hurried);
        assert!(
            image.image.stopped_early && image.image.spp == 1 && image.image.film.samples.iter().all(|&s| s == 1),
            "{kind}"
        );
    }
    assert_validation_clean(&device);
}

/// Camera rays that start at entry points find what rays find that start at the root: nothing is missed at the borders of bundles, by filters wider than a pixel, in wide views,
/// or where instances make a second level. Surfaces that are equally far flip a sample here and there, because the order of traversal decides which of them it leaves from.
#[test]
fn gpu_entry_points_miss_nothing() {
    let device = device();
    if !device.info.packets() || !device.info.is_cpu() || device.info.cuts_long_loops() {
        return;
    }
    for (name, pixel_filter, fov_y, size) in [
        ("cornell-box", PixelFilter::Box, 40.0, [96, 72]),
        ("room:10000", PixelFilter::BlackmanHarris, 65.0, [97, 61]),
        ("room:10000", PixelFilter::Box, 150.0, [64, 48]),
        ("spheres:300", PixelFilter::Tent, 50.0, [96, 72]),
        ("terrain:3000", PixelFilter::Centre, 60.0, [301, 7]),
        ("instances:3000", PixelFilter::Box, 60.0, [96, 72]),
    ] {
        let scene = scene(name);
        let mut camera = scene.cameras[0].clone();
        camera.projection = Projection::Perspective { fov_y: f64::to_radians(fov_y) };
        let flat = FlatScene::new(&scene);
        let [packets, root] = [Kernel::Packet, Kernel::Wide]
            .map(|kernel| Tracer::with_options(&device, TracerKind::Compute, &flat, Needs::default(), kernel).unwrap());
        // with 4 rays the packets of the first launches are of several bundles, and those of later ones are not
        for (rays, spp) in [(1, 32), (4, 64)] {
            let samples = SampleSettings { pixel_filter, ..SampleSettings::new(size, spp, 5) };
            let options = AoOptions { samples, rays, ..Default::default() };
            let [start, root] = [&packets, &root].map(|tracer| render(tracer, &scene, &camera, &options));
            assert!(start.has_entry_points && !root.has_entry_points, "{name}");
            let (count, greatest, _) = differences(&start.image.film.mean, &root.image.film.mean, 1e-6);
            let (covers, ..) = differences(&start.image.film.coverage, &root.image.film.coverage, 0.0);
            println!(
                "{name} {pixel_filter} {rays}: {count} pixels differ, by {greatest} at most; {covers} in coverage"
            );
            assert!(root.occlusion_rays > 1000, "{name}: {} occlusion rays", root.occlusion_rays);
            assert!(
                covers == 0 && count <= 2 && greatest < 1.5 * rays as f32 / spp as f32,
                "{name} {rays}: {count} pixels differ, {covers} in coverage"
            );
        }
    }
    assert_validation_clean(&device);
}
