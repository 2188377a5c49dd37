//! The top-down builder of the laboratory: binned split planes by the rules of a [`Heuristic`].
//!
//! It shares the form of its trees with `accel::build`, so that `validate` there checks them and
//! `Bvh2` lays them out for the device. No path is longer than [`MAX_DEPTH`]: boxes are halved
//! where the rules would make one.

use glam::{DVec3, Vec3};
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use super::heuristic::{AxisRule, CostRule, Heuristic, facing_axes};
use super::projection::RayDistribution;
use crate::accel::Aabb;
use crate::accel::build::MAX_DEPTH;
use crate::stage;

/// Most primitives of a leaf: those that a reference of the binary kernel can count.
const MAX_LEAF: u32 = crate::accel::bvh2::MAX_LEAF;
/// Boxes that are worth handing to another thread.
const PARALLEL: usize = 4096;

/// A primitive's box during the build.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    primitive: u32,
}

impl Item {
    /// Twice the centre.
    fn centre(&self) -> Vec3 {
        self.bounds.min + self.bounds.max
    }
}

/// A subtree before its nodes have numbers.
enum Subtree {
    Leaf(Aabb, Vec<u32>),
    Inner(Aabb, Box<[Subtree; 2]>),
}

/// A plane between two bins.
#[derive(Clone, Copy)]
struct Plane {
    cost: f64,
    /// (p_left + p_right) / p_node.
    ratio: f64,
    axis: usize,
    /// First bin on the upper side.
    bin: usize,
}

/// Builds the tree over 1 to 2^27 boxes, none empty or NaN.
pub fn tree(boxes: &[Aabb], heuristic: &Heuristic) -> Bvh2 {
    let mut items: Vec<Item> =
        boxes.iter().zip(0u32..).map(|(&bounds, primitive)| Item { bounds, primitive }).collect();
    let root = subtree(&mut items, heuristic, 0);

    // parents before children, siblings side by side
    let mut out = Bvh2 { nodes: vec![Bvh2Node::default()], ..Default::default() };
    let mut work = vec![(root, 0usize)];
    while let Some((source, slot)) = work.pop() {
        out.nodes[slot] = match source {
            Subtree::Leaf(b, primitives) => {
                let first_index = out.primitive_indices.len() as u32;
                out.primitive_indices.extend(&primitives);
                Bvh2Node { min: b.min, max: b.max, prim_count: primitives.len() as u32, first_index }
            }
            Subtree::Inner(b, children) => {
                let first = out.nodes.len();
                out.nodes.extend([Bvh2Node::default(); 2]);
                let [left, right] = *children;
                work.push((right, first + 1));
                work.push((left, first));
                Bvh2Node { min: b.min, max: b.max, prim_count: 0, first_index: first as u32 }
            }
        };
    }
    out
}

fn subtree(items: &mut [Item], heuristic: &Heuristic, depth: u32) -> Subtree {
    let n = items.len() as u32;
    let bounds = items.iter().fold(Aabb::EMPTY, |b, i| b.union(i.bounds));
    let leaf = |items: &[Item]| Subtree::Leaf(bounds, items.iter().map(|i| i.primitive).collect());
    if n <= heuristic.stop.at_most.clamp(1, MAX_LEAF) {
        return leaf(items);
    }

    // the plane by the rules, unless the tree would become too deep
    let node = Node::new(items, bounds, heuristic);
    let is_deep = depth + 1 + n.next_power_of_two().ilog2() > MAX_DEPTH;
    let plane = if is_deep { None } else { node.choose(items) };
    if n <= heuristic.stop.by_cost.min(MAX_LEAF) && plane.is_none_or(|p| node.is_dearer(p, n)) {
        return leaf(items);
    }
    let middle = match plane {
        Some(p) => partition(items, |i| node.bin(p.axis, i) < p.bin),
        None => halve(items, node.centres),
    };
    let (left, right) = items.split_at_mut(middle);
    let children = if n as usize >= PARALLEL {
        let counted = |items: &mut [Item]| {
            let subtree = subtree(items, heuristic, depth + 1);
            if items.len() < PARALLEL {
                stage::advance(items.len() as u64);
            }
            subtree
        };
        let (a, b) = rayon::join(|| counted(left), || counted(right));
        [a, b]
    } else {
        [subtree(left, heuristic, depth + 1), subtree(right, heuristic, depth + 1)]
    };
    Subtree::Inner(bounds, Box::new(children))
}

/// A node whose plane is sought.
struct Node<'a> {
    heuristic: &'a Heuristic,
    bounds: Aabb,
    centres: Aabb,
    bins: usize,
    /// The rays that the costs are of, and the node's measure.
    rays: RayDistribution,
    measure: f64,
}

