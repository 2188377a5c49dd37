//! An image against the truth: numbers, and a heat map.

use std::sync::Arc;

use crate::error::Result;
use crate::measure::flip::{PIXELS_PER_DEGREE, flip};
use crate::measure::metrics::ImagePair;
use crate::output::palette::heat;
use crate::renderer::interactive::{ViewPicture, ViewValues};
use crate::viewer::request::Comparison;

/// Compares the values of two views of the same size, over the pixels that show the scene in
/// either. Where one of them is grey, the luminances are compared.
///
/// # Errors
/// [`crate::Error::Usage`] for views of different sizes.
pub fn compare(image: &ViewValues, truth: &ViewValues, truth_samples: u32) -> Result<Comparison> {
    let is_grey = image.channels != truth.channels;
    let [a, b] = [image, truth].map(|v| if is_grey { luminances(&v.values, v.channels) } else { v.values.clone() });
    let channels = if is_grey { 1 } else { image.channels };
    let coverage: Vec<f32> = image.coverage.iter().zip(&truth.coverage).map(|(a, b)| a.max(*b)).collect();
    let pair = ImagePair::new(&a, &b, channels, Some(&coverage))?;
    let flip = flip(&pair, image.size[0] as usize, PIXELS_PER_DEGREE)?;
    let variance = truth.variance.as_ref().map(|v| {
        let counts = |k: usize| truth.coverage[k / truth.channels] > 0.0;
        let counted = v.iter().enumerate().filter(|(k, _)| counts(*k));
        let (sum, n) = counted.fold((0.0, 0u64), |(sum, n), (_, v)| (sum + f64::from(*v), n + 1));
        (sum / n.max(1) as f64).sqrt()
    });
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    let pixels = flip.map.iter().flat_map(|&e| opaque(heat(e))).collect();
    Ok(Comparison {
        request: 0,
        rmse: pair.rmse(),
        bias: pair.bias(),
        flip: flip.mean,
        // one sample has no variance
        truth_error: variance.filter(|_| truth_samples > 1),
        truth_samples,
        heat_map: Arc::new(ViewPicture { size: image.size, rgba: pixels }),
    })
}

fn luminances(values: &[f32], channels: usize) -> Vec<f32> {
    match channels {
        3 => values.chunks_exact(3).map(|c| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]).collect(),
        _ => values.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(channels: usize, values: Vec<f32>, variance: f32) -> ViewValues {
        let n = values.len();
        ViewValues {
            size: [2, 2],
            channels,
            values,
            coverage: vec![1.0, 1.0, 1.0, 0.0],
            variance: Some(vec![variance; n]),
        }
    }

    #[test]
    fn background_does_not_count() {
        let a = values(1, vec![0.5, 0.5, 0.5, 9.0], 0.0);
        let b = values(1, vec![0.4, 0.6, 0.5, 0.0], 0.01);
        let c = compare(&a, &b, 7).unwrap();
        assert!((c.rmse - (0.02f64 / 3.0).sqrt()).abs() < 1e-6 && c.bias.abs() < 1e-6, "{c:?}");
        assert!((c.truth_error.unwrap() - 0.1).abs() < 1e-6 && c.truth_samples == 7 && c.flip > 0.0);
        assert_eq!((c.heat_map.size, c.heat_map.rgba.len()), ([2, 2], 16));
    }

    #[test]
    fn grey_is_compared_with_luminance() {
        let a = values(1, vec![0.5; 4], 0.0);
        let b = values(3, [[0.5; 3]; 4].concat(), 0.0);
        let c = compare(&a, &b, 1).unwrap();
        assert!(c.rmse < 1e-6 && c.truth_error.is_none(), "one sample says nothing of its error: {c:?}");
    }
}
