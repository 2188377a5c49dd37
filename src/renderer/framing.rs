//! The camera of a scene that has none, chosen by what it would see: the whole scene from outside, or a room from inside.

use std::f64::consts::TAU;

use glam::DVec3;
use rayon::prelude::*;

use super::interactive::pick::{camera_ray, visible_surfaces};
use crate::error::{Error, Result};
use crate::oracle::{Oracle, OracleRay};
use crate::scene::{Camera, Geometry, Scene};

/// What a ray sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VisibleSurface {
    /// Distance, scene units.
    pub distance: f64,
    /// Whether it is the front of the surface.
    pub is_front: bool,
}

/// Finds what rays see, which are given as origins and unit directions.
pub type Trace<'a> = dyn Fn(&[(DVec3, DVec3)]) -> Result<Vec<Option<VisibleSurface>>> + 'a;

/// Directions, close to the horizontal, in which it is tested whether there are walls.
const PROBES: usize = 96;
/// Share of them that must see the front of something for a place to be inside a room: from inside an object they see backs.
const ENCLOSED: f64 = 0.93;
/// Nine in ten of them see nothing nearer than this share of the scene's diagonal: rooms are empty in the middle, vehicles are not.
const CLEARANCE: f64 = 0.04;
/// Places inside a room that are compared, along each axis of its floor, and their heights as shares of the scene's.
const PLACES: usize = 5;
const HEIGHTS: [f64; 2] = [0.2, 0.35];
/// Directions that are compared at each place.
const HEADINGS: usize = 12;
/// Rays of a view that is compared, along its width and height.
const VIEW: [usize; 2] = [12, 8];
/// Scenes with more triangles and spheres than this are seen from outside where no device traces the rays: the host's hierarchy of them would take too long.
const MAX_HOST_PRIMITIVES: u64 = 5_000_000;
/// Vertical field of view inside, radians.
const INSIDE_FOV_Y: f64 = 1.05;

/// Chooses a camera for images of `aspect` = width / height of a scene with these bounds. Inside means: from the middle of the scene there is something in nearly
/// all horizontal directions, seen from its front, and none of it close. Then it is the place and direction with the longest view; else the camera sees the whole scene.
///
/// # Errors
/// Those of `trace`.
pub fn choose((lo, hi): (DVec3, DVec3), aspect: f64, trace: &Trace) -> Result<Camera> {
    let outside = Camera::framing(lo, hi, aspect);
    let extent = hi - lo;
    if extent.min_element() <= 0.0 {
        return Ok(outside);
    }
    let at = |x: f64, y: f64, z: f64| lo + extent * DVec3::new(x, y, z);
    for height in HEIGHTS {
        let distances = distances(at(0.5, height, 0.5), trace)?;
        let is_room = distances.len() as f64 >= ENCLOSED * PROBES as f64
            && distances[distances.len() / 10] >= CLEARANCE * extent.length();
        if !is_room {
            return Ok(outside);
        }
    }
    let along = |k: usize| (k as f64 + 1.0) / (PLACES as f64 + 1.0);
    let mut cameras = Vec::new();
    for (place, height) in (0..PLACES * PLACES).flat_map(|p| HEIGHTS.map(|h| (p, h))) {
        let eye = at(along(place % PLACES), height, along(place / PLACES));
        for heading in 0..HEADINGS {
            let angle = TAU * heading as f64 / HEADINGS as f64;
            let forward = DVec3::new(angle.sin(), 0.05, -angle.cos());
            cameras.push(Camera::look_at(eye, eye + forward, DVec3::Y, INSIDE_FOV_Y));
        }
    }
    let [columns, rows] = VIEW;
    let point = |k: usize| [(k % columns) as f64 + 0.5, (k / columns) as f64 + 0.5];
    let rays_of = |camera: &Camera| -> Vec<(DVec3, DVec3)> {
        let of = |k| {
            let [x, y] = point(k);
            camera_ray(camera, [x / columns as f64, y / rows as f64], aspect)
        };
        (0..columns * rows).map(of).collect()
    };
    let rays: Vec<(DVec3, DVec3)> = cameras.iter().flat_map(rays_of).collect();
    let hits = trace(&rays)?;
    let size = extent.length();
    let score = |seen: &[Option<VisibleSurface>]| {
        if seen.iter().flatten().any(|s| !s.is_front) {
            return 0.0;
        }
        let distances: Vec<f64> = seen.iter().flatten().map(|s| s.distance / size).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        // long views of much, with nothing right before the camera; the sky is no view
        let sum: f64 = distances.iter().map(|d| d.sqrt()).sum();
        if nearest < 0.02 { 0.2 * sum } else { sum }
    };
    let best = hits.chunks_exact(columns * rows).map(score).enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
    Ok(best.and_then(|(k, _)| cameras.into_iter().nth(k)).unwrap_or(outside))
}

