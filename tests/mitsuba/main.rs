//! Path-traced images by every tracer against Mitsuba 3's of the same scenes: an implementation of others as the reference.
//!
//! `scripts/mitsuba` writes scenes and the reference images (`tests/mitsuba`); docs/design/mitsuba.md says what they cover, where conventions differ, and what
//! this test can see. Images are noisy on both sides, so the test is whether they differ by more than noise explains:
//!
//! - **pixels**: a Z-test of every pixel and channel, Sidak-corrected to a level of 1 % for the whole image (Subr, Arvo 2007; Rousselle, Jarosz,
//!   Novak 2016). 99.75 % of pixels must pass, and what does not pass is capped in sigmas and in radiance: noise with long tails may move a pixel
//!   or two, a mistake moves more of them, or further.
//! - **tiles**: the same for means of 8 x 8 pixels, all of which must pass, at a level of 0.01 %.
//! - **means**: of each channel over the image, within 4.5 sigmas, where a sigma may be at most 1 % of the mean: noise is no excuse.
//!
//! The compute tracer renders all scenes on a driver that has other tracers, too; every other tracer and driver renders [`EACH`], the scenes in which what
//! rays meet matters. With `SKYLIT_FULL` set (`./scripts/test.sh --full`) all of them render all scenes, with the validation layer. `SKYLIT_MITSUBA=cornell,glass` asks about these
//! scenes only.

#[path = "../common/mod.rs"]
mod common;

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};
use std::time::Instant;

use common::{assert_validation_clean, tracers};
use glam::{DVec3, Vec3};
use serde::Deserialize;
use skylit::accel::flatten::FlatScene;
use skylit::film::camera::CameraRecord;
use skylit::film::{NoControl, SampleSettings};
use skylit::gpu::{Device, Options};
use skylit::integrators::path::{Lens, MAX_DEPTH, PathIntegrator, PathOptions};
use skylit::measure::distributions::critical_value;
use skylit::measure::z_test::{Estimate, Region, pixel_scores, score};
use skylit::output::exr;
use skylit::scene::builtin::shapes;
use skylit::scene::light_spec;
use skylit::scene::load::{load_environment, load_file};
use skylit::scene::{Environment, Scene};
use skylit::tracer::{Needs, Tracer, TracerKind};

/// Scenes for tracers and drivers of which the shading code is known to be right from another's images: alpha, spheres, instances, walls and volumes that rays go through,
/// queues of rays, textures, all kinds of lights.
const EACH: [&str; 12] = [
    "alpha-blend",
    "alpha-mask",
    "camera-inside",
    "cornell",
    "emitter-alpha",
    "glass-rough",
    "instances",
    "lights-all",
    "nested",
    "spheres",
    "texture-sets",
    "thin-straight",
];

/// Renderings with seeds of their own that an image is the mean of. Shaders are compiled once for all of them.
const BLOCKS: u32 = 2;
/// Failures of a scene that are printed.
const MAX_FAILURES: usize = 6;
/// Level of the test of all pixels of an image.
const ALPHA: f64 = 0.01;
/// Pixels that must pass.
const SHARE: f64 = 0.9975;
/// Largest |z| of a pixel that does not pass, in the threshold that it misses.
const PIXEL_CAP: f64 = 2.0;
/// Largest difference of a pixel that does not pass, of the reference radiance there or, where that is less, of the image's mean.
const DIFFERENCE_CAP: f64 = 0.5;
/// Level of the test of all tiles of an image: there is no allowance, and as many images as there are scenes and tracers.
const TILE_ALPHA: f64 = 1e-4;
/// Side of a tile, pixels.
const TILE: usize = 8;
/// Largest |z| of an image's mean.
const MEAN_SIGMAS: f64 = 4.5;
/// Largest standard error of the difference of means, of the mean.
const PRECISION: f64 = 0.01;
/// What may differ without noise, of a value: rounding, and that each renderer begins rays a little off their surfaces.
const ROUNDING: f64 = 2e-4;

