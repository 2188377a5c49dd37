// bsdf_probe: traces nothing; writes what the BSDF of a submesh's material makes of given directions, so that a test can hold density, samples and
// values to each other on every tracer and driver.
#include "path/path.glsl"
#include "interface/ray_set.glsl"

// inputs: three quads each: towards the viewer, and the submesh; wi, or where to sample and which lobe; shading normal, and 1 to sample
// outputs: three quads each: value times |cos|, density; wi, 1 for a delta lobe; weight, eta

Ray ray(uint index) { return no_ray(); }

// About a geometric normal of z. Directions are the world's.
void any(uint index, bool occluded) {
    Probe probe = Probe(push.pass);
    uvec4 a = Quads(probe.inputs).v[3u * index], b = Quads(probe.inputs).v[3u * index + 1u], c = Quads(probe.inputs).v[3u * index + 2u];
    vec3 viewer = uintBitsToFloat(a.xyz), given = uintBitsToFloat(b.xyz);
    Surface s;
    s.position = vec3(0.0);
    s.ng = vec3(0.0, 0.0, 1.0);
    s.ns = uintBitsToFloat(c.xyz);
    s.offset = 0.0;
    s.submesh = a.w;
    s.tlas_instance = 0u;
    s.primitive = SubmeshRecords(SceneRoot(push.scene).submeshes).v[a.w].first_primitive;
    s.uv = vec2(1.0 / 3.0);
    Shading m = shade(s, viewer, SHARP);
    vec3 wo = to_frame(m.frame, viewer);
    wo.z = max(wo.z, MIN_COSINE);
    BsdfSample sampled = BsdfSample(given, vec3(0.0), 0.0, false, 1.0);
    if (c.w != 0u) sampled = sample_direction(m, wo, given.xy, given.z);
    BsdfValue value = vertex_at(m, wo, sampled.wi);
    store_quad(probe.outputs, 3u * index, vec4(value.f, c.w != 0u ? sampled.pdf : value.pdf));
    store_quad(probe.outputs, 3u * index + 1u, vec4(sampled.wi, sampled.delta ? 1.0 : 0.0));
    store_quad(probe.outputs, 3u * index + 2u, vec4(sampled.weight, sampled.eta));
}
