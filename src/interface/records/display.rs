//! Parameters of the pass that shows a buffer of a frame.

records! {
    "display";

    /// What is shown, and how.
    DisplayParams: block readonly 8 {
        /// `FrameParams`.
        frame: address,
        /// A float a byte: the smallest value that is encoded so.
        thresholds: address,
        /// A `uint` a pixel.
        words: address,
        /// A float a pixel: ambient visibility.
        result: address,
        /// Estimates.
        history: address,
        /// 3 floats a pixel: filtered bent normals, or 0.
        bent: address,
        /// One of `SHOWN_*`.
        shown: uint,
        /// `2^exposure`.
        gain: float,
        /// World units that depths and positions are measured in.
        unit: float,
        /// 0: there is nothing but the result.
        has_history: uint,
    }
}
