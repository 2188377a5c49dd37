//! Films of radiance with less noise, and a bias in its place: `filter` is the filter of frames in real time over radiance, on the device of the
//! tracer; [`Oidn`] is Intel's Open Image Denoise. Both are told what the pixels show by [`Features`].

mod features;
mod filter;

pub use crate::gpu::oidn::Oidn;
pub use features::{Features, GRID, PixelContent};
pub use filter::Settings;

use crate::error::Result;
use crate::film::Control;
use crate::film::Film;
use crate::film::camera::CameraRecord;
use crate::integrators::path::PathOptions;
use crate::scene::Scene;
use crate::tracer::Tracer;

/// What films show.
#[derive(Clone, Copy)]
pub struct DenoiseInput<'a> {
    /// Made for paths.
    pub tracer: &'a Tracer,
    /// The tracer's.
    pub scene: &'a Scene,
    /// Of the film.
    pub camera: &'a CameraRecord,
    /// How it was rendered.
    pub options: &'a PathOptions,
}

/// What takes the noise away.
pub enum Denoiser {
    /// The project's own.
    Filter(Settings),
    /// Open Image Denoise.
    Oidn(Oidn),
}

impl Denoiser {
    /// As options and files call it.
    pub fn name(&self) -> &'static str {
        match self {
            Denoiser::Filter(_) => "filter",
            Denoiser::Oidn(_) => "oidn",
        }
    }

    /// The film's means without most of their noise: linear radiance, channels interleaved, rows from the top. `features` are
    /// those of the same shot.
    ///
    /// # Errors
    /// Those of the device, [`crate::Error::Interrupted`] when `control` says so, and those of the library.
    pub fn denoise(
        &self,
        shot: &DenoiseInput,
        film: &Film,
        features: &Features,
        control: &mut dyn Control,
    ) -> Result<Vec<f32>> {
        match self {
            Denoiser::Filter(settings) => filter::filter(shot, film, features, settings, control),
            Denoiser::Oidn(oidn) => oidn.denoise([film.width, film.height], &film.mean, &features.albedo, &features.normals),
        }
    }
}
