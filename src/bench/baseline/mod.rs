//! `--baseline`: the results of a run beside those of an earlier one, so that what became worse beyond noise is found.

mod rule;
mod table;

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::record::BenchKind;
use super::record::saved::SavedRecord;
use super::record::snapshot::{Measurement, Snapshot};
use super::table::Block;
use crate::error::{Error, Result};
use crate::measure::stats::median;
use rule::{Judgement, judge};

/// The rule, in a sentence, as reports say it.
pub const RULE: &str = rule::TEXT;

/// An earlier record.
#[derive(Clone, Debug)]
pub struct Baseline {
    path: PathBuf,
    before: Snapshot,
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
    /// Those of them of which nothing can be said, because one of the records has a single measurement.
    pub not_judged: usize,
    /// Median over all repeated results of how much worse they are, as a share of the baseline: what all of them have in common is more likely the machine's
    /// than the program's. `None` without any.
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
    /// What it was measured of.
    pub row: String,
    /// Quantity and unit.
    pub quantity: &'static str,
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
    /// Reads an earlier record.
    ///
    /// # Errors
    /// Those of [`SavedRecord::read`].
    pub fn read(path: &Path) -> Result<Self> {
        Ok(Self { path: path.to_owned(), before: SavedRecord::read(path)?.snapshot() })
    }

    /// Its file.
    pub fn file(&self) -> &Path {
        &self.path
    }

    /// The benchmark that it is of.
    pub fn kind(&self) -> BenchKind {
        self.before.kind
    }

    /// Is it of the same benchmark with the same settings as a run?
    ///
    /// # Errors
    /// [`Error::Usage`] that says what differs.
    pub fn check(&self, now: &Snapshot) -> Result<()> {
        let refuse = |why: String| Err(Error::Usage(format!("--baseline {}: {why}", self.path.display())));
        if self.before.kind != now.kind {
            let [before, now] = [self.before.kind, now.kind].map(|k| k.name());
            return refuse(format!("it is a record of `skylit bench {before}`, this is `skylit bench {now}`"));
        }
        for ((name, before), (_, now)) in self.before.settings.iter().zip(&now.settings) {
            if before != now && !before.is_empty() && !now.is_empty() {
                return refuse(format!("its {name} is {before}, not {now}: measure both with the same options"));
            }
        }
        Ok(())
    }

    /// Compares a run with it.
    pub fn compare(&self, now: &Snapshot) -> BaselineReport {
        let find = |of: &Measurement, among: &[Measurement]| -> Option<usize> {
            among.iter().position(|m| m.row == of.row && m.quantity == of.quantity)
        };
        let mut report = BaselineReport {
            file: self.path.display().to_string(),
            version: self.before.host.version.clone(),
            rule: RULE,
            warnings: self.warnings(now),
            ..BaselineReport::default()
        };
        let mut changes = Vec::new();
        for before in &self.before.results {
            let Some(k) = find(before, &now.results) else {
                report.missing.push(format!("{}: {}", before.row, before.quantity));
                continue;
            };
            let now = &now.results[k];
            report.compared += 1;
            let (judgement, change) = judge(before, now);
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
        report.new = now.results.iter().filter(|m| find(m, &self.before.results).is_none()).count();
        report.typical_change = median(&changes);
        report.regressions.sort_by(|a, b| b.worse_by.total_cmp(&a.worse_by));
        report.improvements.sort_by(|a, b| a.worse_by.total_cmp(&b.worse_by));
        report
    }

    fn warnings(&self, now: &Snapshot) -> Vec<String> {
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
    /// All of it, for people.
    pub fn blocks(&self) -> Vec<Block> {
        table::blocks(self)
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
    use super::super::record::HostInfo;
    use super::super::record::snapshot::Values;
    use super::*;
    use crate::measure::stats::Percentiles;

    fn result(row: &str, values: &[f64]) -> Measurement {
        let values = Values::Repeated(Percentiles::from_values(values).unwrap());
        Measurement { row: row.into(), quantity: "ms", values, more_is_better: false, is_peers: false }
    }

    fn snapshot(results: Vec<Measurement>) -> Snapshot {
        let host = HostInfo { device: "a".into(), cpu: "x".into(), ..HostInfo::default() };
        Snapshot { kind: BenchKind::Ao, host, settings: vec![("size", "8x4".into())], results }
    }

    fn baseline(results: Vec<Measurement>) -> Baseline {
        Baseline { path: "before.json".into(), before: snapshot(results) }
    }

    /// Repeats around a median that differ by a few per cent.
    fn around(median: f64) -> Vec<f64> {
        [0.98, 1.03, 1.0, 0.99, 1.02, 1.0, 0.97, 1.01].map(|k| k * median).into()
    }

    #[test]
    fn a_slowdown_is_found_and_noise_is_not() {
        let before = baseline(vec![result("a", &around(10.0)), result("b", &around(5.0)), result("c", &around(1.0))]);
        let now = snapshot(vec![result("a", &around(10.2)), result("b", &around(6.0)), result("c", &around(0.8))]);
        let report = before.compare(&now);
        assert_eq!((report.compared, report.regressions.len(), report.improvements.len()), (3, 1, 1));
        let worst = &report.regressions[0];
        assert_eq!((worst.row.as_str(), worst.quantity), ("b", "ms"));
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
        let report = baseline(vec![result("a", &around(1.0)), result("b", &around(1.0))])
            .compare(&snapshot(vec![result("b", &around(1.0)), result("c", &around(1.0))]));
        assert_eq!((report.missing.as_slice(), report.new, report.compared), (&["a: ms".to_owned()][..], 1, 1));
        assert!(report.blocks().contains(&Block::line("    a: ms")), "{:?}", report.blocks());
    }

    #[test]
    fn another_programs_results_do_not_fail_a_run() {
        let theirs = |median| Measurement { is_peers: true, ..result("peer", &around(median)) };
        let report = baseline(vec![theirs(1.0)]).compare(&snapshot(vec![theirs(2.0)]));
        assert!(report.verdict().is_ok() && report.worse_peers.len() == 1);
    }

    #[test]
    fn another_machine_is_a_warning_and_other_settings_an_error() {
        let before = baseline(vec![result("a", &around(1.0))]);
        let mut now = snapshot(Vec::new());
        now.host.cpu = "y".into();
        let warnings = before.compare(&now).warnings;
        assert!(warnings.len() == 1 && warnings[0].contains("its processor is 'x', not 'y'"), "{warnings:?}");
        assert!(before.check(&now).is_ok());
        now.settings[0].1 = "16x8".into();
        let error = before.check(&now).unwrap_err();
        assert!(error.exit_code() == 64 && error.to_string().contains("its size is 8x4, not 16x8"), "{error}");
        now.kind = BenchKind::Rays;
        assert!(before.check(&now).unwrap_err().to_string().contains("record of `skylit bench ao`"));
    }
}
