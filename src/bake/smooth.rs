//! A filter of noise in the texture: an edge-avoiding a-trous wavelet (Dammertz et al. 2010), whose
//! weights follow the surface and what samples say of their noise. Neighbours in the texture that
//! are none on the surface, those of another chart, have no weight.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// A texel that the filter reads.
#[derive(Clone, Copy, Debug)]
pub struct FilterTexel {
    /// The value, mean of its samples.
    pub value: Vec3,
    /// Variance of the value's length or first channel.
    pub variance: f32,
    /// Position in world space.
    pub position: DVec3,
    /// Unit normal.
    pub normal: Vec3,
    /// A surface covers it.
    pub is_covered: bool,
}

/// Passes, of distances 1, 2 and 4.
const PASSES: u32 = 3;
/// Weights of the B3 spline.
const SPLINE: [f32; 5] = [1.0 / 16.0, 1.0 / 4.0, 3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
/// Standard deviations of the noise by which a neighbour's value may differ for a weight of 1 / e.
const NOISE: f32 = 3.0;
/// Exponent of the cosine between normals.
const NORMAL_POWER: i32 = 32;
/// Distances of texels on the surface by which neighbours may be farther apart than in the texture.
const STRETCH: f64 = 2.0;

/// Filters the values; those that no surface covers stay.
pub fn smooth(texels: &mut [FilterTexel], [width, height]: [u32; 2]) {
    let size = [width as usize, height as usize];
    let pitch: Vec<f64> = (0..texels.len()).into_par_iter().map(|at| pitch_at(texels, at, size[0])).collect();
    for pass in 0..PASSES {
        let before: &[FilterTexel] = texels;
        let filtered: Vec<(Vec3, f32)> = (0..texels.len())
            .into_par_iter()
            .map(|at| filtered_texel(before, size, at, 1 << pass, pitch[at]))
            .collect();
        for (texel, (value, variance)) in texels.iter_mut().zip(filtered) {
            (texel.value, texel.variance) = (value, variance);
        }
    }
}

/// Value and variance of a texel after a pass of neighbours `step` texels apart. `pitch`: distance
/// on the surface to the next texel.
fn filtered_texel(
    texels: &[FilterTexel],
    [width, height]: [usize; 2],
    at: usize,
    step: i64,
    pitch: f64,
) -> (Vec3, f32) {
    let own = texels[at];
    if !own.is_covered {
        return (own.value, own.variance);
    }
    let (mut sum, mut variance, mut total) = (Vec3::ZERO, 0.0, 0.0);
    for (j, wy) in (-2i64..=2).zip(SPLINE) {
        for (i, wx) in (-2i64..=2).zip(SPLINE) {
            // neighbours of the same surface
            let (x, y) = ((at % width) as i64 + i * step, (at / width) as i64 + j * step);
            if x < 0 || y < 0 || x >= width as i64 || y >= height as i64 {
                continue;
            }
            let other = texels[y as usize * width + x as usize];
            let reach = STRETCH * pitch * ((i * i + j * j) as f64).sqrt() * step as f64;
            if !other.is_covered || (other.position - own.position).length() > reach {
                continue;
            }

            // by what noise explains of the difference, and by how alike they face
            let noise = NOISE * NOISE * (own.variance + other.variance) + 1e-8;
            let differs = (other.value - own.value).length_squared() / noise;
            let faces = own.normal.dot(other.normal).max(0.0).powi(NORMAL_POWER);
            let weight = wx * wy * faces * (-differs).exp();
            sum += weight * other.value;
            variance += weight * weight * other.variance;
            total += weight;
        }
    }

    // the texel itself has its weight, unless its normal is no unit vector
    if total > 0.0 { (sum / total, variance / (total * total)) } else { (own.value, own.variance) }
}

/// Distance on the surface from a texel to the next, scene units: the least to a covered
/// neighbour.
fn pitch_at(texels: &[FilterTexel], at: usize, width: usize) -> f64 {
    let own = texels[at];
    let neighbours = [at.wrapping_sub(1), at + 1, at.wrapping_sub(width), at + width];
    let distances = neighbours.iter().filter_map(|n| texels.get(*n)).filter(|t| own.is_covered && t.is_covered);
    distances.map(|t| (t.position - own.position).length()).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two charts side by side, flat and far from each other, with noise.
    fn charts(levels: [f32; 2]) -> Vec<FilterTexel> {
        let texel = |at: u32| {
            let (x, y) = (at % 64, at / 64);
            let side = usize::from(x >= 32);
            let noise = ((at.wrapping_mul(2_654_435_761) >> 16) & 0xff) as f32 / 255.0 - 0.5;
            FilterTexel {
                value: Vec3::new(levels[side] + 0.2 * noise, 0.0, 0.0),
                variance: 0.04 / 12.0,
                position: DVec3::new(f64::from(x) + 1000.0 * side as f64, 0.0, f64::from(y)),
                normal: Vec3::Y,
                is_covered: true,
            }
        };
        (0..64 * 32).map(texel).collect()
    }

    fn spread(texels: &[FilterTexel], side: usize) -> [f32; 2] {
        let values: Vec<f32> =
            texels.iter().enumerate().filter(|(at, _)| at % 64 / 32 == side).map(|(_, t)| t.value.x).collect();
        let mean = values.iter().sum::<f32>() / values.len() as f32;
        [mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / values.len() as f32).sqrt()]
    }

    #[test]
    fn noise_goes_and_charts_stay_apart() {
        // values so near to each other that only the surface tells them apart
        let mut texels = charts([0.50, 0.56]);
        let before = [0, 1].map(|side| spread(&texels, side));
        smooth(&mut texels, [64, 32]);
        for (side, [mean, deviation]) in before.into_iter().enumerate() {
            let [after, left] = spread(&texels, side);
            assert!((after - mean).abs() < 2e-3, "{side}: {after} {mean}");
            assert!(left < 0.25 * deviation, "{side}: {left} {deviation}");
        }
    }

    #[test]
    fn edges_and_gaps_stay() {
        let mut texels = charts([0.2, 0.9]);
        texels.iter_mut().for_each(|t| t.position.x = t.position.x.rem_euclid(1000.0));
        texels[70].is_covered = false;
        let gap = texels[70].value;
        smooth(&mut texels, [64, 32]);
        assert_eq!(texels[70].value, gap);
        // an edge of value on one surface: seven times the noise
        assert!((spread(&texels, 0)[0] - 0.2).abs() < 0.01 && (spread(&texels, 1)[0] - 0.9).abs() < 0.01);
    }
}
