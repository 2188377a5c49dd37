//! Parameters of the passes of a frame in real time, a record a pass. Each leads to the `FrameParams` that all share.

records! {
    "passes";

    /// Of `ao_trace`, and of `gather`, which adds up what that traces.
    AoTraceParams: block readonly 8 {
        /// `FrameParams`.
        frame: address,
        /// A float a ray: of a launch, or with a budget of the frame. Used where a pixel may have several.
        samples: address,
        /// This frame's estimates.
        current: address,
        /// 3 floats a pixel: this frame's bent normals; 0: unused.
        current_bent: address,
        /// 8 bytes a pixel: number of its first ray in its sequence (24 bits), rays; samples that its history counts at most. 0, as what follows: every pixel has
        /// as many.
        plan: address,
        /// A `uint` a ray: pixel (28 bits), which of its rays.
        list: address,
        /// A `uint`: occlusion rays of the frame.
        ray_count: address,
        /// Rays of a pixel in a frame with a budget, at most.
        most_rays: uint,
        /// To a multiple of 8 bytes.
        reserved: uint,
    }

    /// Of `gtao`.
    GtaoParams: block readonly 8 {
        /// `FrameParams`.
        frame: address,
        /// This frame's estimates.
        current: address,
        /// Slices through the view ray.
        slices: uint,
        /// On each side of a slice.
        steps: uint,
    }

    /// Of `budget`.
    BudgetParams: block readonly 8 {
        /// `FrameParams`.
        frame: address,
        /// 8 bytes a pixel, in tiles: deviation of one sample, samples.
        desired_samples: address,
        /// Uints: `SUMS_*`.
        sums: address,
        /// As in `AoTraceParams`.
        plan: address,
        /// As in `AoTraceParams`.
        list: address,
        /// A `uint` a pixel: rays that it has had.
        taken: address,
        /// One of `STAGE_*`.
        stage: uint,
        /// Rays of a pixel in a frame, at most.
        most_rays: uint,
    }

    /// Of `temporal`.
    TemporalParams: block readonly 8 {
        /// `FrameParams`.
        frame: address,
        /// This frame's estimates.
        current: address,
        /// Estimates of this frame and those before, written.
        history: address,
        /// 3 floats a pixel each: bent normals of this frame's samples; 0, as the others: unused.
        current_bent: address,
        /// Bent normals of the history, written.
        bent_history: address,
        /// Bent normals of the previous frame's history.
        previous_bent_history: address,
        /// As in `AoTraceParams`.
        plan: address,
        /// `MovedRecord`s: what has moved since the previous frame.
        moved: address,
        /// How many there are.
        moved_count: uint,
        /// How much what moves shortens histories.
        moved_weight: float,
        /// Standard errors by which a history may differ from its surroundings where things move; 0: any.
        clamp_width: float,
        /// To a multiple of 8 bytes.
        reserved: float,
    }

    /// Of `nodes`.
    NodesParams: block readonly 8 {
        /// `BlockParams`.
        block: address,
        /// A `uint` a pixel: BVH nodes that its camera ray visits.
        nodes: address,
        /// A `uint` a pixel: colours.
        words: address,
        /// `2^exposure`.
        gain: float,
        /// Number of nodes that has the colour in the middle of the scale.
        middle: float,
    }

    /// Of a step of a filter: `filter`, `denoise`.
    FilterParams: block readonly 8 {
        /// `FrameParams`.
        frame: address,
        /// Estimates, read.
        from: address,
        /// Estimates, written; 0: the step is the last and writes the result.
        to: address,
        /// A float a pixel: ambient visibility.
        result: address,
        /// 3 floats a pixel each: bent normals, read; 0: unused.
        bent_from: address,
        /// Bent normals, written.
        bent_to: address,
        /// `STEP_HORIZONTAL`, `STEP_VERTICAL`: sides of the box on which it reaches to the radius.
        sides: uint,
        /// Distance of taps, pixels.
        stride: uint,
        /// Taps to each side at most.
        radius: uint,
        /// Samples that a filtered value should rest on.
        samples: float,
        /// The variance of the mean of n samples falls as `n^-(1 + evenness)`.
        evenness: float,
        /// To a multiple of 8 bytes.
        reserved: float,
    }
}
