//! What `skylit render` tells of path-traced images: metadata of the image, lines for people, a record for programs.

use serde_json::{Value, json};

use super::denoise::Told as Denoised;
use crate::accel::features::SceneFeatures;
use crate::cli::args::RenderArgs;
use crate::cli::film::{Identity, Maker, Told, metadata, spp_text};
use crate::cli::report::{Seconds, camera_text};
use crate::film::accumulate::Accumulated;
use crate::gpu::DeviceInfo;
use crate::integrators::path::{MOST_DEPTH, PathOptions, PathResult, PixelFilter, TextureFilter};
use crate::scene::{Camera, Environment, Scene};
use crate::tracer::{BuildStats, TracerKind};

/// What the image is of.
pub struct About<'a> {
    pub args: &'a RenderArgs,
    pub scene: &'a Scene,
    pub camera: &'a Camera,
    pub device: &'a DeviceInfo,
    pub tracer: TracerKind,
    pub options: PathOptions,
    /// Fingerprints of the scene and of its environment, where the film is kept.
    pub prints: Option<[String; 2]>,
}

/// All there is to say about it.
pub struct Report<'a> {
    pub about: &'a About<'a>,
    /// Why this tracer.
    pub why: String,
    pub result: &'a PathResult,
    /// Of the film.
    pub film: Told,
    pub stats: BuildStats,
    /// What the scene made skip.
    pub features: Vec<String>,
    pub tracer_features: SceneFeatures,
    pub warnings: Vec<String>,
    pub seconds: Seconds,
    /// Of the denoiser, if there was one.
    pub denoised: Option<Denoised>,
}

impl About<'_> {
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

    /// What has to agree when the image is gone on with: all that its samples depend on, but for its size.
    pub fn identity(&self) -> Identity {
        // no `..`: a new option has to be put where it belongs
        let PathOptions {
            size: _,
            spp: _,
            time_limit: _,
            cover: _,
            film: _,
            seed,
            max_depth: _,
            rr_depth,
            firefly_clamp,
            strategy,
            white_sky,
            view: _,
            pixel_filter,
            texture_filter,
            lens,
        } = &self.options;
        let [scene, environment] = match &self.prints {
            Some(prints) => prints.each_ref().map(|p| Some(p.clone())),
            None => [None, None],
        };
        vec![
            ("version", Some(env!("CARGO_PKG_VERSION").into())),
            ("integrator", Some(self.args.integrator.name())),
            ("scene.hash", scene),
            ("environment", Some(self.environment())),
            ("environment.hash", environment.filter(|_| white_sky.is_none())),
            ("camera", Some(camera_text(self.camera))),
            ("seed", Some(seed.to_string())),
            ("max_depth", Some(self.depth())),
            ("rr_depth", Some(rr_depth.to_string())),
            ("sampling", Some(format!("{strategy:?}").to_lowercase())),
            ("firefly_clamp", firefly_clamp.is_finite().then(|| firefly_clamp.to_string())),
            ("pixel_filter", (*pixel_filter != PixelFilter::Box).then(|| format!("{pixel_filter:?}"))),
            ("texture_filter", (*texture_filter != TextureFilter::Bilinear).then(|| "ray-cone".into())),
            ("lens", lens.map(|lens| format!("radius {}, focus {}", lens.radius, lens.focus))),
            ("energy_compensation", self.args.paths.energy_compensation.then(|| "on".into())),
            ("sky_albedo", white_sky.map(|albedo| albedo.to_string())),
        ]
    }

    /// What made it.
    pub fn maker(&self) -> Maker {
        [("tracer", self.tracer.name().into()), ("device", format!("{} ({})", self.device.name, self.device.driver))]
    }

    /// Text attributes of the image.
    pub fn metadata(&self, image: &Accumulated) -> Vec<(String, String)> {
        metadata(self.args, spp_text(image.spp, image.most_spp), &self.maker(), &self.identity())
    }
}

