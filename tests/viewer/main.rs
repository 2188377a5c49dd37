//! The viewer: views that change, its panels, and the whole of it used by scripts without a window.

#[path = "../common/mod.rs"]
mod common;

#[cfg(feature = "bake")]
mod bake;
mod hierarchy;
mod images;
mod layer;
mod panels;
mod script;
mod technique;
mod views;
