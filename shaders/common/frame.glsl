// What the passes of a frame share. Mirrors FrameParams in src/render/realtime/params.rs.
//
// Images are in plain memory, rows from the top, one record a pixel:
//   surface   2 x 16 bytes: position and spawn offset; geometric normal on the viewer's side
//   guide     8 bytes: view depth (infinite: nothing is there), normal and id packed: what edge tests of neighbours read
//   history   8 bytes: mean accessibility; number of samples behind it, variance of one of them
//   current   8 bytes: the same of this frame's samples alone; no samples: 0 of them
#ifndef COMMON_FRAME
#define COMMON_FRAME
#include "common/types.glsl"
#include "common/queue.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) readonly buffer FrameParams {
    vec4 camera_to_world[3];           // relative to the scene's origin
    vec4 world_to_camera[3];
    vec4 previous_world_to_camera[3];
    vec2 view;                         // half width and half height of the view: tangents, or world units when orthographic
    vec2 previous_view;
    uint orthographic;
    uint previous_orthographic;
    uvec2 size;                        // pixels
    uint tiles_x;                      // 8x8 tiles in a row
    uint frame;                        // counts up; where samples differ from frame to frame
    uint seed;
    uint rays_per_pixel;               // of a pixel that is sampled in this frame; with a budget: at most
    uint pattern;                      // which pixels are sampled: 0 all, 1 every second, 2 one of four
    uint sequence;                     // see common/sequence.glsl
    float reach;                       // world units: occlusion rays end there
    float falloff_log2;                // a hit at distance d counts 2^(-d * falloff_log2)
    float most_samples;                // that a history counts at most
    float depth_tolerance;             // distance from a pixel's plane, in pixels' footprints, at which an edge begins
    float normal_tolerance;            // cosine between normals at which an edge begins
    uint still;                        // 1: neither camera nor scene have moved since the previous frame
    uint has_history;                  // 0: what lies in the history buffers means nothing
    uint moved_count;
    float clamp_width;                 // standard errors by which a history may differ from its surroundings where things move; 0: any
    float moved_weight;                // how much what moves shortens histories
    float filter_samples;              // samples that a filtered value should rest on
    uint filter_radius;                // pixels, at most
    uint rest;                         // 1: pixels with all their samples get no more while nothing moves
    uint slices;                       // of gtao
    uint steps;                        // of gtao, on each side of a slice
    uint frame_reserved;
    uvec2 surface;
    uvec2 axes;                        // 3 floats a pixel: the hemisphere's axis where it is not the geometric normal; or null
    uvec2 guide;
    uvec2 previous_guide;
    uvec2 history;
    uvec2 previous_history;
    uvec2 current;
    uvec2 samples;                     // a float per ray of a launch, where a pixel has several
    uvec2 previous_position;           // 3 floats a pixel: where its surface was in the previous frame; null: nothing moves
    uvec2 result;                      // a float a pixel: accessibility
    uvec2 moved;                       // MovedRecord: what has moved since the previous frame
    uvec2 tiles;                       // a uint each: the tiles that show anything; null: all
    RayQueue queue;
};

