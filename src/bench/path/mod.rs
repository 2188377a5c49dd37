//! `skylit bench path`: error of path-traced images over time, by sampling strategy and beside
//! peers. docs/reference/benchmarks.md says what is measured and how.

mod args;
mod contestant;
mod curve;
mod engine;
mod peer;
mod scenes;

use std::collections::BTreeSet;

pub use args::BenchPathArgs;
use args::PathSession;
use contestant::Contestant;
use curve::{ErrorCurve, PART};
use engine::{Engine, MAX_SPP, PathReference, render_reference};
use scenes::PathScene;

use super::peers::file::{self, Measures, PeerSpec};
use super::peers::process::PeerError;
use super::record::{BenchKind, REFERENCE, plain, quantity};
use super::scenes::table_name;
use super::session::BenchSession;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::SampleSettings;
use crate::film::camera::CameraRecord;
use crate::integrators::path::{self, PathOptions};
use crate::measure::metrics::ImagePair;
use crate::report::thousands;
use crate::terminal::console::Failure;
use crate::terminal::interrupt;
use crate::tracer::{BuildOptions, ComputeOptions, Needs, Tracer};

/// Share of a scene's progress that its references get.
const REFERENCES: f64 = 0.4;

/// Name of our own engine.
const OWN: &str = "skylit";

