//! A scene on the device, with all that makes images of it: frames of presets, plain accumulation, converged images.

use std::sync::Arc;
use std::time::Instant;

use glam::DMat3;

use super::FramesSession;
use super::displayed::FrameReference;
use super::scenes::FramesScene;
use super::signal::{EqualTime, PlainClock, PlainTime, Sampler, Signal};
use crate::accel::flatten::FlatScene;
use crate::bench::record::frames::{DenoisedImage, PlainImage};
use crate::denoise::{DenoiseInput, Features, Oidn};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::realtime::sequence::FrameSequence;
use crate::realtime::{Preset, Realtime, Settings};
use crate::scene::{Camera, Environment, EnvironmentMap, Orbit, Scene};
use crate::terminal::interrupt::SilentControl;
use crate::tracer::{BuildOptions, Changes, ComputeOptions, MovedBounds, Tracer};

/// Seeds of the halves of a reference; no preset has them.
pub const REFERENCE_SEEDS: [u32; 2] = [0x5eed_000a, 0x5eed_000b];
/// Seed of plain accumulation.
pub const PLAIN_SEED: u32 = 0x5eed_0100;
/// Images of plain accumulation whose time is taken before anything else.
pub const TIMED_IMAGES: u32 = 9;
/// Times of plain accumulation that are taken between frames.
const TIMES_BETWEEN: usize = 4;
/// How far the environment map turns in a frame, degrees: as far as the camera on its orbit.
pub const DEGREES_PER_FRAME: f64 = 0.5;

/// What moves.
pub enum Motion<'a> {
    /// The camera goes round a point.
    Orbit(Orbit),
    /// The environment map turns.
    Sun(&'a EnvironmentMap),
    /// The scene's first animation plays.
    Animation(Box<FrameSequence<'a>>),
}

impl Motion<'_> {
    /// In records.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Orbit(_) => "orbit",
            Self::Sun(_) => "sun",
            Self::Animation(_) => "animation",
        }
    }
}

/// The rotation to a map that has been turned by so many degrees, counter-clockwise from above.
pub fn turned(map: &EnvironmentMap, degrees: f64) -> DMat3 {
    map.to_map * DMat3::from_rotation_y(-degrees.to_radians())
}

/// What is new in a frame.
pub struct FrameInputs {
    /// From where the scene is seen.
    pub camera: CameraRecord,
    /// What has moved in it.
    pub moved: Vec<MovedBounds>,
    /// The rotation to the environment map, if it has turned.
    pub to_map: Option<DMat3>,
    /// The scene in its pose, if that moves lights.
    pub posed: Option<Arc<Scene>>,
}

impl FrameInputs {
    /// Changes the light of a frame to what is new in it.
    ///
    /// # Errors
    /// Those of [`Realtime::move_lights`].
    pub fn light(&self, realtime: &mut Realtime, tracer: &Tracer) -> Result<()> {
        if let Some(to_map) = self.to_map {
            realtime.turn_environment(to_map);
        }
        self.posed.as_ref().map_or(Ok(()), |posed| realtime.move_lights(tracer, posed))
    }
}

/// A scene on the device.
pub struct Stage<'a> {
    /// Holds the scene.
    pub tracer: Tracer,
    /// What the tracer was built from.
    pub flat: &'a FlatScene<'a>,
    /// From where it is seen.
    pub camera: &'a Camera,
    /// Pixels.
    pub size: [u32; 2],
    /// Seed of the samples of frames.
    pub seed: u32,
    /// Time of plain accumulation, before anything else is measured.
    pub plain_time: PlainTime,
    signal: Signal,
    sampler: Sampler,
    oidn: Option<&'a Oidn>,
}

impl<'a> Stage<'a> {
    /// Builds the tracer and finds out how long a path takes.
    ///
    /// # Errors
    /// Those of the device; Ctrl-C.
    pub fn new(
        session: &FramesSession,
        loaded: &'a FramesScene,
        flat: &'a FlatScene<'a>,
        bounces: Option<u32>,
        oidn: Option<&'a Oidn>,
    ) -> Result<Self> {
        let (args, camera) = (session.args, &loaded.camera);
        let signal = Signal::new(args, loaded.reach, bounces);
        let size = args.size();
        let rays = u64::from(size[0]) * u64::from(size[1]) * u64::from(args.reference_paths());
        let build = BuildOptions { preset: args.build.preset(), rays, cache: None, streams: signal.streams()? };
        let (kind, _) = args.tracer.on(session.device.info());
        let tracer = session.device.tracer(flat, kind, signal.needs()?, ComputeOptions::default(), &build)?;
        let mut sampler = signal.sampler(&tracer, flat, camera)?;
        let record = camera_record(camera, flat, size);
        // the first images compile
        sampler.time(&tracer, &record, &mut PlainClock::default())?;
        let mut clock = PlainClock::default();
        for _ in 0..TIMED_IMAGES {
            sampler.time(&tracer, &record, &mut clock)?;
        }
        let plain_time = clock.time();
        let oidn = oidn.filter(|_| signal.channels() == 3);
        let mut stage = Self { tracer, flat, camera, size, seed: args.seed, plain_time, signal, sampler, oidn };
        // before the first update there are no vertices of before
        stage.rest()?;
        Ok(stage)
    }

