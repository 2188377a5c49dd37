//! Scenes that change: after every update a tracer must give the hits of one that was made for the changed scene, and those of the oracle.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};
use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::gpu::Device;
use skylit::integrators::rays::{Mode, trace};
use skylit::measure::parity::{judge_closest, judge_pair};
use skylit::measure::ray_sets::{leak_rays, random_rays};
use skylit::oracle::Oracle;
use skylit::oracle::rounding::Rounding;
use skylit::scene::builtin::{by_name, shapes};
use skylit::scene::{Geometry, Motion, Scene};
use skylit::tracer::{BuildOptions, Changes, ComputeOptions, Kernel, MeshChange, Tracer, TracerKind, UpdateStats};

use crate::common;
use crate::common::{ALL, assert_validation_clean, closest, device, scene, tracers};

const RAYS: usize = 40_000;

fn positions(scene: &Scene, mesh: usize) -> &[Vec3] {
    match &scene.meshes[mesh].geometry {
        Geometry::Triangles(t) => &t.positions,
        Geometry::Spheres(_) => panic!("mesh {mesh} holds spheres"),
    }
}

fn positions_mut(scene: &mut Scene, mesh: usize) -> &mut [Vec3] {
    match &mut scene.meshes[mesh].geometry {
        Geometry::Triangles(t) => &mut t.positions,
        Geometry::Spheres(_) => panic!("mesh {mesh} holds spheres"),
    }
}

/// A scene, what of it moves, and a tracer that follows.
struct Follower {
    scene: Scene,
    motion: Motion,
    tracer: Tracer,
    steps: u32,
}

impl Follower {
    fn new(device: &Arc<Device>, kind: TracerKind, scene: &Scene, motion: Motion) -> Self {
        Self::with_build(device, kind, scene, motion, &BuildOptions::default())
    }

    fn with_build(device: &Arc<Device>, kind: TracerKind, scene: &Scene, motion: Motion, build: &BuildOptions) -> Self {
        let flat = FlatScene::with_motion(scene, motion.clone()).unwrap();
        let tracer = Tracer::with_build(device, kind, &flat, ALL, ComputeOptions::default(), build).unwrap();
        assert_eq!(tracer.stats().on_device.trees > 0, build.on_device.is_some());
        Self { scene: scene.clone(), motion, tracer, steps: 0 }
    }

    /// Changes the scene, updates, and compares.
    fn step(&mut self, change: impl FnOnce(&mut Scene)) -> UpdateStats {
        let before = self.scene.clone();
        change(&mut self.scene);
        assert_eq!(before.origin(), self.scene.origin(), "a test must not move the origin");
        let scene = &self.scene;
        let changes = Changes {
            instances: self.motion.instances.iter().map(|&i| (i, scene.instances[i].object_to_world)).collect(),
            meshes: self
                .motion
                .meshes
                .iter()
                .map(|&mesh| MeshChange { mesh, positions: positions(scene, mesh), normals: None })
                .collect(),
            ..Changes::default()
        };
        let oracle = Oracle::new(scene, scene.origin());
        let rays = random_rays(&oracle, RAYS, 11 + self.steps);
        let stale = closest(&self.tracer, &rays);
        let stats = self.tracer.update(&changes).unwrap();
        let hits = closest(&self.tracer, &rays);
        let kind = self.tracer.kind();
        let (truth, rounding) = (oracle.trace_closest(&rays), Rounding::default());
        let report = judge_closest(&oracle, &rays, &hits, &truth, rounding);
        println!("{} {kind} step {}: {report}; {stats:?}", scene.name, self.steps);
        assert!(report.unexplained_fraction() <= 1e-5, "{kind} step {}: {report}", self.steps);
        assert!(report.hits > RAYS as u64 / 20, "the rays hardly meet the scene");
        let fresh = Tracer::new(self.tracer.device(), kind, &FlatScene::new(scene), ALL).unwrap();
        let report = judge_pair(&oracle, &rays, &hits, &closest(&fresh, &rays), rounding);
        assert!(report.unexplained_fraction() <= 1e-5, "{kind} step {} against a new tracer: {report}", self.steps);
        // without the update the check would have detected it
        let report = judge_closest(&oracle, &rays, &stale, &truth, rounding);
        assert!(report.unexplained_fraction() > 1e-3, "{kind} step {}: hardly anything moved", self.steps);
        let (any, _) = trace(&self.tracer, &rays, Mode::Any, 1, &mut NoControl).unwrap();
        let differ = any.iter().zip(&hits).filter(|(a, h)| a.is_hit() != h.is_hit()).count();
        assert!(differ <= RAYS / 10_000, "{differ} rays to any hit differ");
        self.steps += 1;
        stats
    }
}

