//! The film on the device: compensated sums (Kahan 1965) for each pixel, each a sum and its excess,
//! and the parameters of the passes that add samples to it.

records! {
    "film";

    /// Parameters of the passes that add the samples of a launch to the film. They have all that
    /// those read: a CPU driver reads once for all lanes what push constants lead to at once.
    FilmParams: Block(access: "readonly", align: 8) {
        /// The film's pixels, in the order of the block.
        film: address,
        /// A float per sample for ambient occlusion, a `vec4` (`PathParams.radiance`) for paths.
        samples: address,
        /// `PathParams.occludes_all`.
        occludes_all: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }

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
