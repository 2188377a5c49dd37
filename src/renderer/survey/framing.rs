//! The camera of a scene that has none: chosen by what cameras would see, or named.

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::rays::view_rays;
use super::{Survey, Trace, VisibleSurface, significant};
use crate::error::{Error, Result};
use crate::renderer::settings::CameraSettings;
use crate::scene::camera::ViewHeight;
use crate::scene::open_edges::open_edges;
use crate::scene::{Camera, Geometry, Projection, Scene};
use crate::settings::choices;

choices! {
    /// Cameras that look at the whole scene, or at a room from inside. Models face +z, +y is up (glTF).
    pub enum ViewName {
        /// From +z
        Front = "front",
        /// From -z
        Back = "back",
        /// From -x, which is on the left of the view from the front
        Left = "left",
        /// From +x
        Right = "right",
        /// From above; the front is below
        Top = "top",
        /// From the front, right and above, at equal angles with all three axes
        Iso = "iso",
        /// From the place inside with the longest view
        Inside = "inside",
    }
}

impl ViewName {
    /// Direction from the scene to the camera, and up; `None` from inside.
    fn direction(self) -> Option<(DVec3, DVec3)> {
        Some(match self {
            Self::Front => (DVec3::Z, DVec3::Y),
            Self::Back => (DVec3::NEG_Z, DVec3::Y),
            Self::Left => (DVec3::NEG_X, DVec3::Y),
            Self::Right => (DVec3::X, DVec3::Y),
            Self::Top => (DVec3::Y, DVec3::NEG_Z),
            Self::Iso => (DVec3::ONE, DVec3::Y),
            Self::Inside => return None,
        })
    }
}

/// Directions, close to the horizontal, in which it is tested whether there are walls.
const PROBES: usize = 96;
/// Share of them that must see a front for a position to be in a room: objects show backs inside.
const ENCLOSED: f64 = 0.93;
/// Distance, over the scene's diagonal, that nine in ten exceed: rooms are empty, vehicles are not.
const CLEARANCE: f64 = 0.04;
/// Positions inside a room that are compared, along each axis of its floor, and their heights.
const PLACES: usize = 5;
const HEIGHTS: [f64; 2] = [0.2, 0.35];
/// Directions that are compared at each place.
const HEADINGS: usize = 12;
/// Rays of a view that is compared, along its width and height.
const VIEW: [usize; 2] = [12, 8];
/// Share of backs in a view from which on it is not from a room.
const MOST_BACKS: f64 = 0.1;
/// Share of the rays of a view that see a plane of their own, from which on it shows enough.
const ENOUGH_DETAIL: f64 = 0.25;
/// Vertical field of view inside, and outside, radians.
const INSIDE_FOV_Y: f64 = 1.05;
const OUTSIDE_FOV_Y: f64 = std::f64::consts::FRAC_PI_4;
/// Height of a view of parallel rays over that of the scene.
const FIT_MARGIN: f64 = 1.05;
/// Cameras outside that are compared: degrees from the front to the right and upwards, and how much
/// they are preferred. The first is what most models are made for; another must show clearly more.
const OUTSIDE: [([f64; 2], f64); 12] = [
    ([19.0, 16.0], 1.15),
    ([-19.0, 16.0], 1.05),
    ([19.0, 35.0], 1.05),
    ([-19.0, 35.0], 1.0),
    ([60.0, 16.0], 0.9),
    ([-60.0, 16.0], 0.9),
    ([60.0, 35.0], 0.9),
    ([-60.0, 35.0], 0.9),
    ([120.0, 20.0], 0.85),
    ([-120.0, 20.0], 0.85),
    ([161.0, 16.0], 0.85),
    ([-161.0, 35.0], 0.85),
];
/// From where chosen cameras look.
const OUTSIDE_WORDS: &str = "from outside";
const INSIDE_WORDS: &str = "from inside";
/// Above this number of points, the corners of each instance's box stand for its vertices.
const MAX_POINTS: u64 = 8_000_000;

/// A chosen camera, and its options of the command line, with numbers short enough to be typed.
#[derive(Clone, Debug, PartialEq)]
pub struct ChosenCamera {
    /// From where it looks, in words: `from outside`.
    pub words: String,
    /// Position, world space.
    pub eye: DVec3,
    /// Point in the middle of the image.
    pub target: DVec3,
    /// Up vector.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_y: f64,
    /// Height of the view in scene units, if it is one of parallel rays.
    pub height: Option<f64>,
}

