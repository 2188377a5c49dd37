//! Schedules the samples of a film: all at once, or in steps between which it is saved or tested
//! for convergence. A step depends on the film alone, so that resumed renders take the same
//! samples.

use std::sync::Arc;

use super::convergence::FIRST_CHECK;
use super::display::{DisplayTarget, FIRST_DISPLAY_CHECK};
use super::state::FilmState;

/// Initial state of a film, its intermediate stops, and whether its sums are kept.
#[derive(Clone, Debug, Default)]
pub struct FilmOptions {
    /// State to resume from, with the next samples; size and channels must be those of the image.
    pub start: Option<Arc<FilmState>>,
    /// Return the film's exact sums.
    pub keep_state: bool,
    /// Samples per pixel at which [`crate::film::Control::interval`] is called, ascending.
    pub intervals: Vec<u32>,
    /// Stop sampling tiles whose standard error is at most this, tested at powers of two of samples
    /// from [`FIRST_CHECK`] on. The samples per pixel are then the maximum.
    pub target_rmse: Option<f64>,
    /// Stop sampling tiles whose displayed error is at most this, tested at powers of two of
    /// samples from 2 * [`FIRST_DISPLAY_CHECK`] on. It prevails over `target_rmse`, and the samples
    /// per pixel are the maximum. A film that is resumed does not know its last check, and takes
    /// more.
    pub display_target: Option<DisplayTarget>,
}

/// The next step of a film.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    /// Samples per pixel of the tiles after the step.
    pub goal: u32,
    /// For each tile, whether it is sampled.
    pub tiles: Vec<bool>,
    /// Upper bound on the remaining samples per pixel, summed over tiles, this step's included.
    pub left: u64,
}

impl FilmOptions {
    /// Must the sums be read back between steps or at the end?
    pub(crate) fn needs_state(&self) -> bool {
        self.start.is_some() || self.keep_state || !self.intervals.is_empty() || self.is_adaptive()
    }

    /// Are tiles sampled until they have converged?
    pub(crate) fn is_adaptive(&self) -> bool {
        self.display_target.is_some() || self.target_rmse.is_some()
    }

    /// Is a tile with `n` samples tested for convergence?
    pub(crate) fn is_check(&self, n: u32) -> bool {
        n >= self.first_check() && n.is_power_of_two()
    }

    fn first_check(&self) -> u32 {
        if self.display_target.is_some() { FIRST_DISPLAY_CHECK } else { FIRST_CHECK }
    }

    /// The first check beyond `n` samples.
    fn next_check(&self, n: u32) -> u32 {
        n.checked_add(1).and_then(u32::checked_next_power_of_two).map_or(u32::MAX, |n| n.max(self.first_check()))
    }

