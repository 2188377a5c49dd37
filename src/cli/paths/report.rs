//! What `skylit render` tells of path-traced images: metadata of the image, lines for people, a record for programs.

use serde_json::{Value, json};

use crate::cli::args::RenderArgs;
use crate::cli::report::{Seconds, camera_text};
use crate::gpu::DeviceInfo;
use crate::render::path::{MOST_DEPTH, PathOptions, PathResult, PixelFilter};
use crate::scene::features::SceneFeatures;
use crate::scene::{Camera, Environment, Scene};
use crate::tracer::shading::feature;
use crate::tracer::{BuildStats, TracerKind};

/// All there is to say about it.
pub struct Report<'a> {
    pub args: &'a RenderArgs,
    pub scene: &'a Scene,
    pub camera: &'a Camera,
    pub device: &'a DeviceInfo,
    pub tracer: TracerKind,
    /// Why this tracer.
    pub why: String,
    pub options: &'a PathOptions,
    pub result: &'a PathResult,
    pub stats: BuildStats,
    /// What the scene made skip.
    pub features: Vec<String>,
    pub tracer_features: SceneFeatures,
    pub warnings: Vec<String>,
    pub seconds: Seconds,
}

impl Report<'_> {
    fn depth(&self) -> String {
        match self.options.max_depth {
            n if n >= MOST_DEPTH => "unlimited".into(),
            n => n.to_string(),
        }
    }

    fn environment(&self) -> String {
        match &self.scene.environment {
            _ if self.options.view.is_some() => "none".into(),
            _ if self.options.white_sky.is_some() => "white".into(),
            Environment::Black => "black".into(),
            Environment::Uniform(c) => format!("{}, {}, {}", c.x, c.y, c.z),
            Environment::Map(map) => map.name.clone(),
        }
    }

    /// Text attributes of the image. Nothing in it differs between two runs of the same command.
    pub fn metadata(&self) -> Vec<(String, String)> {
        let o = self.options;
        let mut out = vec![
            ("camera", camera_text(self.camera)),
            ("device", format!("{} ({})", self.device.name, self.device.driver)),
            ("environment", self.environment()),
            ("integrator", self.args.integrator.name()),
            ("max_depth", self.depth()),
            ("rr_depth", o.rr_depth.to_string()),
            ("sampling", format!("{:?}", o.strategy).to_lowercase()),
            ("scene", self.args.scene.clone()),
            ("seed", o.seed.to_string()),
            ("spp", self.result.image.spp.to_string()),
            ("tracer", self.tracer.name().into()),
            ("version", env!("CARGO_PKG_VERSION").into()),
        ];
        if o.firefly_clamp.is_finite() {
            out.push(("firefly_clamp", o.firefly_clamp.to_string()));
        }
        if o.pixel_filter != PixelFilter::Box {
            out.push(("pixel_filter", format!("{:?}", o.pixel_filter)));
        }
        if let Some(lens) = o.lens {
            out.push(("lens", format!("radius {}, focus {}", lens.radius, lens.focus)));
        }
        if self.args.paths.energy_compensation {
            out.push(("energy_compensation", "on".into()));
        }
        if let Some(albedo) = o.white_sky {
            out.push(("sky_albedo", albedo.to_string()));
        }
        out.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }

    fn rays(&self) -> u64 {
        self.result.image.primary_rays + self.result.bounce_rays + self.result.shadow_rays
    }

    fn paths(&self) -> u64 {
        self.result.image.primary_rays
    }

    /// Lines for people.
    pub fn lines(&self) -> Vec<String> {
        let ([width, height], s, image) = (self.options.size, &self.seconds, &self.result.image);
        let (mean, error) = image.film.mean_and_error();
        let per_second = |n: u64| n as f64 / s.trace.max(1e-9) / 1e6;
        let mut lines = vec![
            format!(
                "{}: {width}x{height}, {} spp, {}, tracer {} on {}; mean {}{mean:.5} +- {error:.5}",
                self.args.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "),
                image.spp,
                self.args.integrator.name(),
                self.tracer,
                self.device.name,
                if self.options.view.is_some() { "" } else { "radiance " },
            ),
            format!(
                "{:.2} Mpaths/s, {:.2} Mrays/s; a path has {:.2} rays, {:.2} of them to lights; the longest {} bounces (limit {})",
                per_second(self.paths()),
                per_second(self.rays()),
                self.rays() as f64 / self.paths().max(1) as f64,
                self.result.shadow_rays as f64 / self.paths().max(1) as f64,
                self.result.longest_path,
                self.depth(),
            ),
            format!(
                "seconds: load {:.3}, device {:.3} (at the same time), build {:.3}, upload {:.3}, trace {:.3}, aov {:.3}, write {:.3}, \
                 total {:.3}",
                s.load, s.device, self.stats.build_seconds, self.stats.upload_seconds, s.trace, s.aov, s.write, s.total
            ),
        ];
        if self.options.firefly_clamp.is_finite() {
            lines.push(format!("held to radiance {} after the first hit: the image is too dark", self.options.firefly_clamp));
        }
        if image.stopped_early {
            lines.push(format!("stopped early: {} of {} samples per pixel", image.spp, self.options.spp));
        }
        if self.args.explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// What of materials is compiled, and what is not.
    fn shading(&self) -> Option<String> {
        let asked = self.tracer_features.shading?;
        let list = |on: bool| {
            let names = feature::NAMES.iter().filter(|(bit, _)| (asked & bit != 0) == on).map(|f| f.1);
            names.collect::<Vec<_>>().join(", ")
        };
        Some(format!("materials ask for {}; not compiled: {}", list(true), list(false)))
    }

    fn explanations(&self) -> Vec<String> {
        let image = &self.result.image;
        let mut lines = vec![format!("tracer {}: {}", self.tracer, self.why)];
        lines.extend(self.features.iter().cloned());
        lines.extend(self.shading());
        lines.push(match self.result.lights {
            0 => "no light samples: there is nothing to draw them from, or --sampling asks for none".into(),
            n if self.result.light_tree => format!("{n} lights, drawn by what they may do at a point, from a tree"),
            n => format!("{n} lights, drawn by their power"),
        });
        let all = image.primary_rays + image.skipped_primary_rays;
        lines.push(format!(
            "{} of {all} camera rays ({:.1} %) not traced: nothing is in their part of the image",
            image.skipped_primary_rays,
            100.0 * image.skipped_primary_rays as f64 / all.max(1) as f64
        ));
        let steps: Vec<_> = image.device_seconds.iter().map(|(step, s)| format!("{step} {s:.3}")).collect();
        lines.push(format!("device seconds: {}", steps.join(", ")));
        lines
    }

    /// A record for programs.
    pub fn record(&self) -> Value {
        let (image, o) = (&self.result.image, self.options);
        let (mean, error) = image.film.mean_and_error();
        let steps: serde_json::Map<_, _> = image.device_seconds.iter().map(|(l, s)| ((*l).to_owned(), json!(s))).collect();
        let mut record = json!({
            "scene": self.args.scene,
            "output": self.args.output,
            "integrator": self.args.integrator.name(),
            "width": o.size[0],
            "height": o.size[1],
            "spp": image.spp,
            "spp_asked": o.spp,
            "stopped_early": image.stopped_early,
            "seed": o.seed,
            "camera": camera_text(self.camera),
            "environment": self.environment(),
            "max_depth": if o.max_depth >= MOST_DEPTH { Value::Null } else { json!(o.max_depth) },
            "rr_depth": o.rr_depth,
            "firefly_clamp": if o.firefly_clamp.is_finite() { json!(o.firefly_clamp) } else { Value::Null },
            "sampling": o.strategy,
            "sky_albedo": o.white_sky,
            "energy_compensation": self.args.paths.energy_compensation,
            "tracer": self.tracer.name(),
            "tracer_reason": self.why,
            "device": self.device.name,
            "driver": self.device.driver,
            "mean": mean,
            "mean_standard_error": error,
            "not_finite": image.film.not_finite,
            "lights": self.result.lights,
            "triangles": self.scene.triangle_count(),
            "spheres": self.scene.sphere_count(),
            "warnings": self.warnings,
            "rays": {
                "primary": image.primary_rays,
                "skipped_primary": image.skipped_primary_rays,
                "bounce": self.result.bounce_rays,
                "shadow": self.result.shadow_rays,
            },
            "longest_path": self.result.longest_path,
            "seconds": self.seconds,
            "device_steps": steps,
            "longest_launch_seconds": image.longest_launch,
        });
        record["seconds"]["build"] = json!(self.stats.build_seconds);
        record["seconds"]["upload"] = json!(self.stats.upload_seconds);
        if self.args.explain {
            record["explain"] = json!(self.explanations());
        }
        record
    }
}
