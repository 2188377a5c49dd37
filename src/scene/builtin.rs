//! (being written)

use super::Scene;

/// The built-in scene called `name`, if there is one.
pub fn by_name(_name: &str) -> Option<Scene> {
    None
}
