//! Errors of a film as a display shows it, tile by tile, from the two halves of its samples.
//!
//! At every check a tile has twice the samples of the check before. The first half of them and the
//! second are images of their own, and half the difference of what a display shows of the two
//! estimates the error of their mean. Unlike sample variances it knows what stratification, tone
//! mapping and the limits of a display are worth: nobody sees noise in what is white anyway. Where
//! the samples of the second half fill the gaps of the first, the estimate is too large.
//!
//! A tile that has missed what is rare and bright seems to have no error, so neighbours have a say
//! ([`DisplayErrors::open`]): all of them while there are few samples, and their mean later, when
//! the vote of the noisiest would cost twice the samples in an image of caustics.

use super::block::TILE;
use super::convergence::{FIRST_CHECK, TileErrors};
use super::state::tiles;
use super::{Film, MAX_CHANNELS};
use crate::colour::srgb_encode;
use crate::output::tone_map::ToneMap;

/// Samples per pixel at the first check, of which the halves are compared at the second.
pub const FIRST_DISPLAY_CHECK: u32 = 8;

/// The error that displayed tiles may have, and how they are displayed.
#[derive(Clone, Copy, Debug, Default)]
pub struct DisplayTarget {
    /// Root mean square error over the pixels and channels of a tile, in sRGB values in [0, 1].
    pub error: f64,
    /// Tone mapping operator.
    pub tone_map: ToneMap,
    /// Exposure in stops.
    pub exposure: f64,
    /// Exposure in stops by the film, which prevails where it returns one.
    pub exposure_of_film: Option<fn(&Film) -> Option<f64>>,
}

/// Errors of displayed tiles, each at the last check of its tile.
#[derive(Clone, Debug)]
pub(crate) struct DisplayErrors {
    target: DisplayTarget,
    tiles: TileErrors,
    /// Samples of each tile at its last check.
    checked: Vec<u32>,
    /// Means of each pixel then.
    before: Vec<f32>,
}

impl DisplayErrors {
    /// The errors of a film without samples, which are infinite.
    pub(crate) fn new(target: DisplayTarget, film: &Film) -> Self {
        let tiles = TileErrors::unknown([film.width, film.height]);
        Self { target, checked: vec![0; tiles.errors().len()], tiles, before: film.mean.clone() }
    }

    /// The errors.
    pub(crate) fn tiles(&self) -> &TileErrors {
        &self.tiles
    }

    /// For each tile, true if it is to be sampled on: if its error or that of the nine tiles around
    /// it together exceeds the target, or, below [`FIRST_CHECK`] samples, that of any of them.
    pub(crate) fn open(&self) -> Vec<bool> {
        let target = self.target.error;
        let is_open = |tile: usize, samples: u32| {
            let (count, sum) = self.tiles.around(tile).fold((0.0, 0.0), |(n, sum), e| (n + 1.0, sum + e * e));
            let is_early = samples < FIRST_CHECK;
            self.tiles.errors()[tile] > target
                || (sum / count).sqrt() > target
                || is_early && self.tiles.around(tile).any(|error| error > target)
        };
        self.checked.iter().enumerate().map(|(tile, &samples)| is_open(tile, samples)).collect()
    }

    /// Takes the samples into account of the tiles that are at a check. `tile_samples`: samples of
    /// each tile.
    pub(crate) fn update(&mut self, film: &Film, tile_samples: &[u32], is_check: impl Fn(u32) -> bool) {
        let target = &self.target;
        let exposure = target.exposure_of_film.and_then(|choose| choose(film)).unwrap_or(target.exposure);
        let gain = exposure.exp2() as f32;
        let width = tiles([film.width, film.height])[0];
        for (tile, &samples) in tile_samples.iter().enumerate() {
            let before = self.checked[tile];
            if samples == before || !is_check(samples) {
                continue;
            }
            let (mut sum, mut count) = (0.0, 0usize);
            let [x, y] = [tile % width, tile / width].map(|n| (n * TILE as usize) as u32);
            for index in (y..film.height.min(y + TILE))
                .flat_map(|y| (x..film.width.min(x + TILE)).map(move |x| y as usize * film.width as usize + x as usize))
            {
                let range = film.channels * index..film.channels * (index + 1);
                let (now, old) = (&film.mean[range.clone()], &mut self.before[range]);
                let halves = now.iter().zip(&*old).map(|(now, old)| [*old, 2.0 * now - old]);
                let mut linear = [[0.0; MAX_CHANNELS]; 2];
                halves.enumerate().for_each(|(c, values)| (0..2).for_each(|half| linear[half][c] = values[half]));
                let [first, second] = linear.map(|colour| self.target.shown(gain, film.channels, colour));
                let differences = first.iter().zip(&second).take(film.channels).map(|(a, b)| f64::from(b - a));
                sum += differences.map(|difference| 0.25 * difference * difference).sum::<f64>();
                count += film.channels;
                old.copy_from_slice(now);
            }
            self.checked[tile] = samples;
            let error = if before > 0 && samples == 2 * before { (sum / count as f64).sqrt() } else { f64::INFINITY };
            self.tiles.set(tile, error);
        }
    }
}

