//! Boxes that BVHs are built over, and how much they are padded.

use super::transform::{instance_padding, transformed_bounds};
use crate::accel::Aabb;
use crate::accel::flatten::{BlasGroup, FlatScene};

/// The distance by which boxes are padded: eight half-ulps of the largest coordinate. It covers the
/// rounding of quantization, and a ray within the plane of flat geometry is then strictly inside
/// the box, so that traversal needs no special case for it.
pub(super) fn padding<'a>(boxes: impl Iterator<Item = &'a Aabb>) -> f32 {
    let reach = boxes.fold(0.0f32, |m, b| m.max(b.min.abs().max(b.max.abs()).max_element()));
    reach_padding(reach)
}

/// [`padding`] of boxes whose largest coordinate is `reach`.
pub(super) fn reach_padding(reach: f32) -> f32 {
    (4.0 * f32::EPSILON * reach).max(1e-30)
}

/// World-space bounds of the scene, padded as the boxes of hierarchies are.
pub(super) fn scene_bounds(flat: &FlatScene) -> Aabb {
    let b = flat.bounds();
    if b == Aabb::EMPTY {
        return b;
    }
    let reach = b.min.abs().max(b.max.abs()).max_element().max(0.0);
    let moved = if flat.is_single_level() { 0.0 } else { instance_padding(reach) };
    let pad = reach_padding(reach) + moved;
    Aabb { min: b.min - pad, max: b.max + pad }
}

pub(super) fn primitive_boxes(flat: &FlatScene, group: &BlasGroup) -> impl Iterator<Item = Aabb> {
    group.submeshes.iter().flat_map(move |part| {
        let count = flat.scene.meshes[part.mesh].geometry.primitive_count();
        (part.first_primitive..part.first_primitive + count).map(move |p| flat.primitive_bounds(group, part, p))
    })
}

/// World-space bounds of the instances, from those of their groups, padded by the rounding error of
/// transforming a ray to group space.
pub(super) fn instance_boxes(flat: &FlatScene, bounds: &[Aabb]) -> Vec<Aabb> {
    let scene = flat.bounds();
    let pad = instance_padding(scene.min.abs().max(scene.max.abs()).max_element().max(0.0));
    flat.instances
        .iter()
        .map(|p| {
            let b = transformed_bounds(&p.to_world, bounds[p.group]);
            Aabb { min: b.min - pad, max: b.max + pad }
        })
        .collect()
}
