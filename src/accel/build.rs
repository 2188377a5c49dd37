//! Building binary trees: from the top down by the surface-area heuristic (`sah.rs`) where time
//! matters most; by obvhs's clustering and reinsertion (Meister and Bittner, "Parallel
//! Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", TVCG 2018) by default;
//! with spatial splits (`spatial.rs`) and reinsertion (`reinsert.rs`) where build time does not
//! matter. docs/design/bvh.md links the measurements behind the choice.
//!
//! The depth of what comes out is bounded, whatever the input: the builders halve where they would
//! go deeper, and a subtree that reinsertion made too deep is replaced by a balanced one over the
//! same leaves.

use glam::Vec3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;

use super::clip::Triangles;
use super::reinsert::{self, ReinsertionOptions};
use super::{Aabb, sah, spatial};

/// Maximum depth of a tree: inner nodes on the longest path. A balanced tree over 2^27 primitives
/// needs 27.
pub const MAX_DEPTH: u32 = 48;

/// Trade-off between build time and traversal speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BuildPreset {
    /// Least build time: the heuristic alone.
    Fast,
    /// Clustering and reinsertion where primitives are of uneven size, else the heuristic and
    /// reinsertion as far as it pays.
    #[default]
    Default,
    /// Spatial splits (up to 30 % more references) and thorough reinsertion.
    Best,
}

impl BuildPreset {
    /// Chooses a preset for a number of primitives and an expected number of rays. On Sponza
    /// `Default` traces faster than `Fast` for little more building, on the dragon hardly
    /// (docs/design/bvh.md): with fewer rays than primitives that does not pay back,
    /// and above ten million primitives the fastest build is used.
    ///
    /// Never `Best`: three times the build time for hardly anything on the dragon, and on Sponza
    /// for closest hits alone; any hits are slower, because a large triangle that is left whole
    /// high up in the tree is an occluder that is found early.
    pub fn auto(primitives: usize, rays: u64) -> Self {
        if primitives >= 10_000_000 || rays < primitives as u64 { Self::Fast } else { Self::Default }
    }

    fn reinsertion(self) -> ReinsertionOptions {
        match self {
            Self::Fast => ReinsertionOptions { share: 0.0, rounds: 0, worthwhile: 1.0 },
            Self::Default => ReinsertionOptions { share: 0.003, rounds: 16, worthwhile: 0.001 },
            Self::Best => ReinsertionOptions { share: 0.02, rounds: 16, worthwhile: 0.001 },
        }
    }
}

/// References that spatial splits may add, relative to the number of primitives.
const SPLIT_BUDGET: f32 = 0.3;
/// Cost of visiting a node, relative to that of testing a primitive, when leaves are merged.
const NODE_COST: f32 = 3.0;

impl obvhs::Boundable for Aabb {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.to_vec3a(), self.max.to_vec3a())
    }
}

/// Builds a tree over 1 to 2^27 boxes, none empty or NaN. With `collapse`, leaves contain up to
/// that many primitives where that lowers the SAH cost; otherwise one each. Primitives are never
/// split: `Best` is the heuristic from the top down with thorough reinsertion.
pub fn tree(boxes: &[Aabb], preset: BuildPreset, collapse: Option<u32>) -> Bvh2 {
    let mut tree = whole(boxes, preset, 0.0);
    if let Some(max_leaf) = collapse {
        obvhs::bvh2::leaf_collapser::collapse(&mut tree, max_leaf, NODE_COST);
        // needed by obvhs only
        tree.parents = Vec::new();
    }
    tree
}

/// Builds a tree over primitives with these boxes, each widened by `pad` on all sides. `Best` may
/// split primitives: one may be referenced by several leaves, whose boxes together contain it and
/// its surroundings up to `pad`. `triangles` gives the triangles of each primitive.
pub fn tree_with_splits(boxes: &[Aabb], triangles: &impl Triangles, preset: BuildPreset, pad: f32) -> Bvh2 {
    match preset {
        BuildPreset::Fast | BuildPreset::Default => whole(boxes, preset, pad),
        BuildPreset::Best => finish(spatial::tree(boxes, triangles, SPLIT_BUDGET, pad), boxes.len(), preset),
    }
}

