//! `gbuffer`: the surface at each pixel's centre, by camera rays; skipped if nothing moves.

use crate::error::Result;
use crate::film::block::{Block, BlockParams, PassParams};
use crate::gpu::Recorder;
use crate::interface::records::gbuffer::GbufferParams;
use crate::interface::records::ray::INVALID;
use crate::raster::{CameraRays, Primary, View};
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders::{self, StreamShaders};
use crate::tracer::Tracer;

/// The stream that it traces.
pub const STREAM: &StreamShaders = &shaders::GBUFFER_CLOSEST;

struct Gbuffer {
    rays: CameraRays,
    params: PassParams<GbufferParams>,
    has_axes: bool,
    is_dynamic: bool,
}

/// The pass over all pixels of an image.
pub fn stage(tracer: &Tracer, block: Block, settings: &Settings, primary: Primary) -> Result<Stage> {
    let pass = Gbuffer {
        rays: CameraRays::new(tracer, STREAM, primary, block.size)?,
        params: PassParams::new(tracer.device(), "G-buffer parameters")?,
        has_axes: settings.occlusion.is_about_shading_normals(),
        is_dynamic: tracer.is_dynamic(),
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::launches(block.rays(), 1, settings.launch_rays)))
}

impl Pass for Gbuffer {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(&[Resource::Camera, Resource::Scene], &[Resource::Guide, Resource::Surface, Resource::Normals])
            .and_writes(self.has_axes, &[Resource::Axes])
            .and_writes(self.is_dynamic, &[Resource::PreviousPosition])
            .clears(Resource::Guide, f32::INFINITY.to_bits())
    }

    fn prepare(&mut self, frame: &Frame, _: &Resources) -> Result<()> {
        let block = BlockParams {
            centre_offset: frame.plan.offset,
            ..frame.block.params(frame.block.size, &frame.camera, frame.settings.seed)
        };
        let own = GbufferParams {
            frame: frame.params,
            hemisphere: self.has_axes.into(),
            catcher: frame.settings.catcher.unwrap_or(INVALID),
        };
        self.params.write(&block, &own)
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        if range.first == 0 {
            let view = View {
                camera: frame.camera,
                image_size: frame.block.size,
                block: frame.block,
                at: frame.plan.offset.map(|x| 0.5 + x),
            };
            self.rays.draw(r, frame.tracer, &view)?;
        }
        self.rays.record(r, &frame.push(self.params.address(), range));
        Ok(())
    }
}
