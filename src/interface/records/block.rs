//! Parameters that all passes over a block of an image share: its camera, and its pixels. What one
//! pass alone reads lies behind them in memory, in a record of its own.

records! {
    "block" values {
        /// Pixels along a side of the tiles in which the pixels of a block are numbered.
        TILE: uint = 8;
    };

    /// A block of an image, its camera, and where the samples of its pixels lie.
    BlockParams: Block(access: "readonly", align: 16) {
        /// Camera to world, three rows; the world is relative to the scene's origin.
        camera_to_world: vec4[3],
        /// Half width and half height of the view: tangents, or scene units if orthographic.
        view: vec2,
        /// 1: the camera is orthographic.
        orthographic: uint,
        /// Distance of the near clipping plane along the view direction, scene units; 0: none.
        clip_near: float,
        /// Distance of the far clipping plane; 0: none.
        clip_far: float,
        /// Seed of the sampler.
        seed: uint,
        /// Image size, pixels.
        image_size: uvec2,
        /// Upper left pixel of the block.
        block_origin: uvec2,
        /// Size of the block, pixels.
        block_size: uvec2,
        /// Number of tiles in a row of the block.
        tiles_x: uint,
        /// One of `FILTER_*`: the reconstruction filter.
        pixel_filter: uint,
        /// A `uint` per tile that is rendered: its index; 0: all tiles.
        tiles: address,
        /// Offset of rays through the centres of pixels from there, pixels.
        centre_offset: vec2,
        /// Padding to a multiple of 16 bytes.
        reserved: uint[2],
    }
}
