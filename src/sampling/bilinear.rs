//! Importance sampling of an environment map by luminance, interpolated bilinearly between texels
//! as in the shader (shaders/path/map.glsl), after the sampling of piecewise bilinear functions in
//! Mitsuba 3 and pbrt-v4 (A.5).
//!
//! Patches lie between the centers of texels: `width` columns (the last one wraps round) and
//! `height + 1` rows, of which those at the poles are halves. A row is sampled by its weight, then
//! a patch of the row by its own, both by inversion. The remainder of each number then samples the
//! bilinear function within the patch, which preserves stratification.

use rayon::prelude::*;

/// Cumulative distribution of the rows, and of the patches in each row.
#[derive(Clone, Debug, Default)]
pub struct BilinearDistribution {
    /// Where each row begins, `height + 1` of them, and 1; then of each row where its patches
    /// begin, `width` of them, and 1. An interval that single precision rounds to zero length is
    /// never sampled: its density is 0.
    pub table: Vec<f32>,
}

impl BilinearDistribution {
    /// Builds the distribution of texel values, finite and not negative: `texels(y, out)` writes
    /// the `width` values of row `y`, rows from the pole at +y. It is asked for each row twice, by
    /// several threads: values that are cheap to compute need not be kept, of which a map of
    /// 16384x8192 texels has a gigabyte.
    pub fn new(width: usize, height: usize, texels: impl Fn(usize, &mut [f64]) + Sync) -> Self {
        let mut table = vec![0.0; height + 2 + (height + 1) * (width + 1)];
        let (starts, columns) = table.split_at_mut(height + 2);
        let row_of = |row: usize, [above, below, weights]: &mut [Vec<f64>; 3], out: &mut [f32]| {
            texels(row.saturating_sub(1), above);
            texels(row.min(height - 1), below);
            for (x, weight) in weights.iter_mut().enumerate() {
                let next = if x + 1 < width { x + 1 } else { 0 };
                *weight = 0.25 * (above[x] + above[next] + below[x] + below[next]);
            }
            write_intervals(out, weights);
            // weighted by the solid angle between the centers of two rows of texels
            let cos = |y: f64| (y.clamp(0.0, height as f64) / height as f64 * std::f64::consts::PI).cos();
            weights.iter().sum::<f64>() * (cos(row as f64 - 0.5) - cos(row as f64 + 0.5))
        };
        let scratch = || [(); 3].map(|()| vec![0.0; width]);
        let rows = columns.par_chunks_exact_mut(width + 1).enumerate();
        let rows: Vec<f64> = rows.map_init(scratch, |scratch, (row, out)| row_of(row, scratch, out)).collect();
        write_intervals(starts, &rows);
        Self { table }
    }
}

/// Writes the start of each interval, and 1. Without any weight all intervals are equal.
fn write_intervals(table: &mut [f32], weights: &[f64]) {
    let total: f64 = weights.iter().sum();
    let mut sum = 0.0;
    for (k, (start, weight)) in table.iter_mut().zip(weights).enumerate() {
        let begins = if total > 0.0 { sum / total } else { k as f64 / weights.len() as f64 };
        *start = (begins as f32).min(1.0);
        sum += weight;
    }
    table[weights.len()] = 1.0;
}
