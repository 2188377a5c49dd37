//! `rest`: adds samples of ambient visibility to those at rest; `paths` does so for radiance.

use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::records::radiance::RestParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders;
use crate::tracer::Tracer;

struct Rest {
    pipeline: ComputePipeline,
    params: Params<RestParams>,
}

/// The pass over all pixels.
pub fn stage(tracer: &Tracer, pixels: u32, settings: &Settings) -> Result<Stage> {
    let device = tracer.device();
    let pass = Rest {
        pipeline: shaders::REST.specialized(device, &settings.catcher_constants())?,
        params: Params::new(device, "parameters of samples at rest")?,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for Rest {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{Current, FrameNumber, Guide, Normals, Rest};
        ResourceUse::new(&[FrameNumber, Guide, Normals, Current], &[Rest])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&RestParams {
            frame: frame.params,
            current: resources.address(Resource::Current),
            rest: resources.address(Resource::Rest),
            starts: frame.plan.progress.starts_anew.into(),
            reserved: 0,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "rest", &self.pipeline, frame, range);
        Ok(())
    }
}
