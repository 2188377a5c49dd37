//! The builders that trees of a scene are made by: the presets that tracers use, and the rules of
//! the laboratory.

use glam::{DAffine3, DVec3, Vec3};
use obvhs::bvh2::Bvh2;

use super::body::Body;
use super::heuristic::Heuristic;
use super::projection::RayDistribution;
use super::traverse::Hierarchy;
use crate::accel::flatten::{FlatScene, TlasInstance};
use crate::accel::{Aabb, BuildPreset, build as presets};

/// Most primitives of a leaf in the binary kernel's trees: more cost memory accesses, fewer cost
/// nodes.
pub const MAX_LEAF: u32 = 4;

/// A way to build trees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Builder {
    /// As tracers build.
    Preset(BuildPreset),
    /// By the rules of the laboratory.
    Heuristic(Heuristic),
}

impl Builder {
    /// Builds the tree over some boxes, none empty or NaN; `max_leaf` bounds the primitives of a
    /// leaf. No box makes an empty tree.
    pub fn tree(&self, boxes: &[Aabb], max_leaf: u32) -> Bvh2 {
        if boxes.is_empty() {
            return Bvh2::default();
        }
        match self {
            Self::Preset(preset) => presets::tree(boxes, *preset, Some(max_leaf)),
            Self::Heuristic(h) => {
                let mut stop = h.stop;
                stop.at_most = stop.at_most.min(max_leaf);
                stop.by_cost = stop.by_cost.min(max_leaf);
                super::build::tree(boxes, &Heuristic { stop, ..*h })
            }
        }
    }

    /// The builder of a group with these instances: its rays are those of the scene in the group's
    /// space. Several instances see them from as many directions: then the surface area decides.
    pub fn for_group<'i>(&self, mut instances: impl Iterator<Item = &'i TlasInstance>) -> Self {
        match (self, instances.next(), instances.next()) {
            (Self::Heuristic(h), Some(only), None) => {
                Self::Heuristic(h.for_rays(h.rays.transformed(&only.to_world.inverse())))
            }
            (Self::Heuristic(h), ..) => Self::Heuristic(h.for_rays(RayDistribution::Uniform)),
            (preset, ..) => *preset,
        }
    }
}

impl Hierarchy {
    /// Builds the trees of a scene, as the binary kernel has them. Rays of a heuristic are relative
    /// to the origin of `flat`.
    pub fn build(flat: &FlatScene, builder: &Builder) -> Self {
        let (mut groups, mut bounds) = (Vec::new(), Vec::new());
        for (k, group) in flat.groups.iter().enumerate() {
            let body = Body::from_group(flat, group);
            let boxes = body.boxes();
            bounds.push(boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union));
            let own = builder.for_group(flat.instances.iter().filter(|i| i.group == k));
            groups.push((own.tree(&boxes, MAX_LEAF), body));
        }
        let instances = flat.instances.iter().map(|i| (i.group, i.to_world.inverse())).collect();
        let top = (!flat.is_single_level()).then(|| {
            let boxes: Vec<Aabb> = flat.instances.iter().map(|i| placed(&bounds[i.group], &i.to_world)).collect();
            let reach = boxes.iter().fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
            (builder.tree(&boxes, 1), f64::from(8.0 * f32::EPSILON * reach))
        });
        Self { groups, instances, top }
    }
}

/// The box around a transformed box, rounded outwards.
fn placed(b: &Aabb, by: &DAffine3) -> Aabb {
    let corners: [DVec3; 8] = std::array::from_fn(|k| by.transform_point3(super::hull::corner(b, k as u8)));
    let (lo, hi) = corners.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |r, &c| (r.0.min(c), r.1.max(c)));
    let out = |v: DVec3, f: fn(f32) -> f32| Vec3::from_array(v.to_array().map(|x| f(x as f32)));
    Aabb { min: out(lo, f32::next_down), max: out(hi, f32::next_up) }
}
