//! Reference images: many rays a pixel, through the middles of the pixels, in two independent halves, so that the error
//! of the reference itself is known.

use super::candidates::Occlusion;
use crate::bench::record::ao::ImageErrors;
use crate::bench::record::without_reference;
use crate::bench::reference::ReferenceHalves;
use crate::error::Result;
use crate::film::camera::CameraRecord;
use crate::measure::flip::{PIXELS_PER_DEGREE, flip};
use crate::measure::metrics::ImagePair;
use crate::raster::Primary;
use crate::realtime::{Preset, Realtime, Settings, Surface};
use crate::terminal::interrupt;
use crate::tracer::Tracer;

/// Rays of a pixel in one frame of a half: few enough that the user can interrupt it.
const AT_ONCE: u32 = 16;
/// Seeds of the two halves: no preset has them.
const SEEDS: [u32; 2] = [0x5eed_000a, 0x5eed_000b];

/// A reference image, and what its pixels show.
pub struct AoReference {
    /// The mean of both halves.
    pub image: Vec<f32>,
    /// 1 where something is.
    pub coverage: Vec<f32>,
    /// Standard error of `image`.
    pub rmse: f64,
    /// What each pixel shows.
    pub surfaces: Vec<Option<Surface>>,
    width: usize,
}

/// Makes references of one size.
pub struct ReferenceRenderer {
    halves: [Realtime; 2],
    frames: u32,
    width: usize,
}

impl ReferenceRenderer {
    /// Of `rays` a pixel in all, rounded up to what divides evenly.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(tracer: &Tracer, size: [u32; 2], occlusion: &Occlusion, rays: u32) -> Result<Self> {
        let half = rays.div_ceil(2);
        let at_once = half.min(AT_ONCE);
        let settings = |seed| {
            let primary = Some(Primary::Traced);
            occlusion.of(Settings { seed, rays_per_pixel: at_once, primary, ..Preset::Reference.settings() })
        };
        let [a, b] = SEEDS.map(|seed| Realtime::new(tracer, size, &settings(seed), &[]));
        Ok(Self { halves: [a?, b?], frames: half.div_ceil(at_once), width: size[0] as usize })
    }

    /// Renders what the tracer holds now. Two references draw the same samples: what did not change between them is the same to the bit.
    ///
    /// # Errors
    /// Those of the device; [`crate::Error::Interrupted`].
    pub fn render(&mut self, tracer: &Tracer, camera: &CameraRecord) -> Result<AoReference> {
        let mut halves = ReferenceHalves::default();
        for (k, realtime) in self.halves.iter_mut().enumerate() {
            realtime.rewind();
            for _ in 0..self.frames {
                interrupt::check()?;
                realtime.frame(tracer, camera, &[])?;
                halves.add(k, &realtime.result()?);
            }
        }
        let [first, _] = &mut self.halves;
        let (coverage, surfaces) = (first.coverage()?, first.surfaces()?);
        let rmse = halves.standard_error(1, Some(&coverage))?;
        Ok(AoReference { image: halves.mean(), coverage, rmse, surfaces, width: self.width })
    }
}

impl AoReference {
    /// Pixels that show something.
    pub fn covered(&self) -> u64 {
        self.coverage.iter().filter(|c| **c > 0.0).count() as u64
    }

    /// RMSE of an image over the covered pixels, as measured.
    pub fn rmse_of(&self, image: &[f32]) -> Result<f64> {
        Ok(ImagePair::new(image, &self.image, 1, Some(&self.coverage))?.rmse())
    }

    /// RMSE of an image over some pixels.
    pub fn rmse_over(&self, image: &[f32], mask: &[f32]) -> Result<f64> {
        Ok(ImagePair::new(image, &self.image, 1, Some(mask))?.rmse())
    }

    /// Every error of an image, over the covered pixels.
    pub fn errors_of(&self, image: &[f32]) -> Result<ImageErrors> {
        let pair = ImagePair::new(image, &self.image, 1, Some(&self.coverage))?;
        let rmse = pair.rmse();
        Ok(ImageErrors {
            rmse,
            rmse_corrected: without_reference(rmse, self.rmse),
            bias: pair.bias(),
            flip: flip(&pair, self.width, PIXELS_PER_DEGREE)?.mean,
            tanimoto: pair.tanimoto(),
            minimum_ratio: pair.minimum_ratio(),
        })
    }
}
