//! The film: sums per pixel on the device, means and variances on the host.

use bytemuck::{Pod, Zeroable};

/// `FilmPixel` of shaders/occlusion.glsl: compensated sums.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct FilmPixel {
    /// Sum and its compensation.
    pub sum: [f32; 2],
    /// Sum of squares and its compensation.
    pub sum_squares: [f32; 2],
    /// Samples that met the scene. The others count 0 and are not written; how many were taken the host knows.
    pub covered: u32,
    /// To a multiple of 8 bytes.
    pub reserved: u32,
}

impl FilmPixel {
    /// Mean over all samples; those that missed count 0.
    pub fn mean(&self, samples: u32) -> f64 {
        self.total() / samples.max(1) as f64
    }

    /// Unbiased variance of one sample (not of the mean); 0 with fewer than two samples.
    pub fn variance(&self, samples: u32) -> f64 {
        if samples < 2 {
            return 0.0;
        }
        let n = samples as f64;
        let squares = self.sum_squares[0] as f64 - self.sum_squares[1] as f64;
        ((squares - self.total() * self.total() / n) / (n - 1.0)).max(0.0)
    }

    /// Share of samples that met the scene.
    pub fn coverage(&self, samples: u32) -> f64 {
        self.covered as f64 / samples.max(1) as f64
    }

    fn total(&self) -> f64 {
        // the compensation is what the sum has too much
        self.sum[0] as f64 - self.sum[1] as f64
    }
}

/// A finished film, rows from the top.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Mean over all samples of a pixel.
    pub mean: Vec<f32>,
    /// Share of samples that met the scene.
    pub coverage: Vec<f32>,
    /// Variance of one sample.
    pub variance: Vec<f32>,
    /// Samples taken.
    pub samples: Vec<u32>,
}

impl Film {
    /// An empty film.
    pub fn new(width: u32, height: u32) -> Self {
        let n = width as usize * height as usize;
        Self { width, height, mean: vec![0.0; n], coverage: vec![0.0; n], variance: vec![0.0; n], samples: vec![0; n] }
    }

    /// Puts a pixel of which `samples` were taken in its place.
    pub fn set(&mut self, index: usize, pixel: &FilmPixel, samples: u32) {
        self.mean[index] = pixel.mean(samples) as f32;
        self.coverage[index] = pixel.coverage(samples) as f32;
        self.variance[index] = pixel.variance(samples) as f32;
        self.samples[index] = samples;
    }

    /// Mean of all pixels and its standard error, from the pixels' own variances. Stratified sampling makes the true error
    /// smaller than that.
    pub fn mean_and_error(&self) -> (f64, f64) {
        let n = self.mean.len().max(1) as f64;
        let mean = self.mean.iter().map(|&x| x as f64).sum::<f64>() / n;
        let variance: f64 = self.variance.iter().zip(&self.samples).map(|(&v, &s)| v as f64 / s.max(1) as f64).sum();
        (mean, variance.sqrt() / n)
    }
}
