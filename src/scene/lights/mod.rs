//! The types of lights that no surface emits ([`LightKind`]): a file here, and an entry of the list in src/interface/light_types.rs.

pub mod keys;

use glam::DVec3;

use crate::interface::LightKind as Number;
use crate::interface::light_types::light_types;
use keys::Keys;

/// What a type of light declares.
pub struct LightType {
    /// Its word for `--light`.
    pub word: &'static str,
    /// Its name in inventories and messages.
    pub name: &'static str,
    /// Its type in KHR_lights_punctual, if that has it. Renderers that are compared with have the same ones.
    pub gltf: Option<&'static str>,
    /// Key of its strength for `--light`, which says the unit.
    pub strength: &'static str,
    /// Takes from the keys of `--light` what the light is besides its strength and colour.
    pub read: fn(&mut Keys) -> Result<PlacedLight, String>,
}

/// A light but for its strength and colour.
#[derive(Clone, Copy, Debug)]
pub struct PlacedLight {
    /// Type of the light.
    pub kind: LightKind,
    /// World position.
    pub position: DVec3,
    /// World direction in which it emits, of unit length.
    pub direction: DVec3,
}

/// How a light emits. The path tracer packs and chooses lights by it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Emission {
    /// From a position.
    Placed {
        /// Angle from the axis up to which the intensity is all emitted, 0 to pi radians.
        spread: f64,
        /// Angle beyond that at which emission ends, in radians.
        falloff: f64,
        /// Numbers for the shader: `LightRecord.parameter_0` and `parameter_1`.
        parameters: [f32; 2],
    },
    /// In one direction, from outside of the scene.
    Distant {
        /// Angular diameter, 0 to pi radians.
        angle: f32,
    },
}

macro_rules! light_kind {
    ($(
        $(#[doc = $doc:literal])+
        $variant:ident $({ $($(#[doc = $about:literal])+ $field:ident: $type:ty,)+ })? = mod $module:ident, $flag:literal, $label:literal, help($help:literal);
    )*) => {
        $(pub mod $module;)*

        /// Type of a light. Area lights are emissive surfaces ([`Material::emissive`](crate::scene::Material::emissive)).
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum LightKind {
            $($(#[doc = $doc])+ $variant $({ $($(#[doc = $about])+ $field: $type,)+ })?,)*
        }

        impl LightKind {
            /// What the types declare.
            pub const TYPES: &'static [&'static LightType] = &[$(&$module::TYPE,)*];

            /// What its type declares.
            pub fn about(self) -> &'static LightType {
                match self {
                    $(Self::$variant { .. } => &$module::TYPE,)*
                }
            }

            /// What it is called in the shaders.
            pub fn number(self) -> Number {
                match self {
                    $(Self::$variant { .. } => Number::$variant,)*
                }
            }

            /// How it emits.
            pub fn emission(self) -> Emission {
                match self {
                    $(Self::$variant $({ $($field),+ })? => $module::emission($($($field),+)?),)*
                }
            }
        }
    };
}
light_types!(light_kind);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_names_tell_types_apart() {
        for (k, light) in LightKind::TYPES.iter().enumerate() {
            let same = |o: &&&LightType| o.word == light.word || o.name == light.name;
            assert_eq!(LightKind::TYPES.iter().filter(same).count(), 1, "{} {}", light.word, light.name);
            let missing = (light.read)(&mut Keys::new(light.word, Vec::new())).unwrap_err();
            assert!(missing.starts_with(&format!("{} needs ", light.word)), "{k}: {missing}");
        }
    }
}
