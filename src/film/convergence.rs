//! How well a film knows its image, tile by tile, judged by the variances that it has seen itself.
//!
//! Stopping by such an estimate biases the image: a tile whose samples happened to miss what is bright there looks quiet, is stopped, and stays too dark.
//! That is why nothing is judged before [`FIRST_CHECK`] samples, and why a tile goes on while any of its eight neighbours does not know enough: what
//! is rare in one tile is likely to have been found in one of nine.

use super::Film;
use super::block::TILE;
use super::state::tiles;

/// Samples of a pixel before its variance is believed.
pub const FIRST_CHECK: u32 = 64;

/// The standard error of the mean of each tile: the root of the mean square over its pixels and channels.
#[derive(Clone, Debug, PartialEq)]
pub struct TileErrors {
    size: [usize; 2],
    errors: Vec<f64>,
}

/// How many tiles know enough.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct TileCount {
    /// Those that know enough.
    pub done: usize,
    /// All.
    pub all: usize,
}

impl TileErrors {
    /// Of a film. Pixels with fewer than two samples know nothing: their error is infinite.
    pub fn of(film: &Film) -> Self {
        let size = tiles([film.width, film.height]);
        let mut sums = vec![(0.0, 0u32); size[0] * size[1]];
        for (index, &samples) in film.samples.iter().enumerate() {
            let (x, y) = (index % film.width as usize, index / film.width as usize);
            let sum = &mut sums[y / TILE as usize * size[0] + x / TILE as usize];
            for &variance in &film.variance[film.channels * index..][..film.channels] {
                sum.0 += if samples < 2 { f64::INFINITY } else { f64::from(variance) / f64::from(samples) };
                sum.1 += 1;
            }
        }
        Self { size, errors: sums.into_iter().map(|(sum, n)| (sum / f64::from(n.max(1))).sqrt()).collect() }
    }

    /// The tiles that do not know enough: those whose error, or that of one of their neighbours, is not at most `target`.
    pub fn open(&self, target: f64) -> Vec<bool> {
        let [width, height] = self.size;
        // what is no number is not
        let enough = |x: usize, y: usize| self.errors[y * width + x] <= target;
        let around = |at: usize, n: usize| at.saturating_sub(1)..(at + 2).min(n);
        (0..width * height)
            .map(|tile| {
                let (x, y) = (tile % width, tile / width);
                !around(y, height).all(|y| around(x, width).all(|x| enough(x, y)))
            })
            .collect()
    }

    /// How many tiles [`TileErrors::open`] leaves out.
    pub fn count(&self, target: f64) -> TileCount {
        TileCount { done: self.open(target).iter().filter(|open| !**open).count(), all: self.errors.len() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_waits_for_its_neighbours() {
        // five by three tiles, the last ones cut
        let mut film = Film::new(38, 20, 3);
        film.samples.fill(64);
        film.variance.fill(0.64);
        let quiet = TileErrors::of(&film);
        assert_eq!(quiet.errors.len(), 15);
        assert!(quiet.errors.iter().all(|e| (e - 0.1).abs() < 1e-6));
        assert_eq!(quiet.count(0.1001), TileCount { done: 15, all: 15 });
        assert_eq!(quiet.count(0.0999), TileCount { done: 0, all: 15 });
        // one pixel of the first tile makes four tiles wait
        film.variance[3 * (38 + 1) + 1] = 64.0;
        let errors = TileErrors::of(&film);
        let expected = ((191.0 * 0.01 + 1.0) / 192.0f64).sqrt();
        assert!((errors.errors[0] - expected).abs() < 1e-6, "{}, expected {expected}", errors.errors[0]);
        let open = errors.open(0.11);
        assert_eq!((0..15).filter(|&t| open[t]).collect::<Vec<_>>(), [0, 1, 5, 6]);
        // in the middle it would be nine
        film.variance[3 * (38 * 12 + 20)] = 64.0;
        assert_eq!(TileErrors::of(&film).count(0.11).done, 15 - 11);
        // who knows nothing is not done
        film.variance.fill(0.0);
        film.samples[0] = 1;
        assert_eq!(TileErrors::of(&film).count(1e9).done, 11);
        film.samples[0] = 2;
        assert_eq!(TileErrors::of(&film).count(0.0).done, 15);
        film.variance[0] = f32::NAN;
        assert_eq!(TileErrors::of(&film).count(f64::INFINITY).done, 11);
    }
}
