//! `skylit bench path`: how the error of path-traced images falls with time, by sampling strategy and beside peers.
//! docs/bench-path.md says what is measured and how.

mod args;
mod contestant;
mod engine;
mod peer;
mod scenes;
pub mod table;

pub use args::BenchPathArgs;
use contestant::Contestant;
use engine::{Engine, PathReference, STEP, render_reference};
use scenes::PathScene;

use super::peers::file::{self, Measures, PeerSpec};
use super::peers::process::PeerError;
use super::record::path::{OWN, PathBenchmark, ReferenceDifference, ReferenceRecord, SceneRecord};
use super::session::Session;
use super::table::Block;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::SampleSettings;
use crate::film::camera::CameraRecord;
use crate::integrators::path::{self, PathOptions};
use crate::measure::metrics::ImagePair;
use crate::terminal::console::Failure;
use crate::terminal::interrupt;
use crate::tracer::{BuildOptions, ComputeOptions, Needs};

/// Paths of a pixel in one image at most.
const MAX_SPP: u32 = 1 << 16;
/// Share of a scene's progress that its references get.
const REFERENCES: f64 = 0.4;

/// A run of `skylit bench path`.
type PathSession<'a> = Session<'a, BenchPathArgs, PathBenchmark>;

/// Measures, shows, writes.
///
/// # Errors
/// The first that went wrong; what was measured is written all the same.
pub fn run(args: &BenchPathArgs) -> Result<(), Failure> {
    let scenes = scenes::choose(args);
    // before anything that takes long
    let specs = file::choose(args.peers.as_deref(), Measures::Paths)?;
    scenes.sources.iter().try_for_each(|s| scenes::check(s))?;
    args.common.check_inputs(&scenes.sources, args.environment.as_deref(), args.peers.as_deref())?;
    let mut session = Session::start(args, &args.common, |device| PathBenchmark {
        host: device.host_info(),
        tracer: args.tracer.on(device.info()).0.name().to_owned(),
        repeats: args.repeats(),
        ..Default::default()
    })?;
    scenes.notes.into_iter().for_each(|n| session.note(n));
    let measured = measure(&mut session, &scenes.sources, specs);
    session.finish(measured, !args.scenes.is_empty(), Ok(()))
}

/// All scenes. One that fails does not stop the others.
fn measure(session: &mut PathSession, scenes: &[String], specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
    session.start_peers(specs)?;
    session.record.peers = session.peer_titles();
    let title = table::title(&session.record);
    session.show(&[Block::Line(title)])?;
    session.expect_jobs(scenes.len());
    scenes.iter().try_for_each(|source| session.job(source, |session| session.scene(source)))
}

