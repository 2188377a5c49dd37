//! The types of lights that no surface emits ([`LightKind`]), a file each.

pub mod directional;
pub mod keys;
mod kind;
pub mod led;
pub mod point;
pub mod spot;

use crate::interface::LightKind as Number;
pub use kind::{Emission, LightKind, LightType, PlacedLight};

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
    use super::keys::Keys;
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
