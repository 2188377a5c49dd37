//! Parameters of the pass that finds the surfaces of frames of ambient occlusion.

records! {
    "gbuffer";

    /// Parameters of `gbuffer`, behind the `BlockParams`.
    GbufferParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Axis of the hemisphere: 0 the geometric normal, 1 the shading normal.
        hemisphere: uint,
        /// The material of a ground that catches shadows; `INVALID`: there is none.
        catcher: uint,
    }
}
