//! Section 7, long runs: films of very many samples, stopped and resumed films, histories of many
//! frames, and counters ([`super::counters`]).

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use super::sampling::{matte, render, scene_of};
use super::{Check, Section, Setup, StressSession, Watch};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::film::SampleSettings;
use crate::film::accumulate::Accumulated;
use crate::film::camera::CameraRecord;
use crate::film::schedule::FilmOptions;
use crate::film::state::FilmState;
use crate::integrators::path::PathOptions;
use crate::measure::temporal::Drift;
use crate::raster::Primary;
use crate::realtime::{Preset, Realtime, Settings};
use crate::scene::builtin::{self, SceneTransform, analytic, shapes};
use crate::scene::{Camera, Environment, Instance, Mesh, Scene};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "long-runs",
    title: "Long runs",
    about: "films of a million samples against f64, films stopped and resumed, histories of many frames on constant and alternating input, counters past 2^24 and up to 2^32",
    of_scene: false,
    run,
};

/// Largest relative drift of a film's mean.
const DRIFT: f64 = 1e-6;

/// Radiance of the environment of [`constant`].
pub(super) const RADIANCE: [f32; 3] = [0.1, 0.7, 3.3];

/// Constant pixels, of a radiance that single precision forgets most of when it is added often.
pub fn constant() -> Scene {
    let camera = Camera::look_at(DVec3::ZERO, DVec3::NEG_Z, DVec3::Y, 0.9);
    let behind = shapes::sphere(DVec3::Z * 5.0, 1.0);
    Scene {
        environment: Environment::Uniform(Vec3::from_array(RADIANCE)),
        ..scene_of(vec![(behind, matte(0.5))], camera)
    }
}

fn up_to(options: &PathOptions, spp: u32, start: Option<FilmState>) -> PathOptions {
    let film = FilmOptions { start: start.map(Arc::new), keep_state: true, ..options.samples.film.clone() };
    options.clone().with_samples(|s| (s.spp, s.film) = (spp, film))
}

/// Largest relative error of a film of [`constant`], and that of a plain f32 sum.
pub fn drift(image: &Accumulated) -> (f64, f64) {
    let off = |value: f64, truth: f32| (value / f64::from(truth) - 1.0).abs();
    let (mut worst, mut naive) = (0.0f64, 0.0f64);
    for (c, truth) in RADIANCE.into_iter().enumerate() {
        worst = image.film.plane(c).into_iter().map(|mean| off(f64::from(mean), truth)).fold(worst, f64::max);
        let sum = (0..image.spp).fold(0.0f32, |sum, _| sum + truth);
        naive = naive.max(off(f64::from(sum) / f64::from(image.spp), truth));
    }
    (worst, naive)
}

/// Words of a film's state that differ from another's.
pub fn different_words(a: &FilmState, b: &FilmState) -> usize {
    let words = crate::film::record_words(a.channels());
    let different = |k: usize| a.plane(k).iter().zip(b.plane(k)).filter(|(a, b)| **a != *b).count();
    (0..words).map(different).sum::<usize>()
        + a.samples_plane().iter().zip(b.samples_plane()).filter(|(a, b)| **a != *b).count()
}

/// Counts pixels of frames that differ from a scene's constant ambient visibility `value`, and all
/// seen. The camera moves by `step` in every frame.
pub fn frames_off(
    tracer: &Tracer,
    scene: &Scene,
    settings: &Settings,
    frames: u32,
    step: DVec3,
    value: f32,
) -> Result<(usize, usize)> {
    views_off(tracer, scene, settings, frames, |frame| {
        let mut camera = scene.cameras[0].clone();
        camera.camera_to_world *= DAffine3::from_translation(step * f64::from(frame % 8));
        (camera, value)
    })
}

