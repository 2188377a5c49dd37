//! Renders beside the window: `skylit render` as a program of its own, with its progress;
//! `skylit export` and `skylit bake` likewise.

use std::io::{self, BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use super::baking::BakedModel;

/// Seconds between two lines of progress.
const PROGRESS_SECONDS: &str = "0.25";
/// Exit code of a program that was interrupted.
const INTERRUPTED: i32 = 130;

/// A render that is under way.
pub struct Render {
    /// The file that it writes.
    pub output: String,
    /// The model that is shown once it has been baked.
    pub baked: Option<BakedModel>,
    command: &'static str,
    child: Child,
    heard: Arc<Mutex<Heard>>,
    listener: Option<std::thread::JoinHandle<()>>,
    is_cancelled: bool,
}

/// The lines that the program has printed, as far as they count.
#[derive(Clone, Debug, Default, PartialEq)]
struct Heard {
    /// Share that is done, and the rest of the line about it: how long, how much longer.
    progress: Option<(f32, String)>,
    /// The last line about something else.
    last: String,
}

impl Heard {
    /// Takes a line in.
    fn take(&mut self, line: &str) {
        let percent = line.split_once(" % after ").and_then(|(before, rest)| {
            let percent = before.rsplit(' ').next()?.parse::<f32>().ok()?;
            Some((percent / 100.0, format!("after {rest}")))
        });
        match percent {
            Some(progress) => self.progress = Some(progress),
            None if line.trim().is_empty() => {}
            None => self.last = line.trim().trim_start_matches("skylit: error: ").to_owned(),
        }
    }
}

impl Render {
    /// Starts `program COMMAND` with these arguments, which write `output`.
    ///
    /// # Errors
    /// Those of starting a program and a thread.
    pub fn start(program: &Path, command: &'static str, arguments: &[String], output: &str) -> io::Result<Self> {
        let mut child = Command::new(program)
            .arg(command)
            .args(arguments)
            .env("SKYLIT_PROGRESS_SECONDS", PROGRESS_SECONDS)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let heard = Arc::new(Mutex::new(Heard::default()));
        let listener = child.stderr.take().map(|stderr| {
            let heard = heard.clone();
            let listen = move || {
                for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                    heard.lock().unwrap_or_else(PoisonError::into_inner).take(&line);
                }
            };
            std::thread::Builder::new().name("render".into()).spawn(listen)
        });
        let listener = listener.transpose()?;
        Ok(Self { output: output.to_owned(), baked: None, command, child, heard, listener, is_cancelled: false })
    }

    /// Share that is done, and how long it has taken and will take; `None` before it is known.
    pub fn progress(&self) -> Option<(f32, String)> {
        self.heard.lock().unwrap_or_else(PoisonError::into_inner).progress.clone()
    }

    /// Interrupts it, as Ctrl-C in a terminal does.
    pub fn cancel(&mut self) {
        self.is_cancelled = true;
        #[cfg(unix)]
        if let Ok(id) = self.child.id().try_into() {
            use nix::sys::signal::{Signal, kill};
            // one that has ended meanwhile hears nothing
            let _ = kill(nix::unistd::Pid::from_raw(id), Signal::SIGINT);
        }
        #[cfg(not(unix))]
        let _ = self.child.kill();
    }

    /// Words for what it is doing, and for what it has done.
    pub fn verbs(&self) -> [&'static str; 2] {
        match self.command {
            "export" => ["exporting", "exported"],
            "bake" => ["baking", "baked"],
            _ => ["rendering", "rendered"],
        }
    }

    /// Returns true once it has ended without an error.
    pub fn has_succeeded(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(Some(status)) if status.success())
    }

    /// Returns what is to be said once it has ended, and whether that is an error.
    pub fn ended(&mut self) -> Option<(String, bool)> {
        let status = match self.child.try_wait() {
            Ok(None) => return None,
            Ok(Some(status)) => status,
            Err(e) => return Some((format!("{}: {e}", self.output), true)),
        };
        // all that it said has arrived then
        if let Some(listener) = self.listener.take() {
            let _ = listener.join();
        }
        let output = &self.output;
        if status.success() {
            return Some((format!("{} {output}", self.verbs()[1]), false));
        }
        if self.is_cancelled || status.code() == Some(INTERRUPTED) {
            return Some((format!("{output} was cancelled"), false));
        }
        let said = self.heard.lock().unwrap_or_else(PoisonError::into_inner).last.clone();
        let reason = if said.is_empty() { format!("skylit {} ended with {status}", self.command) } else { said };
        Some((format!("{output}: {reason}"), true))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_told_from_messages() {
        let mut heard = Heard::default();
        heard.take("skylit: rendering: 30 % after 12 s, about 28 s left");
        assert_eq!(heard.progress, Some((0.3, "after 12 s, about 28 s left".into())));
        heard.take("skylit: error: a.exr: the disk is full");
        heard.take("");
        assert_eq!((heard.last.as_str(), heard.progress.is_some()), ("a.exr: the disk is full", true));
    }
}
