// Colours of heat maps.
#ifndef COMMON_VIRIDIS
#define COMMON_VIRIDIS

// Viridis (Smith and van der Walt, 2015) by a polynomial of the sixth degree (Zucker, "Matplotlib colormaps", 2018): perceptually even, readable without
// colour vision. sRGB, 0 to 1.
vec3 viridis(float t) {
    const vec3 c0 = vec3(0.2777273, 0.0054073, 0.3340998), c1 = vec3(0.1050930, 1.4046135, 1.3845902), c2 = vec3(-0.3308618, 0.2148476, 0.0950952);
    const vec3 c3 = vec3(-4.6342305, -5.7991010, -19.3324410), c4 = vec3(6.2282699, 14.1799334, 56.6905526);
    const vec3 c5 = vec3(4.7763850, -13.7451454, -65.3530326), c6 = vec3(-5.4354559, 4.6458526, 26.3124352);
    return clamp(c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6))))), 0.0, 1.0);
}

#endif
