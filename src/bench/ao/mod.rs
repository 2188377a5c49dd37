//! `skylit bench ao`: what each preset's frames cost and how far they are from the truth, by scene and view, standing still and
//! moving, and what of the past they show where the scene changes. docs/benchmarks.md says what is measured and how.

mod args;
mod candidates;
mod changes;
mod equal_time;
mod laps;
mod moving;
mod reference;
mod scenes;
mod series;
mod shot;
mod structures;
mod table;
mod views;

use std::sync::Arc;
use std::time::Instant;

pub use args::BenchAoArgs;
use args::{FalloffChoice, Part};

use super::scenes::check_there;
use crate::accel::flatten::FlatScene;
use crate::bench::plot;
use crate::bench::record::ao::AoBenchmark;
use crate::error::{Error, Result};
use crate::gpu::Device;
use crate::terminal::console::{Console, Failure};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::tracer::{ComputeOptions, Needs, Tracer, TracerKind};

/// Steps of the progress bar for one job: a scene, a change, a series.
const STEPS: u64 = 1000;

/// Measures, shows, writes.
pub fn run(args: &BenchAoArgs) -> Result<(), Failure> {
    let start = Instant::now();
    args.common.check()?;
    interrupt::install();
    let console = args.common.console();
    let (scenes, notes) = scenes::choose(args);
    // before anything that takes long
    scenes.iter().try_for_each(|s| check_there(s))?;
    let device = args.common.open_device()?;
    let kind = args.tracer.on(&device.info).0;
    let mut bench = Bench {
        args,
        console,
        device: &device,
        kind,
        keyboard: ProgressControl { progress: Progress::new("measuring", &console), keep_partial: false },
        start,
        out: AoBenchmark {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: device.info.name.clone(),
            driver: device.info.driver.clone(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            tracer: kind.name().to_owned(),
            size: args.size(),
            frames: args.frames(),
            reference_rays: args.reference_rays(),
            falloff: if args.ao_falloff == FalloffChoice::Binary { "binary" } else { "exponential" }.to_owned(),
            ..Default::default()
        },
        jobs: (0, 1),
        failed: None,
    };
    for note in notes {
        bench.note(note);
    }
    // whatever goes wrong from here on, what was measured until then is written
    let measured = bench.everything(&scenes);
    let (out, failed) = (bench.out, bench.failed);
    drop(bench.keyboard);
    let valid = device.check_validation();
    if measured.is_ok() {
        device.save_pipeline_cache();
    }
    let written = if out.is_empty() { Ok(()) } else { args.common.write(&out, |f| out.write_csv(f), || plot::ao::draw(&out)) };
    let nothing = || Error::Usage(format!("nothing was measured: {}", out.notes.last().map_or("no scene", String::as_str)));
    let verdict = match failed {
        Some(e) if out.is_empty() || !args.scenes.is_empty() => Err(e),
        _ if out.is_empty() => Err(nothing()),
        _ => Ok(()),
    };
    console.close(&out, measured.and(valid).and(written).and(verdict))
}

/// A run under way.
struct Bench<'a> {
    args: &'a BenchAoArgs,
    console: Console,
    device: &'a Arc<Device>,
    kind: TracerKind,
    keyboard: ProgressControl,
    start: Instant,
    out: AoBenchmark,
    /// Those that are done, and all of them.
    jobs: (u64, u64),
    /// The first that went wrong.
    failed: Option<Error>,
}

impl<'a> Bench<'a> {
    /// All jobs. One that fails does not stop the others.
    fn everything(&mut self, scenes: &[String]) -> Result<()> {
        let title = format!(
            "{} ({}), tracer {}, {}x{}, {} frames, references of {} rays a pixel",
            self.out.device,
            self.out.driver,
            self.out.tracer,
            self.out.size[0],
            self.out.size[1],
            self.out.frames,
            self.out.reference_rays
        );
        self.lines(&[title])?;
        let (args, views) = (self.args, self.args.wants_views());
        let (changes, structures) = (args.wants(Part::Changes), args.wants(Part::Structures));
        let count = |wanted: bool, n: usize| if wanted { n as u64 } else { 0 };
        let all = count(views, scenes.len()) + count(changes, 1) + count(structures, 1) + args.series.len() as u64;
        self.jobs = (0, all.max(1));
        for source in scenes.iter().filter(|_| views) {
            self.job(source, |bench| views::measure(bench, source))?;
        }
        if changes {
            self.job("changes", |bench| changes::measure(bench, scenes))?;
        }
        if structures {
            self.job("structures", structures::measure)?;
        }
        for series in &args.series {
            self.job("series", |bench| series::measure(bench, *series, scenes))?;
        }
        Ok(())
    }

    /// Does a job, unless it is too late. What goes wrong is noted; only what ends the run is returned.
    fn job(&mut self, name: &str, work: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        // one at least: a record of nothing says nothing
        if self.is_late() && !self.out.is_empty() {
            self.leave_out(name);
            self.jobs.0 += 1;
            return Ok(());
        }
        self.advance(0.0);
        let outcome = work(self);
        self.jobs.0 += 1;
        match outcome {
            Ok(()) => Ok(()),
            Err(e @ (Error::Interrupted | Error::DeviceLost(_))) => Err(e),
            Err(e) => {
                self.note(format!("{name}: left out from here: {e}"));
                self.failed.get_or_insert(e);
                Ok(())
            }
        }
    }

    fn note(&mut self, text: String) {
        self.keyboard.progress.suspend(|| self.console.warning(&text));
        self.out.notes.push(text);
    }

    /// Says that the time limit took something.
    fn leave_out(&mut self, what: &str) {
        self.out.stopped_early = true;
        self.note(format!("time limit: {what}: left out"));
    }

    /// Shows lines of the result.
    fn lines(&self, lines: &[String]) -> Result<()> {
        self.keyboard.progress.suspend(|| lines.iter().try_for_each(|line| self.console.line(line)))
    }

    /// Says what is done from here on.
    fn phase(&mut self, what: String) {
        self.keyboard.progress.phase(what);
    }

    /// Moves the bar: this share of the job is done.
    fn advance(&mut self, share: f64) {
        let steps = (share.clamp(0.0, 1.0) * STEPS as f64) as u64;
        self.keyboard.progress.set(self.jobs.0 * STEPS + steps, self.jobs.1 * STEPS);
    }

    /// Width over height.
    fn aspect(&self) -> f64 {
        let [width, height] = self.args.size();
        f64::from(width) / f64::from(height)
    }

    fn is_late(&self) -> bool {
        self.args.common.time_limit.is_some_and(|limit| self.start.elapsed() >= limit)
    }

    /// Builds what traces a scene.
    fn tracer(&mut self, name: &str, flat: &FlatScene) -> Result<Tracer> {
        self.phase(format!("{name}: building"));
        let (options, build) = (ComputeOptions::default(), self.args.build_options());
        let tracer = Tracer::with_build(self.device, self.kind, flat, Needs::default(), options, &build)?;
        interrupt::check()?;
        Ok(tracer)
    }
}
