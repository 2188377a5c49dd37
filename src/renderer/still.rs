//! Stills: one image, rendered sample by sample.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;

use super::brightness;
use super::complete::{CHOSEN, Completed, SCENE_OPTIONS};
use super::denoising::{self, Denoising};
use super::film_file::{self, Identity, RenderedBy};
use super::laps::{self, Laps};
use super::report::{FilmReport, Seconds, Setup, StillReport};
use super::{ReadyTracer, RenderSettings, Renderer, TracerRequest, camera_numbers};
use crate::accel::flatten::FlatScene;
use crate::denoise;
use crate::error::{Error, Result};
use crate::files;
use crate::film::Control;
use crate::film::accumulate::Accumulated;
use crate::film::camera::CameraRecord;
use crate::film::display::DisplayTarget;
use crate::film::schedule::FilmOptions;
use crate::integrators::aov::{self, Aov, AovPixel};
use crate::integrators::lighting::LightingSettings;
use crate::integrators::{Integrator, IntegratorReport, PictureOptions, RenderJob, Rendered};
use crate::output::settings::Background;
use crate::output::{self, Channel, FileSettings, Image, ImageFormat, Picture, picture};
use crate::ray::Ray;
use crate::scene::{Camera, Motion, Projection, RenderHints, fingerprint};
use crate::settings::Capability;
use crate::stage;
use crate::tracer::{Needs, Tracer};

/// Additional results of a still.
#[derive(Clone, Copy, Debug, Default)]
pub struct StillExtras {
    /// Keep the rays of the first sample.
    pub keep_rays: bool,
    /// Render auxiliary outputs even if settings name none, for a depth image.
    pub aov: bool,
    /// Make intermediate images at powers of two of samples whatever the settings, for viewers.
    pub intermediate: bool,
    /// Pictures have no exposure but that of the settings: for frames of a sequence, which must not
    /// differ in brightness.
    pub fixed_exposure: bool,
}

/// A finished still image.
pub struct Still {
    /// All channels and the metadata.
    pub image: Image,
    /// Auxiliary outputs, rows from the top, if requested.
    pub aov: Vec<AovPixel>,
    /// World-space camera and occlusion rays of the first sample, with [`StillExtras::keep_rays`].
    pub rays: [Vec<Ray>; 2],
    /// The report of the render.
    pub report: StillReport,
    integrator: &'static dyn Integrator,
    picture: PictureOptions,
    background: Option<Background>,
}

impl Still {
    /// As [`Still::save_with`], errors included, with default settings of the file.
    pub fn save(&self, path: &Path) -> Result<()> {
        self.save_with(path, &FileSettings::default())
    }

    /// Writes the image in the format of the extension; settings of other formats are ignored.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown format, or settings that it lacks; [`Error::Output`].
    pub fn save_with(&self, path: &Path, files: &FileSettings) -> Result<()> {
        save(&self.image, self.integrator, &self.picture, self.background, files, path)
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
    background: Option<Background>,
}

impl IntermediateImage<'_> {
    /// Writes the image as [`Still::save_with`] does, errors included.
    pub fn save_with(&self, path: &Path, files: &FileSettings) -> Result<()> {
        save(self.image, self.integrator, &self.picture, self.background, files, path)
    }
}

fn save(
    image: &Image,
    integrator: &dyn Integrator,
    options: &PictureOptions,
    background: Option<Background>,
    files: &FileSettings,
    path: &Path,
) -> Result<()> {
    let format = ImageFormat::from_path(path)?;
    if format == ImageFormat::Exr {
        return output::exr::write_with(image, path, &files.into());
    }
    let mut shown = match background {
        // the scene on black, as it is in the image
        None => integrator.picture(image, options),
        // the scene without its alpha, since displayed colours are not in proportion to linear ones
        Some(_) => integrator.picture(&picture::unassociated(image), options),
    };
    let alpha = image.channels.iter().find(|c| c.name == "A").filter(|_| shown.f32("A").is_none());
    shown.channels.extend(alpha.cloned());
    let of_others = FileSettings::default();
    let settings = if format == ImageFormat::Png { files } else { &of_others };
    Picture::new(&shown, background, settings, path)?.save(path, files.jpeg_quality())
}

impl Renderer {
    /// Renders a still.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings that do not fit; those of the device and of `control`.
    pub fn still(&mut self, settings: &RenderSettings, control: &mut dyn Control) -> Result<Still> {
        self.still_with(settings, StillExtras::default(), control, &mut |_| Ok(()))
    }

