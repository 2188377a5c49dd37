//! `--baseline`: results beside those of an earlier run, to find what is worse beyond noise.

mod table;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::record::{BenchKind, Better, Measurement, Record};
use crate::error::{Error, Result};
use crate::measure::regression::{Judged, Judgement, RULE, judge};
use crate::measure::stats::median;
use crate::report::Part;

#[derive(Clone, Debug)]
pub struct Baseline {
    path: PathBuf,
    before: Record,
}

/// How a run compares with an earlier one.
#[derive(Clone, Debug, Default, Serialize)]
pub struct BaselineReport {
    /// File of the earlier record.
    pub file: String,
    /// Version of skylit that made it.
    pub version: String,
    /// When a result counts as worse or better.
    pub rule: &'static str,
    /// Results that both records have.
    pub compared: usize,
    /// Results without a verdict, because one of the records has a single measurement.
    pub not_judged: usize,
    /// Median relative change for the worse over all repeated results, which is more likely the
    /// machine's than the program's. `None` without any.
    pub typical_change: Option<f64>,
    /// Results that are worse beyond noise, the worst first.
    pub regressions: Vec<Change>,
    /// Results of other programs that are worse beyond noise: a sign that the machine is slower.
    pub worse_peers: Vec<Change>,
    /// Results that are better beyond noise.
    pub improvements: Vec<Change>,
    /// Results of the baseline that this run does not have.
    pub missing: Vec<String>,
    /// Results of this run that the baseline does not have.
    pub new: usize,
    /// Differences between the machines.
    pub warnings: Vec<String>,
}

/// A result that changed beyond noise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The row of the measurement.
    pub row: String,
    pub quantity: String,
    /// Median of the baseline.
    pub before: f64,
    /// Median of this run.
    pub now: f64,
    /// How much worse it is, as a share of the baseline; negative where it is better.
    pub worse_by: f64,
    /// How much would still be noise.
    pub noise: f64,
}

impl Baseline {
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self { path: path.to_owned(), before: Record::read(path)? })
    }

    pub fn file(&self) -> &Path {
        &self.path
    }

    /// The benchmark that it is of.
    pub fn kind(&self) -> BenchKind {
        self.before.benchmark
    }

    /// Is it of the same benchmark with the same settings as a run?
    ///
    /// # Errors
    /// [`Error::Usage`] that says what differs.
    pub fn check(&self, now: &Record) -> Result<()> {
        let refuse = |why: String| Err(Error::Usage(format!("--baseline {}: {why}", self.path.display())));
        if self.before.benchmark != now.benchmark {
            let [before, now] = [self.before.benchmark, now.benchmark].map(BenchKind::name);
            return refuse(format!("it is a record of `skylit bench {before}`, this is `skylit bench {now}`"));
        }
        for (name, before) in &self.before.settings {
            let Some(now) = now.settings.get(name) else { continue };
            if before != now {
                return refuse(format!("its {name} is {before}, not {now}: measure both with the same options"));
            }
        }
        Ok(())
    }

    /// Compares a run with it.
    pub fn compare(&self, now: &Record) -> BaselineReport {
        let compared = |record: &'_ Record| -> Vec<Measurement> {
            record.measurements.iter().filter(|m| m.better != Better::Neither).cloned().collect()
        };

        // Pairs measurements of the same row and title.
        let [befores, nows] = [compared(&self.before), compared(now)];
        let by_key = |all: &[Measurement]| -> HashMap<(String, String), usize> {
            all.iter().enumerate().map(|(k, m)| ((m.row(), m.title()), k)).collect()
        };
        let [in_before, in_now] = [&befores, &nows].map(|all| by_key(all));
        let mut report = BaselineReport {
            file: self.path.display().to_string(),
            version: self.before.host.version.clone(),
            rule: RULE,
            warnings: self.warnings(now),
            ..BaselineReport::default()
        };

        // Judges every pair, and finds missing and new measurements.
        let mut changes = Vec::new();
        for before in &befores {
            let Some(k) = in_now.get(&(before.row(), before.title())) else {
                report.missing.push(format!("{}: {}", before.row(), before.title()));
                continue;
            };
            let now = &nows[*k];
            report.compared += 1;
            let Judged { judgement, worse_by, noise } = judge(&before.values, &now.values, now.better == Better::More);
            let [before_value, now_value] = [before, now].map(|m| m.values.middle());
            let (row, quantity) = (now.row(), now.title());
            let change = Change { row, quantity, before: before_value, now: now_value, worse_by, noise };
            if before.values.is_repeated() && change.worse_by.is_finite() {
                changes.push(change.worse_by);
            }
            match judgement {
                Judgement::Worse if now.is_peers => report.worse_peers.push(change),
                Judgement::Worse => report.regressions.push(change),
                Judgement::Better => report.improvements.push(change),
                Judgement::Same => {}
                Judgement::Unknown => report.not_judged += 1,
            }
        }
        report.new = nows.iter().filter(|m| !in_before.contains_key(&(m.row(), m.title()))).count();
        report.typical_change = median(&changes);
        report.regressions.sort_by(|a, b| b.worse_by.total_cmp(&a.worse_by));
        report.improvements.sort_by(|a, b| a.worse_by.total_cmp(&b.worse_by));
        report
    }

    fn warnings(&self, now: &Record) -> Vec<String> {
        let (a, b) = (&self.before.host, &now.host);
        let threads = [a, b].map(|h| h.threads.to_string());
        let pairs = [
            ("device", &a.device, &b.device),
            ("driver", &a.driver, &b.driver),
            ("processor", &a.cpu, &b.cpu),
            ("number of threads", &threads[0], &threads[1]),
        ];
        let differ = pairs.into_iter().filter(|(_, a, b)| a != b && !a.is_empty());
        differ
            .map(|(what, a, b)| {
                format!("--baseline {}: its {what} is '{a}', not '{b}': times cannot be compared", self.path.display())
            })
            .collect()
    }
}

