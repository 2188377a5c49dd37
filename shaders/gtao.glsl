// gtao: ambient occlusion from the depth image alone, for comparison with ray tracing: Jimenez, Wu, Pesce, Jarabo, "Practical
// Real-Time Strategies for Accurate Indirect Occlusion", SIGGRAPH 2016 courses. In each of a few slices through the view ray the
// horizons on both sides are searched, and the cosine-weighted arc between them is integrated in closed form. Geometry that is not in the
// image does not occlude.
#include "ao/sample.glsl"
#include "common/frame.glsl"
#include "common/sequence.glsl"
#include "common/warp.glsl"
#include "interface/passes.glsl"

layout(local_size_x = LANES) in;

// Distance of the first step from the pixel, in pixels.
const float MIN_STEP = 1.3;
// Sine of the minimum angle above a surface's plane at which geometry counts as an occluder.
const float MIN_RISE = 1e-3;

float arc(float cos_n, float n, float h) {
    return 0.25 * (cos_n + 2.0 * h * sin(n) - cos(2.0 * h - n));
}

// Weight of an occluder. delta: from the pixel's point, camera space.
float weight(FrameParams f, GtaoParams g, vec3 delta) {
    // the depth image shows the fronts of occluders, of which nobody knows how far they reach behind (the thin-occluder heuristic of XeGTAO)
    delta.z *= 1.0 + g.thinness;
    float d = length(delta) / g.radius_scale;
    // the binary radius gets a soft edge: depth images are too coarse for a sharp one
    float edge = f.reach < INFINITY ? clamp((f.reach - d) / (g.fade * f.reach), 0.0, 1.0) : 1.0;
    return edge * occlusion_at(f.falloff_log2, d);
}

// Distance from a point of the image to its border, in pixels.
float to_border(FrameParams f, vec2 from, vec2 direction) {
    vec2 room = mix(from, vec2(f.size) - from, greaterThan(direction, vec2(0.0))) / max(abs(direction), vec2(1e-6));
    return min(room.x, room.y);
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    GtaoParams g = GtaoParams(push.pass);
    FrameParams f = FrameParams(g.frame);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(guide)) return;
    bool orthographic = f.orthographic != 0u;
    uvec2 pixel = image_pixel(f, at);
    float depth = uintBitsToFloat(guide.x);
    vec2 centre = sample_place(f, vec2(pixel));
    vec2 plane = image_plane(f, f.view, centre);
    vec3 p = unproject(orthographic, plane, depth);
    vec3 v = orthographic ? vec3(0.0, 0.0, 1.0) : normalize(-p);
    vec3 normal = linear(f.world_to_camera, uintBitsToFloat(Quads(f.normals).v[at].xyz));
    // perpendicular to the view ray
    vec3 right = normalize(vec3(v.z, 0.0, -v.x)), up = cross(v, right);
    float radius = g.radius_scale * f.reach / footprint(f, f.view, orthographic, depth);
    vec2 u = sequence_2d(f.sequence, f.seed, pixel, f.frame, 0u, 1u);
    float visibility = 0.0, open = 0.0;
    for (uint slice = 0u; slice < g.slices; slice++) {
        float phi = PI * (float(slice) + u.x) / float(g.slices);
        // slices are uniform about the view ray; away from the image centre that differs from uniform in the image
        vec3 tangent = cos(phi) * right + sin(phi) * up;
        // image rows go down, the camera's y axis goes up
        vec2 along = vec2(1.0, -1.0) * normalize(orthographic ? tangent.xy : tangent.xy + plane * tangent.z);
        vec3 axis = cross(tangent, v);
        vec3 projected = normal - axis * dot(normal, axis);
        float size = length(projected);
        if (size < 1e-5) continue;
        float cos_n = clamp(dot(projected, v) / size, 0.0, 1.0);
        float n = (dot(tangent, projected) < 0.0 ? -1.0 : 1.0) * acos(cos_n);
        float arcs = 0.0;
        for (int side = 0; side < 2; side++) {
            float sgn = side == 0 ? -1.0 : 1.0;
            // the tangent plane is the lowest horizon
            float low = cos(clamp(n + sgn * 0.5 * PI, -PI, PI));
            float horizon = low;
            // geometry beyond the border is unknown: all steps are within the image
            float search = min(radius, to_border(f, centre, sgn * along));
            for (uint k = 0u; k < g.steps; k++) {
                float s = (float(k) + u.y) / float(g.steps);
                vec2 q = centre + sgn * along * max(pow(s, g.step_exponent) * search, MIN_STEP + float(k));
                if (any(lessThan(q, vec2(0.0))) || any(greaterThanEqual(q, vec2(f.size)))) break;
                uvec2 tap = uvec2(q);
                float there = uintBitsToFloat(Pairs(f.guide).v[image_index(f, tap)].x);
                if (!(there < INFINITY)) continue;
                vec3 delta = unproject(orthographic, image_plane(f, f.view, sample_place(f, vec2(tap))), there) - p;
                float d = length(delta);
                // what lies in the surface's own plane is no horizon: a pixel's middle is beside the slice, where a slanting plane is higher
                if (dot(delta, normal) <= MIN_RISE * d) continue;
                horizon = max(horizon, mix(low, dot(delta, v) / d, weight(f, g, delta)));
            }
            float h = sgn * acos(clamp(horizon, -1.0, 1.0));
            // not below the surface
            h = n + clamp(h - n, -0.5 * PI, 0.5 * PI);
            arcs += arc(cos_n, n, h);
        }
        visibility += size * arcs;
        open += size * (cos_n + n * sin(n));
    }
    // of what these slices would be without anything in them, which a few are not evenly
    visibility = open > 0.0 ? pow(clamp(visibility / open, 0.0, 1.0), g.visibility_exponent) : 1.0;
    STORE_PAIR(g.current, at, pack_estimate(Estimate(visibility, 1.0, 0.0)));
}
