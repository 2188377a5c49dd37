//! Films that are put down and taken up again, saved on their way, stopped where they are good enough, and added to a million times.

use super::*;
use skylit::film::Control;
use skylit::film::accumulate::Accumulated;
use skylit::film::schedule::FilmOptions;
use skylit::film::state::FilmState;
use skylit::film::tile_mask::TileMask;
use skylit::integrators::ao::{self, AoOptions};
use skylit::scene::builtin::{by_name, shapes};

/// Keeps what a film has on its way.
#[derive(Default)]
struct Intervals(Vec<Accumulated>);

impl Control for Intervals {
    fn interval(&mut self, image: &Accumulated) -> skylit::error::Result<()> {
        self.0.push(image.clone());
        Ok(())
    }
}

/// With so many samples in all, from a film or from none, its sums kept.
fn up_to(options: &PathOptions, spp: u32, start: Option<FilmState>) -> PathOptions {
    let film = FilmOptions { start: start.map(Arc::new), keep_state: true, ..options.samples.film.clone() };
    options.clone().with_samples(|s| (s.spp, s.film) = (spp, film))
}

fn same(what: &str, a: &Accumulated, b: &Accumulated) {
    assert!(a.state.is_some() && a.state == b.state, "{what}: other sums");
    let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&a.film.mean), bits(&b.film.mean), "{what}: other means");
    assert_eq!(bits(&a.film.variance), bits(&b.film.variance), "{what}: other variances");
    assert_eq!((&a.film.samples, a.spp, a.max_spp), (&b.film.samples, b.spp, b.max_spp), "{what}: other samples");
}

