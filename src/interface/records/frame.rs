//! Parameters and images that the passes of a real-time frame share.
//!
//! Images are buffers, rows from the top, one record per pixel:
//!
//! | image | bytes | what |
//! |---|---|---|
//! | surface | 16 | `SurfaceRecord` |
//! | normals | 16 | unit geometric normal, on the viewer's side, and padding: of its own, because filters need the position no more than its depth |
//! | guide | 8 | view depth (infinite for background), packed normal and id: for edge tests between neighbours |
//! | history | 8 | mean ambient visibility; number of samples, and variance of one sample |
//! | current | 8 | the same for this frame's samples alone; 0 samples where a pixel has none |
//! | bent | 12 | optional: bent normal, the mean of ambient visibility times direction, world space; one image each for this frame, the history and the filtered result, from the same samples as ambient visibility |

records! {
    "frame" values {
        /// Largest variance that a packed estimate holds, of values from 0 to 1: twice a quarter,
        /// for unbiased estimates from two values.
        MAX_VARIANCE: float = 0.5;
    };

    /// Parameters that all passes of a frame share: the cameras of this frame and of the previous
    /// one, the sampling settings, and the G-buffer. `passes.rs` has those of a single pass.
    FrameParams: Block(access: "readonly", align: 16) {
        /// Camera to world, three rows; the world is relative to the scene's origin.
        camera_to_world: vec4[3],
        /// World to camera, three rows.
        world_to_camera: vec4[3],
        /// World to camera of the previous frame, three rows.
        previous_world_to_camera: vec4[3],
        /// Half width and half height of the view: tangents, or scene units if orthographic.
        view: vec2,
        /// `view` of the previous frame.
        previous_view: vec2,
        /// 1: the camera is orthographic.
        orthographic: uint,
        /// `orthographic` of the previous frame.
        previous_orthographic: uint,
        /// Image size, pixels.
        size: uvec2,
        /// Offset of this frame's samples from their pixels' centres, pixels, in [-0.5, 0.5).
        offset: vec2,
        /// `offset` of the previous frame.
        previous_offset: vec2,
        /// Number of 8x8 tiles in a row of the image.
        tiles_x: uint,
        /// Frame index, from which the sampler's points follow.
        frame: uint,
        /// Seed of the sampler.
        seed: uint,
        /// Occlusion rays of each pixel that is sampled in this frame.
        rays_per_pixel: uint,
        /// One of `PATTERN_*`: which pixels are sampled in this frame.
        pattern: uint,
        /// One of `SEQUENCE_*`: the sampler of ray directions.
        sequence: uint,
        /// Length of occlusion rays, scene units.
        reach: float,
        /// Falloff: a hit at distance d occludes by `2^(-d * falloff_log2)`.
        falloff_log2: float,
        /// Maximum history length, in samples.
        most_samples: float,
        /// Distance from a tangent plane, in footprints, at which neighbours are other surfaces.
        depth_tolerance: float,
        /// Cosine between normals below which a neighbour counts as another surface.
        normal_tolerance: float,
        /// 1: neither the camera nor the scene has moved since the previous frame.
        still: uint,
        /// 0: the history buffers hold no data yet.
        has_history: uint,
        /// 1: nothing moves, and pixels whose history is full get no more rays.
        rest: uint,
        /// `SurfaceRecord` of each pixel.
        surface: address,
        /// Normal of each pixel's surface.
        normals: address,
        /// Axis of each pixel's hemisphere, 3 floats; 0: the geometric normal is the axis.
        axes: address,
        /// Guide image of this frame, for edge tests.
        guide: address,
        /// Guide image of the previous frame.
        previous_guide: address,
        /// History of the previous frame.
        previous_history: address,
        /// Position of each pixel's surface in the previous frame, 3 floats; 0: nothing moves.
        previous_position: address,
    }

    /// An object that moved or deformed: a box around its bounds in the previous and in this frame.
    MovedRecord: Array(buffer: "MovedRecords", access: "readonly", align: 16) {
        /// Lower corner, world space relative to the scene's origin.
        lower: vec3,
        /// Fraction of the hemisphere part that the box covers which may have changed: distance
        /// moved over size, at most 1.
        share: float,
        /// Upper corner.
        upper: vec3,
        /// Padding to a multiple of 16 bytes.
        reserved: float,
    }

    /// The surface point at a pixel's centre.
    SurfaceRecord: Words {
        /// Position, world space relative to the scene's origin.
        position: vec3,
        /// Distance along the normal at which rays start, against self-intersection, scene units.
        spawn_offset: float,
    }
}
