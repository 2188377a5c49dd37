//! Tracers that follow an animation: at every time the answers of the oracle, and of a tracer built anew.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};
use skylit::accel::flatten::FlatScene;
use skylit::gpu::Device;
use skylit::measure::parity::{judge_closest, judge_pair};
use skylit::measure::ray_sets::random_rays;
use skylit::oracle::Oracle;
use skylit::oracle::rounding::Rounding;
use skylit::scene::animation::{
    Animation, Channel, Interpolation, LocalTransform, Node, Playback, Pose, Property, RigParts, Sampler, Target,
    ValueChannel,
};
use skylit::scene::builtin::by_name;
use skylit::scene::{AnimationRig, Geometry, Scene};
use skylit::tracer::{Tracer, TracerKind};

use crate::common::{ALL, assert_validation_clean, closest, device, tracers};

const RAYS: usize = 30_000;

/// Plays `animation` at these times. Returns for each the share of rays that the pose before would have answered otherwise.
fn follow(device: &Arc<Device>, kind: TracerKind, scene: &Scene, animation: usize, times: &[f64]) -> Vec<f64> {
    let rig = scene.rig.as_ref().unwrap();
    let flat = FlatScene::with_motion(scene, rig.motion(animation).unwrap()).unwrap();
    let mut tracer = Tracer::new(device, kind, &flat, ALL).unwrap();
    let mut pose = Pose::default();
    let mut stale = Vec::new();
    for &seconds in times {
        rig.pose(animation, seconds, Playback::Loop, &mut pose).unwrap();
        let mut posed = scene.clone();
        pose.apply(&mut posed);
        let oracle = Oracle::new(&posed, flat.origin);
        let rays = random_rays(&oracle, RAYS, 5);
        let truth = oracle.trace_closest(&rays);
        let before = judge_closest(&oracle, &rays, &closest(&tracer, &rays), &truth, Rounding::default());
        tracer.update(&pose.changes()).unwrap();
        let hits = closest(&tracer, &rays);
        let report = judge_closest(&oracle, &rays, &hits, &truth, Rounding::default());
        println!("{} {kind} {seconds} s: {report}", scene.name);
        assert!(report.unexplained_fraction() <= 1e-5, "{kind} {seconds} s: {report}");
        assert!(report.hits > RAYS as u64 / 20, "the rays hardly meet the scene");
        let fresh = FlatScene { origin: flat.origin, ..FlatScene::new(&posed) };
        let fresh = Tracer::new(device, kind, &fresh, ALL).unwrap();
        let report = judge_pair(&oracle, &rays, &hits, &closest(&fresh, &rays), Rounding::default());
        assert!(report.unexplained_fraction() <= 1e-5, "{kind} {seconds} s against a new tracer: {report}");
        stale.push(before.unexplained_fraction());
    }
    stale
}

#[test]
fn gpu_an_animation_is_followed() {
    let device = device();
    let scene = by_name("parade").unwrap();
    for kind in tracers(&device) {
        for animation in 0..2 {
            let stale = follow(&device, kind, &scene, animation, &[0.0, 0.3, 0.95, 1.4, 2.0 + 0.3]);
            // each step moves something, which the check would detect
            assert!(stale[1..].iter().all(|s| *s > 1e-3), "{kind}: {stale:?}");
        }
    }
    assert_validation_clean(&device);
}

/// A block that shrinks to nothing, another that is nothing at first.
fn growing() -> Scene {
    let mut scene = by_name("stairs").unwrap();
    let mesh = scene.meshes.len();
    let size = scene.bounds().map_or(1.0, |(lo, hi)| (hi - lo).max_element());
    let cube = skylit::scene::builtin::shapes::cuboid(DVec3::splat(-0.1 * size), DVec3::splat(0.1 * size));
    assert!(matches!(cube, Geometry::Triangles(_)));
    scene.meshes.push(skylit::scene::Mesh { name: "cube".into(), geometry: cube, material: 0, source: None });
    let mut parts = RigParts { instances: vec![None; scene.instances.len()], ..RigParts::default() };
    parts.cameras = vec![None; scene.cameras.len()];
    let mut channels = Vec::new();
    for (node, ends) in [[1.0, 0.0], [0.0, 1.0]].into_iter().enumerate() {
        let local = LocalTransform::Trs {
            translation: DVec3::new(0.3 * size * (node as f64 - 0.5), 0.4 * size, 0.1 * size),
            rotation: DQuat::from_rotation_x(0.4),
            scale: DVec3::splat(ends[0]),
        };
        parts.nodes.push(Node { local, ..Node::default() });
        let instance = skylit::scene::Instance { name: "cube".into(), mesh, object_to_world: DAffine3::IDENTITY };
        scene.instances.push(instance);
        parts.instances.push(Some(node));
        let values = ends.map(|s| [s as f32; 3]).as_flattened().to_vec();
        let sampler = Sampler { interpolation: Interpolation::Linear, times: [0.0, 1.0].into(), values };
        channels.push(Channel { node, property: Property::Scale, sampler });
    }
    parts.animations = vec![Animation { name: "grow".into(), duration: 1.0, channels, ..Animation::default() }];
    AnimationRig::attach(&mut scene, parts).unwrap();
    scene
}

