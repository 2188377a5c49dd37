//! Influence areas: places from which rays of a known distribution start. A plane area is an
//! oriented box whose rays have one direction, a point area a frustum whose rays pass through its
//! apex. They are given, derived from the lights and cameras of a scene, or fitted to rays.

use std::path::Path;

use glam::{DMat3, DVec2, DVec3};
use serde::{Deserialize, Serialize};

use super::body::LabRay;
use super::projection::{RayDistribution, View, frame};
use super::region::Region;
use crate::error::{Error, Result};
use crate::files;
use crate::scene::{Camera, Light, LightKind, Projection, Scene};

/// Cosine of the angle up to which a direction agrees with that of an area (Falcone's).
pub const AGREEMENT: f64 = 0.99;
/// Width over height of images of cameras that name none.
const ASPECT: f64 = 16.0 / 9.0;
/// Angle in degrees from the mean within which rays through a point fit into one frustum.
const WIDEST: f64 = 65.0;

/// A region, and the rays that start in it.
#[derive(Clone, Debug, PartialEq)]
pub struct InfluenceArea {
    /// The origin of the area, in words.
    pub name: String,
    /// The region.
    pub region: Region,
    /// The rays.
    pub rays: RayDistribution,
    /// Cosine of the angle up to which a direction agrees.
    pub agreement: f64,
}

impl InfluenceArea {
    fn new(name: String, region: Region, rays: RayDistribution) -> Self {
        Self { name, region, rays, agreement: AGREEMENT }
    }

    /// The same area as seen from another origin.
    pub fn relative_to(&self, origin: DVec3) -> Self {
        Self { region: self.region.relative_to(origin), rays: self.rays.relative_to(origin), ..self.clone() }
    }

    /// Whether a ray is one of those that the area's tree is built for: it starts inside, and its
    /// direction agrees, forwards or backwards.
    pub fn is_affine(&self, ray: &LabRay) -> bool {
        let agrees = |d: DVec3| d.dot(ray.direction).abs() >= self.agreement * d.length() * ray.direction.length();
        // a ray that starts at the eye has any direction
        let is_any = |d: DVec3| d.length() <= self.region.slack() || agrees(d);
        self.region.contains(ray.origin) && self.rays.direction_at(ray.origin).is_none_or(is_any)
    }

    /// A box around some points in the frame of a direction.
    fn around(name: String, direction: DVec3, points: &[DVec3]) -> Self {
        let axes = frame(direction);
        let along = |p: DVec3| DVec3::from_array(axes.map(|a| a.dot(p)));
        let none = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (lo, hi) = points.iter().fold(none, |b, &p| (b.0.min(along(p)), b.1.max(along(p))));
        let size = hi - lo;
        // a little more, so that what lies on the border is inside
        let margin = 1e-6 * size.max_element();
        let (lo, size) = (lo - margin, size + 2.0 * margin);
        let half = DVec2::new(size.x, size.y) * 0.5;
        let from = axes[0] * (lo.x + half.x) + axes[1] * (lo.y + half.y) + axes[2] * lo.z;
        let region = Region::oriented_box(from, axes, half, size.z);
        Self::new(name, region, RayDistribution::Parallel(axes[2]))
    }

    /// A frustum; `None` if no point lies in front of it.
    fn of_view(name: String, view: View, near: f64, points: &[DVec3]) -> Option<Self> {
        let far = points.iter().map(|p| (*p - view.eye).dot(view.forward)).fold(0.0, f64::max) * 1.000_001;
        (far > near).then(|| Self::new(name, Region::frustum(&view, near, far), RayDistribution::View(view)))
    }

    /// Six frusta around a point, as the faces of a cube.
    fn around_point(name: &str, eye: DVec3, points: &[DVec3]) -> Vec<Self> {
        let faces = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let names = ["x", "-x", "y", "-y", "z", "-z"];
        let view = |(&axis, side): (&DVec3, &str)| {
            Self::of_view(format!("{name}, {side}"), View::new(eye, axis, DVec2::ONE), 0.0, points)
        };
        faces.iter().zip(names).filter_map(view).collect()
    }
}