/// The camera of a scene that has none, as [`choose`] finds it by rays that are traced on the host. For what is no room that costs a few rays.
///
/// # Errors
/// [`Error::Scene`] for a scene without geometry.
pub fn of_scene(scene: &Scene, aspect: f64) -> Result<Camera> {
    let bounds = scene.bounds().ok_or_else(|| Error::Scene("the scene has no geometry to render".into()))?;
    let (lo, hi) = bounds;
    let middle = lo + (hi - lo) * DVec3::new(0.5, HEIGHTS[0], 0.5);
    if scene.triangle_count() + scene.sphere_count() > MAX_HOST_PRIMITIVES || !may_be_room(scene, middle) {
        return Ok(Camera::framing(lo, hi, aspect));
    }
    let origin = scene.origin();
    let oracle = Oracle::new(scene, origin);
    choose(bounds, aspect, &|rays| {
        let closest = |&(from, direction): &(DVec3, DVec3)| {
            let ray = OracleRay { origin: from - origin, tmin: 0.0, direction, tmax: f64::INFINITY };
            let hit = oracle.closest(ray);
            hit.is_hit().then(|| hit.to_hit())
        };
        Ok(visible_surfaces(scene, rays, rays.par_iter().map(closest).collect()))
    })
}

/// Whether a few rays from a point all see the front of a triangle: else it is in no room. No hierarchy is built for them.
fn may_be_room(scene: &Scene, eye: DVec3) -> bool {
    const RAYS: usize = 6;
    let directions: Vec<DVec3> = (0..RAYS)
        .map(|k| {
            let angle = TAU * (k as f64 + 0.3) / RAYS as f64;
            DVec3::new(angle.sin(), 0.03, angle.cos()).normalize()
        })
        .collect();
    // of each ray the nearest distance, and whether a front is there
    let nearest = scene.instances.par_iter().map(|instance| {
        let mut nearest = [(f64::INFINITY, false); RAYS];
        let Geometry::Triangles(mesh) = &scene.meshes[instance.mesh].geometry else { return nearest };
        let points: Vec<DVec3> =
            mesh.positions.iter().map(|p| instance.object_to_world.transform_point3(p.as_dvec3()) - eye).collect();
        let turned = instance.object_to_world.matrix3.determinant().signum();
        for triangle in &mesh.indices {
            let [a, b, c] = triangle.map(|i| points[i as usize]);
            let normal = (b - a).cross(c - a) * turned;
            for (direction, nearest) in directions.iter().zip(&mut nearest) {
                let facing = normal.dot(*direction);
                let t = normal.dot(a) / facing;
                if !(t > 0.0 && t < nearest.0) {
                    continue;
                }
                // on the inner side of all three edges
                let p = *direction * t;
                let side = |u: DVec3, v: DVec3| (v - u).cross(p - u).dot(normal) * turned >= 0.0;
                if side(a, b) && side(b, c) && side(c, a) {
                    *nearest = (t, facing < 0.0);
                }
            }
        }
        nearest
    });
    let none = || [(f64::INFINITY, false); RAYS];
    let nearest = nearest.reduce(none, |a, b| std::array::from_fn(|k| if b[k].0 < a[k].0 { b[k] } else { a[k] }));
    nearest.iter().all(|(_, is_front)| *is_front)
}

/// Whether there are walls around a point, seen from their fronts.
///
/// # Errors
/// Those of `trace`.
pub fn is_enclosed(eye: DVec3, trace: &Trace) -> Result<bool> {
    Ok(distances(eye, trace)?.len() as f64 >= ENCLOSED * PROBES as f64)
}

