//! `ao_trace`: occlusion rays of the pixels that are sampled in this frame.

use crate::error::Result;
use crate::gpu::Recorder;
use crate::interface::records::frame::SUMS_LISTED;
use crate::interface::records::passes::AoTraceParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::{Budget, Settings};
use crate::shaders::{self, StreamShaders};
use crate::tracer::{Push, Stream, Tracer};

/// The pass.
pub struct AoTrace {
    stream: Stream,
    params: Params<AoTraceParams>,
    /// Pixels have several samples, which `gather` averages.
    has_several: bool,
    has_budget: bool,
    has_bent: bool,
}

/// The stream that it traces: without a falloff any hit ends a ray.
pub fn stream(settings: &Settings) -> &'static StreamShaders {
    if settings.attenuation().is_binary() { &shaders::AO_TRACE_ANY } else { &shaders::AO_TRACE_CLOSEST }
}

/// Parameters that distribute a frame's rays over pixels, shared by `ao_trace` and `gather`.
pub fn params(frame: &Frame, resources: &Resources) -> AoTraceParams {
    AoTraceParams {
        frame: frame.params,
        samples: resources.address(Resource::Samples),
        current: resources.address(Resource::Current),
        current_bent: resources.address(Resource::CurrentBent),
        plan: resources.address(Resource::Plan),
        list: resources.address(Resource::RayPixels),
        ray_count: resources.address(Resource::RayCount),
        most_rays: frame.settings.most_rays(),
        reserved: 0,
    }
}

/// Resources that it reads.
pub const READS: &[Resource] = &[
    Resource::FrameNumber,
    Resource::Scene,
    Resource::Guide,
    Resource::Surface,
    Resource::Normals,
    Resource::Axes,
    Resource::Plan,
    Resource::RayPixels,
    Resource::Sums,
];

impl AoTrace {
    /// Compiles the pass.
    pub fn new(tracer: &Tracer, settings: &Settings) -> Result<Self> {
        let has_budget = settings.budget == Budget::Variance;
        Ok(Self {
            stream: tracer.stream(stream(settings))?,
            params: Params::new(tracer.device(), "parameters of occlusion rays")?,
            has_several: settings.rays_per_pixel > 1 || has_budget,
            has_budget,
            has_bent: settings.bent,
        })
    }
}

impl Pass for AoTrace {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        let uses = ResourceUse::new(READS, &[Resource::RayCount])
            .previous(&[Resource::History])
            .and_writes(self.has_several, &[Resource::Samples])
            .and_writes(!self.has_several, &[Resource::Current])
            .and_writes(!self.has_several && self.has_bent, &[Resource::CurrentBent])
            .clears(Resource::RayCount, 0);
        if self.has_several { uses } else { uses.clears(Resource::Current, 0) }
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&params(frame, resources))
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, resources: &Resources, range: Range) -> Result<()> {
        // with a variance budget only the device knows the number of rays
        let listed = || resources.address(Resource::Sums) + 4 * u64::from(SUMS_LISTED);
        let queued = if self.has_budget { listed() } else { 0 };
        self.stream.record(r, &Push { queued, ..self.params.push(frame, range) });
        Ok(())
    }
}
