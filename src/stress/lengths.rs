//! Walls and boxes up to ten million times as long as what is near them. Their faces stand on one
//! another without common vertices, as in files of cities, roads and buildings. Edge functions and
//! distances round in proportion to the far corners, while the near part is seen.

use glam::{DQuat, DVec3};

use super::closed_forms::{self, Case, on_plane, options};
use super::degenerate::{random, ray, scene_of};
use super::{Check, Section, Setup, StressSession, Watch};
use crate::error::Result;
use crate::integrators::rays::{Mode, trace};
use crate::oracle::closed_form::polygon_form_factor;
use crate::ray::Ray;
use crate::scene::builtin::shapes;
use crate::scene::{Camera, Geometry, Scene, TriangleMesh};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "lengths",
    title: "Lengths of different orders",
    about: "walls, floors and boxes 10 to 1e7 times as long as what is near them, with faces that stand on one another without common vertices",
    of_scene: false,
    run,
};

/// Lengths over the distance of what sees them.
const LENGTHS: [f64; 7] = [1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
/// Height of [`Kerb`] over the distance of the point that sees it.
const HEIGHT: f64 = 15.0;

/// A square floor and a wall of its length, seen from a point at distance 1 from the wall.
pub struct Kerb {
    /// The scene; its vertices are where single precision puts them.
    pub scene: Scene,
    camera: Camera,
    point: DVec3,
    normal: DVec3,
    wall: [[DVec3; 3]; 2],
}

impl Kerb {
    /// `along`: the place along the wall, from -1 to 1; `turn`: a rotation of vertices and camera.
    pub fn new(length: f64, along: f64, turn: DQuat) -> Self {
        let half = 0.5 * length;
        let floor = shapes::floor(DVec3::ZERO, length);
        let wall = shapes::rectangle(DVec3::Y * (0.5 * HEIGHT), DVec3::X * length, DVec3::Y * HEIGHT);
        let turned = |geometry: Geometry| turned(geometry, turn);
        let (floor, wall) = (turned(floor), turned(wall));
        let corners = triangles(&wall);
        let scene = scene_of([floor, wall].map(|g| (g, vec![glam::DAffine3::IDENTITY])).into());
        let point = turn * DVec3::new(along * half, 0.0, 1.0);
        // over the floor, looking down on a patch that is small beside the distance of the wall
        let camera =
            Camera::look_at(point + turn * DVec3::new(0.0, 7.5, 0.0), point, turn * DVec3::NEG_Z, 6f64.to_radians());
        Self { scene, camera, point, normal: turn * DVec3::Y, wall: [corners[0], corners[1]] }
    }

    /// Ambient visibility of a point of the floor.
    pub fn visibility(&self, point: DVec3) -> f64 {
        1.0 - self.wall.iter().map(|t| polygon_form_factor(point, self.normal, t)).sum::<f64>()
    }

    /// The image's bias.
    pub fn bias(&self, tracer: &Tracer, spp: u32, watch: &mut dyn crate::film::Control) -> Result<closed_forms::Bias> {
        let case = Case {
            what: "kerb",
            scene: &self.scene,
            camera: self.camera.clone(),
            options: options(16, spp, 1.0, f64::INFINITY),
            surface: &|ray| on_plane(ray, self.point, self.normal),
            expected: &|p| self.visibility(p),
        };
        case.bias(tracer, &case.expectations(), watch)
    }

    /// Rays from over the floor to the near part of the wall, and where they meet it.
    pub fn rays(&self, count: u32) -> Vec<(Ray, DVec3)> {
        let [a, b, c] = self.wall[0];
        let (right, up) = ((b - a).normalize(), (c - b).normalize());
        let normal = right.cross(up);
        // the near point of the wall's foot
        let foot = a + right * (self.point - a).dot(right);
        let origin = (foot + normal + up).as_vec3().as_dvec3();
        (0..count)
            .map(|i| {
                let target = foot + right * (random(i, 0) - 0.5) * 8.0 + up * (0.1 + 0.8 * random(i, 1)) * HEIGHT;
                let ray = ray(origin, (target - origin).normalize());
                let direction = DVec3::from_array(ray.direction.map(f64::from));
                // of the first triangle's plane, or the second's: rounded vertices have two
                let meet = |t: &[DVec3; 3]| {
                    let normal = (t[1] - t[0]).cross(t[2] - t[0]);
                    origin + direction * ((t[0] - origin).dot(normal) / direction.dot(normal))
                };
                let is_inside = |t: &[DVec3; 3], p: DVec3| {
                    let normal = (t[1] - t[0]).cross(t[2] - t[0]);
                    (0..3).all(|k| (t[(k + 1) % 3] - t[k]).cross(p - t[k]).dot(normal) >= 0.0)
                };
                let hit = self.wall.iter().map(|t| (t, meet(t))).find(|(t, p)| is_inside(t, *p)).map(|(_, p)| p);
                (ray, hit.unwrap_or_else(|| meet(&self.wall[0])))
            })
            .collect()
    }

    /// Largest errors of the distance and of the point between corners at the near part of the
    /// wall, in shares of the distance; misses count 1.
    pub fn errors(&self, tracer: &Tracer, count: u32, watch: &mut dyn crate::film::Control) -> Result<[f64; 2]> {
        let expected = self.rays(count);
        let rays: Vec<Ray> = expected.iter().map(|e| e.0).collect();
        let hits = trace(tracer, &rays, Mode::Closest, 1, watch)?.0;
        let mut worst = [0.0f64; 2];
        for ((ray, want), hit) in expected.iter().zip(&hits) {
            let distance = (DVec3::from_array(ray.origin.map(f64::from)) - *want).length();
            if !hit.is_hit() || hit.instance != 1 {
                return Ok([1.0; 2]);
            }
            let [a, b, c] = self.wall[hit.primitive as usize];
            let [v, w] = [hit.u, hit.v].map(f64::from);
            let point = a + (b - a) * v + (c - a) * w;
            let errors = [(f64::from(hit.t) - distance).abs() / distance, (point - *want).length() / distance];
            worst = [worst[0].max(errors[0]), worst[1].max(errors[1])];
        }
        Ok(worst)
    }
}

fn turned(geometry: Geometry, turn: DQuat) -> Geometry {
    match geometry {
        Geometry::Triangles(mut mesh) => {
            mesh.positions.iter_mut().for_each(|p| *p = (turn * p.as_dvec3()).as_vec3());
            Geometry::Triangles(mesh)
        }
        spheres @ Geometry::Spheres(_) => spheres,
    }
}

fn triangles(geometry: &Geometry) -> Vec<[DVec3; 3]> {
    match geometry {
        Geometry::Triangles(TriangleMesh { positions, indices, .. }) => {
            indices.iter().map(|t| t.map(|k| positions[k as usize].as_dvec3())).collect()
        }
        Geometry::Spheres(_) => Vec::new(),
    }
}

/// A closed box along x with a square cross-section of side 2 around the camera. `split`: long
/// sides have uneven quads, so that edges of one lie within edges of the next.
pub fn long_box(length: f64, split: bool, turn: DQuat) -> Scene {
    let half = 0.5 * length;
    let mut quads = Vec::new();
    for side in 0..4 {
        let about = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2 * f64::from(side));
        // whole numbers: a quarter of a turn moves no corner off the next side's plane
        let at = |x: f64, z: f64| {
            let p = about * DVec3::new(0.0, -1.0, z);
            DVec3::new(x, p.y.round(), p.z.round())
        };
        let cuts = if split { vec![-half, half * (0.31 + 0.1 * f64::from(side)), half] } else { vec![-half, half] };
        quads.extend(cuts.windows(2).map(|x| [at(x[0], -1.0), at(x[0], 1.0), at(x[1], 1.0), at(x[1], -1.0)]));
    }
    let cap = |x: f64| [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(x, y, z));
    quads.extend([cap(-half), cap(half)]);
    let mut scene = scene_of(vec![(turned(shapes::quads(&quads), turn), vec![glam::DAffine3::IDENTITY])]);
    let camera =
        Camera::look_at(turn * DVec3::new(0.2, 0.4, 0.3), turn * DVec3::new(0.9, -0.8, -0.5), turn * DVec3::Y, 1.2);
    scene.cameras.push(camera);
    scene
}

