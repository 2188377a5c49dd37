//! `gather`: mean and variance of a pixel's samples in this frame, if it may have several.

use super::ao_trace;
use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder, Specialization};
use crate::interface::constants;
use crate::interface::records::passes::AoTraceParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders::{self, LANES};
use crate::tracer::Tracer;

/// The pass.
pub struct Gather {
    pipeline: ComputePipeline,
    params: Params<AoTraceParams>,
    /// Rays per pixel in the range.
    rays_per_pixel: u32,
    has_bent: bool,
}

impl Gather {
    /// Compiles the pass.
    pub fn new(tracer: &Tracer, settings: &Settings) -> Result<Self> {
        let specialization = Specialization::default().set(constants::BENT_NORMALS, settings.bent);
        Ok(Self {
            pipeline: shaders::GATHER.specialized(tracer.device(), &specialization)?,
            params: Params::new(tracer.device(), "parameters of gathering")?,
            rays_per_pixel: settings.rays_per_pixel,
            has_bent: settings.bent,
        })
    }
}

impl Pass for Gather {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(ao_trace::READS, &[Resource::Current])
            .and_reads(&[Resource::Samples])
            .previous(&[Resource::History])
            .and_writes(self.has_bent, &[Resource::CurrentBent])
            .clears(Resource::Current, 0)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&ao_trace::params(frame, resources))
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        let push = self.params.push(frame, range);
        let groups = (range.count / self.rays_per_pixel).div_ceil(LANES);
        r.timed("gather", |r| r.dispatch(&self.pipeline, &push, groups));
        Ok(())
    }
}