/// Influence areas of a scene: a box for each directional light and each orthographic camera, a
/// frustum for each perspective camera and each spot that is not too wide, six for any other light.
/// Positions are relative to `origin`.
pub fn areas_of_scene(scene: &Scene, cameras: &[Camera], origin: DVec3) -> Vec<InfluenceArea> {
    let Some((lo, hi)) = scene.bounds() else { return Vec::new() };
    let pick = |k: usize| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { lo[a] } else { hi[a] }));
    let corners: [DVec3; 8] = std::array::from_fn(|k| pick(k) - origin);
    let mut out = Vec::new();
    for (k, light) in scene.lights.iter().enumerate() {
        out.extend(areas_of_light(light, &light_name(light, k), &corners, origin));
    }
    for (k, camera) in cameras.iter().enumerate() {
        let name = if camera.name.is_empty() { format!("camera {k}") } else { format!("camera `{}`", camera.name) };
        let (m, eye) = (camera.camera_to_world.matrix3, camera.camera_to_world.translation - origin);
        match camera.projection {
            Projection::Perspective { fov_y } => {
                let tan = (fov_y * 0.5).tan();
                let tangents = DVec2::new(tan * camera.aspect.unwrap_or(ASPECT), tan);
                let view = View { eye, right: m.x_axis, up: m.y_axis, forward: -m.z_axis, tangents };
                out.extend(InfluenceArea::of_view(name, view, 0.0, &corners));
            }
            Projection::Orthographic { .. } => {
                let points = [&corners[..], &[eye]].concat();
                out.push(InfluenceArea::around(name, -m.z_axis, &points));
            }
        }
    }
    out
}

/// A light in words: its name, or its number.
pub fn light_name(light: &Light, number: usize) -> String {
    if light.name.is_empty() { format!("light {number}") } else { format!("light `{}`", light.name) }
}

/// Influence areas of a light in bounds with these corners, relative to `origin`.
pub fn areas_of_light(light: &Light, name: &str, corners: &[DVec3; 8], origin: DVec3) -> Vec<InfluenceArea> {
    let position = light.position - origin;
    match light.kind {
        LightKind::Directional { .. } => vec![InfluenceArea::around(name.to_owned(), light.direction, corners)],
        LightKind::Spot { outer_angle, .. } if f64::from(outer_angle) < WIDEST.to_radians() => {
            let view = View::new(position, light.direction, DVec2::splat(f64::from(outer_angle).tan()));
            InfluenceArea::of_view(name.to_owned(), view, 0.0, corners).into_iter().collect()
        }
        _ => InfluenceArea::around_point(name, position, corners),
    }
}

/// The distribution of rays with these influence areas, for rules of a whole tree; `None` without.
pub fn distribution_of(areas: &[InfluenceArea]) -> Option<RayDistribution> {
    match areas {
        [] => None,
        [only] => Some(only.rays),
        // all around one point
        [first, ..] => match first.rays {
            RayDistribution::View(view) => Some(RayDistribution::Point(view.eye)),
            other => Some(other),
        },
    }
}

/// Influence areas of recorded rays within bounds: a box where all have one direction, one frustum
/// or six where their lines meet in a point; none where they do neither.
pub fn areas_of_rays(name: &str, rays: &[LabRay], corners: &[DVec3]) -> Vec<InfluenceArea> {
    let Some(first) = rays.first().map(|r| r.direction.normalize()) else { return Vec::new() };
    let unit = |r: &LabRay| r.direction.normalize();

    // one direction, up to the sign
    let mean: DVec3 = rays.iter().map(|r| unit(r) * unit(r).dot(first).signum()).sum();
    let mean = mean.normalize_or(first);
    if rays.iter().all(|r| unit(r).dot(mean).abs() > 0.9999) {
        let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
        let reach = corners.iter().map(|c| c.distance(middle)).fold(0.0, f64::max);
        // ends of rays that have none lie beyond everything
        let end = |r: &LabRay| r.at(r.tmax.min((r.origin.distance(middle) + reach) / r.direction.length()));
        let points: Vec<DVec3> = rays.iter().flat_map(|r| [r.origin, end(r)]).collect();
        return vec![InfluenceArea::around(name.to_owned(), mean, &points)];
    }

    // the point that is closest to all lines
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for ray in rays {
        let d = unit(ray);
        let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        matrix += across;
        right += across * ray.origin;
    }
    let eye = matrix.inverse() * right;
    let size = corners.iter().flat_map(|a| corners.iter().map(move |b| a.distance(*b))).fold(0.0, f64::max);
    let miss = |r: &LabRay| (eye - r.origin).cross(unit(r)).length();
    if !eye.is_finite() || rays.iter().any(|r| miss(r) > 1e-3 * size) {
        return Vec::new();
    }

    // the frustum from there to the rays' origins, or along rays that start there
    let towards: Vec<DVec3> = rays
        .iter()
        .map(|r| if r.origin.distance(eye) > 2e-3 * size { (r.origin - eye).normalize() } else { unit(r) })
        .collect();
    let mean = towards.iter().sum::<DVec3>().normalize_or(first);
    if towards.iter().any(|d| d.dot(mean) < WIDEST.to_radians().cos()) {
        return InfluenceArea::around_point(name, eye, corners);
    }
    let mut view = View::new(eye, mean, DVec2::ZERO);
    for d in &towards {
        let at = DVec2::new(d.dot(view.right), d.dot(view.up)) / d.dot(mean);
        view.tangents = view.tangents.max(at.abs() * 1.0001);
    }
    InfluenceArea::of_view(name.to_owned(), view, 0.0, corners).into_iter().collect()
}

