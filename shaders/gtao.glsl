// gtao: ambient occlusion from the depth image alone, for comparison with what is traced: Jimenez, Wu, Pesce, Jarabo, "Practical
// Real-Time Strategies for Accurate Indirect Occlusion", SIGGRAPH 2016 courses. In each of a few slices through the view ray the
// horizons on both sides are searched, and the cosine-weighted arc between them is integrated in closed form. What the image does not
// show does not occlude.
// compute
#include "common/frame.glsl"
#include "common/sequence.glsl"

layout(local_size_x = LANES) in;

const float PI = 3.14159265359;
// The first step leaves the pixel itself, pixels.
const float LEAST_STEP = 1.3;
// Radius of the search at most, in heights of the image.
const float MOST_SEARCH = 0.5;

float arc(float cos_n, float n, float h) {
    return 0.25 * (cos_n + 2.0 * h * sin(n) - cos(2.0 * h - n));
}

// How much a hit at a distance counts.
float weight(FrameParams f, float d) {
    // the binary radius is not cut sharply: depth images are too coarse for that
    float edge = f.reach < INFINITY ? clamp((f.reach - d) / (0.2 * f.reach), 0.0, 1.0) : 1.0;
    return edge * exp2(-d * f.falloff_log2);
}

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    FrameParams f = FrameParams(push.pass);
    uvec2 guide = LOAD_PAIR(f.guide, at);
    if (!is_surface(guide)) return;
    bool orthographic = f.orthographic != 0u;
    uvec2 pixel = uvec2(at % f.size.x, at / f.size.x);
    float depth = uintBitsToFloat(guide.x);
    vec2 centre = vec2(pixel) + 0.5;
    vec3 p = unproject(orthographic, image_plane(f, f.view, centre), depth);
    vec3 v = orthographic ? vec3(0.0, 0.0, 1.0) : normalize(-p);
    vec3 normal = linear(f.world_to_camera, uintBitsToFloat(Quads(f.surface).v[2u * at + 1u].xyz));
    float most = MOST_SEARCH * float(f.size.y);
    float radius = min(f.reach / footprint(f, f.view, orthographic, depth), most);
    vec2 u = sequence_2d(f.sequence, f.seed, pixel, f.frame, 0u, 1u);
    float accessibility = 0.0;
    for (uint slice = 0u; slice < f.slices; slice++) {
        float phi = PI * (float(slice) + u.x) / float(f.slices);
        // image rows go down, the camera's y goes up
        vec2 along = vec2(cos(phi), -sin(phi));
        vec3 direction = vec3(cos(phi), sin(phi), 0.0);
        vec3 axis = normalize(cross(direction, v));
        vec3 projected = normal - axis * dot(normal, axis);
        float size = length(projected);
        if (size < 1e-5) continue;
        vec3 tangent = direction - v * dot(direction, v);
        float cos_n = clamp(dot(projected, v) / size, 0.0, 1.0);
        float n = (dot(tangent, projected) < 0.0 ? -1.0 : 1.0) * acos(cos_n);
        float arcs = 0.0;
        for (int side = 0; side < 2; side++) {
            float sgn = side == 0 ? -1.0 : 1.0;
            // the surface itself is the lowest horizon
            float low = cos(clamp(n + sgn * 0.5 * PI, -PI, PI));
            float horizon = low;
            for (uint k = 0u; k < f.steps; k++) {
                float s = (float(k) + u.y) / float(f.steps);
                vec2 q = centre + sgn * along * max(s * s * radius, LEAST_STEP + float(k));
                if (any(lessThan(q, vec2(0.0))) || any(greaterThanEqual(q, vec2(f.size)))) break;
                uvec2 tap = uvec2(q);
                float there = uintBitsToFloat(Pairs(f.guide).v[image_index(f, tap)].x);
                if (!(there < INFINITY)) continue;
                vec3 delta = unproject(orthographic, image_plane(f, f.view, vec2(tap) + 0.5), there) - p;
                float d = length(delta);
                if (d == 0.0) continue;
                horizon = max(horizon, mix(low, dot(delta, v) / d, weight(f, d)));
            }
            float h = sgn * acos(clamp(horizon, -1.0, 1.0));
            // not below the surface
            h = n + clamp(h - n, -0.5 * PI, 0.5 * PI);
            arcs += arc(cos_n, n, h);
        }
        accessibility += size * arcs;
    }
    accessibility = clamp(accessibility / float(f.slices), 0.0, 1.0);
    STORE_PAIR(f.current, at, pack_estimate(Estimate(accessibility, 1.0, 0.0)));
}