/// Wherever the samples are cut, the sums are the same to the last bit.
#[test]
fn gpu_a_film_goes_on_as_if_it_had_never_stopped() {
    let device = device();
    let box_ = PathOptions { samples: SampleSettings::new([21, 19], 16, 3), max_depth: 4, ..Default::default() };
    let sky = PathOptions { white_sky: Some(0.5), ..box_.clone().with_samples(|s| s.size = [16, 24]) };
    for (name, options) in [("cornell-box", box_), ("stairs", sky)] {
        let scene = by_name(name).unwrap();
        let flat = FlatScene::new(&scene);
        // the second on one tracer: every run compiles its shaders
        for kind in tracers(&device).into_iter().filter(|&k| name == "cornell-box" || k == TracerKind::Compute) {
            let tracer = tracer(&device, kind, &flat);
            let whole = render(&tracer, &flat, &up_to(&options, 16, None)).image;
            assert_eq!((whole.spp, whole.max_spp, whole.stopped_early), (16, 16, false));
            // and on that one what is the host's alone
            let alone = kind == TracerKind::Compute;
            let cuts = if alone { &[&[3, 7, 16][..], &[15, 16], &[16, 16]][..] } else { &[&[3, 7, 16][..]] };
            for cuts in cuts {
                let (mut state, mut rays, mut covered, mut last) = (None, 0, 0, None);
                for &spp in *cuts {
                    let image = render(&tracer, &flat, &up_to(&options, spp, state)).image;
                    (rays, covered) = (rays + image.primary_rays, covered + image.covered);
                    state = image.state.clone();
                    last = Some(image);
                }
                same(&format!("{name}, {kind}, cut at {cuts:?}"), &last.unwrap(), &whole);
                // each run tells of its own rays
                assert_eq!((rays, covered), (whole.primary_rays, whole.covered), "{name}, {kind}, cut at {cuts:?}");
            }
            if alone {
                // state that is not requested is not kept, and changes nothing
                let plain = render(&tracer, &flat, &options).image;
                assert!(
                    plain.state.is_none()
                        && plain.film.mean == whole.film.mean
                        && plain.film.variance == whole.film.variance
                );
                // another seed, other sums: the comparison sees something
                let other =
                    render(&tracer, &flat, &up_to(&options.clone().with_samples(|s| s.seed = 4), 16, None)).image;
                assert_ne!(other.film.mean, whole.film.mean);
            }
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_films_of_ambient_occlusion_go_on_too() {
    let device = device();
    let scene = by_name("stairs").unwrap();
    let flat = FlatScene::new(&scene);
    let size = [40, 30];
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 4.0 / 3.0);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        let image = |spp: u32, start: Option<FilmState>| {
            let film = FilmOptions { start: start.map(Arc::new), keep_state: true, ..Default::default() };
            ao::render(
                &tracer,
                &record,
                &AoOptions {
                    samples: SampleSettings { film, ..SampleSettings::new(size, spp, 0) },
                    ..Default::default()
                },
                &mut NoControl,
            )
            .unwrap()
        };
        let whole = image(16, None);
        let [first, second] = [image(3, None), image(7, image(3, None).image.state)];
        let last = image(16, second.image.state.clone());
        assert!(
            last.image.state.is_some()
                && last.image.state == whole.image.state
                && last.image.film.mean == whole.image.film.mean,
            "{kind}"
        );
        let rays = first.occlusion_rays + second.occlusion_rays + last.occlusion_rays;
        assert_eq!(rays, whole.occlusion_rays, "{kind}");
    }
    assert_validation_clean(&device);
}

/// What is saved on the way is what a run of so many samples gives.
#[test]
fn gpu_intervals_are_images_of_their_own() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let flat = FlatScene::new(&scene);
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
    let base = PathOptions { samples: SampleSettings::new([24, 24], 12, 9), max_depth: 4, ..Default::default() };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        let run = |options: &PathOptions| {
            let mut seen = Intervals::default();
            let last = path::render(&tracer, &flat, &record, options, &mut seen).unwrap().image;
            (seen.0, last)
        };
        let film = FilmOptions { intervals: vec![1, 2, 4, 8], ..Default::default() };
        let (seen, last) = run(&up_to(&base.clone().with_samples(|s| s.film = film.clone()), 12, None));
        assert_eq!(seen.iter().map(|i| i.spp).collect::<Vec<_>>(), [1, 2, 4, 8], "{kind}");
        if kind != TracerKind::Compute {
            same(&format!("{kind}, 4 samples"), &seen[2], &run(&up_to(&base, 4, None)).1);
            continue;
        }
        for image in seen.iter().chain([&last]) {
            let alone = run(&up_to(&base, image.spp, None)).1;
            same(&format!("{kind}, {} samples", image.spp), image, &alone);
        }
        // from the middle: those that are left
        let options = base.clone().with_samples(|s| s.film = film);
        let (rest, again) = run(&up_to(&options, 12, seen[1].state.clone()));
        assert_eq!(rest.iter().map(|i| i.spp).collect::<Vec<_>>(), [4, 8], "{kind}");
        same(&format!("{kind}, from 2 samples"), &again, &last);
        // the sums are saved only if requested
        let (seen, last) = run(&options);
        assert!(last.state.is_none() && seen.len() == 4, "{kind}");
    }
    assert_validation_clean(&device);
}

