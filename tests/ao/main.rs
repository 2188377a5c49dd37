//! Ambient occlusion stills: closed forms, images against the double-precision oracle's, the film, auxiliary outputs, kept rays, and how a render
//! stops. Every tracer that the device runs takes every test.

#[path = "../common/mod.rs"]
mod common;

mod aov;
mod baking;
mod catcher;
mod closed_forms;
mod film;
mod high_to_low;
mod images;
mod rays;
mod stopping;

use skylit::film::NoControl;
use skylit::integrators::ao::{self, AoOptions, AoResult};
use skylit::oracle::Oracle;
use skylit::oracle::ao::{self as oracle_ao, AoSettings};
use skylit::scene::{Camera, Scene};
use skylit::tracer::Tracer;

fn render(tracer: &Tracer, scene: &Scene, camera: &Camera, options: &AoOptions) -> AoResult {
    ao::render(tracer, &common::record(scene, camera, options.samples.size), options, &mut NoControl)
        .unwrap_or_else(|e| panic!("{}: {e}", tracer.kind()))
}

fn settings(options: &AoOptions) -> AoSettings {
    // what is beyond the reach is not traced for
    AoSettings { radius: options.occlusion.reach(), falloff: options.occlusion.falloff, rays: options.rays }
}

/// Pixels that differ by more than `threshold`, greatest difference, and difference of the means.
fn differences(a: &[f32], b: &[f32], threshold: f32) -> (usize, f32, f64) {
    assert_eq!(a.len(), b.len());
    let pairs = || a.iter().zip(b);
    let count = pairs().filter(|(a, b)| (*a - *b).is_nan() || (*a - *b).abs() > threshold).count();
    let greatest = pairs().map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let mean = pairs().map(|(a, b)| (a - b) as f64).sum::<f64>() / a.len().max(1) as f64;
    (count, greatest, mean)
}

/// The oracle's image as a film has it: means over all samples.
fn oracle_image(oracle: &Oracle, camera: &Camera, options: &AoOptions) -> oracle_ao::AoImage {
    let mut image = oracle_ao::render(
        oracle,
        camera,
        options.samples.size,
        options.samples.spp,
        options.samples.seed,
        &settings(options),
    );
    for (a, c) in image.ambient_visibility.iter_mut().zip(&image.coverage) {
        *a *= c;
    }
    image
}
