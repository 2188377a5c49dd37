//! Where random numbers come from, and how they become directions.
//!
//! [`sobol`] draws points in integer arithmetic only: the shaders hold the same functions, and both sides give the same bits.
//! [`cumulative`] chooses among many, [`patches`] places in an image of the sphere; [`sequence`] has what images of few samples and many frames draw.
//! [`morton`] numbers pixels so that those of a square follow each other.
//! [`best_candidates`] and [`blue_noise`] make the tables of the reference work.
//! [`warp`] maps points of the unit square to disks, hemispheres and frames; `f32`, as the shaders compute them, line by line.

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
pub use sobol::{AO_DIRECTION, CAMERA_FILM, CAMERA_LENS, Sampler, to_unit};
pub use tables::{best_candidates, blue_noise};