impl ChosenCamera {
    /// A perspective camera with its position and direction to a ten-thousandth of the scene's
    /// diagonal: about a tenth of a pixel. It was made with `up`; `fov_y` (radians) was asked for.
    fn rounded(
        camera: &Camera,
        up: DVec3,
        fov_y: Option<f64>,
        bounds: (DVec3, DVec3),
        words: impl Into<String>,
    ) -> Self {
        let (lo, hi) = bounds;
        let (eye, forward) = (camera.camera_to_world.translation, -camera.camera_to_world.matrix3.z_axis);
        let diagonal = (hi - lo).length();
        let distance = distance_ahead(camera, bounds);
        let angle = match camera.projection {
            Projection::Perspective { fov_y } => fov_y.to_degrees(),
            Projection::Orthographic { .. } => OUTSIDE_FOV_Y.to_degrees(),
        };
        let digits = if fov_y.is_some() { 12 } else { 4 };
        Self {
            words: words.into(),
            eye: rounded(eye, diagonal),
            target: rounded(eye + forward * distance, diagonal),
            up,
            fov_y: significant(angle, digits),
            height: None,
        }
    }

    /// The same camera with parallel rays. `aspect` is width / height of the image.
    ///
    /// # Errors
    /// [`Error::Scene`] for a scene without geometry.
    pub fn orthographic(mut self, height: ViewHeight, survey: &Survey, aspect: f64) -> Result<Self> {
        self.height = Some(match height {
            ViewHeight::Units(height) => height,
            ViewHeight::Fit => {
                let (lo, hi) = survey.bounds()?;
                let camera = Self { height: None, ..self.clone() }.camera();
                let is_inside = self.eye.cmpge(lo).all() && self.eye.cmple(hi).all();
                let half = if is_inside {
                    camera.half_height_at(self.target.distance(self.eye))
                } else {
                    // what parallel rays see has another middle
                    let [low, high] = extent(&camera, &hull(survey.scene));
                    let m = camera.camera_to_world.matrix3;
                    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
                    let shift = m.x_axis * middle.x + m.y_axis * middle.y;
                    let size = (hi - lo).length();
                    (self.eye, self.target) = (rounded(self.eye + shift, size), rounded(self.target + shift, size));
                    FIT_MARGIN * half.y.max(half.x / aspect)
                };
                significant(2.0 * half, 4)
            }
        });
        Ok(self)
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        let camera = Camera::look_at(self.eye, self.target, self.up, self.fov_y.to_radians());
        match self.height {
            Some(height) => Camera { projection: Projection::Orthographic { half_height: 0.5 * height }, ..camera },
            None => camera,
        }
    }

    /// The settings that choose it.
    pub fn settings(&self) -> CameraSettings {
        CameraSettings {
            eye: Some(self.eye),
            target: Some(self.target),
            up: Some(self.up).filter(|up| *up != DVec3::Y),
            fov_y: Some(self.fov_y).filter(|_| self.height.is_none()),
            orthographic: self.height.map(ViewHeight::Units),
            ..CameraSettings::default()
        }
    }
}

/// Distance along the view of a camera to a point near the middle of a scene with these bounds, far
/// enough ahead to survive rounding.
pub(in crate::renderer) fn distance_ahead(camera: &Camera, (lo, hi): (DVec3, DVec3)) -> f64 {
    let (eye, forward) = (camera.camera_to_world.translation, -camera.camera_to_world.matrix3.z_axis);
    let distance = ((lo + hi) * 0.5 - eye).dot(forward).max(0.5 * (hi - lo).length());
    if distance > 0.0 { distance } else { 1.0 }
}

