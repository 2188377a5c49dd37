//! Ambient occlusion frame after frame: what its images must show, what it leaves out, and how it ends. Images are small; a claim is
//! held on the tracer that its test's name picks ([`common::picked`]), and what tracers could do differently on each that the device runs.

#[path = "../common/mod.rs"]
mod common;

mod bent;
mod bias;
mod catcher;
// it runs the program
#[cfg(feature = "cli")]
mod cli;
mod constants;
mod degenerate;
mod display;
mod edges;
mod gtao;
mod integers;
mod larsen;
mod long_run;
mod motion;
mod rest;
mod sequence;
mod settings;
mod skips;
mod tracers;

use common::record;
use glam::{DAffine3, DVec3};
use skylit::film::camera::CameraRecord;
use skylit::gpu::{Buffer, Commands, Device, Memory};
use skylit::interface::records::ray_set::Probe;
use skylit::raster::Primary;
use skylit::realtime::{Filter, FilterKind, FrameStats, Preset, Realtime, Settings};
use skylit::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, TriangleMesh};
use skylit::shaders::{self, ComputeShader};
use skylit::tracer::{Push, Tracer, TracerKind};
use std::sync::Arc;

/// The floor's: for what comes after tracing, which no tracer changes.
fn one_tracer(device: &Device) -> Vec<TracerKind> {
    let kinds = common::tracers(device);
    kinds.into_iter().filter(|k| *k == TracerKind::Compute).collect()
}

/// What a shader of tests/shaders makes of `inputs`: two uvec4 each, of which it makes one.
fn probe(device: &Arc<Device>, shader: &ComputeShader, inputs: &[[u32; 8]]) -> Vec<[u32; 4]> {
    let (count, bytes) = (inputs.len() as u32, 16 * inputs.len() as u64);
    let source = Buffer::from_slice(device, "probe inputs", inputs).unwrap();
    let results = Buffer::new(device, "probe outputs", bytes, Memory::Readback).unwrap();
    let probe =
        Buffer::from_slice(device, "probe", &[Probe { inputs: source.address(), outputs: results.address() }]).unwrap();
    let pipeline = shader.pipeline(device).unwrap();
    let push = Push { pass: probe.address(), count, ..Default::default() };
    Commands::new(device).unwrap().run(|r| r.dispatch(&pipeline, &push, count.div_ceil(shaders::LANES))).unwrap();
    bytemuck::pod_collect_to_vec(&results.read(0, bytes).unwrap())
}

/// Of most images here.
const SIZE: [u32; 2] = [96, 54];

/// The scene's own camera, moved along its own axes.
fn stepped(scene: &Scene, size: [u32; 2], step: DVec3) -> CameraRecord {
    let mut camera = scene.cameras[0].clone();
    camera.camera_to_world *= DAffine3::from_translation(step);
    record(scene, &camera, size)
}

/// Camera rays are traced: rasterization has its own test.
fn traced(preset: Preset) -> Settings {
    Settings { primary: Some(Primary::Traced), ..preset.settings() }
}

const NO_FILTER: Filter = Filter { kind: FilterKind::None, radius: 0, samples: 0.0 };

fn realtime(tracer: &Tracer, size: [u32; 2], settings: &Settings) -> Realtime {
    Realtime::new(tracer, size, settings, &[]).unwrap_or_else(|e| panic!("{}: {e}", tracer.kind()))
}

/// Frames of a scene in which nothing moves.
fn frames(realtime: &mut Realtime, tracer: &Tracer, camera: &CameraRecord, count: u32) -> Vec<FrameStats> {
    (0..count).map(|_| realtime.frame(tracer, camera, &[]).unwrap()).collect()
}

/// What an image with many rays says, without history and filter: a quarter of the preset's, which leaves an error of 0.01.
fn reference(tracer: &Tracer, size: [u32; 2], like: &Settings, camera: &CameraRecord) -> Vec<f32> {
    let settings = Settings {
        occlusion: like.occlusion,
        // of none of the seeds under test
        seed: 77,
        rays_per_pixel: 256,
        ..traced(Preset::Reference)
    };
    let mut realtime = realtime(tracer, size, &settings);
    frames(&mut realtime, tracer, camera, 1);
    realtime.result().unwrap()
}

fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().fold((0.0, 0u64), |(s, n), v| (s + v, n + 1));
    assert!(count > 0, "the mean of nothing");
    sum / count as f64
}

/// Root of the mean square difference where `mask` is above 0.
fn rmse(a: &[f32], b: &[f32], mask: &[f32]) -> f64 {
    assert!(a.len() == b.len() && a.len() == mask.len());
    let squares = (0..a.len()).filter(|&i| mask[i] > 0.0).map(|i| f64::from(a[i] - b[i]).powi(2));
    mean(squares).sqrt()
}

/// Finite, from 0 to 1.
fn assert_sound(what: &str, realtime: &Realtime) {
    for (name, image) in [("result", realtime.result().unwrap()), ("history", realtime.unfiltered().unwrap())] {
        let bad = image.iter().filter(|v| !(0.0..=1.0).contains(*v)).count();
        assert_eq!(bad, 0, "{what}: {bad} pixels of {} in the {name} are no ambient visibility", image.len());
    }
    assert!(realtime.samples().unwrap().iter().all(|n| (0.0..=4096.0).contains(n)), "{what}");
}

/// Meshes where they are, each once.
fn scene_of(meshes: Vec<TriangleMesh>, camera: Camera) -> Scene {
    let mut scene = Scene { materials: vec![Material::default()], cameras: vec![camera], ..Scene::default() };
    for (mesh, geometry) in meshes.into_iter().enumerate() {
        scene.meshes.push(Mesh {
            name: format!("mesh {mesh}"),
            geometry: Geometry::Triangles(geometry),
            material: 0,
            source: None,
        });
        scene.instances.push(Instance { name: format!("mesh {mesh}"), mesh, object_to_world: DAffine3::IDENTITY });
    }
    scene
}

fn triangles(geometry: Geometry) -> TriangleMesh {
    match geometry {
        Geometry::Triangles(t) => t,
        Geometry::Spheres(_) => panic!("spheres"),
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}
