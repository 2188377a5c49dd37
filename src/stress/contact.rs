//! Section 4, grazing and contact: rays along surfaces, from edges and vertices, and between
//! surfaces that nearly touch; and the need for the spawn offset.

use glam::{DAffine3, DVec3};

use super::closed_forms::{self, options};
use super::degenerate::{compare_hits, parity_check, ray, scene_of, trace_oracle, triangles};
use super::{Check, Section, StressSession};
use crate::error::{Error, Result};
use crate::film::Control;
use crate::integrators::rays::{Mode, trace};
use crate::oracle::Oracle;
use crate::ray::Ray;
use crate::sampling::sobol::hash_combine;
use crate::scene::builtin::{SceneTransform, analytic, shapes};
use crate::scene::{Camera, Geometry, Scene};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "contact",
    title: "Grazing and contact",
    about: "rays at 1e-4 rad, origins on edges and vertices, surfaces 1e-6 apart; the slack of the spawn offset over scale",
    of_scene: false,
    run,
};

/// Relative distance of surfaces that nearly touch.
const GAP: f64 = 1e-6;
/// Angle of grazing rays, radians.
const GRAZING: f64 = 1e-4;

/// Rays that meet the top of [`analytic::plane`] of side 10 at 1e-4 rad.
pub fn grazing_rays(count: u32) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let unit = |k: u32| f64::from(hash_combine(i, k)) / 4_294_967_296.0;
            let turn = std::f64::consts::TAU * unit(0);
            let along = DVec3::new(turn.cos(), 0.0, turn.sin());
            let target = DVec3::new(8.0 * unit(1) - 4.0, 0.0, 8.0 * unit(2) - 4.0);
            let direction = along - DVec3::Y * GRAZING;
            ray(target - direction * (0.5 + unit(3)), direction)
        })
        .collect()
}

/// Rays outwards from vertices and edge middles of a closed convex body, which meet nothing.
pub fn rays_from_edges(oracle: &Oracle, count: usize) -> Vec<Ray> {
    let all = oracle.triangles();
    (0..count)
        .map(|i| {
            let t = &all[i * 7919 % all.len()];
            let from = if i % 2 == 0 { t.v[0] } else { (t.v[0] + t.v[1]) * 0.5 };
            let unit = |k: u32| 2.0 * f64::from(hash_combine(i as u32, k)) / 4_294_967_296.0 - 1.0;
            let aside = DVec3::new(unit(0), unit(1), unit(2));
            ray(from, from.normalize() + aside * 0.5)
        })
        .collect()
}

/// Two squares of side 2 that are `gap` apart, at heights 0 and `gap`.
pub fn sheets(gap: f64) -> Scene {
    let square = |height: f64| {
        let [a, b, c, d] = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(|[x, z]| DVec3::new(x, height, z));
        [[a, b, c], [a, c, d]]
    };
    scene_of(vec![(triangles([square(0.0), square(gap)].concat()), vec![DAffine3::IDENTITY])])
}

/// Counts rays at [`sheets`] from both sides that hit the sheet behind the nearer one.
pub fn wrong_sides(tracer: &Tracer, count: u32, control: &mut dyn Control) -> Result<usize> {
    let rays: Vec<Ray> = (0..count)
        .map(|i| {
            let unit = |k: u32| 1.8 * f64::from(hash_combine(i, k)) / 4_294_967_296.0 - 0.9;
            let target = DVec3::new(unit(0), 0.0, unit(1));
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            let from = target + DVec3::new(0.3 * unit(2), side * (1.0 + 0.5 * unit(3)), 0.3 * unit(4));
            ray(from, target - from)
        })
        .collect();
    let hits = trace(tracer, &rays, Mode::Closest, 1, control)?.0;
    let is_right = |i: usize, primitive: u32| {
        if i.is_multiple_of(2) { matches!(primitive, 2 | 3) } else { matches!(primitive, 0 | 1) }
    };
    Ok(hits.iter().enumerate().filter(|(i, h)| !is_right(*i, h.primitive)).count())
}

/// How much of the spawn offset is needed on a plane, and what it costs.
#[derive(Clone, Copy, Debug)]
pub struct Slack {
    /// Largest offset of a ray from the plane, scene units.
    pub largest: f64,
    /// The same in roundings (half units in the last place) of the largest coordinate.
    pub roundings: f64,
    /// Rays that meet the plane again with the offset as it is.
    pub self_hits: usize,
    /// Factor by which offsets could be smaller before a ray meets the plane again, or infinity.
    pub factor: f64,
}

