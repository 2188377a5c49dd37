//! The hierarchy that `shaders/trace/wide.glsl` traverses: up to seven children a node, boxes
//! quantised to eight bits a plane (after Ylitie, Karras, Laine, "Efficient Incoherent Ray
//! Traversal on GPUs Through Compressed WideBvh BVHs", HPG 2017).
//!
//! Nodes and leaves are blocks of 64 bytes, a cache line, in one array; the children of a node are
//! adjacent. So a group of siblings is encoded as one index and a few bits, and one fetch serves a
//! node or a leaf alike. Which nodes of the binary tree become wide ones is chosen by dynamic
//! programming for the least expected number of blocks that a ray visits (the paper's section 3.1
//! with one kind of leaf).
//!
//! [`WideNode`] is a node; the layout of a leaf is up to the caller, except for the flag in the
//! last word of its [`Block`].
//!
//! The traversal's stack cannot overflow: a node visit pushes at most one entry (the rest of a
//! group of siblings), so a tree needs as many entries as its longest path has nodes.

use glam::Vec3;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::Aabb;
use super::build::MAX_DEPTH;
pub use crate::interface::records::hierarchy::{Block, LEAF, WideNode};

/// Maximum number of children of a node.
pub const WIDTH: usize = 7;
/// Bytes of a block.
pub const BLOCK_BYTES: u64 = size_of::<Block>() as u64;
/// Number of subtrees that are collapsed in parallel.
const TASKS: usize = 256;

/// A wide hierarchy.
#[derive(Clone, Debug)]
pub struct WideBvh {
    /// Nodes and leaves; the root node is the first, and exists even in an empty tree.
    pub blocks: Vec<Block>,
    /// Nodes on the longest path from the root.
    pub depth: u32,
    /// Bounds of the tree; `None` if it is empty.
    pub bounds: Option<Aabb>,
    /// Expected number of blocks that a ray through the bounds visits, by the surface area
    /// heuristic.
    pub sah_cost: f64,
}

/// Part of a tree, collapsed: its root node is the first block, addresses count from there.
struct Piece {
    blocks: Vec<Block>,
    depth: u32,
    cost: f32,
    /// Where other pieces are attached: block index, piece and level.
    inserts: Vec<(u32, usize, u32)>,
}

impl Default for WideBvh {
    fn default() -> Self {
        Self { blocks: vec![Block::default()], depth: 1, bounds: None, sah_cost: 0.0 }
    }
}

impl WideBvh {
    /// Collapses a binary tree whose leaves hold one item each, and whose boxes are padded by what
    /// quantisation and traversal round away. `leaf` returns the block of an item.
    pub fn collapse(tree: &Bvh2, leaf: impl Fn(u32) -> Block + Sync) -> Self {
        if tree.nodes.is_empty() {
            return Self::default();
        }

        // subtrees that are collapsed on their own, and the rest above them
        let mut frontier = vec![0usize];
        while frontier.len() < TASKS && tree.nodes.len() > 16 * TASKS {
            let inner = |n: &&usize| !tree.nodes[**n].is_leaf();
            if !frontier.iter().any(|n| inner(&n)) {
                break;
            }
            frontier = frontier
                .iter()
                .flat_map(|&n| {
                    let node = &tree.nodes[n];
                    let first = node.first_index as usize;
                    if node.is_leaf() { vec![n] } else { vec![first, first + 1] }
                })
                .collect();
        }
        frontier.retain(|&n| n != 0 && !tree.nodes[n].is_leaf());

        // the pieces in parallel, then the top, which needs their costs
        let pieces: Vec<Piece> = frontier.par_iter().map(|&n| Piece::collapse(tree, n, &[], &[], &leaf)).collect();
        let mut sorted: Vec<(usize, usize)> = frontier.iter().copied().zip(0..).collect();
        sorted.sort_unstable();
        let top = Piece::collapse(tree, 0, &sorted, &pieces, &leaf);
        let bounds = node_box(tree, 0);
        // a single leaf has a node above it
        let blocks = if tree.nodes[0].is_leaf() { 2.0 } else { 1.0 };
        let mut out =
            Self { blocks: top.blocks, depth: top.depth, bounds: Some(bounds), sah_cost: (blocks * top.cost) as f64 };

        // the pieces' roots have their places; the rest of each follows
        let mut ends = Vec::with_capacity(pieces.len());
        let mut end = out.blocks.len();
        for &(at, piece, level) in &top.inserts {
            let p = &pieces[piece];
            out.depth = out.depth.max(level + p.depth - 1);
            out.blocks[at as usize] = rebased(p.blocks[0], end as u32 - 1);
            ends.push((piece, end));
            end += p.blocks.len() - 1;
        }
        out.blocks.resize(end, Block::default());

        // each piece writes its own part of the blocks
        let mut rest = &mut out.blocks[ends.first().map_or(end, |e| e.1)..];
        let mut targets = Vec::new();
        for &(piece, begin) in &ends {
            let (mine, others) = rest.split_at_mut(pieces[piece].blocks.len() - 1);
            targets.push((piece, begin, mine));
            rest = others;
        }
        targets.into_par_iter().for_each(|(piece, begin, target)| {
            for (to, from) in target.iter_mut().zip(&pieces[piece].blocks[1..]) {
                *to = rebased(*from, begin as u32 - 1);
            }
        });
        out
    }