/// An influence area in a file, as `falcone_influence_areas.json` has them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Name of the scene that it is for; may be empty.
    #[serde(default)]
    pub scene: String,
    /// `plane` or `point`.
    pub kind: PlacementKind,
    /// The direction in a word; may be empty.
    #[serde(default)]
    pub orientation: String,
    /// Middle of the rectangle, or the eye. World space.
    pub origin: [f64; 3],
    /// Direction of the rays, or of the view; of any length but 0.
    pub direction: [f64; 3],
    /// Half extents of the rectangle (plane).
    #[serde(default)]
    pub half_width: f64,
    /// Half extent upwards (plane).
    #[serde(default)]
    pub half_height: f64,
    /// Angles of view (point), degrees.
    #[serde(default)]
    pub fov_x_degrees: f64,
    /// Angle of view upwards (point), degrees.
    #[serde(default)]
    pub fov_y_degrees: f64,
    /// Distance of the near face of a point area.
    #[serde(default)]
    pub near: f64,
    /// Distance of the far face.
    pub far: f64,
    /// Number of rays to measure with.
    #[serde(default)]
    pub rays: usize,
}

/// Kinds of influence areas.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PlacementKind {
    /// Parallel rays from a rectangle.
    Plane,
    /// Rays from a point.
    Point,
}

impl Placement {
    /// Reads a list of them.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is missing or no such list, naming the entry.
    pub fn read_list(path: &Path) -> Result<Vec<Self>> {
        let wrong = |why: String| Error::input(path, why);
        let list: Vec<Self> = serde_json::from_slice(&files::read(path)?).map_err(|e| {
            wrong(format!("is no list of influence areas ({e}): give objects with kind, origin, direction and far"))
        })?;
        for (k, p) in list.iter().enumerate() {
            p.check().map_err(|why| wrong(format!("influence area {k}: {why}")))?;
        }
        Ok(list)
    }

    fn check(&self) -> Result<(), String> {
        let is_length = |x: f64| x > 0.0 && x.is_finite();
        let angles = [self.fov_x_degrees, self.fov_y_degrees];
        if !self.origin.iter().chain(&self.direction).all(|x| x.is_finite()) || self.direction == [0.0; 3] {
            return Err("origin and direction must be finite, and the direction not zero".into());
        }
        if !is_length(self.far) || !(0.0..self.far).contains(&self.near) {
            return Err("far must be a length, and near between 0 and far".into());
        }
        match self.kind {
            PlacementKind::Plane if !is_length(self.half_width) || !is_length(self.half_height) => {
                Err("a plane needs half_width and half_height above 0".into())
            }
            PlacementKind::Point if !angles.iter().all(|a| (0.0..179.0).contains(a) && *a > 0.0) => {
                Err("a point needs fov_x_degrees and fov_y_degrees between 0 and 179".into())
            }
            _ => Ok(()),
        }
    }

    fn view(&self, origin: DVec3) -> View {
        let tangents = DVec2::new(self.fov_x_degrees, self.fov_y_degrees).map(|a| (a.to_radians() * 0.5).tan());
        View::new(DVec3::from(self.origin) - origin, self.direction.into(), tangents)
    }

    /// The area, relative to `origin`.
    pub fn area(&self, origin: DVec3) -> InfluenceArea {
        let name = format!("{} {}", self.scene, self.orientation).trim().to_owned();
        match self.kind {
            PlacementKind::Plane => {
                let (from, axes) = (DVec3::from(self.origin) - origin, frame(self.direction.into()));
                let half = DVec2::new(self.half_width, self.half_height);
                let region = Region::oriented_box(from, axes, half, self.far);
                InfluenceArea::new(name, region, RayDistribution::Parallel(axes[2]))
            }
            PlacementKind::Point => {
                let view = self.view(origin);
                InfluenceArea::new(name, Region::frustum(&view, self.near, self.far), RayDistribution::View(view))
            }
        }
    }

