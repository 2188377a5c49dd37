//! `gtao`: ambient occlusion from the depth image alone.

use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::records::passes::GtaoParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::shaders;
use crate::tracer::Tracer;

struct Gtao {
    pipeline: ComputePipeline,
    params: Params<GtaoParams>,
}

/// The pass over all pixels.
pub fn stage(tracer: &Tracer, pixels: u32) -> Result<Stage> {
    let device = tracer.device();
    let pass = Gtao { pipeline: shaders::GTAO.pipeline(device)?, params: Params::new(device, "parameters of GTAO")? };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for Gtao {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(
            &[Resource::FrameNumber, Resource::Camera, Resource::Guide, Resource::Normals],
            &[Resource::Current],
        )
        .clears(Resource::Current, 0)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let [slices, steps] = frame.settings.gtao;
        let constants = frame.settings.gtao_constants;
        self.params.write(&GtaoParams {
            frame: frame.params,
            current: resources.address(Resource::Current),
            slices,
            steps,
            radius_scale: constants.radius_scale,
            fade: constants.fade,
            step_exponent: constants.step_exponent,
            thinness: constants.thinness,
            visibility_exponent: constants.visibility_exponent,
            reserved: 0,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "gtao", &self.pipeline, frame, range);
        Ok(())
    }
}
