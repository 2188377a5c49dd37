//! Benchmarks as pictures: a line a contestant, a panel a scene or a stream of rays.

pub mod ao;
pub mod chart;
pub mod path;
pub mod rays;
