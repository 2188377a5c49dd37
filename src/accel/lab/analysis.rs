//! Figures of a finished tree: counts, costs by area, how siblings overlap, how much of a node is
//! empty, level by level, and the subtrees that cost most.

use std::collections::BTreeMap;

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use serde::Serialize;

use super::body::Body;
use super::heuristic::CostConstants;
use super::projection::RayDistribution;
use crate::accel::Aabb;
use crate::interface::records::hierarchy::{BinaryNode, TriangleRecord};

/// Number of the costliest subtrees that are listed.
const WORST: usize = 20;
/// Meshes that a subtree names.
const NAMED_MESHES: usize = 3;

/// Costs of a tree by the areas of its boxes: what a ray is expected to cost that meets the root's
/// box and is not stopped by a hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TreeCost {
    /// Inner nodes that the ray visits.
    pub nodes: f64,
    /// Primitives that it tests.
    pub primitives: f64,
    /// 2 x 1.0 an inner node and 1.2 a primitive: Falcone's section 1.3.3.
    pub falcone: f64,
    /// 2 x 1.2 an inner node and 1.0 a primitive: his section 5.1.2.
    pub swapped: f64,
}

impl TreeCost {
    /// From the expected counts.
    pub fn new(nodes: f64, primitives: f64) -> Self {
        let cost = |c: CostConstants| 2.0 * c.node * nodes + c.primitive * primitives;
        Self { nodes, primitives, falcone: cost(CostConstants::FALCONE), swapped: cost(CostConstants::SWAPPED) }
    }
}

/// The nodes of one depth.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Level {
    /// Inner nodes above them.
    pub level: u32,
    /// Nodes, leaves included.
    pub nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// References to primitives in these leaves.
    pub primitives: u64,
    /// The level's part of the cost by surface area.
    pub sah: f64,
    /// The level's part of the cost by projected area, where rays are given.
    pub pah: Option<f64>,
    /// Mean over its inner nodes: volume in both children, as a share of the node's.
    pub overlap_volume: f64,
    /// The same of surface areas.
    pub overlap_area: f64,
    /// The same of projected areas, where rays are given.
    pub overlap_projected: Option<f64>,
    /// Mean over its inner nodes: volume in neither child, as a share of the node's.
    pub empty: f64,
}

/// A subtree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Subtree {
    /// Index of its root in the tree.
    pub node: u32,
    /// Inner nodes above it.
    pub level: u32,
    /// References to primitives in it.
    pub primitives: u64,
    /// Share of the tree's cost by surface area (by projected area where rays are given).
    pub share: f64,
    /// Cost of a ray that meets its box.
    pub cost: f64,
    /// Mean overlap of siblings in it, by surface area.
    pub overlap: f64,
    /// Meshes of most of its primitives: index of the mesh, and how many.
    pub meshes: Vec<(u32, u64)>,
}

/// The analysis of a tree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TreeAnalysis {
    /// Primitives.
    pub primitives: u64,
    /// References to them in leaves: more where spatial splits cut some.
    pub references: u64,
    /// Inner nodes.
    pub inner_nodes: u64,
    /// Leaves.
    pub leaves: u64,
    /// Inner nodes on the longest path.
    pub depth: u32,
    /// Bytes of nodes and primitives in the layout of the binary kernel.
    pub bytes: u64,
    /// Cost by surface area.
    pub sah: TreeCost,
    /// Cost by projected area, where rays are given.
    pub pah: Option<TreeCost>,
    /// Means over all inner nodes, as of levels.
    pub overlap_volume: f64,
    /// As of levels.
    pub overlap_area: f64,
    /// As of levels.
    pub overlap_projected: Option<f64>,
    /// As of levels.
    pub empty: f64,
    /// The levels from the root down.
    pub levels: Vec<Level>,
    /// Leaves by their number of primitives.
    pub leaf_sizes: BTreeMap<u32, u64>,
    /// Subtrees of about the same size that cost most, the costliest first.
    pub worst: Vec<Subtree>,
}

/// Sums over some inner nodes.
#[derive(Clone, Copy, Default)]
struct Sums {
    inner: u64,
    volume: f64,
    area: f64,
    projected: f64,
    empty: f64,
}