impl Report<'_> {
    fn rays(&self) -> u64 {
        self.result.image.primary_rays + self.result.bounce_rays + self.result.shadow_rays
    }

    fn paths(&self) -> u64 {
        self.result.image.primary_rays
    }

    /// Lines for people.
    pub fn lines(&self) -> Vec<String> {
        let ([width, height], s, image) = (self.about.options.size, &self.seconds, &self.result.image);
        let (mean, error) = image.film.mean_and_error();
        let per_second = |n: u64| n as f64 / s.trace.max(1e-9) / 1e6;
        let mut lines = vec![
            format!(
                "{}: {width}x{height}, {} spp, {}, tracer {} on {}; mean {}{mean:.5} +- {error:.5}",
                self.about.args.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", "),
                spp_text(image.spp, image.most_spp),
                self.about.args.integrator.name(),
                self.about.tracer,
                self.about.device.name,
                if self.about.options.view.is_some() { "" } else { "radiance " },
            ),
            format!(
                "{:.2} Mpaths/s, {:.2} Mrays/s; a path has {:.2} rays, {:.2} of them to lights; the longest {} bounces (limit {})",
                per_second(self.paths()),
                per_second(self.rays()),
                self.rays() as f64 / self.paths().max(1) as f64,
                self.result.shadow_rays as f64 / self.paths().max(1) as f64,
                self.result.longest_path,
                self.about.depth(),
            ),
            format!(
                "seconds: load {:.3}, device {:.3} (at the same time), build {:.3}, upload {:.3}, trace {:.3}, aov {:.3}, write {:.3}, \
                 total {:.3}",
                s.load, s.device, self.stats.build_seconds, self.stats.upload_seconds, s.trace, s.aov, s.write, s.total
            ),
        ];
        if self.about.options.firefly_clamp.is_finite() {
            lines.push(format!("indirect radiance clamped to {}: biased, too dark", self.about.options.firefly_clamp));
        }
        if self.about.options.texture_filter == TextureFilter::RayCone {
            lines.push("textures filtered by ray cones: blurred, however many samples (biased)".into());
        }
        lines.extend(self.denoised.iter().map(|d| d.line.clone()));
        lines.extend(self.film.lines.iter().cloned());
        if image.stopped_early {
            lines.push(format!("stopped early: {} of {} samples per pixel", image.spp, self.about.options.spp));
        }
        if self.about.args.explain {
            lines.extend(self.explanations().into_iter().map(|l| format!("explain: {l}")));
        }
        lines
    }

    /// What of materials, textures and transport is compiled, and what is not.
    fn compiled(&self) -> Vec<String> {
        let shading = self.tracer_features.shading.unwrap_or_default();
        vec![
            compiled("materials require", shading.materials.labels()),
            compiled("textures beside base colours:", shading.textures.labels()),
            compiled("lights and options require", self.result.features.labels()),
        ]
    }

    fn mip_levels(&self) -> String {
        match self.about.options.texture_filter {
            TextureFilter::Bilinear => "mip levels: unused (--texture-filter ray-cone uses them)".into(),
            TextureFilter::RayCone if self.stats.mip_levels == 0 => "mip levels: none, no surface has a texture".into(),
            TextureFilter::RayCone => {
                format!("mip levels: up to {}, {} bytes beside the first", self.stats.mip_levels, self.stats.mip_bytes)
            }
        }
    }

    fn explanations(&self) -> Vec<String> {
        let image = &self.result.image;
        let mut lines = vec![format!("tracer {}: {}", self.about.tracer, self.why)];
        lines.extend(self.features.iter().cloned());
        lines.extend(self.compiled());
        lines.push(self.mip_levels());
        lines.push(match self.result.lights {
            0 => "no light sampling: there are no lights, or --sampling does not use it".into(),
            n if self.result.light_tree => format!("{n} lights, sampled by a light tree"),
            n => format!("{n} lights, sampled by power"),
        });
        let all = image.primary_rays + image.skipped_primary_rays;
        lines.push(format!(
            "{} of {all} camera rays ({:.1} %) not traced: nothing is in their part of the image",
            image.skipped_primary_rays,
            100.0 * image.skipped_primary_rays as f64 / all.max(1) as f64
        ));
        lines.extend(self.denoised.iter().map(|d| d.explanation.clone()));
        let steps: Vec<_> = image.device_seconds.iter().map(|(step, s)| format!("{step} {s:.3}")).collect();
        lines.push(format!("device seconds: {}", steps.join(", ")));
        lines
    }

    /// A record for programs.
    pub fn record(&self) -> Value {
        let (image, o) = (&self.result.image, &self.about.options);
        let (mean, error) = image.film.mean_and_error();
        let steps: serde_json::Map<_, _> = image.device_seconds.iter().map(|(l, s)| ((*l).to_owned(), json!(s))).collect();
        let mut record = json!({
            "scene": self.about.args.scene,
            "output": self.about.args.output,
            "integrator": self.about.args.integrator.name(),
            "width": o.size[0],
            "height": o.size[1],
            "spp": image.spp,
            "spp_asked": o.spp,
            "stopped_early": image.stopped_early,
            "seed": o.seed,
            "camera": camera_text(self.about.camera),
            "environment": self.about.environment(),
            "max_depth": if o.max_depth >= MOST_DEPTH { Value::Null } else { json!(o.max_depth) },
            "rr_depth": o.rr_depth,
            "firefly_clamp": if o.firefly_clamp.is_finite() { json!(o.firefly_clamp) } else { Value::Null },
            "sampling": o.strategy,
            "view": o.view,
            "texture_filter": o.texture_filter,
            "mip_levels": self.stats.mip_levels,
            "mip_bytes": self.stats.mip_bytes,
            "sky_albedo": o.white_sky,
            "energy_compensation": self.about.args.paths.energy_compensation,
            "tracer": self.about.tracer.name(),
            "tracer_reason": self.why,
            "device": self.about.device.name,
            "driver": self.about.device.driver,
            "mean": mean,
            "mean_standard_error": error,
            "not_finite": image.film.not_finite,
            "film": self.film.record,
            "lights": self.result.lights,
            "light_tree": self.result.light_tree,
            "triangles": self.about.scene.triangle_count(),
            "spheres": self.about.scene.sphere_count(),
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
        if let Some(denoised) = &self.denoised {
            record["denoise"] = denoised.record.clone();
        }
        if self.about.args.explain {
            record["explain"] = json!(self.explanations());
        }
        record
    }
}

/// Which of the code that `names` stand for is compiled.
fn compiled(what: &str, labels: [Vec<&'static str>; 2]) -> String {
    let [required, other] = labels.map(|labels| if labels.is_empty() { "nothing".into() } else { labels.join(", ") });
    format!("{what} {required}; specialized out: {other}")
}
