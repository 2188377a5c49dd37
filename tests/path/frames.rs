//! Frames of radiance in real time, against stills of the same paths.

use super::*;
use glam::DQuat;
use skylit::accel::features::Blend;
use skylit::colour::srgb_byte;
use skylit::integrators::ao::Occlusion;
use skylit::integrators::path::ambient::{Ambient, OccludedLight};
use skylit::integrators::path::{PathIntegrator, PixelFilter};
use skylit::output::tone_map::ToneMap;
use skylit::realtime::display::{Display, DisplayMode};
use skylit::realtime::{Filter, FilterKind, Preset, Realtime, Settings};
use skylit::scene::animation::{
    AnimatedLight, AnimatedMaterial, Animation, Channel, Interpolation, LightProperty, LocalTransform,
    MaterialProperty, Node, Playback, Pose, Property, RigParts, SLOTS, Sampler, Target, TextureTransform, ValueChannel,
};
use skylit::scene::{AnimationRig, EnvironmentMap, builtin};
use skylit::tracer::MaterialChange;

const SIZE: [u32; 2] = [32, 18];

fn scene(name: &str) -> Scene {
    builtin::by_name(name).unwrap()
}

fn record(scene: &Scene, camera: &Camera) -> CameraRecord {
    CameraRecord::new(camera, scene.origin(), f64::from(SIZE[0]) / f64::from(SIZE[1]))
}

/// A frame is what its samples say: neither history, filter nor antialiasing.
fn plain(spp: u32) -> Settings {
    let filter = Filter { kind: FilterKind::None, radius: 0, samples: 0.0 };
    Settings { rays_per_pixel: spp, history: 1, filter, seed: 5, ..Preset::Balanced.settings() }
}

/// With all of it, and what the image converges to at rest.
fn converging() -> Settings {
    Settings { antialias: true, converge: true, ..Preset::Balanced.settings() }
}

fn options(spp: u32) -> PathOptions {
    PathOptions {
        samples: SampleSettings { pixel_filter: PixelFilter::Centre, ..SampleSettings::new(SIZE, spp, 5) },
        ..Default::default()
    }
}

fn frames(tracer: &Tracer, flat: &FlatScene, settings: &Settings, options: &PathOptions) -> Realtime {
    Realtime::radiance(tracer, flat, SIZE, settings, options).unwrap_or_else(|e| panic!("{}: {e}", tracer.kind()))
}

fn rmse(a: &[f32], b: &[f32]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Mirrors, glass, textures of light: the parts that are filtered apart add up to the same paths' radiance, pixel by pixel.
#[test]
fn gpu_frames_the_parts_of_radiance_add_up() {
    let device = device();
    let lit = Ambient {
        color: Vec3::new(1.0, 0.5, 0.25),
        occlusion: Occlusion::new(1.0, 1.0),
        occluded: OccludedLight::Ambient,
    };
    let variants = [
        ("cornell-spheres", options(6)),
        ("cornell-box", PathOptions { max_depth: 1, ambient: Some(lit), ..options(4) }),
        (
            "cornell-box",
            PathOptions { max_depth: 1, ambient: Some(Ambient { occluded: OccludedLight::All, ..lit }), ..options(4) },
        ),
        ("stairs", PathOptions { white_sky: Some(0.5), ..options(4) }),
    ];
    for (name, options) in variants {
        let scene = scene(name);
        let flat = FlatScene::for_paths(&scene);
        let camera = record(&scene, &scene.cameras[0]);
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &flat);
            let still = render(&tracer, &flat, &options).image.film.mean;
            let mut frames = frames(&tracer, &flat, &plain(options.samples.spp), &options);
            frames.frame(&tracer, &camera, &[]).unwrap();
            let got = frames.result().unwrap();
            assert_eq!(got.len(), still.len());
            assert!(still.iter().sum::<f32>() > 1.0, "{name}: dark");
            for (k, (got, want)) in got.iter().zip(&still).enumerate() {
                assert!(
                    (got - want).abs() <= 2e-5 * want.abs().max(0.01),
                    "{kind}, {name}: value {k} is {got}, of a still {want}"
                );
            }
        }
    }
    assert_validation_clean(&device);
}

