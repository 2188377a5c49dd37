//! A camera as numbers, for metadata and reports: as settings have it, and as matrices of OpenEXR.

use glam::{DMat4, DVec3};
use serde_json::{Value, json};

use super::settings::CameraSettings;
use crate::output::exr::{WORLD_TO_CAMERA, WORLD_TO_NDC, matrix_text};
use crate::scene::camera::ViewHeight;
use crate::scene::{Camera, ClipPlanes, Projection};

/// Metadata key of [`pose`].
pub const POSE: &str = "camera_pose";

/// The camera as `--eye`, `--target`, `--up`, `--fov-y` and `--clip` give it: `eye`, `target` (a
/// point in the middle of the image), `up`, scene units; `fov_y` in degrees, or `half_height` of
/// the image if it is orthographic; and `clip`, if it has clipping planes.
pub fn pose(camera: &Camera) -> Value {
    let m = &camera.camera_to_world;
    // far enough for the direction to survive the sum
    let target = m.translation - m.matrix3.z_axis * m.translation.abs().max_element().max(1.0);
    let mut pose = json!({
        "eye": m.translation.to_array(),
        "target": target.to_array(),
        "up": m.matrix3.y_axis.to_array(),
    });
    match camera.projection {
        Projection::Perspective { fov_y } => pose["fov_y"] = json!(fov_y.to_degrees()),
        Projection::Orthographic { half_height } => pose["half_height"] = json!(half_height),
    }
    if camera.clip != ClipPlanes::NONE {
        pose["clip"] = json!(camera.clip);
    }
    pose
}

/// The settings of the camera of a [`pose`] in metadata; `None` if it is none.
pub fn settings(pose: &str) -> Option<CameraSettings> {
    let pose: Value = serde_json::from_str(pose).ok()?;
    let vector = |key: &str| serde_json::from_value(pose[key].clone()).ok().map(DVec3::from_array);
    let (fov_y, half_height) = (pose["fov_y"].as_f64(), pose["half_height"].as_f64());
    if fov_y.is_none() && half_height.is_none() {
        return None;
    }
    Some(CameraSettings {
        eye: Some(vector("eye")?),
        target: Some(vector("target")?),
        up: Some(vector("up")?),
        fov_y,
        orthographic: half_height.map(|half| ViewHeight::Units(2.0 * half)),
        clip: serde_json::from_value(pose["clip"].clone()).ok(),
        ..CameraSettings::default()
    })
}

/// The matrices from world space to camera space, and to normalized device coordinates of an image
/// of `aspect` = width / height. They multiply columns; z / w is 1 - 1 / distance along the view
/// direction in scene units if the camera is a perspective one, else this distance.
pub fn matrices(camera: &Camera, aspect: f64) -> [DMat4; 2] {
    let to_camera = DMat4::from(camera.camera_to_world.inverse());
    let columns = |half: f64, z: [f64; 2], w: [f64; 2]| {
        DMat4::from_cols_array(
            &[
                [1.0 / (half * aspect), 0.0, 0.0, 0.0],
                [0.0, 1.0 / half, 0.0, 0.0],
                [0.0, 0.0, z[0], w[0]],
                [0.0, 0.0, z[1], w[1]],
            ]
            .as_flattened()
            .try_into()
            .unwrap_or([0.0; 16]),
        )
    };
    let projection = match camera.projection {
        Projection::Perspective { fov_y } => columns((fov_y * 0.5).tan(), [-1.0, -1.0], [-1.0, 0.0]),
        Projection::Orthographic { half_height } => columns(half_height, [-1.0, 0.0], [0.0, 1.0]),
    };
    [to_camera, projection * to_camera]
}

/// Metadata of a camera: its pose as JSON, and its matrices.
pub fn metadata(camera: &Camera, aspect: f64) -> [(&'static str, String); 3] {
    // no -0; EXR files have matrices that multiply rows: their rows are these columns
    let [to_camera, to_ndc] = matrices(camera, aspect).map(|m| matrix_text(&m.to_cols_array().map(|v| v as f32 + 0.0)));
    [(POSE, pose(camera).to_string()), (WORLD_TO_CAMERA, to_camera), (WORLD_TO_NDC, to_ndc)]
}
