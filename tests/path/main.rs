//! Path-traced images by every tracer against what is known in closed form: light that arrives directly, furnaces in which nothing may be
//! lost or gained, enclosures with light everywhere; and what becomes of their films. Images are small.

#[path = "../common/mod.rs"]
mod common;

mod appearance;
mod backdrop;
mod bsdf;
mod camera;
mod catcher;
// these run the program
#[cfg(feature = "cli")]
mod cli;
#[cfg(feature = "cli")]
mod denoise;
mod direct;
mod dispersion;
mod emitters;
mod film;
mod frames;
mod furnace;
mod image_light;
mod lag;
mod light_groups;
mod lit;
mod materials;
mod media;
mod megakernel;
mod oren_nayar;
mod portals;
mod scattering;
mod shading_normals;
mod texcoord_sets;
mod texture_filter;
mod transport;
mod validation;
mod whitted;

use std::sync::{Arc, OnceLock};

use common::{assert_validation_clean, picked, tracers};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use skylit::accel::flatten::FlatScene;
use skylit::film::Film;
use skylit::film::camera::CameraRecord;
use skylit::film::{NoControl, SampleSettings};
use skylit::gpu::{Device, Options};
use skylit::integrators::path::{self, PathOptions, PathResult, Strategy};
use skylit::scene::material::MaterialKind;
use skylit::scene::{Camera, Environment, Geometry, Instance, Light, LightKind, Material, Mesh, Scene};
use skylit::stress::sampling::{emitter, matte, mean_of, scene_of};
use skylit::tracer::{Needs, Tracer, TracerKind};

/// The device that the tests of this folder share; with the validation layer if `SKYLIT_FULL` is set. Without it the test in validation.rs has the layer, for
/// all of them.
fn device() -> Arc<Device> {
    static DEVICE: OnceLock<Arc<Device>> = OnceLock::new();
    let validation = common::is_full() && common::validated().validation;
    DEVICE
        .get_or_init(|| common::open(Options { keep_pipelines: common::KEPT, validation, ..Options::default() }))
        .clone()
}

fn tracer(device: &Arc<Device>, kind: TracerKind, flat: &FlatScene) -> Tracer {
    let needs = Needs { shading: true, ..Default::default() };
    Tracer::new(device, kind, flat, needs).unwrap_or_else(|e| panic!("{kind}: {e}"))
}

fn render(tracer: &Tracer, flat: &FlatScene, options: &PathOptions) -> PathResult {
    let aspect = f64::from(options.samples.size[0]) / f64::from(options.samples.size[1]);
    let record = CameraRecord::new(&flat.scene.cameras[0], flat.origin, aspect);
    let result = path::render(tracer, flat, &record, options, &mut NoControl)
        .unwrap_or_else(|e| panic!("{}: {e}", tracer.kind()));
    assert_eq!(result.image.film.not_finite, 0, "{}: samples that are no numbers", tracer.kind());
    result
}

/// Holds the mean of an image that should be `expected` all over against it, on the test's tracer ([`picked`]); strategies that are for comparison on one:
/// they are the same code on all. `precision`: the standard error, relative, that the image must reach to say anything.
fn holds(device: &Arc<Device>, what: &str, scene: &Scene, options: &PathOptions, expected: f64, precision: f64) {
    holds_but_for(2e-6, device, what, scene, options, expected, precision);
}

/// The same, with rounding of a size that is known.
fn holds_but_for(
    rounding: f64,
    device: &Arc<Device>,
    what: &str,
    scene: &Scene,
    options: &PathOptions,
    expected: f64,
    precision: f64,
) {
    let kinds = if options.strategy == Strategy::Mis { picked(device) } else { vec![TracerKind::Compute] };
    holds_with(&kinds, rounding, device, what, scene, options, expected, precision);
}

/// The same on the compute tracer alone: for variations of what another case asks of all of them.
fn holds_on_compute(
    rounding: f64,
    device: &Arc<Device>,
    what: &str,
    scene: &Scene,
    options: &PathOptions,
    expected: f64,
    precision: f64,
) {
    holds_with(&[TracerKind::Compute], rounding, device, what, scene, options, expected, precision);
}

#[expect(clippy::too_many_arguments, reason = "the two above name what they share")]
fn holds_with(
    kinds: &[TracerKind],
    rounding: f64,
    device: &Arc<Device>,
    what: &str,
    scene: &Scene,
    options: &PathOptions,
    expected: f64,
    precision: f64,
) {
    let flat = FlatScene::for_paths(scene);
    for &kind in kinds {
        let result = render(&tracer(device, kind, &flat), &flat, options);
        let (mean, error) = mean_of(&result.image.film);
        println!("{what}, {kind}, {:?}: {mean:.6} +- {error:.6}, expected {expected:.6}", options.strategy);
        assert!(error <= precision * expected, "{what}, {kind}: {mean} +- {error} says nothing about {expected}");
        // rounding beside noise
        assert!(
            (mean - expected).abs() <= 4.5 * error + rounding * expected,
            "{what}, {kind}: {mean} +- {error} is not {expected}"
        );
    }
    assert_validation_clean(device);
}
