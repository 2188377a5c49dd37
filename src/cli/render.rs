//! `skylit render`: a scene to an image file.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::args::{Aov, DEFAULT_SIZE, DEFAULT_SPP, Integrator, RenderArgs, dump_path};
use super::film::{self, Saver};
use super::rays::move_rays;
use super::report::{self, Rays, Report, Seconds};
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::files;
use crate::film::Film;
use crate::film::accumulate::Accumulated;
use crate::film::camera::{self, CameraRecord};
use crate::film::cover::Cover;
use crate::film::schedule::FilmOptions;
use crate::film::state::FilmState;
use crate::gpu::Device;
use crate::integrators::ao::{self, AoOptions, Hemisphere};
use crate::integrators::aov::{self, AovPixel};
use crate::output::{self, Channel, Image, ImageFormat, Samples, png};
use crate::ray::Ray;
use crate::scene::{Projection, Scene, fingerprint, load};
use crate::terminal::console::{Console, Failure};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::{Warnings, warnings_of};
use crate::tracer::{Needs, Tracer};

/// Values of a pixel.
const CHANNELS: [&str; 1] = ["Y"];

/// Loads, renders, writes, reports.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    args.check()?;
    if args.frames.wanted().is_some() {
        return super::frames::run(args, start);
    }
    if args.integrator != Integrator::Ao {
        return super::paths::run(args, start);
    }
    for path in args.outputs() {
        files::check_writable(&path)?;
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
    let camera = choose_camera(args, &scene, aspect)?;
    let flat = FlatScene::new(&scene);
    let record = CameraRecord::new(&camera, flat.origin, aspect);
    let (kind, why, compute) = args.device.choose(&device.info)?;
    let mut options = AoOptions {
        size,
        spp: args.spp.or(scene.hints.spp).unwrap_or(DEFAULT_SPP).max(1),
        seed: args.seed,
        radius: args.ao_radius,
        falloff: args.ao_falloff.unwrap_or(1.0),
        hemisphere: args.ao_normal.into(),
        time_limit: args.time_limit,
        keep_rays: args.dump_rays.is_some(),
        cover: None,
        film: FilmOptions::default(),
    };
    let print = args.film.keeps_state().then(|| fingerprint::of_scene(&scene));
    let identity = report::identity(&camera, &options, print);
    let maker = [("tracer", kind.name().into()), ("device", format!("{} ({})", device.info.name, device.info.driver))];
    let resumed = film::resume(args, &CHANNELS, size, options.spp, &identity, &maker)?;
    let before = resumed.as_ref().map(|r| r.state.most_samples());
    resumed.iter().flat_map(|r| &r.warning).for_each(|w| warnings.add(w));
    options.film = film::options(args, &scene.hints, options.spp, resumed.map(|r| r.state));
    film::check_writable(args, &options.film)?;
    let needs = Needs {
        normals: options.hemisphere == Hemisphere::Shading || args.wants(Aov::Ns),
        albedo: args.wants(Aov::Albedo),
        ..Default::default()
    };
    // a camera ray and an occlusion ray each
    let rays = 2 * options.spp as u64 * size[0] as u64 * size[1] as u64;
    let mut build = args.device.build_options(rays);
    build.streams.extend(ao::streams(&options));
    let tracer = Tracer::with_build(&device, kind, &flat, needs, compute, &build)?;
    build.take_warnings().iter().for_each(|w| warnings.add(w));

    // a dump of rays is a set to compare with: all of them
    if args.dump_rays.is_none() {
        options.cover = Cover::new(&flat, &record, size, options.spp).map(Arc::new);
    }

    let mut keyboard = ProgressControl { progress: Progress::new("rendering", &console), keep_partial: args.keep_partial };
    // first, because what is saved on the way has them, too
    let aov_start = Instant::now();
    let pixels = match args.aov.is_empty() && args.depth_image.is_none() {
        true => Vec::new(),
        false => aov::render(&tracer, &record, size, &mut keyboard)?,
    };
    let aov_seconds = aov_start.elapsed().as_secs_f64();
    let origin = flat.origin;
    let image = |film: Film, state: Option<&FilmState>, spp: String| Image {
        width: size[0],
        height: size[1],
        channels: channels(film, state.filter(|_| options.film.keep_state), args, &pixels, origin),
        metadata: film::metadata(args, spp, &maker, &identity),
    };
    let mut save = |on_way: &Accumulated| {
        let image = image(on_way.film.clone(), on_way.state.as_ref(), film::spp_text(on_way.spp, on_way.most_spp));
        args.output.iter().try_for_each(|path| output::save(&image, &film::interval_path(path, on_way.most_spp)))
    };
    let mut control = Saver { keyboard, save: &mut save };
    let mut result = ao::render(&tracer, &record, &options, &mut control)?;
    let seconds = Seconds { trace: result.trace_seconds, aov: aov_seconds, ..seconds };
    drop(control);
    device.check_validation()?;

    let write_start = Instant::now();
    let (mean, error) = result.film.mean_and_error();
    let mut report = Report {
        args,
        scene: &scene,
        camera: &camera,
        device: &device.info,
        tracer: kind,
        why,
        compute: tracer.compute_options(),
        options: &options,
        spp: result.spp,
        most_spp: result.most_spp,
        film: film::tell(args, &scene.hints, &result.film, result.converged, before, options.spp),
        stopped_early: result.stopped_early,
        mean,
        mean_standard_error: error,
        covered_mean: covered_mean(&result.film),
        rays: Rays {
            primary: result.primary_rays,
            skipped_primary: result.skipped_primary_rays,
            occlusion: result.occlusion_rays,
            skipped: result.skipped_rays,
        },
        device_seconds: std::mem::take(&mut result.device_seconds),
        longest_launch: result.longest_launch,
        stats: tracer.stats(),
        features: tracer.features().explain(&flat),
        warnings: warnings.list,
        seconds,
    };
    write_rays(args, &mut result.kept_primary, &mut result.kept_occlusion, origin)?;
    if let Some(path) = &args.depth_image {
        write_depth(path, &pixels, size)?;
    }
    let image = image(result.film, result.state.as_ref(), film::spp_text(result.spp, result.most_spp));
    for path in &args.output {
        output::save(&image, path)?;
    }
    device.save_pipeline_cache();
    report.seconds.write = write_start.elapsed().as_secs_f64();
    report.seconds.total = start.elapsed().as_secs_f64();
    let interrupted = args.keep_partial && interrupt::requested();
    report.print(&console, if interrupted { Err(Error::Interrupted) } else { Ok(()) })
}

