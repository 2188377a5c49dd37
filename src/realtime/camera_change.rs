//! How the camera changes from frame to frame.

use glam::{DAffine3, DMat3, DVec3};

use crate::film::camera::CameraRecord;
use crate::tracer::transform::rows;

/// Returns true if a camera moved by an eighth of the view, or of the reach of occlusion rays.
pub fn is_jump(before: &CameraRecord, now: &CameraRecord, reach: f64) -> bool {
    const PART: f64 = 0.125;
    let change = |column: usize| {
        let squares =
            (0..3).map(|row| f64::from(now.camera_to_world[row][column] - before.camera_to_world[row][column]).powi(2));
        squares.sum::<f64>().sqrt()
    };
    // half angles are about their tangents
    let view = if now.orthographic { 1.0 } else { 2.0 * f64::from(now.view[1]).min(1.0) };
    let has_turned = (0..3).any(|axis| change(axis) > PART * view);
    let zoom = f64::from(now.view[1] / before.view[1]);
    has_turned || change(3) > PART * reach || now.orthographic != before.orthographic || !(0.5..2.0).contains(&zoom)
}

/// Returns the transform from world to camera.
pub fn inverse(camera: &CameraRecord) -> [[f32; 4]; 3] {
    rows(&to_world(camera).inverse())
}

/// Returns the transform from the space of one camera to that of another.
pub fn between(from: &CameraRecord, to: &CameraRecord) -> [[f32; 4]; 3] {
    rows(&(to_world(to).inverse() * to_world(from)))
}

fn to_world(camera: &CameraRecord) -> DAffine3 {
    let m = camera.camera_to_world.map(|row| row.map(f64::from));
    let column = |k: usize| DVec3::new(m[0][k], m[1][k], m[2][k]);
    DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}
