//! Rays to measure trees with, made on the host: those of an image (camera, shadow, ambient
//! occlusion and bounce rays), of a direction, and of a point.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::body::{LabRay, Shape};
use super::projection::frame;
use super::traverse::{Hierarchy, LabHit, Query, Visits};
use crate::sampling::sobol::hash_combine;
use crate::sampling::to_unit;
use crate::scene::{Camera, Light, LightKind, Projection, Scene};

/// Rays, and the query that is asked of them.
#[derive(Clone, Debug)]
pub struct RayStream {
    /// A name of a word or two.
    pub name: String,
    /// The query of a renderer.
    pub query: Query,
    /// The rays.
    pub rays: Vec<LabRay>,
}

/// A number in [0, 1): value `k` of ray `index`.
pub fn random(index: usize, k: u32) -> f64 {
    let low = hash_combine(hash_combine(0x1ab, index as u32), k);
    f64::from(to_unit(low)) + f64::from(to_unit(hash_combine(low, 1))) / 16_777_216.0
}

/// One jittered ray through each pixel of an image, row by row.
pub fn camera_rays(camera: &Camera, origin: DVec3, [width, height]: [u32; 2]) -> Vec<LabRay> {
    let (m, aspect) = (camera.camera_to_world, f64::from(width) / f64::from(height));
    (0..width as usize * height as usize)
        .map(|i| {
            let pixel = [i % width as usize, i / width as usize];
            let at = [0, 1].map(|a| pixel[a] as f64 + random(i, a as u32));
            let plane = [2.0 * at[0] / f64::from(width) - 1.0, 1.0 - 2.0 * at[1] / f64::from(height)];
            let plane = DVec3::new(plane[0] * aspect, plane[1], 0.0);
            let (from, direction) = match camera.projection {
                Projection::Perspective { fov_y } => (DVec3::ZERO, plane * (fov_y * 0.5).tan() - DVec3::Z),
                Projection::Orthographic { half_height } => (plane * half_height, DVec3::NEG_Z),
            };
            let direction = m.transform_vector3(direction).normalize_or(DVec3::NEG_Z);
            LabRay::new(m.transform_point3(from) - origin, direction, 0.0, f64::INFINITY)
        })
        .collect()
}

/// `count` parallel rays that cross the bounds with these corners.
pub fn parallel_rays(direction: DVec3, corners: &[DVec3; 8], count: usize) -> Vec<LabRay> {
    let axes = frame(direction);
    let along = |p: DVec3| DVec3::from_array(axes.map(|a| a.dot(p)));
    let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (lo, hi) = corners.iter().fold(none, |b, &p| (b.0.min(along(p)), b.1.max(along(p))));
    let ray = |i: usize| {
        let at = lo + (hi - lo) * DVec3::new(random(i, 0), random(i, 1), 0.0);
        LabRay::new(axes[0] * at.x + axes[1] * at.y + axes[2] * at.z, axes[2], 0.0, f64::INFINITY)
    };
    (0..count).map(ray).collect()
}

/// `count` rays from a point to places within the bounds with these corners.
pub fn point_rays(eye: DVec3, corners: &[DVec3; 8], count: usize) -> Vec<LabRay> {
    let (lo, size) = (corners[0], corners[7] - corners[0]);
    let ray = |i: usize| {
        let target = lo + size * DVec3::new(random(i, 0), random(i, 1), random(i, 2));
        LabRay::new(eye, (target - eye).normalize_or(DVec3::Y), 0.0, f64::INFINITY)
    };
    (0..count).map(ray).collect()
}

/// Corners of the bounds of a scene relative to an origin, in the order of `hull`; `None` without
/// geometry.
pub fn corners(scene: &Scene, origin: DVec3) -> Option<[DVec3; 8]> {
    let (lo, hi) = scene.bounds()?;
    let pick = |k: usize| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { lo[a] } else { hi[a] }));
    Some(std::array::from_fn(|k| pick(k) - origin))
}

