//! Texture coordinates from the shape alone: projections from the bounds of a mesh.
//!
//! Axes are those of the mesh: y up, z to the front, x to the right of who looks at the front. All
//! coordinates are glTF's, v down, and show an image the right way round from outside.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use super::options::Projection;
use super::split::{Split, split};
use crate::scene::TriangleMesh;

/// Gives the `wanted` sets of texture coordinates the projection of the mesh onto the shape, and
/// copies vertices where it has a seam. Returns which vertex each vertex was before.
pub(super) fn project(mesh: &mut TriangleMesh, projection: Projection, wanted: &[usize]) -> Vec<u32> {
    let used = || mesh.indices.iter().flatten().map(|&i| mesh.positions[i as usize]);
    let [lo, hi] = used().fold([Vec3::INFINITY, Vec3::NEG_INFINITY], |[lo, hi], p| [lo.min(p), hi.max(p)]);
    let (centre, extent) = (0.5 * lo + 0.5 * hi, (hi - lo).max(Vec3::splat(f32::MIN_POSITIVE)));

    // coordinates of the corners of each triangle
    let project_triangle = |t: &[u32; 3]| {
        let corners = t.map(|i| mesh.positions[i as usize] - centre);
        match projection {
            Projection::Box => box_texcoords(corners, extent.max_element()),
            Projection::Spherical => around(corners.map(|p| {
                let length = p.length();
                let v = if length > 0.0 { (p.y / length).clamp(-1.0, 1.0).acos() / PI } else { 0.5 };
                (turn(p), v)
            })),
            Projection::Cylindrical => around(corners.map(|p| (turn(p), 0.5 - p.y / extent.y))),
        }
    };
    let corners: Vec<[u32; 2]> =
        mesh.indices.iter().flat_map(project_triangle).map(|uv| uv.to_array().map(f32::to_bits)).collect();

    // a vertex for each of them
    let Split { source, keys } = split(mesh, |corner| corners[corner]);
    let texcoords: Vec<Vec2> =
        keys.into_iter().map(|key| key.map_or(Vec2::ZERO, |bits| Vec2::from_array(bits.map(f32::from_bits)))).collect();
    for &set in wanted {
        mesh.texcoord_set_mut(set).clone_from(&texcoords);
    }
    source
}

/// The share of a turn about the y axis, 0 to 1: 0.5 at the front, more to the right. `None` on the
/// axis.
fn turn(p: Vec3) -> Option<f32> {
    (p.x != 0.0 || p.z != 0.0).then(|| 0.5 + p.x.atan2(p.z) / TAU)
}

/// Coordinates of a triangle whose corners have a turn and a v. At the seam at the back a whole
/// turn is none where the rest of the triangle is there; where the triangle crosses the seam, turns
/// go on beyond 1, for textures repeat. A corner on the axis has the mean of the others.
fn around(corners: [(Option<f32>, f32); 3]) -> [Vec2; 3] {
    let turns = || corners.iter().filter_map(|c| c.0);
    let crosses = turns().fold(0.0, f32::max) - turns().fold(1.0, f32::min) > 0.5;
    let begins_at_seam = turns().all(|turn| turn < 0.5 || turn == 1.0);
    let unrolled = |turn: f32| match (crosses, begins_at_seam) {
        (true, true) if turn == 1.0 => 0.0,
        (true, false) if turn < 0.5 => turn + 1.0,
        _ => turn,
    };
    let count = turns().count().max(1) as f32;
    let mean = turns().map(unrolled).sum::<f32>() / count;
    corners.map(|(turn, v)| Vec2::new(turn.map_or(mean, unrolled), v))
}

/// Coordinates on the side of a cube that a triangle faces; `size` fills the image.
fn box_texcoords(corners: [Vec3; 3], size: f32) -> [Vec2; 3] {
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let normal = (b - a).cross(c - a);
    let axis = normal.abs().max_position();
    let side = if normal[axis] < 0.0 { -1.0 } else { 1.0 };
    corners.map(|p| {
        let (right, up) = match axis {
            0 => (-side * p.z, p.y),
            1 => (p.x, -side * p.z),
            _ => (side * p.x, p.y),
        };
        Vec2::new(0.5 + right / size, 0.5 - up / size)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_across_the_seam_go_on() {
        let [a, b, c] = around([(Some(0.9), 0.1), (Some(0.05), 0.2), (None, 0.0)]);
        assert_eq!((a, b), (Vec2::new(0.9, 0.1), Vec2::new(1.05, 0.2)));
        assert!((c.x - 0.975).abs() < 1e-6, "{c}");
        assert_eq!(around([(Some(1.0), 0.1), (Some(0.25), 0.2), (Some(1.0), 0.3)])[2], Vec2::new(0.0, 0.3));
        // no crossing: as they are
        assert_eq!(around([(Some(0.1), 0.0), (Some(0.4), 0.0), (Some(0.3), 1.0)])[1].x, 0.4);
        assert_eq!(turn(Vec3::Y), None);
        assert_eq!([Vec3::Z, Vec3::X].map(|p| turn(p).unwrap()), [0.5, 0.75]);
    }

    #[test]
    fn each_side_of_a_box_is_upright() {
        // right and up as seen from outside of a triangle that faces along a side
        for (normal, right, up) in [
            (Vec3::Z, Vec3::X, Vec3::Y),
            (Vec3::NEG_Z, Vec3::NEG_X, Vec3::Y),
            (Vec3::X, Vec3::NEG_Z, Vec3::Y),
            (Vec3::NEG_X, Vec3::Z, Vec3::Y),
            (Vec3::Y, Vec3::X, Vec3::NEG_Z),
            (Vec3::NEG_Y, Vec3::X, Vec3::Z),
        ] {
            let corners = [-right - up, right - up, right + up].map(|p| p + normal);
            let texcoords = box_texcoords(corners, 2.0);
            assert_eq!(texcoords, [Vec2::new(0.0, 1.0), Vec2::ONE, Vec2::new(1.0, 0.0)], "{normal}");
        }
    }
}
