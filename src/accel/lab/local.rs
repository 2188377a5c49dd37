//! Local trees: one for each influence area over the primitives that touch it, built for the area's
//! rays, and a tree over everything for all other rays (Falcone 2024, chapter 5).
//!
//! A hit in a local tree is the closest only up to where the ray leaves the area: beyond, other
//! primitives may be closer. So hits count up to there, and the traversal of the whole goes on from
//! there; the hits are those of the whole tree, bit for bit.

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::body::{Body, LabRay};
use super::heuristic::Heuristic;
use super::influence::InfluenceArea;
use super::region::Region;
use super::traverse::{LabHit, Query, Visits, trace};
use super::{build, hull};
use crate::accel::Aabb;

/// Levels of an octree below its root: more were of no use in Falcone's measurements.
const OCTREE_LEVELS: u32 = 5;

/// How the areas that a ray starts in are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TopLevelKind {
    /// The boxes around all areas, one after the other.
    List,
    /// An octree over them.
    Octree,
}

/// Where the traversal of the whole begins for a ray that a local tree has no hit for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FallbackStart {
    /// Where the ray leaves the area.
    Exit,
    /// At the ray's start, as in Falcone's program.
    Start,
}

/// A whole tree, local trees, and a top level to choose among them.
pub struct LocalTrees<'b> {
    body: &'b Body,
    whole: &'b Bvh2,
    locals: Vec<LocalTree>,
    top: TopLevel,
    fallback: FallbackStart,
}

/// The tree of an area.
pub struct LocalTree {
    /// The area.
    pub area: InfluenceArea,
    /// The tree; leaves refer to primitives of the whole body.
    pub tree: Bvh2,
}

/// Counts of a ray's way, or of several rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LocalVisits {
    /// Areas and nodes of the octree that were looked at.
    pub top: u64,
    /// Visits of local trees.
    pub local: Visits,
    /// Visits of the whole tree.
    pub whole: Visits,
    /// Rays that were affine to an area.
    pub affine: u64,
    /// Rays of these whose hit the local tree found.
    pub local_hits: u64,
    /// Rays that hit something.
    pub hits: u64,
}

impl LocalVisits {
    /// The sum.
    pub fn plus(self, o: Self) -> Self {
        Self {
            top: self.top + o.top,
            local: self.local.plus(o.local),
            whole: self.whole.plus(o.whole),
            affine: self.affine + o.affine,
            local_hits: self.local_hits + o.local_hits,
            hits: self.hits + o.hits,
        }
    }
}

impl<'b> LocalTrees<'b> {
    /// Builds the trees: `whole` is over all primitives of the body, local ones by a heuristic
    /// whose rays are those of each area.
    pub fn build(
        body: &'b Body,
        whole: &'b Bvh2,
        areas: Vec<InfluenceArea>,
        heuristic: Heuristic,
        (top, fallback): (TopLevelKind, FallbackStart),
    ) -> Self {
        let boxes = body.boxes();
        let top = match top {
            TopLevelKind::List => TopLevel::List(areas.iter().map(|a| a.region.bounds()).collect()),
            TopLevelKind::Octree => TopLevel::Octree(Octree::build(&areas)),
        };
        let local = |area: InfluenceArea| LocalTree { tree: local_tree(body, &boxes, &area, &heuristic), area };
        Self { body, whole, locals: areas.into_iter().map(local).collect(), top, fallback }
    }

    /// The local trees.
    pub fn locals(&self) -> &[LocalTree] {
        &self.locals
    }

    /// Finds the hit of a ray.
    pub fn trace(&self, ray: &LabRay, query: Query, visits: &mut LocalVisits) -> Option<LabHit> {
        let hit = self.find(ray, query, visits);
        visits.hits += u64::from(hit.is_some());
        hit
    }

    fn find(&self, ray: &LabRay, query: Query, visits: &mut LocalVisits) -> Option<LabHit> {
        let local = self.top.find(ray.origin, &mut visits.top, |k| self.locals[k].area.is_affine(ray));
        let Some(local) = local.map(|k| &self.locals[k]) else {
            return trace(self.whole, self.body, ray, query, &mut visits.whole);
        };
        visits.affine += 1;
        let exit = local.area.region.exit(ray);
        let found = trace(&local.tree, self.body, ray, query, &mut visits.local);

        // within the area nothing is missing from its tree; a surface beyond still occludes
        if found.is_some_and(|h| h.t <= exit || query == Query::Any) {
            visits.local_hits += 1;
            return found;
        }
        if exit >= ray.tmax {
            return None;
        }

        // what lies beyond may be closer than a hit out there
        let start = match self.fallback {
            FallbackStart::Exit => exit.max(ray.tmin),
            FallbackStart::Start => ray.tmin,
        };
        let until = found.map_or(ray.tmax, |h| h.t.next_up().min(ray.tmax));
        trace(self.whole, self.body, &ray.between(start, until), query, &mut visits.whole)
    }

