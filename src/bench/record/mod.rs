//! What benchmarks find: records that become JSON, and the rows of their tables. No renderer in here.

pub mod ao;
mod ao_rows;
pub mod ao_verdict;
pub mod path;
pub mod rays;

use std::io::Write;

use serde::Serialize;

/// What a benchmark ran on.
#[derive(Clone, Debug, Default, Serialize)]
pub struct HostInfo {
    /// Version of skylit.
    pub version: String,
    /// Vulkan device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Logical processors of the host.
    pub threads: usize,
}

/// How complete a benchmark is.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Completeness {
    /// The time limit ended it.
    pub stopped_early: bool,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// What a whole run found.
pub trait BenchRecord: Serialize {
    /// Where notes go.
    fn completeness(&mut self) -> &mut Completeness;

    /// Was nothing measured?
    fn is_empty(&self) -> bool;

    /// Writes one row a result. What is not known is empty.
    ///
    /// # Errors
    /// Those of `out`.
    fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()>;
}