/// Turned and moved, differently for each instance and step.
fn wander(scene: &mut Scene, instances: &[usize], step: u32, far: f64) {
    for &i in instances {
        let a = (i as f64 + 1.0) * 0.7 + step as f64;
        let offset = DVec3::new(a.sin(), (1.3 * a).cos(), (0.7 * a).sin()) * far;
        let turn = DAffine3::from_quat(DQuat::from_rotation_y(a) * DQuat::from_rotation_x(0.5 * a));
        let t = &mut scene.instances[i].object_to_world;
        let place = t.translation;
        *t = DAffine3::from_translation(place + offset) * turn * DAffine3::from_translation(-place) * *t;
    }
}

fn all_instances(scene: &Scene) -> Vec<usize> {
    (0..scene.instances.len()).collect()
}

#[test]
fn gpu_moving_instances() {
    let device = device();
    for kind in tracers(&device) {
        for (name, far) in [("grid:2", 0.3), ("cornell-spheres", 0.05), ("leaf-cards", 0.1)] {
            let scene = scene(name);
            let moving =
                if name == "cornell-spheres" { vec![0, scene.instances.len() - 1] } else { all_instances(&scene) };
            let mut f = Follower::new(
                &device,
                kind,
                &scene,
                Motion { instances: moving.clone(), meshes: Vec::new(), ..Motion::default() },
            );
            for step in 0..2 {
                let stats = f.step(|s| wander(s, &moving, step, far));
                assert!(stats.top_rebuilt && stats.rebuilt.is_empty());
            }
        }
    }
    assert_validation_clean(&device);
}

/// More entries than the compute tracer builds anew each time: refitted until that costs too much.
#[test]
fn gpu_many_moving_instances() {
    let device = device();
    let scene = scene("grid:8");
    let moving = all_instances(&scene);
    for kind in tracers(&device) {
        let mut f = Follower::new(
            &device,
            kind,
            &scene,
            Motion { instances: moving.clone(), meshes: Vec::new(), ..Motion::default() },
        );
        let first = f.step(|s| wander(s, &moving, 0, 0.05));
        assert_eq!(first.top_rebuilt, kind != TracerKind::Compute);
        // all elsewhere: the old tree is of no use
        let mixed = f.step(|s| {
            let places: Vec<_> = s.instances.iter().map(|i| i.object_to_world.translation).collect();
            let n = places.len();
            for (k, i) in s.instances.iter_mut().enumerate() {
                i.object_to_world.translation = places[(k * 211 + 7) % n];
            }
        });
        assert_eq!(mixed.top_rebuilt, kind != TracerKind::Compute);
        let last = f.step(|s| wander(s, &moving, 1, 0.05));
        assert!(last.top_rebuilt, "{kind}");
    }
    assert_validation_clean(&device);
}

/// Waves through a sphere; then inside out and much larger.
fn waves(positions: &mut [Vec3], step: u32) {
    let phase = step as f32;
    for p in positions {
        let d = *p / p.length().max(1e-3);
        *p = d * (1.0 + 0.3 * (5.0 * d.x + phase).sin() * (4.0 * d.y - phase).cos())
            + 0.2 * Vec3::new(d.z, 0.0, -d.y) * phase;
    }
}

fn sphere_on_a_plane() -> (Scene, usize) {
    let mut scene = scene("cornell-box");
    let mesh = scene.meshes.len();
    let (material, mut instance) = (scene.meshes[0].material, scene.instances[0].clone());
    let size = scene.bounds().map_or(1.0, |(lo, hi)| (hi - lo).max_element());
    let middle = scene.bounds().map_or(DVec3::ZERO, |(lo, hi)| (lo + hi) * 0.5);
    scene.meshes.push(skylit::scene::Mesh {
        name: "sphere".into(),
        geometry: shapes::icosphere(1.0, 5),
        material,
        source: None,
    });
    if let Geometry::Triangles(t) = &mut scene.meshes[mesh].geometry {
        // a vertex that no triangle uses and that nothing may take notice of
        t.positions.push(Vec3::splat(1e30));
        t.normals.clear();
    }
    (instance.mesh, instance.object_to_world) =
        (mesh, DAffine3::from_scale_rotation_translation(DVec3::splat(size * 0.2), DQuat::IDENTITY, middle));
    scene.instances.push(instance);
    (scene, mesh)
}

