//! The results of a benchmark: measurements that become JSON, CSV, tables, charts and pages.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(super) use super::quantity;
pub use super::quantity::{Better, Quantity, plain};
use crate::error::{Error, Result};
use crate::files;
use crate::gpu::DeviceInfo;
use crate::measure::displayed::ImageErrors;
use crate::measure::regression::Values;
use crate::measure::stats::Percentiles;
use crate::terminal::console::one_line;

/// Which benchmark a record is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BenchKind {
    #[default]
    Rays,
    Frames,
    Path,
    Builders,
}

impl BenchKind {
    /// The name of its command: `skylit bench NAME`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::Frames => "frames",
            Self::Path => "path",
            Self::Builders => "builders",
        }
    }
}

/// The host of a benchmark.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HostInfo {
    pub version: String,
    pub device: String,
    pub driver: String,
    /// Name of the host's processor; empty where the system does not say.
    pub cpu: String,
    /// Logical processors of the host.
    pub threads: usize,
}

impl HostInfo {
    /// This host, with a device of it.
    pub fn new(device: &DeviceInfo) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            device: device.name.clone(),
            driver: device.driver.clone(),
            cpu: cpu_name(),
            threads: std::thread::available_parallelism().map_or(1, usize::from),
        }
    }

    /// The host in a line, as plots and pages have it.
    pub fn line(&self) -> String {
        let cpu = if self.cpu.is_empty() { String::new() } else { format!("{}, ", self.cpu) };
        format!("{} ({}), {cpu}{} threads", self.device, self.driver, self.threads)
    }
}

/// Name of the host's processor, as the kernel says it; empty where it does not.
fn cpu_name() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    // "model name" on x86; boards with other processors say "Hardware" or "Model" at best
    let value = |key: &str| {
        text.lines().filter_map(|l| l.split_once(':')).find(|(k, _)| k.trim() == key).map(|(_, v)| one_line(v))
    };
    ["model name", "Hardware", "Model", "cpu model"].into_iter().find_map(value).unwrap_or_default()
}

/// A whole run.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Record {
    pub benchmark: BenchKind,
    #[serde(flatten)]
    pub host: HostInfo,
    /// Settings that results depend on, by name.
    #[serde(default)]
    pub settings: BTreeMap<String, String>,
    /// Peers that ran, as they introduce themselves.
    #[serde(default)]
    pub peers: Vec<String>,
    /// Scenes, in the order in which they were measured.
    #[serde(default)]
    pub scenes: Vec<SceneRecord>,
    pub measurements: Vec<Measurement>,
    /// The time limit ended it.
    #[serde(default)]
    pub stopped_early: bool,
    /// Omissions, and why.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// Texts about a scene beside its measurements.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SceneRecord {
    /// Name, as measurements have it.
    pub scene: String,
    /// Size, light and the like, in words.
    pub about: String,
    pub remarks: Vec<String>,
}

/// One result: a quantity of a contestant in a part of the benchmark of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measurement {
    /// Name of the scene, with its view where there are several.
    pub scene: String,
    /// Part of the benchmark: a stream of rays, a motion, a change.
    pub part: String,
    /// Preset, kernel, sampling strategy or peer; `reference` for what others are compared with.
    pub contestant: String,
    /// Where along an axis it was measured, for one of several along it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<Position>,
    pub quantity: String,
    /// The unit; empty for plain numbers.
    pub unit: String,
    pub better: Better,
    /// It is the result of another program, for which skylit is not to blame.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub is_peers: bool,
    pub values: Values,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Position {
    /// The quantity along the axis: frames, samples per pixel, bounces.
    pub axis: String,
    pub value: f64,
}

impl Measurement {
    /// A single result of ours: scene, part and contestant, and the quantity with its values.
    pub fn new([scene, part, contestant]: [&str; 3], quantity: Quantity, values: Values) -> Self {
        let [scene, part, contestant] = [scene, part, contestant].map(str::to_owned);
        let (unit, better) = (quantity.unit.to_owned(), quantity.better);
        let quantity = quantity.name.to_owned();
        Self { scene, part, contestant, at: None, quantity, unit, better, is_peers: false, values }
    }

