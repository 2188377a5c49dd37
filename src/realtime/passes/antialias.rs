//! `antialias`: the mean over frames whose samples lie at different places within the pixels, and at rest what the image converges to.

use crate::error::Result;
use crate::gpu::{ComputePipeline, Recorder};
use crate::interface::records::radiance::AntialiasParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, ResourceUse, Stage};
use crate::realtime::resources::{Resource, Resources};
use crate::shaders;
use crate::tracer::Tracer;

/// Maximum number of frames that ambient visibility is averaged over in motion.
const MAX_FRAMES: f32 = 8.0;
/// The same of radiance, which has reflections that move otherwise than their surfaces.
const RADIANCE_FRAMES: f32 = 4.0;
/// The same after lights or materials have changed.
const NEW_LIGHT_FRAMES: f32 = 2.0;
/// Minimum weight of a frame of radiance at rest: each is of all samples since then, and differs from the one before by the edges that its filter sees.
const LEAST_WEIGHT: f32 = 0.25;
/// Half width of the clamp of the history in motion, in standard deviations of the pixels around.
const CLAMP_WIDTH: f32 = 1.25;

struct Antialias {
    pipeline: ComputePipeline,
    params: Params<AntialiasParams>,
    /// `Composed`, or `Result` of ambient visibility.
    input: Resource,
    has_rest: bool,
}

/// The pass over all pixels. `input`: [`Resource::Composed`] or [`Resource::Result`].
pub fn stage(tracer: &Tracer, pixels: u32, input: Resource, has_rest: bool) -> Result<Stage> {
    let device = tracer.device();
    let pass = Antialias {
        pipeline: shaders::ANTIALIAS.pipeline(device)?,
        params: Params::new(device, "parameters of antialiasing")?,
        input,
        has_rest,
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

/// Number of samples as which the image of the last frame in motion counts at rest.
const IN_MOTION: f32 = 8.0;

/// Minimum weight of a frame of radiance at rest, which is the filtered mean of all samples so far: those before it are of a part r of its samples. By the third power of that part they
/// soften what the filter does at edges and hide its specks, and the mean has nearly the noise of all samples: by the square 1.07 times that after four long frames, by higher powers less, and more
/// specks. Where samples are many there are none, and frames that add a constant part would leave sqrt(2p / (2p - 1)) times their noise: 1.095 by the third power, 1.02 by the twelfth, 1.01 by the twenty-fourth.
fn least_weight(frame: &Frame) -> f32 {
    let after = frame.rest_samples as f32;
    if !frame.is_long || after <= 0.0 {
        return LEAST_WEIGHT;
    }
    let before = (after - frame.samples as f32).max(0.0);
    let power = (after / 16.0).clamp(3.0, 24.0);
    let in_motion = if frame.was_in_motion { IN_MOTION } else { 0.0 };
    (1.0 - ((before + in_motion) / (after + in_motion)).powf(power)).max(LEAST_WEIGHT)
}

impl Pass for Antialias {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{Denoised, FrameNumber, Guide, PreviousPosition, Resolved, ResolvedHistory, Rest, Surface};
        let rest: &[Resource] = if self.has_rest { &[Rest, Denoised] } else { &[] };
        ResourceUse::new(&[FrameNumber, Guide, Surface, PreviousPosition, self.input], &[ResolvedHistory, Resolved])
            .previous(&[ResolvedHistory])
            .and_reads(rest)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        let input = resources.address(self.input);
        let is_composed = self.input == Resource::Composed;
        self.params.write(&AntialiasParams {
            frame: frame.params,
            composed: if is_composed { input } else { 0 },
            visibility: if is_composed { 0 } else { input },
            history: resources.address(Resource::ResolvedHistory),
            previous_history: resources.previous_address(Resource::ResolvedHistory),
            rest: resources.address(Resource::Rest),
            denoised: if frame.has_denoised { resources.address(Resource::Denoised) } else { 0 },
            resolved: resources.address(Resource::Resolved),
            has_history: frame.has_resolved.into(),
            most_frames: match frame.settings.antialias {
                true if frame.has_new_light() => NEW_LIGHT_FRAMES,
                true if is_composed => RADIANCE_FRAMES,
                true => MAX_FRAMES,
                false => 1.0,
            },
            clamp_width: CLAMP_WIDTH,
            holds: (!is_composed && frame.is_long).into(),
            reserved: 0,
            least_weight: if is_composed && self.has_rest { least_weight(frame) } else { 0.0 },
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "antialias", &self.pipeline, frame, range);
        Ok(())
    }
}
