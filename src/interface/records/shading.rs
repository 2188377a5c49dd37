//! Material records of the path tracer.

use super::super::features::TextureFeature;
use super::scene::TextureUse;

records! {
    "shading" includes "scene";

    /// A material for path tracing. Factors are linear.
    ShadingRecord: Array(buffer: "ShadingRecords", access: "readonly", align: 16) {
        /// Emitted radiance, linear RGB.
        emission: vec3,
        /// One of `BSDF_*`; `BSDF_NONE` of unlit materials.
        model: uint,
        /// Metallic factor, 0 to 1.
        metallic: float,
        /// Perceptual roughness, 0 to 1: alpha is its square.
        roughness: float,
        /// Index of refraction.
        ior: float,
        /// Specular factor (KHR_materials_specular).
        specular: float,
        /// Mirror, glass, conductor: factor of reflected light.
        specular_color: vec3,
        /// 1: emits from both sides.
        emits_back: uint,
        /// Conductor: real part of its index of refraction, by channel.
        eta: vec3,
        /// Transmission factor (KHR_materials_transmission).
        transmission: float,
        /// Conductor: imaginary part of its index of refraction, by channel.
        k: vec3,
        /// Clearcoat factor (KHR_materials_clearcoat).
        clearcoat: float,
        /// Glass: factor of refracted light.
        transmitted: vec3,
        /// Perceptual roughness of the clearcoat, 0 to 1.
        clearcoat_roughness: float,
        /// Sheen colour (KHR_materials_sheen).
        sheen_color: vec3,
        /// Perceptual roughness of the sheen, 0 to 1.
        sheen_roughness: float,
        /// Coefficient by which the volume attenuates light, per scene unit: what it absorbs and
        /// what it scatters.
        absorption: vec3,
        /// One of `WALLS_*`: transmission mode.
        walls: uint,
        /// Anisotropy strength times the cosine and sine of its angle from the tangent.
        anisotropy: vec2,
        /// Scale of the normal map.
        normal_scale: float,
        /// Scale of the clearcoat's normal map.
        clearcoat_normal_scale: float,
        /// Index of its index of refraction in the albedo tables.
        glass_layer: uint,
        /// Priority among overlapping volumes (path/media.glsl).
        priority: int,
        /// Further parameters of the reflection model; its file in shaders/bsdf says what they are.
        parameters: vec2,
        /// Strength of the occlusion texture, 0 to 1.
        occlusion_strength: float,
        /// Iridescence factor (KHR_materials_iridescence).
        iridescence: float,
        /// Thickness of the thin film where its texture is 0 and where it is 1, nanometres.
        iridescence_thickness: vec2,
        /// Colour of light that is transmitted diffusely (KHR_materials_diffuse_transmission).
        diffuse_transmission_color: vec3,
        /// Diffuse transmission factor.
        diffuse_transmission: float,
        /// Index of refraction of the thin film.
        iridescence_ior: float,
        /// Retroreflection factor (KHR_materials_retroreflection).
        retroreflection: float,
        /// How fast the index of refraction falls with the wavelength, in square micrometres
        /// (shaders/path/wavelength.glsl).
        dispersion: float,
        /// Mean cosine of the angle by which the volume scatters light, -1 to 1.
        scatter_anisotropy: float,
        /// Share of the light which the volume takes out of a ray that it scatters and does not
        /// absorb.
        scattered: vec3,
        /// Padding to a multiple of 16 bytes.
        reserved: uint,
        /// Textures other than the base colour's, indexed by `TextureFeature`.
        uses: TextureUse[TextureFeature::ALL.len()],
    }
}
