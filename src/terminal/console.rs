//! What goes to the terminal: results on stdout, everything else on stderr. A reader that went away is no error.

use std::io::{self, Write};

use serde::Serialize;

use crate::error::{Error, Result};

/// How a command ends that did not do what it was asked to.
#[derive(Debug)]
pub struct Failure {
    /// Why.
    pub error: Error,
    /// The record on stdout says so already.
    pub reported: bool,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self { error, reported: false }
    }
}

/// How results are shown.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Verbosity {
    /// Print one JSON record on stdout instead of text
    #[arg(long)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

impl Verbosity {
    /// Where to say things.
    pub fn console(&self) -> Console {
        Console { json: self.json, quiet: self.quiet }
    }
}

/// How much a command says.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    /// One JSON record on stdout instead of text.
    pub json: bool,
    /// Only errors.
    pub quiet: bool,
}

impl Console {
    /// A line of the result, for people.
    pub fn line(&self, text: &str) -> Result<()> {
        if self.json || self.quiet { Ok(()) } else { print(&format!("{text}\n")) }
    }

    /// The result, for programs.
    pub fn record(&self, value: &impl Serialize) -> Result<()> {
        if self.json { json(value) } else { Ok(()) }
    }

    /// The result of a command that has one also where it fails. In JSON mode the failure is part of the one record, under
    /// `error` and `exit_code`. `value` is a map.
    pub fn close(&self, value: &impl Serialize, outcome: Result<()>) -> Result<(), Failure> {
        #[derive(Serialize)]
        struct Failed<'a, T> {
            #[serde(flatten)]
            value: &'a T,
            error: String,
            exit_code: u8,
        }
        match outcome {
            Ok(()) => Ok(self.record(value)?),
            Err(error) => {
                let record = Failed { value, error: one_line(&error.to_string()), exit_code: error.exit_code() };
                // what failed first counts: a stdout that fails as well is reported of nowhere
                let _ = self.record(&record);
                Err(Failure { error, reported: self.json })
            }
        }
    }

    /// Something to know that is no failure. In JSON mode it is part of the record instead.
    pub fn warning(&self, text: &str) {
        if !self.json && !self.quiet {
            stderr(&format!("skylit: warning: {text}"));
        }
    }
}

/// Text without line breaks.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The line that ends a failed run.
pub fn error(text: &str) {
    stderr(&format!("skylit: error: {text}"));
}

fn stderr(line: &str) {
    // not eprintln!, which panics when stderr is closed
    let _ = writeln!(io::stderr().lock(), "{line}");
}

/// Writes to stdout.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::write("standard output", &e)),
        _ => Ok(()),
    }
}

/// Writes a JSON record to stdout, on one line.
pub fn json(value: &impl Serialize) -> Result<()> {
    let text =
        serde_json::to_string(value).map_err(|e| Error::CheckFailed(format!("cannot express the result as JSON: {e}")))?;
    print(&(text + "\n"))
}
