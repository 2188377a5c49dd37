//! `skylit render --integrator path`, `direct`, `ao-sky`, and views of surfaces.

pub mod args;
pub mod denoise;
mod report;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::args::{DEFAULT_SIZE, DEFAULT_SPP, Integrator, RenderArgs};
use super::film::{self, Saver};
use super::render::{aov_channels, choose_camera, open, write_depth};
use super::report::Seconds;
use crate::accel::flatten::FlatScene;
use crate::colour::srgb_decode;
use crate::denoise::Shot;
use crate::error::{Error, Result};
use crate::files;
use crate::film::accumulate::Accumulated;
use crate::film::camera::CameraRecord;
use crate::film::cover::Cover;
use crate::integrators::aov;
use crate::integrators::path::{self, Lens, MOST_DEPTH, PathOptions, TextureFilter, View};
use crate::output::tone_map::ToneMap;
use crate::output::{self, Channel, Image, ImageFormat, Samples, png};
use crate::scene::{Camera, Environment, Projection, fingerprint};
use crate::terminal::console::Failure;
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::{Warnings, warnings_of};
use crate::tracer::{Needs, Tracer};
use denoise::Denoising;
use report::{About, Report};

/// Rays of a path that the hierarchy's build is planned for.
const RAYS_OF_A_PATH: u64 = 6;
/// Values of a pixel.
const CHANNELS: [&str; 3] = ["R", "G", "B"];
/// Grey of `ao-sky`.
const SKY_ALBEDO: f64 = 0.5;

