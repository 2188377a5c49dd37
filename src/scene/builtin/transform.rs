//! Where a test scene stands.

use glam::{DAffine3, DVec3};

/// Transform of a test scene: scale about its own origin, then translation. It becomes part of the
/// instances' transforms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneTransform {
    /// Uniform scale.
    pub scale: f64,
    /// World position of the scene's own origin.
    pub offset: DVec3,
}

impl Default for SceneTransform {
    fn default() -> Self {
        Self { scale: 1.0, offset: DVec3::ZERO }
    }
}

impl SceneTransform {
    /// The world point of a point in the scene's own units.
    pub fn point(&self, p: DVec3) -> DVec3 {
        p * self.scale + self.offset
    }

    /// The transform of the scene's instances.
    pub fn transform(&self) -> DAffine3 {
        DAffine3::from_translation(self.offset) * DAffine3::from_scale(DVec3::splat(self.scale))
    }
}