/// Lower left and upper right corner of what parallel rays show of some spheres, to the right and
/// up from the camera, scene units.
fn extent(camera: &Camera, spheres: &[(DVec3, f64)]) -> [DVec2; 2] {
    let to_camera = camera.camera_to_world.inverse();
    let of = |&(centre, radius): &(DVec3, f64)| {
        let p = to_camera.transform_point3(centre).truncate();
        [p - radius, p + radius]
    };
    let none = || [DVec2::INFINITY, DVec2::NEG_INFINITY];
    spheres.par_iter().map(of).reduce(none, |a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// A point with as many decimals as tell a ten-thousandth of this size, or more.
pub(in crate::renderer) fn rounded(point: DVec3, size: f64) -> DVec3 {
    if !(size > 0.0 && size.is_finite()) {
        return point;
    }
    let decimals = 4 - size.log10().floor() as i32;
    let step = 10f64.powi(-decimals);
    let round = |x: f64| match usize::try_from(decimals) {
        // the number that is nearest to what is printed
        Ok(decimals) => format!("{x:.decimals$}").parse().unwrap_or(x) + 0.0,
        Err(_) => (x / step).round() * step + 0.0,
    };
    DVec3::from_array(point.to_array().map(round))
}

/// Chooses a camera for images of `aspect` = width / height, with this vertical field of view in
/// radians, if one is given.
///
/// It is inside if from the middle of the scene nearly all horizontal directions show fronts, none
/// of them close: at the position and direction with the longest view that shows more than bare
/// walls. Else the camera sees the whole scene, from the side that shows most fronts and most
/// directions of surfaces, and so do hollow bodies with fronts outside, like bottles.
///
/// # Errors
/// Those of `trace`; [`Error::Scene`] for a scene without geometry.
pub fn choose(scene: &Scene, aspect: f64, fov_y: Option<f64>, trace: &Trace) -> Result<ChosenCamera> {
    let bounds = scene.bounds().ok_or_else(no_geometry)?;
    let chosen = |camera: &Camera, words: &str| ChosenCamera::rounded(camera, DVec3::Y, fov_y, bounds, words);
    let (is_room, is_body) = (is_room(bounds, trace)?, is_body(scene));
    if !is_room || is_body {
        let (outside, score) = outside(scene, aspect, fov_y, trace)?;
        // a sheet may show its back to all sides, and a body that winds the wrong way does
        let has_no_inside = is_flat(bounds) || is_body && !is_room;
        if score >= 0.0 || has_no_inside {
            return Ok(chosen(&outside, OUTSIDE_WORDS));
        }
        // from all sides it shows backs more than fronts: walls that face what is between them
        let (inside, score) = inside(bounds, aspect, fov_y, trace)?;
        return Ok(if score > 0.0 { chosen(&inside, INSIDE_WORDS) } else { chosen(&outside, OUTSIDE_WORDS) });
    }
    Ok(chosen(&inside(bounds, aspect, fov_y, trace)?.0, INSIDE_WORDS))
}

/// The camera with this name, for images of `aspect` = width / height.
///
/// # Errors
/// [`Error::Scene`] for a scene without geometry, or too large to be looked at from inside.
pub fn named(survey: &Survey, name: ViewName, aspect: f64, fov_y: Option<f64>) -> Result<ChosenCamera> {
    let bounds = survey.bounds()?;
    let camera = match name.direction() {
        Some((from, up)) => enclosing(survey.scene, from, up, aspect, fov_y)?,
        None if !survey.is_small() => {
            return Err(Error::Scene(
                "--view inside: the scene has too many triangles to look for a place; give --eye and --target".into(),
            ));
        }
        None => inside(bounds, aspect, fov_y, &|rays| survey.trace(rays))?.0,
    };
    let up = name.direction().map_or(DVec3::Y, |(_, up)| up);
    Ok(ChosenCamera::rounded(&camera, up, fov_y, bounds, format!("as --view {name} has it")))
}

/// The camera of a scene that has none, as [`choose`] finds it by rays that are traced on the host.
///
/// # Errors
/// [`Error::Scene`] for a scene without geometry.
pub fn choose_on_host(survey: &Survey, aspect: f64, fov_y: Option<f64>) -> Result<ChosenCamera> {
    if survey.is_small() {
        return choose(survey.scene, aspect, fov_y, &|rays| survey.trace(rays));
    }
    let (from, _) = OUTSIDE[0];
    let camera = enclosing(survey.scene, direction(from), DVec3::Y, aspect, fov_y)?;
    Ok(ChosenCamera::rounded(&camera, DVec3::Y, fov_y, survey.bounds()?, OUTSIDE_WORDS))
}

fn no_geometry() -> Error {
    Error::Scene("the scene has no geometry to render".into())
}

/// Direction of degrees from the front to the right and upwards.
fn direction([azimuth, elevation]: [f64; 2]) -> DVec3 {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.to_radians().sin_cos(), elevation.to_radians().sin_cos());
    DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e)
}

