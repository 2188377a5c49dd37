//! `temporal`: adds this frame's samples to the reprojected history of the same surface.

use crate::error::Result;
use crate::gpu::{Buffer, ComputePipeline, Memory, Recorder, Specialization};
use crate::interface::constants;
use crate::interface::records::passes::TemporalParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::params::{MAX_MOVED, MovedRecord};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders;
use crate::tracer::Tracer;

struct Temporal {
    pipeline: ComputePipeline,
    params: Params<TemporalParams>,
    moved: Buffer,
    has_bent: bool,
}

/// The pass over all pixels.
pub fn stage(tracer: &Tracer, pixels: u32, settings: &Settings) -> Result<Stage> {
    let device = tracer.device();
    let specialization = Specialization::default().set(constants::BENT_NORMALS, settings.bent);
    let moved_bytes = (MAX_MOVED * size_of::<MovedRecord>()) as u64;
    let pass = Temporal {
        pipeline: shaders::TEMPORAL.specialized(device, &specialization)?,
        params: Params::new(device, "parameters of temporal accumulation")?,
        moved: Buffer::new(device, "moved objects", moved_bytes, Memory::Upload)?,
        has_bent: settings.bent,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for Temporal {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{
            BentHistory, Current, CurrentBent, FrameNumber, Guide, History, Normals, PreviousPosition, Scene, Surface,
        };
        ResourceUse::new(
            &[FrameNumber, Scene, Guide, Surface, Normals, PreviousPosition, Current, CurrentBent],
            &[History],
        )
        .previous(&[Guide, History, BentHistory])
        .and_writes(self.has_bent, &[BentHistory])
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.moved.write(0, bytemuck::cast_slice(frame.moved))?;
        self.params.write(&TemporalParams {
            frame: frame.params,
            current: resources.address(Resource::Current),
            history: resources.address(Resource::History),
            current_bent: resources.address(Resource::CurrentBent),
            bent_history: resources.address(Resource::BentHistory),
            previous_bent_history: resources.previous_address(Resource::BentHistory),
            moved: self.moved.address(),
            moved_count: frame.moved.len() as u32,
            moved_weight: frame.settings.moved_weight,
            clamp_width: frame.settings.clamp,
            reserved: 0.0,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "temporal", &self.pipeline, frame, range);
        Ok(())
    }
}
