//! What the path tracer's shaders get: [`PathParams`], and bytes of what it keeps of each path.

use crate::interface::records::path::PathRecord;
pub(super) use crate::interface::records::path::{EnvironmentRecord, PathParams};
pub(super) use crate::interface::records::ray::INVALID;

/// Bytes of a path between two bounces.
pub(super) const STATE_BYTES: u64 = size_of::<PathRecord>() as u64;
/// Bytes of a path's cone, where it has one.
pub(super) const CONE_BYTES: u64 = 8;
/// Bytes of four numbers.
pub(super) const QUAD_BYTES: u64 = 16;
/// Bytes of the volumes that a path is in, where volumes matter.
pub(super) const MEDIA_BYTES: u64 = 16;
/// Bytes of how far a path has come straight, where there are walls that let it.
pub(super) const STRAIGHT_BYTES: u64 = 4;
/// Bytes of the density with which light samples find what is outside the scene in a path's direction.
pub(super) const SKY_PDF_BYTES: u64 = 4;