    /// Checks that every block is reached once and every child exists, that leaves lie within the
    /// boxes above them, and that the depth is as recorded and at most [`MAX_DEPTH`]. Nothing in
    /// the tree is trusted; the time is linear in its size. `bounds_of` returns the bounds of a
    /// leaf's primitives, or the empty box where they may stick out (a leaf that holds a part of
    /// them). Returns the bounds of all leaves together.
    ///
    /// # Errors
    /// A description of the first defect.
    pub fn validate(&self, bounds_of: impl Fn(&Block) -> Aabb + Sync) -> Result<Aabb, String> {
        // parents before children: each block's parent, and its slot there
        let mut seen = vec![false; self.blocks.len()];
        let mut order = Vec::new();
        let mut work = vec![(0u32, 0u32, 0usize, 1u32)];
        let mut deepest = 0;
        while let Some((at, parent, slot, level)) = work.pop() {
            let block = self.blocks.get(at as usize).ok_or_else(|| format!("block {at} is out of range"))?;
            if std::mem::replace(&mut seen[at as usize], true) {
                return Err(format!("block {at} is reached twice"));
            }
            order.push((at, parent, slot));
            if !is_leaf(block) {
                deepest = deepest.max(level);
                if as_node(block).first_child.checked_add(WIDTH as u32).is_none() {
                    return Err(format!("children of block {at} are out of range"));
                }
                work.extend(children(block).map(|(slot, child)| (child, at, slot, level + 1)));
            }
        }

        // every block is reached, at the recorded depth
        if let Some(at) = seen.iter().position(|s| !s) {
            return Err(format!("block {at} is never reached"));
        }
        if deepest != self.depth || deepest > MAX_DEPTH {
            return Err(format!("depth is {deepest}, recorded as {}; at most {MAX_DEPTH}", self.depth));
        }

        // children before parents: what is below a block lies within the box that its parent has
        // for it
        let of_leaf = |b: &Block| if is_leaf(b) { bounds_of(b) } else { Aabb::EMPTY };
        let mut below: Vec<Aabb> = self.blocks.par_iter().map(of_leaf).collect();
        for &(at, parent, slot) in order.iter().rev() {
            if at == 0 {
                continue;
            }
            let own = below[at as usize];
            let planes = child_box(&self.blocks[parent as usize], slot);
            // a comparison with a plane that is no number fails
            if !(0..3).all(|a| planes[a][0] <= f64::from(own.min[a]) && planes[a][1] >= f64::from(own.max[a])) {
                return Err(format!("a primitive below block {at} sticks out of its box"));
            }
            below[parent as usize] = below[parent as usize].union(own);
        }
        Ok(below[0])
    }
}

/// Is the block a leaf?
pub fn is_leaf(block: &Block) -> bool {
    block.flags & LEAF != 0
}

/// A block with the flag of leaves.
pub fn as_leaf(mut block: Block) -> Block {
    block.flags |= LEAF;
    block
}

/// A block that is a node.
fn as_node(block: &Block) -> &WideNode {
    bytemuck::cast_ref(block)
}

/// A copy of a block whose child references are offset by `by` blocks.
pub fn rebased(mut block: Block, by: u32) -> Block {
    if !is_leaf(&block) {
        let node: &mut WideNode = bytemuck::cast_mut(&mut block);
        node.first_child = node.first_child.wrapping_add(by);
    }
    block
}

