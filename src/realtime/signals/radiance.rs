//! Radiance, by path tracing.

use std::sync::Arc;

use super::{Pipeline, pixels};
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::block::{Block, TILE_PIXELS};
use crate::film::camera::CameraRecord;
use crate::integrators::path::PathOptions;
use crate::integrators::path::signal::SignalPaths;
use crate::interface::DisplayMode;
use crate::raster::Primary;
use crate::realtime::frame_samples::FrameSamples;
use crate::realtime::graph::Stage;
use crate::realtime::history::{History, PathSequence};
use crate::realtime::passes::paths::MAX_SAMPLES;
use crate::realtime::passes::uncovered::{self, Uncovered};
use crate::realtime::passes::{antialias, compose, paths, radiance_filter, radiance_temporal, surfaces};
use crate::realtime::plan::{FramePlan, Inputs, RestProgress, SamplePlacement, Signal};
use crate::realtime::resources::{Extent, Resource};
use crate::realtime::settings::Settings;
use crate::scene::material::MaterialKind;
use crate::tracer::Tracer;
use crate::tracer::stream::with_uncovered;

/// Paths at rest begin at a multiple of this: 2^k samples of a sequence fill the square evenly only
/// where the first one's index is a multiple of 2^k.
const REST_BLOCK: u32 = 1 << 12;

/// Radiance.
pub struct Radiance;

impl Radiance {
    /// Compiles the pipeline for images of `size` pixels. The tracer must have been built from
    /// `flat` with [`crate::tracer::Needs::shading`].
    ///
    /// # Errors
    /// [`crate::error::Error::OutOfMemory`], and those of compiling shaders.
    pub fn pipeline(
        tracer: &Tracer,
        flat: &FlatScene,
        size: [u32; 2],
        settings: &Settings,
        options: &PathOptions,
    ) -> Result<Pipeline> {
        let block = Block { origin: [0, 0], size };
        let pixels = pixels(size);
        let frame_samples = FrameSamples::for_radiance(settings, pixels, tracer.device().info.is_cpu());
        let sampled = Block { size: settings.resolution.sampled_size(block.size), ..block };
        let paths = SignalPaths::new(tracer, flat, options, most_paths(sampled, settings, frame_samples))?;
        let primary_reason = if paths.can_begin_at_known() {
            "paths begin with a camera ray; in motion at what those of the G-buffer hit, which are traced once"
        } else {
            "paths begin with a camera ray"
        };
        let is_matte = || flat.scene.materials.iter().all(|m| m.kind == MaterialKind::Matte);
        let has_specular = options.white_sky.is_none() && !is_matte();
        let half_pixels = pixels.div_ceil(4);
        let extent = Extent { pixels, half_pixels, ..Extent::default() };
        Ok(Pipeline {
            signal: &Self,
            settings: Settings {
                primary: Some(Primary::Traced),
                rest_samples: settings.rest_samples.max(Settings::RADIANCE_REST_SAMPLES),
                ..*settings
            },
            frame_samples,
            extent,
            stages: stages(tracer, flat, paths, [block, sampled], settings, [has_specular, options.catcher.is_some()])?,
            primary_reason: primary_reason.into(),
        })
    }
}

/// Returns the maximum number of paths of a launch, for frames that sample `sampled`.
fn most_paths(sampled: Block, settings: &Settings, samples: FrameSamples) -> u32 {
    let most = with_uncovered(settings.launch_rays.max(MAX_SAMPLES * TILE_PIXELS));
    let spp = samples.most().min(MAX_SAMPLES).next_power_of_two();
    let few = settings.rays_per_pixel.min(MAX_SAMPLES);
    let of_uncovered = uncovered::most_paths(sampled.rays(), few);
    let in_motion = sampled.rays().saturating_mul(few.next_power_of_two()).saturating_add(of_uncovered);
    sampled.rays().saturating_mul(spp).max(in_motion).min(most)
}

