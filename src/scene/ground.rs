//! The ground that settings put under a scene: its kinds, and where it is.

use crate::settings::choices;

choices! {
    /// The ground under a scene.
    pub enum Ground {
        /// None
        None = "none",
        /// A grey diffuse plane
        Plane = "plane",
        /// A plane that is not seen, but for the light that the scene keeps from it
        Catcher = "catcher",
    }
}

/// A ground that is part of a scene, as its last mesh, material and instance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LaidGround {
    /// The kind of ground.
    pub kind: Ground,
    /// The height (y), scene units.
    pub height: f64,
    /// The index of the mesh.
    pub mesh: usize,
    /// The index of the material.
    pub material: usize,
}
