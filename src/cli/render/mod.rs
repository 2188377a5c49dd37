//! `skylit render`: renders a scene, stills or frames in real time.

mod args;
mod frame_files;
mod tev;

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

pub use args::RenderArgs;
use frame_files::{FrameContents, FrameFiles};
use tev::{SendError, TevViewer};

use super::config;
use crate::error::{Error, Result};
use crate::files;
use crate::files::plan::FilePlan;
use crate::film::Control;
use crate::integrators::aov::AovPixel;
use crate::output::settings::PngEncoding;
use crate::output::{self, Channel, FileSettings, Image, ImageFormat, Picture, Samples, picture, png};
use crate::ray::Ray;
use crate::renderer::Renderer;
use crate::renderer::defaults::DefaultsReport;
use crate::renderer::still::StillExtras;
use crate::terminal::console::{Console, Failure};
use crate::terminal::interrupt::{self, Abandonable, ProgressControl, SilentControl};
use crate::terminal::progress::Progress;

/// Loads, renders, writes, reports.
pub fn run(args: &RenderArgs, start: Instant) -> Result<(), Failure> {
    let (args, defaults) = &args.with_files()?;
    args.check()?;
    let plan = &args.plan(defaults)?;
    plan.check()?;
    config::report(args.verbosity.console(), defaults);
    match args.settings.realtime_setting() {
        Some(_) => frames(args, defaults, plan, start),
        None if args.settings.is_still_sequence() => stills(args, defaults, plan, start),
        None => still(args, defaults, plan, start),
    }
}

/// A still for each frame. A frame's files are written when it is finished, so a run that was ended
/// goes on with `--continue`.
fn stills(args: &RenderArgs, defaults: &[DefaultsReport], plan: &FilePlan, start: Instant) -> Result<(), Failure> {
    let timeline = &args.settings.frames;
    timeline.check_outputs(&args.output)?;
    let range = timeline.range();

    // files are checked before anything is loaded
    let files_of = |number: u32| {
        args.output.iter().map(|p| output::frames::numbered(p, u64::from(number))).collect::<Result<Vec<_>>>()
    };
    files_of(range.first)?.iter().try_for_each(|path| files::check_writable(path))?;

    interrupt::install();
    let console = args.verbosity.console();
    let _abandonable = Abandonable::begin(console.json);
    let mut renderer = args.load.open(&args.scene, &args.device, &console)?;
    plan.check_scene(&renderer.scene().report.files)?;
    let about_file = FileWarnings::new(args, &renderer);
    let mut stills = renderer.still_sequence(&args.settings)?;
    let mut progress = Progress::new("rendering frames", &console);
    let (mut records, mut warnings, mut finished) = (Vec::new(), Vec::new(), 0);
    let choices = stills.choices().to_vec();

    // a still whose files are finished is not rendered again
    for number in range.first..range.end {
        interrupt::check()?;
        progress.set(u64::from(number - range.first), u64::from(range.end - range.first));
        let paths = files_of(number)?;
        if args.continues
            && paths.iter().all(|p| p.exists())
            && let Some(path) = paths.first()
            && output::load(path).is_ok_and(|image| stills.is_finished(number, &image).unwrap_or(false))
        {
            finished += 1;
            continue;
        }

        let still = stills.render(number, &mut SilentControl)?;
        paths.iter().try_for_each(|path| still.save_with(path, &args.files))?;
        let mut record = still.report.record(args.explain);
        record["frame"] = serde_json::json!(number);
        // each once, and not for every frame
        for warning in &still.report.setup.warnings {
            if !warnings.contains(warning) {
                let shown = about_file.shown(warning);
                shown.iter().for_each(|text| progress.suspend(|| console.warning(text)));
                warnings.push(warning.clone());
            }
        }
        records.push(record);
    }
    drop(progress);

    // totals of all stills
    let seconds = start.elapsed().as_secs_f64();
    let skipped = if finished > 0 { format!(", {finished} finished before") } else { String::new() };
    let samples = match args.settings.film.quality {
        Some(quality) => format!("quality {quality}"),
        None => format!("{} spp", args.settings.image.spp.unwrap_or(0)),
    };
    console.line(&format!(
        "{}: {} stills{skipped}, {}, {samples}, in {seconds:.1} s",
        names(args),
        records.len(),
        args.settings.integrator().name(),
    ))?;
    if args.prints_all() {
        choices.iter().try_for_each(|choice| console.line(choice))?;
    } else if !choices.is_empty() {
        console.line(&choices.join("; "))?;
    }

    let record = serde_json::json!({
        "stills": records,
        "finished_before": finished,
        "warnings": warnings,
        "seconds": seconds,
        "output": args.output,
        "defaults": defaults,
    });
    console.close(&record, Ok(()))
}

