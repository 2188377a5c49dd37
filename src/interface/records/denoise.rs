//! What the denoiser's filter averages.

records! {
    "denoise";

    /// A mean of radiance over samples.
    RadianceRecord: words {
        /// Linear RGB.
        mean: vec3,
        /// How many.
        samples: float,
        /// Of one sample.
        variance: vec3,
        /// To a multiple of 16 bytes.
        reserved: float,
    }
}
