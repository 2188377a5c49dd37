// First step of a launch of the fast kernel: generates the stream's rays, with all lanes busy.
#ifndef TRACE_GENERATE
#define TRACE_GENERATE
#include "trace/launch.glsl"
#include "trace/slab.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = gl_GlobalInvocationID.x;
    if (k >= ray_count()) return;
    SceneRoot root = SceneRoot(push.scene);
    Ray r = ray(push.first + k);
    // a ray that misses the scene's bounds is answered here, where all lanes are busy
    vec3 inverse = safe_inverse(r.direction);
    vec3 t0 = (root.bounds_min.xyz - r.origin) * inverse, t1 = (root.bounds_max.xyz - r.origin) * inverse;
    vec3 n = MIN(t0, t1), f = MAX(t0, t1);
    float near = MAX(MAX(n.x, n.y), MAX(n.z, r.tmin));
    float far = MIN(MIN(MIN(f.x, f.y), f.z) * SLAB_SCALE, r.tmax);
    r.tmax = near <= far ? r.tmax : -1.0;
    store_ray(push.rays, k, r);
    mark_unfinished(root, k);
}

#endif
