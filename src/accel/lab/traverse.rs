//! Traversal of binary trees on the host, with counts of what it visits: the order is that of the
//! binary kernel (`--traversal nearest`), the nearest child first.

use glam::DAffine3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;

use super::body::{Body, LabRay};
use crate::accel::build::MAX_DEPTH;

/// The end of a traversal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// The closest hit.
    Closest,
    /// Any hit.
    Any,
    /// The closest hit, found without leaving anything out: every box that the ray meets counts.
    /// Costs by area predict this number; Falcone measured it.
    Exhaustive,
}

/// Counts of a traversal, or of several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Visits {
    /// Inner nodes, of the top level too.
    pub nodes: u64,
    /// Boxes tested.
    pub boxes: u64,
    /// Primitives tested.
    pub primitives: u64,
    /// Instances entered.
    pub instances: u64,
}

impl Visits {
    /// The sum.
    pub fn plus(self, o: Self) -> Self {
        Self {
            nodes: self.nodes + o.nodes,
            boxes: self.boxes + o.boxes,
            primitives: self.primitives + o.primitives,
            instances: self.instances + o.instances,
        }
    }

    /// Cost in Falcone's measure: 2.0 an inner node, 1.2 a primitive.
    pub fn cost(&self) -> f64 {
        2.0 * self.nodes as f64 + 1.2 * self.primitives as f64
    }
}

/// A hit of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabHit {
    /// Ray parameter.
    pub t: f64,
    /// Index of the instance; 0 where there is no top level.
    pub instance: u32,
    /// Index of the primitive in its body.
    pub primitive: u32,
}

impl LabHit {
    /// The closer of two; of two at the same distance that of the lower number, so that the answer
    /// does not depend on the order.
    pub(super) fn closer(self, other: Option<Self>) -> Self {
        let key = |h: &Self| (h.t, h.instance, h.primitive);
        other.filter(|o| key(o) <= key(&self)).unwrap_or(self)
    }
}

/// Finds the hit of a ray with a body by a tree over its primitives, or over some of them.
pub fn trace(tree: &Bvh2, body: &Body, ray: &LabRay, query: Query, visits: &mut Visits) -> Option<LabHit> {
    trace_seen(tree, body, ray, query, visits, &|_| ())
}

/// As [`trace`], and calls `seen` with each node that is visited: inner nodes whose children are
/// tested, and leaves whose primitives are.
fn trace_seen(
    tree: &Bvh2,
    body: &Body,
    ray: &LabRay,
    query: Query,
    visits: &mut Visits,
    seen: &impl Fn(usize),
) -> Option<LabHit> {
    let mut found: Option<LabHit> = None;
    walk(tree, body.pad, ray, query, visits, seen, &mut |primitive, visits, until| {
        visits.primitives += 1;
        // at the same distance the lower number wins, so that equal distances have to be seen
        let ray = ray.between(ray.tmin, if found.is_some() { until.next_up() } else { ray.tmax });
        if let Some(t) = body.shapes[primitive as usize].meet(&ray) {
            found = Some(LabHit { t, instance: 0, primitive }.closer(found));
        }
        found.map(|h| h.t)
    });
    found
}