/// What scenes.json says of a scene.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: String,
    /// `stock`: Mitsuba's own BSDFs and emitters; `python`: ones of ours for it.
    judge: String,
    about: String,
    #[serde(default = "default_size")]
    size: [u32; 2],
    #[serde(default = "default_spp")]
    spp: u32,
    max_depth: Option<u32>,
    environment: Option<Surroundings>,
    /// As `--light` takes them.
    #[serde(default)]
    lights: Vec<String>,
    /// `--energy-compensation`.
    #[serde(default)]
    compensation: bool,
    lens: Option<LensEntry>,
    /// What of ours it needs that is not there: it is left out.
    awaits: Option<String>,
    /// Mitsuba's.
    #[serde(rename = "integrator")]
    _integrator: Option<String>,
    /// Mitsuba's.
    #[serde(rename = "judge_spp")]
    _judge_spp: Option<u32>,
}

fn default_size() -> [u32; 2] {
    [32, 32]
}

fn default_spp() -> u32 {
    512
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Surroundings {
    Uniform([f32; 3]),
    File(String),
}

#[derive(Deserialize)]
struct LensEntry {
    radius: f32,
    focus: f32,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mitsuba")
}

fn entries() -> Vec<Entry> {
    let text = std::fs::read_to_string(folder().join("scenes.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// An image with two estimates of its noise.
struct Noisy {
    /// Variances from single samples: stratified samples do better than they say.
    estimate: Estimate,
    /// Variance of each mean from blocks with seeds of their own: true on average, but from few numbers.
    by_blocks: Vec<f64>,
    /// How many numbers each of `by_blocks` is from, less one.
    freedom: f64,
}

impl Entry {
    fn scene(&self) -> Scene {
        let mut scene = load_file(&folder().join("scenes").join(format!("{}.gltf", self.name))).unwrap();
        assert!(scene.report.warnings.is_empty(), "{}: {:?}", self.name, scene.report.warnings);
        for mesh in scene.meshes.iter_mut().filter(|m| m.name == "sphere") {
            // glTF has no analytic spheres: a mesh of unit radius stands for one
            mesh.geometry = shapes::sphere(DVec3::ZERO, 1.0);
        }
        for light in &self.lights {
            light_spec::parse(light).unwrap_or_else(|e| panic!("{}: {e}", self.name)).add(&mut scene);
        }
        scene.environment = match &self.environment {
            None => Environment::Black,
            Some(Surroundings::Uniform(c)) => Environment::Uniform(Vec3::from_array(*c)),
            Some(Surroundings::File(f)) => {
                Environment::Map(load_environment(&folder().join("scenes").join(f)).unwrap())
            }
        };
        scene
    }

    fn judged(&self) -> Noisy {
        let image = exr::read(&folder().join(format!("{}.exr", self.name))).unwrap();
        assert_eq!([image.width, image.height], self.size, "{}: the judge's image has another size", self.name);
        let planes = |names: [&str; 3]| -> Vec<f64> {
            let planes = names.map(|n| image.f32(n).unwrap_or_else(|| panic!("{}: no channel {n}", self.name)));
            (0..3 * image.pixel_count()).map(|k| f64::from(planes[k % 3][k / 3])).collect()
        };
        // of the means
        let variance = planes(["variance.R", "variance.G", "variance.B"]);
        let spp: f64 = image.metadata("spp").and_then(|s| s.parse().ok()).expect("the judge's samples per pixel");
        let estimate = Estimate {
            size: self.size.map(|n| n as usize),
            channels: 3,
            mean: planes(["R", "G", "B"]),
            variance: variance.iter().map(|v| v * spp).collect(),
            samples: vec![spp; image.pixel_count()],
        };
        Noisy { estimate, by_blocks: variance, freedom: f64::INFINITY }
    }

    fn ours(&self, device: &Arc<Device>, kind: TracerKind, flat: &FlatScene) -> Noisy {
        let needs = Needs { shading: true, compensation: self.compensation, ..Default::default() };
        let tracer = Tracer::new(device, kind, flat, needs).unwrap_or_else(|e| panic!("{kind}: {e}"));
        let aspect = f64::from(self.size[0]) / f64::from(self.size[1]);
        let camera = CameraRecord::new(&flat.scene.cameras[0], flat.origin, aspect);
        let n = 3 * (self.size[0] * self.size[1]) as usize;
        let (mut sums, mut squares, mut variances) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let options = PathOptions {
            samples: SampleSettings::new(self.size, self.spp / BLOCKS, 0),
            max_depth: self.max_depth.unwrap_or(MAX_DEPTH),
            lens: self.lens.as_ref().map(|l| Lens { radius: l.radius, focus: l.focus }),
            ..Default::default()
        };
        let mut integrator =
            PathIntegrator::new(&tracer, flat, &options).unwrap_or_else(|e| panic!("{}, {kind}: {e}", self.name));
        for block in 0..BLOCKS {
            // scenes that look alike must not have the same noise
            let seed = self.name.bytes().fold(block, |h, b| h.wrapping_mul(31).wrapping_add(b.into()));
            let film = integrator
                .render(&tracer, &camera, options.samples.spp, seed, &mut NoControl)
                .unwrap_or_else(|e| panic!("{}, {kind}: {e}", self.name));
            let film = film.image.film;
            assert_eq!(film.not_finite, 0, "{}, {kind}: samples that are no numbers", self.name);
            for k in 0..n {
                let m = f64::from(film.mean[k]);
                (sums[k], squares[k], variances[k]) =
                    (sums[k] + m, squares[k] + m * m, variances[k] + f64::from(film.variance[k]));
            }
        }
        let b = f64::from(BLOCKS);
        let mean: Vec<f64> = sums.iter().map(|s| s / b).collect();
        let by_blocks = |k: usize| (squares[k] / b - mean[k] * mean[k]).max(0.0) / (b - 1.0);
        Noisy {
            by_blocks: (0..n).map(by_blocks).collect(),
            freedom: b - 1.0,
            estimate: Estimate {
                size: self.size.map(|n| n as usize),
                channels: 3,
                variance: variances.iter().map(|v| v / b).collect(),
                samples: vec![f64::from(self.spp); n / 3],
                mean,
            },
        }
    }
}

/// What came of a comparison.
#[derive(Debug, Default)]
struct Verdict {
    /// Share of pixels that pass.
    share: f64,
    pixel_z: f64,
    tile_z: f64,
    /// Root of the mean square of tiles' z: 1 where variances are what they say.
    tile_rms: f64,
    /// Of the channel that is furthest off: sigmas, difference of the means over the mean, its standard error over the mean.
    mean_z: f64,
    difference: f64,
    precision: f64,
    failures: Vec<String>,
}

/// Differences of means over regions, a region's channels together: each in standard errors, and itself, and its standard error.
fn over(ours: &Noisy, judge: &Noisy, regions: &[Region], rounding: &[f64]) -> Vec<[f64; 3]> {
    let of = |values: &[f64]| judge.estimate.means_over(values, regions);
    let between = |a: &[f64], b: &[f64], sign: f64| a.iter().zip(b).map(|(a, b)| a + sign * b).collect::<Vec<_>>();
    let differences = of(&between(&ours.estimate.mean, &judge.estimate.mean, -1.0));
    let (variances, rounding) = (of(&between(&ours.by_blocks, &judge.by_blocks, 1.0)), of(rounding));
    let scored = |k: usize| {
        let variance = variances[k] / regions[k / 3].count() as f64;
        let error = (variance + rounding[k].powi(2)).sqrt();
        [score(differences[k], variance, rounding[k]), differences[k], error]
    };
    (0..differences.len()).map(scored).collect()
}

/// Holds an image against the reference image.
fn compare(ours: &Noisy, judge: &Noisy) -> Verdict {
    let known = &judge.estimate;
    let [width, height] = known.size;
    let pixels = width * height;
    let mut v = Verdict::default();
    let averages = known.averages();
    let rounding = known.rounding(ROUNDING);

    let threshold = critical_value(ALPHA, 3.0 * pixels as f64, f64::INFINITY);
    // A pixel that sees little of something bright may have met none of it, and then knows no noise: the judge knows it
    let scores = pixel_scores(&ours.estimate, known, &rounding).unwrap();
    let mut bad = 0;
    for p in 0..pixels {
        let (mut z, mut relative) = (0.0f64, 0.0f64);
        for (k, average) in (3 * p..3 * p + 3).zip(&averages) {
            z = z.max(scores[k].abs());
            let difference = ours.estimate.mean[k] - known.mean[k];
            relative = relative.max(difference.abs() / known.mean[k].max(*average).max(1e-12));
        }
        v.pixel_z = v.pixel_z.max(z);
        if z > threshold {
            bad += 1;
            if z > PIXEL_CAP * threshold || relative > DIFFERENCE_CAP {
                let at = [p % width, p / width];
                v.failures.push(format!("pixel {at:?} is off by {z:.1} sigmas, {:.1} %", 100.0 * relative));
            }
        }
    }
    v.share = 1.0 - bad as f64 / pixels as f64;
    if v.share < SHARE {
        v.failures.push(format!("{bad} of {pixels} pixels beyond {threshold:.2} sigmas"));
    }

    let tiles = Region::tiles(known.size, TILE);
    let freedom = (TILE * TILE) as f64 * ours.freedom;
    let threshold = critical_value(TILE_ALPHA, 3.0 * tiles.len() as f64, freedom);
    let mut squares = 0.0;
    for (k, [z, difference, _]) in over(ours, judge, &tiles, &rounding).into_iter().enumerate() {
        v.tile_z = v.tile_z.max(z.abs());
        squares += z * z;
        if z.abs() > threshold {
            let (at, channel) = (tiles[k / 3].first, k % 3);
            let percent = 100.0 * difference / averages[channel].max(1e-12);
            v.failures
                .push(format!("tile at {at:?}, channel {channel}: {z:.1} sigmas, {percent:.2} % of the image's mean"));
        }
    }
    v.tile_rms = (squares / (3 * tiles.len()) as f64).sqrt();

    for (c, [z, difference, error]) in
        over(ours, judge, &[Region::whole(known.size)], &rounding).into_iter().enumerate()
    {
        let (precision, average) = (error / averages[c], averages[c]);
        if z.abs() >= v.mean_z.abs() {
            (v.mean_z, v.difference) = (z, difference / average);
        }
        v.precision = v.precision.max(precision);
        if z.abs() > MEAN_SIGMAS {
            v.failures
                .push(format!("channel {c}: the mean is off by {z:.1} sigmas, {:.2} %", 100.0 * difference / average));
        }
        // a channel that is black says nothing, and would divide by nothing
        if precision.is_nan() || precision > PRECISION {
            v.failures.push(format!("channel {c}: the mean is known to {:.2} % only", 100.0 * precision));
        }
    }
    v
}

/// Renders all scenes with one tracer, or says that the device has none of its kind. A test each: they run side by side.
/// One device for all tracers. The validation layer would take a third of the time, and hear nothing that it does not hear in tests/path/validation.rs.
fn device() -> Arc<Device> {
    static DEVICE: OnceLock<Arc<Device>> = OnceLock::new();
    let options = || Options {
        keep_pipelines: 64,
        validation: common::is_full() && common::validated().validation,
        ..Options::default()
    };
    DEVICE.get_or_init(|| common::open(options())).clone()
}

fn agrees(kind: TracerKind) {
    let device = device();
    if !tracers(&device).contains(&kind) {
        return println!("skipped: no {kind} here");
    }
    let wanted = std::env::var("SKYLIT_MITSUBA").unwrap_or_default();
    let wanted: Vec<&str> = wanted.split(',').filter(|s| !s.is_empty()).collect();
    let mut failures = Vec::new();
    println!(
        "scene | judge | tracer | spp | pixels that pass | largest z of a pixel | of a tile (rms) | mean: sigmas | % | +- % | s"
    );
    let all = kind == TracerKind::Compute && tracers(&device).len() > 1 || common::is_full();
    let is_wanted = |name: &str| if wanted.is_empty() { all || EACH.contains(&name) } else { wanted.contains(&name) };
    for entry in entries().iter().filter(|e| is_wanted(&e.name)) {
        if let Some(what) = entry.awaits.as_ref().filter(|_| wanted.is_empty()) {
            println!("{}: left out, awaits {what}", entry.name);
            continue;
        }
        let (scene, judge) = (entry.scene(), entry.judged());
        let flat = FlatScene::for_paths(&scene);
        let begin = Instant::now();
        let v = compare(&entry.ours(&device, kind, &flat), &judge);
        println!(
            "{} | {} | {kind} | {} | {:.2} | {:.1} | {:.1} ({:.2}) | {:+.1} | {:+.2} | {:.2} | {:.1}",
            entry.name,
            entry.judge,
            entry.spp,
            100.0 * v.share,
            v.pixel_z,
            v.tile_z,
            v.tile_rms,
            v.mean_z,
            100.0 * v.difference,
            100.0 * v.precision,
            begin.elapsed().as_secs_f64()
        );
        let more = v.failures.len().saturating_sub(MAX_FAILURES);
        // means and tiles come after pixels, and say more
        failures.extend(
            v.failures.into_iter().rev().take(MAX_FAILURES).map(|f| format!("{} ({}): {f}", entry.name, entry.about)),
        );
        if more > 0 {
            failures.push(format!("{}: and {more} more", entry.name));
        }
    }
    assert!(failures.is_empty(), "Mitsuba and {kind} do not agree:\n{}", failures.join("\n"));
    assert_validation_clean(&device);
}

#[test]
fn gpu_mitsuba_agrees_pipeline() {
    agrees(TracerKind::Pipeline);
}

#[test]
fn gpu_mitsuba_agrees_query() {
    agrees(TracerKind::Query);
}

#[test]
fn gpu_mitsuba_agrees_compute() {
    agrees(TracerKind::Compute);
}

/// Every scene exists with a reference image, and there are no others.
#[test]
fn reference_images_are_complete() {
    let entries = entries();
    let listed = |path: PathBuf, extension: &str| -> Vec<String> {
        let files = std::fs::read_dir(path).unwrap().map(|f| f.unwrap().path());
        let mut names: Vec<String> = files
            .filter(|f| f.extension().is_some_and(|e| e == extension))
            .map(|f| f.file_stem().unwrap().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    };
    let mut names: Vec<String> = entries.iter().map(|e| e.name.clone()).collect();
    names.sort();
    assert!(names.windows(2).all(|w| w[0] != w[1]), "a name twice");
    assert_eq!(listed(folder().join("scenes"), "gltf"), names);
    assert_eq!(listed(folder(), "exr"), names);
    assert!(EACH.iter().all(|e| names.iter().any(|n| n == e)), "{EACH:?}");
    for entry in &entries {
        assert!(["stock", "python"].contains(&entry.judge.as_str()), "{}: who is {}?", entry.name, entry.judge);
        assert!(entry.spp % 2 == 0 && entry.spp >= 64, "{}: {} samples", entry.name, entry.spp);
        entry.judged();
    }
}

/// Noise passes; a factor, a channel in place of another, a tile and a single pixel that are wrong do not.
#[test]
fn comparison_detects_wrong_images() {
    let n = 32 * 32;
    let (spp, judge_spp) = (128.0, 8192.0);
    let mut state = 1u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1u32 << 24)
    };
    let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    let truth: Vec<f64> = (0..3 * n).map(|k| 0.5 + 0.2 * (k % 3) as f64 + 0.3 * (k / 96) as f64 / 32.0).collect();
    let mut image = |spp: f64, wrong: &dyn Fn(usize) -> f64| {
        let sd = |k: usize| 0.7 * truth[k] / spp.sqrt();
        let variance: Vec<f64> = (0..3 * n).map(|k| sd(k).powi(2)).collect();
        let mean = (0..3 * n).map(|k| wrong(k) + sd(k) * normal()).collect();
        let samples = vec![spp; n];
        let estimate = Estimate {
            size: [32, 32],
            channels: 3,
            mean,
            variance: variance.iter().map(|v| v * spp).collect(),
            samples,
        };
        Noisy { estimate, by_blocks: variance, freedom: 64.0 }
    };
    let judge = image(judge_spp, &|k| truth[k]);
    for _ in 0..20 {
        let v = compare(&image(spp, &|k| truth[k]), &judge);
        assert!(v.failures.len() <= 1, "{v:?}");
    }
    let faults: [(&str, &dyn Fn(usize) -> f64); 4] = [
        ("a factor of 1.02", &|k| 1.02 * truth[k]),
        ("red for green", &|k| truth[if k % 3 == 0 { k + 1 } else { k }]),
        ("a tile that is 6 % brighter", &|k| truth[k] * if k / 3 % 32 < 8 && k / 96 < 8 { 1.06 } else { 1.0 }),
        ("a black pixel", &|k| if k / 3 == 500 { 0.0 } else { truth[k] }),
    ];
    for (what, fault) in faults {
        let v = compare(&image(spp, fault), &judge);
        assert!(!v.failures.is_empty(), "{what} passes: {v:?}");
    }
}
