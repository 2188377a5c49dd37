//! Trees of shapes that move are refitted: boxes hold what is below them, and work is left out where nothing has moved.

use glam::Vec3;
use skylit::accel::refit::{RefitPlan, RefitPolicy, refit};
use skylit::accel::wide::{self, Block, WideBvh};
use skylit::accel::{Aabb, BuildPreset, build};

const PAD: f32 = 1e-3;

fn boxes(n: usize, seed: u32, spread: f32) -> Vec<Aabb> {
    let mut state = seed;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    (0..n)
        .map(|_| {
            let c = Vec3::new(random(), random(), random()) * spread;
            let r = Vec3::new(random(), random(), 0.0);
            Aabb { min: c - r, max: c + r }
        })
        .collect()
}

fn tree(boxes: &[Aabb]) -> WideBvh {
    if boxes.is_empty() {
        return WideBvh::default();
    }
    let padded: Vec<_> = boxes.iter().map(|b| Aabb { min: b.min - PAD, max: b.max + PAD }).collect();
    WideBvh::collapse(&build::tree(&padded, BuildPreset::Default, None), wide::tests::of_item)
}

const SIZES: [usize; 10] = [0, 1, 2, 7, 8, 50, 1000, 5000, 20_000, 70_000];

#[test]
fn a_refit_to_the_same_boxes_changes_no_bit() {
    for n in SIZES {
        let b = boxes(n, 1, 100.0);
        let built = tree(&b);
        let mut refitted = built.clone();
        refitted.refit(&RefitPlan::new(&built.blocks, 0), PAD, |block| b[block.body[0] as usize]);
        assert!(built.blocks == refitted.blocks, "{n} boxes");
        assert_eq!(built.bounds, refitted.bounds);
        assert!(
            (built.sah_cost - refitted.sah_cost).abs() <= 1e-3 * built.sah_cost,
            "{n}: {} {}",
            built.sah_cost,
            refitted.sah_cost
        );
    }
}

#[test]
fn refitted_trees_hold_what_has_moved_wherever_they_lie() {
    for n in SIZES {
        // a little, everything elsewhere, far away, all in one point
        for (seed, spread) in [(1, 101.0), (2, 100.0), (3, 1e6), (4, 0.0)] {
            let (before, after) = (boxes(n, 1, 100.0), boxes(n, seed, spread));
            let mut built = tree(&before);
            let base = 1234;
            let mut moved: Vec<_> = built.blocks.iter().map(|b| wide::rebased(*b, base)).collect();
            let plan = RefitPlan::new(&moved, base);
            let leaf = |block: &mut Block| after[block.body[0] as usize];
            refit(&mut moved, base, &plan, PAD, leaf);
            built.refit(&plan, PAD, leaf);
            assert!(built.blocks.iter().zip(&moved).all(|(a, b)| wide::rebased(*a, base) == *b));
            built.validate(|b| after[b.body[0] as usize]).unwrap_or_else(|e| panic!("{n} boxes, seed {seed}: {e}"));
            // and a tree that was not refitted would not
            if n > 0 && seed == 3 {
                assert!(tree(&before).validate(|b| after[b.body[0] as usize]).is_err());
            }
        }
    }
}

#[test]
fn large_trees_are_refitted_in_parts() {
    let b = boxes(70_000, 1, 100.0);
    let plan = RefitPlan::new(&tree(&b).blocks, 0);
    assert!(
        plan.tasks.len() > 8 && plan.rest.len() < 5000,
        "{} parts, {} blocks above",
        plan.tasks.len(),
        plan.rest.len()
    );
}

#[test]
fn shuffled_leaves_cost_more_and_the_way_back_restores_the_cost() {
    let b = boxes(5000, 1, 100.0);
    let mut t = tree(&b);
    let (cost, plan) = (t.sah_cost, RefitPlan::new(&t.blocks, 0));
    t.refit(&plan, PAD, |block| b[(block.body[0] as usize * 2503) % 5000]);
    assert!(t.sah_cost > 3.0 * cost, "{} after {cost}", t.sah_cost);
    t.refit(&plan, PAD, |block| b[block.body[0] as usize]);
    assert!((t.sah_cost - cost).abs() < 1e-3 * cost);
}

#[test]
fn the_policy_rebuilds_when_the_loss_exceeds_the_price() {
    let mut p = RefitPolicy::new(50.0, 0.5);
    p.refitted(100.0, 0.1);
    // half of each trace is lost: after eight it is the 0.4 seconds that a rebuild takes beyond
    // a refit
    for k in 1..=7 {
        p.traced(0.1);
        assert!((p.lost_seconds - 0.05 * k as f64).abs() < 1e-12);
        assert!(!p.should_rebuild(), "{p:?}");
    }
    p.traced(0.11);
    assert!(p.should_rebuild());
}

#[test]
fn a_tree_that_did_not_suffer_is_never_rebuilt() {
    let mut p = RefitPolicy::new(50.0, 0.001);
    for cost in [50.0, 40.0, f64::NAN, 0.0] {
        p.refitted(cost, 0.0);
        p.traced(100.0);
    }
    assert!(!p.should_rebuild() && p.lost_seconds == 0.0);
}

#[test]
fn without_times_growth_decides() {
    let mut p = RefitPolicy::new(50.0, 1e9);
    p.refitted(69.0, 0.0);
    assert!(!p.should_rebuild());
    p.refitted(71.0, 0.0);
    assert!(p.should_rebuild());
    assert_eq!(p.growth(), 1.42);
    // with times, the price does
    p.traced(1.0);
    assert!(!p.should_rebuild());
}
