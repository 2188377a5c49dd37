//! Parameters of the pass that displays a buffer of a frame.

records! {
    "display" values {
        /// Flag: the image is radiance, in colour.
        DISPLAY_RADIANCE: uint = 1;
    };

    /// Parameters of the pass `display`.
    DisplayParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// 256 floats: the smallest linear value that sRGB encodes as each byte.
        thresholds: address,
        /// Output, a `uint` per pixel: 8-bit RGBA.
        words: address,
        /// Ambient visibility, a float per pixel.
        result: address,
        /// Final image, a `vec4` per pixel: value and coverage; 0: `result` is it.
        resolved: address,
        /// Accumulated estimates, 8 bytes per pixel.
        history: address,
        /// Estimates of this frame's samples alone, 8 bytes per pixel, or 0.
        current: address,
        /// Filtered bent normals, 3 floats per pixel, or 0.
        bent: address,
        /// One of `SHOWN_*`: the buffer that is displayed.
        shown: uint,
        /// Exposure as a factor: `2^exposure`.
        gain: float,
        /// Length by which depths and positions are divided, scene units.
        unit: float,
        /// 0: the technique has no history, only a result.
        has_history: uint,
        /// Occlusion rays of a pixel that is sampled in a frame.
        rays_per_pixel: float,
        /// Bits `DISPLAY_*`.
        flags: uint,
        /// One of `TONE_MAP_*`, for radiance.
        tone_map: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }
}
