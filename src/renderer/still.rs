//! Stills: one image, rendered sample by sample.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;

use super::brightness;
use super::complete::{CHOSEN, Completed};
use super::denoising::{self, Denoising};
use super::film_file::{self, Identity, Maker};
use super::laps::{self, Laps};
use super::report::{FilmReport, Seconds, Setup, StillReport};
use super::{RenderSettings, Renderer, TracerRequest, camera_numbers};
use crate::accel::flatten::FlatScene;
use crate::denoise;
use crate::error::{Error, Result};
use crate::files;
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::film::schedule::FilmOptions;
use crate::film::tile_mask::TileMask;
use crate::integrators::aov::{self, Aov, AovPixel};
use crate::integrators::{Integrator, PictureOptions, RenderJob};
use crate::output::{self, Channel, FileSettings, Image, ImageFormat, Picture, Samples, picture};
use crate::ray::Ray;
use crate::scene::{Camera, Motion, Projection, RenderHints, fingerprint};
use crate::tracer::Needs;

/// Additional results of a still.
#[derive(Clone, Copy, Debug, Default)]
pub struct StillExtras {
    /// Keep the rays of the first sample.
    pub keep_rays: bool,
    /// Render auxiliary outputs even if settings name none, for a depth image.
    pub aov: bool,
    /// Make intermediate images at every power of two of samples even if settings do not select them, for viewers.
    pub intermediate: bool,
}

/// A finished still image.
pub struct Still {
    /// All channels and the metadata.
    pub image: Image,
    /// Auxiliary outputs, rows from the top, if requested.
    pub aov: Vec<AovPixel>,
    /// Camera rays and occlusion rays of the first sample in world space, if [`StillExtras::keep_rays`] is set.
    pub rays: [Vec<Ray>; 2],
    /// The report of the render.
    pub report: StillReport,
    integrator: &'static dyn Integrator,
    picture: PictureOptions,
}

impl Still {
    /// Writes the image in the format of the file name's extension.
    ///
    /// # Errors
    /// Those of [`Still::save_with`].
    pub fn save(&self, path: &Path) -> Result<()> {
        self.save_with(path, &FileSettings::default())
    }

    /// As [`Still::save`], with settings of the file; those of other formats are ignored.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown format, or one that cannot have what the settings say; [`Error::Output`].
    pub fn save_with(&self, path: &Path, files: &FileSettings) -> Result<()> {
        save(&self.image, self.integrator, &self.picture, files, path)
    }
}

/// An image of a render that is still running ([`Renderer::still_with`]).
pub struct IntermediateImage<'a> {
    /// All channels and the metadata.
    pub image: &'a Image,
    /// Maximum number of samples of a pixel.
    pub samples: u32,
    integrator: &'static dyn Integrator,
    picture: PictureOptions,
}

impl IntermediateImage<'_> {
    /// Writes the image as [`Still::save_with`] does.
    ///
    /// # Errors
    /// Those of [`Still::save_with`].
    pub fn save_with(&self, path: &Path, files: &FileSettings) -> Result<()> {
        save(self.image, self.integrator, &self.picture, files, path)
    }
}

fn save(image: &Image, integrator: &dyn Integrator, options: &PictureOptions, files: &FileSettings, path: &Path) -> Result<()> {
    let format = ImageFormat::of(path)?;
    if format == ImageFormat::Exr {
        return output::exr::write_with(image, path, &files.into());
    }
    let mut shown = match files.background {
        // the scene on black, as it is in the image
        None => integrator.picture(image, options),
        // the scene alone: what a display shows of a colour is not in proportion to it, so that alpha comes afterwards
        Some(_) => integrator.picture(&picture::unassociated(image), options),
    };
    let alpha = image.channels.iter().find(|c| c.name == "A").filter(|_| shown.f32("A").is_none());
    shown.channels.extend(alpha.cloned());
    let of_png = FileSettings { background: files.background, ..FileSettings::default() };
    let settings = if format == ImageFormat::Png { files } else { &of_png };
    Picture::new(&shown, files.background, settings, path)?.save(path, files.jpeg_quality())
}

impl Renderer {
    /// Renders a still.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings that have no effect together or do not fit the scene; those of the device; those of `control`.
    pub fn still(&mut self, settings: &RenderSettings, control: &mut dyn Control) -> Result<Still> {
        self.still_with(settings, StillExtras::default(), control, &mut |_| Ok(()))
    }

