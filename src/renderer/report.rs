//! What there is to say of a render: lines for people, a record for programs. Stills and frames say the same of what they have in common.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::Renderer;
use super::denoising::DenoiseReport;
use super::settings::FilmSettings;
use super::still::spp_text;
use crate::accel::flatten::FlatScene;
use crate::film::accumulate::Accumulated;
use crate::gpu::Timing;
use crate::integrators::IntegratorReport;
use crate::measure::stats::{Summary, percentile};
use crate::raster::Primary;
use crate::realtime::{FrameStats, Preset, Settings};
use crate::scene::RenderHints;
use crate::tracer::{BuildStats, ComputeOptions, Kernel, Tracer, TracerKind};

/// Seconds of each part of a run. Loading and starting the device overlap.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct Seconds {
    /// Reading the scene.
    pub load: f64,
    /// Starting the device.
    pub device: f64,
    /// Tracing, compiling included.
    pub trace: f64,
    /// Auxiliary outputs.
    pub aov: f64,
    /// All of a still: building, tracing, denoising.
    pub render: f64,
    /// Writing files.
    pub write: f64,
    /// The whole run.
    pub total: f64,
}

/// What an image was made of and with.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The scene, as it was asked for.
    pub scene: String,
    /// Triangles over all instances.
    pub triangles: u64,
    /// Spheres over all instances.
    pub spheres: u64,
    /// Triangles that were dropped when the scene was loaded.
    pub degenerate_triangles: usize,
    /// The camera in words.
    pub camera: String,
    /// Name of the device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// The tracer.
    pub tracer: TracerKind,
    /// Why this tracer.
    pub tracer_reason: String,
    /// What building took.
    pub stats: BuildStats,
    /// What the scene does not need, a sentence each.
    pub features: Vec<String>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Reading the scene, and starting the device.
    pub open: super::OpenSeconds,
    /// The scene's file wants a depth image.
    pub wants_depth_image: bool,
}

impl Setup {
    pub(super) fn new(renderer: &Renderer, tracer: &Tracer, flat: &FlatScene, camera: String, warnings: Vec<String>) -> Self {
        let (scene, info) = (flat.scene, &renderer.device.info);
        Self {
            scene: renderer.name.clone(),
            triangles: scene.triangle_count(),
            spheres: scene.sphere_count(),
            degenerate_triangles: scene.report.degenerate_triangles,
            camera,
            device: info.name.clone(),
            driver: info.driver.clone(),
            tracer: renderer.kind,
            tracer_reason: renderer.kind_reason.clone(),
            stats: tracer.stats(),
            features: tracer.features().explain(flat),
            warnings,
            open: renderer.open_seconds,
            wants_depth_image: scene.hints.depth_image,
        }
    }

    fn record(&self, seconds: &Seconds) -> Map<String, Value> {
        let mut record = json!({
            "scene": self.scene,
            "triangles": self.triangles,
            "spheres": self.spheres,
            "degenerate_triangles": self.degenerate_triangles,
            "camera": self.camera,
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
            },
            "seconds": seconds,
        });
        record["seconds"]["load"] = json!(self.open.load);
        record["seconds"]["device"] = json!(self.open.device);
        record["seconds"]["build"] = json!(self.stats.build_seconds);
        record["seconds"]["upload"] = json!(self.stats.upload_seconds);
        record.as_object().cloned().unwrap_or_default()
    }

    fn seconds_line(&self, parts: &[(&str, f64)]) -> String {
        let of = [
            ("load", self.open.load),
            ("device", self.open.device),
            ("build", self.stats.build_seconds),
            ("upload", self.stats.upload_seconds),
        ];
        let parts: Vec<_> = of.iter().chain(parts).map(|(name, s)| format!("{name} {s:.3}")).collect();
        format!("seconds (load and device at the same time): {}", parts.join(", "))
    }
}

/// What there is to say of a film: how good it is, and how that was come by.
#[derive(Clone, Debug)]
pub struct FilmReport {
    lines: Vec<String>,
    record: Value,
}

impl FilmReport {
    /// Of a film that was to get `spp` samples per pixel, and had `before` when it was resumed.
    pub(super) fn new(options: &FilmSettings, hints: &RenderHints, image: &Accumulated, before: Option<u32>, spp: u32) -> Self {
        let (min, mean, max) = image.film.samples_range();
        let estimated = image.film.estimated_rmse();
        let mut lines = Vec::new();
        if let (Some(before), Some(path)) = (before, &options.resume) {
            lines.push(format!("resumed {} from {before} samples per pixel", path.display()));
        }
        if let (Some(tiles), Some(target)) = (image.converged, options.target_rmse) {
            lines.push(format!(
                "estimated rmse {estimated:.3e} (target {target:e}): {} of {} tiles done; {min} to {max} samples per pixel, {mean:.1} in the mean",
                tiles.done, tiles.all
            ));
        }
        if !options.intervals && hints.save_intervals.iter().any(|&n| n < spp) {
            lines.push("the scene asks for intermediate images: add --intervals".into());
        }
        let record = json!({
            "samples": { "min": min, "mean": mean, "max": max },
            "estimated_rmse": estimated,
            "target_rmse": options.target_rmse,
            "tiles": image.converged,
            "resumed": options.resume,
            "samples_before": before,
        });
        Self { lines, record }
    }
}

