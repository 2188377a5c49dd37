//! Convergence of a film, tile by tile, estimated from the sample variances of its pixels.
//!
//! Stopping by such an estimate biases the image: a tile whose samples miss a bright feature has a
//! low variance, is stopped, and stays too dark. So nothing is tested before [`FIRST_CHECK`]
//! samples, and a tile continues while any of its eight neighbours has not converged: a feature
//! that is rare in one tile is likely to have been sampled in one of nine.

use super::Film;
use super::block::TILE;
use super::state::tiles;

/// Minimum number of samples per pixel before convergence is tested.
pub const FIRST_CHECK: u32 = 64;

/// Standard error of each tile: root mean square of its pixels' and channels' errors of the mean.
#[derive(Clone, Debug, PartialEq)]
pub struct TileErrors {
    size: [usize; 2],
    errors: Vec<f64>,
}

/// Number of converged tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct TileCount {
    /// Converged tiles.
    pub done: usize,
    /// All tiles.
    pub all: usize,
}

impl TileCount {
    /// Counts tiles, of which `open` says whether they have not converged.
    pub(crate) fn from_open(open: &[bool]) -> Self {
        Self { done: open.iter().filter(|open| !**open).count(), all: open.len() }
    }
}

impl TileErrors {
    /// Estimates the errors of a film. Pixels with fewer than two samples have an infinite error.
    pub fn from_film(film: &Film) -> Self {
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

    /// Errors that are not known yet of a film of `size` pixels: they are infinite.
    pub(crate) fn unknown(size: [u32; 2]) -> Self {
        let size = tiles(size);
        Self { size, errors: vec![f64::INFINITY; size[0] * size[1]] }
    }

    /// The error of each tile, rows from the top.
    pub fn errors(&self) -> &[f64] {
        &self.errors
    }

    /// Sets the error of a tile.
    pub(crate) fn set(&mut self, tile: usize, error: f64) {
        self.errors[tile] = error;
    }

    /// For each tile, true if its error, or that of one of its eight neighbours, exceeds `target`.
    pub fn unconverged(&self, target: f64) -> Vec<bool> {
        (0..self.errors.len()).map(|tile| !self.around(tile).all(|error| error <= target)).collect()
    }

    /// Errors of a tile and of its neighbours, of which there are eight within the image.
    pub(crate) fn around(&self, tile: usize) -> impl Iterator<Item = f64> {
        let [width, height] = self.size;
        let neighbours = |at: usize, n: usize| at.saturating_sub(1)..(at + 2).min(n);
        let (columns, rows) = (neighbours(tile % width, width), neighbours(tile / width, height));
        rows.flat_map(move |y| columns.clone().map(move |x| self.errors[y * width + x]))
    }

    /// Number of tiles that have converged to `target`.
    pub fn count(&self, target: f64) -> TileCount {
        TileCount::from_open(&self.unconverged(target))
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
        let quiet = TileErrors::from_film(&film);
        assert_eq!(quiet.errors.len(), 15);
        assert!(quiet.errors.iter().all(|e| (e - 0.1).abs() < 1e-6));
        assert_eq!(quiet.count(0.1001), TileCount { done: 15, all: 15 });
        assert_eq!(quiet.count(0.0999), TileCount { done: 0, all: 15 });
        // one pixel of the first tile makes four tiles wait
        film.variance[3 * (38 + 1) + 1] = 64.0;
        let errors = TileErrors::from_film(&film);
        let expected = ((191.0 * 0.01 + 1.0) / 192.0f64).sqrt();
        assert!((errors.errors[0] - expected).abs() < 1e-6, "{}, expected {expected}", errors.errors[0]);
        let open = errors.unconverged(0.11);
        assert_eq!((0..15).filter(|&t| open[t]).collect::<Vec<_>>(), [0, 1, 5, 6]);
        // in the middle it would be nine
        film.variance[3 * (38 * 12 + 20)] = 64.0;
        assert_eq!(TileErrors::from_film(&film).count(0.11).done, 15 - 11);
        // pixels with fewer than two samples have not converged
        film.variance.fill(0.0);
        film.samples[0] = 1;
        assert_eq!(TileErrors::from_film(&film).count(1e9).done, 11);
        film.samples[0] = 2;
        assert_eq!(TileErrors::from_film(&film).count(0.0).done, 15);
        film.variance[0] = f32::NAN;
        assert_eq!(TileErrors::from_film(&film).count(f64::INFINITY).done, 11);
    }
}
