//! A plain binary BVH in double precision: by the binned surface area heuristic (Wald 2007), or in
//! the order of a Morton curve (Lauterbach et al. 2009), which is quickly built and slower to
//! trace.

use super::OracleRay;
use glam::DVec3;
use rayon::prelude::*;
use std::ops::ControlFlow;

const BINS: usize = 16;
const LEAF: usize = 4;
/// Below this depth nodes are halved by count: together with 2^32 primitives at most that bounds
/// the traversal stack.
const HEURISTIC_DEPTH: u32 = 64;
const STACK: usize = HEURISTIC_DEPTH as usize + 34;
/// The two halves of a node with at least so many primitives are built at the same time.
const PARALLEL: usize = 8192;

#[derive(Clone, Copy, Debug)]
struct Node {
    lo: DVec3,
    hi: DVec3,
    /// Leaf: first entry of `order`. Inner: index of the second child; the first follows its
    /// parent.
    next: u32,
    /// Primitives of a leaf; 0 for an inner node.
    count: u32,
}

/// The tree over boxes given to [`Bvh::build`].
#[derive(Clone, Debug, Default)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

type Box3 = (DVec3, DVec3);

const EMPTY: Box3 = (DVec3::INFINITY, DVec3::NEG_INFINITY);

fn join(a: Box3, b: Box3) -> Box3 {
    (a.0.min(b.0), a.1.max(b.1))
}

fn half_area((lo, hi): Box3) -> f64 {
    let d = (hi - lo).max(DVec3::ZERO);
    d.x * d.y + d.y * d.z + d.z * d.x
}

impl Bvh {
    /// Builds the tree. Boxes that are not finite are skipped, because no ray hits their
    /// primitives.
    pub(super) fn build(boxes: &[Box3]) -> Self {
        let mut order = finite(boxes);
        let mut nodes = Vec::with_capacity(order.len() / 2 + 1);
        if !order.is_empty() {
            split(&mut nodes, boxes, &mut order, 0, 0);
        }
        Self { nodes, order }
    }

    /// Builds a tree for few rays: in a fraction of the time of [`Bvh::build`], and rays take
    /// longer.
    pub(super) fn build_quickly(boxes: &[Box3]) -> Self {
        let center = |i: u32| boxes[i as usize].0 * 0.5 + boxes[i as usize].1 * 0.5;
        let order = finite(boxes);
        let (lo, hi) = order.iter().fold(EMPTY, |b, &i| join(b, (center(i), center(i))));
        let scale = (hi - lo).recip();
        let code = |i: u32| morton(((center(i) - lo) * scale).to_array());
        let mut sorted: Vec<(u64, u32)> = order.into_par_iter().map(|i| (code(i), i)).collect();
        sorted.par_sort_unstable();
        let order: Vec<u32> = sorted.into_iter().map(|(_, i)| i).collect();
        let mut nodes = Vec::with_capacity(order.len() / 2 + 1);
        if !order.is_empty() {
            halve(&mut nodes, boxes, &order, 0);
        }
        Self { nodes, order }
    }

    pub(super) fn bounds(&self) -> Option<Box3> {
        self.nodes.first().map(|n| (n.lo, n.hi))
    }