fn whole(boxes: &[Aabb], preset: BuildPreset, pad: f32) -> Bvh2 {
    let grow = |b: &Aabb| Aabb { min: b.min - pad, max: b.max + pad };
    // where sizes are alike, clustering gives no better a tree, for more time; and it pairs one of
    // k equal boxes at a time: k^2 work for a chain of depth k
    if preset == BuildPreset::Default && boxes.len() > 2 && are_uneven(boxes) && !seems_to_repeat(boxes) {
        let boxes: Vec<Aabb> = boxes.par_iter().map(grow).collect();
        return limit_depth(clustered(&boxes), MAX_DEPTH);
    }
    let mut items: Vec<sah::Item> =
        boxes.par_iter().enumerate().map(|(i, b)| sah::Item::new(grow(b), i as u32)).collect();
    let nodes = sah::tree(&mut items);
    drop(items);
    finish(nodes, boxes.len(), preset)
}

/// Is the mean surface area of an evenly spaced sample of the boxes more than three times the
/// median? The ratio is high for architecture (Sponza: 7) and low for scanned surfaces (dragon:
/// 1.3). The largest hundredth does not count: a ground of two triangles under a city of a million
/// makes it no less even.
fn are_uneven(boxes: &[Aabb]) -> bool {
    let mut areas: Vec<f32> = boxes.iter().step_by(boxes.len().div_ceil(4096).max(1)).map(Aabb::half_area).collect();
    areas.sort_unstable_by(f32::total_cmp);
    areas.truncate(areas.len() - areas.len().div_ceil(100));
    let mean = areas.iter().map(|&a| f64::from(a)).sum::<f64>() / areas.len() as f64;
    mean > 3.0 * f64::from(areas[areas.len() / 2])
}

fn clustered(boxes: &[Aabb]) -> Bvh2 {
    let config = obvhs::BvhBuildParams::medium_build();
    let (distance, precision, threshold) =
        (config.ploc_search_distance, config.sort_precision, config.search_depth_threshold);
    let indices = (0..boxes.len() as u32).collect();
    let mut tree =
        obvhs::ploc::PlocBuilder::with_capacity(boxes.len()).build(distance, boxes, indices, precision, threshold);
    obvhs::bvh2::reinsertion::ReinsertionOptimizer::default().run(&mut tree, config.reinsertion_batch_ratio, None);
    // needed by obvhs only
    tree.parents = Vec::new();
    tree
}

/// Does an evenly spaced sample of the boxes contain duplicates? Duplicates too rare for the sample
/// are too few to matter.
fn seems_to_repeat(boxes: &[Aabb]) -> bool {
    // equal as numbers is equal as bits, once -0 is 0
    let bits = |v: Vec3| (v + 0.0).to_array().map(f32::to_bits);
    let mut seen = std::collections::HashSet::new();
    boxes.iter().step_by(boxes.len().div_ceil(4096).max(1)).any(|b| !seen.insert((bits(b.min), bits(b.max))))
}

fn finish(mut nodes: Vec<Bvh2Node>, primitives: usize, preset: BuildPreset) -> Bvh2 {
    reinsert::optimise(&mut nodes, preset.reinsertion());
    limit_depth(Bvh2 { nodes, primitive_indices: (0..primitives as u32).collect(), ..Default::default() }, MAX_DEPTH)
}

/// Expected cost of a ray by the surface-area heuristic: nodes that it visits and primitives that
/// it tests, if it hits the root's box and nothing else (MacDonald and Booth 1990).
#[cfg(test)]
pub fn cost(tree: &Bvh2) -> f64 {
    let area = |n: &Bvh2Node| node_box(n).half_area() as f64 * n.prim_count.max(1) as f64;
    let all: f64 = tree.nodes.par_iter().with_min_len(1 << 14).map(area).sum();
    all / (node_box(&tree.nodes[0]).half_area() as f64).max(f64::MIN_POSITIVE)
}