layout(buffer_reference, std430, buffer_reference_align = 4) buffer FloatImage { float v[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) buffer PairImage { uvec2 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) buffer QuadImage { uvec4 v[]; };

// Pixel of a place in the tile order of src/render/block.rs.
uvec2 tile_pixel(FrameParams f, uint k) {
    uint tile = k >> 6;
    if (!is_null(f.tiles)) tile = Words(f.tiles).v[tile];
    uint j = k & 63u;
    uvec2 inside = uvec2((j & 1u) | (j >> 1 & 2u) | (j >> 2 & 4u), (j >> 1 & 1u) | (j >> 2 & 2u) | (j >> 3 & 4u));
    return uvec2(tile % f.tiles_x, tile / f.tiles_x) * 8u + inside;
}

uint image_index(FrameParams f, uvec2 pixel) {
    return pixel.y * f.size.x + pixel.x;
}

// A direction in 24 bits, 12 for each side of an octahedron: Cigolle et al., "A Survey of Efficient Representations for Independent
// Unit Vectors", JCGT 3(2), 2014. For edge tests only.
uint pack_normal(vec3 n) {
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    if (n.z < 0.0) p = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    uvec2 q = uvec2(clamp((p * 0.5 + 0.5) * 4095.0 + 0.5, 0.0, 4095.0));
    return q.x | q.y << 12;
}

vec3 unpack_normal(uint bits) {
    vec2 p = vec2(bits & 0xfffu, bits >> 12 & 0xfffu) * (2.0 / 4095.0) - 1.0;
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float t = max(-n.z, 0.0);
    n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
    return normalize(n);
}

// Eight bits that tell most ids apart.
uint id_bits(uint id) {
    return (id * 0x9e3779b1u) >> 24;
}

uvec2 make_guide(float depth, vec3 normal, uint id) {
    return uvec2(floatBitsToUint(depth), pack_normal(normal) | id_bits(id) << 24);
}

bool is_surface(uvec2 guide) {
    return uintBitsToFloat(guide.x) < INFINITY;
}

// Where on the plane at unit distance (or, with parallel rays, on the plane of the camera) a point of the image is; pixels from the
// upper left corner.
vec2 image_plane(FrameParams f, vec2 view, vec2 at) {
    vec2 ndc = 2.0 * at / vec2(f.size) - 1.0;
    return vec2(ndc.x, -ndc.y) * view;
}

// The other way.
vec2 image_point(FrameParams f, vec2 view, vec2 plane) {
    vec2 ndc = plane / view;
    return (vec2(ndc.x, -ndc.y) * 0.5 + 0.5) * vec2(f.size);
}

// A point in camera space from its place on the image plane and its view depth.
vec3 unproject(bool orthographic, vec2 plane, float depth) {
    return orthographic ? vec3(plane, -depth) : vec3(plane * depth, -depth);
}

// Side of a pixel's footprint at a depth, world units.
float footprint(FrameParams f, vec2 view, bool orthographic, float depth) {
    float side = 2.0 * view.y / float(f.size.y);
    return orthographic ? side : side * depth;
}

// The plane of a surface in camera space: dot(normal, x) = distance.
struct Plane {
    vec3 normal;
    float distance;
    float tolerance;  // distance from the plane at which an edge begins
    vec3 world_normal;
};

// Do a neighbour's records belong to the same surface? `plane_at`: its place on the image plane.
bool same_surface(Plane p, bool orthographic, vec2 plane_at, uvec2 guide, float cosine) {
    float depth = uintBitsToFloat(guide.x);
    if (!(depth < INFINITY)) return false;
    float off = abs(dot(p.normal, unproject(orthographic, plane_at, depth)) - p.distance);
    return off <= p.tolerance && dot(p.world_normal, unpack_normal(guide.y)) >= cosine;
}

vec3 affine(vec4 rows[3], vec3 p) {
    return vec3(dot(rows[0].xyz, p), dot(rows[1].xyz, p), dot(rows[2].xyz, p)) + vec3(rows[0].w, rows[1].w, rows[2].w);
}

vec3 linear(vec4 rows[3], vec3 v) {
    return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}

// A mean over samples: how many there are, and the variance of one.
struct Estimate {
    float mean;
    float samples;
    float variance;
};

uvec2 pack_estimate(Estimate e) {
    // half floats count exactly up to 2048
    return uvec2(floatBitsToUint(e.mean), packHalf2x16(vec2(e.samples, e.variance)));
}

Estimate unpack_estimate(uvec2 bits) {
    vec2 s = unpackHalf2x16(bits.y);
    return Estimate(uintBitsToFloat(bits.x), s.x, s.y);
}

#endif
