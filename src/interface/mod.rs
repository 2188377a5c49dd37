//! What the program and its shaders share, declared once: records in device memory and push constants, numbers, specialization constants, sets of features,
//! and numbered alternatives. The shaders' side is text that [`glsl::files`] makes of the same declarations: a shader says
//! `#include "interface/scene.glsl"`.
//!
//! build.rs compiles this folder, too, so nothing of the crate is used here, nor of its dependencies: what the crate derives for these types beside, its
//! macros `shared_record`, `shared_enumeration` and `shared_choice` say (src/lib.rs); those of build.rs derive nothing.

pub mod constants;
pub mod enumerations;
pub mod features;
pub mod glsl;
#[macro_use]
pub mod layout;
pub mod records;

pub use enumerations::{BudgetStage, PixelFilter, Resolution, Sequence, Shown, TexelFormat, Texels, View, Walls, Wrap};
pub use features::{
    BsdfModel, BsdfModels, LightKind, LightKinds, MaterialFeature, MaterialFeatures, PathFeature, PathFeatures,
    ShadingFeatures, TextureFeature, TextureFeatures,
};
