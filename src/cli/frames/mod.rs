//! `skylit render` with the real-time pipeline: one frame, or a sequence of them.

pub mod args;
mod report;
mod write;

use std::time::Instant;

use super::args::{Aov, DEFAULT_SIZE, RenderArgs};
use super::render::{choose_camera, open};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::files;
use crate::film::camera::CameraRecord;
use crate::integrators::ao::Hemisphere;
use crate::integrators::aov;
use crate::output;
use crate::realtime::display::{Display, Shown};
use crate::realtime::sequence::{self, CameraMotion, Sequence};
use crate::realtime::{Realtime, Settings, Technique};
use crate::scene::load::load_camera_path;
use crate::scene::{Camera, LightKind, Orbit, Scene};
use crate::terminal::console::Failure;
use crate::terminal::interrupt;
use crate::terminal::progress::Progress;
use crate::terminal::warnings::{Warnings, warnings_of};
use crate::tracer::{Needs, Tracer};
use report::{FrameReport, Report};
use write::Writer;

/// Frames a second, unless said otherwise.
const DEFAULT_FPS: f64 = 30.0;
/// Exposure of pictures, stops.
const EXPOSURE: f32 = 0.0;
/// Of the scene's diagonal: what shown depths and positions are measured in.
const UNIT_OF_SCENE: f32 = 0.25;

/// Loads, makes frames, writes them, reports.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    args.frames.check_outputs(&args.output)?;
    let mut settings = args.frames.settings()?;
    settings.radius = args.ao_radius;
    settings.falloff = args.ao_falloff.unwrap_or(settings.falloff);
    settings.hemisphere = args.ao_normal.into();
    settings.seed = args.seed;
    let shown = args.frames.show.unwrap_or_default();
    settings.bent = args.wants(Aov::Bent) || shown == Shown::Bent;
    settings.check()?;
    shown.check(&settings)?;
    let range = args.frames.range();
    for path in &args.output {
        files::check_writable(&output::frames::numbered(path, u64::from(range.first))?)?;
    }
    interrupt::install();
    let console = args.verbosity.console();
    let (scene, device, seconds) = open(args)?;
    let mut warnings = Warnings::new(console);
    warnings_of(&scene).iter().for_each(|w| warnings.add(w));
    interrupt::check()?;

    let size = args.size.or(scene.hints.size).unwrap_or(DEFAULT_SIZE);
    output::check_size(size[0], size[1])?;
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let path = args.frames.camera_path.as_deref().map(load_camera_path).transpose()?;
    let camera = match &path {
        Some(path) => path.camera_at(f64::from(range.first)),
        None => choose_camera(args, &scene, aspect)?,
    };
    let fps = args.frames.fps.or(path.as_ref().map(|p| p.fps())).unwrap_or(DEFAULT_FPS);
    let motion = match (path, args.frames.orbit) {
        (Some(path), _) => CameraMotion::Path(path),
        (None, Some(frames)) => CameraMotion::Orbit(orbit(&scene, f64::from(frames))?),
        (None, None) => CameraMotion::Still,
    };
    let animation = args.frames.animate.as_deref().map(|a| sequence::find_animation(&scene, a)).transpose()?;
    let file_camera = scene.cameras.iter().position(|c| *c == camera);
    let mut sequence = Sequence::new(&scene, camera.clone(), file_camera, motion, animation, fps)?;
    let flat = FlatScene::with_motion(&scene, sequence.motion()?)?;
    let (kind, why, compute) = args.device.choose(&device.info)?;
    let needs = Needs {
        normals: settings.hemisphere == Hemisphere::Shading || args.wants(Aov::Ns),
        albedo: args.wants(Aov::Albedo),
        ..Default::default()
    };
    let warm_up = warm_up(args, &settings);
    let frames = u64::from(range.end - range.first) + u64::from(warm_up);
    let rays = frames * u64::from(size[0]) * u64::from(size[1]) * (1 + u64::from(settings.rays_per_pixel));
    let mut build = args.device.build_options(rays);
    build.streams.extend(Realtime::streams(&settings));
    let mut tracer = Tracer::with_build(&device, kind, &flat, needs, compute, &build)?;
    build.take_warnings().iter().for_each(|w| warnings.add(w));
    let mut realtime = Realtime::new(&tracer, size, &settings, &point_lights(&scene, &flat))?;

    if args.writes_picture() {
        let display = Display { shown, exposure: EXPOSURE, unit: UNIT_OF_SCENE * scene_size(&scene) as f32 };
        realtime.display(&tracer, Some(display))?;
    }
    let needs_aov = args.aov.iter().any(|a| *a != Aov::Bent);

    let mut progress = Progress::new("rendering", &console);
    let mut writer = Writer::create(&args.output, size, range.end - range.first, fps, shown.colour())?;
    let mut report = Report::new(args, &settings, realtime.settings().primary.unwrap_or_default(), realtime.primary_reason());
    report.describe(&device.info, kind, why, tracer.stats(), tracer.features().explain(&flat), &scene, &camera);
    for (done, number) in (0..warm_up).map(|_| range.first).chain(range.first..range.end).enumerate() {
        let frame_start = Instant::now();
        let (camera, update) = sequence.frame(f64::from(number), &mut tracer)?;
        let record = CameraRecord::new(&camera, flat.origin, aspect);
        let stats = realtime.frame(&tracer, &record, &update.moved)?;
        tracer.traced(stats.tracing_seconds());
        let seconds = frame_start.elapsed().as_secs_f64();
        let kept = done as u64 >= u64::from(warm_up);
        if kept {
            let write_start = Instant::now();
            let pixels =
                if needs_aov { aov::render(&tracer, &record, size, &mut interrupt::SilentControl)? } else { Vec::new() };
            let image = match args.writes_exr() {
                true => Some(write::image(args, &realtime, size, &pixels, flat.origin, report.metadata(number))?),
                false => None,
            };
            writer.add(number, size, image.as_ref(), realtime.displayed())?;
            if number + 1 == range.end {
                report.mean = mean(&realtime.result()?, &realtime.coverage()?);
            }
            report.seconds.write += write_start.elapsed().as_secs_f64();
        }
        report.add(FrameReport::new(number, kept, seconds, update.mesh_seconds + update.top_seconds, stats));
        progress.set(done as u64 + 1, frames);
        interrupt::check()?;
    }
    writer.finish()?;
    drop(progress);
    device.check_validation()?;
    device.save_pipeline_cache();
    report.seconds.load = seconds.load;
    report.seconds.device = seconds.device;
    report.seconds.total = start.elapsed().as_secs_f64();
    report.warnings = warnings.list;
    for line in report.lines() {
        console.line(&line)?;
    }
    console.close(&report.record(), Ok(()))
}

