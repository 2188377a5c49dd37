//! Results as JUnit XML, which CI servers show.

use std::io::Write;
use std::path::Path;
use std::time::Duration;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::{FrameResult, Outcome, Summary};
use crate::error::{Error, Result};
use crate::files::write_atomically;

/// Writes a suite with a test case for each frame and tracer. `suite`: a name such as the folder's.
pub fn write(summary: &Summary, suite: &str, path: &Path) -> Result<()> {
    let xml = text(summary, suite).map_err(|e| Error::Output { path: path.to_owned(), message: e })?;
    write_atomically(path, |file| file.write_all(xml.as_bytes()))
}

/// Writes a file with one error, as no frame was judged, in place of an earlier run's file.
pub fn write_failure(why: &str, suite: &str, path: &Path) -> Result<()> {
    write(&Summary::of_failure(why), suite, path)
}

fn text(summary: &Summary, suite: &str) -> std::result::Result<String, String> {
    let mut tests = TestSuite::new(suite);
    tests.set_time(Duration::from_secs_f64(summary.seconds));
    for (key, value) in
        [("device", &summary.device), ("driver", &summary.driver), ("version", &env!("CARGO_PKG_VERSION").into())]
    {
        tests.add_property((key, value.as_str()));
    }
    tests.add_test_cases(summary.frames.iter().map(|f| case(f, suite)));
    let mut report = Report::new("skylit verify");
    report.add_test_suite(tests);
    report.to_string().map_err(|e| e.to_string())
}

fn case(result: &FrameResult, suite: &str) -> TestCase {
    let failed = |kind, name: &str, text: &str| {
        let mut status = TestCaseStatus::non_success(kind);
        status.set_type(name).set_message(text);
        status
    };
    let status = match &result.outcome {
        Outcome::Holds(_) | Outcome::Blessed(_) => TestCaseStatus::success(),
        Outcome::Differs(judgement) => failed(NonSuccessKind::Failure, "differs", &judgement.text()),
        Outcome::Failed(why) => failed(NonSuccessKind::Error, "failed", why),
        Outcome::Skipped(why) => {
            let mut status = TestCaseStatus::skipped();
            status.set_message(why.as_str());
            status
        }
    };
    let name = match result.tracer {
        Some(tracer) => format!("{} ({})", result.frame, tracer.name()),
        None => result.frame.clone(),
    };
    let mut case = TestCase::new(name, status);
    case.set_classname(suite).set_time(Duration::from_secs_f64(result.seconds));
    let found = if let Outcome::Holds(judgement) = &result.outcome { Some(judgement.text()) } else { None };
    let texts: Vec<String> = found.into_iter().chain(result.note.clone()).collect();
    if !texts.is_empty() {
        case.set_system_out(texts.join("; "));
    }
    case
}

#[cfg(test)]
mod tests {
    use super::super::judge::{Check, Judgement};
    use super::*;
    use crate::tracer::TracerKind;

    #[test]
    fn every_outcome_is_in_the_file() {
        let check = |holds, text: &str| Judgement {
            checks: vec![Check { condition: "flip", holds, text: text.into(), values: serde_json::Value::Null }],
        };
        let result = |frame: &str, outcome| FrameResult {
            frame: frame.into(),
            tracer: Some(TracerKind::Compute),
            outcome,
            seconds: 0.25,
            chosen: None,
            note: None,
            images: None,
        };
        let frames = vec![
            result("a", Outcome::Holds(check(true, "FLIP 0"))),
            result("b", Outcome::Differs(check(false, "FLIP <1> & more"))),
            result("c", Outcome::Failed("no golden image".into())),
            result("d", Outcome::Skipped("no tracer".into())),
        ];
        let summary =
            Summary { device: "llvmpipe".into(), driver: "Mesa 25".into(), pinned: None, frames, seconds: 1.5 };
        let xml = text(&summary, "tests/frames").unwrap();
        for part in [
            r#"tests="4""#,
            r#"failures="1""#,
            r#"errors="1""#,
            r#"skipped="1"#,
            r#"name="b (compute)""#,
            "FLIP &lt;1&gt; &amp; more",
            r#"name="driver" value="Mesa 25""#,
            "no golden image",
        ] {
            assert!(xml.contains(part), "{part} is missing: {xml}");
        }
    }
}
