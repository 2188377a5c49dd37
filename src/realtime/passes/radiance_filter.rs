//! `radiance_filter`: averages diffuse reflection, and the rest, over neighbours (shader
//! `denoise`).

use std::sync::Arc;

use crate::error::Result;
use crate::film::block::Block;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::records::passes::{FILTER_STRIP, FilterParams};
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::{FilterStep, Settings};
use crate::shaders;
use crate::tracer::Tracer;

/// Minimum pixels of the box at rest, however many samples: they tell detail from noise.
const MIN_PIXELS: f32 = 9.0;

/// One step of the filter of one part.
struct RadianceFilter {
    pipeline: Arc<ComputePipeline>,
    params: Params<FilterParams>,
    step: FilterStep,
    from: Resource,
    to: Resource,
}

/// The steps of the filter over the tiles of the image, and the images that hold the results:
/// diffuse reflection and the rest, which is black without `has_specular` and left alone.
pub fn stages(
    tracer: &Tracer,
    block: Block,
    settings: &Settings,
    has_specular: bool,
) -> Result<(Vec<Stage>, [Resource; 2])> {
    let device = tracer.device();
    let pipeline = Arc::new(shaders::DENOISE.specialized(device, &settings.filter.specialization())?);
    let steps = settings.filter.steps();
    let mut stages = Vec::new();
    let mut filtered = [Resource::DiffuseHistory, Resource::SpecularHistory];
    for (part, from) in filtered.iter_mut().enumerate().take(if has_specular { 2 } else { 1 }) {
        for (k, step) in steps.iter().enumerate() {
            let to = Resource::FilteredRadiance(2 * part + k % 2);
            let params = Params::new(device, "parameters of the filter")?;
            let pass = RadianceFilter { pipeline: pipeline.clone(), params, step: *step, from: *from, to };
            stages.push(Stage::new(vec![Box::new(pass)], Range::all(block.rays())));
            *from = to;
        }
    }
    Ok((stages, filtered))
}

impl Pass for RadianceFilter {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(&[Resource::Camera, Resource::Guide, Resource::Normals, self.from], &[self.to])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&FilterParams {
            frame: frame.params,
            from: resources.address(self.from),
            to: resources.address(self.to),
            samples: frame.settings.filter.samples.max(MIN_PIXELS * frame.plan.progress.rest_samples as f32),
            ..self.step.params()
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch_strips(r, "filter", &self.pipeline, frame, range, FILTER_STRIP);
        Ok(())
    }
}
