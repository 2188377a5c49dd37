//! `skylit bench rays`: rates of all contestants, taken in turn, so that a machine that slows down for a while slows all of
//! them down.

mod args;
mod contestant;
mod peer;
mod streams;
mod table;

use std::sync::Arc;
use std::time::Instant;

pub use args::BenchRaysArgs;
use contestant::{Contestant, Lap, OWN, Run};
use peer::Peer;
use streams::{RaySets, STREAMS, Set, StreamKind};

use super::peers::file as peers_file;
use super::peers::file::Measures;
use super::peers::process::PeerError;
use super::scenes::{self, Subject};
use crate::accel::flatten::FlatScene;
use crate::bench::plot;
use crate::bench::record::rays::{CheckRecord, Ratio, RayBenchmark, RunRecord, SceneRecord, StreamRecord};
use crate::error::{Error, Result};
use crate::gpu::Device;
use crate::integrators::rays::Mode;
use crate::measure::agreement;
use crate::measure::stats::{Summary, paired_ratio};
use crate::ray::Ray;
use crate::terminal::console::{Console, Failure};
use crate::terminal::device_args::BuildChoice;
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::tracer::Kernel;
use crate::tracer::visits::VisitCounter;

/// Measures, shows, writes.
pub fn run(args: &BenchRaysArgs) -> Result<(), Failure> {
    let start = Instant::now();
    args.common.check()?;
    interrupt::install();
    let console = args.common.console();
    let (scenes, notes) = scenes::choose(args);
    // before anything that takes long: a broken peers file, a scene that does not exist
    let specs = peers_file::choose(args.peers.as_deref(), Measures::Rays)?;
    scenes.iter().try_for_each(|s| scenes::check_there(s))?;
    let device = args.common.open_device()?;
    let mut bench = Bench {
        args,
        device: &device,
        peers: Vec::new(),
        keyboard: ProgressControl { progress: Progress::new("measuring", &console), keep_partial: false },
        start,
        out: RayBenchmark {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: device.info.name.clone(),
            driver: device.info.driver.clone(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            repeats: args.repeats(),
            build: args.build.name(),
            ..Default::default()
        },
        laps: (0, 0),
    };
    for note in notes {
        bench.note(&console, note);
    }
    match specs {
        Ok(specs) => bench.start_peers(&console, &specs)?,
        Err(note) => bench.note(&console, note),
    }
    // whatever goes wrong from here on, what was measured until then is written
    let measured = bench.scenes(&console, &scenes);
    let mut out = bench.out;
    drop(bench.keyboard);
    let valid = device.check_validation();
    if measured.is_ok() {
        device.save_pipeline_cache();
    }
    out.find_scaling();
    let shown = table::scaling(&out).iter().try_for_each(|line| console.line(line));
    let written = if out.rows().next().is_some() {
        args.common.write(&out, |f| out.write_csv(f), || plot::rays::draw(&out))
    } else {
        Ok(())
    };
    let verdict = verdict(args, &out);
    console.close(&out, measured.and(valid).and(shown).and(written).and(verdict))
}

/// With `--check`: an answer that rounding does not explain is a failure, if it is ours or of a peer that has to agree. The
/// reference is ours, whoever it is held against.
fn verdict(args: &BenchRaysArgs, out: &RayBenchmark) -> Result<()> {
    let checks = || out.scenes.iter().flat_map(|s| s.checks.iter().filter(|c| c.fails()).map(move |c| (s, c)));
    match checks().next() {
        Some((scene, c)) if args.check => Err(Error::CheckFailed(format!(
            "{}, {}: {} of {} answers of '{}' differ from those of '{}' by more than rounding{} ({}); {} such results in all",
            scene.scene,
            c.stream,
            c.unexplained,
            c.rays,
            c.contestant,
            c.reference,
            match c.reference_unexplained {
                0 => String::new(),
                n => format!(", {n} of these because the latter are wrong"),
            },
            c.examples.first().map_or("no example", String::as_str),
            checks().count()
        ))),
        _ => Ok(()),
    }
}

/// A run under way.
struct Bench<'a> {
    args: &'a BenchRaysArgs,
    device: &'a Arc<Device>,
    peers: Vec<Peer>,
    keyboard: ProgressControl,
    start: Instant,
    out: RayBenchmark,
    /// Scenes that are done, and all of them.
    laps: (u64, u64),
}