/// An image of two blocks, and one that is empty for the most part.
#[test]
fn gpu_films_of_many_blocks_and_few_tiles() {
    let device = device();
    // what surrounds the scene differs from texel to texel
    let radiance: Vec<Vec3> = (0..64 * 32).map(|k| Vec3::new(0.1, 1.0, 7.0) * (1.0 + (k * 37 % 101) as f32)).collect();
    let environment = Environment::Map(skylit::scene::EnvironmentMap {
        name: "map".into(),
        width: 64,
        height: 32,
        radiance: radiance.into(),
        factor: Vec3::ONE,
        to_map: glam::DMat3::IDENTITY,
    });
    let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 2.5);
    let behind = shapes::sphere(DVec3::Z * 5.0, 1.0);
    let scene = Scene { environment, ..scene_of(vec![(behind, matte(0.5))], camera) };
    let flat = FlatScene::new(&scene);
    let tracer = |flat: &FlatScene| tracer(&device, TracerKind::Compute, flat);
    let tall = PathOptions { samples: SampleSettings::new([3, 262_200], 16, 2), max_depth: 0, ..Default::default() };
    assert_eq!(skylit::film::block::Block::cut(tall.samples.size).len(), 2);
    let compute = tracer(&flat);
    let whole = render(&compute, &flat, &up_to(&tall, 3, None)).image;
    let film = FilmOptions { intervals: vec![1], ..Default::default() };
    same("two blocks", &render(&compute, &flat, &up_to(&tall.with_samples(|s| s.film = film), 3, None)).image, &whole);
    assert!(whole.film.variance.iter().any(|&v| v > 0.0), "all samples are alike");

    // a light in the dark: most tiles show nothing and are not traced
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 8.0), DVec3::ZERO, DVec3::Y, 0.8);
    let scene = scene_of(vec![(shapes::sphere(DVec3::new(1.0, 0.5, 0.0), 0.4), emitter(2.0))], camera);
    let flat = FlatScene::new(&scene);
    let compute = tracer(&flat);
    let options = PathOptions { samples: SampleSettings::new([80, 60], 16, 6), ..Default::default() };
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 4.0 / 3.0);
    let tile_mask = TileMask::new(&flat, &record, options.samples.size, 16).map(Arc::new);
    assert!(tile_mask.is_some(), "nothing is left out");
    let whole = render(&compute, &flat, &up_to(&options, 16, None)).image;
    let covered = options.with_samples(|s| s.tile_mask = tile_mask);
    let begun = render(&compute, &flat, &up_to(&covered, 5, None)).image;
    let gone_on = render(&compute, &flat, &up_to(&covered, 16, begun.state)).image;
    same("few tiles", &gone_on, &whole);
    assert!(gone_on.skipped_primary_rays > gone_on.primary_rays && gone_on.primary_rays > 0);
    assert_validation_clean(&device);
}

#[test]
fn gpu_a_film_of_another_size_is_refused() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let flat = FlatScene::new(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
    for other in [FilmState::new([8, 9], 3), FilmState::new([8, 8], 1)] {
        let options =
            up_to(&PathOptions { samples: SampleSettings::new([8, 8], 16, 0), ..Default::default() }, 4, Some(other));
        let error = path::render(&tracer, &flat, &record, &options, &mut NoControl).unwrap_err();
        assert_eq!(error.exit_code(), 64);
        assert!(error.to_string().contains("cannot be resumed as one of 8x8 with 3"), "{error}");
    }
}