/// The rays of an image: through its pixels, and from what they hit to each directional light and
/// each other one (the first of either kind; a sun from above where there is none), into the
/// hemisphere up to `ao_radius`, and onwards.
pub fn image_streams(
    hierarchy: &Hierarchy,
    scene: &Scene,
    camera: &Camera,
    origin: DVec3,
    size: [u32; 2],
    ao_radius: f64,
) -> Vec<RayStream> {
    let camera = camera_rays(camera, origin, size);
    let seen = surfaces(hierarchy, &camera);
    let from_all = |name: &str, query, ray: &(dyn Fn(usize, DVec3, DVec3) -> Option<LabRay> + Sync)| RayStream {
        name: name.to_owned(),
        query,
        rays: seen.par_iter().enumerate().filter_map(|(i, &(p, n))| ray(i, p, n)).collect(),
    };

    // lights of both kinds
    let is_sun = |l: &&Light| matches!(l.kind, LightKind::Directional { .. });
    let [own_sun, own_lamp] = usual_lights(scene);
    let to_sun = -scene.lights.iter().find(is_sun).unwrap_or(&own_sun).direction.normalize();
    let lamp = scene.lights.iter().find(|l| !is_sun(l)).unwrap_or(&own_lamp).position - origin;

    let sun_ray = |_, p: DVec3, n: DVec3| (n.dot(to_sun) > 0.0).then(|| LabRay::new(p, to_sun, 0.0, f64::INFINITY));
    let lamp_ray = |_, p: DVec3, n: DVec3| (n.dot(lamp - p) > 0.0).then(|| LabRay::new(p, lamp - p, 0.0, 1.0));
    let ao = |i, p, n| Some(LabRay::new(p, cosine_direction(i, 10, n), 0.0, ao_radius));
    let bounce = |i, p, n| Some(LabRay::new(p, cosine_direction(i, 12, n), 0.0, f64::INFINITY));
    let mut out = vec![
        from_all("sun shadow", Query::Any, &sun_ray),
        from_all("point shadow", Query::Any, &lamp_ray),
        from_all("ambient occlusion", Query::Any, &ao),
        from_all("bounce", Query::Closest, &bounce),
    ];
    out.insert(0, RayStream { name: "camera".into(), query: Query::Closest, rays: camera });
    out.retain(|s| !s.rays.is_empty());
    out
}

/// The lights of a scene that has none: a sun from above, and a lamp in its upper part.
pub fn usual_lights(scene: &Scene) -> [Light; 2] {
    let (lo, hi) = scene.bounds().unwrap_or_default();
    let light = |name: &str, kind, position| Light {
        name: name.to_owned(),
        kind,
        intensity: glam::Vec3::ONE,
        position,
        direction: -DVec3::new(0.3, 1.0, 0.2).normalize(),
        range: f64::INFINITY,
    };
    let upper = lo * 0.5 + hi * 0.5 + DVec3::Y * (hi.y - lo.y) * 0.4;
    [
        light("sun from above", LightKind::Directional { angle: 0.0 }, DVec3::ZERO),
        light("lamp in the upper part", LightKind::Point, upper),
    ]
}

/// The points that rays meet, a little off the surface, each with the normal on the ray's side.
pub fn surfaces(hierarchy: &Hierarchy, rays: &[LabRay]) -> Vec<(DVec3, DVec3)> {
    rays.par_iter().filter_map(|r| hierarchy.surface(r)).collect()
}

/// The shadow rays to a light from points with their normals, where the light reaches them but for
/// what is between. Points are relative to `origin`.
pub fn shadow_rays(seen: &[(DVec3, DVec3)], light: &Light, origin: DVec3) -> Vec<LabRay> {
    let ray = |&(p, n): &(DVec3, DVec3)| {
        let (to_light, tmax) = match light.kind {
            LightKind::Directional { .. } => (-light.direction, f64::INFINITY),
            _ => (light.position - origin - p, 1.0),
        };
        let is_in_cone = match light.kind {
            LightKind::Spot { outer_angle, .. } => {
                to_light.dot(-light.direction) >= f64::from(outer_angle).cos() * to_light.length()
            }
            _ => true,
        };
        let is_in_range = tmax.is_infinite() || to_light.length() <= light.range;
        (n.dot(to_light) > 0.0 && is_in_cone && is_in_range).then(|| LabRay::new(p, to_light, 0.0, tmax))
    };
    seen.par_iter().filter_map(ray).collect()
}

/// A direction about a normal, cosine-distributed; `k`: its first number.
fn cosine_direction(index: usize, k: u32, normal: DVec3) -> DVec3 {
    let (u, v) = (random(index, k), random(index, k + 1));
    let tangent = normal.any_orthonormal_vector();
    let (sin, cos) = (TAU * v).sin_cos();
    let r = u.sqrt();
    tangent * (r * cos) + normal.cross(tangent) * (r * sin) + normal * (1.0 - u).sqrt()
}

impl Hierarchy {
    /// The point that a ray meets, a little off the surface, and the normal on the ray's side.
    fn surface(&self, ray: &LabRay) -> Option<(DVec3, DVec3)> {
        let hit = self.trace(ray, Query::Closest, &mut Visits::default())?;
        let normal = self.normal(ray, &hit).try_normalize()?;
        let normal = if normal.dot(ray.direction) > 0.0 { -normal } else { normal };
        let point = ray.at(hit.t);
        let offset = 4e-6 * point.abs().max_element().max(hit.t * ray.direction.length());
        Some((point + normal * offset, normal))
    }

    fn normal(&self, ray: &LabRay, hit: &LabHit) -> DVec3 {
        let (group, to_group) = match self.top {
            Some(_) => self.instances[hit.instance as usize],
            None => (0, glam::DAffine3::IDENTITY),
        };
        let local = match self.groups[group].1.shapes[hit.primitive as usize] {
            Shape::Triangle([a, b, c]) => {
                let [a, b, c] = [a, b, c].map(|v| v.as_dvec3());
                (b - a).cross(c - a)
            }
            Shape::Sphere(centre, _) => to_group.transform_point3(ray.at(hit.t)) - centre.as_dvec3(),
        };
        to_group.matrix3.transpose() * local
    }
}
