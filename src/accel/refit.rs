//! Refitting: the boxes of a wide hierarchy are recomputed bottom-up for leaves that have moved,
//! while its topology stays (Wald, Boulos, Shirley, "Ray Tracing Deformable Scenes Using Dynamic
//! Bounding Volume Hierarchies", TOG 2007). Boxes are quantised by the same code as at the build,
//! so a refit to unchanged leaves changes no bit.
//!
//! [`RefitPolicy`] decides when a tree that was refitted repeatedly should be rebuilt.

use std::ops::Range;

use rayon::prelude::*;

use super::Aabb;
use super::wide::{self, Block, WIDTH, WideBvh};

/// Minimum number of blocks refitted by one thread: below that, scheduling costs more than the
/// work.
const TASK_BLOCKS: usize = 2048;
/// Approximate maximum number of parallel tasks: a few per thread of any machine.
const TASKS: usize = 128;

/// How a tree is refitted in parallel: its subtrees whose blocks below the root lie side by side,
/// and what is above them. It stays valid until the tree is rebuilt.
#[derive(Clone, Debug)]
pub struct RefitPlan {
    /// Roots of subtrees, and the blocks below each; in the order of the blocks.
    tasks: Vec<(u32, Range<usize>)>,
    /// All other blocks and the roots of `tasks`, ascending.
    rest: Vec<u32>,
}

/// Result of a refit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitResult {
    /// Padded bounds of the tree; `None` if it is empty.
    pub bounds: Option<Aabb>,
    /// SAH cost of the refitted tree, as [`WideBvh::sah_cost`].
    pub sah_cost: f64,
}

impl RefitPlan {
    /// Plans the refit of a tree whose node references count its first block as `base`.
    pub fn new(blocks: &[Block], base: u32) -> Self {
        let below = descendants(blocks, base);
        let most = (blocks.len() / TASKS).max(TASK_BLOCKS) as u32;
        let (mut tasks, mut rest, mut work) = (Vec::new(), Vec::new(), vec![0usize]);
        while let Some(n) = work.pop() {
            rest.push(n as u32);
            if wide::is_leaf(&blocks[n]) {
                continue;
            }
            let children = || wide::children(&blocks[n]).map(|(_, c)| (c - base) as usize);
            let [count, last] = below[n];
            let first = children().next().unwrap_or(n + 1);
            if count > 0 && count <= most && last as usize + 1 - first == count as usize {
                tasks.push((n as u32, first..last as usize + 1));
            } else {
                work.extend(children());
            }
        }
        tasks.sort_unstable_by_key(|t| t.1.start);
        rest.sort_unstable();
        Self { tasks, rest }
    }
}

/// Returns for every block how many are below it, and the last of them (itself where there is
/// none). Children have larger numbers.
fn descendants(blocks: &[Block], base: u32) -> Vec<[u32; 2]> {
    let mut out: Vec<[u32; 2]> = (0..blocks.len() as u32).map(|n| [0, n]).collect();
    for n in (0..blocks.len()).rev().filter(|&n| !wide::is_leaf(&blocks[n])) {
        let mut sum = [0, n as u32];
        for (_, child) in wide::children(&blocks[n]) {
            let c = out[(child - base) as usize];
            sum = [sum[0] + c[0] + 1, sum[1].max(c[1])];
        }
        out[n] = sum;
    }
    out
}

/// Refits a tree in place. Its node references count its first block as `base`. `leaf` rewrites a
/// leaf and returns its box; boxes are widened by `pad`. The plan must be that of this tree.
pub fn refit(
    blocks: &mut [Block],
    base: u32,
    plan: &RefitPlan,
    pad: f32,
    leaf: impl Fn(&mut Block) -> Aabb + Sync,
) -> RefitResult {
    let padded = |block: &mut Block| {
        let b = leaf(block);
        Aabb { min: b.min - pad, max: b.max + pad }
    };

    // each task gets its own slice of the blocks
    let mut roots: Vec<Block> = plan.tasks.iter().map(|t| blocks[t.0 as usize]).collect();
    let mut parts = Vec::with_capacity(plan.tasks.len());
    let (mut left, mut at) = (&mut *blocks, 0);
    for (task, root) in plan.tasks.iter().zip(&mut roots) {
        let (part, others) = left.split_at_mut(task.1.start - at).1.split_at_mut(task.1.len());
        (left, at) = (others, task.1.end);
        parts.push((root, base + task.1.start as u32, part));
    }

    // subtrees in parallel, children before parents
    let done: Vec<(Aabb, f64)> = parts
        .into_par_iter()
        .map_init(Vec::new, |boxes, (root, first, part)| {
            boxes.clear();
            boxes.resize(part.len(), Aabb::EMPTY);
            let mut area = 0.0;
            for k in (0..part.len()).rev() {
                boxes[k] = fit(&mut part[k], &padded, |child| boxes[(child - first) as usize]);
                area += boxes[k].half_area() as f64;
            }
            let bounds = fit(root, &padded, |child| boxes[(child - first) as usize]);
            (bounds, area + bounds.half_area() as f64)
        })
        .collect();

    // what is above, with the subtrees' roots in their places
    let mut boxes = vec![Aabb::EMPTY; plan.rest.len()];
    let mut area = done.iter().map(|d| d.1).sum::<f64>();
    let place = |n: u32| plan.rest.partition_point(|&r| r < n);
    let mut finished = vec![false; plan.rest.len()];
    for ((task, root), d) in plan.tasks.iter().zip(roots).zip(&done) {
        blocks[task.0 as usize] = root;
        boxes[place(task.0)] = d.0;
        finished[place(task.0)] = true;
    }
    for k in (0..plan.rest.len()).rev().filter(|&k| !finished[k]) {
        boxes[k] = fit(&mut blocks[plan.rest[k] as usize], &padded, |child| boxes[place(child - base)]);
        area += boxes[k].half_area() as f64;
    }

    // the cost is relative to the area of the whole
    match boxes.first() {
        Some(b) if b.min.cmple(b.max).all() => {
            // a point or a line has no area, and every box is visited
            let whole = b.half_area() as f64;
            RefitResult { bounds: Some(*b), sah_cost: if whole > 0.0 { area / whole } else { blocks.len() as f64 } }
        }
        _ => RefitResult { bounds: None, sah_cost: 0.0 },
    }
}

