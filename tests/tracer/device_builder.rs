//! Hierarchies that the device builds: each is one, holds what it was built from, is the same each time, and as good as the host's.

use glam::Vec3;
use skylit::accel::flatten::FlatScene;
use skylit::accel::wide::{Block, is_leaf};
use skylit::accel::{Aabb, BuildPreset, RefitPlan, WideBvh, build};
use skylit::measure::ray_sets::random_rays;
use skylit::oracle::Oracle;
use skylit::scene::load;
use skylit::tracer::DeviceBuilder;
use skylit::tracer::visits::VisitCounter;

use crate::common;
use crate::common::{assert_validation_clean, device};

/// Small boxes all over the place, of which the last three of four are flat.
fn boxes(n: usize, scale: f32, offset: f32) -> Vec<Aabb> {
    let small = |i: usize| {
        let c = Vec3::new((i * 37 % 101) as f32, (i * 61 % 89) as f32, (i * 17 % 97) as f32) * scale + offset;
        let r = Vec3::new(0.0, 0.1 + (i % 7) as f32, 3.0) * scale;
        Aabb { min: c - r, max: c + r }
    };
    (0..n).map(small).collect()
}

/// By how much boxes are padded (docs/design/numerics.md).
fn padding(boxes: &[Aabb]) -> f32 {
    let reach = boxes.iter().fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
    (4.0 * f32::EPSILON * reach).max(1e-30)
}

/// A leaf that holds nothing but a number.
fn numbered(item: u32) -> Block {
    let mut block = Block::default();
    block.body[0] = item;
    block
}

fn padded(boxes: &[Aabb]) -> Vec<Aabb> {
    let pad = padding(boxes);
    boxes.iter().map(|b| Aabb { min: b.min - pad, max: b.max + pad }).collect()
}

fn built(builder: &DeviceBuilder, boxes: &[Aabb], max_depth: u32) -> WideBvh {
    builder.build(&padded(boxes), max_depth, numbered).unwrap()
}

fn built_by_host(boxes: &[Aabb]) -> WideBvh {
    WideBvh::collapse(&build::tree(&padded(boxes), BuildPreset::Default, None), numbered)
}

/// A tree is one over these boxes, each once. Its boxes are those that the host makes of the same topology, to the bit: a refit changes nothing.
fn check(tree: &WideBvh, boxes: &[Aabb], what: &str) {
    let mut items: Vec<u32> = tree.blocks.iter().filter(|b| is_leaf(b)).map(|b| b.body[0]).collect();
    items.sort_unstable();
    assert!(items.into_iter().eq(0..boxes.len() as u32), "{what}: not every item has one leaf");
    let bounds_of = |b: &Block| boxes[b.body[0] as usize];
    tree.validate(bounds_of).unwrap_or_else(|e| panic!("{what}: {e}"));
    assert!(tree.sah_cost.is_finite(), "{what}: {}", tree.sah_cost);
    let mut refitted = tree.clone();
    refitted.refit(&RefitPlan::new(&tree.blocks, 0), padding(boxes), |b| bounds_of(b));
    assert!(refitted.blocks == tree.blocks, "{what}: a refit changes the boxes");
    assert_eq!(refitted.bounds, tree.bounds, "{what}");
    // the refit's areas leave the range of a float where coordinates do that of their squares
    let is_other = (refitted.sah_cost - tree.sah_cost).abs() > 1e-3 * tree.sah_cost;
    let has_area = tree.bounds.is_some_and(|b| (1e-30..1e30).contains(&b.half_area()));
    assert!(!(is_other && has_area), "{what}: cost {}, after a refit {}", tree.sah_cost, refitted.sah_cost);
}

#[test]
fn gpu_trees_of_every_size_and_scale_are_valid() {
    let builder = DeviceBuilder::new(&device(), 0).unwrap();
    for n in (0..40).chain([100, 1000, 20_000]) {
        for (scale, offset) in [(1.0, 0.0), (1e-3, 10.0), (1e5, -1e6)] {
            let boxes = boxes(n, scale, offset);
            check(&built(&builder, &boxes, 48), &boxes, &format!("{n} boxes at scale {scale}, offset {offset}"));
        }
    }
    assert_validation_clean(&device());
}