fn still(args: &RenderArgs, defaults: &[DefaultsReport], plan: &FilePlan, start: Instant) -> Result<(), Failure> {
    for path in args.outputs() {
        files::check_writable(&path)?;
    }

    // the scene, and what it makes impossible
    interrupt::install();
    let console = args.verbosity.console();
    // it outlives the renderer, whose end takes time, too
    let abandonable = Arc::new(Abandonable::begin(console.json));
    let mut viewer = Viewer::connect(args, console)?;
    let mut renderer = args.load.open(&args.scene, &args.device, &console)?;
    plan.check_scene(&renderer.scene().report.files)?;
    interrupt::check()?;

    // a still whose partial images are written, too, has more files
    let intervals =
        crate::renderer::still::intervals(&args.settings, &renderer.scene().hints, args.settings.spp(renderer.scene()));
    check_intervals(args, plan.clone(), &intervals, &renderer.scene().report.files)?;

    let mut control = CliControl::new(args, console, &renderer, abandonable.clone());
    let extras = StillExtras {
        keep_rays: args.dump_rays.is_some(),
        aov: args.depth_image.is_some(),
        intermediate: viewer.tev.is_some(),
        fixed_exposure: false,
    };
    let still = renderer.still_with(&args.settings, extras, &mut control, &mut |partial| {
        viewer.show(partial.image);
        if !intervals.contains(&partial.samples) {
            return Ok(());
        }
        args.output.iter().try_for_each(|path| partial.save_with(&interval_path(path, partial.samples), &args.files))
    })?;
    drop(control);
    abandonable.end();

    // files, whose time counts
    let write_start = Instant::now();
    write_rays(args, &still.rays)?;
    if let Some(path) = &args.depth_image {
        write_depth(path, &still.aov, still.report.size, &args.files)?;
    }
    args.output.iter().try_for_each(|path| still.save_with(path, &args.files))?;
    viewer.show(&still.image);

    let mut report = still.report;
    report.setup.warnings.extend(viewer.warning);
    report.seconds.finish(write_start.elapsed().as_secs_f64(), start.elapsed().as_secs_f64());
    let lines = if args.prints_all() { report.lines(&names(args), args.explain) } else { report.summary(&names(args)) };
    lines.iter().try_for_each(|line| console.line(line))?;
    if args.prints_all() && report.setup.wants_depth_image && args.depth_image.is_none() {
        console.line("the scene requests a depth image: add --depth-image FILE")?;
    }

    let mut record = report.record(args.explain);
    record["output"] = serde_json::json!(files::lossy(&args.output));
    record["defaults"] = serde_json::json!(defaults);
    let interrupted = args.keep_partial && interrupt::requested();
    console.close(&record, if interrupted { Err(Error::Interrupted) } else { Ok(()) })
}

fn frames(args: &RenderArgs, defaults: &[DefaultsReport], plan: &FilePlan, start: Instant) -> Result<(), Failure> {
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
    // it outlives the renderer, whose end takes time, too
    let abandonable = Arc::new(Abandonable::begin(console.json));
    let mut viewer = Viewer::connect(args, console)?;
    let mut renderer = args.load.open(&args.scene, &args.device, &console)?;
    plan.check_scene(&renderer.scene().report.files)?;
    interrupt::check()?;

    // a file for each frame, or one for all
    let mut control = CliControl::new(args, console, &renderer, abandonable.clone());
    let mut frames = renderer.frames(&args.settings, args.writes_picture(), &mut control)?;
    let colour = frames.colour();
    let background = args.settings.backdrop().of_pictures();
    let count = range.end - range.first;
    let mut files =
        FrameFiles::create(&args.output, frames.size(), count, frames.fps(), colour, &args.files, background)?;
    let (mut done, all, mut write_seconds) = (0, u64::from(frames.count()), 0.0);

    // only frames that are kept are read back
    while let Some(frame) = frames.advance()? {
        if frame.kept {
            let write_start = Instant::now();
            let image = if args.needs_channels() { Some(frames.image(&mut SilentControl)?) } else { None };
            let coverage = if background.is_some() { Some(frames.coverage()?) } else { None };
            let deep = image.as_ref().filter(|_| args.files.has_deep_png()).map(|image| frames.picture(image));
            let contents = FrameContents { image: image.as_ref(), deep, shown: frames.displayed(), coverage };
            files.add(frame.number, frames.size(), &contents)?;
            image.iter().for_each(|image| viewer.show(image));
            write_seconds += write_start.elapsed().as_secs_f64();
        }
        done += 1;
        control.progress(done, all);
        interrupt::check()?;
    }

    // totals of all frames
    abandonable.end();
    files.finish()?;
    drop(control);
    let mut report = frames.report();
    report.setup.warnings.extend(viewer.warning);
    if let Some(warning) = &report.brightness {
        console.warning(warning);
    }
    report.seconds.finish(write_seconds, start.elapsed().as_secs_f64());
    let lines = if args.prints_all() { report.lines(&names(args), args.explain) } else { report.summary(&names(args)) };
    lines.iter().try_for_each(|line| console.line(line))?;

    let mut record = report.record(args.explain);
    record["output"] = serde_json::json!(files::lossy(&args.output));
    record["defaults"] = serde_json::json!(defaults);
    console.close(&record, Ok(()))
}

