//! Settings of an image's samples, whatever is sampled.

use std::sync::Arc;
use std::time::Duration;

use super::schedule::FilmOptions;
use super::tile_mask::TileMask;
use crate::interface::PixelFilter;

/// Settings of an image's samples that all integrators have in common.
#[derive(Clone, Debug)]
pub struct SampleSettings {
    /// Image size in pixels.
    pub size: [u32; 2],
    /// Samples per pixel; the maximum, if sampling adapts.
    pub spp: u32,
    /// Seed of the sampler.
    pub seed: u32,
    /// Pixel reconstruction filter.
    pub pixel_filter: PixelFilter,
    /// Stop after this time and keep the samples taken so far.
    pub time_limit: Option<Duration>,
    /// Keep the rays of the first sample, if the integrator can and the film starts empty.
    pub keep_rays: bool,
    /// Tiles of the image that can show geometry; `None`: all tiles are traced. An image that shows
    /// its environment, or pixels that see beyond their area, need all tiles.
    pub tile_mask: Option<Arc<TileMask>>,
    /// The film to resume, and when to save it.
    pub film: FilmOptions,
}

impl Default for SampleSettings {
    fn default() -> Self {
        Self {
            size: [1280, 720],
            spp: 16,
            seed: 0,
            pixel_filter: PixelFilter::Box,
            time_limit: None,
            keep_rays: false,
            tile_mask: None,
            film: FilmOptions::default(),
        }
    }
}

impl SampleSettings {
    /// Settings of `spp` samples per pixel of an image of `size` pixels, all others their defaults.
    pub fn new(size: [u32; 2], spp: u32, seed: u32) -> Self {
        Self { size, spp, seed, ..Self::default() }
    }

    /// Number of samples of all pixels together.
    pub fn count(&self) -> u64 {
        u64::from(self.spp) * u64::from(self.size[0]) * u64::from(self.size[1])
    }
}
