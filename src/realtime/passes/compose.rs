//! `compose`: the radiance of each pixel, of the filtered parts and of what is seen directly.

use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder, Specialization};
use crate::interface::constants;
use crate::interface::records::radiance::ComposeParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::shaders;
use crate::tracer::Tracer;

struct Compose {
    pipeline: ComputePipeline,
    params: Params<ComposeParams>,
    /// Diffuse reflection and the rest.
    parts: [Resource; 2],
    has_rest: bool,
}

/// The pass over all pixels. `parts`: images of diffuse reflection and of the rest. `has_catcher`:
/// paths may meet a ground that catches shadows.
pub fn stage(tracer: &Tracer, pixels: u32, parts: [Resource; 2], has_rest: bool, has_catcher: bool) -> Result<Stage> {
    let device = tracer.device();
    let constants = Specialization::default().set(constants::HAS_CATCHER, has_catcher);
    let pass = Compose {
        pipeline: shaders::COMPOSE.specialized(device, &constants)?,
        params: Params::new(device, "parameters of composition")?,
        parts,
        has_rest,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for Compose {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(&[Resource::Guide, Resource::Materials, Resource::Direct], &[Resource::Composed])
            .and_reads(&self.parts)
            .and_reads(if self.has_rest { &[Resource::Rest, Resource::RestParts] } else { &[] })
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let [diffuse, specular] = self.parts.map(|r| resources.address(r));
        self.params.write(&ComposeParams {
            frame: frame.params,
            diffuse,
            specular,
            materials: resources.address(Resource::Materials),
            direct: resources.address(Resource::Direct),
            rest: resources.address(Resource::Rest),
            rest_parts: resources.address(Resource::RestParts),
            composed: resources.address(Resource::Composed),
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "compose", &self.pipeline, frame, range);
        Ok(())
    }
}