/// Loads the scene while the driver starts: on small scenes they take equally long.
pub(super) fn open(args: &RenderArgs) -> Result<(Scene, Arc<Device>, Seconds)> {
    let timed = |start: Instant| start.elapsed().as_secs_f64();
    std::thread::scope(|scope| {
        let device = scope.spawn(|| {
            let start = Instant::now();
            (Device::open(&args.device.options()), timed(start))
        });
        let start = Instant::now();
        let scene = load::load(&args.scene);
        let load = timed(start);
        let (device, open) = match device.join() {
            Ok(done) => done,
            Err(panic) => std::panic::resume_unwind(panic),
        };
        Ok((scene?, device?, Seconds { load, device: open, ..Default::default() }))
    })
}

pub(super) fn choose_camera(args: &RenderArgs, scene: &Scene, aspect: f64) -> Result<crate::scene::Camera> {
    let mut camera = camera::choose(scene, &args.camera_choice(), aspect)?;
    if let Some(degrees) = args.fov_y {
        match &mut camera.projection {
            Projection::Perspective { fov_y } => *fov_y = degrees.to_radians(),
            Projection::Orthographic { .. } => {
                return Err(Error::Usage("--fov-y: the camera is orthographic and has no field of view".into()));
            }
        }
    }
    Ok(camera)
}

/// Mean over what the scene covers.
fn covered_mean(film: &Film) -> f64 {
    let sum = |v: &[f32]| v.iter().map(|&x| f64::from(x)).sum::<f64>();
    let covered = sum(&film.coverage);
    if covered > 0.0 { sum(&film.mean) / covered } else { 0.0 }
}

