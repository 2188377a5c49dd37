//! The binary hierarchy that `shaders/trace/compute.glsl` walks.
//!
//! Built by obvhs: PLOC (Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy
//! Construction", TVCG 2018) with reinsertion (Meister and Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy
//! Optimization", EG 2018). Then laid out so that a node holds the boxes of both its children: a visit is one load of 64
//! bytes, and no box is loaded for nothing.
//!
//! The traversal's stack cannot overflow: every inner node pushes at most one child, so a tree of depth d needs d entries;
//! the depth is limited here ([`MAX_DEPTH`]) and the shader's stack is specialised to the depth that is there. A subtree
//! that would grow deeper is replaced by a balanced one over the same leaves.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Aabb;

/// No tree is deeper than this (inner nodes on the longest path). 2^27 primitives in a balanced tree need 27.
pub const MAX_DEPTH: u32 = 48;
/// Most primitives that a leaf reference can hold.
pub const MAX_LEAF: u32 = 16;
/// Primitives that a reference can number, over all trees of a scene.
pub const MAX_PRIMITIVES: usize = 1 << 27;
/// Reference of a tree without primitives: the traversal goes on with what is on its stack.
pub const EMPTY: u32 = 0x7fff_fffd;

const LEAF: u32 = 0x8000_0000;

/// An inner node: boxes of both children, then the references to them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct Node {
    /// Lower and upper corner of both children.
    pub boxes: [[[f32; 3]; 2]; 2],
    /// Bit 31 set: a leaf with count - 1 in bits 27-30 and the first primitive in bits 0-26; otherwise an inner node.
    pub children: [u32; 2],
    /// To 64 bytes: one cache line.
    pub reserved: [u32; 2],
}

/// How much time to spend on a tree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BuildPreset {
    /// Least build time.
    Fast,
    /// Balanced.
    #[default]
    Default,
}

/// A binary hierarchy in the layout of the compute tracer.
#[derive(Clone, Debug, Default)]
pub struct Bvh2 {
    /// Inner nodes, parents before their children; references are relative to this tree.
    pub nodes: Vec<Node>,
    /// For each slot of the leaves, the number of the primitive that lies there.
    pub primitives: Vec<u32>,
    /// Where traversal begins: an inner node, a leaf, or [`EMPTY`].
    pub root: u32,
    /// Inner nodes on the longest path from the root: what the traversal's stack must hold.
    pub depth: u32,
}

fn leaf_reference(first: u32, count: u32) -> u32 {
    debug_assert!((1..=MAX_LEAF).contains(&count));
    LEAF | (count - 1) << 27 | first
}

/// Splits a leaf reference into its first primitive and their number.
pub fn leaf_range(reference: u32) -> Option<(u32, u32)> {
    (reference & LEAF != 0).then_some((reference & 0x07ff_ffff, (reference >> 27 & 0xf) + 1))
}

/// A reference as seen from a buffer in which this tree's nodes begin at `first_node` and its primitives at `first_primitive`.
pub fn rebase(reference: u32, first_node: u32, first_primitive: u32) -> u32 {
    if reference & LEAF != 0 {
        reference + first_primitive
    } else if reference == EMPTY {
        EMPTY
    } else {
        reference + first_node
    }
}

impl obvhs::Boundable for Aabb {
    fn aabb(&self) -> obvhs::aabb::Aabb {
        obvhs::aabb::Aabb::new(self.min.to_vec3a(), self.max.to_vec3a())
    }
}

impl Bvh2 {
    /// Builds the tree of `boxes`; none may be empty or NaN, and there are at most [`MAX_PRIMITIVES`]. `max_leaf` (1 to
    /// [`MAX_LEAF`]) bounds the primitives of a leaf.
    pub fn build<T: obvhs::Boundable + Sync + Send>(boxes: &[T], preset: BuildPreset, max_leaf: u32) -> Self {
        assert!(boxes.len() <= MAX_PRIMITIVES);
        if boxes.is_empty() {
            return Self { root: EMPTY, ..Default::default() };
        }
        let mut config = match preset {
            BuildPreset::Fast => obvhs::BvhBuildParams::fast_build(),
            BuildPreset::Default => obvhs::BvhBuildParams::medium_build(),
        };
        config.pre_split = false;
        config.max_prims_per_leaf = max_leaf.clamp(1, MAX_LEAF);
        let tree = obvhs::bvh2::builder::build_bvh2(boxes, config, &mut std::time::Duration::default());
        Self::lay_out(&tree)
    }

    fn lay_out(tree: &obvhs::bvh2::Bvh2) -> Self {
        let mut out = Self { nodes: Vec::with_capacity(tree.nodes.len() / 2), primitives: Vec::new(), root: 0, depth: 0 };
        if depth_of(tree) <= MAX_DEPTH {
            out.root = out.emit(Source::Tree { tree, node: 0 }, 0, None);
        } else {
            let leaves = leaf_counts(tree);
            out.root = out.emit(Source::Tree { tree, node: 0 }, 0, Some(&leaves));
        }
        out.primitives = tree.primitive_indices.clone();
        out
    }

