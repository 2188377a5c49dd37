//! `skylit bench rays`: ray rates of all contestants, in interleaved repeats, so that slowdowns of
//! the machine affect all of them.

mod args;
mod check;
mod contestant;
mod edges;
mod peer;
pub(super) mod scenes;
mod streams;

pub use args::BenchRaysArgs;
use args::RaySession;
use check::Check;
use contestant::{Contestant, KERNELS, PreparedRun};
use edges::EdgeCounts;
use scenes::RayScene;
use streams::{STREAMS, StreamKind};

use super::chart;
use super::peers::file::{self, Measures, PeerSpec};
use super::peers::process::PeerError;
use super::record::{BenchKind, SIZE, plain, quantity};
use super::scenes::check_exists;
use super::session::BenchSession;
use crate::accel::flatten::FlatScene;
use crate::error::{Error, Result};
use crate::integrators::ray_sets::{RaySet, RaySets};
use crate::integrators::rays::Mode;
use crate::measure::agreement;
use crate::measure::stats::{LogScaling, Percentiles, paired_ratio};
use crate::ray::Ray;
use crate::report::thousands;
use crate::terminal::console::Failure;
use crate::terminal::interrupt::{self, SilentControl};
use crate::tracer::settings::BuildChoice;
use crate::tracer::visits::VisitCounter;
use crate::tracer::{DeviceBuilder, Kernel};

/// Share of a scene's progress that checking gets, with `--check`.
const CHECK_SHARE: f64 = 0.3;
/// Number of rays of each stream whose node visits are counted.
const VISITED_RAYS: usize = 20_000;
/// Maximum number of primitives of scenes whose hierarchy is rebuilt for counting visits.
const MAX_VISITED_PRIMITIVES: usize = 2_000_000;

/// The outcomes of comparing answers.
#[derive(Default)]
struct Findings {
    checks: Vec<Check>,
    edges: Vec<EdgeCounts>,
    /// Contestants that ratios are given to, if they run.
    baselines: Vec<String>,
}

/// The results of a contestant with a stream.
struct StreamRun<'c> {
    contestant: &'c Contestant<'c>,
    rays: f64,
    hit_share: f64,
    seconds: Vec<f64>,
    wall_seconds: Option<Vec<f64>>,
}

