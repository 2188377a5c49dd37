//! Pixels of the film on the device: compensated sums (Kahan 1965), each a sum and its excess.

records! {
    "film";

    /// A pixel of a film of one channel.
    ScalarFilmPixel: Array(buffer: "ScalarFilm", access: "", align: 8) {
        /// Sum of the samples, and its compensation term.
        sum: vec2[1],
        /// Sum of the squared samples, and its compensation term.
        sum_squares: vec2[1],
        /// Number of samples whose camera ray hit the scene.
        covered: uint,
        /// Number of samples that were rejected because they were not finite.
        not_finite: uint,
    }

    /// A pixel of a film of linear RGB.
    RgbFilmPixel: Array(buffer: "RgbFilm", access: "", align: 8) {
        /// Sum of the samples of each channel, and its compensation term.
        sum: vec2[3],
        /// Sum of the squared samples of each channel, and its compensation term.
        sum_squares: vec2[3],
        /// Number of samples whose camera ray hit the scene.
        covered: uint,
        /// Number of samples that were rejected because they were not finite.
        not_finite: uint,
    }
}