    /// As [`Renderer::still`]; `save`, whose errors are returned, receives intermediate images, at
    /// the numbers of samples that [`super::settings::FilmSettings::intervals`] selects.
    pub fn still_with(
        &mut self,
        settings: &RenderSettings,
        extras: StillExtras,
        control: &mut dyn Control,
        save: &mut dyn FnMut(&IntermediateImage) -> Result<()>,
    ) -> Result<Still> {
        settings.check()?;
        if let Some(frames) = settings.frames.given().first() {
            return Err(Error::Usage(format!(
                "{} is for frames, and a still is rendered: leave it out",
                frames.option()
            )));
        }
        let start = Instant::now();
        let mut laps = Laps::after_open(self.open_seconds.wall);
        let completed = self.complete(settings, None)?;
        laps.lap(laps::SURVEY);
        self.still_of(&completed, extras, (start, laps), control, save)
    }

    /// Renders a still of completed settings. `started`: begin of the work, and its parts so far.
    pub(super) fn still_of(
        &mut self,
        completed: &Completed,
        extras: StillExtras,
        started: (Instant, Laps),
        control: &mut dyn Control,
        save: &mut dyn FnMut(&IntermediateImage) -> Result<()>,
    ) -> Result<Still> {
        let (start, mut laps) = started;
        let denoiser = denoising::choose(completed.settings.image.denoise)?;
        let ready = self.tracer.take();
        let mut render = StillRender::new(self, completed, extras);
        render.warnings.iter().for_each(|w| control.warning(w));

        // the film: empty, or that of the image that is resumed
        render.resume(control)?;

        // the scene in device memory, and what of the image can show it
        let preparing = stage::begin("preparing the scene");
        let flat = FlatScene::with_motion_and_blend(&self.scene, Motion::default(), render.integrator.blend())?;
        drop(preparing);
        laps.lap("prepare");
        let ready = render.build(ready, &flat, denoiser.is_some(), control)?;
        let tracer = &ready.tracer;
        laps.lap("build");
        let camera = render.job.camera_record(&flat);
        render.job.samples.tile_mask = render.job.tile_mask(render.integrator, &flat, &camera);
        laps.lap("prepare");

        // auxiliary outputs and denoiser first, because intermediate images contain them, too
        let aov_start = Instant::now();
        let pixels = render.trace_aov(tracer, &camera, control)?;
        let aov_seconds = aov_start.elapsed().as_secs_f64();
        laps.lap("aov");
        let denoise_options = render.integrator.denoise_options(&render.job)?;
        let denoising = denoiser.as_ref().zip(denoise_options.as_ref()).map(|(chosen, options)| {
            let input = denoise::DenoiseInput { tracer, scene: flat.scene, camera: &camera, options };
            Denoising::new(chosen, input, render.integrator.channels())
        });

        // the samples, and the image of them
        let composer =
            Composer { render: &render, pixels: &pixels, origin: flat.origin, denoising: denoising.as_ref() };
        let rendered = render.trace(tracer, &flat, &composer, control, save)?;
        laps.lap("trace");
        let image = composer.compose(&rendered.image, control)?;
        laps.lap(if denoising.is_some() { "denoise" } else { "film" });
        self.device.check_validation()?;
        let Rendered { image: accumulated, report: details, kept_rays: mut rays } = rendered;
        for rays in &mut rays {
            // to world space, as exported meshes are
            crate::ray::translate(rays, flat.origin);
        }

        // what there is to say about it
        let (integrator, picture) = (render.integrator, render.picture_options(&accumulated));
        let mut report = render.report(tracer, &flat, &accumulated, details, control);
        report.denoise = denoising.as_ref().map(Denoising::report);
        report.seconds.aov = aov_seconds;
        report.seconds.render = start.elapsed().as_secs_f64();
        drop(denoising);

        // what later images can use
        self.tracer = Some(ready);
        self.keep_pipelines();
        laps.lap("film");
        report.seconds.parts = laps.into_parts();
        let background = completed.settings.backdrop().of_pictures();
        Ok(Still { image, aov: pixels, rays, report, integrator, picture, background })
    }
}