/// Spawned rays of an image of a plane through `point` with unit normal `normal`, traced again with
/// smaller offsets by bisection. `multiply` scales the offset first.
///
/// # Errors
/// Those of rendering and tracing; [`Error::Scene`] if the image shows nothing.
pub fn slack(
    tracer: &Tracer,
    scene: &Scene,
    normal: DVec3,
    point: DVec3,
    multiply: f64,
    control: &mut dyn Control,
) -> Result<Slack> {
    let options = options(48, 1, 1.0, f64::INFINITY).with_samples(|s| s.keep_rays = true);
    let image = closed_forms::render(tracer, scene, &scene.cameras[0], &options, control)?;
    let rays = image.kept_occlusion;
    if rays.is_empty() {
        return Err(Error::Scene("no ray was spawned".into()));
    }

    // Traces them with offsets of any size.
    let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let height = |r: &Ray| (wide(r.origin) - point).dot(normal);
    let with = |factor: f64| -> Vec<Ray> {
        let moved = |r: &Ray| Ray {
            origin: (wide(r.origin) + normal * (height(r) * (factor - 1.0))).as_vec3().to_array(),
            ..*r
        };
        rays.iter().map(moved).collect()
    };
    let mut hits = |rays: &[Ray], tracer: &Tracer| -> Result<usize> {
        Ok(trace(tracer, rays, Mode::Any, 1, control)?.0.iter().filter(|h| h.is_hit()).count())
    };
    let largest = rays.iter().map(height).fold(0.0, f64::max);
    let reach = rays.iter().map(|r| wide(r.origin).abs().max_element()).fold(0.0, f64::max);
    let as_is = with(multiply);
    let self_hits = hits(&as_is, tracer)?;

    // The smallest multiple without a hit is between `bad` and `good`.
    let (mut bad, mut good) = (0.0f64, multiply);
    let mut factor = f64::INFINITY;
    if self_hits == 0 && hits(&with(0.0), tracer)? > 0 {
        for _ in 0..12 {
            let middle = 0.5 * (bad + good);
            if hits(&with(middle), tracer)? > 0 { bad = middle } else { good = middle }
        }
        factor = multiply / good;
    } else if self_hits > 0 {
        factor = 0.0;
    }
    Ok(Slack {
        largest: largest * multiply,
        roundings: largest * multiply / (reach * f64::from(f32::EPSILON) * 0.5),
        self_hits,
        factor,
    })
}

/// Planes over scale and place: name, scene, normal, and a point relative to the scene's origin.
pub fn slack_planes() -> Vec<(String, Scene, DVec3, DVec3)> {
    let mut out = Vec::new();
    for (scale, offset) in [(1e-6, 0.0), (1e-3, 0.0), (1.0, 0.0), (1e3, 0.0), (1e6, 0.0), (1.0, 1e7)] {
        for (orientation, turn) in [("flat", 0.0), ("tilted", 0.6)] {
            let place = SceneTransform { scale, offset: DVec3::splat(offset) };
            let mut scene = analytic::plane(10.0, place);
            let about = DAffine3::from_translation(place.offset)
                * DAffine3::from_rotation_z(turn)
                * DAffine3::from_rotation_x(0.7 * turn)
                * DAffine3::from_translation(-place.offset);
            scene.instances[0].object_to_world = about * scene.instances[0].object_to_world;
            scene.cameras[0].camera_to_world = about * scene.cameras[0].camera_to_world;
            let normal = about.transform_vector3(DVec3::Y);
            let point = place.offset - scene.origin();
            let far = if offset == 0.0 { String::new() } else { format!(", {offset:e} from the origin") };
            out.push((format!("{orientation} plane, scale {scale:e}{far}"), scene, normal, point));
        }
    }
    out
}

/// The plane of [`slack_planes`] with a sheet over it at this distance.
fn bridged(
    kind: TracerKind,
    setup: &super::Setup,
    scene: &Scene,
    normal: DVec3,
    gap: f64,
    control: &mut dyn Control,
) -> Result<usize> {
    let mut both = scene.clone();
    let mut sheet = both.instances[0].clone();
    sheet.object_to_world = DAffine3::from_translation(normal * gap) * sheet.object_to_world;
    both.instances.push(sheet);
    let options = options(48, 1, 1.0, f64::INFINITY).with_samples(|s| s.keep_rays = true);
    // between the plane and the sheet, which is in the way of the camera
    let tracer = setup.tracer(kind, scene)?;
    let rays = closed_forms::render(&tracer, scene, &scene.cameras[0], &options, control)?.kept_occlusion;
    // towards the sheet: those that run along it may leave at its edge
    let steep = |r: &&Ray| DVec3::from_array(r.direction.map(f64::from)).normalize().dot(normal) > 0.01;
    let rays: Vec<Ray> = rays.iter().filter(steep).copied().collect();
    let hits = trace(&setup.tracer(kind, &both)?, &rays, Mode::Any, 1, control)?.0;
    Ok(hits.iter().filter(|h| !h.is_hit()).count())
}

