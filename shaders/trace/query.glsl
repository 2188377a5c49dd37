// The query tracer: VK_KHR_ray_query in a compute shader, one thread per ray.
#ifndef TRACE_QUERY
#define TRACE_QUERY
#include "scene/material.glsl"
#include "scene/sphere.glsl"
#include "trace/spread.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint k = ray_of_dispatch();
    if (k >= ray_count()) return;
    uint index = push.first + k;
    Ray world = ray(index);
    bool met = false;
#ifndef STREAM_ANY
    Hit hit = miss();
#endif
    if (is_ray(world) && is_finite(world)) {
        SceneRoot root = SceneRoot(push.scene);
        InstanceRecords instances = InstanceRecords(root.instances);
        rayQueryEXT query;
#ifdef STREAM_ANY
        const uint flags = gl_RayFlagsTerminateOnFirstHitEXT;
#else
        const uint flags = gl_RayFlagsNoneEXT;
#endif
        rayQueryInitializeEXT(query, accelerationStructureEXT(root.top_level), flags, 0xffu, world.origin, world.tmin, world.direction, world.tmax);
        while (rayQueryProceedEXT(query)) {
            uint type = rayQueryGetIntersectionTypeEXT(query, false);
            uint instance = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, false));
            uint primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, false));
            if (type == gl_RayQueryCandidateIntersectionTriangleEXT) {
                // only alpha-tested triangles are not opaque, and they are the second geometry
                vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, false);
                if (HAS_ALPHA && alpha_passes(instance, instances.v[instance].opaque_count + primitive, uv, world.tmin))
                    rayQueryConfirmIntersectionEXT(query);
            } else if (HAS_SPHERES) {
                SubmeshRecords submeshes = SubmeshRecords(root.submeshes);
                vec4 sphere = uintBitsToFloat(Quads(submeshes.v[instances.v[instance].first_submesh].positions).v[primitive]);
                float far = rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT
                    ? world.tmax : rayQueryGetIntersectionTEXT(query, true);
                float t = intersect_sphere(rayQueryGetIntersectionObjectRayOriginEXT(query, false),
                    rayQueryGetIntersectionObjectRayDirectionEXT(query, false), world.tmin, far, sphere.xyz, sphere.w);
                if (t > world.tmin && t < far) rayQueryGenerateIntersectionEXT(query, t);
            }
        }
        uint type = rayQueryGetIntersectionTypeEXT(query, true);
        met = type != gl_RayQueryCommittedIntersectionNoneEXT;
#ifndef STREAM_ANY
        if (met) {
            uint instance = uint(rayQueryGetIntersectionInstanceCustomIndexEXT(query, true));
            uint primitive = uint(rayQueryGetIntersectionPrimitiveIndexEXT(query, true));
            bool sphere = type == gl_RayQueryCommittedIntersectionGeneratedEXT;
            if (rayQueryGetIntersectionGeometryIndexEXT(query, true) != 0) primitive += instances.v[instance].opaque_count;
            vec2 uv = sphere ? vec2(0.0) : rayQueryGetIntersectionBarycentricsEXT(query, true);
            hit = scene_hit(rayQueryGetIntersectionTEXT(query, true), instance, primitive, uv);
        }
#endif
    }
    // one call for hits and misses: the stream's code, which may be all of a path's, is compiled once for each call
#ifdef STREAM_ANY
    any(index, met);
#else
    closest(index, hit);
#endif
}

#endif
