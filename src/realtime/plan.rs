//! The plan of a frame, decided before anything of it is recorded.

use glam::DMat3;

use super::camera_change::is_jump;
use super::display::{Display, DisplayMode};
use super::frame_samples::FrameSamples;
use super::history::{History, Motion, PathSequence};
use super::settings::Settings;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::raster::Primary;

/// Maximum samples of a history of radiance after a change of light, per ray of a frame.
const PAST_AFTER_NEW_LIGHT: f32 = 8.0;

/// Minimum number of frames at rest before their mean is denoised: their noise must be known.
const MIN_DENOISED_FRAMES: u32 = 4;
/// Minimum number of samples of a pixel, likewise.
const MIN_DENOISED_SAMPLES: u64 = 8;

/// Inputs of a frame besides the frames before it.
#[derive(Clone, Copy)]
pub struct Inputs<'a> {
    /// Signal of the frames.
    pub signal: &'a dyn Signal,
    /// Settings of the pipeline.
    pub settings: &'a Settings,
    /// Number of samples of its frames.
    pub frame_samples: FrameSamples,
    /// Camera of this frame.
    pub camera: CameraRecord,
    /// Objects have moved since the previous frame.
    pub has_moved_objects: bool,
    /// The buffer to display, if any.
    pub display: Option<Display>,
}

/// How far an image has come since it came to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestProgress {
    /// Motion of this frame. An image of which nothing is known may begin at rest.
    pub motion: Motion,
    /// The surfaces in view are those of the previous frame, and so is their light.
    pub is_still: bool,
    /// Light alone has changed: histories are of the same pixels, wherever in them samples lie.
    pub only_light_is_new: bool,
    /// The frame is a long one ([`super::frame_samples`]).
    pub is_long: bool,
    /// Samples of each pixel that is sampled in this frame.
    pub samples: u32,
    /// Samples start anew: the image has not rested before, or they no longer count.
    pub starts_anew: bool,
    /// Samples of each pixel that count since the image came to rest, but for the first frame.
    pub rest_samples: u64,
}

/// Where the samples of a frame lie in the sequence and in the area of their pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplePlacement {
    /// Each path has a place of its own within its pixel, in place of that of the frame.
    pub spreads: bool,
    /// Rays through the frame's place in each pixel are those of the previous frame.
    pub keeps_offset: bool,
    /// Index of the first sample in the pixel's sequence, but for short frames of visibility.
    pub first_sample: u32,
    /// The paths that the pixels take.
    pub paths: PathSequence,
}

/// A signal is what frames show: ambient visibility, radiance, or the image of Larsen's pipeline.
/// Each has stages of its own (`signals`); plans ask here where their rules differ. The defaults
/// are those of a signal of one channel without anything special at rest.
pub trait Signal: Sync {
    /// Returns the number of values per pixel of the result.
    fn channels(&self) -> usize {
        1
    }

    /// Returns how many samples the frames of an image of so many pixels take.
    fn frame_samples(&self, settings: &Settings, pixels: u64, _is_cpu: bool) -> FrameSamples {
        FrameSamples::for_visibility(settings, pixels)
    }

    /// Checks that frames with these settings have the buffer.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`], saying what it takes.
    fn check_display(&self, mode: DisplayMode, settings: &Settings) -> Result<()> {
        mode.check(settings)
    }

    /// Returns true if the image depends on lights and materials.
    fn depends_on_light(&self) -> bool {
        false
    }

    /// Returns true if each pixel has a history of samples, which can be taken back.
    fn has_pixel_histories(&self) -> bool {
        true
    }

    /// Returns true if a frame leaves a history to the next one.
    fn keeps_history(&self, settings: &Settings) -> bool {
        settings.history > 1
    }

    /// Returns the number of frames at rest after which the image does not change, if any.
    fn frames_to_rest(&self, settings: &Settings, samples: &FrameSamples) -> Option<u32> {
        if settings.converges() { Some(samples.frames_for(settings.rest_samples)) } else { settings.frames_to_rest() }
    }

    /// Returns the number of frames at rest in which each pixel has the samples of one.
    fn rest_period(&self, _settings: &Settings) -> u32 {
        1
    }

    /// Returns true if the first frame of an image is one at rest: there are no histories yet.
    fn begins_at_rest(&self, _samples: &FrameSamples) -> bool {
        false
    }

    /// Returns true if the previous image, by another camera, may have shown little of this one.
    fn may_be_cut(&self, before: &CameraRecord, now: &CameraRecord, settings: &Settings) -> bool {
        is_jump(before, now, settings.occlusion.reach())
    }

