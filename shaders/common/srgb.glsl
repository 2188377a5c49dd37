// The transfer function of sRGB (IEC 61966-2-1), as src/colour.rs has it.
#ifndef COMMON_SRGB
#define COMMON_SRGB

// A linear value in [0, 1] to a coded one in [0, 1].
float srgb_encode(float linear) {
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1.0 / 2.4) - 0.055;
}

// The inverse.
vec3 srgb_decode(vec3 coded) {
    return mix(coded / 12.92, pow((coded + 0.055) / 1.055, vec3(2.4)), greaterThan(coded, vec3(0.04045)));
}

#endif