    /// Calls `visit` for every primitive whose box, widened by `pad`, the ray meets within
    /// `(tmin, limit)`; `visit` returns a parameter beyond which nothing matters any more.
    pub(super) fn visit(
        &self,
        ray: &OracleRay,
        pad: f64,
        limit: f64,
        mut visit: impl FnMut(u32) -> ControlFlow<(), f64>,
    ) {
        // the entry of a box, and whether the ray meets it before the limit
        let inverse = ray.direction.recip();
        // NaN (a zero direction component on the slab's plane) is ignored by min and max: the slab
        // does not limit the ray
        let enter = |n: &Node, limit: f64| -> Option<f64> {
            let (mut near, mut far) = (ray.tmin, limit);
            for k in 0..3 {
                let a = (n.lo[k] - pad - ray.origin[k]) * inverse[k];
                let b = (n.hi[k] + pad - ray.origin[k]) * inverse[k];
                near = near.max(a.min(b));
                far = far.min(a.max(b));
            }
            (near <= far).then_some(near)
        };

        // depth first from the root, nearer children first
        let mut limit = limit;
        let mut stack = [(0u32, 0.0f64); STACK];
        let mut depth = 0;
        if let Some(root) = self.nodes.first()
            && let Some(near) = enter(root, limit)
        {
            stack[0] = (0, near);
            depth = 1;
        }
        while depth > 0 {
            depth -= 1;
            let (index, near) = stack[depth];
            if near > limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for &primitive in &self.order[node.next as usize..(node.next + node.count) as usize] {
                    match visit(primitive) {
                        ControlFlow::Continue(t) => limit = limit.min(t),
                        ControlFlow::Break(()) => return,
                    }
                }
                continue;
            }

            // the far child is pushed below the near one
            let (first, second) = (index + 1, node.next);
            let a = enter(&self.nodes[first as usize], limit).map(|t| (first, t));
            let b = enter(&self.nodes[second as usize], limit).map(|t| (second, t));
            let (far, near) = match (a, b) {
                (Some(x), Some(y)) if x.1 <= y.1 => (Some(y), Some(x)),
                other => other,
            };
            for child in [far, near].into_iter().flatten() {
                stack[depth] = child;
                depth += 1;
            }
        }
    }
}

/// Indices of the boxes that are finite.
fn finite(boxes: &[Box3]) -> Vec<u32> {
    (0u32..).zip(boxes).filter(|(_, b)| b.0.is_finite() && b.1.is_finite()).map(|(i, _)| i).collect()
}

/// Interleaves 21 bits of three numbers from 0 to 1, the first on top; what is not finite is 0.
fn morton(at: [f64; 3]) -> u64 {
    let spread = |x: f64| {
        let mut v = (x * 2_097_151.0) as u64 & 0x1f_ffff;
        for (shift, mask) in [
            (32, 0x001f_0000_0000_ffff),
            (16, 0x001f_0000_ff00_00ff),
            (8, 0x100f_00f0_0f00_f00f),
            (4, 0x10c3_0c30_c30c_30c3),
            (2, 0x1249_2492_4924_9249),
        ] {
            v = (v | v << shift) & mask;
        }
        v
    };
    spread(at[0]) << 2 | spread(at[1]) << 1 | spread(at[2])
}

/// Appends the subtree that `second` makes behind what `first` appends, and returns where it
/// begins. With so many primitives both are made at the same time.
fn append_both(
    nodes: &mut Vec<Node>,
    count: usize,
    first: impl FnOnce(&mut Vec<Node>) + Send,
    second: impl FnOnce(&mut Vec<Node>) + Send,
) -> u32 {
    if count < PARALLEL {
        first(nodes);
        let at = nodes.len();
        second(nodes);
        return at as u32;
    }
    let mut apart = Vec::new();
    rayon::join(|| first(nodes), || second(&mut apart));
    let at = nodes.len() as u32;
    nodes.extend(apart.into_iter().map(|n| if n.count == 0 { Node { next: n.next + at, ..n } } else { n }));
    at
}

/// Appends the tree over `items` in their order, which begin at `first` of it: halves of halves.
fn halve(nodes: &mut Vec<Node>, boxes: &[Box3], items: &[u32], first: usize) {
    let (node, count) = (nodes.len(), items.len());
    if count <= LEAF {
        let (lo, hi) = items.iter().fold(EMPTY, |b, &i| join(b, boxes[i as usize]));
        nodes.push(Node { lo, hi, next: first as u32, count: count as u32 });
        return;
    }

    // the first child follows its parent, whose box is that of both
    nodes.push(Node { lo: EMPTY.0, hi: EMPTY.1, next: 0, count: 0 });
    let middle = count / 2;
    let (left, right) = items.split_at(middle);
    let below = |items, first| move |nodes: &mut Vec<Node>| halve(nodes, boxes, items, first);
    let at = append_both(nodes, count, below(left, first), below(right, first + middle));
    let [a, b] = [nodes[node + 1], nodes[at as usize]];
    nodes[node] = Node { lo: a.lo.min(b.lo), hi: a.hi.max(b.hi), next: at, count: 0 };
}

