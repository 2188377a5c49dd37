//! The figures of a comparison.

use serde::Serialize;

use super::references::{Halves, References};
use super::samples::Samples;
use super::search::{Choice, Curve, Found};
use super::sums::Target;
use super::{PathFit, combine, lit, mean};
use crate::integrators::ao::Occlusion;
use crate::integrators::path::ambient::EnvironmentLight;
use crate::measure::flip::{PIXELS_PER_DEGREE, flip};
use crate::measure::metrics::ImagePair;

/// A radius and falloff, and the ambient radiance that fits best with them.
#[derive(Clone, Debug, Serialize)]
pub struct ChoiceRecord {
    /// AO radius, scene units; `None`: no limit.
    pub radius: Option<f64>,
    /// AO falloff; 1 is binary.
    pub falloff: f64,
    /// Distance at which the occlusion of a hit halves, scene units; `None`: binary.
    pub half_distance: Option<f64>,
    /// Ambient radiance, linear RGB; one value for grey targets.
    pub ambient: Vec<f64>,
    /// Root mean squared error against the target, of converged images.
    pub rmse: f64,
    /// Relative standard error of the radius, or without one of the distance at which occlusion
    /// halves, by leaving out parts of the image; `None` at the end of the range, or for a choice
    /// of both.
    pub standard_error: Option<f64>,
}

/// An approximation, and what it leaves.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub name: &'static str,
    /// Ambient radiance that fits best; empty for none.
    pub ambient: Vec<f64>,
    /// Root mean squared error against the target, of converged images.
    pub rmse: f64,
    /// Share of the target's mean square accounted for: 1 - MSE / mean square, below 0 if harmful.
    pub explained: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct CurveRecord {
    /// AO falloff; 1 is binary.
    pub falloff: f64,
    /// Distance at which the occlusion of a hit halves, scene units; `None`: binary.
    pub half_distance: Option<f64>,
    /// AO radius, scene units; `None`: no limit.
    pub radii: Vec<Option<f64>>,
    /// Root mean squared error with the ambient radiance that fits best.
    pub rmse: Vec<f64>,
}

/// Where the mean squared error of the best fit comes from; the three add up to it.
#[derive(Clone, Debug, Serialize)]
pub struct ErrorParts {
    /// The error with `ao-sky` in place of ambient occlusion, which no ambient radiance can lower.
    pub transport: f64,
    /// Difference of ambient occlusion from `ao-sky`, each with its best ambient radiance.
    pub occlusion: f64,
    /// Twice the product of the two: negative where the differences compensate each other.
    pub cross: f64,
}

/// Metrics of the best `lit` image against the path-traced one, over pixels of nothing but surfaces
/// that reflect ambient light (visible lamps would outweigh them); noise of both counts.
#[derive(Clone, Debug, Serialize)]
pub struct Metrics {
    /// Mean FLIP of linear radiance clamped to 1.
    pub flip: f64,
    /// Tanimoto coefficient of linear radiance.
    pub tanimoto: f64,
    /// Mean minimum ratio of linear radiance.
    pub minimum_ratio: f64,
    /// Mean of `lit` - path.
    pub bias: f64,
}

/// A fit against a target.
#[derive(Clone, Debug, Serialize)]
pub struct FitRecord {
    /// The setting of `lit` that says what ambient light stands for; `None` against `ao-sky`.
    pub environment_light: Option<EnvironmentLight>,
    /// Pixels that count.
    pub pixels: usize,
    /// Root mean square of the target.
    pub target_rms: f64,
    /// Standard error of the target, root mean square over pixels and channels.
    pub target_standard_error: f64,
    /// Approximations, from none to the best.
    pub rows: Vec<Row>,
    pub best: ChoiceRecord,
    /// The best radius of binary occlusion.
    pub binary: ChoiceRecord,
    /// The best falloff without a radius.
    pub falloff: ChoiceRecord,
    /// The best pair of both.
    pub both: ChoiceRecord,
    /// Radii of binary occlusion whose error is within 5 % of the smallest.
    pub good_radii: [Option<f64>; 2],
    /// Where the error of the best choice comes from, mean squares; only against path tracing.
    pub parts: Option<ErrorParts>,
    pub metrics: Metrics,
    pub curves: Vec<CurveRecord>,
}

