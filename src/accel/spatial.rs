//! Binary trees with spatial splits: Stich, Friedrich and Dietrich, "Spatial Splits in Bounding
//! Volume Hierarchies" (HPG 2009).
//!
//! Where the halves that the surface-area heuristic would make overlap, a node may be cut by a
//! plane instead, and what straddles the plane goes to both sides, each with the box of its part.
//! Leaves contain one reference each; a primitive may be in several leaves, which together cover
//! it.

use glam::Vec3;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;

use super::Aabb;
use super::build::MAX_DEPTH;
use super::clip::{Triangles, clip};
use super::sah::{self, Bounds, Item};
use crate::stage;

const BINS: usize = 16;
/// A spatial split is looked for where the halves overlap in more than this share of the whole
/// tree's area (Stich's alpha).
const OVERLAP: f32 = 1e-5;
/// Boxes of a node below which cutting no longer pays for its time.
const SMALLEST: usize = 24;

struct Builder<'a, T> {
    triangles: &'a T,
    /// Half of the root's area.
    area: f32,
    pad: f32,
}

/// The nodes over primitives with these boxes (at least one), depth first as [`sah::tree`] lays
/// them; leaves name their primitive. At most `budget` times as many references are added as there
/// are primitives. Every box is widened by `pad`.
pub fn tree(boxes: &[Aabb], triangles: &impl Triangles, budget: f32, pad: f32) -> Vec<Bvh2Node> {
    let grow = |b: Aabb| Aabb { min: b.min - pad, max: b.max + pad };
    let items: Vec<Item> = boxes.par_iter().enumerate().map(|(i, &b)| Item::new(grow(b), i as u32)).collect();
    let area = sah::bounds_of(&items).0.half_area();
    let budget = (budget as f64 * boxes.len() as f64) as usize;
    Builder { triangles, area, pad }.parallel(items, budget, 0)
}

/// A node's references after a split.
struct Halves {
    left: Vec<Item>,
    right: Vec<Item>,
    /// Budgets of spare references that are left on either side.
    budgets: [usize; 2],
}