/// Appends the tree over `items`, which begin at `first` of the order.
fn split(nodes: &mut Vec<Node>, boxes: &[Box3], items: &mut [u32], first: usize, depth: u32) {
    let center = |i: u32| boxes[i as usize].0 * 0.5 + boxes[i as usize].1 * 0.5;
    let (mut bounds, mut centers) = (EMPTY, EMPTY);
    for &i in items.iter() {
        bounds = join(bounds, boxes[i as usize]);
        centers = join(centers, (center(i), center(i)));
    }
    let (node, count) = (nodes.len(), items.len());
    nodes.push(Node { lo: bounds.0, hi: bounds.1, next: first as u32, count: count as u32 });
    if count <= LEAF {
        return;
    }

    // by the heuristic, or into halves
    let (lo, hi) = centers;
    let axis = (0..3).max_by(|&a, &b| (hi - lo)[a].total_cmp(&(hi - lo)[b])).unwrap_or(0);
    let middle = if depth < HEURISTIC_DEPTH { binned_split(boxes, items, axis, lo[axis], hi[axis]) } else { None };
    let middle = middle.unwrap_or_else(|| {
        items.select_nth_unstable_by(count / 2, |&a, &b| center(a)[axis].total_cmp(&center(b)[axis]));
        count / 2
    });

    // the first child follows its parent, the second one the tree below the first
    let (left, right) = items.split_at_mut(middle);
    let below = |items, first| move |nodes: &mut Vec<Node>| split(nodes, boxes, items, first, depth + 1);
    let at = append_both(nodes, count, below(left, first), below(right, first + middle));
    (nodes[node].next, nodes[node].count) = (at, 0);
}

/// Partitions `items` by the best of the planes between bins; `None` when all centres coincide.
fn binned_split(boxes: &[Box3], items: &mut [u32], axis: usize, lo: f64, hi: f64) -> Option<usize> {
    let scale = BINS as f64 / (hi - lo);
    if !scale.is_finite() {
        return None;
    }
    let bin = |i: u32| {
        let b = boxes[i as usize];
        ((((b.0[axis] * 0.5 + b.1[axis] * 0.5) - lo) * scale) as usize).min(BINS - 1)
    };
    let mut bins = [(EMPTY, 0usize); BINS];
    for &i in items.iter() {
        let (b, n) = &mut bins[bin(i)];
        (*b, *n) = (join(*b, boxes[i as usize]), *n + 1);
    }

    // costs of what is before and behind each plane, by a sweep from either side
    let add = |(b, n): (Box3, usize), bin: &(Box3, usize)| (join(b, bin.0), n + bin.1);
    let cost = |(b, n): (Box3, usize)| if n == 0 { f64::INFINITY } else { half_area(b) * n as f64 };
    let (mut before, mut behind, mut costs) = ((EMPTY, 0), (EMPTY, 0), [0.0; BINS]);
    for k in (1..BINS).rev() {
        behind = add(behind, &bins[k]);
        costs[k] = cost(behind);
    }
    for k in 1..BINS {
        before = add(before, &bins[k - 1]);
        costs[k] += cost(before);
    }
    let best = (1..BINS).min_by(|&a, &b| costs[a].total_cmp(&costs[b]))?;

    // what is before the best one comes first
    let mut middle = 0;
    for k in 0..items.len() {
        if bin(items[k]) < best {
            items.swap(k, middle);
            middle += 1;
        }
    }
    (middle > 0 && middle < items.len()).then_some(middle)
}
