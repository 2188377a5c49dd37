// path_gather: the means and variances of a launch's paths for each pixel, of the diffuse part and of the rest, and the sum of all since the image came to rest.
#include "path/params.glsl"
#include "common/radiance.glsl"
#include "common/rest_parts.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

// A mean over samples, added one after the other (Welford 1962); `variance` is a sum of squares until `finished`.
void add_sample(inout RadianceEstimate e, vec3 c) {
    e.samples += 1.0;
    vec3 difference = c - e.mean;
    e.mean += difference / e.samples;
    e.variance += difference * (c - e.mean);
}

RadianceEstimate finished(RadianceEstimate e) {
    e.variance /= max(e.samples - 1.0, 1.0);
    return e;
}

void main() {
    uint k = gl_GlobalInvocationID.x, n = 1u << push.sample_bits;
    if (k >= push.count >> push.sample_bits) return;
    GatherParams p = GatherParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    PathParams path = PathParams(p.path);
    uint sampled = is_null(p.listed) ? (push.first >> push.sample_bits) + k : Words(p.listed).v[k];
    uvec2 cell = tile_pixel(sampled >> 6, p.tiles_x, sampled & 63u), size = pattern_cell(f);
    bool is_first = p.earlier == 0u;
    uvec2 pixel = sampled_pixel(f, cell);
    // the others of its cell have no samples in this frame
    if (is_first && f.pattern != PATTERN_FULL) {
        for (uint other = 0u; other < size.x * size.y; other++) {
            uvec2 q = size * cell + uvec2(other & 1u, other >> 1);
            if (q == pixel || any(greaterThanEqual(q, f.size))) continue;
            uint at = image_index(f, q);
            store_radiance(p.diffuse, at, NO_RADIANCE);
            store_radiance(p.specular, at, NO_RADIANCE);
            FloatImage(p.distances).v[at] = SIGNAL_UNKNOWN;
            if (!is_null(p.rest) && p.starts != 0u) {
                store_rest(p.rest, at, NO_REST);
                store_parts(p.rest_parts, at, NO_PARTS);
            }
        }
    }
    if (any(greaterThanEqual(pixel, f.size))) return;
    uint at = image_index(f, pixel);
    RadianceEstimate diffuse = NO_RADIANCE, specular = NO_RADIANCE, whole = NO_RADIANCE;
    RestParts parts = NO_PARTS;
    // of catchers
    float passed = 0.0;
    bool is_caught = WITH_CATCHER;
    float covered = 0.0, distance_ = 0.0, distances = 0.0;
    for (uint s = 0u; s < n; s++) {
        uint i = p.first_path + k * n + s;
        vec4 direct = load_signal(path, i, SIGNAL_DIRECT), d = load_signal(path, i, SIGNAL_DIFFUSE), albedo = load_signal(path, i, SIGNAL_ALBEDO);
        vec4 radiance = load_quad(path.radiance, i);
        float share = occluded_share(path.occludes_all, radiance);
        vec3 c = share * radiance.rgb;
        d.rgb *= share;
        if (!is_finite(c) || !is_finite(d.rgb) || !is_finite(direct.rgb)) continue;
        add_sample(diffuse, d.rgb);
        // rounding may leave less than nothing
        vec3 rest = max(c - d.rgb * albedo.rgb, vec3(0.0));
        add_sample(specular, rest);
        add_sample(whole, c + direct.rgb);
        parts.diffuse += d.rgb * albedo.rgb;
        parts.albedo += albedo.rgb;
        parts.specular += rest;
        covered += direct.a;
        if (WITH_CATCHER) {
            // the share of light reaches all channels alike
            if (albedo.w == SIGNAL_CAUGHT) passed += d.r;
            else is_caught = false;
        }
        if (d.a >= 0.0) {
            distance_ += min(d.a, 1e30);
            distances += 1.0;
        }
    }
    diffuse = finished(diffuse);
    specular = finished(specular);
    if (!is_first) {
        diffuse = all_samples(load_radiance(p.diffuse, at), diffuse);
        specular = all_samples(load_radiance(p.specular, at), specular);
    }
    store_radiance(p.diffuse, at, diffuse);
    store_radiance(p.specular, at, specular);
    if (is_first) FloatImage(p.distances).v[at] = distances > 0.0 ? distance_ / distances : SIGNAL_UNKNOWN;
    if (is_null(p.rest)) return;
    bool begins = p.starts != 0u && is_first;
    Rest before = begins ? NO_REST : load_rest(p.rest, at);
    RestParts past = begins ? NO_PARTS : load_parts(p.rest_parts, at);
    float samples = max(whole.samples, 1.0);
    parts = RestParts(parts.diffuse / samples, 0.0, parts.albedo / samples, 0.0, parts.specular / samples);
    Rest after = add_rest(before, whole.mean, whole.samples, covered / samples, passed / samples, is_caught);
    store_rest(p.rest, at, after);
    store_parts(p.rest_parts, at, add_parts(past, before, after, parts, covered / samples));
}
