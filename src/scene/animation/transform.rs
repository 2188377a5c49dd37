//! Transforms that are precise and invertible enough for tracers.

use glam::{DAffine3, DMat3, DVec3};

/// World position of the instance of a skinned mesh, given its first joint's world transform at
/// rest. It is near the joint, so that the mesh keeps its precision in f32 far from the origin; it
/// is zero for skeletons near the origin.
fn anchor(joint: &DAffine3) -> DVec3 {
    // so coarse that it is exact in f32
    const STEP: f64 = 1024.0;
    (joint.translation / STEP).round() * STEP
}

/// Object-to-world transform of the instance of a skinned mesh, given its first joint's world
/// transform at rest and inverse bind matrix. Where the skeleton is mirrored, as of left hands and
/// halves of characters, so is the instance: triangles keep the side that is their front.
pub(in crate::scene) fn skin_place(joint: &DAffine3, bind: &DAffine3) -> DAffine3 {
    let mirrors = (joint.matrix3 * bind.matrix3).determinant() < 0.0;
    let axes = if mirrors { DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0)) } else { DMat3::IDENTITY };
    DAffine3 { matrix3: axes, translation: anchor(joint) }
}

/// A joint's world transform as seen from an instance at a [`skin_place`], whose axes are their own
/// inverse.
pub(in crate::scene) fn from_skin_place(place: &DAffine3, joint: &DAffine3) -> DAffine3 {
    let near = DAffine3 { translation: joint.translation - place.translation, ..*joint };
    DAffine3::from_mat3(place.matrix3) * near
}

/// `t` with at least the scale `floor` (above zero) in every direction; unchanged where it has
/// that.
pub(super) fn at_least(t: &DAffine3, floor: f64) -> DAffine3 {
    let mut columns = [t.matrix3.x_axis, t.matrix3.y_axis, t.matrix3.z_axis];
    let longest = |columns: &[DVec3; 3], of: &[usize], along: &dyn Fn(DVec3) -> DVec3| {
        of.iter()
            .copied()
            .max_by(|&a, &b| along(columns[a]).length_squared().total_cmp(&along(columns[b]).length_squared()))
    };
    let a = longest(&columns, &[0, 1, 2], &|c| c).unwrap_or(0);
    let Some(first) = columns[a].try_normalize().filter(|_| columns[a].length() >= floor) else {
        return DAffine3 { matrix3: glam::DMat3::from_diagonal(DVec3::splat(floor)), ..*t };
    };
    let across = |c: DVec3| c - first * c.dot(first);
    let others: Vec<usize> = (0..3).filter(|&i| i != a).collect();
    let b = longest(&columns, &others, &across).unwrap_or(0);
    let mut side = across(columns[b]);
    if side.length() < floor {
        // what is left of parallel columns is rounding, which points anywhere
        let direction = side.try_normalize().map(across).filter(|d| d.length() > 0.1).and_then(DVec3::try_normalize);
        let direction = direction.unwrap_or_else(|| first.any_orthonormal_vector());
        columns[b] += direction * floor - side;
        side = direction * floor;
    }
    let c = 3 - a - b;
    // keep the handedness; a degenerate transform gets that of a rotation
    let even = (a + 1) % 3 == b;
    let normal = first.cross(side).normalize() * if even { 1.0 } else { -1.0 };
    let height = columns[c].dot(normal);
    if height.abs() < floor {
        columns[c] += normal * (floor.copysign(height) - height);
    }
    DAffine3 { matrix3: glam::DMat3::from_cols(columns[0], columns[1], columns[2]), ..*t }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn nothing_is_squashed_below_the_floor() {
        let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.0));
        let floor = 1e-6;
        let skew = DMat3::from_cols(DVec3::X, DVec3::new(1.0, 1e-9, 0.0), DVec3::new(2.0, 0.0, 0.0));
        for scale in
            [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 1.0], [3.0, 2.0, 0.0], [1e-9, -1e-9, 1e-12], [5.0, 1e-9, -2.0]]
        {
            for m in
                [DMat3::from_diagonal(DVec3::from_array(scale)), skew * DMat3::from_diagonal(DVec3::from_array(scale))]
            {
                let t = DAffine3::from_mat3_translation(turn * m, DVec3::new(1.0, 2.0, 3.0));
                let fixed = at_least(&t, floor);
                let inverse = fixed.matrix3.inverse();
                assert!(inverse.to_cols_array().iter().all(|x| x.abs() <= 3.0 / floor), "{scale:?} {fixed:?}");
                assert!((fixed.matrix3 - t.matrix3).to_cols_array().iter().all(|x| x.abs() < 2.5 * floor), "{scale:?}");
                assert_eq!(fixed.translation, t.translation);
                assert_eq!(at_least(&fixed, 0.9 * floor), fixed);
            }
        }
        for scale in [[1.0, 1.0, 1.0], [-1.0, 2.0, 0.01], [1e-5, 1e-5, -1e-5]] {
            let t = DAffine3::from_mat3(turn * DMat3::from_diagonal(DVec3::from_array(scale)));
            assert_eq!(at_least(&t, floor), t);
        }
    }

    #[test]
    fn anchors_are_zero_near_the_origin() {
        assert_eq!(anchor(&DAffine3::from_translation(DVec3::new(500.0, -500.0, 3.0))), DVec3::ZERO);
        assert_eq!(
            anchor(&DAffine3::from_translation(DVec3::new(1e6, 0.0, -1024.5))),
            DVec3::new(1000448.0, 0.0, -1024.0)
        );
    }
}
