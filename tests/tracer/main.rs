//! Tracers: parity with the double-precision oracle, what the fast kernels could get wrong, degenerate input, scenes that change, the sampler
//! on the device. Every tracer that the device runs takes every test.

#[path = "../common/mod.rs"]
mod common;

mod animation;
mod degenerate;
mod device_builder;
mod dynamic;
mod kernel;
mod parity;
mod sampler;
mod validation;
