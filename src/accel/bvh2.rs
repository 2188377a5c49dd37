//! The binary hierarchy that `shaders/trace/reference.glsl` traverses.
//!
//! A node stores the boxes of both its children: a visit is one load of 64 bytes, and no box is
//! loaded that is not tested. The traversal's stack cannot overflow: every inner node pushes at
//! most one child, so a tree of depth d needs d entries, and the shader's stack size is specialized
//! to the depth of the tree.
//!
//! A reference to an inner node also says along which axis that node's children lie apart, the
//! lower one first. A traversal that orders children by the sign of the ray's direction thus knows
//! the order without loading anything more, and nodes do not grow.

use glam::Vec3;

use super::build::MAX_DEPTH;
use super::{Aabb, BuildPreset, build};
pub use crate::interface::records::hierarchy::BinaryNode;
use crate::interface::records::hierarchy::{AXIS_SHIFT, LEAF, NEXT, NODE_NUMBER};

/// Maximum number of primitives in a leaf.
pub const MAX_LEAF: u32 = 16;
/// Maximum number of primitives over all trees of a scene, bounded by the bits of a reference.
pub const MAX_PRIMITIVES: usize = 1 << 27;
/// Root reference of a tree without primitives: the traversal continues with its stack.
pub const EMPTY: u32 = NEXT;

/// A binary hierarchy in the layout of the compute tracer.
#[derive(Clone, Debug, Default)]
pub struct Bvh2 {
    /// Inner nodes, parents before their children; references are relative to this tree.
    pub nodes: Vec<BinaryNode>,
    /// Primitive index of each leaf slot.
    pub primitives: Vec<u32>,
    /// Reference where traversal begins: an inner node, a leaf, or [`EMPTY`].
    pub root: u32,
    /// Inner nodes on the longest path from the root: the stack entries that traversal needs.
    pub depth: u32,
}

fn leaf_reference(first: u32, count: u32) -> u32 {
    debug_assert!((1..=MAX_LEAF).contains(&count));
    LEAF | (count - 1) << 27 | first
}

/// Splits a leaf reference into its first primitive and their number.
pub fn leaf_range(reference: u32) -> Option<(u32, u32)> {
    (reference & LEAF != 0).then_some((reference & NODE_NUMBER, (reference >> 27 & 0xf) + 1))
}

/// Splits a reference to an inner node into its number and the axis (0, 1, 2) along which its
/// children lie apart.
pub fn inner_node(reference: u32) -> Option<(u32, usize)> {
    (reference & LEAF == 0 && reference != EMPTY)
        .then_some((reference & NODE_NUMBER, (reference >> AXIS_SHIFT) as usize))
}

/// The axis along which the centres of two boxes lie farthest apart, and whether the first box is
/// the upper one there.
fn split_axis(a: &Aabb, b: &Aabb) -> (u32, bool) {
    // twice the centres; halves first, so that huge boxes do not overflow
    let apart = (b.min * 0.5 + b.max * 0.5) - (a.min * 0.5 + a.max * 0.5);
    let axis = apart.abs().max_position();
    (axis as u32, apart[axis] < 0.0)
}

/// A reference as seen from a buffer in which this tree's nodes begin at `first_node` and its
/// primitives at `first_primitive`.
pub fn rebase(reference: u32, first_node: u32, first_primitive: u32) -> u32 {
    if reference & LEAF != 0 {
        reference + first_primitive
    } else if reference == EMPTY {
        EMPTY
    } else {
        reference + first_node
    }
}

impl Bvh2 {
    /// Builds the tree of `boxes`; none may be empty or NaN, and there are at most
    /// [`MAX_PRIMITIVES`]. `max_leaf` (1 to [`MAX_LEAF`]) bounds the primitives of a leaf.
    pub fn build(boxes: &[Aabb], preset: BuildPreset, max_leaf: u32) -> Self {
        assert!(boxes.len() <= MAX_PRIMITIVES);
        if boxes.is_empty() {
            return Self { root: EMPTY, ..Default::default() };
        }
        Self::from_tree(build::tree(boxes, preset, Some(max_leaf.clamp(1, MAX_LEAF))))
    }

