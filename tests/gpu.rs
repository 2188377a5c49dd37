//! What runs on the device, piece by piece: sampler, film, images against the double-precision oracle's, auxiliary outputs, ray
//! dumps, and how a render begins, stops and is cut into blocks. Every tracer that the device runs takes every test.

mod common;

use skylit::interface::records::ray_set::Probe;
use skylit::shaders;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytemuck::Zeroable;
use common::{assert_validation_clean, device, tracer, tracers};
use glam::{DAffine3, DQuat, DVec2, DVec3, DVec4};
use rayon::prelude::*;
use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::film::block::Block;
use skylit::film::camera::CameraRecord;
use skylit::film::cover::Cover;
use skylit::film::{Control, NoControl};
use skylit::gpu::{Buffer, Commands, Device, Memory};
use skylit::integrators::ao::{self, AoOptions, AoResult};
use skylit::integrators::aov::{self, AovPixel};
use skylit::oracle::Oracle;
use skylit::oracle::ao::{self as oracle_ao, AoSettings};
use skylit::oracle::camera::camera_ray;
use skylit::sampling::sobol::hash_combine;
use skylit::sampling::{AO_DIRECTION, CAMERA_FILM, Sampler, to_unit, warp};
use skylit::scene::builtin::{Placement, analytic, by_name, shapes};
use skylit::scene::{Camera, Filter, Geometry, Instance, Mesh, Projection, Scene, Texture, Wrap};
use skylit::tracer::{Kernel, Needs, Push, Tracer, TracerKind};

fn scene(name: &str) -> Scene {
    by_name(name).unwrap_or_else(|| panic!("no built-in scene {name}"))
}

fn record(scene: &Scene, camera: &Camera, size: [u32; 2]) -> CameraRecord {
    CameraRecord::new(camera, scene.origin(), size[0] as f64 / size[1] as f64)
}

fn render(tracer: &Tracer, scene: &Scene, camera: &Camera, options: &AoOptions) -> AoResult {
    ao::render(tracer, &record(scene, camera, options.size), options, &mut NoControl)
        .unwrap_or_else(|e| panic!("{}: {e}", tracer.kind()))
}

fn settings(options: &AoOptions) -> AoSettings {
    // what is beyond the reach is not traced for
    AoSettings { radius: options.attenuation().reach(), falloff: options.falloff }
}

// --- the sampler ---

#[test]
fn gpu_sampler_gives_the_hosts_bits() {
    let device = device();
    let count = 100_000u32;
    let random = |i: u32, k: u32| hash_combine(hash_combine(7, i), k);
    let inputs: Vec<[u32; 8]> = (0..count)
        .map(|i| {
            // a third of the sample indices small, as in images; the others use all bits
            let sample = random(i, 3) >> if i % 3 == 0 { 20 } else { 0 };
            let z = 1.0 - 2.0 * to_unit(random(i, 5)) as f64;
            let (s, c) = (std::f64::consts::TAU * to_unit(random(i, 6)) as f64).sin_cos();
            let r = (1.0 - z * z).max(0.0).sqrt();
            let normal = match i {
                // the frame's seam and poles
                0 => [0.0, 0.0, 1.0],
                1 => [0.0, 0.0, -1.0],
                2 => [1.0, 0.0, -0.0],
                _ => [r * c, r * s, z].map(|x| x as f32),
            };
            let [nx, ny, nz] = normal.map(f32::to_bits);
            [random(i, 0), random(i, 1) >> 18, random(i, 2) >> 18, sample, random(i, 4) & 15, nx, ny, nz]
        })
        .collect();
    let scene = analytic::plane(1.0, Placement::default());
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let stream = tracer.stream(&shaders::probes::SAMPLER_PROBE_ANY).unwrap();
        let source = Buffer::from_slice(&device, "probe inputs", &inputs).unwrap();
        let results = Buffer::new(&device, "probe outputs", 48 * count as u64, Memory::Readback).unwrap();
        let probe =
            Buffer::from_slice(&device, "probe", &[Probe { inputs: source.address(), outputs: results.address() }]).unwrap();
        let push = Push { scene: tracer.scene_address(), pass: probe.address(), count, ..Default::default() };
        Commands::new(&device).unwrap().run(|r| stream.record(r, &push)).unwrap();
        let results = results.read(0, 48 * count as u64).unwrap();
        let (mut worst_local, mut worst_world, mut same) = (0.0f32, 0.0f32, 0);
        for (i, (input, bytes)) in inputs.iter().zip(results.chunks_exact(48)).enumerate() {
            let got: [u32; 12] = bytemuck::pod_read_unaligned(bytes);
            let &[seed, x, y, sample, dimension, nx, ny, nz] = input;
            let sampler = Sampler { seed };
            let bits = sampler.get_2d([x, y], sample, dimension);
            assert_eq!([got[0], got[1]], bits, "{kind}: probe {i}, {input:?}");
            let choice = sampler.get_choice_2d([x, y], sample, dimension);
            assert_eq!([got[11], bits[1]], choice, "{kind}: choice of probe {i}, {input:?}");
            let u = sampler.get_2d_unit([x, y], sample, dimension);
            assert_eq!([got[2], got[3]], u.map(f32::to_bits), "{kind}: probe {i}");
            assert_eq!(got[7], 0, "{kind}: a ray that is none was occluded");
            let local = warp::cosine_hemisphere(u);
            let world = warp::to_world([nx, ny, nz].map(f32::from_bits), local);
            let worst = |a: [f32; 3], b: &[u32]| {
                // NaN must not pass for small
                a.iter().zip(b).fold(0.0f32, |w, (a, b)| {
                    let d = (a - f32::from_bits(*b)).abs();
                    if d <= w { w } else { d }
                })
            };
            worst_local = worst_local.max(worst(local, &got[4..7]));
            worst_world = worst_world.max(worst(world, &got[8..11]));
            assert!(worst(local, &got[4..7]) <= 1e-6 && worst(world, &got[8..11]) <= 1e-6, "{kind}: probe {i}, {input:?}");
            same += (local.map(f32::to_bits) == got[4..7] && world.map(f32::to_bits) == got[8..11]) as u32;
        }
        println!(
            "{kind}: {count} points bit for bit; hemisphere within {worst_local:.1e}, in the world {worst_world:.1e}; {same} of them bit for bit, too"
        );
    }
    assert_validation_clean(&device);
}