/// A still in progress: what its steps have in common.
struct StillRender<'a> {
    renderer: &'a Renderer,
    completed: &'a Completed,
    extras: StillExtras,
    integrator: &'static dyn Integrator,
    job: RenderJob<'a>,
    identity: Identity,
    rendered_by: RenderedBy,
    /// Options that the scene decided, as text.
    chosen: Option<String>,
    /// Samples per pixel of the image that is resumed.
    samples_before: Option<u32>,
    warnings: Vec<String>,
}

impl<'a> StillRender<'a> {
    fn new(renderer: &'a Renderer, completed: &'a Completed, extras: StillExtras) -> Self {
        let Completed { camera, settings, .. } = completed;
        let (scene, info) = (&renderer.scene, &renderer.device.info);
        let integrator = settings.integrator().get();
        let mut job = settings.job(scene, camera);
        job.samples.keep_rays = extras.keep_rays;
        job.samples.film.keep_state = settings.film.keeps_state();
        let fingerprint = settings.film.keeps_state().then(|| fingerprint::of_scene(scene));
        let mut warnings = scene.report.all_warnings();
        let shows_materials =
            integrator.capabilities().contains(&Capability::Textures) || !settings.image.aov.is_empty();
        if !settings.scene.material.is_empty() && !shows_materials {
            warnings.push(format!(
                "--material changes nothing that --integrator {} shows: leave it out, or use --integrator path",
                integrator.name()
            ));
        }
        Self {
            renderer,
            completed,
            extras,
            integrator,
            identity: identity(integrator, &job, fingerprint),
            job,
            rendered_by: [
                ("tracer", renderer.kind.name().into()),
                ("device", format!("{} ({})", info.name, info.driver)),
            ],
            chosen: completed.options(),
            samples_before: None,
            warnings,
        }
    }

    /// Reads the film that is resumed, if any, and says when the film is saved.
    fn resume(&mut self, control: &mut dyn Control) -> Result<()> {
        let (settings, job) = (&self.completed.settings, &mut self.job);
        let (name, channels) = (&self.renderer.name, self.integrator.channels());
        let resume = |path| {
            film_file::resume(
                path,
                name,
                channels,
                job.samples.size,
                job.samples.spp,
                &self.identity,
                &self.rendered_by,
            )
        };
        let resumed = settings.film.resume.as_deref().map(resume).transpose()?;
        self.samples_before = resumed.as_ref().map(|r| r.state.max_samples());
        if let Some(warning) = resumed.as_ref().and_then(|r| r.warning.clone()) {
            control.warning(&warning);
            self.warnings.push(warning);
        }
        let display_target = self.display_target();
        let job = &mut self.job;
        job.samples.film = FilmOptions {
            start: resumed.map(|r| r.state.into()),
            keep_state: settings.film.keeps_state(),
            intervals: stops(settings, self.extras, &job.scene.hints, job.samples.spp),
            target_rmse: settings.film.target_rmse,
            display_target,
        };
        Ok(())
    }

    /// The error that displayed tiles may have, if a quality was chosen.
    fn display_target(&self) -> Option<DisplayTarget> {
        let PictureOptions { tone_map, exposure } = self.completed.settings.picture.options();
        self.completed.settings.film.quality.map(|quality| DisplayTarget {
            error: quality.error(),
            tone_map,
            exposure: exposure.into(),
            exposure_of_film: self.chooses_exposure().then_some(brightness::film_exposure),
        })
    }

    /// Builds the tracer, unless the one at hand has the same scene data.
    fn build(
        &mut self,
        ready: Option<ReadyTracer>,
        flat: &FlatScene,
        is_denoised: bool,
        control: &mut dyn Control,
    ) -> Result<ReadyTracer> {
        let Renderer { device, kind, compute, settings: device_settings, .. } = self.renderer;
        let settings = &self.completed.settings;
        let needs = aov_needs(self.integrator.needs(&settings.integrators), &settings.image.aov);
        let request = TracerRequest {
            // the normals that tell surfaces apart
            needs: Needs { normals: needs.normals || is_denoised, ..needs },
            streams: self.integrator.streams(&settings.integrators),
            rays: self.integrator.rays_per_sample() * self.job.samples.count(),
            camera: Some(&self.completed.camera),
            control,
            warnings: &mut self.warnings,
        };
        request.reuse_or_build(ready, device, *kind, flat, *compute, device_settings)
    }

    /// Traces auxiliary outputs, if any are wanted.
    fn trace_aov(&self, tracer: &Tracer, camera: &CameraRecord, control: &mut dyn Control) -> Result<Vec<AovPixel>> {
        if self.completed.settings.image.aov.is_empty() && !self.extras.aov {
            return Ok(Vec::new());
        }
        aov::render(tracer, camera, self.job.samples.size, control)
    }

