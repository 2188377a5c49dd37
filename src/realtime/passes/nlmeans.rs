//! `nlmeans`: non-local means of all samples of ambient visibility at rest, after `rest_noise`,
//! which says how well each pixel is known. Stills share its shaders ([`crate::denoise`]).

use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::records::denoise::{NLMEANS_BLOCK, NLMEANS_RADIANCE_BLOCK, NlMeansParams};
use crate::interface::records::radiance::RestNoiseParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::shaders::{self, ComputeShader};
use crate::tracer::Tracer;

/// Assumed convergence of samplers: the variance of n samples falls as `n^-(1 + EVENNESS)`. It is
/// within half of that for 64 samples of ambient occlusion in six scenes (docs/guide/denoising.md).
pub const EVENNESS: f32 = 0.33;

/// The shader for images of so many channels, 1 or 3.
pub fn shader(channels: u32) -> &'static ComputeShader {
    if channels == 1 { &shaders::NLMEANS } else { &shaders::NLMEANS_RADIANCE }
}

/// Number of the shader's invocations: each filters a square of pixels.
pub fn blocks(size: [u32; 2], channels: u32) -> u32 {
    let side = if channels == 1 { NLMEANS_BLOCK } else { NLMEANS_RADIANCE_BLOCK };
    size[0].div_ceil(side) * size[1].div_ceil(side)
}

/// The shader's parameters. `from`, `to`: addresses of the images that it reads and writes;
/// `depths`: of the pixels' depths, or 0.
pub fn params(size: [u32; 2], channels: u32, [from, to, depths]: [u64; 3]) -> NlMeansParams {
    // noise of radiance differs more from pixel to pixel
    let sameness = if channels == 1 { 1.0 } else { 2.0 };
    NlMeansParams { size, from, to, depths, sameness, reserved: 0.0 }
}

/// Channels of ambient visibility.
const CHANNELS: u32 = 1;

struct Noise {
    pipeline: ComputePipeline,
    params: Params<RestNoiseParams>,
}

struct NlMeans {
    pipeline: ComputePipeline,
    params: Params<NlMeansParams>,
}

/// The two passes, over all pixels and over all blocks of pixels.
pub fn stages(tracer: &Tracer, size: [u32; 2]) -> Result<[Stage; 2]> {
    let device = tracer.device();
    let noise = Noise {
        pipeline: shaders::REST_NOISE.pipeline(device)?,
        params: Params::new(device, "parameters of noise at rest")?,
    };
    let nlmeans = NlMeans {
        pipeline: shader(CHANNELS).pipeline(device)?,
        params: Params::new(device, "parameters of non-local means")?,
    };
    Ok([
        Stage::new(vec![Box::new(noise)], Range::all(size[0] * size[1])),
        Stage::new(vec![Box::new(nlmeans)], Range::all(blocks(size, CHANNELS))),
    ])
}

impl Pass for Noise {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(&[Resource::FrameNumber, Resource::Rest], &[Resource::RestNoise])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&RestNoiseParams {
            frame: frame.params,
            rest: resources.address(Resource::Rest),
            to: resources.address(Resource::RestNoise),
            evenness: EVENNESS,
            reserved: 0.0,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        if frame.plan.denoises {
            self.params.dispatch(r, "rest_noise", &self.pipeline, frame, range);
        }
        Ok(())
    }
}

impl Pass for NlMeans {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(&[Resource::FrameNumber, Resource::RestNoise], &[Resource::Denoised])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let [from, to] = [Resource::RestNoise, Resource::Denoised].map(|k| resources.address(k));
        self.params.write(&params(frame.block.size, CHANNELS, [from, to, 0]))
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        if frame.plan.denoises {
            self.params.dispatch(r, "nlmeans", &self.pipeline, frame, range);
        }
        Ok(())
    }
}
