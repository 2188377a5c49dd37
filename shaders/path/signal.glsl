// Paths of frames in real time keep apart what is filtered apart: the diffuse part of the first surface that scatters light, divided by its albedo, from the rest
// (src/interface/records/path.rs, SignalRecord). The parts add up to the path's radiance: no light is lost or counted twice.
//
// The division by the albedo keeps textures out of the filter (Schied et al., "Spatiotemporal Variance-Guided Filtering", HPG 2017). Which part a sampled direction's light belongs to is not
// decided by a lobe: it is split in the proportion in which the BSDF's lobes reflect it.
#ifndef PATH_SIGNAL
#define PATH_SIGNAL
#include "path/shading.glsl"
#include "common/frame.glsl"
#include "interface/bake.glsl"

// What a vertex is to its path.
struct SignalVertex {
    float phase;     // before it
    bool is_apart;   // its diffuse part is kept apart
    vec3 share;      // of light that comes from here: the diffuse part of the surface where it was apart, divided by the albedo
};

// Paths beside the one or few that each pixel has in a frame: indices of samples that those do not come to.
const uint LISTED_SAMPLES = 0x80000000u;

// The point of a surface at which the paths of a pixel begin (WITH_SURFACE_POINTS).
BakePoint path_point(BlockParams p, uint ray_index) {
    uvec2 pixel = block_pixel(p, pixel_index(ray_index)) + p.block_origin;
    return BakePoints(path_frame_params().points).v[pixel.y * p.image_size.x + pixel.x];
}

// Number of a path's pixel in the block. The pixels beyond the block's are of listed ones.
uint path_cell(uint ray_index) {
    uint pixel = pixel_index(ray_index);
    PathFrameParams p = path_frame_params();
    return WITH_SIGNAL && pixel >= p.cells ? Words(p.listed).v[pixel - p.cells >> p.listed_bits] : pixel;
}

// The index of a path in the sequence of its pixel.
uint path_sample(uint ray_index) {
    if (WITH_SURFACE_POINTS) return path_point(BlockParams(push.pass), ray_index).first_sample + sample_index(ray_index);
    PathFrameParams p = path_frame_params();
    if (!WITH_SIGNAL || pixel_index(ray_index) < p.cells) return sample_index(ray_index);
    uint bits = p.listed_bits + push.sample_bits, k = ray_index - (p.cells << push.sample_bits);
    return LISTED_SAMPLES | (push.sample_index << bits) + (k & (1u << bits) - 1u);
}

// The pixel of the image that a path belongs to. Frames in real time count the pixels that are sampled in a frame alone, so that neighbouring rays are of pixels that are close to each other.
uvec2 path_pixel(BlockParams p, uint ray_index) {
    if (WITH_SURFACE_POINTS) {
        // texels have sequences of samples as pixels have
        uint texel = path_point(p, ray_index).texel;
        return uvec2(texel & 0xffffu, texel >> 16);
    }
    uvec2 pixel = block_pixel(p, path_cell(ray_index)) + p.block_origin;
    return WITH_SIGNAL ? sampled_pixel(FrameParams(path_frame_params().frame), pixel) : pixel;
}

// Of light reflected by the BSDF's value f: the diffuse part divided by the albedo. w: its direction in the world.
vec3 diffuse_share(Shading m, vec3 wo, vec3 w, vec3 f) {
    return mix(bsdf_diffuse(m.bsdf, wo, to_frame(m.frame, w)) / f, vec3(0.0), equal(f, vec3(0.0)));
}

// A vertex whose surface reflects; notes its albedo if it is the first that scatters light.
SignalVertex signal_vertex(PathParams p, uint k, bool is_start, Shading m) {
    float phase = is_start ? SIGNAL_SEEN : load_signal(p, k, SIGNAL_ALBEDO).w;
    if (phase == SIGNAL_SCATTERED) return SignalVertex(phase, false, load_signal(p, k, SIGNAL_SHARE).rgb);
    if (!has_rough_part(m.bsdf)) return SignalVertex(phase, false, vec3(0.0));
    bool is_apart = phase == SIGNAL_SEEN;
    store_signal(p, k, SIGNAL_ALBEDO, vec4(is_apart ? m.bsdf.diffuse : vec3(0.0), SIGNAL_SCATTERED));
    return SignalVertex(phase, is_apart, vec3(0.0));
}

// The path goes on from a vertex by this sample. side: positive if it is reflected.
void signal_sampled(PathParams p, uint k, SignalVertex v, Shading m, vec3 wo, BsdfSample s, float side) {
    if (v.is_apart) {
        vec3 share = s.delta ? vec3(0.0) : diffuse_share(m, wo, s.wi, s.weight * s.pdf);
        store_signal(p, k, SIGNAL_SHARE, vec4(share, 0.0));
        // where a diffuse reflection's light comes from says nothing about what is reflected; no shadow ray has been traced yet
        bool is_reflection = side > 0.0 && highest(share * m.bsdf.diffuse) < 0.5;
        store_signal(p, k, SIGNAL_DIFFUSE, vec4(vec3(0.0), is_reflection ? SIGNAL_PENDING : SIGNAL_UNKNOWN));
    } else if (v.phase == SIGNAL_SEEN && side > 0.0 && m.bsdf.transmitted != vec3(0.0)) {
        // the G-buffer's rays go through glass
        store_signal(p, k, SIGNAL_ALBEDO, vec4(vec3(0.0), SIGNAL_ASIDE));
    }
}

// The share of what a path finds at the end of a ray, whose length it notes if it reflects what is there.
vec3 arrived_share(PathParams p, uint k, Hit hit) {
    if (load_signal(p, k, SIGNAL_ALBEDO).w != SIGNAL_SCATTERED) return vec3(0.0);
    vec4 diffuse = load_signal(p, k, SIGNAL_DIFFUSE);
    if (diffuse.w == SIGNAL_PENDING) store_signal(p, k, SIGNAL_DIFFUSE, vec4(diffuse.rgb, hit.t));
    return load_signal(p, k, SIGNAL_SHARE).rgb;
}

#endif
