//! What a benchmark of ray tracing found: records for programs, and the rows of its table.
//!
//! Rates are Mrays/s (10^6 rays a second). A *contestant* is a tracer with a kernel of ours, or a kernel of a peer.

use std::io::Write;

use serde::{Deserialize, Serialize};

use super::saved::SavedRecord;
use super::{BenchRecord, Completeness, HostInfo};
use crate::measure::agreement::Agreement;
use crate::measure::stats::{LogScaling, Summary, number_or_nan};

/// A whole run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct RayBenchmark {
    /// What it ran on.
    #[serde(flatten)]
    pub host: HostInfo,
    /// Timed repeats that were asked for, after one that warms up.
    pub repeats: u32,
    /// Image whose pixels the camera rays of a set go through; 0x0 in records of earlier versions.
    pub size: [u32; 2],
    /// How long our own hierarchies were built: a preset, or `auto`.
    pub build: String,
    /// Peers that ran, as they introduce themselves.
    pub peers: Vec<String>,
    /// Contestants that ratios are given to.
    pub baselines: Vec<String>,
    /// What was measured.
    pub scenes: Vec<SceneRecord>,
    /// How rates fall with size, over families of scenes.
    pub scaling: Vec<ScalingRecord>,
    /// What became of rays at edges of closed meshes, with `--edges`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub edges: Vec<EdgeRecord>,
    /// What is missing.
    #[serde(flatten)]
    pub completeness: Completeness,
}

/// One scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneRecord {
    /// As on the command line.
    pub scene: String,
    /// Over all instances.
    pub triangles: u64,
    /// Over all instances.
    pub spheres: u64,
    /// Placed meshes.
    pub instances: usize,
    /// Triangles and spheres that are stored; less than what is placed where meshes are placed several times.
    pub stored_primitives: u64,
    /// Length of the ambient occlusion rays, scene units; `None` for no limit.
    pub ao_radius: Option<f64>,
    /// Light of the shadow rays, world coordinates.
    pub light: [f64; 3],
    /// What building took.
    pub builds: Vec<BuildRecord>,
    /// What tracing took.
    pub streams: Vec<StreamRecord>,
    /// Comparisons of answers, with `--check`.
    pub checks: Vec<CheckRecord>,
}

impl SceneRecord {
    /// Triangles and spheres over all instances.
    pub fn primitives(&self) -> u64 {
        self.triangles + self.spheres
    }
}

/// Building for one contestant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BuildRecord {
    /// Name of the contestant.
    pub contestant: String,
    /// Seconds to build the hierarchy.
    pub build_seconds: f64,
    /// Seconds to write the scene into device memory; `None` for peers.
    pub upload_seconds: Option<f64>,
    /// Bytes of nodes and primitives by stored primitive.
    pub bytes_per_primitive: f64,
    /// Cost of the hierarchy by the surface area heuristic, where it is known.
    pub sah_cost: Option<f64>,
}

/// One stream of rays.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StreamRecord {
    /// Name.
    pub stream: String,
    /// Rays in the whole set.
    pub rays: usize,
    /// Results, in the order of the contestants.
    pub results: Vec<RunRecord>,
}

/// One contestant on one stream.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RunRecord {
    /// Name of the contestant.
    pub contestant: String,
    /// Rays of a repeat; fewer than the set's for slow tracers, which get a sample of it.
    pub rays: usize,
    /// Share of these that met something.
    #[serde(deserialize_with = "number_or_nan")]
    pub hit_share: f64,
    /// Mrays/s by the time on the device; a peer has its own clock, which leaves out what lies between it and us.
    pub device: Summary,
    /// Mrays/s by the clock, submission included; `None` for peers.
    pub wall: Option<Summary>,
    /// Seconds of each repeat on the device, in the order of the rounds.
    pub seconds: Vec<f64>,
    /// Rate relative to each baseline, the median of the rounds' quotients, by device time.
    pub ratios: Vec<Ratio>,
    /// Nodes visited per ray, where that is counted.
    pub nodes_per_ray: Option<f64>,
    /// Leaves visited per ray, of one or two triangles each, where that is counted.
    pub leaves_per_ray: Option<f64>,
}

/// How many times as fast as a baseline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ratio {
    /// The baseline.
    pub to: String,
    /// Rate over its rate.
    #[serde(deserialize_with = "number_or_nan")]
    pub ratio: f64,
}

/// One contestant's answers against the first one's.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct CheckRecord {
    /// Name of the contestant.
    pub contestant: String,
    /// The contestant it was compared with.
    pub reference: String,
    /// Name of the stream.
    pub stream: String,
    /// Rays compared.
    pub rays: u64,
    /// Same answer.
    pub agree: u64,
    /// Another answer that rounding allows.
    pub ties: u64,
    /// Any other.
    pub unexplained: u64,
    /// Of these, where it is the reference's answer that no rounding explains.
    pub reference_unexplained: u64,
    /// Unexplained answers of this contestant are a failure.
    pub strict: bool,
    /// The first of the unexplained.
    pub examples: Vec<String>,
}