impl<T: Triangles> Builder<'_, T> {
    /// Nodes of a subtree, its root first, numbered from 0.
    fn parallel(&self, items: Vec<Item>, budget: usize, depth: u32) -> Vec<Bvh2Node> {
        if items.len() < sah::PARALLEL {
            let (count, mut out) = (items.len(), vec![Bvh2Node::default()]);
            self.serial(items, budget, depth, 0, &mut out);
            stage::advance(count as u64);
            return out;
        }
        let bounds = sah::bounds_of(&items).0;
        let h = self.split(items, budget, depth);
        let (a, b) = rayon::join(
            || self.parallel(h.left, h.budgets[0], depth + 1),
            || self.parallel(h.right, h.budgets[1], depth + 1),
        );
        let mut out = Vec::with_capacity(1 + a.len() + b.len());
        out.extend([inner(bounds, 1), moved(a[0], 2), moved(b[0], a.len() as u32 + 1)]);
        out.extend(a[1..].iter().map(|&n| moved(n, 2)));
        out.extend(b[1..].iter().map(|&n| moved(n, a.len() as u32 + 1)));
        out
    }

    fn serial(&self, items: Vec<Item>, budget: usize, depth: u32, at: usize, out: &mut Vec<Bvh2Node>) {
        if let [one] = items[..] {
            out[at] = one.leaf();
            return;
        }
        let first = out.len();
        out[at] = inner(sah::bounds_of(&items).0, first as u32);
        out.extend([Bvh2Node::default(); 2]);
        let h = self.split(items, budget, depth);
        self.serial(h.left, h.budgets[0], depth + 1, first, out);
        self.serial(h.right, h.budgets[1], depth + 1, first + 1, out);
    }

    fn split(&self, mut items: Vec<Item>, budget: usize, depth: u32) -> Halves {
        let n = items.len();
        let (bounds, centres) = sah::bounds_of(&items);
        // as in sah.rs: below this there is just room for a balanced tree
        let cramped = depth + 2 + (n as u32).next_power_of_two().ilog2() > MAX_DEPTH;
        let middle = if n == 2 {
            1
        } else if cramped {
            sah::halve(&mut items, centres)
        } else if n <= sah::SMALL {
            sah::sweep(&mut items)
        } else {
            sah::binned(&mut items, centres).unwrap_or_else(|| sah::halve(&mut items, centres))
        };
        if budget > 0 && n >= SMALLEST && !cramped {
            let (l, r) = (sah::bounds_of(&items[..middle]).0, sah::bounds_of(&items[middle..]).0);
            let overlap = Bounds { min: l.min.max(r.min), max: l.max.min(r.max) };
            let overlaps = (overlap.max - overlap.min).truncate().min_element() >= 0.0;
            if overlaps && overlap.half_area() > OVERLAP * self.area {
                let cost = l.half_area() * middle as f32 + r.half_area() * (n - middle) as f32;
                if let Some(plane) = self.plane(&items, bounds, budget, cost)
                    && let Some((left, right)) = self.cut(&items, plane, budget)
                {
                    let rest = budget - (left.len() + right.len() - n);
                    return shared(left, right, rest);
                }
            }
        }
        let right = items.split_off(middle);
        shared(items, right, budget)
    }

    /// The cheapest plane among equally spaced ones, if it costs less than `cost`: axis, position
    /// and both sides' boxes.
    fn plane(&self, items: &[Item], bounds: Bounds, budget: usize, cost: f32) -> Option<Plane> {
        let mut best: Option<(f32, Plane)> = None;
        for axis in 0..3 {
            let (low, extent) = (bounds.min[axis], bounds.max[axis] - bounds.min[axis]);
            let scale = BINS as f32 / extent;
            if !(extent > 0.0 && scale.is_finite()) {
                continue;
            }
            let place = |b: usize| low + extent * (b as f32 / BINS as f32);
            let bin = |x: f32| (((x - low) * scale) as usize).min(BINS - 1);

            // each bin's bounds of the parts of triangles in it, and how many begin and end there
            let mut bins = [Bounds::EMPTY; BINS];
            let (mut enter, mut leave) = ([0u32; BINS], [0u32; BINS]);
            for item in items {
                let b = item.bounds();
                let (from, to) = (bin(b.min[axis]), bin(b.max[axis]));
                enter[from] += 1;
                leave[to] += 1;
                if from == to {
                    bins[from].add(item);
                    continue;
                }
                let (low, high) = (b.min.extend(0.0), b.max.extend(0.0));
                self.triangles.each(item.primitive(), &mut |t| {
                    for (k, out) in bins.iter_mut().enumerate().take(to + 1).skip(from) {
                        let part = slab(&t, axis, place(k).max(b.min[axis]), place(k + 1).min(b.max[axis]));
                        let part = Bounds { min: part.min.max(low), max: part.max.min(high) };
                        if part.min.cmple(part.max).all() {
                            *out = out.union(part);
                        }
                    }
                });
            }

            // bounds of everything to the right of each plane
            let mut right = [Bounds::EMPTY; BINS];
            let mut sum = Bounds::EMPTY;
            for b in (1..BINS).rev() {
                sum = sum.union(bins[b]);
                right[b] = sum;
            }

            // planes from left to right: the cheapest within the budget
            let (mut left, mut n_left, mut n_right) = (Bounds::EMPTY, 0, items.len() as u32);
            for b in 1..BINS {
                left = left.union(bins[b - 1]);
                n_left += enter[b - 1];
                n_right -= leave[b - 1];
                let fits = (n_left + n_right) as usize <= items.len() + budget;
                if !fits || n_left == 0 || n_right == 0 || n_left.max(n_right) as usize == items.len() {
                    continue;
                }
                let c = left.half_area() * n_left as f32 + right[b].half_area() * n_right as f32;
                if c < best.as_ref().map_or(cost, |b| b.0) {
                    best = Some((c, Plane { axis, at: place(b), sides: [left, right[b]], counts: [n_left, n_right] }));
                }
            }
        }
        best.map(|b| b.1)
    }

    /// References on either side of a plane. None if that brings no progress, or more references
    /// than the budget has.
    fn cut(&self, items: &[Item], plane: Plane, budget: usize) -> Option<(Vec<Item>, Vec<Item>)> {
        let Plane { axis, at, mut sides, counts } = plane;
        let mut counts = counts.map(|c| c as f32);
        let (mut left, mut right) = (Vec::with_capacity(items.len()), Vec::with_capacity(items.len() / 2));
        let with = |side: Bounds, item: &Item| {
            let mut b = side;
            b.add(item);
            b
        };
        for item in items {
            // references on one side of the plane stay whole
            let b = item.bounds();
            if b.max[axis] <= at {
                left.push(*item);
                continue;
            }
            if b.min[axis] >= at {
                right.push(*item);
                continue;
            }

            // unsplitting: whole on one side may be cheaper than in halves on both
            let both = sides[0].half_area() * counts[0] + sides[1].half_area() * counts[1];
            let (l, r) = (with(sides[0], item), with(sides[1], item));
            let on_left = l.half_area() * counts[0] + sides[1].half_area() * (counts[1] - 1.0);
            let on_right = sides[0].half_area() * (counts[0] - 1.0) + r.half_area() * counts[1];
            if on_left <= both && on_left <= on_right {
                left.push(*item);
                (sides[0], counts[1]) = (l, counts[1] - 1.0);
                continue;
            }
            if on_right <= both {
                right.push(*item);
                (sides[1], counts[0]) = (r, counts[0] - 1.0);
                continue;
            }

            // the reference becomes two, each bounded by its part of the triangle
            let (mut low, mut high) = (b, b);
            low.max[axis] = at;
            high.min[axis] = at;
            let part = |cell: Aabb| clip(item.primitive(), cell, self.triangles).map(|p| self.padded(p, b));
            let parts = [part(low), part(high)];
            match parts {
                // nothing of it on either side can only be rounding: it stays whole
                [None, None] => left.push(*item),
                [l, r] => {
                    left.extend(l.map(|p| Item::new(p, item.primitive())));
                    right.extend(r.map(|p| Item::new(p, item.primitive())));
                }
            }
        }

        // a split that separates nothing would never end
        let n = items.len();
        let progress = left.len().max(right.len()) < n && !left.is_empty() && !right.is_empty();
        (progress && left.len() + right.len() <= n + budget).then_some((left, right))
    }

    /// A part of what lies in a widened box, widened too.
    fn padded(&self, part: Aabb, whole: Aabb) -> Aabb {
        Aabb { min: (part.min - self.pad).max(whole.min), max: (part.max + self.pad).min(whole.max) }
    }
}

