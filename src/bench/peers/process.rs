//! A peer's process: lines on its stdin, answers in JSON lines (docs/reference/benchmarks.md).

use std::io::{BufRead, BufReader, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::file::PeerSpec;
use crate::error::{Error, Result};
use crate::terminal::interrupt;

const PROTOCOL: u64 = 1;
/// Timeout of an answer. Building over 10^7 triangles takes seconds.
const PATIENCE: Duration = Duration::from_secs(600);
/// Timeout of the greeting.
const START_PATIENCE: Duration = Duration::from_secs(60);

/// Failure of a request to a peer.
pub enum PeerError {
    /// The peer failed, for this reason.
    Failed(String),
    /// skylit failed, or the user pressed Ctrl-C.
    Ours(Error),
}

impl From<Error> for PeerError {
    fn from(e: Error) -> Self {
        Self::Ours(e)
    }
}

impl PeerError {
    /// As an error that ends what `who` was part of.
    pub fn into_error(self, who: &str) -> Error {
        match self {
            Self::Failed(why) => Error::CheckFailed(format!("{who}: {why}")),
            Self::Ours(e) => e,
        }
    }
}

/// A running peer. `bench::rays` and `bench::path` add what is said to it.
pub struct Peer {
    pub spec: PeerSpec,
    /// As it introduces itself.
    pub title: String,
    child: Child,
    stdin: ChildStdin,
    lines: Receiver<String>,
    files: tempfile::TempDir,
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = writeln!(self.stdin, "quit");
        // it may be in the middle of something, or not listen
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Peer {
    /// Builds, starts and greets it.
    ///
    /// # Errors
    /// [`PeerError::Failed`] when it does not build or start, or speaks another protocol.
    pub fn start(spec: &PeerSpec) -> Result<Self, PeerError> {
        let mut command = spec.prepare().map_err(PeerError::Failed)?;
        let not_started = |e: std::io::Error| PeerError::Failed(format!("`{}` does not run ({e})", spec.run[0]));
        let mut child =
            command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().map_err(not_started)?;
        let (Some(stdin), Some(stdout)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(PeerError::Failed("it has no stdin or stdout".into()));
        };
        let (to_us, lines) = channel();
        // ends with the process' stdout, or when nobody listens any more
        let forward = move || BufReader::new(stdout).lines().map_while(|l| l.ok()).try_for_each(|l| to_us.send(l));
        if let Err(e) = std::thread::Builder::new().spawn(forward) {
            // nobody would hear what it says
            let _ = child.kill();
            let _ = child.wait();
            return Err(PeerError::Failed(format!("there is no room for the thread that reads its answers ({e})")));
        }
        let files = tempfile::tempdir().map_err(|e| Error::write(std::env::temp_dir(), &e))?;
        let mut process = Self { spec: spec.clone(), title: String::new(), child, stdin, lines, files };
        let hello = process.listen(START_PATIENCE)?;
        if hello["protocol"].as_u64() != Some(PROTOCOL) {
            return Err(PeerError::Failed(format!("it does not speak protocol {PROTOCOL}")));
        }
        process.title = hello["peer"].as_str().unwrap_or(&spec.name).to_owned();
        let offered: Vec<&str> = hello["kernels"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        if let Some(k) = spec.kernels.iter().find(|k| !offered.contains(&k.as_str())) {
            return Err(PeerError::Failed(format!("it has no kernel '{k}' (it has {})", offered.join(", "))));
        }
        Ok(process)
    }

    /// Waits for one answer.
    fn listen(&mut self, patience: Duration) -> Result<Value, PeerError> {
        let start = Instant::now();
        let line = loop {
            match self.lines.recv_timeout(Duration::from_millis(100)) {
                Ok(line) => break line,
                Err(RecvTimeoutError::Disconnected) => {
                    // Ctrl-C reaches both of us
                    interrupt::check()?;
                    let status = self.child.wait().map_or_else(|e| e.to_string(), |s| s.to_string());
                    return Err(PeerError::Failed(format!("it ended ({status})")));
                }
                Err(RecvTimeoutError::Timeout) => {
                    interrupt::check()?;
                    if start.elapsed() > patience {
                        return Err(PeerError::Failed(format!("it did not answer for {} seconds", patience.as_secs())));
                    }
                }
            }
        };
        let value: Value = serde_json::from_str(&line)
            .map_err(|_| PeerError::Failed(format!("its answer is not JSON: {line:.80}")))?;
        match value["error"].as_str() {
            Some(e) => Err(PeerError::Failed(format!("it reports: {e}"))),
            None => Ok(value),
        }
    }

    /// Sends a command and waits for the answer.
    ///
    /// # Errors
    /// [`PeerError::Failed`] when it fails, ends, or is silent too long; [`PeerError::Ours`].
    pub fn ask(&mut self, command: &str) -> Result<Value, PeerError> {
        let sent = writeln!(self.stdin, "{command}").and_then(|()| self.stdin.flush());
        // one that has ended says so to `listen`
        let _ = sent;
        self.listen(PATIENCE)
    }

    /// A number of an answer.
    ///
    /// # Errors
    /// [`PeerError::Failed`] when it is not there.
    pub fn number(answer: &Value, name: &str) -> Result<f64, PeerError> {
        answer[name].as_f64().ok_or_else(|| PeerError::Failed(format!("its answer has no number '{name}'")))
    }

    /// A file for it to read or write; gone when it ends.
    pub fn file(&self, name: &str) -> PathBuf {
        self.files.path().join(name)
    }
}