impl<'a> Node<'a> {
    fn new(items: &[Item], bounds: Aabb, heuristic: &'a Heuristic) -> Self {
        let centre = |b: Aabb, i: &Item| b.union(Aabb { min: i.centre(), max: i.centre() });
        let centres = items.iter().fold(Aabb::EMPTY, centre);
        let mut rays = heuristic.measured_rays();
        let mut measure = rays.measure(&bounds);
        if measure <= 0.0 {
            // no ray of the distribution comes here
            rays = RayDistribution::Uniform;
            measure = rays.measure(&bounds);
        }
        let bins = heuristic.bins.clamp(2, Heuristic::MAX_BINS);
        Self { heuristic, bounds, centres, bins, rays, measure }
    }

    /// The bin of a box along an axis.
    fn bin(&self, axis: usize, item: &Item) -> usize {
        let (low, extent) = (self.centres.min[axis], self.centres.max[axis] - self.centres.min[axis]);
        let at = (item.centre()[axis] - low) / extent * self.bins as f32;
        // NaN of an axis without extent is bin 0
        (at as usize).min(self.bins - 1)
    }

    /// The plane by the axis rule; `None` if no plane separates the boxes.
    fn choose(&self, items: &[Item]) -> Option<Plane> {
        let longest = (self.bounds.max - self.bounds.min).max_position();
        let any = |found: Option<Plane>| found.or_else(|| self.best_of(items, [0, 1, 2]));
        match self.heuristic.axes {
            AxisRule::All => self.best_of(items, [0, 1, 2]),
            AxisRule::Longest => any(self.best_of(items, [longest])),
            AxisRule::Facing(rule) => {
                let middle = ((self.bounds.min + self.bounds.max) * 0.5).as_dvec3();
                let direction = self.heuristic.rays.direction_at(middle).unwrap_or(DVec3::ONE);
                let mut best: Option<Plane> = None;
                for (axis, quality) in facing_axes(direction) {
                    if quality < rule.quality {
                        break;
                    }
                    let found = self.best_of(items, [axis]);
                    best = cheaper(best, found);
                    if best.is_some_and(|b| b.ratio <= rule.excellent) {
                        return best;
                    }
                }
                if rule.falls_back && best.is_none_or(|b| b.ratio >= rule.acceptable) {
                    let by_area = Heuristic { cost: CostRule::SurfaceArea, ..*self.heuristic };
                    let fallback = Node::new(items, self.bounds, &by_area).best_of(items, [longest]);
                    return any(fallback.or(best));
                }
                any(best)
            }
        }
    }

    /// The cheapest plane across some axes.
    fn best_of<const N: usize>(&self, items: &[Item], axes: [usize; N]) -> Option<Plane> {
        axes.into_iter().fold(None, |best, axis| cheaper(best, self.best_across(items, axis)))
    }

    fn best_across(&self, items: &[Item], axis: usize) -> Option<Plane> {
        // boxes into bins by their centres
        let mut bins = [(Aabb::EMPTY, 0u32); Heuristic::MAX_BINS];
        for item in items {
            let bin = &mut bins[self.bin(axis, item)];
            *bin = (bin.0.union(item.bounds), bin.1 + 1);
        }
        let bins = &bins[..self.bins];

        // measures of everything above each plane; a plane after an empty bin is that before it
        let mut above = [(0.0, 0u32); Heuristic::MAX_BINS];
        let (mut sum, mut count) = (Aabb::EMPTY, 0);
        for b in (1..bins.len()).rev() {
            if bins[b].1 > 0 {
                (sum, count) = (sum.union(bins[b].0), count + bins[b].1);
                above[b] = (self.rays.measure(&sum), count);
            } else {
                above[b] = above.get(b + 1).copied().unwrap_or_default();
            }
        }

        // planes from below
        let mut best: Option<Plane> = None;
        let (mut sum, mut count) = (Aabb::EMPTY, 0);
        for b in 1..bins.len() {
            if bins[b - 1].1 == 0 {
                continue;
            }
            (sum, count) = (sum.union(bins[b - 1].0), count + bins[b - 1].1);
            let (upper, upper_count) = above[b];
            if upper_count == 0 {
                break;
            }
            let lower = self.rays.measure(&sum);
            let cost = lower * f64::from(count) + upper * f64::from(upper_count);
            let ratio = if self.measure > 0.0 { (lower + upper) / self.measure } else { 1.0 };
            best = cheaper(best, Some(Plane { cost, ratio, axis, bin: b }));
        }
        best
    }

    /// Whether a split costs more than testing all primitives.
    fn is_dearer(&self, plane: Plane, n: u32) -> bool {
        let c = &self.heuristic.constants;
        2.0 * c.node * self.measure + c.primitive * plane.cost >= c.primitive * f64::from(n) * self.measure
    }
}

fn cheaper(a: Option<Plane>, b: Option<Plane>) -> Option<Plane> {
    match (a, b) {
        (Some(x), Some(y)) => Some(if y.cost < x.cost { y } else { x }),
        (x, y) => x.or(y),
    }
}