/// Leads a ray through a tree: calls `leaf` with each index of a leaf that it meets, the counts,
/// and the distance up to which hits count; it returns the distance of the closest hit so far.
/// Calls `seen` with each node that is visited.
fn walk(
    tree: &Bvh2,
    pad: f64,
    ray: &LabRay,
    query: Query,
    visits: &mut Visits,
    seen: &impl Fn(usize),
    leaf: &mut dyn FnMut(u32, &mut Visits, f64) -> Option<f64>,
) {
    let Some(root) = tree.nodes.first() else { return };
    let mut closest = ray.tmax;
    let enters = |n: &Bvh2Node, until: f64| ray.enters(n.min, n.max, pad, until);

    // nodes yet to be visited, and where the ray enters them
    let mut stack: Vec<(usize, f64)> = Vec::with_capacity(2 * MAX_DEPTH as usize);
    visits.boxes += 1;
    stack.extend(enters(root, closest).map(|t| (0, t)));
    while let Some((at, entry)) = stack.pop() {
        if entry > closest && query != Query::Exhaustive {
            continue;
        }
        seen(at);
        let node = &tree.nodes[at];
        let first = node.first_index as usize;
        if node.is_leaf() {
            for slot in first..first + node.prim_count as usize {
                if let Some(t) = leaf(tree.primitive_indices[slot], visits, closest) {
                    closest = closest.min(t);
                    if query == Query::Any {
                        return;
                    }
                }
            }
            continue;
        }
        visits.nodes += 1;
        visits.boxes += 2;
        let until = if query == Query::Exhaustive { ray.tmax } else { closest };
        let mut children = [first, first + 1].map(|k| enters(&tree.nodes[k], until).map(|t| (k, t)));
        if let [Some(a), Some(b)] = children
            && a.1 <= b.1
        {
            children.reverse();
        }
        stack.extend(children.into_iter().flatten());
    }
}

/// A hierarchy as the tracers have it: a tree for each group, and one over the instances where
/// there are several.
#[derive(Clone)]
pub struct Hierarchy {
    /// Tree and primitives of each group.
    pub groups: Vec<(Bvh2, Body)>,
    /// Group of each instance, and the transform from world to group space.
    pub instances: Vec<(usize, DAffine3)>,
    /// Tree over the instances' boxes in world space; `None` for a single instance without a
    /// transform.
    pub top: Option<(Bvh2, f64)>,
}

impl Hierarchy {
    /// Finds the hit of a ray.
    pub fn trace(&self, ray: &LabRay, query: Query, visits: &mut Visits) -> Option<LabHit> {
        self.trace_seen(ray, query, visits, &|_, _| ())
    }

    /// As [`Hierarchy::trace`], and calls `seen` with each node that is visited: its index in the
    /// tree of the instance's group, without an instance in [`Hierarchy::root_tree`].
    pub fn trace_seen(
        &self,
        ray: &LabRay,
        query: Query,
        visits: &mut Visits,
        seen: &impl Fn(Option<u32>, usize),
    ) -> Option<LabHit> {
        let Some((top, pad)) = &self.top else {
            let (tree, body) = self.groups.first()?;
            return trace_seen(tree, body, ray, query, visits, &|node| seen(None, node));
        };
        let mut found: Option<LabHit> = None;
        walk(top, *pad, ray, query, visits, &|node| seen(None, node), &mut |instance, visits, until| {
            visits.instances += 1;
            let (group, to_group) = &self.instances[instance as usize];
            let (tree, body) = &self.groups[*group];
            let is_first = found.is_none() || query == Query::Exhaustive;
            let until = if is_first { ray.tmax } else { until.next_up() };
            let local = ray.between(ray.tmin, until).transformed(to_group);
            let hit = trace_seen(tree, body, &local, query, visits, &|node| seen(Some(instance), node));
            if let Some(hit) = hit {
                found = Some(LabHit { instance, ..hit }.closer(found));
            }
            found.map(|h| h.t)
        });
        found
    }

    /// The tree that traversal begins with: the top level, or that of the only group.
    pub fn root_tree(&self) -> Option<&Bvh2> {
        self.top.as_ref().map(|(top, _)| top).or_else(|| self.groups.first().map(|(tree, _)| tree))
    }

    /// Visits of many rays together, and how many of them hit something.
    pub fn visits(&self, rays: &[LabRay], query: Query) -> (Visits, u64) {
        let each = |ray: &LabRay| {
            let mut visits = Visits::default();
            let hit = self.trace(ray, query, &mut visits);
            (visits, u64::from(hit.is_some()))
        };
        let none = || (Visits::default(), 0);
        rays.par_iter().map(each).reduce(none, |a, b| (a.0.plus(b.0), a.1 + b.1))
    }
}
