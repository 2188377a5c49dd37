//! Auxiliary outputs.

records! {
    "aov";

    /// Parameters of `aov`, behind the `BlockParams`.
    AovParams: Block(access: "readonly", align: 8) {
        /// Output, an `AovPixel` for each ray of a launch.
        pixels: address,
    }

    /// Surface properties at the hit of the ray through a pixel's centre.
    AovPixel: Words {
        /// Distance along the ray, scene units; infinite for a miss.
        depth: float,
        /// Index into the scene's instances; `INVALID` for a miss.
        instance: uint,
        /// Index of the triangle or sphere in the instance's mesh.
        primitive: uint,
        /// Index into the scene's materials.
        material: uint,
        /// World position relative to the scene's origin.
        position: vec3,
        /// Linear base colour: red.
        red: float,
        /// Unit geometric normal, world space, on the front side.
        ng: vec3,
        /// Linear base colour: green.
        green: float,
        /// Unit shading normal, on the side of `ng`.
        ns: vec3,
        /// Linear base colour: blue.
        blue: float,
    }
}
