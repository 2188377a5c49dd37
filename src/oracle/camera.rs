//! Camera rays in double precision.

use super::OracleRay;
use crate::scene::{Camera, Projection};
use glam::{DVec2, DVec3};

/// The ray through `film`, a point of the image in pixels from its upper left corner (pixel centres
/// at halves), relative to `origin`, from the near clipping plane to the far one. Its direction has
/// unit length. The image's width over height decides the horizontal field of view.
pub fn camera_ray(camera: &Camera, origin: DVec3, size: [u32; 2], film: [f64; 2]) -> OracleRay {
    let size = DVec2::new(size[0].max(1) as f64, size[1].max(1) as f64);
    let ndc = DVec2::new(2.0 * film[0] / size.x - 1.0, 1.0 - 2.0 * film[1] / size.y);
    let plane = ndc * DVec2::new(size.x / size.y, 1.0);
    let to_world = camera.camera_to_world;
    let (from, direction) = match camera.projection {
        Projection::Perspective { fov_y } => (DVec3::ZERO, (plane * (fov_y * 0.5).tan()).extend(-1.0)),
        Projection::Orthographic { half_height } => ((plane * half_height).extend(0.0), DVec3::NEG_Z),
    };
    let [near, far] = camera.clip.of_ray(-direction.z / direction.length());
    let to = to_world.transform_vector3(direction).normalize_or(DVec3::NEG_Z);
    OracleRay { origin: to_world.transform_point3(from) - origin, direction: to, tmin: near, tmax: far }
}
