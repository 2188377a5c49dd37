//! The passes of a frame, one file each: the resources that a pass reads and writes, its parameters, and how it is recorded.

mod antialias;
mod ao_trace;
mod compose;
pub mod debug;
pub mod display;
mod filter;
mod gather;
mod gbuffer;
mod gtao;
mod larsen;
pub mod nlmeans;
pub mod nodes;
mod paths;
mod radiance_filter;
mod radiance_temporal;
pub mod rejected;
mod rest;
mod rest_samples;
mod surfaces;
mod temporal;
mod uncovered;

use std::sync::Arc;

use super::frame_samples::FrameSamples;
use super::graph::{Range, Stage};
use super::resources::Resource;
use super::settings::{Settings, Technique};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::block::{Block, TILE_PIXELS};
use crate::integrators::path::PathOptions;
use crate::integrators::path::signal::SignalPaths;
use crate::interface::DisplayMode;
use crate::raster::Primary;
use crate::scene::material::MaterialKind;
use crate::shaders::{self, ComputeShader, StreamShaders};
use crate::tracer::Tracer;
use crate::tracer::stream::with_uncovered;
use debug::DebugView;
use paths::MAX_SAMPLES;
use uncovered::Uncovered;

/// The debug view that a display mode selects, and its shader; `None` for buffers.
pub fn debug_view(mode: DisplayMode) -> Option<(&'static DebugView, &'static ComputeShader)> {
    match mode {
        DisplayMode::Nodes => Some((&nodes::VIEW, &shaders::NODES)),
        DisplayMode::Rejected => Some((&rejected::VIEW, &shaders::REJECTED)),
        DisplayMode::Result
        | DisplayMode::Unfiltered
        | DisplayMode::Samples
        | DisplayMode::Variance
        | DisplayMode::Depth
        | DisplayMode::Rays
        | DisplayMode::Normal
        | DisplayMode::Position
        | DisplayMode::Bent
        | DisplayMode::Ids
        | DisplayMode::Motion => None,
    }
}

/// The streams that frames with these settings trace.
pub fn streams(settings: &Settings) -> [&'static StreamShaders; 2] {
    [gbuffer::STREAM, ao_trace::stream(settings)]
}

/// The stages of a frame, in order. `lights`: positions of point lights relative to the scene's origin.
pub fn stages(
    tracer: &Tracer,
    block: Block,
    settings: &Settings,
    primary: Primary,
    lights: &[[f32; 3]],
    samples: FrameSamples,
) -> Result<Vec<Stage>> {
    let pixels = block.size[0] * block.size[1];
    let mut stages = vec![gbuffer::stage(tracer, block, settings, primary)?];
    match settings.technique {
        Technique::Larsen => {
            stages.extend(larsen::stages(tracer, block.size, settings, lights)?);
            return Ok(stages);
        }
        Technique::Gtao => stages.push(gtao::stage(tracer, pixels)?),
        Technique::Traced => {
            let n = settings.rays_per_pixel;
            let mut stage: Vec<Box<dyn super::graph::Pass>> = vec![Box::new(ao_trace::AoTrace::new(tracer, settings)?)];
            if n > 1 {
                stage.push(Box::new(gather::Gather::new(tracer, settings)?));
            }
            stages.push(Stage::new(stage, Range::launches(block.rays() * n, n, settings.launch_rays)));
        }
    }
    stages.push(temporal::stage(tracer, pixels, settings)?);
    stages.extend(filter::stages(tracer, block, settings)?);
    let has_rest = settings.converges();
    if has_rest {
        stages.push(rest::stage(tracer, pixels)?);
        if samples.has_long() {
            stages = stages.into_iter().map(Stage::of_short_frames).collect();
            stages.push(rest_samples::stage(block, samples.most(), settings.launch_rays));
        }
        stages.extend(nlmeans::stages(tracer, block.size)?);
    }
    if has_rest || settings.antialias {
        stages.push(antialias::stage(tracer, pixels, Resource::Result, has_rest)?);
    }
    Ok(stages)
}

/// The stages of a frame of radiance, in order. The tracer must have been built from `flat` with [`crate::tracer::Needs::shading`].
pub fn radiance_stages(
    tracer: &Tracer,
    flat: &FlatScene,
    block: Block,
    settings: &Settings,
    options: &PathOptions,
    samples: FrameSamples,
) -> Result<Vec<Stage>> {
    let pixels = block.size[0] * block.size[1];
    let most = with_uncovered(settings.launch_rays.max(MAX_SAMPLES * TILE_PIXELS));
    let sampled = Block { size: settings.resolution.sampled_size(block.size), ..block };
    let spp = samples.most().min(MAX_SAMPLES).next_power_of_two();
    let few = settings.rays_per_pixel.min(MAX_SAMPLES);
    let in_motion =
        sampled.rays().saturating_mul(few.next_power_of_two()).saturating_add(uncovered::most_paths(sampled.rays(), few));
    let paths = sampled.rays().saturating_mul(spp).max(in_motion).min(most);
    let paths = SignalPaths::new(tracer, flat, options, paths)?;
    let has_rest = settings.converges();
    let uncovered = match settings.history > 1 {
        true => Some(Arc::new(Uncovered::new(tracer.device(), sampled)?)),
        false => None,
    };
    let mut stages = vec![
        surfaces::stage(tracer, flat.scene, &paths, block, uncovered.clone(), settings.launch_rays)?,
        paths::stage(tracer, paths, sampled, uncovered, settings, has_rest)?,
        radiance_temporal::stage(tracer, pixels, has_rest)?,
    ];
    let is_diffuse = options.white_sky.is_some() || flat.scene.materials.iter().all(|m| m.kind == MaterialKind::Matte);
    let (filters, filtered) = radiance_filter::stages(tracer, block, settings, !is_diffuse)?;
    stages.extend(filters);
    stages.push(compose::stage(tracer, pixels, filtered, has_rest)?);
    stages.push(antialias::stage(tracer, pixels, Resource::Composed, has_rest)?);
    Ok(stages)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view shows what its name says: its file, its shader and its mode are called the same.
    #[test]
    fn debug_views_have_shaders_of_their_names() {
        let views = DisplayMode::ALL.into_iter().filter_map(|mode| Some((mode, debug_view(mode)?.1)));
        let names: Vec<_> = views.map(|(mode, shader)| (mode.name(), shader.name)).collect();
        assert_eq!(names, [("nodes", "nodes"), ("rejected", "rejected")]);
    }
}
