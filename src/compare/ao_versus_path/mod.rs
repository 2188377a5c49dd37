//! Is ambient occlusion a stand-in for global illumination (Larsen 2019)? How far is the integrator
//! `lit` from path tracing in a view, with the radius, falloff and ambient colour that fit best?
//!
//! `lit` is D + A V albedo: direct light, and an ambient radiance A by the ambient visibility V of
//! a radius and falloff. Path tracing is T. The search minimizes the mean of (A V albedo - g)^2, g
//! = T - D, over linear RGB and pixels of surfaces. All occlusion rays are traced once, to their
//! nearest hits (`samples`), from whose distances every radius and falloff follows (`sums`,
//! `search`).
//!
//! Where the scene has an environment there are two questions: ambient light in place of bounces,
//! with the environment traced as direct light; and in place of environment and bounces, as
//! renderers do that cannot trace it. A third compares V with `ao-sky`, grey surfaces under a white
//! sky.

pub mod page;
mod references;
mod report;
mod samples;
mod search;
mod sums;

use std::time::Instant;

use glam::DVec3;

pub use report::{ChoiceRecord, CurveRecord, ErrorParts, FitRecord, LightShares, Metrics, Report, Row, significant};

use crate::error::{Error, Result};
use crate::film::Control;
use crate::integrators::ao::{Hemisphere, Occlusion};
use crate::integrators::lighting::LightingSettings;
use crate::integrators::path::ambient::EnvironmentLight;
use crate::output::{Channel, Image, Samples as Values};
use crate::renderer::settings::{CameraSettings, options_text, quoted};
use crate::renderer::{Completed, RenderSettings, Renderer};
use crate::scene::SceneSettings;
use crate::settings::Length;
use references::{Halves, References};
use report::fit_record;
use search::{Found, search};
use sums::Target;

#[derive(Clone, Debug)]
pub struct AoVersusPathSettings {
    pub size: [u32; 2],
    /// Paths per pixel of each reference, in two halves of at least one.
    pub spp: u32,
    /// Occlusion rays per pixel, in two halves of at least one.
    pub ao_samples: u32,
    pub seed: u32,
    /// Meaning of the scene's file.
    pub scene: SceneSettings,
    pub camera: CameraSettings,
    /// Lights in addition to the scene's.
    pub lighting: LightingSettings,
    /// Maximum path length in bounces; `None`: the scene's, or no limit.
    pub max_depth: Option<u32>,
    /// Clamp of indirect radiance; `None`: unclamped.
    pub firefly_clamp: Option<f64>,
    /// Albedo of all surfaces in `ao-sky`; `None`: its default.
    pub sky_albedo: Option<f64>,
    /// Axis of the hemisphere of occlusion rays; `None`: the geometric normal.
    pub ao_normal: Option<Hemisphere>,
}

impl Default for AoVersusPathSettings {
    fn default() -> Self {
        Self {
            size: [640, 360],
            // as good a radius as twice as many samples give (docs/results/ao-versus-path.md)
            spp: 16,
            ao_samples: 32,
            seed: 0,
            scene: SceneSettings::default(),
            camera: CameraSettings::default(),
            lighting: LightingSettings::default(),
            max_depth: None,
            firefly_clamp: None,
            sky_albedo: None,
            ao_normal: None,
        }
    }
}

impl AoVersusPathSettings {
    fn spp_per_half(&self) -> u32 {
        self.spp.div_ceil(2).max(1)
    }

    fn ao_samples_per_half(&self) -> u32 {
        self.ao_samples.div_ceil(2).max(1)
    }

    fn shared(&self) -> RenderSettings {
        let (scene, camera, lighting) = (self.scene.clone(), self.camera.clone(), self.lighting.clone());
        RenderSettings { scene, camera, lighting, ..Default::default() }
    }

    /// These settings with nothing left open, and what was chosen.
    fn completed(&self, renderer: &mut Renderer) -> Result<(Self, Completed)> {
        let mut path = self.shared();
        path.integrator = Some("path".parse()?);
        path.image.size = Some(self.size);
        let completed = renderer.complete(&path, None)?;
        let (camera, lit) = (completed.settings.camera.clone(), path.overridden_by(&completed.chosen));
        Ok((Self { camera, lighting: lit.lighting, ..self.clone() }, completed))
    }

