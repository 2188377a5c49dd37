//! Many bounces: enclosures in which light is the same everywhere, where paths end, and what does not depend on how they are traced.

use super::*;
use skylit::scene::builtin::{by_name, shapes};

/// In a closed box whose walls emit 1 and reflect a share a, radiance is 1 / (1 - a) everywhere.
#[test]
fn gpu_a_room_of_light() {
    let device = device();
    let h = DVec3::splat(1.0);
    let camera = Camera::look_at(DVec3::new(0.3, 0.1, 0.2), DVec3::new(-1.0, -0.4, -0.3), DVec3::Y, 1.2);
    for albedo in [0.3f32, 0.8] {
        // seen from inside: the box's faces look outwards
        let walls = Material { emissive: Vec3::ONE, double_sided: true, ..matte(albedo) };
        let room = scene_of(vec![(shapes::cuboid(-h, h), walls)], camera.clone());
        let options = PathOptions { samples: SampleSettings::new([16, 16], 256, 9), ..Default::default() };
        let expected = 1.0 / (1.0 - f64::from(albedo));
        for strategy in [Strategy::Mis, Strategy::Bsdf, Strategy::Light] {
            holds(&device, "room", &room, &PathOptions { strategy, ..options.clone() }, expected, 2e-2);
        }
        // a path of n bounces has the first n + 1 terms of the series
        for max_depth in [0u32, 1, 3] {
            let part: f64 = (0..=max_depth).map(|k| f64::from(albedo).powi(k as i32)).sum();
            let options = PathOptions { max_depth, rr_depth: 100, ..options.clone() };
            holds(&device, &format!("room, {max_depth} bounces"), &room, &options, part, 2e-2);
        }
        // and without its first n bounces the rest of the series
        for min_depth in [1u32, 2] {
            let rest = f64::from(albedo).powi(min_depth as i32) * expected;
            let options = PathOptions { min_depth, rr_depth: 100, ..options.clone().with_samples(|s| s.spp = 64) };
            holds(&device, &format!("room, without {min_depth} bounces"), &room, &options, rest, 2e-2);
        }
        // or with the rest of the series scaled, from the second bounce on
        for indirect_scale in [0.25, 3.0] {
            let direct = 1.0 + f64::from(albedo);
            let scaled = direct + f64::from(indirect_scale) * (expected - direct);
            let options = PathOptions { indirect_scale, rr_depth: 100, ..options.clone().with_samples(|s| s.spp = 64) };
            holds(&device, &format!("room, indirect light by {indirect_scale}"), &room, &options, scaled, 2e-2);
        }
        // or with each term from the second bounce on clamped: sampled by the BSDF, a path adds the terms themselves
        let clamp = 0.25f32;
        let terms = (0..100).map(|k| (k, f64::from(albedo).powi(k)));
        let clamped: f64 = terms.map(|(k, term)| if k < 2 { term } else { term.min(f64::from(clamp)) }).sum();
        let options = PathOptions {
            firefly_clamp: clamp,
            strategy: Strategy::Bsdf,
            rr_depth: 100,
            ..options.clone().with_samples(|s| s.spp = 64)
        };
        holds(&device, "room, indirect light clamped", &room, &options, clamped, 2e-2);
    }
}

/// Direct and indirect light are the whole, pixel by pixel: the same paths are counted in parts.
#[test]
fn gpu_parts_of_light_add_up() {
    let device = device();
    let scene = by_name("cornell-glass-sphere").unwrap();
    let flat = FlatScene::for_paths(&scene);
    let whole = PathOptions { samples: SampleSettings::new([16, 16], 16, 1), ..Default::default() };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &flat);
        let [direct, indirect, all] = [
            PathOptions { max_depth: 1, ..whole.clone() },
            PathOptions { min_depth: 2, ..whole.clone() },
            whole.clone(),
        ]
        .map(|options| render(&tracer, &flat, &options).image.film.mean);
        assert!(indirect.iter().any(|&c| c > 0.01) && indirect != all, "{kind}");
        for (k, &all) in all.iter().enumerate() {
            let sum = direct[k] + indirect[k];
            assert!((sum - all).abs() <= 2e-6 * (1.0 + all), "{kind}: {} + {} is not {all}", direct[k], indirect[k]);
        }
    }
    assert_validation_clean(&device);
}

