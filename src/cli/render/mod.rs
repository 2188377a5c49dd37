//! `skylit render`: renders a scene, stills or frames in real time.

mod args;
mod frame_files;

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use args::RenderArgs;
use frame_files::FrameFiles;

use crate::error::{Error, Result};
use crate::files;
use crate::film::Control;
use crate::integrators::aov::AovPixel;
use crate::output::{self, Channel, Image, ImageFormat, Samples, png};
use crate::ray::Ray;
use crate::renderer::Renderer;
use crate::renderer::still::StillExtras;
use crate::scene::RenderHints;
use crate::terminal::console::{Console, Failure};
use crate::terminal::interrupt::{self, ProgressControl, SilentControl};
use crate::terminal::progress::Progress;

/// Loads, renders, writes, reports.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    let args = &args.with_settings_file()?;
    args.check()?;
    match args.settings.realtime_setting() {
        Some(_) => frames(args, start),
        None => still(args, start),
    }
}

fn still(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    for path in args.outputs() {
        files::check_writable(&path)?;
    }
    interrupt::install();
    let console = args.verbosity.console();
    let mut renderer = Renderer::open(&args.scene, &args.device)?;
    interrupt::check()?;
    check_intervals(args, &renderer.scene().hints, args.settings.spp(renderer.scene()))?;
    let mut control = CliControl::new(args, console);
    let extras = StillExtras { keep_rays: args.dump_rays.is_some(), aov: args.depth_image.is_some() };
    let still = renderer.still_with(&args.settings, extras, &mut control, &mut |on_way| {
        args.output.iter().try_for_each(|path| on_way.save(&interval_path(path, on_way.samples)))
    })?;
    drop(control);
    let write_start = Instant::now();
    write_rays(args, &still.rays)?;
    if let Some(path) = &args.depth_image {
        write_depth(path, &still.aov, still.report.size)?;
    }
    args.output.iter().try_for_each(|path| still.save(path))?;
    let mut report = still.report;
    report.seconds.write = write_start.elapsed().as_secs_f64();
    report.seconds.total = start.elapsed().as_secs_f64();
    for line in report.lines(&names(args), args.explain) {
        console.line(&line)?;
    }
    if report.setup.wants_depth_image && args.depth_image.is_none() {
        console.line("the scene requests a depth image: add --depth-image FILE")?;
    }
    let mut record = report.record(args.explain);
    record["output"] = serde_json::json!(args.output);
    let interrupted = args.keep_partial && interrupt::requested();
    console.close(&record, if interrupted { Err(Error::Interrupted) } else { Ok(()) })
}

fn frames(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    let timeline = &args.settings.frames;
    // report invalid settings before anything is loaded
    crate::renderer::frames::frame_settings(&args.settings)?;
    timeline.check_outputs(&args.output)?;
    let range = timeline.range();
    for path in &args.output {
        files::check_writable(&output::frames::numbered(path, u64::from(range.first))?)?;
    }
    interrupt::install();
    let console = args.verbosity.console();
    let mut renderer = Renderer::open(&args.scene, &args.device)?;
    interrupt::check()?;
    let mut control = CliControl::new(args, console);
    let mut frames = renderer.frames(&args.settings, args.writes_picture(), &mut control)?;
    let colour = timeline.show.unwrap_or_default().colour();
    let mut files = FrameFiles::create(&args.output, frames.size(), range.end - range.first, frames.fps(), colour)?;
    let (mut done, all, mut write_seconds) = (0, u64::from(frames.count()), 0.0);
    while let Some(frame) = frames.advance()? {
        if frame.kept {
            let write_start = Instant::now();
            let image = if args.writes_exr() { Some(frames.image(&mut SilentControl)?) } else { None };
            files.add(frame.number, frames.size(), image.as_ref(), frames.displayed())?;
            write_seconds += write_start.elapsed().as_secs_f64();
        }
        done += 1;
        control.progress(done, all);
        interrupt::check()?;
    }
    files.finish()?;
    drop(control);
    let mut report = frames.report();
    report.seconds.write = write_seconds;
    report.seconds.total = start.elapsed().as_secs_f64();
    for line in report.lines(&names(args), args.explain) {
        console.line(&line)?;
    }
    let mut record = report.record(args.explain);
    record["output"] = serde_json::json!(args.output);
    console.close(&record, Ok(()))
}

/// Progress bar and interruption by Ctrl-C; warnings are printed at once.
struct CliControl {
    progress: ProgressControl,
    console: Console,
}

impl CliControl {
    fn new(args: &RenderArgs, console: Console) -> Self {
        let progress = Progress::new("rendering", &console);
        Self { progress: ProgressControl { progress, keep_partial: args.keep_partial }, console }
    }
}

impl Control for CliControl {
    fn progress(&mut self, done: u64, total: u64) {
        self.progress.progress(done, total);
    }

    fn warning(&mut self, text: &str) {
        self.progress.progress.suspend(|| self.console.warning(&crate::terminal::console::one_line(text)));
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.progress.should_stop()
    }
}

/// The outputs' names in a line.
fn names(args: &RenderArgs) -> String {
    args.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Checks before rendering starts that intermediate images can be written.
fn check_intervals(args: &RenderArgs, hints: &RenderHints, spp: u32) -> Result<()> {
    let intervals = crate::renderer::still::intervals(&args.settings, hints, spp);
    let check = |path: &PathBuf| intervals.iter().try_for_each(|&n| files::check_writable(&interval_path(path, n)));
    args.output.iter().try_for_each(check)
}

/// NAME.0016.exr: name of an output's intermediate image with `samples` samples.
fn interval_path(path: &Path, samples: u32) -> PathBuf {
    let mut name = OsString::from(path.file_stem().unwrap_or_default());
    name.push(format!(".{samples:04}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

fn write_depth(path: &Path, pixels: &[AovPixel], size: [u32; 2]) -> Result<()> {
    let depth: Vec<f32> = pixels.iter().map(|p| p.depth).collect();
    match ImageFormat::of(path)? {
        ImageFormat::Png => png::write_grey(path, &png::depth_to_grey(&depth), size[0], size[1]),
        ImageFormat::Exr => {
            let channels = vec![Channel { name: "depth.Z".into(), samples: Samples::F32(depth) }];
            output::save(&Image { width: size[0], height: size[1], channels, metadata: Vec::new() }, path)
        }
    }
}

fn write_rays(args: &RenderArgs, rays: &[Vec<Ray>; 2]) -> Result<()> {
    let Some(prefix) = &args.dump_rays else { return Ok(()) };
    for (kind, rays) in ["primary", "ao"].into_iter().zip(rays) {
        files::write_atomically(&args::dump_path(prefix, kind), |file| file.write_all(bytemuck::cast_slice(rays)))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_intervals() {
        let of = |path: &str, n: u32| interval_path(path.as_ref(), n).to_string_lossy().into_owned();
        assert_eq!(of("out/a.exr", 16), "out/a.0016.exr");
        assert_eq!(of("a.b.png", 65536), "a.b.65536.png");
    }
}
