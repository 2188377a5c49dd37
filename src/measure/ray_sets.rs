//! Sets of rays on which tracers are compared. All are reproducible from their seed, rounded to
//! `f32`, and relative to the oracle's origin.

use crate::oracle::camera::camera_ray;
use crate::oracle::{Oracle, OracleHit, OracleRay};
use crate::ray::Ray;
use crate::sampling::sobol::hash_combine;
use crate::sampling::{AO_DIRECTION, CAMERA_FILM, Sampler, to_unit, warp};
use crate::scene::builtin::{self, SceneTransform};
use crate::scene::{Camera, Geometry, Scene};
use glam::DVec3;
use rayon::prelude::*;

/// A small counter-based generator: value `k` of stream `(seed, index)`.
fn random(seed: u32, index: usize, k: u32) -> f64 {
    let low = hash_combine(hash_combine(seed, index as u32), k);
    to_unit(low) as f64 + to_unit(hash_combine(low, 1)) as f64 / 16_777_216.0
}

fn random3(seed: u32, index: usize, k: u32) -> DVec3 {
    DVec3::new(random(seed, index, k), random(seed, index, k + 1), random(seed, index, k + 2))
}

fn random_direction(seed: u32, index: usize, k: u32) -> DVec3 {
    let z = 1.0 - 2.0 * random(seed, index, k);
    let (s, c) = (std::f64::consts::TAU * random(seed, index, k + 1)).sin_cos();
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * c, r * s, z)
}

/// The ray rounded to single precision.
pub fn narrow(ray: &OracleRay) -> Ray {
    Ray::new(ray.origin, ray.direction, [ray.tmin, ray.tmax])
}

/// `count` rays from points in and around the scene's bounds, half of them in any direction, half
/// towards another point of the bounds. Directions have lengths between 1/4 and 4, and one ray in
/// eight ends early, so that `t` is tested in its own units.
pub fn random_rays(oracle: &Oracle, count: usize, seed: u32) -> Vec<Ray> {
    let Some((lo, hi)) = oracle.bounds() else { return Vec::new() };
    let size = (hi - lo).max(DVec3::splat((hi - lo).max_element() * 0.1));
    let lo = (lo + hi) * 0.5 - size * 0.5;
    (0..count)
        .into_par_iter()
        .map(|i| {
            let origin = lo + (random3(seed, i, 0) * 1.5 - 0.25) * size;
            let target = lo + random3(seed, i, 3) * size;
            let towards = (target - origin).normalize_or(DVec3::Y);
            let direction = if i % 2 == 0 { random_direction(seed, i, 6) } else { towards };
            let direction = direction * (random(seed, i, 8) * 4.0 - 2.0).exp2();
            let reach = size.length() * random(seed, i, 9) / direction.length();
            let tmax = if i % 8 == 3 { reach } else { f64::INFINITY };
            narrow(&OracleRay { origin, direction, tmin: 0.0, tmax })
        })
        .collect()
}

/// One jittered ray through every pixel of an image, in rows.
pub fn camera_rays(oracle: &Oracle, camera: &Camera, size: [u32; 2], seed: u32) -> Vec<Ray> {
    let sampler = Sampler { seed };
    (0..size[0] as usize * size[1] as usize)
        .into_par_iter()
        .map(|i| {
            let pixel = [i as u32 % size[0], i as u32 / size[0]];
            let u = sampler.get_2d_unit(pixel, 0, CAMERA_FILM);
            let film = [pixel[0] as f64 + u[0] as f64, pixel[1] as f64 + u[1] as f64];
            narrow(&camera_ray(camera, oracle.origin(), size, film))
        })
        .collect()
}

/// `per_hit` ambient occlusion rays of length `radius` from every hit of `rays`, cosine-distributed
/// around the geometric normal on the viewer's side. They start 16 ulp of the greatest coordinate
/// above the surface.
pub fn ao_rays(oracle: &Oracle, rays: &[Ray], hits: &[OracleHit], per_hit: u32, radius: f64, seed: u32) -> Vec<Ray> {
    let sampler = Sampler { seed };
    let count = rays.len().min(hits.len());
    (0..count)
        .into_par_iter()
        .filter(|&i| hits[i].is_hit())
        .flat_map_iter(|i| {
            let ray = OracleRay::from(&rays[i]);
            let normal = oracle.facing_normal(&ray, &hits[i]);
            let point = ray.at(hits[i].t);
            let origin = point
                + normal * (16.0 * f32::EPSILON as f64 * point.abs().max_element().max(ray.origin.abs().max_element()));
            (0..per_hit).map(move |s| {
                let u = sampler.get_2d_unit([i as u32, 0], s, AO_DIRECTION);
                let d = warp::to_world(normal.as_vec3().to_array(), warp::cosine_hemisphere(u));
                Ray { origin: origin.as_vec3().to_array(), tmin: 0.0, direction: d, tmax: radius as f32 }
            })
        })
        .collect()
}

