//! Structures that divide space instead of primitives, to compare in counts: a uniform grid (walked
//! as by Amanatides and Woo 1987), an octree and a kd-tree by the surface area (Falcone's
//! background chapter). A primitive is in every cell that its box overlaps.

use glam::DVec3;

use super::body::{Body, LabRay};
use super::traverse::{LabHit, Query, Visits};
use crate::accel::Aabb;

/// Cells of a grid for each primitive.
const CELLS_A_PRIMITIVE: f64 = 4.0;
/// Most cells along an axis of a grid.
const MAX_SIDE: f64 = 256.0;
/// Primitives at or below which a cell of a tree is not divided.
const LEAF: usize = 4;
/// Most planes above a cell of a tree. An octree's level is three of them.
const MAX_PLANES: u32 = 24;
/// Planes that are tried across each axis of a kd-tree.
const PLANES: usize = 16;

/// How space is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellKind {
    /// Cells of equal size.
    Grid,
    /// Cells are halved across x, y and z in turn.
    Octree,
    /// Cells are divided where that is expected to cost least.
    KdTree,
}

impl CellKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Grid, Self::Octree, Self::KdTree];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grid => "grid",
            Self::Octree => "octree",
            Self::KdTree => "kd-tree",
        }
    }
}

/// A divided space.
pub enum Cells<'b> {
    /// Cells of equal size.
    Grid(Grid<'b>),
    /// A tree of planes.
    Tree(PlaneTree<'b>),
}

/// A uniform grid.
pub struct Grid<'b> {
    body: &'b Body,
    bounds: Aabb,
    sides: [usize; 3],
    cells: Vec<Vec<u32>>,
}

/// A tree of planes across axes.
pub struct PlaneTree<'b> {
    body: &'b Body,
    bounds: Aabb,
    nodes: Vec<PlaneNode>,
}

enum PlaneNode {
    /// Axis, place, and the number of the lower side's node; the upper one's is the next.
    Plane(usize, f32, usize),
    Leaf(Vec<u32>),
}

impl<'b> Cells<'b> {
    /// Divides the space of a body.
    pub fn build(body: &'b Body, kind: CellKind) -> Self {
        let pad = body.pad as f32;
        let boxes: Vec<Aabb> = body.boxes().iter().map(|b| Aabb { min: b.min - pad, max: b.max + pad }).collect();
        let bounds = boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union);
        match kind {
            CellKind::Grid => Self::Grid(Grid::build(body, &boxes, bounds)),
            _ => Self::Tree(PlaneTree::build(body, &boxes, bounds, kind == CellKind::KdTree)),
        }
    }

    /// References to primitives in all cells.
    pub fn references(&self) -> usize {
        match self {
            Self::Grid(g) => g.cells.iter().map(Vec::len).sum(),
            Self::Tree(t) => t.nodes.iter().map(|n| if let PlaneNode::Leaf(all) = n { all.len() } else { 0 }).sum(),
        }
    }

    /// Finds the hit of a ray. Cells of a grid and planes of a tree count as nodes.
    pub fn trace(&self, ray: &LabRay, query: Query, visits: &mut Visits) -> Option<LabHit> {
        match self {
            Self::Grid(grid) => grid.trace(ray, query, visits),
            Self::Tree(tree) => tree.trace(ray, query, visits),
        }
    }
}

/// Tests the primitives of a cell.
fn test(body: &Body, all: &[u32], ray: &LabRay, found: &mut Option<LabHit>, visits: &mut Visits) {
    for &primitive in all {
        visits.primitives += 1;
        if let Some(t) = body.shapes[primitive as usize].meet(ray) {
            *found = Some(LabHit { t, instance: 0, primitive }.closer(*found));
        }
    }
}

/// Whether a hit ends the way through cells of which the next begins at `entry`.
fn is_over(found: &Option<LabHit>, entry: f64, query: Query) -> bool {
    match query {
        Query::Any => found.is_some(),
        Query::Closest => found.is_some_and(|h| h.t < entry),
        Query::Exhaustive => false,
    }
}

/// Where a ray is within bounds.
fn span(ray: &LabRay, bounds: &Aabb) -> Option<[f64; 2]> {
    let (mut near, mut far) = (ray.tmin, ray.tmax);
    for a in 0..3 {
        let [low, high] = [bounds.min[a], bounds.max[a]].map(f64::from);
        if ray.direction[a] == 0.0 {
            if ray.origin[a] < low || ray.origin[a] > high {
                return None;
            }
            continue;
        }
        let t = [low, high].map(|p| (p - ray.origin[a]) / ray.direction[a]);
        (near, far) = (near.max(t[0].min(t[1])), far.min(t[0].max(t[1])));
    }
    (near <= far).then_some([near, far])
}

