//! Lights that are no surfaces of a mesh, and what surrounds the scene.

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};

/// Shape and falloff of a light (KHR_lights_punctual). What has an extent is a surface that emits ([`super::Material::emissive`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// `intensity` in candela.
    Point,
    /// `intensity` in candela along the axis.
    Spot {
        /// Radians from the axis where the falloff starts.
        inner_angle: f32,
        /// Radians from the axis where it ends.
        outer_angle: f32,
    },
    /// `intensity` in lux, of a surface that faces it.
    Directional {
        /// Radians that it fills in the sky, from edge to edge; 0: shadows are sharp. The sun: 0.0093.
        angle: f32,
    },
}

/// One light.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name in the file; may be empty.
    pub name: String,
    /// Shape and falloff.
    pub kind: LightKind,
    /// Linear colour times intensity; see [`LightKind`] for the unit.
    pub intensity: Vec3,
    /// World position.
    pub position: DVec3,
    /// World direction in which it shines, of unit length.
    pub direction: DVec3,
    /// World units beyond which it has no effect (KHR_lights_punctual range); infinite by default.
    pub range: f64,
}

/// A rectangle through which the environment lights a room: a window, a door, a skylight. It shows where to look for light, and neither emits nor hides any: images differ
/// by their noise alone. Light that comes in elsewhere is still found.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// World position of a corner.
    pub corner: DVec3,
    /// The two edges from there, at right angles; world units.
    pub edges: [DVec3; 2],
}

impl Portal {
    /// World units, squared.
    pub fn area(&self) -> f64 {
        self.edges[0].cross(self.edges[1]).length()
    }
}

/// What a ray that leaves the scene sees.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// Nothing.
    #[default]
    Black,
    /// The same radiance from everywhere.
    Uniform(Vec3),
    /// An image of it.
    Map(EnvironmentMap),
}

/// Radiance from every direction, in equirectangular projection.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvironmentMap {
    /// File name.
    pub name: String,
    /// Pixels in x: once around. -z of the map is in the middle, +x to the right of it.
    pub width: u32,
    /// Pixels in y, from +y at the top to -y.
    pub height: u32,
    /// Linear radiance, rows from the top, finite and not negative.
    pub radiance: Arc<[Vec3]>,
    /// Multiplies it.
    pub factor: Vec3,
    /// Rotation from world directions to the map's.
    pub to_map: DMat3,
}
