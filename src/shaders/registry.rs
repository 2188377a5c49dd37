//! All shaders. A pass is a static here, its name in the list below, and a file in shaders/.
//! build.rs includes this file and compiles what the lists name.

use super::source::Mode::{self, Any, Closest};
use super::source::Rays::{Camera, CameraOrKnown, CameraOrRasterized, Generated, Queue};
use super::source::{ComputeShader, Shader, Source, Stage, StreamShaders, Traversal};

/// Occlusion rays of a frame, for ambient occlusion without a falloff.
pub static AO_TRACE_ANY: StreamShaders = StreamShaders::new("ao_trace", Any, Generated);
/// Occlusion rays of a frame, for ambient occlusion with a falloff.
pub static AO_TRACE_CLOSEST: StreamShaders = StreamShaders::new("ao_trace", Closest, Generated);
/// Camera rays of auxiliary outputs.
pub static AOV_CLOSEST: StreamShaders = StreamShaders::new("aov", Closest, CameraOrRasterized);
/// Occlusion rays from the points of texels, for ambient occlusion without a falloff.
pub static BAKE_ANY: StreamShaders = StreamShaders::new("bake", Any, Generated);
/// Occlusion rays from the points of texels, with a falloff, and rays of thickness.
pub static BAKE_CLOSEST: StreamShaders = StreamShaders::new("bake", Closest, Generated);
/// Camera rays of a frame's G-buffer.
pub static GBUFFER_CLOSEST: StreamShaders = StreamShaders::new("gbuffer", Closest, CameraOrRasterized);
/// Shadow rays of Larsen (2019).
pub static LARSEN_LIGHT_ANY: StreamShaders = StreamShaders::new("larsen_light", Any, Generated);
/// Occlusion rays of Larsen (2019).
pub static LARSEN_OCCLUSION_CLOSEST: StreamShaders = StreamShaders::new("larsen_occlusion", Closest, Generated);
/// Occlusion rays of a still, for ambient occlusion without a falloff.
pub static OCCLUSION_ANY: StreamShaders = StreamShaders::new("occlusion", Any, Queue);
/// Occlusion rays of a still, for ambient occlusion with a falloff.
pub static OCCLUSION_CLOSEST: StreamShaders = StreamShaders::new("occlusion", Closest, Queue);
/// Rays from one path vertex to the next.
pub static PATH_BOUNCE_CLOSEST: StreamShaders =
    StreamShaders::new("path_bounce", Closest, Queue).sharing("path_vertex", CameraOrKnown);
/// Camera rays of paths.
pub static PATH_CAMERA_CLOSEST: StreamShaders =
    StreamShaders::new("path_camera", Closest, CameraOrKnown).sharing("path_vertex", CameraOrKnown);
/// Distances along rays of ambient light.
pub static PATH_DISTANCE_CLOSEST: StreamShaders = StreamShaders::new("path_distance", Closest, Queue);
/// Rays of the G-buffer behind mirrors and glass.
pub static PATH_REFLECTION_CLOSEST: StreamShaders =
    StreamShaders::new("path_reflection", Closest, Queue).sharing("path_guide", Camera);
/// Shadow rays of paths.
pub static PATH_SHADOW_ANY: StreamShaders = StreamShaders::new("path_shadow", Any, Queue);
/// Shadow rays of paths that pass through thin walls.
pub static PATH_SHADOW_WALLS_CLOSEST: StreamShaders = StreamShaders::new("path_shadow_walls", Closest, Queue);
/// Camera rays of the G-buffer of frames of light.
pub static PATH_SURFACE_CLOSEST: StreamShaders =
    StreamShaders::new("path_surface", Closest, Camera).sharing("path_guide", Camera);
/// Camera rays of ambient occlusion.
pub static PRIMARY_CLOSEST: StreamShaders = StreamShaders::new("primary", Closest, Camera);
/// Given rays: whether each is occluded.
pub static RAYS_ANY: StreamShaders = StreamShaders::new("rays", Any, Generated);
/// Given rays: the closest hit of each.
pub static RAYS_CLOSEST: StreamShaders = StreamShaders::new("rays", Closest, Generated);

/// The passes that trace rays.
pub const STREAMS: &[&StreamShaders] = &[
    &AO_TRACE_ANY,
    &AO_TRACE_CLOSEST,
    &AOV_CLOSEST,
    &BAKE_ANY,
    &BAKE_CLOSEST,
    &GBUFFER_CLOSEST,
    &LARSEN_LIGHT_ANY,
    &LARSEN_OCCLUSION_CLOSEST,
    &OCCLUSION_ANY,
    &OCCLUSION_CLOSEST,
    &PATH_BOUNCE_CLOSEST,
    &PATH_CAMERA_CLOSEST,
    &PATH_DISTANCE_CLOSEST,
    &PATH_REFLECTION_CLOSEST,
    &PATH_SHADOW_ANY,
    &PATH_SHADOW_WALLS_CLOSEST,
    &PATH_SURFACE_CLOSEST,
    &PRIMARY_CLOSEST,
    &RAYS_ANY,
    &RAYS_CLOSEST,
];