    /// The commands that render the best `lit` image and its path-traced reference.
    fn commands(&self, scene: &str, fits: &[FitRecord]) -> Result<Vec<String>> {
        let Some(fit) = fits.first() else { return Ok(Vec::new()) };
        let mut shared = self.shared();
        (shared.image.size, shared.image.spp) = (Some(self.size), Some(COMMAND_SPP));

        let best = &fit.best;
        let mut lit = RenderSettings { integrator: Some("lit".parse()?), ..shared.clone() };
        lit.integrators.ao.ao_radius = Some(Length::Units(best.radius.map_or(f64::INFINITY, rounded)));
        lit.integrators.ao.ao_falloff = report::significant_falloff(best.falloff).parse().ok().filter(|f| *f > 1.0);
        lit.integrators.ao.ao_normal = self.ao_normal;
        lit.integrators.path.ambient =
            <[f64; 3]>::try_from(&best.ambient[..]).ok().map(|c| DVec3::from(c.map(rounded)));
        lit.integrators.path.environment_light = fit.environment_light.filter(|e| *e == EnvironmentLight::Ambient);

        let mut path = RenderSettings { integrator: Some("path".parse()?), ..shared };
        (path.integrators.path.max_depth, path.integrators.path.firefly_clamp) = (self.max_depth, self.firefly_clamp);
        let command = |settings: &RenderSettings, name: &str| {
            format!("skylit render {} {} -o {name}.exr", quoted(scene), options_text(settings))
        };
        Ok(vec![command(&lit, "lit"), command(&path, "path")])
    }
}

/// A number as it is printed.
fn rounded(x: f64) -> f64 {
    crate::renderer::survey::significant(x, 4)
}

struct Steps<'a> {
    control: &'a mut dyn Control,
    /// Share of the work that was done before, and that of this part.
    first: f64,
    share: f64,
}

impl Control for Steps<'_> {
    fn progress(&mut self, done: u64, total: u64) {
        const UNITS: f64 = 1000.0;
        let at = self.first + self.share * done as f64 / total.max(1) as f64;
        self.control.progress((UNITS * at) as u64, UNITS as u64);
    }

    fn warning(&mut self, text: &str) {
        self.control.warning(text);
    }

    // what a reference has of the light may well be black: a closed room's sky
    fn brightness(&mut self, _: &str) {}

    fn should_stop(&mut self) -> Result<bool> {
        self.control.should_stop()
    }
}

pub struct AoVersusPath {
    pub report: Report,
    /// The best `lit` image (R, G, B, and A: 1 where a surface is visible), the path-traced one and
    /// direct light (`path`, `direct`), the best ambient visibility (`ao.Y`) and `ao-sky`
    /// (`sky.Y`).
    pub image: Image,
    /// 1 for each pixel that metrics count: nothing but surfaces that reflect ambient light.
    pub counted: Vec<f32>,
}

/// Samples per pixel of images by the report's commands, whose noise is less than most errors.
const COMMAND_SPP: u32 = 1024;

