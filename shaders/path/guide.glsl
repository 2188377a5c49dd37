// The G-buffer of frames of radiance: the first surface behind each pixel that scatters light, seen directly or by mirrors and glass.
//
// What a flat mirror shows is a rigid copy of the scene behind it. The G-buffer has the surface where it seems to be, so that reprojection and edge tests work on
// it as on surfaces seen directly. Glass is looked through, and refraction moves nothing: an approximation, which costs history, not truth.
#ifndef PATH_GUIDE
#define PATH_GUIDE
#include "common/frame.glsl"
#include "interface/radiance.glsl"
#include "path/known_hit.glsl"
#include "path/uncovered.glsl"
#include "path/path.glsl"
#include "scene/motion.glsl"

// A ray of the G-buffer on its way.
struct GuideRay {
    vec3 mirrored[3];  // rows of the product of reflections so far, which takes directions from where things are to where they seem to be
    float far;         // distance from the camera, scene units
    uint bounces;
    bool is_uncovered; // its pixel shows a surface that the previous image did not show
};

const GuideRay GUIDE_START = GuideRay(vec3[3](vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0)), 0.0, 0u, false);
const uint GUIDE_QUADS = GUIDE_RAY_RECORD_PAIRS / 2u;
// A number of evenly distributed ones that selects transmission where there is any.
const float TRANSMITTED = 0.99999994;

vec3 where_it_seems(GuideRay g, vec3 v) { return vec3(dot(g.mirrored[0], v), dot(g.mirrored[1], v), dot(g.mirrored[2], v)); }

GuideRay load_guide_ray(SurfacesParams q, uint k) {
    GuideRay g;
    vec4 rows[3];
    [[unroll]] for (uint row = 0u; row < 3u; row++) {
        rows[row] = load_quad(q.states, GUIDE_QUADS * k + row);
        g.mirrored[row] = rows[row].xyz;
    }
    g.far = rows[0].w;
    g.bounces = floatBitsToUint(rows[1].w);
    g.is_uncovered = rows[2].w != 0.0;
    return g;
}

void store_guide_ray(SurfacesParams q, uint k, GuideRay g) {
    store_quad(q.next_states, GUIDE_QUADS * k, vec4(g.mirrored[0], g.far));
    store_quad(q.next_states, GUIDE_QUADS * k + 1u, vec4(g.mirrored[1], uintBitsToFloat(g.bounces)));
    store_quad(q.next_states, GUIDE_QUADS * k + 2u, vec4(g.mirrored[2], g.is_uncovered ? 1.0 : 0.0));
}

// Roughness by which reflections are judged: 0 for mirrors, 1 for surfaces that reflect diffusely only.
float reflection_roughness(Bsdf b) {
    if (b.kind == BSDF_DIFFUSE || b.kind == BSDF_OREN_NAYAR || b.kind == BSDF_NONE) return 1.0;
    float alpha = max(b.facets.alpha.x, b.facets.alpha.y);
    if (HAS_CLEARCOAT && b.clearcoat.weight > 0.0) alpha = min(alpha, max(b.clearcoat.facets.alpha.x, b.clearcoat.facets.alpha.y));
    return sqrt(clamp(alpha, 0.0, 1.0));
}

// What a camera ray sees that meets no surface.
vec3 background(PathParams p, vec3 w) {
    if (WITH_CONSTANT_ALBEDO) return vec3(0.0);
    if (WITH_BACKGROUND) return counted_radiance(p, background_radiance(p, w), 0u);
    vec3 c = environment_radiance(p, w);
    PathState start = PathState(vec3(1.0), -1.0, 0u, 0u, 0u, false, 1.0, NO_MEDIUM);
    if (WITH_DISTANT_DISKS) c += disks_met(p, start, 1.0, w);
    return counted_radiance(p, c, 0u);
}

// The surface that a pixel shows is known: counts it, and lists the pixel where the previous image did not show it.
void list_surface(FrameParams f, SurfacesParams q, uint at, bool is_uncovered) {
    if (is_null(q.list)) return;
    uvec2 pixel = image_pixel(f, at);
    if (!is_sampled(f, pixel)) return;
    PixelList list = PixelList(q.list);
    uint k = tile_index(pixel / pattern_cell(f), q.tiles_x);
    if (k % LIST_PART == 0u) atomicAdd(list.v[1], 1u);
    if (is_uncovered) list.v[2u + atomicAdd(list.v[0], 1u)] = k;
}