    /// Emits a subtree depth first, iteratively, and returns the reference to it.
    fn emit(&mut self, root: Source, depth: u32, leaves: Option<&[u32]>) -> u32 {
        let mut result = 0;
        // what to emit, its depth, and the node and side that will refer to it
        let mut work = vec![(root, depth, None::<(usize, usize)>)];
        while let Some((source, depth, parent)) = work.pop() {
            let source = source.limited(depth, leaves);
            let reference = match source.split() {
                Err(leaf) => leaf,
                Ok(children) => {
                    let index = self.nodes.len();
                    self.depth = self.depth.max(depth + 1);
                    let corners = |b: Aabb| [b.min.to_array(), b.max.to_array()];
                    self.nodes.push(Node {
                        boxes: [corners(children[0].bounds()), corners(children[1].bounds())],
                        children: [0; 2],
                        reserved: [0; 2],
                    });
                    let [a, b] = children;
                    work.push((b, depth + 1, Some((index, 1))));
                    work.push((a, depth + 1, Some((index, 0))));
                    index as u32
                }
            };
            match parent {
                Some((node, side)) => self.nodes[node].children[side] = reference,
                None => result = reference,
            }
        }
        result
    }

    /// Checks the whole structure against the boxes it was built from: every primitive in exactly one leaf, every box holds
    /// what is below it, the depth as stated. The error says what is wrong.
    pub fn validate(&self, boxes: &[Aabb]) -> Result<(), String> {
        let mut seen = vec![false; boxes.len()];
        let mut depth = 0;
        let all = Aabb { min: Vec3::NEG_INFINITY, max: Vec3::INFINITY };
        let mut work = vec![(self.root, all, 0u32)];
        while let Some((reference, bounds, level)) = work.pop() {
            if reference == EMPTY {
                continue;
            }
            if let Some((first, count)) = leaf_range(reference) {
                for slot in first..first + count {
                    let &p = self.primitives.get(slot as usize).ok_or(format!("slot {slot} is outside"))?;
                    let seen = seen.get_mut(p as usize).ok_or(format!("primitive {p} is outside"))?;
                    if std::mem::replace(seen, true) {
                        return Err(format!("primitive {p} is in two leaves"));
                    }
                    if !bounds.contains(&boxes[p as usize]) {
                        return Err(format!("primitive {p} sticks out of its leaf"));
                    }
                }
                continue;
            }
            depth = depth.max(level + 1);
            let node = self.nodes.get(reference as usize).ok_or(format!("node {reference} is outside"))?;
            for side in 0..2 {
                let [lo, hi] = node.boxes[side];
                let child = Aabb { min: lo.into(), max: hi.into() };
                if !bounds.contains(&child) {
                    return Err(format!("child {side} of node {reference} sticks out of its parent"));
                }
                work.push((node.children[side], child, level + 1));
            }
        }
        if let Some(p) = seen.iter().position(|s| !s) {
            return Err(format!("primitive {p} is in no leaf"));
        }
        if depth != self.depth || depth > MAX_DEPTH {
            return Err(format!("depth is {depth}, said to be {}, at most {MAX_DEPTH}", self.depth));
        }
        Ok(())
    }

    /// Expected cost of a random ray by the surface area heuristic: nodes visited plus primitives tested, each counted 1.
    pub fn sah_cost(&self) -> f32 {
        let root = self.nodes.first().map(|n| bounds_of(&n.boxes[0]).union(bounds_of(&n.boxes[1])).half_area()).unwrap_or(0.0);
        if root <= 0.0 {
            return self.primitives.len() as f32;
        }
        let children = self.nodes.iter().flat_map(|n| (0..2).map(move |k| (n.boxes[k], n.children[k])));
        let sum: f64 = children
            .map(|(b, child)| {
                let cost = leaf_range(child).map_or(1.0, |(_, count)| count as f64);
                bounds_of(&b).half_area() as f64 * cost
            })
            .sum();
        1.0 + (sum / root as f64) as f32
    }
}

fn bounds_of(b: &[[f32; 3]; 2]) -> Aabb {
    Aabb { min: b[0].into(), max: b[1].into() }
}

/// A leaf of obvhs's tree: its box and reference.
type LeafBox = (Aabb, u32);

/// A subtree yet to be laid out.
enum Source<'a> {
    /// As obvhs built it.
    Tree { tree: &'a obvhs::bvh2::Bvh2, node: usize },
    /// Balanced over these leaves, because obvhs's subtree is too deep.
    Balanced(Vec<LeafBox>),
}

fn node_box(node: &obvhs::bvh2::node::Bvh2Node) -> Aabb {
    Aabb { min: node.min, max: node.max }
}

impl<'a> Source<'a> {
    fn bounds(&self) -> Aabb {
        match self {
            Source::Tree { tree, node } => node_box(&tree.nodes[*node]),
            Source::Balanced(leaves) => leaves.iter().fold(Aabb::EMPTY, |b, l| b.union(l.0)),
        }
    }

