//! What the program and its shaders share, declared once: specialization constants, sets of features, and numbered alternatives. The shaders' side is text
//! that [`glsl::files`] makes of the same declarations: a shader says `#include "interface/constants.glsl"`.
//!
//! build.rs compiles this folder, too, so nothing of the crate is used here.

pub mod constants;
pub mod enumerations;
pub mod features;
pub mod glsl;

pub use enumerations::{LightKind, MaterialModel, Walls};
pub use features::{
    MaterialFeature, MaterialFeatures, PathFeature, PathFeatures, ShadingFeatures, TextureFeature, TextureFeatures,
};
