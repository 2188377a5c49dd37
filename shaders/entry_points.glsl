// entry_points: the blocks of the hierarchy at which traversal of the camera rays of 2x2 pixels starts (Reshetov, Soupikov, Hurley, "Multi-Level Ray Tracing Algorithm",
// SIGGRAPH 2005). A lane has one such bundle: an interval of directions along each axis (Boulos, Wald, Shirley, "Geometric and Arithmetic Culling Methods for Entire Ray
// Packets", 2006) and a list of blocks sorted by their distance, of which it expands the nearest node until the list is full. Every ray of the bundle that meets a triangle
// finds it below an entry point: directions, boxes and distances are widened by more than rays and traversal round. Nothing is tested but boxes, so it is of no consequence
// what the leaves hold.
#include "common/camera.glsl"
#include "common/entry_points.glsl"
#include "interface/hierarchy.glsl"
#include "interface/pixel_filter.glsl"
#include "scene/scene.glsl"
#include "trace/block.glsl"

layout(local_size_x = LANES) in;

// Expansions per bundle at most: beyond, lists hardly change.
const uint MAX_EXPANSIONS = 24u;

const uvec2 BUNDLE_SIZE = uvec2(1u << ((BUNDLE_BITS + 1u) >> 1), 1u << (BUNDLE_BITS >> 1));

#define FOR_ENTRIES [[unroll]] for (uint i = 0u; i < MAX_ENTRY_POINTS; i++)

// How far beyond its area a pixel's rays may be, in pixels.
float filter_margin(uint pixel_filter) {
    return pixel_filter == FILTER_BLACKMAN_HARRIS ? 1.0 : pixel_filter == FILTER_TENT ? 0.5 : 0.0;
}

// A direction through a point of the image as camera_ray has it before it is normalized.
vec3 image_direction(BlockParams p, vec2 at) {
    vec2 ndc = 2.0 * at / vec2(p.image_size) - 1.0;
    vec3 d = vec3(vec2(ndc.x, -ndc.y) * p.view, -1.0);
    vec4 rows[3] = p.camera_to_world;
    return vec3(dot(rows[0].xyz, d), dot(rows[1].xyz, d), dot(rows[2].xyz, d));
}