    /// The subject of the measurement: scene, part, contestant, position.
    pub fn row(&self) -> String {
        let at = self.at.as_ref().filter(|at| at.axis != SIZE).map(|at| format!("{} {}", at.axis, at.value));
        let names = [&self.scene, &self.part, &self.contestant].into_iter().filter(|n| !n.is_empty()).cloned();
        names.chain(at).collect::<Vec<_>>().join(", ")
    }

    pub fn title(&self) -> String {
        if self.unit.is_empty() { self.quantity.clone() } else { format!("{}, {}", self.quantity, self.unit) }
    }

    /// Position of a curve; `None` for a single result, also along the sizes of scenes.
    pub fn along(&self) -> Option<&Position> {
        self.at.as_ref().filter(|at| at.axis != SIZE)
    }
}

/// Heads of the columns of a CSV table.
const CSV_HEAD: &str = "benchmark,scene,part,contestant,axis,at,quantity,unit,median,p5,p25,p75,p95,count";
/// Axis of results by the size of scenes: each scene has one.
pub const SIZE: &str = "triangles and spheres";
/// Axis of frames that follow each other.
pub const FRAME: &str = "frame";
/// Contestant that others are compared with.
pub const REFERENCE: &str = "reference";

/// Adds results of one contestant in one part.
pub struct Row<'a> {
    record: &'a mut Record,
    /// A measurement with all that they have in common; its quantity and values are those of none.
    like: Measurement,
}

impl Row<'_> {
    /// The same row at a place along an axis.
    pub fn at(&mut self, axis: &str, value: f64) -> Row<'_> {
        let at = Some(Position { axis: axis.to_owned(), value });
        Row { record: self.record, like: Measurement { at, ..self.like.clone() } }
    }

    /// The row as one of another program, or not.
    pub fn of_peer(mut self, is_peers: bool) -> Self {
        self.like.is_peers = is_peers;
        self
    }

    fn add(&mut self, quantity: Quantity, values: Values) {
        let Quantity { name, unit, better } = quantity;
        let (quantity, unit) = (name.to_owned(), unit.to_owned());
        self.record.measurements.push(Measurement { quantity, unit, better, values, ..self.like.clone() });
    }

    /// Adds what has no noise; nothing for what is not known.
    pub fn exact(&mut self, quantity: Quantity, value: impl Into<Option<f64>>) -> &mut Self {
        value.into().into_iter().for_each(|value| self.add(quantity, Values::Exact(value)));
        self
    }

    /// Adds repeated measurements; nothing for none.
    pub fn repeated(&mut self, quantity: Quantity, values: impl Into<Option<Percentiles>>) -> &mut Self {
        let measured = values.into().filter(|p| p.median > 0.0 && p.median.is_finite());
        measured.into_iter().for_each(|p| self.add(quantity, Values::Repeated(p)));
        self
    }

    /// Adds the errors of an image.
    pub fn errors(&mut self, e: &ImageErrors) {
        self.exact(quantity::RMSE, e.rmse).exact(quantity::CORRECTED, e.corrected);
        self.exact(plain("bias", ""), e.bias).exact(plain("FLIP", ""), e.flip).exact(plain("rel MSE", ""), e.rel_mse);
        let similarity = |k: usize| e.similarity.map(|s| s[k]);
        self.exact(plain("Tanimoto", ""), similarity(0)).exact(plain("minimum ratio", ""), similarity(1));
    }
}

