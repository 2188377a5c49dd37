//! Images or hits in, numbers out: [`metrics`] of two images, [`flip`] for how different they look, [`temporal`] for what of the past is
//! left in a sequence of them, [`parity`] of two tracers over [`ray_sets`], [`agreement`] of the answers of two; and [`stats`] of what
//! was measured several times.

pub mod agreement;
pub mod flip;
pub mod metrics;
pub mod parity;
pub mod ray_sets;
pub mod stats;
pub mod temporal;
