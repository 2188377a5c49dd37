// Where in a pixel, or around it, a sample of the film lies.
#ifndef COMMON_PIXEL_FILTER
#define COMMON_PIXEL_FILTER
#include "common/warp.glsl"
#include "interface/pixel_filter.glsl"

const float BLACKMAN_HARRIS_RADIUS = 1.5;

// Share of Blackman and Harris' window (four terms) below x, which goes over it from 0 to 1.
float blackman_harris_share(float x) {
    const float TURN = 6.28318530718;
    float s1 = on_circle(x).y, s2 = on_circle(fract(2.0 * x)).y, s3 = on_circle(fract(3.0 * x)).y;
    return x + (-0.48829 * s1 + 0.5 * 0.14128 * s2 - 0.01168 / 3.0 * s3) / (0.35875 * TURN);
}

// Offset from the centre of a pixel, distributed as the filter.
float filter_offset(uint pixel_filter, float u) {
    if (pixel_filter == FILTER_TENT) return u < 0.5 ? sqrt(2.0 * u) - 1.0 : 1.0 - sqrt(2.0 - 2.0 * u);
    if (pixel_filter == FILTER_BLACKMAN_HARRIS) {
        // the share grows with x: halve to the last bit that matters
        float low = 0.0, high = 1.0;
        for (int k = 0; k < 20; k++) {
            float middle = 0.5 * (low + high);
            if (blackman_harris_share(middle) < u) low = middle;
            else high = middle;
        }
        return (low + high - 1.0) * BLACKMAN_HARRIS_RADIUS;
    }
    return pixel_filter == FILTER_CENTRE ? 0.0 : u - 0.5;
}

vec2 filter_offset(uint pixel_filter, vec2 u) {
    return vec2(filter_offset(pixel_filter, u.x), filter_offset(pixel_filter, u.y));
}

#endif
