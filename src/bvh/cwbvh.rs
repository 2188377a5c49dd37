//! The eight-wide hierarchy that `shaders/trace/wide.glsl` walks: Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on
//! GPUs Through Compressed Wide BVHs" (HPG 2017), in obvhs's layout of 80 bytes a node.
//!
//! The traversal's stack cannot overflow: a node visit pushes at most one entry (the rest of its group of children), so a
//! tree needs as many entries as its longest path has nodes, and the shader's stack is specialised to that.

use obvhs::cwbvh::node::CwBvhNode;

use super::{Aabb, BuildPreset, build};

/// Most primitives of a leaf: what a node's two bits and a pair fetch make best use of.
const MAX_LEAF: u32 = 3;
/// Bytes of a node.
pub const NODE_BYTES: u64 = size_of::<CwBvhNode>() as u64;

/// An eight-wide hierarchy.
#[derive(Clone, Debug, Default)]
pub struct Cwbvh {
    /// Nodes; the root is the first. There is one even over nothing.
    pub nodes: Vec<CwBvhNode>,
    /// For each slot of the leaves, the number of the primitive that lies there.
    pub primitives: Vec<u32>,
    /// Nodes on the longest path from the root.
    pub depth: u32,
    /// Bounds of everything.
    pub bounds: Option<Aabb>,
}

impl Cwbvh {
    /// Builds the tree of `boxes`, each widened by `pad` on all sides; none may be empty or NaN. `pad` must cover four
    /// half-ulps of the largest coordinate: it holds what quantisation and the traversal round away.
    pub fn build(mut boxes: Vec<Aabb>, pad: f32, preset: BuildPreset) -> Self {
        if boxes.is_empty() {
            return Self { nodes: vec![CwBvhNode::default()], primitives: Vec::new(), depth: 1, bounds: None };
        }
        for b in &mut boxes {
            *b = Aabb { min: b.min - pad, max: b.max + pad };
        }
        let tree = build::tree(&boxes, preset, None);
        drop(boxes);
        let wide = obvhs::cwbvh::bvh2_to_cwbvh::bvh2_to_cwbvh(&tree, MAX_LEAF, true, false);
        let bounds = Aabb { min: wide.total_aabb.min.into(), max: wide.total_aabb.max.into() };
        let mut out = Self { nodes: wide.nodes, primitives: wide.primitive_indices, depth: 0, bounds: Some(bounds) };
        out.depth = out.walk(|_, _| ());
        out
    }

    /// A node as it lies in a buffer in which this tree's nodes begin at `first_node` and its primitives at `first_primitive`.
    pub fn rebased(&self, index: usize, first_node: u32, first_primitive: u32) -> CwBvhNode {
        let n = self.nodes[index];
        CwBvhNode {
            child_base_idx: n.child_base_idx + first_node,
            primitive_base_idx: n.primitive_base_idx + first_primitive,
            ..n
        }
    }

    /// Calls `see` for every child with the node's index and its slot; returns the nodes on the longest path.
    fn walk(&self, mut see: impl FnMut(usize, usize)) -> u32 {
        let (mut deepest, mut work) = (0, vec![(0usize, 1u32)]);
        while let Some((index, level)) = work.pop() {
            deepest = deepest.max(level);
            for slot in 0..8 {
                if self.nodes[index].child_meta[slot] != 0 {
                    see(index, slot);
                }
                if let Some(child) = self.child(index, slot) {
                    work.push((child, level + 1));
                }
            }
        }
        deepest
    }

    /// The inner child in a slot.
    fn child(&self, index: usize, slot: usize) -> Option<usize> {
        let n = &self.nodes[index];
        let below = n.imask & ((1u16 << slot) - 1) as u8;
        (n.imask >> slot & 1 == 1).then(|| n.child_base_idx as usize + below.count_ones() as usize)
    }

    /// Slots of the leaf in a slot of a node.
    fn leaf(&self, index: usize, slot: usize) -> Option<std::ops::Range<usize>> {
        let n = &self.nodes[index];
        let meta = n.child_meta[slot];
        (meta != 0 && n.imask >> slot & 1 == 0).then(|| {
            let first = n.primitive_base_idx as usize + (meta & 0x1f) as usize;
            first..first + (meta >> 5).count_ones() as usize
        })
    }