    /// Traces all samples; `save` receives intermediate images.
    fn trace(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        composer: &Composer,
        control: &mut dyn Control,
        save: &mut dyn FnMut(&IntermediateImage) -> Result<()>,
    ) -> Result<Rendered> {
        let integrator = self.integrator;
        let mut interval_control = IntervalControl {
            control,
            save: &mut |accumulated, control| {
                let image = composer.compose(accumulated, control)?;
                let picture = self.picture_options(accumulated);
                let samples = accumulated.max_spp;
                let background = self.completed.settings.backdrop().of_pictures();
                save(&IntermediateImage { image: &image, samples, integrator, picture, background })
            },
        };
        let rendered = integrator.render(tracer, flat, &self.job, &mut interval_control)?;
        self.renderer.device.check_validation()?;
        Ok(rendered)
    }

    /// How pictures of an image show it. Without an exposure in the settings there is one where the
    /// scene's own light is far from what a display shows.
    fn picture_options(&self, image: &Accumulated) -> PictureOptions {
        let options = self.completed.settings.picture.options();
        self.chosen_exposure(image).map_or(options, |stops| PictureOptions { exposure: stops as f32, ..options })
    }

    /// The exposure that is chosen for the scene's own light, in stops; `None` for that of the
    /// settings.
    fn chosen_exposure(&self, image: &Accumulated) -> Option<f64> {
        self.chooses_exposure().then(|| brightness::film_exposure(&image.film)).flatten()
    }

    /// Returns true if the exposure is open, and the image shows the scene's own light.
    fn chooses_exposure(&self) -> bool {
        let settings = &self.completed.settings;
        let shows_own_light = self.integrator.capabilities().contains(&Capability::SceneLights)
            && settings.lighting == LightingSettings::default()
            && !self.renderer.lighting.is_automatic;
        let is_open = settings.picture.exposure.is_none() && !self.extras.fixed_exposure;
        shows_own_light && is_open
    }

    /// Writes the report, and hands the warnings about the image to `control`.
    fn report(
        mut self,
        tracer: &Tracer,
        flat: &FlatScene,
        image: &Accumulated,
        details: IntegratorReport,
        control: &mut dyn Control,
    ) -> StillReport {
        let Completed { camera, settings, choices, .. } = self.completed;
        let (integrator, job) = (self.integrator, &self.job);

        // warnings, of which those about brightness can be switched off
        let surface_mean = brightness::surface_mean(image, integrator.channels().len());
        let chosen_exposure = self.chosen_exposure(image);
        let exposure = f64::from(settings.picture.options().exposure);
        let chosen_exposure = chosen_exposure.map(|stops| {
            format!("exposure of pictures: {stops:+} stops, for the light of the scene is far from a display's (--exposure {stops}); --exposure 0 shows it as it is")
        });
        // an exposure that was chosen for the image needs no other
        let brightness = surface_mean
            .filter(|_| chosen_exposure.is_none())
            .and_then(|mean| brightness::warning(mean, integrator.capabilities(), exposure));
        details.warnings.iter().for_each(|w| control.warning(w));
        brightness.iter().for_each(|w| control.brightness(w));
        self.warnings.extend(details.warnings.iter().chain(&brightness).cloned());

        let (mean, mean_standard_error) = image.film.mean_and_error();
        let compute = tracer.compute_options();
        let choices = (choices.iter().cloned().chain(chosen_exposure).collect(), self.chosen);
        StillReport {
            setup: Setup::new(self.renderer, tracer, flat, camera, choices, &settings.scene, self.warnings),
            integrator: integrator.name(),
            quantity: integrator.quantity(),
            size: job.samples.size,
            spp: image.spp,
            most_spp: image.max_spp,
            requested_spp: job.samples.spp,
            seed: job.samples.seed,
            stopped_early: image.stopped_early,
            mean,
            mean_standard_error,
            surface_mean,
            film: FilmReport::new(&settings.film, &job.scene.hints, image, self.samples_before, job.samples.spp),
            compute,
            coherent_kernel: compute.map(|o| o.kernel.for_coherent(&self.renderer.device.info)),
            primary_rays: image.primary_rays,
            skipped_primary_rays: image.skipped_primary_rays,
            device_seconds: image.device_seconds.clone(),
            longest_launch: image.longest_launch,
            details,
            denoise: None,
            seconds: Seconds { trace: image.trace_seconds, ..Seconds::default() },
        }
    }
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

/// All that must agree to resume a render. `scene`: its fingerprint, if the state is kept.
pub(super) fn identity(integrator: &dyn Integrator, job: &RenderJob, scene: Option<String>) -> Identity {
    let has_environment = scene.is_some() && integrator.sees_environment();
    let environment = has_environment.then(|| fingerprint::of_environment(&job.scene.environment));
    let mut out = vec![
        ("version", Some(env!("CARGO_PKG_VERSION").into())),
        ("integrator", Some(integrator.name().to_owned())),
        ("scene.hash", scene),
        ("environment.hash", environment),
        ("camera", Some(camera_text(job.camera))),
        ("seed", Some(job.samples.seed.to_string())),
    ];
    out.extend(integrator.identity(job));
    out
}

/// Numbers of samples of intermediate images: powers of two, and those that the scene names.
pub fn intervals(settings: &RenderSettings, hints: &RenderHints, spp: u32) -> Vec<u32> {
    if !settings.film.intervals {
        return Vec::new();
    }
    let mut intervals: Vec<u32> = powers_of_two(spp).chain(hints.save_intervals.iter().copied()).collect();
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
    render: &'a StillRender<'a>,
    /// Auxiliary outputs.
    pixels: &'a [AovPixel],
    origin: DVec3,
    denoising: Option<&'a Denoising<'a>>,
}

impl Composer<'_> {
    /// Composes the image of a film: channels, denoised if wanted, auxiliary outputs and metadata.
    fn compose(&self, accumulated: &Accumulated, control: &mut dyn Control) -> Result<Image> {
        let mut channels = self.channels(accumulated);
        let mut metadata = self.metadata(accumulated);
        if let Some(denoising) = self.denoising {
            channels = denoising.channels(accumulated, channels, control)?;
            metadata.push(("denoise".into(), denoising.name().into()));
        }
        channels.extend(aov::channels(&self.render.completed.settings.image.aov, self.pixels, self.origin));
        let [width, height] = self.render.job.samples.size;
        Ok(Image { width, height, channels, metadata })
    }

