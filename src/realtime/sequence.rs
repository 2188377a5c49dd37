//! A scene and a camera over time, frame by frame.

use crate::error::{Error, Result};
use crate::scene::animation::{AnimationRig, Playback, Pose};
use crate::scene::camera_path::CameraPath;
use crate::scene::{Camera, Motion, Orbit, Scene};
use crate::tracer::{Tracer, UpdateStats};

/// How the camera moves besides what an animation does with it.
#[derive(Clone, Debug, Default)]
pub enum CameraMotion {
    /// Not at all.
    #[default]
    Still,
    /// From key to key.
    Path(CameraPath),
    /// Around a point.
    Orbit(Orbit),
}

/// An animation that is played.
#[derive(Debug)]
struct Played<'a> {
    rig: &'a AnimationRig,
    animation: usize,
    pose: Pose,
}

/// What frames of a scene show.
#[derive(Debug)]
pub struct Sequence<'a> {
    camera: Camera,
    /// The camera's index in the file, where it is one of the file's.
    file_camera: Option<usize>,
    motion: CameraMotion,
    played: Option<Played<'a>>,
    frames_per_second: f64,
}

/// The animation that is called so, or has this index.
///
/// # Errors
/// [`Error::Usage`] when there is none, listing those that there are.
pub fn find_animation(scene: &Scene, wanted: &str) -> Result<usize> {
    let all = scene.rig.as_ref().map_or(&[][..], AnimationRig::animations);
    let by_index = wanted.parse::<usize>().ok().filter(|k| *k < all.len());
    by_index.or_else(|| all.iter().position(|a| a.name == wanted)).ok_or_else(|| {
        let names: Vec<_> = all.iter().enumerate().map(|(k, a)| format!("{k} '{}'", a.name)).collect();
        let there = if names.is_empty() { "the scene has none".to_owned() } else { format!("there is {}", names.join(", ")) };
        Error::Usage(format!("--animate {wanted}: no such animation; {there}"))
    })
}

impl<'a> Sequence<'a> {
    /// `file_camera`: the index of `camera` in the scene, so that an animation that moves it is followed. `animation`: an index
    /// ([`find_animation`]).
    ///
    /// # Errors
    /// [`Error::Usage`] when the scene has no such animation.
    pub fn new(
        scene: &'a Scene,
        camera: Camera,
        file_camera: Option<usize>,
        motion: CameraMotion,
        animation: Option<usize>,
        frames_per_second: f64,
    ) -> Result<Self> {
        let played = match animation {
            None => None,
            Some(animation) => {
                let rig = scene.rig.as_ref().ok_or_else(|| Error::Usage("the scene has no animations".into()))?;
                Some(Played { rig, animation, pose: Pose::default() })
            }
        };
        Ok(Self { camera, file_camera, motion, played, frames_per_second })
    }

    /// What of the scene changes: what it is to be flattened with.
    ///
    /// # Errors
    /// [`Error::Usage`] when the scene has no such animation.
    pub fn motion(&self) -> Result<Motion> {
        self.played.as_ref().map_or(Ok(Motion::default()), |p| p.rig.motion(p.animation))
    }

    /// Brings the tracer to a frame, and says from where it is seen and what an update did. Animations loop.
    ///
    /// # Errors
    /// Those of [`Tracer::update`].
    pub fn frame(&mut self, frame: f64, tracer: &mut Tracer) -> Result<(Camera, UpdateStats)> {
        let mut camera = self.camera.clone();
        let mut stats = UpdateStats::default();
        if let Some(p) = &mut self.played {
            p.rig.pose(p.animation, frame / self.frames_per_second, Playback::Loop, &mut p.pose)?;
            let posed = p.pose.cameras.iter().find(|(k, _)| Some(*k) == self.file_camera);
            if let Some(&(_, camera_to_world)) = posed {
                camera.camera_to_world = camera_to_world;
            }
            if tracer.is_dynamic() {
                stats = tracer.update(&p.pose.changes())?;
            }
        }
        let camera = match &self.motion {
            CameraMotion::Still => camera,
            CameraMotion::Path(path) => path.camera_at(frame),
            CameraMotion::Orbit(orbit) => orbit.camera_at(&camera, frame),
        };
        Ok((camera, stats))
    }

    /// Does anything move from frame to frame?
    pub fn moves(&self) -> bool {
        self.played.is_some() || !matches!(self.motion, CameraMotion::Still)
    }
}
