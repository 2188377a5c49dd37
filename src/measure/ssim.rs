//! SSIM: how much of the structure of one image the other has.
//!
//! After Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error visibility to
//! structural similarity" (IEEE TIP 2004), with their window: a Gaussian of 1.5 pixels over 11x11
//! pixels, K1 = 0.01, K2 = 0.03, for values from 0 to 1. Colour images have the mean of their
//! channels.

use rayon::prelude::*;

use super::metrics::ImagePair;
use crate::{Error, Result};

/// Half the width of the window, pixels.
pub const RADIUS: usize = 5;
/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;
/// (K1 L)^2 and (K2 L)^2 of the paper, for a range L of 1.
const STABILIZERS: [f64; 2] = [1e-4, 9e-4];
/// Rows worked on at a time.
const BAND: usize = 32;

/// Mean SSIM over the pixels that count and whose window lies inside the image, -1 to 1; 1 for
/// equal images. `None` where there is no such pixel. Values are those of a display, 0 to 1; those
/// that are not finite are compared as 0. `width`: pixels in a row.
///
/// # Errors
/// [`Error::Usage`] if the width does not divide the image.
pub fn ssim(pair: &ImagePair, width: usize) -> Result<Option<f64>> {
    let (channels, pixels) = (pair.channels, pair.image.len() / pair.channels);
    if width == 0 || !pixels.is_multiple_of(width) {
        return Err(Error::Usage("cannot compute SSIM: the width does not divide the number of pixels".into()));
    }
    let height = pixels / width;
    if width <= 2 * RADIUS || height <= 2 * RADIUS {
        return Ok(None);
    }
    let window = window();
    let inner = height - 2 * RADIUS;
    // (sum, number of values) of each band of rows: sums in the same order whatever the number of
    // threads
    let sums: Vec<(f64, u64)> = (0..inner.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let rows = RADIUS + band * BAND..RADIUS + inner.min((band + 1) * BAND);
            let mut sum = (0.0, 0);
            for channel in 0..channels {
                for y in rows.clone() {
                    let filtered = filtered_row(pair, channel, y, width, &window);
                    for (x, moments) in filtered.iter().enumerate() {
                        if pair.coverage.is_none_or(|c| c[y * width + x + RADIUS] > 0.0) {
                            sum = (sum.0 + similarity(moments), sum.1 + 1);
                        }
                    }
                }
            }
            sum
        })
        .collect();
    let (sum, count) = sums.iter().fold((0.0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
    Ok((count > 0).then(|| sum / count as f64))
}

/// The Gaussian window along one axis; its weights add up to 1.
fn window() -> [f64; 2 * RADIUS + 1] {
    let weights: [f64; 2 * RADIUS + 1] =
        std::array::from_fn(|k| (-0.5 * ((k as f64 - RADIUS as f64) / SIGMA).powi(2)).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

/// Weighted means over a window: of both images, of their squares, and of their product.
type Moments = [f64; 5];

/// Moments of the windows around the pixels of row `y`, without `RADIUS` pixels at either end.
fn filtered_row(pair: &ImagePair, channel: usize, y: usize, width: usize, window: &[f64]) -> Vec<Moments> {
    let mut columns = vec![[0.0; 5]; width];
    for (k, weight) in window.iter().enumerate() {
        let row = (y + k - RADIUS) * width;
        for (x, sums) in columns.iter_mut().enumerate() {
            let at = (row + x) * pair.channels + channel;
            let value = |values: &[f32]| if values[at].is_finite() { f64::from(values[at]) } else { 0.0 };
            let (a, b) = (value(pair.image), value(pair.reference));
            for (sum, moment) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                *sum += weight * moment;
            }
        }
    }
    let along_x = |columns: &[Moments]| {
        let mut sums = [0.0; 5];
        for (column, weight) in columns.iter().zip(window) {
            sums.iter_mut().zip(column).for_each(|(sum, moment)| *sum += weight * moment);
        }
        sums
    };
    columns.windows(window.len()).map(along_x).collect()
}

/// Equation 13 of the paper.
fn similarity(&[a, b, aa, bb, ab]: &Moments) -> f64 {
    let [c1, c2] = STABILIZERS;
    let (variance_a, variance_b, covariance) = (aa - a * a, bb - b * b, ab - a * b);
    ((2.0 * a * b + c1) * (2.0 * covariance + c2)) / ((a * a + b * b + c1) * (variance_a + variance_b + c2))
}
