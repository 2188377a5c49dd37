//! Parameters of the passes that bake maps: surface points of texels, and sums of their samples.

use super::ao::OcclusionRecord;

records! {
    "bake" includes "ao";

    /// A point of a surface whose hemisphere is sampled for a texel.
    BakePoint: Array(buffer: "BakePoints", access: "readonly", align: 8) {
        /// Index into the scene's instances.
        instance: uint,
        /// Index of the triangle or sphere in the instance's mesh.
        primitive: uint,
        /// Barycentric weight of the triangle's second vertex.
        u: float,
        /// Barycentric weight of the triangle's third vertex.
        v: float,
        /// Column and row of the texel, which decide its sequence of samples: `x | y << 16`.
        texel: uint,
        /// Index in the texel's sequence of the point's first sample.
        first_sample: uint,
    }

    /// Parameters of `bake` and `bake_sum`.
    BakeParams: Block(access: "readonly", align: 8) {
        /// The `BakePoint`s.
        points: address,
        /// Results of the samples of a launch: a float each, or with `directions` a `vec4`.
        samples: address,
        /// Two `vec4` for each point: the sums of its samples' weighted directions and values, and
        /// of their squares.
        sums: address,
        /// Which hits occlude, and how much.
        occlusion: OcclusionRecord,
        /// Seed of the sampler.
        seed: uint,
        /// Rays leave into the surface, not from it.
        is_inward: uint,
        /// The value of a ray is the share of the reach that it gets, not whether it is open.
        has_lengths: uint,
        /// Directions of samples are summed, too, each weighted by its value.
        has_directions: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }
}
