//! A frame's occlusion rays, shared out by what each pixel knows: the pass `budget` and its memory.

use super::params::FrameParams;
use super::settings::Settings;
use crate::error::Result;
use crate::film::block::Block;
use crate::gpu::{Buffer, ComputePipeline, Memory, Recorder};
use crate::interface::BudgetStage;
use crate::interface::records::frame::{BUDGET_SHARE, SUMS_COUNT, SUMS_LISTED};
use crate::shaders::{self, LANES};
use crate::tracer::stream::LAUNCH_RAYS;
use crate::tracer::{Push, Tracer};

/// Rounds of the pass, each with the pixels that one lane works for.
const STAGES: [(&str, BudgetStage, u32); 4] = [
    ("budget wishes", BudgetStage::DesiredSamples, 1),
    ("budget sums", BudgetStage::Coarse, BUDGET_SHARE),
    ("budget sums", BudgetStage::Fine, BUDGET_SHARE),
    ("budget rays", BudgetStage::Rays, 1),
];
/// The pass and its memory.
pub(super) struct BudgetPass {
    pipeline: ComputePipeline,
    /// Pixels, those that fill tiles included.
    places: u32,
    most_rays: u32,
    plan: Buffer,
    list: Buffer,
    taken: Buffer,
    desired_samples: Buffer,
    sums: Buffer,
    samples: Buffer,
}

impl BudgetPass {
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings) -> Result<Self> {
        let device = tracer.device();
        let pixels = u64::from(size[0]) * u64::from(size[1]);
        let places = Block { origin: [0, 0], size }.rays();
        let most_rays = Settings::MAX_SHARE * settings.rays_per_pixel;
        let image = |name: &str, bytes: u64| Buffer::new(device, name, bytes * pixels, Memory::Device);
        Ok(Self {
            pipeline: shaders::BUDGET.pipeline(device)?,
            places,
            most_rays,
            plan: image("plan of rays", 8)?,
            list: image("list of rays", 4 * u64::from(most_rays))?,
            // sequences may begin anywhere
            taken: image("rays taken", 4)?,
            desired_samples: Buffer::new(device, "desired samples", 8 * u64::from(places), Memory::Device)?,
            sums: Buffer::new(device, "sums of desired samples", 4 * u64::from(SUMS_COUNT), Memory::Device)?,
            samples: image("samples", 4 * u64::from(most_rays))?,
        })
    }

    /// Its addresses, everything else as it is.
    pub fn params(&self, others: FrameParams) -> FrameParams {
        FrameParams {
            most_rays: self.most_rays,
            samples: self.samples.address(),
            plan: self.plan.address(),
            list: self.list.address(),
            taken: self.taken.address(),
            desired_samples: self.desired_samples.address(),
            budget_sums: self.sums.address(),
            ..others
        }
    }

    /// Before the occlusion rays.
    pub fn record(&self, r: &mut Recorder, push: Push) {
        r.clear(&self.sums);
        for (label, stage, share) in STAGES {
            let push = Push { first: 0, count: self.places, sample_index: stage as u32, ..push };
            r.barrier();
            r.timed(label, |r| r.dispatch(&self.pipeline, &push, self.places.div_ceil(LANES * share)));
        }
        r.barrier();
    }

    /// Launches of as many rays as there may be; how many there are, the device knows.
    pub fn launches(&self, pixels: u64, push: Push) -> Vec<Push> {
        let all = pixels as u32 * self.most_rays;
        let queued = self.sums.address() + 4 * u64::from(SUMS_LISTED);
        (0..all)
            .step_by(LAUNCH_RAYS as usize)
            .map(|first| Push { first, count: LAUNCH_RAYS.min(all - first), queued, ..push })
            .collect()
    }

    /// After the occlusion rays.
    pub fn record_gather(&self, r: &mut Recorder, gather: &ComputePipeline, push: Push) {
        let push = Push { first: 0, count: self.places, queued: 0, ..push };
        r.timed("gather", |r| r.dispatch(gather, &push, self.places.div_ceil(LANES)));
        r.barrier();
    }
}
