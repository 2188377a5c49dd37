//! Records in device memory, push constants and shared numbers, one file per subject.

pub mod albedo;
pub mod ao;
pub mod aov;
pub mod bake;
pub mod block;
pub mod builder;
pub mod denoise;
pub mod display;
pub mod film;
pub mod frame;
pub mod gbuffer;
pub mod hierarchy;
pub mod larsen;
pub mod lights;
pub mod passes;
pub mod path;
pub mod queue;
pub mod radiance;
pub mod raster;
pub mod ray;
pub mod ray_set;
pub mod sampler;
pub mod scene;
pub mod shading;

use super::layout::File;

/// All files; each after those that it includes.
pub const FILES: [&File; 25] = [
    &ray::FILE,
    &queue::FILE,
    &scene::FILE,
    &shading::FILE,
    &block::FILE,
    &ao::FILE,
    &bake::FILE,
    &film::FILE,
    &super::path_options::FILE,
    &lights::FILE,
    &path::FILE,
    &frame::FILE,
    &gbuffer::FILE,
    &passes::FILE,
    &radiance::FILE,
    &larsen::FILE,
    &display::FILE,
    &denoise::FILE,
    &raster::FILE,
    &aov::FILE,
    &ray_set::FILE,
    &hierarchy::FILE,
    &builder::FILE,
    &sampler::FILE,
    &albedo::FILE,
];
