//! What is compared between two records of a benchmark: its settings, and its results one by one.

use super::ao::{AoBenchmark, StillRecord};
use super::cost::FrameCost;
use super::frames::FramesBenchmark;
use super::path::{OWN, PathBenchmark};
use super::rays::RayBenchmark;
use super::{BenchKind, HostInfo};
use crate::measure::stats::Percentiles;

/// The comparable part of a record.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// Which benchmark.
    pub kind: BenchKind,
    /// What it ran on.
    pub host: HostInfo,
    /// Settings that results depend on, name and value. Empty: unknown.
    pub settings: Vec<(&'static str, String)>,
    /// Results.
    pub results: Vec<Measurement>,
}

/// Records that can be compared.
pub trait Comparable {
    /// What is compared.
    fn snapshot(&self) -> Snapshot;
}

/// One result.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// What it was measured of: scene, view, contestant.
    pub row: String,
    /// Quantity and unit.
    pub quantity: &'static str,
    /// Its values.
    pub values: Values,
    /// More of it is better; otherwise less is.
    pub more_is_better: bool,
    /// It is the result of another program, for which skylit is not to blame.
    pub is_peers: bool,
}

/// Values of a result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Values {
    /// Repeated measurements, which have noise.
    Repeated(Percentiles),
    /// What is the same in every run on the same device.
    Exact(f64),
}

impl Values {
    /// Has it noise?
    pub fn is_repeated(&self) -> bool {
        matches!(self, Self::Repeated(_))
    }

    /// The median, or the value.
    pub fn middle(&self) -> f64 {
        match self {
            Self::Repeated(p) => p.median,
            Self::Exact(v) => *v,
        }
    }
}

/// Collects results of one row.
struct Row<'a> {
    results: &'a mut Vec<Measurement>,
    name: String,
    is_peers: bool,
}

impl<'a> Row<'a> {
    /// A row of ours.
    fn new(results: &'a mut Vec<Measurement>, name: String) -> Self {
        Self { results, name, is_peers: false }
    }

    fn add(&mut self, quantity: &'static str, values: Values, more_is_better: bool) {
        let (row, is_peers) = (self.name.clone(), self.is_peers);
        self.results.push(Measurement { row, quantity, values, more_is_better, is_peers });
    }

    /// A time; one that was not measured is left out.
    fn time(&mut self, quantity: &'static str, values: Option<Percentiles>) {
        if let Some(values) = values.filter(|p| p.median > 0.0) {
            self.add(quantity, Values::Repeated(values), false);
        }
    }

    fn cost(&mut self, quantity: &'static str, cost: Option<&FrameCost>) {
        self.time(quantity, cost.map(FrameCost::time));
    }

    fn exact(&mut self, quantity: &'static str, value: Option<f64>) {
        if let Some(value) = value {
            self.add(quantity, Values::Exact(value), false);
        }
    }
}

impl Comparable for AoBenchmark {
    /// Times of frames and updates, and errors. Seeds are those of every run, so errors have no noise.
    fn snapshot(&self) -> Snapshot {
        let mut results = Vec::new();
        for view in &self.views {
            for r in &view.results {
                let mut row = Row::new(&mut results, format!("{}, {}, {}", view.scene, view.view, r.preset));
                let (still, rest, moving) = (r.still.as_ref(), r.rest.as_ref(), r.moving.as_ref());
                row.cost("ms a frame, still camera", still.map(|s| &s.cost));
                row.cost("ms a frame with camera rays", still.map(|s| &s.moving_cost));
                row.cost("ms a frame at rest", rest.map(|r| &r.cost));
                row.cost("ms a frame, orbiting camera", moving.map(|m| &m.cost));
                row.exact("RMSE, still camera", still.and_then(StillRecord::settled).map(|p| p.errors.rmse));
                row.exact("RMSE at rest", rest.map(|r| r.errors.rmse));
                row.exact("RMSE, orbiting camera", moving.map(|m| m.errors.rmse));
            }
        }
        for change in &self.changes {
            for r in &change.results {
                let mut row = Row::new(&mut results, format!("{}, {}, {}", change.scene, change.change, r.preset));
                row.cost("ms a frame", r.cost.as_ref());
                row.time("ms to update the tracer", r.update_ms);
                row.exact("RMSE", r.errors.map(|e| e.rmse));
            }
        }
        for s in &self.structures {
            let mut row = Row::new(&mut results, format!("structures of {}", s.scene));
            row.time("ms to update the top level", s.top);
            row.time("ms to refit a mesh", s.refit);
            row.time("ms to rebuild a mesh", s.rebuild);
        }
        for series in &self.series {
            for line in &series.lines {
                for p in &line.points {
                    let mut row =
                        Row::new(&mut results, format!("series {}, {}, {}, {}", series.series, p.scene, line.name, p.x));
                    row.cost("ms a frame", p.cost.as_ref());
                    row.exact("RMSE", p.rmse);
                }
            }
        }
        let settings = vec![
            ("tracer", self.tracer.clone()),
            ("size", format!("{}x{}", self.size[0], self.size[1])),
            ("frames", self.frames.to_string()),
            ("reference rays", self.reference_rays.to_string()),
            ("falloff", self.falloff.clone()),
        ];
        Snapshot { kind: BenchKind::Ao, host: self.host.clone(), settings, results }
    }
}