    /// Returns true if the mean of the samples at rest is denoised by itself.
    fn denoises_at_rest(&self) -> bool {
        false
    }

    /// Decides where the samples of a frame lie.
    fn place_samples(&self, history: &History, _inputs: &Inputs, _progress: &RestProgress) -> SamplePlacement {
        SamplePlacement { spreads: false, keeps_offset: false, first_sample: 0, paths: history.paths }
    }

    /// Returns the number of frames as this one that sample all pixels once.
    fn period(&self, _plan: &FramePlan, settings: &Settings) -> u32 {
        settings.resolution.period()
    }

    /// Returns the number of camera rays of the frame in an image of so many pixels.
    /// `has_known_hits`: what the rays of the G-buffer hit is kept.
    fn camera_rays(&self, plan: &FramePlan, settings: &Settings, pixels: u64, _has_known_hits: bool) -> u64 {
        let RestProgress { is_long, samples, .. } = plan.progress;
        match settings.primary {
            Some(Primary::Raster) if !is_long => 0,
            _ if is_long => pixels * u64::from(samples),
            _ if plan.has_new_view => pixels,
            _ => 0,
        }
    }
}

/// The work of a frame. It follows from history and inputs alone; a frame is: plan, run, commit.
///
/// The rules, in the order in which they are decided:
///
/// - The image *moves* where the camera or an object has moved, light has changed, or the frame
///   before was interrupted. Otherwise it *rests*, and frames at rest are counted. Larsen's
///   pipeline never rests; of radiance also the first frame of an image counts as one at rest.
/// - A frame is *skipped* after [`Signal::frames_to_rest`] frames at rest, if it displays what the
///   last one did.
/// - The first frames at rest are short, as those in motion; those after them are long
///   ([`FrameSamples`]). Samples at rest start anew in motion, where there is no image to go on
///   with, and where those of short frames no longer count.
/// - The signal places the samples: in their sequence, and all at one place of their pixels or each
///   at its own. The place changes from frame to frame if the image is antialiased, unless surfaces
///   are known at the place of the last frame only.
/// - Camera rays are traced anew where the image moves or its place in the pixels changes
///   (`has_new_view`). Other passes skip themselves by what they read (`graph`).
/// - The mean at rest is denoised again where samples have grown by a sixteenth.
/// - Where light has changed, histories count as few samples (`most_past`).
/// - A camera that may have jumped (`may_be_cut`) has surfaces looked at first: where the previous
///   image shows few of them, history starts at frame 0, and the frame is planned again.
///
/// [`FramePlan::commit`] says what the frame leaves behind. A frame that fails commits nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePlan {
    /// Number of the frame.
    pub number: u32,
    /// Nothing would change: no pass runs, and nothing is committed.
    pub is_skipped: bool,
    /// The camera or objects have moved since the previous frame.
    pub has_moved: bool,
    /// Objects have moved since the previous frame.
    pub has_moved_objects: bool,
    /// How far the image has come since it came to rest.
    pub progress: RestProgress,
    /// Where samples lie.
    pub placement: SamplePlacement,
    /// Where samples that do not spread lie in their pixels: offset from the centre, pixels.
    pub offset: [f32; 2],
    /// Camera rays start elsewhere, or may hit something else.
    pub has_new_view: bool,
    /// The previous image may have shown little of what the camera sees now.
    pub may_be_cut: bool,
    /// There is a resolved image of the previous frame.
    pub has_resolved: bool,
    /// The mean of ambient visibility at rest is denoised in this frame.
    pub denoises: bool,
    /// It is denoised in this frame, or was in an earlier one at rest.
    pub has_denoised: bool,
    /// Mean number of samples of a pixel at rest when they were last denoised, this frame included.
    pub denoised_samples: u64,
    /// Maximum samples of histories of radiance before this frame's.
    pub most_past: f32,
    /// The environment map has been turned: its new rotation from world directions to the map's.
    pub environment_turn: Option<DMat3>,
}

impl RestProgress {
    fn next(history: &History, inputs: &Inputs, has_moved: bool) -> Self {
        let samples = &inputs.frame_samples;
        let is_undisturbed = !history.has_new_light && !history.was_interrupted;
        let is_still = !has_moved && inputs.signal.has_pixel_histories() && is_undisturbed;
        let begins_at_rest = !history.has_resolved && inputs.signal.begins_at_rest(samples);
        let resting =
            if is_still { history.motion.frames_at_rest().saturating_add(1) } else { u32::from(begins_at_rest) };
        Self {
            motion: Motion::from_frames_at_rest(resting),
            is_still,
            only_light_is_new: !has_moved && history.has_new_light && history.has_resolved,
            is_long: samples.is_long(resting),
            samples: samples.in_frame(resting),
            starts_anew: resting == 0 || !history.has_resolved || samples.starts_anew(resting),
            rest_samples: samples.since_rest(resting),
        }
    }
}

