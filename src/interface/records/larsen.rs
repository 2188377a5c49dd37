//! What the passes of Larsen's pipeline (2019) share.

records! {
    "larsen" values {
        /// Occlusion rays of a pixel of the occlusion image.
        LARSEN_RAYS: uint = 64;
        /// Side of the tile of noise, pixels.
        LARSEN_NOISE: uint = 64;
    };

    /// Parameters of Larsen's pipeline.
    LarsenParams: block readonly 16 {
        /// `FrameParams`.
        frame: address,
        /// 4 floats each: position relative to the scene's origin.
        lights: address,
        /// How many there are.
        light_count: uint,
        /// The frame's number, modulo 2.
        frame_parity: uint,
        /// Pixels of the occlusion image.
        half_size: uvec2,
        /// World units that one of its own is.
        unit: float,
        /// 0: without the blur.
        blurred: uint,
        /// 2 floats each: 64 of Mitchell's best candidates.
        points: address,
        /// A float each: 64 x 64 blue noise.
        noise: address,
        /// A `uint` a pixel: lights that are visible.
        lit: address,
        /// A float per ray of a launch.
        samples: address,
        /// A float per pixel of the occlusion image.
        occlusion: address,
        /// A float a pixel.
        combined: address,
        /// A float a pixel: the result of the frame before.
        previous: address,
        /// A float a pixel: ambient visibility.
        result: address,
        /// A `uint`: occlusion rays traced.
        rays: address,
    }
}
