//! Records that were saved as JSON, read again.

use std::path::Path;

use serde_json::Value;

use super::ao::AoBenchmark;
use super::frames::FramesBenchmark;
use super::path::PathBenchmark;
use super::rays::RayBenchmark;
use super::snapshot::{Comparable, Snapshot};
use super::{BenchKind, Completeness, HostInfo};
use crate::error::{Error, Result};
use crate::files;
use crate::terminal::console::one_line;

/// A record of one of the benchmarks.
#[derive(Clone, Debug)]
pub enum SavedRecord {
    /// Of `skylit bench rays`.
    Rays(Box<RayBenchmark>),
    /// Of `skylit bench ao`.
    Ao(Box<AoBenchmark>),
    /// Of `skylit bench path`.
    Path(Box<PathBenchmark>),
    /// Of `skylit bench frames`.
    Frames(Box<FramesBenchmark>),
}

impl SavedRecord {
    /// Reads a record.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is missing or that no benchmark wrote.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = files::read(path)?;
        let broken = |why: String| Error::input(path, format!("is no record of `skylit bench`: {why}"));
        let mut value: Value = serde_json::from_slice(&bytes).map_err(|e| broken(e.to_string()))?;
        clean(&mut value);
        if let Some(why) = unmeasurable(&value) {
            return Err(broken(why));
        }
        let kind = kind_of(&value).ok_or_else(|| broken("it does not say which benchmark it is of".into()))?;
        let record = match kind {
            BenchKind::Rays => serde_json::from_value(value).map(Self::Rays),
            BenchKind::Ao => serde_json::from_value(value).map(Self::Ao),
            BenchKind::Path => serde_json::from_value(value).map(Self::Path),
            BenchKind::Frames => serde_json::from_value(value).map(Self::Frames),
        };
        record.map_err(|e| broken(e.to_string()))
    }

    /// Which benchmark it is of.
    pub fn kind(&self) -> BenchKind {
        match self {
            Self::Rays(_) => BenchKind::Rays,
            Self::Ao(_) => BenchKind::Ao,
            Self::Path(_) => BenchKind::Path,
            Self::Frames(_) => BenchKind::Frames,
        }
    }

    /// What it was measured on.
    pub fn host(&self) -> &HostInfo {
        match self {
            Self::Rays(r) => &r.host,
            Self::Ao(r) => &r.host,
            Self::Path(r) => &r.host,
            Self::Frames(r) => &r.host,
        }
    }

    /// What is missing.
    pub fn completeness(&self) -> &Completeness {
        match self {
            Self::Rays(r) => &r.completeness,
            Self::Ao(r) => &r.completeness,
            Self::Path(r) => &r.completeness,
            Self::Frames(r) => &r.completeness,
        }
    }

    /// What is compared between records.
    pub fn snapshot(&self) -> Snapshot {
        match self {
            Self::Rays(r) => r.snapshot(),
            Self::Ao(r) => r.snapshot(),
            Self::Path(r) => r.snapshot(),
            Self::Frames(r) => r.snapshot(),
        }
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

/// Greatest magnitude of what benchmarks measure, and the inverse of the least. Square roots, quotients and squares of such numbers are numbers.
const MAX_MAGNITUDE: f64 = 1e100;
/// Greatest count: beyond it `f64` has not every integer, and sums of counts have no room in 64 bits.
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

/// Records say which benchmark they are of; those of skylit before it had `--baseline` are known by their keys.
fn kind_of(value: &Value) -> Option<BenchKind> {
    let record = value.as_object()?;
    if let Some(kind) = record.get("benchmark") {
        return serde_json::from_value(kind.clone()).ok();
    }
    let has = |keys: &[&str]| keys.iter().all(|k| record.contains_key(*k));
    match () {
        () if has(&["views", "reference_rays"]) => Some(BenchKind::Ao),
        () if has(&["scenes", "scaling"]) => Some(BenchKind::Rays),
        () if has(&["scenes", "tracer", "peers"]) => Some(BenchKind::Path),
        () => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::ao::{
        ChangeRecord, ChangeResult, ErrorPoint, ImageErrors, StillRecord, TechniqueRecord, ViewRecord,
    };
    use crate::measure::stats::Percentiles;

    fn read(text: &str) -> Result<SavedRecord> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.json");
        std::fs::write(&path, text).unwrap();
        SavedRecord::read(&path)
    }

    #[test]
    fn a_record_is_read_as_it_was_written() {
        let errors = ImageErrors { rmse: f64::NAN, bias: -0.25, ..ImageErrors::default() };
        let still = StillRecord {
            curve: vec![ErrorPoint { frame: 3, errors, ..ErrorPoint::default() }],
            rmse: vec![0.5, f64::NAN],
            ..StillRecord::default()
        };
        let results = vec![TechniqueRecord { preset: "fast".into(), still: Some(still), ..TechniqueRecord::default() }];
        let result = ChangeResult {
            half_life: Some(f64::INFINITY),
            update_ms: Percentiles::from_values(&[1.0, 2.0]),
            ..ChangeResult::default()
        };
        let record = AoBenchmark {
            host: HostInfo { cpu: "a processor".into(), threads: 2, ..HostInfo::default() },
            views: vec![ViewRecord { results, ..ViewRecord::default() }],
            changes: vec![ChangeRecord { results: vec![result], ..ChangeRecord::default() }],
            ..AoBenchmark::default()
        };
        let SavedRecord::Ao(read) = read(&serde_json::to_string(&record).unwrap()).unwrap() else { panic!("no record of ao") };
        assert_eq!(read.host, record.host);
        let still = read.views[0].results[0].still.as_ref().unwrap();
        assert!(still.curve[0].errors.rmse.is_nan() && still.curve[0].errors.bias == -0.25 && still.rmse[1].is_nan());
        // infinite is null, and null is unknown
        assert_eq!(read.changes[0].results[0].half_life, None);
        assert_eq!(read.changes[0].results[0].update_ms, Percentiles::from_values(&[1.0, 2.0]));
    }

    #[test]
    fn records_are_told_apart() {
        let kind = |text: &str| read(text).map(|r| r.kind());
        assert_eq!(kind(&serde_json::to_string(&RayBenchmark::default()).unwrap()).unwrap(), BenchKind::Rays);
        assert_eq!(kind(&serde_json::to_string(&PathBenchmark::default()).unwrap()).unwrap(), BenchKind::Path);
        assert_eq!(kind(r#"{"benchmark":"frames"}"#).unwrap(), BenchKind::Frames);
        assert_eq!(kind(r#"{"benchmark":"ao"}"#).unwrap(), BenchKind::Ao);
        for broken in ["[]", "{}", r#"{"benchmark":"time"}"#, r#"{"benchmark":"ao","views":3}"#] {
            let error = read(broken).unwrap_err();
            assert!(
                error.exit_code() == 3 && error.to_string().contains("is no record of `skylit bench`"),
                "{broken}: {error}"
            );
        }
        assert!(read("").unwrap_err().to_string().contains("is empty"));
        for number in ["5e-324", "-1e-320", "1e308", "-1e101", "9007199254740993", "18446744073709551615", "1e999"] {
            let error = read(&format!(r#"{{"benchmark":"ao","views":[{{"reference_rmse":{number}}}]}}"#)).unwrap_err();
            let is_named = number == "1e999" || error.to_string().contains("views.0.reference_rmse is ");
            assert!(error.exit_code() == 3 && is_named, "{error}");
        }
    }
}
