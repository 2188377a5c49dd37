//! The interface of the program and its shaders, declared once: records in device memory and push
//! constants, numbers, specialization constants, sets of features, and enumerations. The GLSL side
//! is text that [`glsl::files`] generates from the same declarations: a shader includes it by
//! `#include "interface/scene.glsl"`.
//!
//! build.rs compiles this folder, too, so it uses nothing of the crate but the macro `choices!`,
//! and no package. Where `cfg(library)` holds, these types derive what the crate needs.

pub mod constants;
pub mod enumerations;
pub mod features;
pub mod glsl;
#[macro_use]
pub mod layout;
pub mod path_options;
pub mod records;

pub use enumerations::{
    DisplayMode, PixelFilter, Resolution, Sequence, TexelFormat, Texels, ToneMap, TransmissionMode, View, Wrap,
};
pub use features::{
    BsdfModel, BsdfModels, LightKind, LightKinds, MaterialFeature, MaterialFeatures, ShadingFeatures, TextureFeature,
    TextureFeatures,
};
pub use path_options::{PathFeature, PathFeatures, PathOptionsRecord};
