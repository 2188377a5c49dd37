//! A scene on the device, with makers of its images: presets, plain accumulation, converged images.

use std::sync::Arc;
use std::time::Instant;

use glam::{DAffine3, DMat3};

use super::args::FramesSession;
use super::candidates::Candidate;
use super::frame_log::FrameLog;
use super::scenes::{CameraView, FramesScene};
use super::signal::{EqualTime, Sampler, Signal};
use crate::accel::flatten::FlatScene;
use crate::bench::record::{Row, plain, quantity};
use crate::denoise::{DenoiseInput, Features, Oidn};
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::displayed::{Displayed, FrameReference, ImageErrors};
use crate::measure::plain_time::{PlainClock, PlainTime};
use crate::raster::Primary;
use crate::realtime::sequence::FrameSequence;
use crate::realtime::{Preset, Realtime, Settings, Surface};
use crate::scene::builtin::moving_box::Mover;
use crate::scene::{Camera, Environment, EnvironmentMap, Orbit, Scene};
use crate::terminal::interrupt::SilentControl;
use crate::tracer::{BuildOptions, Changes, ComputeOptions, MaterialChange, MovedBounds, Tracer, UpdateStats};

/// Seeds of the halves of a reference; no preset has them.
pub const REFERENCE_SEEDS: [u32; 2] = [0x5eed_000a, 0x5eed_000b];
/// Seed of plain accumulation.
pub const PLAIN_SEED: u32 = 0x5eed_0100;
/// Images of plain accumulation whose time is taken before anything else.
pub const TIMED_IMAGES: u32 = 9;
/// How far the environment map turns in a frame, degrees: as far as the camera on its orbit.
pub const DEGREES_PER_FRAME: f64 = 0.5;

pub enum Motion<'a> {
    /// The camera goes round a point.
    Orbit(Orbit),
    /// The environment map turns.
    Sun(&'a EnvironmentMap),
    /// The scene's first animation plays.
    Animation(Box<FrameSequence<'a>>),
    /// The box of the room slides to and fro.
    Slide(Mover),
}

impl Motion<'_> {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Orbit(_) => "orbit",
            Self::Sun(_) => "sun",
            Self::Animation(_) => "animation",
            Self::Slide(_) => "slide",
        }
    }

    /// Whether objects move.
    pub fn moves_objects(&self) -> bool {
        matches!(self, Self::Animation(_) | Self::Slide(_))
    }
}

/// An image of plain accumulation, in the time that a preset takes.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlainImage {
    /// Paths per pixel, at least one.
    pub paths: u32,
    pub errors: ImageErrors,
}

impl PlainImage {
    /// Adds it to the row of the preset, whose errors are `ours`.
    pub fn add_to(&self, row: &mut Row, ours: &ImageErrors) {
        row.exact(plain("plain paths", ""), f64::from(self.paths)).exact(quantity::PLAIN_RMSE, self.errors.rmse);
        row.exact(quantity::PLAIN_CORRECTED, self.errors.corrected).exact(plain("plain FLIP", ""), self.errors.flip);
        row.exact(plain("over plain", ""), ours.over(&self.errors));
    }
}

/// Plain accumulation whose every frame is denoised, in the time that a preset takes.
#[derive(Clone, Copy, Debug, Default)]
pub struct DenoisedImage {
    /// Paths per pixel: at least one a frame.
    pub paths: u32,
    /// Time of a frame: paths and denoiser, perhaps more than the preset's.
    pub ms: f64,
    pub errors: ImageErrors,
}

impl DenoisedImage {
    /// Adds it to the row of the preset.
    pub fn add_to(&self, row: &mut Row) {
        row.exact(plain("oidn RMSE", ""), self.errors.rmse)
            .exact(plain("corrected oidn RMSE", ""), self.errors.corrected);
        row.exact(plain("oidn paths", ""), f64::from(self.paths)).exact(plain("oidn time", "ms"), self.ms);
    }
}

/// The rotation to a map that has been turned by so many degrees, counter-clockwise from above.
pub fn turned(map: &EnvironmentMap, degrees: f64) -> DMat3 {
    map.to_map * DMat3::from_rotation_y(-degrees.to_radians())
}

pub struct FrameInputs {
    pub camera: CameraRecord,
    pub moved: Vec<MovedBounds>,
    /// The rotation to the environment map, if it has turned.
    pub to_map: Option<DMat3>,
    /// The scene in its pose, if that moves lights.
    pub posed: Option<Arc<Scene>>,
    /// The change of materials.
    pub materials: MaterialChange,
    /// The time of updating the tracer, where objects move.
    pub update_seconds: Option<f64>,
}