/// The film, its sums if it is to go on, and the auxiliary outputs that were asked for, as named channels.
fn channels(
    film: Film,
    state: Option<&FilmState>,
    args: &RenderArgs,
    pixels: &[AovPixel],
    origin: glam::DVec3,
) -> Vec<Channel> {
    let f32s = |name: &str, samples| Channel { name: name.into(), samples: Samples::F32(samples) };
    let mut out = vec![f32s(CHANNELS[0], film.mean)];
    if !args.writes_exr() {
        return out;
    }
    out.push(f32s("A", film.coverage));
    out.push(f32s("variance", film.variance));
    out.push(Channel { name: "samples".into(), samples: Samples::U32(film.samples) });
    out.extend(state.iter().flat_map(|s| film::state_channels(s, &CHANNELS)));
    out.extend(aov_channels(args, pixels, origin));
    out
}

/// The auxiliary outputs that were asked for.
pub(super) fn aov_channels(args: &RenderArgs, pixels: &[AovPixel], origin: glam::DVec3) -> Vec<Channel> {
    let f32s = |name: &str, samples| Channel { name: name.into(), samples: Samples::F32(samples) };
    let mut out = Vec::new();
    let plane = |name: &str, f: &dyn Fn(&AovPixel) -> f32| f32s(name, pixels.iter().map(f).collect());
    let ids = |name: &str, f: &dyn Fn(&AovPixel) -> u32| Channel {
        name: name.into(),
        samples: Samples::U32(pixels.iter().map(f).collect()),
    };
    if args.wants(Aov::Depth) {
        out.push(plane("depth.Z", &|p| p.depth));
    }
    for (k, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
        if args.wants(Aov::Position) {
            out.push(plane(&format!("position.{axis}"), &|p| (f64::from(p.position[k]) + origin[k]) as f32));
        }
        if args.wants(Aov::Ng) {
            out.push(plane(&format!("Ng.{axis}"), &|p| p.ng[k]));
        }
        if args.wants(Aov::Ns) {
            out.push(plane(&format!("Ns.{axis}"), &|p| p.ns[k]));
        }
    }
    if args.wants(Aov::Ids) {
        out.push(ids("id.instance", &|p| p.instance));
        out.push(ids("id.primitive", &|p| p.primitive));
        out.push(ids("id.material", &|p| p.material));
    }
    if args.wants(Aov::Albedo) {
        out.push(plane("albedo.R", &|p| p.red));
        out.push(plane("albedo.G", &|p| p.green));
        out.push(plane("albedo.B", &|p| p.blue));
    }
    out
}

pub(super) fn write_depth(path: &Path, pixels: &[AovPixel], size: [u32; 2]) -> Result<()> {
    let depth: Vec<f32> = pixels.iter().map(|p| p.depth).collect();
    match ImageFormat::of(path)? {
        ImageFormat::Png => png::write_grey(path, &png::depth_to_grey(&depth), size[0], size[1]),
        ImageFormat::Exr => {
            let channels = vec![Channel { name: "depth.Z".into(), samples: Samples::F32(depth) }];
            output::save(&Image { width: size[0], height: size[1], channels, metadata: Vec::new() }, path)
        }
    }
}

fn write_rays(args: &RenderArgs, primary: &mut [Ray], occlusion: &mut [Ray], origin: glam::DVec3) -> Result<()> {
    let Some(prefix) = &args.dump_rays else { return Ok(()) };
    for (kind, rays) in [("primary", primary), ("ao", occlusion)] {
        // files are in the scene's world, as its exported mesh is
        move_rays(rays, origin);
        files::write_atomically(&dump_path(prefix, kind), |file| file.write_all(bytemuck::cast_slice(rays)))?;
    }
    Ok(())
}

impl Report<'_> {
    fn print(&self, console: &Console, outcome: Result<()>) -> Result<(), Failure> {
        for line in self.lines() {
            console.line(&line)?;
        }
        console.close(&self.record(), outcome)
    }
}