impl Record {
    /// A row to add results to.
    pub fn row(&mut self, scene: &str, part: &str, contestant: &str) -> Row<'_> {
        Row { record: self, like: Measurement::new([scene, part, contestant], plain("", ""), Values::Exact(f64::NAN)) }
    }

    /// The scene of this name, which is added where it is new.
    pub fn scene(&mut self, name: &str) -> &mut SceneRecord {
        let index = self.scenes.iter().position(|s| s.scene == name).unwrap_or_else(|| {
            self.scenes.push(SceneRecord { scene: name.to_owned(), ..SceneRecord::default() });
            self.scenes.len() - 1
        });
        &mut self.scenes[index]
    }

    /// A result of one contestant that is no place along an axis.
    pub fn value(&self, scene: &str, part: &str, contestant: &str, quantity: Quantity) -> Option<f64> {
        let is_asked = |m: &&Measurement| {
            m.scene == scene
                && m.part == part
                && m.contestant == contestant
                && m.quantity == quantity.name
                && m.along().is_none()
        };
        self.measurements.iter().find(is_asked).map(|m| m.values.middle())
    }

    /// Whether nothing was measured.
    pub fn is_empty(&self) -> bool {
        self.measurements.is_empty()
    }

    /// Writes a row for each result. What is not known is empty.
    pub fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(CSV_HEAD.split(','))?;
        for m in &self.measurements {
            let numbers = match m.values {
                Values::Exact(v) => {
                    vec![v.to_string(), String::new(), String::new(), String::new(), String::new(), "1".into()]
                }
                Values::Repeated(p) => {
                    let numbers = [p.median, p.p5, p.p25, p.p75, p.p95].into_iter().map(|v| v.to_string());
                    numbers.chain([p.count.to_string()]).collect()
                }
            };
            let (axis, at) = m.at.as_ref().map_or_else(Default::default, |at| (at.axis.clone(), at.value.to_string()));
            let names = [self.benchmark.name(), &m.scene, &m.part, &m.contestant, &axis, &at, &m.quantity, &m.unit];
            csv.write_record(names.into_iter().chain(numbers.iter().map(String::as_str)))?;
        }
        csv.flush()?;
        Ok(())
    }

    /// Reads a record that was saved as JSON.
    ///
    /// # Errors
    /// [`Error::Input`] for a missing file, or one that this version's benchmarks did not write.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let broken = |why: String| Error::input(path, format!("is no record of `skylit bench`: {why}"));
        let mut value: Value = serde_json::from_slice(&bytes).map_err(|e| broken(e.to_string()))?;
        clean(&mut value);
        if let Some(why) = unmeasurable(&value) {
            return Err(broken(why));
        }
        let has = |key: &str| value.get(key).is_some();
        if !has("measurements") && (has("views") || has("scenes")) {
            let why = "is a record of an earlier version of `skylit bench`, whose format was another: measure again";
            return Err(Error::input(path, why.to_owned()));
        }
        if !has("benchmark") {
            return Err(broken("it does not say which benchmark it is of".into()));
        }
        serde_json::from_value(value).map_err(|e| broken(e.to_string()))
    }
}

/// Makes lines of all texts: names go into tables, pages and plots.
fn clean(value: &mut Value) {
    match value {
        Value::String(text) if text.chars().any(char::is_control) => *text = one_line(text),
        Value::Array(all) => all.iter_mut().for_each(clean),
        Value::Object(map) => map.values_mut().for_each(clean),
        _ => {}
    }
}

/// Greatest magnitude of measurements, and inverse of the least: squares and quotients stay finite.
const MAX_MAGNITUDE: f64 = 1e100;
/// Greatest count: larger ones are no integers in `f64`, and their sums overflow.
const MAX_COUNT: u64 = 1 << 53;

