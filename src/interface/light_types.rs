//! The types of lights that no surface emits. A type is an entry of this list, `src/scene/lights/NAME.rs`, which says how it emits and how it is asked for, and
//! `shaders/lights/NAME.glsl`, which samples it: the rest is made of the list.

/// Calls the macro `$callback` with all types, an entry each: what its intensity is, its variant of `LightKind` (of the scene and of
/// [`features`](super::features)) with its numbers, its module in src/scene/lights, its name in shaders and what it is called there, and its line of the help of
/// `--light`.
macro_rules! light_types {
    ($callback:ident) => {
        $callback! {
            /// `intensity` in lux, on a surface that faces the light.
            Directional {
                /// Angular diameter in radians; 0 for sharp shadows. The sun has 0.0093.
                angle: f32,
            } = mod directional, "HAS_DIRECTIONAL_LIGHTS", "directional lights",
                help(" sun: direction, irradiance (lux), angle (its diameter in degrees);");
            /// `intensity` in candela.
            Point = mod point, "HAS_POINT_LIGHTS", "point lights",
                help(" point: position, intensity (cd);");
            /// `intensity` in candela along the axis.
            Spot {
                /// Angle from the axis at which the falloff starts, in radians.
                inner_angle: f32,
                /// Angle from the axis at which the falloff ends, in radians.
                outer_angle: f32,
            } = mod spot, "HAS_SPOT_LIGHTS", "spot lights",
                help(" spot: position, direction, intensity (cd), outer, inner (degrees from the axis);");
            /// `intensity` in candela along the axis; beside it falls off as a power of the cosine, to nothing at 90 degrees.
            Led {
                /// Angle from the axis at which the intensity is half of that, in radians, 1 to 89 degrees.
                half_angle: f32,
            } = mod led, "HAS_LED_LIGHTS", "LEDs",
                help(" led: position, direction, intensity (cd), half_angle (degrees from the axis where it is half);");
        }
    };
}
pub(crate) use light_types;
