// What the passes of a frame share. Mirrors FrameParams in src/render/realtime/params.rs.
//
// Images are in plain memory, rows from the top, one record a pixel:
//   surface   2 x 16 bytes: position and spawn offset; geometric normal on the viewer's side
//   guide     8 bytes: view depth (infinite: nothing is there), normal and id packed: what edge tests of neighbours read
//   history   8 bytes: mean accessibility; number of samples behind it, variance of one of them
//   current   8 bytes: the same of this frame's samples alone; no samples: 0 of them
//   bent      12 bytes, where asked for: mean of accessibility times direction (bent normal), world space; one for each of
//             this frame's samples, history and the filtered result. Its samples are those of the accessibility beside it.
#ifndef COMMON_FRAME
#define COMMON_FRAME
#include "common/types.glsl"
#include "common/morton.glsl"
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
    uint rest;                         // 1: nothing moves, and pixels with all their samples get no more
    uint slices;                       // of gtao
    uint steps;                        // of gtao, on each side of a slice
    float evenness;                    // the variance of the mean of n samples falls as n^-(1 + evenness)
    uint most_rays;                    // of a pixel in a frame with a budget
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
    uvec2 ray_count;                   // a uint: occlusion rays of the frame
    uvec2 current_bent;                // 3 floats a pixel, of each bent image: of this frame's samples; null, as the others: not asked for
    uvec2 previous_bent_history;
    uvec2 bent[4];                     // history; two between the steps of the filter; filtered
    uvec2 plan;                        // 8 bytes a pixel: number of its first ray in its sequence (24 bits), rays; samples that its
                                       // history counts at most; null, as what follows: every pixel has as many
    uvec2 list;                        // a uint a ray: pixel (28 bits), which of its rays
    uvec2 taken;                       // a uint a pixel: rays that it has had
    uvec2 desired_samples;                      // 8 bytes a pixel, in tiles: deviation of one sample, samples
    uvec2 budget_sums;                 // see common/budget.glsl
};

