//! `filter`: averages over neighbours on the same surface, and turns estimates into the result.

use std::sync::Arc;

use crate::error::Result;
use crate::film::block::Block;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::constants;
use crate::interface::records::passes::{FILTER_STRIP, FilterParams};
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::{FilterStep, Settings};
use crate::shaders;
use crate::tracer::Tracer;

/// One step of the filter.
struct Filter {
    pipeline: Arc<ComputePipeline>,
    params: Params<FilterParams>,
    step: FilterStep,
    /// Input estimates and bent normals.
    from: [Resource; 2],
    to: Option<[Resource; 2]>,
    has_bent: bool,
}

/// The steps of the filter over the tiles of the image.
pub fn stages(tracer: &Tracer, block: Block, settings: &Settings) -> Result<Vec<Stage>> {
    let device = tracer.device();
    let specialization = settings.filter.specialization().set(constants::BENT_NORMALS, settings.bent);
    let pipeline = Arc::new(shaders::FILTER.specialized(device, &specialization)?);
    let steps = settings.filter.steps();
    // steps alternate between two images
    let after = |k: usize| [Resource::Filtered(k % 2), Resource::FilteredBent(k % 2)];
    let stage = |(k, step): (usize, &FilterStep)| {
        let pass = Filter {
            pipeline: pipeline.clone(),
            params: Params::new(device, "parameters of the filter")?,
            step: *step,
            from: if k == 0 { [Resource::History, Resource::BentHistory] } else { after(k - 1) },
            to: (k + 1 < steps.len()).then(|| after(k)),
            has_bent: settings.bent,
        };
        Ok(Stage::new(vec![Box::new(pass)], Range::all(block.rays())))
    };
    steps.iter().enumerate().map(stage).collect()
}

impl Filter {
    /// Resources written: estimates or the result, and bent normals.
    fn targets(&self) -> [Resource; 2] {
        self.to.unwrap_or([Resource::Result, Resource::BentResult])
    }
}

impl Pass for Filter {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        let [values, bent] = self.targets();
        ResourceUse::new(&[Resource::Camera, Resource::Guide, Resource::Normals], &[values])
            .and_reads(&self.from)
            .and_writes(self.has_bent, &[bent])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let s = frame.settings;
        let [bent_from, bent_to] = [self.from[1], self.targets()[1]].map(|b| resources.address(b));
        self.params.write(&FilterParams {
            frame: frame.params,
            from: resources.address(self.from[0]),
            to: self.to.map_or(0, |to| resources.address(to[0])),
            result: resources.address(Resource::Result),
            bent_from,
            bent_to,
            samples: s.filter.samples,
            evenness: if s.occlusion.is_binary() { 0.0 } else { s.sequence.evenness() },
            ..self.step.params()
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch_strips(r, "filter", &self.pipeline, frame, range, FILTER_STRIP);
        Ok(())
    }
}
