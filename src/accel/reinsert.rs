//! Makes a binary tree cheaper by moving subtrees to where they cost less: Meister and Bittner,
//! "Parallel Reinsertion for Bounding Volume Hierarchy Optimization" (EG 2018). The search is
//! parallel, the moves are not.
//!
//! It corrects a weakness of top-down builders: a large box has to stay in one of two halves.

use glam::Vec4;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;
use std::collections::BinaryHeap;

use crate::stage;

/// Box of a node as two registers; the fourth lanes are integers and take no part.
#[inline(always)]
fn corners(node: &Bvh2Node) -> [Vec4; 2] {
    bytemuck::cast(*node)
}

#[inline(always)]
fn area([min, max]: [Vec4; 2]) -> f32 {
    let d = max - min;
    d.x * d.y + d.y * d.z + d.z * d.x
}

#[inline(always)]
fn union(a: [Vec4; 2], b: [Vec4; 2]) -> [Vec4; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Siblings lie side by side, the left one at an odd number.
#[inline(always)]
fn sibling(node: u32) -> u32 {
    ((node + 1) ^ 1) - 1
}

/// A subtree that would be cheaper as the sibling of another.
#[derive(Clone, Copy)]
struct Move {
    from: u32,
    to: u32,
    /// Reduction of the summed surface area.
    gain: f32,
}

/// Maximum number of nodes that one search visits. Where thousands of boxes overlap, pruning fails
/// and it would visit all of them.
const MAX_VISITS: u32 = 1 << 12;

/// Minimum number of nodes that a round considers: a share of a small tree would be too few to find
/// anything.
const MIN_BATCH: usize = 512;

/// When reinsertion stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReinsertionOptions {
    /// Share of the nodes that a round considers, largest first, in [0, 1].
    pub share: f32,
    /// Maximum number of rounds.
    pub rounds: u32,
    /// Stops once a round saves less than this share of the total surface area of all nodes.
    pub worthwhile: f64,
}

/// Optimises a tree. Afterwards children may have lower numbers than their parents.
pub fn optimise(nodes: &mut [Bvh2Node], options: ReinsertionOptions) {
    if nodes.len() < 7 || options.rounds == 0 {
        return;
    }
    let _stage = stage::begin("optimising the BVH");
    let total: f64 = nodes.par_iter().with_min_len(1 << 14).map(|n| area(corners(n)) as f64).sum();

    // the search climbs, so that it needs the parents
    let mut parents = vec![0u32; nodes.len()];
    for (k, n) in nodes.iter().enumerate() {
        if !n.is_leaf() {
            parents[n.first_index as usize] = k as u32;
            parents[n.first_index as usize + 1] = k as u32;
        }
    }
    let mut touched = vec![0u32; nodes.len()];
    let batch = ((nodes.len() as f64 * options.share as f64) as usize).max(MIN_BATCH).min(nodes.len() - 1);

    // in each round the largest nodes look for better places, and the best moves are made first
    for round in 0..options.rounds {
        let mut saved = 0.0;
        let candidates = largest(nodes, batch);
        let mut moves: Vec<Move> = candidates
            .par_chunks(64)
            .map_init(Vec::new, |stack, chunk| {
                chunk.iter().filter_map(|&c| find(nodes, &parents, c, stack)).collect::<Vec<_>>()
            })
            .flatten_iter()
            .collect();
        moves.par_sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));

        // moves of one round may not touch one another's nodes
        for m in moves {
            // a node that an earlier move of this round has changed is no longer what the search
            // saw
            let involved = [m.from, m.to, sibling(m.from), parents[m.from as usize], parents[m.to as usize]];
            if involved.iter().any(|&i| touched[i as usize] == round + 1) {
                continue;
            }
            for i in involved {
                touched[i as usize] = round + 1;
            }
            reinsert(nodes, &mut parents, m.from, m.to);
            saved += m.gain as f64;
        }
        // sums that overflowed are no reason to go on
        if saved <= options.worthwhile * total || !saved.is_finite() || !total.is_finite() {
            return;
        }
    }
}