impl Comparable for RayBenchmark {
    /// Rates, and what hierarchies are like, which has no noise.
    fn snapshot(&self) -> Snapshot {
        let mut results = Vec::new();
        for scene in &self.scenes {
            let is_peers =
                |contestant: &str| scene.builds.iter().any(|b| b.contestant == contestant && b.upload_seconds.is_none());
            for build in &scene.builds {
                let name = format!("{}, {}", scene.scene, build.contestant);
                let mut row = Row { results: &mut results, name, is_peers: is_peers(&build.contestant) };
                row.exact("bytes a primitive", Some(build.bytes_per_primitive));
            }
            for stream in &scene.streams {
                for run in &stream.results {
                    let name = format!("{}, {}, {}", scene.scene, stream.stream, run.contestant);
                    let mut row = Row { results: &mut results, name, is_peers: is_peers(&run.contestant) };
                    let rates: Vec<f64> = run.seconds.iter().map(|s| run.rays as f64 / s / 1e6).collect();
                    if let Some(rates) = Percentiles::from_values(&rates).filter(|p| p.median.is_finite()) {
                        row.add("Mrays/s", Values::Repeated(rates), true);
                    }
                    row.exact("nodes a ray", run.nodes_per_ray);
                }
            }
        }
        let [width, height] = self.size;
        let size = if width > 0 { format!("{width}x{height}") } else { String::new() };
        let settings = vec![("rays", size), ("build", self.build.clone())];
        Snapshot { kind: BenchKind::Rays, host: self.host.clone(), settings, results }
    }
}

impl Comparable for PathBenchmark {
    /// Time and error of images, by sample count.
    fn snapshot(&self) -> Snapshot {
        let mut results = Vec::new();
        for scene in &self.scenes {
            for r in &scene.results {
                for p in &r.points {
                    let name = format!("{} {}x{}, {}, {} spp", scene.scene, scene.size[0], scene.size[1], r.name, p.spp);
                    let mut row = Row { results: &mut results, name, is_peers: r.engine != OWN };
                    row.time("seconds an image", Percentiles::from_values(&p.repeats));
                    // what is less than the reference's own error says nothing
                    row.time("RMSE", Percentiles::from_values(&p.rmse_repeats).filter(|_| !p.unsure));
                }
            }
        }
        let settings = vec![("tracer", self.tracer.clone())];
        Snapshot { kind: BenchKind::Path, host: self.host.clone(), settings, results }
    }
}

impl Comparable for FramesBenchmark {
    /// Times of frames, and errors and flicker of the presets. Seeds are those of every run, so these have no noise; those of plain accumulation depend on times.
    fn snapshot(&self) -> Snapshot {
        let mut results = Vec::new();
        for view in &self.views {
            for r in &view.still {
                let mut row = Row::new(&mut results, format!("{}, still, {}", view.scene, r.preset));
                row.cost("ms a frame", Some(&r.cost));
                row.exact("RMSE", r.curve.last().map(|p| p.errors.rmse));
                row.exact("flicker", r.flicker.map(|f| f.rms));
            }
            for m in &view.motions {
                for r in &m.results {
                    let mut row = Row::new(&mut results, format!("{}, {}, {}", view.scene, m.motion, r.preset));
                    row.cost("ms a frame", Some(&r.cost));
                    row.exact("RMSE", Some(r.errors.rmse));
                }
            }
            for c in &view.changes {
                for r in &c.results {
                    let mut row = Row::new(&mut results, format!("{}, {}, {}", view.scene, c.change, r.preset));
                    row.exact("RMSE of the first frame", r.rmse.first().copied());
                }
            }
        }
        for b in &self.bounces {
            for p in &b.points {
                let mut row = Row::new(&mut results, format!("{}, {} bounces, {}", b.scene, p.bounces, b.preset));
                row.cost("ms a frame", Some(&p.cost));
            }
        }
        let settings = vec![
            ("tracer", self.tracer.clone()),
            ("integrator", self.integrator.clone()),
            ("size", format!("{}x{}", self.size[0], self.size[1])),
            ("frames", self.frames.to_string()),
            ("seed", self.seed.to_string()),
            ("runs", self.runs.to_string()),
            ("reference paths", self.reference_paths.to_string()),
        ];
        Snapshot { kind: BenchKind::Frames, host: self.host.clone(), settings, results }
    }
}