/// After the camera has stopped, the filtered image gives way to the mean of all samples: the error falls to that of a still of as many samples, and is no bias.
#[test]
fn gpu_frames_at_rest_become_the_still() {
    let device = device();
    const FRAMES: [usize; 4] = [8, 64, 250, 1000];
    const EARLY_RUNS: u32 = 8;
    let names = ["cornell-spheres", "leaf-cards", "cornell-box", "stairs"];
    for &name in if common::is_full() { &names[..] } else { &names[..1] } {
        let mut scene = scene(name);
        if scene.lights.is_empty() && scene.materials.iter().all(|m| m.emissive == Vec3::ZERO) {
            scene.environment = Environment::Uniform(Vec3::new(0.5, 0.7, 1.0));
        }
        let flat = FlatScene::for_paths(&scene);
        let tracer = tracer(&device, TracerKind::Compute, &flat);
        // without the noise of caustics, which no number of samples here ends
        let paths =
            PathOptions { firefly_clamp: 1.0, ..options(8192).with_samples(|s| s.pixel_filter = PixelFilter::Box) };
        let camera = record(&scene, &scene.cameras[0]);
        let mut integrator = PathIntegrator::new(&tracer, &flat, &paths).unwrap();
        let mut still =
            |spp, seed| integrator.render(&tracer, &camera, spp, seed, &mut NoControl).unwrap().image.film.mean;
        let truth = still(8192, 1);
        let expected = rmse(&still(1024, 2), &truth);
        // Frames of 2, 2, 4, 8, 8, 8, 8 and 8 samples: better than a still of 35, and no worse than one of 40. The error of so few differs by a tenth from seed to seed.
        let mean_error =
            |error: &mut dyn FnMut(u32) -> f64| (0..EARLY_RUNS).map(|k| error(10 + k).powi(2)).sum::<f64>().sqrt();
        let [early_least, early_still] = [35, 40].map(|spp| mean_error(&mut |seed| rmse(&still(spp, seed), &truth)));
        let early = mean_error(&mut |seed| {
            let paths = paths.clone().with_samples(|s| s.seed = seed);
            let mut frames = frames(&tracer, &flat, &converging(), &paths);
            for _ in 0..FRAMES[0] {
                frames.frame(&tracer, &camera, &[]).unwrap();
            }
            rmse(&frames.result().unwrap(), &truth)
        });
        let mut frames = frames(&tracer, &flat, &converging(), &paths);
        let mut errors = Vec::new();
        for k in 1..=FRAMES[3] {
            frames.frame(&tracer, &camera, &[]).unwrap();
            if FRAMES.contains(&k) {
                errors.push(rmse(&frames.result().unwrap(), &truth));
            }
        }
        // as many samples as the settings say, and then none
        assert_eq!(frames.shown_samples(), converging().rest_samples.max(Settings::RADIANCE_REST_SAMPLES), "{name}");
        let result = frames.result().unwrap();
        let bias = result.iter().zip(&truth).map(|(a, b)| f64::from(a - b)).sum::<f64>() / truth.len() as f64;
        println!(
            "{name}: error after {FRAMES:?} frames {errors:.5?}; of a still of 1024 samples {expected:.5}; after 8 frames {:.3} of a still; bias {bias:+.6}",
            early / early_still
        );
        // the first frame, whose samples lie at one place in all pixels, is soon forgotten, and the mean of the long ones has nearly the noise of all their samples
        assert!(
            early < early_least.min(1.05 * early_still),
            "{name}: after 8 frames {early}, of stills {early_least} and {early_still}"
        );
        assert!(errors.windows(2).all(|e| e[1] < 1.02 * e[0]), "{name}: the error grows: {errors:?}");
        assert!(errors[3] < 1.6 * expected, "{name}: {errors:?}, of a still {expected}");
        assert!(errors[3] < 0.5 * errors[0], "{name}: {errors:?}");
        // pixels are independent
        assert!(bias.abs() < 4.0 * expected / (truth.len() as f64 / 3.0).sqrt() + 1e-5, "{name}: bias {bias}");
    }
    assert_validation_clean(&device);
}

/// While the camera moves: far less noise than the paths of one frame have, and no light that lags behind.
#[test]
fn gpu_frames_in_motion_are_clean_and_do_not_lag() {
    let device = device();
    let scene = scene("cornell-box");
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let at = |frame: u32| {
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world *= DAffine3::from_translation(DVec3::new(0.004 * f64::from(frame), 0.0, 0.0));
        record(&scene, &camera)
    };
    let paths = options(1);
    let mut moving = frames(&tracer, &flat, &Settings { converge: false, ..converging() }, &paths);
    let mut noisy = frames(&tracer, &flat, &plain(1), &paths);
    for k in 0..24 {
        moving.frame(&tracer, &at(k), &[]).unwrap();
    }
    noisy.frame(&tracer, &at(23), &[]).unwrap();
    let truth = options(512).with_samples(|s| s.pixel_filter = PixelFilter::Box);
    let truth =
        PathIntegrator::new(&tracer, &flat, &truth).unwrap().render(&tracer, &at(23), 512, 9, &mut NoControl).unwrap();
    // the lamp's edge, at fifty times the radiance of the walls, is another matter
    let dark = |values: &[f32]| -> Vec<f32> { values.iter().map(|v| v.min(0.5)).collect() };
    let truth = dark(&truth.image.film.mean);
    let [clean, noise] = [moving, noisy].map(|f| rmse(&dark(&f.result().unwrap()), &truth));
    println!("RMSE in motion {clean:.4}, of the samples of a frame {noise:.4}");
    assert!(clean < 0.55 * noise, "{clean} of {noise}");
    assert_validation_clean(&device);
}

