// The pipeline tracer's ray generation shader: VK_KHR_ray_tracing_pipeline, one invocation per ray.
#ifndef TRACE_PIPELINE
#define TRACE_PIPELINE
#include "scene/scene.glsl"
#include "trace/payload.glsl"

layout(location = 0) rayPayloadEXT Payload payload;

void main() {
    // the ray order of work-groups (trace/spread.glsl), but in one row: with several rows, GPUs combine invocations of small tiles, whose rays would be far apart
    const uint RUN_RAYS = LANES * RUN;
    uint run = gl_LaunchIDEXT.x / RUN_RAYS, rows = gl_LaunchSizeEXT.x / (RUN_RAYS * SPREAD);
    uint k = (run % rows * SPREAD + run / rows) * RUN_RAYS + gl_LaunchIDEXT.x % RUN_RAYS;
    if (k >= ray_count()) return;
    uint index = push.first + k;
    Ray world = ray(index);
    bool traces = is_ray(world) && is_finite(world);
    // what the miss shader stores
    payload.t = traces ? 0.0 : INFINITY;
    payload.instance = INVALID;
    payload.primitive = INVALID;
    payload.u = 0.0;
    payload.v = 0.0;
#ifdef STREAM_ANY
    // only the miss shader reports that nothing is in the way
    const uint flags = gl_RayFlagsTerminateOnFirstHitEXT | gl_RayFlagsSkipClosestHitShaderEXT;
#else
    const uint flags = gl_RayFlagsNoneEXT;
#endif
    if (traces) {
        traceRayEXT(accelerationStructureEXT(SceneRoot(push.scene).top_level), flags, 0xffu, 0, 1, 0, world.origin, world.tmin,
            world.direction, world.tmax, 0);
    }
    // one call for hits and misses: the stream's code, which may be all of a path's, is compiled once for each call
#ifdef STREAM_ANY
    any(index, payload.t < INFINITY);
#else
    Hit hit = miss();
    if (payload.t < INFINITY) hit = scene_hit(payload.t, payload.instance, payload.primitive, vec2(payload.u, payload.v));
    closest(index, hit);
#endif
}

#endif