impl PathSession<'_> {
    fn scene(&mut self, source: &str) -> Result<()> {
        let (args, size) = (self.args, self.args.size());
        let name = scenes::name(source);
        self.phase(format!("{name}: building"));
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let loaded = scenes::load(source, args, aspect)?;
        interrupt::check()?;
        let flat = FlatScene::for_paths(&loaded.scene);
        let camera = CameraRecord::new(&loaded.camera, flat.origin, aspect);
        let paths = u64::from(size[0]) * u64::from(size[1]) * 4096;
        let build = BuildOptions { preset: args.build.preset(), rays: paths, cache: None, streams: path::streams().to_vec() };
        let needs = Needs { shading: true, ..Default::default() };
        let (kind, _) = args.tracer.on(self.device.info());
        let tracer = self.device.tracer(&flat, kind, needs, ComputeOptions::default(), &build)?;
        let mut record = SceneRecord {
            scene: name.clone(),
            size,
            triangles: loaded.scene.triangle_count(),
            spheres: loaded.scene.sphere_count(),
            environment: loaded.environment.clone(),
            ..SceneRecord::default()
        };
        let own = |strategy| -> Result<Engine> {
            let options = PathOptions { samples: SampleSettings::new(size, MAX_SPP, 0), strategy, ..PathOptions::default() };
            Engine::own(&tracer, &flat, camera, &options)
        };
        let mut engine = own(path::Strategy::Mis)?;
        let mut references = vec![self.reference(&mut record, OWN, &mut engine).map_err(|e| e.of(OWN))?];
        if let Engine::Own { integrator, .. } = &engine {
            record.lights = integrator.lights();
        }
        drop(engine);
        let mut contestants: Vec<Contestant> = Vec::new();
        for strategy in args.strategies() {
            contestants.push(Contestant::new(strategy.name().to_owned(), 0, own(strategy)?));
        }
        let mut baseline = contestants.first().map(|c| c.name.clone());
        for k in 0..self.peers.len() {
            match self.peer_contestants(k, &loaded, &mut record, &mut references) {
                Ok(theirs) => {
                    if let (0, Some(first)) = (k, theirs.first()) {
                        baseline = Some(first.name.clone());
                    }
                    contestants.extend(theirs);
                }
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => {
                    let peer = &self.peers[k].spec.name;
                    self.note(format!("{name}: peer '{peer}' left out: {why}"));
                }
            }
        }
        self.rounds(&name, &mut contestants, &references)?;
        record.results = contestants.into_iter().map(|c| c.finish(size, &record, &references)).collect();
        if let Some(baseline) = baseline {
            record.set_target(&baseline);
        }
        self.show(&table::scene(&record))?;
        self.record.scenes.push(record);
        Ok(())
    }

    /// Gives a scene to a peer and renders its reference.
    fn peer_contestants(
        &mut self,
        k: usize,
        loaded: &PathScene,
        record: &mut SceneRecord,
        references: &mut Vec<PathReference>,
    ) -> Result<Vec<Contestant<'static>>, PeerError> {
        let size = record.size;
        self.peers[k].load_scene(&loaded.scene, &loaded.camera, size)?;
        let spec = self.peers[k].spec.clone();
        let engine = |kernel: &String| Engine::Peer { peer: k, kernel: kernel.clone(), size };
        let Some(first) = spec.kernels.first() else { return Ok(Vec::new()) };
        let theirs = self.reference(record, &spec.name, &mut engine(first))?;
        let ours = &references[0];
        let sum = |r: &PathReference| r.image.iter().map(|v| f64::from(*v)).sum::<f64>();
        record.differences.push(ReferenceDifference {
            engine: spec.name.clone(),
            mean_ratio: sum(&theirs) / sum(ours),
            rmse: ImagePair::new(&theirs.image, &ours.image, 3, None)?.rmse(),
            explained: theirs.rmse.hypot(ours.rmse),
        });
        references.push(theirs);
        let reference = references.len() - 1;
        Ok(spec.kernels.iter().map(|k| Contestant::new(spec.title_of(k), reference, engine(k))).collect())
    }

    /// Renders the reference of an engine.
    fn reference(&mut self, record: &mut SceneRecord, name: &str, engine: &mut Engine) -> Result<PathReference, PeerError> {
        self.phase(format!("{}: reference of {name}", record.scene));
        let limit = self.args.reference_seconds();
        // ours, and one of each peer
        let (before, all) = (record.references.len() as f64, (self.peers.len() + 1) as f64);
        let (mut advance, peers) = self.advancer();
        let reference =
            render_reference(engine, peers, limit, MAX_SPP, &mut |share| advance(REFERENCES * (before + share) / all))?;
        let mean = reference.image.iter().map(|v| f64::from(*v)).sum::<f64>() / reference.image.len() as f64;
        let PathReference { spp, seconds, rmse, .. } = reference;
        record.references.push(ReferenceRecord { engine: name.to_owned(), spp, seconds, rmse, mean });
        Ok(reference)
    }

    /// Everybody in turn, sample count by sample count: a warming round, which also finds how far to go, then the timed ones.
    fn rounds(&mut self, scene: &str, contestants: &mut [Contestant], references: &[PathReference]) -> Result<()> {
        let rounds = self.args.repeats() + 1;
        for round in 0..rounds {
            self.phase(match round {
                0 => format!("{scene}: warming up"),
                _ => format!("{scene}: round {round} of {}", rounds - 1),
            });
            let (mut spp, mut going) = (1u32, true);
            while going && spp <= MAX_SPP {
                going = false;
                for contestant in contestants.iter_mut() {
                    let wanted = match round {
                        // those whose last image was short go on; a curve has two points
                        0 => contestant
                            .by_spp
                            .last()
                            .is_none_or(|l| l.spp * STEP == spp && (l.spp == 1 || 2.0 * l.seconds[0] < self.args.seconds())),
                        _ => contestant.by_spp.iter().any(|l| l.spp == spp),
                    };
                    if !wanted {
                        continue;
                    }
                    going = true;
                    contestant.render(&mut self.peers, round, spp, references).map_err(|e| e.of(&contestant.name))?;
                }
                spp *= STEP;
            }
            if round == 0 {
                // compiling is not what is timed
                contestants.iter_mut().flat_map(|c| &mut c.by_spp).for_each(|l| l.seconds.clear());
            }
            self.advance(REFERENCES + (1.0 - REFERENCES) * f64::from(round + 1) / f64::from(rounds));
            if self.is_late() && round > 0 {
                self.stop_early();
                break;
            }
        }
        Ok(())
    }
}
