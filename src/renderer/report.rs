//! Reports of a render: lines for people, a JSON record for programs.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::denoising::DenoiseReport;
use super::quality::QualityReport;
use super::settings::FilmSettings;
use super::still::{camera_text, spp_text};
use super::survey::significant;
use super::{Renderer, camera_numbers};
use crate::accel::flatten::FlatScene;
use crate::film::accumulate::Accumulated;
use crate::gpu::Timing;
use crate::integrators::{IntegratorName, IntegratorReport};
use crate::measure::stats::{Summary, percentile};
use crate::raster::Primary;
use crate::realtime::{FrameStats, Preset, Settings};
use crate::scene::{Camera, RenderHints, SceneSettings};
use crate::settings::Capability;
use crate::tracer::{BuildStats, ComputeOptions, Kernel, Tracer, TracerKind};

/// Seconds of a run. Its parts add up to the total; the others lie within them, and may overlap.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Seconds {
    /// Loading the scene.
    pub load: f64,
    /// Starting the device.
    pub device: f64,
    /// Tracing.
    pub trace: f64,
    /// Auxiliary outputs.
    pub aov: f64,
    /// Rendering of a still: building, tracing, denoising.
    pub render: f64,
    /// Writing files.
    pub write: f64,
    /// The whole run.
    pub total: f64,
    /// The parts of the run, one after another.
    #[serde(serialize_with = "as_map")]
    pub parts: Vec<(&'static str, f64)>,
}

