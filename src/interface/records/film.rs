//! Pixels of the film on the device: compensated sums (Kahan 1965), each a sum and what it has too much.

records! {
    "film";

    /// A pixel of a film of one channel.
    ScalarFilmPixel: array ScalarFilm readwrite 8 {
        /// Of the samples, and its compensation.
        sum: vec2[1],
        /// Of their squares, likewise.
        sum_squares: vec2[1],
        /// Samples that met the scene.
        covered: uint,
        /// Samples that were left out because they were not finite.
        not_finite: uint,
    }

    /// A pixel of a film of linear RGB.
    RgbFilmPixel: array RgbFilm readwrite 8 {
        /// Of the samples of each channel, and its compensation.
        sum: vec2[3],
        /// Of their squares, likewise.
        sum_squares: vec2[3],
        /// Samples that met the scene.
        covered: uint,
        /// Samples that were left out because they were not finite.
        not_finite: uint,
    }
}