/// The mean over frames whose samples lie at different places within the pixels.
pub static ANTIALIAS: ComputeShader = ComputeShader::new("antialias");
/// The samples of a launch, added to the sums of the points of texels.
pub static BAKE_SUM: ComputeShader = ComputeShader::new("bake_sum");
/// Bounds of the centres of leaves, for the builder on the device.
pub static BVH_BOUNDS: ComputeShader = ComputeShader::new("bvh_bounds");
/// The wide nodes of a level, made of a binary tree.
pub static BVH_EMIT: ComputeShader = ComputeShader::new("bvh_emit");
/// Clusters that are each other's nearest, joined to nodes of a binary tree.
pub static BVH_MERGE: ComputeShader = ComputeShader::new("bvh_merge");
/// Morton codes of leaves.
pub static BVH_MORTON: ComputeShader = ComputeShader::new("bvh_morton");
/// The nearest cluster of each cluster.
pub static BVH_NEAREST: ComputeShader = ComputeShader::new("bvh_nearest");
/// Numbers of keys by digit, for sorting.
pub static BVH_SORT_COUNT: ComputeShader = ComputeShader::new("bvh_sort_count");
/// Keys in the order of a digit.
pub static BVH_SORT_SCATTER: ComputeShader = ComputeShader::new("bvh_sort_scatter");
/// Radiance of each pixel, of its filtered parts.
pub static COMPOSE: ComputeShader = ComputeShader::new("compose");
/// The spatial filter of radiance.
pub static DENOISE: ComputeShader = ComputeShader::new("denoise");
/// A buffer of the frame as 8-bit sRGB.
pub static DISPLAY: ComputeShader = ComputeShader::new("display");
/// Blocks of the BVH at which camera rays start.
pub static ENTRY_POINTS: ComputeShader = ComputeShader::new("entry_points");
/// The spatial filter of ambient visibility.
pub static FILTER: ComputeShader = ComputeShader::new("filter");
/// Mean and variance of a pixel's samples of ambient visibility.
pub static GATHER: ComputeShader = ComputeShader::new("gather");
/// Ambient occlusion from the depth image alone.
pub static GTAO: ComputeShader = ComputeShader::new("gtao");
/// The box filter of Larsen (2019).
pub static LARSEN_BLUR: ComputeShader = ComputeShader::new("larsen_blur");
/// The mean of a pixel's rays of Larsen (2019).
pub static LARSEN_SUM: ComputeShader = ComputeShader::new("larsen_sum");
/// The mean of two frames of Larsen (2019).
pub static LARSEN_TEMPORAL: ComputeShader = ComputeShader::new("larsen_temporal");
/// Non-local means of ambient visibility.
pub static NLMEANS: ComputeShader = ComputeShader::new("nlmeans");
/// Non-local means of radiance.
pub static NLMEANS_RADIANCE: ComputeShader = ComputeShader::new("nlmeans_radiance");
/// The debug view of BVH nodes that camera rays visit.
pub static NODES: ComputeShader = ComputeShader::new("nodes");
/// Means and variances of the paths of each pixel of a frame.
pub static PATH_GATHER: ComputeShader = ComputeShader::new("path_gather");
/// The paths of a launch, added to the film.
pub static PATH_RESOLVE: ComputeShader = ComputeShader::new("path_resolve");
/// The histories of radiance, reprojected.
pub static RADIANCE_TEMPORAL: ComputeShader = ComputeShader::new("radiance_temporal");
/// The debug view of pixels without a history.
pub static REJECTED: ComputeShader = ComputeShader::new("rejected");
/// An image of records in another size.
pub static RESAMPLE: ComputeShader = ComputeShader::new("resample");
/// The occlusion samples of a launch, added to the film.
pub static RESOLVE: ComputeShader = ComputeShader::new("resolve");
/// A frame's samples, added to those since the image came to rest.
pub static REST: ComputeShader = ComputeShader::new("rest");
/// The mean of the samples at rest, and its variance.
pub static REST_NOISE: ComputeShader = ComputeShader::new("rest_noise");
/// A long frame's samples, added to those since the image came to rest.
pub static REST_SAMPLES: ComputeShader = ComputeShader::new("rest_samples");
/// Surfaces of another image that this one has seen.
pub static SEEN: ComputeShader = ComputeShader::new("seen");
/// The history of ambient visibility, reprojected.
pub static TEMPORAL: ComputeShader = ComputeShader::new("temporal");

