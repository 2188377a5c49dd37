//! `skylit bench path`: how the error of path-traced images falls with time, by sampling strategy and beside peers.
//! docs/benchmarks.md says what is measured and how.

mod args;
mod engine;
mod peer;
mod scenes;
mod table;

use std::sync::Arc;
use std::time::Instant;

pub use args::BenchPathArgs;
use engine::{Engine, OWN, STEP, Truth, truth};
use peer::Peer;

use super::peers::file as peers_file;
use super::peers::file::{Measures, PeerSpec};
use super::peers::process::PeerError;
use crate::accel::flatten::FlatScene;
use crate::bench::plot;
use crate::bench::record::path::{Contestant, Difference, PathBenchmark, PathScene, Point, Reference};
use crate::error::{Error, Result};
use crate::film::camera::CameraRecord;
use crate::gpu::Device;
use crate::integrators::path::{self, PathOptions};
use crate::measure::metrics::{ImagePair, bad_pixels};
use crate::measure::stats::Summary;
use crate::terminal::console::{Console, Failure};
use crate::terminal::interrupt::{self, ProgressControl};
use crate::terminal::progress::Progress;
use crate::tracer::{BuildOptions, ComputeOptions, Needs, Tracer, TracerKind};

/// Paths of a pixel in one image at most.
const MAX_SPP: u32 = 1 << 16;
/// Steps of the progress bar for one scene.
const STEPS: u64 = 1000;
/// Share of a scene's bar that its references get.
const REFERENCES: f64 = 0.4;

/// Measures, shows, writes.
pub fn run(args: &BenchPathArgs) -> Result<(), Failure> {
    let start = Instant::now();
    args.common.check()?;
    interrupt::install();
    let console = args.common.console();
    let (scenes, notes) = scenes::choose(args);
    // before anything that takes long
    let specs = peers_file::choose(args.peers.as_deref(), Measures::Paths)?;
    scenes.iter().try_for_each(|s| scenes::check(s))?;
    let device = args.common.open_device()?;
    let kind = args.tracer.on(&device.info).0;
    let mut bench = Bench {
        args,
        console,
        device: &device,
        kind,
        peers: Vec::new(),
        keyboard: ProgressControl { progress: Progress::new("measuring", &console), keep_partial: false },
        start,
        out: PathBenchmark {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: device.info.name.clone(),
            driver: device.info.driver.clone(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            tracer: kind.name().to_owned(),
            repeats: args.repeats(),
            ..Default::default()
        },
        jobs: (0, scenes.len().max(1) as u64),
        failed: None,
    };
    notes.into_iter().for_each(|n| bench.note(n));
    // whatever goes wrong from here on, what was measured until then is written
    let measured = bench.everything(&scenes, specs);
    let (out, failed) = (bench.out, bench.failed);
    drop((bench.keyboard, bench.peers));
    let valid = device.check_validation();
    if measured.is_ok() {
        device.save_pipeline_cache();
    }
    let written =
        if out.is_empty() { Ok(()) } else { args.common.write(&out, |f| out.write_csv(f), || plot::path::draw(&out)) };
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
    args: &'a BenchPathArgs,
    console: Console,
    device: &'a Arc<Device>,
    kind: TracerKind,
    peers: Vec<Peer>,
    keyboard: ProgressControl,
    start: Instant,
    out: PathBenchmark,
    /// Scenes that are done, and all of them.
    jobs: (u64, u64),
    /// The first that went wrong.
    failed: Option<Error>,
}

/// Who is measured, and what was found until now.
struct Entry<'a> {
    name: String,
    /// Place of its reference.
    truth: usize,
    engine: Engine<'a>,
    /// By sample count.
    laps: Vec<Laps>,
    /// Sums of image - reference over all images, one for each repeat.
    biases: Vec<f64>,
    longest_launch: Option<f64>,
}

/// Images of one sample count.
struct Laps {
    spp: u32,
    seconds: Vec<f64>,
    squares: Vec<f64>,
    bad: Vec<f64>,
    rays: Option<u64>,
}

