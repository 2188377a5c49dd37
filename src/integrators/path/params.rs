//! Parameters of the path tracer's shaders, [`PathParams`], and sizes of the state of each path.

use crate::interface::records::path::PathRecord;
pub(super) use crate::interface::records::path::{EnvironmentRecord, PathFrameParams, PathParams};
pub(super) use crate::interface::records::ray::INVALID;

/// The parameters of a launch, behind those of its block.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct LaunchParams {
    pub path: PathParams,
    /// Parameters that frames in real time add; zero in stills.
    pub of_frame: PathFrameParams,
}

/// Bytes of the state of a path between two bounces.
pub(super) const STATE_BYTES: u64 = size_of::<PathRecord>() as u64;
/// Bytes of a path's ray cone.
pub(super) const CONE_BYTES: u64 = 8;
/// Bytes of four floats.
pub(super) const QUAD_BYTES: u64 = 16;
/// Bytes of the stack of volumes that a path is in.
pub(super) const MEDIA_BYTES: u64 = 16;
/// Bytes of the distance that a path has passed straight through thin walls.
pub(super) const STRAIGHT_BYTES: u64 = 4;
/// Bytes of the probability density of light sampling for the environment in a path's direction.
pub(super) const SKY_PDF_BYTES: u64 = 4;
/// Bytes of the share of placed lights in the light samples of a path's last bounce.
pub(super) const SHARE_BYTES: u64 = 4;
