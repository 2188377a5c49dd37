//! `skylit view`: a window in which a scene is looked at, or, with the feature `probes`, a script
//! that uses it.

#[cfg(feature = "probes")]
use std::path::Path;
use std::path::PathBuf;

use clap::{Args, ValueHint};

use super::args::LoadArgs;
use super::config::{self, ConfigArgs};
use super::image_info;
use crate::error::{Error, Result};
use crate::realtime::frame_settings::FrameSettings;
use crate::renderer::RenderSettings;
use crate::renderer::defaults;
use crate::renderer::settings::ImageSettings;
use crate::scene::load;
use crate::settings::parse::parse_rate;
use crate::terminal::console::{Failure, Verbosity};
use crate::tracer::DeviceSettings;
#[cfg(feature = "probes")]
use crate::viewer::headless;
use crate::viewer::images::Images;
use crate::viewer::{CPU_FRAME_RATE, DEFAULT_SIZE, GPU_FRAME_RATE, Painter, ViewOptions, window};

const EXAMPLES: &str = "\
Examples:
  skylit scene.glb                                       # `view` may be left out
  skylit view scene.glb --integrator path
  skylit view scene.glb --preset quality --ao-radius 2
  skylit view image.exr reference.exr                    # images, their difference and FLIP";

/// `skylit view`.
#[derive(Clone, Debug, Args)]
#[command(before_help = EXAMPLES)]
pub struct ViewArgs {
    /// Scene (.gltf, .glb, .obj, .brhan or builtin:NAME), or images [default: the viewer asks]
    ///
    /// `skylit scenes` lists the built-in scenes. Images are .exr, .hdr, .png, .jpg and .webp
    /// files.
    #[arg(value_name = "SCENE|IMAGE", value_hint = ValueHint::FilePath)]
    pub files: Vec<String>,
    /// Read settings from this file, .json or .toml; options replace what it says
    ///
    /// The viewer saves such files.
    #[arg(long = "settings", value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub settings_file: Option<PathBuf>,
    /// Which files the scene may name.
    #[command(flatten)]
    pub load: LoadArgs,
    /// Files of defaults.
    #[command(flatten)]
    pub config: ConfigArgs,
    /// Frame rate to hold by a lower resolution [default: 10 on CPUs, 30 on GPUs]
    ///
    /// The resolution is lower while something moves. 0 keeps the full resolution.
    #[arg(long, value_name = "N", value_parser = parse_frame_rate)]
    pub frame_rate: Option<f64>,
    /// Who paints the window [default: Vulkan on GPUs, the CPU on CPU drivers]
    #[arg(long, value_enum, hide_short_help = true)]
    pub painter: Option<Painter>,
    /// Run this script without a window, and end
    #[cfg(feature = "probes")]
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, hide = true)]
    pub headless_script: Option<PathBuf>,
    /// What is shown first, and how; --size is the window's
    #[command(flatten)]
    pub settings: RenderSettings,
    /// Device and tracer
    #[command(flatten)]
    pub device: DeviceSettings,
    /// What is printed beside the window
    #[command(flatten)]
    pub verbosity: Verbosity,
}

fn parse_frame_rate(text: &str) -> Result<f64, String> {
    if text.trim() == "0" { Ok(0.0) } else { parse_rate(text) }
}

/// Whether the first argument of the program is a scene or an image, and no command.
pub fn is_file(argument: &str) -> bool {
    argument.starts_with("builtin:") || load::is_scene_file(argument) || image_info::is_image(argument)
}

/// Looks at images.
fn run_images(args: &ViewArgs) -> Result<(), Failure> {
    let is_other = |file: &&String| !image_info::is_image(file);
    if let Some(scene) = args.files.iter().find(is_other) {
        let message = format!("{scene}: a scene and images cannot be looked at together");
        return Err(Error::Usage(message).into());
    }
    let settings =
        RenderSettings { image: ImageSettings { size: None, ..args.settings.image.clone() }, ..args.settings.clone() };
    if let Some(flag) = settings.flags().first() {
        return Err(Error::Usage(format!("{flag} is for scenes: leave it out to look at images")).into());
    }
    let paths: Vec<PathBuf> = args.files.iter().map(PathBuf::from).collect();
    let mut images = Images::load(&paths)?;
    crate::terminal::interrupt::install();
    let size = args.settings.image.size.unwrap_or(DEFAULT_SIZE);
    Ok(window::run_images(&mut images, size)?)
}

/// Refuses settings that have no effect on what is looked at.
fn check_has_effect(settings: &RenderSettings) -> Result<()> {
    let s = &settings.frames;
    let frames = FrameSettings {
        frames: s.frames,
        fps: s.fps,
        camera_path: s.camera_path.clone(),
        orbit: s.orbit,
        warm_up: s.warm_up,
        lead_in: s.lead_in,
        ..Default::default()
    };
    let image =
        ImageSettings { time_limit: settings.image.time_limit, aov: settings.image.aov.clone(), ..Default::default() };
    match [image.given(), settings.film.given(), frames.given()].concat().first() {
        Some(setting) => Err(Error::Usage(format!(
            "{} has no effect on `skylit view`: leave it out, or use `skylit render`",
            setting.option()
        ))),
        None => Ok(()),
    }
}

