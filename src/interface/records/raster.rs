//! Parameters of what rasterizes.

records! {
    "raster";

    /// What is rasterized, and from where.
    RasterParams: block readonly 16 {
        /// Rows: from a point relative to the eye to clip space.
        clip: vec4[4],
        /// The camera's position, relative to the scene's origin.
        eye: vec3,
        /// -1 where the camera's transform turns the winding, else 1.
        turned: float,
        /// Where in a pixel its ray passes.
        at: vec2,
        /// `BlockParams`.
        block: address,
    }
}
