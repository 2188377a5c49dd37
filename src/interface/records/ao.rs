//! Parameters of ambient occlusion: of its surfaces' hemispheres, and of the passes of stills.

use super::queue::QueueRecord;

records! {
    "ao" includes "queue" values {
        /// Log2 of the pixels of a bundle, 2x2 in a row, whose rays share a list of entry points.
        BUNDLE_BITS: uint = 2;
        /// Maximum number of entry points of a bundle.
        MAX_ENTRY_POINTS: uint = 12;
        /// Bytes of a bundle's list: per entry point its block and the least distance to it, near
        /// to far, then a pair of `INVALID`.
        ENTRY_LIST_BYTES: uint = 128;
        /// Bit of the tag of an occlusion ray from a ground that catches shadows.
        CAUGHT: uint = 2147483648;
        /// Sample of such a ray that nothing occludes; that of a camera ray that misses is -1.
        CAUGHT_UNOCCLUDED: float = -2.0;
    };

    /// Which hits occlude a surface point, and how much.
    OcclusionRecord: Structure {
        /// Length of occlusion rays, scene units: hits beyond do not occlude; infinite: no limit.
        reach: float,
        /// Falloff: a hit at distance d occludes by `2^(-d * falloff_log2)`.
        falloff_log2: float,
        /// Axis of the hemisphere: 0 the geometric normal, 1 the shading normal.
        hemisphere: uint,
    }

    /// Parameters of `primary` and `occlusion`, and of `entry_points`, which precedes them. They
    /// lie behind the `BlockParams`.
    AoParams: Block(access: "readonly", align: 8) {
        /// Which hits occlude.
        occlusion: OcclusionRecord,
        /// Log2 of the number of consecutive samples of a pixel that share a camera ray.
        camera_shift: uint,
        /// A float per sample of a launch: its value, negative if its camera ray missed.
        samples: address,
        /// The queue of occlusion rays.
        queue: QueueRecord,
        /// Entry points of each bundle of pixels (entry_points.glsl); 0: rays start at the root.
        entry_points: address,
        /// Output for camera rays, or 0.
        ray_dump: address,
        /// Output for occlusion rays, or 0.
        occlusion_dump: address,
        /// The material of a ground that catches shadows, with `HAS_CATCHER`.
        catcher: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }
}
