//! The input of the denoiser's filter.

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
        /// Padding to a multiple of 16 bytes.
        reserved: float,
    }
}