/// Steps of the progress bar for one scene.
const STEPS: u64 = 1000;
/// Of these, with `--check`, for checking.
const CHECK_STEPS: u64 = 300;
/// Rays whose visits are counted, of each stream.
const VISITS_OF: usize = 20_000;
/// Larger scenes are not built once more for counting.
const VISITS_MOST: usize = 2_000_000;

impl Bench<'_> {
    fn note(&mut self, console: &Console, text: String) {
        self.keyboard.progress.suspend(|| console.warning(&text));
        self.out.notes.push(text);
    }

    /// All scenes. One that fails does not stop the others; it fails the run in the end if it was asked for by name, or if nothing
    /// was measured.
    fn scenes(&mut self, console: &Console, scenes: &[String]) -> Result<()> {
        let title = format!(
            "{} ({}), {} threads; medians of {} repeats, in turn{}",
            self.out.device,
            self.out.driver,
            self.out.threads,
            self.out.repeats,
            self.out.peers.iter().map(|p| format!("; beside {p}")).collect::<String>()
        );
        self.keyboard.progress.suspend(|| console.line(&title))?;
        let mut failed = None;
        for (k, source) in scenes.iter().enumerate() {
            // one scene at least: a record of nothing says nothing
            if k > 0 && self.is_late() {
                self.out.stopped_early = true;
                self.note(console, format!("time limit: {} scenes left out", scenes.len() - k));
                break;
            }
            // a share of the bar for every scene
            self.laps = (k as u64, scenes.len() as u64);
            self.advance(0);
            let mut record = SceneRecord { scene: source.clone(), ..Default::default() };
            let outcome = self.scene(console, source, &mut record);
            if !record.streams.is_empty() {
                let table = table::scene(&record, &self.out.baselines);
                self.keyboard.progress.suspend(|| table.iter().try_for_each(|line| console.line(line)))?;
                self.out.scenes.push(record);
            }
            match outcome {
                Ok(()) => {}
                Err(e @ (Error::Interrupted | Error::DeviceLost(_))) => return Err(e),
                Err(e) => {
                    self.note(console, format!("{source}: left out from here: {e}"));
                    failed.get_or_insert(e);
                }
            }
        }
        let nothing = self.out.rows().next().is_none();
        match failed {
            Some(e) if nothing || !self.args.scenes.is_empty() => Err(e),
            None if nothing => {
                let why = self.out.notes.last().map_or("no scene", String::as_str);
                Err(Error::Usage(format!("nothing was measured: {why}")))
            }
            _ => Ok(()),
        }
    }

    /// Moves the bar: so many of [`STEPS`] of this scene are done.
    fn advance(&mut self, steps: u64) {
        self.keyboard.progress.set(self.laps.0 * STEPS + steps, self.laps.1 * STEPS);
    }

    /// Says what is done from here on.
    fn phase(&mut self, what: String) {
        self.keyboard.progress.phase(what);
    }

    fn is_late(&self) -> bool {
        self.args.common.time_limit.is_some_and(|limit| self.start.elapsed() >= limit)
    }

    /// Starts the peers; those that do not are named and left out.
    fn start_peers(&mut self, console: &Console, specs: &[peers_file::PeerSpec]) -> Result<()> {
        for spec in specs {
            let how = if spec.is_built() { "starting" } else { "compiling" };
            self.phase(format!("{how} peer '{}'", spec.name));
            match Peer::start(spec) {
                Ok(peer) => {
                    self.out.baselines.extend(spec.baselines.iter().map(|k| spec.title_of(k)));
                    self.out.peers.push(peer.process.title.clone());
                    self.peers.push(peer);
                }
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => self.note(console, spec.missing(&why)),
            }
        }
        Ok(())
    }

    /// Everything about one scene. `record` has what there is also where it fails.
    fn scene(&mut self, console: &Console, source: &str, record: &mut SceneRecord) -> Result<()> {
        let size = self.args.size();
        self.phase(format!("{source}: loading"));
        let subject = scenes::load(source, self.args, f64::from(size[0]) / f64::from(size[1]))?;
        for warning in crate::terminal::warnings::warnings_of(&subject.scene) {
            self.note(console, format!("{source}: {}", crate::terminal::warnings::one_line(&warning)));
        }
        if let Some(known) = subject.view {
            self.note(console, format!("{source}: seen and lit as {known} is (docs/benchmarks.md)"));
        }
        interrupt::check()?;
        let flat = FlatScene::new(&subject.scene);
        let contestants = self.contestants(console, source, &flat)?;
        let Some(tracer) = contestants.iter().find_map(Contestant::tracer) else {
            return Err(Error::Device(format!("{source}: none of the kernels asked for runs here; `skylit doctor` says why")));
        };
        self.phase(format!("{source}: making rays"));
        let sets = RaySets::make(tracer, &subject, size, &mut interrupt::SilentControl)?;
        *record = SceneRecord {
            scene: source.to_owned(),
            triangles: subject.scene.triangle_count(),
            spheres: subject.scene.sphere_count(),
            instances: subject.scene.instances.len(),
            stored_primitives: flat.primitive_count() as u64,
            ao_radius: Some(subject.ao_radius).filter(|r| r.is_finite()),
            light: subject.light.to_array(),
            builds: contestants.iter().map(|c| c.build.clone()).collect(),
            ..Default::default()
        };
        // contestants that failed on the way
        let mut failed = vec![false; contestants.len()];
        let asked: Vec<&StreamKind> = STREAMS.iter().filter(|s| self.wants(s)).collect();
        for set in Set::ALL {
            if asked.iter().any(|s| s.set == set) {
                self.give_rays(console, &contestants, &mut failed, set, sets.get(set))?;
            }
        }
        // the counter's tree is that of the default preset
        let same = self.args.build == BuildChoice::Default && flat.primitive_count() <= VISITS_MOST;
        let counted = same && contestants.iter().any(|c| c.kernel == Some(Kernel::Wide));
        let counter = if counted { VisitCounter::new(&flat) } else { None };
        for (k, stream) in asked.iter().enumerate() {
            // one stream at least: a record of nothing says nothing
            if self.is_late() && !(record.streams.is_empty() && self.out.scenes.is_empty()) {
                self.out.stopped_early = true;
                self.note(console, format!("time limit: {source}: {} streams left out", asked.len() - k));
                break;
            }
            let rays = sets.get(stream.set);
            if rays.is_empty() {
                self.note(console, format!("{source}: {}: no rays (nothing in view that they start from)", stream.name));
                continue;
            }
            if !contestants.iter().zip(&failed).any(|(c, f)| !f && c.is_for(stream.set)) {
                self.note(console, format!("{source}: {}: no contestant takes part in it", stream.name));
                continue;
            }
            let steps = if self.args.check { STEPS - CHECK_STEPS } else { STEPS };
            let share = (k as u64 * steps / asked.len() as u64, (k as u64 + 1) * steps / asked.len() as u64);
            self.phase(format!("{source}: {}", stream.name));
            let results = self.stream(console, &contestants, &mut failed, stream, (rays, counter.as_ref()), share)?;
            record.streams.push(results);
        }
        if self.args.check {
            self.check(console, &subject, &contestants, &mut failed, &sets, record)?;
        }
        Ok(())
    }

    fn wants(&self, stream: &StreamKind) -> bool {
        self.args.streams.is_empty() || self.args.streams.iter().any(|s| s == stream.name)
    }

    /// All that take part in a scene, built: one of our own at least, which makes the rays.
    fn contestants<'f>(&mut self, console: &Console, source: &str, flat: &'f FlatScene<'f>) -> Result<Vec<Contestant<'f>>> {
        let mut out = Vec::new();
        let mut refused = None;
        for own in &OWN {
            let named = self.args.kernels.iter().any(|k| k == own.name);
            if !named && !self.args.kernels.is_empty() {
                continue;
            }
            self.phase(format!("{source}: building for '{}'", own.name));
            let made = match own.takes_part(&self.device.info, flat, named) {
                Ok(()) => Contestant::own(self.device, flat, own, &self.args.build_options()),
                Err(why) => Err(Error::Device(why)),
            };
            match made {
                Ok(c) => out.push(c),
                // one that the scene is too large for, or that the device does not run, does not stop the others
                Err(e @ (Error::OutOfMemory(_) | Error::Device(_) | Error::Scene(_))) => {
                    self.note(console, format!("{source}: '{}' left out: {e}", own.name));
                    refused.get_or_insert(e);
                }
                Err(e) => return Err(e),
            }
            interrupt::check()?;
        }
        if let (true, Some(why)) = (out.is_empty(), refused) {
            return Err(why);
        }
        let masked = flat.has_alpha();
        for index in 0..self.peers.len() {
            let spec = self.peers[index].process.spec.clone();
            self.phase(format!("{source}: building for '{}'", spec.name));
            let mut build = || -> Result<Vec<Contestant<'f>>, PeerError> {
                if masked {
                    return Err(PeerError::Failed("it knows no alpha masks".into()));
                }
                self.peers[index].load_scene(flat)?;
                spec.kernels.iter().map(|k| Contestant::peer(&mut self.peers, index, k, flat)).collect()
            };
            match build() {
                Ok(list) => out.extend(list),
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => self.note(console, format!("{source}: peer '{}' left out: {why}", spec.name)),
            }
        }
        Ok(out)
    }

    /// Gives a set of rays to every peer that takes part.
    fn give_rays(
        &mut self,
        console: &Console,
        contestants: &[Contestant],
        failed: &mut [bool],
        set: Set,
        rays: &[Ray],
    ) -> Result<()> {
        for index in 0..self.peers.len() {
            if !contestants.iter().zip(&*failed).any(|(c, f)| !f && c.peer_index() == Some(index)) {
                continue;
            }
            match self.peers[index].load_rays(set.name(), rays) {
                Ok(()) => {}
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => {
                    self.note(console, format!("peer '{}' left out: {why}", self.peers[index].process.spec.name));
                    contestants.iter().zip(&mut *failed).for_each(|(c, f)| *f |= c.peer_index() == Some(index));
                }
            }
        }
        Ok(())
    }

    /// Rounds over one stream: each contestant once a round.
    fn stream(
        &mut self,
        console: &Console,
        contestants: &[Contestant],
        failed: &mut [bool],
        stream: &StreamKind,
        (rays, counter): (&[Ray], Option<&VisitCounter>),
        share: (u64, u64),
    ) -> Result<StreamRecord> {
        let mut runs: Vec<Run> = Vec::new();
        for c in contestants {
            runs.push(c.prepare(stream.set, rays, stream.mode)?);
        }
        let mut laps: Vec<Vec<Lap>> = contestants.iter().map(|_| Vec::new()).collect();
        let repeats = self.args.repeats();
        for round in 0..=repeats {
            for (k, run) in runs.iter_mut().enumerate() {
                if failed[k] || !contestants[k].is_for(stream.set) {
                    continue;
                }
                match run.lap(&mut self.peers, &mut self.keyboard) {
                    // the first round compiles, finds launch sizes and fills caches
                    Ok(lap) if round > 0 => laps[k].push(lap),
                    Ok(_) => {}
                    Err(PeerError::Ours(e)) => return Err(e),
                    Err(PeerError::Failed(why)) => {
                        failed[k] = true;
                        self.note(console, format!("'{}' left out from here: {why}", contestants[k].name));
                    }
                }
            }
            interrupt::check()?;
            let done = share.0 + (share.1 - share.0) * u64::from(round) / u64::from(repeats);
            self.advance(done);
            if round > 0 && self.is_late() {
                self.out.stopped_early |= round < repeats;
                break;
            }
        }
        // a sample says as much as all of them
        let some: Vec<Ray> = rays.iter().step_by(rays.len().div_ceil(VISITS_OF).max(1)).copied().collect();
        let visits = counter.map(|c| c.mean(&some, stream.mode == Mode::Any));
        let mut results = Vec::new();
        for (k, contestant) in contestants.iter().enumerate() {
            if failed[k] || laps[k].is_empty() {
                continue;
            }
            let count = runs[k].rays as f64;
            let seconds: Vec<f64> = laps[k].iter().map(|l| l.device).collect();
            let rates = |s: &[f64]| Summary::of(&s.iter().map(|s| count / s / 1e6).collect::<Vec<_>>());
            let walls: Option<Vec<f64>> = laps[k].iter().map(|l| l.wall).collect();
            let Some(device) = rates(&seconds) else { continue };
            results.push(RunRecord {
                contestant: contestant.name.clone(),
                rays: runs[k].rays,
                hit_share: runs[k].hit_count()? as f64 / count,
                device,
                wall: walls.and_then(|w| rates(&w)),
                seconds,
                ratios: Vec::new(),
                nodes_per_ray: visits.filter(|_| contestant.kernel == Some(Kernel::Wide)).map(|v| v.nodes),
                leaves_per_ray: visits.filter(|_| contestant.kernel == Some(Kernel::Wide)).map(|v| v.leaves),
            });
        }
        give_ratios(&mut results, &self.out.baselines);
        Ok(StreamRecord { stream: stream.name.to_owned(), rays: rays.len(), results })
    }

    /// All answers against those of the first of our own.
    fn check(
        &mut self,
        console: &Console,
        subject: &Subject,
        contestants: &[Contestant],
        failed: &mut [bool],
        sets: &RaySets,
        record: &mut SceneRecord,
    ) -> Result<()> {
        let Some((first, reference)) = contestants.iter().enumerate().find(|(_, c)| c.tracer().is_some()) else {
            return Ok(());
        };
        let source = record.scene.clone();
        self.phase(format!("{source}: checking"));
        let streams: Vec<_> = STREAMS.iter().filter(|s| record.streams.iter().any(|r| r.stream == s.name)).collect();
        let pairs = (streams.len() * contestants.len()).max(1) as u64;
        for (done, stream) in streams.iter().enumerate() {
            if self.is_late() {
                self.out.stopped_early = true;
                self.note(console, format!("time limit: {source}: {} streams not checked", streams.len() - done));
                return Ok(());
            }
            if !(0..contestants.len()).any(|k| k != first && !failed[k] && contestants[k].is_for(stream.set)) {
                self.note(console, format!("{source}: {}: nothing to compare with '{}'", stream.name, reference.name));
                continue;
            }
            let rays = sets.get(stream.set);
            let ours = sure(reference.hits(&mut self.peers, rays, stream.mode, &mut self.keyboard))?;
            for (k, contestant) in contestants.iter().enumerate() {
                if k == first || failed[k] || !contestant.is_for(stream.set) {
                    continue;
                }
                let mut compare = || {
                    let hits = contestant.hits(&mut self.peers, rays, stream.mode, &mut self.keyboard)?;
                    if stream.mode == Mode::Closest {
                        return Ok(agreement::compare_closest(&subject.scene, rays, &hits, &ours));
                    }
                    agreement::compare_any(&subject.scene, rays, &hits, &ours, |some| {
                        let mut named = contestant.hits(&mut self.peers, some, Mode::Closest, &mut self.keyboard)?;
                        named.extend(reference.hits(&mut self.peers, some, Mode::Closest, &mut self.keyboard)?);
                        Ok(named)
                    })
                };
                match compare() {
                    Ok(found) => {
                        let check = CheckRecord::new(&contestant.name, &reference.name, stream.name, &found, contestant.strict);
                        record.checks.push(check);
                    }
                    Err(PeerError::Ours(e)) => return Err(e),
                    Err(PeerError::Failed(why)) => {
                        failed[k] = true;
                        self.note(console, format!("'{}' left out of the check from here: {why}", contestant.name));
                    }
                }
                interrupt::check()?;
                self.advance(STEPS - CHECK_STEPS + (done * contestants.len() + k + 1) as u64 * CHECK_STEPS / pairs);
            }
        }
        Ok(())
    }
}

/// Our own contestants fail with errors of ours only.
fn sure<T>(result: Result<T, PeerError>) -> Result<T> {
    result.map_err(|e| match e {
        PeerError::Ours(e) => e,
        PeerError::Failed(why) => Error::CheckFailed(why),
    })
}

/// Ratios to each baseline that ran, round by round.
fn give_ratios(results: &mut [RunRecord], baselines: &[String]) {
    for name in baselines {
        let Some(base) = results.iter().find(|r| &r.contestant == name).map(|r| (r.seconds.clone(), r.rays as f64)) else {
            continue;
        };
        for run in results.iter_mut() {
            if let Some(ratio) = paired_ratio(&run.seconds, run.rays as f64, &base.0, base.1) {
                run.ratios.push(Ratio { to: name.clone(), ratio });
            }
        }
    }
}