/// Checks a tree against what it was built from: nodes in pairs, each with one parent; every box
/// contains its children's; every primitive is in a leaf, whole or (where `triangles` are given) in
/// parts that cover it; no deeper than [`MAX_DEPTH`].
///
/// # Errors
/// A description of the first defect.
pub fn validate(tree: &Bvh2, boxes: &[Aabb], triangles: Option<&dyn Triangles>) -> Result<(), String> {
    let mut parts: Vec<Vec<Aabb>> = vec![Vec::new(); boxes.len()];

    // from the root down: each node once, within its parent, its leaves' primitives noted
    let (mut seen, mut work) = (vec![false; tree.nodes.len()], vec![(0usize, None::<Aabb>, 0u32)]);
    while let Some((at, above, depth)) = work.pop() {
        let node = tree.nodes.get(at).ok_or(format!("node {at} is out of range"))?;
        if std::mem::replace(&mut seen[at], true) {
            return Err(format!("node {at} has two parents"));
        }
        if depth > MAX_DEPTH {
            return Err(format!("node {at} is at depth {depth}"));
        }
        let b = node_box(node);
        if above.is_some_and(|a| !a.contains(&b)) {
            return Err(format!("node {at} sticks out of its parent"));
        }
        let first = node.first_index as usize;
        if !node.is_leaf() {
            if first.is_multiple_of(2) {
                return Err(format!("the children of node {at} are no pair"));
            }
            work.extend([(first, Some(b), depth + 1), (first + 1, Some(b), depth + 1)]);
            continue;
        }
        for slot in first..first + node.prim_count as usize {
            let &p = tree.primitive_indices.get(slot).ok_or(format!("slot {slot} is out of range"))?;
            parts.get_mut(p as usize).ok_or(format!("primitive {p} is out of range"))?.push(b);
        }
    }

    // nodes that were never reached belong to no tree
    if let Some(at) = seen.iter().position(|s| !s) {
        return Err(format!("node {at} is in no tree"));
    }

    // leaves may hold parts of a triangle, which together have to cover it
    for (p, (whole, parts)) in boxes.iter().zip(&parts).enumerate() {
        let contained = match (parts.as_slice(), triangles) {
            ([one], _) if one.contains(whole) => true,
            ([], _) | (_, None) => false,
            (parts, Some(triangles)) => {
                let mut covered = true;
                triangles.each(p as u32, &mut |t| covered &= is_covered(t, parts));
                covered
            }
        };
        if !contained {
            return Err(format!("primitive {p} is in {} leaves, which do not cover it", parts.len()));
        }
    }
    Ok(())
}

/// Is every point of a lattice on a triangle in one of the boxes? Points are those of exact
/// arithmetic to some 1e-15.
fn is_covered(t: [Vec3; 3], parts: &[Aabb]) -> bool {
    const STEPS: u32 = 12;
    let [a, b, c] = t.map(Vec3::as_dvec3);
    let slack = 1e-14 * a.abs().max(b.abs()).max(c.abs()).max_element();
    (0..=STEPS).flat_map(|i| (0..=STEPS - i).map(move |k| (i, k))).all(|(i, k)| {
        let [u, v] = [i, k].map(|x| x as f64 / STEPS as f64);
        let p = a + (b - a) * u + (c - a) * v;
        parts
            .iter()
            .any(|part| part.min.as_dvec3().cmple(p + slack).all() && part.max.as_dvec3().cmpge(p - slack).all())
    })
}

/// Rebuilds subtrees so that the tree is no deeper than `most`, which must be at least
/// ceil(log2(leaves)). The leaves stay the same.
pub fn limit_depth(tree: Bvh2, most: u32) -> Bvh2 {
    if depth_of(&tree) <= most {
        return tree;
    }
    let counts = leaf_counts(&tree);
    let nodes = emit(Source::Tree { tree: &tree, node: 0 }, |source, depth| source.limited(depth, most, &counts));
    Bvh2 { nodes, primitive_indices: tree.primitive_indices, ..Default::default() }
}

/// Nodes of a subtree, each passed through `change` first with its depth. The root has slot 0,
/// children lie side by side.
fn emit<'a>(root: Source<'a>, change: impl Fn(Source<'a>, u32) -> Source<'a>) -> Vec<Bvh2Node> {
    let mut nodes = vec![Bvh2Node::default()];
    let mut work = vec![(root, 0u32, 0usize)];
    while let Some((source, depth, slot)) = work.pop() {
        let source = change(source, depth);
        let bounds = source.bounds();
        nodes[slot] = match source.split() {
            Err(leaf) => leaf,
            Ok([a, b]) => {
                let first = nodes.len();
                nodes.extend([Bvh2Node::default(); 2]);
                work.push((b, depth + 1, first + 1));
                work.push((a, depth + 1, first));
                Bvh2Node { min: bounds.min, max: bounds.max, prim_count: 0, first_index: first as u32 }
            }
        };
    }
    nodes
}

/// A subtree yet to be emitted.
enum Source<'a> {
    /// As it was built.
    Tree { tree: &'a Bvh2, node: usize },
    /// Balanced over these leaves, because the subtree is too deep.
    Balanced(Vec<Bvh2Node>),
}