/// Approximate bounding box of a triangle clipped to a slab between two planes across an axis, good
/// enough to compare costs. The corners of the clipped part lie on the triangle's edges.
#[inline(always)]
fn slab(t: &[Vec3; 3], axis: usize, low: f32, high: f32) -> Bounds {
    let mut out = Bounds::EMPTY;
    for k in 0..3 {
        let (p, q) = (t[k].extend(0.0), t[(k + 1) % 3].extend(0.0));
        let (x, y) = (p[axis], q[axis]);
        if x.min(y) > high || x.max(y) < low {
            continue;
        }
        let inverse = 1.0 / (y - x);
        // an edge parallel to the planes is included whole
        let at = |plane: f32| ((plane - x) * inverse).clamp(0.0, 1.0);
        let (u, v) = if x == y { (0.0, 1.0) } else { (at(low), at(high)) };
        let (a, b) = (p + (q - p) * u, p + (q - p) * v);
        out = Bounds { min: out.min.min(a).min(b), max: out.max.max(a).max(b) };
    }
    out
}

/// A candidate split plane: the boxes of both sides and their reference counts.
struct Plane {
    axis: usize,
    at: f32,
    sides: [Bounds; 2],
    counts: [u32; 2],
}

fn shared(left: Vec<Item>, right: Vec<Item>, budget: usize) -> Halves {
    let first = (budget as u128 * left.len() as u128 / (left.len() + right.len()) as u128) as usize;
    Halves { left, right, budgets: [first, budget - first] }
}

fn inner(b: Bounds, first_index: u32) -> Bvh2Node {
    Bvh2Node { min: b.min.truncate(), max: b.max.truncate(), prim_count: 0, first_index }
}

/// A node whose children were moved.
fn moved(node: Bvh2Node, by: u32) -> Bvh2Node {
    if node.is_leaf() { node } else { Bvh2Node { first_index: node.first_index + by, ..node } }
}
