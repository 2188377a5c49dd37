// Environments from images: radiance from a direction, and directions by how much light comes from there. Texels are looked up bilinearly;
// directions are drawn texel by texel, each as often as the mean of its bilinear patch is bright, by its solid angle, from an alias table
// (src/sampling/alias.rs), so that wherever there is light a direction can be drawn.
#ifndef PATH_MAP
#define PATH_MAP
#include "common/warp.glsl"
#include "path/params.glsl"
#include "bsdf/microfacet.glsl"

vec3 map_direction(EnvironmentMap map, vec3 w) {
    return vec3(dot(map.to_map[0].xyz, w), dot(map.to_map[1].xyz, w), dot(map.to_map[2].xyz, w));
}

// From the upper left corner; -z is in the middle.
vec2 map_coordinates(vec3 d) {
    return vec2(0.5 + turns_of(d.x, -d.z), 2.0 * turns_of(length(d.xz), d.y));
}

vec4 map_texel(EnvironmentMap map, int x, int y) {
    int w = int(map.width);
    x = x < 0 ? x + w : x >= w ? x - w : x;
    return load_quad(map.texels, uint(clamp(y, 0, int(map.height) - 1) * w + x));
}

vec3 map_lookup(EnvironmentMap map, vec2 uv) {
    vec2 p = uv * vec2(map.width, map.height) - 0.5;
    ivec2 i = ivec2(floor(p));
    vec2 f = p - vec2(i);
    return mix(
        mix(map_texel(map, i.x, i.y).rgb, map_texel(map, i.x + 1, i.y).rgb, f.x),
        mix(map_texel(map, i.x, i.y + 1).rgb, map_texel(map, i.x + 1, i.y + 1).rgb, f.x),
        f.y);
}

vec3 map_radiance(EnvironmentMap map, vec3 w) {
    return map_lookup(map, map_coordinates(map_direction(map, w)));
}

// `likely`: of the texel.
float map_density(EnvironmentMap map, float likely, float sin_theta) {
    return sin_theta > 0.0 ? likely * float(map.width * map.height) / (2.0 * PI * PI * sin_theta) : 0.0;
}

float map_pdf(EnvironmentMap map, vec3 w) {
    vec3 d = map_direction(map, w);
    uvec2 texel = min(uvec2(map_coordinates(d) * vec2(map.width, map.height)), uvec2(map.width, map.height) - 1u);
    float likely = load_quad(map.texels, texel.y * map.width + texel.x).w;
    return map_density(map, likely, sqrt(max(1.0 - d.y * d.y, 0.0)));
}

// Direction (world), radiance and density.
struct MapSample {
    vec3 wi;
    vec3 radiance;
    float pdf;
};

MapSample sample_map(EnvironmentMap map, vec2 u) {
    uint n = map.width * map.height;
    float x = u.x * float(n);
    uint k = min(uint(x), n - 1u);
    // what is left of the number after each choice is as even as it was
    float rest = x - float(k);
    uvec2 entry = Pairs(map.table).v[k];
    float threshold = uintBitsToFloat(entry.x);
    if (rest < threshold) {
        rest /= threshold;
    } else {
        rest = (rest - threshold) / (1.0 - threshold);
        k = entry.y;
    }
    vec2 uv = (vec2(k % map.width, k / map.width) + vec2(min(rest, 0.9999999), u.y)) / vec2(map.width, map.height);
    vec2 down = on_circle(0.5 * uv.y), around = on_circle(uv.x);
    float s = down.y;
    // half a turn from where the map begins
    vec3 d = vec3(-s * around.y, down.x, s * around.x);
    float likely = load_quad(map.texels, k).w;
    // the map's directions are world's, turned: back by the transpose
    vec3 wi = map.to_map[0].xyz * d.x + map.to_map[1].xyz * d.y + map.to_map[2].xyz * d.z;
    return MapSample(wi, map_lookup(map, uv), map_density(map, likely, s));
}

#endif