/// New light shortens histories of radiance to eight frames, and to fewer where light differs; a jump of the camera alone ends those that show other surfaces.
#[test]
fn gpu_frames_forget_what_has_changed_and_no_more() {
    let device = device();
    let scene = scene("cornell-box");
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let camera = record(&scene, &scene.cameras[0]);
    let settings = Settings { converge: false, antialias: false, ..converging() };
    let mut frames = frames(&tracer, &flat, &settings, &options(1));
    for _ in 0..32 {
        frames.frame(&tracer, &camera, &[]).unwrap();
    }
    let most = |f: &Realtime| f.samples().unwrap().into_iter().fold(0.0, f32::max);
    assert_eq!(most(&frames), 32.0);
    frames.change_light();
    frames.frame(&tracer, &camera, &[]).unwrap();
    assert_eq!(most(&frames), 9.0, "eight of before, and one");
    let (samples, covered) = (frames.samples().unwrap(), frames.coverage().unwrap());
    let covered: Vec<f32> = samples.into_iter().zip(covered).filter(|(_, c)| *c > 0.0).map(|(n, _)| n).collect();
    let kept = covered.iter().filter(|n| **n >= 3.0).count();
    println!("{kept} of {} pixels count two frames of before or more: nothing differs", covered.len());
    // where e is the variance of the mean, b^2 is below 3 e with a probability of 0.92
    assert!(kept as f64 > 0.85 * covered.len() as f64);
    for _ in 0..20 {
        frames.frame(&tracer, &camera, &[]).unwrap();
    }
    assert_eq!(most(&frames), 29.0);
    // a jump to the side: most of the room is in both images
    let mut jumped = scene.cameras[0].clone();
    jumped.camera_to_world *= DAffine3::from_translation(DVec3::new(1.0, 0.0, 0.0));
    frames.frame(&tracer, &record(&scene, &jumped), &[]).unwrap();
    let (samples, covered) = (frames.samples().unwrap(), frames.coverage().unwrap());
    let seen =
        |test: &dyn Fn(f32) -> bool| samples.iter().zip(&covered).filter(|(n, c)| **c > 0.0 && test(**n)).count();
    let (kept, new) = (seen(&|n| n > 10.0), seen(&|n| n == 5.0));
    println!("{kept} pixels kept their history, {new} show another surface");
    // one path, and four more because nothing is known of them
    assert!(kept > 20 * new && new > 0, "{kept} kept, {new} new");
    assert_eq!(seen(&|n| n < 5.0), 0);
    assert_validation_clean(&device);
}

/// What a camera that jumps uncovers has five paths, without bias, and others of each seed; in all tracers the same pixels have them, also where the pixels of a frame fill a launch.
#[test]
fn gpu_frames_uncovered_pixels_have_more_paths() {
    const SEEDS: u32 = 12;
    let all = SIZE.map(|n| n.next_multiple_of(8)).iter().product();
    let device = device();
    let scene = scene("cornell-box");
    let flat = FlatScene::for_paths(&scene);
    let camera = record(&scene, &scene.cameras[0]);
    let mut jumped = scene.cameras[0].clone();
    jumped.camera_to_world *= DAffine3::from_translation(DVec3::new(1.0, 0.0, 0.0));
    let jumped = record(&scene, &jumped);
    let mut uncovered: Option<Vec<bool>> = None;
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &flat);
        let truth = PathIntegrator::new(&tracer, &flat, &options(1024)).unwrap();
        let truth = { truth }.render(&tracer, &jumped, 1024, 9, &mut NoControl).unwrap().image.film.mean;
        let (mut squares, mut differences) = ([0.0, 0.0], Vec::new());
        for seed in 0..SEEDS {
            let [with_history, plain] = [32, 1].map(|history| {
                let launch_rays = if seed % 2 == 0 { u32::MAX } else { all };
                let settings = Settings { history, antialias: false, seed, launch_rays, ..plain(1) };
                let mut frames = frames(&tracer, &flat, &settings, &options(1).with_samples(|s| s.seed = seed));
                frames.frame(&tracer, &camera, &[]).unwrap();
                frames.frame(&tracer, &jumped, &[]).unwrap();
                frames
            });
            let is_new: Vec<bool> = with_history.samples().unwrap().iter().map(|n| *n == 5.0).collect();
            assert_eq!(*uncovered.get_or_insert_with(|| is_new.clone()), is_new, "{kind}, seed {seed}");
            let results = [with_history, plain].map(|f| f.result().unwrap());
            for k in (0..truth.len()).filter(|k| is_new[k / 3]) {
                for (sum, result) in squares.iter_mut().zip(&results) {
                    *sum += f64::from(result[k] - truth[k]).powi(2);
                }
                differences.push(f64::from(results[0][k] - truth[k]));
            }
        }
        let n = differences.len() as f64;
        let [five, one] = squares.map(|sum| (sum / n).sqrt());
        let bias = differences.iter().sum::<f64>() / n;
        println!(
            "{kind}: {} values, RMSE of five paths {five:.4}, of one {one:.4}, bias {bias:+.4}",
            differences.len()
        );
        // 0.45 where paths are independent
        assert!(five < 0.6 * one, "{kind}: {five} of {one}");
        // channels of a pixel are not independent
        assert!(bias.abs() < 4.0 * five / (n / 3.0).sqrt(), "{kind}: bias {bias}");
    }
    assert_validation_clean(&device);
}

