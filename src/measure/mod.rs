//! Numbers that say how good something is: [`metrics`] of two images, [`flip`] for how different they look, [`temporal`] for
//! what of the past is left in a sequence of them, [`parity`] of two tracers, over [`ray_sets`]; and how fast: [`benchmark`]
//! holds what a benchmark found, [`stats`] what repeats say, [`plot`] the picture of it.

pub mod agreement;
pub mod benchmark;
pub mod flip;
pub mod metrics;
pub mod parity;
pub mod plot;
pub mod ray_sets;
pub mod stats;
pub mod temporal;
