//! Loaders and exporter: every glTF feature, OBJ, `.brhan`, bad input, round trips, and the scenes of others where present.

mod animation;
mod brhan;
mod build;
mod camera;
mod camera_path;
mod compressed;
mod environment;
mod errors;
mod export;
mod exporters;
mod fingerprint;
mod fuzz;
mod geometry;
mod hierarchy;
mod image_light;
mod light_spec;
mod materials;
mod memory;
mod obj;
mod own;
mod pointer;
mod shared;
mod sky;
mod squares;
mod texture;
