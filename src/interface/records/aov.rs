//! Auxiliary outputs.

records! {
    "aov";

    /// What a pixel's centre shows.
    AovPixel: words {
        /// Distance along the ray (world units); infinite where nothing is met.
        depth: float,
        /// Index into the scene's instances; all ones where nothing is met.
        instance: uint,
        /// Triangle or sphere of the instance's mesh.
        primitive: uint,
        /// Index into the scene's materials.
        material: uint,
        /// World position relative to the scene's origin.
        position: vec3,
        /// Linear base colour: red.
        red: float,
        /// Unit geometric normal, world, front side.
        ng: vec3,
        /// Linear base colour: green.
        green: float,
        /// Unit shading normal, on the side of `ng`.
        ns: vec3,
        /// Linear base colour: blue.
        blue: float,
    }
}
