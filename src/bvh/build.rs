//! Building binary trees, by obvhs: PLOC (Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume
//! Hierarchy Construction", TVCG 2018) with reinsertion (Meister and Bittner, "Parallel Reinsertion for Bounding Volume
//! Hierarchy Optimization", EG 2018).
//!
//! The depth of what comes out is bounded, whatever the input: a subtree that would grow deeper is replaced by a balanced one
//! over the same leaves, and equal boxes are clustered as one.

use glam::Vec3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;

use super::Aabb;

/// No tree is deeper than this (inner nodes on the longest path). 2^27 primitives in a balanced tree need 27.
pub const MAX_DEPTH: u32 = 48;

/// How much time to spend on a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BuildPreset {
    /// Least build time.
    Fast,
    /// Balanced.
    #[default]
    Default,
}

impl obvhs::Boundable for Aabb {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.to_vec3a(), self.max.to_vec3a())
    }
}

/// The tree of some boxes (at least one). `collapse`: leaves hold up to so many primitives, where that lowers the cost; else
/// one each.
pub fn tree(boxes: &[Aabb], preset: BuildPreset, collapse: Option<u32>) -> Bvh2 {
    if !seems_to_repeat(boxes) {
        return limit_depth(distinct_tree(boxes, preset, collapse), MAX_DEPTH);
    }
    // clustering pairs one of k equal boxes at a time: k^2 work for a chain of depth k. Build over one of each instead.
    let copies = Copies::of(boxes);
    let unique: Vec<Aabb> = copies.groups().map(|g| boxes[g[0] as usize]).collect();
    limit_depth(copies.expand(&distinct_tree(&unique, preset, None)), MAX_DEPTH)
}

/// Are there equal boxes among some of them, evenly spread? What a sample of this size overlooks is too few to matter.
fn seems_to_repeat(boxes: &[Aabb]) -> bool {
    let mut seen = std::collections::HashSet::new();
    boxes.iter().step_by(boxes.len().div_ceil(4096).max(1)).any(|b| !seen.insert(key(b)))
}

fn key(b: &Aabb) -> [u32; 6] {
    // equal as numbers is equal as bits, once -0 is 0
    let bits = |v: Vec3| (v + 0.0).to_array().map(f32::to_bits);
    let ([a, b, c], [d, e, f]) = (bits(b.min), bits(b.max));
    [a, b, c, d, e, f]
}

/// Boxes sorted so that equal ones lie side by side.
struct Copies {
    order: Vec<u32>,
    /// Where each group of equal boxes begins in `order`, and the end.
    begins: Vec<usize>,
}

impl Copies {
    fn of(boxes: &[Aabb]) -> Self {
        let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
        order.par_sort_unstable_by_key(|&i| (key(&boxes[i as usize]), i));
        let mut begins = vec![0];
        begins.extend((1..order.len()).filter(|&k| key(&boxes[order[k - 1] as usize]) != key(&boxes[order[k] as usize])));
        begins.push(order.len());
        Self { order, begins }
    }

    fn groups(&self) -> impl Iterator<Item = &[u32]> {
        self.begins.windows(2).map(|w| &self.order[w[0]..w[1]])
    }

    /// A tree over one of each, with every leaf replaced by a balanced tree over its copies.
    fn expand(self, tree: &Bvh2) -> Bvh2 {
        let nodes = emit(Source::Tree { tree, node: 0 }, |source, _| match source {
            Source::Tree { tree, node } if tree.nodes[node].is_leaf() => {
                let leaf = tree.nodes[node];
                let group = tree.primitive_indices[leaf.first_index as usize] as usize;
                let slots = self.begins[group]..self.begins[group + 1];
                Source::Balanced(slots.map(|s| Bvh2Node { first_index: s as u32, prim_count: 1, ..leaf }).collect())
            }
            other => other,
        });
        Bvh2 { nodes, primitive_indices: self.order, ..Default::default() }
    }
}

fn distinct_tree(boxes: &[Aabb], preset: BuildPreset, collapse: Option<u32>) -> Bvh2 {
    let mut config = match preset {
        BuildPreset::Fast => obvhs::BvhBuildParams::fast_build(),
        BuildPreset::Default => obvhs::BvhBuildParams::medium_build(),
    };
    config.pre_split = false;
    match collapse {
        Some(max_leaf) => {
            config.max_prims_per_leaf = max_leaf;
            obvhs::bvh2::builder::build_bvh2(boxes, config, &mut std::time::Duration::default())
        }
        None => {
            let indices = (0..boxes.len() as u32).collect();
            let (distance, precision, threshold) =
                (config.ploc_search_distance, config.sort_precision, config.search_depth_threshold);
            let mut tree =
                obvhs::ploc::PlocBuilder::with_capacity(boxes.len()).build(distance, boxes, indices, precision, threshold);
            obvhs::bvh2::reinsertion::ReinsertionOptimizer::default().run(&mut tree, config.reinsertion_batch_ratio, None);
            tree
        }
    }
}

/// The same leaves in a tree that is no deeper than `most` (but ceil(log2 leaves) must fit).
pub fn limit_depth(tree: Bvh2, most: u32) -> Bvh2 {
    if depth_of(&tree) <= most {
        return tree;
    }
    let counts = leaf_counts(&tree);
    let nodes = emit(Source::Tree { tree: &tree, node: 0 }, |source, depth| source.limited(depth, most, &counts));
    Bvh2 { nodes, primitive_indices: tree.primitive_indices, ..Default::default() }
}

/// Nodes of a subtree, each passed through `change` first with its depth. The root has slot 0, children lie side by side.
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
    /// As obvhs built it.
    Tree { tree: &'a Bvh2, node: usize },
    /// Balanced over these leaves, because obvhs's subtree is too deep.
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

    /// Itself while there is room below for anything it may hold, otherwise balanced. With d inner nodes above and n leaves
    /// below, a balanced tree needs d + ceil(log2 n); descending keeps that bound as long as it is below the limit.
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

    /// Boxes whose sizes grow geometrically, in a chain: it must be cut at the limit, and hold the same leaves.
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