fn node_box(node: &Bvh2Node) -> Aabb {
    Aabb { min: node.min, max: node.max }
}

impl<'a> Source<'a> {
    fn bounds(&self) -> Aabb {
        match self {
            Source::Tree { tree, node } => node_box(&tree.nodes[*node]),
            Source::Balanced(leaves) => leaves.iter().fold(Aabb::EMPTY, |b, l| b.union(node_box(l))),
        }
    }

    /// Itself while there is room below for anything it may hold, otherwise balanced. With d inner
    /// nodes above and n leaves below, a balanced tree needs d + ceil(log2 n); descending keeps
    /// that bound as long as it is below the limit.
    fn limited(self, depth: u32, most: u32, counts: &[u32]) -> Self {
        match &self {
            Source::Tree { tree, node } if depth + counts[*node].next_power_of_two().ilog2() >= most => {
                let (mut found, mut work) = (Vec::new(), vec![*node]);
                while let Some(n) = work.pop() {
                    let n = &tree.nodes[n];
                    if n.is_leaf() {
                        found.push(*n);
                    } else {
                        work.extend([n.first_index as usize, n.first_index as usize + 1]);
                    }
                }
                Source::Balanced(found)
            }
            _ => self,
        }
    }

    /// Both children, or the leaf.
    fn split(self) -> Result<[Source<'a>; 2], Bvh2Node> {
        match self {
            Source::Tree { tree, node } => {
                let n = &tree.nodes[node];
                if n.is_leaf() {
                    return Err(*n);
                }
                let first = n.first_index as usize;
                Ok([Source::Tree { tree, node: first }, Source::Tree { tree, node: first + 1 }])
            }
            Source::Balanced(leaves) if leaves.len() == 1 => Err(leaves[0]),
            Source::Balanced(mut leaves) => {
                // the median along the longest axis of the centres
                let centre = |l: &Bvh2Node| l.min * 0.5 + l.max * 0.5;
                let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
                let (lo, hi) = leaves.iter().fold(none, |(a, b), l| (a.min(centre(l)), b.max(centre(l))));
                let axis = (hi - lo).max_position();
                let middle = leaves.len() / 2;
                leaves.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
                let upper = leaves.split_off(middle);
                Ok([Source::Balanced(leaves), Source::Balanced(upper)])
            }
        }
    }
}

fn depth_of(tree: &Bvh2) -> u32 {
    let (mut deepest, mut work) = (0, vec![(0usize, 0u32)]);
    while let Some((node, level)) = work.pop() {
        let n = &tree.nodes[node];
        if !n.is_leaf() {
            deepest = deepest.max(level + 1);
            work.extend([(n.first_index as usize, level + 1), (n.first_index as usize + 1, level + 1)]);
        }
    }
    deepest
}