/// A floor above a closed box, with a camera of each and the ambient visibility that it sees.
pub fn open_and_closed() -> (Scene, [(Camera, f32); 2]) {
    let mut scene = analytic::plane(20.0, SceneTransform::default());
    let closed = analytic::closed_box(2.0, SceneTransform { scale: 1.0, offset: DVec3::Y * -10.0 });
    let cameras = [(scene.cameras[0].clone(), 1.0), (closed.cameras[0].clone(), 0.0)];
    scene.instances.extend(closed.instances.into_iter().map(|i| Instance { mesh: i.mesh + scene.meshes.len(), ..i }));
    let materials = scene.materials.len();
    scene.meshes.extend(closed.meshes.into_iter().map(|m| Mesh { material: m.material + materials, ..m }));
    scene.materials.extend(closed.materials);
    (scene, cameras)
}

/// As [`frames_off`], of frames each of which has a camera and an ambient visibility of its own.
pub fn views_off(
    tracer: &Tracer,
    scene: &Scene,
    settings: &Settings,
    frames: u32,
    view: impl Fn(u32) -> (Camera, f32),
) -> Result<(usize, usize)> {
    let size = [48, 27];
    let mut realtime = Realtime::new(tracer, size, settings, &[])?;
    let (mut off, mut seen) = (0, 0);
    for frame in 0..frames {
        let (camera, value) = view(frame);
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        realtime.frame(tracer, &CameraRecord::new(&camera, scene.origin(), aspect), &[])?;
        let (result, coverage) = (realtime.result()?, realtime.coverage()?);
        let covered = result.iter().zip(&coverage).filter(|(_, c)| **c > 0.0);
        seen += covered.clone().count();
        off += covered.filter(|(v, _)| **v != value).count();
    }
    Ok((off, seen))
}

/// Settings of a preset whose camera rays are traced.
pub fn traced(preset: Preset) -> Settings {
    Settings { primary: Some(Primary::Traced), ..preset.settings() }
}

fn run(session: &mut StressSession) -> Result<()> {
    let effort = session.setup().effort();
    let shading = session.setup().shading_tracers();
    let samples = effort.pick(1u32 << 14, 1_000_000);
    let name = format!("{samples} samples against f64");
    session.measure_each(&name, &shading, |s, kind, w| {
        let scene = constant();
        let flat = FlatScene::new(&scene);
        let options = PathOptions { samples: SampleSettings::new([8, 8], 16, 0), max_depth: 0, ..Default::default() };
        let image =
            render(&super::scale::path_tracer(s, kind, &flat)?, &flat, &up_to(&options, samples, None), w)?.image;
        let (worst, naive) = drift(&image);
        Ok(Check::at_most(name.as_str(), worst, "relative", DRIFT)
            .says(format!("a plain f32 sum is off by {naive:.1e}")))
    })?;

    let stops = 100;
    let name = format!("a film stopped and resumed {stops} times");
    session.measure_each(&name, &shading, |s, kind, w| {
        let words = resumed(s, kind, stops, w)?;
        Ok(Check::at_most(name.as_str(), words as f64, "words", 0.0)
            .says("of its sums differ from those of a film that was never stopped"))
    })?;

    let kinds = session.setup().tracers();
    let frames = effort.pick(60, 100_000);
    let name = format!("{frames} frames of a plane, camera moving");
    session.measure_each(&name, &kinds, |s, kind, _| {
        let plane = analytic::plane(20.0, SceneTransform::default());
        let tracer = Tracer::new(s.device(), kind, &FlatScene::new(&plane), super::degenerate::NEEDS)?;
        let (off, seen) =
            frames_off(&tracer, &plane, &traced(Preset::Balanced), frames, DVec3::new(0.035, 0.015, -0.02), 1.0)?;
        let value = if seen == 0 { f64::NAN } else { off as f64 };
        Ok(Check::at_most(name.as_str(), value, "pixels", 0.0).says(format!("of {seen} are not 1")))
    })?;

    // each view's history is no use to the next
    let name = format!("{frames} frames of an open floor and a closed box in turn");
    session.measure_each(&name, &kinds, |s, kind, _| {
        let (scene, views) = open_and_closed();
        let tracer = Tracer::new(s.device(), kind, &FlatScene::new(&scene), super::degenerate::NEEDS)?;
        let in_turn = |frame: u32| views[frame as usize % 2].clone();
        let (off, seen) = views_off(&tracer, &scene, &traced(Preset::Balanced), frames, in_turn)?;
        let figure = if seen == 0 { f64::NAN } else { off as f64 };
        // drivers' own tracers let rays out of the box
        let check = match kind {
            TracerKind::Compute => Check::at_most(name.as_str(), figure, "pixels", 0.0),
            _ => Check::reported(name.as_str(), figure, "pixels"),
        };
        Ok(check.says(format!("of {seen} are not what their view has, bit for bit")))
    })?;

    let turns = effort.pick(20, 5000);
    let name = format!("{} frames to and fro", turns * 20);
    session.measure_each(&name, &kinds, |s, kind, w| level(s, kind, &name, turns, w))?;
    super::counters::run(session)
}

