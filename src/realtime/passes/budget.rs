//! `budget`: distributes a frame's occlusion rays over pixels by their standard errors, in four
//! stages.

use std::sync::Arc;

use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::BudgetStage;
use crate::interface::records::frame::BUDGET_SHARE;
use crate::interface::records::passes::BudgetParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders::{self, LANES};
use crate::tracer::Tracer;

/// One stage of the pass.
struct Budget {
    pipeline: Arc<ComputePipeline>,
    params: Params<BudgetParams>,
    label: &'static str,
    stage: BudgetStage,
    /// Number of pixels per invocation.
    share: u32,
}

/// The stages of the pass over all pixels, including those that fill up tiles.
pub fn stages(tracer: &Tracer, tiled_pixels: u32, _: &Settings) -> Result<Vec<Stage>> {
    let device = tracer.device();
    let pipeline = Arc::new(shaders::BUDGET.pipeline(device)?);
    let stage = |(label, stage, share)| {
        let params = Params::new(device, "parameters of the budget")?;
        let pass = Budget { pipeline: pipeline.clone(), params, label, stage, share };
        Ok(Stage::new(vec![Box::new(pass)], Range::all(tiled_pixels)))
    };
    let rounds = [
        ("budget desired", BudgetStage::DesiredSamples, 1),
        ("budget sums", BudgetStage::Coarse, BUDGET_SHARE),
        ("budget sums", BudgetStage::Fine, BUDGET_SHARE),
        ("budget rays", BudgetStage::Rays, 1),
    ];
    rounds.into_iter().map(stage).collect()
}

impl Pass for Budget {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{
            DesiredSamples, FrameNumber, Guide, History, Normals, Plan, PreviousPosition, RayPixels, Sums, Surface, TotalRays,
        };
        match self.stage {
            BudgetStage::DesiredSamples => {
                ResourceUse::new(&[FrameNumber, Guide, Surface, Normals, PreviousPosition], &[DesiredSamples])
                    .previous(&[Guide, History])
            }
            BudgetStage::Coarse => ResourceUse::new(&[FrameNumber, DesiredSamples], &[Sums]).clears(Sums, 0),
            BudgetStage::Fine => ResourceUse::new(&[FrameNumber, DesiredSamples], &[Sums]),
            BudgetStage::Rays => ResourceUse::new(&[FrameNumber, DesiredSamples], &[Sums, Plan, RayPixels, TotalRays]),
        }
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.params.write(&BudgetParams {
            frame: frame.params,
            desired_samples: resources.address(Resource::DesiredSamples),
            sums: resources.address(Resource::Sums),
            plan: resources.address(Resource::Plan),
            list: resources.address(Resource::RayPixels),
            taken: resources.address(Resource::TotalRays),
            stage: self.stage as u32,
            most_rays: frame.settings.most_rays(),
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        let push = self.params.push(frame, range);
        r.timed(self.label, |r| r.dispatch(&self.pipeline, &push, range.count.div_ceil(LANES * self.share)));
        Ok(())
    }
}
