//! Parameters of the path tracer's passes, and what it keeps of each path.

use super::queue::QueueRecord;

records! {
    "path" includes "queue";

    /// An environment in equirectangular projection.
    EnvironmentRecord: structure {
        /// A `vec4` each: linear radiance, and the weight with which directions there are sampled; 0: the environment is constant.
        texels: address,
        /// Floats: what directions are sampled with (path/map.glsl).
        table: address,
        /// Texels in x.
        width: uint,
        /// Texels in y.
        height: uint,
        /// To a multiple of 16 bytes.
        reserved0: uint,
        /// To a multiple of 16 bytes.
        reserved1: uint,
        /// Rows: world directions to the map's own, in which +y is up and -z in the middle.
        to_map: vec4[3],
    }

    /// Parameters of the path tracer.
    PathParams: block readonly 16 {
        /// The environment map.
        map: EnvironmentRecord,
        /// Radiance of the constant environment; factor of the map's.
        environment: vec3,
        /// Lights that are chosen by power.
        light_count: uint,
        /// `LightRecord`s.
        lights: address,
        /// Uints: for each instance of the scene the index in this table at which its primitives' lights begin, or `INVALID`; then those lights.
        light_of: address,
        /// `PathRecord` of each ray of the queue that is traced.
        states: address,
        /// Of the next bounce's.
        next_states: address,
        /// A `vec4` a path: radiance, and 1 where its camera ray met something.
        radiance: address,
        /// A `vec4` for each ray of the shadow queue: what it adds if nothing is in the way.
        contributions: address,
        /// A `uint` a ray of the queue that is traced: its path.
        tags: address,
        /// Rays of the next bounce.
        next: QueueRecord,
        /// Rays to lights.
        shadow: QueueRecord,
        /// Bounces.
        max_depth: uint,
        /// Bounces before Russian roulette.
        rr_depth: uint,
        /// No path vertex adds more than this in any channel; infinite: unclamped.
        clamp_to: float,
        /// Of every surface, with `WITH_CONSTANT_ALBEDO`.
        albedo: float,
        /// Index of the environment among the lights, or `INVALID`.
        environment_light: uint,
        /// Paths of fewer bounces add nothing, with `WITH_MIN_DEPTH`.
        min_depth: uint,
        /// To a multiple of 16 bytes.
        reserved: uint[3],
        /// One of `FILTER_*`.
        pixel_filter: uint,
        /// World units; 0: a pinhole.
        lens_radius: float,
        /// Distance along the view at which the image is sharp, world units.
        focus: float,
        /// One of `VIEW_*`: what camera rays see instead of light; 0: light.
        view: uint,
        /// The first of the lights that are chosen by power.
        light_first: uint,
        /// `LightNode`s over the lights before.
        light_tree: address,
        /// A `vec2` a path: width and spread of its cone (path/cone.glsl).
        cones: address,
        /// A `uint` for each light that is chosen by power, and one more: from which number on it is chosen.
        light_starts: address,
        /// The first directional light.
        first_disk: uint,
        /// How many there are.
        disk_count: uint,
        /// A `uvec4` a path: the volumes that it is in (path/media.glsl).
        media: address,
        /// A float a path: how far it has come straight through thin walls.
        straight: address,
        /// Volumes that the camera is in.
        camera_media: uvec4,
        /// Rays to lights that have come through thin walls.
        later: QueueRecord,
        /// As `contributions`.
        later_contributions: address,
        /// A float a path: density with which light samples at its last bounce find what is outside the scene in its direction.
        sky_pdfs: address,
    }

    /// A path between two bounces.
    PathRecord: words {
        /// Linear.
        throughput: vec3,
        /// Density with which the BSDF proposed its ray; negative: nothing else could have.
        pdf: float,
        /// Of its camera ray.
        index: uint,
        /// Bounces so far in the lower 16 bits; above them the surfaces that it went straight through, which are no bounces.
        depth_passes: uint,
        /// Refraction changed radiance by 1 / this.
        eta_scale: float,
        /// Material of the volume that it is in, or `INVALID`.
        medium: uint,
    }
}