/// Number of leaves below every node, in post-order (the depth may be anything: no recursion).
fn leaf_counts(tree: &Bvh2) -> Vec<u32> {
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut work = vec![0usize];
    while let Some(node) = work.pop() {
        order.push(node);
        let n = &tree.nodes[node];
        if !n.is_leaf() {
            work.extend([n.first_index as usize, n.first_index as usize + 1]);
        }
    }
    let mut counts = vec![0; tree.nodes.len()];
    for &node in order.iter().rev() {
        let n = &tree.nodes[node];
        let first = n.first_index as usize;
        counts[node] = if n.is_leaf() { 1 } else { counts[first] + counts[first + 1] };
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRESETS: [BuildPreset; 3] = [BuildPreset::Fast, BuildPreset::Default, BuildPreset::Best];

    /// A sequence of numbers in [0, 1).
    fn numbers() -> impl FnMut() -> f32 {
        let mut state = 7u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1u32 << 24) as f32
        }
    }

    /// A ground under many equal boxes leaves them even; half of them ten times as long as others
    /// does not.
    #[test]
    fn a_few_large_boxes_leave_the_others_even() {
        let mut next = numbers();
        let mut cube = |size: f32| {
            let at = Vec3::new(next(), next(), next()) * 100.0;
            Aabb { min: at, max: at + size }
        };
        let alike: Vec<Aabb> = (0..10_000).map(|_| cube(1.0)).collect();
        let mixed: Vec<Aabb> = (0..10_000).map(|k| cube(if k % 5 == 0 { 10.0 } else { 1.0 })).collect();
        let ground = [Aabb { min: Vec3::ZERO, max: Vec3::new(1e4, 0.0, 1e4) }; 2];
        assert!(!are_uneven(&alike) && are_uneven(&mixed));
        assert!(!are_uneven(&[&ground[..], &alike].concat()) && are_uneven(&[&ground[..], &mixed].concat()));
    }

    /// Triangles of many kinds: small ones, long slivers across everything, flat ones, one of no
    /// extent.
    fn triangles(n: usize, scale: f32, offset: f32) -> Vec<[Vec3; 3]> {
        let mut next = numbers();
        let mut point = move || Vec3::new(next(), next(), next());
        (0..n)
            .map(|i| {
                let (a, b, c) = (point(), point(), point());
                let t = match i % 7 {
                    0 => [a, b, a + (c - a) * 0.01],
                    1 => [a, a + (b - a) * 0.01, Vec3::new(a.x, c.y, a.z)],
                    2 => [Vec3::new(a.x, 0.5, a.z), Vec3::new(b.x, 0.5, b.z), Vec3::new(c.x, 0.5, c.z)],
                    3 => [a, a, a],
                    _ => [a, a + (b - a) * 0.02, a + (c - a) * 0.02],
                };
                t.map(|p| p * scale + offset)
            })
            .collect()
    }

    fn sizes() -> impl Iterator<Item = usize> {
        (1..40).chain([100, 1000, 20_000])
    }

    #[test]
    fn trees_of_every_size_and_scale_are_valid() {
        for n in sizes() {
            for (scale, offset) in [(1.0, 0.0), (1e-3, 10.0), (1e5, -1e6), (1e-25, 0.0), (1e17, 0.0)] {
                let t = triangles(n, scale, offset);
                let boxes: Vec<Aabb> = t.iter().map(|t| Aabb::of_points(t)).collect();
                let each = |p: u32, see: &mut dyn FnMut([Vec3; 3])| see(t[p as usize]);
                let reach = boxes.iter().fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
                for preset in PRESETS {
                    let what = format!("{n} boxes at scale {scale}, offset {offset}, {preset:?}");
                    validate(&tree(&boxes, preset, None), &boxes, None).unwrap_or_else(|e| panic!("{what}: {e}"));
                    validate(&tree(&boxes, preset, Some(4)), &boxes, None)
                        .unwrap_or_else(|e| panic!("{what}, collapsed: {e}"));
                    let split = tree_with_splits(&boxes, &each, preset, 4.0 * f32::EPSILON * reach);
                    validate(&split, &boxes, Some(&each)).unwrap_or_else(|e| panic!("{what}, split: {e}"));
                }
            }
        }
    }

    /// Equal boxes, which no plane separates, and boxes that only differ in one of several places.
    #[test]
    fn equal_boxes_are_halved() {
        for n in [2, 3, 1000, 50_000] {
            let boxes: Vec<Aabb> =
                (0..n).map(|i| Aabb { min: Vec3::splat((i % 3) as f32), max: Vec3::splat(4.0) }).collect();
            for preset in PRESETS {
                validate(&tree(&boxes, preset, None), &boxes, None).unwrap();
            }
        }
    }

    /// Long diagonal triangles, whose boxes hold nearly everything, among small ones.
    #[test]
    fn splits_pay_for_diagonals() {
        let mut next = numbers();
        let t: Vec<[Vec3; 3]> = (0..500)
            .map(|i| {
                let a = Vec3::new(next(), next(), next());
                let (a, size) = if i % 10 == 0 { (a * 0.2, 0.8) } else { (a, 0.02) };
                [a, a + Vec3::splat(size), a + Vec3::new(size, size, size * 1.01)]
            })
            .collect();
        let boxes: Vec<Aabb> = t.iter().map(|t| Aabb::of_points(t)).collect();
        let each = |p: u32, see: &mut dyn FnMut([Vec3; 3])| see(t[p as usize]);
        let (without, with) =
            (tree(&boxes, BuildPreset::Best, None), tree_with_splits(&boxes, &each, BuildPreset::Best, 0.0));
        validate(&with, &boxes, Some(&each)).unwrap();
        assert!(with.nodes.len() > without.nodes.len() && with.nodes.len() <= 2 * (500 + 150), "{}", with.nodes.len());
        assert!(cost(&with) < 0.9 * cost(&without), "{} {}", cost(&with), cost(&without));
    }

    /// Reinsertion finds where a few large boxes among small ones cost least.
    #[test]
    fn reinsertion_lowers_the_cost() {
        let boxes: Vec<Aabb> = triangles(5000, 1.0, 0.0).iter().map(|t| Aabb::of_points(t)).collect();
        let costs = PRESETS.map(|p| cost(&tree(&boxes, p, None)));
        assert!(costs[1] < 0.97 * costs[0] && costs[2] < 0.97 * costs[0], "{costs:?}");
    }

    /// Boxes that all overlap leave the search for a better place nothing to prune.
    #[test]
    fn overlapping_boxes_are_built_in_time() {
        let mut next = numbers();
        let boxes: Vec<Aabb> = (0..100_000)
            .map(|_| Aabb {
                min: Vec3::new(next(), next(), next()) * 0.01,
                max: 1.0 - Vec3::new(next(), next(), next()) * 0.01,
            })
            .collect();
        let start = std::time::Instant::now();
        validate(&tree(&boxes, BuildPreset::Default, None), &boxes, None).unwrap();
        assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
    }

    #[test]
    fn validate_sees_damage() {
        let t = triangles(300, 1.0, 0.0);
        let boxes: Vec<Aabb> = t.iter().map(|t| Aabb::of_points(t)).collect();
        let each = |p: u32, see: &mut dyn FnMut([Vec3; 3])| see(t[p as usize]);
        let good = tree_with_splits(&boxes, &each, BuildPreset::Best, 0.0);
        validate(&good, &boxes, Some(&each)).unwrap();
        assert!(validate(&good, &boxes, None).is_err(), "split, and yet whole");
        let leaf = good.nodes.iter().position(|n| n.is_leaf()).unwrap();
        let damage: [&dyn Fn(&mut Bvh2); 5] = [
            &|t| t.nodes[leaf].first_index = 300,
            &|t| t.nodes[leaf].max = t.nodes[leaf].min - 1.0,
            &|t| t.nodes[0].min.x += 0.1,
            &|t| t.nodes[0].first_index = 3,
            &|t| t.nodes[leaf].first_index = (t.nodes[leaf].first_index + 1) % 300,
        ];
        for (k, damage) in damage.iter().enumerate() {
            let mut bad = good.clone();
            damage(&mut bad);
            assert!(validate(&bad, &boxes, Some(&each)).is_err(), "damage {k}");
        }
    }

    #[test]
    fn auto_spends_more_where_more_is_traced() {
        use BuildPreset::*;
        for (primitives, rays, expected) in
            [(871_306, 100, Fast), (871_306, 30_000_000, Default), (36, 36, Default), (20_000_000, u64::MAX, Fast)]
        {
            assert_eq!(BuildPreset::auto(primitives, rays), expected, "{primitives} {rays}");
        }
    }

    /// Boxes whose sizes grow geometrically, in a chain: it must be cut at the limit, and hold the
    /// same leaves.
    #[test]
    fn a_chain_is_cut_at_the_limit() {
        let n = 240usize;
        // one table: powi may round differently from one use to the next
        let mut radius = vec![1.0f32];
        for i in 1..n {
            radius.push(radius[i - 1] * 1.15);
        }
        let bounds = |i: usize| Aabb { min: Vec3::splat(-radius[i]), max: Vec3::splat(radius[i]) };
        let node = |b: Aabb, prim_count, first_index| Bvh2Node { min: b.min, max: b.max, prim_count, first_index };
        let mut nodes = vec![node(bounds(n - 1), 0, 1)];
        for i in (1..n).rev() {
            let next = nodes.len() as u32 + 2;
            nodes.push(node(bounds(i), 1, i as u32));
            // obvhs numbers children after their parents, side by side
            nodes.push(if i == 1 { node(bounds(0), 1, 0) } else { node(bounds(i - 1), 0, next) });
        }
        let tree = Bvh2 { nodes, primitive_indices: (0..n as u32).collect(), ..Default::default() };
        assert_eq!(depth_of(&tree), n as u32 - 1);
        let out = limit_depth(tree, MAX_DEPTH);
        assert!(depth_of(&out) <= MAX_DEPTH);
        let mut leaves: Vec<_> = out.nodes.iter().filter(|n| n.is_leaf()).map(|n| n.first_index).collect();
        leaves.sort_unstable();
        assert_eq!(leaves, (0..n as u32).collect::<Vec<_>>());
        for inner in out.nodes.iter().filter(|n| !n.is_leaf()) {
            for k in 0..2 {
                let child = &out.nodes[inner.first_index as usize + k];
                assert!(node_box(inner).contains(&node_box(child)), "{inner:?} {child:?}");
            }
        }
    }
}
