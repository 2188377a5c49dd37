// Functions that the passes of a frame share.
#ifndef COMMON_FRAME
#define COMMON_FRAME
#include "common/types.glsl"
#include "common/morton.glsl"
#include "common/queue.glsl"
#include "interface/frame.glsl"
#include "interface/pattern.glsl"

layout(buffer_reference, std430, buffer_reference_align = 4) buffer FloatImage { float v[]; };

void store_vec3(uvec2 image, uint at, vec3 value) {
    FloatImage target = FloatImage(image);
    for (uint k = 0u; k < 3u; k++) target.v[3u * at + k] = value[k];
}

// The pixel of an index that counts the image in 8x8 tiles.
uvec2 tile_pixel(FrameParams f, uint k) {
    return tile_pixel(k >> 6, f.tiles_x, k & 63u);
}

// The pixel whose image_index this is.
uvec2 image_pixel(FrameParams f, uint index) {
    return divide(index, f.size.x);
}

uint image_index(FrameParams f, uvec2 pixel) {
    return pixel.y * f.size.x + pixel.x;
}

// A direction in 24 bits, for edge tests only: within 0.004 of each coordinate.
uint pack_normal(vec3 n) {
    return packSnorm4x8(vec4(n, 0.0)) & 0xffffffu;
}

// An 8-bit hash of an id.
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
    return uintBitsToFloat(uvec3(LOAD_PAIR(f.surface, 2u * at), LOAD_PAIR(f.surface, 2u * at + 1u).x));
}

vec3 surface_normal(FrameParams f, uint at) {
    return uintBitsToFloat(uvec3(LOAD_PAIR(f.normals, 2u * at), LOAD_PAIR(f.normals, 2u * at + 1u).x));
}

float spawn_offset_at(FrameParams f, uint at) {
    return uintBitsToFloat(LOAD_PAIR(f.surface, 2u * at + 1u).y);
}

void store_surface(FrameParams f, uint at, vec3 position, float spawn_offset, vec3 normal) {
    STORE_PAIR(f.surface, 2u * at, floatBitsToUint(position.xy));
    STORE_PAIR(f.surface, 2u * at + 1u, floatBitsToUint(vec2(position.z, spawn_offset)));
    STORE_PAIR(f.normals, 2u * at, floatBitsToUint(normal.xy));
    STORE_PAIR(f.normals, 2u * at + 1u, floatBitsToUint(vec2(normal.z, 0.0)));
}

// A pixel that shows a ground that catches shadows: its surface has been stored, and this is a word of it that surfaces leave 0.
void store_caught(FrameParams f, uint at, vec3 normal) { STORE_PAIR(f.normals, 2u * at + 1u, uvec2(floatBitsToUint(normal.z), 1u)); }

// `at`: a pixel that shows a surface.
bool is_catcher(uvec2 normals, uint at) { return HAS_CATCHER && LOAD_PAIR(normals, 2u * at + 1u).y != 0u; }

// Where in the image a pixel's sample lies in this frame.
vec2 sample_place(FrameParams f, vec2 pixel) {
    return pixel + 0.5 + f.offset;
}

// Position on the image plane at unit distance (for an orthographic camera, on the camera's plane) of a point of the image, in pixels from the
// upper left corner.
vec2 image_plane(FrameParams f, vec2 view, vec2 at) {
    vec2 ndc = 2.0 * at / vec2(f.size) - 1.0;
    return vec2(ndc.x, -ndc.y) * view;
}

// The inverse.
vec2 image_point(FrameParams f, vec2 view, vec2 plane) {
    vec2 ndc = plane / view;
    return (vec2(ndc.x, -ndc.y) * 0.5 + 0.5) * vec2(f.size);
}

// A point in camera space from its position on the image plane and its view depth.
vec3 unproject(bool orthographic, vec2 plane, float depth) {
    return orthographic ? vec3(plane, -depth) : vec3(plane * depth, -depth);
}

// Side of a pixel's footprint at a depth, in scene units.
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

// Decides whether neighbours of a point of the image show the same surface: they must be within a tolerance of its plane, and have similar
// normals. The distance of a pixel's surface from the plane follows from its depth and an expression that is linear in the
// pixel's position.
struct EdgeTest {
    vec3 normal;        // world
    float cosine;
    float distance;     // of the plane from the camera
    float tolerance;    // of the distance from the plane
    float at, right, down;  // the linear expression, at the point and by pixel
    float by_depth;
    bool orthographic;
};

