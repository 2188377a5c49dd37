//! A scene over time: anything that can bring a tracer to a frame.

use crate::bench::ao::scenes::REACH;
use crate::error::Result;
use crate::film::camera::{self, Choice};
use crate::realtime::sequence::{CameraMotion, FrameSequence};
use crate::scene::animation::AnimationRig;
use crate::scene::{Camera, Motion, Scene};
use crate::tracer::{Tracer, UpdateStats};

/// Brings the tracer to a frame. Frames need not come in order.
pub type Advance<'a> = Box<dyn FnMut(&mut Tracer, u32) -> Result<UpdateStats> + 'a>;

/// A scene, what may change in it, and what does.
pub struct ChangeScript<'a> {
    /// In tables.
    pub name: String,
    /// As it is at the beginning.
    pub scene: &'a Scene,
    /// What may change.
    pub motion: Motion,
    /// How far occlusion reaches, scene units.
    pub reach: f64,
    /// From where it is seen.
    pub camera: Camera,
    /// What changes.
    pub advance: Advance<'a>,
}

/// Of an animation.
const FRAMES_PER_SECOND: f64 = 60.0;

impl<'a> ChangeScript<'a> {
    /// A scene's first animation, seen by a camera that stands still; `None` where it has none.
    ///
    /// # Errors
    /// Those of [`FrameSequence::new`] and of choosing the camera.
    pub fn animated(name: &str, scene: &'a Scene, aspect: f64) -> Result<Option<Self>> {
        if scene.rig.as_ref().is_none_or(|rig: &AnimationRig| rig.animations().is_empty()) {
            return Ok(None);
        }
        let camera = camera::choose(scene, &Choice::Auto, aspect)?;
        let mut sequence = FrameSequence::new(scene, camera.clone(), None, CameraMotion::Still, Some(0), FRAMES_PER_SECOND)?;
        let (lo, hi) = scene.bounds().unwrap_or_default();
        Ok(Some(Self {
            name: name.to_owned(),
            scene,
            motion: sequence.motion()?,
            reach: REACH * (hi - lo).length(),
            camera,
            advance: Box::new(move |tracer, frame| Ok(sequence.frame(f64::from(frame), tracer)?.1)),
        }))
    }

    /// Brings the tracer to a frame.
    pub fn to(&mut self, tracer: &mut Tracer, frame: u32) -> Result<UpdateStats> {
        (self.advance)(tracer, frame)
    }
}