    /// Rays of the area, relative to `origin`, from its near face onwards without end: `at` are
    /// their positions on it, in [0, 1).
    pub fn rays_through(&self, origin: DVec3, at: impl Iterator<Item = [f64; 2]>) -> Vec<LabRay> {
        let ray = |u: [f64; 2]| {
            let at = DVec2::from(u) * 2.0 - 1.0;
            match self.kind {
                PlacementKind::Plane => {
                    let [right, up, forward] = frame(self.direction.into());
                    let start = right * (at.x * self.half_width) + up * (at.y * self.half_height);
                    LabRay::new(DVec3::from(self.origin) - origin + start, forward, 0.0, f64::INFINITY)
                }
                PlacementKind::Point => {
                    let v = self.view(origin);
                    let direction = v.forward + v.right * (at.x * v.tangents.x) + v.up * (at.y * v.tangents.y);
                    LabRay::new(v.eye + direction * self.near, direction.normalize(), 0.0, f64::INFINITY)
                }
            }
        };
        at.map(ray).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners() -> [DVec3; 8] {
        std::array::from_fn(|k| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { -5.0 } else { 5.0 })))
    }

    fn grid(n: usize) -> impl Iterator<Item = [f64; 2]> {
        (0..n * n).map(move |k| [(k % n) as f64 / n as f64, (k / n) as f64 / n as f64])
    }

    fn placement(kind: PlacementKind) -> Placement {
        let text = r#"{"kind": "plane", "origin": [1, 2, 3], "direction": [-1, -0.3, 0.4], "half_width": 1.5,
            "half_height": 0.9, "fov_x_degrees": 70, "fov_y_degrees": 50, "near": 0.5, "far": 10}"#;
        Placement { kind, ..serde_json::from_str(text).unwrap() }
    }

    #[test]
    fn rays_of_a_placement_are_affine_to_its_area() {
        for kind in [PlacementKind::Plane, PlacementKind::Point] {
            let p = placement(kind);
            let area = p.area(DVec3::ZERO);
            for ray in p.rays_through(DVec3::ZERO, grid(20)) {
                assert!(area.is_affine(&ray), "{ray:?}");
                // backwards, too; not from elsewhere, and not across
                assert!(area.is_affine(&LabRay::new(ray.at(1.0), -ray.direction, 0.0, 1.0)));
                assert!(!area.is_affine(&LabRay::new(ray.at(-9.0), ray.direction, 0.0, 1.0)));
                let across = LabRay::new(ray.at(1.0), ray.direction.any_orthogonal_vector(), 0.0, 1.0);
                assert!(!area.is_affine(&across));
            }
        }
    }

    /// Fitted to its rays, an area has the same rays, and they are affine to it.
    #[test]
    fn areas_are_fitted_to_rays() {
        for kind in [PlacementKind::Plane, PlacementKind::Point] {
            let rays = placement(kind).rays_through(DVec3::ZERO, grid(10));
            let found = areas_of_rays("set", &rays, &corners());
            let [area] = &found[..] else { panic!("{} areas", found.len()) };
            assert!(rays.iter().all(|r| area.is_affine(r)));
            match (kind, area.rays) {
                (PlacementKind::Plane, RayDistribution::Parallel(d)) => {
                    assert!(d.cross(DVec3::new(-1.0, -0.3, 0.4)).length() < 1e-9);
                }
                (PlacementKind::Point, RayDistribution::View(v)) => {
                    assert!(v.eye.distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-6, "{}", v.eye);
                }
                other => panic!("{other:?}"),
            }
        }
        // to a point from all sides: six frusta, and every ray in one of them
        let towards: Vec<LabRay> = (0..600)
            .map(|k| (k as f64 * 0.37).sin_cos())
            .zip((0..600).map(|k| (k as f64 * 1.71).sin() * 3.0))
            .map(|((s, c), y)| DVec3::new(4.0 * s, y, 4.0 * c))
            .map(|from| LabRay::new(from, DVec3::ONE - from, 0.0, 1.0))
            .collect();
        let areas = areas_of_rays("light", &towards, &corners());
        assert_eq!(areas.len(), 6);
        assert!(towards.iter().all(|r| areas.iter().any(|a| a.is_affine(r))));
        // rays of no order have none
        let random: Vec<LabRay> = towards
            .iter()
            .map(|r| LabRay::new(r.origin, DVec3::new(r.direction.y, r.direction.z, r.direction.x), 0.0, 1.0))
            .collect();
        assert!(areas_of_rays("random", &random, &corners()).is_empty());
    }

    #[test]
    fn broken_lists_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("areas.json");
        let good = serde_json::to_value(placement(PlacementKind::Plane)).unwrap();
        let read = |v: serde_json::Value| {
            std::fs::write(&path, v.to_string()).unwrap();
            Placement::read_list(&path)
        };
        assert_eq!(read(serde_json::json!([good])).unwrap().len(), 1);
        for (key, value) in [
            ("direction", serde_json::json!([0, 0, 0])),
            ("far", serde_json::json!(-1)),
            ("near", serde_json::json!(11)),
            ("half_width", serde_json::json!(0)),
            ("kind", serde_json::json!("cone")),
            ("colour", serde_json::json!("red")),
        ] {
            let mut bad = good.clone();
            bad[key] = value;
            let e = read(serde_json::json!([good, bad])).unwrap_err();
            assert_eq!(e.exit_code(), 3, "{e}");
            assert!(e.to_string().contains("influence area"), "{e}");
        }
    }
}