/// Moves the items for which `left` is true to the front, and returns their number.
fn partition(items: &mut [Item], left: impl Fn(&Item) -> bool) -> usize {
    let mut middle = 0;
    for k in 0..items.len() {
        if left(&items[k]) {
            items.swap(k, middle);
            middle += 1;
        }
    }
    middle
}

fn halve(items: &mut [Item], centres: Aabb) -> usize {
    let axis = (centres.max - centres.min).max_position();
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |a, b| a.centre()[axis].total_cmp(&b.centre()[axis]));
    middle
}

#[cfg(test)]
mod tests {
    use super::super::heuristic::{HeuristicChoice, StopRule};
    use super::super::projection::View;
    use super::super::streams::random;
    use super::*;
    use crate::accel::build::{cost, validate};
    use glam::DVec2;

    fn boxes(n: usize) -> Vec<Aabb> {
        let hash = |i: usize, k: u32| random(i, k) as f32;
        (0..n)
            .map(|i| {
                let lo = Vec3::new(hash(i, 1), hash(i, 2) * 3.0, hash(i, 3));
                Aabb { min: lo, max: lo + Vec3::new(hash(i, 4), hash(i, 5), hash(i, 6)) * 0.1 }
            })
            .collect()
    }

    fn distributions() -> [RayDistribution; 4] {
        let eye = DVec3::new(0.5, 1.5, 0.5);
        [
            RayDistribution::Parallel(DVec3::new(0.3, -1.0, 0.2)),
            RayDistribution::Point(eye),
            RayDistribution::Point(DVec3::new(-4.0, 6.0, 2.0)),
            RayDistribution::View(View::new(eye - DVec3::Z * 2.0, DVec3::Z, DVec2::splat(0.5))),
        ]
    }

    #[test]
    fn trees_of_all_rules_are_valid() {
        for n in [1, 2, 3, 7, 100, 6000] {
            let boxes = boxes(n);
            for choice in HeuristicChoice::ALL {
                for rays in distributions() {
                    for stop in [StopRule::default(), StopRule { at_most: 1, by_cost: 8 }] {
                        let tree = tree(&boxes, &Heuristic { stop, ..choice.heuristic(rays) });
                        validate(&tree, &boxes, None).unwrap_or_else(|e| panic!("{n} {choice:?} {rays:?}: {e}"));
                        let largest = tree.nodes.iter().map(|n| n.prim_count).max().unwrap();
                        assert!(largest <= stop.at_most.max(stop.by_cost), "{largest}");
                    }
                }
            }
        }
    }

    /// Equal boxes, which no plane separates, and flat ones, whose measures are 0.
    #[test]
    fn what_cannot_be_split_is_halved() {
        let equal = vec![Aabb { min: Vec3::ZERO, max: Vec3::ONE }; 5000];
        let points: Vec<Aabb> =
            (0..300).map(|i| Vec3::splat((i % 3) as f32)).map(|p| Aabb { min: p, max: p }).collect();
        for choice in HeuristicChoice::ALL {
            for boxes in [&equal, &points] {
                let tree = tree(boxes, &choice.heuristic(RayDistribution::Parallel(DVec3::Y)));
                validate(&tree, boxes, None).unwrap();
            }
        }
    }

    /// More axes make no dearer a tree here; and of boxes that hardly overlap along the rays the
    /// projected area makes the cheaper one for its own rays.
    #[test]
    fn each_cost_wins_by_its_own_measure() {
        let small = |b: Aabb| Aabb { max: b.min + (b.max - b.min) * 0.05, ..b };
        let boxes: Vec<Aabb> = boxes(4000).into_iter().map(small).collect();
        let rays = RayDistribution::Parallel(DVec3::X);
        let built = |choice: HeuristicChoice| tree(&boxes, &choice.heuristic(rays));
        let projected = |tree: &Bvh2| {
            let area = |n: &Bvh2Node| rays.measure(&Aabb { min: n.min, max: n.max }) * f64::from(n.prim_count.max(1));
            tree.nodes.iter().map(area).sum::<f64>()
        };
        assert!(cost(&built(HeuristicChoice::Sah)) < 1.01 * cost(&built(HeuristicChoice::SahLongest)));
        let by_surface = projected(&built(HeuristicChoice::Sah));
        for choice in [HeuristicChoice::PahSpfh, HeuristicChoice::Pah] {
            assert!(projected(&built(choice)) < 0.8 * by_surface, "{choice}");
        }
    }

    /// A chain of boxes that grow geometrically along the longest axis stays within the depth.
    #[test]
    fn chains_are_cut() {
        let boxes: Vec<Aabb> = (0..500)
            .map(|i| 1.17f32.powi(i))
            .filter(|x| x.is_finite() && *x < 1e18)
            .map(|x| Aabb { min: Vec3::splat(0.0), max: Vec3::new(x, 1.0, 1.0) })
            .collect();
        for choice in HeuristicChoice::ALL {
            validate(&tree(&boxes, &choice.heuristic(RayDistribution::Parallel(DVec3::Z))), &boxes, None).unwrap();
        }
    }
}