#[test]
fn gpu_what_shrinks_to_nothing_comes_back() {
    let device = device();
    let scene = growing();
    for kind in tracers(&device) {
        let stale = follow(&device, kind, &scene, 0, &[0.5, 0.0, 1e-8, 0.999_999, 0.25]);
        assert!(stale[0] > 1e-3 && stale[4] > 1e-3, "{kind}: {stale:?}");
    }
    assert_validation_clean(&device);
}

/// The growing scene, of whose animation a channel hides an instance, or all, from 1 s to 2 s.
fn switching(instances: &[usize]) -> Scene {
    let mut scene = growing();
    let mut parts = scene.rig.as_ref().unwrap().parts().clone();
    let node = parts.nodes.len();
    parts.nodes.push(Node::default());
    parts.switched_instances = instances.iter().map(|i| (*i, node)).collect();
    let (times, values) = ([0.0, 1.0, 2.0].into(), vec![1.0, 0.0, 1.0]);
    let sampler = Sampler { interpolation: Interpolation::Step, times, values };
    parts.animations[0].values.push(ValueChannel { target: Target::Visibility(node), sampler });
    parts.animations[0].duration = 3.0;
    AnimationRig::attach(&mut scene, parts).unwrap();
    scene
}

/// What is hidden is missed on every tracer, and hit again once it is shown; what is hidden from the first frame on, too.
#[test]
fn gpu_what_is_hidden_is_missed() {
    let device = device();
    // the largest block and what grows: one that moves and one that does not
    let last = growing().instances.len() - 1;
    let scene = switching(&[0, last]);
    for kind in tracers(&device) {
        let stale = follow(&device, kind, &scene, 0, &[1.5, 0.5, 1.0, 2.5, 1.9]);
        assert!(stale.iter().all(|s| *s > 1e-3), "{kind}: {stale:?}");
    }

    // hidden altogether
    let all: Vec<usize> = (0..=last).collect();
    let scene = switching(&all);
    let rig = scene.rig.as_ref().unwrap();
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = random_rays(&oracle, RAYS, 6);
    let flat = FlatScene::with_motion(&scene, rig.motion(0).unwrap()).unwrap();
    for kind in tracers(&device) {
        let mut tracer = Tracer::new(&device, kind, &flat, ALL).unwrap();
        let mut pose = Pose::default();
        for (seconds, hits) in [(0.5, true), (1.5, false), (2.5, true)] {
            rig.pose(0, seconds, Playback::Once, &mut pose).unwrap();
            tracer.update(&pose.changes()).unwrap();
            let hit = closest(&tracer, &rays).iter().filter(|h| h.instance != u32::MAX).count();
            assert_eq!(hit > RAYS / 20, hits, "{kind}, at {seconds} s: {hit} hits");
            assert!(hits || hit == 0, "{kind}: {hit} hits of what is hidden");
        }
        // hidden at rest: the tracer begins that way
        let mut at_rest = scene.clone();
        at_rest.hidden = all.iter().copied().collect();
        let flat = FlatScene::with_motion(&at_rest, rig.motion(0).unwrap()).unwrap();
        let tracer = Tracer::new(&device, kind, &flat, ALL).unwrap();
        assert!(closest(&tracer, &rays).iter().all(|h| h.instance == u32::MAX), "{kind}: hits before any update");
    }
    assert_validation_clean(&device);
}

#[test]
fn a_rig_must_fit_its_scene() {
    let mut scene = by_name("parade").unwrap();
    let good = scene.rig.take().unwrap().parts().clone();
    let refused = |change: &dyn Fn(&mut RigParts), says: &str| {
        let mut parts = good.clone();
        change(&mut parts);
        let error = AnimationRig::attach(&mut scene.clone(), parts).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(says) && !text.contains('\n') && error.exit_code() == 3, "{says}: {text}");
    };
    refused(&|p| p.nodes[0].parent = Some(0), "comes before its parent");
    refused(&|p| p.nodes[0].local = LocalTransform::Matrix(DAffine3::from_scale(DVec3::NAN)), "not finite");
    refused(&|p| p.instances.truncate(1), "instances are on nodes");
    refused(&|p| p.cameras[0] = Some(999), "of only");
    refused(&|p| p.skins[0].joints[1] = 999, "joint node 999 does not exist");
    refused(&|p| p.skins[0].inverse_bind.truncate(2), "3 joints and 2 inverse bind matrices");
    refused(&|p| p.deformations[0].mesh = 0, "vertices");
    refused(&|p| p.deformations[0].mesh = 99, "mesh 99 does not exist");
    refused(&|p| p.deformations[1].mesh = p.deformations[0].mesh, "deforms in two ways");
    refused(&|p| p.deformations[0].influences[0].joints[5] = [7; 4], "vertex 5 is bound to joint 7 of only 3");
    refused(&|p| p.deformations[0].influences[0].weights[5][1] = f32::NAN, "vertex 5");
    refused(&|p| p.deformations[1].targets.truncate(1), "1 morph targets");
    refused(&|p| p.deformations[1].targets[1].positions[3].y = f32::NAN, "morph target 1 is not finite at vertex 3");
    refused(&|p| p.animations[0].channels[2].node = 999, "animation 0 `parade`, channel 2: node 999");
    refused(&|p| p.animations[0].channels[0].sampler.times = [1.0, 0.0].into(), "channel 0: the time of key 1");
    refused(
        &|p| p.animations[1].channels[0].sampler.values[4] = f32::INFINITY,
        "animation 1 `bend`, channel 0: a value of key 1",
    );
}
