//! Camera paths from JSON:
//!
//! ```json
//! {
//!   "fps": 30,
//!   "interpolation": "smooth",
//!   "keys": [
//!     { "frame": 0, "eye": [0, 1.6, 4], "target": [0, 1, 0], "up": [0, 1, 0], "fov_y_degrees": 45 },
//!     { "frame": 60, "eye": [3, 1.6, 2], "target": [0, 1, 0] },
//!     { "frame": 61, "eye": [0, 4, 0], "target": [0, 1, 0], "up": [0, 0, -1], "cut": true }
//!   ]
//! }
//! ```
//!
//! Lengths are in scene units. `interpolation` is `smooth` or `linear`. `keys`, and of a key
//! `frame`, `eye` and `target`, are required; the defaults of the others are those of the first key
//! above. Frames increase and may be fractional. `cut` has the camera stand still at the key
//! before, and jump to this one at its frame.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;

use crate::error::{Error, Result};
use crate::files;
use crate::scene::camera_path::{CameraPath, Interpolation, Key};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathJson {
    #[serde(default = "default_fps")]
    fps: f64,
    #[serde(default)]
    interpolation: Interpolation,
    // read one by one, so that an error can say which it is
    keys: Vec<Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyJson {
    frame: f64,
    eye: [f64; 3],
    target: [f64; 3],
    #[serde(default = "default_up")]
    up: [f64; 3],
    #[serde(default = "default_fov")]
    fov_y_degrees: f64,
    #[serde(default)]
    cut: bool,
}

fn default_fps() -> f64 {
    30.0
}

fn default_up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

fn default_fov() -> f64 {
    45.0
}

/// Reads a camera path from JSON, in the format of the module's example.
///
/// # Errors
/// [`Error::Input`] for a file that is missing or broken, with the number of the key, counted from
/// 1, and what is wrong with it.
pub fn load_camera_path(path: &Path) -> Result<CameraPath> {
    let bytes = files::read(path)?;
    let file: PathJson =
        serde_json::from_slice(&bytes).map_err(|e| Error::input(path, format!("not a readable camera path: {e}")))?;
    let key = |(k, value): (usize, Value)| {
        let key: KeyJson =
            serde_json::from_value(value).map_err(|e| Error::input(path, format!("key {}: {e}", k + 1)))?;
        let (eye, target, up) = (DVec3::from(key.eye), DVec3::from(key.target), DVec3::from(key.up));
        Ok(Key { frame: key.frame, eye, target, up, fov_y: key.fov_y_degrees.to_radians(), cut: key.cut })
    };
    let keys = file.keys.into_iter().enumerate().map(key).collect::<Result<Vec<_>>>()?;
    CameraPath::new(keys, file.interpolation, file.fps).map_err(|e| Error::input(path, e))
}