    /// The film as named channels: means, coverage, the variance of a sample, and sums if kept.
    fn channels(&self, image: &Accumulated) -> Vec<Channel> {
        let (film, names) = (&image.film, self.render.integrator.channels());
        let mean = |(c, name): (usize, &&str)| Channel::from_floats(*name, film.plane(c));
        let mut out: Vec<_> = names.iter().enumerate().map(mean).collect();
        out.push(Channel::from_floats("A", film.coverage.clone()));
        for (c, name) in names.iter().enumerate() {
            let name = if names.len() == 1 { "variance".to_owned() } else { format!("variance.{name}") };
            out.push(Channel::from_floats(name, film.variance_plane(c)));
        }
        // exact, as there are at most 2^24; frames in real time have fractions of samples
        out.push(Channel::from_floats("samples", film.samples.iter().map(|n| *n as f32).collect()));
        out.extend(image.state.iter().flat_map(|s| film_file::state_channels(s, names)));
        out
    }

    /// Text attributes. They are identical for two runs of the same command.
    fn metadata(&self, image: &Accumulated) -> Vec<(String, String)> {
        let StillRender { renderer, completed, job, .. } = self.render;
        let mut out =
            vec![("scene", files::portable_name(&renderer.name)), ("spp", spp_text(image.spp, image.max_spp))];
        let options = renderer.scene_options(&completed.settings.scene);
        out.extend(options.map(|options| (SCENE_OPTIONS, options)));
        out.extend(camera_numbers::metadata(job.camera, job.aspect()));
        out.extend(self.render.rendered_by.iter().cloned());
        out.extend(self.render.identity.iter().filter_map(|(key, value)| Some((*key, value.clone()?))));
        if let Some(target) = completed.settings.film.target_rmse {
            out.push(("target_rmse", target.to_string()));
        }
        if let Some(quality) = completed.settings.film.quality {
            out.push(("quality", quality.to_string()));
        }
        out.extend(self.render.chosen.clone().map(|options| (CHOSEN, options)));
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
    Needs {
        normals: needs.normals || Aov::Ns.is_in(wanted),
        albedo: needs.albedo || Aov::Albedo.is_in(wanted),
        ..needs
    }
}
