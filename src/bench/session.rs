//! A running benchmark: its device, peers, record, time limit and progress.

use std::sync::Arc;
use std::time::Instant;

use super::baseline::{Baseline, BaselineReport};
use super::common::{CommonArgs, JsonRecord, show_address};
use super::page::ReportedRecord;
use super::peers::file::PeerSpec;
use super::peers::process::{Peer, PeerError};
use super::record::{BenchKind, HostInfo, Record};
use super::table;
use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::gpu::{Device, DeviceInfo, Options};
use crate::scene::Scene;
use crate::terminal::console::{Console, Failure, one_line};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;

/// Steps of the progress bar for one job.
const STEPS: u64 = 1000;

/// A running benchmark, with its arguments and its record.
pub struct BenchSession<'a, A> {
    pub args: &'a A,
    pub device: Arc<Device>,
    pub peers: Vec<Peer>,
    /// Progress bar and Ctrl-C of long work.
    pub control: ProgressControl,
    pub record: Record,
    common: &'a CommonArgs,
    console: Console,
    baseline: Option<Baseline>,
    start: Instant,
    /// Jobs that are done, and all of them.
    jobs: (u64, u64),
    failure: Option<Error>,
    /// Keeps the folder of the report, which is removed with it while it is empty.
    _plan: FilePlan,
}

impl<'a, A> BenchSession<'a, A> {
    /// Opens the device and begins a record. `settings`: what results depend on, which have to be
    /// those of the baseline.
    pub fn start(
        args: &'a A,
        common: &'a CommonArgs,
        plan: FilePlan,
        benchmark: BenchKind,
        settings: impl FnOnce(&DeviceInfo) -> Vec<(&'static str, String)>,
    ) -> Result<Self> {
        let start = Instant::now();
        let baseline = common.baseline.as_deref().map(Baseline::read).transpose()?;
        interrupt::install();
        let console = common.outputs.console();
        let options = Options { device: common.device.clone(), validation: common.validation, ..Default::default() };
        let device = Device::open(&options)?;
        let control = ProgressControl { progress: Progress::new("measuring", &console), keep_partial: false };
        let settings = settings(&device.info).into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        let record = Record { benchmark, host: HostInfo::new(&device.info), settings, ..Record::default() };
        baseline.as_ref().map_or(Ok(()), |b| b.check(&record))?;
        Ok(Self {
            args,
            device,
            peers: Vec::new(),
            control,
            record,
            common,
            console,
            baseline,
            start,
            jobs: (0, 1),
            failure: None,
            _plan: plan,
        })
    }

    /// Starts peers, or notes why they are left out, as all are where `specs` is a reason; then
    /// shows what the run is of.
    pub fn start_peers(&mut self, specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
        let specs = specs.unwrap_or_else(|why| {
            self.note(why);
            Vec::new()
        });
        for spec in &specs {
            let activity = if spec.is_built() { "starting" } else { "compiling" };
            self.phase(format!("{activity} peer '{}': `{}`", spec.name, spec.command_line()));
            match Peer::start(spec) {
                Ok(peer) => self.peers.push(peer),
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => self.note(spec.missing(&why)),
            }
        }
        self.record.peers = self.peers.iter().map(|p| p.title.clone()).collect();
        self.show_title()
    }

    /// The outcome of a peer's work; `None`, and a note that begins with `what`, where it failed.
    pub fn unless_peer_fails<T>(&mut self, what: &str, outcome: Result<T, PeerError>) -> Result<Option<T>> {
        match outcome {
            Ok(done) => Ok(Some(done)),
            Err(PeerError::Ours(e)) => Err(e),
            Err(PeerError::Failed(why)) => {
                self.note(format!("{what}: {why}"));
                Ok(None)
            }
        }
    }

    /// Says how many jobs there are.
    pub fn expect_jobs(&mut self, count: usize) {
        self.jobs = (0, count.max(1) as u64);
    }

    /// Runs a job unless the time limit has passed. Errors are noted and fail the run at the end;
    /// only errors that end the run are returned.
    pub fn job(&mut self, name: &str, work: impl FnOnce(&mut Self) -> Result<()>) -> Result<()> {
        if self.is_over() {
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
                self.failure.get_or_insert(e);
                Ok(())
            }
        }
    }

    /// Warns, and keeps the warning in the record.
    pub fn note(&mut self, text: String) {
        self.control.progress.suspend(|| self.console.warning(&text));
        self.record.notes.push(text);
    }