/// Compares ambient light with path tracing. Camera and light that settings leave open are chosen
/// as [`Renderer::complete`] does for `path`.
///
/// # Errors
/// Errors of [`Renderer::still`]; [`Error::Scene`] without surfaces in view or ambient light.
pub fn run(
    renderer: &mut Renderer,
    settings: &AoVersusPathSettings,
    control: &mut dyn Control,
) -> Result<AoVersusPath> {
    let start = Instant::now();
    let (settings, completed) = &settings.completed(renderer)?;
    let references = References::render(renderer, settings, control)?;
    let render_seconds = start.elapsed().as_secs_f64();

    // Limits the search to pixels of surfaces and distances within the scene.
    let fit_start = Instant::now();
    let scene = renderer.scene();
    let diagonal = scene.bounds().map_or(1.0, |(lo, hi)| (hi - lo).length());
    let width = settings.size[0] as usize;
    let covered = references.samples.covered();
    if covered.is_empty() {
        return Err(Error::Scene(format!(
            "{}: the view shows no surface: choose another --camera, or --eye and --target",
            renderer.name()
        )));
    }

    // Fits ambient light to all light but the direct, with and without a traced environment.
    let path = add(&references.direct, &references.indirect);
    let mut fits = Vec::new();
    let mut best = None;
    for (light, direct) in
        [(EnvironmentLight::Ambient, references.lights.as_ref()), (EnvironmentLight::Traced, Some(&references.direct))]
    {
        let Some(direct) = direct else { continue };
        let halves = subtract(&path, direct);
        let target = Target { channels: 3, halves, pixels: covered.clone(), width };
        if target.energy() <= 0.0 {
            continue;
        }
        let found = search(&references.samples, &target, diagonal);
        let view = PathFit { references: &references, direct, path: &path, target: &target, found: &found };
        fits.push(fit_record(&view, light));
        best.get_or_insert((light, found.best));
        control.should_stop()?;
    }
    let Some((light, choice)) = best else {
        return Err(Error::Scene(format!(
            "{}: no light reaches the camera after a bounce, so there is nothing that ambient light could stand for: give --environment or --light",
            renderer.name()
        )));
    };

    // Fits ambient visibility alone to the sky's.
    let diffuse = references.samples.diffuse();
    let sky = Target { channels: 1, halves: references.sky.clone(), pixels: diffuse.clone(), width };
    let sky_fit = (!sky.pixels.is_empty() && sky.energy() > 0.0).then(|| {
        let found = search(&references.samples, &sky, diagonal);
        report::sky_record(&references.samples, &sky, &found)
    });

    // Puts together images and figures.
    let direct =
        references.lights.as_ref().filter(|_| light == EnvironmentLight::Ambient).unwrap_or(&references.direct);
    let image = picture(settings.size, &references, &path, direct, choice.occlusion, choice.ambient);
    let shares = LightShares::new(&references, &diffuse);
    let mut counted = vec![0.0; references.samples.pixels()];
    diffuse.iter().for_each(|&p| counted[p] = 1.0);
    let report = Report {
        scene: renderer.name().to_owned(),
        size: settings.size,
        spp: 2 * settings.spp_per_half(),
        ao_samples: 2 * settings.ao_samples_per_half(),
        seed: settings.seed,
        choices: completed.choices.clone(),
        chosen: completed.options(),
        commands: settings.commands(renderer.name(), &fits)?,
        diagonal,
        covered: covered.len() as f64 / references.samples.pixels() as f64,
        light: shares,
        path: fits,
        sky: sky_fit,
        render_seconds,
        fit_seconds: fit_start.elapsed().as_secs_f64(),
    };
    Ok(AoVersusPath { report, image, counted })
}

/// The results of a fit against path tracing.
struct PathFit<'a> {
    references: &'a References,
    /// The light that is not ambient.
    direct: &'a Halves,
    path: &'a Halves,
    target: &'a Target,
    found: &'a Found,
}

fn combine(a: &Halves, b: &Halves, f: impl Fn(f32, f32) -> f32) -> Halves {
    [0, 1].map(|h| a[h].iter().zip(&b[h]).map(|(a, b)| f(*a, *b)).collect())
}

fn add(a: &Halves, b: &Halves) -> Halves {
    combine(a, b, |a, b| a + b)
}

fn subtract(a: &Halves, b: &Halves) -> Halves {
    combine(a, b, |a, b| a - b)
}

fn mean(halves: &Halves) -> Vec<f32> {
    halves[0].iter().zip(&halves[1]).map(|(a, b)| 0.5 * (a + b)).collect()
}

fn lit(direct: &Halves, ambient: &Halves, color: [f64; 3]) -> Vec<f32> {
    let color = color.map(|c| c as f32);
    mean(direct).iter().zip(mean(ambient)).enumerate().map(|(k, (d, a))| d + color[k % 3] * a).collect()
}

fn picture(
    size: [u32; 2],
    references: &References,
    path: &Halves,
    direct: &Halves,
    occlusion: Occlusion,
    color: [f64; 3],
) -> Image {
    let samples = &references.samples;
    let mut channels = Vec::new();
    let mut planes = |layer: &str, names: &[&str], values: &[f32]| {
        for (c, name) in names.iter().enumerate() {
            let plane = values.iter().skip(c).step_by(names.len()).copied().collect();
            channels.push(Channel { name: format!("{layer}{name}"), samples: Values::F32(plane) });
        }
    };
    let rgb = ["R", "G", "B"];
    planes("", &rgb, &lit(direct, &samples.ambient(occlusion), color));
    planes("path.", &rgb, &mean(path));
    planes("direct.", &rgb, &mean(direct));
    let mut alpha = vec![0.0; samples.pixels()];
    samples.covered().into_iter().for_each(|p| alpha[p] = 1.0);
    planes("", &["A"], &alpha);
    planes("ao.", &["Y"], &mean(&samples.visibility(occlusion)));
    planes("sky.", &["Y"], &mean(&references.sky));
    Image { width: size[0], height: size[1], channels, metadata: vec![("integrator".into(), "lit".into())] }
}
