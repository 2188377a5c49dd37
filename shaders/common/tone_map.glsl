// Tone mapping from radiance to display range, as src/output/tone_map.rs has it.
#ifndef COMMON_TONE_MAP
#define COMMON_TONE_MAP
#include "interface/tone_map.glsl"

vec3 neutral(vec3 c) {
    const float START = 0.8 - 0.04, DESATURATION = 0.15;
    float least = min(c.r, min(c.g, c.b));
    c -= least < 0.08 ? least - 6.25 * least * least : 0.04;
    float peak = max(c.r, max(c.g, c.b));
    if (peak < START) return c;
    float room = 1.0 - START;
    float new_peak = 1.0 - room * room / (peak + room - START);
    float grey = 1.0 - 1.0 / (DESATURATION * (peak - new_peak) + 1.0);
    return c * (new_peak / peak * (1.0 - grey)) + new_peak * grey;
}

vec3 agx(vec3 c) {
    const float MIN_STOPS = -12.47393, MAX_STOPS = 4.026069;
    // rows
    const vec3 INSET[3] = vec3[3](vec3(0.842479, 0.0784336, 0.07922375), vec3(0.042328242, 0.87846864, 0.07916613), vec3(0.042375655, 0.0784336, 0.879143));
    const vec3 OUTSET[3] = vec3[3](vec3(1.196879, -0.09802089, -0.09902974), vec3(-0.05289685, 1.1519031, -0.09896118), vec3(-0.052971635, -0.098043453, 1.1510737));
    vec3 x = vec3(dot(INSET[0], c), dot(INSET[1], c), dot(INSET[2], c));
    x = clamp((log2(max(x, vec3(1e-10))) - MIN_STOPS) / (MAX_STOPS - MIN_STOPS), 0.0, 1.0);
    x = ((((((15.5 * x - 40.14) * x + 31.96) * x - 6.868) * x + 0.4298) * x + 0.1191) * x) - 0.00232;
    x = vec3(dot(OUTSET[0], x), dot(OUTSET[1], x), dot(OUTSET[2], x));
    return pow(clamp(x, 0.0, 1.0), vec3(2.2));
}

// Maps one colour; negative and non-finite values count as 0.
vec3 tone_mapped(uint operator_, vec3 c) {
    for (uint k = 0u; k < 3u; k++) c[k] = c[k] > 0.0 && c[k] < 1e38 ? c[k] : 0.0;
    if (operator_ == TONE_MAP_EXPONENTIAL) return 1.0 - exp(-c);
    if (operator_ == TONE_MAP_REINHARD) return c / (1.0 + dot(c, vec3(0.2126, 0.7152, 0.0722)));
    if (operator_ == TONE_MAP_NEUTRAL) return neutral(c);
    if (operator_ == TONE_MAP_AGX) return agx(c);
    return c;
}

#endif
