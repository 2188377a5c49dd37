//! Denoising of films (biased): `filter` applies the spatial filter of the real-time renderer to
//! radiance or ambient visibility, on the tracer's device; [`Oidn`] is Intel's Open Image Denoise.
//! Both are guided by the feature images of [`Features`].

mod features;
mod filter;
mod nlmeans;

pub use crate::gpu::oidn::Oidn;
pub use features::{Features, GRID, PixelContent};
pub use filter::Settings;

use crate::error::Result;
use crate::film::Control;
use crate::film::Film;
use crate::film::camera::CameraRecord;
use crate::integrators::path::PathOptions;
use crate::scene::Scene;
use crate::settings::choices;
use crate::tracer::Tracer;

choices! {
    /// Denoiser of stills.
    pub enum DenoiseChoice {
        /// Open Image Denoise if it is installed, else the filter
        Auto = "auto",
        /// Intel Open Image Denoise: a neural network, on the CPU
        Oidn = "oidn",
        /// The filter of real-time ambient occlusion
        Filter = "filter",
    }
}

/// The scene, camera and options with which a film was rendered.
#[derive(Clone, Copy)]
pub struct DenoiseInput<'a> {
    /// A tracer that was built for path tracing.
    pub tracer: &'a Tracer,
    /// The tracer's scene.
    pub scene: &'a Scene,
    /// The film's camera.
    pub camera: &'a CameraRecord,
    /// The options of the path integrator; ambient occlusion has those of a white sky.
    pub options: &'a PathOptions,
}

/// A denoiser.
pub enum Denoiser {
    /// skylit's cross-bilateral filter.
    Filter(Settings),
    /// Open Image Denoise.
    Oidn(Oidn),
}

impl Denoiser {
    /// Name in options and metadata.
    pub fn name(&self) -> &'static str {
        match self {
            Denoiser::Filter(_) => "filter",
            Denoiser::Oidn(_) => "oidn",
        }
    }

    /// Denoises the means of the film: linear radiance or ambient visibility, channels interleaved,
    /// rows from the top. `features` must be rendered from the same input.
    ///
    /// # Errors
    /// Those of the device or the library; [`crate::Error::Interrupted`] when `control` says so.
    pub fn denoise(
        &self,
        shot: &DenoiseInput,
        film: &Film,
        features: &Features,
        control: &mut dyn Control,
    ) -> Result<Vec<f32>> {
        // both filter three channels: ambient visibility is three equal ones
        let grey = (film.channels == 1).then(|| film.as_grey());
        let colour = grey.as_ref().unwrap_or(film);
        let own = |means: Vec<f32>| match film.channels {
            1 => means.into_iter().step_by(3).collect(),
            _ => means,
        };
        match self {
            Denoiser::Filter(settings) => {
                let filtered = filter::filter(shot, colour, features, settings, control)?;
                let mut means = own(filtered.means);
                nlmeans::refine(shot.tracer.device(), film, &filtered.depths, &mut means, control)?;
                Ok(means)
            }
            Denoiser::Oidn(oidn) => {
                Ok(own(oidn.denoise([film.width, film.height], &colour.mean, &features.albedo, &features.normals)?))
            }
        }
    }
}