/// Stairs under a map of a blue sky with a sun.
fn stairs_in_the_sun(to_map: DMat3) -> Scene {
    let mut scene = scene("stairs");
    let radiance = (0..32).map(|k| if k == 11 { Vec3::splat(40.0) } else { Vec3::new(0.2, 0.3, 0.5) }).collect();
    let map = EnvironmentMap { name: "map".into(), width: 8, height: 4, radiance, factor: Vec3::ONE, to_map };
    scene.environment = Environment::Map(map);
    scene
}

/// A map that is turned on the device lights frames and stills as one that was turned before.
#[test]
fn gpu_frames_under_a_map_that_turns() {
    let device = device();
    let after = DMat3::from_rotation_y(1.0);
    let [before, turned] = [DMat3::IDENTITY, after].map(stairs_in_the_sun);
    let [flat, turned] = [&before, &turned].map(FlatScene::for_paths);
    let [before, wanted] = [&flat, &turned].map(|flat| {
        let tracer = tracer(&device, TracerKind::Compute, flat);
        render(&tracer, flat, &options(4)).image.film.mean
    });
    assert!(rmse(&before, &wanted) > 0.05, "the map looks alike from all sides");
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let camera = record(flat.scene, &flat.scene.cameras[0]);
    let mut frames = frames(&tracer, &flat, &plain(4), &options(4));
    frames.frame(&tracer, &camera, &[]).unwrap();
    let first = frames.result().unwrap();
    // the same samples again
    frames.turn_environment(after);
    frames.rewind();
    frames.frame(&tracer, &camera, &[]).unwrap();
    let mut integrator = PathIntegrator::new(&tracer, &flat, &options(4)).unwrap();
    integrator.turn_environment(&after).unwrap();
    let still = integrator.render(&tracer, &camera, 4, 5, &mut NoControl).unwrap().image.film.mean;
    for (got, wanted) in [(&first, &before), (&frames.result().unwrap(), &wanted), (&still, &wanted)] {
        let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 2e-5 * b.abs().max(0.01);
        assert!(got.iter().zip(wanted).all(close), "RMSE {}", rmse(got, wanted));
    }
    assert_validation_clean(&device);
}

