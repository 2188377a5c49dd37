//! What benchmarks find: records that become JSON and are read from it again (`saved`), and the rows of their tables. No renderer in here.

pub mod ao;
mod ao_rows;
pub mod ao_verdict;
pub mod cost;
pub mod frames;
pub mod path;
pub mod rays;
pub mod saved;
pub mod snapshot;

use std::io::Write;

use serde::{Deserialize, Serialize};

use self::saved::SavedRecord;
use self::snapshot::Comparable;

/// Which benchmark a record is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BenchKind {
    /// Rays per second.
    Rays,
    /// Ambient occlusion in real time.
    Ao,
    /// Path tracing.
    Path,
    /// Frames in real time, of any integrator.
    Frames,
}

impl BenchKind {
    /// The name of its command: `skylit bench NAME`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::Ao => "ao",
            Self::Path => "path",
            Self::Frames => "frames",
        }
    }
}

/// What a benchmark ran on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct HostInfo {
    /// Version of skylit.
    pub version: String,
    /// Vulkan device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Name of the host's processor; empty where the system does not say.
    pub cpu: String,
    /// Logical processors of the host.
    pub threads: usize,
}

/// How complete a benchmark is.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Completeness {
    /// The time limit ended it.
    pub stopped_early: bool,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// What a whole run found.
pub trait BenchRecord: Serialize + Comparable {
    /// Where notes go.
    fn completeness(&mut self) -> &mut Completeness;

    /// Was nothing measured?
    fn is_empty(&self) -> bool;

    /// The record among those of all benchmarks.
    fn saved(&self) -> SavedRecord;

    /// Writes one row a result. What is not known is empty.
    ///
    /// # Errors
    /// Those of `out`.
    fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()>;
}

/// The root of a mean squared error without the error of the reference that it was measured against, which is independent of it; 0 where nothing is left. NaN
/// stays what it is.
pub fn without_reference(rmse: f64, reference_rmse: f64) -> f64 {
    let squares = rmse * rmse - reference_rmse * reference_rmse;
    if squares < 0.0 { 0.0 } else { squares.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_references_own_error_is_taken_off() {
        assert!((without_reference(0.5, 0.3) - 0.4).abs() < 1e-12);
        assert_eq!(without_reference(0.1, 0.2), 0.0);
        assert!(without_reference(f64::NAN, 0.1).is_nan());
    }
}
