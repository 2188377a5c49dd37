// path_shadow: shadow rays from path vertices to lights; the contribution of an unoccluded light is added to its path.
#include "path/params.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

void any(uint index, bool occluded) {
    if (occluded) return;
    PathParams p = path_params();
    uint k = Words(p.shadow.tags).v[index];
    store_quad(p.radiance, k, load_quad(p.radiance, k) + load_quad(p.contributions, index));
    if (!is_null(p.diffuse_contributions)) add_diffuse(p, k, load_quad(p.diffuse_contributions, index).rgb);
}