/// Compiles the stages of a frame, in order. `sampled`: the pixels that are sampled in a frame.
fn stages(
    tracer: &Tracer,
    flat: &FlatScene,
    paths: SignalPaths,
    [block, sampled]: [Block; 2],
    settings: &Settings,
    [has_specular, has_catcher]: [bool; 2],
) -> Result<Vec<Stage>> {
    let pixels = block.size[0] * block.size[1];
    let has_rest = settings.converges();
    let uncovered = || Uncovered::new(tracer.device(), sampled).map(Arc::new);
    let uncovered = (settings.history > 1).then(uncovered).transpose()?;
    let mut stages = vec![
        surfaces::stage(tracer, flat, &paths, block, uncovered.clone(), settings.launch_rays)?,
        paths::stage(tracer, paths, sampled, uncovered, settings, has_rest)?,
        radiance_temporal::stage(tracer, pixels, has_rest)?,
    ];
    let (filters, filtered) = radiance_filter::stages(tracer, block, settings, has_specular)?;
    stages.extend(filters);
    stages.push(compose::stage(tracer, pixels, filtered, has_rest, has_catcher)?);
    stages.push(antialias::stage(tracer, pixels, Resource::Composed, settings)?);
    Ok(stages)
}

impl Signal for Radiance {
    fn channels(&self) -> usize {
        3
    }

    fn frame_samples(&self, settings: &Settings, pixels: u64, is_cpu: bool) -> FrameSamples {
        FrameSamples::for_radiance(settings, pixels, is_cpu)
    }

    fn check_display(&self, mode: DisplayMode, settings: &Settings) -> Result<()> {
        mode.check(settings)?;
        mode.check_radiance()
    }

    fn depends_on_light(&self) -> bool {
        true
    }

    fn frames_to_rest(&self, settings: &Settings, samples: &FrameSamples) -> Option<u32> {
        if settings.converges() {
            // the frame before those at rest counts besides
            Some(samples.frames_for(settings.rest_samples) * self.rest_period(settings) + 1)
        } else {
            settings.frames_to_rest()
        }
    }

    fn rest_period(&self, settings: &Settings) -> u32 {
        // frames of a pattern have samples of the same indices
        settings.resolution.period()
    }

    fn begins_at_rest(&self, samples: &FrameSamples) -> bool {
        samples.starts_anew(1)
    }

    fn may_be_cut(&self, _before: &CameraRecord, _now: &CameraRecord, _settings: &Settings) -> bool {
        // paths wait for the host after the surfaces anyway
        true
    }

    fn place_samples(&self, history: &History, inputs: &Inputs, progress: &RestProgress) -> SamplePlacement {
        let RestProgress { is_still, only_light_is_new, is_long, samples, starts_anew, .. } = *progress;
        // one path a frame: offsets of frames are more even than the first points of a sequence
        let spreads = inputs.settings.converges()
            && inputs.settings.antialias
            && samples > 1
            && (is_long || !starts_anew || !history.has_resolved || only_light_is_new);
        let paths = align_paths(history, inputs, progress);
        SamplePlacement {
            spreads,
            // what is known of surfaces is of the last frame whose samples lay at one place
            keeps_offset: spreads && (is_still || only_light_is_new),
            first_sample: paths.first,
            paths,
        }
    }

    fn camera_rays(&self, plan: &FramePlan, _settings: &Settings, pixels: u64, has_known_hits: bool) -> u64 {
        // of each sample, unless they are those of the G-buffer
        let has_own = plan.placement.spreads || !has_known_hits;
        let of_paths = if has_own { u64::from(plan.progress.samples) } else { 0 };
        pixels * (of_paths + u64::from(plan.has_new_view))
    }
}

/// Has paths at rest begin with a block of the sequence.
fn align_paths(history: &History, inputs: &Inputs, progress: &RestProgress) -> PathSequence {
    let (samples, resting) = (&inputs.frame_samples, progress.motion.frames_at_rest());
    let mut paths = history.paths;
    let taken = paths.first % REST_BLOCK;
    let begins_pattern = history.frame.is_multiple_of(inputs.settings.resolution.period());
    if progress.starts_anew {
        paths.in_block = taken == 0 && begins_pattern;
    }
    // in motion frames take a sequence from its beginning; all of a pattern take the same paths
    if resting > 0 && begins_pattern && !paths.in_block {
        // a camera that has stood still from the first frame has the paths of a still
        let is_forgotten = samples.has_forgotten_short(resting) && taken <= samples.in_short();
        let block = if is_forgotten { 0 } else { REST_BLOCK };
        paths.first = (paths.first - taken).wrapping_add(block);
        paths.in_block = true;
    }
    paths
}
