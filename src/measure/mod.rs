//! Numbers that say how good something is: [`metrics`] of two images, [`parity`] of two tracers, over [`ray_sets`].

pub mod metrics;
pub mod parity;
pub mod ray_sets;