impl FramePlan {
    /// Plans the frame after those of a history.
    pub fn next(history: &History, inputs: &Inputs) -> Self {
        let Inputs { signal, settings, frame_samples, camera, has_moved_objects, display } = *inputs;

        // how the frame stands to those before it
        let has_moved = has_moved_objects || history.camera != Some(camera);
        let progress = RestProgress::next(history, inputs, has_moved);
        let resting = progress.motion.frames_at_rest();
        let has_come_to_rest = signal.frames_to_rest(settings, &frame_samples).is_some_and(|frames| resting >= frames);
        let before = history.camera.filter(|before| *before != camera && history.has_history);

        // where samples lie
        let placement = signal.place_samples(history, inputs, &progress);
        let offset = if !settings.antialias {
            [0.0; 2]
        } else if placement.keeps_offset {
            history.offset
        } else {
            sample_offset(history.frame)
        };

        // what is denoised at rest
        let denoised = if resting == 0 { 0 } else { history.denoised_samples };
        let denoises = signal.denoises_at_rest()
            && progress.rest_samples >= MIN_DENOISED_SAMPLES
            && resting >= MIN_DENOISED_FRAMES
            && progress.rest_samples >= denoised + denoised / 16;

        Self {
            number: history.frame,
            is_skipped: has_come_to_rest && history.shown == Some(display),
            has_moved,
            has_moved_objects,
            progress,
            placement,
            offset,
            has_new_view: !progress.is_still || offset != history.offset,
            may_be_cut: before.is_some_and(|before| signal.may_be_cut(&before, &camera, settings)),
            has_resolved: history.has_resolved,
            denoises,
            has_denoised: denoises || denoised > 0,
            denoised_samples: if denoises { progress.rest_samples } else { denoised },
            most_past: if history.has_new_light {
                PAST_AFTER_NEW_LIGHT * settings.rays_per_pixel as f32
            } else {
                f32::INFINITY
            },
            environment_turn: history.environment_turn,
        }
    }

    /// Returns true if lights or materials have changed.
    pub fn has_new_light(&self) -> bool {
        self.most_past.is_finite()
    }

    /// Returns the history after the frame, which has been rendered as planned.
    pub fn commit(&self, history: &History, inputs: &Inputs) -> History {
        let frame = history.frame.wrapping_add(1);
        let mut paths = self.placement.paths;
        paths.of_pattern = paths.of_pattern.max(self.progress.samples);
        if frame.is_multiple_of(inputs.settings.resolution.period()) {
            paths.first = paths.first.wrapping_add(paths.of_pattern);
            paths.of_pattern = 0;
        }
        History {
            frame,
            camera: Some(inputs.camera),
            has_history: inputs.signal.keeps_history(inputs.settings),
            has_resolved: true,
            offset: self.offset,
            motion: self.progress.motion,
            denoised_samples: self.denoised_samples,
            paths,
            has_new_light: false,
            is_black: history.is_black,
            environment_turn: None,
            was_interrupted: false,
            shown: Some(inputs.display),
        }
    }
}