// One vertex of a pixel's ray: writes the G-buffer, or continues.
void guide_vertex(BlockParams block, uint at, GuideRay g, Ray ray, Hit hit) {
    SurfacesParams q = SurfacesParams(behind_block(0u));
    FrameParams f = FrameParams(q.frame);
    PathParams p = PathParams(q.path);
    if (g.bounces == 0u && !is_null(q.known_hits)) store_known_hit(q.known_hits, at, hit);
    if (!is_hit(hit)) {
        // behind mirrors the last one is what the pixel shows
        if (g.bounces > 0u) {
            list_surface(f, q, at, g.is_uncovered);
            return;
        }
        STORE_PAIR(f.guide, at, uvec2(floatBitsToUint(INFINITY), 0u));
        store_quad(q.direct, at, vec4(background(p, ray.direction), 0.0));
        return;
    }
    Surface s = surface_at(ray, hit);
    vec3 towards_viewer = -ray.direction;
    Shading m;
    bool is_caught = WITH_CATCHER && g.bounces == 0u && load_submesh_record(SceneRoot(push.scene).submeshes, s.submesh).material == p.catcher;
    if (WITH_CONSTANT_ALBEDO || is_caught) m = grey_shading(s, towards_viewer, p.albedo);
    else m = shade(s, towards_viewer, SHARP);
    // what is behind a catcher takes the place of its albedo
    if (is_caught) m.bsdf.diffuse = background(p, ray.direction);
    g.far += hit.t * length(ray.direction);
    if (g.bounces == 0u) store_quad(q.direct, at, vec4(counted_radiance(p, m.emission, 0u), is_caught ? COVERS_CAUGHT : 1.0));
    bool scatters = m.bsdf.kind == BSDF_NONE || has_rough_part(m.bsdf);

    // the point where it seems to be, now and in the previous frame
    vec3 position = s.position, before = previous_position(hit, s) - s.position;
    if (g.bounces > 0u) {
        uvec2 pixel = image_pixel(f, at);
        Ray first = camera_ray(block, vec2(pixel) + 0.5 + block.centre_offset);
        position = first.origin + first.direction * g.far;
        before = where_it_seems(g, before);
    }
    vec4 back = f.world_to_camera[2];
    float depth = -(dot(back.xyz, position) + back.w);
    vec3 normal = where_it_seems(g, m.frame.n);
    uvec2 guide = make_guide(depth, normal, hit.instance + 0x10001u * g.bounces);
    STORE_PAIR(f.guide, at, guide);
    vec3 ng = where_it_seems(g, m.ng);
    store_surface(f, at, position, s.offset, ng);
    if (!is_null(f.previous_position)) {
        FloatImage previous = FloatImage(f.previous_position);
        for (uint k = 0u; k < 3u; k++) previous.v[3u * at + k] = position[k] + before[k];
    }
    store_quad(q.materials, at, vec4(m.bsdf.diffuse, scatters ? reflection_roughness(m.bsdf) : 0.0));
    if (!is_null(q.list)) g.is_uncovered = is_uncovered(f, position + before, ng, guide);
    bool goes_on = !scatters && g.bounces < MAX_GUIDE_BOUNCES && !is_null(q.states);
    vec3 w = vec3(0.0);
    if (goes_on) {
        vec3 wo = to_frame(m.frame, towards_viewer);
        wo.z = max(wo.z, MIN_COSINE);
        BsdfSample b = bsdf_sample(m.bsdf, wo, vec2(0.5), TRANSMITTED);
        if (b.pdf > 0.0) w = normalize(from_frame(m.frame, b.wi));
    }
    float side = dot(m.ng, w);
    if (side == 0.0) {
        list_surface(f, q, at, g.is_uncovered);
        return;
    }
    if (side > 0.0) {
        vec3 n = m.frame.n;
        [[unroll]] for (uint row = 0u; row < 3u; row++) g.mirrored[row] -= 2.0 * dot(g.mirrored[row], n) * n;
    }
    g.bounces++;
    uint slot = append_ray(q.next, Ray(s.position + m.ng * (sign(side) * s.offset), 0.0, w, INFINITY), at);
    store_guide_ray(q, slot, g);
}

#endif