// --- images against the oracle's, and against each other ---

/// Pixels that differ by more than `threshold`, greatest difference, and difference of the means.
fn differences(a: &[f32], b: &[f32], threshold: f32) -> (usize, f32, f64) {
    assert_eq!(a.len(), b.len());
    let pairs = || a.iter().zip(b);
    let count = pairs().filter(|(a, b)| (*a - *b).is_nan() || (*a - *b).abs() > threshold).count();
    let greatest = pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let mean = pairs().map(|(a, b)| (a - b) as f64).sum::<f64>() / a.len().max(1) as f64;
    (count, greatest, mean)
}

/// The oracle's image as a film has it: means over all samples.
fn oracle_image(oracle: &Oracle, camera: &Camera, options: &AoOptions) -> oracle_ao::AoImage {
    let mut image = oracle_ao::render(oracle, camera, options.size, options.spp, options.seed, &settings(options));
    for (a, c) in image.accessibility.iter_mut().zip(&image.coverage) {
        *a *= c;
    }
    image
}

/// Samples are the same points on both sides, so an image differs from the oracle's only where rounding turns a sample: a ray
/// that passes an edge within rounding. Of a thousand pixels, at most two.
fn compare_with_oracle(device: &Arc<Device>, what: &str, scene: &Scene, camera: &Camera, options: &AoOptions) {
    let oracle = Oracle::new(scene, scene.origin());
    let want = oracle_image(&oracle, camera, options);
    let pixels = want.accessibility.len();
    let allowed = pixels.div_ceil(500);
    // a turned sample moves a pixel by up to 1/spp; rounding alone by far less
    let threshold = 1e-4;
    let mut images: Vec<(skylit::tracer::TracerKind, Vec<f32>)> = Vec::new();
    for kind in tracers(device) {
        let tracer = tracer(device, kind, scene);
        let image = render(&tracer, scene, camera, options);
        assert!(image.image.film.samples.iter().all(|&s| s == options.spp), "{what} {kind}: samples are missing");
        let (count, greatest, mean) = differences(&image.image.film.mean, &want.accessibility, threshold);
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
        let options = AoOptions { size: [96, 72], spp: 8, seed: 3, ..Default::default() };
        compare_with_oracle(&device, name, &scene, &scene.cameras[0], &options);
    }
    for (name, falloff, radius) in [("stairs", 8.0, f64::INFINITY), ("leaf-cards", 2.0, 0.6), ("spheres:300", 1.0, 0.5)] {
        let scene = scene(name);
        let options = AoOptions { size: [96, 72], spp: 8, seed: 4, falloff, radius, ..Default::default() };
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
            let options = AoOptions { size, spp, ..Default::default() };
            compare_with_oracle(&device, &format!("{size:?} at {spp}"), &scene, &scene.cameras[0], &options);
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
    let options = AoOptions { size: [90, 60], spp: 8, ..Default::default() };
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
    let options = AoOptions { size: [3000, 1000], spp: 1, seed: 11, ..Default::default() };
    let blocks = Block::cut(options.size);
    assert!(blocks.len() > 1);
    let seam = blocks[1].origin[1];
    assert!(seam > 0 && blocks[1].origin[0] == 0);
    let mut pixels: Vec<[u32; 2]> =
        (0..4000).map(|i| [0, 1].map(|k| (to_unit(hash_combine(i, k)) * options.size[k as usize] as f32) as u32)).collect();
    pixels.extend((0..3000).step_by(5).flat_map(|x| [[x, seam - 1], [x, seam]]));
    let sampler = Sampler { seed: options.seed };
    let want: Vec<f32> = pixels
        .par_iter()
        .map(|&pixel| {
            let u = sampler.get_2d_unit(pixel, 0, CAMERA_FILM);
            let ray = camera_ray(camera, oracle.origin(), options.size, [0, 1].map(|k| pixel[k] as f64 + u[k] as f64));
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
        let got: Vec<f32> = pixels.iter().map(|&[x, y]| image.image.film.mean[(y * options.size[0] + x) as usize]).collect();
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
        let hurried = AoOptions { spp: 4, time_limit: Some(Duration::ZERO), ..options.clone() };
        let image = render(&tracer, &scene, camera, &hurried);
        assert!(
            image.image.stopped_early && image.image.spp == 1 && image.image.film.samples.iter().all(|&s| s == 1),
            "{kind}"
        );
    }
    assert_validation_clean(&device);
}

// --- the film ---

/// 20 000 samples of a smooth quantity: sums in single precision would be off by some 1e-5 (each addition to a sum of 1e4
/// rounds to 1e-3), compensated ones are not. The variance is that of single samples, unbiased.
#[test]
fn gpu_film_keeps_its_digits() {
    let device = device();
    // a small floor: rays start above it by a few ulp of its size, and that much less is met
    let scene = analytic::sphere_over_plane(1.0, 1.5, 0.25, Placement::default());
    let camera = Camera::look_at(DVec3::new(1.0, 0.2, 0.0), DVec3::ZERO, DVec3::Y, 0.02);
    let options = AoOptions { size: [3, 2], spp: 20_000, falloff: 1.7, ..Default::default() };
    let oracle = Oracle::new(&scene, scene.origin());
    let want = oracle_image(&oracle, &camera, &options);
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let image = render(&tracer, &scene, &camera, &options);
        let (_, greatest, mean) = differences(&image.image.film.mean, &want.accessibility, 0.0);
        let relative: Vec<f64> =
            image.image.film.variance.iter().zip(&want.variance).map(|(a, b)| (*a as f64 / *b as f64 - 1.0).abs()).collect();
        let worst = relative.iter().fold(0.0f64, |a, b| a.max(*b));
        println!("{kind}: means differ by at most {greatest:.1e}, on average {mean:+.1e}; variances by a share of {worst:.1e}");
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
    let options = AoOptions { size: [64, 48], spp: 6, ..Default::default() };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let first = render(&tracer, &scene, camera, &options);
        let (mut mixed, n) = (0, options.spp as f64);
        for (&m, &v) in first.image.film.mean.iter().zip(&first.image.film.variance) {
            let m = m as f64;
            assert!((v as f64 - n / (n - 1.0) * m * (1.0 - m)).abs() < 1e-6, "{kind}: mean {m}, variance {v}");
            mixed += (v > 0.0) as u32;
        }
        assert!(mixed > 500, "{kind}: {mixed} pixels with a variance");
        let again = render(&tracer, &scene, camera, &options);
        assert_eq!(first.image.film.mean, again.image.film.mean, "{kind}: the same seed, other bits");
        assert_eq!(first.image.film.variance, again.image.film.variance, "{kind}: the same seed, other bits");
        let other = render(&tracer, &scene, camera, &AoOptions { seed: 1, ..options.clone() });
        let (count, _, mean) = differences(&first.image.film.mean, &other.image.film.mean, 1e-3);
        let (_, error) = first.image.film.mean_and_error();
        println!("{kind}: another seed changes {count} pixels and the mean by {mean:+.1e}, standard error {error:.1e}");
        assert!(count > 500, "{kind}: another seed changes {count} pixels only");
        assert!(mean.abs() < 4.0 * 2f64.sqrt() * error, "{kind}: another seed changes the mean by {mean}");
        // a single sample has no variance, and is 0 or 1
        let single = render(&tracer, &scene, camera, &AoOptions { spp: 1, ..options.clone() });
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
    let options = AoOptions { size: [70, 45], spp: 23, falloff: 3.0, ..Default::default() };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        // 16 + 4 + 2 + 1 samples
        let whole = render(&tracer, &scene, camera, &options);
        // 1 + 16 + 4 + 2
        let kept = render(&tracer, &scene, camera, &AoOptions { keep_rays: true, ..options.clone() });
        // 1 at a time at first, more later
        let paced =
            render(&tracer, &scene, camera, &AoOptions { time_limit: Some(Duration::from_secs(3600)), ..options.clone() });
        for other in [&kept, &paced] {
            assert_eq!(whole.image.film.mean, other.image.film.mean, "{kind}");
            assert_eq!(whole.image.film.variance, other.image.film.variance, "{kind}");
            assert_eq!(whole.image.film.coverage, other.image.film.coverage, "{kind}");
            assert_eq!(whole.occlusion_rays, other.occlusion_rays, "{kind}");
        }
        assert!(whole.image.film.mean.iter().any(|m| *m > 0.0) && whole.occlusion_rays > 1000, "{kind}: nothing to see");
    }
    assert_validation_clean(&device);
}

/// Every kernel of the compute tracer stops where the queue of occlusion rays ends: what an earlier launch left there is not traced.
#[test]
fn gpu_kernels_heed_the_queues_end() {
    let device = device();
    // much background: the queue of one launch is longer than that of the next
    let scene = scene("cornell-box");
    let camera = &scene.cameras[0];
    let far = Camera { camera_to_world: DAffine3::from_translation(DVec3::Z * 4.0) * camera.camera_to_world, ..camera.clone() };
    let camera =
        [camera.clone(), far].into_iter().max_by_key(|c| (c.camera_to_world.translation.z.abs() * 1e6) as i64).unwrap();
    let flat = FlatScene::new(&scene);
    let options = AoOptions { size: [96, 96], spp: 8, ..Default::default() };
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
        // rounding turns a sample here and there
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
        .chain([("spheres", analytic::sphere_over_plane(1.0, 1.5, 0.25, Placement::default()))].map(|(name, scene)| {
            let camera = Camera::look_at(DVec3::new(40.0, 30.0, 50.0), DVec3::ZERO, DVec3::Y, 0.5);
            (name, scene, camera)
        }))
        .collect();
    for (name, scene, camera) in &cases {
        let flat = FlatScene::new(scene);
        for (orthographic, size, spp) in [(false, [203, 149], 4), (true, [160, 96], 4), (false, [64, 64], 1)] {
            let camera = match orthographic {
                false => camera.clone(),
                true => Camera { projection: Projection::Orthographic { half_height: 12.0 }, ..camera.clone() },
            };
            let options = AoOptions { size, spp, ..Default::default() };
            let cover = Cover::new(&flat, &record(scene, &camera, size), size, spp).map(Arc::new);
            let (live, all) = cover.as_ref().map_or((1, 1), |c| c.count());
            for kind in tracers(&device) {
                let tracer = tracer(&device, kind, scene);
                let whole = render(&tracer, scene, &camera, &options);
                let image = render(&tracer, scene, &camera, &AoOptions { cover: cover.clone(), ..options.clone() });
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
        assert!(Cover::new(&flat, &record(scene, &within, [64, 64]), [64, 64], 1).is_none(), "{name}");
    }
    assert_validation_clean(&device);
}

// --- beginning and stopping ---

#[test]
fn gpu_time_limit() {
    let device = device();
    let scene = scene("cornell-box");
    let limit = Duration::from_millis(400);
    let options = AoOptions { size: [64, 64], spp: 1 << 24, time_limit: Some(limit), ..Default::default() };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let start = Instant::now();
        let image = render(&tracer, &scene, &scene.cameras[0], &options);
        let took = start.elapsed();
        println!(
            "{kind}: {} samples in {took:?}, the longest launch took {:.4} s",
            image.image.spp, image.image.longest_launch
        );
        assert!(
            image.image.stopped_early && image.image.spp >= 1 && image.image.spp < options.spp,
            "{kind}: {}",
            image.image.spp
        );
        assert!(image.image.film.samples.iter().all(|&s| s == image.image.spp), "{kind}: pixels with other counts");
        assert_eq!(image.image.primary_rays, 64 * 64 * image.image.spp as u64);
        // generous: the machine may be busy. Compiling counts too
        assert!(took >= limit && took < limit + Duration::from_secs(20), "{kind}: {took:?}");
        let mean = image.image.film.mean_and_error().0;
        assert!((0.2..0.7).contains(&mean), "{kind}: mean {mean}");
    }
    assert_validation_clean(&device);
}

/// Says what it is told to after some questions, and records the progress.
struct Stopper {
    questions: u32,
    answer: fn() -> skylit::error::Result<bool>,
    progress: Vec<(u64, u64)>,
}

impl Control for Stopper {
    fn progress(&mut self, done: u64, total: u64) {
        self.progress.push((done, total));
    }

    fn should_stop(&mut self) -> skylit::error::Result<bool> {
        self.questions = self.questions.saturating_sub(1);
        if self.questions == 0 { (self.answer)() } else { Ok(false) }
    }
}

#[test]
fn gpu_interruption_and_progress() {
    let device = device();
    let scene = scene("cornell-box");
    let camera = record(&scene, &scene.cameras[0], [64, 64]);
    let options = AoOptions { size: [64, 64], spp: 800, ..Default::default() };
    let stopper = |questions, answer| Stopper { questions, answer, progress: Vec::new() };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let mut control = stopper(9, || Err(Error::Interrupted));
        let result = ao::render(&tracer, &camera, &options, &mut control);
        assert!(matches!(result, Err(Error::Interrupted)), "{kind}: {:?}", result.map(|r| r.image.spp));
        // the same through the auxiliary outputs
        let result = aov::render(&tracer, &camera, [64, 64], &mut stopper(1, || Err(Error::Interrupted)));
        assert!(matches!(result, Err(Error::Interrupted)), "{kind}");
        // stop, but keep what there is
        let image = ao::render(&tracer, &camera, &options, &mut stopper(9, || Ok(true))).unwrap();
        println!("{kind}: stopped after {} samples", image.image.spp);
        assert!(image.image.stopped_early && image.image.spp >= 1 && image.image.spp < 800, "{kind}: {}", image.image.spp);
        let same = render(&tracer, &scene, &scene.cameras[0], &AoOptions { spp: image.image.spp, ..options.clone() });
        assert_eq!(image.image.film.mean, same.image.film.mean, "{kind}: not the image of as many samples");
        assert!(!same.image.stopped_early);
        // in the midst of the first samples that are taken together: one is finished, or there would be no image
        let image = ao::render(&tracer, &camera, &options, &mut stopper(1, || Ok(true))).unwrap();
        assert!(image.image.stopped_early && image.image.spp == 1, "{kind}: {}", image.image.spp);
        let same = render(&tracer, &scene, &scene.cameras[0], &AoOptions { spp: 1, ..options.clone() });
        assert_eq!(image.image.film.mean, same.image.film.mean, "{kind}: not the image of one sample");
        let mut control = stopper(u32::MAX, || Ok(false));
        let image = ao::render(&tracer, &camera, &options, &mut control).unwrap();
        assert!(!image.image.stopped_early && image.image.spp == 800);
        assert!(control.progress.windows(2).all(|w| w[0].0 <= w[1].0), "{kind}: progress goes back");
        assert_eq!(control.progress.last(), Some(&(64 * 64 * 800, 64 * 64 * 800)), "{kind}");
    }
    assert_validation_clean(&device);
}

/// The layer does listen: copying no bytes is forbidden (VUID-VkBufferCopy-size-01988) and does nothing.
#[test]
fn gpu_validation_layer_listens() {
    let device = device();
    let a = Buffer::new(&device, "a", 64, Memory::Device).unwrap();
    let b = Buffer::new(&device, "b", 64, Memory::Device).unwrap();
    Commands::new(&device).unwrap().run(|r| r.copy(&a, 0, &b, 0, 0)).unwrap();
    let messages = device.validation_messages();
    println!("{} messages, the first: {:?}", messages.len(), messages.first());
    assert!(messages.iter().any(|m| m.contains("VUID-VkBufferCopy-size-01988")), "{messages:?}");
    // taken: gone
    assert_validation_clean(&device);
    // and through the check that commands make
    Commands::new(&device).unwrap().run(|r| r.copy(&a, 0, &b, 0, 0)).unwrap();
    assert!(matches!(device.check_validation(), Err(Error::Vulkan(_))));
    assert!(device.check_validation().is_ok());
}

// --- auxiliary outputs ---

/// A texture's linear colour at coordinates `uv`, by the book: sRGB decoded before filtering.
fn texture_color(texture: &Texture, uv: DVec2) -> DVec3 {
    let rgba8 = texture.texels.as_bytes();
    let decode = |c: u8| {
        let c = c as f64 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    };
    let wrap = |i: f64, n: u32, mode: Wrap| {
        let (i, n) = (i as i64, n as i64);
        match mode {
            Wrap::Repeat => i.rem_euclid(n),
            Wrap::Clamp => i.clamp(0, n - 1),
            Wrap::Mirror => (i.rem_euclid(2 * n)).min(2 * n - 1 - i.rem_euclid(2 * n)),
        }
    };
    let fetch = |x: f64, y: f64| {
        let (x, y) = (wrap(x, texture.width, texture.wrap[0]), wrap(y, texture.height, texture.wrap[1]));
        let at = 4 * (y * texture.width as i64 + x) as usize;
        DVec3::from_array([0, 1, 2].map(|k| decode(rgba8[at + k])))
    };
    let p = uv * DVec2::new(texture.width as f64, texture.height as f64);
    match texture.filter {
        Filter::Nearest => fetch(p.x.floor(), p.y.floor()),
        Filter::Linear => {
            let corner = (p - 0.5).floor();
            let f = p - 0.5 - corner;
            let row = |y: f64| fetch(corner.x, y).lerp(fetch(corner.x + 1.0, y), f.x);
            row(corner.y).lerp(row(corner.y + 1.0), f.y)
        }
    }
}

/// What a pixel's centre shows, in double precision.
fn expected_aov(scene: &Scene, oracle: &Oracle, camera: &Camera, size: [u32; 2], pixel: [u32; 2]) -> AovPixel {
    let ray = camera_ray(camera, oracle.origin(), size, pixel.map(|p| p as f64 + 0.5));
    let hit = oracle.closest(ray);
    if !hit.is_hit() {
        let none = u32::MAX;
        return AovPixel { depth: f32::INFINITY, instance: none, primitive: none, material: none, ..AovPixel::zeroed() };
    }
    let instance = &scene.instances[hit.instance as usize];
    let mesh = &scene.meshes[instance.mesh];
    let material = &scene.materials[mesh.material];
    // normals go by the inverse transpose: the front stays the front, also of mirrored instances
    let normals = instance.object_to_world.matrix3.inverse().transpose();
    let [v, w] = hit.barycentrics;
    let mut color = material.base_color.as_dvec4();
    let (ng, mut ns) = match &mesh.geometry {
        Geometry::Triangles(t) => {
            let corners = t.indices[hit.primitive as usize].map(|i| i as usize);
            let [a, b, c] = corners.map(|i| t.positions[i].as_dvec3());
            let ng = (normals * (b - a).cross(c - a)).normalize();
            let blend = |f: &dyn Fn(usize) -> DVec4| f(corners[0]) * (1.0 - v - w) + f(corners[1]) * v + f(corners[2]) * w;
            let ns = match t.normals.is_empty() {
                true => ng,
                false => (normals * blend(&|i| t.normals[i].as_dvec3().extend(0.0)).truncate()).normalize(),
            };
            if !t.colors.is_empty() {
                color *= blend(&|i| t.colors[i].as_dvec4());
            }
            if let Some(slot) = material.base_color_texture {
                let set = &t.texcoords[slot.texcoord];
                let uv = match set.is_empty() {
                    true => DVec2::ZERO,
                    false => blend(&|i| set[i].as_dvec2().extend(0.0).extend(0.0)).truncate().truncate(),
                };
                let uv = slot.transform.matrix2.as_dmat2() * uv + slot.transform.translation.as_dvec2();
                color *= texture_color(&scene.textures[slot.texture], uv).extend(1.0);
            }
            (ng, ns)
        }
        Geometry::Spheres(s) => {
            let center = s[hit.primitive as usize].center.as_dvec3();
            let object = instance.object_to_world.inverse().transform_point3(ray.at(hit.t) + oracle.origin());
            let ng = (normals * (object - center)).normalize();
            (ng, ng)
        }
    };
    if ns.dot(ng) < 0.0 {
        ns = -ns;
    }
    AovPixel {
        depth: hit.t as f32,
        instance: hit.instance,
        primitive: hit.primitive,
        material: mesh.material as u32,
        position: ray.at(hit.t).as_vec3().to_array(),
        ng: ng.as_vec3().to_array(),
        ns: ns.as_vec3().to_array(),
        red: color.x as f32,
        green: color.y as f32,
        blue: color.z as f32,
    }
}

/// Everything at once: an ellipsoid, mirrored and stretched instances (in a group of their own and baked), spheres, smooth
/// normals, textures with transforms, vertex colours.
fn everything() -> Scene {
    let mut scene = scene("leaf-cards");
    let mut add = |geometry: Geometry, material: usize, transforms: &[DAffine3]| {
        scene.meshes.push(Mesh { name: String::new(), geometry, material });
        let mesh = scene.meshes.len() - 1;
        scene.instances.extend(transforms.iter().map(|&t| Instance { name: String::new(), mesh, object_to_world: t }));
    };
    let place = |scale: DVec3, turn: f64, x: f64, y: f64| {
        DAffine3::from_scale_rotation_translation(scale, DQuat::from_rotation_x(turn), DVec3::new(x, y, 1.5))
    };
    add(
        shapes::torus(0.3, 0.12, 24, 12),
        1,
        &[place(DVec3::new(-1.0, 1.0, 1.3), 0.4, -1.2, 1.0), place(DVec3::new(1.0, 0.6, 1.0), 1.0, -0.4, 1.1)],
    );
    add(shapes::icosphere(0.3, 2), 0, &[place(DVec3::new(1.0, -1.0, 0.8), 0.3, 0.4, 1.0)]);
    add(shapes::sphere(DVec3::new(0.1, 0.0, 0.0), 0.3), 0, &[place(DVec3::new(1.5, 0.6, 1.0), 0.9, 1.2, 1.0)]);
    add(
        shapes::sphere(DVec3::ZERO, 0.2),
        0,
        &[place(DVec3::splat(1.2), 0.2, 0.0, 1.8), place(DVec3::splat(-0.7), 0.2, 0.7, 1.8)],
    );
    scene
}

#[test]
fn gpu_auxiliary_outputs_equal_the_oracles() {
    let device = device();
    let mut scenes: Vec<(String, Scene)> =
        ["cornell-box", "stairs", "spheres:300", "grid:4", "far-away"].map(|n| (n.to_owned(), scene(n))).to_vec();
    scenes.push(("everything".into(), everything()));
    for (name, scene) in &scenes {
        let oracle = Oracle::new(scene, scene.origin());
        let extent = oracle.bounds().map_or(1.0, |(lo, hi)| lo.abs().max(hi.abs()).max_element()) as f32;
        let mut cameras = vec![("", scene.cameras[0].clone())];
        if name == "everything" || name == "stairs" {
            let mut camera = scene.cameras[0].clone();
            camera.projection = Projection::Orthographic { half_height: 2.0 };
            cameras.push((", orthographic", camera));
        }
        for (view, camera) in &cameras {
            let size = [150, 101];
            let want: Vec<AovPixel> = (0..size[0] * size[1])
                .into_par_iter()
                .map(|i| expected_aov(scene, &oracle, camera, size, [i % size[0], i / size[0]]))
                .collect();
            let instances: std::collections::HashSet<u32> = want.iter().map(|p| p.instance).collect();
            for kind in tracers(&device) {
                let what = format!("{name}{view} {kind}");
                let tracer = tracer(&device, kind, scene);
                let got = aov::render(&tracer, &record(scene, camera, size), size, &mut NoControl).unwrap();
                let far = |a: [f32; 3], b: [f32; 3]| {
                    let d = [0, 1, 2].map(|k| (a[k] - b[k]).abs());
                    // NaN counts as far
                    if d.iter().all(|x| x.is_finite()) { d[0].max(d[1]).max(d[2]) } else { f32::INFINITY }
                };
                // ids, depth, position, geometric normal, shading normal, colour
                let mut off = [0; 6];
                let mut example = [None; 6];
                for (i, (a, b)) in got.iter().zip(&want).enumerate() {
                    let ids = |p: &AovPixel| (p.instance, p.primitive, p.material);
                    let mut wrong = [false; 6];
                    wrong[0] = ids(a) != ids(b) || a.depth.is_finite() != b.depth.is_finite();
                    if wrong[0] || b.instance == u32::MAX {
                        // a pixel that misses holds nothing but its infinite depth
                        wrong[1] = !wrong[0] && a != b;
                    } else {
                        wrong[1] = a.depth.is_nan() || (a.depth - b.depth).abs() > 2e-5 * b.depth;
                        wrong[2] = far(a.position, b.position) > 1e-5 * extent;
                        wrong[3] = far(a.ng, b.ng) > 1e-4;
                        // a mesh that is placed once has its normals scaled to unit length before they are interpolated, others
                        // after: under a stretching transform that differs by a share of a triangle's curvature
                        wrong[4] = far(a.ns, b.ns) > 1e-4;
                        wrong[5] = far([a.red, a.green, a.blue], [b.red, b.green, b.blue]) > 2e-3;
                    }
                    for k in 0..6 {
                        off[k] += wrong[k] as usize;
                        if wrong[k] && example[k].is_none() {
                            example[k] = Some((i, *a, *b));
                        }
                    }
                }
                println!(
                    "{what}: of {} pixels and {} instances differ: ids {}, depth {}, position {}, ng {}, ns {}, colour {}",
                    want.len(),
                    instances.len(),
                    off[0],
                    off[1],
                    off[2],
                    off[3],
                    off[4],
                    off[5]
                );
                // edges within rounding of a pixel's centre, grazing views, borders of texels
                for k in 0..6 {
                    assert!(off[k] <= want.len() / 1000, "{what}: output {k} differs at {} pixels: {:?}", off[k], example[k]);
                }
            }
        }
    }
    assert_validation_clean(&device);
}

// --- rays ---

/// The rays that a render keeps are those of its first sample: the oracle's camera and sampler make the same.
#[test]
fn gpu_kept_rays_are_the_images() {
    let device = device();
    let scene = scene("stairs");
    let camera = &scene.cameras[0];
    let oracle = Oracle::new(&scene, scene.origin());
    let options = AoOptions { size: [75, 50], spp: 2, seed: 5, radius: 1.25, keep_rays: true, ..Default::default() };
    let sampler = Sampler { seed: options.seed };
    let block = Block::cut(options.size)[0];
    // in the order in which pixels are numbered
    let pixels: Vec<[u32; 2]> =
        (0..block.rays()).filter(|&k| block.image_index(k, options.size[0]).is_some()).map(|k| block.pixel(k)).collect();
    assert_eq!(pixels.len(), 75 * 50);
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let image = render(&tracer, &scene, camera, &options);
        let (primary, occlusion) = (&image.kept_primary, &image.kept_occlusion);
        assert_eq!(primary.len(), pixels.len(), "{kind}");
        let covered = image.image.film.coverage.len();
        println!("{kind}: {} camera rays, {} occlusion rays of {covered} pixels", primary.len(), occlusion.len());
        let wide = |a: [f32; 3]| DVec3::from_array(a.map(f64::from));
        let mut next = 0;
        let mut odd = 0;
        for (ray, &pixel) in primary.iter().zip(&pixels) {
            let u = sampler.get_2d_unit(pixel, 0, CAMERA_FILM);
            let film = [0, 1].map(|k| pixel[k] as f64 + u[k] as f64);
            let want = camera_ray(camera, oracle.origin(), options.size, film);
            assert!((wide(ray.origin) - want.origin).length() < 1e-6, "{kind}: {ray:?}, {want:?}");
            assert!((wide(ray.direction) - want.direction).length() < 1e-6, "{kind}: {ray:?}, {want:?}");
            assert!(ray.tmin == 0.0 && ray.tmax == f32::INFINITY, "{kind}: {ray:?}");
            let hit = oracle.closest(*ray);
            if !hit.is_hit() {
                continue;
            }
            // an edge within rounding may make the oracle's hit another one: then the rays are out of step
            let Some(shadow) = occlusion.get(next) else { panic!("{kind}: occlusion rays are missing") };
            next += 1;
            let (point, normal) = (want.at(hit.t), oracle.facing_normal(&want, &hit));
            let direction = warp::to_world(
                normal.as_vec3().to_array(),
                warp::cosine_hemisphere(sampler.get_2d_unit(pixel, 0, AO_DIRECTION)),
            );
            let above = wide(shadow.origin) - point;
            odd += ((wide(shadow.direction) - wide(direction)).length() > 1e-4 || above.length() > 1e-4) as usize;
            assert!(shadow.tmin == 0.0 && shadow.tmax == 1.25, "{kind}: {shadow:?}");
        }
        println!("{kind}: {odd} occlusion rays are not the oracle's");
        assert_eq!(next, occlusion.len(), "{kind}");
        assert!(odd <= next / 1000, "{kind}: {odd} of {next} occlusion rays are not the oracle's");
        // those of the second sample are not among them, and they are not kept unless asked for
        let image = render(&tracer, &scene, camera, &AoOptions { keep_rays: false, ..options.clone() });
        assert!(image.kept_primary.is_empty() && image.kept_occlusion.is_empty());
    }
    assert_validation_clean(&device);
}
