//! Debug views: passes that write the displayed image themselves, compiled and run only for frames
//! that show them. Each is a file here and a variant of [`DisplayMode`] ([`super::debug_view`]).

use crate::error::Result;
use crate::film::block::{Block, BlockParams};
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::DisplayMode;
use crate::interface::records::passes::DebugParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders::ComputeShader;
use crate::tracer::Tracer;

/// A debug view. Its shader takes `DebugParams`.
pub struct DebugView {
    /// Resources of this frame that it reads: what it shows stays until one of them changes.
    pub reads: &'static [Resource],
    /// Resources of the previous frame that it reads.
    pub previous: &'static [Resource],
    /// It counts something in each pixel ([`Resource::DebugCounts`]).
    pub has_counts: bool,
    /// Value at the middle of its colour scale.
    pub middle: f32,
    /// The launches that go over all pixels.
    pub ranges: fn(Block) -> Vec<Range>,
    /// Checks that frames with these settings have it.
    pub check: fn(&Settings) -> Result<()>,
    /// Compiles its shader.
    pub pipeline: fn(&Tracer, &'static ComputeShader) -> Result<ComputePipeline>,
}

impl DebugView {
    /// A view of pixels in the order of rows, which frames of all settings have.
    pub const OF_PIXELS: Self = Self {
        reads: &[],
        previous: &[],
        has_counts: false,
        middle: 1.0,
        ranges: |block| Range::all(block.size[0] * block.size[1]),
        check: |_| Ok(()),
        pipeline: |tracer, shader| shader.pipeline(tracer.device()),
    };
}

struct DebugPass {
    mode: DisplayMode,
    view: &'static DebugView,
    pipeline: ComputePipeline,
    block: Params<BlockParams>,
    params: Params<DebugParams>,
}

/// The pass of a debug view over all pixels of the image.
///
/// # Errors
/// Those of compiling the shader, and what the view requires of the tracer.
pub fn stage(
    tracer: &Tracer,
    block: Block,
    mode: DisplayMode,
    view: &'static DebugView,
    shader: &'static ComputeShader,
) -> Result<Stage> {
    let device = tracer.device();
    let pass = DebugPass {
        mode,
        view,
        pipeline: (view.pipeline)(tracer, shader)?,
        block: Params::new(device, "camera of a debug view")?,
        params: Params::new(device, "parameters of a debug view")?,
    };
    Ok(Stage::new(vec![Box::new(pass)], (view.ranges)(block)))
}

impl Pass for DebugPass {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        ResourceUse::new(&[Resource::DisplaySettings], &[Resource::DisplayImage])
            .and_reads(self.view.reads)
            .previous(self.view.previous)
            .and_writes(self.view.has_counts, &[Resource::DebugCounts])
    }

    fn is_enabled(&self, display: Option<&Display>) -> bool {
        display.is_some_and(|d| d.shown == self.mode)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.block.write(&frame.block.params(frame.block.size, &frame.camera, frame.settings.seed))?;
        self.params.write(&DebugParams {
            frame: frame.params,
            block: self.block.address(),
            counts: if self.view.has_counts { resources.address(Resource::DebugCounts) } else { 0 },
            words: resources.address(Resource::DisplayImage),
            gain: frame.display.map_or(1.0, |d| d.exposure.exp2()),
            middle: self.view.middle,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, self.mode.name(), &self.pipeline, frame, range);
        Ok(())
    }
}