    /// As [`Renderer::still`]; `save` receives intermediate images, at the numbers of samples that [`super::settings::FilmSettings::intervals`] selects.
    ///
    /// # Errors
    /// As [`Renderer::still`], and those of `save`.
    pub fn still_with(
        &mut self,
        settings: &RenderSettings,
        extras: StillExtras,
        control: &mut dyn Control,
        save: &mut dyn FnMut(&IntermediateImage) -> Result<()>,
    ) -> Result<Still> {
        settings.check()?;
        if let Some(frames) = settings.frames.given().first() {
            return Err(Error::Usage(format!("{} is for frames, and a still is rendered: leave it out", frames.option())));
        }
        let start = Instant::now();
        let mut laps = Laps::after_open(self.open_seconds.wall);
        let completed = self.complete(settings, None)?;
        laps.lap(laps::SURVEY);
        self.still_of(&completed, extras, (start, laps), control, save)
    }

    /// Renders a still of completed settings. `begun`: when work on it began, and the parts of its time so far.
    pub(super) fn still_of(
        &mut self,
        completed: &Completed,
        extras: StillExtras,
        begun: (Instant, Laps),
        control: &mut dyn Control,
        save: &mut dyn FnMut(&IntermediateImage) -> Result<()>,
    ) -> Result<Still> {
        let Completed { camera, settings, choices, .. } = completed;
        let chosen = completed.options();
        let (start, mut laps) = begun;
        let denoiser = denoising::choose(settings.image.denoise)?;
        let integrator = settings.integrator().get();
        let size = settings.size(&self.scene);
        let (device, kind, compute) = (self.device.clone(), self.kind, self.compute);
        let ready = self.tracer.take();
        let scene = &self.scene;
        let mut warnings = scene_warnings(scene);
        warnings.iter().for_each(|w| control.warning(w));
        let mut job = RenderJob { keep_rays: extras.keep_rays, ..settings.job(scene, camera) };
        let prints = settings.film.keeps_state().then(|| fingerprint::of_scene(scene));
        let identity = identity(integrator, &job, prints);
        let maker: Maker =
            [("tracer", kind.name().into()), ("device", format!("{} ({})", device.info.name, device.info.driver))];
        let resumed = settings
            .film
            .resume
            .as_ref()
            .map(|path| film_file::resume(path, &self.name, integrator.channels(), size, job.spp, &identity, &maker));
        let resumed = resumed.transpose()?;
        let samples_before = resumed.as_ref().map(|r| r.state.max_samples());
        if let Some(warning) = resumed.as_ref().and_then(|r| r.warning.clone()) {
            control.warning(&warning);
            warnings.push(warning);
        }
        job.film = FilmOptions {
            start: resumed.map(|r| r.state.into()),
            keep_state: settings.film.keeps_state(),
            intervals: stops(settings, extras, &scene.hints, job.spp),
            target_rmse: settings.film.target_rmse,
        };
        let flat = FlatScene::with_motion_and_blend(scene, Motion::default(), integrator.blend())?;
        let wanted = &settings.image.aov;
        let needs = aov_needs(integrator.needs(&settings.integrators), wanted);
        // the normals that tell surfaces apart
        let needs = Needs { normals: needs.normals || denoiser.is_some(), ..needs };
        let rays = integrator.rays_per_sample() * u64::from(job.spp) * u64::from(size[0]) * u64::from(size[1]);
        let streams = integrator.streams(&settings.integrators);
        let request = TracerRequest { needs, streams, rays, control: &mut *control, warnings: &mut warnings };
        laps.lap("prepare");
        let ready = request.reuse_or_build(ready, &device, kind, &flat, compute, &self.settings)?;
        laps.lap("build");
        let tracer = &ready.tracer;
        let record = job.camera_record(&flat);
        let tile_mask = match integrator.skips_empty_tiles(&job) {
            true => TileMask::new(&flat, &record, size, job.spp).map(Arc::new),
            false => None,
        };

        laps.lap("prepare");
        // first, because intermediate images contain them, too
        let aov_start = Instant::now();
        let pixels = match wanted.is_empty() && !extras.aov {
            true => Vec::new(),
            false => aov::render(tracer, &record, size, control)?,
        };
        let aov_seconds = aov_start.elapsed().as_secs_f64();
        laps.lap("aov");
        let denoise_options = integrator.denoise_options(&job)?;
        let denoising = denoiser.as_ref().zip(denoise_options.as_ref()).map(|(chosen, options)| {
            Denoising::new(chosen, denoise::DenoiseInput { tracer, scene, camera: &record, options }, integrator.channels())
        });
        let composer = Composer {
            name: files::portable_name(&self.name),
            camera,
            integrator,
            size,
            pixels: &pixels,
            aov: wanted,
            origin: flat.origin,
            identity: &identity,
            maker: &maker,
            target_rmse: settings.film.target_rmse,
            chosen: chosen.as_deref(),
            denoising: denoising.as_ref(),
        };
        let picture = settings.picture.options();
        let mut interval_control = IntervalControl {
            control: &mut *control,
            save: &mut |accumulated, control| {
                let image = composer.image(accumulated, control)?;
                save(&IntermediateImage { image: &image, samples: accumulated.max_spp, integrator, picture })
            },
        };
        let rendered = integrator.render(tracer, &flat, &job, tile_mask, &mut interval_control)?;
        device.check_validation()?;
        laps.lap("trace");
        let image = composer.image(&rendered.image, control)?;
        laps.lap(if denoising.is_some() { "denoise" } else { "film" });
        device.check_validation()?;
        let mut rays = rendered.kept_rays;
        for rays in &mut rays {
            // to world space, as exported meshes are
            crate::ray::translate(rays, flat.origin);
        }
        let surface_mean = brightness::of_surfaces(&rendered.image, integrator.channels().len());
        let brightness =
            surface_mean.and_then(|mean| brightness::warning(mean, integrator.capabilities(), f64::from(picture.exposure)));
        rendered.report.warnings.iter().for_each(|w| control.warning(w));
        brightness.iter().for_each(|w| control.brightness(w));
        warnings.extend(rendered.report.warnings.iter().chain(&brightness).cloned());
        let (mean, mean_standard_error) = rendered.image.film.mean_and_error();
        let mut report = StillReport {
            setup: Setup::new(self, tracer, &flat, camera, (choices.clone(), chosen.clone()), warnings),
            integrator: integrator.name(),
            quantity: integrator.quantity(),
            size,
            spp: rendered.image.spp,
            most_spp: rendered.image.max_spp,
            requested_spp: job.spp,
            seed: job.seed,
            stopped_early: rendered.image.stopped_early,
            mean,
            mean_standard_error,
            surface_mean,
            film: FilmReport::new(&settings.film, &scene.hints, &rendered.image, samples_before, job.spp),
            compute: tracer.compute_options(),
            coherent_kernel: tracer.compute_options().map(|o| o.kernel.for_coherent(&device.info)),
            primary_rays: rendered.image.primary_rays,
            skipped_primary_rays: rendered.image.skipped_primary_rays,
            device_seconds: rendered.image.device_seconds.clone(),
            longest_launch: rendered.image.longest_launch,
            details: rendered.report,
            denoise: denoising.as_ref().map(Denoising::report),
            seconds: Seconds {
                trace: rendered.image.trace_seconds,
                aov: aov_seconds,
                render: start.elapsed().as_secs_f64(),
                ..Seconds::default()
            },
        };
        drop(denoising);
        self.tracer = Some(ready);
        self.keep_pipelines();
        laps.lap("film");
        report.seconds.parts = laps.into_parts();
        Ok(Still { image, aov: pixels, rays, report, integrator, picture })
    }
}

