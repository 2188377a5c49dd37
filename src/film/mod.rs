//! The film: sums per pixel on the device, means and variances on the host. [`state`] has exact
//! sums.
//!
//! A render is a number of *steps* ([`schedule`]): each brings some tiles to a number of samples,
//! and between two of them a render may end or be saved. A step goes over the image in *blocks*
//! ([`block`]), as many pixels as device buffers hold; a block in batches of samples
//! ([`accumulate`]); a batch in launches of about 0.05 s ([`pace`]). The image depends on none of
//! these.

pub mod accumulate;
pub mod block;
pub mod camera;
mod control;
pub mod convergence;
pub mod display;
pub mod pace;
mod samples;
pub mod schedule;
pub mod state;
pub mod tile_mask;

pub use control::{Control, NoControl};
pub use samples::SampleSettings;

use crate::interface::records::film::{RgbFilmPixel, ScalarFilmPixel};

/// Maximum number of channels of a film.
pub const MAX_CHANNELS: usize = 3;

/// 32-bit words of a pixel's record on the device: for each channel a compensated sum (the sum and
/// its excess, after Kahan), then for each channel a compensated sum of squares, then two counts.
pub const fn record_words(channels: usize) -> usize {
    4 * channels + 2
}

const _: () = assert!(size_of::<ScalarFilmPixel>() as u64 == record_bytes(1));
const _: () = assert!(size_of::<RgbFilmPixel>() as u64 == record_bytes(3));

/// Bytes of a pixel's record on the device.
pub const fn record_bytes(channels: usize) -> u64 {
    4 * record_words(channels) as u64
}

/// A pixel's record, read back from the device.
#[derive(Clone, Copy, Debug, Default)]
pub struct FilmPixel {
    /// Sum and sum of squares of each channel.
    sums: [[f64; 2]; MAX_CHANNELS],
    /// Samples that hit geometry.
    pub covered: u32,
    /// Samples that were rejected because they were not finite.
    pub not_finite: u32,
}

impl FilmPixel {
    /// Decodes a record of [`record_words`] words.
    pub fn from_words(words: &[u32]) -> Self {
        let channels = (words.len() - 2) / 4;
        // the compensation is the excess of the rounded sum
        let total = |k: usize| f64::from(f32::from_bits(words[k])) - f64::from(f32::from_bits(words[k + 1]));
        let mut sums = [[0.0; 2]; MAX_CHANNELS];
        for (c, s) in sums.iter_mut().enumerate().take(channels) {
            *s = [total(2 * c), total(2 * (channels + c))];
        }
        Self { sums, covered: words[4 * channels], not_finite: words[4 * channels + 1] }
    }

    /// Mean over all samples; those that missed count 0.
    pub fn mean(&self, channel: usize, samples: u32) -> f64 {
        self.sums[channel][0] / f64::from(samples.max(1))
    }

    /// Unbiased variance of one sample (not of the mean); 0 with fewer than two samples.
    pub fn variance(&self, channel: usize, samples: u32) -> f64 {
        if samples < 2 {
            return 0.0;
        }
        let ([sum, squares], n) = (self.sums[channel], f64::from(samples));
        ((squares - sum * sum / n) / (n - 1.0)).max(0.0)
    }

    /// Pixel alpha: share of samples that hit geometry, in [0, 1].
    pub fn coverage(&self, samples: u32) -> f64 {
        f64::from(self.covered) / f64::from(samples.max(1))
    }
}

/// Mean over covered pixels and `channels` interleaved channels; 0 if nothing is covered.
pub fn covered_mean(values: &[f32], channels: usize, coverage: &[f32]) -> f64 {
    let covered: f64 = coverage.iter().map(|&x| f64::from(x)).sum();
    let values = values.iter().enumerate().filter(|(k, _)| coverage[k / channels] > 0.0);
    let sum: f64 = values.map(|(_, &x)| f64::from(x)).sum();
    if covered > 0.0 { sum / (covered * channels as f64) } else { 0.0 }
}

/// A finished film, rows from the top.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Number of channels: 1 (ambient visibility) or 3 (linear RGB radiance).
    pub channels: usize,
    /// Mean over all samples of a pixel, channels interleaved.
    pub mean: Vec<f32>,
    /// Pixel alpha: share of samples that hit geometry, in [0, 1].
    pub coverage: Vec<f32>,
    /// Variance of one sample, channels interleaved.
    pub variance: Vec<f32>,
    /// Samples of each pixel that count.
    pub samples: Vec<u32>,
    /// Samples of all pixels that were rejected because they were not finite.
    pub not_finite: u64,
}

impl Film {
    /// An empty film.
    pub fn new(width: u32, height: u32, channels: usize) -> Self {
        let n = width as usize * height as usize;
        Self {
            width,
            height,
            channels,
            mean: vec![0.0; channels * n],
            coverage: vec![0.0; n],
            variance: vec![0.0; channels * n],
            samples: vec![0; n],
            not_finite: 0,
        }
    }

    /// Sets the pixel at `index`, of which `samples` were taken.
    pub fn set(&mut self, index: usize, pixel: &FilmPixel, samples: u32) {
        // rejected samples do not count
        let counted = samples - pixel.not_finite.min(samples);
        for c in 0..self.channels {
            self.mean[self.channels * index + c] = pixel.mean(c, counted) as f32;
            self.variance[self.channels * index + c] = pixel.variance(c, counted) as f32;
        }
        self.coverage[index] = pixel.coverage(counted) as f32;
        self.samples[index] = counted;
        self.not_finite += u64::from(pixel.not_finite);
    }

    /// One channel of the means.
    pub fn plane(&self, channel: usize) -> Vec<f32> {
        self.mean.iter().skip(channel).step_by(self.channels).copied().collect()
    }

    /// The film of one channel as one of three that are equal.
    pub fn as_grey(&self) -> Self {
        let three = |values: &[f32]| values.iter().flat_map(|v| [*v; 3]).collect();
        Self { channels: 3, mean: three(&self.mean), variance: three(&self.variance), ..self.clone() }
    }

    /// One channel of the variances.
    pub fn variance_plane(&self, channel: usize) -> Vec<f32> {
        self.variance.iter().skip(channel).step_by(self.channels).copied().collect()
    }

    /// Minimum, mean and maximum number of samples of a pixel.
    pub fn samples_range(&self) -> (u32, f64, u32) {
        let sum: u64 = self.samples.iter().map(|&n| u64::from(n)).sum();
        let least = self.samples.iter().copied().min().unwrap_or(0);
        (least, sum as f64 / self.samples.len().max(1) as f64, self.samples.iter().copied().max().unwrap_or(0))
    }

    /// RMSE of the image, estimated from the variances of its pixels: the root mean square of the
    /// standard errors of the means. Stratified sampling makes the true error smaller.
    pub fn estimated_rmse(&self) -> f64 {
        (self.summed_square_errors() / self.mean.len().max(1) as f64).sqrt()
    }

    /// Mean over all pixels and channels and its standard error, from the pixels' own variances.
    /// Stratification makes the true error smaller, correlation between channels larger.
    pub fn mean_and_error(&self) -> (f64, f64) {
        let n = self.mean.len().max(1) as f64;
        let mean = self.mean.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
        (mean, self.summed_square_errors().sqrt() / n)
    }

    fn summed_square_errors(&self) -> f64 {
        let samples = |k: usize| f64::from(self.samples[k / self.channels].max(1));
        self.variance.iter().enumerate().map(|(k, &v)| f64::from(v) / samples(k)).sum()
    }
}
