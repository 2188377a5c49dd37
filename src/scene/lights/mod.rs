//! The types of lights that no surface emits ([`LightKind`]), a file each.

pub mod directional;
pub mod keys;
pub mod led;
pub mod point;
pub mod spot;

use glam::DVec3;

use crate::interface::LightKind as Number;
use keys::Keys;

/// Names, keys and reader that a type of light declares.
pub struct LightType {
    /// Word of the type for `--light`.
    pub word: &'static str,
    /// Name of the type in inventories and messages.
    pub name: &'static str,
    /// Name of the type in KHR_lights_punctual, if that has it. Renderers that are compared with
    /// have the same ones.
    pub gltf: Option<&'static str>,
    /// Key of its strength for `--light`, which says the unit.
    pub strength: &'static str,
    /// Keys of the type for `--light`, with their units, as help lists them.
    pub keys: &'static str,
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
    /// It emits from a position.
    Placed {
        /// Angle from the axis up to which the intensity is all emitted, 0 to pi radians.
        spread: f64,
        /// Angle beyond that at which emission ends, in radians.
        falloff: f64,
        /// Numbers for the shader: `LightRecord.parameter_0` and `parameter_1`.
        parameters: [f32; 2],
    },
    /// It emits in one direction, from outside of the scene.
    Distant {
        /// Angular diameter, 0 to pi radians.
        angle: f32,
    },
}

/// Type of a light. Area lights are emissive surfaces
/// ([`Material::emissive`](crate::scene::Material::emissive)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// `intensity` in lux, on a surface that faces the light.
    Directional {
        /// Angular diameter in radians; 0 for sharp shadows. The sun has 0.0093.
        angle: f32,
    },
    /// `intensity` in candela.
    Point,
    /// `intensity` in candela along the axis.
    Spot {
        /// Angle from the axis at which the falloff starts, in radians.
        inner_angle: f32,
        /// Angle from the axis at which the falloff ends, in radians.
        outer_angle: f32,
    },
    /// `intensity` in candela along the axis; beside it falls off as a power of the cosine, to
    /// nothing at 90 degrees.
    Led {
        /// Angle from the axis at which the intensity is half of that, in radians, 1 to 89 degrees.
        half_angle: f32,
    },
}

impl LightKind {
    /// Declarations of all types.
    pub const TYPES: &'static [&'static LightType] = &[&directional::TYPE, &point::TYPE, &spot::TYPE, &led::TYPE];

    /// Returns the declaration of its type.
    pub fn about(self) -> &'static LightType {
        match self {
            Self::Directional { .. } => &directional::TYPE,
            Self::Point => &point::TYPE,
            Self::Spot { .. } => &spot::TYPE,
            Self::Led { .. } => &led::TYPE,
        }
    }

    /// Returns the number of its type in shaders.
    pub fn number(self) -> Number {
        match self {
            Self::Directional { .. } => Number::Directional,
            Self::Point => Number::Point,
            Self::Spot { .. } => Number::Spot,
            Self::Led { .. } => Number::Led,
        }
    }

    /// How it emits.
    pub fn emission(self) -> Emission {
        match self {
            Self::Directional { angle } => directional::emission(angle),
            Self::Point => point::emission(),
            Self::Spot { inner_angle, outer_angle } => spot::emission(inner_angle, outer_angle),
            Self::Led { half_angle } => led::emission(half_angle),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The compiler holds all but the list to the variants.
    #[test]
    fn every_type_is_listed() {
        // rectangles, triangles, spheres, the environment and portals are no types
        assert_eq!(LightKind::TYPES.len() + 5, Number::ALL.len());
        for light in LightKind::TYPES {
            let given = vec![("position", "0,1,0"), ("direction", "0,-1,0")];
            let kind = (light.read)(&mut Keys::new(light.word, given)).unwrap().kind;
            assert_eq!(kind.about().word, light.word);
            assert!(Number::ALL[5..].contains(&kind.number()));
            assert!(light.keys.contains(light.strength), "{}: {}", light.word, light.keys);
        }
    }

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