/// Warnings of the scene's loader, a sentence each.
pub(super) fn scene_warnings(scene: &crate::scene::Scene) -> Vec<String> {
    let report = &scene.report;
    let dropped =
        (report.degenerate_triangles > 0).then(|| format!("dropped {} degenerate triangles", report.degenerate_triangles));
    report.warnings.iter().cloned().chain(dropped).collect()
}

/// Description of a camera, for metadata.
pub fn camera_text(camera: &Camera) -> String {
    let m = &camera.camera_to_world;
    let lens = match camera.projection {
        Projection::Perspective { fov_y } => format!("perspective, fov_y {} degrees", fov_y.to_degrees()),
        Projection::Orthographic { half_height } => format!("orthographic, half height {half_height}"),
    };
    format!("{:?} eye {}, forward {}, up {}; {lens}", camera.name, m.translation, -m.matrix3.z_axis, m.matrix3.y_axis)
}

/// Everything that must agree for a render to be resumed: all that its samples depend on, except its size. `print`: the scene's fingerprint, if the film's state
/// is kept.
pub(super) fn identity(integrator: &dyn Integrator, job: &RenderJob, print: Option<String>) -> Identity {
    let environment = || fingerprint::of_environment(&job.scene.environment);
    let around = print.as_ref().filter(|_| integrator.sees_environment()).map(|_| environment());
    let mut out = vec![
        ("version", Some(env!("CARGO_PKG_VERSION").into())),
        ("integrator", Some(integrator.name().to_owned())),
        ("scene.hash", print),
        ("environment.hash", around),
        ("camera", Some(camera_text(job.camera))),
        ("seed", Some(job.seed.to_string())),
    ];
    out.extend(integrator.identity(job));
    out
}

/// Numbers of samples at which intermediate images are saved: powers of two, and those that the scene names.
pub fn intervals(settings: &RenderSettings, hints: &RenderHints, spp: u32) -> Vec<u32> {
    let mut intervals: Vec<u32> = match settings.film.intervals {
        true => powers_of_two(spp).chain(hints.save_intervals.iter().copied()).collect(),
        false => Vec::new(),
    };
    intervals.retain(|&n| n > 0 && n < spp);
    intervals.sort_unstable();
    intervals.dedup();
    intervals
}

