//! Images or hits in, numbers out: [`comparison`] of two images by all metrics: those of pairs of
//! values ([`metrics`]), [`ssim`], [`flip`] for how different they look, over the pixels of a
//! [`mask`]; [`temporal`] for what of the past is left in a sequence of them, [`stale`] pixels that
//! keep it, [`z_test`] for whether noise explains the difference, [`parity`] of two tracers over
//! [`ray_sets`], [`agreement`] of the answers of two; [`stats`] of what was measured several times,
//! [`regression`] for whether it has become worse, and [`displayed`] images against references that
//! have an error of their own.

pub mod agreement;
pub mod comparison;
pub mod displayed;
pub mod distributions;
pub mod flip;
pub mod halves;
pub mod mask;
pub mod metrics;
pub mod parity;
pub mod plain_time;
pub mod ray_sets;
pub mod regression;
pub mod ssim;
pub mod stale;
pub mod stats;
pub mod temporal;
pub mod z_test;
