//! Numbers that say how good something is: [`metrics`] of two images, [`flip`] for how different they look, [`temporal`] for
//! what of the past is left in a sequence of them, [`parity`] of two tracers, over [`ray_sets`]; and how fast: [`benchmark`]
//! holds what a benchmark found, [`ao_benchmark`] what one of ambient occlusion did, [`path_benchmark`] what one of paths did,
//! [`stats`] what repeats say, [`plot`], [`ao_plot`] and [`path_plot`] the pictures of them, with what [`chart`] has for all.

pub mod agreement;
pub mod ao_benchmark;
pub mod ao_plot;
pub mod benchmark;
pub mod chart;
pub mod flip;
pub mod metrics;
pub mod parity;
pub mod path_benchmark;
pub mod path_plot;
pub mod plot;
pub mod ray_sets;
pub mod stats;
pub mod temporal;
