//! `nodes`: a heat map of the BVH nodes that camera rays visit with the compute tracer. It is compiled and run only for frames that display it; it has
//! its own traversal kernel, and no other pass reads its output.

use crate::error::Result;
use crate::film::block::{Block, BlockParams};
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::DisplayMode;
use crate::interface::records::passes::NodesParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, ResourceUse, Stage};
use crate::realtime::resources::{Resource, Resources};
use crate::shaders;
use crate::tracer::Tracer;
use crate::tracer::stream::LAUNCH_RAYS;

/// Number of nodes at the middle of the colour scale.
const MIDDLE: f32 = 16.0;

/// BVH nodes that the camera rays of a frame visit, one ray through the centre of each pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct NodeVisits {
    /// Mean over all pixels of the image.
    pub mean: f64,
    /// Maximum over all pixels.
    pub max: u32,
}

struct Nodes {
    pipeline: ComputePipeline,
    block: Params<BlockParams>,
    params: Params<NodesParams>,
}

/// The pass over all pixels of the image.
///
/// # Errors
/// [`crate::Error::Usage`] for tracers that cannot count ([`Tracer::counting_kernel`]), and those of compiling the shader.
pub fn stage(tracer: &Tracer, block: Block) -> Result<Stage> {
    let device = tracer.device();
    let pass = Nodes {
        pipeline: tracer.counting_kernel(&shaders::NODES, "--show nodes")?,
        block: Params::new(device, "camera of visited nodes")?,
        params: Params::new(device, "parameters of visited nodes")?,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::launches(block.rays(), 1, LAUNCH_RAYS)))
}

impl NodeVisits {
    /// Reads the counts of the last frame that displayed them, for `pixels` pixels.
    pub fn read(resources: &Resources, pixels: u64) -> Result<Self> {
        let nodes: Vec<u32> = resources.read(Resource::Nodes, pixels)?;
        let sum: u64 = nodes.iter().map(|&n| u64::from(n)).sum();
        Ok(Self { mean: sum as f64 / nodes.len().max(1) as f64, max: nodes.iter().copied().max().unwrap_or(0) })
    }
}

impl Pass for Nodes {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{Camera, DisplayImage, DisplaySettings, Nodes, Scene};
        ResourceUse::new(&[Camera, Scene, DisplaySettings], &[Nodes, DisplayImage])
    }

    fn is_enabled(&self, display: Option<&Display>) -> bool {
        display.is_some_and(|d| d.shown == DisplayMode::Nodes)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        self.block.write(&frame.block.params(frame.block.size, &frame.camera, frame.settings.seed))?;
        self.params.write(&NodesParams {
            block: self.block.address(),
            nodes: resources.address(Resource::Nodes),
            words: resources.address(Resource::DisplayImage),
            gain: frame.display.map_or(1.0, |d| d.exposure.exp2()),
            middle: MIDDLE,
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "nodes", &self.pipeline, frame, range);
        Ok(())
    }
}