/// Mean accessibility over what is covered.
fn mean(accessibility: &[f32], coverage: &[f32]) -> f64 {
    let sum = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>();
    let covered = sum(coverage);
    if covered > 0.0 { sum(accessibility) / covered } else { 0.0 }
}

/// Diagonal, world units; 1 where there is nothing.
fn scene_size(scene: &Scene) -> f64 {
    scene.bounds().map(|(lo, hi)| (hi - lo).length()).filter(|d| *d > 0.0).unwrap_or(1.0)
}

/// Frames before the first: a single one is to be settled.
fn warm_up(args: &RenderArgs, settings: &Settings) -> u32 {
    let settles = || match settings.technique {
        Technique::Larsen => 4,
        _ => settings.history.min(Settings::MAX_SAMPLES) * settings.resolution.period() - 1,
    };
    args.frames.warm_up.unwrap_or_else(|| if args.frames.frames.is_some() { 0 } else { settles() })
}

fn orbit(scene: &Scene, frames: f64) -> Result<Orbit> {
    let (lo, hi) = scene.bounds().ok_or_else(|| Error::Scene("nothing to turn about: the scene has no geometry".into()))?;
    Orbit::vertical((lo + hi) * 0.5, frames)
}

/// Positions relative to the tracers' origin.
fn point_lights(scene: &Scene, flat: &FlatScene) -> Vec<[f32; 3]> {
    let point = scene.lights.iter().filter(|l| matches!(l.kind, LightKind::Point));
    point.map(|l| (l.position - flat.origin).as_vec3().to_array()).collect()
}

/// What the camera's image is called in reports.
fn camera_name(camera: &Camera) -> &str {
    if camera.name.is_empty() { "(none)" } else { &camera.name }
}
