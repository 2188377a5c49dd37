//! One camera ray per pixel, traced or rasterized behind one interface.

use super::{Primary, Raster, View};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::shaders::StreamShaders;
use crate::tracer::{Push, Stream, Tracer};

/// Finds the hits of a stream of camera rays, one through each pixel.
pub enum CameraRays {
    /// Rays are traced.
    Traced(Box<Stream>),
    /// The scene is rasterized first.
    Rasterized(Box<Raster>),
}

impl CameraRays {
    /// Compiles what a stream needs, and allocates for blocks of up to `size` pixels.
    ///
    /// # Errors
    /// Those of [`Tracer::stream`] and [`Raster::new`].
    pub fn new(tracer: &Tracer, shaders: &'static StreamShaders, primary: Primary, size: [u32; 2]) -> Result<Self> {
        Ok(match primary {
            Primary::Traced => Self::Traced(Box::new(tracer.stream(shaders)?)),
            Primary::Raster => Self::Rasterized(Box::new(Raster::new(tracer, shaders, size)?)),
        })
    }

    /// Is primary visibility rasterized, so that [`CameraRays::draw`] records commands?
    pub fn is_rasterized(&self) -> bool {
        matches!(self, Self::Rasterized(_))
    }

    /// Records the rasterization of a view, if any, before its rays.
    ///
    /// # Errors
    /// Those of [`Raster::draw`].
    pub fn draw(&self, recorder: &mut Recorder, tracer: &Tracer, view: &View) -> Result<()> {
        match self {
            Self::Traced(_) => Ok(()),
            Self::Rasterized(raster) => raster.draw(recorder, tracer, view).map(drop),
        }
    }

    /// Records the rays of a launch. The stream's parameters must be those of the last view drawn.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        match self {
            Self::Traced(stream) => stream.record(recorder, push),
            Self::Rasterized(raster) => raster.trace(recorder, push),
        }
    }
}
