//! `antialias`: the mean over frames of moving sample positions; at rest the converging image.

use crate::error::Result;
use crate::gpu::{Buffer, ComputePipeline, Memory, Recorder};
use crate::interface::records::radiance::AntialiasParams;
use crate::realtime::display::Display;
use crate::realtime::graph::{Frame, Params, Pass, Range, Stage};
use crate::realtime::params::{MAX_MOVED, MovedRecord};
use crate::realtime::resources::{Resource, ResourceUse, Resources};
use crate::realtime::settings::Settings;
use crate::shaders;
use crate::tracer::Tracer;

/// Maximum number of frames that ambient visibility is averaged over in motion.
const MAX_FRAMES: f32 = 8.0;
/// The same of radiance, which has reflections that move otherwise than their surfaces.
const RADIANCE_FRAMES: f32 = 4.0;
/// The same of both in pixels in which nothing moves: their history is not interpolated.
const STILL_FRAMES: f32 = 16.0;
/// The same after lights or materials have changed.
const NEW_LIGHT_FRAMES: f32 = 2.0;
/// Minimum weight of a frame of radiance at rest, which differs in its filter's edges.
const MIN_WEIGHT: f32 = 0.25;
/// Half width of the clamp of the history in motion, in standard deviations of the pixels around.
const CLAMP_WIDTH: f32 = 1.25;

struct Antialias {
    pipeline: ComputePipeline,
    params: Params<AntialiasParams>,
    moved: Buffer,
    /// `Composed`, or `Result` of ambient visibility.
    input: Resource,
    has_rest: bool,
}

/// The pass over all pixels. `input`: [`Resource::Composed`] or [`Resource::Result`].
pub fn stage(tracer: &Tracer, pixels: u32, input: Resource, settings: &Settings) -> Result<Stage> {
    let device = tracer.device();
    let moved_bytes = (MAX_MOVED * size_of::<MovedRecord>()) as u64;
    let pass = Antialias {
        pipeline: shaders::ANTIALIAS.specialized(device, &settings.catcher_constants())?,
        params: Params::new(device, "parameters of antialiasing")?,
        moved: Buffer::new(device, "moved objects", moved_bytes, Memory::Upload)?,
        input,
        has_rest: settings.converges(),
    };
    Ok(Stage::new(vec![Box::new(pass)], Range::all(pixels)))
}

/// Number of samples as which a frame in motion counts at rest: 8 for a full history.
const MOTION_SAMPLES: f32 = 8.0 / RADIANCE_FRAMES;

/// How much a long frame of radiance at rest counts, which is the filtered mean of all samples so
/// far: those before it are of a part r of its samples. By the third power of that part they soften
/// what the filter does at edges and hide its specks, and the mean has nearly the noise of all
/// samples: by the square 1.07 times that after four long frames, by higher powers less, and more
/// specks. Where samples are many there are none, and frames that add a constant part would leave
/// sqrt(2p / (2p - 1)) times their noise: 1.095 for p = 3, 1.02 for 12, 1.01 for 24.
struct LongFrame {
    before: f32,
    after: f32,
    power: f32,
}

impl LongFrame {
    fn from_frame(frame: &Frame) -> Option<Self> {
        let after = frame.plan.progress.rest_samples as f32;
        (frame.plan.progress.is_long && after > 0.0).then(|| Self {
            before: (after - frame.plan.progress.samples as f32).max(0.0),
            after,
            power: (after / 16.0).clamp(3.0, 24.0),
        })
    }
}

impl Pass for Antialias {
    fn uses(&self, _: Option<&Display>) -> ResourceUse {
        use Resource::{
            Denoised, DiffuseHistory, FrameNumber, Guide, Normals, PreviousPosition, Resolved, ResolvedHistory, Rest,
            Surface,
        };
        let rest: &[Resource] = if self.has_rest { &[Rest, Denoised] } else { &[] };
        let light: &[Resource] = if self.input == Resource::Composed { &[DiffuseHistory] } else { &[] };
        ResourceUse::new(
            &[FrameNumber, Guide, Surface, Normals, PreviousPosition, self.input],
            &[ResolvedHistory, Resolved],
        )
        .previous(&[Guide, ResolvedHistory])
        .and_reads(rest)
        .and_reads(light)
    }

    fn prepare(&mut self, frame: &Frame, resources: &Resources) -> Result<()> {
        // The image that it resolves, and how a long frame counts.
        self.moved.write(0, bytemuck::cast_slice(frame.moved))?;
        let input = resources.address(self.input);
        let is_composed = self.input == Resource::Composed;
        let is_light_at_rest = is_composed && self.has_rest;
        let long = LongFrame::from_frame(frame).filter(|_| is_light_at_rest);
        let of_long = |f: fn(&LongFrame) -> f32| long.as_ref().map_or(0.0, f);

        // The number of frames that it averages follows from the signal and from what has changed.
        let has_new_light = frame.plan.has_new_light();
        let is_changed = is_composed && (has_new_light || !frame.moved.is_empty());
        let most_frames = if !frame.settings.antialias {
            1.0
        } else if has_new_light {
            NEW_LIGHT_FRAMES
        } else if is_composed {
            RADIANCE_FRAMES
        } else {
            MAX_FRAMES
        };
        self.params.write(&AntialiasParams {
            previous_to_camera: frame.previous_to_camera,
            frame: frame.params,
            composed: if is_composed { input } else { 0 },
            visibility: if is_composed { 0 } else { input },
            history: resources.address(Resource::ResolvedHistory),
            previous_history: resources.previous_address(Resource::ResolvedHistory),
            rest: resources.address(Resource::Rest),
            denoised: if frame.plan.has_denoised { resources.address(Resource::Denoised) } else { 0 },
            resolved: resources.address(Resource::Resolved),
            moved: self.moved.address(),
            changed: if is_changed { resources.address(Resource::DiffuseHistory) } else { 0 },
            moved_count: frame.moved.len() as u32,
            uncovers: frame.plan.has_moved.into(),
            has_history: frame.plan.has_resolved.into(),
            most_frames,
            most_still_frames: if has_new_light { NEW_LIGHT_FRAMES } else { STILL_FRAMES },
            camera_rests: frame.camera_rests.into(),
            samples_at: if frame.plan.placement.spreads { [0.0; 2] } else { frame.plan.offset },
            clamp_width: CLAMP_WIDTH,
            holds: (!is_composed && frame.plan.progress.is_long).into(),
            resting: frame.plan.progress.motion.frames_at_rest() as f32,
            rest_before: of_long(|l| l.before),
            rest_after: of_long(|l| l.after),
            motion_samples: MOTION_SAMPLES,
            power: of_long(|l| l.power),
            least_weight: if is_light_at_rest { MIN_WEIGHT } else { 0.0 },
        })
    }

    fn record(&self, r: &mut Recorder, frame: &Frame, _: &Resources, range: Range) -> Result<()> {
        self.params.dispatch(r, "antialias", &self.pipeline, frame, range);
        Ok(())
    }
}