impl<'a> Bench<'a> {
    fn everything(&mut self, scenes: &[String], specs: Result<Vec<PeerSpec>, String>) -> Result<()> {
        match specs {
            Ok(specs) => self.start_peers(&specs)?,
            Err(why) => self.note(why),
        }
        let title = format!("{} ({}), tracer {}", self.out.device, self.out.driver, self.out.tracer);
        self.lines(&[title])?;
        for source in scenes {
            // one at least: a record of nothing says nothing
            if self.is_late() && !self.out.is_empty() {
                self.out.stopped_early = true;
                self.note(format!("time limit: {source}: left out"));
                continue;
            }
            let outcome = self.scene(source);
            self.jobs.0 += 1;
            match outcome {
                Ok(()) => (),
                Err(e @ (Error::Interrupted | Error::DeviceLost(_))) => return Err(e),
                Err(e) => {
                    self.note(format!("{source}: left out: {e}"));
                    self.failed.get_or_insert(e);
                }
            }
        }
        Ok(())
    }

    /// Those that do not start are left out with a note.
    fn start_peers(&mut self, specs: &[PeerSpec]) -> Result<()> {
        for spec in specs {
            self.keyboard.progress.phase(format!("starting peer '{}'", spec.name));
            match Peer::start(spec) {
                Ok(peer) => {
                    self.out.peers.push(peer.process.title.clone());
                    self.peers.push(peer);
                }
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => self.note(spec.missing(&why)),
            }
        }
        Ok(())
    }

    fn scene(&mut self, source: &str) -> Result<()> {
        let (args, size) = (self.args, self.args.size());
        let name = scenes::name(source);
        self.keyboard.progress.phase(format!("{name}: building"));
        let aspect = f64::from(size[0]) / f64::from(size[1]);
        let subject = scenes::load(source, args, aspect)?;
        interrupt::check()?;
        let flat = FlatScene::for_paths(&subject.scene);
        let camera = CameraRecord::new(&subject.camera, flat.origin, aspect);
        let paths = u64::from(size[0]) * u64::from(size[1]) * 4096;
        let build = BuildOptions { preset: args.build.preset(), rays: paths, cache: None, streams: path::streams().to_vec() };
        let needs = Needs { shading: true, ..Default::default() };
        let tracer = Tracer::with_build(self.device, self.kind, &flat, needs, ComputeOptions::default(), &build)?;
        let mut record = PathScene {
            scene: name.clone(),
            size,
            triangles: subject.scene.triangle_count(),
            spheres: subject.scene.sphere_count(),
            environment: subject.environment.clone(),
            ..PathScene::default()
        };
        let mut truths = Vec::new();
        let own = |strategy| -> Result<Engine> {
            let options = PathOptions { size, spp: MAX_SPP, strategy, ..PathOptions::default() };
            Engine::own(&tracer, &flat, camera, &options)
        };
        let mut referee = own(path::Strategy::Mis)?;
        let ours = self.reference(&mut record, OWN, &mut referee, self.peers.len() + 1);
        truths.push(ours.map_err(|e| e.of(OWN))?);
        if let Engine::Own { integrator, .. } = &referee {
            record.lights = integrator.lights();
        }
        drop(referee);
        let mut entries: Vec<Entry> = Vec::new();
        for strategy in args.strategies() {
            let engine = own(strategy.into())?;
            let name = format!("{strategy:?}").to_lowercase();
            entries.push(Entry { name, truth: 0, engine, laps: Vec::new(), biases: Vec::new(), longest_launch: None });
        }
        let mut baseline = entries.first().map(|e| e.name.clone());
        for k in 0..self.peers.len() {
            match self.peer_entries(k, &subject, &mut record, &mut truths) {
                Ok(theirs) => {
                    if let (0, Some(first)) = (k, theirs.first()) {
                        baseline = Some(first.name.clone());
                    }
                    entries.extend(theirs);
                }
                Err(PeerError::Ours(e)) => return Err(e),
                Err(PeerError::Failed(why)) => {
                    let peer = &self.peers[k].process.spec.name;
                    self.note(format!("{name}: peer '{peer}' left out: {why}"));
                }
            }
        }
        self.measure(&name, &mut entries, &truths)?;
        record.results = entries.into_iter().map(|e| e.finish(size, &record, truths.as_slice())).collect();
        if let Some(baseline) = baseline {
            record.set_target(&baseline);
        }
        self.lines(&table::scene(&record))?;
        self.out.scenes.push(record);
        Ok(())
    }

