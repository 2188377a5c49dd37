//! One camera ray a pixel, traced or rasterized: who renders need not know which.

use super::{Primary, Raster, View};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::shaders::StreamShaders;
use crate::tracer::{Push, Stream, Tracer};

/// What finds the hits of a stream of camera rays, one through each pixel.
pub enum CameraRays {
    /// A tracer.
    Traced(Box<Stream>),
    /// Triangles that are drawn first.
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

    /// Has [`CameraRays::draw`] something to record?
    pub fn is_rasterized(&self) -> bool {
        matches!(self, Self::Rasterized(_))
    }

    /// Records what has to be drawn of a view before its rays, if anything.
    ///
    /// # Errors
    /// Those of [`Raster::draw`].
    pub fn draw(&self, recorder: &mut Recorder, tracer: &Tracer, view: &View) -> Result<()> {
        match self {
            Self::Traced(_) => Ok(()),
            Self::Rasterized(raster) => raster.draw(recorder, tracer, view).map(drop),
        }
    }

    /// Records the rays of a launch. The stream's parameters must be those of the view that was drawn last.
    pub fn record(&self, recorder: &mut Recorder, push: &Push) {
        match self {
            Self::Traced(stream) => stream.record(recorder, push),
            Self::Rasterized(raster) => raster.trace(recorder, push),
        }
    }
}
