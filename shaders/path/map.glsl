// Environments from images: radiance from a direction, and directions by how much light comes from there. Texels are looked up bilinearly.
// Directions are sampled by weights of texels (src/integrators/path/environment.rs), interpolated likewise: first a row of patches between texel centres, then a
// patch of the row, then a position in the patch (src/sampling/bilinear.rs has the formulas). The mapping preserves the order of the two numbers, so that
// well stratified numbers give well stratified directions, and unoccluded environments have little noise.
#ifndef PATH_MAP
#define PATH_MAP
#include "common/warp.glsl"
#include "path/params.glsl"
#include "bsdf/microfacet.glsl"

vec3 map_direction(EnvironmentRecord map, vec3 w) {
    return vec3(dot(map.to_map[0].xyz, w), dot(map.to_map[1].xyz, w), dot(map.to_map[2].xyz, w));
}

// From the upper left corner; -z is in the middle.
vec2 map_coordinates(vec3 d) {
    return vec2(0.5 + turns_of(d.x, -d.z), 2.0 * turns_of(length(d.xz), d.y));
}

vec4 map_texel(EnvironmentRecord map, int x, int y) {
    int w = int(map.width);
    x = x < 0 ? x + w : x >= w ? x - w : x;
    return load_quad(map.texels, uint(clamp(y, 0, int(map.height) - 1) * w + x));
}

// The four texels of a patch, and a position in it.
struct Patch {
    vec4 a, b, c, d;  // upper left, upper right, lower left, lower right: radiance, weight
    vec2 at;          // 0 to 1
};

vec4 patch_value(Patch q) { return mix(mix(q.a, q.b, q.at.x), mix(q.c, q.d, q.at.x), q.at.y); }

// x: column; y: row, of which those at the poles are halves. at: in the patch.
Patch map_patch(EnvironmentRecord map, ivec2 i, vec2 at) {
    return Patch(map_texel(map, i.x, i.y - 1), map_texel(map, i.x + 1, i.y - 1), map_texel(map, i.x, i.y), map_texel(map, i.x + 1, i.y), at);
}

// Where a patch begins among numbers from 0 to 1, and where it ends; those of rows come first.
vec2 map_interval(EnvironmentRecord map, uint at) {
    Floats table = Floats(map.table);
    return vec2(table.v[at], table.v[at + 1u]);
}

uint map_columns(EnvironmentRecord map, uint row) { return map.height + 2u + row * (map.width + 1u); }

// Cells of the guide to so many intervals (src/sampling/bilinear.rs).
uint guide_cells(uint intervals) { return (intervals + GUIDED_INTERVALS - 1u) / GUIDED_INTERVALS; }

// Where the guide to a row's columns begins, after that to rows.
uint guide_columns(EnvironmentRecord map, uint row) { return guide_cells(map.height + 1u) + 1u + row * (guide_cells(map.width) + 1u); }

// Density per solid angle of a direction in a patch whose row and column have these intervals.
float map_density(EnvironmentRecord map, Patch q, uint row, vec2 rows, vec2 columns, float sin_theta) {
    float mean = 0.25 * (q.a.w + q.b.w + q.c.w + q.d.w);
    if (!(mean > 0.0 && sin_theta > 0.0)) return 0.0;
    float halves = row == 0u || row == map.height ? 2.0 : 1.0;
    float density = (rows.y - rows.x) * (columns.y - columns.x) * halves * (patch_value(q).w / mean);
    return density * (float(map.width) * float(map.height) / (2.0 * PI * PI * sin_theta));
}

// Where a direction meets a map: the patch, its row and column, and the sine of the angle to the poles.
struct MapPoint {
    Patch patch_;
    uint row;
    uint column;
    float sin_theta;
};

MapPoint map_point(EnvironmentRecord map, vec3 w) {
    vec3 d = map_direction(map, w);
    vec2 p = map_coordinates(d) * vec2(map.width, map.height) - 0.5;
    ivec2 i = to_int(floor(p));
    // a patch is indexed by the row of its lower texels and the column of its left ones
    i.y = clamp(i.y + 1, 0, int(map.height));
    uint column = uint(i.x < 0 ? i.x + int(map.width) : i.x);
    return MapPoint(map_patch(map, i, p - floor(p)), uint(i.y), min(column, map.width - 1u), sqrt(max(1.0 - d.y * d.y, 0.0)));
}

vec3 map_radiance(MapPoint at) { return patch_value(at.patch_).rgb; }

float map_pdf(EnvironmentRecord map, MapPoint at) {
    vec2 columns = map_interval(map, map_columns(map, at.row) + at.column);
    return map_density(map, at.patch_, at.row, map_interval(map, at.row), columns, at.sin_theta);
}

// Direction (world), radiance and density.
struct MapSample {
    vec3 wi;
    vec3 radiance;
    float pdf;
};

// The interval among `count` that holds u, which begin at the table's place `first`, and their guide at `first_cell`; what is left of u is as even as it was.
uint find_interval(EnvironmentRecord map, uint first, uint count, uint first_cell, inout float u, out vec2 interval) {
    Floats table = Floats(map.table);
    uint cells = guide_cells(count);
    uint cell = first_cell + min(uint(to_int(floor(u * float(cells)))), cells - 1u);
    uint low = Words(map.guide).v[cell];
    count = Words(map.guide).v[cell + 1u] - low + 1u;
    while (count > 1u) {
        uint half_ = count >> 1;
        if (table.v[first + low + half_] <= u) low += half_;
        count -= half_;
    }
    interval = map_interval(map, first + low);
    u = clamp((u - interval.x) / (interval.y - interval.x), 0.0, 0.99999994);
    return low;
}

// Samples a density that is linear from a to b over [0, 1] (pbrt-v4, A.4.2).
float sample_linear(float u, float a, float b) {
    float sum = a + b;
    if (!(sum > 0.0)) return u;
    a /= sum;
    b /= sum;
    float root = sqrt(mix(a * a, b * b, u));
    return a + root > 0.0 ? min(u / (a + root), 0.99999994) : 0.0;
}

MapSample sample_map(EnvironmentRecord map, vec2 u) {
    vec2 rows, columns;
    uint row = find_interval(map, 0u, map.height + 1u, 0u, u.y, rows);
    uint column = find_interval(map, map_columns(map, row), map.width, guide_columns(map, row), u.x, columns);
    Patch q = map_patch(map, ivec2(column, row), vec2(0.0));
    float y = sample_linear(u.y, q.a.w + q.b.w, q.c.w + q.d.w);
    q.at = vec2(sample_linear(u.x, mix(q.a.w, q.c.w, y), mix(q.b.w, q.d.w, y)), y);
    // poles are in the middle of their patches
    float half_row = row == 0u ? 0.5 + 0.5 * y : row == map.height ? 0.5 * y : y;
    vec2 uv = (vec2(column, row) + vec2(0.5 + q.at.x, half_row - 0.5)) / vec2(map.width, map.height);
    vec2 down = on_circle(0.5 * clamp(uv.y, 0.0, 1.0)), around = on_circle(fract(uv.x));
    float s = down.y;
    // half a turn from where the map begins
    vec3 d = vec3(-s * around.y, down.x, s * around.x);
    // map to world by the transpose of the rotation
    vec3 wi = map.to_map[0].xyz * d.x + map.to_map[1].xyz * d.y + map.to_map[2].xyz * d.z;
    return MapSample(wi, patch_value(q).rgb, map_density(map, q, row, rows, columns, s));
}

#endif
