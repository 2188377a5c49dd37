//! `ao_trace`: occlusion rays of the pixels that are sampled in this frame.

use crate::error::Result;
use crate::gpu::Recorder;
use crate::interface::records::passes::AoTraceParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders::{self, StreamShaders};
use crate::tracer::{Stream, Tracer};

/// The pass.
pub struct AoTrace {
    stream: Stream,
    params: Params<AoTraceParams>,
    /// Pixels have several samples, which `gather` averages.
    has_several: bool,
    has_bent: bool,
}

/// The stream that it traces: without a falloff any hit ends a ray.
pub fn stream(settings: &Settings) -> &'static StreamShaders {
    if settings.occlusion.is_binary() { &shaders::AO_TRACE_ANY } else { &shaders::AO_TRACE_CLOSEST }
}

/// Parameters of the rays of a frame, shared by `ao_trace` and `gather`.
pub fn params(frame: &Frame, resources: &Resources) -> AoTraceParams {
    AoTraceParams {
        frame: frame.params,
        samples: resources.address(Resource::Samples),
        current: resources.address(Resource::Current),
        current_bent: resources.address(Resource::CurrentBent),
        ray_count: resources.address(Resource::RayCount),
    }
}

/// Resources that it reads.
pub const READS: &[Resource] =
    &[Resource::FrameNumber, Resource::Scene, Resource::Guide, Resource::Surface, Resource::Normals, Resource::Axes];

impl AoTrace {
    /// Compiles the pass.
    pub fn new(tracer: &Tracer, settings: &Settings) -> Result<Self> {
        Ok(Self {
            stream: tracer.stream(stream(settings))?,
            params: Params::new(tracer.device(), "parameters of occlusion rays")?,
            has_several: settings.rays_per_pixel > 1,
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

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.stream.record(r, &self.params.push(frame, range));
        Ok(())
    }
}
