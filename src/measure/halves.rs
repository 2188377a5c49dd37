//! Reference images in two independent halves, so that the error of their mean is known.

use super::metrics::ImagePair;
use crate::error::Result;

/// Sums of the images of each half.
#[derive(Clone, Debug, Default)]
pub struct ReferenceHalves {
    sums: [Vec<f64>; 2],
    counts: [u32; 2],
}

impl ReferenceHalves {
    /// Adds an image to a half, 0 or 1. All images have the same size.
    pub fn add(&mut self, half: usize, image: &[f32]) {
        self.sums[half].resize(image.len(), 0.0);
        self.sums[half].iter_mut().zip(image).for_each(|(sum, v)| *sum += f64::from(*v));
        self.counts[half] += 1;
    }

    /// Mean of both halves.
    pub fn mean(&self) -> Vec<f32> {
        let [a, b] = &self.sums;
        let [n, m] = self.counts.map(f64::from);
        a.iter().zip(b).map(|(a, b)| (0.5 * (a / n + b / m)) as f32).collect()
    }

    /// Standard error of [`Self::mean`], root mean square over the channels of the pixels whose
    /// `mask` is above 0 (`None`: all).
    pub fn standard_error(&self, channels: usize, mask: Option<&[f32]>) -> Result<f64> {
        let half = |k: usize| -> Vec<f32> {
            self.sums[k].iter().map(|sum| (sum / f64::from(self.counts[k])) as f32).collect()
        };
        Ok(0.5 * ImagePair::new(&half(0), &half(1), channels, mask)?.rmse())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_that_differ_say_by_how_much() {
        let mut halves = ReferenceHalves::default();
        for (half, image) in [(0, [1.0, 2.0]), (1, [3.0, 2.0]), (0, [1.0, 2.0]), (1, [3.0, 4.0])] {
            halves.add(half, &image);
        }
        assert_eq!(halves.mean(), [2.0, 2.5]);
        assert!((halves.standard_error(1, None).unwrap() - 0.5 * 2.5f64.sqrt()).abs() < 1e-7);
        assert_eq!(halves.standard_error(1, Some(&[0.0, 1.0])).unwrap(), 0.5);
    }
}
