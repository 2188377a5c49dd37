//! `skylit bench rays`: ray rates of all contestants. Their repeats are interleaved, so that a temporary slowdown of the machine affects
//! all of them.

mod args;
mod contestant;
mod edges;
mod peer;
mod scenes;
mod streams;
pub mod table;

pub use args::BenchRaysArgs;
use contestant::{Contestant, KERNELS, PreparedRun, RepeatTime};
use scenes::RayScene;
use streams::{RaySets, STREAMS, Set, StreamKind};

use super::peers::file::{self, Measures, PeerSpec};
use super::peers::process::PeerError;
use super::record::rays::{CheckRecord, Ratio, RayBenchmark, RunRecord, SceneRecord, StreamRecord};
use super::scenes::check_exists;
use super::session::Session;
use super::table::Block;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::integrators::rays::Mode;
use crate::measure::agreement;
use crate::measure::stats::{Summary, paired_ratio};
use crate::ray::Ray;
use crate::terminal::console::Failure;
use crate::terminal::interrupt::{self, SilentControl};
use crate::tracer::Kernel;
use crate::tracer::settings::BuildChoice;
use crate::tracer::visits::VisitCounter;

/// Share of a scene's progress that checking gets, with `--check`.
const CHECK_SHARE: f64 = 0.3;
/// Number of rays of each stream whose node visits are counted.
const VISITED_RAYS: usize = 20_000;
/// Maximum number of primitives of scenes whose hierarchy is rebuilt for counting visits.
const MAX_VISITED_PRIMITIVES: usize = 2_000_000;

/// A run of `skylit bench rays`.
type RaySession<'a> = Session<'a, BenchRaysArgs, RayBenchmark>;

