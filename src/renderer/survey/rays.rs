//! Rays through cameras, and what they see.

use glam::DVec3;

use super::VisibleSurface;
use crate::ray::Hit;
use crate::scene::{Camera, Geometry, Projection, Scene};

/// Distances of the clipping planes along a ray from the camera, of unit `direction`.
pub fn clipped(camera: &Camera, direction: DVec3) -> [f64; 2] {
    camera.clip.of_ray(-camera.camera_to_world.matrix3.z_axis.dot(direction))
}

/// Removes surfaces beyond the far clipping plane from those that camera rays hit.
pub fn clip(camera: &Camera, rays: &[(DVec3, DVec3)], seen: &mut [Option<VisibleSurface>]) {
    for ((_, direction), seen) in rays.iter().zip(seen.iter_mut()) {
        let [near, far] = clipped(camera, *direction);
        *seen = seen.filter(|surface| near + surface.distance < far);
    }
}

/// Rays through the middles of an image's pixels, rows from the top.
pub fn view_rays(camera: &Camera, aspect: f64, [columns, rows]: [usize; 2]) -> Vec<(DVec3, DVec3)> {
    let at = |k: usize| [((k % columns) as f64 + 0.5) / columns as f64, ((k / columns) as f64 + 0.5) / rows as f64];
    (0..columns * rows).map(|k| camera_ray(camera, at(k), aspect)).collect()
}

/// Origin, on the near clipping plane, and unit direction in world space of the ray through a point
/// of the image: `at` from (0, 0) at the top left to (1, 1). `aspect` is width over height.
pub fn camera_ray(camera: &Camera, at: [f64; 2], aspect: f64) -> (DVec3, DVec3) {
    let (origin, direction) = unclipped_ray(camera, at, aspect);
    (origin + direction * clipped(camera, direction)[0], direction)
}

fn unclipped_ray(camera: &Camera, at: [f64; 2], aspect: f64) -> (DVec3, DVec3) {
    let to_world = &camera.camera_to_world;
    let (x, y) = (2.0 * at[0] - 1.0, 1.0 - 2.0 * at[1]);
    let [right, up, back] = [to_world.matrix3.x_axis, to_world.matrix3.y_axis, to_world.matrix3.z_axis];
    match camera.projection {
        Projection::Perspective { fov_y } => {
            let half = (0.5 * fov_y).tan();
            let direction = right * (x * half * aspect) + up * (y * half) - back;
            (to_world.translation, direction.normalize_or(-back))
        }
        Projection::Orthographic { half_height } => {
            let origin = to_world.translation + right * (x * half_height * aspect) + up * (y * half_height);
            (origin, -back)
        }
    }
}

/// The surfaces of the hits of rays.
pub fn visible_surfaces(scene: &Scene, rays: &[(DVec3, DVec3)], hits: Vec<Option<Hit>>) -> Vec<Option<VisibleSurface>> {
    let of = |(hit, (from, direction)): (Option<Hit>, &(DVec3, DVec3))| {
        let hit = hit?;
        let instance = scene.instances.get(hit.instance as usize)?;
        // out of the front
        let outwards = match &scene.meshes[instance.mesh].geometry {
            Geometry::Triangles(t) => {
                let corners = t.indices.get(hit.primitive as usize)?.map(|i| t.positions[i as usize].as_dvec3());
                let [a, b, c] = corners.map(|p| instance.object_to_world.transform_point3(p));
                // a mirrored instance turns its triangles over
                (b - a).cross(c - a) * instance.object_to_world.matrix3.determinant().signum()
            }
            Geometry::Spheres(spheres) => {
                let sphere = spheres.get(hit.primitive as usize)?;
                let point = *from + *direction * f64::from(hit.t);
                let world_to_object = instance.object_to_world.inverse();
                let normal = world_to_object.transform_point3(point) - sphere.center.as_dvec3();
                world_to_object.matrix3.transpose() * normal
            }
        };
        // spheres have no back: what is inside sees them as a room
        let is_front =
            outwards.dot(*direction) < 0.0 || matches!(scene.meshes[instance.mesh].geometry, Geometry::Spheres(_));
        let normal = outwards.normalize_or(-*direction);
        let normal = if normal.dot(*direction) > 0.0 { -normal } else { normal };
        Some(VisibleSurface {
            distance: f64::from(hit.t),
            is_front,
            normal,
            material: scene.meshes[instance.mesh].material,
        })
    };
    hits.into_iter().zip(rays).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_pass_through_corners_and_centre() {
        let camera =
            Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 0.0), DVec3::Y, 90f64.to_radians());
        let (origin, direction) = camera_ray(&camera, [0.5, 0.5], 2.0);
        assert!(origin == DVec3::new(1.0, 2.0, 3.0) && (direction - DVec3::NEG_Z).length() < 1e-12);
        let (_, corner) = camera_ray(&camera, [0.0, 0.0], 2.0);
        assert!((corner / -corner.z - DVec3::new(-2.0, 1.0, -1.0)).length() < 1e-12, "{corner}");
        let orthographic = Camera { projection: Projection::Orthographic { half_height: 4.0 }, ..camera };
        let (origin, direction) = camera_ray(&orthographic, [1.0, 1.0], 2.0);
        assert!((origin - DVec3::new(9.0, -2.0, 3.0)).length() < 1e-12 && direction == DVec3::NEG_Z);
    }
}
