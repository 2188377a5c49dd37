//! Stills: one image, sample by sample.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use glam::DVec3;

use super::denoising::{self, Denoising};
use super::film_file::{self, Identity, Maker};
use super::report::{FilmReport, Seconds, Setup, StillReport};
use super::{ReadyTracer, RenderSettings, Renderer, TracerRequest};
use crate::denoise;
use crate::error::{Error, Result};
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::film::schedule::FilmOptions;
use crate::film::tile_mask::TileMask;
use crate::integrators::aov::{self, Aov, AovPixel};
use crate::integrators::{Integrator, PictureOptions, Shot};
use crate::output::{self, Channel, Image, ImageFormat, Samples, png};
use crate::ray::Ray;
use crate::scene::{Camera, Projection, RenderHints, fingerprint};
use crate::tracer::Needs;

/// What a still is wanted for beside its image.
#[derive(Clone, Copy, Debug, Default)]
pub struct StillExtras {
    /// Keep the rays of the first sample.
    pub keep_rays: bool,
    /// Render auxiliary outputs even where settings name none: a depth image is made of them.
    pub aov: bool,
}

/// A finished still.
pub struct Still {
    /// Its channels and metadata, all of them.
    pub image: Image,
    /// Auxiliary outputs, rows from the top, if any were wanted.
    pub aov: Vec<AovPixel>,
    /// Camera rays and occlusion rays of the first sample, in the file's world, if they were to be kept.
    pub rays: [Vec<Ray>; 2],
    /// How it came about.
    pub report: StillReport,
    integrator: &'static dyn Integrator,
    picture: PictureOptions,
}

impl Still {
    /// Writes it in the format that the file's name says.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown format, [`Error::Output`].
    pub fn save(&self, path: &Path) -> Result<()> {
        save(&self.image, self.integrator, &self.picture, path)
    }
}

/// An image that is not finished, on its way to a file ([`Renderer::still_with`]).
pub struct Interval<'a> {
    image: &'a Image,
    /// Samples that any pixel has at most.
    pub samples: u32,
    integrator: &'static dyn Integrator,
    picture: PictureOptions,
}

impl Interval<'_> {
    /// As [`Still::save`].
    ///
    /// # Errors
    /// Those of [`Still::save`].
    pub fn save(&self, path: &Path) -> Result<()> {
        save(self.image, self.integrator, &self.picture, path)
    }
}

fn save(image: &Image, integrator: &dyn Integrator, picture: &PictureOptions, path: &Path) -> Result<()> {
    match ImageFormat::of(path)? {
        ImageFormat::Png => png::write(&integrator.picture(image, picture), path, 0.0),
        ImageFormat::Exr => output::save(image, path),
    }
}

impl Renderer {
    /// Renders a still.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings that have no effect together or do not fit the scene; those of the device; what `control` says.
    pub fn still(&mut self, settings: &RenderSettings, control: &mut dyn Control) -> Result<Still> {
        self.still_with(settings, StillExtras::default(), control, &mut |_| Ok(()))
    }

