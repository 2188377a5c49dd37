//! The hemisphere that occlusion rays sample.

use crate::settings::choices;

choices! {
    /// The axis of the hemisphere that occlusion rays fill.
    pub enum Hemisphere {
        /// Geometric normal, on the viewer's side (as pbrt-v4's AOIntegrator)
        Geometric = "geometric",
        /// Shading normal (interpolated)
        Shading = "shading",
    }
}
