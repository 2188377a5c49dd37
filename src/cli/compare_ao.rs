//! `skylit compare ao-vs-path`: is ambient occlusion a stand-in for global illumination in a view,
//! and with which radius, falloff and ambient colour?

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueHint};

use super::args::LoadArgs;
use crate::compare::ao_versus_path::{self, AoVersusPathSettings, ChoiceRecord, FitRecord, Report, page, significant};
use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::film::Control;
use crate::integrators::ao::Hemisphere;
use crate::integrators::lighting::LightingSettings;
use crate::output::{self, ImageFormat, parse_size};
use crate::renderer::settings::CameraSettings;
use crate::report;
use crate::scene::SceneSettings;
use crate::settings::parse::{parse_albedo, parse_positive};
use crate::terminal::console::{Verbosity, command_line};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::terminal::warnings::Warnings;
use crate::tracer::DeviceSettings;

const EXAMPLES: &str = "\
Examples:
  skylit compare ao-vs-path scene.glb
  skylit compare ao-vs-path scene.glb --spp 128 --ao-samples 256 --html report --output best.exr";

/// `skylit compare ao-vs-path`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct AoVsPathArgs {
    /// Scene: a .gltf, .glb, .obj or .brhan file, or builtin:NAME (`skylit scenes` lists them)
    #[arg(value_hint = ValueHint::FilePath)]
    scene: String,
    /// Image size in pixels
    #[arg(long, value_name = "WxH", value_parser = parse_size, default_value = "640x360")]
    size: [u32; 2],
    /// Paths per pixel of the references
    ///
    /// Their noise does not count as an error, but makes the result uncertain.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(2..=1 << 20))]
    spp: u32,
    /// Occlusion rays per pixel
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(2..=1 << 12))]
    ao_samples: u32,
    /// Seed of the sampler
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Normal of the hemisphere that AO samples [default: geometric]
    #[arg(long, value_enum)]
    ao_normal: Option<Hemisphere>,
    /// Maximum path length in bounces [default: the scene's, or no limit]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    max_depth: Option<u32>,
    /// Clamp indirect radiance to X (reduces fireflies; biased) [default: off]
    #[arg(long, value_name = "X", value_parser = parse_positive, allow_hyphen_values = true)]
    firefly_clamp: Option<f64>,
    /// Albedo of all surfaces in ao-sky [default: 0.5]
    #[arg(long, value_name = "X", value_parser = parse_albedo, allow_hyphen_values = true)]
    sky_albedo: Option<f64>,
    /// Also write the best `lit` image (R, G, B) with the layers path, direct, ao and sky
    #[arg(long, short, value_name = "FILE.exr", value_hint = ValueHint::FilePath)]
    output: Option<PathBuf>,
    /// Write a report into this folder: a page that needs no network
    ///
    /// It has images, differences, tables and curves.
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    html: Option<PathBuf>,
    /// Also plot the error over the radius, a line per falloff
    #[cfg(feature = "bench")]
    #[arg(long, value_name = "FILE.svg", value_hint = ValueHint::FilePath)]
    plot: Option<PathBuf>,
    #[command(flatten)]
    load: LoadArgs,
    #[command(flatten)]
    meaning: SceneSettings,
    #[command(flatten)]
    camera: CameraSettings,
    #[command(flatten)]
    lighting: LightingSettings,
    #[command(flatten)]
    device: DeviceSettings,
    #[command(flatten)]
    verbosity: Verbosity,
}

/// Compares and prints.
pub fn run(args: &AoVsPathArgs, start: Instant) -> Result<()> {
    let plan = args.check()?;
    interrupt::install();
    let console = args.verbosity.console();
    let mut renderer = args.load.open(&args.scene, &args.device, &console)?;
    plan.check_scene(&renderer.scene().report.files)?;
    interrupt::check()?;
    let mut control = CompareControl {
        progress: ProgressControl { progress: Progress::new("comparing", &console), keep_partial: false },
        warnings: Warnings::new(console),
    };
    let found = ao_versus_path::run(&mut renderer, &args.settings(), &mut control)?;
    let CompareControl { progress, warnings } = control;
    drop(progress);
    if let Some(path) = &args.output {
        output::save(&found.image, path)?;
    }
    #[cfg(feature = "bench")]
    if let Some(path) = &args.plot {
        plot::write(path, &found.report)?;
    }
    let page = |dir: &PathBuf| report::write(dir, &page::page(&found, &command_line(), &warnings.list)?);
    let index = args.html.as_ref().map(page).transpose()?;
    let seconds = start.elapsed().as_secs_f64();
    lines(&found.report, seconds).iter().try_for_each(|line| console.line(line))?;
    let mut record = serde_json::to_value(&found.report)
        .map_err(|e| Error::CheckFailed(format!("cannot express the result as JSON: {e}")))?;
    record["tracer"] = renderer.tracer_kind().0.name().into();
    record["device"] = renderer.device().info.name.clone().into();
    record["seconds"] = seconds.into();
    record["warnings"] = warnings.list.clone().into();
    if let Some(index) = &index {
        console.line(&format!("report: {}", report::address(index)))?;
    }
    record["report"] = serde_json::json!(index);
    console.record(&record)
}

