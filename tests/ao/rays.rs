//! Rays that a render keeps.

use glam::DVec3;
use skylit::film::SampleSettings;
use skylit::film::block::Block;
use skylit::integrators::ao::Occlusion;
use skylit::oracle::Oracle;
use skylit::oracle::camera::camera_ray;
use skylit::sampling::{AO_DIRECTION, CAMERA_FILM, Sampler, warp};

use crate::common::{assert_validation_clean, device, scene, tracer, tracers};
use crate::{AoOptions, render};

/// The rays that a render keeps are those of its first sample: the oracle's camera and sampler make the same.
#[test]
fn gpu_kept_rays_are_the_images() {
    let device = device();
    let scene = scene("stairs");
    let camera = &scene.cameras[0];
    let oracle = Oracle::new(&scene, scene.origin());
    let options = AoOptions {
        samples: SampleSettings { keep_rays: true, ..SampleSettings::new([75, 50], 2, 5) },
        occlusion: Occlusion::new(1.25, 1.0),
        ..Default::default()
    };
    let sampler = Sampler { seed: options.samples.seed };
    let block = Block::cut(options.samples.size)[0];
    // in the order in which pixels are numbered
    let pixels: Vec<[u32; 2]> = (0..block.rays())
        .filter(|&k| block.image_index(k, options.samples.size[0]).is_some())
        .map(|k| block.pixel(k))
        .collect();
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
            let want = camera_ray(camera, oracle.origin(), options.samples.size, film);
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
        // those of the second sample are not among them, and they are not kept unless requested
        let image = render(&tracer, &scene, camera, &options.clone().with_samples(|s| s.keep_rays = false));
        assert!(image.kept_primary.is_empty() && image.kept_occlusion.is_empty());
    }
    assert_validation_clean(&device);
}