/// Says which number of a record no benchmark can have measured, and why; `None` if there is none.
fn unmeasurable(value: &Value) -> Option<String> {
    let within = |key: String, value: &Value| unmeasurable(value).map(|why| format!("{key}{why}"));
    let separated = |key: &str, value: &Value| match value {
        Value::Number(_) => key.to_owned(),
        _ => format!("{key}."),
    };
    match value {
        Value::Array(all) => all.iter().enumerate().find_map(|(k, v)| within(separated(&k.to_string(), v), v)),
        Value::Object(map) => map.iter().find_map(|(key, v)| within(separated(key, v), v)),
        Value::Number(number) => {
            let magnitude = number.as_f64()?.abs();
            let count = number.as_i64().map(i64::unsigned_abs).or(number.as_u64());
            let is_too_large = count.map_or(magnitude > MAX_MAGNITUDE, |n| n > MAX_COUNT);
            let is_too_small = magnitude > 0.0 && magnitude < 1.0 / MAX_MAGNITUDE;
            (is_too_large || is_too_small).then(|| format!(" is {number}, which is beyond what can be measured"))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record() -> Record {
        let mut record = Record { benchmark: BenchKind::Frames, ..Record::default() };
        let times = Percentiles::from_values(&[1.0, 2.0, 4.0]);
        let mut row = record.row("a.glb", "still", "fast, or so");
        row.repeated(quantity::FRAME_TIME, times).exact(quantity::RMSE, f64::NAN).exact(quantity::FLICKER, None);
        row.at(FRAME, 8.0).exact(quantity::RMSE.not_compared(), 0.25);
        record.scene("a.glb").about = "12 primitives".into();
        record
    }

    fn read(text: &str) -> Result<Record> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(&path, text).unwrap();
        Record::read(&path)
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let written = record();
        let read = read(&serde_json::to_string(&written).unwrap()).unwrap();
        assert_eq!((read.benchmark, &read.scenes, read.measurements.len()), (BenchKind::Frames, &written.scenes, 3));
        assert_eq!(read.measurements[0], written.measurements[0]);
        // what is not finite is null
        assert!(read.measurements[1].values.middle().is_nan());
        assert_eq!(read.measurements[2].at, Some(Position { axis: FRAME.into(), value: 8.0 }));
        assert_eq!(read.value("a.glb", "still", "fast, or so", quantity::FRAME_TIME), Some(2.0));
        assert_eq!(read.measurements[2].row(), "a.glb, still, fast, or so, frame 8");
    }

    #[test]
    fn a_row_a_result_with_quotes_where_they_are_needed() {
        let mut text = Vec::new();
        record().write_csv(&mut text).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_slice());
        let head = reader.headers().unwrap().clone();
        let rows: Vec<_> = reader.records().map(|r| r.unwrap()).collect();
        let at = |row: usize, name: &str| rows[row][head.iter().position(|h| h == name).unwrap()].to_owned();
        assert_eq!(rows.len(), 3);
        assert_eq!([at(0, "benchmark"), at(0, "contestant"), at(0, "median")], ["frames", "fast, or so", "2"]);
        assert_eq!([at(0, "p95"), at(0, "count"), at(1, "median")], ["4", "3", "NaN"]);
        assert_eq!([at(2, "axis"), at(2, "at"), at(2, "p5")], ["frame", "8", ""]);
    }

    #[test]
    fn other_files_are_refused_in_a_line() {
        for (text, says) in [
            ("[]", "does not say which benchmark"),
            (r#"{"benchmark":"time","measurements":[]}"#, "unknown variant"),
            (r#"{"benchmark":"rays","measurements":3}"#, "is no record of `skylit bench`"),
            (r#"{"benchmark":"ao","views":[]}"#, "earlier version"),
            (r#"{"scenes":[],"scaling":[]}"#, "earlier version"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.exit_code() == 3 && error.to_string().contains(says), "{text}: {error}");
            assert_eq!(error.to_string().lines().count(), 1);
        }
        assert!(read("").unwrap_err().to_string().contains("is empty"));
        for number in ["5e-324", "-1e-320", "1e308", "-1e101", "9007199254740993", "18446744073709551615", "1e999"] {
            let error = read(&format!(r#"{{"benchmark":"rays","measurements":[{{"values":{number}}}]}}"#)).unwrap_err();
            let is_named = number == "1e999" || error.to_string().contains("measurements.0.values is ");
            assert!(error.exit_code() == 3 && is_named, "{error}");
        }
    }
}
