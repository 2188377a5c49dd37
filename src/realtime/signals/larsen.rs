//! The image of Larsen (2019): its passes average images, and leave no histories of pixels.

use super::visibility::{check_rays, choose_primary, extent};
use super::{Pipeline, pixels};
use crate::error::Result;
use crate::film::block::Block;
use crate::film::camera::CameraRecord;
use crate::realtime::frame_samples::FrameSamples;
use crate::realtime::passes::{gbuffer, larsen};
use crate::realtime::plan::Signal;
use crate::realtime::settings::Settings;
use crate::tracer::Tracer;

/// Ambient visibility by the pipeline of Larsen (2019).
pub struct Larsen;

impl Larsen {
    /// Compiles the pipeline for images of `size` pixels. `lights`: positions of point lights
    /// relative to the scene's origin.
    ///
    /// # Errors
    /// Those of [`super::visibility::AmbientVisibility::pipeline`].
    pub fn pipeline(tracer: &Tracer, size: [u32; 2], settings: &Settings, lights: &[[f32; 3]]) -> Result<Pipeline> {
        let block = Block { origin: [0, 0], size };
        check_rays(block, settings)?;
        let (primary, primary_reason) = choose_primary(tracer, settings, size);
        let mut stages = vec![gbuffer::stage(tracer, block, settings, primary)?];
        stages.extend(larsen::stages(tracer, size, settings, lights)?);
        Ok(Pipeline {
            signal: &Self,
            settings: Settings { primary: Some(primary), ..*settings },
            frame_samples: FrameSamples::for_visibility(settings, pixels(size)),
            extent: extent(tracer, block),
            stages,
            primary_reason,
        })
    }
}

impl Signal for Larsen {
    fn has_pixel_histories(&self) -> bool {
        false
    }

    fn keeps_history(&self, _settings: &Settings) -> bool {
        true
    }

    fn may_be_cut(&self, _before: &CameraRecord, _now: &CameraRecord, _settings: &Settings) -> bool {
        false
    }
}