/// Runs the benchmark, prints the results and writes the files.
pub fn run(args: &BenchRaysArgs) -> Result<(), Failure> {
    let scenes = scenes::choose(&args.scenes, args.common.quick);
    // before anything that takes long: a broken peers file, a scene that does not exist
    let specs = file::choose(args.peers.as_deref(), Measures::Rays)?;
    scenes.sources.iter().try_for_each(|s| check_exists(s))?;
    let plan = args.common.check(&scenes.sources, None, args.peers.as_deref())?;
    let mut session = BenchSession::start(args, &args.common, plan, BenchKind::Rays, |_| {
        let [width, height] = args.size();
        vec![("rays", format!("{width}x{height}")), ("build", args.build.name().to_owned())]
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let mut findings = Findings::default();
    let measured = measure(&mut session, &scenes.sources, specs, &mut findings);
    let shown = add_scaling(&mut session);
    let agreed = check::verdict(&findings.checks).and(edges::verdict(&findings.edges));
    session.finish(measured, !args.scenes.is_empty(), shown.and(agreed))
}

/// All scenes. One that fails does not stop the others.
fn measure(
    session: &mut RaySession,
    scenes: &[String],
    specs: Result<Vec<PeerSpec>, String>,
    findings: &mut Findings,
) -> Result<()> {
    session.start_peers(specs)?;
    let specs = session.peers.iter().map(|p| &p.spec);
    findings.baselines = specs.flat_map(|s| s.baselines.iter().map(|k| s.title_of(k))).collect();
    if session.args.edges {
        return session.edges(&mut findings.edges);
    }
    session.expect_jobs(scenes.len());
    for source in scenes {
        session.job(source, |session| {
            let outcome = session.scene(source, findings);
            // what there is, also where it failed
            session.show_scene(source)?;
            outcome
        })?;
    }
    Ok(())
}

/// Says of each family of scenes, stream and contestant how rates fall with size.
fn add_scaling(session: &mut RaySession) -> Result<()> {
    let rates: Vec<_> = session
        .record
        .measurements
        .iter()
        .filter(|m| m.quantity == quantity::RATE.name)
        .filter_map(|m| {
            let family = chart::family(&m.scene)?.to_owned();
            let size = m.at.as_ref()?.value as u64;
            Some(((family, m.part.clone(), m.contestant.clone()), (size, m.values.middle())))
        })
        .collect();
    let keys = chart::distinct(rates.iter().map(|(key, _)| key));
    for key in &keys {
        let points: Vec<(u64, f64)> = rates.iter().filter(|(k, _)| k == *key).map(|(_, p)| *p).collect();
        let Some(law) = LogScaling::from_points(&points) else { continue };
        let (family, stream, contestant) = key;
        let mut row = session.record.row(family, &format!("{stream} by size"), contestant);
        row.exact(plain("falls as n to the power", ""), law.exponent);
        row.exact(plain("worst x log n", ""), law.worst).exact(plain("at", ""), law.worst_at as f64);
        let holds = if law.holds() { "yes" } else { "no" };
        let remark = format!("{stream}, {contestant}: falls no faster than log n: {holds}");
        session.record.scene(family).remarks.push(remark);
    }
    let families = chart::distinct(keys.iter().map(|(family, ..)| family));
    families.into_iter().try_for_each(|family| session.show_scene(family))
}

impl RaySession<'_> {
    /// Everything about one scene. The record has what there is also where it fails.
    fn scene(&mut self, source: &str, findings: &mut Findings) -> Result<()> {
        let size = self.args.size();
        self.phase(format!("{source}: loading"));
        let loaded =
            scenes::load(source, self.args.alpha, self.args.ao_radius, f64::from(size[0]) / f64::from(size[1]))?;
        self.note_warnings(source, &loaded.scene);
        if let Some(known) = loaded.well_known {
            self.note(format!("{source}: seen and lit as {known} is (docs/reference/benchmarks.md)"));
        }
        interrupt::check()?;

        // Builds the contestants, and makes the rays that they are given.
        let flat = FlatScene::new(&loaded.scene);
        let contestants = self.contestants(source, &flat)?;
        let Some(tracer) = contestants.iter().find_map(Contestant::tracer) else {
            return Err(Error::Device(format!(
                "{source}: the device supports none of the requested kernels; see `skylit doctor`"
            )));
        };
        self.phase(format!("{source}: making rays"));
        let (seen, lit) = ((&loaded.scene, &loaded.camera), (loaded.ao_radius, loaded.light));
        let sets = RaySets::new(tracer, seen, lit, size, &mut SilentControl)?;
        // contestants that failed on the way
        let mut failed = vec![false; contestants.len()];
        let requested: Vec<&StreamKind> = STREAMS.iter().filter(|s| self.wants(s)).collect();
        for set in RaySet::ALL {
            if requested.iter().any(|s| s.set == set) {
                self.load_rays(&contestants, &mut failed, set, sets.get(set))?;
            }
        }
        // the counter's tree is that of the default preset, or of the device
        let on_device = self.args.build.on_device();
        let same = (self.args.build == BuildChoice::Default || on_device.is_some())
            && flat.primitive_count() <= MAX_VISITED_PRIMITIVES;
        let counted = same && contestants.iter().any(|c| c.kernel == Some(Kernel::Wide));
        let builder = on_device.filter(|_| counted).map(|n| DeviceBuilder::new(&self.device, n)).transpose()?;
        let counter = if counted { VisitCounter::with_builder(&flat, builder.as_ref()) } else { None };

        // Measures stream by stream, as long as there is time.
        let mut traced: Vec<&StreamKind> = Vec::new();
        for (k, stream) in requested.iter().enumerate() {
            // one stream at least: a record of nothing says nothing
            if self.is_over() {
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
            let runs = self.stream(&contestants, &mut failed, stream, rays, share)?;
            if traced.is_empty() {
                self.add_scene(source, &loaded, &flat, &contestants);
            }
            // a sample of the rays is enough
            let some: Vec<Ray> = rays.iter().step_by(rays.len().div_ceil(VISITED_RAYS).max(1)).copied().collect();
            let visits = counter.as_ref().map(|c| c.mean(&some, stream.mode == Mode::Any));
            let size = (loaded.scene.triangle_count() + loaded.scene.sphere_count()) as f64;
            // ratios are to each baseline that ran, or else to the first contestant
            let is_named = |run: &&StreamRun| findings.baselines.contains(&run.contestant.name);
            let mut bases: Vec<&StreamRun> = runs.iter().filter(is_named).collect();
            if bases.is_empty() && runs.len() > 1 {
                bases.extend(runs.first());
            }
            for run in &runs {
                let Contestant { name, kernel, .. } = run.contestant;
                let mut row = self.record.row(source, stream.name, name).of_peer(run.contestant.peer_index().is_some());
                let mut row = row.at(SIZE, size);
                let rates = |seconds: &[f64]| {
                    Percentiles::from_values(&seconds.iter().map(|s| run.rays / s / 1e6).collect::<Vec<_>>())
                };
                row.repeated(quantity::RATE, rates(&run.seconds));
                row.repeated(plain("wall rate", "Mrays/s"), run.wall_seconds.as_deref().and_then(rates));
                row.exact(plain("traced", "rays"), run.rays).exact(plain("hit share", ""), run.hit_share);
                // round by round
                for base in &bases {
                    let ratio = paired_ratio(&run.seconds, run.rays, &base.seconds, base.rays);
                    row.exact(plain(&format!("x {}", base.contestant.name), ""), ratio);
                }
                let visits = visits.filter(|_| *kernel == Some(Kernel::Wide));
                row.exact(quantity::NODES, visits.map(|v| v.nodes));
                row.exact(plain("leaves a ray", ""), visits.map(|v| v.leaves));
            }
            traced.push(stream);
        }
        if self.args.check {
            self.check(source, &loaded, &contestants, &mut failed, (&sets, &traced), findings)?;
        }
        Ok(())
    }

    /// Describes a scene, and says what building took.
    fn add_scene(&mut self, source: &str, loaded: &RayScene, flat: &FlatScene, contestants: &[Contestant]) {
        let (triangles, spheres) = (loaded.scene.triangle_count(), loaded.scene.sphere_count());
        let mut about = vec![format!("{} triangles", thousands(triangles))];
        about.extend((spheres > 0).then(|| format!("{} spheres", thousands(spheres))));
        let (stored, instances) = (flat.primitive_count() as u64, loaded.scene.instances.len() as u64);
        let is_shared = stored != triangles + spheres;
        about.extend(is_shared.then(|| format!("{} stored, {} instances", thousands(stored), thousands(instances))));
        self.record.scene(source).about = about.join(", ");
        for contestant in contestants {
            let (build, is_peers) = (&contestant.build, contestant.peer_index().is_some());
            let mut row = self.record.row(source, "building", &contestant.name).of_peer(is_peers);
            row.exact(plain("build", "s"), build.seconds).exact(plain("upload", "s"), build.upload_seconds);
            row.exact(quantity::BYTES, build.bytes_per_primitive).exact(plain("SAH cost", ""), build.sah_cost);
            let device = Some(build.on_device).filter(|d| d.trees > 0);
            for (name, seconds) in [
                ("sorting", device.map(|d| d.sort_seconds)),
                ("clustering", device.map(|d| d.cluster_seconds)),
                ("wide nodes", device.map(|d| d.emit_seconds)),
            ] {
                row.exact(plain(name, "ms"), seconds.map(|s| 1e3 * s));
            }
        }
    }

    fn wants(&self, stream: &StreamKind) -> bool {
        self.args.streams.is_empty() || self.args.streams.iter().any(|s| s == stream.name)
    }

    /// Builds the contestants of a scene. At least one is a kernel of skylit, which makes the rays.
    fn contestants<'f>(&mut self, source: &str, flat: &'f FlatScene<'f>) -> Result<Vec<Contestant<'f>>> {
        let mut out = Vec::new();
        let mut refused = None;
        for own in &KERNELS {
            let named = self.args.kernels.iter().any(|k| k == own.name);
            if !named && !self.args.kernels.is_empty() {
                continue;
            }
            self.phase(format!("{source}: building for '{}'", own.name));
            let made = match own.takes_part(&self.device.info, flat, named) {
                Ok(()) => Contestant::own(&self.device, flat, own, &self.args.build_options()),
                Err(why) => Err(Error::Device(why)),
            };
            match made {
                Ok(c) => out.push(c),
                // a device or a scene that one contestant cannot take does not stop the others
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

        // Peers build from the same triangles; they know no alpha masks.
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
            let built = build();
            let built = self.unless_peer_fails(&format!("{source}: peer '{}' left out", spec.name), built)?;
            out.extend(built.into_iter().flatten());
        }
        Ok(out)
    }

    /// Gives a set of rays to every peer that takes part.
    fn load_rays(&mut self, contestants: &[Contestant], failed: &mut [bool], set: RaySet, rays: &[Ray]) -> Result<()> {
        for index in 0..self.peers.len() {
            if !contestants.iter().zip(&*failed).any(|(c, f)| !f && c.peer_index() == Some(index)) {
                continue;
            }
            let loaded = self.peers[index].load_rays(set.name(), rays);
            let what = format!("peer '{}' left out", self.peers[index].spec.name);
            if self.unless_peer_fails(&what, loaded)?.is_none() {
                contestants.iter().zip(&mut *failed).for_each(|(c, f)| *f |= c.peer_index() == Some(index));
            }
        }
        Ok(())
    }

    /// Measures one stream in rounds: each contestant traces once per round.
    fn stream<'c>(
        &mut self,
        contestants: &'c [Contestant<'c>],
        failed: &mut [bool],
        stream: &StreamKind,
        rays: &[Ray],
        [from, to]: [f64; 2],
    ) -> Result<Vec<StreamRun<'c>>> {
        let mut runs: Vec<PreparedRun> = Vec::new();
        for c in contestants {
            runs.push(c.prepare(stream.set, rays, stream.mode)?);
        }

        // Traces in rounds, without contestants that have failed.
        let mut times: Vec<Vec<(f64, Option<f64>)>> = contestants.iter().map(|_| Vec::new()).collect();
        let repeats = self.args.repeats();
        for round in 0..=repeats {
            for (k, run) in runs.iter_mut().enumerate() {
                if failed[k] || !contestants[k].is_for(stream.set) {
                    continue;
                }
                let time = run.repeat(&mut self.peers, &mut self.control);
                let time = self.unless_peer_fails(&format!("'{}' left out from here", contestants[k].name), time)?;
                failed[k] = time.is_none();
                // the first round compiles, finds launch sizes and fills caches
                times[k].extend(time.filter(|_| round > 0));
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

        // Collects times and hits of those that are left.
        let mut results = Vec::new();
        for (k, contestant) in contestants.iter().enumerate() {
            if failed[k] || times[k].is_empty() {
                continue;
            }
            let rays = runs[k].rays as f64;
            results.push(StreamRun {
                contestant,
                rays,
                hit_share: runs[k].hit_count()? as f64 / rays,
                seconds: times[k].iter().map(|t| t.0).collect(),
                wall_seconds: times[k].iter().map(|t| t.1).collect(),
            });
        }
        Ok(results)
    }

    /// Compares all hits with those of skylit's first kernel.
    fn check(
        &mut self,
        source: &str,
        loaded: &RayScene,
        contestants: &[Contestant],
        failed: &mut [bool],
        (sets, streams): (&RaySets, &[&StreamKind]),
        findings: &mut Findings,
    ) -> Result<()> {
        let Some((first, reference)) = contestants.iter().enumerate().find(|(_, c)| c.tracer().is_some()) else {
            return Ok(());
        };
        self.phase(format!("{source}: checking"));

        // Compares stream by stream, as long as there is time.
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
            let ours = reference.hits(&mut self.peers, rays, stream.mode, &mut self.control);
            // our own contestants fail with errors of ours only
            let ours = ours.map_err(|e| e.into_error(&reference.name))?;
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
                let found = compare();
                let what = format!("'{}' left out of the check from here", contestant.name);
                if let Some(found) = self.unless_peer_fails(&what, found)? {
                    let names = [source, stream.name, &contestant.name, &reference.name].map(str::to_owned);
                    let check = Check { names, found, strict: contestant.strict };
                    check.add_to(&mut self.record);
                    findings.checks.push(check);
                } else {
                    failed[k] = true;
                }
                interrupt::check()?;
                self.advance(1.0 - CHECK_SHARE + CHECK_SHARE * (done * contestants.len() + k + 1) as f64 / pairs);
            }
        }
        Ok(())
    }
}
