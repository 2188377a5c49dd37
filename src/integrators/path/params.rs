//! What the path tracer's shaders get; mirrors shaders/path/params.glsl.

use bytemuck::{Pod, Zeroable};

use crate::tracer::queue::QueueRecord;

/// Bytes of a path between two bounces.
pub(super) const STATE_BYTES: u64 = 32;
/// Bytes of a path's cone, where it has one.
pub(super) const CONE_BYTES: u64 = 8;
/// Bytes of four numbers.
pub(super) const QUAD_BYTES: u64 = 16;
/// Bytes of the volumes that a path is in, where volumes matter.
pub(super) const MEDIA_BYTES: u64 = 16;
/// Bytes of how far a path has come straight, where there are walls that let it.
pub(super) const STRAIGHT_BYTES: u64 = 4;
/// Bytes of the density with which light samples draw a path's direction, where they draw from an environment of one colour.
pub(super) const ENVIRONMENT_PDF_BYTES: u64 = 4;
/// Names no light, and no volume.
pub(super) const INVALID: u32 = u32::MAX;

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct MapRecord {
    pub texels: u64,
    pub table: u64,
    pub width: u32,
    pub height: u32,
    pub reserved: [u32; 2],
    pub to_map: [[f32; 4]; 3],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(super) struct PathParams {
    pub map: MapRecord,
    pub environment: [f32; 3],
    pub light_count: u32,
    pub lights: u64,
    pub light_of: u64,
    pub states: u64,
    pub next_states: u64,
    pub radiance: u64,
    pub contributions: u64,
    pub tags: u64,
    pub next: QueueRecord,
    pub shadow: QueueRecord,
    pub max_depth: u32,
    pub rr_depth: u32,
    pub clamp_to: f32,
    pub albedo: f32,
    pub environment_light: u32,
    pub pixel_filter: u32,
    pub lens_radius: f32,
    pub focus: f32,
    pub view: u32,
    pub light_first: u32,
    pub light_tree: u64,
    pub cones: u64,
    pub light_starts: u64,
    pub first_disk: u32,
    pub disk_count: u32,
    pub media: u64,
    pub straight: u64,
    pub camera_media: [u32; 4],
    pub later: QueueRecord,
    pub later_contributions: u64,
    pub environment_pdfs: u64,
}