pub fn run(args: &BenchPathArgs) -> Result<(), Failure> {
    let scenes = scenes::choose(args);
    // before anything that takes long
    let specs = file::choose(args.peers.as_deref(), Measures::Paths)?;
    scenes.sources.iter().try_for_each(|s| scenes::check(s))?;
    let plan = args.common.check(&scenes.sources, args.environment.as_deref(), args.peers.as_deref())?;
    let mut session = BenchSession::start(args, &args.common, plan, BenchKind::Path, |device| {
        let [width, height] = args.size();
        vec![("tracer", args.tracer.on(device).0.name().to_owned()), ("size", format!("{width}x{height}"))]
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let measured = measure(&mut session, &scenes.sources, specs);
    session.finish(measured, !args.scenes.is_empty(), Ok(()))
}

/// All scenes. One that fails does not stop the others.
fn measure(session: &mut PathSession, scenes: &[String], specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
    session.start_peers(specs)?;
    session.expect_jobs(scenes.len());
    scenes.iter().try_for_each(|source| session.job(source, |session| session.scene(source)))
}

impl PathSession<'_> {
    fn scene(&mut self, source: &str) -> Result<()> {
        let (args, size) = (self.args, self.args.size());
        let name = table_name(&scenes::FILES, source);
        self.phase(format!("{name}: building"));
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let loaded = scenes::load(source, args, aspect)?;
        interrupt::check()?;
        let flat = FlatScene::for_paths(&loaded.scene);
        let camera = CameraRecord::new(&loaded.camera, flat.origin, aspect);
        let paths = u64::from(size[0]) * u64::from(size[1]) * 4096;
        let build = BuildOptions {
            preset: args.build.preset(),
            on_device: args.build.on_device(),
            rays: paths,
            streams: path::streams().to_vec(),
            ..Default::default()
        };
        let needs = Needs { shading: true, ..Default::default() };
        let (kind, _) = args.tracer.on(&self.device.info);
        let tracer = Tracer::with_build(&self.device, kind, &flat, needs, ComputeOptions::default(), &build)?;
        let own = |strategy| -> Result<Engine> {
            let options =
                PathOptions { samples: SampleSettings::new(size, MAX_SPP, 0), strategy, ..PathOptions::default() };
            Engine::own(&tracer, &flat, camera, &options)
        };
        let mut engine = own(path::Strategy::Mis)?;
        let mut references = vec![self.reference(&name, OWN, 0, &mut engine).map_err(|e| e.into_error(OWN))?];
        let lights = if let Engine::Own { integrator, .. } = &engine { integrator.lights() } else { 0 };
        drop(engine);
        let mut contestants: Vec<Contestant> = Vec::new();
        for strategy in args.strategies() {
            contestants.push(Contestant::new(strategy.name().to_owned(), 0, own(strategy)?));
        }
        let mut baseline = contestants.first().map(|c| c.name.clone());
        for k in 0..self.peers.len() {
            let theirs = self.peer_contestants(k, (&name, &loaded), size, &mut references);
            let what = format!("{name}: peer '{}' left out", self.peers[k].spec.name);
            let theirs = self.unless_peer_fails(&what, theirs)?.unwrap_or_default();
            if let (0, Some(first)) = (k, theirs.first()) {
                baseline = Some(first.name.clone());
            }
            contestants.extend(theirs);
        }
        self.rounds(&name, &mut contestants, baseline.as_deref(), &references)?;
        let curves: Vec<ErrorCurve> = contestants.into_iter().map(|c| c.finish(size, &references)).collect();

        // all at once: what is interrupted on the way is no result
        let mut about = vec![format!("{} triangles", thousands(loaded.scene.triangle_count()))];
        let spheres = loaded.scene.sphere_count();
        about.extend((spheres > 0).then(|| format!("{} spheres", thousands(spheres))));
        about.push(format!("{lights} lights"));
        about.push(format!("environment {}", loaded.environment));
        self.record.scene(&name).about = about.join(", ");
        self.add_references(&name, &references)?;
        let target = baseline.and_then(|baseline| curves.iter().find(|c| c.name == baseline));
        curves.iter().for_each(|curve| curve.add_to(&mut self.record, &name, target));
        if let Some((target, last)) = target.and_then(|t| Some((t, t.points.last()?))) {
            let remark = format!("the target is the RMSE of the longest images of {}: {:.2e}", target.name, last.rmse);
            self.record.scene(&name).remarks.push(remark);
        }
        self.show_scene(&name)
    }

    /// Adds what reference images are, and how far those of peers are from ours.
    fn add_references(&mut self, scene: &str, references: &[PathReference]) -> Result<()> {
        let mean = |r: &PathReference| r.image.iter().map(|v| f64::from(*v)).sum::<f64>() / r.image.len() as f64;
        for r in references {
            let name = if references.len() > 1 { format!("{REFERENCE} of {}", r.engine) } else { REFERENCE.to_owned() };
            let mut row = self.record.row(scene, PART, &name).of_peer(r.engine != OWN);
            row.exact(quantity::RMSE.not_compared(), r.rmse).exact(plain("greatest", "spp"), r.spp as f64);
            row.exact(plain("image", "s"), r.seconds).exact(plain("mean", ""), mean(r));
            let ours = &references[0];
            if r.engine != OWN {
                let rmse = ImagePair::new(&r.image, &ours.image, 3, None)?.rmse();
                let explained = r.rmse.hypot(ours.rmse);
                let ratio = mean(r) / mean(ours);
                row.exact(plain("mean over ours", ""), ratio).exact(plain("RMSE beside ours", ""), rmse);
                row.exact(plain("of which noise", ""), explained);
            }
        }
        Ok(())
    }

    /// Gives a scene to a peer and renders its reference.
    fn peer_contestants(
        &mut self,
        k: usize,
        (name, loaded): (&str, &PathScene),
        size: [u32; 2],
        references: &mut Vec<PathReference>,
    ) -> Result<Vec<Contestant<'static>>, PeerError> {
        self.peers[k].load_scene(&loaded.scene, &loaded.camera, size)?;
        let spec = self.peers[k].spec.clone();
        let engine = |kernel: &String| Engine::Peer { peer: k, kernel: kernel.clone(), size };
        let Some(first) = spec.kernels.first() else { return Ok(Vec::new()) };
        let theirs = self.reference(name, &spec.name, references.len(), &mut engine(first))?;
        references.push(theirs);
        let reference = references.len() - 1;
        Ok(spec.kernels.iter().map(|k| Contestant::new(spec.title_of(k), reference, engine(k))).collect())
    }

    /// Renders the reference of an engine, after so many others.
    fn reference(
        &mut self,
        scene: &str,
        name: &str,
        done: usize,
        engine: &mut Engine,
    ) -> Result<PathReference, PeerError> {
        self.phase(format!("{scene}: reference of {name}"));
        let limit = self.args.reference_seconds();
        // ours, and one of each peer
        let (done, all) = (done as f64, (self.peers.len() + 1) as f64);
        let (mut advance, peers) = self.advancer();
        let mut advance = |share| advance(REFERENCES * (done + share) / all);
        render_reference(engine, name, peers, (limit, MAX_SPP), &mut advance)
    }

    /// Runs contestants in turn for each sample count: a warming round, in which each finds out how
    /// far it goes, the baseline first, then timed ones.
    fn rounds(
        &mut self,
        scene: &str,
        contestants: &mut [Contestant],
        baseline: Option<&str>,
        references: &[PathReference],
    ) -> Result<()> {
        // warming up: compiling is not what is timed
        let mut target = None;
        for is_baseline in [true, false] {
            for contestant in contestants.iter_mut().filter(|c| (baseline == Some(c.name.as_str())) == is_baseline) {
                self.phase(format!("{scene}: warming up {}", contestant.name));
                while let Some(spp) = contestant.next_count(self.args.seconds(), target) {
                    contestant
                        .render(&mut self.peers, 0, spp, references)
                        .map_err(|e| e.into_error(&contestant.name))?;
                }
                target = target.or_else(|| contestant.last_rmse().filter(|_| is_baseline));
            }
        }
        contestants.iter_mut().flat_map(|c| &mut c.by_spp).for_each(|l| l.seconds.clear());

        let rounds = self.args.repeats();
        let counts = contestants.iter().flat_map(|c| &c.by_spp).map(|l| l.spp).collect::<BTreeSet<u32>>();
        for round in 1..=rounds {
            self.phase(format!("{scene}: round {round} of {rounds}"));
            self.advance(REFERENCES + (1.0 - REFERENCES) * f64::from(round) / f64::from(rounds + 1));
            for &spp in &counts {
                for contestant in contestants.iter_mut().filter(|c| c.by_spp.iter().any(|l| l.spp == spp)) {
                    contestant
                        .render(&mut self.peers, round, spp, references)
                        .map_err(|e| e.into_error(&contestant.name))?;
                }
            }
            if self.is_late() {
                self.stop_early();
                break;
            }
        }
        Ok(())
    }
}