/// Largest relative error of the compute tracer's hits: of trace/triangle.glsl, and of a weight's
/// 24 bits.
pub fn hit_bound(length: f64) -> f64 {
    1.0 / 64.0 + 1e-7 * length
}

/// Rotations of the section, with their names.
fn turns() -> [(&'static str, DQuat); 2] {
    [("along the axes", DQuat::IDENTITY), ("turned", DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 1.1))]
}

/// Whether single precision can say where vertices at this distance are, beside lengths of 1.
fn can_turn(length: f64, turn: DQuat) -> bool {
    turn == DQuat::IDENTITY || length <= 1e4
}

/// A check whose bound counts only where it is meant for the tracer.
fn bound_if(check: Check, is_bound: bool) -> Check {
    if is_bound { check } else { Check::reported(check.name, check.value, check.unit).says(check.sentence) }
}

fn check_kerb(setup: &Setup, kind: TracerKind, name: &str, kerb: &Kerb, watch: &mut Watch) -> Result<Check> {
    let bias = kerb.bias(&setup.tracer(kind, &kerb.scene)?, setup.effort().pick(256, 4096), watch)?;
    let bound = 2e-4f64.max(4.5 * bias.standard_error + 2e-6);
    let value = if bias.uncovered > 0 || bias.pixels < 64 { f64::NAN } else { bias.bias.abs() };
    Ok(Check::at_most(name, value, "of visibility", bound)
        .says(format!("closed form {:.5}, standard error {:.1e}", bias.expected, bias.standard_error)))
}

