//! `rest_samples`: several samples of each pixel in a long frame at rest, by the passes of stills,
//! `primary` and `occlusion`, which take less time than the passes of frames in motion.

use crate::error::Result;
use crate::film::block::{Block, BlockParams, PassParams};
use crate::gpu::{ComputePipeline, Recorder};
use crate::integrators::ao::AoRays;
use crate::interface::PixelFilter;
use crate::interface::records::ao::AoParams;
use crate::interface::records::radiance::RestSamplesParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::shaders::{self, LANES};
use crate::tracer::Push;

/// Added to the seed, so that frames at rest do not share samples with a still, their reference.
const SEED: u32 = 0x7265_7374;

/// The pipelines and their memory, made when the first long frame comes.
struct Traced {
    rays: AoRays,
    has_entry_points: bool,
    block: PassParams<AoParams>,
    resolve: ComputePipeline,
    params: Params<RestSamplesParams>,
}

struct RestSamples {
    traced: Option<Traced>,
    sample_bits: u32,
    /// Maximum rays of a launch.
    most: u32,
}

/// The pass over all pixels. `spp`: samples of each in a frame, a power of two.
pub fn stage(block: Block, spp: u32, launch_rays: u32) -> Stage {
    let ranges = Range::launches(block.rays() * spp, spp, launch_rays);
    let most = ranges.iter().map(|r| r.count).max().unwrap_or(0);
    let pass = RestSamples { traced: None, sample_bits: spp.ilog2(), most };
    Stage::new(vec![Box::new(pass)], ranges).in_long_frames()
}

impl Traced {
    fn new(frame: &Frame, most: u32, sample_bits: u32) -> Result<Self> {
        let device = frame.tracer.device();
        Ok(Self {
            rays: AoRays::new(frame.tracer, frame.settings.occlusion, most, sample_bits, 0, frame.settings.catcher)?,
            has_entry_points: false,
            block: PassParams::new(device, "block parameters of samples at rest")?,
            resolve: shaders::REST_SAMPLES.specialized(device, &frame.settings.catcher_constants())?,
            params: Params::new(device, "parameters of samples at rest")?,
        })
    }
}

impl Pass for RestSamples {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{Camera, FrameNumber, Guide, History, Normals, RayCount, Rest, Scene, Surface};
        ResourceUse::new(&[FrameNumber, Camera, Scene, Guide, Surface, Normals], &[Rest, History, RayCount])
            .previous(&[History])
            .clears(RayCount, 0)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let traced = match &mut self.traced {
            Some(traced) => traced,
            None => self.traced.insert(Traced::new(frame, self.most, self.sample_bits)?),
        };
        let (settings, camera) = (frame.settings, &frame.camera);
        let block = BlockParams {
            pixel_filter: if settings.antialias { PixelFilter::Box } else { PixelFilter::Centre } as u32,
            ..frame.block.params(frame.block.size, camera, settings.seed.wrapping_add(SEED))
        };
        traced.has_entry_points = traced.rays.has_entry_points(camera);
        traced.block.write(&block, &traced.rays.params(settings.occlusion.record(), camera))?;
        traced.params.write(&RestSamplesParams {
            frame: frame.params,
            samples: traced.rays.samples(),
            rest: resources.address(Resource::Rest),
            history: resources.address(Resource::History),
            ray_count: resources.address(Resource::RayCount),
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        let Some(traced) = &self.traced else { return Ok(()) };
        let sampled = Push {
            sample_index: frame.plan.placement.first_sample,
            sample_bits: self.sample_bits,
            ..frame.push(traced.block.address(), range)
        };
        // the range before reads the samples
        r.barrier();
        traced.rays.record(r, &sampled, traced.has_entry_points);
        r.barrier();
        let push = Push { pass: traced.params.address(), ..sampled };
        let groups = (range.count >> self.sample_bits).div_ceil(LANES);
        r.timed("rest_samples", |r| r.dispatch(&traced.resolve, &push, groups));
        Ok(())
    }
}