layout(buffer_reference, std430, buffer_reference_align = 4) buffer FloatImage { float v[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) buffer QuadImage { uvec4 v[]; };

void store_vec3(uvec2 image, uint at, vec3 value) {
    FloatImage target = FloatImage(image);
    for (uint k = 0u; k < 3u; k++) target.v[3u * at + k] = value[k];
}

// Pixel of an index that counts the image's tiles of 8x8.
uvec2 tile_pixel(FrameParams f, uint k) {
    return tile_pixel(k >> 6, f.tiles_x, k & 63u);
}

uint image_index(FrameParams f, uvec2 pixel) {
    return pixel.y * f.size.x + pixel.x;
}

// A direction in 24 bits, for edge tests only: within 0.004 of each coordinate.
uint pack_normal(vec3 n) {
    return packSnorm4x8(vec4(n, 0.0)) & 0xffffffu;
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

vec3 surface_position(FrameParams f, uint at) {
    return uintBitsToFloat(uvec3(LOAD_PAIR(f.surface, 4u * at), LOAD_PAIR(f.surface, 4u * at + 1u).x));
}

vec3 surface_normal(FrameParams f, uint at) {
    return uintBitsToFloat(uvec3(LOAD_PAIR(f.surface, 4u * at + 2u), LOAD_PAIR(f.surface, 4u * at + 3u).x));
}

float spawn_offset_at(FrameParams f, uint at) {
    return uintBitsToFloat(LOAD_PAIR(f.surface, 4u * at + 1u).y);
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

vec3 affine(vec4 rows[3], vec3 p) {
    return vec3(dot(rows[0].xyz, p), dot(rows[1].xyz, p), dot(rows[2].xyz, p)) + vec3(rows[0].w, rows[1].w, rows[2].w);
}

vec3 linear(vec4 rows[3], vec3 v) {
    return vec3(dot(rows[0].xyz, v), dot(rows[1].xyz, v), dot(rows[2].xyz, v));
}

// Tells whether neighbours of a point of the image show the same surface: they lie on its plane, by so much, and their normals are
// like its own. The distance from the plane of what a pixel shows follows from its depth and an expression that is linear in the
// pixel's place.
struct EdgeTest {
    vec3 normal;        // world
    float cosine;
    float distance;     // of the plane from the camera
    float tolerance;    // of the distance from the plane
    float at, right, down;  // the linear expression, at the point and by pixel
    float by_depth;
    bool orthographic;
};

// `centre`: the point's place in the image, pixels; position and normal in world space.
EdgeTest edge_test(FrameParams f, vec4 world_to_camera[3], vec2 view, bool orthographic, vec3 position, vec3 normal, vec2 centre) {
    EdgeTest e;
    vec3 c = affine(world_to_camera, position), n = linear(world_to_camera, normal);
    vec2 plane = image_plane(f, view, centre), step = 2.0 * view / vec2(f.size);
    e.normal = normal;
    e.cosine = f.normal_tolerance;
    e.distance = dot(n, c);
    e.tolerance = f.depth_tolerance * footprint(f, view, orthographic, -c.z);
    e.at = dot(n.xy, plane) - (orthographic ? 0.0 : n.z);
    e.right = n.x * step.x;
    e.down = -n.y * step.y;
    e.by_depth = -n.z;
    e.orthographic = orthographic;
    return e;
}

// `offset`: from the point to the neighbour, pixels.
bool on_plane(EdgeTest e, vec2 offset, uvec2 guide) {
    float depth = uintBitsToFloat(guide.x);
    float s = e.at + offset.x * e.right + offset.y * e.down;
    float off = (e.orthographic ? s + depth * e.by_depth : s * depth) - e.distance;
    // not so where the depth is infinite
    return abs(off) <= e.tolerance;
}

bool same_surface(EdgeTest e, vec2 offset, uvec2 guide) {
    return on_plane(e, offset, guide) && dot(e.normal, unpackSnorm4x8(guide.y).xyz) >= e.cosine;
}

// A mean over samples: how many there are, and the variance of one.
struct Estimate {
    float mean;
    float samples;
    float variance;
};

const float MAX_VARIANCE = 0.5;  // of values from 0 to 1: a quarter, and half of it more for an unbiased estimate from two

uvec2 pack_estimate(Estimate e) {
    // sixteenths of a sample: interpolated histories have parts of them
    uint samples = uint(clamp(e.samples, 0.0, 4095.0) * 16.0 + 0.5);
    uint variance = uint(clamp(e.variance * (65535.0 / MAX_VARIANCE), 0.0, 65535.0) + 0.5);
    return uvec2(floatBitsToUint(e.mean), samples << 16 | variance);
}

Estimate unpack_estimate(uvec2 bits) {
    return Estimate(uintBitsToFloat(bits.x), float(bits.y >> 16) * 0.0625, float(bits.y & 0xffffu) * (MAX_VARIANCE / 65535.0));
}

const uint PATTERN_CHECKER = 1u;
const uint PATTERN_QUARTER = 2u;

bool is_sampled(FrameParams f, uvec2 pixel) {
    if (f.pattern == PATTERN_CHECKER) return ((pixel.x + pixel.y + f.frame) & 1u) == 0u;
    // one of each 2x2, opposite corners in turn
    if (f.pattern == PATTERN_QUARTER) return (0x9cu >> (2u * (f.frame & 3u)) & 3u) == ((pixel.x & 1u) | (pixel.y & 1u) << 1);
    return true;
}

// Has a pixel of a surface all its samples?
bool is_resting(FrameParams f, uint at) {
    return f.rest != 0u && unpack_estimate(LOAD_PAIR(f.previous_history, at)).samples >= f.most_samples;
}

// Has a pixel rays in this frame?
bool has_rays(FrameParams f, uvec2 pixel, uint at) {
    return is_sampled(f, pixel) && is_surface(LOAD_PAIR(f.guide, at)) && !is_resting(f, at);
}

#endif