/// Whether settings with defaults are as good as those `given`: they have an effect on what is
/// looked at, and neither change the size of the window, which --size is here, nor put frames in
/// real time in the place of an integrator.
fn is_shown(settings: &RenderSettings, given: &RenderSettings) -> bool {
    let is_frames = |s: &RenderSettings| s.realtime_setting().is_some();
    // an animation to start with, and its time, select no kind of image
    let keeps_integrator = settings.integrator.is_none() || is_frames(settings) == is_frames(given);
    keeps_integrator
        && settings.image.size == given.image.size
        && settings.camera.check().is_ok()
        && check_has_effect(settings).is_ok()
}

/// Opens the window, or runs the script.
///
/// # Errors
/// Those of the settings, of the window and of the script.
pub fn run(args: &ViewArgs) -> Result<(), Failure> {
    if args.files.iter().any(|file| image_info::is_image(file)) {
        return run_images(args);
    }
    let scene = args.files.first();
    if let Some(second) = args.files.get(1) {
        return Err(Error::Usage(format!("{second}: one scene is looked at at a time; images can be several")).into());
    }
    let given = args.settings.over_file(args.settings_file.as_deref())?;
    given.camera.check()?;
    check_has_effect(&given)?;

    // settings of the command line and of files
    let confine = args.load.confine();
    let files = args.config.files(scene.map(String::as_str), confine)?;
    let resolved = defaults::resolve(&files, &given, &args.device, &|settings| is_shown(settings, &given));
    let (settings, device_settings) = (resolved.settings, resolved.device);
    device_settings.check_with_files()?;
    config::report(args.verbosity.console(), &resolved.reports);

    if args.painter == Some(Painter::Vulkan) {
        // Mesa's CPU driver cannot rasterize with wider vectors; GPUs do not care
        crate::gpu::environment::prefer_vector_bits(256);
    }

    // without a device there is a window all the same: it says what is missing
    let device = crate::gpu::preferred(&device_settings.options()).ok();
    let is_cpu = device.as_ref().is_none_or(|d| d.is_cpu());
    let options = ViewOptions {
        scene: scene.cloned(),
        gltf_scene: args.load.gltf_scene.clone(),
        confine,
        geometry: args.load.geometry(),
        size: settings.image.size,
        settings,
        device: device_settings,
        frame_rate: match args.frame_rate {
            Some(rate) => Some(rate).filter(|r| *r > 0.0),
            None => Some(if is_cpu { CPU_FRAME_RATE } else { GPU_FRAME_RATE }),
        },
        painter: args.painter.unwrap_or(if is_cpu { Painter::Cpu } else { Painter::Vulkan }),
        device_name: device.map(|d| d.name),
    };
    #[cfg(feature = "probes")]
    if let Some(script) = &args.headless_script {
        return run_script(&options, script, &args.verbosity);
    }
    crate::terminal::interrupt::install();
    Ok(window::run(&options)?)
}

/// Runs a script without a window, and prints the figures of its sections.
#[cfg(feature = "probes")]
fn run_script(options: &ViewOptions, script: &Path, verbosity: &Verbosity) -> Result<(), Failure> {
    let console = verbosity.console();
    let sections = headless::run(options, script)?;
    for section in &sections {
        let [median, p95, most] = section.ui_frame_ms;
        let first = section.first_picture_seconds.map_or(String::new(), |s| format!("; first picture after {s:.2} s"));
        console.line(&format!(
            "{}: {:.1} s; interface {median:.1} ms (95 %: {p95:.1}, most: {most:.1}); {} pictures, {:.1} ms (95 %: {:.1}), from input to picture {:.1} ms (95 %: {:.1}){first}; {:.0} MiB",
            section.name,
            section.seconds,
            section.pictures,
            section.picture_ms[0],
            section.picture_ms[1],
            section.latency_ms[0],
            section.latency_ms[1],
            section.memory_mib,
        ))?;
    }
    Ok(console.record(&serde_json::json!({ "sections": sections }))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::parse::parse_args;

    #[test]
    fn settings_without_effect_are_refused() {
        let check = |line: &str| {
            let words: Vec<&str> = line.split_whitespace().collect();
            check_has_effect(&parse_args(&words).unwrap())
        };
        for line in [
            "--time-limit 3",
            "--aov depth",
            "--resume a.exr",
            "--resumable",
            "--frames 0..3",
            "--orbit",
            "--warm-up 2",
        ] {
            let error = check(line).unwrap_err();
            assert!(
                error.to_string().starts_with(line.split(' ').next().unwrap()) && error.exit_code() == 64,
                "{error}"
            );
        }
        for line in
            ["", "--size 800x600 --preset fast --show depth", "--integrator path --max-depth 3 --environment 1,1,1"]
        {
            check(line).unwrap();
        }
    }
}