/// Runs the benchmark, prints the results and writes the files.
///
/// # Errors
/// The first error; the results measured so far are written nevertheless.
pub fn run(args: &BenchRaysArgs) -> Result<(), Failure> {
    let scenes = scenes::choose(&args.scenes, args.common.quick);
    // before anything that takes long: a broken peers file, a scene that does not exist
    let specs = file::choose(args.peers.as_deref(), Measures::Rays)?;
    scenes.sources.iter().try_for_each(|s| check_exists(s))?;
    args.common.check_inputs(&scenes.sources, None, args.peers.as_deref())?;
    let mut session = Session::start(args, &args.common, |device| RayBenchmark {
        host: device.host_info(),
        repeats: args.repeats(),
        size: args.size(),
        build: args.build.name().to_owned(),
        ..Default::default()
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let measured = measure(&mut session, &scenes.sources, specs);
    session.record.find_scaling();
    let shown = session.show(&table::scaling(&session.record));
    let agreed = check_agreement(args, &session.record).and(edges::verdict(&session.record.edges));
    session.finish(measured, !args.scenes.is_empty(), shown.and(agreed))
}

/// With `--check`: an answer that rounding does not explain is a failure, if it is ours or of a peer that has to agree. The
/// reference is ours, whoever it is held against.
fn check_agreement(args: &BenchRaysArgs, record: &RayBenchmark) -> Result<()> {
    let checks = || record.scenes.iter().flat_map(|s| s.checks.iter().filter(|c| c.fails()).map(move |c| (s, c)));
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

/// All scenes. One that fails does not stop the others.
fn measure(session: &mut RaySession, scenes: &[String], specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
    session.start_peers(specs)?;
    let specs = session.peers.iter().map(|p| &p.spec);
    session.record.baselines = specs.flat_map(|s| s.baselines.iter().map(|k| s.title_of(k))).collect();
    session.record.peers = session.peer_titles();
    let title = table::title(&session.record);
    session.show(&[Block::Line(title)])?;
    if session.args.edges {
        return session.edges();
    }
    session.expect_jobs(scenes.len());
    for source in scenes {
        session.job(source, |session| {
            let mut record = SceneRecord { scene: source.clone(), ..Default::default() };
            let outcome = session.scene(source, &mut record);
            // what there is, also where it failed
            if !record.streams.is_empty() {
                session.show(&table::scene(&record, &session.record.baselines))?;
                session.record.scenes.push(record);
            }
            outcome
        })?;
    }
    Ok(())
}

impl RaySession<'_> {
    /// Everything about one scene. `record` has what there is also where it fails.
    fn scene(&mut self, source: &str, record: &mut SceneRecord) -> Result<()> {
        let size = self.args.size();
        self.phase(format!("{source}: loading"));
        let loaded = scenes::load(source, self.args.alpha, self.args.ao_radius, f64::from(size[0]) / f64::from(size[1]))?;
        self.note_warnings(source, &loaded.scene);
        if let Some(known) = loaded.well_known {
            self.note(format!("{source}: seen and lit as {known} is (docs/benchmarks.md)"));
        }
        interrupt::check()?;
        let flat = FlatScene::new(&loaded.scene);
        let contestants = self.contestants(source, &flat)?;
        let Some(tracer) = contestants.iter().find_map(Contestant::tracer) else {
            return Err(Error::Device(format!(
                "{source}: the device supports none of the requested kernels; see `skylit doctor`"
            )));
        };
        self.phase(format!("{source}: making rays"));
        let sets = RaySets::make(tracer, &loaded, size, &mut SilentControl)?;
        *record = SceneRecord {
            scene: source.to_owned(),
            triangles: loaded.scene.triangle_count(),
            spheres: loaded.scene.sphere_count(),
            instances: loaded.scene.instances.len(),
            stored_primitives: flat.primitive_count() as u64,
            ao_radius: Some(loaded.ao_radius).filter(|r| r.is_finite()),
            light: loaded.light.to_array(),
            builds: contestants.iter().map(|c| c.build.clone()).collect(),
            ..Default::default()
        };
        // contestants that failed on the way
        let mut failed = vec![false; contestants.len()];
        let requested: Vec<&StreamKind> = STREAMS.iter().filter(|s| self.wants(s)).collect();
        for set in Set::ALL {
            if requested.iter().any(|s| s.set == set) {
                self.give_rays(&contestants, &mut failed, set, sets.get(set))?;
            }
        }
        // the counter's tree is that of the default preset
        let same = self.args.build == BuildChoice::Default && flat.primitive_count() <= MAX_VISITED_PRIMITIVES;
        let counted = same && contestants.iter().any(|c| c.kernel == Some(Kernel::Wide));
        let counter = if counted { VisitCounter::new(&flat) } else { None };
        for (k, stream) in requested.iter().enumerate() {
            // one stream at least: a record of nothing says nothing
            if self.is_late() && !(record.streams.is_empty() && self.record.scenes.is_empty()) {
                self.stop_early();
                self.note(format!("time limit: {source}: {} streams left out", requested.len() - k));
                break;
            }
            let rays = sets.get(stream.set);
            if rays.is_empty() {
                self.note(format!("{source}: {}: no rays (nothing in view that they start from)", stream.name));
                continue;
            }
            if !contestants.iter().zip(&failed).any(|(c, f)| !f && c.is_for(stream.set)) {
                self.note(format!("{source}: {}: no contestant takes part in it", stream.name));
                continue;
            }
            let all = if self.args.check { 1.0 - CHECK_SHARE } else { 1.0 };
            let share = [k, k + 1].map(|k| all * k as f64 / requested.len() as f64);
            self.phase(format!("{source}: {}", stream.name));
            let results = self.stream(&contestants, &mut failed, stream, (rays, counter.as_ref()), share)?;
            record.streams.push(results);
        }
        if self.args.check {
            self.check(&loaded, &contestants, &mut failed, &sets, record)?;
        }
        Ok(())
    }

    fn wants(&self, stream: &StreamKind) -> bool {
        self.args.streams.is_empty() || self.args.streams.iter().any(|s| s == stream.name)
    }

    /// Builds the contestants of a scene. At least one is a kernel of skylit, which generates the rays.
    fn contestants<'f>(&mut self, source: &str, flat: &'f FlatScene<'f>) -> Result<Vec<Contestant<'f>>> {
        let mut out = Vec::new();
        let mut refused = None;
        for own in &KERNELS {
            let named = self.args.kernels.iter().any(|k| k == own.name);
            if !named && !self.args.kernels.is_empty() {
                continue;
            }
            self.phase(format!("{source}: building for '{}'", own.name));
            let made = match own.takes_part(self.device.info(), flat, named) {
                Ok(()) => Contestant::own(&self.device, flat, own, &self.args.build_options()),
                Err(why) => Err(Error::Device(why)),
            };
            match made {
                Ok(c) => out.push(c),
                // one that the scene is too large for, or that the device does not run, does not stop the others
                Err(e @ (Error::OutOfMemory(_) | Error::Device(_) | Error::Scene(_))) => {
                    self.note(format!("{source}: '{}' left out: {e}", own.name));
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
            let spec = self.peers[index].spec.clone();
            self.phase(format!("{source}: building for '{}'", spec.name));
            let mut build = || -> Result<Vec<Contestant<'f>>, PeerError> {
                if masked {
                    return Err(PeerError::Failed("it does not support alpha masks".into()));
                }
                self.peers[index].load_geometry(flat)?;
                spec.kernels.iter().map(|k| Contestant::peer(&mut self.peers, index, k, flat)).collect()
            };
            match build() {
                Ok(list) => out.extend(list),
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => self.note(format!("{source}: peer '{}' left out: {why}", spec.name)),
            }
        }
        Ok(out)
    }

    /// Gives a set of rays to every peer that takes part.
    fn give_rays(&mut self, contestants: &[Contestant], failed: &mut [bool], set: Set, rays: &[Ray]) -> Result<()> {
        for index in 0..self.peers.len() {
            if !contestants.iter().zip(&*failed).any(|(c, f)| !f && c.peer_index() == Some(index)) {
                continue;
            }
            match self.peers[index].load_rays(set.name(), rays) {
                Ok(()) => {}
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => {
                    self.note(format!("peer '{}' left out: {why}", self.peers[index].spec.name));
                    contestants.iter().zip(&mut *failed).for_each(|(c, f)| *f |= c.peer_index() == Some(index));
                }
            }
        }
        Ok(())
    }

    /// Measures one stream in rounds: each contestant traces once per round.
    fn stream(
        &mut self,
        contestants: &[Contestant],
        failed: &mut [bool],
        stream: &StreamKind,
        (rays, counter): (&[Ray], Option<&VisitCounter>),
        [from, to]: [f64; 2],
    ) -> Result<StreamRecord> {
        let mut runs: Vec<PreparedRun> = Vec::new();
        for c in contestants {
            runs.push(c.prepare(stream.set, rays, stream.mode)?);
        }
        let mut times: Vec<Vec<RepeatTime>> = contestants.iter().map(|_| Vec::new()).collect();
        let repeats = self.args.repeats();
        for round in 0..=repeats {
            for (k, run) in runs.iter_mut().enumerate() {
                if failed[k] || !contestants[k].is_for(stream.set) {
                    continue;
                }
                match run.repeat(&mut self.peers, &mut self.control) {
                    // the first round compiles, finds launch sizes and fills caches
                    Ok(time) if round > 0 => times[k].push(time),
                    Ok(_) => {}
                    Err(PeerError::Ours(e)) => return Err(e),
                    Err(PeerError::Failed(why)) => {
                        failed[k] = true;
                        self.note(format!("'{}' left out from here: {why}", contestants[k].name));
                    }
                }
            }
            interrupt::check()?;
            self.advance(from + (to - from) * f64::from(round) / f64::from(repeats));
            if round > 0 && self.is_late() {
                if round < repeats {
                    self.stop_early();
                }
                break;
            }
        }
        // a sample of the rays is enough
        let some: Vec<Ray> = rays.iter().step_by(rays.len().div_ceil(VISITED_RAYS).max(1)).copied().collect();
        let visits = counter.map(|c| c.mean(&some, stream.mode == Mode::Any));
        let mut results = Vec::new();
        for (k, contestant) in contestants.iter().enumerate() {
            if failed[k] || times[k].is_empty() {
                continue;
            }
            let count = runs[k].rays as f64;
            let seconds: Vec<f64> = times[k].iter().map(|l| l.device).collect();
            let rates = |s: &[f64]| Summary::from_values(&s.iter().map(|s| count / s / 1e6).collect::<Vec<_>>());
            let walls: Option<Vec<f64>> = times[k].iter().map(|l| l.wall).collect();
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
        give_ratios(&mut results, &self.record.baselines);
        Ok(StreamRecord { stream: stream.name.to_owned(), rays: rays.len(), results })
    }

    /// Compares all hits with those of skylit's first kernel.
    fn check(
        &mut self,
        loaded: &RayScene,
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
        let pairs = (streams.len() * contestants.len()).max(1) as f64;
        for (done, stream) in streams.iter().enumerate() {
            if self.is_late() {
                self.stop_early();
                self.note(format!("time limit: {source}: {} streams not checked", streams.len() - done));
                return Ok(());
            }
            if !(0..contestants.len()).any(|k| k != first && !failed[k] && contestants[k].is_for(stream.set)) {
                self.note(format!(
                    "{source}: {}: hits not checked: only '{}' traces these rays, so there is no second result",
                    stream.name, reference.name
                ));
                continue;
            }
            let rays = sets.get(stream.set);
            let ours = sure(reference.hits(&mut self.peers, rays, stream.mode, &mut self.control))?;
            for (k, contestant) in contestants.iter().enumerate() {
                if k == first || failed[k] || !contestant.is_for(stream.set) {
                    continue;
                }
                let mut compare = || {
                    let hits = contestant.hits(&mut self.peers, rays, stream.mode, &mut self.control)?;
                    if stream.mode == Mode::Closest {
                        return Ok(agreement::compare_closest(&loaded.scene, rays, &hits, &ours));
                    }
                    agreement::compare_any(&loaded.scene, rays, &hits, &ours, |some| {
                        let mut named = contestant.hits(&mut self.peers, some, Mode::Closest, &mut self.control)?;
                        named.extend(reference.hits(&mut self.peers, some, Mode::Closest, &mut self.control)?);
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
                        self.note(format!("'{}' left out of the check from here: {why}", contestant.name));
                    }
                }
                interrupt::check()?;
                self.advance(1.0 - CHECK_SHARE + CHECK_SHARE * (done * contestants.len() + k + 1) as f64 / pairs);
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