fn check_hits(
    setup: &Setup,
    kind: TracerKind,
    name: &str,
    kerb: &Kerb,
    length: f64,
    watch: &mut Watch,
) -> Result<Check> {
    let [t, point] = kerb.errors(&setup.tracer(kind, &kerb.scene)?, 4000, watch)?;
    let check = Check::at_most(name, t.max(point), "of the distance", hit_bound(length));
    let check = check.says(format!("off: the distance by {t:.1e}, the point between the corners by {point:.1e}"));
    Ok(bound_if(check, kind == TracerKind::Compute))
}

fn run(session: &mut StressSession) -> Result<()> {
    let kinds = session.setup().tracers();
    for (k, length) in LENGTHS.into_iter().enumerate() {
        for (orientation, turn) in turns().into_iter().filter(|t| can_turn(length, t.1)) {
            let along = if k.is_multiple_of(2) { 0.0 } else { 0.37 };
            let kerb = Kerb::new(length, along, turn);
            let name = format!("a wall on a floor, length {length:e}, {orientation}");
            // beyond, rays start off the floor at a height that matters beside the wall's
            session.measure_each(&name, &kinds, |s, kind, w| {
                Ok(bound_if(check_kerb(s, kind, &name, &kerb, w)?, length <= 1e6))
            })?;
            let name = format!("hits of a wall, length {length:e}, {orientation}");
            session.measure_each(&name, &kinds, |s, kind, w| check_hits(s, kind, &name, &kerb, length, w))?;
            for (what, split) in [("box", false), ("box of uneven quads", true)] {
                let name = format!("{what} is dark, length {length:e}, {orientation}");
                let scene = long_box(length, split, turn);
                session.measure_each(&name, &kinds, |s, kind, w| {
                    let check = super::scale::check_exact(s, kind, &name, &scene, 0.0, w)?;
                    // beyond, ray origins and edges are rounded to a thousandth of the box's width
                    Ok(bound_if(check, length <= 1e3))
                })?;
            }
        }
    }
    Ok(())
}
