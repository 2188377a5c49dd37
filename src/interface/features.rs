//! Sets of features that scenes and options require of the path tracer's shaders. Code of a feature
//! that is not in its set is specialized out. A set is stored in as many 32-bit specialization
//! constants as it needs; a feature is a `bool` in the shaders.

use super::constants::{self, Constant};
use super::enumerations::Texels;
use super::path_options::{PATH, PathFeatures};

/// A set, as its GLSL constants are generated from it.
pub(super) struct Declaration {
    /// Name of its file in interface/, and in upper case the prefix of its words.
    pub name: &'static str,
    /// `constant_id` of the first word.
    pub first_id: u32,
    /// All features are in the set when the host does not specialize it.
    pub is_full: bool,
    /// In the shaders a feature is a number, to be looked up in the set, and not a `bool`.
    pub is_indexed: bool,
    /// Names in the shaders, and what they mean.
    pub features: &'static [(&'static str, &'static str)],
}

/// Declares a set and the features that it may hold, each with its name in shaders and its label.
macro_rules! feature_set {
    (
        $(#[doc = $set_doc:literal])*
        $set:ident of $(#[doc = $feature_doc:literal])* $feature:ident: $file:literal, from $first:expr, full $is_full:literal, indexed $is_indexed:literal, $declaration:ident;
        $($variant:ident = $name:literal, $label:literal;)*
    ) => {
        $(#[doc = $feature_doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[allow(missing_docs, reason = "label() says what each is")]
        pub enum $feature {
            $($variant,)*
        }

        impl $feature {
            /// All of them, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)*];

            /// Name for people.
            pub fn label(self) -> &'static str {
                match self {
                    $(Self::$variant => $label,)*
                }
            }
        }

        $(#[doc = $set_doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct $set {
            words: [u32; Self::WORDS],
        }

        impl $set {
            pub(super) const WORDS: usize = $feature::ALL.len().div_ceil(32);

            /// Is it in the set?
            pub fn contains(self, feature: $feature) -> bool {
                self.words[feature as usize / 32] >> (feature as u32 % 32) & 1 == 1
            }

            /// Adds it.
            pub fn insert(&mut self, feature: $feature) {
                self.words[feature as usize / 32] |= 1 << (feature as u32 % 32);
            }

            /// Adds it if `required`.
            pub fn insert_if(&mut self, required: bool, feature: $feature) {
                if required {
                    self.insert(feature);
                }
            }

            /// Returns true if all of it is in `other`, too.
            pub fn is_subset(self, other: Self) -> bool {
                self.words.iter().zip(other.words).all(|(own, other)| own & !other == 0)
            }

            /// The specialization constants of the set, with their values.
            pub fn constants(self) -> impl Iterator<Item = (Constant, u32)> {
                self.words.into_iter().zip($first..).map(|(word, id)| (Constant { id }, word))
            }

            /// Labels of the features that are in the set, and of those that are not.
            pub fn labels(self) -> [Vec<&'static str>; 2] {
                [true, false].map(|there| {
                    $feature::ALL.iter().filter(|&&f| self.contains(f) == there).map(|f| f.label()).collect()
                })
            }
        }

        impl FromIterator<$feature> for $set {
            fn from_iter<I: IntoIterator<Item = $feature>>(features: I) -> Self {
                let mut set = Self::default();
                features.into_iter().for_each(|f| set.insert(f));
                set
            }
        }

        pub(super) const $declaration: Declaration =
            Declaration { name: $file, first_id: $first, is_full: $is_full, is_indexed: $is_indexed, features: &[$(($name, $label),)*] };
    };
}

pub(super) use feature_set;

const BSDF_FIRST: u32 = constants::ALL.len() as u32;
const MATERIAL_FIRST: u32 = BSDF_FIRST + BsdfModels::WORDS as u32;
const TEXTURE_FIRST: u32 = MATERIAL_FIRST + MaterialFeatures::WORDS as u32;
/// `constant_id` of the first word of [`PathFeatures`].
pub(super) const PATH_FIRST: u32 = TEXTURE_FIRST + TextureFeatures::WORDS as u32;
const LIGHT_FIRST: u32 = PATH_FIRST + PathFeatures::WORDS as u32;

feature_set! {
    /// The reflection models of a scene's materials.
    BsdfModels of /// A reflection model: `HAS_NAME` stands for `shaders/bsdf/name.glsl`, which defines
    /// functions `name_setup`, `name_eval` and so on, as shaders/bsdf/bsdf.glsl describes them.
    /// The functions that dispatch to them are generated from this list ([`super::glsl`]).
    BsdfModel: "bsdf_models", from BSDF_FIRST, full true, indexed false, BSDF;
    Gltf = "HAS_GLTF", "metallic-roughness";
    Diffuse = "HAS_DIFFUSE", "Lambert";
    Conductor = "HAS_CONDUCTOR", "conductors";
    Dielectric = "HAS_DIELECTRIC", "glass";
    Mirror = "HAS_MIRROR", "mirrors";
    OrenNayar = "HAS_OREN_NAYAR", "Oren-Nayar";
}

feature_set! {
    /// Features that the materials of a scene require.
    MaterialFeatures of /// A feature that materials may require of shaders.
    MaterialFeature: "material_features", from MATERIAL_FIRST, full true, indexed false, MATERIAL;
    Unlit = "HAS_UNLIT", "unlit surfaces";
    Clearcoat = "HAS_CLEARCOAT", "clearcoat";
    Sheen = "HAS_SHEEN", "sheen";
    ThinWalls = "HAS_THIN_WALLS", "thin walls that transmit";
    Volumes = "HAS_VOLUMES", "volumes";
    Absorption = "HAS_ABSORPTION", "absorption";
    Anisotropy = "HAS_ANISOTROPY", "anisotropy";
    Iridescence = "HAS_IRIDESCENCE", "iridescence";
    DiffuseTransmission = "HAS_DIFFUSE_TRANSMISSION", "diffuse transmission";
    Retroreflection = "HAS_RETROREFLECTION", "retroreflection";
    Dispersion = "HAS_DISPERSION", "dispersion";
    Scattering = "HAS_SCATTERING", "volumes that scatter";
    BaseColors = "HAS_BASE_COLORS", "base colours that vary over a surface";
    Emission = "HAS_EMISSION", "emissive surfaces";
    Compensation = "HAS_COMPENSATION", "energy compensation";
    ShadingNormals = "HAS_SHADING_NORMALS", "shading normals";
    White = "IS_WHITE", "white surfaces";
    RayCones = "HAS_RAY_CONES", "ray cones";
    SeparateTangents = "HAS_SEPARATE_TANGENTS", "tangents of more than one texture";
}

feature_set! {
    /// Which textures the materials of a scene have.
    TextureFeatures of /// A texture of a material other than its base colour's; the number is its slot in `ShadingRecord::uses`.
    TextureFeature: "texture_features", from TEXTURE_FIRST, full true, indexed true, TEXTURE;
    MetallicRoughness = "USE_METALLIC_ROUGHNESS", "metallic-roughness";
    Emission = "USE_EMISSION", "emissive";
    Normal = "USE_NORMAL", "normal";
    Clearcoat = "USE_CLEARCOAT", "clearcoat";
    ClearcoatRoughness = "USE_CLEARCOAT_ROUGHNESS", "clearcoat roughness";
    ClearcoatNormal = "USE_CLEARCOAT_NORMAL", "clearcoat normal";
    SheenColor = "USE_SHEEN", "sheen colour";
    SheenRoughness = "USE_SHEEN_ROUGHNESS", "sheen roughness";
    Transmission = "USE_TRANSMISSION", "transmission";
    Specular = "USE_SPECULAR", "specular";
    SpecularColor = "USE_SPECULAR_COLOR", "specular colour";
    Anisotropy = "USE_ANISOTROPY", "anisotropy";
    Occlusion = "USE_OCCLUSION", "occlusion";
    Iridescence = "USE_IRIDESCENCE", "iridescence";
    IridescenceThickness = "USE_IRIDESCENCE_THICKNESS", "iridescence thickness";
    DiffuseTransmission = "USE_DIFFUSE_TRANSMISSION", "diffuse transmission";
    DiffuseTransmissionColor = "USE_DIFFUSE_TRANSMISSION_COLOR", "diffuse transmission colour";
    Retroreflection = "USE_RETROREFLECTION", "retroreflection";
}

impl TextureFeature {
    /// The encoding of the texture; shaders know those that are sRGB as `SRGB_TEXTURES`.
    pub fn texels(self) -> Texels {
        match self {
            Self::Emission | Self::SheenColor | Self::SpecularColor | Self::DiffuseTransmissionColor => Texels::Srgb,
            Self::MetallicRoughness
            | Self::Normal
            | Self::Clearcoat
            | Self::ClearcoatRoughness
            | Self::ClearcoatNormal
            | Self::SheenRoughness
            | Self::Transmission
            | Self::Specular
            | Self::Anisotropy
            | Self::Occlusion
            | Self::Iridescence
            | Self::IridescenceThickness
            | Self::DiffuseTransmission
            | Self::Retroreflection => Texels::Linear,
        }
    }
}

feature_set! {
    /// The kinds of lights that paths sample.
    LightKinds of /// A kind of light: `HAS_NAME_LIGHTS` stands for `shaders/lights/name.glsl`, which defines
    /// `name_sample` and `name_pdf`, as shaders/lights/light.glsl describes them. The functions
    /// that dispatch to them are generated from this list ([`super::glsl`]): first surfaces and
    /// the environment, then the kinds of `src/scene/lights`. Its number is the record's
    /// [`kind`](super::records::lights::LightRecord::kind).
    LightKind: "light_kinds", from LIGHT_FIRST, full false, indexed false, LIGHTS;
    Rectangle = "HAS_RECTANGLE_LIGHTS", "emissive rectangles";
    Triangle = "HAS_TRIANGLE_LIGHTS", "emissive triangles";
    Sphere = "HAS_SPHERE_LIGHTS", "emissive spheres";
    Environment = "HAS_ENVIRONMENT_LIGHTS", "environment light";
    Portal = "HAS_PORTAL_LIGHTS", "portals";
    Directional = "HAS_DIRECTIONAL_LIGHTS", "directional lights";
    Point = "HAS_POINT_LIGHTS", "point lights";
    Spot = "HAS_SPOT_LIGHTS", "spot lights";
    Led = "HAS_LED_LIGHTS", "LEDs";
}

/// The features of the path tracer's shaders that a scene's materials require.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct ShadingFeatures {
    /// Reflection models.
    pub bsdfs: BsdfModels,
    /// Other features of materials.
    pub materials: MaterialFeatures,
    /// Textures of materials.
    pub textures: TextureFeatures,
}

/// All sets, in the order of their specialization constants.
pub(super) const SETS: [&Declaration; 5] = [&BSDF, &MATERIAL, &TEXTURE, &PATH, &LIGHTS];

impl BsdfModel {
    /// Number in records; 0 is no model, which absorbs everything.
    pub const fn number(self) -> u32 {
        self as u32 + 1
    }
}

#[cfg(test)]
mod tests {
    use super::super::path_options::PathFeature;
    use super::*;

    #[test]
    fn sets_hold_what_was_put_in() {
        let set: PathFeatures = [PathFeature::LightTree, PathFeature::ClearWalls].into_iter().collect();
        for &feature in PathFeature::ALL {
            assert_eq!(
                set.contains(feature),
                matches!(feature, PathFeature::LightTree | PathFeature::ClearWalls),
                "{feature:?}"
            );
        }
        assert_eq!(set.labels()[0], ["light tree", "thin walls that light passes straight"]);
        assert_eq!(set.constants().map(|c| c.1).collect::<Vec<_>>(), [1 | 1 << PathFeature::ClearWalls as u32]);
    }

    /// All specialization constants have different ids: the named ones, then the words of each set.
    #[test]
    fn numbers_are_given_out_once() {
        let mut ids: Vec<u32> = (0..constants::ALL.len() as u32).collect();
        ids.extend(BsdfModels::default().constants().map(|c| c.0.id));
        ids.extend(MaterialFeatures::default().constants().map(|c| c.0.id));
        ids.extend(TextureFeatures::default().constants().map(|c| c.0.id));
        ids.extend(PathFeatures::default().constants().map(|c| c.0.id));
        ids.extend(LightKinds::default().constants().map(|c| c.0.id));
        assert!(ids.iter().copied().eq(0..ids.len() as u32), "{ids:?}");
    }
}
