//! `skylit bench rays --check`: answers of contestants held against those of the first.

use crate::bench::record::{Record, plain};
use crate::error::{Error, Result};
use crate::measure::agreement::Agreement;

/// One contestant's answers on a stream against the first one's.
pub struct Check {
    scene: String,
    stream: String,
    contestant: String,
    reference: String,
    rays: u64,
    agree: u64,
    /// Other answers that rounding allows.
    ties: u64,
    unexplained: u64,
    /// Unexplained ones where it is the reference's answer that no rounding explains.
    reference_unexplained: u64,
    /// Unexplained answers of this contestant are a failure.
    strict: bool,
    example: Option<String>,
}

impl Check {
    /// The findings about a contestant: names of scene, stream, contestant, and of its reference.
    pub fn new([scene, stream, contestant, reference]: [&str; 4], found: &Agreement, strict: bool) -> Self {
        let report = &found.report;
        Self {
            scene: scene.to_owned(),
            stream: stream.to_owned(),
            contestant: contestant.to_owned(),
            reference: reference.to_owned(),
            rays: report.rays,
            agree: report.agree,
            ties: report.ties,
            unexplained: report.unexplained,
            reference_unexplained: found.reference_unexplained,
            strict,
            // its text is a summary and a line for each example
            example: report.to_string().lines().nth(1).map(|l| l.trim().to_owned()),
        }
    }

    /// Adds the counts to the record.
    pub fn add_to(&self, record: &mut Record) {
        let mut row = record.row(&self.scene, &format!("answers, {}", self.stream), &self.contestant);
        let counts =
            [("compared", self.rays), ("agree", self.agree), ("ties", self.ties), ("unexplained", self.unexplained)];
        counts.into_iter().for_each(|(name, count)| {
            row.exact(plain(name, ""), count as f64);
        });
    }

    /// Is it a failure? One of our own tracers as the reference always counts.
    fn fails(&self) -> bool {
        self.strict && self.unexplained > 0 || self.reference_unexplained > 0
    }
}

/// An unexplained answer is a failure, if it is ours or of a peer that has to agree.
///
/// # Errors
/// [`Error::CheckFailed`] that names the first.
pub fn verdict(checks: &[Check]) -> Result<()> {
    let Some(c) = checks.iter().find(|c| c.fails()) else { return Ok(()) };
    Err(Error::CheckFailed(format!(
        "{}, {}: {} of {} answers of '{}' differ from those of '{}' by more than rounding{} ({}); {} such results in all",
        c.scene,
        c.stream,
        c.unexplained,
        c.rays,
        c.contestant,
        c.reference,
        match c.reference_unexplained {
            0 => String::new(),
            n => format!(", {n} of these because the latter are wrong"),
        },
        c.example.as_deref().unwrap_or("no example"),
        checks.iter().filter(|c| c.fails()).count()
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::parity::ParityReport;

    #[test]
    fn who_fails_a_check() {
        let check = |strict, unexplained, reference_unexplained| {
            let report = ParityReport { rays: 10, unexplained, ..Default::default() };
            Check::new(["a", "primary", "b", "wide"], &Agreement { report, reference_unexplained }, strict)
        };
        assert!(verdict(&[check(true, 0, 0), check(false, 3, 0)]).is_ok());
        // the reference's own answers count whoever is beside it
        assert!(check(true, 1, 0).fails() && verdict(&[check(false, 1, 1)]).is_err());
    }
}
