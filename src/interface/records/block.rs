//! Parameters of the passes that render a block of an image.

use super::queue::QueueRecord;

records! {
    "block" includes "queue" values {
        /// Pixels along a side of the tiles in which the pixels of a block are numbered.
        TILE: uint = 8;
        /// Log2 of the pixels of a bundle, 2x2 in a row, whose rays share a list of entry points.
        BUNDLE_BITS: uint = 2;
        /// Maximum number of entry points of a bundle.
        MAX_ENTRY_POINTS: uint = 12;
        /// Bytes of a bundle's list: per entry point its block and the least distance to it, near
        /// to far, then a pair of `INVALID`.
        ENTRY_LIST_BYTES: uint = 128;
    };

    /// A block of an image, its camera, and what its passes read and write.
    BlockParams: Block(access: "readonly", align: 16) {
        /// Camera to world, three rows; the world is relative to the scene's origin.
        camera_to_world: vec4[3],
        /// Half width and half height of the view: tangents, or scene units if orthographic.
        view: vec2,
        /// 1: the camera is orthographic.
        orthographic: uint,
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
        /// Axis of the hemisphere: 0 the geometric normal, 1 the shading normal.
        hemisphere: uint,
        /// Falloff: a hit at distance d occludes by `2^(-d * falloff_log2)`.
        falloff_log2: float,
        /// AO radius, scene units: hits beyond do not occlude; infinite: no limit.
        radius: float,
        /// The film's pixels, in the order of the block.
        film: address,
        /// A float per ray of a launch: value of the sample, negative if its camera ray missed.
        samples: address,
        /// `AovPixel` of each ray of a launch.
        aov: address,
        /// A `uint` per tile that is rendered: its index; 0: all tiles.
        tiles: address,
        /// The queue of occlusion rays.
        queue: QueueRecord,
        /// Output for camera rays, or 0.
        ray_dump: address,
        /// Output for occlusion rays, or 0.
        occlusion_dump: address,
        /// Address of the `FrameParams`, or 0.
        frame: address,
        /// Address of the `PathParams`, or 0.
        path: address,
        /// One of `FILTER_*`: the reconstruction filter.
        pixel_filter: uint,
        /// Frames in real time: number of pixels that are sampled in a frame. Rays of pixels beyond
        /// are of listed ones, `1 << listed_bits` after another of each.
        cells: uint,
        /// Address of the `SurfacesParams`, or 0.
        surfaces: address,
        /// Entry points of each bundle of pixels (entry_points.glsl); 0: rays start at the root.
        entry_points: address,
        /// Offset of rays through the centres of pixels from there, pixels.
        centre_offset: vec2,
        /// Frames in real time: listed ones among the sampled pixels (`SurfacesParams.list`).
        listed: address,
        /// Frames in real time: a `KnownHit` per pixel of the image (`path_surface`), or 0: paths
        /// trace their camera rays themselves.
        known_hits: address,
        /// Log2 of the number of pixels beyond `cells` that are of a listed one.
        listed_bits: uint,
        /// Distance of the near clipping plane along the view direction, scene units; 0: none.
        clip_near: float,
        /// Distance of the far clipping plane; 0: none.
        clip_far: float,
        /// Log2 of the number of consecutive samples of a pixel that share a camera ray.
        camera_shift: uint,
    }
}
