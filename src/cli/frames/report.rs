//! What rendering frames tells: lines for people, a record for programs.

use serde_json::{Value, json};

use super::camera_name;
use crate::cli::args::RenderArgs;
use crate::cli::report::Seconds;
use crate::gpu::{DeviceInfo, Timing};
use crate::measure::stats::{Summary, percentile};
use crate::raster::Primary;
use crate::realtime::{FrameStats, Settings};
use crate::scene::{Camera, Scene};
use crate::tracer::{BuildStats, TracerKind};

/// One frame.
pub struct FrameReport {
    number: u32,
    kept: bool,
    /// From the scene's update to the finished image in device memory; writing not included.
    seconds: f64,
    update_seconds: f64,
    stats: FrameStats,
}

impl FrameReport {
    /// `kept`: it was written.
    pub fn new(number: u32, kept: bool, seconds: f64, update_seconds: f64, stats: FrameStats) -> Self {
        Self { number, kept, seconds, update_seconds, stats }
    }
}

/// All there is to say.
pub struct Report<'a> {
    args: &'a RenderArgs,
    settings: &'a Settings,
    primary: Primary,
    primary_reason: String,
    device: String,
    driver: String,
    tracer: &'static str,
    tracer_reason: String,
    stats: BuildStats,
    features: Vec<String>,
    triangles: u64,
    spheres: u64,
    camera: String,
    frames: Vec<FrameReport>,
    /// Mean accessibility of the last frame, over what is covered.
    pub mean: f64,
    /// What is no failure, but to be known.
    pub warnings: Vec<String>,
    /// Times.
    pub seconds: Seconds,
}

impl<'a> Report<'a> {
    /// Nothing is known yet but what was asked for.
    pub fn new(args: &'a RenderArgs, settings: &'a Settings, primary: Primary, primary_reason: &str) -> Self {
        Self {
            args,
            settings,
            primary,
            primary_reason: primary_reason.to_owned(),
            device: String::new(),
            driver: String::new(),
            tracer: "",
            tracer_reason: String::new(),
            stats: BuildStats::default(),
            features: Vec::new(),
            triangles: 0,
            spheres: 0,
            camera: String::new(),
            frames: Vec::new(),
            mean: 0.0,
            warnings: Vec::new(),
            seconds: Seconds::default(),
        }
    }

    /// What it runs on, and what is rendered.
    #[expect(clippy::too_many_arguments, reason = "each is one thing to tell, and there is one call")]
    pub fn describe(
        &mut self,
        device: &DeviceInfo,
        tracer: TracerKind,
        why: String,
        stats: BuildStats,
        features: Vec<String>,
        scene: &Scene,
        camera: &Camera,
    ) {
        (self.device, self.driver) = (device.name.clone(), device.driver.clone());
        (self.tracer, self.tracer_reason) = (tracer.name(), why);
        (self.stats, self.features) = (stats, features);
        (self.triangles, self.spheres) = (scene.triangle_count(), scene.sphere_count());
        self.camera = camera_name(camera).to_owned();
    }

    /// Text attributes of a frame's image. Nothing in it differs between two runs of the same command.
    pub fn metadata(&self, frame: u32) -> Vec<(String, String)> {
        let s = self.settings;
        [
            ("ao.falloff", s.falloff.to_string()),
            ("ao.radius", s.radius.to_string()),
            ("budget", s.budget.name().into()),
            ("camera", self.camera.clone()),
            ("device", format!("{} ({})", self.device, self.driver)),
            ("frame", frame.to_string()),
            ("history", s.history.to_string()),
            ("integrator", "ao".into()),
            ("preset", self.args.frames.preset.unwrap_or_default().name().into()),
            ("primary", format!("{:?}", self.primary).to_lowercase()),
            ("rays_per_pixel", s.rays_per_pixel.to_string()),
            ("resolution", s.resolution.name().into()),
            ("scene", self.args.scene.clone()),
            ("seed", s.seed.to_string()),
            ("sequence", s.sequence.name().into()),
            ("technique", s.technique.name().into()),
            ("tracer", self.tracer.into()),
            ("version", env!("CARGO_PKG_VERSION").into()),
        ]
        .map(|(k, v)| (k.to_owned(), v))
        .to_vec()
    }

    /// Takes a frame.
    pub fn add(&mut self, frame: FrameReport) {
        self.frames.push(frame);
    }

