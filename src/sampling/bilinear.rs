//! Importance sampling of an environment map by luminance, interpolated bilinearly between texels
//! as in the shader (shaders/path/map.glsl), after the sampling of piecewise bilinear functions in
//! Mitsuba 3 and pbrt-v4 (A.5).
//!
//! Patches lie between the centers of texels: `width` columns (the last one wraps round) and
//! `height + 1` rows, of which those at the poles are halves. A row is sampled by its weight, then
//! a patch of the row by its own, both by inversion. The remainder of each number then samples the
//! bilinear function within the patch, which preserves stratification.

use rayon::prelude::*;

use crate::interface::records::path::GUIDED_INTERVALS;

/// Cumulative distribution of the rows, and of the patches in each row.
#[derive(Clone, Debug, Default)]
pub struct BilinearDistribution {
    /// Where each row begins, `height + 1` of them, and 1; then of each row where its patches
    /// begin, `width` of them, and 1. An interval that single precision rounds to zero length is
    /// never sampled: its density is 0.
    pub table: Vec<f32>,
    /// Guides to the rows, then to the patches of each row (Chen and Asau, "On Generating Random
    /// Variates from an Empirical Distribution", AIIE Transactions 6(2), 1974). A guide divides the
    /// numbers from 0 to 1 into equal cells. It has the interval with which each cell begins, and
    /// after the last cell the last interval.
    pub guide: Vec<u32>,
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

        let mut guide = vec![0; cells(height + 1) + 1 + (height + 1) * (cells(width) + 1)];
        let (to_rows, to_columns) = guide.split_at_mut(cells(height + 1) + 1);
        write_guide(to_rows, starts);
        let rows = to_columns.par_chunks_exact_mut(cells(width) + 1);
        rows.zip(columns.par_chunks_exact(width + 1)).for_each(|(guide, row)| write_guide(guide, row));
        Self { table, guide }
    }
}

/// Cells of a guide to so many intervals.
fn cells(intervals: usize) -> usize {
    intervals.div_ceil(GUIDED_INTERVALS as usize)
}

/// Writes the guide to intervals of which `table` has the starts, and 1. A number `u` is in the
/// cell `u * cells`, rounded down: in single precision as in shaders, so that none is missed.
fn write_guide(guide: &mut [u32], table: &[f32]) {
    let (cells, last) = (guide.len() - 1, table.len() - 2);
    let mut begun = 0;
    for (cell, interval) in guide.iter_mut().enumerate() {
        // intervals that begin in a cell before this one
        while begun <= last && ((table[begun] * cells as f32) as usize) < cell {
            begun += 1;
        }
        *interval = begun.saturating_sub(1) as u32;
    }
    guide[cells] = last as u32;
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The last interval that begins at or before a number, by its guide and by looking at all.
    fn found(guide: &[u32], starts: &[f32], u: f32) -> [usize; 2] {
        let cells = guide.len() - 1;
        let cell = ((u * cells as f32) as usize).min(cells - 1);
        let (low, high) = (guide[cell] as usize, guide[cell + 1] as usize);
        let last = |range: &[f32]| range.iter().rposition(|start| *start <= u).unwrap();
        [low + last(&starts[low..=high]), last(&starts[..starts.len() - 1])]
    }

    #[test]
    fn guides_lead_to_the_interval() {
        // even, all in one texel, black rows, and fewer texels than a cell has
        let bright = |x: usize, y: usize| if (x, y) == (37, 11) { 1e6 } else { 1e-6 };
        type Texel = dyn Fn(usize, usize) -> f64;
        let maps: [(usize, usize, &Texel); 4] = [
            (64, 32, &|_, _| 1.0),
            (64, 32, &bright),
            (97, 41, &|x, y| ((x * 7 + y * 3) % 5) as f64 * f64::from(y % 3 != 0)),
            (2, 1, &|x, _| x as f64),
        ];
        for (width, height, texel) in maps {
            let values: Vec<Vec<f64>> = (0..height).map(|y| (0..width).map(|x| texel(x, y)).collect()).collect();
            let made = BilinearDistribution::new(width, height, |y, out| out.copy_from_slice(&values[y]));
            let (starts, columns) = made.table.split_at(height + 2);
            let (to_rows, to_columns) = made.guide.split_at(cells(height + 1) + 1);
            let rows = to_columns.chunks(cells(width) + 1).zip(columns.chunks(width + 1));
            for (guide, starts) in rows.chain([(to_rows, starts)]) {
                // numbers all over, and at and beside each start
                let beside = starts.iter().flat_map(|s| [s.next_down(), *s, s.next_up()]);
                for u in (0..1000).map(|k| k as f32 / 1000.0).chain(beside).filter(|u| (0.0..1.0).contains(u)) {
                    let [guided, searched] = found(guide, starts, u);
                    assert_eq!(guided, searched, "{width}x{height}: {u}");
                }
            }
        }
    }
}
