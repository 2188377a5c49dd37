// path_shadow_walls: path_shadow for scenes with smooth thin walls, through which light passes straight: the attenuated shadow ray continues
// behind the wall, in another queue.
#include "path/path.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

void closest(uint index, Hit hit) {
    PathParams p = path_params();
    uint k = Words(p.shadow.tags).v[index];
    vec4 c = load_quad(p.contributions, index);
    if (!is_hit(hit)) {
        store_quad(p.radiance, k, load_quad(p.radiance, k) + c);
        if (WITH_SIGNAL) add_diffuse(p, k, load_quad(p.diffuse_contributions, index).rgb);
        return;
    }
    Ray r = load_ray(push.rays, index - push.first);
    Surface s = surface_at(r, hit);
    Shading m = shade(s, -r.direction, SHARP);
    vec3 through = straight_transmittance(m, -r.direction);
    c.rgb *= through;
    if (!(highest(c.rgb) > 0.0)) return;
    Ray behind = Ray(s.position - m.ng * s.offset, 0.0, r.direction, INFINITY);
    if (r.tmax < INFINITY) {
        // to the same point: a ray that starts a little beside would end a little elsewhere, and perhaps meet the light itself
        vec3 to = r.origin + r.tmax * r.direction - behind.origin;
        float d = length(to);
        behind.direction = to / d;
        behind.tmax = d * (1.0 - SHADOW_EPSILON);
        // the wall hides nothing that is nearer than rounding
        if (dot(behind.direction, r.direction) <= 0.0) behind = no_ray();
    }
    if (HAS_COVERAGE) next_ray_seed = hash(floatBitsToUint(r.tmin));
    uint slot = append_ray(p.later, behind, k);
    store_quad(p.later_contributions, slot, c);
    if (WITH_SIGNAL) store_quad(p.later_diffuse_contributions, slot, load_quad(p.diffuse_contributions, index) * vec4(through, 0.0));
}