void main() {
    uint k = gl_GlobalInvocationID.x, first = first_bundle();
    if (first + k > last_bundle()) return;
    BlockParams p = BlockParams(push.pass);
    SceneRoot root = SceneRoot(push.scene);
    uvec2 blocks = root.nodes;
    uvec2 pixel = block_pixel(p, (first + k) << BUNDLE_BITS);
    // Directions are linear over the image, so those through the corners bound them.
    // The rounding of a point of the image is far below the 2e-3 of a pixel.
    float margin = filter_margin(p.pixel_filter) + 2e-3;
    vec2 low = vec2(pixel + p.block_origin) - margin;
    vec2 high = vec2(pixel + p.block_origin) + vec2(BUNDLE_SIZE) + margin;
    vec3 d0 = image_direction(p, low), d1 = image_direction(p, vec2(high.x, low.y));
    vec3 d2 = image_direction(p, vec2(low.x, high.y)), d3 = image_direction(p, high);
    vec3 middle = normalize(d0 + d1 + d2 + d3);
    // what a unit of t is at least, in units of length
    float unit = min(min(dot(d0, middle), dot(d1, middle)), min(dot(d2, middle), dot(d3, middle))) * (1.0 - 1e-5);
    // rays start at the near clipping plane, at most so far from the eye
    float skipped = p.clip_near * max(max(length(d0), length(d1)), max(length(d2), length(d3))) * (1.0 + 1e-5);
    // a ray's direction rounds by a tenth of this
    float slack = 4e-6 * max(max(length(d0), length(d1)), max(length(d2), length(d3)));
    vec3 least = min(min(d0, d1), min(d2, d3)) - slack, most = max(max(d0, d1), max(d2, d3)) + slack;
    vec3 eye = vec3(p.camera_to_world[0].w, p.camera_to_world[1].w, p.camera_to_world[2].w);
    // The inverse of the greatest speed up and down each axis, with which a box ahead is reached first: infinite where no ray goes that way. Where all go the same way, the
    // slowest leaves a box last.
    bvec3 up = greaterThan(most, vec3(0.0)), down = lessThan(least, vec3(0.0));
    vec3 inverse_most = mix(vec3(INFINITY), 1.0 / most, up), inverse_least = mix(vec3(-INFINITY), 1.0 / least, down);
    bvec3 only_up = greaterThan(least, vec3(0.0)), only_down = lessThan(most, vec3(0.0));
    vec3 slowest_up = 1.0 / least, slowest_down = 1.0 / most;

    uint block[MAX_ENTRY_POINTS], distance_[MAX_ENTRY_POINTS];
    FOR_ENTRIES {
        block[i] = i == 0u ? root.root : INVALID;
        distance_[i] = i == 0u ? 0u : INVALID;
    }
    uint count = 1u;
    // padding beyond the block
    bool done = !in_block(p, pixel);
    if (done) block[0] = INVALID;
    for (uint turn = 0u; turn < MAX_EXPANSIONS && !done; turn++) {
        // the nearest entry that can be expanded: the lowest bit of a distance says that one cannot
        uint at = MAX_ENTRY_POINTS, number = 0u;
        FOR_ENTRIES {
            bool open = (distance_[i] & 1u) == 0u && at == MAX_ENTRY_POINTS;
            number = open ? block[i] : number;
            at = open ? i : at;
        }
        if (at == MAX_ENTRY_POINTS) {
            done = true;
        } else {
            Block8 b = Block8(block_address(blocks, number));
            uvec2 w0 = PAIR(b.q0), w1 = PAIR(b.q1), w2 = PAIR(b.q2), w3 = PAIR(b.q3);
            uvec2 w4 = PAIR(b.q4), w5 = PAIR(b.q5), w6 = PAIR(b.q6), w7 = PAIR(b.q7);
            uint hits = 0u;
            uint near_of[7];
            bool is_node = (BLOCK_FLAGS & LEAF) == 0u;
            if (is_node) {
                vec3 scale = uintBitsToFloat(uvec3(WIDE_NODE_LOWER_X.y >> 24, WIDE_NODE_LOWER_Y.y >> 24, WIDE_NODE_LOWER_Z.y >> 24) << 23);
                vec3 corner = uintBitsToFloat(WIDE_NODE_CORNER(uvec3));
                // eight half-ulps of a coordinate are 5e-7 of it
                vec3 reach = abs(corner) + abs(eye) + 255.0 * scale;
                corner -= eye;
                vec3 pad = 1e-6 * reach;
                [[unroll]] for (int c = 0; c < 7; c++) {
                    vec3 lo = vec3(BYTE(WIDE_NODE_LOWER_X, c), BYTE(WIDE_NODE_LOWER_Y, c), BYTE(WIDE_NODE_LOWER_Z, c)) * scale + corner - pad;
                    vec3 hi = vec3(BYTE(WIDE_NODE_UPPER_X, c), BYTE(WIDE_NODE_UPPER_Y, c), BYTE(WIDE_NODE_UPPER_Z, c)) * scale + corner + pad;
                    vec3 n = mix(mix(vec3(0.0), hi * inverse_least, lessThan(hi, vec3(0.0))), lo * inverse_most, greaterThan(lo, vec3(0.0)));
                    vec3 f = mix(mix(vec3(INFINITY), lo * slowest_down, only_down), hi * slowest_up, only_up);
                    float near = max(max(n.x, n.y), n.z);
                    float far = min(min(f.x, f.y), f.z);
                    bool hit = near <= far * (1.0 + 1e-5) && near < INFINITY;
                    hits |= hit ? 1u << c : 0u;
                    near_of[c] = floatBitsToUint(max(near * unit - skipped, 0.0)) & ~1u;
                }
                hits &= WIDE_NODE_UPPER_Y.y >> 24;
            }
            uint more = bitCount(hits);
            // a leaf, or a node with more children in the frustum than there is room for, stays as it is
            if (!is_node || count + more > MAX_ENTRY_POINTS + 1u) {
                FOR_ENTRIES distance_[i] |= i == at ? 1u : 0u;
            } else {
                // its children take its place, each where its distance belongs
                FOR_ENTRIES {
                    bool behind = i >= at;
                    block[i] = behind ? (i + 1u < MAX_ENTRY_POINTS ? block[min(i + 1u, MAX_ENTRY_POINTS - 1u)] : INVALID) : block[i];
                    distance_[i] = behind ? (i + 1u < MAX_ENTRY_POINTS ? distance_[min(i + 1u, MAX_ENTRY_POINTS - 1u)] : INVALID) : distance_[i];
                }
                uint present = WIDE_NODE_UPPER_Y.y >> 24;
                [[unroll]] for (int c = 0; c < 7; c++) {
                    uint child = WIDE_NODE_FIRST_CHILD + bitCount(present & ((1u << c) - 1u));
                    bool hit = (hits >> c & 1u) != 0u;
                    uint new_distance = hit ? near_of[c] : INVALID;
                    FOR_ENTRIES {
                        bool before = new_distance < distance_[i];
                        uint old_block = block[i], old_distance = distance_[i];
                        block[i] = before ? child : old_block;
                        distance_[i] = before ? new_distance : old_distance;
                        child = before ? old_block : child;
                        new_distance = before ? old_distance : new_distance;
                    }
                }
                count += more - 1u;
            }
        }
    }
    uvec2 list = offset_address(ao_params().entry_points, k * ENTRY_LIST_BYTES);
    FOR_ENTRIES {
        if (i <= count) STORE_PAIR(list, i, uvec2(block[i], distance_[i]));
    }
    STORE_PAIR(list, MAX_ENTRY_POINTS, uvec2(INVALID));
}
