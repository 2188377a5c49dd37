//! Values of the JSON document as its readers take them.

use ::gltf::json::Index;
use ::gltf::json::accessor::Accessor;
use ::gltf::json::validation::Checked;

/// Index of an accessor in the document.
pub(super) type AccessorIndex = Index<Accessor>;

/// The value, if the crate found it valid.
pub(super) fn valid<T>(checked: Checked<T>) -> Option<T> {
    match checked {
        Checked::Valid(value) => Some(value),
        Checked::Invalid => None,
    }
}

/// An optional name, or none.
pub(super) fn text(name: &Option<String>) -> &str {
    name.as_deref().unwrap_or_default()
}
