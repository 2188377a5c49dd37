//! Surfaces in one plane: rounding decides which a ray meets. Part of [`super::scene`].

use glam::DVec3;
use rayon::prelude::*;

use crate::oracle::{Oracle, OracleRay};
use crate::sampling::sobol::hash_combine;

/// Cosine between normals from which two triangles count as parallel.
const PARALLEL: f64 = 1.0 - 1e-6;
/// Roundings of the largest coordinate within which two surfaces are one to a tracer.
const ROUNDINGS: f64 = 4.0;

/// Points of a scene's triangles, spread evenly over their area, and the surfaces under them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Overlaps {
    pub points: u64,
    /// Points in the plane of another triangle within a rounding, but not at its edge.
    pub covered: u64,
    /// Instance and primitive of two triangles of which one lies on the other.
    pub example: Option<[(u32, u32); 2]>,
}

impl Overlaps {
    /// Looks at `count` points.
    pub fn measure(oracle: &Oracle, count: u32, seed: u32) -> Self {
        let triangles = oracle.triangles();
        let mut total = 0.0;
        let areas: Vec<f64> = triangles
            .iter()
            .map(|t| {
                let area = (t.v[1] - t.v[0]).cross(t.v[2] - t.v[0]).length();
                total += if area.is_finite() { area } else { 0.0 };
                total
            })
            .collect();
        let Some((lo, hi)) = oracle.bounds().filter(|_| total > 0.0) else { return Self::default() };
        let reach = ROUNDINGS * f64::from(f32::EPSILON) * lo.abs().max(hi.abs()).max_element();
        let found: Vec<[(u32, u32); 2]> = (0..count)
            .into_par_iter()
            .filter_map(|i| {
                let unit = |k: u32| f64::from(hash_combine(hash_combine(seed, i), k)) / 4_294_967_296.0;
                let share = (f64::from(i) + unit(0)) / f64::from(count) * total;
                let own = &triangles[areas.partition_point(|a| *a < share).min(triangles.len() - 1)];
                // uniform over the triangle
                let (u, v) = (unit(1).sqrt(), unit(2));
                let point = own.v[0] * (1.0 - u) + own.v[1] * (u * (1.0 - v)) + own.v[2] * (u * v);
                let normal = own.normal();
                other_at(oracle, (own.instance, own.primitive), point, normal, reach)
                    .map(|other| [(own.instance, own.primitive), other])
            })
            .collect();
        Self { points: u64::from(count), covered: found.len() as u64, example: found.first().copied() }
    }
}

/// Another triangle in the plane of a point.
fn other_at(oracle: &Oracle, own: (u32, u32), point: DVec3, normal: DVec3, reach: f64) -> Option<(u32, u32)> {
    let ray = OracleRay { origin: point + normal * (2.0 * reach), direction: -normal, tmin: reach, tmax: 3.0 * reach };
    let mut found = None;
    oracle.all(ray, |hit| {
        let id = (hit.instance, hit.primitive);
        // at its edge the neighbour in the same plane is met, too
        let [v, w] = hit.barycentrics;
        let is_within = v.min(w).min(1.0 - v - w) > 1e-9;
        if id != own
            && is_within
            && oracle.facing_normal(&ray, hit).dot(normal) > PARALLEL
            && found.is_none_or(|f| id < f)
        {
            found = Some(id);
        }
    });
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use crate::scene::builtin::{SceneTransform, analytic, shapes};
    use crate::stress::sampling::{add, matte};

    fn overlaps(scene: &Scene) -> Overlaps {
        Overlaps::measure(&Oracle::new(scene, scene.origin()), 20_000, 3)
    }

    /// A square over a quarter of another one, an eighth of a sheet over a plane, and sound scenes.
    #[test]
    fn overlaps_are_found_where_they_are() {
        for at in [SceneTransform::default(), SceneTransform { scale: 1e-3, offset: DVec3::splat(1e6) }] {
            let plane = analytic::plane(2.0, at);
            assert_eq!(overlaps(&plane).covered, 0);
            let mut both = plane.clone();
            // its middle is a corner of the plane: a quarter of it lies on a quarter of the plane
            let mut second = plane.instances[0].clone();
            second.object_to_world *= glam::DAffine3::from_translation(DVec3::new(1.0, 0.0, 1.0));
            both.instances.push(second.clone());
            let found = overlaps(&both);
            let share = found.covered as f64 / found.points as f64;
            assert!((share - 0.25).abs() < 0.01, "{share}");
            assert_eq!(found.example.map(|e| e.map(|(instance, _)| instance)), Some([0, 1]));
            // a thousandth apart is apart
            both.instances[1].object_to_world *= glam::DAffine3::from_translation(DVec3::Y * 1e-3);
            assert_eq!(overlaps(&both).covered, 0, "{at:?}");
        }
        assert_eq!(overlaps(&analytic::closed_box(1.0, SceneTransform::default())).covered, 0);
        let mut grid = Scene::default();
        for k in 0..16 {
            let middle = DVec3::new(f64::from(k % 4), 0.0, f64::from(k / 4));
            add(&mut grid, shapes::floor(middle, 1.0), matte(0.5));
        }
        assert_eq!(overlaps(&grid).covered, 0);
    }
}