impl AoVsPathArgs {
    /// Checks the arguments, and returns which files are read and written.
    fn check(&self) -> Result<FilePlan> {
        self.device.check_with_files()?;
        self.camera.check()?;
        let mut plan = FilePlan::default();
        plan.reads("the scene", &self.scene);
        self.lighting.environment_file().iter().for_each(|path| plan.reads_images("--environment", path));
        self.output.iter().for_each(|path| plan.writes("--output", path));
        self.html.iter().for_each(|folder| plan.writes_report("--html", folder));
        #[cfg(feature = "bench")]
        self.plot.iter().for_each(|path| plan.writes("--plot", path));
        plan.check()?;
        if let Some(path) = &self.output {
            if ImageFormat::from_path(path)? != ImageFormat::Exr {
                return Err(Error::Usage(format!(
                    "--output {}: the name must end in .exr, which holds all layers",
                    path.display()
                )));
            }
            crate::files::check_writable(path)?;
        }
        self.html.iter().try_for_each(|folder| plan.make_folder(folder))?;
        #[cfg(feature = "bench")]
        if let Some(path) = &self.plot {
            plot::check(path)?;
        }
        Ok(plan)
    }

    fn settings(&self) -> AoVersusPathSettings {
        AoVersusPathSettings {
            size: self.size,
            spp: self.spp,
            ao_samples: self.ao_samples,
            seed: self.seed,
            scene: self.meaning.clone(),
            camera: self.camera.clone(),
            lighting: self.lighting.clone(),
            max_depth: self.max_depth,
            firefly_clamp: self.firefly_clamp,
            sky_albedo: self.sky_albedo,
            ao_normal: self.ao_normal,
        }
    }
}

/// Progress, Ctrl-C and warnings.
struct CompareControl {
    progress: ProgressControl,
    warnings: Warnings,
}

impl Control for CompareControl {
    fn progress(&mut self, done: u64, total: u64) {
        self.progress.progress(done, total);
    }

    fn warning(&mut self, text: &str) {
        // each render of a scene repeats those of the scene
        if !self.warnings.list.iter().any(|w| w == text) {
            let warnings = &mut self.warnings;
            self.progress.progress.suspend(|| warnings.add(text));
        }
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.progress.should_stop()
    }
}

/// The report as text.
fn lines(report: &Report, seconds: f64) -> Vec<String> {
    let [width, height] = report.size;
    let light = &report.light;
    let percent = |x: f64| format!("{:.0} %", 100.0 * x);
    let mut lines = vec![
        format!(
            "{}: {width}x{height}, {} paths and {} occlusion rays per pixel; surfaces in {} of the pixels",
            report.scene,
            report.spp,
            report.ao_samples,
            percent(report.covered)
        ),
        format!(
            "mean radiance {}: {} from lights and emitters, {} directly from the environment, {} after two bounces or more",
            significant(light.mean),
            percent(light.lights),
            percent(light.environment),
            percent(light.bounces)
        ),
    ];

    // what was found, and commands that show it
    lines.extend(report.choices.iter().cloned());
    for fit in report.path.iter().chain(&report.sky) {
        lines.push(String::new());
        lines.extend(fit_lines(fit));
    }
    if let Some(fit) = report.path.first() {
        lines.push(String::new());
        lines.push(if fit.best.rmse > 0.0 {
            format!(
                "two images that differ by the RMSE of the best, {}, over the pixels that show surfaces, and by their noise:",
                significant(fit.best.rmse)
            )
        } else {
            "two images that differ by less than the noise of these samples tells:".to_owned()
        });
        lines.extend(report.commands.iter().cloned());
    }
    lines.push(format!(
        "{:.1} s: {:.1} s of rendering, {:.1} s of search",
        seconds, report.render_seconds, report.fit_seconds
    ));
    lines
}

