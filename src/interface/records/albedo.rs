//! Tables of directional albedos: layers of `ALBEDO_SIZE` squared, rows by roughness.

records! {
    "albedo" values {
        /// Entries along cosine and along roughness, both from 0 to 1.
        ALBEDO_SIZE: uint = 64;
        /// Layer: albedo of perfectly reflecting GGX microfacets, by the stretched cosine.
        ALBEDO_GGX: uint = 0;
        /// Layer: mean of `schlick_weight()` over what GGX reflects.
        ALBEDO_SCHLICK: uint = 1;
        /// Layer: albedo of Charlie sheen.
        ALBEDO_SHEEN: uint = 2;
        /// Layer: albedo of perfectly reflecting Beckmann microfacets, by the stretched cosine.
        ALBEDO_BECKMANN: uint = 3;
        /// First of eight layers per index of refraction: `DIELECTRIC_*` from outside, then inside.
        ALBEDO_DIELECTRIC: uint = 4;
        /// GGX microfacets with a dielectric's exact Fresnel term: light reflected beyond the
        /// critical angle, over `ALBEDO_GGX`.
        DIELECTRIC_TOTAL: uint = 0;
        /// Light reflected below the critical angle, over `ALBEDO_GGX`.
        DIELECTRIC_REFLECTED: uint = 1;
        /// Light refracted if F were 0 below the critical angle.
        DIELECTRIC_OPEN: uint = 2;
        /// Share of `DIELECTRIC_OPEN` that F removes.
        DIELECTRIC_CLOSED: uint = 3;
        /// Number of `DIELECTRIC_*` layers.
        DIELECTRIC_LAYERS: uint = 4;
    };
}
