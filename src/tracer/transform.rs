//! Affine maps as devices take them, and boxes that they map.

use glam::{DAffine3, DVec3, Vec3};

use crate::accel::Aabb;
use crate::accel::flatten::TlasInstance;

/// The three rows of an affine map in single precision, as shaders and Vulkan's instances take it.
pub fn rows(t: &DAffine3) -> [[f32; 4]; 3] {
    let (m, o) = (t.matrix3, t.translation);
    std::array::from_fn(|k| [m.x_axis[k] as f32, m.y_axis[k] as f32, m.z_axis[k] as f32, o[k] as f32])
}

/// Coordinate to which the origin of every ray is mapped that enters a hidden instance: no test
/// against a box or a primitive near the origin accepts a ray from there.
const NOWHERE: f64 = 1e30;

/// World to group space of a TLAS instance, three rows: rays miss a hidden one.
pub(super) fn world_to_group(instance: &TlasInstance) -> [[f32; 4]; 3] {
    if instance.hidden {
        rows(&DAffine3::from_translation(DVec3::splat(NOWHERE)))
    } else {
        rows(&instance.to_world.inverse())
    }
}

/// 16 half-ulps of the largest coordinate: two transforms of three products each, and the inverse's
/// own rounding.
pub(super) fn instance_padding(reach: f32) -> f32 {
    16.0 * f32::EPSILON * 0.5 * reach
}

/// Bounds of a transformed box, rounded but not padded.
pub(super) fn transformed_bounds(to_world: &DAffine3, b: Aabb) -> Aabb {
    (0..8u32).fold(Aabb::EMPTY, |out, k| {
        let pick = |axis: usize| if k >> axis & 1 == 0 { b.min[axis] } else { b.max[axis] };
        let corner = to_world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)).as_dvec3()).as_vec3();
        out.union(Aabb { min: corner, max: corner })
    })
}