    /// As [`Renderer::still`]; `save` gets the image on its way, at the samples that [`super::settings::FilmSettings::intervals`] means.
    ///
    /// # Errors
    /// As [`Renderer::still`], and what `save` says.
    pub fn still_with(
        &mut self,
        settings: &RenderSettings,
        extras: StillExtras,
        control: &mut dyn Control,
        save: &mut dyn FnMut(&Interval) -> Result<()>,
    ) -> Result<Still> {
        settings.check()?;
        if let Some(frames) = settings.asks_for_frames() {
            return Err(Error::Usage(format!("{} is for frames in real time, and this is a still", frames.option())));
        }
        let start = Instant::now();
        let denoiser = denoising::choose(settings.integrators.path.denoise)?;
        self.light(&settings.lighting)?;
        let integrator = settings.integrator().get();
        let size = settings.size(&self.scene);
        output::check_size(size[0], size[1])?;
        let camera = settings.camera.choose(&self.scene, f64::from(size[0]) / f64::from(size[1]))?;
        let (device, kind, compute) = (self.device.clone(), self.kind, self.compute);
        let ready = self.tracer.take();
        let scene = &self.scene;
        let mut warnings = scene_warnings(scene);
        warnings.iter().for_each(|w| control.warning(w));
        let mut shot = Shot {
            scene,
            camera: &camera,
            size,
            spp: settings.spp(scene),
            seed: settings.seed(),
            settings: &settings.integrators,
            time_limit: settings.image.time_limit.map(Duration::from_secs_f64),
            keep_rays: extras.keep_rays,
            film: FilmOptions::default(),
        };
        let prints = settings.film.keeps_state().then(|| fingerprint::of_scene(scene));
        let identity = identity(integrator, &shot, prints);
        let maker: Maker =
            [("tracer", kind.name().into()), ("device", format!("{} ({})", device.info.name, device.info.driver))];
        let resumed = settings
            .film
            .resume
            .as_ref()
            .map(|path| film_file::resume(path, &self.name, integrator.channels(), size, shot.spp, &identity, &maker));
        let resumed = resumed.transpose()?;
        let samples_before = resumed.as_ref().map(|r| r.state.max_samples());
        if let Some(warning) = resumed.as_ref().and_then(|r| r.warning.clone()) {
            control.warning(&warning);
            warnings.push(warning);
        }
        shot.film = FilmOptions {
            start: resumed.map(|r| r.state.into()),
            keep_state: settings.film.keeps_state(),
            intervals: intervals(settings, &scene.hints, shot.spp),
            target_rmse: settings.film.target_rmse,
        };
        let flat = integrator.flatten(scene)?;
        let wanted = &settings.image.aov;
        let needs = aov_needs(integrator.needs(&settings.integrators), wanted);
        let ready = match ready.filter(|r| r.blend == flat.blend && r.needs == needs) {
            Some(ready) => ready,
            None => {
                let rays = integrator.rays_per_sample() * u64::from(shot.spp) * u64::from(size[0]) * u64::from(size[1]);
                let streams = integrator.streams(&settings.integrators);
                let request = TracerRequest { needs, streams, rays, control: &mut *control, warnings: &mut warnings };
                let tracer = request.build(&device, kind, &flat, compute, &self.settings)?;
                ReadyTracer { tracer, blend: flat.blend, needs }
            }
        };
        let tracer = &ready.tracer;
        let record = shot.camera_record(&flat);
        let tile_mask = match integrator.skips_empty_tiles(&shot) {
            true => TileMask::new(&flat, &record, size, shot.spp).map(Arc::new),
            false => None,
        };

        // first, because what is saved on the way has them, too
        let aov_start = Instant::now();
        let pixels = match wanted.is_empty() && !extras.aov {
            true => Vec::new(),
            false => aov::render(tracer, &record, size, control)?,
        };
        let aov_seconds = aov_start.elapsed().as_secs_f64();
        let path_options = integrator.path_options(&shot)?;
        let denoising = denoiser
            .as_ref()
            .zip(path_options.as_ref())
            .map(|(chosen, options)| Denoising::new(chosen, denoise::DenoiseInput { tracer, scene, camera: &record, options }));
        let composer = Composer {
            name: &self.name,
            integrator,
            size,
            pixels: &pixels,
            aov: wanted,
            origin: flat.origin,
            identity: &identity,
            maker: &maker,
            target_rmse: settings.film.target_rmse,
            denoising: denoising.as_ref(),
        };
        let picture = settings.picture.options();
        let mut on_way = OnWay {
            control: &mut *control,
            save: &mut |accumulated, control| {
                let image = composer.image(accumulated, control)?;
                save(&Interval { image: &image, samples: accumulated.max_spp, integrator, picture })
            },
        };
        let rendered = integrator.render(tracer, &flat, &shot, tile_mask, &mut on_way)?;
        device.check_validation()?;
        let image = composer.image(&rendered.image, control)?;
        device.check_validation()?;
        let mut rays = rendered.kept_rays;
        for rays in &mut rays {
            // in the scene's world, as its exported mesh is
            crate::ray::translate(rays, flat.origin);
        }
        for warning in &rendered.report.warnings {
            control.warning(warning);
            warnings.push(warning.clone());
        }
        let (mean, mean_standard_error) = rendered.image.film.mean_and_error();
        let report = StillReport {
            setup: Setup::new(self, tracer, &flat, camera_text(&camera), warnings),
            integrator: integrator.name(),
            quantity: integrator.quantity(),
            size,
            spp: rendered.image.spp,
            most_spp: rendered.image.max_spp,
            wanted_spp: shot.spp,
            seed: shot.seed,
            stopped_early: rendered.image.stopped_early,
            mean,
            mean_standard_error,
            film: FilmReport::new(&settings.film, &scene.hints, &rendered.image, samples_before, shot.spp),
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
        Ok(Still { image, aov: pixels, rays, report, integrator, picture })
    }
}

/// What the loader of a scene warns of, a sentence each.
pub(super) fn scene_warnings(scene: &crate::scene::Scene) -> Vec<String> {
    let report = &scene.report;
    let dropped =
        (report.degenerate_triangles > 0).then(|| format!("dropped {} degenerate triangles", report.degenerate_triangles));
    report.warnings.iter().cloned().chain(dropped).collect()
}

/// A camera in words.
pub fn camera_text(camera: &Camera) -> String {
    let m = &camera.camera_to_world;
    let lens = match camera.projection {
        Projection::Perspective { fov_y } => format!("perspective, fov_y {} degrees", fov_y.to_degrees()),
        Projection::Orthographic { half_height } => format!("orthographic, half height {half_height}"),
    };
    format!("{:?} eye {}, forward {}, up {}; {lens}", camera.name, m.translation, -m.matrix3.z_axis, m.matrix3.y_axis)
}

/// What has to agree when an image is gone on with: all that its samples depend on, but for its size. `print`: the scene's fingerprint, where the film
/// is kept.
fn identity(integrator: &dyn Integrator, shot: &Shot, print: Option<String>) -> Identity {
    let environment = || fingerprint::of_environment(&shot.scene.environment);
    let around = print.as_ref().filter(|_| integrator.sees_environment()).map(|_| environment());
    let mut out = vec![
        ("version", Some(env!("CARGO_PKG_VERSION").into())),
        ("integrator", Some(integrator.name().to_owned())),
        ("scene.hash", print),
        ("environment.hash", around),
        ("camera", Some(camera_text(shot.camera))),
        ("seed", Some(shot.seed.to_string())),
    ];
    out.extend(integrator.identity(shot));
    out
}

/// Samples at which the image is saved on its way. A scene names some of its own.
pub fn intervals(settings: &RenderSettings, hints: &RenderHints, spp: u32) -> Vec<u32> {
    let mut intervals: Vec<u32> = match settings.film.intervals {
        true => (0..u32::BITS).map(|k| 1 << k).chain(hints.save_intervals.iter().copied()).collect(),
        false => Vec::new(),
    };
    intervals.retain(|&n| n > 0 && n < spp);
    intervals.sort_unstable();
    intervals.dedup();
    intervals
}

/// Samples per pixel: the fewest and the most.
pub(super) fn spp_text(least: u32, most: u32) -> String {
    if least == most { most.to_string() } else { format!("{least} to {most}") }
}

/// Makes images of films.
struct Composer<'a> {
    name: &'a str,
    integrator: &'static dyn Integrator,
    size: [u32; 2],
    pixels: &'a [AovPixel],
    aov: &'a [Aov],
    origin: DVec3,
    identity: &'a Identity,
    maker: &'a Maker,
    target_rmse: Option<f64>,
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