impl<'b> Grid<'b> {
    fn build(body: &'b Body, boxes: &[Aabb], bounds: Aabb) -> Self {
        // cells that are nearly cubes
        let size = (bounds.max - bounds.min).as_dvec3().max(DVec3::splat(1e-30));
        let edge = (size.element_product() / (CELLS_A_PRIMITIVE * boxes.len().max(1) as f64)).cbrt();
        let sides = [0, 1, 2].map(|a| (size[a] / edge.max(1e-30)).round().clamp(1.0, MAX_SIDE) as usize);
        let mut grid = Self { body, bounds, sides, cells: vec![Vec::new(); sides.iter().product()] };
        for (k, b) in boxes.iter().enumerate() {
            let [lo, hi] = [b.min, b.max].map(|p| [0, 1, 2].map(|a| grid.place(a, f64::from(p[a]))));
            for z in lo[2]..=hi[2] {
                for y in lo[1]..=hi[1] {
                    for x in lo[0]..=hi[0] {
                        let cell = grid.cell([x, y, z]);
                        grid.cells[cell].push(k as u32);
                    }
                }
            }
        }
        grid
    }

    fn place(&self, axis: usize, p: f64) -> usize {
        let (low, high) = (f64::from(self.bounds.min[axis]), f64::from(self.bounds.max[axis]));
        let at = (p - low) / (high - low) * self.sides[axis] as f64;
        (at as usize).min(self.sides[axis] - 1)
    }

    fn cell(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.sides[1] + y) * self.sides[0] + x
    }

    fn trace(&self, ray: &LabRay, query: Query, visits: &mut Visits) -> Option<LabHit> {
        let mut found = None;
        visits.boxes += 1;
        let [near, far] = span(ray, &self.bounds)?;

        // the first cell, and where the ray crosses into the next one along each axis
        let start = ray.at(near);
        let mut at = [0, 1, 2].map(|a| self.place(a, start[a]));
        let plane = |a: usize, k: usize| {
            let (low, high) = (f64::from(self.bounds.min[a]), f64::from(self.bounds.max[a]));
            let p = low + (high - low) * k as f64 / self.sides[a] as f64;
            (p - ray.origin[a]) / ray.direction[a]
        };
        let next = |a: usize, at: &[usize; 3]| match ray.direction[a] {
            d if d > 0.0 => plane(a, at[a] + 1),
            d if d < 0.0 => plane(a, at[a]),
            _ => f64::INFINITY,
        };
        let mut crossing = [0, 1, 2].map(|a| next(a, &at));
        loop {
            visits.nodes += 1;
            test(self.body, &self.cells[self.cell(at)], ray, &mut found, visits);
            let axis = (0..3).min_by(|&a, &b| crossing[a].total_cmp(&crossing[b])).unwrap_or(0);
            let is_last = if ray.direction[axis] > 0.0 { at[axis] + 1 == self.sides[axis] } else { at[axis] == 0 };
            if is_last || crossing[axis] > far || is_over(&found, crossing[axis], query) {
                return found;
            }
            at[axis] = if ray.direction[axis] > 0.0 { at[axis] + 1 } else { at[axis] - 1 };
            crossing[axis] = next(axis, &at);
        }
    }
}

impl<'b> PlaneTree<'b> {
    fn build(body: &'b Body, boxes: &[Aabb], bounds: Aabb, by_cost: bool) -> Self {
        let mut nodes = vec![PlaneNode::Leaf(Vec::new())];
        let mut work = vec![(0usize, bounds, (0..boxes.len() as u32).collect::<Vec<_>>(), 0u32)];
        while let Some((at, cell, all, depth)) = work.pop() {
            let plane = if all.len() <= LEAF || depth >= MAX_PLANES {
                None
            } else if by_cost {
                cheapest(&cell, &all, boxes)
            } else {
                let axis = depth as usize % 3;
                Some((axis, cell.min[axis] * 0.5 + cell.max[axis] * 0.5))
            };
            let Some((axis, place)) = plane else {
                nodes[at] = PlaneNode::Leaf(all);
                continue;
            };
            let first = nodes.len();
            nodes[at] = PlaneNode::Plane(axis, place, first);
            nodes.extend([PlaneNode::Leaf(Vec::new()), PlaneNode::Leaf(Vec::new())]);
            let (mut lower, mut upper) = (cell, cell);
            lower.max[axis] = place;
            upper.min[axis] = place;
            let below = all.iter().copied().filter(|&k| boxes[k as usize].min[axis] <= place).collect();
            let above = all.into_iter().filter(|&k| boxes[k as usize].max[axis] >= place).collect();
            work.push((first, lower, below, depth + 1));
            work.push((first + 1, upper, above, depth + 1));
        }
        Self { body, bounds, nodes }
    }

