//! Seconds of the parts of a run, which follow each other: their sum is the whole.

use std::time::Instant;

use crate::gpu;

/// Name of the part that is compiling pipelines.
const COMPILE: &str = "compile";
/// Name of the part in which settings are completed by a few thousand rays.
pub(super) const SURVEY: &str = "survey";

/// A stopwatch whose laps are the parts of a run; compiling pipelines is a part of its own.
#[derive(Clone, Debug)]
pub struct Laps {
    last: Instant,
    compiled: f64,
    parts: Vec<(&'static str, f64)>,
}

impl Laps {
    /// A stopwatch that starts now, after parts of `open` seconds.
    pub(super) fn after_open(open: f64) -> Self {
        Self { last: Instant::now(), compiled: gpu::compile_seconds(), parts: vec![("open", open)] }
    }

    /// Adds the time since the last lap to the part `name`.
    pub(super) fn lap(&mut self, name: &'static str) {
        let (now, compiled) = (Instant::now(), gpu::compile_seconds());
        let compile = compiled - self.compiled;
        let seconds = now.duration_since(self.last).as_secs_f64();
        (self.last, self.compiled) = (now, compiled);
        self.add(COMPILE, compile);
        self.add(name, (seconds - compile).max(0.0));
    }

    /// Adds these seconds to the part `name`.
    pub(super) fn add(&mut self, name: &'static str, seconds: f64) {
        match self.parts.iter_mut().find(|p| p.0 == name) {
            Some(part) => part.1 += seconds,
            None => self.parts.push((name, seconds)),
        }
    }

    /// The parts, in their order.
    pub(super) fn into_parts(self) -> Vec<(&'static str, f64)> {
        self.parts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laps_add_up() {
        let start = Instant::now();
        let mut laps = Laps::after_open(0.0);
        for name in ["a", "b", "a"] {
            std::thread::sleep(std::time::Duration::from_millis(3));
            laps.lap(name);
        }
        let (whole, parts) = (start.elapsed().as_secs_f64(), laps.into_parts());
        assert_eq!(parts.iter().map(|p| p.0).collect::<Vec<_>>(), ["open", COMPILE, "a", "b"]);
        let sum: f64 = parts.iter().map(|p| p.1).sum();
        assert!(sum >= 0.009 && sum <= whole, "{parts:?} {whole}");
    }
}