impl Sums {
    fn add(&mut self, o: &Self) {
        self.inner += o.inner;
        self.volume += o.volume;
        self.area += o.area;
        self.projected += o.projected;
        self.empty += o.empty;
    }

    fn mean(&self, sum: f64) -> f64 {
        sum / self.inner.max(1) as f64
    }
}

/// Analyses a tree over a body, for rays where they are given (in the body's space). A tree over
/// instances has no body.
pub fn analyse(tree: &Bvh2, body: Option<&Body>, rays: Option<&RayDistribution>) -> TreeAnalysis {
    let count = body.map_or(tree.primitive_indices.len(), |b| b.shapes.len());
    let mut out = TreeAnalysis {
        primitives: count as u64,
        references: 0,
        inner_nodes: 0,
        leaves: 0,
        depth: 0,
        bytes: 0,
        sah: TreeCost::default(),
        pah: None,
        overlap_volume: 0.0,
        overlap_area: 0.0,
        overlap_projected: None,
        empty: 0.0,
        levels: Vec::new(),
        leaf_sizes: BTreeMap::new(),
        worst: Vec::new(),
    };
    let Some(root) = tree.nodes.first() else { return out };

    // nodes from the root down: each with its level and its probability by both measures
    let surface = RayDistribution::Uniform;
    let whole = [surface, rays.copied().unwrap_or(surface)].map(|r| r.measure(&bounds(root)));
    let share = |r: &RayDistribution, b: &Aabb, whole: f64| if whole > 0.0 { r.measure(b) / whole } else { 0.0 };
    let mut order: Vec<(usize, u32)> = Vec::with_capacity(tree.nodes.len());
    let mut work = vec![(0usize, 0u32)];
    let mut sums: Vec<Sums> = Vec::new();
    let mut costs = [[0.0; 2]; 2];
    let mut cost_of = vec![0.0; tree.nodes.len()];
    while let Some((at, level)) = work.pop() {
        order.push((at, level));
        if out.levels.len() <= level as usize {
            out.levels.push(Level { level: out.levels.len() as u32, pah: rays.map(|_| 0.0), ..Level::default() });
            sums.push(Sums::default());
        }
        let node = &tree.nodes[at];
        let p_surface = share(&surface, &bounds(node), whole[0]);
        let p_rays = rays.map_or(0.0, |r| share(r, &bounds(node), whole[1]));
        let row = &mut out.levels[level as usize];
        row.nodes += 1;
        let (kind, n, unit) = if node.is_leaf() {
            row.leaves += 1;
            row.primitives += u64::from(node.prim_count);
            *out.leaf_sizes.entry(node.prim_count).or_default() += 1;
            (1, f64::from(node.prim_count), CostConstants::FALCONE.primitive)
        } else {
            let first = node.first_index as usize;
            work.extend([(first + 1, level + 1), (first, level + 1)]);
            sums[level as usize].add(&overlap(tree, node, rays));
            (0, 1.0, 2.0 * CostConstants::FALCONE.node)
        };
        costs[0][kind] += p_surface * n;
        costs[1][kind] += p_rays * n;
        row.sah += p_surface * n * unit;
        row.pah = row.pah.map(|sum| sum + p_rays * n * unit);
        cost_of[at] = if rays.is_some() { p_rays } else { p_surface } * n * unit;
    }

    // the whole and its levels
    let mut all = Sums::default();
    for (row, sums) in out.levels.iter_mut().zip(&sums) {
        row.overlap_volume = sums.mean(sums.volume);
        row.overlap_area = sums.mean(sums.area);
        row.overlap_projected = rays.map(|_| sums.mean(sums.projected));
        row.empty = sums.mean(sums.empty);
        all.add(sums);
    }
    out.leaves = out.levels.iter().map(|l| l.leaves).sum();
    out.references = out.levels.iter().map(|l| l.primitives).sum();
    out.inner_nodes = all.inner;
    out.depth = out.levels.len() as u32 - 1;
    out.bytes = out.inner_nodes * size_of::<BinaryNode>() as u64 + out.references * size_of::<TriangleRecord>() as u64;
    out.sah = TreeCost::new(costs[0][0], costs[0][1]);
    out.pah = rays.map(|_| TreeCost::new(costs[1][0], costs[1][1]));
    out.overlap_volume = all.mean(all.volume);
    out.overlap_area = all.mean(all.area);
    out.overlap_projected = rays.map(|_| all.mean(all.projected));
    out.empty = all.mean(all.empty);
    if let Some(body) = body {
        let measure = |b: &Aabb| match rays {
            Some(r) => share(r, b, whole[1]),
            None => share(&surface, b, whole[0]),
        };
        let total = out.pah.unwrap_or(out.sah).falcone;
        out.worst = worst_subtrees(tree, body, &order, &cost_of, measure, total);
    }
    out
}