/// Generates at least `total` rays like those that renderers trace: a third from `camera`, a third
/// ambient occlusion rays of their hits, a third [`random_rays`].
pub fn mixed_rays(oracle: &Oracle, camera: &Camera, total: usize, seed: u32) -> Vec<Ray> {
    let edge = ((total / 3) as f64).sqrt().ceil() as u32;
    let mut rays = camera_rays(oracle, camera, [edge, edge], seed);
    let hits = oracle.trace_closest(&rays);
    let covered = hits.iter().filter(|h| h.is_hit()).count().max(1);
    let each = (total / 3).div_ceil(covered) as u32;
    let occlusion = ao_rays(oracle, &rays, &hits, each, f64::INFINITY, seed.wrapping_add(1));
    rays.extend(occlusion);
    let missing = total.saturating_sub(rays.len()).max(total / 3);
    rays.extend(random_rays(oracle, missing, seed.wrapping_add(2)));
    rays
}

/// Scenes for [`leak_rays`], with what sets each apart: a box and a round body at scales of 1e-3 to
/// 1e6 and at offsets to 1e6, in an instance's transform (from which the scene's origin takes it
/// away) and in the vertices.
pub fn leak_scenes() -> Vec<(String, Scene)> {
    let mut out = Vec::new();
    for (scale, offset) in [(1.0, 0.0), (1e-3, 0.0), (1e3, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-3, 1.0), (1e3, -1e6)] {
        let place = SceneTransform { scale, offset: DVec3::new(offset, offset * 0.37, -offset * 0.71) };
        let cube = builtin::analytic::closed_box(1.0, place);
        let mut sphere = cube.clone();
        sphere.meshes[0].geometry = builtin::shapes::icosphere(1.0, 5);
        for (what, scene) in [("box", cube), ("round body", sphere)] {
            out.push((format!("{what}, baked, scale {scale:e}, offset {offset:e}"), builtin::bake(&scene)));
            out.push((format!("{what}, placed, scale {scale:e}, offset {offset:e}"), scene));
        }
    }
    out
}

/// Closed convex meshes beside [`leak_scenes`]: many triangles, needles (`segments` of them around
/// a point), and nearly flat ones.
pub fn hard_leak_scenes(levels: u32, segments: u32) -> Vec<(String, Scene)> {
    let body = |geometry: Geometry| {
        let mut scene = builtin::analytic::closed_box(1.0, SceneTransform::default());
        scene.meshes[0].geometry = geometry;
        scene
    };
    let mut flat = builtin::shapes::icosphere(1.0, 4);
    if let Geometry::Triangles(mesh) = &mut flat {
        mesh.positions.iter_mut().for_each(|p| p.y *= 1e-4);
        mesh.normals.clear();
    }
    let round = builtin::shapes::icosphere(1.0, levels);
    let name = format!("round body of {} triangles", round.primitive_count());
    vec![
        (name, body(round)),
        ("cylinder of needles".into(), body(builtin::shapes::cylinder(0.02, 4.0, 60))),
        ("disk of needle fans".into(), body(builtin::shapes::cylinder(1.0, 0.01, segments))),
        ("nearly flat ellipsoid".into(), body(flat)),
    ]
}

/// Rays that must hit a closed convex mesh (or a union of them), aimed at its shared vertices and
/// edges: even ones from inside, odd ones from outside. Every miss is a leak.
///
/// A target is a vertex, the middle of an edge, or any point of an edge. One ray in four has an
/// origin on a coarse binary grid, so that on tidy meshes the arithmetic is exact and the ray meets
/// the edge exactly. The inner end lies well inside, so that no ray only grazes the mesh.
pub fn leak_rays(oracle: &Oracle, count: usize, seed: u32) -> Vec<Ray> {
    let triangles = oracle.triangles();

    // middle of each instance's vertices: inside, for a convex mesh
    let mut middles = std::collections::HashMap::<u32, (DVec3, f64)>::new();
    for t in triangles {
        let entry = middles.entry(t.instance).or_default();
        *entry = (entry.0 + t.v[0] + t.v[1] + t.v[2], entry.1 + 3.0);
    }
    if triangles.is_empty() {
        return Vec::new();
    }
    (0..count)
        .into_par_iter()
        .map(|i| {
            let pick = |n: usize, k: u32| ((random(seed, i, k) * n as f64) as usize).min(n - 1);
            let triangle = &triangles[pick(triangles.len(), 0)];
            let (sum, n) = middles[&triangle.instance];
            let middle = sum / n;
            let corner = pick(3, 1);
            let (a, b) = (triangle.v[corner], triangle.v[(corner + 1) % 3]);
            let along = [0.0, 0.5, random(seed, i, 2), random(seed, i, 3)][pick(4, 4)];
            let target = a + (b - a) * along;

            // half way to a random point of a random triangle at most: strictly inside
            let other = &triangles[pick(triangles.len(), 5)];
            let other = if other.instance == triangle.instance { other.v[pick(3, 6)] } else { target };
            let mut inside = middle + (other - middle) * (0.5 * random(seed, i, 7));
            if i % 4 < 2 {
                let grid = (0.03125 * (target - middle).length()).log2().floor().exp2();
                if grid.is_normal() {
                    inside = (inside / grid).round() * grid;
                }
            }

            // half of the rays go outwards, the others come from beyond the target
            let outward = target - inside;
            let origin = if i % 2 == 0 { inside } else { target + outward * (random(seed, i, 8) * 10.0 - 5.0).exp2() };
            // the direction from the rounded origin, so that the ray passes the target but for its
            // own rounding
            let origin = origin.as_vec3().as_dvec3();
            narrow(&OracleRay { origin, direction: target - origin, tmin: 0.0, tmax: f64::INFINITY })
        })
        .collect()
}
