//! Estimates of radiance: input and output of the denoiser's filter, and the signals of frames in real time.

records! {
    "denoise";

    /// Statistics of a pixel's radiance samples.
    RadianceRecord: words {
        /// Mean, linear RGB.
        mean: vec3,
        /// Number of samples.
        samples: float,
        /// Variance of one sample, by channel.
        variance: vec3,
        /// By how much the filter's box is narrowed here: 0 not at all, 1 to the pixel itself.
        narrowed: float,
    }
}
