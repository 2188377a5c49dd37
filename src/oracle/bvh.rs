//! A plain binary BVH in double precision: binned surface area heuristic (Wald 2007).

use super::OracleRay;
use glam::DVec3;
use std::ops::ControlFlow;

const BINS: usize = 16;
const LEAF: usize = 4;
/// Below this depth nodes are halved by count: together with 2^32 primitives at most that bounds
/// the traversal stack.
const HEURISTIC_DEPTH: u32 = 64;
const STACK: usize = HEURISTIC_DEPTH as usize + 34;

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
        let finite = |b: &Box3| b.0.is_finite() && b.1.is_finite();
        let order: Vec<u32> = (0u32..).zip(boxes).filter(|(_, b)| finite(b)).map(|(i, _)| i).collect();
        let mut bvh = Self { nodes: Vec::with_capacity(order.len() / 2 + 1), order };
        let count = bvh.order.len();
        if count > 0 {
            bvh.split(boxes, 0, count, 0);
        }
        bvh
    }

    pub(super) fn bounds(&self) -> Option<Box3> {
        self.nodes.first().map(|n| (n.lo, n.hi))
    }

    fn split(&mut self, boxes: &[Box3], first: usize, end: usize, depth: u32) {
        let center = |i: u32| boxes[i as usize].0 * 0.5 + boxes[i as usize].1 * 0.5;
        let items = &mut self.order[first..end];
        let bounds = items.iter().fold(EMPTY, |b, &i| join(b, boxes[i as usize]));
        let node = self.nodes.len();
        self.nodes.push(Node { lo: bounds.0, hi: bounds.1, next: first as u32, count: items.len() as u32 });
        if items.len() <= LEAF {
            return;
        }
        let (lo, hi) = items.iter().fold(EMPTY, |b, &i| join(b, (center(i), center(i))));
        let axis = (0..3).max_by(|&a, &b| (hi - lo)[a].total_cmp(&(hi - lo)[b])).unwrap_or(0);
        let middle = if depth < HEURISTIC_DEPTH { binned_split(boxes, items, axis, lo[axis], hi[axis]) } else { None };
        let middle = middle.unwrap_or_else(|| {
            let half = items.len() / 2;
            items.select_nth_unstable_by(half, |&a, &b| center(a)[axis].total_cmp(&center(b)[axis]));
            half
        });
        self.split(boxes, first, first + middle, depth + 1);
        self.nodes[node].next = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(boxes, first + middle, end, depth + 1);
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
    let cost = |parts: &[(Box3, usize)]| {
        let (b, n) = parts.iter().fold((EMPTY, 0), |(b, n), p| (join(b, p.0), n + p.1));
        if n == 0 { f64::INFINITY } else { half_area(b) * n as f64 }
    };
    let best = (1..BINS).min_by(|&a, &b| {
        let total = |k: usize| cost(&bins[..k]) + cost(&bins[k..]);
        total(a).total_cmp(&total(b))
    })?;
    let mut middle = 0;
    for k in 0..items.len() {
        if bin(items[k]) < best {
            items.swap(k, middle);
            middle += 1;
        }
    }
    (middle > 0 && middle < items.len()).then_some(middle)
}