/// All there is to say about a still.
#[derive(Clone, Debug)]
pub struct StillReport {
    /// What it was made of and with.
    pub setup: Setup,
    /// Name of the integrator.
    pub integrator: &'static str,
    /// What the mean is of.
    pub quantity: &'static str,
    /// Pixels.
    pub size: [u32; 2],
    /// Samples that every pixel got.
    pub spp: u32,
    /// Samples that any pixel got at most.
    pub most_spp: u32,
    /// Samples that were asked for.
    pub wanted_spp: u32,
    /// Seed of the sampler.
    pub seed: u32,
    /// Fewer samples than were asked for.
    pub stopped_early: bool,
    /// Mean over all pixels and channels; background counts 0 where nothing is seen there.
    pub mean: f64,
    /// Its standard error, from the pixels' own variances.
    pub mean_standard_error: f64,
    /// Of the film.
    pub film: FilmReport,
    /// How the compute tracer worked, where it was the one.
    pub compute: Option<ComputeOptions>,
    /// The kernel that traced coherent rays, likewise.
    pub coherent_kernel: Option<Kernel>,
    /// Camera rays traced.
    pub primary_rays: u64,
    /// Camera rays not traced: nothing is in their tile of the image.
    pub skipped_primary_rays: u64,
    /// Device seconds of each step of each pass.
    pub device_seconds: Vec<(&'static str, f64)>,
    /// Longest launch in device seconds.
    pub longest_launch: f64,
    /// What the integrator says.
    pub details: IntegratorReport,
    /// Of the denoiser, if there was one.
    pub denoise: Option<DenoiseReport>,
    /// Times.
    pub seconds: Seconds,
}

impl StillReport {
    /// Lines for people. `outputs`: where the image is; `explain`: with what was skipped.
    pub fn lines(&self, outputs: &str, explain: bool) -> Vec<String> {
        let ([width, height], s) = (self.size, &self.seconds);
        let mut lines = vec![format!(
            "{outputs}: {width}x{height}, {} spp, {}, tracer {} on {}; mean {} {:.5} +- {:.5}",
            spp_text(self.spp, self.most_spp),
            self.integrator,
            self.setup.tracer,
            self.setup.device,
            self.quantity,
            self.mean,
            self.mean_standard_error,
        )];
        lines.extend(self.details.lines.iter().cloned());
        lines.push(self.setup.seconds_line(&[("trace", s.trace), ("aov", s.aov), ("write", s.write), ("total", s.total)]));
        lines.extend(self.denoise.iter().map(|d| d.line.clone()));
        lines.extend(self.film.lines.iter().cloned());
        if self.stopped_early {
            lines.push(format!("stopped early: {} of {} samples per pixel", self.spp, self.wanted_spp));
        }
        if explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// What was skipped, and what that saved.
    fn explanations(&self) -> Vec<String> {
        let mut lines = vec![format!("tracer {}: {}", self.setup.tracer, self.setup.tracer_reason)];
        if let (Some(ComputeOptions { kernel, triangle_test }), Some(camera)) = (self.compute, self.coherent_kernel) {
            lines.push(format!("traversal {kernel}: {}; camera rays: {camera}; triangle test {triangle_test}", kernel.help()));
        }
        lines.extend(self.setup.features.iter().cloned());
        lines.extend(self.details.explanations.iter().cloned());
        let all = self.primary_rays + self.skipped_primary_rays;
        lines.push(format!(
            "{} of {all} camera rays ({:.1} %) not traced: nothing is in their part of the image",
            self.skipped_primary_rays,
            100.0 * self.skipped_primary_rays as f64 / all.max(1) as f64
        ));
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
            "spp_asked": self.wanted_spp,
            "stopped_early": self.stopped_early,
            "seed": self.seed,
            "traversal": self.compute.map(|o| o.kernel),
            "triangle_test": self.compute.map(|o| o.triangle_test),
            "mean": self.mean,
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

/// One frame.
#[derive(Clone, Debug)]
pub struct FrameReport {
    /// Its number.
    pub number: u32,
    /// It was not a frame of the warm-up.
    pub kept: bool,
    /// From the scene's update to the finished image in device memory.
    pub seconds: f64,
    /// Of these, for updating the scene.
    pub update_seconds: f64,
    /// Passes and rays.
    pub stats: FrameStats,
}

/// All there is to say about frames.
#[derive(Clone, Debug)]
pub struct FramesReport {
    /// What they were made of and with.
    pub setup: Setup,
    /// The preset.
    pub preset: Preset,
    /// How they were made.
    pub settings: Settings,
    /// Primary visibility.
    pub primary: Primary,
    /// Why this one.
    pub primary_reason: String,
    /// Frame by frame, those of the warm-up included.
    pub frames: Vec<FrameReport>,
    /// Mean ambient visibility of the last frame, over pixels that show the scene.
    pub mean: f64,
    /// Times.
    pub seconds: Seconds,
}

impl FramesReport {
    /// Milliseconds of each pass: median and 95th percentile over the frames that have it. The first frame compiles the shaders on some
    /// drivers; where there are others it is left out.
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
            if let (Some(s), Some(p95)) = (Summary::of(&ms), percentile(&ms, 0.95)) {
                out.push((label, s.median, p95));
            }
        }
        out
    }

    /// Milliseconds of a frame: median and 95th percentile.
    fn frame_ms(&self) -> (f64, f64) {
        let from = usize::from(self.frames.len() > 1);
        let ms: Vec<f64> = self.frames[from..].iter().map(|f| 1e3 * f.seconds).collect();
        (Summary::of(&ms).map_or(0.0, |s| s.median), percentile(&ms, 0.95).unwrap_or(0.0))
    }

    fn rays(&self) -> [u64; 3] {
        let sum = |of: fn(&FrameStats) -> u64| self.frames.iter().map(|f| of(&f.stats)).sum();
        [sum(|s| s.primary_rays), sum(|s| s.occlusion_rays), sum(|s| s.skipped_rays)]
    }

    /// Lines for people. `outputs`: where the frames are; `explain`: with what was skipped.
    pub fn lines(&self, outputs: &str, explain: bool) -> Vec<String> {
        let (kept, all) = (self.frames.iter().filter(|f| f.kept).count(), self.frames.len());
        let (median, p95) = self.frame_ms();
        let [primary, occlusion, skipped] = self.rays();
        let mut lines = vec![
            format!(
                "{outputs}: {kept} frame{} (warm-up: {}), {}, technique {}, tracer {} on {}; mean ambient visibility {:.5} over the scene's pixels",
                if kept == 1 { "" } else { "s" },
                all - kept,
                self.preset,
                self.settings.technique,
                self.setup.tracer,
                self.setup.device,
                self.mean,
            ),
            format!("a frame: {median:.1} ms (95 %: {p95:.1}), {:.1} frames a second", 1e3 / median.max(1e-6)),
            format!(
                "rays a frame: {} camera, {} occlusion, {} not traced",
                primary / all.max(1) as u64,
                occlusion / all.max(1) as u64,
                skipped / all.max(1) as u64
            ),
        ];
        let passes: Vec<_> = self.passes().iter().map(|(l, m, p)| format!("{l} {m:.2} ({p:.2})")).collect();
        lines.push(format!("device ms by pass, median (95 %): {}", passes.join(", ")));
        lines.push(self.setup.seconds_line(&[("write", self.seconds.write), ("total", self.seconds.total)]));
        if explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// What was skipped, and what that saved.
    fn explanations(&self) -> Vec<String> {
        let mut lines = self.setup.features.clone();
        lines.push(format!("tracer {}: {}", self.setup.tracer, self.setup.tracer_reason));
        let visibility = if self.primary == Primary::Raster { "rasterized" } else { "ray traced" };
        lines.push(format!("primary visibility {visibility}: {}", self.primary_reason));
        let s = &self.settings;
        lines.push(match (s.attenuation().is_binary(), s.attenuation().reach()) {
            (true, r) if r.is_finite() => format!("binary occlusion: any hit within {r} ends a ray"),
            (true, _) => "binary occlusion: any hit ends a ray".into(),
            (false, r) => format!("occlusion rays end at {r:.4}: what lies beyond changes nothing that can be seen"),
        });
        let resting = self.frames.iter().filter(|f| f.stats.primary_rays == 0).count();
        lines.push(format!(
            "{resting} of {} frames without camera rays: neither the camera nor the scene had moved, or the scene was rasterized",
            self.frames.len()
        ));
        let [_, traced, skipped] = self.rays();
        lines.push(format!(
            "{skipped} of {} occlusion rays ({:.1} %) not traced: nothing is there, or the pixel has all its samples",
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
        settings["radius"] = finite(self.settings.radius);
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
        let passes: Map<_, _> =
            passes.map(|(label, median, p95)| (label.to_owned(), json!({ "median_ms": median, "p95_ms": p95 }))).collect();
        let own = json!({
            "integrator": "ao",
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
