//! What `skylit render` tells: metadata of the image, lines for people, a record for programs.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::args::RenderArgs;
use super::film::{Identity, Told, spp_text};
use crate::gpu::DeviceInfo;
use crate::integrators::ao::{AoOptions, Hemisphere};
use crate::scene::{Camera, Projection, Scene};
use crate::tracer::{BuildStats, ComputeOptions, TracerKind};

/// Seconds of each part of a run. Loading and starting the device overlap.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct Seconds {
    /// Reading the scene.
    pub load: f64,
    /// Starting the device.
    pub device: f64,
    /// Ambient occlusion, compiling included.
    pub trace: f64,
    /// Auxiliary outputs.
    pub aov: f64,
    /// Writing files.
    pub write: f64,
    /// From the start of the process' `main`.
    pub total: f64,
}

/// Rays that were traced, and that were not.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct Rays {
    /// Camera rays.
    pub primary: u64,
    /// Camera rays not traced: nothing is in their tile.
    pub skipped_primary: u64,
    /// Occlusion rays.
    pub occlusion: u64,
    /// Occlusion rays not traced: samples that meet nothing.
    pub skipped: u64,
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

/// What has to agree when an image of ambient occlusion is gone on with: all that its samples depend on, but for its size. `print`: the
/// scene's fingerprint, where the film is kept.
pub fn identity(camera: &Camera, options: &AoOptions, print: Option<String>) -> Identity {
    // no `..`: a new option has to be put where it belongs
    let AoOptions { size: _, spp: _, time_limit: _, keep_rays: _, cover: _, film: _, seed, radius, falloff, hemisphere: _ } =
        options;
    vec![
        ("version", Some(env!("CARGO_PKG_VERSION").into())),
        ("integrator", Some("ao".into())),
        ("scene.hash", print),
        ("camera", Some(camera_text(camera))),
        ("seed", Some(seed.to_string())),
        ("ao.radius", Some(radius.to_string())),
        ("ao.falloff", Some(falloff.to_string())),
        ("ao.normal", Some(hemisphere(options).into())),
    ]
}

fn hemisphere(options: &AoOptions) -> &'static str {
    match options.hemisphere {
        Hemisphere::Geometric => "geometric",
        Hemisphere::Shading => "shading",
    }
}

/// All there is to say about a render.
pub struct Report<'a> {
    /// What was asked for.
    pub args: &'a RenderArgs,
    /// The scene.
    pub scene: &'a Scene,
    /// The camera that was used.
    pub camera: &'a Camera,
    /// The device.
    pub device: &'a DeviceInfo,
    /// The tracer.
    pub tracer: TracerKind,
    /// Why this tracer.
    pub why: String,
    /// How the compute tracer worked, where it was the one.
    pub compute: Option<ComputeOptions>,
    /// The options of the pass.
    pub options: &'a AoOptions,
    /// Samples that every pixel got.
    pub spp: u32,
    /// Samples that any pixel got at most.
    pub most_spp: u32,
    /// Of the film.
    pub film: Told,
    /// Fewer than asked for.
    pub stopped_early: bool,
    /// Mean accessibility over all pixels; background counts 0.
    pub mean: f64,
    /// Of the mean, from the pixels' own variances.
    pub mean_standard_error: f64,
    /// Mean accessibility over what the scene covers.
    pub covered_mean: f64,
    /// Rays.
    pub rays: Rays,
    /// Device seconds of each step of each pass.
    pub device_seconds: Vec<(&'static str, f64)>,
    /// Longest launch in device seconds.
    pub longest_launch: f64,
    /// What building took.
    pub stats: BuildStats,
    /// What the scene made skip.
    pub features: Vec<String>,
    /// What is no failure, but to be known.
    pub warnings: Vec<String>,
    /// Times.
    pub seconds: Seconds,
}