/// The nodes of largest area except the root, found top-down, because no child is larger than its
/// parent.
fn largest(nodes: &[Bvh2Node], count: usize) -> Vec<u32> {
    // areas are not negative, so their bits are in order
    let key = |k: u32| (area(corners(&nodes[k as usize])).to_bits(), std::cmp::Reverse(k));
    let mut heap = BinaryHeap::from([key(1), key(2)]);
    let mut out = Vec::with_capacity(count);
    while out.len() < count
        && let Some((_, std::cmp::Reverse(k))) = heap.pop()
    {
        out.push(k);
        let n = &nodes[k as usize];
        if !n.is_leaf() {
            heap.extend([key(n.first_index), key(n.first_index + 1)]);
        }
    }
    out
}

/// The best new position for a subtree: from its sibling upwards, everything beside the path is
/// searched, and cut off where even a box that need not grow would gain too little.
fn find(nodes: &[Bvh2Node], parents: &[u32], from: u32, stack: &mut Vec<(f32, u32)>) -> Option<Move> {
    let own = corners(&nodes[from as usize]);
    let own_area = area(own);
    let parent = parents[from as usize];
    if parent == 0 {
        // taking it out would remove the root
        return None;
    }

    // the tree without the node: what its ancestors shrink by is won wherever it goes
    let mut best = Move { from, to: 0, gain: 0.0 };
    let mut gain = area(corners(&nodes[parent as usize]));
    let mut beside = sibling(from);
    let mut without = corners(&nodes[beside as usize]);
    let mut pivot = parent;
    let mut visits = 0;

    // from each ancestor down the other side, as long as an insertion there may gain more
    loop {
        stack.push((gain, beside));
        while let Some((gain, to)) = stack.pop() {
            visits += 1;
            if visits > MAX_VISITS {
                stack.clear();
                return Some(best).filter(|b| b.gain > 0.0 && b.to != parent);
            }
            if gain - own_area <= best.gain {
                continue;
            }
            let node = &nodes[to as usize];
            let there = corners(node);
            let left = gain - area(union(there, own));
            if left > best.gain && to != sibling(from) {
                best = Move { to, gain: left, ..best };
            }
            if !node.is_leaf() {
                let below = left + area(there);
                // no growth is the best that can happen below
                if below - own_area > best.gain {
                    stack.extend([(below, node.first_index), (below, node.first_index + 1)]);
                }
            }
        }

        // one level up: this ancestor shrinks, too
        if pivot != parent {
            without = union(without, corners(&nodes[beside as usize]));
            gain += area(corners(&nodes[pivot as usize])) - area(without);
        }
        if pivot == 0 {
            break;
        }
        beside = sibling(pivot);
        pivot = parents[pivot as usize];
    }
    Some(best).filter(|b| b.gain > 0.0 && b.to != parent)
}

/// Takes `from` out, its sibling takes the parent's place; then it becomes the sibling of `to`.
fn reinsert(nodes: &mut [Bvh2Node], parents: &mut [u32], from: u32, to: u32) {
    let (beside, parent) = (sibling(from), parents[from as usize]);
    let (sibling_node, there) = (nodes[beside as usize], nodes[to as usize]);
    nodes[to as usize] = Bvh2Node { prim_count: 0, first_index: from.min(beside), ..there };
    nodes[beside as usize] = there;
    nodes[parent as usize] = sibling_node;
    for (node, at) in [(there, beside), (sibling_node, parent)] {
        if !node.is_leaf() {
            parents[node.first_index as usize] = at;
            parents[node.first_index as usize + 1] = at;
        }
    }
    parents[beside as usize] = to;
    parents[from as usize] = to;
    refit(nodes, parents, to);
    refit(nodes, parents, parent);
}

/// Refits a node and its ancestors, as far as their boxes change.
fn refit(nodes: &mut [Bvh2Node], parents: &[u32], from: u32) {
    let mut at = from;
    loop {
        let node = &nodes[at as usize];
        if !node.is_leaf() {
            let [a, b] = [0, 1].map(|k| &nodes[node.first_index as usize + k]);
            let (min, max) = (a.min.min(b.min), a.max.max(b.max));
            // the first node has moved: an unchanged box of its own says nothing about its new
            // ancestors
            if at != from && (min, max) == (node.min, node.max) {
                return;
            }
            nodes[at as usize] = Bvh2Node { min, max, ..nodes[at as usize] };
        }
        if at == 0 {
            return;
        }
        at = parents[at as usize];
    }
}