impl CheckRecord {
    /// From a report.
    pub fn new(contestant: &str, reference: &str, stream: &str, found: &Agreement, strict: bool) -> Self {
        let report = &found.report;
        // its text: a summary and a line for each example
        let examples = report.to_string().lines().skip(1).map(|l| l.trim().to_owned()).collect();
        Self {
            contestant: contestant.to_owned(),
            reference: reference.to_owned(),
            stream: stream.to_owned(),
            rays: report.rays,
            agree: report.agree,
            ties: report.ties,
            unexplained: report.unexplained,
            reference_unexplained: found.reference_unexplained,
            strict,
            examples,
        }
    }

    /// Is it a failure? The reference is one of our own tracers: that its answers are wrong always is.
    pub fn fails(&self) -> bool {
        self.strict && self.unexplained > 0 || self.reference_unexplained > 0
    }
}

/// What became of a contestant's rays at shared edges and vertices of closed meshes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct EdgeRecord {
    /// Name of the contestant.
    pub contestant: String,
    /// Meshes.
    pub meshes: u32,
    /// Rays; fewer than the set's for slow tracers.
    pub rays: u64,
    /// Rays that met nothing, asked for any hit.
    pub leaks_any: u64,
    /// Rays that met nothing, asked for the closest.
    pub leaks_closest: u64,
    /// Closest hits that are the oracle's: the same primitive at the same distance but for rounding.
    pub agree: u64,
    /// Other answers that rounding allows: at an edge, either side of it, or none.
    pub ties: u64,
    /// All other answers.
    pub unexplained: u64,
    /// Whether leaks are a failure: those of the compute tracer are.
    pub is_watertight: bool,
    /// Whether unexplained answers are a failure.
    pub strict: bool,
    /// The first of the unexplained.
    pub examples: Vec<String>,
}

impl EdgeRecord {
    /// Is it a failure?
    pub fn fails(&self) -> bool {
        self.is_watertight && self.leaks_any + self.leaks_closest > 0 || self.strict && self.unexplained > 0
    }
}

/// How one contestant's rate on one stream falls over a family of scenes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ScalingRecord {
    /// What the scenes have in common: the name before the number.
    pub family: String,
    /// Name of the stream.
    pub stream: String,
    /// Name of the contestant.
    pub contestant: String,
    /// (primitives, median Mrays/s), by size.
    pub points: Vec<(u64, f64)>,
    /// The fitted law.
    pub law: LogScaling,
    /// Falls no faster than log n.
    pub holds: bool,
}

/// The family of `builtin:NAME:N`: its name.
pub fn family(scene: &str) -> Option<&str> {
    let (family, number) = scene.rsplit_once(':')?;
    number.parse::<u64>().ok().map(|_| family)
}

impl RayBenchmark {
    /// All (family, stream, contestant) with two sizes or more.
    pub fn find_scaling(&mut self) {
        let mut found: Vec<ScalingRecord> = Vec::new();
        let mut keys: Vec<(String, String, String)> = Vec::new();
        for (scene, stream, run) in self.rows() {
            let Some(family) = family(&scene.scene) else { continue };
            let key = (family.to_owned(), stream.stream.clone(), run.contestant.clone());
            if !keys.contains(&key) {
                keys.push(key);
            }
        }
        for (name, stream, contestant) in keys {
            let mut points: Vec<_> = self
                .rows()
                .filter(|(s, t, r)| family(&s.scene) == Some(&name) && t.stream == stream && r.contestant == contestant)
                .map(|(s, _, r)| (s.primitives(), r.device.median))
                .collect();
            points.sort_by_key(|p| p.0);
            if let Some(law) = LogScaling::from_points(&points) {
                found.push(ScalingRecord { family: name, stream, contestant, points, law, holds: law.holds() });
            }
        }
        self.scaling = found;
    }

    /// Every result with where it belongs.
    pub fn rows(&self) -> impl Iterator<Item = (&SceneRecord, &StreamRecord, &RunRecord)> {
        self.scenes.iter().flat_map(|s| s.streams.iter().flat_map(move |t| t.results.iter().map(move |r| (s, t, r))))
    }
}

impl BenchRecord for RayBenchmark {
    fn saved(&self) -> SavedRecord {
        SavedRecord::Rays(Box::new(self.clone()))
    }

    fn completeness(&mut self) -> &mut Completeness {
        &mut self.completeness
    }

    fn is_empty(&self) -> bool {
        self.rows().next().is_none() && self.edges.is_empty()
    }