fn as_map<S: serde::Serializer>(parts: &[(&'static str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(parts.iter().copied())
}

impl Seconds {
    /// Ends the run of `total` seconds with `write` seconds of files; the part `other` is the rest.
    pub fn finish(&mut self, write: f64, total: f64) {
        (self.write, self.total) = (write, total);
        self.parts.push(("write", write));
        let named: f64 = self.parts.iter().map(|p| p.1).sum();
        self.parts.push(("other", (total - named).max(0.0)));
    }
}

/// The scene, device and tracer of an image.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The scene as named by the user.
    pub scene: String,
    /// The options by which it was loaded and understood; `None`: the defaults
    /// ([`Renderer::scene_options`]).
    pub scene_options: Option<String>,
    /// Triangles over all instances.
    pub triangles: u64,
    /// Spheres over all instances.
    pub spheres: u64,
    /// Degenerate triangles that were dropped when the scene was loaded.
    pub degenerate_triangles: usize,
    /// The camera in words.
    pub camera: String,
    /// Choices that settings left to the scene, a sentence each.
    pub choices: Vec<String>,
    /// These choices as options of `skylit render`; `None` if nothing was left open.
    pub chosen: Option<String>,
    /// The camera in numbers ([`camera_numbers::pose`]).
    pub camera_pose: Value,
    /// Name of the device.
    pub device: String,
    /// Name of the driver.
    pub driver: String,
    /// The tracer.
    pub tracer: TracerKind,
    /// Why the tracer was chosen.
    pub tracer_reason: String,
    /// Statistics of the acceleration structure's build.
    pub stats: BuildStats,
    /// Sentences about shader features that the scene does not require.
    pub features: Vec<String>,
    /// Warnings for the user, a sentence each.
    pub warnings: Vec<String>,
    /// Seconds of loading the scene and starting the device.
    pub open: super::OpenSeconds,
    /// The scene's file requests a depth image.
    pub wants_depth_image: bool,
}

impl Setup {
    pub(super) fn new(
        renderer: &Renderer,
        tracer: &Tracer,
        flat: &FlatScene,
        camera: &Camera,
        (choices, chosen): (Vec<String>, Option<String>),
        settings: &SceneSettings,
        warnings: Vec<String>,
    ) -> Self {
        let (scene, info, stats) = (flat.scene, &renderer.device.info, tracer.stats());
        let mut features = tracer.features().explain(flat);
        if stats.areas > 0 {
            let (areas, primitives) = (stats.areas, stats.area_primitives);
            features.push(format!("{areas} influence areas, whose trees hold {primitives} primitives"));
        }
        features.extend(stats.on_device.text());
        Self {
            scene: renderer.name.clone(),
            scene_options: renderer.scene_options(settings),
            triangles: scene.triangle_count(),
            spheres: scene.sphere_count(),
            degenerate_triangles: scene.report.degenerate_triangles,
            camera: camera_text(camera),
            camera_pose: camera_numbers::pose(camera),
            choices,
            chosen,
            device: info.name.clone(),
            driver: info.driver.clone(),
            tracer: renderer.kind,
            tracer_reason: renderer.kind_reason.clone(),
            stats,
            features,
            warnings,
            open: renderer.open_seconds,
            wants_depth_image: scene.hints.depth_image,
        }
    }

    fn record(&self, seconds: &Seconds) -> Map<String, Value> {
        let mut record = json!({
            "scene": self.scene,
            "scene_options": self.scene_options,
            "triangles": self.triangles,
            "spheres": self.spheres,
            "degenerate_triangles": self.degenerate_triangles,
            "camera": self.camera,
            "choices": self.choices,
            "chosen": self.chosen,
            "camera_pose": self.camera_pose,
            "device": self.device,
            "driver": self.driver,
            "tracer": self.tracer,
            "tracer_reason": self.tracer_reason,
            "warnings": self.warnings,
            "build": {
                "structure_bytes": self.stats.structure_bytes,
                "scene_bytes": self.stats.scene_bytes,
                "bytes_per_primitive": self.stats.bytes_per_primitive(),
                "stack_entries": self.stats.stack_entries,
                "areas": self.stats.areas,
                "area_primitives": self.stats.area_primitives,
                "on_device": self.stats.on_device,
            },
            "seconds": seconds,
        });
        record["seconds"]["load"] = json!(self.open.load);
        record["seconds"]["device"] = json!(self.open.device);
        record["seconds"]["build"] = json!(self.stats.build_seconds);
        record["seconds"]["upload"] = json!(self.stats.upload_seconds);
        record.as_object().cloned().unwrap_or_default()
    }

    /// The outcome of what settings left to the scene, as options to append to a line.
    fn chosen_text(&self) -> String {
        self.chosen.as_ref().map_or_else(String::new, |options| format!("; chosen: {options}"))
    }

    /// The parts of the run that took half a millisecond or more.
    fn seconds_line(&self, seconds: &Seconds) -> String {
        let parts = seconds.parts.iter().filter(|p| p.1 >= 0.000_5).map(|&(name, s)| match name {
            "open" => {
                format!("open {s:.3} (load {:.3} while the device starts in {:.3})", self.open.load, self.open.device)
            }
            _ => format!("{name} {s:.3}"),
        });
        format!("{:.3} seconds: {}", seconds.total, parts.collect::<Vec<_>>().join(", "))
    }
}

/// The report of a film: its estimated error and its numbers of samples.
#[derive(Clone, Debug)]
pub struct FilmReport {
    lines: Vec<String>,
    /// How large the error of pixels is, in a line; `None` if the film does not know.
    error: Option<String>,
    explanations: Vec<String>,
    record: Value,
}

impl FilmReport {
    /// The report of a film of at most `spp` samples per pixel, which had `before` when resumed.
    pub(super) fn new(
        options: &FilmSettings,
        hints: &RenderHints,
        image: &Accumulated,
        before: Option<u32>,
        spp: u32,
    ) -> Self {
        let (min, mean, max) = image.film.samples_range();
        let estimated = image.film.estimated_rmse();

        // how exact the image is: by what bounds its error, else by the variance of samples
        let mut errors = Vec::new();
        if let (Some(tiles), Some(target)) = (image.converged, options.target_rmse) {
            errors.push(format!(
                "estimated rmse {} (target {}): {} of {} tiles done; {min} to {max} samples per pixel, {mean:.1} on average",
                significant(estimated, 3),
                significant(target, 3),
                tiles.done,
                tiles.all
            ));
        }
        let quality = options.quality.and_then(|quality| QualityReport::new(quality, image));
        errors.extend(quality.iter().flat_map(QualityReport::lines));
        let estimate = (estimated.is_finite() && estimated > 0.0)
            .then(|| format!("estimated rmse {} of a pixel", significant(estimated, 3)));
        let error = errors.first().cloned().or(estimate);

        // all lines, and the record
        let mut lines = Vec::new();
        if let (Some(before), Some(path)) = (before, &options.resume) {
            lines.push(format!("resumed {} from {before} samples per pixel", path.display()));
        }
        lines.extend(errors);
        if !options.intervals && hints.save_intervals.iter().any(|&n| n < spp) {
            lines.push("the scene requests intermediate images: add --intervals".into());
        }
        let record = json!({
            "samples": { "min": min, "mean": mean, "max": max },
            "estimated_rmse": estimated,
            "target_rmse": options.target_rmse,
            "quality": quality.as_ref().map(QualityReport::record),
            "tiles": image.converged,
            "resumed": options.resume.as_ref().map(|path| path.to_string_lossy()),
            "samples_before": before,
        });
        let explanations = quality.map(|q| q.explanations()).unwrap_or_default();
        Self { lines, error, explanations, record }
    }
}

/// A standard error behind its value; empty without an estimate, as with one sample per pixel.
fn error_text(error: f64) -> String {
    match error {
        e if e >= 0.000_1 => format!(" +- {e:.5}"),
        e if e > 0.0 => format!(" +- {e:.0e}"),
        _ => String::new(),
    }
}

/// The report of a still.
#[derive(Clone, Debug)]
pub struct StillReport {
    /// Scene, device and tracer.
    pub setup: Setup,
    /// Name of the integrator.
    pub integrator: &'static str,
    /// Name of the quantity that `mean` is the mean of.
    pub quantity: &'static str,
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Minimum number of samples per pixel.
    pub spp: u32,
    /// Maximum number of samples per pixel.
    pub most_spp: u32,
    /// Requested number of samples per pixel.
    pub requested_spp: u32,
    /// Seed of the sampler.
    pub seed: u32,
    /// The image has fewer samples than requested.
    pub stopped_early: bool,
    /// Mean over all pixels and channels; background without an environment counts 0.
    pub mean: f64,
    /// Standard error of the mean, from the variances of pixels.
    pub mean_standard_error: f64,
    /// Mean of the pixels that show surfaces alone, luminance for colours; `None` without any.
    pub surface_mean: Option<f64>,
    /// Report of the film.
    pub film: FilmReport,
    /// Options of the compute tracer, if it was used.
    pub compute: Option<ComputeOptions>,
    /// The compute tracer's kernel for camera rays, if it was used.
    pub coherent_kernel: Option<Kernel>,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Camera rays not traced because their tile of the image shows no geometry.
    pub skipped_primary_rays: u64,
    /// Device seconds of each step of each pass.
    pub device_seconds: Vec<(&'static str, f64)>,
    /// Device seconds of the longest launch.
    pub longest_launch: f64,
    /// Report of the integrator.
    pub details: IntegratorReport,
    /// Report of the denoiser, if one was used.
    pub denoise: Option<DenoiseReport>,
    /// Seconds of each part of the run.
    pub seconds: Seconds,
}

impl StillReport {
    /// At most three lines for people: what was rendered, how long it took, how exact it is.
    /// `outputs` names the image files.
    pub fn summary(&self, outputs: &str) -> Vec<String> {
        let [width, height] = self.size;
        let samples = spp_text(self.spp, self.most_spp);
        let stopped =
            if self.stopped_early { format!(" of {}, stopped early", self.requested_spp) } else { String::new() };
        let trace = self.seconds.parts.iter().find(|(name, _)| *name == "trace");
        let trace = trace.map_or_else(String::new, |(_, s)| format!(", {s:.3} of them tracing"));
        let error = self.film.error.as_ref().map_or_else(String::new, |error| format!("; {error}"));
        let denoised = self.denoise.as_ref().map_or_else(String::new, |d| format!("; denoised by {} (biased)", d.name));
        let surfaces =
            self.surface_mean.map_or_else(String::new, |mean| format!(", {mean:.5} where the scene is seen"));
        vec![
            format!(
                "{outputs}: {width}x{height}, {samples} spp{stopped}, {}, on {}{}",
                self.integrator,
                self.setup.device,
                self.setup.chosen_text()
            ),
            format!("{:.3} seconds{trace}", self.seconds.total),
            format!(
                "mean {} {:.5}{}{surfaces}{error}{denoised}",
                self.quantity,
                self.mean,
                error_text(self.mean_standard_error)
            ),
        ]
    }

    /// All lines for people. `outputs` names the image files; `explain` adds lines about skipped
    /// work.
    pub fn lines(&self, outputs: &str, explain: bool) -> Vec<String> {
        let [width, height] = self.size;
        let mut lines = vec![format!(
            "{outputs}: {width}x{height}, {} spp, {}, tracer {} on {}; mean {} {:.5}{}",
            spp_text(self.spp, self.most_spp),
            self.integrator,
            self.setup.tracer,
            self.setup.device,
            self.quantity,
            self.mean,
            error_text(self.mean_standard_error),
        )];
        lines.extend(self.setup.choices.iter().cloned());
        lines.extend(self.details.lines.iter().cloned());
        lines.push(self.setup.seconds_line(&self.seconds));
        lines.extend(self.denoise.iter().map(|d| d.line.clone()));
        lines.extend(self.film.lines.iter().cloned());
        if self.stopped_early {
            lines.push(format!("stopped early: {} of {} samples per pixel", self.spp, self.requested_spp));
        }
        if explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// Lines about skipped work and its savings.
    fn explanations(&self) -> Vec<String> {
        let mut lines = vec![format!("tracer {}: {}", self.setup.tracer, self.setup.tracer_reason)];
        if let (Some(ComputeOptions { kernel, triangle_test }), Some(camera)) = (self.compute, self.coherent_kernel) {
            lines.push(format!(
                "traversal {kernel}: {}; camera rays: {camera}; triangle test {triangle_test}",
                kernel.help()
            ));
        }
        lines.extend(self.setup.features.iter().cloned());
        lines.extend(self.details.explanations.iter().cloned());
        let all = self.primary_rays + self.skipped_primary_rays;
        lines.push(format!(
            "{} of {all} camera rays ({:.1} %) not traced: their tiles show no geometry",
            self.skipped_primary_rays,
            100.0 * self.skipped_primary_rays as f64 / all.max(1) as f64
        ));
        lines.extend(self.film.explanations.iter().cloned());
        lines.extend(self.denoise.iter().map(|d| d.explanation.clone()));
        let steps: Vec<_> = self.device_seconds.iter().map(|(step, s)| format!("{step} {s:.3}")).collect();
        lines.push(format!("device seconds: {}", steps.join(", ")));
        lines
    }

    /// A record for programs: a map.
    pub fn record(&self, explain: bool) -> Value {
        let steps: Map<_, _> = self.device_seconds.iter().map(|(label, s)| ((*label).to_owned(), json!(s))).collect();
        let mut passes = BTreeMap::new();
        for (label, s) in &self.device_seconds {
            *passes.entry(label.split(' ').next().unwrap_or(label)).or_insert(0.0) += s;
        }
        let own = json!({
            "integrator": self.integrator,
            "width": self.size[0],
            "height": self.size[1],
            "spp": self.spp,
            "spp_asked": self.requested_spp,
            "stopped_early": self.stopped_early,
            "seed": self.seed,
            "traversal": self.compute.map(|o| o.kernel),
            "triangle_test": self.compute.map(|o| o.triangle_test),
            "mean": self.mean,
            "surface_mean": self.surface_mean,
            "mean_standard_error": self.mean_standard_error,
            "film": self.film.record,
            "device_seconds": passes,
            "device_steps": steps,
            "longest_launch_seconds": self.longest_launch,
        });
        let mut record = self.setup.record(&self.seconds);
        record.extend(own.as_object().cloned().unwrap_or_default());
        record.extend(self.details.record.clone());
        if let Some(denoise) = &self.denoise {
            record.insert("denoise".into(), denoise.record.clone());
        }
        if explain {
            record.insert("explain".into(), json!(self.explanations()));
        }
        Value::Object(record)
    }
}

/// The report of a frame.
#[derive(Clone, Debug)]
pub struct FrameReport {
    /// Frame number.
    pub number: u32,
    /// False for frames of the warm-up.
    pub kept: bool,
    /// Seconds from the scene's update to the finished image in device memory.
    pub seconds: f64,
    /// Seconds of the scene's update, included in `seconds`.
    pub update_seconds: f64,
    /// Work and timings of the passes.
    pub stats: FrameStats,
}

impl FrameReport {
    /// Returns true if the image had converged, and neither camera nor scene had moved.
    pub fn is_skipped(&self) -> bool {
        self.stats.timings.is_empty() && self.stats.primary_rays + self.stats.occlusion_rays == 0
    }
}

/// The frames before those that are kept, in words.
fn warm_up_text(warm_up: usize) -> String {
    let frames = if warm_up == 1 { "frame" } else { "frames" };
    match warm_up {
        0 => String::new(),
        n => format!(", after {n} {frames} that are not kept (--warm-up, --lead-in)"),
    }
}

/// Milliseconds with three significant digits at most.
pub fn milliseconds(ms: f64) -> String {
    match ms {
        ms if ms >= 100.0 => format!("{ms:.0} ms"),
        ms if ms >= 1.0 => format!("{ms:.1} ms"),
        ms => format!("{ms:.2} ms"),
    }
}

/// The report of real-time frames.
#[derive(Clone, Debug)]
pub struct FramesReport {
    /// Scene, device and tracer.
    pub setup: Setup,
    /// The integrator.
    pub integrator: IntegratorName,
    /// Name of the quantity of [`FramesReport::mean`].
    pub quantity: &'static str,
    /// The preset.
    pub preset: Preset,
    /// Settings of the pipeline.
    pub settings: Settings,
    /// Primary visibility.
    pub primary: Primary,
    /// Why camera rays are traced or rasterized.
    pub primary_reason: String,
    /// Reports of all frames, including those of the warm-up.
    pub frames: Vec<FrameReport>,
    /// Mean of the last frame, over covered pixels and channels.
    pub mean: f64,
    /// A warning about a last frame that is all but black or white; it is one of the warnings, too.
    pub brightness: Option<String>,
    /// Seconds of each part of the run.
    pub seconds: Seconds,
}

impl FramesReport {
    /// Median and 95th percentile of the milliseconds of each pass, over the frames that run it.
    /// The first frame, in which some drivers compile shaders, only counts if it is the only one.
    fn passes(&self) -> Vec<(&'static str, f64, f64)> {
        let from = usize::from(self.frames.len() > 1);
        let mut labels: Vec<&'static str> = Vec::new();
        for t in self.frames[from..].iter().flat_map(|f| &f.stats.timings) {
            if !labels.contains(&t.label) {
                labels.push(t.label);
            }
        }
        let of = |label: &str, timings: &[Timing]| {
            let mut all = timings.iter().filter(|t| t.label == label).map(|t| t.seconds).peekable();
            all.peek().is_some().then(|| 1e3 * all.sum::<f64>())
        };
        let mut out = Vec::new();
        for label in labels {
            let ms: Vec<f64> = self.frames[from..].iter().filter_map(|f| of(label, &f.stats.timings)).collect();
            if let (Some(s), Some(p95)) = (Summary::from_values(&ms), percentile(&ms, 0.95)) {
                out.push((label, s.median, p95));
            }
        }
        out
    }

    /// Median and 95th percentile of the milliseconds per frame, without skipped ones if possible.
    pub fn frame_ms(&self) -> (f64, f64) {
        let from = usize::from(self.frames.len() > 1);
        let of =
            |frames: &mut dyn Iterator<Item = &FrameReport>| -> Vec<f64> { frames.map(|f| 1e3 * f.seconds).collect() };
        let worked = of(&mut self.frames[from..].iter().filter(|f| !f.is_skipped()));
        let first = of(&mut self.frames.iter().filter(|f| !f.is_skipped()));
        let all = of(&mut self.frames[from..].iter());
        let ms = [worked, first, all].into_iter().find(|ms| !ms.is_empty()).unwrap_or_default();
        (Summary::from_values(&ms).map_or(0.0, |s| s.median), percentile(&ms, 0.95).unwrap_or(0.0))
    }

    /// How long frames take, in a line.
    fn time_line(&self) -> String {
        let (median, p95) = self.frame_ms();
        let skipped = self.frames.iter().filter(|f| f.is_skipped()).count();
        let skipped = match skipped {
            0 => String::new(),
            n => format!("; {n} of {} frames had nothing to do: the image had converged", self.frames.len()),
        };
        if median <= 0.0 || self.frames.iter().all(FrameReport::is_skipped) {
            return format!("frame time: none{skipped}");
        }
        let rate = 1e3 / median;
        let rate = if rate < 10.0 { format!("{rate:.1}") } else { format!("{rate:.0}") };
        format!("frame time: {} (95 %: {}), {rate} frames per second{skipped}", milliseconds(median), milliseconds(p95))
    }

    fn rays(&self) -> [u64; 3] {
        let sum = |of: fn(&FrameStats) -> u64| self.frames.iter().map(|f| of(&f.stats)).sum();
        [sum(|s| s.primary_rays), sum(|s| s.occlusion_rays), sum(|s| s.skipped_rays)]
    }

    /// Three lines for people: what was rendered, how long it took, what it shows on average.
    /// `outputs` names the files.
    pub fn summary(&self, outputs: &str) -> Vec<String> {
        let kept = self.frames.iter().filter(|f| f.kept).count();
        let frames = if kept == 1 { "1 frame".to_owned() } else { format!("{kept} frames") };
        vec![
            format!(
                "{outputs}: {frames} of {}, {}, on {}{}",
                self.technique_text(),
                self.preset,
                self.setup.device,
                self.setup.chosen_text()
            ),
            format!("{:.3} seconds; {}", self.seconds.total, self.time_line()),
            format!("mean {} {:.5} over the scene's pixels", self.quantity, self.mean),
        ]
    }

    /// All lines for people. `outputs`: names of the files; `explain`: add lines about skipped
    /// work.
    pub fn lines(&self, outputs: &str, explain: bool) -> Vec<String> {
        let (kept, all) = (self.frames.iter().filter(|f| f.kept).count(), self.frames.len());
        let [primary, occlusion, skipped] = self.rays();
        let mut lines = vec![
            format!(
                "{outputs}: {kept} frame{} of {}, {}{}, tracer {} on {}; mean {} {:.5} over the scene's pixels",
                if kept == 1 { "" } else { "s" },
                self.technique_text(),
                self.preset,
                warm_up_text(all - kept),
                self.setup.tracer,
                self.setup.device,
                self.quantity,
                self.mean,
            ),
            self.time_line(),
            format!(
                "rays per frame: {} camera, {} {}, {} not traced",
                primary / all.max(1) as u64,
                occlusion / all.max(1) as u64,
                if self.is_radiance() { "of bounces and to lights" } else { "occlusion" },
                skipped / all.max(1) as u64
            ),
        ];
        lines.extend(self.setup.choices.iter().cloned());
        let passes: Vec<_> = self.passes().iter().map(|(l, m, p)| format!("{l} {m:.2} ({p:.2})")).collect();
        lines.push(format!("device ms by pass, median (95 %): {}", passes.join(", ")));
        lines.push(self.setup.seconds_line(&self.seconds));
        if explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    fn is_radiance(&self) -> bool {
        !self.integrator.can(Capability::AmbientVisibility)
    }

    /// The integrator, with the technique of ambient occlusion.
    fn technique_text(&self) -> String {
        let name = self.integrator.name();
        if self.is_radiance() { name.to_owned() } else { format!("{name} ({})", self.settings.technique) }
    }

    /// Lines about skipped work and its savings.
    fn explanations(&self) -> Vec<String> {
        let mut lines = self.setup.features.clone();
        lines.push(format!("tracer {}: {}", self.setup.tracer, self.setup.tracer_reason));
        let visibility = if self.primary == Primary::Raster { "rasterized" } else { "ray traced" };
        lines.push(format!("primary visibility {visibility}: {}", self.primary_reason));
        let s = &self.settings;
        if self.is_radiance() {
            return lines;
        }
        lines.push(match (s.occlusion.is_binary(), s.occlusion.visible_reach()) {
            (true, r) if r.is_finite() => format!("binary occlusion: any hit within {} ends a ray", significant(r, 4)),
            (true, _) => "binary occlusion: any hit ends a ray".into(),
            (false, r) => {
                format!("occlusion rays end at distance {}: hits beyond do not occlude visibly", significant(r, 4))
            }
        });
        let resting = self.frames.iter().filter(|f| f.stats.primary_rays == 0).count();
        lines.push(format!(
            "{resting} of {} frames without camera rays: neither the camera nor the scene had moved, or the scene was rasterized",
            self.frames.len()
        ));
        let [_, traced, skipped] = self.rays();
        lines.push(format!(
            "{skipped} of {} occlusion rays ({:.1} %) not traced: background, or the pixel's history is full",
            traced + skipped,
            100.0 * skipped as f64 / (traced + skipped).max(1) as f64
        ));
        if let Some(nodes) = self.frames.last().and_then(|f| f.stats.nodes) {
            lines.push(format!(
                "BVH nodes visited per camera ray of the last frame: mean {:.2}, maximum {}",
                nodes.mean, nodes.max
            ));
        }
        lines
    }

    /// A record for programs: a map.
    pub fn record(&self, explain: bool) -> Value {
        let (median, p95) = self.frame_ms();
        let [primary, occlusion, skipped] = self.rays();
        let finite = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
        let mut settings = json!(self.settings);
        settings["radius"] = finite(self.settings.occlusion.radius);
        let frame = |f: &FrameReport| {
            json!({
                "frame": f.number,
                "kept": f.kept,
                "ms": 1e3 * f.seconds,
                "update_ms": 1e3 * f.update_seconds,
                "primary_rays": f.stats.primary_rays,
                "occlusion_rays": f.stats.occlusion_rays,
                "skipped_rays": f.stats.skipped_rays,
                "nodes": f.stats.nodes,
            })
        };
        let passes = self.passes().into_iter();
        let passes: Map<_, _> = passes
            .map(|(label, median, p95)| (label.to_owned(), json!({ "median_ms": median, "p95_ms": p95 })))
            .collect();

        // what frames have, beside what all renders have
        let own = json!({
            "integrator": self.integrator,
            "preset": self.preset,
            "settings": settings,
            "primary": self.primary,
            "primary_reason": self.primary_reason,
            "mean": self.mean,
            "frame_ms": { "median": median, "p95": p95 },
            "passes": passes,
            "rays": { "primary": primary, "occlusion": occlusion, "skipped": skipped },
            "frames": self.frames.iter().map(frame).collect::<Vec<_>>(),
        });
        let mut record = self.setup.record(&self.seconds);
        record.extend(own.as_object().cloned().unwrap_or_default());
        if explain {
            record.insert("explain".into(), json!(self.explanations()));
        }
        Value::Object(record)
    }
}