/// The viewer tev, if it is to show images. A connection that ends is a warning: the render goes on
/// without it.
struct Viewer {
    tev: Option<TevViewer>,
    console: Console,
    warning: Option<String>,
}

impl Viewer {
    fn connect(args: &RenderArgs, console: Console) -> Result<Self> {
        let output = args.output.first().map_or(Path::new("skylit"), PathBuf::as_path);
        let tev = args.tev.as_ref().map(|address| TevViewer::connect(address, output)).transpose()?;
        Ok(Self { tev, console, warning: None })
    }

    fn show(&mut self, image: &Image) {
        let Some(tev) = &mut self.tev else { return };
        match tev.send(image) {
            Ok(()) => {}
            // whoever renders stops, too, and says so
            Err(SendError::Interrupted) => self.tev = None,
            Err(SendError::Failed(why)) => {
                let warning = format!("--tev: the connection has ended ({why}); the image is not shown any more");
                self.console.warning(&warning);
                (self.tev, self.warning) = (None, Some(warning));
            }
        }
    }
}

/// The warnings about a scene's file, of which the terminal gets the first and a count.
struct FileWarnings {
    scene: String,
    list: Vec<String>,
}

impl FileWarnings {
    fn new(args: &RenderArgs, renderer: &Renderer) -> Self {
        Self { scene: args.scene.clone(), list: renderer.scene().report.all_warnings() }
    }

    /// The text of a warning in the terminal; `None` if a count stands for it.
    fn shown(&self, warning: &str) -> Option<String> {
        match (self.list.iter().position(|w| w == warning), self.list.len()) {
            (Some(0), 2..) => Some(format!(
                "{warning} (and {} more about the file: `skylit info {} --no-device` lists them)",
                self.list.len() - 1,
                self.scene
            )),
            (Some(1..), _) => None,
            _ => Some(warning.to_owned()),
        }
    }
}

/// Progress bar and interruption by Ctrl-C; warnings are printed at once.
struct CliControl {
    progress: ProgressControl,
    console: Console,
    about_file: FileWarnings,
    /// It ends once there is a partial result that is to be kept.
    abandonable: Arc<Abandonable>,
}

impl CliControl {
    fn new(args: &RenderArgs, console: Console, renderer: &Renderer, abandonable: Arc<Abandonable>) -> Self {
        let progress = Progress::new("rendering", &console);
        let about_file = FileWarnings::new(args, renderer);
        let progress = ProgressControl { progress, keep_partial: args.keep_partial };
        Self { progress, console, about_file, abandonable }
    }
}

impl CliControl {
    /// Samples are being taken, of which a partial result is to be kept.
    fn keep_partial(&mut self) {
        if self.progress.keep_partial {
            self.abandonable.end();
        }
    }
}

impl Control for CliControl {
    fn progress(&mut self, done: u64, total: u64) {
        self.keep_partial();
        self.progress.progress(done, total);
    }

    fn warning(&mut self, text: &str) {
        if let Some(text) = self.about_file.shown(text) {
            self.progress.progress.suspend(|| self.console.warning(&crate::terminal::console::one_line(&text)));
        }
    }

    fn should_stop(&mut self) -> Result<bool> {
        self.keep_partial();
        self.progress.should_stop()
    }
}

/// The outputs' names in a line.
fn names(args: &RenderArgs) -> String {
    args.output.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Checks before rendering starts that intermediate images can be written, and take the place of no
/// other file.
fn check_intervals(args: &RenderArgs, mut plan: FilePlan, intervals: &[u32], scene_files: &[PathBuf]) -> Result<()> {
    for path in &args.output {
        intervals.iter().for_each(|&n| plan.writes("an intermediate image", interval_path(path, n)));
    }
    plan.check()?;
    plan.check_scene(scene_files)?;
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

fn write_depth(path: &Path, pixels: &[AovPixel], size: [u32; 2], files: &FileSettings) -> Result<()> {
    let depth: Vec<f32> = pixels.iter().map(|p| p.depth).collect();
    if ImageFormat::from_path(path)? == ImageFormat::Exr {
        let channels = vec![Channel { name: "depth.Z".into(), samples: Samples::F32(depth) }];
        return output::save(&Image { width: size[0], height: size[1], channels, metadata: Vec::new() }, path);
    }
    // numbers as they are: no transfer function
    let settings =
        FileSettings { png_bits: files.png_bits, png_encoding: Some(PngEncoding::Linear), ..FileSettings::default() };
    let picture = Picture::new(&picture::grey_image(png::depth_to_unit(&depth), size), None, &settings, path)?;
    Picture { encoding: PngEncoding::Srgb, ..picture }.save(path, files.jpeg_quality())
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
        let numbered = |path: &str, n: u32| interval_path(path.as_ref(), n).to_string_lossy().into_owned();
        assert_eq!(numbered("out/a.exr", 16), "out/a.0016.exr");
        assert_eq!(numbered("a.b.png", 65536), "a.b.65536.png");
    }
}
