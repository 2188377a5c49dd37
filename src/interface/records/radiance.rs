//! Parameters of the passes of a frame of radiance, and of those that resolve any frame.

use super::queue::QueueRecord;

records! {
    "radiance" includes "queue" values {
        /// Mirrors and panes of glass that the G-buffer's rays follow.
        MAX_GUIDE_BOUNCES: uint = 8;
        /// The coverage in the G-buffer of a ground that catches shadows, which covers by the light
        /// that it does not get.
        COVERS_CAUGHT: float = 2.0;
        /// One of so many pixels is counted to know how many show a surface.
        LIST_PART: uint = 16;
    };

    /// A ray of the G-buffer on its way behind mirrors and glass.
    GuideRayRecord: Words {
        /// Rows of the product of reflections so far, each with a number besides: the distance from
        /// the camera in scene units, the number of bounces (bits of a `uint`), and 1 where the
        /// previous image did not show what the pixel does, else 0.
        rows: vec4[3],
    }

    /// The hit of a pixel's ray, with the ids of the scene.
    KnownHit: Words {
        /// Ray parameter; infinite for a miss, which has no other fields.
        t: float,
        /// Index of the instance.
        instance: uint,
        /// Index of the primitive in its mesh.
        primitive: uint,
        /// Barycentric coordinates: weights of the second and third vertex.
        uv: vec2,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }

    /// Parameters of `path_surface` and `path_reflection`, behind the `BlockParams`.
    SurfacesParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Address of the `PathParams`.
        path: address,
        /// The queue of rays behind mirrors and glass.
        next: QueueRecord,
        /// A `GuideRayRecord` per ray of the queue that is traced; 0: no ray goes on.
        states: address,
        /// A `GuideRayRecord` per ray of the queue that is filled.
        next_states: address,
        /// A `uint` per ray of the queue that is traced: its pixel.
        tags: address,
        /// Output, a `vec4` per pixel: linear diffuse albedo, and roughness of reflections, 0 to 1.
        materials: address,
        /// Output, a `vec4` per pixel: emission and background seen directly, linear, and coverage.
        direct: address,
        /// Output, a `KnownHit` per pixel: what is seen directly; or 0.
        known_hits: address,
        /// Output: the number of pixels whose surface was not seen in the previous image, that of
        /// pixels that show a surface, counted in one of `LIST_PART`, and each of the former; or 0.
        list: address,
        /// Tiles in a row of the pixels that are sampled in a frame.
        tiles_x: uint,
        /// Padding.
        reserved: uint,
    }

    /// Parameters of `path_gather`.
    GatherParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Address of the `PathParams`, with what the paths of the launch left.
        path: address,
        /// Output, a `RadianceRecord` per pixel: diffuse reflection divided by the albedo.
        diffuse: address,
        /// Output, a `RadianceRecord` per pixel: the rest.
        specular: address,
        /// Output, a float per pixel: distance of reflections, scene units, or `SIGNAL_UNKNOWN`.
        distances: address,
        /// Output, two `vec4` per pixel: samples of the whole signal at rest; 0: not kept.
        rest: address,
        /// Output, three `vec4` per pixel: the parts of the samples at rest; 0: not kept.
        rest_parts: address,
        /// 1: it has not rested before.
        starts: uint,
        /// Samples per pixel of earlier launches of this frame.
        earlier: uint,
        /// Tiles in a row of the pixels that are sampled in a frame.
        tiles_x: uint,
        /// The first path of the launch that is gathered.
        first_path: uint,
        /// A `uint` per gathered pixel among those sampled in a frame; 0: those of the launch.
        listed: address,
    }

    /// Parameters of `radiance_temporal`.
    RadianceTemporalParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// This frame's diffuse reflection divided by the albedo, a `RadianceRecord` per pixel.
        diffuse: address,
        /// This frame's rest of the signal, a `RadianceRecord` per pixel.
        specular: address,
        /// Histories of the previous frame.
        previous_diffuse: address,
        /// Histories of the rest of the signal in the previous frame.
        previous_specular: address,
        /// Output: histories of this frame.
        diffuse_history: address,
        /// Output: histories of the rest of the signal in this frame.
        specular_history: address,
        /// Distance of what is reflected, a float per pixel.
        distances: address,
        /// A `vec4` per pixel: albedo, and roughness of reflections.
        materials: address,
        /// Samples since the image came to rest (`GatherParams`); 0: none.
        rest: address,
        /// The parts of which they consist.
        rest_parts: address,
        /// `MovedRecord`s of this frame.
        moved: address,
        /// Number of `MovedRecord`s.
        moved_count: uint,
        /// Strength with which moving objects shorten histories; 0: none.
        moved_weight: float,
        /// Half width of history clamping, in standard deviations of the neighbourhood; 0: none.
        clamp_width: float,
        /// Maximum samples of a history before this frame's: few after lights have changed.
        most_past: float,
    }

    /// Parameters of `compose`.
    ComposeParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Diffuse reflection divided by the albedo, a `RadianceRecord` per pixel.
        diffuse: address,
        /// The rest.
        specular: address,
        /// A `vec4` per pixel: albedo, and roughness of reflections.
        materials: address,
        /// A `vec4` per pixel: what is seen directly, and coverage.
        direct: address,
        /// Samples since the image came to rest (`GatherParams`); 0: none.
        rest: address,
        /// The parts of which they consist.
        rest_parts: address,
        /// Output, a `vec4` per pixel: radiance, and coverage.
        composed: address,
    }

    /// Parameters of `antialias`.
    AntialiasParams: Block(access: "readonly", align: 16) {
        /// From the space of the previous frame's camera to that of this one's, three rows.
        previous_to_camera: vec4[3],
        /// Address of the `FrameParams`.
        frame: address,
        /// Radiance and coverage, a `vec4` per pixel; 0: `visibility` is the input.
        composed: address,
        /// Ambient visibility, a float per pixel.
        visibility: address,
        /// Output, two `vec4` per pixel: value, number of frames, and coverage.
        history: address,
        /// Histories of the previous frame.
        previous_history: address,
        /// Samples since the image came to rest (`GatherParams`); 0: none.
        rest: address,
        /// Their mean after non-local means, a float per pixel; 0: there is none, or not yet.
        denoised: address,
        /// Output, a `vec4` per pixel: value, and coverage.
        resolved: address,
        /// `MovedRecord`s of this frame.
        moved: address,
        /// Histories of diffuse reflection where light may have changed, `RadianceRecord`; or 0.
        changed: address,
        /// Number of `MovedRecord`s.
        moved_count: uint,
        /// 1: the camera or objects have moved, so that surfaces may have come into sight.
        uncovers: uint,
        /// 1: there is a history.
        has_history: uint,
        /// Maximum number of frames of a history in motion.
        most_frames: float,
        /// Maximum number of frames of a history in which nothing moves.
        most_still_frames: float,
        /// 1: the camera is where it was in the previous frame, and sees as much.
        camera_rests: uint,
        /// Offset of the samples from their pixels' centres, pixels; 0 where each has its own.
        samples_at: vec2,
        /// Half width of the clamp of histories in motion, in their standard deviations.
        clamp_width: float,
        /// Minimum weight of a frame at rest.
        least_weight: float,
        /// 1: the mean over frames stays as it is.
        holds: uint,
        /// Frames since the image came to rest, this one included.
        resting: float,
        /// Samples of a pixel since then, without this frame's.
        rest_before: float,
        /// With them; 0: the weight of a frame at rest does not depend on them.
        rest_after: float,
        /// Samples as which each frame in motion counts at rest.
        motion_samples: float,
        /// Power of the part of a frame's samples that were there before.
        power: float,
    }

    /// Parameters of `rest_noise`.
    RestNoiseParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Two `vec4` per pixel: samples since the image came to rest.
        rest: address,
        /// Output, two floats per pixel: mean of those samples, and variance of the mean.
        to: address,
        /// Convergence of the sampler: the variance of n frames falls as `n^-(1 + evenness)`.
        evenness: float,
        /// Padding to a multiple of 8 bytes.
        reserved: float,
    }

    /// Parameters of `rest`.
    RestParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// Estimates of this frame, 8 bytes per pixel.
        current: address,
        /// In and out, two `vec4` per pixel: samples since the image came to rest.
        rest: address,
        /// 1: it has not rested before.
        starts: uint,
        /// Padding to a multiple of 8 bytes.
        reserved: uint,
    }

    /// Parameters of `rest_samples`.
    RestSamplesParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// A float per sample of the launch: ambient visibility; negative for camera rays' misses.
        samples: address,
        /// In and out, two `vec4` per pixel: samples since the image came to rest.
        rest: address,
        /// Out, 8 bytes per pixel: the history of the pixel's surface.
        history: address,
        /// In and out: number of occlusion rays of the frame.
        ray_count: address,
    }
}
