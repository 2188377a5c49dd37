//! Device memory of a frame's passes: a record a pixel each, and parameters.

use super::bent::Bent;
use super::params::{FrameParams, MAX_MOVED, MovedRecord};
use super::settings::Settings;
use crate::error::Result;
use crate::film::block::BlockParams;
use crate::gpu::{Buffer, Memory};
use crate::integrators::ao::Hemisphere;
use crate::interface::records::frame::SurfaceRecord;
use crate::tracer::Tracer;
use crate::tracer::stream::LAUNCH_RAYS;

/// Bytes of a pixel's surface.
pub const SURFACE_BYTES: u64 = size_of::<SurfaceRecord>() as u64;
/// Bytes of where it was.
pub const POSITION_BYTES: u64 = 12;

/// Those of one image size.
pub struct Images {
    pub block_params: Buffer,
    pub frame_params: Buffer,
    pub moved: Buffer,
    pub surface: Buffer,
    pub axes: Option<Buffer>,
    pub guides: [Buffer; 2],
    pub histories: [Buffer; 2],
    pub current: Buffer,
    /// Between the steps of a filter of several.
    pub between: Option<[Buffer; 2]>,
    pub samples: Option<Buffer>,
    pub previous_position: Option<Buffer>,
    pub bent: Option<Bent>,
    pub result: Buffer,
    /// Number of occlusion rays.
    pub ray_count: Buffer,
}

impl Images {
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings) -> Result<Self> {
        let device = tracer.device();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let image = |name: &str, bytes: u64| Buffer::new(device, name, bytes * pixels, Memory::Device);
        let maybe = |wanted: bool, name: &str, bytes: u64| if wanted { image(name, bytes).map(Some) } else { Ok(None) };
        let upload = |name: &str, bytes: usize| Buffer::new(device, name, bytes as u64, Memory::Upload);
        Ok(Self {
            block_params: upload("block parameters", size_of::<BlockParams>())?,
            frame_params: upload("frame parameters", size_of::<FrameParams>())?,
            moved: upload("what moved", MAX_MOVED * size_of::<MovedRecord>())?,
            surface: image("surfaces", SURFACE_BYTES)?,
            axes: maybe(settings.hemisphere == Hemisphere::Shading, "axes of hemispheres", 12)?,
            guides: [image("guide", 8)?, image("guide", 8)?],
            histories: [image("history", 8)?, image("history", 8)?],
            current: image("samples of the frame", 8)?,
            between: match settings.filter.steps().len() {
                0 | 1 => None,
                _ => Some([image("filtered estimates", 8)?, image("filtered estimates", 8)?]),
            },
            samples: match settings.rays_per_pixel > 1 {
                true => Some(Buffer::new(device, "samples", 4 * u64::from(LAUNCH_RAYS), Memory::Device)?),
                false => None,
            },
            previous_position: maybe(tracer.is_dynamic(), "previous positions", POSITION_BYTES)?,
            bent: settings.bent.then(|| Bent::new(device, pixels, settings.filter.steps().len())).transpose()?,
            result: Buffer::new(device, "accessibility", 4 * pixels, Memory::Readback)?,
            ray_count: Buffer::new(device, "number of rays", 4, Memory::Readback)?,
        })
    }
}
