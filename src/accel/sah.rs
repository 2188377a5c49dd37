//! Binary trees from the top down: at each node the plane of least surface-area cost among equally
//! spaced ones on all three axes (Wald, "On fast Construction of SAH-based Bounding Volume
//! Hierarchies", RT 2007), few boxes by exhaustive sweep.
//!
//! Nodes are stored depth first with both children adjacent, so a subtree is one range: threads
//! build theirs without a lock, and what walks the tree later walks memory forwards. Leaves hold
//! one box each. No path is longer than [`MAX_DEPTH`]: where the cost would make one, the boxes are
//! halved instead.

use glam::{UVec4, Vec4};
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;

use super::Aabb;
use super::build::MAX_DEPTH;
use crate::stage;

/// A primitive's box during the build. The fourth lanes contain the primitive's index as a normal
/// float, so that SIMD arithmetic on them is fast (no denormals, no NaN).
#[derive(Clone, Copy)]
pub struct Item {
    min: Vec4,
    max: Vec4,
}

/// Turns a number below 2^27 into the bits of a float of ordinary size.
const NORMAL: u32 = 0x4000_0000;

impl Item {
    /// A box and its primitive's index (below 2^27).
    pub fn new(bounds: Aabb, primitive: u32) -> Self {
        let w = f32::from_bits(NORMAL | primitive);
        Self { min: bounds.min.extend(w), max: bounds.max.extend(w) }
    }

    pub(super) fn leaf(self) -> Bvh2Node {
        Bvh2Node { min: self.min.truncate(), max: self.max.truncate(), prim_count: 1, first_index: self.primitive() }
    }

    pub(super) fn primitive(self) -> u32 {
        self.min.w.to_bits() & !NORMAL
    }

    pub(super) fn bounds(self) -> Aabb {
        Aabb { min: self.min.truncate(), max: self.max.truncate() }
    }

    /// Twice the centre.
    #[inline(always)]
    fn centre(&self) -> Vec4 {
        self.min + self.max
    }
}

#[derive(Clone, Copy)]
pub(super) struct Bounds {
    pub min: Vec4,
    pub max: Vec4,
}

impl Bounds {
    pub(super) const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub(super) fn union(self, o: Self) -> Self {
        Self { min: self.min.min(o.min), max: self.max.max(o.max) }
    }

    #[inline(always)]
    pub(super) fn add(&mut self, item: &Item) {
        self.min = self.min.min(item.min);
        self.max = self.max.max(item.max);
    }

