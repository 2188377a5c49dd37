//! Tables of directional albedos: layers of `ALBEDO_SIZE` squared, rows by roughness.

records! {
    "albedo" values {
        /// Entries along cosine and along roughness, both from 0 to 1.
        ALBEDO_SIZE: uint = 64;
        /// Of GGX that reflects everything, by the stretched cosine.
        ALBEDO_GGX: uint = 0;
        /// Mean of `schlick_weight()` over what GGX reflects.
        ALBEDO_SCHLICK: uint = 1;
        /// Of Charlie.
        ALBEDO_SHEEN: uint = 2;
        /// Of Beckmann's microfacets that reflect everything, by the stretched cosine.
        ALBEDO_BECKMANN: uint = 3;
        /// Eight for each index of refraction, `DIELECTRIC_*` as seen from outside, then from inside.
        ALBEDO_DIELECTRIC: uint = 4;
        /// Of GGX microfacets with the exact Fresnel term F of a dielectric: reflected beyond the critical angle, over `ALBEDO_GGX`.
        DIELECTRIC_TOTAL: uint = 0;
        /// Reflected where there is refraction, over `ALBEDO_GGX`.
        DIELECTRIC_REFLECTED: uint = 1;
        /// Refracted, as if F were 0 where there is refraction.
        DIELECTRIC_OPEN: uint = 2;
        /// And what of that F takes away.
        DIELECTRIC_CLOSED: uint = 3;
        /// How many of these there are.
        DIELECTRIC_LAYERS: uint = 4;
    };
}
