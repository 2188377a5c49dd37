//! The AO radius at which a view shows neither black nor white.

use std::f64::consts::TAU;

use glam::DVec3;

use super::rays::{clip, view_rays};
use super::{Trace, significant};
use crate::error::Result;
use crate::scene::Camera;

/// Rays through the image, along its width and height, that find surfaces in view.
const VIEW: [usize; 2] = [24, 16];
/// Occlusion rays of each of the surfaces.
const RAYS: usize = 12;
/// Mean ambient visibility of the surfaces in view at the radius that is chosen.
pub const TARGET: f64 = 0.6;
/// Share of occlusion rays that get out below which unlimited ambient occlusion is all but black.
pub const CLOSED: f64 = 0.1;

/// Occlusion of the surfaces in view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Openness {
    /// Share of occlusion rays that hit nothing: the mean ambient visibility without a radius.
    pub open: f64,
    /// The largest radius, in scene units and with two significant digits, at which the mean
    /// ambient visibility is [`TARGET`] or more; infinite if it is without a radius.
    pub radius: f64,
}

impl Openness {
    /// The AO radius to use, scene units, if one is to be chosen (`is_auto`) or none is given.
    pub fn limit(&self, is_auto: bool) -> Option<f64> {
        (self.radius.is_finite() && (is_auto || self.open < CLOSED)).then_some(self.radius)
    }
}

/// Measures how open the surfaces are that a camera sees, if any. `size`: of the scene.
pub fn measure(camera: &Camera, aspect: f64, size: f64, trace: &Trace) -> Result<Option<Openness>> {
    let views = view_rays(camera, aspect, VIEW);
    let mut seen = trace(&views)?;
    clip(camera, &views, &mut seen);
    let surfaces = views.iter().zip(seen).filter_map(|(ray, seen)| Some((ray, seen?)));
    let mut rays = Vec::new();
    for (&(from, direction), surface) in surfaces {
        // beside the surface by more than single precision may be wrong
        let point = from + direction * surface.distance + surface.normal * (1e-4 * surface.distance + 1e-5 * size);
        for _ in 0..RAYS {
            rays.push((point, cosine_direction(surface.normal, rays.len())));
        }
    }
    if rays.is_empty() {
        return Ok(None);
    }
    let mut distances: Vec<f64> = trace(&rays)?.into_iter().map(|s| s.map_or(f64::INFINITY, |s| s.distance)).collect();
    distances.sort_by(f64::total_cmp);
    let hits = distances.partition_point(|d| d.is_finite());
    let open = 1.0 - hits as f64 / distances.len() as f64;
    // at a radius just below this distance, all beyond are open
    let radius = distances[((1.0 - TARGET) * distances.len() as f64) as usize];
    Ok(Some(Openness { open, radius: if radius.is_finite() { significant(radius, 2) } else { f64::INFINITY } }))
}

/// The `k`-th direction of a low-discrepancy sequence (Roberts' R2), distributed as the cosine.
fn cosine_direction(normal: DVec3, k: usize) -> DVec3 {
    let u = (0.5 + 0.754_877_666_246_692_7 * k as f64).fract();
    let v = (0.5 + 0.569_840_290_998_053_2 * k as f64).fract();
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * v).sin_cos();
    let radius = u.sqrt();
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * (1.0 - u).sqrt()).normalize_or(normal)
}

#[cfg(test)]
mod tests {
    use super::super::{Survey, VisibleSurface};
    use super::*;

    #[test]
    fn directions_follow_the_cosine() {
        let normal = DVec3::new(1.0, -2.0, 0.5).normalize();
        let cosines: Vec<f64> = (0..20_000).map(|k| cosine_direction(normal, k).dot(normal)).collect();
        assert!(cosines.iter().all(|c| *c >= 0.0));
        // the mean of the cosine under its own density is 2/3
        assert!((cosines.iter().sum::<f64>() / 20_000.0 - 2.0 / 3.0).abs() < 1e-3);
        assert_eq!([0.01234, 5.678, 1234.0, 0.999].map(|v| significant(v, 2)), [0.012, 5.7, 1200.0, 1.0]);
    }

    #[test]
    fn a_closed_room_needs_a_radius_and_a_plane_none() {
        let of = |name: &str| {
            let scene = crate::scene::builtin::by_name(name).unwrap();
            let survey = Survey::new(&scene);
            measure(&scene.cameras[0], 1.5, survey.diagonal(), &|rays| survey.trace(rays)).unwrap().unwrap()
        };
        assert_eq!(of("plane"), Openness { open: 1.0, radius: f64::INFINITY });
        let room = of("closed-box");
        assert!(room.open == 0.0 && room.radius > 0.0 && room.radius < 2.0, "{room:?}");
    }

    #[test]
    fn the_radius_leaves_as_much_open_as_it_should() {
        let scene = crate::scene::builtin::by_name("closed-box").unwrap();
        let survey = Survey::new(&scene);
        let camera = scene.cameras[0].clone();
        let trace = |rays: &[(DVec3, DVec3)]| survey.trace(rays);
        let radius = measure(&camera, 1.0, survey.diagonal(), &trace).unwrap().unwrap().radius;
        // hits beyond the radius are none
        let within = |rays: &[(DVec3, DVec3)]| -> Result<Vec<Option<VisibleSurface>>> {
            let from_camera = rays[0].0 == camera.camera_to_world.translation;
            Ok(trace(rays)?.into_iter().map(|s| s.filter(|s| from_camera || s.distance <= radius)).collect())
        };
        let open = measure(&camera, 1.0, survey.diagonal(), &within).unwrap().unwrap().open;
        assert!((open - TARGET).abs() < 0.06, "{open} at {radius}");
        // nothing in view
        assert_eq!(measure(&camera, 1.0, 1.0, &|rays| Ok(vec![None; rays.len()])).unwrap(), None);
    }
}