/// Areas beyond the range of a float, below it, and none at all: all boxes equal, in a plane, on a line.
#[test]
fn gpu_trees_of_any_shape_end() {
    let builder = DeviceBuilder::new(&device(), 0).unwrap();
    for (scale, offset) in [(1e18, 0.0), (1e16, -1e18), (1e-30, 0.0), (0.0, 1.0), (0.0, 0.0)] {
        let boxes = boxes(3000, scale, offset);
        check(&built(&builder, &boxes, 48), &boxes, &format!("scale {scale}, offset {offset}"));
        // equal boxes are halved
        assert!(scale > 0.0 || builder.stats().rounds == 12, "{:?}", builder.stats());
    }
    for axes in [Vec3::new(1.0, 1.0, 0.0), Vec3::Y] {
        let boxes: Vec<Aabb> =
            boxes(3000, 1.0, 0.0).iter().map(|b| Aabb { min: b.min * axes, max: b.max * axes }).collect();
        check(&built(&builder, &boxes, 48), &boxes, &format!("{axes}"));
    }
    assert_validation_clean(&device());
}

/// A chain, each box nearer to what is before it than to what follows: merged one by one it would be as deep as it is long.
#[test]
fn gpu_depth_is_bounded() {
    let builder = DeviceBuilder::new(&device(), 0).unwrap();
    let at = |i: i32| Vec3::splat(1.02f32.powi(i));
    let chain: Vec<Aabb> = (0..2000).map(|i| Aabb { min: at(i - 1000), max: at(i - 1000) * 1.001 }).collect();
    for (boxes, max_depth) in [(&chain, 48), (&chain, 11), (&boxes(5000, 1.0, 0.0), 13)] {
        let tree = built(&builder, boxes, max_depth);
        check(&tree, boxes, "a chain");
        assert!(tree.depth <= max_depth, "{} levels, at most {max_depth}", tree.depth);
    }
}

#[test]
fn gpu_builds_are_the_same_each_time() {
    let device = device();
    let boxes = boxes(20_000, 1.0, 0.0);
    let first = built(&DeviceBuilder::new(&device, 0).unwrap(), &boxes, 48);
    let builder = DeviceBuilder::new(&device, 0).unwrap();
    for _ in 0..3 {
        // after a larger one, whose memory it has
        built(&builder, &self::boxes(30_000, 2.0, 1.0), 48);
        assert!(built(&builder, &boxes, 48).blocks == first.blocks);
    }
}

/// What a device cannot take is refused.
#[test]
fn gpu_boxes_that_are_too_far_away_are_refused() {
    let far = [Aabb { min: Vec3::splat(-1e38), max: Vec3::splat(1e38) }];
    let refused = DeviceBuilder::new(&device(), 0).unwrap().build(&far, 48, numbered);
    assert!(refused.is_err_and(|e| e.to_string().contains("coordinates")));
}

/// Rays visit at most a tenth more blocks than in the trees of the host's default.
#[test]
fn gpu_trees_are_as_good_as_the_hosts() {
    let device = device();
    let builder = DeviceBuilder::new(&device, 0).unwrap();
    let shared = common::shared_scenes()
        .into_iter()
        .flat_map(|folder| Some(folder.join("bunny/bunny.glb")).filter(|f| f.exists()));
    let named = ["builtin:terrain:20000", "builtin:city:20000", "builtin:room:20000"].map(str::to_owned);
    for name in named.into_iter().chain(shared.map(|f| f.to_string_lossy().into_owned())) {
        let scene = load::load(&name).unwrap();
        let flat = FlatScene::new(&scene);
        let own = VisitCounter::with_builder(&flat, Some(&builder)).unwrap();
        let hosts = VisitCounter::new(&flat).unwrap();
        let rays = random_rays(&Oracle::new(&scene, scene.origin()), 10_000, 5);
        for any in [false, true] {
            let visits = [&own, &hosts].map(|c| c.mean(&rays, any)).map(|v| v.nodes + v.leaves);
            let ratio = visits[0] / visits[1];
            println!("{name}, any {any}: {visits:.1?} blocks a ray, {ratio:.3} times as many");
            assert!(ratio <= 1.1, "{name}: {visits:?}");
        }
    }
    assert_validation_clean(&device);
}

/// Large trees of evenly spread boxes cost what the host's do.
#[test]
fn gpu_costs_are_those_of_the_host() {
    let builder = DeviceBuilder::new(&device(), 0).unwrap();
    let boxes = boxes(20_000, 1.0, 0.0);
    let costs = [built(&builder, &boxes, 48), built_by_host(&boxes)].map(|t| t.sah_cost);
    println!("costs {costs:.2?}, {:?}", builder.stats());
    assert!(costs[0] <= 1.1 * costs[1], "{costs:?}");
}