fn bounds(node: &Bvh2Node) -> Aabb {
    Aabb { min: node.min, max: node.max }
}

/// How the children of an inner node lie in it.
fn overlap(tree: &Bvh2, node: &Bvh2Node, rays: Option<&RayDistribution>) -> Sums {
    let first = node.first_index as usize;
    let [a, b] = [first, first + 1].map(|k| bounds(&tree.nodes[k]));
    let both = Aabb { min: a.min.max(b.min), max: a.max.min(b.max) };
    let volume = |b: &Aabb| (b.max - b.min).max(glam::Vec3::ZERO).as_dvec3().element_product();
    let ratio = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    let whole = bounds(node);
    let of = |r: &RayDistribution| ratio(r.measure(&both), r.measure(&whole));
    let (v, v_both) = (volume(&whole), if both.min.cmple(both.max).all() { volume(&both) } else { 0.0 });
    Sums {
        inner: 1,
        volume: ratio(v_both, v),
        area: of(&RayDistribution::Uniform),
        projected: rays.map_or(0.0, of),
        empty: if v > 0.0 { (1.0 - (volume(&a) + volume(&b) - v_both) / v).clamp(0.0, 1.0) } else { 0.0 },
    }
}

/// The costliest of the largest subtrees below a two-hundredth of all primitives. `order` has nodes
/// before their children.
fn worst_subtrees(
    tree: &Bvh2,
    body: &Body,
    order: &[(usize, u32)],
    cost_of: &[f64],
    measure: impl Fn(&Aabb) -> f64,
    total: f64,
) -> Vec<Subtree> {
    let limit = (body.shapes.len() as u64 / 200).max(16);

    // sums from the leaves up
    let mut cost = cost_of.to_vec();
    let mut count = vec![0u64; tree.nodes.len()];
    let mut overlaps = vec![(0.0, 0u64); tree.nodes.len()];
    for &(at, _) in order.iter().rev() {
        let node = &tree.nodes[at];
        count[at] = u64::from(node.prim_count);
        if !node.is_leaf() {
            let own = overlap(tree, node, None).area;
            overlaps[at] = (own, 1);
            for k in [0, 1].map(|k| node.first_index as usize + k) {
                cost[at] += cost[k];
                count[at] += count[k];
                overlaps[at] = (overlaps[at].0 + overlaps[k].0, overlaps[at].1 + overlaps[k].1);
            }
        }
    }

    // from the root down to where they are small enough
    let (mut found, mut work) = (Vec::new(), vec![(0usize, 0u32)]);
    while let Some((at, level)) = work.pop() {
        let node = &tree.nodes[at];
        if count[at] > limit && !node.is_leaf() {
            let first = node.first_index as usize;
            work.extend([(first, level + 1), (first + 1, level + 1)]);
            continue;
        }
        let p = measure(&bounds(node));
        found.push(Subtree {
            node: at as u32,
            level,
            primitives: count[at],
            share: if total > 0.0 { cost[at] / total } else { 0.0 },
            cost: if p > 0.0 { cost[at] / p } else { 0.0 },
            overlap: overlaps[at].0 / overlaps[at].1.max(1) as f64,
            meshes: Vec::new(),
        });
    }
    found.sort_by(|a, b| b.share.total_cmp(&a.share).then(a.node.cmp(&b.node)));
    found.truncate(WORST);
    for subtree in &mut found {
        subtree.meshes = meshes_below(tree, body, subtree.node as usize);
    }
    found
}