/// Rewrites one block and gives its box.
fn fit(block: &mut Block, leaf: &impl Fn(&mut Block) -> Aabb, box_of: impl Fn(u32) -> Aabb) -> Aabb {
    if wide::is_leaf(block) {
        return leaf(block);
    }
    let (mut children, mut count, mut bounds) = ([(0usize, Aabb::EMPTY); WIDTH], 0, Aabb::EMPTY);
    for (slot, child) in wide::children(block) {
        children[count] = (slot, box_of(child));
        bounds = bounds.union(children[count].1);
        count += 1;
    }
    // the root over nothing
    if count > 0 {
        *block = wide::node(bounds, &children[..count], wide::first_child(block));
    }
    bounds
}

impl WideBvh {
    /// Refits this tree, for callers that keep it on the host: see [`refit`].
    pub fn refit(&mut self, plan: &RefitPlan, pad: f32, leaf: impl Fn(&mut Block) -> Aabb + Sync) {
        let refitted = refit(&mut self.blocks, 0, plan, pad, leaf);
        (self.bounds, self.sah_cost) = (refitted.bounds, refitted.sah_cost);
    }
}

/// Decides when to rebuild a tree instead of refitting it once more.
///
/// The expected cost of a ray grows with the surface areas of the boxes, so a tree whose SAH cost
/// is `g` times that at its build makes a trace of `T` seconds take `T (1 - 1/g)` longer than it
/// had to. These losses are added up; once they exceed what a build takes beyond a refit, the tree
/// is rebuilt. That is the ski-rental rule (buy when the rent paid equals the price), which costs
/// at most twice the optimal schedule. Lauterbach, Yoon, Tuft, Manocha, "RT-DEFORM: Interactive Ray
/// Tracing of Dynamic Scenes Using BVHs", RT 2006, watch areas in the same way and rebuild at a
/// fixed growth; so does this policy while trace times are unknown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitPolicy {
    built_cost: f64,
    growth: f64,
    build_seconds: f64,
    refit_seconds: f64,
    lost_seconds: f64,
    timed: bool,
}

impl RefitPolicy {
    /// Growth of the SAH cost at which a tree is rebuilt while no trace has been timed.
    pub const GROWTH_UNTIMED: f64 = 1.4;

    /// The policy of a tree that was built in `build_seconds` with this [`WideBvh::sah_cost`].
    pub fn new(sah_cost: f64, build_seconds: f64) -> Self {
        Self { built_cost: sah_cost, growth: 1.0, build_seconds, refit_seconds: 0.0, lost_seconds: 0.0, timed: false }
    }

    /// Records a refit that took `seconds` and resulted in this SAH cost.
    pub fn refitted(&mut self, sah_cost: f64, seconds: f64) {
        self.refit_seconds = seconds;
        self.costs(sah_cost);
    }

    /// Records the current SAH cost. Values that are not positive numbers are ignored.
    pub fn costs(&mut self, sah_cost: f64) {
        let growth = sah_cost / self.built_cost;
        if growth.is_finite() && growth > 0.0 {
            self.growth = growth;
        }
    }

    /// Records seconds spent tracing this tree since the last refit or build.
    pub fn traced(&mut self, seconds: f64) {
        if seconds.is_finite() && seconds >= 0.0 {
            self.timed = true;
            self.lost_seconds += seconds * (1.0 - 1.0 / self.growth).max(0.0);
        }
    }

    /// Have the accumulated losses exceeded the price of a rebuild?
    pub fn should_rebuild(&self) -> bool {
        if self.timed {
            self.lost_seconds > (self.build_seconds - self.refit_seconds).max(0.0)
        } else {
            self.growth >= Self::GROWTH_UNTIMED
        }
    }

    /// Current SAH cost over that at the build.
    pub fn growth(&self) -> f64 {
        self.growth
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::accel::{BuildPreset, build};

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
}
