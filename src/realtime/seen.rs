//! How much of an image the one before it shows.

use super::graph::Params;
use crate::error::Result;
use crate::gpu::{Buffer, Commands, ComputePipeline, Memory};
use crate::interface::records::passes::SeenParams;
use crate::shaders::{self, LANES};
use crate::tracer::{Push, Tracer};

/// Counts surfaces of an image, and those of them that the last frame of a pipeline shows.
pub struct SeenSurfaces {
    pipeline: ComputePipeline,
    params: Params<SeenParams>,
    counts: Buffer,
    commands: Commands,
}

impl SeenSurfaces {
    /// Compiles the pass.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(tracer: &Tracer) -> Result<Self> {
        let device = tracer.device();
        Ok(Self {
            pipeline: shaders::SEEN.pipeline(device)?,
            params: Params::new(device, "parameters of surfaces seen")?,
            counts: Buffer::new(device, "surfaces seen", 8, Memory::Readback)?,
            commands: Commands::new(device)?,
        })
    }

    /// Share of the surfaces in one of `stride` pixels of an image that the frame before shows; 1
    /// where there are none. `frame`: address of `FrameParams` whose G-buffer is that of the image.
    ///
    /// # Errors
    /// Those of the device.
    pub fn share(&mut self, frame: u64, pixels: u32, stride: u32) -> Result<f64> {
        self.params.write(&SeenParams { frame, counts: self.counts.address(), stride, reserved: 0 })?;
        let push = Push { pass: self.params.address(), count: pixels.div_ceil(stride), ..Default::default() };
        self.commands.run(|r| {
            r.fill(&self.counts, 8, 0);
            r.barrier();
            r.dispatch(&self.pipeline, &push, push.count.div_ceil(LANES));
        })?;
        let [surfaces, seen]: [u32; 2] = bytemuck::pod_read_unaligned(&self.counts.read(0, 8)?);
        // an empty view has nothing to lack
        Ok(if surfaces == 0 { 1.0 } else { f64::from(seen) / f64::from(surfaces) })
    }
}
