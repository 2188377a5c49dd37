//! The exact state of a film: the sums of every pixel as the device stores them, and their sample
//! counts. A render resumed from it is bit-identical to an uninterrupted one.

use super::block::TILE;
use super::{Film, FilmPixel, record_words};

/// The exact state of a film. All pixels of a tile have the same number of samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilmState {
    size: [u32; 2],
    channels: usize,
    /// One record per pixel, rows from the top.
    words: Vec<u32>,
    /// Samples per pixel of each tile, rows from the top.
    tile_samples: Vec<u32>,
}

/// Description of one word of a pixel's record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Word {
    /// Name, such as `sum.R`.
    pub name: String,
    /// True for the bits of an `f32`, false for a count.
    pub float: bool,
}

/// The words of a record, in order, for channels of these names.
pub fn words(channels: &[&str]) -> Vec<Word> {
    let pair =
        |kind: &str, excess: &str, c: &str| [kind, excess].map(|k| Word { name: format!("{k}.{c}"), float: true });
    let sums = channels.iter().flat_map(|c| pair("sum", "excess", c));
    let squares = channels.iter().flat_map(|c| pair("squares", "squares_excess", c));
    let counts = ["covered", "not_finite"].map(|n| Word { name: n.into(), float: false });
    sums.chain(squares).chain(counts).collect()
}

/// Tiles of an image in x and y.
pub(crate) fn tiles(size: [u32; 2]) -> [usize; 2] {
    size.map(|n| n.div_ceil(TILE) as usize)
}

impl FilmState {
    /// The state of an empty film. `size` in pixels.
    pub fn new(size: [u32; 2], channels: usize) -> Self {
        let [tiles_x, tiles_y] = tiles(size);
        Self {
            size,
            channels,
            words: vec![0; record_words(channels) * size[0] as usize * size[1] as usize],
            tile_samples: vec![0; tiles_x * tiles_y],
        }
    }

    /// From a plane of each word ([`words`]) and the samples taken of each pixel, rows from the
    /// top. `None` for states that no film writes, as with different numbers of samples in a tile.
    pub fn from_planes(size: [u32; 2], channels: usize, planes: &[Vec<u32>], samples: &[u32]) -> Option<Self> {
        let mut state = Self::new(size, channels);
        let record = record_words(channels);
        let pixels = state.words.len() / record;
        if planes.len() != record || samples.len() != pixels || planes.iter().any(|p| p.len() != pixels) {
            return None;
        }
        for (index, words) in state.words.chunks_exact_mut(record).enumerate() {
            for (word, plane) in words.iter_mut().zip(planes) {
                *word = plane[index];
            }
            if words[record - 1] > samples[index] {
                return None;
            }
        }
        // store the count of each tile's first pixel, then compare all pixels with it
        let tile_of = |index: usize| tile_of(size, index);
        for index in (0..pixels).rev() {
            state.tile_samples[tile_of(index)] = samples[index];
        }
        (0..pixels).all(|index| state.tile_samples[tile_of(index)] == samples[index]).then_some(state)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Channels of a pixel.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// One word of every pixel, rows from the top.
    pub fn plane(&self, word: usize) -> Vec<u32> {
        self.words.iter().skip(word).step_by(record_words(self.channels)).copied().collect()
    }

    /// Samples taken of every pixel, rejected ones included; rows from the top.
    pub fn samples_plane(&self) -> Vec<u32> {
        let pixels = self.words.len() / record_words(self.channels);
        (0..pixels).map(|index| self.tile_samples[tile_of(self.size, index)]).collect()
    }

    /// Samples per pixel of each tile, rows from the top.
    pub fn tile_samples(&self) -> &[u32] {
        &self.tile_samples
    }

    /// Maximum number of samples of any pixel.
    pub fn max_samples(&self) -> u32 {
        self.tile_samples.iter().copied().max().unwrap_or(0)
    }

    pub(crate) fn set_tile_samples(&mut self, samples: &[u32]) {
        self.tile_samples.copy_from_slice(samples);
    }

    /// The record of a pixel.
    pub(crate) fn record(&self, index: usize) -> &[u32] {
        let record = record_words(self.channels);
        &self.words[record * index..][..record]
    }

    pub(crate) fn record_mut(&mut self, index: usize) -> &mut [u32] {
        let record = record_words(self.channels);
        &mut self.words[record * index..][..record]
    }

    /// Means and variances.
    pub fn film(&self) -> Film {
        let mut film = Film::new(self.size[0], self.size[1], self.channels);
        for (index, words) in self.words.chunks_exact(record_words(self.channels)).enumerate() {
            film.set(index, &FilmPixel::from_words(words), self.tile_samples[tile_of(self.size, index)]);
        }
        film
    }
}

/// The tile of a pixel.
fn tile_of(size: [u32; 2], index: usize) -> usize {
    let (width, edge) = (size[0] as usize, TILE as usize);
    index / width / edge * tiles(size)[0] + index % width / edge
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_and_back() {
        let size = [11, 9];
        let mut state = FilmState::new(size, 3);
        for (k, word) in state.words.iter_mut().enumerate() {
            *word = (k as u32).wrapping_mul(0x9e37_79b9);
        }
        for index in 0..99 {
            state.record_mut(index)[13] = index as u32 % 3;
        }
        state.set_tile_samples(&[4, 8, 16, 32]);
        assert_eq!(words(&["R", "G", "B"]).len(), record_words(3));
        assert_eq!(
            words(&["Y"]).iter().map(|w| w.name.as_str()).collect::<Vec<_>>(),
            ["sum.Y", "excess.Y", "squares.Y", "squares_excess.Y", "covered", "not_finite"]
        );
        let planes: Vec<_> = (0..record_words(3)).map(|w| state.plane(w)).collect();
        let samples = state.samples_plane();
        assert_eq!((samples[0], samples[8], samples[8 * 11], samples[98]), (4, 8, 16, 32));
        assert_eq!(FilmState::from_planes(size, 3, &planes, &samples).as_ref(), Some(&state));
        // a tile whose pixels disagree, and more left out than there were
        let mut odd = samples.clone();
        odd[5] = 5;
        assert_eq!(FilmState::from_planes(size, 3, &planes, &odd), None);
        let mut left_out = planes.clone();
        left_out[13][98] = 33;
        assert_eq!(FilmState::from_planes(size, 3, &left_out, &samples), None);
        assert_eq!(FilmState::from_planes(size, 3, &planes[1..], &samples), None);
    }

    #[test]
    fn a_film_has_the_samples_that_were_counted() {
        let mut state = FilmState::new([1, 1], 1);
        // 3 and 1 of four samples, two of them left out, one word of excess
        let floats = [4.5f32, 0.5, 10.0, 0.0].map(f32::to_bits);
        state.record_mut(0).copy_from_slice(&[floats[0], floats[1], floats[2], floats[3], 1, 2]);
        state.set_tile_samples(&[4]);
        let film = state.film();
        assert_eq!((film.mean[0], film.variance[0], film.coverage[0]), (2.0, 2.0, 0.5));
        assert_eq!((film.samples[0], film.not_finite), (2, 2));
        assert_eq!((film.estimated_rmse(), film.samples_range()), (1.0, (2, 2.0, 2)));
    }
}
