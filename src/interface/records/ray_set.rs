//! Parameters of the pass that traces a set of rays, and of test shaders.

records! {
    "ray_set";

    /// A set of rays and their results.
    RaySet: Block(access: "readonly", align: 8) {
        /// The `Ray`s.
        rays: address,
        /// Closest: a `Hit` per ray, as in HITS.bin; any: a `uint` per ray, 1 = occluded.
        results: address,
    }

    /// Input and output buffers of a test shader.
    Probe: Block(access: "readonly", align: 8) {
        /// Input, as the shader declares it.
        inputs: address,
        /// Output, as the shader declares it.
        outputs: address,
    }
}
