//! The film: sums per pixel on the device, means and variances on the host.

/// Bytes of a pixel's record on the device: of each channel a sum and its compensation, of each a sum of squares and its compensation, then two
/// counts. `FilmPixel` of shaders/resolve.glsl and shaders/path_resolve.glsl.
pub const fn record_bytes(channels: usize) -> u64 {
    16 * channels as u64 + 8
}

/// A pixel's record as the device left it.
#[derive(Clone, Debug)]
pub struct FilmPixel {
    /// Sum and sum of squares of each channel.
    sums: Vec<[f64; 2]>,
    /// Samples that met the scene.
    pub covered: u32,
    /// Samples that were left out because they were not finite.
    pub not_finite: u32,
}

impl FilmPixel {
    /// Nothing was added.
    pub fn empty(channels: usize) -> Self {
        Self { sums: vec![[0.0; 2]; channels], covered: 0, not_finite: 0 }
    }

    /// From [`record_bytes`] bytes.
    pub fn read(bytes: &[u8]) -> Self {
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
        let channels = (words.len() - 2) / 4;
        // the compensation is what the sum has too much
        let total = |k: usize| f64::from(f32::from_bits(words[k])) - f64::from(f32::from_bits(words[k + 1]));
        Self {
            sums: (0..channels).map(|c| [total(2 * c), total(2 * (channels + c))]).collect(),
            covered: words[4 * channels],
            not_finite: words[4 * channels + 1],
        }
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

    /// Share of samples that met the scene.
    pub fn coverage(&self, samples: u32) -> f64 {
        f64::from(self.covered) / f64::from(samples.max(1))
    }
}

/// A finished film, rows from the top.
#[derive(Clone, Debug, Default)]
pub struct Film {
    /// Pixels in x.
    pub width: u32,
    /// Pixels in y.
    pub height: u32,
    /// Values of a pixel: 1 (accessibility) or 3 (linear RGB radiance).
    pub channels: usize,
    /// Mean over all samples of a pixel, channels interleaved.
    pub mean: Vec<f32>,
    /// Share of samples that met the scene.
    pub coverage: Vec<f32>,
    /// Variance of one sample, channels interleaved.
    pub variance: Vec<f32>,
    /// Samples taken.
    pub samples: Vec<u32>,
    /// Samples of all pixels that were left out because they were not finite.
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

    /// Puts a pixel of which `samples` were taken in its place.
    pub fn set(&mut self, index: usize, pixel: &FilmPixel, samples: u32) {
        // those that were left out were not taken
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

    /// One channel of the variances.
    pub fn variance_plane(&self, channel: usize) -> Vec<f32> {
        self.variance.iter().skip(channel).step_by(self.channels).copied().collect()
    }

    /// Mean over all pixels and channels and its standard error, from the pixels' own variances. Stratified sampling makes the true error
    /// smaller than that; that channels vary together, larger.
    pub fn mean_and_error(&self) -> (f64, f64) {
        let n = self.mean.len().max(1) as f64;
        let mean = self.mean.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
        let of = |k: usize| f64::from(self.samples[k / self.channels].max(1));
        let variance: f64 = self.variance.iter().enumerate().map(|(k, &v)| f64::from(v) / of(k)).sum();
        (mean, variance.sqrt() / n)
    }
}
