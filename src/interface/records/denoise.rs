//! Estimates of radiance: input and output of the denoiser's filter, and the signals of frames in real time.

records! {
    "denoise" values {
        /// How far non-local means look for pixels that are alike, pixels along each axis.
        NLMEANS_RADIUS: uint = 4;
        /// Side of the square of pixels that a thread of `nlmeans` filters.
        NLMEANS_BLOCK: uint = 4;
        /// The same of `nlmeans_radiance`.
        NLMEANS_RADIANCE_BLOCK: uint = 2;
    };

    /// Statistics of a pixel's radiance samples.
    RadianceRecord: Words {
        /// Mean, linear RGB.
        mean: vec3,
        /// Number of samples.
        samples: float,
        /// Variance of one sample, by channel.
        variance: vec3,
        /// By how much the filter's box is narrowed here: 0 not at all, 1 to the pixel itself; negative where light has changed from one frame to the next.
        narrowed: float,
    }

    /// Parameters of `nlmeans` and `nlmeans_radiance`.
    NlMeansParams: Block(access: "readonly", align: 8) {
        /// Image size, pixels.
        size: uvec2,
        /// Input: of each pixel its value and the variance of that, two floats; of radiance four.
        from: address,
        /// Output, a float per pixel; of radiance a `vec4`.
        to: address,
        /// A float per pixel: depth of its surface, scene units; negative where it shows several, 0 where it is left alone. Pixels of different surfaces are not averaged. 0: all may be.
        depths: address,
        /// How much pixels may differ, as a factor of the variance of their difference, for their weight to fall to 1/e.
        sameness: float,
        /// Padding to a multiple of 8 bytes.
        reserved: float,
    }
}