/// The meshes of most primitives in a subtree.
fn meshes_below(tree: &Bvh2, body: &Body, root: usize) -> Vec<(u32, u64)> {
    let mut counts = BTreeMap::<u32, u64>::new();
    let mut work = vec![root];
    while let Some(at) = work.pop() {
        let node = &tree.nodes[at];
        let first = node.first_index as usize;
        if node.is_leaf() {
            for slot in first..first + node.prim_count as usize {
                *counts.entry(body.owners[tree.primitive_indices[slot] as usize].mesh).or_default() += 1;
            }
        } else {
            work.extend([first, first + 1]);
        }
    }
    let mut out: Vec<(u32, u64)> = counts.into_iter().collect();
    out.sort_by_key(|&(mesh, n)| (std::cmp::Reverse(n), mesh));
    out.truncate(NAMED_MESHES);
    out
}

#[cfg(test)]
mod tests {
    use super::super::body::{Owner, Shape};
    use super::*;
    use glam::{DVec3, Vec3};

    fn node(min: [f32; 3], max: [f32; 3], prim_count: u32, first_index: u32) -> Bvh2Node {
        Bvh2Node { min: min.into(), max: max.into(), prim_count, first_index }
    }

    /// A tree whose figures are known: a box of 4 x 1 x 1, of which one half is a leaf of two, and
    /// the other two leaves that overlap by a quarter of it.
    #[test]
    fn figures_are_those_of_a_tree_by_hand() {
        let tree = Bvh2 {
            nodes: vec![
                node([0.0; 3], [4.0, 1.0, 1.0], 0, 1),
                node([0.0; 3], [2.0, 1.0, 1.0], 2, 0),
                node([2.0, 0.0, 0.0], [4.0, 1.0, 1.0], 0, 3),
                node([2.0, 0.0, 0.0], [3.0, 1.0, 1.0], 1, 2),
                node([2.5, 0.0, 0.0], [3.5, 1.0, 1.0], 1, 3),
            ],
            primitive_indices: vec![0, 1, 2, 3],
            ..Default::default()
        };
        let shape = Shape::Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
        let owners = [0, 0, 1, 1].map(|mesh| Owner { instance: 0, mesh, primitive: 0 });
        let body = Body { shapes: vec![shape; 4], owners: owners.to_vec(), pad: 0.0 };
        let rays = RayDistribution::Parallel(DVec3::Y);
        let a = analyse(&tree, Some(&body), Some(&rays));
        assert_eq!((a.inner_nodes, a.leaves, a.references, a.depth), (2, 3, 4, 2));
        assert_eq!(a.leaf_sizes, BTreeMap::from([(1, 2), (2, 1)]));
        // half areas: 9 of the root, 5 of its halves, 3 of cubes
        let (nodes, primitives) = (1.0 + 5.0 / 9.0, 2.0 * 5.0 / 9.0 + 2.0 * 3.0 / 9.0);
        assert!((a.sah.nodes - nodes).abs() < 1e-12 && (a.sah.primitives - primitives).abs() < 1e-12);
        assert!((a.sah.falcone - (2.0 * nodes + 1.2 * primitives)).abs() < 1e-12);
        assert!((a.sah.swapped - (2.4 * nodes + primitives)).abs() < 1e-12);
        // projected: 4, 2 and 1
        let pah = a.pah.unwrap();
        assert!((pah.nodes - 1.5).abs() < 1e-12 && (pah.primitives - 1.5).abs() < 1e-12);
        let sum = |f: fn(&Level) -> f64| a.levels.iter().map(f).sum::<f64>();
        assert!(
            (sum(|l| l.sah) - a.sah.falcone).abs() < 1e-12 && (sum(|l| l.pah.unwrap()) - pah.falcone).abs() < 1e-12
        );
        assert!((a.levels[1].overlap_volume - 0.25).abs() < 1e-9 && a.levels[0].overlap_volume == 0.0);
        assert!((a.levels[1].overlap_projected.unwrap() - 0.25).abs() < 1e-9);
        assert!((a.levels[1].empty - 0.25).abs() < 1e-9 && a.levels[0].empty == 0.0);
        // the whole is below the limit, and half of it is of either mesh
        assert_eq!(a.worst.len(), 1);
        assert_eq!((a.worst[0].meshes.as_slice(), a.worst[0].primitives), (&[(0, 2), (1, 2)][..], 4));
        assert!((a.worst[0].share - 1.0).abs() < 1e-12);
    }
}
