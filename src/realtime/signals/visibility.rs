//! Ambient visibility, ray traced or in screen space.

use super::{Pipeline, pixels};
use crate::error::{Error, Result};
use crate::film::block::Block;
use crate::raster::Primary;
use crate::realtime::frame_samples::FrameSamples;
use crate::realtime::graph::{Pass, Range, Stage};
use crate::realtime::history::History;
use crate::realtime::passes::{
    antialias, ao_trace, filter, gather, gbuffer, gtao, nlmeans, rest, rest_samples, temporal,
};
use crate::realtime::plan::{FramePlan, Inputs, RestProgress, SamplePlacement, Signal};
use crate::realtime::resources::{Extent, Resource};
use crate::realtime::settings::{Settings, Technique};
use crate::shaders::StreamShaders;
use crate::tracer::Tracer;
use crate::tracer::stream::launch_rays;

/// Ambient visibility.
pub struct AmbientVisibility;

impl AmbientVisibility {
    /// Returns the streams that its frames trace with these settings.
    pub fn streams(settings: &Settings) -> [&'static StreamShaders; 2] {
        [gbuffer::STREAM, ao_trace::stream(settings)]
    }

    /// Compiles the pipeline for images of `size` pixels.
    ///
    /// # Errors
    /// [`Error::Usage`] for too many rays, [`Error::OutOfMemory`], and those of compiling shaders.
    pub fn pipeline(tracer: &Tracer, size: [u32; 2], settings: &Settings) -> Result<Pipeline> {
        let block = Block { origin: [0, 0], size };
        check_rays(block, settings)?;
        let (primary, primary_reason) = choose_primary(tracer, settings, size);
        let frame_samples = FrameSamples::for_visibility(settings, pixels(size));
        Ok(Pipeline {
            signal: &Self,
            settings: Settings { primary: Some(primary), ..*settings },
            frame_samples,
            extent: extent(tracer, block),
            stages: stages(tracer, block, settings, primary, frame_samples)?,
            primary_reason,
        })
    }
}

/// Checks that the rays of a frame can be counted.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_rays(block: Block, settings: &Settings) -> Result<()> {
    let rays = u64::from(block.rays()) * u64::from(settings.rays_per_pixel);
    if rays > u64::from(u32::MAX) {
        return Err(Error::Usage(format!(
            "{} rays per pixel of {}x{}: a frame has 2^32 rays at most; use fewer, or a smaller image",
            settings.rays_per_pixel, block.size[0], block.size[1]
        )));
    }
    Ok(())
}

/// Chooses whether camera rays are traced or rasterized, and says why.
pub fn choose_primary(tracer: &Tracer, settings: &Settings, size: [u32; 2]) -> (Primary, String) {
    match settings.primary {
        Some(primary) => (primary, "requested".to_owned()),
        None => Primary::auto(tracer, pixels(size)),
    }
}

/// Returns the quantities from which the sizes of resources follow.
pub fn extent(tracer: &Tracer, block: Block) -> Extent {
    Extent {
        pixels: pixels(block.size),
        half_pixels: pixels(block.size.map(|n| n.div_ceil(2))),
        launch_rays: launch_rays(&tracer.device().info).into(),
    }
}

/// Compiles the stages of a frame, in order.
fn stages(
    tracer: &Tracer,
    block: Block,
    settings: &Settings,
    primary: Primary,
    frame_samples: FrameSamples,
) -> Result<Vec<Stage>> {
    let pixels = block.size[0] * block.size[1];
    let mut stages = vec![gbuffer::stage(tracer, block, settings, primary)?];

    // samples of the frame
    if settings.technique == Technique::Gtao {
        stages.push(gtao::stage(tracer, pixels)?);
    } else {
        let n = settings.rays_per_pixel;
        let mut stage: Vec<Box<dyn Pass>> = vec![Box::new(ao_trace::AoTrace::new(tracer, settings)?)];
        if n > 1 {
            stage.push(Box::new(gather::Gather::new(tracer, settings)?));
        }
        stages.push(Stage::new(stage, Range::launches(block.rays() * n, n, settings.launch_rays)));
    }

    // histories and their filter
    stages.push(temporal::stage(tracer, pixels, settings)?);
    stages.extend(filter::stages(tracer, block, settings)?);

    // samples at rest, for which long frames do without all stages so far
    let has_rest = settings.converges();
    if has_rest {
        stages.push(rest::stage(tracer, pixels, settings)?);
        if frame_samples.has_long() {
            stages = stages.into_iter().map(Stage::in_short_frames).collect();
            stages.push(rest_samples::stage(block, frame_samples.most(), settings.launch_rays));
        }
        stages.extend(nlmeans::stages(tracer, block.size)?);
    }
    if has_rest || settings.antialias || settings.catcher.is_some() {
        stages.push(antialias::stage(tracer, pixels, Resource::Result, settings)?);
    }
    Ok(stages)
}

impl Signal for AmbientVisibility {
    fn denoises_at_rest(&self) -> bool {
        true
    }

    fn place_samples(&self, history: &History, inputs: &Inputs, progress: &RestProgress) -> SamplePlacement {
        let RestProgress { motion, is_still, is_long, .. } = *progress;
        SamplePlacement {
            spreads: false,
            // long frames have rays of their own, anywhere in the pixels
            keeps_offset: is_still && is_long,
            first_sample: if is_long { inputs.frame_samples.in_long_before(motion.frames_at_rest()) } else { 0 },
            paths: history.paths,
        }
    }

    fn period(&self, plan: &FramePlan, settings: &Settings) -> u32 {
        // long frames sample all pixels
        if plan.progress.is_long { 1 } else { settings.resolution.period() }
    }
}
