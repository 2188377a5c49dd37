//! Parameters that the passes of Larsen's pipeline (2019) share.

records! {
    "larsen" values {
        /// Occlusion rays per pixel of the half-resolution occlusion image.
        LARSEN_RAYS: uint = 64;
        /// Side of the blue-noise tile, pixels.
        LARSEN_NOISE: uint = 64;
    };

    /// Parameters of Larsen's pipeline.
    LarsenParams: Block(access: "readonly", align: 16) {
        /// Address of the `FrameParams`.
        frame: address,
        /// 4 floats per point light: position relative to the scene's origin, and padding.
        lights: address,
        /// Number of point lights.
        light_count: uint,
        /// Frame index modulo 2.
        frame_parity: uint,
        /// Size of the occlusion image, pixels.
        half_size: uvec2,
        /// Scene units per unit of length in the paper.
        unit: float,
        /// 0: the blur is off.
        blurred: uint,
        /// Sample points, 2 floats each: 64 points by Mitchell's best candidates.
        points: address,
        /// Blue-noise tile, 64 x 64 floats.
        noise: address,
        /// A `uint` per pixel: number of visible point lights.
        lit: address,
        /// A float per ray of a launch: its occlusion.
        samples: address,
        /// A float per pixel of the occlusion image.
        occlusion: address,
        /// A float per pixel: one minus blurred occlusion.
        combined: address,
        /// A float per pixel: result of the previous frame.
        previous: address,
        /// Output, a float per pixel: ambient visibility.
        result: address,
        /// A `uint`: number of occlusion rays traced.
        rays: address,
    }
}
