//! Choice of the camera, and its parameters as shaders read them.

use glam::{DAffine3, DVec3};

use crate::error::{Error, Result};
use crate::scene::{Camera, Projection, Scene};

/// How the camera is chosen.
#[derive(Clone, Debug, Default)]
pub enum Choice {
    /// The scene's first camera, or one that frames the whole scene if it has none.
    #[default]
    Auto,
    /// The scene camera with this index or name.
    Named(String),
    /// An explicit camera. `up` need not be perpendicular to the view direction.
    LookAt {
        /// Position.
        eye: DVec3,
        /// Point at the center of the image.
        target: DVec3,
        /// Direction that points up in the image.
        up: DVec3,
        /// Full vertical field of view, radians.
        fov_y: f64,
    },
}

/// The scene's camera with this index or name.
pub fn named<'s>(scene: &'s Scene, wanted: &str) -> Option<&'s Camera> {
    let by_index = wanted.parse::<usize>().ok().and_then(|k| scene.cameras.get(k));
    by_index.or_else(|| scene.cameras.iter().find(|c| c.name == wanted))
}

/// Finds the camera for an image of `aspect` = width / height.
pub fn choose(scene: &Scene, choice: &Choice, aspect: f64) -> Result<Camera> {
    match choice {
        Choice::LookAt { eye, target, up, fov_y } => Ok(Camera::look_at(*eye, *target, *up, *fov_y)),
        Choice::Named(wanted) => named(scene, wanted).cloned().ok_or_else(|| {
            let names: Vec<_> = scene.cameras.iter().enumerate().map(|(k, c)| format!("{k} '{}'", c.name)).collect();
            let available = if names.is_empty() {
                "the scene has no cameras; use --eye and --target".to_owned()
            } else {
                format!("available: {}", names.join(", "))
            };
            Error::Usage(format!("--camera {wanted}: no such camera; {available}"))
        }),
        Choice::Auto => match (scene.cameras.first(), scene.bounds()) {
            (Some(camera), _) => Ok(camera.clone()),
            (None, Some((lo, hi))) => Ok(Camera::framing(lo, hi, aspect)),
            (None, None) => Err(Error::Scene("the scene has no geometry to render".into())),
        },
    }
}

/// Camera parameters in single precision, as shaders read them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRecord {
    /// Camera to world relative to the scene's origin, three rows.
    pub camera_to_world: [[f32; 4]; 3],
    /// Half width and height of the view: tangents of half angles, or scene units if orthographic.
    pub view: [f32; 2],
    /// Orthographic projection.
    pub orthographic: bool,
    /// Distances of the clipping planes along the view direction, scene units; 0, infinity: none.
    pub clip: [f32; 2],
}

impl CameraRecord {
    /// The record for an image of `aspect` = width / height, relative to `origin`.
    pub fn new(camera: &Camera, origin: DVec3, aspect: f64) -> Self {
        let t = camera.camera_to_world;
        let relative = DAffine3 { translation: t.translation - origin, ..t };
        let (half, orthographic) = match camera.projection {
            Projection::Perspective { fov_y } => ((fov_y * 0.5).tan(), false),
            Projection::Orthographic { half_height } => (half_height, true),
        };
        Self {
            camera_to_world: crate::tracer::transform::rows(&relative),
            view: [(half * aspect) as f32, half as f32],
            orthographic,
            clip: [camera.clip.near as f32, camera.clip.far as f32],
        }
    }
}