    /// Notes what loading a scene warned of.
    pub fn note_warnings(&mut self, source: &str, scene: &Scene) {
        for warning in scene.report.all_warnings() {
            self.note(format!("{source}: {}", one_line(&warning)));
        }
    }

    /// Notes that the time limit took something.
    pub fn leave_out(&mut self, what: &str) {
        self.stop_early();
        self.note(format!("time limit: {what}: left out"));
    }

    /// Says what is done from here on, or notes that the time limit took it. Returns which.
    pub fn has_time_for(&mut self, what: String) -> bool {
        if self.is_over() {
            self.leave_out(&what);
            return false;
        }
        self.phase(what);
        true
    }

    /// Records that the time limit took something.
    pub fn stop_early(&mut self) {
        self.record.stopped_early = true;
    }

    /// Shows what the run is of: host, settings and peers.
    pub fn show_title(&self) -> Result<()> {
        self.show(&[table::title(&self.record)])
    }

    /// Shows what is known of a scene, if anything was measured of it.
    pub fn show_scene(&self, scene: &str) -> Result<()> {
        let is_measured = self.record.measurements.iter().any(|m| m.scene == scene);
        if is_measured { self.show(&table::scene_lines(&self.record, scene)) } else { Ok(()) }
    }

    fn show(&self, lines: &[String]) -> Result<()> {
        self.control.progress.suspend(|| lines.iter().try_for_each(|line| self.console.line(line)))
    }

    /// Says what is done from here on.
    pub fn phase(&mut self, label: String) {
        self.control.progress.phase(label);
    }

    /// Moves the bar: this share of the job, 0 to 1, is done.
    pub fn advance(&mut self, share: f64) {
        advance(&mut self.control.progress, self.jobs, share);
    }

    /// A closure that moves the bar, and the peers, for use while the session is borrowed.
    pub fn advancer(&mut self) -> (impl FnMut(f64), &mut [Peer]) {
        let jobs = self.jobs;
        let progress = &mut self.control.progress;
        (move |share| advance(progress, jobs, share), &mut self.peers)
    }

    pub fn is_late(&self) -> bool {
        self.common.time_limit.is_some_and(|limit| self.start.elapsed() >= limit)
    }

    /// Has the time limit passed with at least one result? The first is measured in any case.
    pub fn is_over(&self) -> bool {
        self.is_late() && !self.record.is_empty()
    }

    /// Writes and prints measurements, whatever went wrong, and compares them with the baseline.
    /// `scenes_named`: a failed scene fails the run; `checked`: the outcome of the record itself.
    pub fn finish(self, measured: Result<()>, scenes_named: bool, checked: Result<()>) -> Result<(), Failure> {
        let Self { record, device, common, console, failure, control, peers, baseline, .. } = self;
        // before anything is printed
        drop((control, peers));
        let valid = device.check_validation();
        if measured.is_ok() {
            device.save_pipeline_cache();
        }
        let compared = baseline.filter(|_| !record.is_empty()).map(|b| b.compare(&record));
        let shown = compared
            .as_ref()
            .map_or(Ok(()), |report| table::lines(&report.parts()).iter().try_for_each(|line| console.line(line)));
        if let Some(report) = &compared {
            report.warnings.iter().for_each(|w| console.warning(w));
        }
        let complete = match failure {
            Some(e) if record.is_empty() || scenes_named => Err(e),
            _ if record.is_empty() => {
                let why = record.notes.last().map_or("no scene", String::as_str);
                Err(Error::Usage(format!("nothing was measured: {why}")))
            }
            _ => Ok(()),
        };
        let file = common.outputs.json_file().cloned().unwrap_or_else(|| "this run".into());
        let is_empty = record.is_empty();
        let reported = ReportedRecord { file, record, baseline: compared };
        let pictures = if is_empty { Ok(None) } else { common.outputs.write_pictures(std::slice::from_ref(&reported)) };
        let (report, drawn) = show_address(pictures, console);
        let baseline = reported.baseline.as_ref();
        let json = JsonRecord { record: &reported.record, baseline, report };
        let written = if is_empty { Ok(()) } else { common.write_tables(&json).and(drawn) };
        let holds = baseline.map_or(Ok(()), BaselineReport::verdict);
        console.close(&json, measured.and(valid).and(written).and(complete).and(checked).and(shown).and(holds))
    }
}

fn advance(progress: &mut Progress, jobs: (u64, u64), share: f64) {
    let steps = (share.clamp(0.0, 1.0) * STEPS as f64) as u64;
    progress.set(jobs.0 * STEPS + steps, jobs.1 * STEPS);
}
