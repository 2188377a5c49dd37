//! What keeping up with a changing scene costs on the host: `cargo bench --bench dynamic`. Throughput is triangles or instances a second.
//! docs/design/bvh.md has the table and what follows from it.

use divan::Bencher;
use divan::counter::ItemsCount;
use glam::{DAffine3, DVec3, Vec3};
use skylit::accel::flatten::FlatScene;
use skylit::accel::wide::Block;
use skylit::accel::{Aabb, BuildPreset, RefitPlan, WideBvh, build};
use skylit::gpu::{Device, Options};
use skylit::scene::{Geometry, Instance, Mesh, Motion, Scene, TriangleMesh};
use skylit::tracer::{Changes, MeshChange, Needs, Tracer, TracerKind};

/// A leaf that holds nothing but a number.
fn of_item(item: u32) -> Block {
    Block { body: [item; 15], ..Block::default() }
}

fn main() {
    divan::main();
}

/// A bumpy surface of about n triangles: what a scanned mesh looks like to a builder.
fn surface(n: usize, phase: f32) -> TriangleMesh {
    let edge = ((n / 2) as f32).sqrt().ceil() as u32;
    let positions = (0..(edge + 1) * (edge + 1))
        .map(|v| {
            let (x, y) = ((v % (edge + 1)) as f32, (v / (edge + 1)) as f32);
            Vec3::new(x, y, 20.0 * (x * 0.05 + phase).sin() * (y * 0.03 - phase).cos())
        })
        .collect();
    let quads = (0..edge * edge).map(|q| q / edge * (edge + 1) + q % edge);
    let indices = quads.flat_map(|v| [[v, v + 1, v + edge + 2], [v, v + edge + 2, v + edge + 1]]).collect();
    TriangleMesh { positions, indices, ..Default::default() }
}

fn scene(mesh: TriangleMesh, instances: usize) -> Scene {
    let edge = (instances as f64).cbrt().ceil() as usize;
    let place = |i: usize| {
        let at = DVec3::new((i % edge) as f64, (i / edge % edge) as f64, (i / edge / edge) as f64);
        DAffine3::from_scale(DVec3::splat(0.1)) * DAffine3::from_translation(10.0 * at)
    };
    Scene {
        meshes: vec![Mesh { name: String::new(), geometry: Geometry::Triangles(mesh), material: 0, source: None }],
        instances: (0..instances)
            .map(|i| Instance { name: String::new(), mesh: 0, object_to_world: place(i) })
            .collect(),
        materials: vec![Default::default()],
        ..Default::default()
    }
}