/// Distances of what is seen from its front around a point, ascending.
fn distances(eye: DVec3, trace: &Trace) -> Result<Vec<f64>> {
    let direction = |k: usize| {
        let angle = TAU * (k as f64 + 0.5) / PROBES as f64;
        DVec3::new(angle.sin(), [-0.1, 0.05, 0.2][k % 3], angle.cos()).normalize()
    };
    let rays: Vec<(DVec3, DVec3)> = (0..PROBES).map(|k| (eye, direction(k))).collect();
    let seen = trace(&rays)?;
    let mut distances: Vec<f64> = seen.iter().flatten().filter(|s| s.is_front).map(|s| s.distance).collect();
    distances.sort_by(f64::total_cmp);
    Ok(distances)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: (DVec3, DVec3) = (DVec3::new(-4.0, 0.0, -2.0), DVec3::new(4.0, 3.0, 2.0));

    fn hit(distance: f64) -> Option<VisibleSurface> {
        Some(VisibleSurface { distance, is_front: true })
    }

    /// Rays inside a box end on its sides, but for those that `open` lets pass.
    fn inside(rays: &[(DVec3, DVec3)], open: impl Fn(DVec3) -> bool) -> Result<Vec<Option<VisibleSurface>>> {
        let (lo, hi) = BOUNDS;
        let is_inside = |p: DVec3| p.cmpge(lo).all() && p.cmple(hi).all();
        let distance = |(from, d): &(DVec3, DVec3)| ((DVec3::select(d.cmpgt(DVec3::ZERO), hi, lo) - *from) / *d).min_element();
        Ok(rays.iter().map(|ray| if is_inside(ray.0) && !open(ray.1) { hit(distance(ray)) } else { None }).collect())
    }

    fn is_inside(camera: &Camera) -> bool {
        let eye = camera.camera_to_world.translation;
        eye.cmpgt(BOUNDS.0).all() && eye.cmplt(BOUNDS.1).all()
    }

    #[test]
    fn rooms_are_seen_from_inside() {
        let camera = choose(BOUNDS, 1.5, &|rays| inside(rays, |_| false)).unwrap();
        // along the room, from its end
        let forward = -camera.camera_to_world.matrix3.z_axis;
        assert!(is_inside(&camera) && forward.x.abs() > 0.8, "{camera:?}");
        // a courtyard is open above
        assert!(is_inside(&choose(BOUNDS, 1.5, &|rays| inside(rays, |d| d.y > 0.5)).unwrap()));
    }

    #[test]
    fn scenes_are_looked_at_by_the_host() {
        for (name, inside) in
            [("closed-box", true), ("stairs", false), ("cornell-box", false), ("terrain:2000", false), ("spheres:50", false)]
        {
            let mut scene = crate::scene::builtin::by_name(name).unwrap();
            if let (true, Geometry::Triangles(mesh)) = (inside, &mut scene.meshes[0].geometry) {
                // walls that face the room
                mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let (lo, hi) = scene.bounds().unwrap();
            let eye = of_scene(&scene, 1.5).unwrap().camera_to_world.translation;
            assert_eq!(eye.cmpgt(lo).all() && eye.cmplt(hi).all(), inside, "{name}: {eye}");
        }
        assert!(of_scene(&Scene::default(), 1.0).is_err());
    }

    #[test]
    fn objects_and_open_boxes_are_seen_from_outside() {
        // one side is missing
        assert!(!is_inside(&choose(BOUNDS, 1.5, &|rays| inside(rays, |d| d.z > d.x.abs())).unwrap()));
        // a solid object around the middle, seen from inside
        let back = |rays: &[(DVec3, DVec3)]| Ok(vec![Some(VisibleSurface { distance: 2.0, is_front: false }); rays.len()]);
        assert!(!is_inside(&choose(BOUNDS, 1.5, &back).unwrap()));
        // something close around it
        assert!(!is_inside(&choose(BOUNDS, 1.5, &|rays| Ok(vec![hit(0.1); rays.len()])).unwrap()));
        assert!(!is_inside(&choose(BOUNDS, 1.5, &|rays| Ok(vec![None; rays.len()])).unwrap()));
    }
}