/// Loads, renders, writes, reports.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    for path in args.outputs() {
        files::check_writable(&path)?;
    }
    let denoiser = denoise::choose(args.paths.denoise)?;
    interrupt::install();
    let console = args.verbosity.console();
    let (mut scene, device, seconds) = open(args)?;
    let mut warnings = Warnings::new(console);
    warnings_of(&scene).iter().for_each(|w| warnings.add(w));
    if let Some(environment) = args.paths.environment()? {
        scene.environment = environment;
    }
    args.paths.light.iter().for_each(|l| l.add(&mut scene));
    interrupt::check()?;

    let size = args.size.or(scene.hints.size).unwrap_or(DEFAULT_SIZE);
    output::check_size(size[0], size[1])?;
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let camera = choose_camera(args, &scene, aspect)?;
    let flat = FlatScene::for_paths(&scene);
    let record = CameraRecord::new(&camera, flat.origin, aspect);
    let (kind, why, compute) = args.device.choose(&device.info)?;
    let prints = || [fingerprint::of_scene(&scene), fingerprint::of_environment(&scene.environment)];
    let mut about = About {
        args,
        scene: &scene,
        camera: &camera,
        device: &device.info,
        tracer: kind,
        options: options(args, &flat, &camera, size)?,
        prints: args.film.keeps_state().then(prints),
    };
    let spp = about.options.spp;
    let resumed = film::resume(args, &CHANNELS, size, spp, &about.identity(), &about.maker())?;
    let before = resumed.as_ref().map(|r| r.state.most_samples());
    resumed.iter().flat_map(|r| &r.warning).for_each(|w| warnings.add(w));
    about.options.film = film::options(args, &scene.hints, spp, resumed.map(|r| r.state));
    film::check_writable(args, &about.options.film)?;
    let mut build = args.device.build_options(RAYS_OF_A_PATH * spp as u64 * size[0] as u64 * size[1] as u64);
    build.streams.extend(path::streams());
    let needs = Needs {
        shading: true,
        white: about.options.white_sky.is_some(),
        compensation: args.paths.energy_compensation,
        baked_occlusion: about.options.view == Some(View::BakedOcclusion),
        mip_levels: about.options.texture_filter == TextureFilter::RayCone,
        ..Default::default()
    };
    let tracer = Tracer::with_build(&device, kind, &flat, needs, compute, &build)?;
    build.take_warnings().iter().for_each(|w| warnings.add(w));
    // what surrounds the scene is seen where nothing is; lenses and wide filters look beside the pixel
    let black = about.options.view.is_some() || about.options.white_sky.is_none() && !scene.has_visible_sky();
    if black && about.options.is_sharp() {
        about.options.cover = Cover::new(&flat, &record, size, spp).map(Arc::new);
    }
    let (about, options) = (&about, &about.options);

    let mut keyboard = ProgressControl { progress: Progress::new("rendering", &console), keep_partial: args.keep_partial };
    // first, because what is saved on the way has them, too
    let aov_start = Instant::now();
    let pixels = match args.aov.is_empty() && args.depth_image.is_none() {
        true => Vec::new(),
        false => aov::render(&tracer, &record, size, &mut keyboard)?,
    };
    let aov_seconds = aov_start.elapsed().as_secs_f64();
    let denoising = denoiser.as_ref().map(|chosen| {
        let shot = Shot { tracer: &tracer, scene: &scene, camera: &record, options };
        Denoising::new(chosen, shot, args)
    });
    let image = |accumulated: &Accumulated| -> Result<Image> {
        let mut channels = channels(accumulated, args, options.film.keep_state);
        let mut metadata = about.metadata(accumulated);
        if let Some(denoising) = &denoising {
            channels = denoising.channels(accumulated, channels, args.writes_exr())?;
            metadata.push(("denoise".into(), denoising.name().into()));
        }
        channels.extend(aov_channels(args, &pixels, flat.origin));
        Ok(Image { width: size[0], height: size[1], channels, metadata })
    };
    let mut save = |accumulated: &Accumulated| {
        let image = image(accumulated)?;
        args.output.iter().try_for_each(|path| write(&image, &film::interval_path(path, accumulated.most_spp), args))
    };
    let mut control = Saver { keyboard, save: &mut save };
    let result = path::render(&tracer, &flat, &record, options, &mut control)?;
    let seconds = Seconds { trace: result.image.trace_seconds, aov: aov_seconds, ..seconds };
    drop(control);
    device.check_validation()?;
    if result.image.film.not_finite > 0 {
        warnings.add(&format!(
            "{} of {} samples were not finite and were left out: please report this scene",
            result.image.film.not_finite,
            u64::from(result.image.spp) * u64::from(size[0]) * u64::from(size[1])
        ));
    }
    if options.view.is_none()
        && options.white_sky.is_none()
        && scene.environment == Environment::Black
        && scene.lights.is_empty()
        && !emits(&flat)
    {
        warnings.add("the scene has no light, and the image is black: give --environment FILE or R,G,B");
    }

    let image = image(&result.image)?;
    device.check_validation()?;
    let write_start = Instant::now();
    let mut report = Report {
        about,
        why,
        result: &result,
        film: film::tell(args, &scene.hints, &result.image.film, result.image.converged, before, spp),
        stats: tracer.stats(),
        features: tracer.features().explain(&flat),
        tracer_features: tracer.features(),
        warnings: warnings.list,
        seconds,
        denoised: denoising.as_ref().map(|d| d.tell(args.writes_exr())),
    };
    if let Some(path) = &args.depth_image {
        write_depth(path, &pixels, size)?;
    }
    args.output.iter().try_for_each(|path| write(&image, path, args))?;
    device.save_pipeline_cache();
    report.seconds.write = write_start.elapsed().as_secs_f64();
    report.seconds.total = start.elapsed().as_secs_f64();
    for line in report.lines() {
        console.line(&line)?;
    }
    let interrupted = args.keep_partial && interrupt::requested();
    console.close(&report.record(), if interrupted { Err(Error::Interrupted) } else { Ok(()) })
}

/// Does any surface emit?
fn emits(flat: &FlatScene) -> bool {
    flat.scene.meshes.iter().any(|m| flat.scene.materials[m.material].emissive != glam::Vec3::ZERO)
}

/// Height of the sensor that `--f-number` is about, metres.
const SENSOR_HEIGHT: f64 = 0.024;

/// The lens that is asked for.
fn lens(args: &RenderArgs, camera: &Camera) -> Result<Option<Lens>> {
    let (Some(f_number), Some(focus)) = (args.paths.f_number, args.paths.focus_distance) else { return Ok(None) };
    match camera.projection {
        Projection::Perspective { fov_y } => {
            let focal_length = 0.5 * SENSOR_HEIGHT / (0.5 * fov_y).tan();
            Ok(Some(Lens { radius: (0.5 * focal_length / f_number) as f32, focus: focus as f32 }))
        }
        Projection::Orthographic { .. } => Err(Error::Usage("--f-number: the camera is orthographic and has no lens".into())),
    }
}