    /// The film as named channels: means, coverage, of each channel the variance of one sample, and the film's sums, if it is to go on.
    fn channels(&self, image: &Accumulated) -> Vec<Channel> {
        let (film, names) = (&image.film, self.integrator.channels());
        let f32s = |name: String, samples| Channel { name, samples: Samples::F32(samples) };
        let mut out: Vec<_> = names.iter().enumerate().map(|(c, n)| f32s((*n).into(), film.plane(c))).collect();
        out.push(f32s("A".into(), film.coverage.clone()));
        for (c, name) in names.iter().enumerate() {
            let name = if names.len() == 1 { "variance".into() } else { format!("variance.{name}") };
            out.push(f32s(name, film.variance_plane(c)));
        }
        out.push(Channel { name: "samples".into(), samples: Samples::U32(film.samples.clone()) });
        out.extend(image.state.iter().flat_map(|s| film_file::state_channels(s, names)));
        out
    }

    /// Text attributes. Nothing in it differs between two runs of the same command.
    fn metadata(&self, image: &Accumulated) -> Vec<(String, String)> {
        let mut out = vec![("scene", self.name.to_owned()), ("spp", spp_text(image.spp, image.max_spp))];
        out.extend(self.maker.iter().cloned());
        out.extend(self.identity.iter().filter_map(|(key, value)| Some((*key, value.clone()?))));
        if let Some(target) = self.target_rmse {
            out.push(("target_rmse", target.to_string()));
        }
        out.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

/// Saves an image on its way.
struct OnWay<'a> {
    control: &'a mut dyn Control,
    save: &'a mut dyn FnMut(&Accumulated, &mut dyn Control) -> Result<()>,
}

impl Control for OnWay<'_> {
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

/// Needs of the tracer that auxiliary outputs have.
pub(super) fn aov_needs(needs: Needs, wanted: &[Aov]) -> Needs {
    Needs { normals: needs.normals || Aov::Ns.among(wanted), albedo: needs.albedo || Aov::Albedo.among(wanted), ..needs }
}
