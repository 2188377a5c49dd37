//! Stills of a scene and a camera over time, which frames in real time approximate.

use std::time::Instant;

use super::complete::{Completed, SCENE_OPTIONS};
use super::frames::{DEFAULT_FPS, camera_motion};
use super::laps::Laps;
use super::still::{Still, StillExtras, identity};
use super::{RenderSettings, Renderer};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::output::Image;
use crate::realtime::frame_settings::FrameRange;
use crate::realtime::sequence::{CameraMotion, find_animation};
use crate::scene::animation::{Playback, Pose};
use crate::scene::load::load_camera_path;
use crate::scene::{Camera, Scene};

/// Stills of a time line ([`Renderer::still_sequence`]).
pub struct StillSequence<'r> {
    renderer: &'r mut Renderer,
    /// Completed once, for the first frame, so that neither light nor AO radius changes.
    completed: Completed,
    /// The camera without motion.
    camera: Camera,
    motion: CameraMotion,
    /// Index of the camera in the file, if it is one of the file's.
    file_camera: Option<usize>,
    animation: Option<PosedAnimation>,
    range: FrameRange,
    fps: f64,
    /// Seconds since the animation's start at which it is held.
    held: Option<f64>,
}

/// An animation, and the scene at rest.
struct PosedAnimation {
    index: usize,
    pose: Pose,
    rest: Scene,
}

impl Renderer {
    /// Prepares stills, one for each of `settings.frames`.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings that have no effect together or do not fit the scene.
    pub fn still_sequence(&mut self, settings: &RenderSettings) -> Result<StillSequence<'_>> {
        settings.check()?;
        if !settings.is_still_sequence() {
            return Err(Error::Usage(
                "stills of a time line need --spp or --quality, and no setting of frames in real time".into(),
            ));
        }
        if settings.film.resume.is_some() || settings.film.keeps_state() {
            return Err(Error::Usage(
                "--resume, --resumable and --intervals are for one still: leave them out (--continue leaves out frames that are finished)".into(),
            ));
        }
        let timeline = &settings.frames;
        let range = timeline.range();
        let path = timeline.camera_path.as_deref().map(load_camera_path).transpose()?;
        let first_of_path = path.as_ref().map(|path| path.camera_at(f64::from(range.first)));
        let fps = timeline.fps.or(path.as_ref().map(|p| p.fps())).unwrap_or(DEFAULT_FPS);
        let completed = self.complete(settings, first_of_path)?;
        let motion = camera_motion(&self.scene, path, timeline.orbit)?;
        let file_camera = self.scene.cameras.iter().position(|c| *c == completed.camera);
        let animation = match timeline.animation() {
            None => None,
            Some(name) => {
                let index = find_animation(&self.scene, name)?;
                Some(PosedAnimation { index, pose: Pose::default(), rest: self.scene.clone() })
            }
        };
        let camera = completed.camera.clone();
        Ok(StillSequence {
            renderer: self,
            completed,
            camera,
            motion,
            file_camera,
            animation,
            range,
            fps,
            held: timeline.time,
        })
    }
}

impl StillSequence<'_> {
    /// The numbers of the frames.
    pub fn range(&self) -> FrameRange {
        self.range
    }

    /// Choices that settings left to the scene, a sentence each.
    pub fn choices(&self) -> &[String] {
        &self.completed.choices
    }

    /// Image size in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.completed.settings.size(&self.renderer.scene)
    }

    /// Returns true if an image is the finished frame of this number: its metadata name the same
    /// scene, camera and settings, and as many samples.
    ///
    /// # Errors
    /// Those of posing the scene.
    pub fn is_finished(&mut self, number: u32, image: &Image) -> Result<bool> {
        let camera = self.pose(number)?;
        let settings = &self.completed.settings;
        let job = settings.job(&self.renderer.scene, &camera);
        let has = |key: &str, text: &str| image.metadata.iter().any(|(k, v)| k == key && v == text);
        let same = identity(settings.integrator().get(), &job, None).iter().all(|(key, text)| match text {
            Some(text) => has(key, text),
            None => !image.metadata.iter().any(|(k, _)| k == key) || key.ends_with(".hash"),
        });
        let scene = crate::files::portable_name(&self.renderer.name);
        let options = self.renderer.scene_options(&settings.scene);
        let same_options = image.metadata(SCENE_OPTIONS) == options.as_deref();
        let has_samples = match settings.film.quality {
            Some(quality) => has("quality", quality.name()),
            None => has("spp", &job.samples.spp.to_string()),
        };
        Ok(same && same_options && has_samples && has("scene", &scene) && [image.width, image.height] == self.size())
    }

    /// Renders the still of a frame. Animations loop.
    ///
    /// # Errors
    /// Those of [`Renderer::still`].
    pub fn render(&mut self, number: u32, control: &mut dyn Control) -> Result<Still> {
        let started = (Instant::now(), Laps::after_open(self.renderer.open_seconds.wall));
        self.completed.camera = self.pose(number)?;
        let mut still = self.renderer.still_of(
            &self.completed,
            StillExtras { fixed_exposure: true, ..Default::default() },
            started,
            control,
            &mut |_| Ok(()),
        )?;
        still.image.metadata.push(("frame".into(), number.to_string()));
        still.image.metadata.sort();
        Ok(still)
    }

    /// Moves the scene to a frame, and returns its camera.
    fn pose(&mut self, number: u32) -> Result<Camera> {
        let frame = f64::from(number);
        let mut camera = self.camera.clone();
        if let Some(PosedAnimation { index, pose, rest }) = &mut self.animation {
            let none = || Error::Usage("the scene has no animations".into());
            let (seconds, end) = match self.held {
                // its end is not its beginning
                Some(held) => (held, Playback::Once),
                None => (frame / self.fps, Playback::Loop),
            };
            rest.rig.as_ref().ok_or_else(none)?.pose(*index, seconds, end, pose)?;
            pose.apply(&mut self.renderer.scene);
            let moves = !pose.instances.is_empty() || !pose.meshes.is_empty();
            if moves || !pose.materials.is_empty() || !pose.hidden.is_empty() {
                self.renderer.tracer = None;
            }
            if let Some(&(_, to_world)) = pose.cameras.iter().find(|(k, _)| Some(*k) == self.file_camera) {
                camera.camera_to_world = to_world;
            }
            pose.set_lens(self.file_camera, &mut camera);
        }
        Ok(self.motion.camera_at(camera, frame))
    }
}

impl Drop for StillSequence<'_> {
    /// The renderer's scene is at rest again.
    fn drop(&mut self) {
        if let Some(animation) = self.animation.take() {
            self.renderer.scene = animation.rest;
            self.renderer.tracer = None;
        }
    }
}
