//! Parameters of the path tracer's passes, and the state of each path.

use super::super::path_options::PathOptionsRecord;
use super::ao::OcclusionRecord;
use super::lights::LightRecord;
use super::queue::QueueRecord;

records! {
    "path" includes "queue" "ao" "path_options" "lights" values {
        /// Phase of a path that has met mirrors and glass alone, and followed the G-buffer's rays.
        SIGNAL_SEEN: float = 0.0;
        /// Phase of a path: as before, but it went another way.
        SIGNAL_ASIDE: float = 1.0;
        /// Phase of a path: it has met a surface that scatters light.
        SIGNAL_SCATTERED: float = 2.0;
        /// Phase of a path: its camera ray has met a ground that catches shadows, and it has ended.
        SIGNAL_CAUGHT: float = 3.0;
        /// No distance.
        SIGNAL_UNKNOWN: float = -1.0;
        /// No distance yet.
        SIGNAL_PENDING: float = -2.0;
        /// Width of a blurred environment map, texels.
        BLURRED_WIDTH: uint = 192;
        /// Intervals of an environment's sampling table for each cell of its guide, on average.
        GUIDED_INTERVALS: uint = 4;
        /// Height of a blurred environment map, texels.
        BLURRED_HEIGHT: uint = 96;
    };

    /// An environment map in equirectangular projection.
    EnvironmentRecord: Structure {
        /// A `vec4` per texel: linear radiance, and the sampling weight; 0: a constant environment.
        texels: address,
        /// Floats: the sampling table (path/map.glsl).
        table: address,
        /// Uints: where a search in the table begins and ends (`GUIDED_INTERVALS`).
        guide: address,
        /// Padding to a multiple of 16 bytes.
        reserved: uvec2,
        /// Width in texels.
        width: uint,
        /// Height in texels.
        height: uint,
        /// A `vec4` per texel of `BLURRED_WIDTH` x `BLURRED_HEIGHT`: the map blurred, with
        /// `WITH_BLURRED_BACKGROUND`.
        blurred: address,
        /// World to map, three rows; in the map's space +y is up and -z is at its centre.
        to_map: vec4[3],
    }

    /// Parameters of the path tracer. They lie behind the `BlockParams` of its passes.
    PathParams: Block(access: "readonly", align: 16) {
        /// The environment map.
        map: EnvironmentRecord,
        /// The light that is sampled, where there is but one.
        only_light: LightRecord,
        /// Radiance of a constant environment; scale factor of an environment map. Linear RGB.
        environment: vec3,
        /// Number of distant lights: the environment, its portals, directional lights.
        distant_lights: uint,
        /// The `LightRecord`s: placed lights, then distant ones.
        lights: address,
        /// Uints: for each instance the index in this table at which its primitives begin, or
        /// `INVALID`; then the light of each primitive, or `INVALID`.
        light_of: address,
        /// `PathRecord` of each ray of the queue that is traced.
        states: address,
        /// `PathRecord` of each ray of the next bounce.
        next_states: address,
        /// A `vec4` per path: radiance, and 1 if its camera ray hit the scene.
        radiance: address,
        /// A `vec4` per shadow ray: the radiance that it adds if it is unoccluded.
        contributions: address,
        /// A `uint` per ray of the queue that is traced: index of its path.
        tags: address,
        /// The queue of the next bounce.
        next: QueueRecord,
        /// The queue of shadow rays.
        shadow: QueueRecord,
        /// Maximum number of bounces.
        max_depth: uint,
        /// Albedo of all surfaces, with `WITH_CONSTANT_ALBEDO`.
        albedo: float,
        /// Index of the environment among the lights, or `INVALID`.
        environment_light: uint,
        /// Radius of the thin lens, scene units; 0: a pinhole.
        lens_radius: float,
        /// Focus distance along the view, scene units.
        focus: float,
        /// One of `VIEW_*`: the surface property rendered in place of radiance; 0: radiance.
        view: uint,
        /// `LightNode`s of the tree over placed lights.
        light_tree: address,
        /// A `vec2` per path: width and spread of its ray cone (path/cone.glsl).
        cones: address,
        /// Cumulative distributions of placed lights (`placed_lights + 1` uints) and distant ones.
        light_starts: address,
        /// Index of the first directional light.
        first_disk: uint,
        /// Number of directional lights.
        disk_count: uint,
        /// A `uvec4` per path: stack of the volumes that it is in (path/media.glsl).
        media: address,
        /// A float per path: distance since its last bounce, through thin clear walls, scene units.
        straight: address,
        /// Stack of the volumes that the camera is in.
        camera_media: uvec4,
        /// Ambient radiance, linear RGB, with `WITH_AMBIENT`.
        ambient_color: vec3,
        /// 1: ambient occlusion darkens all light of a first surface, with `WITH_OCCLUDED_LIGHT`.
        occludes_all: uint,
        /// The queue of shadow rays that continue behind a thin wall.
        later: QueueRecord,
        /// `contributions` of the queue `later`.
        later_contributions: address,
        /// A float per path: light sampling density of its direction to the environment.
        sky_pdfs: address,
        /// The queue of rays of ambient light, with `WITH_AMBIENT`.
        ambient: QueueRecord,
        /// A `vec4` per ray of ambient light: the radiance that it adds if it is unoccluded.
        ambient_contributions: address,
        /// A `SignalRecord` per path, with `WITH_SIGNAL`.
        signals: address,
        /// With `WITH_SIGNAL` a `vec4` per shadow ray: its diffuse part over the albedo, or 0.
        diffuse_contributions: address,
        /// `diffuse_contributions` of the queue `later`.
        later_diffuse_contributions: address,
        /// `diffuse_contributions` of the queue `ambient`.
        ambient_diffuse_contributions: address,
        /// The queue of shadow rays to distant lights, with `WITH_LIGHT_SPLIT`.
        distant_shadow: QueueRecord,
        /// `contributions` of the queue `distant_shadow`.
        distant_contributions: address,
        /// `diffuse_contributions` of the queue `distant_shadow`.
        distant_diffuse_contributions: address,
        /// A float per path, with `WITH_LIGHT_GROUPS`: placed lights' share in its last samples.
        placed_shares: address,
        /// The options that are numbers.
        options: PathOptionsRecord,
        /// Three uints that `path_megakernel` adds to: numbers of bounce rays and of shadow rays,
        /// and bounces of the longest path.
        counts: address,
        /// Maximum number of rays of a path in `path_megakernel`, without the camera ray.
        max_rays: uint,
        /// Number of placed lights, which is the index of the first distant one.
        placed_lights: uint,
        /// Irradiance of distant lights, by which points choose between the groups.
        distant_irradiance: float,
        /// Probability with which the environment is chosen among distant lights.
        environment_probability: float,
        /// Which hits keep ambient light from a surface, with `WITH_AMBIENT`.
        occlusion: OcclusionRecord,
        /// Number of leaves of a scene that has few, for `path_megakernel`.
        few_count: uint,
        /// Address of those leaves, then of their boxes of eight floats (shaders/trace/few.glsl).
        few: address,
        /// The material of a ground that catches shadows, with `WITH_CATCHER`.
        catcher: uint,
        /// A bit for each of those leaves: it is flat.
        few_flat: uint,
    }

    /// Parameters of the paths of a frame in real time, with `WITH_SIGNAL`. They lie behind the
    /// `PathParams`.
    PathFrameParams: Block(access: "readonly", align: 8) {
        /// Address of the `FrameParams`.
        frame: address,
        /// A `KnownHit` per pixel of the image (`path_surface`), or 0: paths trace their camera
        /// rays themselves.
        known_hits: address,
        /// A `BakePoint` per pixel, where paths begin at points of surfaces
        /// (`WITH_SURFACE_POINTS`).
        points: address,
        /// Listed ones among the pixels that are sampled in the frame (`SurfacesParams.list`).
        listed: address,
        /// Number of pixels that are sampled in the frame. Rays of pixels beyond are of listed
        /// ones, `1 << listed_bits` after another of each.
        cells: uint,
        /// Log2 of the number of pixels beyond `cells` that are of a listed one.
        listed_bits: uint,
    }

    /// The signal of a path of a frame, beside its radiance, without directly visible emission. Its
    /// vertex is the first whose surface scatters light, seen directly or by mirrors and glass.
    SignalRecord: Words {
        /// Emission and background seen directly, linear RGB.
        direct: vec3,
        /// 1 if the camera ray hit the scene.
        covered: float,
        /// Part of the radiance that this vertex reflects diffusely, divided by its diffuse albedo.
        diffuse: vec3,
        /// Distance from the vertex to the next one, scene units, infinite if there is none;
        /// `SIGNAL_UNKNOWN` if that direction tells nothing about reflections.
        reflected_distance: float,
        /// Diffuse albedo of the vertex; 0 where the diffuse part is not kept apart.
        albedo: vec3,
        /// One of `SIGNAL_*`: how far the path is.
        phase: float,
        /// Share of the diffuse part, divided by the albedo, in what the sampled direction brings.
        share: vec3,
        /// Padding to a multiple of 16 bytes.
        reserved: float,
    }

    /// The state of a path between two bounces.
    PathRecord: Words {
        /// Throughput, linear RGB.
        throughput: vec3,
        /// Density of BSDF sampling for the direction; negative: no other technique samples it.
        pdf: float,
        /// Index of its camera ray.
        index: uint,
        /// Number of bounces in the lower 15 bits, above it whether the path has one wavelength,
        /// and in the upper 16 the number of surfaces passed straight.
        depth_passes: uint,
        /// Product of the squared relative indices of refraction; Russian roulette divides it out.
        eta_scale: float,
        /// Material of the volume that the path is in, or `INVALID`.
        medium: uint,
    }
}
