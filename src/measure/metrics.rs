//! Image metrics: `image` is compared with `reference`, both linear, over the pixels that
//! `coverage` counts. A metric of a pair that holds a value that is not finite is NaN
//! ([`ImagePair::non_finite`] counts them): invalid pixels must not be averaged away. A metric of
//! no pixels is NaN too.

use crate::{Error, Result};

/// Denominator's floor in [`ImagePair::rel_mse`], as is customary (Rousselle et al. 2011).
pub const REL_MSE_EPSILON: f64 = 1e-2;

/// Two images of the same size, and which of their pixels count.
#[derive(Clone, Copy, Debug)]
pub struct ImagePair<'a> {
    pub(super) image: &'a [f32],
    pub(super) reference: &'a [f32],
    pub(super) channels: usize,
    pub(super) coverage: Option<&'a [f32]>,
}

impl<'a> ImagePair<'a> {
    /// `image` and `reference` are interleaved with the given number of channels. `coverage` has
    /// one value a pixel: those above 0 count, `None` counts all.
    pub fn new(image: &'a [f32], reference: &'a [f32], channels: usize, coverage: Option<&'a [f32]>) -> Result<Self> {
        let wrong = |what: &str| Err(Error::Usage(format!("cannot compare images: {what}")));
        if channels == 0 || !image.len().is_multiple_of(channels) {
            return wrong("the number of values is not a multiple of the number of channels");
        }
        if image.len() != reference.len() {
            return wrong(&format!("they differ in size ({} and {} values)", image.len(), reference.len()));
        }
        if coverage.is_some_and(|c| c.len() != image.len() / channels) {
            return wrong("the coverage differs in size");
        }
        Ok(Self { image, reference, channels, coverage })
    }

    /// All counted pairs of values.
    pub(super) fn values(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let counts = move |i: usize| self.coverage.is_none_or(|c| c[i / self.channels] > 0.0);
        let pairs = self.image.iter().zip(self.reference).enumerate();
        pairs.filter(move |(i, _)| counts(*i)).map(|(_, (a, b))| (*a as f64, *b as f64))
    }

    fn mean(&self, f: impl Fn(f64, f64) -> f64) -> f64 {
        let (sum, n) = self.values().fold((0.0, 0u64), |(sum, n), (a, b)| (sum + f(a, b), n + 1));
        sum / n as f64
    }

    /// NaN when any counted value is not finite, else `x`.
    fn guarded(&self, x: f64) -> f64 {
        if self.non_finite() > 0 { f64::NAN } else { x }
    }

    /// Number of values (pixels times channels) that count.
    pub fn count(&self) -> u64 {
        self.values().count() as u64
    }

    /// Number of counted pairs in which either value is infinite or not a number.
    pub fn non_finite(&self) -> u64 {
        self.values().filter(|(a, b)| !(a.is_finite() && b.is_finite())).count() as u64
    }

    /// Mean squared error.
    pub fn mse(&self) -> f64 {
        self.guarded(self.mean(|a, b| (a - b) * (a - b)))
    }

    /// Root of the mean squared error.
    pub fn rmse(&self) -> f64 {
        self.mse().sqrt()
    }

    /// Mean of image - reference.
    pub fn bias(&self) -> f64 {
        self.guarded(self.mean(|a, b| a - b))
    }

    /// Mean of the absolute difference.
    pub fn mae(&self) -> f64 {
        self.guarded(self.mean(|a, b| (a - b).abs()))
    }

    /// Standard error of [`ImagePair::bias`], were pixels independent: the standard deviation of
    /// the pixels' mean differences over the root of their number. NaN for fewer than two pixels.
    pub fn bias_standard_error(&self) -> f64 {
        let counts = |i: &usize| self.coverage.is_none_or(|c| c[*i] > 0.0);
        let pixel = |values: &[f32], i: usize| {
            let values = &values[i * self.channels..(i + 1) * self.channels];
            values.iter().map(|v| f64::from(*v)).sum::<f64>() / self.channels as f64
        };
        let differences = || {
            (0..self.image.len() / self.channels)
                .filter(counts)
                .map(|i| pixel(self.image, i) - pixel(self.reference, i))
        };
        let n = differences().count() as f64;
        let mean = differences().sum::<f64>() / n;
        let squares: f64 = differences().map(|d| (d - mean).powi(2)).sum();
        self.guarded((squares / (n - 1.0) / n).sqrt())
    }