impl BaselineReport {
    pub fn parts(&self) -> Vec<Part> {
        table::parts(self)
    }

    /// Fails if anything is worse beyond noise.
    ///
    /// # Errors
    /// [`Error::CheckFailed`] that names the worst.
    pub fn verdict(&self) -> Result<()> {
        let Some(worst) = self.regressions.first() else { return Ok(()) };
        let count = match self.regressions.len() {
            1 => "1 result is".to_owned(),
            n => format!("{n} results are"),
        };
        Err(Error::CheckFailed(format!(
            "{count} worse than in {} beyond noise; the worst: {}, {}: {}",
            self.file,
            worst.row,
            worst.quantity,
            table::change_text(worst)
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::{HostInfo, Quantity};
    use super::*;
    use crate::measure::regression::Values;
    use crate::measure::stats::Percentiles;

    fn result(row: &str, values: &[f64]) -> Measurement {
        let values = Values::Repeated(Percentiles::from_values(values).unwrap());
        Measurement::new([row, "", ""], Quantity { name: "ms", unit: "", better: Better::Less }, values)
    }

    fn run(measurements: Vec<Measurement>) -> Record {
        let host = HostInfo { device: "a".into(), cpu: "x".into(), ..HostInfo::default() };
        let settings = [("size".to_owned(), "8x4".to_owned())].into();
        Record { benchmark: BenchKind::Frames, host, settings, measurements, ..Record::default() }
    }

    fn baseline(results: Vec<Measurement>) -> Baseline {
        Baseline { path: "before.json".into(), before: run(results) }
    }

    /// Repeats around a median that differ by a few per cent.
    fn repeats_around(median: f64) -> Vec<f64> {
        [0.98, 1.03, 1.0, 0.99, 1.02, 1.0, 0.97, 1.01].map(|k| k * median).into()
    }

    #[test]
    fn a_slowdown_is_found_and_noise_is_not() {
        let before = baseline(vec![
            result("a", &repeats_around(10.0)),
            result("b", &repeats_around(5.0)),
            result("c", &repeats_around(1.0)),
        ]);
        let now = run(vec![
            result("a", &repeats_around(10.2)),
            result("b", &repeats_around(6.0)),
            result("c", &repeats_around(0.8)),
        ]);
        let report = before.compare(&now);
        assert_eq!((report.compared, report.regressions.len(), report.improvements.len()), (3, 1, 1));
        let worst = &report.regressions[0];
        assert_eq!((worst.row.as_str(), worst.quantity.as_str()), ("b", "ms"));
        assert!((worst.worse_by - 0.2).abs() < 1e-9 && worst.noise >= 0.05);
        assert!((report.typical_change.unwrap() - 0.02).abs() < 1e-9);
        let error = report.verdict().unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(
            error.to_string().contains("1 result is worse than in before.json beyond noise; the worst: b, ms: "),
            "{error}"
        );
        assert!(before.compare(&before.before).verdict().is_ok());
    }

    #[test]
    fn what_is_missing_is_named() {
        let report = baseline(vec![result("a", &repeats_around(1.0)), result("b", &repeats_around(1.0))])
            .compare(&run(vec![result("b", &repeats_around(1.0)), result("c", &repeats_around(1.0))]));
        assert_eq!((report.missing.as_slice(), report.new, report.compared), (&["a: ms".to_owned()][..], 1, 1));
        assert!(crate::bench::table::lines(&report.parts()).iter().any(|l| l.trim() == "a: ms"));
    }

    #[test]
    fn another_programs_results_do_not_fail_a_run() {
        let theirs = |median| Measurement { is_peers: true, ..result("peer", &repeats_around(median)) };
        let report = baseline(vec![theirs(1.0)]).compare(&run(vec![theirs(2.0)]));
        assert!(report.verdict().is_ok() && report.worse_peers.len() == 1);
    }

    #[test]
    fn another_machine_is_a_warning_and_other_settings_an_error() {
        let before = baseline(vec![result("a", &repeats_around(1.0))]);
        let mut now = run(Vec::new());
        now.host.cpu = "y".into();
        let warnings = before.compare(&now).warnings;
        assert!(warnings.len() == 1 && warnings[0].contains("its processor is 'x', not 'y'"), "{warnings:?}");
        assert!(before.check(&now).is_ok());
        now.settings.insert("size".into(), "16x8".into());
        let error = before.check(&now).unwrap_err();
        assert!(error.exit_code() == 64 && error.to_string().contains("its size is 8x4, not 16x8"), "{error}");
        now.benchmark = BenchKind::Rays;
        assert!(before.check(&now).unwrap_err().to_string().contains("record of `skylit bench frames`"));
    }
}