fn tracer(kind: TracerKind, scene: &Scene, motion: Motion) -> Tracer {
    let device = Device::open(&Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let flat = FlatScene::with_motion(scene, motion).unwrap_or_else(|e| panic!("{e}"));
    Tracer::new(&device, kind, &flat, Needs::default()).unwrap_or_else(|e| panic!("{kind}: {e}"))
}

const TRIANGLES: [usize; 4] = [1_000, 10_000, 100_000, 1_000_000];

/// Two poses in turn. `rebuild`: the policy is told that each trace lost more than a new tree costs.
fn deform(bencher: Bencher, kind: TracerKind, n: usize, rebuild: bool) {
    let poses = [surface(n, 0.0).positions, surface(n, 0.1).positions];
    let scene = scene(surface(n, 0.0), 1);
    let mut tracer = tracer(kind, &scene, Motion { instances: Vec::new(), meshes: vec![0], ..Motion::default() });
    let mut turn = 0;
    bencher.counter(ItemsCount::new(n)).bench_local(|| {
        turn += 1;
        let change = MeshChange { mesh: 0, positions: &poses[turn % 2], normals: None };
        if rebuild {
            // the first refit makes some growth, after which any loss is enough
            tracer.traced(1e-6);
            tracer.traced(1e9);
        }
        tracer.update(&Changes { meshes: vec![change], ..Default::default() }).unwrap()
    });
}

#[divan::bench(args = TRIANGLES, sample_count = 7, sample_size = 2)]
fn refit_compute(bencher: Bencher, n: usize) {
    deform(bencher, TracerKind::Compute, n, false);
}

#[divan::bench(args = TRIANGLES, sample_count = 7, sample_size = 2)]
fn refit_query(bencher: Bencher, n: usize) {
    deform(bencher, TracerKind::Query, n, false);
}

#[divan::bench(args = TRIANGLES, sample_count = 5, sample_size = 1)]
fn rebuild_query(bencher: Bencher, n: usize) {
    deform(bencher, TracerKind::Query, n, true);
}

/// The build that a refit saves: everything else is as at the first build.
#[divan::bench(args = TRIANGLES, sample_count = 5, sample_size = 1)]
fn build_compute(bencher: Bencher, n: usize) {
    let scene = scene(surface(n, 0.0), 1);
    let device = Device::open(&Options::default()).unwrap_or_else(|e| panic!("{e}"));
    let flat = FlatScene::new(&scene);
    bencher.counter(ItemsCount::new(n)).bench_local(|| {
        Tracer::new(&device, TracerKind::Compute, &flat, Needs::default()).unwrap().stats().build_seconds
    });
}

const INSTANCES: [usize; 6] = [10, 100, 256, 1_000, 10_000, 100_000];

/// All instances move a little; tracing is said to cost nothing, so a large top level is only refitted.
fn place(bencher: Bencher, kind: TracerKind, n: usize) {
    let scene = scene(surface(8, 0.0), n);
    let mut tracer =
        tracer(kind, &scene, Motion { instances: (0..n).collect(), meshes: Vec::new(), ..Motion::default() });
    let poses = [0.0, 0.2].map(|by| {
        let moved = |(i, x): (usize, &Instance)| {
            (i, DAffine3::from_translation(DVec3::splat(by * (i % 7) as f64)) * x.object_to_world)
        };
        scene.instances.iter().enumerate().map(moved).collect::<Vec<_>>()
    });
    let mut turn = 0;
    bencher.counter(ItemsCount::new(n)).bench_local(|| {
        turn += 1;
        tracer.traced(0.0);
        tracer.update(&Changes { instances: poses[turn % 2].clone(), ..Default::default() }).unwrap()
    });
}

#[divan::bench(args = INSTANCES, sample_count = 7, sample_size = 2)]
fn top_update_compute(bencher: Bencher, n: usize) {
    place(bencher, TracerKind::Compute, n);
}

#[divan::bench(args = INSTANCES, sample_count = 7, sample_size = 2)]
fn top_rebuild_query(bencher: Bencher, n: usize) {
    place(bencher, TracerKind::Query, n);
}

fn boxes(n: usize) -> Vec<Aabb> {
    let edge = (n as f64).cbrt().ceil() as usize;
    let corner = |i: usize| Vec3::new((i % edge) as f32, (i / edge % edge) as f32, (i / edge / edge) as f32);
    (0..n).map(|i| Aabb { min: corner(i), max: corner(i) + 0.2 + 0.1 * (i % 7) as f32 }).collect()
}

/// What a top level's tree takes to build, without a device around it.
#[divan::bench(args = INSTANCES, consts = [0, 1], sample_count = 7, sample_size = 2)]
fn top_build_host<const DEFAULT: usize>(bencher: Bencher, n: usize) {
    let boxes = boxes(n);
    let preset = [BuildPreset::Fast, BuildPreset::Default][DEFAULT];
    bencher.counter(ItemsCount::new(n)).bench_local(|| WideBvh::collapse(&build::tree(&boxes, preset, None), of_item));
}

/// What refitting it takes.
#[divan::bench(args = INSTANCES, sample_count = 7, sample_size = 2)]
fn top_refit_host(bencher: Bencher, n: usize) {
    let boxes = boxes(n);
    let mut tree = WideBvh::collapse(&build::tree(&boxes, BuildPreset::Fast, None), of_item);
    let plan = RefitPlan::new(&tree.blocks, 0);
    bencher.counter(ItemsCount::new(n)).bench_local(|| tree.refit(&plan, 1e-3, |block| boxes[block.body[0] as usize]));
}
