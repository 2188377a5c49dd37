//! Estimates of radiance: input and output of the denoiser's filter, and the signals of frames.

records! {
    "denoise" values {
        /// How far non-local means look for pixels that are alike, pixels along each axis.
        NLMEANS_RADIUS: uint = 4;
        /// Side of the square of pixels that a thread of `nlmeans` filters.
        NLMEANS_BLOCK: uint = 4;
        /// Side of the square of pixels that a thread of `nlmeans_radiance` filters.
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
        /// Narrowing of the filter's box: 0 not at all, 1 to the pixel itself; negative where light
        /// has changed from one frame to the next.
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
        /// A float per pixel: depth of its surface, scene units, negative for several surfaces, 0
        /// if left alone; or 0. Pixels of different surfaces are not averaged.
        depths: address,
        /// Difference of pixels, over the variance of it, at which their weight falls to 1/e.
        sameness: float,
        /// Padding to a multiple of 8 bytes.
        reserved: float,
    }
}