/// A camera that sees the whole scene, as large as fits.
fn enclosing(scene: &Scene, from: DVec3, up: DVec3, aspect: f64, fov_y: Option<f64>) -> Result<Camera> {
    Camera::enclosing(&hull(scene), from, up, fov_y.unwrap_or(OUTSIDE_FOV_Y), aspect).ok_or_else(no_geometry)
}

/// Spheres that a camera has to hold: vertices and spheres in world space.
fn hull(scene: &Scene) -> Vec<(DVec3, f64)> {
    let count = |i: &crate::scene::Instance| match &scene.meshes[i.mesh].geometry {
        Geometry::Triangles(t) => t.positions.len() as u64,
        Geometry::Spheres(s) => s.len() as u64,
    };
    let standing = scene.standing();
    let exact = standing.iter().map(count).sum::<u64>() <= MAX_POINTS;
    standing
        .par_iter()
        .flat_map_iter(|instance| -> Vec<(DVec3, f64)> {
            let to_world = &instance.object_to_world;
            let place = |p: DVec3| to_world.transform_point3(p);
            let geometry = &scene.meshes[instance.mesh].geometry;
            if exact {
                let m = &to_world.matrix3;
                let scale = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
                let point = |p: glam::Vec4| (place(p.truncate().as_dvec3()), scale * f64::from(p.w));
                return geometry.points().into_iter().map(point).collect();
            }
            geometry.bounds().map_or_else(Vec::new, |(lo, hi)| {
                let corner = |k: u32| DVec3::from_array([0, 1, 2].map(|a| if k >> a & 1 == 0 { lo[a] } else { hi[a] }));
                (0..8).map(|k| (place(corner(k)), 0.0)).collect()
            })
        })
        .collect()
}

fn is_flat((lo, hi): (DVec3, DVec3)) -> bool {
    (hi - lo).min_element() <= 0.0
}