    /// Visits of many rays together.
    pub fn visits(&self, rays: &[LabRay], query: Query) -> LocalVisits {
        let each = |ray: &LabRay| {
            let mut visits = LocalVisits::default();
            self.trace(ray, query, &mut visits);
            visits
        };
        rays.par_iter().map(each).reduce(LocalVisits::default, LocalVisits::plus)
    }
}

/// The tree over the primitives of a body, each with a box, that touch an area; its leaves refer to
/// primitives of the body.
pub fn local_tree(body: &Body, boxes: &[Aabb], area: &InfluenceArea, heuristic: &Heuristic) -> Bvh2 {
    let around = area.region.bounds();
    let overlaps = |b: &Aabb| b.min.cmple(around.max).all() && b.max.cmpge(around.min).all();
    let touching: Vec<u32> = (0..boxes.len())
        .into_par_iter()
        .filter(|&k| overlaps(&boxes[k]) && area.region.touches(&body.shapes[k]))
        .map(|k| k as u32)
        .collect();
    if touching.is_empty() {
        return Bvh2::default();
    }
    let own: Vec<Aabb> = touching.iter().map(|&k| boxes[k as usize]).collect();
    let mut tree = build::tree(&own, &heuristic.for_rays(area.rays));
    tree.primitive_indices.iter_mut().for_each(|k| *k = touching[*k as usize]);
    tree
}

enum TopLevel {
    List(Vec<Aabb>),
    Octree(Octree),
}

impl TopLevel {
    /// The first area of those around a point for which `is_wanted` is true. `looked_at` counts.
    fn find(&self, at: DVec3, looked_at: &mut u64, is_wanted: impl Fn(usize) -> bool) -> Option<usize> {
        match self {
            Self::List(boxes) => (0..boxes.len()).find(|&k| {
                *looked_at += 1;
                is_around(&boxes[k], at) && is_wanted(k)
            }),
            Self::Octree(tree) => tree.areas_at(at, looked_at).iter().copied().map(|k| k as usize).find(|&k| {
                *looked_at += 1;
                is_wanted(k)
            }),
        }
    }
}

fn is_around(b: &Aabb, p: DVec3) -> bool {
    b.min.as_dvec3().cmple(p).all() && b.max.as_dvec3().cmpge(p).all()
}

/// An octree over the areas' boxes (his appendix A): a cell is divided as long as the border of an
/// area passes through it.
pub struct Octree {
    /// The root's cell.
    pub bounds: Aabb,
    /// All cells, the root first.
    pub cells: Vec<Cell>,
}

/// A cell of an octree.
pub enum Cell {
    /// Index of the first of eight cells, by upper halves along x, y, z in bits 0 to 2.
    Divided(usize),
    /// The areas that touch it.
    Leaf(Vec<u32>),
}

impl Octree {
    /// Builds the octree over some areas.
    pub fn build(areas: &[InfluenceArea]) -> Self {
        let bounds = areas.iter().map(|a| a.region.bounds()).fold(Aabb::EMPTY, Aabb::union);
        let mut cells = vec![Cell::Leaf(Vec::new())];
        let mut work = vec![(0usize, bounds, (0..areas.len() as u32).collect::<Vec<_>>(), 0u32)];
        while let Some((at, cell, above, level)) = work.pop() {
            let region = |k: u32| -> &Region { &areas[k as usize].region };
            let touching: Vec<u32> = above.into_iter().filter(|&k| region(k).touches_box(&cell)).collect();
            let is_cut = touching.iter().any(|&k| !region(k).contains_box(&cell));
            if !is_cut || level == OCTREE_LEVELS {
                cells[at] = Cell::Leaf(touching);
                continue;
            }
            let first = cells.len();
            cells[at] = Cell::Divided(first);
            for k in 0..8 {
                cells.push(Cell::Leaf(Vec::new()));
                work.push((first + k, octant(&cell, k), touching.clone(), level + 1));
            }
        }
        Self { bounds, cells }
    }

    /// The areas of the cell around a point, in their order.
    fn areas_at(&self, p: DVec3, looked_at: &mut u64) -> &[u32] {
        *looked_at += 1;
        if !is_around(&self.bounds, p) {
            return &[];
        }
        let (mut cell, mut at) = (self.bounds, 0);
        loop {
            match &self.cells[at] {
                Cell::Leaf(areas) => return areas,
                Cell::Divided(first) => {
                    *looked_at += 1;
                    let middle = middle(&cell);
                    let k = (0..3).fold(0, |k, a| k | usize::from(p[a] > f64::from(middle[a])) << a);
                    (cell, at) = (octant(&cell, k), first + k);
                }
            }
        }
    }
}

fn middle(b: &Aabb) -> glam::Vec3 {
    b.min * 0.5 + b.max * 0.5
}

/// An eighth of a box, by upper halves in bits.
fn octant(b: &Aabb, k: usize) -> Aabb {
    let (mut out, middle) = (*b, middle(b));
    for a in 0..3 {
        if k >> a & 1 == 0 {
            out.max[a] = middle[a];
        } else {
            out.min[a] = middle[a];
        }
    }
    debug_assert!((0..8).all(|c| is_around(b, hull::corner(&out, c))));
    out
}
