//! Parameters of the passes that render a block of an image.

use super::queue::QueueRecord;

records! {
    "block" includes "queue" values {
        /// Pixels along a side of the tiles in which the pixels of a block are numbered.
        TILE: uint = 8;
    };

    /// A block of an image, its camera, and what its passes read and write.
    BlockParams: block readonly 16 {
        /// Rows, relative to the scene's origin.
        camera_to_world: vec4[3],
        /// Half width and half height of the view: tangents, or world units when orthographic.
        view: vec2,
        /// 1: parallel rays.
        orthographic: uint,
        /// Of the sampler.
        seed: uint,
        /// Pixels.
        image_size: uvec2,
        /// Its upper left pixel.
        block_origin: uvec2,
        /// Pixels.
        block_size: uvec2,
        /// Tiles in a row of the block.
        tiles_x: uint,
        /// Axis of the hemisphere: 0 the geometric normal, 1 the shading normal.
        hemisphere: uint,
        /// A hit at distance d counts `2^(-d * falloff_log2)`.
        falloff_log2: float,
        /// World units beyond which nothing occludes; infinite: no limit.
        radius: float,
        /// A film pixel for each pixel of the block.
        film: address,
        /// A float per ray of a launch: what the sample adds to its pixel, negative where it met nothing.
        samples: address,
        /// `AovPixel` per ray of a launch.
        aov: address,
        /// A `uint` each: the tiles that are rendered; 0: all.
        tiles: address,
        /// Occlusion rays.
        queue: QueueRecord,
        /// Where camera rays are written, or 0.
        ray_dump: address,
        /// Where occlusion rays are written, or 0.
        occlusion_dump: address,
        /// `FrameParams`, or 0.
        frame: address,
        /// `PathParams`, or 0.
        path: address,
    }
}