// `plane`: position of the point on the image plane; `c`: in camera space; `n`: the normal there; `normal`: in world space.
EdgeTest edge_test(FrameParams f, vec2 view, bool orthographic, vec2 plane, vec3 c, vec3 n, vec3 normal) {
    EdgeTest e;
    vec2 step = 2.0 * view / vec2(f.size);
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

// `centre`: position of the point in the image, in pixels; position and normal in world space.
EdgeTest edge_test(FrameParams f, vec4 world_to_camera[3], vec2 view, bool orthographic, vec3 position, vec3 normal, vec2 centre) {
    vec3 c = affine(world_to_camera, position), n = linear(world_to_camera, normal);
    return edge_test(f, view, orthographic, image_plane(f, view, centre), c, n, normal);
}

// The same for the surface that a pixel of this frame shows, whose guide says how far away it is.
EdgeTest edge_test(FrameParams f, uvec2 guide, vec3 normal, vec2 centre) {
    bool orthographic = f.orthographic != 0u;
    vec2 plane = image_plane(f, f.view, centre);
    vec3 c = unproject(orthographic, plane, uintBitsToFloat(guide.x)), n = linear(f.world_to_camera, normal);
    return edge_test(f, f.view, orthographic, plane, c, n, normal);
}

// Distance of a neighbour from the plane, on the side of its normal. `offset`: from the point to the neighbour, in pixels.
float distance_from_plane(EdgeTest e, vec2 offset, float depth) {
    float s = e.at + offset.x * e.right + offset.y * e.down;
    return (e.orthographic ? s + depth * e.by_depth : s * depth) - e.distance;
}

bool on_plane(EdgeTest e, vec2 offset, uvec2 guide) {
    // false where the depth is infinite
    return abs(distance_from_plane(e, offset, uintBitsToFloat(guide.x))) <= e.tolerance;
}

// Whether a neighbour of that depth is in front of the plane. Normals are on the viewer's side.
bool in_front(EdgeTest e, vec2 offset, float depth) { return distance_from_plane(e, offset, depth) > e.tolerance; }

// The normal in a guide, to be computed once for many tests. As unpackSnorm4x8 has it, but for its divisions and its clamps of -128, which pack_normal does not make.
vec3 guide_normal(uvec2 guide) {
    ivec3 bytes = ivec3(uvec3(guide.y << 24, guide.y << 16, guide.y << 8)) >> 24;
    return vec3(bytes) * (1.0 / 127.0);
}

bool same_surface(EdgeTest e, vec2 offset, uvec2 guide, vec3 normal) {
    return on_plane(e, offset, guide) && dot(e.normal, normal) >= e.cosine;
}

bool same_surface(EdgeTest e, vec2 offset, uvec2 guide) { return same_surface(e, offset, guide, guide_normal(guide)); }

// a / b, for 0 <= a <= b but for rounding, b > 0: from 0 to 1, and 1 where they are equal. Vulkan lets a quotient be 2.5 units in the last place off.
float share_of(float a, float b) { return a >= b ? 1.0 : min(a / b, 1.0); }

// A mean over samples: their number, and the variance of one.
struct Estimate {
    float mean;
    float samples;
    float variance;
};

uvec2 pack_estimate(Estimate e) {
    // in sixteenths of a sample, because interpolated histories have fractions
    uint samples = uint(to_int(floor(clamp(e.samples, 0.0, 4095.0) * 16.0 + 0.5)));
    uint variance = uint(to_int(floor(clamp(e.variance * (65535.0 / MAX_VARIANCE), 0.0, 65535.0) + 0.5)));
    return uvec2(floatBitsToUint(e.mean), samples << 16 | variance);
}

Estimate unpack_estimate(uvec2 bits) {
    return Estimate(uintBitsToFloat(bits.x), float(bits.y >> 16) * 0.0625, float(bits.y & 0xffffu) * (MAX_VARIANCE / 65535.0));
}

// Of each 2x2 pixels the one that is sampled in this frame: opposite corners in turn. Bit 0 is its column, bit 1 its row.
uint sampled_corner(FrameParams f) { return 0x9cu >> (2u * (f.frame & 3u)) & 3u; }

bool is_sampled(FrameParams f, uvec2 pixel) {
    if (f.pattern == PATTERN_CHECKER) return ((pixel.x + pixel.y + f.frame) & 1u) == 0u;
    if (f.pattern == PATTERN_QUARTER) return sampled_corner(f) == ((pixel.x & 1u) | (pixel.y & 1u) << 1);
    return true;
}

// Pixels of a cell of the pattern, of which one is sampled.
uvec2 pattern_cell(FrameParams f) { return uvec2(f.pattern == PATTERN_FULL ? 1u : 2u, f.pattern == PATTERN_QUARTER ? 2u : 1u); }

// The pixel of a cell that is sampled in this frame; outside the image where the cell reaches beyond it.
uvec2 sampled_pixel(FrameParams f, uvec2 cell) {
    if (f.pattern == PATTERN_CHECKER) return uvec2(2u * cell.x + (cell.y + f.frame & 1u), cell.y);
    if (f.pattern == PATTERN_QUARTER) {
        uint corner = sampled_corner(f);
        return 2u * cell + uvec2(corner & 1u, corner >> 1);
    }
    return cell;
}

// Whether a pixel of a surface has all its samples.
bool is_resting(FrameParams f, uint at) {
    return f.rest != 0u && unpack_estimate(LOAD_PAIR(f.previous_history, at)).samples >= f.most_samples;
}

// Whether a pixel has rays in this frame.
bool has_rays(FrameParams f, uvec2 pixel, uint at) {
    return is_sampled(f, pixel) && is_surface(LOAD_PAIR(f.guide, at)) && !is_resting(f, at);
}

#endif
