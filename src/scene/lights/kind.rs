//! Declarations of types of lights, and lights of these types.

use glam::DVec3;

use super::keys::Keys;

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