/// Root of the mean square difference over the pixels that `of` chooses.
fn rmse(film: &Film, reference: &Film, of: impl Fn(usize) -> bool) -> f64 {
    let squares: Vec<f64> = (0..film.mean.len())
        .filter(|k| of(k / 3))
        .map(|k| f64::from(film.mean[k] - reference.mean[k]).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

/// A floor seen from above, a light over one of its corners and out of sight: found by chance, which is noisy near it and quiet far away.
fn light_over_a_corner() -> Scene {
    let mut camera = Camera::look_at(DVec3::new(0.0, 0.5, 0.0), DVec3::ZERO, DVec3::Z, 1.0);
    camera.projection = skylit::scene::Projection::Orthographic { half_height: 3.0 };
    let lamp = shapes::sphere(DVec3::new(2.5, 1.2, 1.5), 0.5);
    scene_of(vec![(shapes::floor(DVec3::ZERO, 20.0), matte(0.6)), (lamp, emitter(4.0))], camera)
}

/// Tiles are left alone once they are good enough: the image is as accurate as requested, and quiet tiles cost less.
#[test]
fn gpu_a_target_is_reached_where_it_is_dear_and_where_it_is_cheap() {
    let device = device();
    let scene = light_over_a_corner();
    let flat = FlatScene::new(&scene);
    let base = PathOptions { samples: SampleSettings::new([64, 48], 16, 11), max_depth: 1, ..Default::default() };
    let compute = tracer(&device, TracerKind::Compute, &flat);
    // light samples find the light at once
    let reference = render(&compute, &flat, &base.clone().with_samples(|s| (s.spp, s.seed) = (1024, 12))).image.film;
    assert!(reference.estimated_rmse() < 1e-3, "the reference is too noisy");
    let (target, most) = (0.03, 8192);
    let film = FilmOptions { target_rmse: Some(target), ..Default::default() };
    let options = PathOptions { strategy: Strategy::Uniform, ..base.with_samples(|s| s.film = film) };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        let image = render(&tracer, &flat, &up_to(&options, most, None)).image;
        let (least, mean, highest) = image.film.samples_range();
        let tiles = image.converged.unwrap();
        let error = rmse(&image.film, &reference, |_| true);
        println!(
            "{kind}: rmse {error:.5}, estimated {:.5}, target {target}; {least} to {highest} samples, {mean:.1} in the mean; {tiles:?}",
            image.film.estimated_rmse()
        );
        assert!(error <= 1.5 * target, "{kind}: {error}");
        assert!(image.film.estimated_rmse() <= target, "{kind}");
        // all are done before the samples are spent, and not all at once
        assert!(tiles.done == tiles.all && tiles.all == 48 && !image.stopped_early, "{kind}: {tiles:?}");
        assert_eq!((least, least.is_power_of_two(), highest.is_power_of_two()), (64, true, true), "{kind}");
        assert!(highest >= 512 && mean < 0.6 * f64::from(highest), "{kind}: {mean} of {highest}");
        assert_eq!((image.spp, image.max_spp), (least, highest), "{kind}");
        // tile by tile, too: those that got least, and those in the middle
        let samples = image.state.as_ref().unwrap().tile_samples().to_vec();
        println!("{kind}: {samples:?}");
        let of_tile = |tile: usize| rmse(&image.film, &reference, |k| k / 64 / 8 * 8 + k % 64 / 8 == tile);
        let worst = (0..48).map(of_tile).fold(0.0, f64::max);
        println!("{kind}: worst tile {worst:.5}");
        assert!(worst <= 1.5 * target, "{kind}: a tile with an error of {worst}");
        let mut counts = samples.clone();
        counts.sort_unstable();
        counts.dedup();
        assert!(counts.len() >= 3, "{kind}: {counts:?}");
        if kind != TracerKind::Compute {
            continue;
        }

        // put down at a check, between two, and at the end: the same bits
        for cut in [64, 100, 300] {
            let begun = render(&tracer, &flat, &up_to(&options, cut, None)).image;
            let gone_on = render(&tracer, &flat, &up_to(&options, most, begun.state)).image;
            same(&format!("{kind}, cut at {cut}"), &gone_on, &image);
        }
        // less error: those that are not good enough go on, from where they are
        let film = FilmOptions { target_rmse: Some(0.7 * target), ..Default::default() };
        let better = render(
            &tracer,
            &flat,
            &up_to(&options.clone().with_samples(|s| s.film = film), 4 * most, image.state.clone()),
        )
        .image;
        assert!(better.film.estimated_rmse() <= 0.7 * target && better.converged.unwrap().done == 48, "{kind}");
        assert!(rmse(&better.film, &reference, |_| true) <= 1.05 * target, "{kind}");
        // and without a target, all do
        let untargeted = options.clone().with_samples(|s| s.film = FilmOptions::default());
        let even = render(&tracer, &flat, &up_to(&untargeted, 300, image.state.clone()));
        assert!(
            even.image.film.samples.iter().zip(&image.film.samples).all(|(now, then)| *now == 300.max(*then)),
            "{kind}"
        );
    }
    assert_validation_clean(&device);
}

/// A pixel that sees the same all the time, so often that single precision forgets most of it.
fn holds_after(samples: u32, cut: u32) {
    let device = device();
    let radiance = [0.1f32, 0.7, 3.3];
    let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.9);
    let behind = shapes::sphere(DVec3::Z * 5.0, 1.0);
    let environment = Environment::Uniform(Vec3::from_array(radiance));
    let scene = Scene { environment, ..scene_of(vec![(behind, matte(0.5))], camera) };
    let flat = FlatScene::new(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let options = PathOptions { samples: SampleSettings::new([8, 8], 16, 0), max_depth: 0, ..Default::default() };
    let begun = render(&tracer, &flat, &up_to(&options, cut, None)).image;
    let film = render(&tracer, &flat, &up_to(&options, samples, begun.state)).image.film;
    assert!(film.samples.iter().all(|&n| n == samples));
    let off = |value: f64, truth: f32| (value / f64::from(truth) - 1.0).abs();
    for (c, truth) in radiance.into_iter().enumerate() {
        let worst = film.plane(c).into_iter().map(|mean| off(f64::from(mean), truth)).fold(0.0, f64::max);
        let naive = (0..samples).fold(0.0f32, |sum, _| sum + truth);
        let naive = off(f64::from(naive) / f64::from(samples), truth);
        // of one sample: 0, and the rounding of two sums of squares whose difference it is
        let deviation = film.variance_plane(c).into_iter().fold(0.0, f32::max).sqrt() / truth;
        println!("{samples} times {truth}: off by {worst:.1e}, a plain sum by {naive:.1e}; deviation {deviation:.1e}");
        assert!(worst < 1e-6, "{samples} times {truth}: off by {worst}");
        assert!(naive > 1e-6, "{samples} times {truth}: a plain sum would do");
        assert!(deviation < 1e-3, "{samples} times {truth}: deviation {deviation}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_many_samples_keep_their_digits() {
    holds_after(1 << 16, 12_345);
}

#[test]
#[ignore = "takes a minute: 64 million camera rays, a thousand at a time"]
fn gpu_a_million_samples_keep_their_digits() {
    holds_after(1_000_000, 333_333);
}

#[test]
fn gpu_an_integrator_renders_again() {
    let device = device();
    let scene = skylit::scene::builtin::by_name("cornell-box").unwrap();
    let flat = FlatScene::for_paths(&scene);
    let options = PathOptions { samples: SampleSettings::new([16, 16], 8, 0), ..PathOptions::default() };
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &flat);
        let record = CameraRecord::new(&scene.cameras[0], flat.origin, 1.0);
        let mut integrator = path::PathIntegrator::new(&tracer, &flat, &options).unwrap();
        let mut again = |spp, seed| integrator.render(&tracer, &record, spp, seed, &mut NoControl).unwrap();
        let [first, other, fewer, second] = [again(8, 3), again(8, 4), again(2, 3), again(8, 3)];
        // nothing of an image is left in the next
        assert_eq!(first.image.film.mean, second.image.film.mean, "{kind}");
        assert_eq!((first.bounce_rays, first.shadow_rays), (second.bounce_rays, second.shadow_rays), "{kind}");
        assert_ne!(first.image.film.mean, other.image.film.mean, "{kind}");
        let alone = path::render(
            &tracer,
            &flat,
            &record,
            &options.clone().with_samples(|s| (s.spp, s.seed) = (2, 3)),
            &mut NoControl,
        )
        .unwrap();
        assert_eq!(fewer.image.film.mean, alone.image.film.mean, "{kind}");
        let error = integrator.render(&tracer, &record, 9, 0, &mut NoControl).unwrap_err();
        assert_eq!(error.exit_code(), 64, "{error}");
    }
    assert_validation_clean(&device);
}
