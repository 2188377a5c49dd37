//! A scene and a camera over time, frame by frame.

use std::sync::Arc;

use glam::Vec3;

use crate::error::{Error, Result};
use crate::scene::animation::{AnimationRig, Playback, Pose};
use crate::scene::camera_path::CameraPath;
use crate::scene::{Camera, Motion, Orbit, Scene};
use crate::tracer::{Tracer, UpdateStats};

/// Camera motion, in addition to an animation of the camera.
#[derive(Clone, Debug, Default)]
pub enum CameraMotion {
    /// No motion.
    #[default]
    Still,
    /// Interpolation of key frames.
    Path(CameraPath),
    /// An orbit around a point.
    Orbit(Orbit),
}

impl CameraMotion {
    /// The camera in a frame, if it was `camera` without this motion.
    pub fn camera_at(&self, camera: Camera, frame: f64) -> Camera {
        match self {
            Self::Still => camera,
            Self::Path(path) => path.camera_at(frame),
            Self::Orbit(orbit) => orbit.camera_at(&camera, frame),
        }
    }

    /// Returns true if the camera is cut after frame `before`, and at `frame` or earlier.
    pub fn has_cut(&self, before: f64, frame: f64) -> bool {
        matches!(self, Self::Path(path) if path.has_cut(before, frame))
    }
}

/// An animation that is played.
#[derive(Debug)]
struct AnimationPlayback<'a> {
    rig: &'a AnimationRig,
    animation: usize,
    pose: Pose,
    /// The scene in the pose, if lights move.
    posed: Option<Arc<Scene>>,
}

/// A scene and a camera over a sequence of frames.
#[derive(Debug)]
pub struct FrameSequence<'a> {
    camera: Camera,
    /// Index of the camera in the file, if it is one of the file's.
    file_camera: Option<usize>,
    motion: CameraMotion,
    played: Option<AnimationPlayback<'a>>,
    frames_per_second: f64,
    /// Seconds since the animation's start at which it is held.
    held: Option<f64>,
    /// The last frame, if there was one.
    last: Option<f64>,
    has_cut: bool,
}

/// Index of the animation with this name or index.
///
/// # Errors
/// [`Error::Usage`] if the scene has no such animation, listing those that it has.
pub fn find_animation(scene: &Scene, wanted: &str) -> Result<usize> {
    let all = scene.rig.as_ref().map_or(&[][..], AnimationRig::animations);
    let by_index = wanted.parse::<usize>().ok().filter(|k| *k < all.len());
    by_index.or_else(|| all.iter().position(|a| a.name == wanted)).ok_or_else(|| {
        let names: Vec<_> = all.iter().enumerate().map(|(k, a)| format!("{k} '{}'", a.name)).collect();
        let there =
            if names.is_empty() { "the scene has none".to_owned() } else { format!("it has {}", names.join(", ")) };
        Error::Usage(format!("--animate {wanted}: no such animation; {there}"))
    })
}

/// Returns true if an animation moves or changes lights, or surfaces that emit light.
///
/// # Errors
/// [`Error::Usage`] when the scene has no such animation.
pub fn moves_lights(scene: &Scene, rig: &AnimationRig, animation: usize) -> Result<bool> {
    let motion = rig.motion(animation)?;
    let moves = |k: usize, mesh: usize| motion.instances.contains(&k) || motion.meshes.contains(&mesh);
    let emits = |mesh: usize| {
        scene.materials.get(scene.meshes[mesh].material).is_some_and(|m| m.emissive != Vec3::ZERO && !m.unlit)
    };
    let moves_emitter = scene.instances.iter().enumerate().any(|(k, i)| moves(k, i.mesh) && emits(i.mesh));
    Ok(moves_emitter || !rig.moving_lights(animation)?.is_empty() || rig.changes_light(animation)?)
}

impl<'a> FrameSequence<'a> {
    /// `file_camera`: the index of `camera` in the scene, so that an animation that moves it is
    /// followed. `animation`: an index ([`find_animation`]).
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
                let posed = moves_lights(scene, rig, animation)?.then(|| Arc::new(scene.clone()));
                Some(AnimationPlayback { rig, animation, pose: Pose::default(), posed })
            }
        };
        Ok(Self { camera, file_camera, motion, played, frames_per_second, held: None, last: None, has_cut: false })
    }

    /// Holds the animation at a time in seconds, if one is given; the camera's motion goes on.
    #[must_use]
    pub fn held_at(self, seconds: Option<f64>) -> Self {
        Self { held: seconds, ..self }
    }

    /// The motion that the scene must be flattened with.
    ///
    /// # Errors
    /// [`Error::Usage`] when the scene has no such animation.
    pub fn motion(&self) -> Result<Motion> {
        self.played.as_ref().map_or(Ok(Motion::default()), |p| p.rig.motion(p.animation))
    }

    /// Updates the tracer to a frame, and returns the camera and statistics. Animations loop.
    ///
    /// # Errors
    /// Those of [`Tracer::update`].
    pub fn frame(&mut self, frame: f64, tracer: &mut Tracer) -> Result<(Camera, UpdateStats)> {
        let mut camera = self.camera.clone();
        let mut stats = UpdateStats::default();
        if let Some(p) = &mut self.played {
            let (seconds, end) = match self.held {
                // its end is not its beginning
                Some(held) => (held, Playback::Once),
                None => (frame / self.frames_per_second, Playback::Loop),
            };
            p.rig.pose(p.animation, seconds, end, &mut p.pose)?;
            let posed = p.pose.cameras.iter().find(|(k, _)| Some(*k) == self.file_camera);
            if let Some(&(_, camera_to_world)) = posed {
                camera.camera_to_world = camera_to_world;
            }
            p.pose.set_lens(self.file_camera, &mut camera);
            if tracer.is_dynamic() {
                stats = tracer.update(&p.pose.changes())?;
            }
            stats.materials = tracer.set_materials(&p.pose.materials)?;
            if let Some(posed) = &mut p.posed {
                p.pose.apply(Arc::make_mut(posed));
            }
        }
        self.has_cut = self.last.is_some_and(|last| self.motion.has_cut(last, frame));
        self.last = Some(frame);
        Ok((self.motion.camera_at(camera, frame), stats))
    }

    /// Returns true if the camera was cut before the last frame: no earlier image tells of it.
    pub fn has_cut(&self) -> bool {
        self.has_cut
    }

    /// The scene as it is in the last frame, if its animation moves lights or emissive surfaces.
    pub fn posed_lights(&self) -> Option<&Arc<Scene>> {
        self.played.as_ref()?.posed.as_ref()
    }

    /// Returns true if the camera or the scene changes from frame to frame.
    pub fn moves(&self) -> bool {
        self.played.is_some() || !matches!(self.motion, CameraMotion::Still)
    }
}
