//! Radiance or ambient visibility: makers of its frames, and of plain and converged images.

use std::time::Instant;

use glam::DMat3;

use super::args::{BenchFramesArgs, FalloffChoice};
use super::candidates::{Candidate, CommonOcclusion};
use super::frame_log::TypicalFrame;
use crate::accel::flatten::FlatScene;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::integrators::path::{PathIntegrator, PathOptions};
use crate::measure::plain_time::{PlainClock, PlainTime};
use crate::raster::Primary;
use crate::realtime::frame_settings::Antialias;
use crate::realtime::{Filter, FilterKind, Preset, Realtime, Settings, Technique};
use crate::renderer::RenderSettings;
use crate::renderer::frames::{
    frame_needs, frame_path_options, frame_settings, frame_streams, is_ambient_occlusion, pipeline,
};
use crate::scene::{Camera, Scene};
use crate::settings::{Capability, Length};
use crate::shaders::StreamShaders;
use crate::terminal::interrupt::{self, SilentControl};
use crate::tracer::{Needs, Tracer};

/// Paths of a pixel in one image at most.
const MAX_PATHS: u32 = 1 << 16;
/// Occlusion rays of a pixel in one launch at most.
const MAX_RAYS: u32 = 256;

/// The signal in frames of one scene.
pub struct Signal {
    settings: RenderSettings,
    size: [u32; 2],
    occlusion: Option<CommonOcclusion>,
}

impl Signal {
    /// The requested signal in an image of this size; occlusion up to `reach` scene units, paths of
    /// at most `bounces` (`None`: the integrator's).
    pub fn new(args: &BenchFramesArgs, size: [u32; 2], reach: f64, bounces: Option<u32>) -> Result<Self> {
        let mut settings = RenderSettings { integrator: Some(args.integrator()), ..RenderSettings::default() };
        settings.image.size = Some(size);
        settings.integrators.path.max_depth = bounces;
        let mut occlusion = None;
        if args.is_occlusion() {
            // through the middles of pixels, which all presets can
            settings.frames.antialias = Some(Antialias::Off);
            occlusion = Some(CommonOcclusion::new(reach, args.ao_falloff == FalloffChoice::Binary)?);
        } else if args.integrator().get().capabilities().contains(&Capability::AmbientOcclusion) {
            settings.integrators.ao.ao_radius = Some(Length::Units(reach));
        }
        Ok(Self { settings, size, occlusion })
    }

    pub fn channels(&self) -> usize {
        if is_ambient_occlusion(self.settings.integrator()) { 1 } else { 3 }
    }

    fn render_settings(&self, preset: Preset) -> RenderSettings {
        let mut settings = self.settings.clone();
        settings.frames.preset = Some(preset);
        settings
    }

    /// Settings of a preset's frames, as `render` has them; all work is done in every frame.
    pub fn frame_settings(&self, candidate: &Candidate) -> Result<Settings> {
        self.preset_settings(candidate.preset, candidate.technique)
    }

    fn preset_settings(&self, preset: Preset, technique: Option<Technique>) -> Result<Settings> {
        let mut render = self.render_settings(preset);
        render.frames.technique = technique;
        let settings = Settings { rest: false, ..frame_settings(&render)? };
        Ok(self.occlusion.map_or(settings, |occlusion| occlusion.apply_to(settings)))
    }

    /// Scene data that a tracer needs for all of this.
    pub fn needs(&self) -> Result<Needs> {
        Ok(frame_needs(&self.settings, &self.preset_settings(Preset::Balanced, None)?))
    }

    /// Streams that are traced.
    pub fn streams(&self) -> Result<Vec<&'static StreamShaders>> {
        Ok(frame_streams(&self.settings, &self.preset_settings(Preset::Balanced, None)?))
    }

    /// Makes frames of a preset with settings like its [`Signal::frame_settings`].
    pub fn realtime(
        &self,
        tracer: &Tracer,
        flat: &FlatScene,
        camera: &Camera,
        preset: Preset,
        frame: Settings,
    ) -> Result<Realtime> {
        let settings = self.render_settings(preset);
        let options = frame_path_options(&settings, flat.scene, camera, self.size, &frame)?;
        let options = options.map(|options| options.with_samples(|s| s.seed = frame.seed));
        pipeline(tracer, flat, self.size, &frame, options.as_ref())
    }

    /// Makes images of independent samples.
    pub fn sampler(&self, tracer: &Tracer, flat: &FlatScene, camera: &Camera) -> Result<Sampler> {
        let frame = self.preset_settings(Preset::Balanced, None)?;
        Ok(match frame_path_options(&self.settings, flat.scene, camera, self.size, &frame)? {
            Some(options) => {
                let options = options.with_samples(|s| s.spp = MAX_PATHS);
                Sampler::Paths { integrator: Box::new(PathIntegrator::new(tracer, flat, &options)?), options }
            }
            None => {
                let filter = Filter { kind: FilterKind::None, ..frame.filter };
                let settings = Settings { history: 1, filter, primary: Some(Primary::Traced), ..frame };
                Sampler::Rays { settings, size: self.size }
            }
        })
    }
}

