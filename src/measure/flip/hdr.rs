//! FLIP of images whose values exceed what a display shows.
//!
//! After Andersson, Nilsson, Shirley and Akenine-Möller, "Visualizing Errors in Rendered High
//! Dynamic Range Images" (Eurographics 2021, short papers): the images are tone mapped at several
//! exposures, and a pixel's error is the largest of them.

use rayon::prelude::*;

use super::colour::luminance;
use super::flip;
use crate::Result;
use crate::measure::metrics::ImagePair;

/// Tone-mapped luminance that the brightest pixel and the median one have at the first and the last
/// exposure.
const TARGET: f64 = 0.85;
/// The least median luminance: that of a mostly black image would ask for endless exposures.
const MIN_MEDIAN: f64 = f32::EPSILON as f64;
/// Numerator and denominator of the tone mapping operator (Narkowicz's fit of ACES, with the
/// pre-exposure of 0.6 that the paper takes out): (c0 x^2 + c1 x) / (d0 x^2 + d1 x + d2).
const NUMERATOR: [f64; 2] = [0.6 * 0.6 * 2.51, 0.6 * 0.03];
const DENOMINATOR: [f64; 3] = [0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14];

/// How different two images look at the exposures at which one would look at them.
#[derive(Clone, Debug, PartialEq)]
pub struct HdrFlip {
    /// The error of each pixel, covered or not, in [0, 1]. NaN where a value is not finite.
    pub map: Vec<f32>,
    /// Mean over the pixels that count; NaN for none, or when one of them is broken.
    pub mean: f64,
    /// First and last exposure, stops.
    pub stops: [f64; 2],
    /// Number of exposures.
    pub exposures: u32,
}

/// As [`flip`], for linear values of any size. The exposures follow from the reference; `None` if
/// that has no luminance above 0.
///
/// # Errors
/// Those of [`flip`].
pub fn flip_hdr(pair: &ImagePair, width: usize, pixels_per_degree: f64) -> Result<Option<HdrFlip>> {
    let Some(stops) = exposure_range(pair) else { return Ok(None) };
    let exposures = (stops[1] - stops[0]).ceil().max(2.0) as u32;
    let step = (stops[1] - stops[0]) / f64::from(exposures - 1);
    let mut map = vec![0f32; pair.image.len() / pair.channels];
    for k in 0..exposures {
        let gain = (stops[0] + f64::from(k) * step).exp2() as f32;
        let [image, reference] = [pair.image, pair.reference].map(|values| tone_mapped(values, gain));
        let at = flip(&ImagePair { image: &image, reference: &reference, ..*pair }, width, pixels_per_degree)?;
        // a pixel that is not finite stays so
        map.iter_mut().zip(at.map).for_each(|(worst, e)| *worst = if e.is_nan() { e } else { worst.max(e) });
    }
    let mean = pair.mean_of(&map);
    Ok(Some(HdrFlip { map, mean, stops, exposures }))
}

/// The exposures, in stops, that bring the greatest and the median luminance of the reference, over
/// the pixels that count, to [`TARGET`].
fn exposure_range(pair: &ImagePair) -> Option<[f64; 2]> {
    let mut luminances: Vec<f32> = match pair.channels {
        3 => pair.reference.par_chunks_exact(3).map(|p| luminance(p[0], p[1], p[2])).collect(),
        _ => pair.reference.to_vec(),
    };
    let mut counts = pair.coverage.unwrap_or_default().iter();
    luminances.retain(|l| counts.next().is_none_or(|c| *c > 0.0) && l.is_finite());
    let greatest = luminances.iter().copied().fold(0.0, f32::max);
    if greatest <= 0.0 {
        return None;
    }
    let middle = luminances.len() / 2;
    let median = *luminances.select_nth_unstable_by(middle, f32::total_cmp).1;
    let stops = |l: f64| (brought_to(TARGET) / l).log2();
    let range = [stops(f64::from(greatest)), stops(f64::from(median).max(MIN_MEDIAN))];
    // of an image darker than the least median the greatest would come last
    Some([range[0].min(range[1]), range[1]])
}

/// The value that the tone mapping operator maps to `shown`.
fn brought_to(shown: f64) -> f64 {
    let [a, b, c] =
        [NUMERATOR[0] - shown * DENOMINATOR[0], NUMERATOR[1] - shown * DENOMINATOR[1], -shown * DENOMINATOR[2]];
    (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a)
}

fn tone_mapped(values: &[f32], gain: f32) -> Vec<f32> {
    let ([n0, n1], [d0, d1, d2]) = (NUMERATOR.map(|c| c as f32), DENOMINATOR.map(|c| c as f32));
    let map = |v: &f32| {
        // f32::max would turn NaN into 0, and large values into a quotient of infinities
        let x = if *v < 0.0 { 0.0 } else { (v * gain).min(1e9) };
        if v.is_finite() { (x * (n0 * x + n1) / (x * (d0 * x + d1) + d2)).min(1.0) } else { f32::NAN }
    };
    values.par_iter().with_min_len(4096).map(map).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_operator_is_inverted() {
        let x = brought_to(TARGET);
        assert!((f64::from(tone_mapped(&[x as f32], 1.0)[0]) - TARGET).abs() < 1e-6);
        assert_eq!(tone_mapped(&[0.0, -1.0, f32::MAX], 2.0), [0.0, 0.0, 1.0]);
        assert!(tone_mapped(&[f32::NAN, f32::INFINITY], 1.0).iter().all(|v| v.is_nan()));
    }
}