    fn trace(&self, ray: &LabRay, query: Query, visits: &mut Visits) -> Option<LabHit> {
        let mut found = None;
        visits.boxes += 1;
        let mut stack = vec![(0usize, span(ray, &self.bounds)?)];
        while let Some((at, [near, far])) = stack.pop() {
            if is_over(&found, near, query) {
                break;
            }
            match &self.nodes[at] {
                PlaneNode::Leaf(all) => test(self.body, all, ray, &mut found, visits),
                PlaneNode::Plane(axis, place, first) => {
                    visits.nodes += 1;
                    let (from, along) = (f64::from(*place) - ray.origin[*axis], ray.direction[*axis]);
                    let crossing = from / along;
                    // the side from which the ray comes is first; a ray in the plane sees both
                    let is_lower = from > 0.0 || (from == 0.0 && along >= 0.0);
                    let [this, other] = if is_lower { [*first, first + 1] } else { [first + 1, *first] };
                    if crossing.is_nan() {
                        stack.extend([(other, [near, far]), (this, [near, far])]);
                    } else if crossing > far || crossing < 0.0 {
                        stack.push((this, [near, far]));
                    } else if crossing < near {
                        stack.push((other, [near, far]));
                    } else {
                        stack.extend([(other, [crossing, far]), (this, [near, crossing])]);
                    }
                }
            }
        }
        found
    }
}

/// The plane of least expected cost; `None` where no plane is cheaper than testing all.
fn cheapest(cell: &Aabb, all: &[u32], boxes: &[Aabb]) -> Option<(usize, f32)> {
    // a visit costs as much as a test
    let whole = cell.half_area();
    let mut best = (whole * (all.len() as f32 - 1.0), None);
    for axis in 0..3 {
        let (low, size) = (cell.min[axis], cell.max[axis] - cell.min[axis]);
        let bin = |p: f32| (((p - low) / size * PLANES as f32) as usize).min(PLANES - 1);
        // how many begin and end in each bin
        let (mut begins, mut ends) = ([0u32; PLANES], [0u32; PLANES]);
        for &k in all {
            let b = &boxes[k as usize];
            begins[bin(b.min[axis].max(low))] += 1;
            ends[bin(b.max[axis].max(low))] += 1;
        }
        let (mut below, mut above) = (0, all.len() as u32);
        for k in 1..PLANES {
            below += begins[k - 1];
            above -= ends[k - 1];
            let place = low + size * k as f32 / PLANES as f32;
            let (mut lower, mut upper) = (*cell, *cell);
            lower.max[axis] = place;
            upper.min[axis] = place;
            let cost = lower.half_area() * below as f32 + upper.half_area() * above as f32;
            if cost < best.0 && place > low && place < cell.max[axis] {
                best = (cost, Some((axis, place)));
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::super::Builder;
    use super::super::heuristic::HeuristicChoice;
    use super::super::projection::RayDistribution;
    use super::super::streams::random;
    use super::super::traverse::trace;
    use super::*;
    use glam::Vec3;

    #[test]
    fn cells_give_the_hits_of_a_tree() {
        let triangle = |i: usize| {
            let triple = |k: u32| Vec3::new(random(i, k) as f32, random(i, k + 1) as f32, random(i, k + 2) as f32);
            let at = triple(0) * Vec3::new(10.0, 3.0, 6.0);
            [3, 6, 9].map(|k| at + (triple(k) - 0.5) * if i.is_multiple_of(50) { 5.0 } else { 0.6 })
        };
        let body = Body::from_triangles((0..3000).map(triangle).collect());
        let tree = Builder::Heuristic(HeuristicChoice::Sah.heuristic(RayDistribution::Uniform)).tree(&body.boxes(), 2);
        let rays: Vec<LabRay> = (0..20_000usize)
            .map(|i| {
                let r = |k: u32| random(i, 40 + k);
                let origin = DVec3::new(r(0) * 14.0 - 2.0, r(1) * 7.0 - 2.0, r(2) * 10.0 - 2.0);
                let mut direction = DVec3::new(r(3) - 0.5, r(4) - 0.5, r(5) - 0.5);
                if i.is_multiple_of(7) {
                    direction[i % 3] = 0.0;
                }
                LabRay::new(origin, direction, 0.0, if i.is_multiple_of(5) { r(6) * 9.0 } else { f64::INFINITY })
            })
            .collect();
        for kind in CellKind::ALL {
            let cells = Cells::build(&body, kind);
            assert!(cells.references() >= 3000);
            let mut hits = 0;
            for ray in &rays {
                let expected = trace(&tree, &body, ray, Query::Closest, &mut Visits::default());
                let mut visits = Visits::default();
                assert_eq!(cells.trace(ray, Query::Closest, &mut visits), expected, "{kind:?} {ray:?}");
                let any = cells.trace(ray, Query::Any, &mut Visits::default());
                assert_eq!(any.is_some(), expected.is_some(), "{kind:?} {ray:?}");
                hits += usize::from(expected.is_some());
            }
            assert!(hits > 5000 && hits < 19_000, "{hits}");
        }
    }
}