impl Report<'_> {
    /// Lines for people.
    pub fn lines(&self) -> Vec<String> {
        let [width, height] = self.options.size;
        let s = &self.seconds;
        let mut lines = vec![
            format!(
                "{}: {width}x{height}, {} spp, tracer {} on {}; mean accessibility {:.5} +- {:.5} ({:.5} where the scene is)",
                self.args.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "),
                spp_text(self.spp, self.most_spp),
                self.tracer,
                self.device.name,
                self.mean,
                self.mean_standard_error,
                self.covered_mean,
            ),
            format!(
                "seconds: load {:.3}, device {:.3} (at the same time), build {:.3}, upload {:.3}, trace {:.3}, aov {:.3}, write {:.3}, \
                 total {:.3}; {:.1} Mrays/s",
                s.load,
                s.device,
                self.stats.build_seconds,
                self.stats.upload_seconds,
                s.trace,
                s.aov,
                s.write,
                s.total,
                self.mrays_s(),
            ),
        ];
        lines.extend(self.film.lines.iter().cloned());
        if self.stopped_early {
            lines.push(format!("stopped early: {} of {} samples per pixel", self.spp, self.options.spp));
        }
        if self.scene.hints.depth_image && self.args.depth_image.is_none() {
            lines.push("the scene asks for a depth image: add --depth-image FILE".into());
        }
        if self.args.explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// What was skipped, and what that saved.
    fn explanations(&self) -> Vec<String> {
        let rays = self.rays;
        let mut lines = vec![format!("tracer {}: {}", self.tracer, self.why)];
        if let Some(ComputeOptions { kernel, triangle_test }) = self.compute {
            let camera = kernel.for_coherent(self.device);
            lines.push(format!(
                "traversal {kernel}: {}; camera rays: {camera}; triangle test {triangle_test}",
                kernel.describe()
            ));
        }
        lines.extend(self.features.iter().cloned());
        lines.push(match self.options.attenuation().is_binary() {
            true => "binary occlusion: any hit ends a ray, no nearest one is looked for".into(),
            false => "occlusion falls off with distance: the nearest hit is looked for".into(),
        });
        lines.push(match self.options.attenuation().reach() {
            r if r.is_finite() => {
                format!("occlusion rays end at distance {r:.6}: what is beyond changes nothing that can be seen")
            }
            _ => "occlusion rays have no end: no radius and no falloff was given".into(),
        });
        let share = |part: u64, all: u64| 100.0 * part as f64 / all.max(1) as f64;
        let all = rays.primary + rays.skipped_primary;
        lines.push(format!(
            "{} of {all} camera rays ({:.1} %) not traced: nothing is in their part of the image",
            rays.skipped_primary,
            share(rays.skipped_primary, all)
        ));
        let all = rays.occlusion + rays.skipped;
        lines.push(format!(
            "{} of {all} occlusion rays ({:.1} %) not traced: their sample's camera ray meets nothing",
            rays.skipped,
            share(rays.skipped, all)
        ));
        let steps: Vec<_> = self.device_seconds.iter().map(|(step, s)| format!("{step} {s:.3}")).collect();
        lines.push(format!("device seconds: {}", steps.join(", ")));
        lines
    }

    /// All rays of the image by the clock.
    fn mrays_s(&self) -> f64 {
        if self.seconds.trace > 0.0 { (self.rays.primary + self.rays.occlusion) as f64 / self.seconds.trace / 1e6 } else { 0.0 }
    }

    /// A record for programs.
    pub fn record(&self) -> Value {
        let device_steps: serde_json::Map<_, _> =
            self.device_seconds.iter().map(|(label, s)| ((*label).to_owned(), json!(s))).collect();
        let mut device_seconds = BTreeMap::new();
        for (label, s) in &self.device_seconds {
            *device_seconds.entry(label.split(' ').next().unwrap_or(label)).or_insert(0.0) += s;
        }
        let finite = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
        let mut record = json!({
            "scene": self.args.scene,
            "output": self.args.output,
            "width": self.options.size[0],
            "height": self.options.size[1],
            "spp": self.spp,
            "spp_asked": self.options.spp,
            "stopped_early": self.stopped_early,
            "seed": self.options.seed,
            "camera": camera_text(self.camera),
            "ao": {
                "radius": finite(self.options.radius),
                "falloff": self.options.falloff,
                "normal": hemisphere(self.options),
                "reach": finite(self.options.attenuation().reach()),
            },
            "tracer": self.tracer.name(),
            "tracer_reason": self.why,
            "traversal": self.compute.map(|o| o.kernel),
            "triangle_test": self.compute.map(|o| o.triangle_test),
            "device": self.device.name,
            "driver": self.device.driver,
            "mean": self.mean,
            "mean_standard_error": self.mean_standard_error,
            "covered_mean": self.covered_mean,
            "film": self.film.record,
            "triangles": self.scene.triangle_count(),
            "spheres": self.scene.sphere_count(),
            "degenerate_triangles": self.scene.report.degenerate_triangles,
            "warnings": self.warnings,
            "rays": self.rays,
            "mrays_s_wall": self.mrays_s(),
            "build": self.stats_record(),
            "seconds": self.seconds,
            "device_seconds": device_seconds,
            "device_steps": device_steps,
            "longest_launch_seconds": self.longest_launch,
        });
        record["seconds"]["build"] = json!(self.stats.build_seconds);
        record["seconds"]["upload"] = json!(self.stats.upload_seconds);
        if self.args.explain {
            record["explain"] = json!(self.explanations());
        }
        record
    }

    fn stats_record(&self) -> Value {
        json!({
            "structure_bytes": self.stats.structure_bytes,
            "scene_bytes": self.stats.scene_bytes,
            "bytes_per_primitive": self.stats.bytes_per_primitive(),
            "stack_entries": self.stats.stack_entries,
        })
    }
}