/// Where the sun jumps, histories have no part in the first frame after it: it has hardly more error than one that has none. Antialiasing's mean, which is clipped to the pixels around, has.
#[test]
fn gpu_frames_follow_a_sun_that_jumps() {
    let device = device();
    let after = DMat3::from_rotation_y(1.0);
    let [before, turned] = [DMat3::IDENTITY, after].map(stairs_in_the_sun);
    let [flat, turned] = [&before, &turned].map(FlatScene::for_paths);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let turned_tracer = self::tracer(&device, TracerKind::Compute, &turned);
    let camera = record(flat.scene, &flat.scene.cameras[0]);
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    for (antialias, pixel_filter) in [(false, PixelFilter::Centre), (true, PixelFilter::Box)] {
        let options = |spp| options(spp).with_samples(|s| s.pixel_filter = pixel_filter);
        let truth = render(&turned_tracer, &turned, &options(1024)).image.film.mean;
        for rays_per_pixel in [1, 4] {
            let (mut errors, seeds) = ([0.0; 3], 4);
            for seed in 0..seeds {
                let settings = Settings { seed, rays_per_pixel, antialias, ..converging() };
                let mut frames = frames(&tracer, &flat, &settings, &options(1).with_samples(|s| s.seed = seed));
                for _ in 0..16 {
                    frames.frame(&tracer, &camera, &[]).unwrap();
                }
                let old = frames.result().unwrap();
                frames.turn_environment(after);
                let stats = frames.frame(&tracer, &camera, &[]).unwrap();
                // several paths lie at places of their own, as where an image begins
                let have_own = antialias && rays_per_pixel > 1;
                assert_eq!((stats.samples, stats.primary_rays > pixels), (rays_per_pixel, have_own));
                let new = frames.result().unwrap();
                // where a frame has one path it has two then
                frames.reset();
                frames.frame(&tracer, &camera, &[]).unwrap();
                let fresh = frames.result().unwrap();
                for (error, image) in errors.iter_mut().zip([old, new, fresh]) {
                    *error += rmse(&image, &truth) / f64::from(seeds);
                }
            }
            let [old, new, fresh] = errors;
            println!(
                "{rays_per_pixel} paths: RMSE of what was shown {old:.4}, after the jump {new:.4}, without histories {fresh:.4}"
            );
            assert!(if antialias { new < 0.6 * old } else { new < 1.2 * fresh }, "{new} of {old}, {fresh}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_frames_are_tone_mapped_as_pictures_are() {
    let device = device();
    let scene = scene("cornell-spheres");
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let camera = record(&scene, &scene.cameras[0]);
    let mut frames = frames(&tracer, &flat, &plain(4), &options(4));
    for tone_map in ToneMap::ALL {
        let display = Display { shown: DisplayMode::Result, exposure: 1.0, unit: 1.0, tone_map };
        frames.display(&tracer, Some(display)).unwrap();
        frames.frame(&tracer, &camera, &[]).unwrap();
        let bytes = frames.displayed().unwrap().read(0, 4 * u64::from(SIZE[0] * SIZE[1])).unwrap();
        for (k, pixel) in frames.result().unwrap().chunks(3).enumerate() {
            let want = tone_map.map([2.0 * pixel[0], 2.0 * pixel[1], 2.0 * pixel[2]]).map(srgb_byte);
            let got = &bytes[4 * k..4 * k + 3];
            assert!((0..3).all(|c| got[c].abs_diff(want[c]) <= 1), "{tone_map}, pixel {k}: {got:?}, not {want:?}");
        }
    }
    let rays = Display { shown: DisplayMode::Rays, exposure: 0.0, unit: 1.0, tone_map: ToneMap::Linear };
    let error = frames.display(&tracer, Some(rays)).unwrap_err();
    assert_eq!(error.exit_code(), 64, "{error}");
    assert_validation_clean(&device);
}

/// What only ambient occlusion has is an error that says so.
#[test]
fn gpu_frames_of_radiance_refuse_settings_of_occlusion() {
    let device = device();
    let scene = scene("cornell-box");
    let flat = FlatScene::for_paths(&scene);
    let tracer = tracer(&device, TracerKind::Compute, &flat);
    let wrong = |settings: Settings, what: &str| {
        let error = Realtime::radiance(&tracer, &flat, SIZE, &settings, &options(1)).err().unwrap();
        assert!(error.exit_code() == 64 && error.to_string().contains(what), "{error}");
    };
    wrong(Preset::Larsen.settings(), "--preset larsen");
    wrong(Settings { technique: skylit::realtime::Technique::Gtao, ..plain(1) }, "--technique gtao");
}

/// The Cornell box, whose lamp moves and turns, as do a point light and a spot.
fn moving_lights() -> Scene {
    let mut scene = scene("cornell-box");
    let place = |kind, intensity| Light {
        name: String::new(),
        kind,
        intensity,
        position: DVec3::ZERO,
        direction: DVec3::NEG_Z,
        range: f64::INFINITY,
    };
    scene.lights.push(place(LightKind::Point, Vec3::new(0.2, 0.1, 0.05)));
    scene.lights.push(place(LightKind::Spot { inner_angle: 0.2, outer_angle: 0.7 }, Vec3::splat(0.4)));
    let (lo, hi) = scene.bounds().unwrap();
    let (middle, size) = ((lo + hi) * 0.5, (hi - lo).max_element());
    let emits = |scene: &Scene, mesh: usize| scene.materials[scene.meshes[mesh].material].emissive != Vec3::ZERO;
    let lamp = scene.instances.iter().position(|i| emits(&scene, i.mesh)).unwrap();
    let mut parts = RigParts {
        instances: vec![None; scene.instances.len()],
        cameras: vec![None; scene.cameras.len()],
        lights: vec![Some(1), Some(2)],
        ..RigParts::default()
    };
    parts.instances[lamp] = Some(0);
    let mut channels = Vec::new();
    for (node, (from, to)) in [
        (DVec3::ZERO, DVec3::new(0.2, -0.1, 0.1) * size),
        (middle, middle + DVec3::new(-0.2, 0.1, 0.2) * size),
        (middle + DVec3::Y * 0.3 * size, middle),
    ]
    .into_iter()
    .enumerate()
    {
        let turn = DQuat::from_rotation_x(if node == 2 { -1.4 } else { 0.0 });
        let local = LocalTransform::Trs { translation: from, rotation: turn, scale: DVec3::ONE };
        parts.nodes.push(Node { local, ..Node::default() });
        let values = [from, to].map(|v| v.as_vec3().to_array()).as_flattened().to_vec();
        let sampler = Sampler { interpolation: Interpolation::Linear, times: [0.0, 1.0].into(), values };
        channels.push(Channel { node, property: Property::Translation, sampler });
    }
    parts.animations = vec![Animation { name: "lights".into(), duration: 1.0, channels, ..Animation::default() }];
    AnimationRig::attach(&mut scene, parts).unwrap();
    scene
}

/// What lights is where the animation has it: frames are those of the posed scene.
#[test]
fn gpu_frames_lights_move() {
    let device = device();
    let scene = moving_lights();
    let rig = scene.rig.as_ref().unwrap();
    let motion = || rig.motion(0).unwrap();
    let options = options(4);
    let camera = record(&scene, &scene.cameras[0]);
    for kind in tracers(&device) {
        let flat = FlatScene::with_motion_and_blend(&scene, motion(), Blend::Stochastic).unwrap();
        let mut moving = tracer(&device, kind, &flat);
        let mut frames = frames(&moving, &flat, &plain(options.samples.spp), &options);
        frames.frame(&moving, &camera, &[]).unwrap();
        let first = frames.result().unwrap();
        for time in [0.5, 0.9] {
            let mut pose = Pose::default();
            rig.pose(0, time, Playback::Once, &mut pose).unwrap();
            let mut posed = scene.clone();
            pose.apply(&mut posed);
            let update = moving.update(&pose.changes()).unwrap();
            frames.move_lights(&moving, &posed).unwrap();
            frames.rewind();
            frames.frame(&moving, &camera, &update.moved).unwrap();
            let got = frames.result().unwrap();
            // a tracer that never knew another pose; the origin is that of the scene at rest
            let flat = FlatScene::with_motion_and_blend(&posed, motion(), Blend::Stochastic).unwrap();
            let still = render(&tracer(&device, kind, &flat), &flat, &options).image.film.mean;
            assert!(rmse(&first, &still) > 0.05, "{kind}: the lights stand still");
            let differs = |(got, want): &(&f32, &f32)| (*got - *want).abs() > 2e-5 * want.abs().max(0.01);
            // where a ray meets an edge, rounding decides
            let wrong: Vec<_> = got.iter().zip(&still).enumerate().filter(|(_, pair)| differs(pair)).collect();
            let some: Vec<_> =
                wrong.iter().take(12).map(|(k, (got, want))| format!("{}: {got} for {want}", k / 3)).collect();
            assert!(
                wrong.len() * 200 <= got.len(),
                "{kind}, at {time} s: {} of {} values differ from the posed scene's (pixel: value) {}",
                wrong.len(),
                got.len(),
                some.join(", ")
            );
        }
    }
    assert_validation_clean(&device);
}

/// The Cornell box, whose lamp goes out and comes back while its walls change their colour and a point light its intensity, from 0 on.
fn changing_values() -> Scene {
    let mut scene = scene("cornell-box");
    let (lo, hi) = scene.bounds().unwrap();
    scene.lights.push(Light {
        name: String::new(),
        kind: LightKind::Point,
        intensity: Vec3::ZERO,
        position: (lo + hi) * 0.5,
        direction: DVec3::NEG_Z,
        range: f64::INFINITY,
    });
    let lamp = scene.materials.iter().position(|m| m.emissive != Vec3::ZERO).unwrap();
    let wall = scene.instances.iter().map(|i| scene.meshes[i.mesh].material).find(|m| *m != lamp).unwrap();
    let material = |k: usize| AnimatedMaterial {
        materials: vec![k],
        emissive_factor: scene.materials[k].emissive,
        emissive_strength: 1.0,
        transforms: [TextureTransform::default(); SLOTS],
    };
    let mut parts = RigParts {
        instances: vec![None; scene.instances.len()],
        cameras: vec![None; scene.cameras.len()],
        lights: vec![None],
        materials: vec![material(lamp), material(wall)],
        animated_lights: vec![AnimatedLight { lights: vec![0], color: Vec3::new(1.0, 0.5, 0.2), intensity: 0.0 }],
        ..RigParts::default()
    };
    let channel = |target, values: &[f32]| ValueChannel {
        target,
        sampler: Sampler {
            interpolation: Interpolation::Linear,
            times: [0.0, 0.5, 1.0].into(),
            values: values.to_vec(),
        },
    };
    let colours = [0.9, 0.1, 0.1, 1.0, 0.1, 0.9, 0.1, 1.0, 0.1, 0.1, 0.9, 1.0];
    parts.animations = vec![Animation {
        name: "values".into(),
        duration: 1.0,
        values: vec![
            channel(Target::Material(0, MaterialProperty::EmissiveStrength), &[1.0, 0.0, 1.0]),
            channel(Target::Material(1, MaterialProperty::BaseColor), &colours),
            channel(Target::Material(1, MaterialProperty::Clearcoat), &[0.0, 1.0, 0.0]),
            channel(Target::Light(0, LightProperty::Intensity), &[0.0, 0.3, 0.3]),
        ],
        ..Animation::default()
    }];
    AnimationRig::attach(&mut scene, parts).unwrap();
    scene
}

/// Where nothing emits, samples are black and have no variance, which says nothing of light that begins: frames are those of an image that begins with it.
#[test]
fn gpu_frames_of_light_that_begins_have_no_black_histories() {
    let device = device();
    let scene = changing_values();
    let lamp = scene.materials.iter().position(|m| m.emissive != Vec3::ZERO).unwrap();
    let mut black = scene.clone();
    black.materials[lamp].emissive = Vec3::ZERO;
    assert!(black.is_black() && !black.is_dark() && !scene.is_black());
    let motion = scene.rig.as_ref().unwrap().motion(0).unwrap();
    let flat = FlatScene::with_motion_and_blend(&scene, motion, Blend::Stochastic).unwrap();
    let mut tracer = tracer(&device, TracerKind::Compute, &flat);
    let camera = record(&scene, &scene.cameras[0]);
    let brightest = |f: &Realtime| f.result().unwrap().into_iter().fold(0.0, f32::max);

    let mut changing = frames(&tracer, &flat, &converging(), &options(1));
    for (k, posed) in [&black, &black, &scene].into_iter().enumerate() {
        let change = tracer.set_materials(&[(lamp, posed.materials[lamp].clone())]).unwrap();
        changing.change_materials(change);
        changing.move_lights(&tracer, posed).unwrap();
        changing.frame(&tracer, &camera, &[]).unwrap();
        assert_eq!(brightest(&changing) > 0.0, !posed.is_black(), "frame {k}");
    }
    let mut begun = frames(&tracer, &flat, &converging(), &options(1));
    begun.start_at(2);
    begun.frame(&tracer, &camera, &[]).unwrap();
    assert_eq!(changing.result().unwrap(), begun.result().unwrap());
    assert_eq!(changing.samples().unwrap(), begun.samples().unwrap());

    // light that goes on changing has histories
    scene.materials[lamp].clone_into(&mut black.materials[lamp]);
    black.materials[lamp].emissive *= 1.01;
    tracer.set_materials(&[(lamp, black.materials[lamp].clone())]).unwrap();
    changing.move_lights(&tracer, &black).unwrap();
    changing.frame(&tracer, &camera, &[]).unwrap();
    let most = |f: &Realtime| f.samples().unwrap().into_iter().fold(0.0, f32::max);
    assert!(most(&changing) > most(&begun), "{} and {}", most(&changing), most(&begun));
    assert_validation_clean(&device);
}

/// Materials and lights have the values of their animation: frames are those of the scene with these values, on every tracer, also where a light goes out or begins, and an extension's lobe.
#[test]
fn gpu_frames_materials_and_lights_change() {
    let device = device();
    let scene = changing_values();
    let rig = scene.rig.as_ref().unwrap();
    let motion = || rig.motion(0).unwrap();
    assert!(motion().is_none() && motion().materials.len() == 2 && motion().lights == [0]);
    let options = options(16);
    let camera = record(&scene, &scene.cameras[0]);
    for kind in tracers(&device) {
        let flat = FlatScene::with_motion_and_blend(&scene, motion(), Blend::Stochastic).unwrap();
        let mut changing = tracer(&device, kind, &flat);
        let mut frames = frames(&changing, &flat, &plain(options.samples.spp), &options);
        frames.frame(&changing, &camera, &[]).unwrap();
        let mut before = frames.result().unwrap();
        for time in [0.25, 0.5, 0.9] {
            let mut pose = Pose::default();
            rig.pose(0, time, Playback::Once, &mut pose).unwrap();
            let mut posed = scene.clone();
            pose.apply(&mut posed);
            assert_eq!(changing.set_materials(&pose.materials).unwrap(), MaterialChange::Shading);
            assert_eq!(changing.set_materials(&pose.materials).unwrap(), MaterialChange::None);
            frames.move_lights(&changing, &posed).unwrap();
            frames.rewind();
            frames.frame(&changing, &camera, &[]).unwrap();
            let got = frames.result().unwrap();
            assert!(rmse(&before, &got) > 0.05, "{kind}: nothing changes until {time} s");
            // a tracer that never knew other values
            let flat = FlatScene::with_motion_and_blend(&posed, motion(), Blend::Stochastic).unwrap();
            let still = render(&tracer(&device, kind, &flat), &flat, &options).image.film.mean;
            let differs = |(got, want): &(&f32, &f32)| (*got - *want).abs() > 2e-5 * want.abs().max(0.01);
            let wrong = got.iter().zip(&still).filter(differs).count();
            assert!(wrong * 200 <= got.len(), "{kind}, at {time} s: {wrong} of {} values differ", got.len());
            // one that knows of no animation has other samples, and the same mean; the light in the room's middle makes it noisy
            if kind == TracerKind::Compute {
                let mean = |flat: &FlatScene| {
                    let v = render(&tracer(&device, kind, flat), flat, &self::options(256)).image.film.mean;
                    v.iter().sum::<f32>() / v.len() as f32
                };
                let ratio = mean(&flat) / mean(&FlatScene::for_paths(&posed));
                assert!((ratio - 1.0).abs() < 0.02, "at {time} s: {ratio} of the mean of a static scene");
            }
            before = got;
        }
    }
    assert_validation_clean(&device);
}

/// Who moves while a frame at rest is computed, which is then interrupted, sees what they would have seen without it: with what mirrors show, too.
#[test]
fn gpu_frames_interrupted_leave_histories() {
    let device = device();
    let scene = scene("cornell-spheres");
    let options = PathOptions { samples: SampleSettings::new(SIZE, 16, 0), ..Default::default() };
    let flat = FlatScene::for_paths(&scene);
    let cameras = [0.0, 0.01, 0.02].map(|x| {
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world *= glam::DAffine3::from_translation(glam::DVec3::X * x);
        record(&scene, &camera)
    });
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &flat);
        let settings = Settings { launch_rays: 2000, ..converging() };
        let make = || frames(&tracer, &flat, &settings, &options);
        let launches = crate::common::assert_interruptions_leave_histories(&tracer, &cameras, &make);
        println!("{kind}: {launches} launches");
        assert!(launches > 6, "{kind}: {launches}");
    }
    assert_validation_clean(&device);
}

/// An image whose resolution changes goes on with the histories of the one before, but for what it has seen itself when it comes to rest.
#[test]
fn gpu_frames_continue_in_another_size() {
    let device = device();
    let scene = scene("cornell-box");
    let flat = FlatScene::for_paths(&scene);
    let (full, half) = ([64, 36], [32, 18]);
    let camera = |size: [u32; 2], step: f64| {
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world *= glam::DAffine3::from_translation(glam::DVec3::X * step);
        CameraRecord::new(&camera, scene.origin(), f64::from(size[0]) / f64::from(size[1]))
    };
    // of what is displayed: else the lamp's edges were all of it
    let error = |frames: &Realtime, truth: &[f32]| {
        let shown = |image: &[f32]| image.iter().map(|v| v.min(1.0)).collect::<Vec<_>>();
        rmse(&shown(&frames.result().unwrap()), &shown(truth))
    };
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &flat);
        let with = |size, settings: Settings| {
            let options = PathOptions { samples: SampleSettings::new(size, 16, 0), ..Default::default() };
            Realtime::radiance(&tracer, &flat, size, &settings, &options).unwrap()
        };
        let pipeline = |size, seed| with(size, Settings { seed, ..converging() });
        let frame = |frames: &mut Realtime, size, step| drop(frames.frame(&tracer, &camera(size, step), &[]).unwrap());
        // a frame in motion: the first one of all has more paths
        let alone = |size, step, truth: &[f32]| {
            let mut frames = with(size, Settings { history: 1, antialias: false, ..converging() });
            [step - 0.01, step].iter().for_each(|&step| frame(&mut frames, size, step));
            error(&frames, truth)
        };
        let at_rest = |size, seed, step, count| {
            let mut frames = pipeline(size, seed);
            (0..count).for_each(|_| frame(&mut frames, size, step));
            frames
        };
        let truth = [(half, 0.02, 30), (full, 0.1, 60)]
            .map(|(size, step, count)| at_rest(size, 77, step, count).result().unwrap());
        // at rest, then in motion at half the size
        let mut rests = at_rest(full, 0, 0.0, 30);
        let mut own = at_rest(full, 0, 0.0, 30);
        let mut moves = pipeline(half, 0);
        assert!(!rests.continue_from(&tracer, &moves, false).unwrap(), "{kind}: there is nothing to continue");
        frame(&mut moves, half, 0.02);
        let noisy = alone(half, 0.02, &truth[0]);
        assert!(moves.continue_from(&tracer, &rests, false).unwrap());
        frame(&mut moves, half, 0.02);
        let continued = error(&moves, &truth[0]);
        println!("{kind}: in motion {noisy:.4}, continued {continued:.4}");
        assert!(continued < 0.4 * noisy, "{kind}: {continued}, and {noisy} without histories");
        (2..=5).for_each(|k| frame(&mut moves, half, 0.02 * f64::from(k)));
        // and at rest again, where nothing was seen before
        let noisy = alone(full, 0.1, &truth[1]);
        let mut frames = pipeline(full, 0);
        assert!(frames.continue_from(&tracer, &moves, true).unwrap());
        frame(&mut frames, full, 0.1);
        let continued = error(&frames, &truth[1]);
        println!("{kind}: at rest {noisy:.4}, continued {continued:.4}");
        assert!(continued < 0.4 * noisy, "{kind}: {continued}, and {noisy} without histories");
        // where all was, and where it was another part of the scene
        assert!(!rests.continue_from(&tracer, &moves, true).unwrap(), "{kind}: its own histories are better");
        frame(&mut rests, full, 0.1);
        frame(&mut own, full, 0.1);
        assert!(rests.result().unwrap() == own.result().unwrap(), "{kind}: they are not what they were");
        assert!(
            error(&rests, &truth[1]) < continued,
            "{kind}: coarse histories are better than {}",
            error(&rests, &truth[1])
        );
        frame(&mut rests, full, 30.0);
        assert!(rests.continue_from(&tracer, &moves, true).unwrap(), "{kind}: it has seen nothing of this");
    }
    assert_validation_clean(&device);
}
