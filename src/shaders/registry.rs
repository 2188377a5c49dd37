// All shaders: a pass is a line here and a file in shaders/. build.rs includes this file and compiles the shaders that it lists; src/shaders/mod.rs includes
// it and defines a constant for each.
//
// streams: passes that trace rays. CONSTANT = file, any or closest hit, and the source of rays:
//     generated   the pass generates them
//     camera      the pass generates coherent rays: neighbours are traced as packets, and primary visibility can be rasterized instead
//     camera_or_known  as camera; or another pass has traced the same rays, and the hits are in memory
//     queue       they are in memory before the pass begins
// compute: passes that trace no rays; those of debug views are in src/interface/debug_views.rs.
// stages: shaders that streams of the pipeline tracer share, and shaders of rasterization.
registry! {
    streams {
        AO_TRACE_ANY = "ao_trace", any, generated;
        AO_TRACE_CLOSEST = "ao_trace", closest, generated;
        AOV_CLOSEST = "aov", closest, camera;
        GBUFFER_CLOSEST = "gbuffer", closest, camera;
        LARSEN_LIGHT_ANY = "larsen_light", any, generated;
        LARSEN_OCCLUSION_CLOSEST = "larsen_occlusion", closest, generated;
        OCCLUSION_ANY = "occlusion", any, queue;
        OCCLUSION_CLOSEST = "occlusion", closest, queue;
        PATH_BOUNCE_CLOSEST = "path_bounce", closest, queue;
        PATH_CAMERA_CLOSEST = "path_camera", closest, camera_or_known;
        PATH_DISTANCE_CLOSEST = "path_distance", closest, queue;
        PATH_REFLECTION_CLOSEST = "path_reflection", closest, queue;
        PATH_SHADOW_ANY = "path_shadow", any, queue;
        PATH_SHADOW_WALLS_CLOSEST = "path_shadow_walls", closest, queue;
        PATH_SURFACE_CLOSEST = "path_surface", closest, camera;
        PRIMARY_CLOSEST = "primary", closest, camera;
        RAYS_ANY = "rays", any, generated;
        RAYS_CLOSEST = "rays", closest, generated;
    }
    compute {
        ANTIALIAS = "antialias";
        BUDGET = "budget";
        COMPOSE = "compose";
        DENOISE = "denoise";
        DISPLAY = "display";
        ENTRY_POINTS = "entry_points";
        FILTER = "filter";
        GATHER = "gather";
        GTAO = "gtao";
        LARSEN_BLUR = "larsen_blur";
        LARSEN_SUM = "larsen_sum";
        LARSEN_TEMPORAL = "larsen_temporal";
        NLMEANS = "nlmeans";
        NLMEANS_RADIANCE = "nlmeans_radiance";
        PATH_GATHER = "path_gather";
        PATH_RESOLVE = "path_resolve";
        RADIANCE_TEMPORAL = "radiance_temporal";
        RESAMPLE = "resample";
        RESOLVE = "resolve";
        REST = "rest";
        REST_SAMPLES = "rest_samples";
        REST_NOISE = "rest_noise";
        SEEN = "seen";
        TEMPORAL = "temporal";
    }
    stages {
        MISS = "trace/miss.rmiss", Miss;
        TRIANGLE_CLOSEST = "trace/triangle.rchit", ClosestHit;
        TRIANGLE_ANY = "trace/triangle.rahit", AnyHit;
        SPHERE_CLOSEST = "trace/sphere.rchit", ClosestHit;
        SPHERE_INTERSECTION = "trace/sphere.rint", Intersection;
        DRAW_TRIANGLES = "raster/triangle.vert", Vertex;
        DRAW_OPAQUE = "raster/opaque.frag", Fragment;
        DRAW_ALPHA = "raster/alpha.frag", Fragment;
        DRAW_SPHERES = "raster/sphere.vert", Vertex;
        DRAW_SPHERE = "raster/sphere.frag", Fragment;
    }
}
