//! Qualities of stills: how much noise a display may show, whatever the number of samples.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::film::accumulate::Accumulated;
use crate::film::block::TILE;
use crate::settings::choices;

choices! {
    /// How much noise a still may have where it is displayed. Tiles are sampled until they have no
    /// more.
    pub enum Quality (default Good) {
        /// Noise of 4/255 in a tile: to look at, and for denoising
        Draft = "draft",
        /// Noise of 2/255 in a tile: hardly visible
        Good = "good",
        /// Noise of 1/255 in a tile: less than 8 bits show
        Final = "final",
    }
}

impl Quality {
    /// Root mean square error that displayed tiles may have, in sRGB values in [0, 1].
    pub fn error(self) -> f64 {
        let of_255 = match self {
            Self::Draft => 4.0,
            Self::Good => 2.0,
            Self::Final => 1.0,
        };
        of_255 / 255.0
    }

    /// Maximum number of samples per pixel.
    pub fn max_spp(self) -> u32 {
        match self {
            Self::Draft => 256,
            Self::Good => 1024,
            Self::Final => 4096,
        }
    }
}

/// How a film has reached a quality: the error of displayed tiles and what it took.
pub(super) struct QualityReport {
    quality: Quality,
    /// Root mean square error of displayed pixels; `None` if tiles have too few samples to know.
    error: Option<f64>,
    /// Corner of the tile with the largest error, in pixels from the upper left, and the error.
    worst: Option<([u32; 2], f64)>,
    /// Corners of the tiles that have all samples and a larger error than the quality's.
    limited: Vec<[u32; 2]>,
    /// Number of tiles by their samples per pixel.
    tiles: BTreeMap<u32, usize>,
    mean_samples: f64,
}

impl QualityReport {
    /// The report of a film; `None` if its samples were not taken for a quality.
    pub(super) fn new(quality: Quality, image: &Accumulated) -> Option<Self> {
        let (film, errors) = (&image.film, image.displayed.as_ref()?);
        let [width, height] = [film.width, film.height];
        let (mut sum, mut worst, mut limited, mut tiles) = (0.0, None::<([u32; 2], f64)>, Vec::new(), BTreeMap::new());
        for (tile, &error) in errors.errors().iter().enumerate() {
            let tile = tile as u32;
            let [x, y] = [tile % width.div_ceil(TILE), tile / width.div_ceil(TILE)].map(|n| n * TILE);
            let rows = y..height.min(y + TILE);
            let pixels = rows.flat_map(|y| (x..width.min(x + TILE)).map(move |x| (y * width + x) as usize));
            sum += error * error * pixels.clone().count() as f64;

            // samples that were rejected are missing in single pixels
            let samples = pixels.map(|index| film.samples[index]).max().unwrap_or(0);
            *tiles.entry(samples).or_insert(0) += 1;
            if samples >= quality.max_spp() && error > quality.error() {
                limited.push([x, y]);
            }
            if worst.is_none_or(|(_, most)| error > most) {
                worst = Some(([x, y], error));
            }
        }
        let error = Some((sum / film.samples.len().max(1) as f64).sqrt()).filter(|e| e.is_finite());
        Some(Self { quality, error, worst, limited, tiles, mean_samples: film.samples_range().1 })
    }

    /// Lines for people.
    pub(super) fn lines(&self) -> Vec<String> {
        let (Some((least, _)), Some((most, _))) = (self.tiles.first_key_value(), self.tiles.last_key_value()) else {
            return Vec::new();
        };
        let error =
            self.error.map_or("is not known yet".to_owned(), |error| format!("is estimated as {}", of_255(error)));
        let mut lines = vec![format!(
            "quality {}: noise on a display {error} (bound: {} in a tile); {least} to {most} samples per pixel, {:.1} on average",
            self.quality,
            of_255(self.quality.error()),
            self.mean_samples
        )];
        if let (false, Some(([x, y], error))) = (self.limited.is_empty(), self.worst) {
            let count = self.limited.len();
            lines.push(format!(
                "{count} of {} tiles {} {} samples, the most, and noise above the bound: up to {}, in the tile at {x},{y}",
                self.tiles.values().sum::<usize>(),
                if count == 1 { "has" } else { "have" },
                self.quality.max_spp(),
                of_255(error)
            ));
        }
        lines
    }

    /// Sentences about samples that were not taken.
    pub(super) fn explanations(&self) -> Vec<String> {
        let Some((&most, _)) = self.tiles.last_key_value() else { return Vec::new() };
        let counts: Vec<_> = self.tiles.iter().map(|(samples, tiles)| format!("{tiles} with {samples}")).collect();
        vec![format!(
            "{:.1} % fewer samples than {most} in every pixel: tiles that a display shows without noise have enough; tiles by samples per pixel: {}",
            100.0 * (1.0 - self.mean_samples / f64::from(most.max(1))),
            counts.join(", ")
        )]
    }

    /// A record for programs.
    pub(super) fn record(&self) -> Value {
        let tiles: BTreeMap<_, _> = self.tiles.iter().map(|(samples, count)| (samples.to_string(), count)).collect();
        let worst = self.worst.filter(|(_, error)| error.is_finite());
        json!({
            "name": self.quality,
            "bound": self.quality.error(),
            "error": self.error,
            "worst_tile": worst.map(|([x, y], error)| json!({ "x": x, "y": y, "error": error })),
            "limited_tiles": self.limited,
            "tiles_by_samples": tiles,
        })
    }
}

/// An sRGB value in [0, 1] in steps of 8 bits.
fn of_255(value: f64) -> String {
    format!("{}/255", super::survey::significant(255.0 * value, 3))
}
