//! Parameters of the pass that traces a set of rays, and of those that tests ask.

records! {
    "ray_set";

    /// A set of rays and what they met.
    RaySet: block readonly 8 {
        /// `Ray`s.
        rays: address,
        /// Nearest hits: `Hit`s, as HITS.bin; any: a `uint` each, 1 = occluded.
        results: address,
    }

    /// What a test gives a shader, and what it makes of that.
    Probe: block readonly 8 {
        /// The shader says what.
        inputs: address,
        /// The shader says what.
        outputs: address,
    }
}
