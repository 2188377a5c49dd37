// compose: the radiance of each pixel, of the filtered parts and of what is seen directly.
#include "common/radiance.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    ComposeParams p = ComposeParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    vec4 c = load_quad(p.direct, at);
    if (is_surface(LOAD_PAIR(f.guide, at))) {
        vec3 albedo = load_quad(p.materials, at).rgb;
        c.rgb += albedo * load_radiance(p.diffuse, at).mean + load_radiance(p.specular, at).mean;
    }
    store_quad(p.composed, at, c);
}