/// Makes images of independent samples: paths of stills, or unfiltered occlusion without history.
pub enum Sampler {
    Paths {
        integrator: Box<PathIntegrator>,
        options: PathOptions,
    },
    /// Ambient visibility.
    Rays {
        /// Settings of a frame, but for the number of rays.
        settings: Settings,
        size: [u32; 2],
    },
}

impl Sampler {
    /// Options of paths, if it traces any.
    pub fn options(&self) -> Option<&PathOptions> {
        match self {
            Self::Paths { options, .. } => Some(options),
            Self::Rays { .. } => None,
        }
    }

    /// Turns the environment map.
    pub fn turn_environment(&mut self, to_map: &DMat3) -> Result<()> {
        match self {
            Self::Paths { integrator, .. } => integrator.turn_environment(to_map),
            Self::Rays { .. } => Ok(()),
        }
    }

    /// Moves the lights to where they are in `scene`, which is that of the tracer in another pose.
    pub fn move_lights(&mut self, tracer: &Tracer, scene: &Scene) -> Result<()> {
        match self {
            Self::Paths { integrator, .. } => integrator.move_lights(tracer, scene),
            Self::Rays { .. } => Ok(()),
        }
    }

    /// An image of `paths` samples per pixel, and the seconds that it took.
    pub fn render(&mut self, tracer: &Tracer, camera: &CameraRecord, paths: u32, seed: u32) -> Result<(Vec<f32>, f64)> {
        match self {
            Self::Paths { integrator, .. } => {
                let start = Instant::now();
                let result = integrator.render(tracer, camera, paths.min(MAX_PATHS), seed, &mut SilentControl)?;
                Ok((result.image.film.mean, start.elapsed().as_secs_f64()))
            }
            Self::Rays { settings, size } => {
                let launches = paths.div_ceil(MAX_RAYS);
                let rays_per_pixel = paths.div_ceil(launches);
                let mut realtime = Realtime::new(tracer, *size, &Settings { rays_per_pixel, seed, ..*settings }, &[])?;
                let (mut sums, mut seconds) = (Vec::new(), 0.0);
                for _ in 0..launches {
                    interrupt::check()?;
                    let start = Instant::now();
                    realtime.frame(tracer, camera, &[])?;
                    seconds += start.elapsed().as_secs_f64();
                    let image = realtime.result()?;
                    sums.resize(image.len(), 0f64);
                    sums.iter_mut().zip(&image).for_each(|(sum, v)| *sum += f64::from(*v));
                }
                Ok((sums.into_iter().map(|s| (s / f64::from(launches)) as f32).collect(), seconds))
            }
        }
    }

    /// Takes the times of an image of few and one of many paths.
    pub fn time(&mut self, tracer: &Tracer, camera: &CameraRecord, clock: &mut PlainClock) -> Result<()> {
        clock.take(|paths| Ok(self.render(tracer, camera, paths, 0)?.1))
    }
}

/// The time of a preset's frames, in paths of plain accumulation.
#[derive(Clone, Debug)]
pub struct EqualTime {
    plain: PlainTime,
    /// In their order. At rest those after the first few are long.
    frames: Vec<TypicalFrame>,
}

impl EqualTime {
    /// The time of these frames, at least one.
    pub fn new(plain: PlainTime, frames: Vec<TypicalFrame>) -> Self {
        Self { plain, frames }
    }

    pub fn plain(&self) -> PlainTime {
        self.plain
    }

    /// As many paths as fit into the time of the first frames, in stills or in frames, whichever
    /// are more: images cost more than their paths, and many paths at once cost less.
    pub fn paths(&self, frames: u32) -> u32 {
        // plain accumulation is timed by the clock, too
        self.plain.paths_in(self.ms(frames)).max(self.first(frames).iter().map(|f| f.paths).sum::<f64>() as u32)
    }

    /// Time of the first frames, milliseconds.
    pub fn ms(&self, frames: u32) -> f64 {
        self.first(frames).iter().map(|f| f.ms).sum()
    }

    fn first(&self, frames: u32) -> &[TypicalFrame] {
        &self.frames[..self.frames.len().min(frames as usize)]
    }

    /// As many as fit into the last frame beside what takes so many milliseconds.
    pub fn paths_beside(&self, ms: f64) -> u32 {
        let Some(last) = self.frames.last() else { return 1 };
        self.plain.paths_in(last.ms - ms).max((last.paths * (1.0 - ms / last.ms)) as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_fit_a_time() {
        let time = PlainTime { per_image: 3.0, per_path: 2.0 };
        let frame = TypicalFrame { ms: 10.0, paths: 8.0 };
        let equal = EqualTime::new(time, vec![frame; 10]);
        // (10 - 3) / 2 of images; 8 of frames
        assert_eq!([equal.paths(1), equal.paths_beside(5.0), equal.paths_beside(50.0)], [8, 4, 1]);
        assert_eq!(EqualTime::new(time, vec![TypicalFrame { paths: 2.0, ..frame }; 10]).paths(10), 48);
        // short frames, then long ones
        let short = TypicalFrame { ms: 5.0, paths: 0.5 };
        let rest = EqualTime::new(time, vec![short, short, frame, frame]);
        assert_eq!([1, 2, 3, 4, 5].map(|n| rest.paths(n)), [1, 3, 9, 17, 17]);
    }
}