/// Block of a node's first child.
pub(super) fn first_child(node: &Block) -> u32 {
    as_node(node).first_child
}

/// Slots and blocks of a node's children.
pub fn children(node: &Block) -> impl Iterator<Item = (usize, u32)> {
    let node = as_node(node);
    let (first, present) = (node.first_child, node.upper_y[WIDTH]);
    (0..WIDTH).filter(move |s| present >> s & 1 == 1).zip(first..)
}

/// Box of a slot's child: lower and upper plane per axis.
pub fn child_box(node: &Block, slot: usize) -> [[f64; 2]; 3] {
    let node = as_node(node);
    let planes = [(node.lower_x, node.upper_x), (node.lower_y, node.upper_y), (node.lower_z, node.upper_z)];
    std::array::from_fn(|axis| {
        let (lower, upper) = planes[axis];
        let scale = f64::from(f32::from_bits(u32::from(lower[WIDTH]) << 23));
        [lower[slot], upper[slot]].map(|plane| f64::from(node.corner[axis]) + f64::from(plane) * scale)
    })
}

fn node_box(tree: &Bvh2, n: usize) -> Aabb {
    Aabb { min: tree.nodes[n].min, max: tree.nodes[n].max }
}

/// A node of the binary tree with what its subtree costs as at most 1, 2, ... wide subtrees.
struct Local {
    node: u32,
    /// Index of the left child, 0 for leaves and for roots of other pieces; the right one's.
    children: [u32; 2],
    cost: [f32; WIDTH],
}

/// Least cost of two subtrees as at most `count` wide ones together (two or more), and how many of
/// those on the left.
fn split(left: &[f32; WIDTH], right: &[f32; WIDTH], count: usize) -> (f32, usize) {
    let cost = |k: usize| (left[k - 1] + right[count - k - 1], k);
    (2..count).map(cost).fold(cost(1), |a, b| if b.0 < a.0 { b } else { a })
}

