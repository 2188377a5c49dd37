//! The pipelines of a frame's passes, and how each is recorded.

use super::Realtime;
use super::images::Images;
use super::settings::{Filter, Settings, Technique};
use crate::error::Result;
use crate::gpu::{Buffer, ComputePipeline, Recorder, Specialization};
use crate::interface::constants;
use crate::raster::{CameraRays, Primary, View};
use crate::shaders::{self, LANES};
use crate::tracer::stream::LAUNCH_RAYS;
use crate::tracer::{Push, Stream, Tracer};

/// Those of one image size and of settings.
pub struct Passes {
    pub gbuffer: CameraRays,
    pub accessibility: Stream,
    pub gather: ComputePipeline,
    pub gtao: ComputePipeline,
    pub temporal: ComputePipeline,
    pub filter: ComputePipeline,
}

impl Passes {
    pub fn new(tracer: &Tracer, size: [u32; 2], settings: &Settings, primary: Primary) -> Result<Self> {
        let device = tracer.device();
        let [gbuffer, accessibility] = Realtime::streams(settings);
        let specialization = Specialization::default().set(constants::BENT_NORMALS, settings.bent);
        Ok(Self {
            gbuffer: CameraRays::new(tracer, gbuffer, primary, size)?,
            accessibility: tracer.stream(accessibility)?,
            gather: shaders::GATHER.specialized(device, &specialization)?,
            gtao: shaders::GTAO.pipeline(device)?,
            temporal: shaders::TEMPORAL.specialized(device, &specialization)?,
            filter: shaders::FILTER.specialized(device, &specialization)?,
        })
    }

    pub fn record_gbuffer(
        &self,
        r: &mut Recorder,
        tracer: &Tracer,
        images: &Images,
        guide: &Buffer,
        push: Push,
        view: &View,
    ) -> Result<()> {
        r.fill(guide, guide.size(), f32::INFINITY.to_bits());
        r.barrier();
        self.gbuffer.draw(r, tracer, view)?;
        let rays = view.block.rays();
        for first in (0..rays).step_by(LAUNCH_RAYS as usize) {
            let push = Push { first, count: LAUNCH_RAYS.min(rays - first), pass: images.block_params.address(), ..push };
            self.gbuffer.record(r, &push);
            r.barrier();
        }
        Ok(())
    }

    pub fn record_begin(&self, r: &mut Recorder, images: &Images, push: Push, pixels: u32, technique: Technique) {
        r.clear(&images.current);
        r.clear(&images.ray_count);
        r.barrier();
        if technique == Technique::Gtao {
            r.timed("gtao", |r| r.dispatch(&self.gtao, &Push { count: pixels, ..push }, pixels.div_ceil(LANES)));
            r.barrier();
        }
    }

    pub fn record_occlusion(&self, r: &mut Recorder, push: &Push, rays_per_pixel: u32, several: bool) {
        self.accessibility.record(r, push);
        r.barrier();
        if several {
            r.timed("gather", |r| r.dispatch(&self.gather, push, (push.count / rays_per_pixel).div_ceil(LANES)));
            r.barrier();
        }
    }

    /// `history`: the frame's.
    pub fn record_end(&self, r: &mut Recorder, images: &Images, push: Push, pixels: u32, history: &Buffer, filter: &Filter) {
        let (push, groups) = (Push { count: pixels, ..push }, pixels.div_ceil(LANES));
        r.timed("temporal", |r| r.dispatch(&self.temporal, &push, groups));
        let steps = filter.steps();
        let (mut from, mut bent_from) = (history.address(), 0);
        for (k, step) in steps.iter().enumerate() {
            // bent normals are named by their place in the parameters
            let (to, bent_to) = match &images.between {
                Some(between) if k + 1 < steps.len() => (between[k % 2].address(), 1 + k as u32 % 2),
                _ => (0, 3),
            };
            let sides = u32::from(step.sides[0]) | u32::from(step.sides[1]) << 1;
            let push = Push {
                rays: from,
                queued: to,
                sample_index: sides | step.stride << 2,
                sample_bits: step.radius,
                first: bent_from | bent_to << 2,
                ..push
            };
            r.barrier();
            r.timed("filter", |r| r.dispatch(&self.filter, &push, groups));
            (from, bent_from) = (to, bent_to);
        }
    }
}
