//! What the path tracer knows of a material.

use super::super::features::TextureFeature;
use super::scene::TextureUse;

records! {
    "shading" includes "scene";

    /// A material as paths shade it. Factors are linear.
    ShadingRecord: array ShadingRecords readonly 16 {
        /// Radiance.
        emission: vec3,
        /// One of `BSDF_*`; `BSDF_NONE` of unlit materials.
        model: uint,
        /// 0 to 1.
        metallic: float,
        /// 0 to 1, before it is squared.
        roughness: float,
        /// Index of refraction.
        ior: float,
        /// KHR_materials_specular.
        specular: float,
        /// Of mirror, glass, conductor: factor of what is reflected.
        specular_color: vec3,
        /// 1: emits from both sides.
        emits_back: uint,
        /// Of a conductor: real part of its index of refraction.
        eta: vec3,
        /// KHR_materials_transmission.
        transmission: float,
        /// Of a conductor: imaginary part of its index of refraction.
        k: vec3,
        /// KHR_materials_clearcoat.
        clearcoat: float,
        /// Of glass: factor of what is refracted.
        transmitted: vec3,
        /// As `roughness`.
        clearcoat_roughness: float,
        /// KHR_materials_sheen.
        sheen_color: vec3,
        /// As `roughness`.
        sheen_roughness: float,
        /// Attenuation per world unit in the volume.
        absorption: vec3,
        /// One of `WALLS_*`.
        walls: uint,
        /// Strength times cosine and sine of its angle from the tangent.
        anisotropy: vec2,
        /// Of the normal map.
        normal_scale: float,
        /// Of the clearcoat's normal map.
        clearcoat_normal_scale: float,
        /// Of the albedo tables: its place among the indices of refraction.
        glass_layer: uint,
        /// Of a volume among those that overlap (path/media.glsl).
        priority: int,
        /// Of the reflection model; what they are, its file in shaders/bsdf says.
        parameters: vec2,
        /// Its textures beside the base colour's, by `TextureFeature`.
        uses: TextureUse[TextureFeature::ALL.len()],
    }
}