fn options(args: &RenderArgs, flat: &FlatScene, camera: &Camera, size: [u32; 2]) -> Result<PathOptions> {
    let hints = &flat.scene.hints;
    let asked = args.paths.max_depth.or(hints.max_depth).unwrap_or(MOST_DEPTH);
    Ok(PathOptions {
        size,
        pixel_filter: args.paths.pixel_filter.map(Into::into).unwrap_or_default(),
        texture_filter: args.paths.texture_filter.map(Into::into).unwrap_or_default(),
        lens: lens(args, camera)?,
        spp: args.spp.or(hints.spp).unwrap_or(DEFAULT_SPP).max(1),
        seed: args.seed,
        max_depth: if args.integrator == Integrator::Direct { 1 } else { asked },
        rr_depth: args.paths.rr_depth.unwrap_or(PathOptions::default().rr_depth),
        firefly_clamp: args.paths.firefly_clamp.map_or(f32::INFINITY, |c| c as f32),
        strategy: args.paths.sampling.map(Into::into).unwrap_or_default(),
        view: view(args.integrator),
        white_sky: (args.integrator == Integrator::AoSky).then(|| args.paths.sky_albedo.unwrap_or(SKY_ALBEDO) as f32),
        time_limit: args.time_limit,
        cover: None,
        film: Default::default(),
    })
}

/// What is seen instead of light.
fn view(integrator: Integrator) -> Option<View> {
    match integrator {
        Integrator::Normals => Some(View::Normals),
        Integrator::Albedo => Some(View::Albedo),
        Integrator::Depth => Some(View::Depth),
        Integrator::BakedOcclusion => Some(View::BakedOcclusion),
        Integrator::Ao | Integrator::Path | Integrator::Direct | Integrator::AoSky => None,
    }
}

/// Writes an output, of the kind that its name says.
fn write(image: &Image, path: &Path, args: &RenderArgs) -> Result<()> {
    match ImageFormat::of(path)? {
        ImageFormat::Png => png::write(&picture(image, args), path, 0.0),
        ImageFormat::Exr => output::save(image, path),
    }
}

/// What a picture of 8 bits shows: light; of views, normals about the middle of the range, and depths over the greatest.
fn picture(image: &Image, args: &RenderArgs) -> Image {
    let shown = |f: &dyn Fn(f32) -> f32| {
        let mut out = image.clone();
        out.channels.retain(|c| ["R", "G", "B"].contains(&c.name.as_str()));
        for channel in &mut out.channels {
            if let Samples::F32(values) = &mut channel.samples {
                values.iter_mut().for_each(|v| *v = srgb_decode(f(*v)));
            }
        }
        out
    };
    match view(args.integrator) {
        Some(View::Normals) => return shown(&|n| 0.5 * n + 0.5),
        Some(View::Depth) => {
            let greatest = image.f32("R").map_or(0.0, |d| d.iter().copied().fold(0.0, f32::max)).max(f32::MIN_POSITIVE);
            return shown(&|d| d / greatest);
        }
        Some(View::BakedOcclusion) => return shown(&|o| o),
        Some(View::Albedo) | None => (),
    }
    let map = args.paths.tone_map.map(ToneMap::from).unwrap_or_default();
    map.apply(image, args.paths.exposure.unwrap_or(0.0) as f32)
}

/// The film as named channels: linear RGB, coverage, and of each channel the variance of one sample; its sums, so that it can be gone on with.
fn channels(image: &Accumulated, args: &RenderArgs, keep_state: bool) -> Vec<Channel> {
    let film = &image.film;
    let f32s = |name: String, samples| Channel { name, samples: Samples::F32(samples) };
    let mut out: Vec<_> = CHANNELS.iter().enumerate().map(|(c, n)| f32s((*n).into(), film.plane(c))).collect();
    if args.writes_exr() {
        out.push(f32s("A".into(), film.coverage.clone()));
        for (c, name) in CHANNELS.iter().enumerate() {
            out.push(f32s(format!("variance.{name}"), film.variance_plane(c)));
        }
        out.push(Channel { name: "samples".into(), samples: Samples::U32(film.samples.clone()) });
    }
    if let Some(state) = image.state.as_ref().filter(|_| keep_state) {
        out.extend(film::state_channels(state, &CHANNELS));
    }
    out
}