impl DisplayTarget {
    /// The sRGB values in [0, 1] that a display shows of a pixel.
    fn shown(&self, gain: f32, channels: usize, colour: [f32; MAX_CHANNELS]) -> [f32; MAX_CHANNELS] {
        // ambient visibility is shown as it is
        let linear = if channels == 3 { self.tone_map.map(colour.map(|v| gain * v)) } else { colour };
        linear.map(|v| srgb_encode(v.clamp(0.0, 1.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors of a film of these means after 8 samples and after 16.
    fn errors(target: DisplayTarget, eight: &Film, sixteen: &Film) -> DisplayErrors {
        let count = tiles([eight.width, eight.height]).iter().product();
        let mut errors = DisplayErrors::new(target, eight);
        let is_check = |n: u32| n >= FIRST_DISPLAY_CHECK && n.is_power_of_two();
        errors.update(eight, &vec![8; count], is_check);
        assert!(errors.tiles().errors().iter().all(|e| e.is_infinite()));
        // not a check
        errors.update(sixteen, &vec![12; count], is_check);
        errors.update(sixteen, &vec![16; count], is_check);
        errors
    }

    fn uniform(channels: usize, value: f32) -> Film {
        let mut film = Film::new(8, 8, channels);
        film.mean.fill(value);
        film
    }

    #[test]
    fn an_error_is_half_the_difference_of_two_halves() {
        let target = DisplayTarget { error: 0.1, ..Default::default() };
        let of = |target: DisplayTarget, channels: usize, [first, second]: [f32; 2]| {
            let errors = errors(target, &uniform(channels, first), &uniform(channels, 0.5 * (first + second)));
            errors.tiles().errors()[0]
        };
        let expected = |a: f32, b: f32| 0.5 * f64::from(srgb_encode(a) - srgb_encode(b)).abs();
        for channels in [1, 3] {
            assert!((of(target, channels, [0.2, 0.3]) - expected(0.2, 0.3)).abs() < 1e-6);
            // nobody sees noise in what is white, but a hot pixel in what is not
            assert_eq!(of(target, channels, [2.0, 40.0]), 0.0);
            assert!((of(target, channels, [0.2, 4000.0]) - expected(0.2, 1.0)).abs() < 1e-6);
        }
        // at the exposure of the picture, and as tone mapped; ambient visibility has neither
        let dark = DisplayTarget { exposure: -1.0, ..target };
        assert!((of(dark, 3, [0.4, 0.6]) - expected(0.2, 0.3)).abs() < 1e-6);
        assert!((of(dark, 1, [0.4, 0.6]) - expected(0.4, 0.6)).abs() < 1e-6);
        let chosen = DisplayTarget { exposure_of_film: Some(|_| Some(-2.0)), ..dark };
        assert!((of(chosen, 3, [0.8, 1.2]) - expected(0.2, 0.3)).abs() < 1e-6);
        let none = DisplayTarget { exposure_of_film: Some(|_| None), ..dark };
        assert_eq!(of(none, 3, [0.4, 0.6]), of(dark, 3, [0.4, 0.6]));
        let mapped = DisplayTarget { tone_map: ToneMap::Exponential, ..target };
        let exponential = |x: f32| 1.0 - (-x).exp();
        assert!((of(mapped, 3, [1.0, 2.0]) - expected(exponential(1.0), exponential(2.0))).abs() < 1e-6);
    }

    #[test]
    fn tiles_wait_for_others() {
        // five by three tiles, the last ones cut; the one in the middle is noisy
        let (mut film, target) = (Film::new(38, 20, 1), DisplayTarget { error: 0.01, ..Default::default() });
        let quiet = errors(target, &film, &film);
        assert!(quiet.open().iter().all(|open| !open));
        for y in 8..16 {
            film.mean[38 * y + 16..][..8].fill(2e-3);
        }
        let mut noisy = errors(target, &Film::new(38, 20, 1), &film);
        let error = noisy.tiles().errors()[7];
        // the second half of the samples is 4e-3, the first black
        assert!((error - 0.5 * (1.055 * 4e-3f64.powf(1.0 / 2.4) - 0.055)).abs() < 1e-4, "{error}");
        let open = |errors: &DisplayErrors| (0..15).filter(|&t| errors.open()[t]).collect::<Vec<_>>();
        let around = vec![1, 2, 3, 6, 7, 8, 11, 12, 13];
        // while there are few samples, its neighbours wait for it
        assert_eq!(open(&noisy), around);
        // then for the mean of nine, 0.026 / 3, or of six at a border, 0.026 / sqrt(6)
        noisy.checked.fill(64);
        assert_eq!(open(&noisy), [1, 2, 3, 7, 11, 12, 13]);
    }
}
