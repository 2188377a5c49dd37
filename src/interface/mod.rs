//! The interface of the program and its shaders, declared once: records in device memory and push constants, numbers, specialization constants, sets of
//! features, and enumerations. The GLSL side is text that [`glsl::files`] generates from the same declarations: a shader includes it by
//! `#include "interface/scene.glsl"`.
//!
//! build.rs compiles this folder, too, so it uses nothing of the crate or its dependencies. The crate's macros `shared_record`, `shared_enumeration` and
//! `shared_choice` (src/lib.rs) add derives to these types; those of build.rs derive nothing.

pub mod constants;
pub mod debug_views;
pub mod enumerations;
pub mod features;
pub mod glsl;
#[macro_use]
pub mod layout;
pub mod light_types;
pub mod path_options;
pub mod records;

pub use enumerations::{
    BudgetStage, DisplayMode, PixelFilter, Resolution, Sequence, TexelFormat, Texels, ToneMap, TransmissionMode, View, Wrap,
};
pub use features::{
    BsdfModel, BsdfModels, LightKind, LightKinds, MaterialFeature, MaterialFeatures, PathFeature, PathFeatures,
    ShadingFeatures, TextureFeature, TextureFeatures,
};
