//! The passes of a frame, one file each: the resources that a pass reads and writes, its parameters, and how it is recorded.

mod ao_trace;
mod budget;
pub mod display;
mod filter;
mod gather;
mod gbuffer;
mod gtao;
mod larsen;
pub mod nodes;
mod temporal;

use super::graph::{Range, Stage};
use super::settings::{Budget, Settings, Technique};
use crate::error::Result;
use crate::film::block::Block;
use crate::raster::Primary;
use crate::shaders::StreamShaders;
use crate::tracer::Tracer;

/// The streams that frames with these settings trace.
pub fn streams(settings: &Settings) -> [&'static StreamShaders; 2] {
    [gbuffer::STREAM, ao_trace::stream(settings)]
}

/// The stages of a frame, in order. `lights`: positions of point lights relative to the scene's origin.
pub fn stages(tracer: &Tracer, block: Block, settings: &Settings, primary: Primary, lights: &[[f32; 3]]) -> Result<Vec<Stage>> {
    let pixels = block.size[0] * block.size[1];
    let mut stages = vec![gbuffer::stage(tracer, block, settings, primary)?];
    match (settings.technique, settings.budget) {
        (Technique::Larsen, _) => {
            stages.extend(larsen::stages(tracer, block.size, settings, lights)?);
            return Ok(stages);
        }
        (Technique::Gtao, _) => stages.push(gtao::stage(tracer, pixels)?),
        (Technique::Traced, Budget::Variance) => {
            stages.extend(budget::stages(tracer, block.rays(), settings)?);
            stages.push(Stage::new(
                vec![Box::new(ao_trace::AoTrace::new(tracer, settings)?)],
                Range::launches(pixels * settings.most_rays(), 1, settings.launch_rays),
            ));
            stages.push(Stage::new(vec![Box::new(gather::Gather::new(tracer, settings)?)], Range::all(block.rays())));
        }
        (Technique::Traced, Budget::Uniform) => {
            let n = settings.rays_per_pixel;
            let mut stage: Vec<Box<dyn super::graph::Pass>> = vec![Box::new(ao_trace::AoTrace::new(tracer, settings)?)];
            if n > 1 {
                stage.push(Box::new(gather::Gather::new(tracer, settings)?));
            }
            stages.push(Stage::new(stage, Range::launches(block.rays() * n, n, settings.launch_rays)));
        }
    }
    stages.push(temporal::stage(tracer, pixels, settings)?);
    stages.extend(filter::stages(tracer, pixels, settings)?);
    Ok(stages)
}
