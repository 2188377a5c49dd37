//! `radiance_temporal`: adds samples of diffuse reflection and the rest to reprojected histories.

use crate::error::Result;
use crate::gpu::{Buffer, ComputePipeline, Memory, Recorder};
use crate::interface::records::radiance::RadianceTemporalParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::params::{MAX_MOVED, MovedRecord};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::shaders;
use crate::tracer::Tracer;

/// Half width of history clamping, in standard deviations, relative to the settings' `clamp`.
const CLAMP_SCALE: f32 = 0.5;

struct RadianceTemporal {
    pipeline: ComputePipeline,
    params: Params<RadianceTemporalParams>,
    moved: Buffer,
    has_rest: bool,
}

/// The pass over all pixels.
pub fn stage(tracer: &Tracer, pixels: u32, has_rest: bool) -> Result<Stage> {
    let device = tracer.device();
    let moved_bytes = (MAX_MOVED * size_of::<MovedRecord>()) as u64;
    let pass = RadianceTemporal {
        pipeline: shaders::RADIANCE_TEMPORAL.pipeline(device)?,
        params: Params::new(device, "parameters of temporal accumulation")?,
        moved: Buffer::new(device, "moved objects", moved_bytes, Memory::Upload)?,
        has_rest,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

impl Pass for RadianceTemporal {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{
            CurrentDiffuse, CurrentSpecular, DiffuseHistory, FrameNumber, Guide, Materials, Normals, PreviousPosition,
            ReflectedDistance, Scene, SpecularHistory, Surface,
        };
        let reads = [
            FrameNumber,
            Scene,
            Guide,
            Surface,
            Normals,
            Materials,
            PreviousPosition,
            CurrentDiffuse,
            CurrentSpecular,
            ReflectedDistance,
        ];
        let histories = [DiffuseHistory, SpecularHistory];
        ResourceUse::new(&reads, &histories).previous(&[Guide]).previous(&histories).and_reads(if self.has_rest {
            &[Resource::Rest, Resource::RestParts]
        } else {
            &[]
        })
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.moved.write(0, bytemuck::cast_slice(frame.moved))?;
        let [now, before] = [Resources::address, Resources::previous_address];
        self.params.write(&RadianceTemporalParams {
            frame: frame.params,
            diffuse: now(resources, Resource::CurrentDiffuse),
            specular: now(resources, Resource::CurrentSpecular),
            previous_diffuse: before(resources, Resource::DiffuseHistory),
            previous_specular: before(resources, Resource::SpecularHistory),
            diffuse_history: now(resources, Resource::DiffuseHistory),
            specular_history: now(resources, Resource::SpecularHistory),
            distances: now(resources, Resource::ReflectedDistance),
            materials: now(resources, Resource::Materials),
            rest: now(resources, Resource::Rest),
            rest_parts: now(resources, Resource::RestParts),
            moved: self.moved.address(),
            moved_count: frame.moved.len() as u32,
            moved_weight: frame.settings.moved_weight,
            clamp_width: CLAMP_SCALE * frame.settings.clamp,
            most_past: frame.plan.most_past,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "temporal", &self.pipeline, frame, range);
        Ok(())
    }
}
