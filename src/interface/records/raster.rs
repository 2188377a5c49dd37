//! Parameters of rasterization.

records! {
    "raster";

    /// Parameters of rasterization.
    RasterParams: Block(access: "readonly", align: 16) {
        /// Eye-relative position to clip space, four rows.
        clip: vec4[4],
        /// Camera position, relative to the scene's origin.
        eye: vec3,
        /// -1 where the camera's transform mirrors and reverses the winding, else 1.
        turned: float,
        /// Position in a pixel through which its ray passes, 0 to 1.
        at: vec2,
        /// Address of the `BlockParams`.
        block: address,
        /// Depth in clip space of the boxes around spheres, which no clipping plane cuts.
        box_depth: float,
        /// Padding to a multiple of 16 bytes.
        reserved: uint[3],
    }
}