    /// Box of a child as the traversal sees it.
    fn child_box(&self, index: usize, slot: usize) -> [[f64; 2]; 3] {
        let n = &self.nodes[index];
        let planes = [[n.child_min_x, n.child_max_x], [n.child_min_y, n.child_max_y], [n.child_min_z, n.child_max_z]];
        std::array::from_fn(|axis| {
            let scale = f32::from_bits((n.e[axis] as u32) << 23) as f64;
            [0, 1].map(|side| n.p[axis] as f64 + planes[axis][side][slot] as f64 * scale)
        })
    }

    /// Checks the structure against the unpadded boxes it was built from: every primitive in exactly one leaf, every quantised
    /// box around what is below it, the depth as stated. The error says what is wrong.
    pub fn validate(&self, boxes: &[Aabb]) -> Result<(), String> {
        let mut seen = vec![0u32; boxes.len()];
        let mut wrong = None;
        // every ancestor's box has to hold a primitive: gather them on the way down
        let mut work = vec![(0usize, Vec::<[[f64; 2]; 3]>::new())];
        while let Some((index, above)) = work.pop() {
            for slot in 0..8 {
                if self.nodes[index].child_meta[slot] == 0 {
                    continue;
                }
                let mut chain = above.clone();
                chain.push(self.child_box(index, slot));
                if let Some(range) = self.leaf(index, slot) {
                    for s in range {
                        let Some(&p) = self.primitives.get(s) else { return Err(format!("slot {s} is outside")) };
                        let Some(count) = seen.get_mut(p as usize) else { return Err(format!("primitive {p} is outside")) };
                        *count += 1;
                        let b = boxes[p as usize];
                        let inside =
                            |c: &[[f64; 2]; 3]| (0..3).all(|a| c[a][0] <= b.min[a] as f64 && c[a][1] >= b.max[a] as f64);
                        if !chain.iter().all(inside) {
                            wrong = Some(format!("primitive {p} sticks out of a box above it"));
                        }
                    }
                } else if let Some(child) = self.child(index, slot) {
                    if child >= self.nodes.len() {
                        return Err(format!("child {child} of node {index} is outside"));
                    }
                    work.push((child, chain));
                }
            }
        }
        if let Some(p) = seen.iter().position(|&s| s != 1) {
            return Err(format!("primitive {p} is in {} leaves", seen[p]));
        }
        let depth = self.walk(|_, _| ());
        if depth != self.depth {
            wrong = Some(format!("depth is {depth}, said to be {}", self.depth));
        }
        wrong.map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn boxes(n: usize, scale: f32, offset: f32) -> Vec<Aabb> {
        (0..n)
            .map(|i| {
                let c = Vec3::new((i * 37 % 101) as f32, (i * 61 % 89) as f32, (i * 17 % 97) as f32) * scale + offset;
                let r = Vec3::new(0.0, 0.1 + (i % 7) as f32, 3.0) * scale;
                Aabb { min: c - r, max: c + r }
            })
            .collect()
    }

    fn pad(b: &[Aabb]) -> f32 {
        b.iter().fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element())) * 4.0 * f32::EPSILON
    }

    #[test]
    fn trees_of_every_size_and_scale_are_valid() {
        for n in (0..40).chain([100, 1000, 20_000]) {
            for (scale, offset) in [(1.0, 0.0), (1e-3, 10.0), (1e5, -1e6)] {
                let b = boxes(n, scale, offset);
                let tree = Cwbvh::build(b.clone(), pad(&b), BuildPreset::Default);
                tree.validate(&b).unwrap_or_else(|e| panic!("{n} boxes at scale {scale}, offset {offset}: {e}"));
            }
        }
    }

    #[test]
    fn validate_sees_damage() {
        let b = boxes(500, 1.0, 0.0);
        let good = Cwbvh::build(b.clone(), pad(&b), BuildPreset::Default);
        let mut bad = good.clone();
        bad.primitives[3] = bad.primitives[4];
        assert!(bad.validate(&b).is_err());
        let mut bad = good.clone();
        bad.nodes[0].p.x += 20.0;
        assert!(bad.validate(&b).is_err());
        let mut bad = good;
        bad.depth += 1;
        assert!(bad.validate(&b).is_err());
    }
}
