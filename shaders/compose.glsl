// compose: the radiance of each pixel, of the filtered parts and of what is seen directly.
#include "common/rest_parts.glsl"
#include "interface/radiance.glsl"

layout(local_size_x = LANES) in;

void main() {
    uint at = push.first + gl_GlobalInvocationID.x;
    if (gl_GlobalInvocationID.x >= push.count) return;
    ComposeParams p = ComposeParams(push.pass);
    FrameParams f = FrameParams(p.frame);
    vec4 c = load_quad(p.direct, at);
    bool is_filtered = is_surface(LOAD_PAIR(f.guide, at));
    Rest rest = is_null(p.rest) ? NO_REST : load_rest(p.rest, at);
    if (rest.frames > 0.0) {
        // albedo and what is seen directly are means over all samples, too; where this frame's sample shows background, nothing has been filtered
        RestParts parts = load_parts(p.rest_parts, at);
        c = vec4(rest.mean, rest.coverage);
        if (is_filtered) c.rgb = direct_part(rest, parts) + parts.albedo * load_radiance(p.diffuse, at).mean + rest.coverage * load_radiance(p.specular, at).mean;
        if (HAS_CATCHER) c.a -= is_filtered && rest.is_caught ? rest.coverage * load_radiance(p.diffuse, at).mean.r : rest.passed;
    } else if (is_filtered) {
        vec3 albedo = load_quad(p.materials, at).rgb;
        vec3 diffuse = load_radiance(p.diffuse, at).mean;
        c.rgb += albedo * diffuse + load_radiance(p.specular, at).mean;
        // a catcher covers by the light that it does not get
        if (HAS_CATCHER && c.a == COVERS_CAUGHT) c.a = 1.0 - diffuse.r;
    }
    store_quad(p.composed, at, c);
}
