//! Lights that no surface emits, portals and environment lights.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::LightKind;

/// One light.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name in the file; may be empty.
    pub name: String,
    /// Type of the light.
    pub kind: LightKind,
    /// Linear colour times intensity; see [`LightKind`] for the unit.
    pub intensity: Vec3,
    /// World position.
    pub position: DVec3,
    /// World direction in which it emits, of unit length.
    pub direction: DVec3,
    /// Distance in scene units beyond which it has no effect (KHR_lights_punctual range); infinite
    /// by default.
    pub range: f64,
}

impl Light {
    /// Places it at a node of this transform to world space, without scale: as in
    /// KHR_lights_punctual it emits along the node's negative z axis.
    pub fn place(&mut self, to_world: &DAffine3) {
        self.position = to_world.translation;
        self.direction = -to_world.matrix3.z_axis;
    }
}

/// A rectangle through which the environment lights a room: a window, a door, a skylight. It guides
/// the sampling of the environment, and neither emits nor blocks light: images differ only in
/// noise. Light that enters elsewhere is still found.
#[derive(Clone, Debug, PartialEq)]
pub struct Portal {
    /// World position of a corner.
    pub corner: DVec3,
    /// The two edges from that corner, at right angles, in scene units.
    pub edges: [DVec3; 2],
}

impl Portal {
    /// Area in squared scene units.
    pub fn area(&self) -> f64 {
        self.edges[0].cross(self.edges[1]).length()
    }
}

/// Environment light, seen by rays that leave the scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Environment {
    /// No environment light.
    #[default]
    Black,
    /// Constant radiance from all directions.
    Uniform(Vec3),
    /// An environment map.
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

impl EnvironmentMap {
    /// A map as it is, neither turned nor scaled.
    pub fn new(name: impl Into<String>, [width, height]: [u32; 2], radiance: Arc<[Vec3]>) -> Self {
        Self { name: name.into(), width, height, radiance, factor: Vec3::ONE, to_map: DMat3::IDENTITY }
    }
}