fn run(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().tracers(), session.setup().effort());
    let count = effort.pick(20_000, 1_000_000);

    // Rays along a plane meet it, and rays that it spawns do not.
    let name = "rays at 1e-4 rad meet the plane";
    let plane = analytic::plane(10.0, SceneTransform::default());
    let oracle = Oracle::new(&plane, plane.origin());
    let rays = grazing_rays(count);
    let expected = trace_oracle(&oracle, &rays);
    session.measure_each(name, &kinds, |s, kind, w| {
        Ok(parity_check(name, &compare_hits(&s.tracer(kind, &plane)?, &oracle, &rays, &expected, w)?))
    })?;

    let name = "seen at 1e-4 rad, a plane does not occlude itself";
    let mut grazed = plane.clone();
    grazed.cameras[0] = Camera::look_at(DVec3::new(0.0, 4.0 * GRAZING, 4.0), DVec3::new(0.0, 0.0, 0.0), DVec3::Y, 2e-5);
    session.measure_each(name, &kinds, |s, kind, w| super::scale::check_exact(s, kind, name, &grazed, 1.0, w))?;

    // Rays from edges, vertices and corners of closed bodies leave them.
    let mut body = analytic::closed_box(1.0, SceneTransform::default());
    body.meshes[0].geometry = shapes::icosphere(1.0, 4);
    let oracle = Oracle::new(&body, body.origin());
    let rays = rays_from_edges(&oracle, count as usize);
    let expected = oracle.trace_closest(&rays);
    let name = "rays that start on edges and vertices";
    session.measure_each(name, &kinds, |s, kind, w| {
        Ok(parity_check(name, &compare_hits(&s.tracer(kind, &body)?, &oracle, &rays, &expected, w)?))
    })?;

    let name = "close to a corner, a box does not occlude itself";
    let mut corner = analytic::closed_box(2.0, SceneTransform::default());
    corner.cameras[0] =
        Camera::look_at(DVec3::splat(1.0) + DVec3::new(1.3, 1.1, 0.9) * 1e-3, DVec3::splat(1.0), DVec3::Y, 0.9);
    session.measure_each(name, &kinds, |s, kind, w| super::scale::check_exact(s, kind, name, &corner, 1.0, w))?;

    // Two surfaces close to one another are told apart.
    let name = "surfaces 1e-6 apart: the near one is seen";
    let near = sheets(GAP);
    session.measure_each(name, &kinds, |s, kind, w| {
        let wrong = wrong_sides(&s.tracer(kind, &near)?, count, w)?;
        let is_ours = kind == TracerKind::Compute;
        Ok(Check::none_of(name, wrong as u64, "rays", is_ours).says(format!("of {count} see the one behind")))
    })?;

    let name = "a sheet 1e-6 thick does not occlude itself";
    let thin = thin_sheet(GAP);
    session.measure_each(name, &kinds, |s, kind, w| super::scale::check_exact(s, kind, name, &thin, 1.0, w))?;

    // Offsets are no larger than needed, over scale and place.
    for (what, scene, normal, point) in slack_planes() {
        let scale = scene.instances[0].object_to_world.matrix3.x_axis.length();
        let (offset, gap) = (format!("spawn offset: {what}"), format!("gap bridged: {what}"));
        for kind in &kinds {
            session.measure_these(&[&offset, &gap], Some(*kind), |s, w| {
                let slack = slack(&s.tracer(*kind, &scene)?, &scene, normal, point, 1.0, w)?;
                let missed = bridged(*kind, s, &scene, normal, 2.0 * slack.largest.max(1e-9 * scale), w)?;
                let could = match slack.factor {
                    f if f.is_infinite() => "rays from the plane itself would do".to_owned(),
                    f => format!("offsets {f:.1} times smaller would do"),
                };
                let sentence = format!("of the spawned rays; {could}, {:.0} roundings at most", slack.roundings);
                Ok(vec![
                    Check::at_most(offset.as_str(), slack.self_hits as f64, "self-hits", 0.0).says(sentence),
                    Check::at_most(gap.as_str(), slack.largest / scale, "of the scale", GAP * 10.0).says(format!(
                        "the largest offset of a plane of 10 by 10; {missed} rays miss a sheet at twice that"
                    )),
                ])
            })?;
        }
    }
    Ok(())
}

/// A closed sheet of side 2 and this thickness, seen from above.
pub fn thin_sheet(thickness: f64) -> Scene {
    let mut scene = analytic::closed_box(1.0, SceneTransform::default());
    let half = DVec3::new(1.0, 0.5 * thickness, 1.0);
    scene.meshes[0].geometry = shapes::cuboid(-half, half);
    scene.cameras[0] = Camera::look_at(DVec3::new(0.4, 0.9, 1.1), DVec3::ZERO, DVec3::Y, 1.0);
    if let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry {
        mesh.normals.clear();
    }
    scene
}
