//! Random and quasi-random numbers, and their mapping to directions.
//!
//! [`sobol`] generates points in integer arithmetic only: the shaders have the same functions, and
//! both give the same bits. [`cumulative`] samples a discrete distribution, [`bilinear`] an
//! environment map; [`sequence`] has the sequences of the real-time renderer. [`morton`] numbers
//! pixels in Morton order. [`best_candidates`] and [`blue_noise`] make the tables of the `larsen`
//! preset. [`warp`] maps points of the unit square to disks, hemispheres and frames; `f32`, as the
//! shaders compute them, line by line.

pub mod bilinear;
pub mod cumulative;
pub mod morton;
pub mod sequence;
pub mod sobol;
mod tables;
pub mod warp;

pub use bilinear::BilinearDistribution;
pub use cumulative::CumulativeTable;
pub use sequence::Sequence;
pub use sobol::{AO_DIRECTION, CAMERA_FILM, CAMERA_LENS, Sampler, sobol_2d, to_unit};
pub use tables::{best_candidates, blue_noise};
