//! State that frames leave behind for those after them.

use glam::DMat3;

use super::display::Display;
use super::settings::Settings;
use crate::film::camera::CameraRecord;

/// Whether an image rests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// The camera, the scene or its light has changed, or the frame before was interrupted.
    #[default]
    Moving,
    /// The image rests for so many frames, this one included.
    Resting(u32),
}

impl Motion {
    /// Returns the motion of an image that rests for so many frames; with 0 it moves.
    pub fn from_frames_at_rest(frames: u32) -> Self {
        if frames == 0 { Self::Moving } else { Self::Resting(frames) }
    }

    /// Returns the number of frames since the image came to rest, this one included; 0 in motion.
    pub fn frames_at_rest(self) -> u32 {
        match self {
            Self::Moving => 0,
            Self::Resting(frames) => frames,
        }
    }
}

/// The paths that frames take of the sequence of each pixel: one after the other, also where it is
/// sampled in every fourth frame only, because all samples of a sequence are more even.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PathSequence {
    /// Index of the next path.
    pub first: u32,
    /// The paths since the image came to rest are a block of the sequence, from its beginning.
    pub in_block: bool,
    /// Maximum number of paths of a pixel since then, which other pixels of the pattern follow.
    pub of_pattern: u32,
}

/// Host state of earlier frames that the next one depends on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Number of the next frame, by which samples are chosen.
    pub frame: u32,
    /// Camera of the last frame; `None`: there is none that counts.
    pub camera: Option<CameraRecord>,
    /// Pixels have histories.
    pub has_history: bool,
    /// There is a resolved image.
    pub has_resolved: bool,
    /// Where samples lay in their pixels: offset from the centre, pixels.
    pub offset: [f32; 2],
    /// Motion of the last frame.
    pub motion: Motion,
    /// Mean number of samples of a pixel at rest when they were last denoised.
    pub denoised_samples: u64,
    /// The next paths of each pixel's sequence.
    pub paths: PathSequence,
    /// Lights or materials have changed: histories of radiance count less.
    pub has_new_light: bool,
    /// Nothing emits light in the scene as it is.
    pub is_black: bool,
    /// The rotation to the environment map, if it is not yet on the device.
    pub environment_turn: Option<DMat3>,
    /// A frame was interrupted: the samples at rest are in pieces and start anew.
    pub was_interrupted: bool,
    /// Display of the last frame; `None`: there was none.
    pub shown: Option<Option<Display>>,
}

impl History {
    /// Forgets the images so far.
    pub fn reset(&mut self) {
        self.has_history = false;
        self.has_resolved = false;
        self.camera = None;
    }

    /// Forgets the images so far, and gives the next frame this number.
    pub fn start_at(&mut self, frame: u32, settings: &Settings) {
        self.reset();
        self.frame = frame;
        self.paths.first = (frame / settings.resolution.period()).wrapping_mul(settings.rays_per_pixel);
        self.paths.of_pattern = 0;
    }

    /// Notes that lights or materials have changed.
    pub fn change_light(&mut self) {
        self.has_new_light = true;
        self.motion = Motion::Moving;
    }

    /// Returns the history of a frame that was interrupted and taken back: that before it.
    pub fn after_interruption(self) -> Self {
        Self { was_interrupted: true, ..self }
    }

    /// Returns the history of a pipeline that continues the frames of `other`. `has_resolved`: it
    /// has taken over the resolved image, where there is one. Samples at rest are not taken over.
    pub fn continued_from(&self, other: &Self, has_resolved: bool) -> Self {
        Self {
            has_resolved: other.has_resolved && has_resolved,
            has_new_light: self.has_new_light || other.has_new_light,
            environment_turn: self.environment_turn,
            motion: Motion::Moving,
            was_interrupted: true,
            shown: self.shown,
            ..other.clone()
        }
    }
}