/// Mean radiance by its origin, over pixels of nothing but surfaces that reflect ambient light.
#[derive(Clone, Debug, Serialize)]
pub struct LightShares {
    /// Mean radiance of the path-traced image, over linear RGB.
    pub mean: f64,
    /// Share of emitted light and of direct light of lights.
    pub lights: f64,
    /// Share of the environment's direct light.
    pub environment: f64,
    /// Share of light of two or more bounces.
    pub bounces: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Report {
    pub scene: String,
    pub size: [u32; 2],
    /// Paths per pixel of each reference.
    pub spp: u32,
    /// Occlusion rays per pixel.
    pub ao_samples: u32,
    pub seed: u32,
    /// A sentence for each setting that was left open and the scene decided.
    pub choices: Vec<String>,
    /// The `choices` as options of `skylit render`; `None` if nothing was left open.
    pub chosen: Option<String>,
    /// Commands that render the best `lit` image of the first fit, and the path-traced one.
    pub commands: Vec<String>,
    /// Diagonal of the scene's bounding box, scene units.
    pub diagonal: f64,
    /// Share of pixels that show surfaces.
    pub covered: f64,
    pub light: LightShares,
    /// Fits against path tracing: first what the environment does, if there is one.
    pub path: Vec<FitRecord>,
    /// Ambient visibility against `ao-sky`; `None` without pixels of nothing but such surfaces.
    pub sky: Option<FitRecord>,
    pub render_seconds: f64,
    pub fit_seconds: f64,
}

impl LightShares {
    pub(super) fn new(references: &References, pixels: &[usize]) -> Self {
        let mean_of = |image: &Halves| {
            let image = mean(image);
            let sum: f64 = pixels.iter().flat_map(|p| &image[3 * p..3 * p + 3]).map(|v| f64::from(*v)).sum();
            sum / (3 * pixels.len()).max(1) as f64
        };
        let (direct, bounces) = (mean_of(&references.direct), mean_of(&references.indirect));
        let lights = references.lights.as_ref().map_or(direct, mean_of);
        let all = direct + bounces;
        let share = |x: f64| if all > 0.0 { x / all } else { 0.0 };
        Self { mean: all, lights: share(lights), environment: share(direct - lights), bounces: share(bounces) }
    }
}

impl ChoiceRecord {
    fn new(choice: &Choice, channels: usize) -> Self {
        let Occlusion { radius, falloff, .. } = choice.occlusion;
        Self {
            radius: finite(radius),
            falloff,
            half_distance: half_distance(falloff),
            ambient: choice.ambient[..channels].to_vec(),
            rmse: choice.mse.max(0.0).sqrt(),
            standard_error: choice.log_error,
        }
    }

    /// The choice as options of `skylit render --integrator lit` or `ao`.
    pub fn options(&self) -> String {
        let radius = Some(format!("--ao-radius {}", self.radius.map_or_else(|| "inf".to_owned(), significant)));
        let falloff = (self.falloff > 1.0).then(|| format!("--ao-falloff {}", significant_falloff(self.falloff)));
        [radius, falloff].into_iter().flatten().collect::<Vec<_>>().join(" ")
    }