    fn kept(&self) -> impl Iterator<Item = &FrameReport> {
        self.frames.iter().filter(|f| f.kept)
    }

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

    /// Lines for people.
    pub fn lines(&self) -> Vec<String> {
        let names = self.args.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
        let (kept, all) = (self.kept().count(), self.frames.len());
        let (median, p95) = self.frame_ms();
        let s = &self.seconds;
        let [primary, occlusion, skipped] = self.rays();
        let mut lines = vec![
            format!(
                "{names}: {kept} frame{} ({} before), {}, technique {}, tracer {} on {}; mean accessibility {:.5} where the scene is",
                if kept == 1 { "" } else { "s" },
                all - kept,
                self.args.frames.preset.unwrap_or_default().name(),
                self.settings.technique.name(),
                self.tracer,
                self.device,
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
        lines.push(format!(
            "seconds: load {:.3}, device {:.3} (at the same time), build {:.3}, upload {:.3}, write {:.3}, total {:.3}",
            s.load, s.device, self.stats.build_seconds, self.stats.upload_seconds, s.write, s.total
        ));
        if self.args.explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// What was skipped, and what that saved.
    fn explanations(&self) -> Vec<String> {
        let mut lines = self.features.clone();
        lines.push(format!("tracer {}: {}", self.tracer, self.tracer_reason));
        lines.push(format!(
            "camera rays {}: {}",
            if self.primary == Primary::Raster { "drawn" } else { "traced" },
            self.primary_reason
        ));
        let s = self.settings;
        lines.push(match (s.attenuation().is_binary(), s.attenuation().reach()) {
            (true, r) if r.is_finite() => format!("binary occlusion: any hit within {r} ends a ray"),
            (true, _) => "binary occlusion: any hit ends a ray".into(),
            (false, r) => format!("occlusion rays end at {r:.4}: what lies beyond changes nothing that can be seen"),
        });
        let resting = self.frames.iter().filter(|f| f.stats.primary_rays == 0).count();
        lines.push(format!(
            "{resting} of {} frames without camera rays: neither the camera nor the scene had moved, or the scene was drawn",
            self.frames.len()
        ));
        let [_, traced, skipped] = self.rays();
        lines.push(format!(
            "{skipped} of {} occlusion rays ({:.1} %) not traced: nothing is there, or the pixel has all its samples",
            traced + skipped,
            100.0 * skipped as f64 / (traced + skipped).max(1) as f64
        ));
        lines
    }

    /// A record for programs.
    pub fn record(&self) -> Value {
        let (median, p95) = self.frame_ms();
        let [primary, occlusion, skipped] = self.rays();
        let finite = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
        let mut settings = json!(self.settings);
        settings["radius"] = finite(self.settings.radius);
        let frames: Vec<_> = self
            .frames
            .iter()
            .map(|f| {
                json!({
                    "frame": f.number,
                    "kept": f.kept,
                    "ms": 1e3 * f.seconds,
                    "update_ms": 1e3 * f.update_seconds,
                    "primary_rays": f.stats.primary_rays,
                    "occlusion_rays": f.stats.occlusion_rays,
                    "skipped_rays": f.stats.skipped_rays,
                })
            })
            .collect();
        let passes: serde_json::Map<_, _> = self
            .passes()
            .into_iter()
            .map(|(label, median, p95)| (label.to_owned(), json!({ "median_ms": median, "p95_ms": p95 })))
            .collect();
        let mut record = json!({
            "scene": self.args.scene,
            "output": self.args.output,
            "preset": self.args.frames.preset.unwrap_or_default(),
            "settings": settings,
            "primary": self.primary,
            "primary_reason": self.primary_reason,
            "tracer": self.tracer,
            "tracer_reason": self.tracer_reason,
            "device": self.device,
            "driver": self.driver,
            "triangles": self.triangles,
            "spheres": self.spheres,
            "mean": self.mean,
            "frame_ms": { "median": median, "p95": p95 },
            "passes": passes,
            "rays": { "primary": primary, "occlusion": occlusion, "skipped": skipped },
            "frames": frames,
            "warnings": self.warnings,
            "seconds": self.seconds,
        });
        record["seconds"]["build"] = json!(self.stats.build_seconds);
        record["seconds"]["upload"] = json!(self.stats.upload_seconds);
        if self.args.explain {
            record["explain"] = json!(self.explanations());
        }
        record
    }
}