    /// Values per pixel.
    pub fn channels(&self) -> usize {
        self.signal.channels()
    }

    /// The camera that stands still.
    pub fn still_camera(&self) -> CameraRecord {
        self.camera_record(self.camera)
    }

    /// A camera as shaders read it.
    pub fn camera_record(&self, camera: &Camera) -> CameraRecord {
        camera_record(camera, self.flat, self.size)
    }

    /// The environment map, if the frames depend on one.
    pub fn map(&self) -> Option<&'a EnvironmentMap> {
        match &self.flat.scene.environment {
            Environment::Map(map) if self.sampler.options().is_some_and(|o| o.white_sky.is_none()) => Some(map),
            _ => None,
        }
    }

    /// Brings scene, camera and light to a frame. Frames need not come in order.
    ///
    /// # Errors
    /// Those of updating the tracer.
    pub fn go(&mut self, motion: &mut Motion, frame: u32) -> Result<FrameInputs> {
        let camera = self.still_camera();
        if !matches!(motion, Motion::Animation(_)) {
            self.rest()?;
        }
        let inputs = |camera, moved, to_map| FrameInputs { camera, moved, to_map, posed: None };
        Ok(match motion {
            Motion::Orbit(orbit) => {
                inputs(self.camera_record(&orbit.camera_at(self.camera, f64::from(frame))), Vec::new(), None)
            }
            Motion::Sun(map) => {
                let to_map = turned(map, DEGREES_PER_FRAME * f64::from(frame));
                self.turn_environment(&to_map)?;
                inputs(camera, Vec::new(), Some(to_map))
            }
            Motion::Animation(sequence) => {
                let (_, update) = sequence.frame(f64::from(frame), &mut self.tracer)?;
                let posed = sequence.posed_lights().cloned();
                if let Some(posed) = &posed {
                    self.sampler.move_lights(&self.tracer, posed)?;
                }
                FrameInputs { posed, ..inputs(camera, update.moved, None) }
            }
        })
    }

    /// Tells a dynamic scene that it stands still in the next frame: motion vectors are those since its last update.
    ///
    /// # Errors
    /// Those of [`Tracer::update`].
    pub fn rest(&mut self) -> Result<()> {
        if self.tracer.is_dynamic() {
            self.tracer.update(&Changes::default())?;
        }
        Ok(())
    }

    /// Turns the environment map of plain and of converged images.
    ///
    /// # Errors
    /// Those of the device.
    pub fn turn_environment(&mut self, to_map: &DMat3) -> Result<()> {
        self.sampler.turn_environment(to_map)
    }

    /// Makes frames of a preset, without any history.
    ///
    /// # Errors
    /// Those of the device.
    pub fn realtime(&self, preset: Preset) -> Result<Realtime> {
        self.realtime_with_seed(preset, self.seed)
    }

    /// The same with other samples.
    ///
    /// # Errors
    /// Those of the device.
    pub fn realtime_with_seed(&self, preset: Preset, seed: u32) -> Result<Realtime> {
        let how = Settings { seed, ..self.signal.frame_settings(preset)? };
        self.signal.realtime(&self.tracer, self.flat, self.camera, preset, how)
    }

    /// As [`Stage::realtime`], but frames at rest take as many paths as those in motion.
    ///
    /// # Errors
    /// Those of the device.
    pub fn realtime_as_in_motion(&self, preset: Preset) -> Result<Realtime> {
        let how = Settings { seed: self.seed, converge: false, ..self.signal.frame_settings(preset)? };
        self.signal.realtime(&self.tracer, self.flat, self.camera, preset, how)
    }

    /// Paths, or rays, of a pixel in a frame of a preset.
    ///
    /// # Errors
    /// Those of settings.
    pub fn rays_per_pixel(&self, preset: Preset) -> Result<u32> {
        Ok(self.signal.frame_settings(preset)?.rays_per_pixel)
    }

    /// A converged image of what the scene is now.
    ///
    /// # Errors
    /// Those of the device; Ctrl-C.
    pub fn reference(&mut self, camera: &CameraRecord, paths: u32) -> Result<FrameReference> {
        let mut half = |seed| Ok::<_, crate::Error>(self.sampler.render(&self.tracer, camera, paths.div_ceil(2), seed)?.0);
        let [a, b] = REFERENCE_SEEDS.map(&mut half);
        FrameReference::new([&a?, &b?], self.channels(), self.size[0] as usize)
    }

    /// Plain accumulation of so many paths.
    ///
    /// # Errors
    /// Those of the device; Ctrl-C.
    pub fn plain(&mut self, camera: &CameraRecord, paths: u32, seed: u32) -> Result<Vec<f32>> {
        Ok(self.sampler.render(&self.tracer, camera, paths, seed)?.0)
    }

    /// Takes the time of plain accumulation.
    ///
    /// # Errors
    /// Those of the device; Ctrl-C.
    pub fn time_plain(&mut self, camera: &CameraRecord, clock: &mut PlainClock) -> Result<()> {
        self.sampler.time(&self.tracer, camera, clock)
    }

    /// Plain accumulation of so many paths, and its errors.
    ///
    /// # Errors
    /// Those of the device; Ctrl-C.
    pub fn plain_image(
        &mut self,
        camera: &CameraRecord,
        paths: u32,
        reference: &FrameReference,
        seed: u32,
    ) -> Result<PlainImage> {
        Ok(PlainImage { paths, errors: reference.errors_of(&self.plain(camera, paths, seed)?)? })
    }

    /// Plain accumulation over `frames` frames in the time of a preset's, every one of them denoised, and the errors of the last. Feature images count where the camera
    /// moves (`is_moving`): of one that stands still they are rendered once. `None` where Open Image Denoise is not there.
    ///
    /// # Errors
    /// Those of the device and the library; Ctrl-C.
    pub fn denoised(
        &mut self,
        camera: &CameraRecord,
        (time, frames, is_moving): (&EqualTime, u32, bool),
        reference: &FrameReference,
        seed: u32,
    ) -> Result<Option<DenoisedImage>> {
        let (Some(oidn), Some(options)) = (self.oidn, self.sampler.options().cloned()) else { return Ok(None) };
        let start = Instant::now();
        let input = DenoiseInput { tracer: &self.tracer, scene: self.flat.scene, camera, options: &options };
        let features = Features::render(&input, &mut SilentControl)?;
        let mut denoiser_ms = if is_moving { 1e3 * start.elapsed().as_secs_f64() } else { 0.0 };
        let denoise = |image: &[f32]| {
            let start = Instant::now();
            let out = oidn.denoise(self.size, image, &features.albedo, &features.normals)?;
            Ok::<_, crate::Error>((out, 1e3 * start.elapsed().as_secs_f64()))
        };
        // what the denoiser takes does not depend on the image
        denoiser_ms += denoise(&vec![0.5; features.albedo.len()])?.1;
        // an image a frame
        let paths = frames * time.paths_beside(denoiser_ms);
        let image = self.sampler.render(&self.tracer, camera, paths, seed)?.0;
        let errors = reference.errors_of(&denoise(&image)?.0)?;
        let PlainTime { per_image, per_path } = time.plain();
        let ms = denoiser_ms + per_image + f64::from(paths / frames) * per_path;
        Ok(Some(DenoisedImage { paths, ms, errors }))
    }
}

/// Is the time of plain accumulation taken after a frame, counted from 0, of so many whose time counts from `first` on?
pub fn is_plain_timed(frame: u32, first: usize, frames: u32) -> bool {
    let step = (frames as usize - first).div_ceil(TIMES_BETWEEN);
    (frame as usize).checked_sub(first).is_some_and(|n| n.is_multiple_of(step.max(1)))
}

fn camera_record(camera: &Camera, flat: &FlatScene, size: [u32; 2]) -> CameraRecord {
    CameraRecord::new(camera, flat.origin, f64::from(size[0]) / f64::from(size[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_accumulation_is_timed_between_late_frames() {
        let at = |frames: u32, first: usize| (0..frames).filter(|f| is_plain_timed(*f, first, frames)).collect::<Vec<_>>();
        assert_eq!(at(96, 48), [48, 60, 72, 84]);
        assert_eq!(at(8, 0), [0, 2, 4, 6]);
        assert_eq!(at(4, 2), [2, 3]);
    }
}
