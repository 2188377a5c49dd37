//! Parameters of the passes of a frame, one record per pass, with the address of the `FrameParams`.

records! {
    "passes" values {
        /// Pixels of a thread of the filters `filter` and `denoise`.
        FILTER_STRIP: uint = 4;
    };

    /// Parameters of `ao_trace`, and of `gather`, which averages its results.
    AoTraceParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// A float per ray of the launch: ambient visibility. Unused when each pixel has one ray.
        samples: address,
        /// Estimates of this frame, 8 bytes per pixel.
        current: address,
        /// Bent normals of this frame, 3 floats per pixel; 0: unused.
        current_bent: address,
        /// A `uint`: number of occlusion rays of the frame.
        ray_count: address,
    }

    /// Parameters of `gtao`.
    GtaoParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Estimates of this frame, 8 bytes per pixel.
        current: address,
        /// Number of slices through the view ray.
        slices: uint,
        /// Number of steps on each side of a slice.
        steps: uint,
        /// Factor of the distances at which geometry occludes.
        radius_scale: float,
        /// Share of the radius over which occlusion fades out before it.
        fade: float,
        /// Exponent of the distances of steps: 1 spaces them evenly, more brings them closer.
        step_exponent: float,
        /// Factor of distances along the view beyond 1: what is far behind or before occludes less.
        thinness: float,
        /// Exponent of the ambient visibility.
        visibility_exponent: float,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }

    /// Parameters of `temporal`.
    TemporalParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Estimates of this frame, 8 bytes per pixel.
        current: address,
        /// Output: estimates from this frame and the frames before.
        history: address,
        /// Bent normals of this frame, 3 floats per pixel; 0, as the two that follow: unused.
        current_bent: address,
        /// Output: bent normals of the history.
        bent_history: address,
        /// Bent normals of the previous frame's history.
        previous_bent_history: address,
        /// `MovedRecord`s of this frame.
        moved: address,
        /// Number of `MovedRecord`s.
        moved_count: uint,
        /// Strength with which moving objects shorten histories; 0: none.
        moved_weight: float,
        /// Half width of clamping near moving objects, in standard errors of the mean; 0: none.
        clamp_width: float,
        /// Padding to a multiple of 8 bytes.
        reserved: float,
    }

    /// Parameters of debug views.
    DebugParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Address of the `BlockParams` of the whole image.
        block: address,
        /// Output of views that count something, a `uint` per pixel; else 0.
        counts: address,
        /// Output, a `uint` per pixel: colour, 8-bit RGBA.
        words: address,
        /// `2^exposure`.
        gain: float,
        /// Value at the middle of the colour scale.
        middle: float,
    }

    /// Parameters of one step of a spatial filter (`filter`, `denoise`).
    FilterParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Input estimates.
        from: address,
        /// Output estimates; 0: this is the last step, which writes `result`.
        to: address,
        /// Output of the last step, a float per pixel: ambient visibility.
        result: address,
        /// Input bent normals, 3 floats per pixel; 0: unused.
        bent_from: address,
        /// Output bent normals, 3 floats per pixel.
        bent_to: address,
        /// Distance between taps, pixels.
        stride: uint,
        /// Maximum number of taps to each side.
        radius: uint,
        /// Samples that a filtered value should average: the box grows until it holds this many.
        samples: float,
        /// Convergence of the sampler: the variance of n samples falls as `n^-(1 + evenness)`.
        evenness: float,
    }

    /// Parameters of `resample`.
    ResampleParams: Block(access: "readonly", align: 8) {
        /// Input records.
        from: address,
        /// Output records.
        to: address,
        /// Size of the input image, pixels.
        from_size: uvec2,
        /// Size of the output image, pixels.
        to_size: uvec2,
        /// Words of a pixel's record.
        words: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }

    /// Parameters of `seen`.
    SeenParams: Block(access: "readonly", align: 8) {
        /// Address of a `FrameParams`: this frame's G-buffer is the other image's, the previous
        /// frame this image's last one.
        frame: address,
        /// Two `uint`: pixels of the other image with a surface, and how many this one shows too.
        counts: address,
        /// One of so many pixels is counted.
        stride: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }
}