/// A sphere's light in a room with roulette from the start, and never.
#[test]
fn gpu_roulette_changes_no_mean() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let flat = FlatScene::new(&scene);
    let options = PathOptions {
        samples: SampleSettings::new([16, 16], 256, 1),
        max_depth: 12,
        rr_depth: 100,
        ..Default::default()
    };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &flat);
        let whole = render(&tracer, &flat, &options);
        let cut = render(&tracer, &flat, &PathOptions { rr_depth: 1, ..options.clone().with_samples(|s| s.seed = 2) });
        assert!(cut.bounce_rays * 2 < whole.bounce_rays, "{kind}: roulette ends nothing");
        let (a, b) = (whole.image.film.mean_and_error(), cut.image.film.mean_and_error());
        println!("{kind}: {a:?}, with roulette {b:?}; longest paths {} and {}", whole.longest_path, cut.longest_path);
        assert_eq!(whole.longest_path, 12);
        // channels vary together: three times the variance
        assert!((a.0 - b.0).abs() < 4.5 * (3.0 * (a.1 * a.1 + b.1 * b.1)).sqrt(), "{kind}: {a:?} and {b:?}");
        assert!(a.1 < 0.02 * a.0);
    }
    assert_validation_clean(&device);
}

/// The same seed gives the same bits; and one tracer's image is another's, but for rays that rounding sends elsewhere.
#[test]
fn gpu_three_tracers_one_image_of_paths() {
    let device = device();
    for name in ["cornell-box", "cornell-mirror", "cornell-glass-sphere"] {
        let scene = by_name(name).unwrap();
        let flat = FlatScene::new(&scene);
        let options = PathOptions { samples: SampleSettings::new([32, 24], 16, 4), max_depth: 6, ..Default::default() };
        let mut images: Vec<(TracerKind, Vec<f32>)> = Vec::new();
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &flat);
            let first = render(&tracer, &flat, &options).image.film;
            let again = render(&tracer, &flat, &options).image.film;
            assert_eq!(first.mean, again.mean, "{name} {kind}: the same seed, other bits");
            assert!(first.mean.iter().any(|&m| m > 0.1), "{name} {kind}: dark");
            for (other, pixels) in &images {
                let differ =
                    first.mean.iter().zip(pixels).filter(|(a, b)| (**a - **b).abs() > 1e-3 * (1.0 + b.abs())).count();
                println!("{name}: {kind} and {other} differ in {differ} of {} values", pixels.len());
                // a path that goes elsewhere after a few bounces changes its pixel
                assert!(
                    differ * 50 <= pixels.len(),
                    "{name}: {kind} and {other} differ in {differ} of {} values",
                    pixels.len()
                );
            }
            images.push((kind, first.mean));
        }
    }
    assert_validation_clean(&device);
}

/// Grey surfaces under a white sky, one bounce: ambient occlusion itself.
#[test]
fn gpu_one_bounce_under_a_white_sky_is_ambient_occlusion() {
    use skylit::integrators::ao::{self, AoOptions};
    let device = device();
    let scene = by_name("stairs").unwrap();
    let flat = FlatScene::new(&scene);
    let size = [48, 32];
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &flat);
        let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.5);
        let occlusion = ao::render(
            &tracer,
            &record,
            &AoOptions { samples: SampleSettings::new(size, 256, 0), ..Default::default() },
            &mut NoControl,
        )
        .unwrap();
        let options = PathOptions {
            samples: SampleSettings::new(size, 256, 8),
            max_depth: 1,
            white_sky: Some(0.5),
            ..Default::default()
        };
        let sky = render(&tracer, &flat, &options).image.film;
        let error: f64 = (0..occlusion.image.film.mean.len())
            .map(|k| f64::from(occlusion.image.film.mean[k] - sky.mean[3 * k]).powi(2))
            .sum::<f64>();
        let rmse = (error / occlusion.image.film.mean.len() as f64).sqrt();
        println!("{kind}: rmse {rmse}");
        assert!(rmse < 0.03, "{kind}: {rmse}");
        let (a, b) = (occlusion.image.film.mean_and_error(), sky.mean_and_error());
        assert!((a.0 - b.0).abs() < 4.5 * (a.1 * a.1 + 3.0 * b.1 * b.1).sqrt(), "{kind}: {a:?} and {b:?}");
        // more bounces, more light
        let more = render(&tracer, &flat, &PathOptions { max_depth: 20, ..options }).image.film.mean_and_error().0;
        assert!(more > b.0 * 1.02, "{kind}: {more} with bounces, {} without", b.0);
    }
}