    /// The ambient radiance as the value of `--ambient`.
    pub fn color(&self) -> String {
        self.ambient.iter().map(|c| significant(*c)).collect::<Vec<_>>().join(",")
    }
}

fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

fn half_distance(falloff: f64) -> Option<f64> {
    (falloff > 1.0).then(|| 1.0 / falloff.log2())
}

/// A number with four significant digits.
pub fn significant(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let digits = (3 - x.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A falloff with four significant digits of what is above 1.
pub(super) fn significant_falloff(falloff: f64) -> String {
    if falloff <= 1.0 {
        return "1".to_owned();
    }
    if falloff >= 1e6 {
        return format!("{falloff:.3e}");
    }
    let digits = (3 - (falloff - 1.0).log10().floor() as i32).max(0) as usize;
    format!("{falloff:.digits$}")
}

fn curve_record(curve: &Curve) -> CurveRecord {
    CurveRecord {
        falloff: curve.falloff,
        half_distance: half_distance(curve.falloff),
        radii: curve.radii.iter().map(|r| finite(*r)).collect(),
        rmse: curve.rmse.clone(),
    }
}

/// Ends of the interval about the best radius in which the error is within 5 % of the smallest;
/// `None`: as far as was searched.
fn good_radii(curve: &Curve, best: f64) -> [Option<f64>; 2] {
    let least = (0..curve.rmse.len()).min_by(|&a, &b| curve.rmse[a].total_cmp(&curve.rmse[b])).unwrap_or(0);
    let good = |k: &usize| curve.rmse[*k] <= 1.05 * curve.rmse[least];
    let low = (0..=least).rev().take_while(good).last().unwrap_or(least);
    let high = (least..curve.rmse.len()).take_while(good).last().unwrap_or(least);
    // the best lies between two radii of the grid
    [if low == 0 { None } else { Some(curve.radii[low].min(best)) }, finite(curve.radii[high].max(best))]
}

/// Composes rows of one target.
struct Rows<'a> {
    target: &'a Target,
    energy: f64,
    rows: Vec<Row>,
}

impl<'a> Rows<'a> {
    fn new(target: &'a Target) -> Self {
        Self { target, energy: target.energy(), rows: Vec::new() }
    }

    fn push(&mut self, name: &'static str, ambient: Vec<f64>, mse: f64) {
        let explained = 1.0 - mse * self.target.values() / self.energy;
        self.rows.push(Row { name, ambient, rmse: mse.max(0.0).sqrt(), explained });
    }

    fn none(&mut self, name: &'static str) {
        self.push(name, Vec::new(), self.energy / self.target.values());
    }

    /// A signal with its best ambient radiance, which it returns.
    fn fitted(&mut self, name: &'static str, signal: &Halves) -> [f64; 3] {
        let sums = self.target.sums(signal);
        let ambient = sums.ambient();
        self.push(
            name,
            ambient[..self.target.channels].to_vec(),
            (self.energy - sums.explained()) / self.target.values(),
        );
        ambient
    }

    fn choice(&mut self, name: &'static str, choice: &Choice) {
        self.push(name, choice.ambient[..self.target.channels].to_vec(), choice.mse);
    }
}

fn scaled(signal: &Halves, color: [f64; 3], channels: usize) -> Halves {
    [0, 1].map(|h| signal[h].iter().enumerate().map(|(k, v)| v * color[k % channels] as f32).collect())
}

const UNLIMITED: Occlusion = Occlusion::new(f64::INFINITY, 1.0);

/// The record of a fit against path tracing.
pub(super) fn fit_record(fit: &PathFit, light: EnvironmentLight) -> FitRecord {
    let (target, found, samples) = (fit.target, fit.found, &fit.references.samples);
    let mut rows = Rows::new(target);
    rows.none("no ambient light");
    let reflectance = samples.reflectance();
    rows.fitted("ambient light without occlusion", &reflectance);
    rows.fitted("AO without radius or falloff", &samples.ambient(UNLIMITED));
    rows.choice("AO with the best radius", &found.binary);
    rows.choice("AO with the best falloff", &found.falloff);
    rows.choice("AO with the best radius and falloff", &found.both);
    let sky =
        [0, 1].map(|h| reflectance[h].iter().enumerate().map(|(k, r)| r * fit.references.sky[h][k / 3]).collect());
    let color = rows.fitted("ao-sky in place of AO", &sky);
    // error = (sky - target) + (ao - sky)
    let sky = scaled(&sky, color, 3);
    let ambient = samples.ambient(found.best.occlusion);
    let ao = scaled(&ambient, found.best.ambient, 3);
    let (transport, occlusion) = (combine(&sky, &target.halves, |a, b| a - b), combine(&ao, &sky, |a, b| a - b));
    let values = target.values();
    let parts = ErrorParts {
        transport: target.product(&transport, &transport) / values,
        occlusion: target.product(&occlusion, &occlusion) / values,
        cross: 2.0 * target.product(&transport, &occlusion) / values,
    };
    let metrics = metrics(&lit(fit.direct, &ambient, found.best.ambient), &mean(fit.path), target, &samples.diffuse());
    // no sky reaches a closed room: there is nothing to compare with
    let parts = color.iter().any(|c| *c > 0.0).then_some(parts);
    record(Some(light), target, found, rows.rows, parts, metrics)
}

/// The record of a fit of ambient visibility against `ao-sky`.
pub(super) fn sky_record(samples: &Samples, target: &Target, found: &Found) -> FitRecord {
    let mut rows = Rows::new(target);
    let ones = [0, 1].map(|_| vec![1.0; samples.pixels()]);
    rows.fitted("the same everywhere", &ones);
    let unlimited = samples.visibility(UNLIMITED);
    let difference = combine(&unlimited, &target.halves, |a, b| a - b);
    rows.push(
        "AO without radius or falloff, as it is",
        vec![1.0],
        target.product(&difference, &difference) / target.values(),
    );
    rows.fitted("AO without radius or falloff", &unlimited);
    rows.choice("AO with the best radius", &found.binary);
    rows.choice("AO with the best falloff", &found.falloff);
    rows.choice("AO with the best radius and falloff", &found.both);
    let best = mean(&scaled(&samples.visibility(found.best.occlusion), found.best.ambient, 1));
    record(None, target, found, rows.rows, None, metrics(&best, &mean(&target.halves), target, &target.pixels))
}

fn record(
    environment_light: Option<EnvironmentLight>,
    target: &Target,
    found: &Found,
    rows: Vec<Row>,
    parts: Option<ErrorParts>,
    metrics: Metrics,
) -> FitRecord {
    let choice = |c: &Choice| ChoiceRecord::new(c, target.channels);
    FitRecord {
        environment_light,
        pixels: target.pixels.len(),
        target_rms: (target.energy() / target.values()).max(0.0).sqrt(),
        target_standard_error: target.standard_error(),
        rows,
        best: choice(&found.best),
        binary: choice(&found.binary),
        falloff: choice(&found.falloff),
        both: choice(&found.both),
        good_radii: found.curves.first().map_or([None; 2], |c| good_radii(c, found.binary.occlusion.radius)),
        parts,
        metrics,
        curves: found.curves.iter().map(curve_record).collect(),
    }
}

fn metrics(image: &[f32], reference: &[f32], target: &Target, pixels: &[usize]) -> Metrics {
    let mut coverage = vec![0.0f32; reference.len() / target.channels];
    pixels.iter().for_each(|p| coverage[*p] = 1.0);
    let nan = Metrics { flip: f64::NAN, tanimoto: f64::NAN, minimum_ratio: f64::NAN, bias: f64::NAN };
    let Ok(pair) = ImagePair::new(image, reference, target.channels, Some(&coverage)) else { return nan };
    let clamped = |image: &[f32]| image.iter().map(|v| v.clamp(0.0, 1.0)).collect::<Vec<_>>();
    let (a, b) = (clamped(image), clamped(reference));
    let shown = ImagePair::new(&a, &b, target.channels, Some(&coverage))
        .and_then(|p| flip(&p, target.width, PIXELS_PER_DEGREE));
    Metrics {
        flip: shown.map_or(f64::NAN, |f| f.mean),
        tanimoto: pair.tanimoto(),
        minimum_ratio: pair.minimum_ratio(),
        bias: pair.bias(),
    }
}
