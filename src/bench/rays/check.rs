//! `skylit bench rays --check`: answers of contestants held against those of the first.

use crate::bench::record::{Record, plain};
use crate::error::{Error, Result};
use crate::measure::agreement::Agreement;

/// One contestant's answers on a stream against the first one's.
pub struct Check {
    /// Scene, stream, contestant, and the contestant that is its reference.
    pub names: [String; 4],
    pub found: Agreement,
    /// Unexplained answers of this contestant are a failure.
    pub strict: bool,
}

impl Check {
    /// Adds the counts to the record.
    pub fn add_to(&self, record: &mut Record) {
        let ([scene, stream, contestant, _], report) = (&self.names, &self.found.report);
        let mut row = record.row(scene, &format!("answers, {stream}"), contestant);
        row.exact(plain("compared", ""), report.rays as f64).exact(plain("agree", ""), report.agree as f64);
        row.exact(plain("ties", ""), report.ties as f64).exact(plain("unexplained", ""), report.unexplained as f64);
    }

    /// Is it a failure? One of our own tracers as the reference always counts.
    fn fails(&self) -> bool {
        self.strict && self.found.report.unexplained > 0 || self.found.reference_unexplained > 0
    }
}

/// An unexplained answer is a failure, if it is ours or of a peer that has to agree.
///
/// # Errors
/// [`Error::CheckFailed`] that names the first.
pub fn verdict(checks: &[Check]) -> Result<()> {
    let Some(c) = checks.iter().find(|c| c.fails()) else { return Ok(()) };
    let ([scene, stream, contestant, reference], report) = (&c.names, &c.found.report);
    let latter = match c.found.reference_unexplained {
        0 => String::new(),
        n => format!(", {n} of these because the latter are wrong"),
    };
    // its text is a summary and a line for each example
    let text = report.to_string();
    Err(Error::CheckFailed(format!(
        "{scene}, {stream}: {} of {} answers of '{contestant}' differ from those of '{reference}' by more than rounding{latter} ({}); {} such results in all",
        report.unexplained,
        report.rays,
        text.lines().nth(1).map_or("no example", str::trim),
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
            let names = ["a", "primary", "b", "wide"].map(str::to_owned);
            Check { names, found: Agreement { report, reference_unexplained }, strict }
        };
        assert!(verdict(&[check(true, 0, 0), check(false, 3, 0)]).is_ok());
        // the reference's own answers count whoever is beside it
        assert!(check(true, 1, 0).fails() && verdict(&[check(false, 1, 1)]).is_err());
    }
}
