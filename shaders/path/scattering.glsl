// Random walks through volumes that scatter (KHR_materials_volume_scatter): how far light gets before particles send it another way. Surfaces around a volume hide
// lights from what is inside, so nothing samples lights on the way: what a walk meets counts in full.
#ifndef PATH_SCATTERING
#define PATH_SCATTERING
#include "path/media.glsl"

bool scatters(uint medium) { return HAS_SCATTERING && medium != NO_MEDIUM && highest(SHADING_OF(medium).scattered) > 0.0; }

// A distance in a volume.
struct FreeFlight {
    float length_;
    bool is_scattered;  // before the ray's end
    vec3 weight;        // of the throughput, over the density of the distance
};

// Samples the distance by one channel, chosen by what it is worth; weighed by the mean density of all (balance heuristic, Veach 1997), so that no channel's weight
// exceeds 1 over its probability. u: two numbers in [0, 1).
FreeFlight free_flight(uint medium, vec3 throughput, float end, vec2 u) {
    vec3 attenuation = SHADING_OF(medium).absorption, albedo = SHADING_OF(medium).scattered;
    // what is black after this scattering is not worth sampling, but what passes is
    vec3 worth = throughput * (albedo + 0.05);
    worth /= worth.r + worth.g + worth.b;
    float chosen = u.y < worth.r ? attenuation.r : u.y < worth.r + worth.g ? attenuation.g : attenuation.b;
    float length_ = chosen > 0.0 ? -log(1.0 - u.x) / chosen : INFINITY;
    if (length_ < end) {
        vec3 density = attenuation * exp(-attenuation * length_);
        return FreeFlight(length_, true, density * albedo / dot(worth, density));
    }
    vec3 passes = mix(exp(-attenuation * end), vec3(1.0), equal(attenuation, vec3(0.0)));
    return FreeFlight(end, false, passes / max(dot(worth, passes), 1e-30));
}

// A direction after scattering (Henyey and Greenstein 1941); w: that before.
vec3 scattered_direction(vec3 w, float g, vec2 u) {
    float cosine = 1.0 - 2.0 * u.x;
    if (abs(g) > 1e-3) {
        float s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u.x);
        cosine = clamp((1.0 + g * g - s * s) / (2.0 * g), -1.0, 1.0);
    }
    return normalize(from_frame(frame_about(w), vec3(on_circle(u.y) * sqrt(1.0 - cosine * cosine), cosine)));
}

#endif
