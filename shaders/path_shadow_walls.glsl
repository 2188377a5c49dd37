// path_shadow_walls: path_shadow where there are thin walls without roughness, which light goes straight through: what is left of the light goes on
// behind the wall, in a queue of its own.
// stream: closest
// rays: queue
#include "path/path.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

void closest(uint index, Hit hit) {
    PathParams p = PathParams(BlockParams(push.pass).path);
    uint k = Words(p.shadow.tags).v[index];
    vec4 c = load_quad(p.contributions, index);
    if (!is_hit(hit)) {
        store_quad(p.radiance, k, load_quad(p.radiance, k) + c);
        return;
    }
    Ray r = load_ray(push.rays, index - push.first);
    Surface s = surface_at(r, hit);
    Shading m = shade(s, -r.direction, SHARP);
    c.rgb *= straight_transmittance(m, -r.direction);
    if (!(highest(c.rgb) > 0.0)) return;
    if (HAS_COVERAGE) next_ray_seed = hash(floatBitsToUint(r.tmin));
    uint slot = append_ray(p.later, Ray(s.position - m.ng * s.offset, 0.0, r.direction, (r.tmax - hit.t) * (1.0 - SHADOW_EPSILON)), k);
    store_quad(p.later_contributions, slot, c);
}