/// The passes that trace no rays.
pub const COMPUTE: &[&ComputeShader] = &[
    &ANTIALIAS,
    &BAKE_SUM,
    &BVH_BOUNDS,
    &BVH_EMIT,
    &BVH_MERGE,
    &BVH_MORTON,
    &BVH_NEAREST,
    &BVH_SORT_COUNT,
    &BVH_SORT_SCATTER,
    &COMPOSE,
    &DENOISE,
    &DISPLAY,
    &ENTRY_POINTS,
    &FILTER,
    &GATHER,
    &GTAO,
    &LARSEN_BLUR,
    &LARSEN_SUM,
    &LARSEN_TEMPORAL,
    &NLMEANS,
    &NLMEANS_RADIANCE,
    &NODES,
    &PATH_GATHER,
    &PATH_RESOLVE,
    &RADIANCE_TEMPORAL,
    &REJECTED,
    &RESAMPLE,
    &RESOLVE,
    &REST,
    &REST_NOISE,
    &REST_SAMPLES,
    &SEEN,
    &TEMPORAL,
];

/// The miss shader of the pipeline tracer.
pub static MISS: Shader = Shader::from_file("trace/miss.rmiss", Stage::Miss);
/// The closest-hit shader of triangles.
pub static TRIANGLE_CLOSEST: Shader = Shader::from_file("trace/triangle.rchit", Stage::ClosestHit);
/// The any-hit shader of alpha-tested triangles.
pub static TRIANGLE_ANY: Shader = Shader::from_file("trace/triangle.rahit", Stage::AnyHit);
/// The closest-hit shader of spheres.
pub static SPHERE_CLOSEST: Shader = Shader::from_file("trace/sphere.rchit", Stage::ClosestHit);
/// The intersection shader of spheres.
pub static SPHERE_INTERSECTION: Shader = Shader::from_file("trace/sphere.rint", Stage::Intersection);
/// The vertex shader of rasterized triangles.
pub static DRAW_TRIANGLES: Shader = Shader::from_file("raster/triangle.vert", Stage::Vertex);
/// The fragment shader of opaque triangles.
pub static DRAW_OPAQUE: Shader = Shader::from_file("raster/opaque.frag", Stage::Fragment);
/// The fragment shader of alpha-tested triangles.
pub static DRAW_ALPHA: Shader = Shader::from_file("raster/alpha.frag", Stage::Fragment);
/// The vertex shader of rasterized spheres.
pub static DRAW_SPHERES: Shader = Shader::from_file("raster/sphere.vert", Stage::Vertex);
/// The fragment shader of rasterized spheres.
pub static DRAW_SPHERE: Shader = Shader::from_file("raster/sphere.frag", Stage::Fragment);

/// The shaders that streams of the pipeline tracer share, and those of rasterization.
pub const STAGES: &[&Shader] = &[
    &MISS,
    &TRIANGLE_CLOSEST,
    &TRIANGLE_ANY,
    &SPHERE_CLOSEST,
    &SPHERE_INTERSECTION,
    &DRAW_TRIANGLES,
    &DRAW_OPAQUE,
    &DRAW_ALPHA,
    &DRAW_SPHERES,
    &DRAW_SPHERE,
];

/// A kernel of the compute tracer, which all streams of a mode share. `ballot`: for devices with
/// 64-bit integers and subgroup ballots, of which only the wide kernel makes use.
pub const fn kernel(traversal: Traversal, mode: Mode, ballot: bool) -> Shader {
    let ballot = ballot && matches!(traversal, Traversal::Wide);
    Shader::new(Source::Kernel { traversal, mode, ballot })
}

/// The kernels of the compute tracer, and whether each is for devices with ballots.
const KERNELS: [(Traversal, bool); 4] =
    [(Traversal::Wide, false), (Traversal::Wide, true), (Traversal::Binary, false), (Traversal::Brute, false)];

/// Whole paths in one kernel, which traces their rays itself.
pub const PATH_MEGAKERNEL: Shader = Shader::new(Source::Tracing { pass: "path_megakernel" });

/// Lists all shaders of the program, each once.
pub fn list_shaders() -> Vec<Shader> {
    let streams = STREAMS.iter().flat_map(|s| s.variants());
    let compute = COMPUTE.iter().flat_map(|c| c.variants());
    let kernels = [Any, Closest].into_iter().flat_map(|mode| KERNELS.map(|(of, ballot)| kernel(of, mode, ballot)));
    let stages = STAGES.iter().map(|s| **s);
    let mut out: Vec<Shader> = Vec::new();
    for shader in streams.chain(compute).chain(stages).chain(kernels).chain([PATH_MEGAKERNEL]) {
        // some streams share theirs
        if !out.contains(&shader) {
            out.push(shader);
        }
    }
    out
}