/// Offset of a frame's samples from their pixels' centres, pixels. Those of consecutive frames are
/// even (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
fn sample_offset(frame: u32) -> [f32; 2] {
    // powers of the inverse of the plastic number
    const STEPS: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
    STEPS.map(|step| ((0.5 + f64::from(frame) * step).fract() - 0.5) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrators::ao::Occlusion;
    use crate::realtime::settings::{Preset, Resolution};
    use crate::realtime::signals::larsen::Larsen;
    use crate::realtime::signals::radiance::Radiance;
    use crate::realtime::signals::visibility::AmbientVisibility;

    const PIXELS: u64 = 14_400;

    fn camera_at(x: f32) -> CameraRecord {
        let camera_to_world = [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        CameraRecord { camera_to_world, view: [0.5, 0.5], orthographic: false, clip: [0.0, f32::INFINITY] }
    }

    fn display(exposure: f32) -> Option<Display> {
        let tone_map = crate::interface::ToneMap::default();
        Some(Display { shown: DisplayMode::Result, exposure, unit: 1.0, tone_map })
    }

    /// Frames that are planned and committed, and rendered by nobody.
    #[derive(Clone)]
    struct Frames {
        signal: &'static dyn Signal,
        settings: Settings,
        history: History,
        camera: CameraRecord,
        has_moved_objects: bool,
        display: Option<Display>,
    }

    impl Frames {
        fn new(signal: &'static dyn Signal, settings: Settings) -> Self {
            let history = History::default();
            Self { signal, settings, history, camera: camera_at(0.0), has_moved_objects: false, display: None }
        }

        fn inputs(&self) -> Inputs<'_> {
            Inputs {
                signal: self.signal,
                settings: &self.settings,
                frame_samples: self.signal.frame_samples(&self.settings, PIXELS, true),
                camera: self.camera,
                has_moved_objects: self.has_moved_objects,
                display: self.display,
            }
        }

        fn plan(&self) -> FramePlan {
            FramePlan::next(&self.history, &self.inputs())
        }

        /// The plan of the next frame, after which that counts as rendered.
        fn frame(&mut self) -> FramePlan {
            let plan = self.plan();
            if !plan.is_skipped {
                self.history = plan.commit(&self.history, &self.inputs());
            }
            plan
        }

        fn frames(&mut self, n: usize) -> Vec<FramePlan> {
            (0..n).map(|_| self.frame()).collect()
        }
    }

    fn converging() -> Settings {
        Settings { antialias: true, converge: true, occlusion: Occlusion::new(2.0, 1.0), ..Preset::Balanced.settings() }
    }

    fn visibility() -> Frames {
        Frames::new(&AmbientVisibility, converging())
    }

    fn radiance() -> Frames {
        Frames::new(&Radiance, converging())
    }

    fn larsen() -> Frames {
        Frames::new(&Larsen, Preset::Larsen.settings())
    }

    fn all() -> [Frames; 3] {
        [visibility(), radiance(), larsen()]
    }

    #[test]
    fn the_first_frame_knows_nothing() {
        for mut frames in all() {
            let plan = frames.frame();
            assert!(plan.has_moved && plan.has_new_view && plan.progress.starts_anew);
            assert!(!plan.progress.is_still && !plan.has_resolved && !plan.may_be_cut && !plan.is_skipped);
            assert!(!plan.denoises && !plan.has_denoised && !plan.has_new_light() && plan.environment_turn.is_none());
            assert_eq!((plan.number, plan.placement.first_sample), (0, 0));
            let history = &frames.history;
            assert_eq!((history.frame, history.camera), (1, Some(frames.camera)));
            assert!(history.has_history && history.has_resolved);
        }
        // an image of radiance begins as if it had come to rest, if it converges
        let first = |frames: Frames| frames.plan().progress;
        assert_eq!(first(visibility()).motion, Motion::Moving);
        assert_eq!(first(larsen()).motion, Motion::Moving);
        assert_eq!(first(radiance()).motion, Motion::Resting(1));
        assert!(first(radiance()).is_long && radiance().plan().placement.spreads);
        let held = Frames::new(&Radiance, Settings { converge: false, ..converging() });
        assert_eq!(first(held).motion, Motion::Moving);
    }

    #[test]
    fn frames_at_rest_are_counted() {
        let motions = |mut frames: Frames| frames.frames(4).iter().map(|p| p.progress.motion).collect::<Vec<_>>();
        let resting = Motion::Resting;
        assert_eq!(motions(visibility()), [Motion::Moving, resting(1), resting(2), resting(3)]);
        assert_eq!(motions(radiance()), [1, 2, 3, 4].map(resting));
        // Larsen's pipeline skips no pass
        assert_eq!(motions(larsen()), [Motion::Moving; 4]);
        assert!(larsen().frames(4).iter().all(|p| p.has_new_view && p.progress.starts_anew && !p.progress.is_still));
    }

    #[test]
    fn long_frames_of_visibility_follow_a_few_short_ones() {
        let plans = visibility().frames(7);
        let of = |value: fn(&FramePlan) -> u32| plans.iter().map(value).collect::<Vec<_>>();
        assert_eq!(of(|p| p.progress.is_long.into()), [0, 0, 0, 0, 1, 1, 1]);
        assert_eq!(of(|p| p.progress.samples), [1, 1, 1, 1, 16, 16, 16]);
        assert_eq!(of(|p| p.progress.starts_anew.into()), [1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(of(|p| p.progress.rest_samples as u32), [0, 1, 2, 3, 19, 35, 51]);
        // indices in the sequence of long frames
        assert_eq!(of(|p| p.placement.first_sample), [0, 0, 0, 0, 0, 16, 32]);
        // camera rays start elsewhere in short frames only
        assert_eq!(of(|p| p.has_new_view.into()), [1, 1, 1, 1, 0, 0, 0]);
        assert!(plans[4..].iter().all(|p| p.offset == plans[3].offset) && plans[3].offset != plans[2].offset);
        assert!(plans.iter().all(|p| !p.placement.spreads));
    }

    #[test]
    fn long_frames_of_radiance_grow_and_spread() {
        let plans = radiance().frames(6);
        let of = |value: fn(&FramePlan) -> u32| plans.iter().map(value).collect::<Vec<_>>();
        assert_eq!(of(|p| p.progress.samples), [2, 2, 4, 8, 8, 8]);
        assert_eq!(of(|p| p.placement.first_sample), [0, 2, 4, 8, 16, 24]);
        assert_eq!(of(|p| p.progress.starts_anew.into()), [1, 0, 0, 0, 0, 0]);
        assert_eq!(of(|p| p.has_new_view.into()), [1, 0, 0, 0, 0, 0]);
        assert!(plans.iter().all(|p| p.placement.spreads && p.progress.is_long && !p.denoises));
        // of one place in a pixel without antialiasing
        let plain = Frames::new(&Radiance, Settings { antialias: false, ..converging() }).frames(6);
        assert!(plain.iter().all(|p| !p.placement.spreads && p.offset == [0.0; 2]));
    }

    #[test]
    fn places_change_with_each_frame_in_motion() {
        for mut frames in [visibility(), radiance()] {
            let plans: Vec<_> = (1..9)
                .map(|k| {
                    frames.camera = camera_at(0.01 * k as f32);
                    frames.frame()
                })
                .collect();
            for (k, plan) in plans.iter().enumerate() {
                let is_new = plans[..k].iter().all(|p| p.offset != plan.offset);
                assert!(is_new && plan.offset.iter().all(|x| x.abs() <= 0.5));
            }
        }
        let mut plain = Frames::new(&AmbientVisibility, Settings { antialias: false, ..converging() });
        let plans = plain.frames(3);
        assert!(plans.iter().all(|p| p.offset == [0.0; 2]) && !plans[1].has_new_view);
    }

    #[test]
    fn a_camera_that_moves_ends_rest() {
        for mut frames in all() {
            frames.frames(6);
            frames.camera = camera_at(0.01);
            let plan = frames.frame();
            assert_eq!(plan.progress.motion, Motion::Moving);
            assert!(plan.has_moved && plan.has_new_view && plan.progress.starts_anew && plan.has_resolved);
            assert!(!plan.progress.is_still && !plan.progress.is_long && !plan.has_moved_objects);
            assert_eq!(plan.progress.rest_samples, 0);
            // and rest begins again
            let is_larsen = !frames.signal.has_pixel_histories();
            let again = if is_larsen { Motion::Moving } else { Motion::Resting(1) };
            assert_eq!(frames.frame().progress.motion, again);
        }
    }

    #[test]
    fn a_cut_is_looked_for_where_the_camera_may_have_jumped() {
        let may_be_cut = |mut frames: Frames, x: f32| {
            frames.frame();
            frames.camera = camera_at(x);
            frames.plan().may_be_cut
        };
        // an eighth of the length of occlusion rays
        assert_eq!([0.0, 0.2, 0.3].map(|x| may_be_cut(visibility(), x)), [false, false, true]);
        assert_eq!([0.0, 0.01].map(|x| may_be_cut(radiance(), x)), [false, true]);
        assert!(!may_be_cut(larsen(), 5.0));
        // without histories there is nothing to lose
        for frames in [visibility(), radiance()] {
            let settings = Settings { history: 1, ..frames.settings };
            assert!(!may_be_cut(Frames { settings, ..frames }, 5.0));
        }
        // an image that begins anew is not looked at again
        let mut frames = radiance();
        frames.frames(3);
        frames.camera = camera_at(5.0);
        frames.history.start_at(0, &frames.settings);
        assert!(!frames.plan().may_be_cut && frames.plan().number == 0);
    }

    #[test]
    fn an_animation_keeps_frames_in_motion() {
        for mut frames in all() {
            frames.has_moved_objects = true;
            frames.frame();
            for plan in frames.frames(300) {
                assert_eq!(plan.progress.motion, Motion::Moving);
                assert!(plan.has_moved && plan.has_moved_objects && plan.has_new_view && plan.progress.starts_anew);
                assert!(!plan.is_skipped && !plan.may_be_cut && !plan.denoises && !plan.progress.is_long);
            }
            frames.has_moved_objects = false;
            assert!(!frames.plan().has_moved);
        }
    }

    #[test]
    fn new_light_shortens_histories() {
        let settings = Settings { rays_per_pixel: 4, ..converging() };
        let mut frames = Frames::new(&Radiance, settings);
        frames.frames(5);
        let turn = DMat3::from_rotation_x(1.0);
        frames.history.environment_turn = Some(turn);
        frames.history.change_light();
        assert_eq!(frames.history.motion, Motion::Moving);
        let offset = frames.history.offset;
        let plan = frames.frame();
        assert_eq!(plan.progress.motion, Motion::Moving);
        assert!(plan.has_new_light() && plan.progress.only_light_is_new && plan.progress.starts_anew);
        assert!(!plan.has_moved && !plan.progress.is_still);
        assert_eq!((plan.most_past, plan.environment_turn), (8.0 * 4.0, Some(turn)));
        // histories are of the same places
        assert!(plan.placement.spreads && plan.offset == offset);
        let next = frames.frame();
        assert!(!next.has_new_light() && next.environment_turn.is_none());
        assert_eq!(next.progress.motion, Motion::Resting(1));
        // with a camera that moves as well they are not
        frames.history.change_light();
        frames.camera = camera_at(0.01);
        let plan = frames.frame();
        assert!(plan.has_new_light() && !plan.progress.only_light_is_new && plan.offset != offset);
    }

    #[test]
    fn an_interrupted_frame_leaves_the_frame_before() {
        for mut frames in [visibility(), radiance()] {
            frames.frames(6);
            let before = frames.history.clone();
            frames.history = frames.history.clone().after_interruption();
            let plan = frames.frame();
            assert_eq!(plan.progress.motion, Motion::Moving);
            assert!(plan.progress.starts_anew && plan.has_resolved && !plan.has_moved && !plan.progress.is_still);
            assert_eq!(plan.number, before.frame);
            assert_eq!(frames.frame().progress.motion, Motion::Resting(1));
        }
    }

    #[test]
    fn a_reset_forgets_images_and_a_rewind_the_number_too() {
        for mut frames in all() {
            let first = frames.plan();
            frames.frames(6);
            frames.history.reset();
            assert!(!frames.history.has_history);
            let plan = frames.plan();
            assert!(plan.has_moved && !plan.has_resolved && !plan.may_be_cut && plan.progress.starts_anew);
            assert_eq!((plan.number, plan.progress.motion), (6, first.progress.motion));
            frames.history.start_at(0, &frames.settings);
            assert_eq!(frames.plan(), first);
        }
        // the number chooses the samples of a pattern
        let settings = Settings { rays_per_pixel: 3, resolution: Resolution::Half, converge: false, ..converging() };
        let mut half = Frames::new(&Radiance, settings);
        half.frames(3);
        half.history.start_at(9, &half.settings);
        assert_eq!((half.history.frame, half.plan().placement.first_sample), (9, 2 * 3));
    }

    #[test]
    fn an_image_of_another_size_or_of_other_settings_continues() {
        for mut old in [visibility(), radiance()] {
            old.frames(6);
            for takes_resolved in [true, false] {
                let mut new = Frames { history: History::default(), ..old.clone() };
                new.settings.history /= 2;
                new.history.has_new_light = true;
                new.history = new.history.continued_from(&old.history, takes_resolved);
                let plan = new.frame();
                assert_eq!((plan.number, plan.has_resolved), (old.history.frame, takes_resolved));
                let is_first = !takes_resolved && new.signal.depends_on_light();
                let motion = if is_first { Motion::Resting(1) } else { Motion::Moving };
                assert_eq!(plan.progress.motion, motion);
                assert!(plan.progress.starts_anew && !plan.has_moved && plan.has_new_light());
                assert_eq!(plan.progress.only_light_is_new, takes_resolved);
                assert!(!plan.may_be_cut);
                new.camera = camera_at(5.0);
                assert!(new.plan().may_be_cut);
            }
        }
        // samples at rest start anew; what was displayed is not taken over, what has changed stays
        let [mut old, mut new] = [radiance(), radiance()];
        old.frames(6);
        new.history.environment_turn = Some(DMat3::IDENTITY);
        new.history = new.history.continued_from(&old.history, true);
        assert_eq!((new.history.motion, new.history.shown), (Motion::Moving, None));
        assert_eq!(new.plan().environment_turn, Some(DMat3::IDENTITY));
        assert!(!new.plan().progress.is_still && new.plan().progress.starts_anew);
    }

    #[test]
    fn frames_without_change_are_skipped() {
        for frames in [visibility(), radiance()] {
            let mut frames = Frames { display: display(0.0), ..frames };
            let all = frames.signal.frames_to_rest(&frames.settings, &frames.inputs().frame_samples).unwrap();
            let resting = |plan: &FramePlan| plan.progress.motion.frames_at_rest();
            let plans = frames.frames(all as usize + 5);
            let skipped: Vec<_> = plans.iter().filter(|p| p.is_skipped).collect();
            assert_eq!(resting(skipped[0]), all);
            assert!(plans.iter().all(|p| p.is_skipped == (resting(p) >= all)));
            // they commit nothing
            assert!(skipped.len() >= 5 && skipped.iter().all(|p| *p == skipped[0]));
            // another display shows itself, and then stays
            frames.display = display(1.0);
            assert!(!frames.frame().is_skipped && frames.plan().is_skipped);
            // what moves is rendered
            let moved = Frames { camera: camera_at(1.0), ..frames.clone() };
            assert!(!moved.plan().is_skipped);
            assert!(!Frames { has_moved_objects: true, ..frames }.plan().is_skipped);
        }
        // as many samples as the settings say, of each frame of a pattern, and one before
        let to_rest = |frames: &Frames| frames.signal.frames_to_rest(&frames.settings, &frames.inputs().frame_samples);
        let samples = |frames: &Frames| frames.inputs().frame_samples.frames_for(frames.settings.rest_samples);
        let [full, half] = [Resolution::Full, Resolution::Half]
            .map(|resolution| Frames::new(&Radiance, Settings { resolution, ..converging() }));
        assert_eq!(to_rest(&full), Some(samples(&full) + 1));
        assert_eq!(to_rest(&half), Some(4 * samples(&half) + 1));
        assert_eq!(to_rest(&visibility()), Some(samples(&visibility())));
    }

    #[test]
    fn images_that_do_not_converge_rest_when_histories_are_full() {
        let settings = Settings { converge: false, history: 8, ..converging() };
        for signal in [&AmbientVisibility as &'static dyn Signal, &Radiance] {
            let mut frames = Frames::new(signal, settings);
            let plans = frames.frames(100);
            // 64 places in a pixel besides
            assert_eq!(plans.iter().position(|p| p.is_skipped), Some(8 + 64));
            assert!(plans.iter().all(|p| p.progress.samples == 1));
            // without antialiasing each pixel rests on its own
            let mut plain = Frames::new(signal, Settings { antialias: false, ..settings });
            assert!(plain.frames(300).iter().all(|p| !p.is_skipped));
        }
        assert!(larsen().frames(300).iter().all(|p| !p.is_skipped));
    }

    #[test]
    fn a_history_of_one_frame_is_none() {
        for frames in all() {
            let mut frames = Frames { settings: Settings { history: 1, ..frames.settings }, ..frames };
            frames.frame();
            // the image of Larsen's pipeline has its own
            assert_eq!(frames.history.has_history, !frames.signal.has_pixel_histories());
            assert!(frames.history.has_resolved);
        }
    }

    #[test]
    fn visibility_at_rest_is_denoised_as_samples_grow() {
        let mut frames = visibility();
        frames.settings.rest_samples = 1 << 14;
        let plans = frames.frames(120);
        assert_eq!(plans.iter().position(|p| p.denoises), Some(4), "the first with eight samples");
        let mut last = 0;
        for plan in &plans {
            let now = plan.progress.rest_samples;
            let is_due = now >= 8 && now >= last + last / 16;
            assert_eq!(plan.denoises, is_due && plan.progress.motion.frames_at_rest() >= 4);
            last = if plan.denoises { now } else { last };
            assert_eq!((plan.denoised_samples, plan.has_denoised), (last, last > 0));
        }
        assert!(plans[5..].iter().any(|p| !p.denoises && p.has_denoised));
        // in motion what was denoised no longer holds
        frames.camera = camera_at(0.01);
        let plan = frames.frame();
        assert!(!plan.denoises && !plan.has_denoised && frames.history.denoised_samples == 0);
        assert!(radiance().frames(50).iter().all(|p| !p.has_denoised));
    }

    #[test]
    fn paths_at_rest_begin_with_a_block_of_the_sequence() {
        let mut frames = radiance();
        frames.settings.rest_samples = 1 << 14;
        for k in 0..5 {
            frames.camera = camera_at(0.01 * k as f32);
            frames.frame();
        }
        // in motion they take the sequence from its beginning: two, then one each
        assert_eq!(frames.history.paths.first, 2 + 4);
        let mut next = 1 << 12;
        for plan in frames.frames(40) {
            assert!(plan.placement.spreads);
            assert_eq!(plan.placement.first_sample, next);
            assert!(next.is_multiple_of(plan.progress.samples));
            next += plan.progress.samples;
        }
        // moved and at rest again: the next block
        frames.camera = camera_at(1.0);
        assert_eq!(frames.frame().placement.first_sample, next);
        assert_eq!(frames.frame().placement.first_sample, 2 << 12);
    }

    #[test]
    fn frames_of_a_pattern_have_the_same_paths() {
        let settings = Settings { resolution: Resolution::Half, ..converging() };
        let plans = Frames::new(&Radiance, settings).frames(16);
        for pattern in plans.chunks(4) {
            assert!(pattern.iter().all(|p| p.placement.first_sample == pattern[0].placement.first_sample));
        }
        let firsts: Vec<u32> = plans.iter().step_by(4).map(|p| p.placement.first_sample).collect();
        // a camera that stands still from the first frame has a still's, anew in long frames
        assert_eq!(firsts, [0, 0, 8, 16]);
    }

    #[test]
    fn blocks_of_a_pattern_begin_with_a_pattern() {
        let settings = Settings { resolution: Resolution::Half, ..converging() };
        let mut frames = Frames::new(&Radiance, settings);
        for k in 0..25 {
            frames.camera = camera_at(0.01 * k as f32);
            frames.frame();
        }
        let firsts: Vec<u32> = frames.frames(8).iter().map(|p| p.placement.first_sample).collect();
        assert_eq!(firsts, [6, 6, 6, 4096, 4096, 4096, 4096, 4096 + 8]);
        // also where no path has been taken before: rest began within the first pattern
        let mut frames = Frames::new(&Radiance, settings);
        frames.frame();
        frames.camera = camera_at(0.01);
        let firsts: Vec<u32> = frames.frames(4).iter().map(|p| p.placement.first_sample).collect();
        assert_eq!(firsts, [0, 0, 0, 4096]);
    }

    #[test]
    fn single_paths_lie_at_the_place_of_their_frame() {
        let spreads = |frames: &mut Frames, n: usize| {
            let plans = frames.frames(n);
            plans.iter().map(|p| p.placement.spreads).collect::<Vec<_>>()
        };
        // of a pattern short frames at rest have one path, each at another place
        let half = Settings { resolution: Resolution::Half, ..converging() };
        let plans = Frames::new(&Radiance, half).frames(5);
        assert_eq!(plans.iter().map(|p| p.placement.spreads).collect::<Vec<_>>(), [false, false, false, false, true]);
        assert!(plans[..4].windows(2).all(|p| p[0].offset != p[1].offset && p[1].has_new_view));
        assert_eq!(plans[4].offset, plans[3].offset);
        // several paths spread, but for those in motion that go on with an image
        let several = Settings { rays_per_pixel: 4, ..half };
        let mut frames = Frames::new(&Radiance, several);
        assert_eq!(spreads(&mut frames, 3), [true; 3]);
        frames.camera = camera_at(0.01);
        assert_eq!(spreads(&mut frames, 2), [false, true]);
        // an image that does not converge takes them all at the frame's place
        let mut frames = Frames::new(&Radiance, Settings { converge: false, ..several });
        assert_eq!(spreads(&mut frames, 6), [false; 6]);
    }

    #[test]
    fn rays_are_counted_as_planned() {
        let count = |frames: &Frames, plan: &FramePlan| frames.signal.camera_rays(plan, &frames.settings, 100, false);
        // visibility: rays of the G-buffer, and in long frames those of each sample
        let half = Settings { resolution: Resolution::Half, antialias: false, ..converging() };
        for (primary, expected) in [(Primary::Traced, [100, 0, 1600]), (Primary::Raster, [0, 0, 1600])] {
            let mut frames = Frames::new(&AmbientVisibility, Settings { primary: Some(primary), ..half });
            let plans = frames.frames(5);
            assert_eq!([0, 1, 4].map(|k| count(&frames, &plans[k])), expected);
            assert_eq!([0, 4].map(|k| frames.signal.period(&plans[k], &half)), [4, 1]);
        }
        // radiance: of paths with places of their own, and of the G-buffer where the view is new
        let mut frames = radiance();
        let plans = frames.frames(2);
        assert_eq!([0, 1].map(|k| count(&frames, &plans[k])), [100 * (2 + 1), 100 * 2]);
        frames.camera = camera_at(0.01);
        let moving = frames.frame();
        let rays = |has_known_hits| frames.signal.camera_rays(&moving, &frames.settings, 100, has_known_hits);
        assert_eq!([true, false].map(rays), [100, 200]);
        assert_eq!(frames.signal.period(&moving, &half), 4);
    }
}