/// Sums that differ between a film in one go and one that was stopped `stops` times.
fn resumed(setup: &Setup, kind: TracerKind, stops: u32, watch: &mut Watch) -> Result<usize> {
    let scene = builtin::by_name("cornell-box").ok_or_else(|| Error::Scene("no Cornell box".into()))?;
    let flat = FlatScene::new(&scene);
    let tracer = super::scale::path_tracer(setup, kind, &flat)?;
    let options = PathOptions { samples: SampleSettings::new([13, 11], 16, 3), max_depth: 3, ..Default::default() };
    let whole = render(&tracer, &flat, &up_to(&options, 2 * stops, None), watch)?.image.state;
    let mut state = None;
    for k in 1..=stops {
        state = render(&tracer, &flat, &up_to(&options, 2 * k, state), watch)?.image.state;
    }
    match (whole, state) {
        (Some(whole), Some(state)) => Ok(different_words(&whole, &state)),
        _ => Err(Error::CheckFailed("the film's sums were not kept".into())),
    }
}

/// The mean of frames whose camera goes to and fro neither rises nor falls.
fn level(setup: &Setup, kind: TracerKind, name: &str, turns: u32, watch: &mut Watch) -> Result<Check> {
    const TURN: u32 = 20;
    let scene = builtin::by_name("stairs").ok_or_else(|| Error::Scene("no stairs".into()))?;
    let tracer = Tracer::new(setup.device(), kind, &FlatScene::new(&scene), super::degenerate::NEEDS)?;
    let size = [16, 9];
    let mut realtime = Realtime::new(&tracer, size, &traced(Preset::Fast), &[])?;
    let (mut level, mut unsound) = (Vec::new(), 0);
    for _ in 0..turns {
        let mut sum = 0.0;
        for frame in 0..TURN {
            let phase = f64::from(frame) / f64::from(TURN) * std::f64::consts::TAU;
            let mut camera = scene.cameras[0].clone();
            camera.camera_to_world *= DAffine3::from_translation(DVec3::new(0.3, 0.1, 0.0) * phase.sin());
            realtime.frame(&tracer, &CameraRecord::new(&camera, scene.origin(), 16.0 / 9.0), &[])?;
            let result = realtime.result()?;
            unsound += result.iter().filter(|v| !(0.0..=1.0).contains(*v)).count();
            sum += result.iter().map(|v| f64::from(*v)).sum::<f64>() / result.len() as f64;
        }
        if crate::film::Control::should_stop(watch)? {
            return Err(Error::Interrupted);
        }
        level.push(sum / f64::from(TURN));
    }
    // histories have filled up
    let drift = Drift::from_values(&level[4..]).ok_or_else(|| Error::CheckFailed("too few frames".into()))?;
    let change = (drift.slope * level.len() as f64).abs();
    let value = if unsound > 0 || !drift.is_level() { f64::NAN } else { change };
    let sentence = format!(
        "over {} turns; {unsound} values out of range{}",
        level.len(),
        if drift.is_level() { "" } else { "; it drifts" }
    );
    Ok(Check::at_most(name, value, "of visibility", 0.01).says(sentence))
}