/// Whether the middle of a scene is in a room.
fn is_room((lo, hi): (DVec3, DVec3), trace: &Trace) -> Result<bool> {
    if is_flat((lo, hi)) {
        return Ok(false);
    }
    let extent = hi - lo;
    for height in HEIGHTS {
        let distances = distances(lo + extent * DVec3::new(0.5, height, 0.5), trace)?;
        let is_room = distances.len() as f64 >= ENCLOSED * PROBES as f64
            && distances[distances.len() / 10] >= CLEARANCE * extent.length();
        if !is_room {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Whether the scene is one closed mesh. Rooms are made of several, or of sheets that face inwards.
fn is_body(scene: &Scene) -> bool {
    let [instance] = scene.standing() else { return false };
    match &scene.meshes[instance.mesh].geometry {
        Geometry::Triangles(mesh) => open_edges(mesh) == 0,
        Geometry::Spheres(_) => false,
    }
}

/// The surfaces that the rays of views hit.
fn trace_views(cameras: &[Camera], aspect: f64, trace: &Trace) -> Result<Vec<Vec<Option<VisibleSurface>>>> {
    let rays: Vec<(DVec3, DVec3)> = cameras.iter().flat_map(|c| view_rays(c, aspect, VIEW)).collect();
    Ok(trace(&rays)?.chunks_exact(VIEW[0] * VIEW[1]).map(<[_]>::to_vec).collect())
}

/// Number of planes that a view sees over its rays: a corridor has few, a furnished room many.
/// Planes count as one whose normals and positions, in fiftieths of `size`, are nearly the same.
fn detail(rays: &[(DVec3, DVec3)], seen: &[Option<VisibleSurface>], size: f64) -> f64 {
    let plane = |((from, along), s): (&(DVec3, DVec3), &Option<VisibleSurface>)| {
        s.as_ref().map(|s| {
            let at = s.normal.dot(*from + *along * s.distance);
            ((s.normal * 3.0).round().as_ivec3(), (50.0 * at / size).round() as i64)
        })
    };
    let planes: std::collections::HashSet<_> = rays.iter().zip(seen).filter_map(plane).collect();
    planes.len() as f64 / rays.len() as f64
}

/// The camera with the highest score, and the score; of equal ones the first.
fn choose_best(cameras: Vec<Camera>, scores: impl Iterator<Item = f64>) -> Result<(Camera, f64)> {
    let best = scores.enumerate().reduce(|a, b| if b.1 > a.1 { b } else { a });
    best.and_then(|(k, score)| Some((cameras.into_iter().nth(k)?, score))).ok_or_else(no_geometry)
}

/// The camera inside with the longest view, if it shows enough.
fn inside((lo, hi): (DVec3, DVec3), aspect: f64, fov_y: Option<f64>, trace: &Trace) -> Result<(Camera, f64)> {
    let extent = hi - lo;
    let along = |k: usize| (k as f64 + 1.0) / (PLACES as f64 + 1.0);
    let mut cameras = Vec::new();
    for (place, height) in (0..PLACES * PLACES).flat_map(|p| HEIGHTS.map(|h| (p, h))) {
        let eye = lo + extent * DVec3::new(along(place % PLACES), height, along(place / PLACES));
        for heading in 0..HEADINGS {
            let angle = TAU * heading as f64 / HEADINGS as f64;
            let forward = DVec3::new(angle.sin(), 0.05, -angle.cos());
            cameras.push(Camera::look_at(eye, eye + forward, DVec3::Y, fov_y.unwrap_or(INSIDE_FOV_Y)));
        }
    }
    let size = extent.length();
    let score = |(camera, seen): (&Camera, Vec<Option<VisibleSurface>>)| {
        // from within a body backs are seen; those of curtains and leaves are few
        let fronts = seen.iter().flatten().filter(|s| s.is_front).count() as f64;
        let backs = seen.iter().flatten().filter(|s| !s.is_front).count() as f64;
        let flaws = backs / (fronts + backs).max(1.0) / MOST_BACKS;
        if flaws >= 1.0 {
            return 0.0;
        }
        let distances: Vec<f64> = seen.iter().flatten().map(|s| s.distance / size).collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        // long views of much, with nothing right before the camera; the sky is no view
        let sum: f64 = distances.iter().map(|d| d.sqrt()).sum();
        let shown = (detail(&view_rays(camera, aspect, VIEW), &seen, size) / ENOUGH_DETAIL).min(1.0);
        let sum = (1.0 - flaws) * shown * sum;
        if nearest < 0.02 { 0.2 * sum } else { sum }
    };
    let scores: Vec<f64> = cameras.iter().zip(trace_views(&cameras, aspect, trace)?).map(score).collect();
    choose_best(cameras, scores.into_iter())
}

/// The camera outside that shows most.
fn outside(scene: &Scene, aspect: f64, fov_y: Option<f64>, trace: &Trace) -> Result<(Camera, f64)> {
    let hull = hull(scene);
    let fov_y = fov_y.unwrap_or(OUTSIDE_FOV_Y);
    let camera = |(from, _): &([f64; 2], f64)| Camera::enclosing(&hull, direction(*from), DVec3::Y, fov_y, aspect);
    let cameras: Vec<Camera> = OUTSIDE.par_iter().filter_map(camera).collect();
    let score = |seen: Vec<Option<VisibleSurface>>, preference: f64| {
        let fronts = seen.iter().flatten().filter(|s| s.is_front).count() as f64;
        let backs = seen.iter().flatten().filter(|s| !s.is_front).count() as f64;
        let mean = seen.iter().flatten().map(|s| s.normal).sum::<DVec3>() / (fronts + backs).max(1.0);
        // a wall seen head on has one normal, of length 1; three sides of a box have a mean of 0.58
        let variety = 1.0 - mean.length();
        preference * (fronts - backs) / (fronts + backs).max(1.0) * (0.5 + variety)
    };
    let preferences = OUTSIDE.iter().map(|o| o.1);
    let scores = trace_views(&cameras, aspect, trace)?
        .into_iter()
        .zip(preferences)
        .map(|(seen, preference)| score(seen, preference));
    choose_best(cameras, scores)
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
    use glam::DAffine3;

    use super::*;
    use crate::renderer::RenderSettings;
    use crate::scene::builtin::{self, shapes};
    use crate::scene::{Instance, Material, Mesh};

    const BOUNDS: (DVec3, DVec3) = (DVec3::new(-4.0, 0.0, -2.0), DVec3::new(4.0, 3.0, 2.0));

    /// A scene of these bounds: a floor and a ceiling.
    fn scene() -> Scene {
        let (lo, hi) = BOUNDS;
        let (middle, size) = ((lo + hi) * 0.5, hi - lo);
        let at = |y: f64| shapes::rectangle(DVec3::new(middle.x, y, middle.z), DVec3::X * size.x, DVec3::Z * size.z);
        let mesh = |y| Mesh { name: String::new(), geometry: at(y), material: 0, source: None };
        let instance = |mesh| Instance { name: String::new(), mesh, object_to_world: DAffine3::IDENTITY };
        Scene {
            materials: vec![Material::default()],
            meshes: vec![mesh(lo.y), mesh(hi.y)],
            instances: vec![instance(0), instance(1)],
            ..Scene::default()
        }
    }

    fn chosen(trace: &Trace) -> Camera {
        choose(&scene(), 1.5, None, trace).unwrap().camera()
    }

    fn hit(distance: f64) -> Option<VisibleSurface> {
        Some(VisibleSurface { distance, is_front: true, normal: DVec3::Y, material: 0 })
    }

    /// Rays inside a box end on its sides, but for those that `open` lets pass.
    fn inside(rays: &[(DVec3, DVec3)], open: impl Fn(DVec3) -> bool) -> Result<Vec<Option<VisibleSurface>>> {
        let (lo, hi) = BOUNDS;
        let is_inside = |p: DVec3| p.cmpge(lo).all() && p.cmple(hi).all();
        let distance =
            |(from, d): &(DVec3, DVec3)| ((DVec3::select(d.cmpgt(DVec3::ZERO), hi, lo) - *from) / *d).min_element();
        Ok(rays.iter().map(|ray| if is_inside(ray.0) && !open(ray.1) { hit(distance(ray)) } else { None }).collect())
    }

    fn is_inside(camera: &Camera) -> bool {
        let eye = camera.camera_to_world.translation;
        eye.cmpgt(BOUNDS.0).all() && eye.cmplt(BOUNDS.1).all()
    }

    #[test]
    fn rooms_are_seen_from_inside() {
        let camera = chosen(&|rays| inside(rays, |_| false));
        // along the room, from its end
        let forward = -camera.camera_to_world.matrix3.z_axis;
        assert!(is_inside(&camera) && forward.x.abs() > 0.8, "{camera:?}");
        // a courtyard is open above
        assert!(is_inside(&chosen(&|rays| inside(rays, |d| d.y > 0.5))));
    }

    /// The view from above is as high as the scene, or wide enough for it.
    #[test]
    fn parallel_rays_hold_the_scene() {
        let scene = scene();
        let survey = Survey::new(&scene);
        for aspect in [0.5, 1.0, 2.0, 4.0] {
            let settings =
                CameraSettings { view: Some(ViewName::Top), orthographic: Some(ViewHeight::Fit), ..Default::default() };
            let chosen = settings.automatic(&survey, aspect).unwrap().unwrap();
            let size = BOUNDS.1 - BOUNDS.0;
            let needed = size.z.max(size.x / aspect);
            assert!((chosen.height.unwrap() / (FIT_MARGIN * needed) - 1.0).abs() < 1e-3, "{aspect}: {chosen:?}");
            let camera = settings.choose(&survey, aspect).unwrap();
            assert_eq!(chosen.settings().choose(&survey, aspect).unwrap(), camera);
            assert!(matches!(camera.projection, Projection::Orthographic { .. }));
        }
        let of = |height| CameraSettings {
            eye: Some(DVec3::new(0.0, 1.0, 9.0)),
            target: Some(DVec3::Y),
            orthographic: Some(height),
            ..Default::default()
        };
        let half = |settings: CameraSettings| settings.choose(&survey, 1.5).unwrap().half_height_at(1.0);
        assert_eq!(half(of(ViewHeight::Units(5.0))), 2.5);
        assert!((half(of(ViewHeight::Fit)) - 9.0 * 22.5f64.to_radians().tan()).abs() < 1e-9);
        let both = CameraSettings { fov_y: Some(30.0), ..of(ViewHeight::Fit) };
        assert!(both.check().unwrap_err().to_string().contains("--fov-y"));
    }

    #[test]
    fn bare_walls_show_little() {
        let rays = view_rays(&Camera::look_at(DVec3::ZERO, DVec3::X, DVec3::Y, 1.0), 1.0, VIEW);
        let wall = vec![hit(2.0); rays.len()];
        // planes across the view, each at a distance of its own
        let steps: Vec<_> = (0..rays.len())
            .map(|k| hit(2.0 + k as f64))
            .map(|s| s.map(|s| VisibleSurface { normal: DVec3::X, ..s }))
            .collect();
        let flat: Vec<_> = rays.iter().map(|(_, d)| hit(-1.6 / d.y)).collect();
        let of = |seen: &[Option<VisibleSurface>]| detail(&rays, seen, 100.0);
        assert_eq!(of(&flat), 1.0 / rays.len() as f64, "a floor is one plane");
        assert!(of(&wall) < 0.1 && of(&steps) > 2.0 * of(&wall), "{} {}", of(&wall), of(&steps));
        assert_eq!(of(&vec![None; rays.len()]), 0.0);
    }

    #[test]
    fn scenes_are_looked_at_by_the_host() {
        for (name, inside) in [
            ("closed-box", true),
            ("stairs", false),
            ("cornell-box", false),
            ("terrain:2000", false),
            ("spheres:50", false),
        ] {
            let mut scene = builtin::by_name(name).unwrap();
            if let (true, Geometry::Triangles(mesh)) = (inside, &mut scene.meshes[0].geometry) {
                // walls that face the room
                mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let (lo, hi) = scene.bounds().unwrap();
            let eye = choose_on_host(&Survey::new(&scene), 1.5, None).unwrap().camera().camera_to_world.translation;
            assert_eq!(eye.cmpgt(lo).all() && eye.cmplt(hi).all(), inside, "{name}: {eye}");
        }
    }

    /// A box in a box, one mesh whose inner side faces what is between its walls.
    #[test]
    fn hollow_bodies_are_seen_from_outside() {
        let mut scene = builtin::by_name("closed-box").unwrap();
        let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry else { panic!("no triangles") };
        let count = mesh.positions.len() as u32;
        let middle = mesh.positions.iter().sum::<glam::Vec3>() / count as f32;
        let inner: Vec<glam::Vec3> = mesh.positions.iter().map(|p| middle + (*p - middle) * 0.9).collect();
        mesh.positions.extend(inner);
        let turned: Vec<[u32; 3]> = mesh.indices.iter().map(|&[a, b, c]| [a, c, b].map(|k| k + count)).collect();
        mesh.indices.extend(turned);
        mesh.normals.clear();
        mesh.texcoords.iter_mut().for_each(|t| t.clear());
        let (lo, hi) = scene.bounds().unwrap();
        let eye = |scene: &Scene| {
            choose_on_host(&Survey::new(scene), 1.5, None).unwrap().camera().camera_to_world.translation
        };
        let is_inside = |p: DVec3| p.cmpgt(lo).all() && p.cmplt(hi).all();
        assert!(!is_inside(eye(&scene)));
        // as two meshes it is a room with thick walls
        let mut walls = scene.clone();
        let Geometry::Triangles(mesh) = &mut walls.meshes[0].geometry else { panic!("no triangles") };
        let inside = mesh.indices.split_off(mesh.indices.len() / 2);
        let mut second = walls.meshes[0].clone();
        let Geometry::Triangles(mesh) = &mut second.geometry else { panic!("no triangles") };
        mesh.indices = inside;
        walls.meshes.push(second);
        walls.instances.push(Instance { mesh: 1, ..walls.instances[0].clone() });
        assert!(is_inside(eye(&walls)));
    }

    /// A solid body that winds the wrong way, and a floor that faces down.
    #[test]
    fn backs_alone_are_seen_from_outside() {
        let mut rod = builtin::by_name("closed-box").unwrap();
        let to_rod = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.02));
        rod.instances[0].object_to_world = to_rod * rod.instances[0].object_to_world;
        let mut floor = scene();
        floor.meshes.truncate(1);
        floor.instances.truncate(1);
        floor.meshes[0].geometry = shapes::rectangle(DVec3::ZERO, DVec3::Z * 2.0, DVec3::X * 2.0);
        for up in [false, true] {
            for scene in [&mut rod, &mut floor] {
                let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry else { panic!("no triangles") };
                mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
                let chosen = choose_on_host(&Survey::new(scene), 1.5, None).unwrap();
                assert!(chosen.words.contains("outside"), "{up}: {}", chosen.words);
            }
        }
    }

    #[test]
    fn objects_and_open_boxes_are_seen_from_outside() {
        // one side is missing
        assert!(!is_inside(&chosen(&|rays| inside(rays, |d| d.z > d.x.abs()))));
        // a solid object around the middle, seen from inside
        let back = |rays: &[(DVec3, DVec3)]| {
            Ok(vec![Some(VisibleSurface { distance: 2.0, is_front: false, normal: DVec3::Y, material: 0 }); rays.len()])
        };
        assert!(!is_inside(&chosen(&back)));
        // something close around it
        assert!(!is_inside(&chosen(&|rays| Ok(vec![hit(0.1); rays.len()]))));
        assert!(!is_inside(&chosen(&|rays| Ok(vec![None; rays.len()]))));
    }

    #[test]
    fn the_side_that_shows_fronts_is_chosen() {
        // a wall whose front is at -x, and a floor
        let wall = shapes::rectangle(DVec3::new(0.0, 0.0, -1.0), DVec3::Z * 2.0, DVec3::Y * 2.0);
        for (flip, left) in [(false, true), (true, false)] {
            let mut scene = scene();
            scene.meshes.truncate(1);
            scene.instances.truncate(1);
            scene.meshes[0].geometry = wall.clone();
            let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry else { panic!("it has triangles") };
            if flip {
                mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
            }
            let camera = choose_on_host(&Survey::new(&scene), 1.0, None).unwrap().camera();
            assert_eq!(camera.camera_to_world.translation.x < 0.0, left, "{camera:?}");
        }
    }

    #[test]
    fn chosen_numbers_can_be_typed() {
        // whatever the size of a scene, and wherever it is
        for (size, at, digits) in [(1.0, 0.0, 6), (2e-3, 0.0, 9), (3e5, 0.0, 6), (1.0, 4.5e6, 13), (7e7, -1e9, 11)] {
            let point = rounded(DVec3::splat(at + size * 0.123_456_789), size);
            assert!((point.x - at - size * 0.123_456_789).abs() <= 1e-4 * size, "{size} {at}: {point}");
            assert!(point.x.to_string().trim_start_matches('-').len() <= digits + 1, "{size} {at}: {}", point.x);
        }
        assert_eq!(rounded(DVec3::splat(0.1), 0.0), DVec3::splat(0.1));
        assert!(rounded(DVec3::splat(-1e-9), 1.0).x.is_sign_positive());
    }

    #[test]
    fn names_are_directions() {
        let mut scene = builtin::by_name("stairs").unwrap();
        scene.cameras.clear();
        let survey = Survey::new(&scene);
        let eye = |name| {
            let chosen = named(&survey, name, 1.5, None).unwrap();
            assert!(chosen.words.contains(name.name()));
            // what is printed is the camera
            let typed = RenderSettings { camera: chosen.settings(), ..Default::default() };
            assert_eq!(typed.camera.choose(&survey, 1.5).unwrap(), chosen.camera());
            chosen.camera().camera_to_world.translation
        };
        let (lo, hi) = survey.bounds().unwrap();
        use ViewName::{Back, Front, Inside, Iso, Left, Right, Top};
        assert!(
            eye(Front).z > hi.z && eye(Back).z < lo.z && eye(Left).x < lo.x && eye(Right).x > hi.x && eye(Top).y > hi.y
        );
        assert!(eye(Iso).cmpgt((lo + hi) * 0.5).all());
        let inside = eye(Inside);
        assert!(inside.cmpgt(lo).all() && inside.cmplt(hi).all());
        // a narrow field of view sees the same from farther away
        let far = named(&survey, Front, 1.5, Some(0.1)).unwrap().camera().camera_to_world.translation;
        assert!(far.z > 3.0 * eye(Front).z);
    }
}
