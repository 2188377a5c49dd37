//! Terminal output: results on stdout, everything else on stderr. A closed pipe is not an error.
//!
//! All that the program prints goes through [`print`], [`json`], [`error`] and [`note`]. What files
//! call their cameras, channels or settings is a part of it, so none of them lets a character
//! through that a terminal obeys.

use std::borrow::Cow;
use std::io::{self, Write};

use clap::builder::Resettable;
use serde::Serialize;

use crate::error::{Error, Result};

/// The failure of a command.
#[derive(Debug)]
pub struct Failure {
    /// The error.
    pub error: Error,
    /// The JSON record on stdout already contains the error.
    pub reported: bool,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self { error, reported: false }
    }
}

/// Output options.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Verbosity {
    /// Print one JSON record on stdout instead of text
    #[arg(long, help_heading = Resettable::Reset)]
    pub json: bool,
    /// Print nothing but errors
    #[arg(long, short, help_heading = Resettable::Reset)]
    pub quiet: bool,
}

impl Verbosity {
    /// The console with these options.
    pub fn console(&self) -> Console {
        Console { json: self.json, quiet: self.quiet }
    }
}

/// Prints results and warnings as the output options require.
#[derive(Clone, Copy, Debug)]
pub struct Console {
    /// One JSON record on stdout instead of text.
    pub json: bool,
    /// Print errors only.
    pub quiet: bool,
}

impl Console {
    /// Prints a line of the result in text mode.
    pub fn line(&self, text: &str) -> Result<()> {
        if self.json || self.quiet { Ok(()) } else { print(&(visible(text, &[]) + "\n")) }
    }

    /// Prints the result as a record in JSON mode.
    pub fn record(&self, value: &impl Serialize) -> Result<()> {
        if self.json { json(value) } else { Ok(()) }
    }

    /// Prints the result of a command that has one even if it fails. In JSON mode the failure is
    /// part of the one record, under `error` and `exit_code`. `value` must serialize to a map.
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
                // the first failure counts: a second one, of stdout, is not reported
                let _ = self.record(&record);
                Err(Failure { error, reported: self.json })
            }
        }
    }

    /// Prints a remark to stderr, also in JSON mode, whose record on stdout it does not touch.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            note(text);
        }
    }

    /// Prints a warning to stderr. In JSON mode warnings are part of the record instead.
    pub fn warning(&self, text: &str) {
        if !self.json && !self.quiet {
            stderr(&format!("skylit: warning: {}", one_line(text)));
        }
    }
}

/// Returns true for characters that a terminal obeys instead of showing them: control characters,
/// line and paragraph separators, and those that reorder a line.
fn is_obeyed(c: char) -> bool {
    let reorders =
        matches!(c, '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || reorders
}

/// Replaces line breaks, other characters that a terminal obeys and runs of white space by single
/// spaces.
pub fn one_line(text: &str) -> String {
    text.split(|c: char| c.is_whitespace() || is_obeyed(c))
        .filter(|word| !word.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Replaces each character that a terminal obeys by a space, except those of `kept`: columns stay
/// where they are.
pub fn visible(text: &str, kept: &[char]) -> String {
    text.chars().map(|c| if is_obeyed(c) && !kept.contains(&c) { ' ' } else { c }).collect()
}

/// The command line of this process, quoted as a shell needs it.
pub fn command_line() -> String {
    let words: Vec<String> = std::env::args_os().skip(1).map(|w| w.to_string_lossy().into_owned()).collect();
    let quoted = words.iter().map(|w| shlex::try_quote(w).unwrap_or(Cow::Borrowed(w)));
    std::iter::once(Cow::Borrowed("skylit")).chain(quoted).collect::<Vec<_>>().join(" ")
}

/// Prints the error that ends a failed run.
pub fn error(text: &str) {
    stderr(&format!("skylit: error: {text}"));
}

/// Prints a remark to stderr.
pub fn note(text: &str) {
    stderr(&format!("skylit: {text}"));
}

fn stderr(line: &str) {
    // not eprintln!, which panics when stderr is closed
    let _ = writeln!(io::stderr().lock(), "{}", visible(line, &[]));
}

/// Writes lines to stdout.
pub fn print(text: &str) -> Result<()> {
    write(&visible(text, &['\n', '\t']))
}

fn write(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::write("standard output", &e)),
        _ => Ok(()),
    }
}

/// Writes a JSON record to stdout, on one line.
pub fn json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string(value)
        .map_err(|e| Error::CheckFailed(format!("cannot express the result as JSON: {e}")))?;
    write(&(escaped(&text) + "\n"))
}

/// JSON whose strings have escapes for all that a terminal obeys; the format itself requires them
/// for some only.
fn escaped(json: &str) -> String {
    use std::fmt::Write;
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if is_obeyed(c) {
            // writing to a string does not fail
            let _ = write!(out, "\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVIL: &str = "a\x1b[31m\u{9b}2J\u{202e}b\r\nc\x07";

    #[test]
    fn nothing_that_a_terminal_obeys_is_printed() {
        assert_eq!(one_line(EVIL), "a [31m 2J b c");
        assert_eq!(visible(EVIL, &[]), "a [31m 2J b  c ");
        assert_eq!(visible("a\tb\n c\x1b", &['\n', '\t']), "a\tb\n c ");
        let value = serde_json::json!({ "name": EVIL });
        let text = escaped(&value.to_string());
        assert!(!text.chars().any(is_obeyed), "{text}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value, "it says the same");
    }
}
