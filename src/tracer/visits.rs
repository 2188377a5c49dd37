//! Counts the BVH nodes and leaves that rays visit, by repeating the fast kernel's traversal on the
//! host: an explanation of ray rates.

use glam::Vec3;
use rayon::prelude::*;

use super::device_builder::DeviceBuilder;
use super::kernel::BuildOptions;
use super::wide::Trees;
use crate::accel::flatten::FlatScene;
use crate::accel::pairs::NONE;
use crate::accel::wide::{self, Block};
use crate::interface::records::hierarchy::{SPHERE, TriangleLeaf};
use crate::ray::Ray;

/// The hierarchy of a scene, for counting.
pub struct VisitCounter {
    blocks: Vec<Block>,
}

/// Number of nodes and leaves that a ray visits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Visits {
    /// Nodes.
    pub nodes: f64,
    /// Leaves, of one or two triangles each.
    pub leaves: f64,
}

impl VisitCounter {
    /// Builds the BVH as the compute tracer does. `None` for unsupported scenes: those of two
    /// levels, with spheres or with alpha.
    pub fn new(flat: &FlatScene) -> Option<Self> {
        Self::with_builder(flat, None)
    }

    /// As [`VisitCounter::new`], for a BVH that a device builds.
    pub fn with_builder(flat: &FlatScene, device: Option<&DeviceBuilder>) -> Option<Self> {
        let countable = flat.is_single_level() && !flat.has_spheres() && !flat.has_alpha();
        countable
            .then(|| Trees::build(flat, &BuildOptions::default(), device))
            .and_then(Trees::into_only_group)
            .map(|w| Self { blocks: w.blocks })
    }

    /// Means over rays; with `any`, of traversals that stop at the first hit found.
    pub fn mean(&self, rays: &[Ray], any: bool) -> Visits {
        let sum = rays.par_iter().map(|r| self.walk(r, any)).reduce(|| [0u64; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
        let n = rays.len().max(1) as f64;
        Visits { nodes: sum[0] as f64 / n, leaves: sum[1] as f64 / n }
    }

    /// Visited nodes and leaves of a ray. The order of children is that of shaders/trace/wide.glsl:
    /// for the nearest hit, first the child that the ray enters first and then the others by
    /// octant; for any hit, all by octant.
    fn walk(&self, ray: &Ray, any: bool) -> [u64; 2] {
        let mut visits = [0u64; 2];
        if ray.tmax <= ray.tmin {
            return visits;
        }
        let (origin, direction) = (Vec3::from(ray.origin), Vec3::from(ray.direction));

        // children are visited in the order of the ray's octant
        let inverse = direction.to_array().map(|d| 1.0 / if d == 0.0 { 1e-30 } else { d });
        let octant = (0..3).fold(7u32, |o, a| if inverse[a] < 0.0 { o & !(4 >> a) } else { o });
        let mut best = ray.tmax;

        // siblings yet to be visited: node, and slots
        let mut stack: Vec<(usize, u32)> = Vec::new();
        let mut next = Some(0usize);
        while let Some(at) = next.take() {
            let block = &self.blocks[at];
            let mut nearest = None;

            // leaves end the ray, or shorten it
            if wide::is_leaf(block) {
                visits[1] += 1;
                if let Some(t) = meet(block, origin, direction, ray.tmin, best) {
                    best = t;
                    if any {
                        break;
                    }
                }
            } else {
                visits[0] += 1;

                // nodes push the children that the ray meets
                let mut hits = 0;
                let mut least = f32::INFINITY;
                for (slot, _) in wide::children(block) {
                    let planes = wide::child_box(block, slot);
                    let (mut near, mut far) = (ray.tmin, best);
                    for a in 0..3 {
                        let t = planes[a].map(|p| (p as f32 - origin[a]) * inverse[a]);
                        near = near.max(t[0].min(t[1]));
                        far = far.min(t[0].max(t[1]));
                    }
                    if near <= far {
                        hits |= 1 << slot;
                        if near < least {
                            (least, nearest) = (near, Some(slot as u32));
                        }
                    }
                }
                if hits != 0 {
                    stack.push((at, hits));
                } else {
                    nearest = None;
                }
            }

            // the nearest child comes next, or the first along the ray
            if let Some((node, slots)) = stack.last_mut() {
                let along =
                    (0..8u32).rev().map(|rank| rank ^ octant).find(|&slot| *slots >> slot & 1 == 1).unwrap_or(0);
                let slot = nearest.filter(|_| !any).unwrap_or(along);
                *slots &= !(1 << slot);
                next = wide::children(&self.blocks[*node]).find(|c| c.0 as u32 == slot).map(|c| c.1 as usize);
                if *slots == 0 {
                    stack.pop();
                }
            }
        }
        visits
    }
}

/// Distance of the nearest hit in a leaf's triangles, if within (tmin, tmax).
fn meet(block: &Block, origin: Vec3, direction: Vec3, tmin: f32, tmax: f32) -> Option<f32> {
    let leaf: &TriangleLeaf = bytemuck::cast_ref(block);
    debug_assert!(wide::is_leaf(block) && (leaf.primitives[0] == NONE || leaf.primitives[0] & SPHERE == 0));
    let corners = leaf.corners.map(Vec3::from_array);
    let mut best = tmax;
    for [b, c] in [[1, 2], [2, 3]] {
        // Moeller and Trumbore: not watertight, which does not matter for a mean
        let (e1, e2) = (corners[b] - corners[0], corners[c] - corners[0]);
        let p = direction.cross(e2);
        let inverse = 1.0 / e1.dot(p);
        let s = origin - corners[0];
        let q = s.cross(e1);
        let (u, v, t) = (s.dot(p) * inverse, direction.dot(q) * inverse, e2.dot(q) * inverse);
        if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > tmin && t < best {
            best = t;
        }
    }
    (best < tmax).then_some(best)
}