    /// A ratio column for each baseline.
    fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        let ratios = self.baselines.iter().map(|b| format!("ratio to {b}"));
        let head = CSV_COLUMNS.iter().map(|c| (*c).to_owned()).chain(ratios);
        csv.write_record(head)?;
        let number = |x: f64| format!("{x:.6}");
        let maybe = |x: Option<f64>| x.map_or_else(String::new, number);
        for (scene, stream, run) in self.rows() {
            let build = scene.builds.iter().find(|b| b.contestant == run.contestant);
            let mut row = vec![
                scene.scene.clone(),
                scene.primitives().to_string(),
                scene.stored_primitives.to_string(),
                stream.stream.clone(),
                run.contestant.clone(),
                run.rays.to_string(),
                number(run.hit_share),
                number(run.device.median),
                number(run.device.min),
                number(run.device.max),
                maybe(run.wall.map(|w| w.median)),
                maybe(run.wall.map(|w| w.min)),
                maybe(run.wall.map(|w| w.max)),
                run.seconds.len().to_string(),
                maybe(build.map(|b| b.build_seconds)),
                maybe(build.map(|b| b.bytes_per_primitive)),
                maybe(build.and_then(|b| b.sah_cost)),
                maybe(run.nodes_per_ray),
                maybe(run.leaves_per_ray),
            ];
            row.extend(self.baselines.iter().map(|b| maybe(run.ratio_to(b))));
            csv.write_record(row)?;
        }
        csv.flush()?;
        Ok(())
    }
}

const CSV_COLUMNS: [&str; 19] = [
    "scene",
    "primitives",
    "stored primitives",
    "stream",
    "contestant",
    "rays",
    "hit share",
    "Mrays/s",
    "Mrays/s min",
    "Mrays/s max",
    "Mrays/s wall",
    "Mrays/s wall min",
    "Mrays/s wall max",
    "repeats",
    "build seconds",
    "bytes per primitive",
    "SAH cost",
    "nodes per ray",
    "leaves per ray",
];

impl RunRecord {
    /// Rate relative to that of a baseline.
    pub fn ratio_to(&self, baseline: &str) -> Option<f64> {
        self.ratios.iter().find(|r| r.to == baseline).map(|r| r.ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::parity::ParityReport;

    fn run(contestant: &str, rate: f64) -> RunRecord {
        let flat = Summary { median: rate, min: rate, max: rate };
        RunRecord {
            contestant: contestant.into(),
            rays: 100,
            hit_share: 0.5,
            device: flat,
            wall: None,
            seconds: vec![1.0],
            ratios: vec![Ratio { to: "peer, one".into(), ratio: 0.5 }],
            nodes_per_ray: None,
            leaves_per_ray: Some(2.0),
        }
    }

    fn benchmark() -> RayBenchmark {
        let scene = |name: &str, triangles, rate| SceneRecord {
            scene: name.into(),
            triangles,
            streams: vec![StreamRecord { stream: "ao-any".into(), rays: 100, results: vec![run("wide", rate), run("b", 1.0)] }],
            ..Default::default()
        };
        RayBenchmark {
            baselines: vec!["peer, one".into()],
            scenes: vec![
                scene("builtin:terrain:1000", 1000, 9.0),
                scene("a.glb", 50, 3.0),
                scene("builtin:terrain:10", 10, 10.0),
            ],
            ..Default::default()
        }
    }

    #[test]
    fn families_by_name_and_number() {
        assert_eq!(family("builtin:terrain:1000"), Some("builtin:terrain"));
        assert_eq!(family("builtin:terrain"), None);
        assert_eq!(family("scene.glb"), None);
    }

    #[test]
    fn scaling_of_each_family_stream_and_contestant() {
        let mut b = benchmark();
        b.find_scaling();
        assert_eq!(b.scaling.len(), 2);
        let s = &b.scaling[0];
        assert_eq!((s.contestant.as_str(), s.points.as_slice()), ("wide", &[(10, 10.0), (1000, 9.0)][..]));
        assert!(s.holds);
    }

    #[test]
    fn who_fails_a_check() {
        let check = |strict, unexplained, reference_unexplained| {
            let report = ParityReport { rays: 10, unexplained, ..Default::default() };
            CheckRecord::new("b", "wide", "primary", &Agreement { report, reference_unexplained }, strict).fails()
        };
        assert!(!check(true, 0, 0) && !check(false, 3, 0));
        // the reference's own answers count whoever is beside it
        assert!(check(true, 1, 0) && check(false, 1, 1));
    }

    #[test]
    fn who_fails_at_edges() {
        let record = |is_watertight, strict, leaks_any, unexplained| {
            EdgeRecord { is_watertight, strict, leaks_any, unexplained, ..Default::default() }.fails()
        };
        assert!(!record(true, true, 0, 0) && !record(false, true, 7, 0) && !record(false, false, 0, 3));
        assert!(record(true, true, 1, 0) && record(false, true, 0, 1));
    }

    #[test]
    fn csv_has_a_row_a_result_and_quotes_what_needs_it() {
        let mut text = Vec::new();
        benchmark().write_csv(&mut text).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_slice());
        let head = reader.headers().unwrap().clone();
        assert_eq!(head.iter().next_back(), Some("ratio to peer, one"));
        let rows: Vec<_> = reader.records().map(|r| r.unwrap()).collect();
        assert_eq!(rows.len(), 6);
        let at = |row: &csv::StringRecord, name: &str| row[head.iter().position(|h| h == name).unwrap()].to_owned();
        assert_eq!(at(&rows[0], "Mrays/s"), "9.000000");
        assert_eq!(at(&rows[0], "nodes per ray"), "");
        assert_eq!(at(&rows[0], "ratio to peer, one"), "0.500000");
    }
}