    /// Percentiles of the absolute difference, by linear interpolation between ranks, of `shares`
    /// from 0 to 1; NaN for no pixels.
    pub fn percentiles<const N: usize>(&self, shares: [f64; N]) -> [f64; N] {
        let mut differences: Vec<f64> = self.values().map(|(a, b)| (a - b).abs()).collect();
        differences.sort_by(f64::total_cmp);
        shares.map(|share| self.guarded(super::stats::percentile_of_sorted(&differences, share).unwrap_or(f64::NAN)))
    }

    /// Mean of one value a pixel over the pixels that count; NaN for none.
    pub fn mean_of(&self, map: &[f32]) -> f64 {
        let counted = map.iter().enumerate().filter(|(i, _)| self.coverage.is_none_or(|c| c[*i] > 0.0));
        let (sum, count) = counted.fold((0.0, 0u64), |(sum, n), (_, &e)| (sum + f64::from(e), n + 1));
        sum / count as f64
    }

    /// Greatest absolute difference.
    pub fn max_abs_difference(&self) -> f64 {
        self.guarded(self.values().map(|(a, b)| (a - b).abs()).reduce(f64::max).unwrap_or(f64::NAN))
    }

    /// Mean of (image - reference)^2 / (reference^2 + [`REL_MSE_EPSILON`]).
    pub fn rel_mse(&self) -> f64 {
        self.guarded(self.mean(|a, b| (a - b) * (a - b) / (b * b + REL_MSE_EPSILON)))
    }

    /// Peak signal-to-noise ratio in dB for a peak of 1; infinite for equal images.
    pub fn psnr(&self) -> f64 {
        -10.0 * self.mse().log10()
    }

    /// Mean of min(a/b, b/a) (Larsen 2019). Two zeros are alike and count 1 (there, 0); a zero
    /// against anything else counts 0, and so do values of opposite sign.
    pub fn minimum_ratio(&self) -> f64 {
        self.guarded(self.mean(|a, b| {
            if a == b {
                1.0
            } else if a * b <= 0.0 {
                0.0
            } else {
                (a / b).min(b / a)
            }
        }))
    }

    /// The Tanimoto coefficient a.b / (|a|^2 + |b|^2 - a.b) of the images as vectors; 1 for two
    /// black images.
    pub fn tanimoto(&self) -> f64 {
        let (ab, aa, bb) =
            self.values().fold((0.0, 0.0, 0.0), |(ab, aa, bb), (a, b)| (ab + a * b, aa + a * a, bb + b * b));
        let x = if aa == 0.0 && bb == 0.0 { 1.0 } else { ab / (aa + bb - ab) };
        if self.count() == 0 { f64::NAN } else { self.guarded(x) }
    }
}

/// Share of pixels, RGB, that differ by more than a tenth of white in any channel after 1 -
/// exp(-radiance).
pub fn bad_pixels(image: &[f32], reference: &[f32]) -> f64 {
    let shown = |x: &f32| 1.0 - (-x).exp();
    let bad = image.chunks_exact(3).zip(reference.chunks_exact(3));
    let bad = bad.filter(|(a, b)| !a.iter().zip(*b).all(|(a, b)| (shown(a) - shown(b)).abs() <= 0.1)).count();
    bad as f64 / (image.len() / 3).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_pixels_are_seen() {
        let reference = [0.0, 0.0, 0.0, 5.0, 5.0, 5.0];
        assert_eq!(bad_pixels(&reference, &reference), 0.0);
        // bright ones look alike
        assert_eq!(bad_pixels(&[0.0, 0.0, 0.0, 9.0, 9.0, 9.0], &reference), 0.0);
        assert_eq!(bad_pixels(&[0.0, 0.2, 0.0, 5.0, 5.0, 5.0], &reference), 0.5);
        assert_eq!(bad_pixels(&[0.0, f32::NAN, 0.0, 5.0, 5.0, 5.0], &reference), 0.5);
    }
}