    /// Lays a tree out depth first. Its leaves hold at most [`MAX_LEAF`] primitives; one without
    /// nodes is empty.
    pub fn from_tree(tree: obvhs::bvh2::Bvh2) -> Self {
        if tree.nodes.is_empty() {
            return Self { root: EMPTY, ..Default::default() };
        }
        let mut out =
            Self { nodes: Vec::with_capacity(tree.nodes.len() / 2), primitives: Vec::new(), root: 0, depth: 0 };
        // what to emit, its depth, and the node and side that will refer to it
        let mut work = vec![(0usize, 0u32, None::<(usize, usize)>)];
        while let Some((at, depth, parent)) = work.pop() {
            let n = &tree.nodes[at];
            let reference = if n.is_leaf() {
                leaf_reference(n.first_index, n.prim_count)
            } else {
                let (index, first) = (out.nodes.len(), n.first_index as usize);
                out.depth = out.depth.max(depth + 1);
                let bounds = |k: usize| Aabb { min: tree.nodes[k].min, max: tree.nodes[k].max };
                let (axis, swap) = split_axis(&bounds(first), &bounds(first + 1));
                let (lower, upper) = if swap { (first + 1, first) } else { (first, first + 1) };
                let corners = |k: usize| [tree.nodes[k].min.to_array(), tree.nodes[k].max.to_array()];
                out.nodes.push(BinaryNode {
                    boxes: [corners(lower), corners(upper)],
                    children: [0; 2],
                    reserved: [0; 2],
                });
                work.push((upper, depth + 1, Some((index, 1))));
                work.push((lower, depth + 1, Some((index, 0))));
                axis << AXIS_SHIFT | index as u32
            };
            match parent {
                Some((node, side)) => out.nodes[node].children[side] = reference,
                None => out.root = reference,
            }
        }
        out.primitives = tree.primitive_indices;
        out
    }

    /// Checks the whole structure against the boxes it was built from: every primitive in exactly
    /// one leaf, every box contains its children's, children in order along the stated axis, the
    /// depth as stated.
    ///
    /// # Errors
    /// A description of the first defect.
    pub fn validate(&self, boxes: &[Aabb]) -> Result<(), String> {
        // from the root down: each primitive in one leaf, each box within its parent's
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
                    let &p = self.primitives.get(slot as usize).ok_or(format!("slot {slot} is out of range"))?;
                    let seen = seen.get_mut(p as usize).ok_or(format!("primitive {p} is out of range"))?;
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
            let (number, axis) =
                inner_node(reference).filter(|r| r.1 < 3).ok_or(format!("reference {reference:#x} is broken"))?;
            let node = self.nodes.get(number as usize).ok_or(format!("node {number} is out of range"))?;
            let [a, b] = node.boxes.map(|b| bounds_of(&b));
            if split_axis(&a, &b) != (axis as u32, false) {
                return Err(format!("children of node {number} are not in order along axis {axis}"));
            }
            for side in 0..2 {
                let [lo, hi] = node.boxes[side];
                let child = Aabb { min: lo.into(), max: hi.into() };
                if !bounds.contains(&child) {
                    return Err(format!("child {side} of node {number} sticks out of its parent"));
                }
                work.push((node.children[side], child, level + 1));
            }
        }

        // nothing may be missing, and traversal's stack relies on the depth
        if let Some(p) = seen.iter().position(|s| !s) {
            return Err(format!("primitive {p} is in no leaf"));
        }
        if depth != self.depth || depth > MAX_DEPTH {
            return Err(format!("depth is {depth}, recorded as {}, at most {MAX_DEPTH}", self.depth));
        }
        Ok(())
    }
}

fn bounds_of(b: &[[f32; 3]; 2]) -> Aabb {
    Aabb { min: b[0].into(), max: b[1].into() }
}
