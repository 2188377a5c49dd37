//! What benchmarks find: records that become JSON, and the rows of their tables. No renderer in here.

pub mod ao;
mod ao_rows;
pub mod ao_verdict;
pub mod path;
pub mod rays;
