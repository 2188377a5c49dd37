// bvh_emit: the wide nodes of a level. Each opens the binary nodes below it that the dynamic program chose, writes its block and those of its leaves, and leaves its inner
// children to the next level. Where a child's blocks go follows from the numbers of blocks of its siblings: the order in which nodes are found is of no consequence, and a
// subtree's blocks lie side by side, as refitting in parallel needs them. Layout and rules are those of src/accel/wide.rs.
#include "bvh/builder.glsl"
#include "interface/hierarchy.glsl"

layout(buffer_reference, std430, buffer_reference_align = 16) buffer BuildBlocks { uvec4 v[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) buffer BuildQueue { uvec4 v[]; };

// The binary nodes that are the children of a wide one.
struct Children {
    uint count;
    uint id[7];
    uint slot[7];
    vec3 min[7];
    vec3 max[7];
    uint blocks[7];
};

// a - b, and what is left off where that is rounded (Knuth's two-sum).
vec3 difference(vec3 a, vec3 b, out vec3 rest) {
    precise vec3 d = a - b;
    precise vec3 other = d - a;
    precise vec3 error = (a - (d - other)) - (b + other);
    rest = error;
    return d;
}

// Opens nodes from the root of a wide node down, until all that are left are children.
void open_node(BuildParams p, uint id, inout Children children) {
    BuildNodes nodes = BuildNodes(p.nodes);
    uint open[7], open_count[7], depth = 0u, count = 7u, choice = nodes.v[id].choices & 7u;
    children.count = 0u;
    if (id < p.count) {
        // a tree of a single leaf: its node has that as its only child
        children.id[0] = id;
        children.count = 1u;
        return;
    }
    // a wide node has at least two children and at most seven, of which each turn finds one at least or opens one
    for (uint turn = 0u; turn < 7u; turn++) {
        BuildInner inner = BuildInners(p.inners).v[id - p.count];
        for (uint side = 0u; side < 2u; side++) {
            uint child = inner.children[side], most = side == 0u ? choice : count - choice, choices = nodes.v[child].choices;
            while (most > 1u && (choices >> 3u * (most - 1u) & 7u) == 0u) most--;
            if (most == 1u) {
                children.id[children.count] = child;
                children.count++;
            } else {
                open[depth] = child;
                open_count[depth] = most;
                depth++;
            }
        }
        if (depth == 0u) return;
        depth--;
        id = open[depth];
        count = open_count[depth];
        choice = nodes.v[id].choices >> 3u * (count - 1u) & 7u;
    }
}

// Gives each child the slot whose direction from the node's middle is most its own.
void assign_slots(inout Children children, vec3 middle) {
    uint left = (1u << children.count) - 1u, free = 0x7fu;
    while (left != 0u) {
        float most = -INFINITY;
        uint child = uint(findLSB(left)), slot = uint(findLSB(free));
        for (uint c = 0u; c < children.count; c++) {
            if ((left >> c & 1u) == 0u) continue;
            vec3 offset = children.min[c] + children.max[c] - middle;
            for (uint s = 0u; s < 7u; s++) {
                vec3 direction = vec3((s & 4u) != 0u ? 1.0 : -1.0, (s & 2u) != 0u ? 1.0 : -1.0, (s & 1u) != 0u ? 1.0 : -1.0);
                float along = dot(offset, direction);
                if ((free >> s & 1u) != 0u && along > most) {
                    most = along;
                    child = c;
                    slot = s;
                }
            }
        }
        children.slot[child] = slot;
        left &= ~(1u << child);
        free &= ~(1u << slot);
    }
}

// Puts a byte into eight.
void set_byte(inout uvec2 bytes, uint k, uint value) {
    uint shift = 8u * (k & 3u), mask = ~(0xffu << shift);
    if (k < 4u) bytes.x = (bytes.x & mask) | value << shift;
    else bytes.y = (bytes.y & mask) | value << shift;
}

// The block of a wide node. Planes are rounded outwards: a difference that is rounded is still on the same side of every plane but the one that it equals,
// because planes are floats and rounding is monotonic; there what rounding left off decides.
void write_node(uvec2 blocks, uint at, BuildNode node, Children children, uint first_child) {
    vec3 rest, size = difference(node.max, node.min, rest);
    // the least power of two of which 255 reach across: 2^-7 or 2^-6 of that below the size
    ivec3 exponent = max(ivec3(floatBitsToUint(size) >> 23u) - 7, 1);
    vec3 reach = 255.0 * intBitsToFloat(exponent << 23);
    bvec3 is_short = bvec3(uvec3(lessThan(reach, size)) | (uvec3(equal(reach, size)) & uvec3(greaterThan(rest, vec3(0.0)))));
    exponent += ivec3(is_short);
    vec3 inverse = intBitsToFloat((254 - exponent) << 23);

    uvec2 lower[3], upper[3];
    for (uint axis = 0u; axis < 3u; axis++) {
        lower[axis] = uvec2(0xffffffffu, 0x00ffffffu | uint(exponent[axis]) << 24);
        upper[axis] = uvec2(0u);
    }
    for (uint c = 0u; c < children.count; c++) {
        vec3 low = difference(children.min[c], node.min, rest) * inverse;
        vec3 floors = floor(low);
        uvec3 planes = uvec3(clamp(floors - vec3(uvec3(equal(floors, low)) & uvec3(lessThan(rest, vec3(0.0)))), 0.0, 255.0));
        for (uint axis = 0u; axis < 3u; axis++) set_byte(lower[axis], children.slot[c], planes[axis]);
        vec3 high = difference(children.max[c], node.min, rest) * inverse;
        vec3 ceilings = ceil(high);
        planes = uvec3(clamp(ceilings + vec3(uvec3(equal(ceilings, high)) & uvec3(greaterThan(rest, vec3(0.0)))), 0.0, 255.0));
        for (uint axis = 0u; axis < 3u; axis++) set_byte(upper[axis], children.slot[c], planes[axis]);
        upper[1].y |= 0x1000000u << children.slot[c];
    }
    BuildBlocks out_ = BuildBlocks(blocks);
    out_.v[4u * at] = uvec4(floatBitsToUint(node.min), first_child);
    out_.v[4u * at + 1u] = uvec4(lower[0], upper[0]);
    out_.v[4u * at + 2u] = uvec4(lower[1], upper[1]);
    out_.v[4u * at + 3u] = uvec4(lower[2], upper[2]);
}

// The node of a tree with this number, whose block is `at` and whose children's blocks begin at `first`.
void emit(BuildParams p, uint level, uint id, uint at, uint first) {
    BuildNodes nodes = BuildNodes(p.nodes);
    BuildNode node = nodes.v[id];
    Children children;
    open_node(p, id, children);
    for (uint c = 0u; c < children.count; c++) {
        BuildNode child = nodes.v[children.id[c]];
        children.min[c] = child.min;
        children.max[c] = child.max;
        children.blocks[c] = child.blocks;
    }
    assign_slots(children, node.min + node.max);
    write_node(p.blocks, at, node, children, first);

    uint inner = 0u;
    for (uint c = 0u; c < children.count; c++) inner += children.id[c] < p.count ? 0u : 1u;
    uint place = 0u;
    BuildSteps steps = BuildSteps(p.steps);
    if (inner > 0u) {
        place = atomicAdd(steps.v[FIRST_LEVEL + level + 1u].count, inner);
        atomicMax(steps.v[FIRST_LEVEL + level + 1u].groups[0], min(tile_count(place + inner, BUILD_LANES), MAX_GROUPS_X));
    }
    // slots are in the order of the octants, in which rays visit them
    uint block = first, below = first + children.count;
    for (uint s = 0u; s < 7u; s++) {
        uint c = 0u;
        while (c < children.count && children.slot[c] != s) c++;
        if (c == children.count) continue;
        uint child = children.id[c];
        if (child < p.count) {
            BuildBlocks from = BuildBlocks(p.leaves), to = BuildBlocks(p.blocks);
            for (uint k = 0u; k < 4u; k++) to.v[4u * block + k] = from.v[4u * child + k] | uvec4(0u, 0u, 0u, k == 3u ? LEAF : 0u);
        } else {
            BuildQueue(p.pairs[level & 1u]).v[place] = uvec4(child, block, below, 0u);
            place++;
            below += children.blocks[c] - 1u;
        }
        block++;
    }
}

void main() {
    BuildParams p = BuildParams(push.pass);
    uint level = push.first, first = gl_GlobalInvocationID.x;
    if (level == 0u) {
        // the root is the last node
        uint root = 2u * p.count - 2u;
        if (first != 0u) return;
        BuildState state = BuildState(p.state);
        BuildNode node = BuildNodes(p.nodes).v[root];
        float area = half_area(node.min, node.max, p.scale);
        state.root_area = area;
        state.root_cost = p.count == 1u ? 2.0 * area : BuildInners(p.inners).v[root - p.count].cost[0];
        state.blocks = p.count == 1u ? 2u : node.blocks;
        emit(p, level, root, 0u, 1u);
        return;
    }
    for (uint k = first; k < BuildSteps(p.steps).v[FIRST_LEVEL + level].count; k += gl_NumWorkGroups.x * BUILD_LANES) {
        uvec4 entry = BuildQueue(p.pairs[~level & 1u]).v[k];
        emit(p, level, entry.x, entry.y, entry.z);
    }
}