    /// Gives a scene to a peer and makes its reference.
    fn peer_entries(
        &mut self,
        k: usize,
        subject: &scenes::Subject,
        record: &mut PathScene,
        truths: &mut Vec<Truth>,
    ) -> Result<Vec<Entry<'static>>, PeerError> {
        let size = record.size;
        self.peers[k].load(&subject.scene, &subject.camera, size)?;
        let spec = self.peers[k].process.spec.clone();
        let engine = |kernel: &String| Engine::Peer { peer: k, kernel: kernel.clone(), size };
        let Some(first) = spec.kernels.first() else { return Ok(Vec::new()) };
        let theirs = self.reference(record, &spec.name, &mut engine(first), self.peers.len() + 1)?;
        let ours = &truths[0];
        let mean = |t: &Truth| t.image.iter().map(|v| f64::from(*v)).sum::<f64>();
        record.differences.push(Difference {
            engine: spec.name.clone(),
            mean_ratio: mean(&theirs) / mean(ours),
            rmse: ImagePair::new(&theirs.image, &ours.image, 3, None)?.rmse(),
            explained: theirs.rmse.hypot(ours.rmse),
        });
        truths.push(theirs);
        let truth = truths.len() - 1;
        let entry = |kernel: &String| Entry {
            name: spec.title_of(kernel),
            truth,
            engine: engine(kernel),
            laps: Vec::new(),
            biases: Vec::new(),
            longest_launch: None,
        };
        Ok(spec.kernels.iter().map(entry).collect())
    }

    fn reference(&mut self, record: &mut PathScene, name: &str, engine: &mut Engine, of: usize) -> Result<Truth, PeerError> {
        self.keyboard.progress.phase(format!("{}: reference of {name}", record.scene));
        let Self { keyboard, peers, args, jobs, .. } = self;
        let (jobs, before) = (*jobs, record.references.len() as f64);
        let limit = args.reference_seconds();
        let truth = truth(engine, peers, limit, MAX_SPP, &mut |share| {
            advance(keyboard, jobs, REFERENCES * (before + share) / of as f64);
        })?;
        let mean = truth.image.iter().map(|v| f64::from(*v)).sum::<f64>() / truth.image.len() as f64;
        let engine = name.to_owned();
        record.references.push(Reference { engine, spp: truth.spp, seconds: truth.seconds, rmse: truth.rmse, mean });
        Ok(truth)
    }

    /// Everybody in turn, sample count by sample count: a warming round, which also finds how far to go, then the timed ones.
    fn measure(&mut self, scene: &str, entries: &mut [Entry], truths: &[Truth]) -> Result<()> {
        let rounds = self.args.repeats() + 1;
        for round in 0..rounds {
            self.keyboard.progress.phase(match round {
                0 => format!("{scene}: warming up"),
                _ => format!("{scene}: round {round} of {}", rounds - 1),
            });
            let (mut spp, mut going) = (1u32, true);
            while going && spp <= MAX_SPP {
                going = false;
                for entry in entries.iter_mut() {
                    let wanted = match round {
                        // those whose last image was short go on; a curve has two points
                        0 => entry
                            .laps
                            .last()
                            .is_none_or(|l| l.spp * STEP == spp && (l.spp == 1 || 2.0 * l.seconds[0] < self.args.seconds())),
                        _ => entry.laps.iter().any(|l| l.spp == spp),
                    };
                    if !wanted {
                        continue;
                    }
                    going = true;
                    entry.lap(&mut self.peers, round, spp, truths).map_err(|e| e.of(&entry.name))?;
                }
                spp *= STEP;
            }
            if round == 0 {
                // compiling is not what is timed
                entries.iter_mut().flat_map(|e| &mut e.laps).for_each(|l| l.seconds.clear());
            }
            let share = f64::from(round + 1) / f64::from(rounds);
            advance(&mut self.keyboard, self.jobs, REFERENCES + (1.0 - REFERENCES) * share);
            if self.is_late() && round > 0 {
                self.out.stopped_early = true;
                break;
            }
        }
        Ok(())
    }

    fn note(&mut self, text: String) {
        self.keyboard.progress.suspend(|| self.console.warning(&text));
        self.out.notes.push(text);
    }

    fn lines(&self, lines: &[String]) -> Result<()> {
        self.keyboard.progress.suspend(|| lines.iter().try_for_each(|line| self.console.line(line)))
    }

    fn is_late(&self) -> bool {
        self.args.common.time_limit.is_some_and(|limit| self.start.elapsed() >= limit)
    }
}