fn fit_lines(fit: &FitRecord) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{}: root mean square {}, standard error of the reference {}",
            page::title(fit),
            significant(fit.target_rms),
            significant(fit.target_standard_error)
        ),
        format!("  {:<42} {:>9}  {:>9}  ambient", "", "RMSE", "explained"),
    ];
    for row in &fit.rows {
        let ambient = row.ambient.iter().map(|c| significant(*c)).collect::<Vec<_>>().join(", ");
        let line =
            format!("  {:<42} {:>9}  {:>7.1} %  {ambient}", row.name, significant(row.rmse), 100.0 * row.explained);
        lines.push(line.trim_end().to_owned());
    }
    lines.push(format!(
        "  best radius {}; error within 5 % for {}",
        choice_text(&fit.binary),
        interval(fit.good_radii)
    ));
    lines.push(format!("  best falloff {}", choice_text(&fit.falloff)));

    // none of a sum that noise makes negative
    if let Some((parts, all)) =
        fit.parts.as_ref().map(|p| (p, p.transport + p.occlusion + p.cross)).filter(|p| p.1 > 0.0)
    {
        let share = |x: f64| format!("{:+.0} %", 100.0 * x / all);
        lines.push(format!(
            "  squared error of the best: {} left by ao-sky in place of AO, {} AO against ao-sky, {} both together",
            share(parts.transport),
            share(parts.occlusion),
            share(parts.cross)
        ));
    }

    // the best image by other metrics
    let m = &fit.metrics;
    lines.push(format!(
        "  the best image: FLIP {:.4}, Tanimoto {:.4}, minimum ratio {:.4}, bias {:+.2e}",
        m.flip, m.tanimoto, m.minimum_ratio, m.bias
    ));
    lines
}

fn choice_text(choice: &ChoiceRecord) -> String {
    let error = choice.standard_error.map_or(String::new(), |e| format!(" +- {:.1} %", 100.0 * e));
    match (choice.radius, choice.half_distance) {
        (Some(radius), None) if choice.standard_error.is_none() => {
            format!("none: down to {} the error falls with the radius", significant(radius))
        }
        (Some(radius), None) => format!("{}{error}", significant(radius)),
        (None, Some(half)) => {
            let falloff = choice.options();
            format!(
                "{} (occlusion halves every {}{error})",
                falloff.trim_start_matches("--ao-falloff "),
                significant(half)
            )
        }
        (None, None) => "unlimited".into(),
        (Some(radius), Some(half)) => {
            format!("radius {}, occlusion halves every {}", significant(radius), significant(half))
        }
    }
}

fn interval([low, high]: [Option<f64>; 2]) -> String {
    match (low, high) {
        (Some(low), Some(high)) => format!("{} to {}", significant(low), significant(high)),
        (None, Some(high)) => format!("any up to {}", significant(high)),
        (Some(low), None) => format!("any from {} on", significant(low)),
        (None, None) => "any".into(),
    }
}

/// The plot of error over radius.
#[cfg(feature = "bench")]
mod plot {
    use std::path::Path;

    use super::{FitRecord, Report, Result, page, report};
    use crate::integrators::path::ambient::EnvironmentLight;
    use crate::report::{Axis, Chart, Mark};

    /// Checks before anything is rendered that the plot can be written.
    pub fn check(path: &Path) -> Result<()> {
        report::check_svg_name("--plot", path)?;
        crate::files::check_writable(path)
    }

    /// Draws a chart per fit.
    pub fn write(path: &Path, found: &Report) -> Result<()> {
        let title = format!("{}: ambient occlusion against path tracing", page::scene_name(&found.scene));
        let subtitle = format!(
            "{}x{}, {} paths and {} occlusion rays per pixel; the ambient colour is the best one everywhere",
            found.size[0], found.size[1], found.spp, found.ao_samples
        );
        let charts: Vec<Chart> = found.path.iter().chain(&found.sky).map(chart).collect();
        report::write_svg(path, &title, &subtitle, &charts)
    }

    fn chart(fit: &FitRecord) -> Chart {
        let title = match fit.environment_light {
            Some(EnvironmentLight::Ambient) => "path tracing; ambient: environment and bounces",
            Some(EnvironmentLight::Traced) => "path tracing; ambient: bounces",
            None => "ao-sky",
        };
        Chart {
            title: title.into(),
            caption: "Error by the radius of ambient occlusion.".into(),
            x: Axis::logarithmic("AO radius, scene units"),
            y: Axis::logarithmic("RMSE"),
            series: page::error_curves(fit, Mark::LineAndPoints),
        }
    }
}