    #[inline(always)]
    pub(super) fn half_area(self) -> f32 {
        let d = self.max - self.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

const BINS: usize = 16;
/// Boxes that are swept exhaustively instead of binned.
pub(super) const SMALL: usize = 8;
/// Boxes that are worth handing to another thread.
pub(super) const PARALLEL: usize = 4096;
/// Boxes that several threads bin together.
const PARALLEL_BINS: usize = 1 << 17;

#[derive(Clone, Copy)]
struct Bins {
    bounds: [[Bounds; BINS]; 3],
    count: [[u32; BINS]; 3],
}

/// Which bin a centre falls into, on every axis.
#[derive(Clone, Copy)]
struct Grid {
    low: Vec4,
    scale: Vec4,
    last: Vec4,
}

impl Grid {
    fn new(centres: Bounds, bins: usize) -> Self {
        let extent = centres.max - centres.min;
        // an axis without extent, or too large a one, has one bin
        let scale = Vec4::select(extent.cmpgt(Vec4::ZERO), (bins as f32 * 0.999_99) / extent, Vec4::ZERO);
        let scale = Vec4::select(scale.cmplt(Vec4::splat(f32::MAX)), scale, Vec4::ZERO);
        Self { low: centres.min, scale, last: Vec4::splat(bins as f32 - 1.0) }
    }

    #[inline(always)]
    fn bin(&self, centre: Vec4) -> UVec4 {
        // rounds to the nearest: adding 2^23 leaves the integer in the low bits, where a cast would
        // check its range
        let x = ((centre - self.low) * self.scale - 0.5).max(Vec4::ZERO).min(self.last);
        UVec4::from_array((x + 8_388_608.0).to_array().map(f32::to_bits)) & (BINS as u32 - 1)
    }
}

impl Bins {
    const EMPTY: Self = Self { bounds: [[Bounds::EMPTY; BINS]; 3], count: [[0; BINS]; 3] };

    #[inline(always)]
    fn fill(&mut self, grid: &Grid, items: &[Item]) {
        for item in items {
            let bin = grid.bin(item.centre());
            for (axis, b) in [bin.x, bin.y, bin.z].into_iter().enumerate() {
                self.bounds[axis][b as usize % BINS].add(item);
                self.count[axis][b as usize % BINS] += 1;
            }
        }
    }

    fn union(mut self, o: Self) -> Self {
        for axis in 0..3 {
            for b in 0..BINS {
                self.bounds[axis][b] = self.bounds[axis][b].union(o.bounds[axis][b]);
                self.count[axis][b] += o.count[axis][b];
            }
        }
        self
    }

    /// Axis and first bin on the right of the cheapest plane.
    fn cheapest(&self, bins: usize) -> Option<(usize, u32)> {
        let mut best = (f32::INFINITY, 0, 0);
        for axis in 0..3 {
            let (bounds, count) = (&self.bounds[axis][..bins], &self.count[axis][..bins]);
            let mut right = [f32::INFINITY; BINS];
            let (mut sum, mut n) = (Bounds::EMPTY, 0);
            for b in (1..bins).rev() {
                sum = sum.union(bounds[b]);
                n += count[b];
                right[b] = if n == 0 { f32::INFINITY } else { sum.half_area() * n as f32 };
            }
            let (mut sum, mut n) = (Bounds::EMPTY, 0);
            for b in 1..bins {
                sum = sum.union(bounds[b - 1]);
                n += count[b - 1];
                if n == 0 {
                    continue;
                }
                let cost = sum.half_area() * n as f32 + right[b];
                if cost < best.0 {
                    best = (cost, axis, b as u32);
                }
            }
        }
        (best.0 < f32::INFINITY).then_some((best.1, best.2))
    }
}

pub(super) fn bounds_of(items: &[Item]) -> (Bounds, Bounds) {
    let serial = |items: &[Item]| {
        let (mut bounds, mut centres) = (Bounds::EMPTY, Bounds::EMPTY);
        for i in items {
            bounds.add(i);
            let c = i.centre();
            centres.min = centres.min.min(c);
            centres.max = centres.max.max(c);
        }
        (bounds, centres)
    };
    if items.len() < PARALLEL_BINS {
        return serial(items);
    }
    let none = || (Bounds::EMPTY, Bounds::EMPTY);
    items.par_chunks(PARALLEL_BINS / 4).map(serial).reduce(none, |a, b| (a.0.union(b.0), a.1.union(b.1)))
}

/// Builds the tree over at least one box. The items are reordered.
pub fn tree(items: &mut [Item]) -> Vec<Bvh2Node> {
    let mut nodes = vec![Bvh2Node::default(); 2 * items.len() - 1];
    let (root, below) = nodes.split_first_mut().expect("there is a box");
    subtree(items, root, below, 1, 0);
    nodes
}

/// Fills a subtree: its root, and the nodes below, the first of which has the number `first`.
fn subtree(items: &mut [Item], root: &mut Bvh2Node, below: &mut [Bvh2Node], first: u32, depth: u32) {
    let n = items.len();
    if n == 1 {
        *root = items[0].leaf();
        return;
    }
    let (bounds, centres) = bounds_of(items);
    *root = Bvh2Node { min: bounds.min.truncate(), max: bounds.max.truncate(), prim_count: 0, first_index: first };
    let middle = if n == 2 {
        1
    } else if depth + 1 + (n as u32).next_power_of_two().ilog2() > MAX_DEPTH {
        halve(items, centres)
    } else if n <= SMALL {
        sweep(items)
    } else {
        binned(items, centres).unwrap_or_else(|| halve(items, centres))
    };
    let (left, right) = items.split_at_mut(middle);
    let sizes = [left.len(), right.len()];
    let (children, below) = below.split_at_mut(2);
    let (a, b) = children.split_at_mut(1);
    let (below_left, below_right) = below.split_at_mut(2 * left.len() - 2);
    let (first_left, first_right) = (first + 2, first + 2 + below_left.len() as u32);
    let mut go_left = || subtree(left, &mut a[0], below_left, first_left, depth + 1);
    let mut go_right = || subtree(right, &mut b[0], below_right, first_right, depth + 1);
    if n >= PARALLEL {
        let counted = |count: usize, go: &mut dyn FnMut()| {
            go();
            if count < PARALLEL {
                stage::advance(count as u64);
            }
        };
        rayon::join(|| counted(sizes[0], &mut go_left), || counted(sizes[1], &mut go_right));
    } else {
        go_left();
        go_right();
    }
}

/// Partitions the boxes at the cheapest plane and returns the number on its left. `None` if no
/// plane separates them.
pub(super) fn binned(items: &mut [Item], centres: Bounds) -> Option<usize> {
    let bins = if items.len() > 64 { BINS } else { BINS / 2 };
    let grid = Grid::new(centres, bins);
    let filled = |items: &[Item]| {
        let mut b = Bins::EMPTY;
        b.fill(&grid, items);
        b
    };
    let all = if items.len() < PARALLEL_BINS {
        filled(items)
    } else {
        items.par_chunks(PARALLEL_BINS / 4).map(filled).reduce(|| Bins::EMPTY, Bins::union)
    };
    let (axis, plane) = all.cheapest(bins)?;
    let middle = match axis {
        0 => partition(items, |i| grid.bin(i.centre()).x < plane),
        1 => partition(items, |i| grid.bin(i.centre()).y < plane),
        _ => partition(items, |i| grid.bin(i.centre()).z < plane),
    };
    Some(middle)
}

/// Moves the items for which `left` is true to the front and returns their number. Branchless
/// (Lomuto's scheme): the branch would be unpredictable.
#[inline(always)]
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for k in 0..items.len() {
        items.swap(k, middle);
        middle += left(&items[middle]) as usize;
    }
    middle
}

pub(super) fn halve(items: &mut [Item], centres: Bounds) -> usize {
    let axis = (centres.max - centres.min).truncate().max_position();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.centre()[axis].total_cmp(&b.centre()[axis]));
    middle
}

/// The best of all splits of a few boxes in the order of their centres along an axis.
pub(super) fn sweep(items: &mut [Item]) -> usize {
    let n = items.len();
    let mut best = (f32::INFINITY, 0, n / 2);
    let mut sorted = 0;
    for axis in 0..3 {
        insertion_sort(items, axis);
        sorted = axis;
        let mut right = [0.0; SMALL];
        let mut sum = Bounds::EMPTY;
        for k in (1..n).rev() {
            sum.add(&items[k]);
            right[k] = sum.half_area() * (n - k) as f32;
        }
        let mut sum = Bounds::EMPTY;
        for k in 1..n {
            sum.add(&items[k - 1]);
            let cost = sum.half_area() * k as f32 + right[k];
            if cost < best.0 {
                best = (cost, axis, k);
            }
        }
    }
    if best.1 != sorted {
        insertion_sort(items, best.1);
    }
    best.2
}

fn insertion_sort(items: &mut [Item], axis: usize) {
    for k in 1..items.len() {
        let item = items[k];
        let at = item.centre()[axis];
        let mut to = k;
        while to > 0 && items[to - 1].centre()[axis] > at {
            items[to] = items[to - 1];
            to -= 1;
        }
        items[to] = item;
    }
}
