//! What the passes of a frame in real time share.
//!
//! Images are in plain memory, rows from the top, one record a pixel:
//!
//! | image | bytes | what |
//! |---|---|---|
//! | surface | 32 | `SurfaceRecord` |
//! | guide | 8 | view depth (infinite: nothing is there), normal and id packed: what edge tests of neighbours read |
//! | history | 8 | mean accessibility; number of samples behind it, variance of one of them |
//! | current | 8 | the same of this frame's samples alone; no samples: 0 of them |
//! | bent | 12 | where required: mean of accessibility times direction (bent normal), world space; one for each of this frame's samples, history and the filtered result. Its samples are those of the accessibility beside it |

records! {
    "frame" values {
        /// Largest variance that a packed estimate holds, of values from 0 to 1: a quarter, and half of it more for an unbiased estimate from two.
        MAX_VARIANCE: float = 0.5;
        /// Budget: sums of desired samples at 64 levels far apart.
        SUMS_COARSE: uint = 0;
        /// Budget: sums of desired samples at 64 levels between two of those.
        SUMS_FINE: uint = 64;
        /// Budget: sum of deviations.
        SUMS_DEVIATION: uint = 128;
        /// Budget: number of pixels.
        SUMS_PIXELS: uint = 129;
        /// Budget: number of rays that are listed.
        SUMS_LISTED: uint = 130;
        /// Budget: how many sums there are.
        SUMS_COUNT: uint = 131;
        /// Budget: one of so many pixels speaks for all where desired samples are added up.
        BUDGET_SHARE: uint = 16;
        /// Step of a filter: its box reaches along rows.
        STEP_HORIZONTAL: uint = 1;
        /// Step of a filter: its box reaches along columns.
        STEP_VERTICAL: uint = 2;
    };

    /// What all passes of a frame share: its cameras, how it is sampled, and the images that tell what pixels show. What else a pass reads and writes is in a record
    /// of its own (src/interface/records/passes.rs).
    FrameParams: block readonly 16 {
        /// Rows, relative to the scene's origin.
        camera_to_world: vec4[3],
        /// Rows of the inverse.
        world_to_camera: vec4[3],
        /// Of the previous frame.
        previous_world_to_camera: vec4[3],
        /// Half width and half height of the view: tangents, or world units when orthographic.
        view: vec2,
        /// Of the previous frame.
        previous_view: vec2,
        /// 1: parallel rays.
        orthographic: uint,
        /// Of the previous frame.
        previous_orthographic: uint,
        /// Pixels.
        size: uvec2,
        /// 8x8 tiles in a row.
        tiles_x: uint,
        /// Counts up; where samples differ from frame to frame.
        frame: uint,
        /// Of the sequence.
        seed: uint,
        /// Of a pixel that is sampled in this frame; with a budget: at most.
        rays_per_pixel: uint,
        /// One of `PATTERN_*`: which pixels are sampled.
        pattern: uint,
        /// One of `SEQUENCE_*`.
        sequence: uint,
        /// Length of occlusion rays, world units.
        reach: float,
        /// A hit at distance d counts `2^(-d * falloff_log2)`.
        falloff_log2: float,
        /// That a history counts at most.
        most_samples: float,
        /// Distance from a pixel's plane, in pixels' footprints, at which an edge begins.
        depth_tolerance: float,
        /// Cosine between normals at which an edge begins.
        normal_tolerance: float,
        /// 1: neither camera nor scene have moved since the previous frame.
        still: uint,
        /// 0: the history buffers hold nothing.
        has_history: uint,
        /// 1: nothing moves, and pixels with all their samples get no more.
        rest: uint,
        /// `SurfaceRecord`s.
        surface: address,
        /// 3 floats a pixel: the hemisphere's axis where it is not the geometric normal; or 0.
        axes: address,
        /// For edge tests.
        guide: address,
        /// Of the previous frame.
        previous_guide: address,
        /// Of the previous frame.
        previous_history: address,
        /// 3 floats a pixel: where its surface was in the previous frame; 0: nothing moves.
        previous_position: address,
    }

    /// What moved, or changed its shape: box around where it was and where it is.
    MovedRecord: array MovedRecords readonly 16 {
        /// Lower corner, world space.
        lower: vec3,
        /// Of what it covers that may have changed in this frame: the way it went by its size, at most 1.
        share: float,
        /// Upper corner.
        upper: vec3,
        /// To a multiple of 16 bytes.
        reserved: float,
    }

    /// What a pixel shows.
    SurfaceRecord: words {
        /// World space, relative to the scene's origin.
        position: vec3,
        /// How far off the surface a ray has to start so that it does not meet it, world units.
        spawn_offset: float,
        /// Unit geometric normal on the viewer's side.
        normal: vec3,
        /// To a multiple of 16 bytes.
        reserved: float,
    }
}