#[test]
fn gpu_deforming_mesh() {
    let device = device();
    let (scene, mesh) = sphere_on_a_plane();
    // the compute tracer once more, with trees that the device builds
    let all = tracers(&device).into_iter().map(|kind| (kind, None)).chain([(TracerKind::Compute, Some(0))]);
    for (kind, on_device) in all {
        let mut f = Follower::with_build(
            &device,
            kind,
            &scene,
            Motion { instances: Vec::new(), meshes: vec![mesh], ..Motion::default() },
            &BuildOptions { on_device, ..Default::default() },
        );
        let used = positions(&scene, mesh).len() - 1;
        for step in 0..3 {
            f.step(|s| waves(&mut positions_mut(s, mesh)[..used], step));
        }
        // spikes through the whole sphere: the tree suffers, and the next update builds it anew (the driver's once its traces take longer)
        let torn = f.step(|s| {
            for p in positions_mut(s, mesh)[..used].iter_mut().step_by(100) {
                *p = -*p;
            }
        });
        assert!(torn.rebuilt.is_empty());
        if kind == TracerKind::Compute {
            println!("{kind}: growth {}", torn.growth);
            assert!(torn.growth > 1.4);
        } else {
            f.tracer.traced(1.0);
            f.tracer.traced(1e6);
        }
        let rebuilt = f.step(|s| waves(&mut positions_mut(s, mesh)[..used], 1));
        assert_eq!(rebuilt.rebuilt, [mesh], "{kind}");
        assert_eq!(rebuilt.growth, 1.0);
        let after = f.step(|s| waves(&mut positions_mut(s, mesh)[..used], 2));
        assert!(after.rebuilt.is_empty());
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_moving_and_deforming() {
    let device = device();
    let (scene, mesh) = sphere_on_a_plane();
    let instances = vec![0, scene.instances.len() - 1];
    for kind in tracers(&device) {
        let mut f = Follower::new(
            &device,
            kind,
            &scene,
            Motion { instances: instances.clone(), meshes: vec![mesh], ..Motion::default() },
        );
        let used = positions(&scene, mesh).len() - 1;
        for step in 0..2 {
            f.step(|s| {
                waves(&mut positions_mut(s, mesh)[..used], step);
                wander(s, &instances[1..], step, 0.01);
            });
        }
    }
    assert_validation_clean(&device);
}

/// A mesh that is all there is, at the origin, has one level only; and stays watertight whatever it is refitted to.
#[test]
fn gpu_nothing_leaks_after_a_refit() {
    let device = device();
    let mut scene = scene("plane");
    scene.meshes[0].geometry = shapes::icosphere(1.0, 5);
    scene.instances[0].object_to_world = DAffine3::IDENTITY;
    let flat =
        FlatScene::with_motion(&scene, Motion { instances: Vec::new(), meshes: vec![0], ..Motion::default() }).unwrap();
    assert!(flat.is_single_level());
    let mut tracer = Tracer::new(&device, TracerKind::Compute, &flat, ALL).unwrap();
    let sphere = positions(&scene, 0).to_vec();
    let squeeze = DMat3::from_diagonal(DVec3::new(3.0, 0.01, 1.0));
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(2.0, 1.0, 0.0), DVec3::new(0.5, 3.0, 1.0));
    for m in [squeeze, shear, DMat3::from_diagonal(DVec3::splat(1e4)), DMat3::from_rotation_x(1.0)] {
        let moved: Vec<Vec3> = sphere.iter().map(|p| (m * p.as_dvec3()).as_vec3()).collect();
        positions_mut(&mut scene, 0).copy_from_slice(&moved);
        let changes =
            Changes { meshes: vec![MeshChange { mesh: 0, positions: &moved, normals: None }], ..Default::default() };
        let stats = tracer.update(&changes).unwrap();
        let oracle = Oracle::new(&scene, scene.origin());
        let rays = leak_rays(&oracle, 200_000, 7);
        let leaks = closest(&tracer, &rays).iter().filter(|h| !h.is_hit()).count();
        println!("{m:?}: {leaks} leaks of {}, growth {}", rays.len(), stats.growth);
        assert_eq!(leaks, 0);
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_bad_changes_are_refused_and_change_nothing() {
    let device = device();
    let (scene, mesh) = sphere_on_a_plane();
    let last = scene.instances.len() - 1;
    let good = positions(&scene, mesh).to_vec();
    let mut bad = good.clone();
    bad[5].y = f32::NAN;
    let place = scene.instances[last].object_to_world;
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = random_rays(&oracle, 5000, 3);
    for kind in tracers(&device) {
        let motion = Motion { instances: vec![last], meshes: vec![mesh], ..Motion::default() };
        let mut tracer = Tracer::new(&device, kind, &FlatScene::with_motion(&scene, motion).unwrap(), ALL).unwrap();
        let before = closest(&tracer, &rays);
        let deform = |mesh, positions| vec![MeshChange { mesh, positions, normals: None }];
        // each beside a good change, which must not take place either
        let moved = DAffine3::from_translation(DVec3::X) * place;
        for (instances, meshes, words) in [
            (vec![(0, place)], vec![], "was not declared as moving"),
            (vec![(last, moved), (last, flat)], vec![], "cannot be inverted"),
            (vec![(last, moved)], deform(0, &good), "was not declared as deforming"),
            (vec![(last, moved)], deform(mesh, &good[1..]), "vertices"),
            (vec![(last, moved)], deform(mesh, &bad), "vertex 5"),
        ] {
            let e = tracer.update(&Changes { instances, meshes, ..Changes::default() }).unwrap_err();
            assert!(matches!(e, Error::Usage(_) | Error::Scene(_)) && e.to_string().contains(words), "{e}");
            assert_eq!(before, closest(&tracer, &rays), "{kind}: {e}");
        }
        let e = common::tracer(&device, kind, &scene).update(&Changes::default()).unwrap_err();
        assert!(e.to_string().contains("with_motion"), "{e}");
    }
    let motion = Motion { instances: vec![last], meshes: Vec::new(), ..Motion::default() };
    let flat = FlatScene::with_motion(&scene, motion).unwrap();
    let e = Tracer::with_options(&device, TracerKind::Compute, &flat, ALL, Kernel::Nearest).err().unwrap();
    assert!(e.to_string().contains("--traversal wide"), "{e}");
    let spheres = by_name("spheres:5").unwrap();
    for motion in [
        Motion { instances: vec![999], meshes: Vec::new(), ..Motion::default() },
        Motion { instances: Vec::new(), meshes: vec![999], ..Motion::default() },
        Motion {
            instances: Vec::new(),
            meshes: spheres
                .meshes
                .iter()
                .position(|m| matches!(m.geometry, Geometry::Spheres(_)))
                .into_iter()
                .collect(),
            ..Motion::default()
        },
    ] {
        assert!(matches!(FlatScene::with_motion(&spheres, motion), Err(Error::Usage(_))));
    }
    assert_validation_clean(&device);
}

/// Bits of the hierarchy do not depend on whether a scene could change: what stays costs nothing.
#[test]
fn gpu_a_scene_that_stays_pays_nothing() {
    let device = device();
    let scene = scene("cornell-box");
    let stays = common::tracer(&device, TracerKind::Compute, &scene).stats();
    let none = FlatScene::with_motion(&scene, Motion::default()).unwrap();
    let stats = Tracer::new(&device, TracerKind::Compute, &none, ALL).unwrap().stats();
    assert_eq!((stays.structure_bytes, stays.stack_entries), (stats.structure_bytes, stats.stack_entries));
    let moves = Motion { instances: vec![0], meshes: Vec::new(), ..Motion::default() };
    let moves = Tracer::new(&device, TracerKind::Compute, &FlatScene::with_motion(&scene, moves).unwrap(), ALL)
        .unwrap()
        .stats();
    assert!(moves.structure_bytes > stays.structure_bytes);
}
