// Fibres that stand on a surface (KHR_materials_sheen): Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF", 2017. Part of
// bsdf/gltf.glsl.
#ifndef BSDF_SHEEN
#define BSDF_SHEEN

const float MIN_SHEEN_ALPHA = 1e-3;

// Charlie's distribution by the sine of the microfacet's normal.
float charlie(float alpha, float cos_m) {
    float s = sqrt(max(1.0 - cos_m * cos_m, 0.0)), inverse = 1.0 / alpha;
    return s > 0.0 ? (2.0 + inverse) * exp(log(s) * inverse) / (2.0 * PI) : 0.0;
}

// Fit of the paper's Smith term below one half.
float charlie_curve(float x, float alpha) {
    float t = sqr(1.0 - alpha);
    float a = mix(21.5473, 25.3245, t), b = mix(3.82987, 3.32435, t), c = mix(0.19823, 0.16801, t);
    float d = mix(-1.97760, -1.27393, t), e = mix(-4.32054, -4.85967, t);
    return a / (1.0 + b * exp(log(max(x, 1e-9)) * c)) + d * x + e;
}

float charlie_lambda(float cos_w, float alpha) {
    return cos_w < 0.5 ? exp(charlie_curve(cos_w, alpha)) : exp(2.0 * charlie_curve(0.5, alpha) - charlie_curve(1.0 - cos_w, alpha));
}

// Value times |cos wi|.
vec3 sheen_value(Sheen sheen, vec3 wo, vec3 wi) {
    vec3 m = normalize(wo + wi);
    float g = 1.0 / (1.0 + charlie_lambda(wo.z, sheen.alpha) + charlie_lambda(wi.z, sheen.alpha));
    return sheen.color * (charlie(sheen.alpha, m.z) * g / (4.0 * wo.z));
}

// Transmittance of the sheen layer to the layers below, by the cosine of the light's or the viewer's direction.
float sheen_kept(Sheen sheen, float cosine) {
    return 1.0 - highest(sheen.color) * min(albedo(ALBEDO_SHEEN, sqrt(max(cosine, 0.0)), sqrt(sheen.alpha)), 1.0);
}

#endif