/// Moves the bar: this share of the scene is done.
fn advance(keyboard: &mut ProgressControl, jobs: (u64, u64), share: f64) {
    let steps = (share.clamp(0.0, 1.0) * STEPS as f64) as u64;
    keyboard.progress.set(jobs.0 * STEPS + steps, jobs.1 * STEPS);
}

impl Entry<'_> {
    /// An image, and what is to be known of it. Those of the warming round are held against the reference, too: their seeds are their own.
    fn lap(&mut self, peers: &mut [Peer], round: u32, spp: u32, truths: &[Truth]) -> Result<(), PeerError> {
        let shot = self.engine.render(peers, spp, 1 + round)?;
        let truth = &truths[self.truth];
        let pair = ImagePair::new(&shot.image, &truth.image, 3, None)?;
        let place = match self.laps.iter().position(|l| l.spp == spp) {
            Some(place) => place,
            None => {
                let (seconds, squares, bad) = (Vec::new(), Vec::new(), Vec::new());
                self.laps.push(Laps { spp, seconds, squares, bad, rays: None });
                self.laps.len() - 1
            }
        };
        let lap = &mut self.laps[place];
        lap.seconds.push(shot.seconds);
        lap.squares.push(pair.mse());
        lap.bad.push(bad_pixels(&shot.image, &truth.image));
        lap.rays = shot.rays;
        // the first launch of all compiles
        if round > 0 {
            self.longest_launch = [self.longest_launch, shot.longest_launch].into_iter().flatten().reduce(f64::max);
        }
        let bias = pair.bias() * f64::from(spp);
        match self.biases.get_mut(round as usize) {
            Some(sum) => *sum += bias,
            None => self.biases.push(bias),
        }
        Ok(())
    }

    /// What was found.
    fn finish(self, size: [u32; 2], record: &PathScene, truths: &[Truth]) -> Contestant {
        let reference = truths[self.truth].rmse.powi(2);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let points: Vec<Point> = self
            .laps
            .iter()
            .map(|l| {
                let squares = mean(&l.squares);
                let unsure = squares < 4.0 * reference;
                Point {
                    spp: l.spp,
                    seconds: Summary::of(&l.seconds),
                    rmse: if unsure { squares } else { squares - reference }.sqrt(),
                    unsure,
                    bad_pixels: mean(&l.bad),
                }
            })
            .collect();
        let paths = |l: &Laps| f64::from(l.spp) * f64::from(size[0]) * f64::from(size[1]);
        let last = self.laps.last().zip(points.last());
        let seconds = last.and_then(|(_, p)| p.seconds).map_or(f64::NAN, |s| s.median);
        // how far the mean of all images is off, by how far the rounds are from one another
        let n = self.biases.len() as f64;
        let middle = mean(&self.biases);
        let spread = (self.biases.iter().map(|b| (b - middle).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
        let engine = record.references.get(self.truth).map_or_else(String::new, |r| r.engine.clone());
        Contestant {
            name: self.name,
            engine,
            bias_sigmas: (self.biases.len() > 2 && spread > 0.0).then(|| middle / spread),
            mpaths: last.map_or(0.0, |(l, _)| paths(l) / seconds / 1e6),
            mrays: last.and_then(|(l, _)| Some(l.rays? as f64 / seconds / 1e6)),
            efficiency: last.map_or(0.0, |(_, p)| 1.0 / (p.rmse * p.rmse * seconds)),
            longest_launch: self.longest_launch,
            points,
            seconds_to_target: None,
        }
    }
}
