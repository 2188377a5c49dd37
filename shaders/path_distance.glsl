// path_distance: the distance to the nearest hit of each ray of ambient light, in place of the light that it would add (src/integrators/path/ambient.rs).
#include "path/params.glsl"

Ray ray(uint index) {
    return load_ray(push.rays, index - push.first);
}

// What a sample leaves in its path's memory: the reflectance of its surface, and the distance; infinite if nothing was hit.
void closest(uint index, Hit hit) {
    PathParams p = path_params();
    uint k = Words(p.shadow.tags).v[index];
    store_quad(p.radiance, k, vec4(load_quad(p.contributions, index).rgb, hit.t));
}