impl FrameInputs {
    /// Changes the light of a frame to what is new in it.
    pub fn light(&self, realtime: &mut Realtime, tracer: &Tracer) -> Result<()> {
        if let Some(to_map) = self.to_map {
            realtime.turn_environment(to_map);
        }
        realtime.change_materials(self.materials);
        self.posed.as_ref().map_or(Ok(()), |posed| realtime.move_lights(tracer, posed))
    }
}

pub struct SceneStage<'a> {
    pub tracer: Tracer,
    pub flat: &'a FlatScene<'a>,
    pub camera: &'a Camera,
    pub size: [u32; 2],
    /// Seed of the samples of frames.
    pub seed: u32,
    /// How far ambient occlusion reaches, scene units.
    pub reach: f64,
    /// Time of plain accumulation, before anything else is measured.
    pub plain_time: PlainTime,
    signal: Signal,
    sampler: Sampler,
    oidn: Option<&'a Oidn>,
}

impl<'a> SceneStage<'a> {
    /// Builds the tracer for images of this size, and finds out how long a path takes.
    pub fn new(
        session: &FramesSession,
        (loaded, view): (&FramesScene, &'a CameraView),
        flat: &'a FlatScene<'a>,
        size: [u32; 2],
        bounces: Option<u32>,
        oidn: Option<&'a Oidn>,
    ) -> Result<Self> {
        // the tracer
        let (args, camera) = (session.args, &view.camera);
        let signal = Signal::new(args, size, loaded.reach, bounces)?;
        let build = BuildOptions { streams: signal.streams()?, ..args.build_options(size) };
        let (kind, _) = args.tracer.on(&session.device.info);
        let (needs, options) = (signal.needs()?, ComputeOptions::default());
        let tracer = Tracer::with_build(&session.device, kind, flat, needs, options, &build)?;

        // the time of images of paths; the first ones compile
        let mut sampler = signal.sampler(&tracer, flat, camera)?;
        let record = camera_record(camera, flat, size);
        sampler.time(&tracer, &record, &mut PlainClock::default())?;
        let mut clock = PlainClock::default();
        for _ in 0..TIMED_IMAGES {
            sampler.time(&tracer, &record, &mut clock)?;
        }
        let plain_time = clock.time();
        let oidn = oidn.filter(|_| signal.channels() == 3);
        let (reach, seed) = (loaded.reach, args.seed);
        let mut stage = Self { tracer, flat, camera, size, seed, reach, plain_time, signal, sampler, oidn };
        // before the first update there are no vertices of before
        stage.rest()?;
        Ok(stage)
    }

    pub fn channels(&self) -> usize {
        self.signal.channels()
    }

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
    pub fn move_to(&mut self, motion: &mut Motion, frame: u32) -> Result<FrameInputs> {
        // what stands still
        let camera = self.still_camera();
        if !motion.moves_objects() {
            self.rest()?;
        }
        let inputs = |camera, moved, to_map| FrameInputs {
            camera,
            moved,
            to_map,
            posed: None,
            update_seconds: None,
            materials: Default::default(),
        };
        let seconds = |update: &UpdateStats| Some(update.mesh_seconds + update.top_seconds);

        // what moves
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
                let materials = update.materials;
                let posed = sequence.posed_lights().cloned();
                if let Some(posed) = &posed {
                    self.sampler.move_lights(&self.tracer, posed)?;
                }
                let update_seconds = seconds(&update);
                FrameInputs { posed, materials, update_seconds, ..inputs(camera, update.moved, None) }
            }
            Motion::Slide(mover) => {
                let aspect = f64::from(self.size[0]) / f64::from(self.size[1]);
                let update = self.place(mover.sliding(frame, aspect))?;
                let update_seconds = seconds(&update);
                FrameInputs { update_seconds, ..inputs(camera, update.moved, None) }
            }
        })
    }

    /// Puts an instance somewhere.
    pub fn place(&mut self, instance: (usize, DAffine3)) -> Result<UpdateStats> {
        self.tracer.update(&Changes { instances: vec![instance], ..Default::default() })
    }

    /// Stops the motion of a dynamic scene: motion vectors are those since its last update.
    pub fn rest(&mut self) -> Result<()> {
        if self.tracer.is_dynamic() {
            self.tracer.update(&Changes::default())?;
        }
        Ok(())
    }

    /// Turns the environment map of plain and of converged images.
    pub fn turn_environment(&mut self, to_map: &DMat3) -> Result<()> {
        self.sampler.turn_environment(to_map)
    }

    pub fn settings(&self, candidate: &Candidate) -> Result<Settings> {
        Ok(Settings { seed: self.seed, ..self.signal.frame_settings(candidate)? })
    }

    /// Makes frames of a preset, without any history.
    pub fn realtime(&self, candidate: &Candidate) -> Result<Realtime> {
        self.realtime_with(candidate, self.settings(candidate)?)
    }

    /// Makes frames of a preset with other settings.
    pub fn realtime_with(&self, candidate: &Candidate, settings: Settings) -> Result<Realtime> {
        self.signal.realtime(&self.tracer, self.flat, self.camera, candidate.preset, settings)
    }

    /// The last of some frames, all with new camera rays: the camera moves by under 0.001 pixels.
    pub fn jittered_frames(
        &self,
        candidate: &Candidate,
        settings: Settings,
        frames: u32,
    ) -> Result<(Vec<f32>, FrameLog)> {
        let mut realtime = self.realtime_with(candidate, settings)?;
        let (mut log, camera) = (FrameLog::default(), self.still_camera());
        for frame in 0..frames {
            log.render_frame(&mut realtime, &self.tracer, &jittered(&camera, frame), &[])?;
        }
        Ok((realtime.result()?, log))
    }

    /// The surface in each pixel.
    pub fn surfaces(&self, camera: &CameraRecord) -> Result<Vec<Option<Surface>>> {
        let settings = Settings { primary: Some(Primary::Traced), ..Preset::Fast.settings() };
        let mut realtime = Realtime::new(&self.tracer, self.size, &settings, &[])?;
        realtime.frame(&self.tracer, camera, &[])?;
        realtime.surfaces()
    }

    /// Frames of a scene at rest, each of the next ones without any past.
    pub fn frames_afresh(&self, realtime: &mut Realtime, camera: &CameraRecord, frames: u32) -> Result<Vec<Vec<f32>>> {
        realtime.reset();
        let mut log = FrameLog::default();
        let mut render_one = |_| {
            log.render_frame(realtime, &self.tracer, camera, &[])?;
            realtime.result()
        };
        (0..frames).map(&mut render_one).collect()
    }

    /// An image as it is displayed.
    pub fn displayed(&self, image: &[f32]) -> Displayed {
        Displayed::new(image, self.channels())
    }

    /// A converged image of what the scene is now.
    pub fn reference(&mut self, camera: &CameraRecord, paths: u32) -> Result<FrameReference> {
        let mut half =
            |seed| Ok::<_, crate::Error>(self.sampler.render(&self.tracer, camera, paths.div_ceil(2), seed)?.0);
        let [a, b] = REFERENCE_SEEDS.map(&mut half);
        // of ambient visibility only pixels count that show something
        let mask = if self.channels() == 1 {
            let surfaces = self.surfaces(camera)?;
            Some(surfaces.iter().map(|s| f32::from(u8::from(s.is_some()))).collect())
        } else {
            None
        };
        FrameReference::new([&a?, &b?], self.channels(), self.size[0] as usize, mask)
    }

    /// Plain accumulation of so many paths.
    pub fn plain(&mut self, camera: &CameraRecord, paths: u32, seed: u32) -> Result<Vec<f32>> {
        Ok(self.sampler.render(&self.tracer, camera, paths, seed)?.0)
    }

    pub fn time_plain(&mut self, camera: &CameraRecord, clock: &mut PlainClock) -> Result<()> {
        self.sampler.time(&self.tracer, camera, clock)
    }

    /// Plain accumulation of so many paths, and its errors.
    pub fn plain_image(
        &mut self,
        camera: &CameraRecord,
        paths: u32,
        reference: &FrameReference,
        seed: u32,
    ) -> Result<PlainImage> {
        Ok(PlainImage { paths, errors: reference.errors_of(&self.plain(camera, paths, seed)?)? })
    }

    /// Plain accumulation over `frames` frames, each denoised, in a preset's time, and the last
    /// errors. Feature images take time where the camera moves (`is_moving`). `None` without a
    /// denoiser.
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

/// The camera, moved by under 0.001 pixels in every second frame: nothing is reused as it is.
fn jittered(camera: &CameraRecord, frame: u32) -> CameraRecord {
    let [width, height] = camera.view;
    CameraRecord { view: [if frame % 2 == 1 { width.next_up() } else { width }, height], ..*camera }
}

fn camera_record(camera: &Camera, flat: &FlatScene, size: [u32; 2]) -> CameraRecord {
    CameraRecord::new(camera, flat.origin, f64::from(size[0]) / f64::from(size[1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jittered_camera_moves_by_next_to_nothing() {
        let camera = CameraRecord {
            camera_to_world: [[0.0; 4]; 3],
            view: [0.7, 0.4],
            orthographic: false,
            clip: [0.0, f32::INFINITY],
        };
        let moved = jittered(&camera, 1);
        assert!(moved != camera && jittered(&camera, 2) == camera);
        // pixels, at the border of a wide image
        assert!((moved.view[0] - camera.view[0]) / camera.view[0] * 3840.0 < 1e-3);
    }
}
