// rest: adds this frame's samples of ambient visibility to those since the image came to rest (common/rest.glsl).
#include "common/rest.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    RestParams p = RestParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    Rest rest = NO_REST;
    if (p.starts == 0u) rest = load_rest(p.rest, at);
    uvec2 pixel = image_pixel(f, at);
    if (is_sampled(f, pixel)) {
        if (is_surface(LOAD_PAIR(f.guide, at))) {
            Estimate e = unpack_estimate(LOAD_PAIR(p.current, at));
            bool caught = is_catcher(f.normals, at);
            rest = add_rest(rest, vec3(e.mean), e.samples, 1.0, caught ? e.mean : 0.0, caught);
        } else {
            rest = add_rest(rest, vec3(0.0), float(f.rays_per_pixel), 0.0, 0.0, false);
        }
    }
    store_rest(p.rest, at, rest);
}
