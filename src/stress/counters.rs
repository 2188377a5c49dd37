//! Counters beyond 2^24, where single precision skips whole numbers, and to 2^32: samples of a
//! film, and numbers of frames. Part of section 7, [`super::long_runs`].

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::long_runs::{RADIANCE, constant, traced};
use super::sampling::{not_finite, render};
use super::{Check, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::SampleSettings;
use crate::film::camera::CameraRecord;
use crate::film::schedule::FilmOptions;
use crate::film::state::{FilmState, words};
use crate::integrators::path::PathOptions;
use crate::realtime::{Filter, FilterKind, Preset, Realtime, Settings};
use crate::scene::builtin::{self, SceneTransform, analytic};
use crate::scene::{Camera, Scene};
use crate::tracer::{Tracer, TracerKind};

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// A film of `samples` samples of `radiance` in each pixel, with sums in f64.
pub fn film_after(size: [u32; 2], samples: u32, radiance: [f32; 3]) -> Option<FilmState> {
    let pixels = size[0] as usize * size[1] as usize;
    let compensated = |value: f32| {
        let sum = f64::from(value) * f64::from(samples);
        let rounded = sum as f32;
        [rounded, (f64::from(rounded) - sum) as f32].map(f32::to_bits)
    };
    let sums = radiance.into_iter().flat_map(compensated);
    let squares = radiance.into_iter().flat_map(|x| compensated(x * x));
    // nothing was met, and all were numbers
    let planes: Vec<Vec<u32>> = sums.chain(squares).chain([0, 0]).map(|word| vec![word; pixels]).collect();
    debug_assert_eq!(planes.len(), words(&CHANNELS).len());
    FilmState::from_planes(size, CHANNELS.len(), &planes, &vec![samples; pixels])
}

fn go_on(options: &PathOptions, from: FilmState, spp: u32) -> PathOptions {
    let film = FilmOptions { start: Some(Arc::new(from)), keep_state: true, ..options.samples.film.clone() };
    options.clone().with_samples(|s| (s.spp, s.film) = (spp, film))
}

/// Pixels of the film of [`film_drift`].
pub const SIZE: [u32; 2] = [8, 8];

/// Largest relative error of a film of [`super::long_runs::constant`] continued to `last` samples.
pub fn film_drift(
    setup: &Setup,
    kind: TracerKind,
    film: Option<FilmState>,
    last: u32,
    watch: &mut Watch,
) -> Result<f64> {
    let scene = constant();
    let flat = FlatScene::new(&scene);
    let options = PathOptions { samples: SampleSettings::new(SIZE, 16, 0), max_depth: 0, ..Default::default() };
    let state = film.ok_or_else(|| Error::CheckFailed("no such film".into()))?;
    let image =
        render(&super::scale::path_tracer(setup, kind, &flat)?, &flat, &go_on(&options, state, last), watch)?.image;
    let counted = image.film.samples.iter().all(|&n| n == last);
    let off = |(k, mean): (usize, &f32)| (f64::from(*mean) / f64::from(RADIANCE[k % 3]) - 1.0).abs();
    let worst = image.film.mean.iter().enumerate().map(off).fold(0.0, f64::max);
    // variances are rounding errors of sums of squares: at most a thousandth of the square at 2^24
    let spread =
        image.film.variance.iter().enumerate().map(|(k, v)| f64::from(v / RADIANCE[k % 3].powi(2))).fold(0.0, f64::max);
    Ok(if counted && not_finite(&image.film) == 0 && spread < 1e-3 { worst } else { f64::NAN })
}

/// Statistics of an image's samples: mean, standard error, and pixels whose samples differ.
#[derive(Clone, Copy, Debug)]
pub struct Sampled {
    pub mean: f64,
    pub error: f64,
    /// Pixels whose samples differ.
    pub varied: usize,
}

impl Sampled {
    /// Statistics from each pixel's sum and sum of squares over `count` samples.
    pub fn from_sums(sums: &[f64], squares: &[f64], count: u32) -> Self {
        let (n, pixels) = (f64::from(count), sums.len() as f64);
        let mean = sums.iter().sum::<f64>() / n / pixels;
        let variances = || sums.iter().zip(squares).map(|(s, q)| (q / n - (s / n).powi(2)).max(0.0));
        let varied = variances().filter(|v| *v > 1e-6 * mean * mean).count();
        Self { mean, error: (variances().sum::<f64>() / n).sqrt() / pixels, varied }
    }

    /// Distance of the means in standard errors; NaN where samples do not differ as in the other.
    pub fn distance(&self, other: &Self) -> f64 {
        let is_alike =
            self.varied as f64 > 0.9 * other.varied as f64 && (0.7..1.4).contains(&(self.error / other.error));
        if is_alike { (self.mean - other.mean).abs() / self.error.hypot(other.error) } else { f64::NAN }
    }
}

/// The samples `first` to `first + count` of an image.
pub fn samples(setup: &Setup, kind: TracerKind, first: u32, count: u32, watch: &mut Watch) -> Result<Sampled> {
    let scene = builtin::by_name("cornell-box").ok_or_else(|| Error::Scene("no Cornell box".into()))?;
    let flat = FlatScene::new(&scene);
    let options = PathOptions { samples: SampleSettings::new([16, 16], 16, 3), max_depth: 2, ..Default::default() };
    // so many samples of nothing: what is added to them is what is seen
    let none =
        film_after(options.samples.size, first, [0.0; 3]).ok_or_else(|| Error::CheckFailed("no such film".into()))?;
    let tracer = super::scale::path_tracer(setup, kind, &flat)?;
    let image = render(&tracer, &flat, &go_on(&options, none, first + count), watch)?.image;
    let state = image.state.ok_or_else(|| Error::CheckFailed("the film's sums were not kept".into()))?;
    let total = |k: usize| {
        let [sum, excess] = [state.plane(k), state.plane(k + 1)].map(|p| p.into_iter().map(f32::from_bits));
        sum.zip(excess).map(|(s, e)| f64::from(s) - f64::from(e)).collect::<Vec<_>>()
    };
    // green, after red, and after three sums its squares
    Ok(Sampled::from_sums(&total(2), &total(8), count))
}

/// Frames of a scene from number `first` on, the camera a step aside in each: pixels of geometry.
pub fn frames_from(
    tracer: &Tracer,
    scene: &Scene,
    settings: &Settings,
    first: u32,
    count: u32,
) -> Result<Vec<Vec<f32>>> {
    let size = [32, 18];
    let mut realtime = Realtime::new(tracer, size, settings, &[])?;
    realtime.start_at(first);
    let mut out = Vec::new();
    for frame in 0..count {
        let mut camera: Camera = scene.cameras[0].clone();
        camera.camera_to_world *= DAffine3::from_translation(DVec3::new(0.002, 0.001, 0.0) * f64::from(frame % 8));
        realtime.frame(tracer, &CameraRecord::new(&camera, scene.origin(), 16.0 / 9.0), &[])?;
        let (result, coverage) = (realtime.result()?, realtime.coverage()?);
        out.push(result.into_iter().zip(coverage).filter(|(_, c)| *c > 0.0).map(|(v, _)| v).collect());
    }
    Ok(out)
}

/// [`frame_distance`] of frames from `first` on and as many from 0 on.
pub fn frame_bias(setup: &Setup, kind: TracerKind, first: u32, count: u32) -> Result<f64> {
    let scene = builtin::by_name("stairs").ok_or_else(|| Error::Scene("no stairs".into()))?;
    let tracer = Tracer::new(setup.device(), kind, &FlatScene::new(&scene), super::degenerate::NEEDS)?;
    let plain = Filter { kind: FilterKind::None, radius: 0, samples: 0.0 };
    let settings = Settings { history: 1, filter: plain, ..traced(Preset::Fast) };
    let frames = |first: u32| frames_from(&tracer, &scene, &settings, first, count);
    Ok(frame_distance(&frames(first)?, &frames(0)?))
}

/// Distance of the means of two series of frames in standard errors; NaN for a repeated frame.
pub fn frame_distance(a: &[Vec<f32>], b: &[Vec<f32>]) -> f64 {
    let mean = |frames: &[Vec<f32>]| {
        if frames.windows(2).any(|w| w[0] == w[1]) {
            return [f64::NAN; 2];
        }
        let means: Vec<f64> =
            frames.iter().map(|f| f.iter().map(|v| f64::from(*v)).sum::<f64>() / f.len() as f64).collect();
        let n = means.len() as f64;
        let mean = means.iter().sum::<f64>() / n;
        [mean, (means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()]
    };
    let ([a, e], [b, f]) = (mean(a), mean(b));
    (a - b).abs() / e.hypot(f)
}

pub(super) fn run(session: &mut StressSession) -> Result<()> {
    let effort = session.setup().effort();
    let (shading, kinds) = (session.setup().shading_tracers(), session.setup().tracers());
    let steps = effort.pick(64, 4096);
    let places = [("2^24", (1u32 << 24) - steps / 2), ("2^32", u32::MAX - steps)];
    for (what, first) in places {
        let name = format!("a film past {what} samples against f64");
        session.measure_each(&name, &shading, |s, kind, w| {
            let worst = film_drift(s, kind, film_after(SIZE, first, RADIANCE), first + steps, w)?;
            Ok(Check::at_most(name.as_str(), worst, "relative", 1e-6)
                .says(format!("from {first} samples to {}", first + steps)))
        })?;
        let name = format!("samples past {what}");
        session.measure_each(&name, &shading, |s, kind, w| {
            let off = samples(s, kind, first, steps, w)?.distance(&samples(s, kind, 0, steps, w)?);
            Ok(Check::at_most(name.as_str(), off, "standard errors", 4.5)
                .says("between their mean and that of the first ones"))
        })?;
    }
    // numbers of frames go on at 0 after the last
    let frames = effort.pick(16, 1024);
    for (what, first) in [("2^24", (1u32 << 24) - frames / 2), ("2^32", 0u32.wrapping_sub(frames / 2))] {
        let name = format!("{frames} frames past number {what} of a plane");
        session.measure_each(&name, &kinds, |s, kind, _| {
            let plane = analytic::plane(20.0, SceneTransform::default());
            let tracer = Tracer::new(s.device(), kind, &FlatScene::new(&plane), super::degenerate::NEEDS)?;
            let seen = frames_from(&tracer, &plane, &traced(Preset::Balanced), first, frames)?.concat();
            let off = seen.iter().filter(|v| **v != 1.0).count();
            let value = if seen.is_empty() { f64::NAN } else { off as f64 };
            Ok(Check::at_most(name.as_str(), value, "pixels", 0.0).says(format!("of {} are not 1", seen.len())))
        })?;
        let name = format!("samples of {frames} frames past number {what}");
        session.measure_each(&name, &kinds, |s, kind, _| {
            let off = frame_bias(s, kind, first, frames)?;
            Ok(Check::at_most(name.as_str(), off, "standard errors", 4.5)
                .says("between their mean and that of the first frames"))
        })?;
    }
    Ok(())
}