    /// Itself while there is room below for anything it may hold, otherwise balanced. With d inner nodes above and n leaves
    /// below, a balanced tree needs d + ceil(log2 n); descending keeps that bound as long as it is below the limit.
    fn limited(self, depth: u32, leaves: Option<&[u32]>) -> Self {
        match (&self, leaves) {
            (Source::Tree { tree, node }, Some(counts)) if depth + counts[*node].next_power_of_two().ilog2() >= MAX_DEPTH => {
                let (mut found, mut work) = (Vec::new(), vec![*node]);
                while let Some(n) = work.pop() {
                    let n = &tree.nodes[n];
                    if n.is_leaf() {
                        found.push((node_box(n), leaf_reference(n.first_index, n.prim_count)));
                    } else {
                        work.extend([n.first_index as usize, n.first_index as usize + 1]);
                    }
                }
                Source::Balanced(found)
            }
            _ => self,
        }
    }

    /// Both children, or the reference of a leaf.
    fn split(self) -> Result<[Source<'a>; 2], u32> {
        match self {
            Source::Tree { tree, node } => {
                let n = &tree.nodes[node];
                if n.is_leaf() {
                    return Err(leaf_reference(n.first_index, n.prim_count));
                }
                let first = n.first_index as usize;
                Ok([Source::Tree { tree, node: first }, Source::Tree { tree, node: first + 1 }])
            }
            Source::Balanced(leaves) if leaves.len() == 1 => Err(leaves[0].1),
            Source::Balanced(mut leaves) => {
                // the median along the longest axis of the centres
                let centre = |l: &LeafBox| l.0.min * 0.5 + l.0.max * 0.5;
                let (lo, hi) =
                    leaves.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), l| (a.min(centre(l)), b.max(centre(l))));
                let axis = (hi - lo).max_position();
                let middle = leaves.len() / 2;
                leaves.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
                let upper = leaves.split_off(middle);
                Ok([Source::Balanced(leaves), Source::Balanced(upper)])
            }
        }
    }
}

fn depth_of(tree: &obvhs::bvh2::Bvh2) -> u32 {
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

/// Number of leaves below every node of obvhs's tree, in post-order (its depth may be anything: no recursion).
fn leaf_counts(tree: &obvhs::bvh2::Bvh2) -> Vec<u32> {
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

    fn boxes(n: usize, place: impl Fn(usize) -> Vec3, size: impl Fn(usize) -> f32) -> Vec<Aabb> {
        (0..n).map(|i| Aabb { min: place(i) - size(i), max: place(i) + size(i) }).collect()
    }

    #[test]
    fn trees_of_every_small_size_are_valid() {
        for n in 0..70 {
            let b = boxes(
                n,
                |i| Vec3::new((i * 37 % 101) as f32, (i * 61 % 89) as f32, (i * 17 % 97) as f32),
                |i| 0.1 + i as f32 * 0.01,
            );
            for max_leaf in [1, 3, 8] {
                let tree = Bvh2::build(&b, BuildPreset::Default, max_leaf);
                tree.validate(&b).unwrap_or_else(|e| panic!("{n} boxes, leaf {max_leaf}: {e}"));
            }
        }
    }

    #[test]
    fn coincident_boxes_are_valid() {
        let b = boxes(1000, |_| Vec3::ONE, |_| 0.5);
        Bvh2::build(&b, BuildPreset::Fast, 4).validate(&b).unwrap();
    }

    /// Boxes whose sizes grow geometrically make a chain; the layout must cut it at the limit.
    #[test]
    fn a_chain_is_cut_at_the_limit() {
        let n = 240;
        let b: Vec<_> = boxes(n, |_| Vec3::ZERO, |i| 1.15f32.powi(i as i32));
        // obvhs itself may balance them: make the chain by hand
        let node =
            |b: Aabb, prim_count, first_index| obvhs::bvh2::node::Bvh2Node { min: b.min, max: b.max, prim_count, first_index };
        let mut nodes = vec![node(b[n - 1], 0, 1)];
        for i in (1..n).rev() {
            let next = nodes.len() as u32 + 2;
            nodes.push(node(b[i], 1, i as u32));
            nodes.push(if i == 1 { node(b[0], 1, 0) } else { node(b[i - 1], 0, next) });
        }
        let tree = obvhs::bvh2::Bvh2 { nodes, primitive_indices: (0..n as u32).collect(), ..Default::default() };
        assert_eq!(depth_of(&tree), n as u32 - 1);
        let out = Bvh2::lay_out(&tree);
        out.validate(&b).unwrap();
        assert!(out.depth <= MAX_DEPTH, "{}", out.depth);
    }

    #[test]
    fn validate_sees_damage() {
        let b = boxes(50, |i| Vec3::splat(i as f32), |_| 0.4);
        let good = Bvh2::build(&b, BuildPreset::Default, 2);
        let mut bad = good.clone();
        bad.nodes[0].boxes[0][1][0] -= 30.0;
        assert!(bad.validate(&b).is_err());
        let mut bad = good.clone();
        bad.primitives[3] = bad.primitives[4];
        assert!(bad.validate(&b).is_err());
        let mut bad = good;
        bad.depth += 1;
        assert!(bad.validate(&b).is_err());
    }
}