    /// The next step to `spp` samples of a film of tiles with `tile_samples`; `None` at the end.
    /// `open` finds the tiles that have not converged, and is called at checks alone.
    pub(crate) fn next(&self, spp: u32, tile_samples: &[u32], open: &dyn Fn() -> Vec<bool>) -> Option<Step> {
        let below = |n: u32| n < spp;
        let mut tiles: Vec<bool> = tile_samples.iter().map(|&n| below(n)).collect();
        if self.is_adaptive() {
            // a film saved between two checks first brings its tiles to the next check (or stops at
            // `spp`), so that where it was saved does not change which tiles are tested
            if tile_samples.iter().any(|&n| !self.is_check(n)) {
                tiles.iter_mut().zip(tile_samples).for_each(|(tile, &n)| *tile &= !self.is_check(n));
            } else if tiles.contains(&true) {
                tiles.iter_mut().zip(open()).for_each(|(tile, open)| *tile &= open);
            }
        }
        let chosen = || tile_samples.iter().zip(&tiles).filter(|(_, chosen)| **chosen).map(|(n, _)| *n);
        let least = chosen().min()?;
        let left = chosen().map(|n| u64::from(spp - n)).sum();
        let interval = self.intervals.iter().copied().find(|&n| n > least).unwrap_or(spp);
        let check = if self.is_adaptive() { self.next_check(least) } else { spp };
        let goal = spp.min(interval).min(check);
        // tiles with more samples wait
        tiles.iter_mut().zip(tile_samples).for_each(|(tile, &n)| *tile &= n < goal);
        Some(Step { goal, tiles, left })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Film;
    use crate::film::convergence::TileErrors;

    /// The goals of a film whose tiles all stay open, from `first` samples on.
    fn goals(options: &FilmOptions, first: u32, spp: u32) -> Vec<u32> {
        let mut film = Film::new(16, 8, 1);
        film.variance.fill(1e9);
        let (mut samples, mut goals) = ([first; 2], Vec::new());
        film.samples.fill(first);
        while let Some(step) = options.next(spp, &samples, &|| TileErrors::from_film(&film).unconverged(0.1)) {
            assert_eq!((step.tiles, step.left), (vec![true; 2], 2 * u64::from(spp - samples[0])));
            goals.push(step.goal);
            samples = [step.goal; 2];
            film.samples.fill(step.goal);
        }
        goals
    }

    #[test]
    fn steps_end_where_the_film_is_looked_at() {
        let plain = FilmOptions::default();
        assert!(!plain.needs_state());
        assert_eq!(goals(&plain, 0, 100), [100]);
        assert_eq!(goals(&plain, 16, 100), [100]);
        assert!(goals(&plain, 100, 100).is_empty());
        let intervals = FilmOptions { intervals: vec![1, 2, 4, 8, 16], ..Default::default() };
        assert_eq!(goals(&intervals, 0, 23), [1, 2, 4, 8, 16, 23]);
        assert_eq!(goals(&intervals, 5, 23), [8, 16, 23]);
        let target = FilmOptions { target_rmse: Some(0.1), ..Default::default() };
        assert_eq!(goals(&target, 0, 300), [64, 128, 256, 300]);
        assert_eq!(goals(&target, 100, 512), [128, 256, 512]);
        assert_eq!(goals(&target, 0, 10), [10]);
        let displayed = DisplayTarget { error: 0.01, ..Default::default() };
        let displayed = FilmOptions { display_target: Some(displayed), ..Default::default() };
        assert!(displayed.needs_state());
        assert_eq!(goals(&displayed, 0, 100), [8, 16, 32, 64, 100]);
        let both = FilmOptions { intervals: vec![16, 100], ..target };
        assert_eq!(goals(&both, 0, 128), [16, 64, 100, 128]);
        assert_eq!(FilmOptions::default().next_check(u32::MAX), u32::MAX);
    }

    #[test]
    fn quiet_tiles_wait_and_are_taken_up_again() {
        let options = FilmOptions { target_rmse: Some(0.1), ..Default::default() };
        // four tiles in a row
        let mut film = Film::new(32, 8, 1);
        let mut set = |samples: [u32; 4], variance: [f32; 4]| {
            for x in 0..32 * 8 {
                film.samples[x] = samples[x % 32 / 8];
                film.variance[x] = variance[x % 32 / 8];
            }
            options.next(1024, &samples, &|| TileErrors::from_film(&film).unconverged(0.1))
        };
        // errors 0.05, 0.05, 0.05, 1
        let step = set([64; 4], [0.16, 0.16, 0.16, 64.0]).unwrap();
        assert_eq!((step.goal, step.tiles), (128, vec![false, false, true, true]));
        // cut short: nothing is judged before they are all there
        let step = set([64, 64, 100, 100], [64.0; 4]).unwrap();
        assert_eq!((step.goal, step.tiles), (128, vec![false, false, true, true]));
        // at the end of a run of 100 samples, too
        assert_eq!(
            FilmOptions { target_rmse: Some(0.1), ..Default::default() }
                .next(100, &[64, 64, 100, 100], &|| TileErrors::from_film(&Film::new(32, 8, 1)).unconverged(0.1)),
            None
        );
        // the third has turned out to be noisy: the second, which has fewer samples, goes on first
        let step = set([64, 64, 128, 128], [0.16, 0.16, 64.0, 64.0]).unwrap();
        assert_eq!((step.goal, step.tiles, step.left), (128, vec![false, true, false, false], 960 + 2 * 896));
        let step = set([64, 128, 128, 128], [0.16, 0.16, 64.0, 64.0]).unwrap();
        assert_eq!((step.goal, step.tiles), (256, vec![false, true, true, true]));
        // all know enough; and those that do not have all there are
        assert_eq!(set([64, 128, 256, 256], [0.16; 4]), None);
        assert_eq!(
            set([64, 512, 1024, 1024], [0.16, 0.16, 1e9, 1e9]).map(|s| s.tiles),
            Some(vec![false, true, false, false])
        );
        assert_eq!(set([64, 1024, 1024, 1024], [0.16, 0.16, 1e9, 1e9]), None);
    }
}