/// Numbers of samples at which intermediate images are made: to be saved, and for viewers.
fn stops(settings: &RenderSettings, extras: StillExtras, hints: &RenderHints, spp: u32) -> Vec<u32> {
    let mut stops = intervals(settings, hints, spp);
    if extras.intermediate {
        stops.extend(powers_of_two(spp));
        stops.sort_unstable();
        stops.dedup();
    }
    stops
}

/// Powers of two below `spp`.
fn powers_of_two(spp: u32) -> impl Iterator<Item = u32> {
    (0..u32::BITS).map(|k| 1 << k).take_while(move |n| *n < spp)
}

/// Text of a range of samples per pixel.
pub(super) fn spp_text(least: u32, most: u32) -> String {
    if least == most { most.to_string() } else { format!("{least} to {most}") }
}

/// Composes images from films.
struct Composer<'a> {
    name: String,
    camera: &'a Camera,
    integrator: &'static dyn Integrator,
    size: [u32; 2],
    pixels: &'a [AovPixel],
    aov: &'a [Aov],
    origin: DVec3,
    identity: &'a Identity,
    maker: &'a Maker,
    target_rmse: Option<f64>,
    chosen: Option<&'a str>,
    denoising: Option<&'a Denoising<'a>>,
}

impl Composer<'_> {
    fn image(&self, accumulated: &Accumulated, control: &mut dyn Control) -> Result<Image> {
        let mut channels = self.channels(accumulated);
        let mut metadata = self.metadata(accumulated);
        if let Some(denoising) = self.denoising {
            channels = denoising.channels(accumulated, channels, control)?;
            metadata.push(("denoise".into(), denoising.name().into()));
        }
        channels.extend(aov::channels(self.aov, self.pixels, self.origin));
        Ok(Image { width: self.size[0], height: self.size[1], channels, metadata })
    }

    /// The film as named channels: means, coverage, the variance of one sample of each channel, and the film's sums if its state is kept.
    fn channels(&self, image: &Accumulated) -> Vec<Channel> {
        let (film, names) = (&image.film, self.integrator.channels());
        let f32s = |name: String, samples| Channel { name, samples: Samples::F32(samples) };
        let mut out: Vec<_> = names.iter().enumerate().map(|(c, n)| f32s((*n).into(), film.plane(c))).collect();
        out.push(f32s("A".into(), film.coverage.clone()));
        for (c, name) in names.iter().enumerate() {
            let name = if names.len() == 1 { "variance".into() } else { format!("variance.{name}") };
            out.push(f32s(name, film.variance_plane(c)));
        }
        // exact: there are at most 2^24; floats, because frames in real time have fractions of samples
        out.push(f32s("samples".into(), film.samples.iter().map(|n| *n as f32).collect()));
        out.extend(image.state.iter().flat_map(|s| film_file::state_channels(s, names)));
        out
    }

    /// Text attributes. They are identical for two runs of the same command.
    fn metadata(&self, image: &Accumulated) -> Vec<(String, String)> {
        let mut out = vec![("scene", self.name.clone()), ("spp", spp_text(image.spp, image.max_spp))];
        let aspect = f64::from(self.size[0]) / f64::from(self.size[1]);
        out.extend(camera_numbers::metadata(self.camera, aspect));
        out.extend(self.maker.iter().cloned());
        out.extend(self.identity.iter().filter_map(|(key, value)| Some((*key, value.clone()?))));
        if let Some(target) = self.target_rmse {
            out.push(("target_rmse", target.to_string()));
        }
        out.extend(self.chosen.map(|options| (CHOSEN, options.to_owned())));
        out.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

/// A control that saves intermediate images.
struct IntervalControl<'a> {
    control: &'a mut dyn Control,
    save: &'a mut dyn FnMut(&Accumulated, &mut dyn Control) -> Result<()>,
}

impl Control for IntervalControl<'_> {
    fn progress(&mut self, done: u64, total: u64) {
        self.control.progress(done, total);
    }

    fn interval(&mut self, image: &Accumulated) -> Result<()> {
        (self.save)(image, self.control)
    }

    fn warning(&mut self, text: &str) {
        self.control.warning(text);
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.control.should_stop()
    }
}

/// Adds the scene data that auxiliary outputs need to `needs`.
pub(super) fn aov_needs(needs: Needs, wanted: &[Aov]) -> Needs {
    Needs { normals: needs.normals || Aov::Ns.is_in(wanted), albedo: needs.albedo || Aov::Albedo.is_in(wanted), ..needs }
}