/// Area of a box as a share of a larger one's, whatever the scale: areas alone leave the range of a
/// float at 1e19 and at 1e-20.
fn share(of: Aabb, whole: Aabb) -> f32 {
    let area = |b: Aabb| {
        let d = (b.max.as_dvec3() - b.min.as_dvec3()).max(glam::DVec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    };
    let whole = area(whole);
    if whole > 0.0 { (area(of) / whole) as f32 } else { 0.0 }
}

impl Piece {
    /// `cuts`: roots of other pieces (sorted), which are not descended into.
    fn collapse(
        tree: &Bvh2,
        root: usize,
        cuts: &[(usize, usize)],
        pieces: &[Piece],
        leaf: &(impl Fn(u32) -> Block + Sync),
    ) -> Self {
        // a copy of the subtree, which ends at the roots of other pieces
        let whole = node_box(tree, 0);
        let cut = |n: u32| cuts.binary_search_by_key(&(n as usize), |c| c.0).ok().map(|k| cuts[k].1);
        let mut locals = vec![Local { node: root as u32, children: [0; 2], cost: [0.0; WIDTH] }];
        // parents before children
        let mut work = vec![0usize];
        while let Some(k) = work.pop() {
            let node = &tree.nodes[locals[k].node as usize];
            if node.is_leaf() || (!cuts.is_empty() && cut(locals[k].node).is_some()) {
                continue;
            }
            let at = locals.len();
            locals[k].children = [at as u32, at as u32 + 1];
            locals.extend([0, 1].map(|c| Local { node: node.first_index + c, children: [0; 2], cost: [0.0; WIDTH] }));
            work.extend([at + 1, at]);
        }

        // children before parents: the least cost of covering each subtree with 1 to 8 children
        for k in (0..locals.len()).rev() {
            let area = share(node_box(tree, locals[k].node as usize), whole);
            locals[k].cost = match locals[k].children {
                [0, _] if tree.nodes[locals[k].node as usize].is_leaf() => [area; WIDTH],
                [0, _] => [cut(locals[k].node).map_or(area, |p| pieces[p].cost); WIDTH],
                [l, r] => {
                    let (left, right) = (locals[l as usize].cost, locals[r as usize].cost);
                    let mut cost = [area + split(&left, &right, WIDTH).0; WIDTH];
                    for count in 2..=WIDTH {
                        cost[count - 1] = cost[count - 2].min(split(&left, &right, count).0);
                    }
                    cost
                }
            };
        }

        // blocks from the root down: each node opens the children that its least cost asks for
        let mut out = Self { blocks: vec![Block::default()], depth: 1, cost: locals[0].cost[0], inserts: Vec::new() };
        let mut work = vec![(0usize, 0usize, 1u32)];
        let (mut found, mut open) = (Vec::new(), Vec::new());
        while let Some((k, at, level)) = work.pop() {
            out.depth = out.depth.max(level);
            found.clear();
            match locals[k].children {
                // a tree of a single leaf: its node has that as its only child
                [0, _] => found.push(k),
                children => open.push((children, WIDTH)),
            }
            while let Some(([l, r], count)) = open.pop() {
                let k = split(&locals[l as usize].cost, &locals[r as usize].cost, count).1;
                for (child, mut count) in [(l as usize, k), (r as usize, count - k)] {
                    let cost = &locals[child].cost;
                    while count > 1 && cost[count - 1] >= cost[count - 2] {
                        count -= 1;
                    }
                    if count == 1 { found.push(child) } else { open.push((locals[child].children, count)) }
                }
            }

            // slots are in the order of the octants, in which rays visit them
            let mut boxes = [(0usize, Aabb::EMPTY); WIDTH];
            let boxes = &mut boxes[..found.len()];
            for (b, &child) in boxes.iter_mut().zip(&found) {
                b.1 = node_box(tree, locals[child].node as usize);
            }
            let bounds = node_box(tree, locals[k].node as usize);
            assign_slots(boxes, bounds);
            let mut order: [usize; WIDTH] = std::array::from_fn(|k| k);
            let order = &mut order[..found.len()];
            order.sort_unstable_by_key(|&k| boxes[k].0);

            // children lie side by side: leaves at once, nodes when their turn comes
            let first = out.blocks.len();
            out.blocks[at] = node(bounds, boxes, first as u32);
            for (place, &j) in (first..).zip(&*order) {
                let child = found[j];
                let number = locals[child].node;
                let binary = &tree.nodes[number as usize];
                if binary.is_leaf() {
                    out.blocks.push(as_leaf(leaf(tree.primitive_indices[binary.first_index as usize])));
                    continue;
                }
                out.blocks.push(Block::default());
                match cut(number) {
                    Some(piece) => out.inserts.push((place as u32, piece, level + 1)),
                    None => work.push((child, place, level + 1)),
                }
            }
        }
        out
    }
}

/// Gives each child the slot whose direction from the node's middle is most its own, so that going
/// through the slots in the order of a ray's octant meets near children first (Ylitie et al.,
/// section 3.2; greedily).
fn assign_slots(children: &mut [(usize, Aabb)], parent: Aabb) {
    let middle = parent.min + parent.max;
    let mut free = (1u32 << WIDTH) - 1;
    let mut left: u32 = (1 << children.len()) - 1;
    let mut offsets = [Vec3::ZERO; WIDTH];
    for (o, c) in offsets.iter_mut().zip(&*children) {
        *o = c.1.min + c.1.max - middle;
    }
    while left != 0 {
        let mut best = (f32::NEG_INFINITY, 0, 0);
        for c in (0..children.len()).filter(|c| left >> c & 1 == 1) {
            for s in (0..WIDTH).filter(|s| free >> s & 1 == 1) {
                let sign = |bit: usize| if s & bit != 0 { 1.0 } else { -1.0 };
                let value = offsets[c].dot(Vec3::new(sign(4), sign(2), sign(1)));
                if value > best.0 {
                    best = (value, c, s);
                }
            }
        }
        // a value that is not a number loses to all: then the first free slot will do
        if best.0 == f32::NEG_INFINITY {
            best = (0.0, left.trailing_zeros() as usize, free.trailing_zeros() as usize);
        }
        children[best.1].0 = best.2;
        left &= !(1 << best.1);
        free &= !(1 << best.2);
    }
}

/// A node over its children's boxes by slot, whose blocks begin at `first`: planes are rounded
/// outwards.
pub(super) fn node(bounds: Aabb, children: &[(usize, Aabb)], first: u32) -> Block {
    let (mut lower, mut upper, mut present) = ([[0u8; WIDTH + 1]; 3], [[0u8; WIDTH + 1]; 3], 0u8);
    for axis in 0..3 {
        let low = bounds.min[axis] as f64;
        let extent = bounds.max[axis] as f64 - low;
        // the least power of two of which 255 reach across
        let mut exponent = ((extent / 255.0) as f32).to_bits() >> 23;
        while f32::from_bits(exponent << 23) as f64 * 255.0 < extent && exponent < 254 {
            exponent += 1;
        }
        let exponent = exponent.max(1);
        let scale = 1.0 / f32::from_bits(exponent << 23) as f64;
        lower[axis] = [255; WIDTH + 1];
        for &(slot, b) in children {
            lower[axis][slot] = ((b.min[axis] as f64 - low) * scale).floor().clamp(0.0, 255.0) as u8;
            upper[axis][slot] = ((b.max[axis] as f64 - low) * scale).ceil().clamp(0.0, 255.0) as u8;
            present |= 1 << slot;
        }
        lower[axis][WIDTH] = exponent as u8;
    }
    upper[1][WIDTH] = present;
    let ([lower_x, lower_y, lower_z], [upper_x, upper_y, upper_z]) = (lower, upper);
    let corner = bounds.min.to_array();
    bytemuck::cast(WideNode { corner, first_child: first, lower_x, upper_x, lower_y, upper_y, lower_z, upper_z })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::accel::{BuildPreset, build};

    pub fn boxes(n: usize, scale: f32, offset: f32) -> Vec<Aabb> {
        (0..n)
            .map(|i| {
                let c = Vec3::new((i * 37 % 101) as f32, (i * 61 % 89) as f32, (i * 17 % 97) as f32) * scale + offset;
                let r = Vec3::new(0.0, 0.1 + (i % 7) as f32, 3.0) * scale;
                Aabb { min: c - r, max: c + r }
            })
            .collect()
    }

    /// A leaf that holds nothing but a number.
    pub fn of_item(item: u32) -> Block {
        let mut block = Block::default();
        block.body[0] = item;
        block
    }

    fn tree(boxes: &[Aabb]) -> WideBvh {
        if boxes.is_empty() {
            return WideBvh::default();
        }
        let binary = build::tree(boxes, BuildPreset::Default, None);
        WideBvh::collapse(&binary, of_item)
    }

    /// Areas beyond the range of a float, below it, and none at all.
    #[test]
    fn trees_of_any_scale_end() {
        for (scale, offset) in [(1e18, 0.0), (1e16, -1e18), (1e-30, 0.0), (0.0, 1.0)] {
            let boxes = boxes(3000, scale, offset);
            let tree = tree(&boxes);
            check(&tree, &boxes).unwrap_or_else(|e| panic!("{scale}: {e}"));
            assert!(tree.sah_cost.is_finite(), "{scale}: {}", tree.sah_cost);
        }
    }

    fn check(tree: &WideBvh, boxes: &[Aabb]) -> Result<(), String> {
        let mut items: Vec<u32> = tree.blocks.iter().filter(|b| is_leaf(b)).map(|b| b.body[0]).collect();
        items.sort_unstable();
        if items != (0..boxes.len() as u32).collect::<Vec<_>>() {
            return Err("not every item has one leaf".into());
        }
        tree.validate(|b| boxes[b.body[0] as usize]).map(drop)
    }

    #[test]
    fn trees_of_every_size_and_scale_are_valid() {
        for n in (0..40).chain([100, 1000, 20_000]) {
            for (scale, offset) in [(1.0, 0.0), (1e-3, 10.0), (1e5, -1e6)] {
                let b = boxes(n, scale, offset);
                check(&tree(&b), &b).unwrap_or_else(|e| panic!("{n} boxes at scale {scale}, offset {offset}: {e}"));
            }
        }
    }

    #[test]
    fn validate_sees_damage() {
        let b = boxes(500, 1.0, 0.0);
        let good = tree(&b);
        let mut bad = good.clone();
        bytemuck::cast_mut::<Block, WideNode>(&mut bad.blocks[0]).corner[0] += 20.0;
        assert!(check(&bad, &b).is_err());
        let mut bad = good.clone();
        bytemuck::cast_mut::<Block, WideNode>(&mut bad.blocks[0]).first_child += 1;
        assert!(check(&bad, &b).is_err());
        let mut bad = good;
        bad.depth += 1;
        assert!(check(&bad, &b).is_err());
    }
}
