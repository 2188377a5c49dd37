//! Section 2, watertightness: rays at shared edges and vertices of closed meshes, and rays with
//! zero and negative-zero components.

use glam::DVec3;

use super::{Check, Section, StressSession};
use crate::error::Result;
use crate::film::Control;
use crate::integrators::rays::{Mode, trace};
use crate::measure::ray_sets::{hard_leak_scenes, leak_rays, leak_scenes};
use crate::oracle::Oracle;
use crate::ray::{Hit, Ray};
use crate::scene::builtin::{self, SceneTransform, analytic, shapes};
use crate::tracer::{Tracer, TracerKind};

pub const SECTION: Section = Section {
    name: "watertight",
    title: "Watertightness",
    about: "rays at shared edges and vertices of closed meshes; the compute tracer lets none through",
    of_scene: false,
    run,
};

/// Rays along the axes out of the middle of a symmetric closed body through each of its vertices:
/// two components are zero or negative zero, and planes between triangles are met exactly.
pub fn axis_rays(oracle: &Oracle) -> Vec<Ray> {
    let mut rays = Vec::new();
    for (i, corner) in oracle.triangles().iter().flat_map(|t| t.v).enumerate() {
        let axis = corner.abs().max_position();
        let mut origin = corner;
        origin[axis] = 0.0;
        let mut direction = if i % 2 == 0 { [0.0f32; 3] } else { [-0.0f32; 3] };
        direction[axis] = if corner[axis] > 0.0 { 1.0 } else { -1.0 };
        rays.push(Ray { origin: origin.as_vec3().to_array(), tmin: 0.0, direction, tmax: f32::INFINITY });
    }
    rays
}

/// Rays of a set that meet nothing, asked for any hit and for the closest.
pub fn leaks(tracer: &Tracer, rays: &[Ray], control: &mut dyn Control) -> Result<[usize; 2]> {
    let missed = |hits: Vec<Hit>| hits.iter().filter(|h| !h.is_hit()).count();
    let any = missed(trace(tracer, rays, Mode::Any, 1, control)?.0);
    Ok([any, missed(trace(tracer, rays, Mode::Closest, 1, control)?.0)])
}

/// The check of a closed scene: none of `rays` may leave it through the compute tracer. Leaks of
/// hardware tracers are their driver's affair, and reported.
pub fn check(tracer: &Tracer, name: &str, rays: &[Ray], control: &mut dyn Control) -> Result<Check> {
    Ok(check_leaks(tracer.kind(), name, leaks(tracer, rays, control)?, rays.len()))
}

/// See [`check`]: how many of `rays` leaked, asked for any hit and for the closest.
fn check_leaks(kind: TracerKind, name: &str, [any, closest]: [usize; 2], rays: usize) -> Check {
    Check::none_of(name, any.max(closest) as u64, "leaks", kind == TracerKind::Compute)
        .says(format!("of {rays}; {any} asked for any hit, {closest} for the closest"))
}

fn run(session: &mut StressSession) -> Result<()> {
    let effort = session.setup().effort();
    let mut scenes = leak_scenes();
    // the ends of the range, which its middle does not reach
    for (scale, offset) in [(1e-6, 0.0), (1.0, 1e7)] {
        let place = SceneTransform { scale, offset: DVec3::splat(offset) };
        scenes.push((format!("box, placed, scale {scale:e}, offset {offset:e}"), analytic::closed_box(1.0, place)));
    }
    scenes.extend(hard_leak_scenes(effort.pick(6, 8), effort.pick(200, 5000)));
    // drivers' own tracers are slower on CPUs, and their leaks are theirs
    let count = |kind| {
        if kind == TracerKind::Compute { effort.pick(1_000_000, 100_000_000) } else { effort.pick(150_000, 10_000_000) }
    };
    let kinds = session.setup().tracers();

    // Every scene has its check, and every tracer the sum of all.
    let mut sums = vec![(0u64, 0u64); kinds.len()];
    for (what, scene) in &scenes {
        let name = format!("edges and vertices: {what}");
        let oracle = Oracle::new(scene, scene.origin());
        for (kind, sum) in kinds.iter().zip(&mut sums) {
            session.measure(&name, Some(*kind), |s, w| {
                let (tracer, each) = (s.tracer(*kind, scene)?, count(*kind) / scenes.len());
                let (mut found, mut traced) = ([0, 0], 0);
                // in parts, which fit into memory
                for part in 0..each.div_ceil(PART) {
                    let rays = leak_rays(&oracle, PART.min(each - part * PART), 7 + part as u32);
                    let [any, closest] = leaks(&tracer, &rays, w)?;
                    found = [found[0] + any, found[1] + closest];
                    traced += rays.len();
                }
                let check = check_leaks(*kind, &name, found, traced);
                *sum = (sum.0 + check.value as u64, sum.1 + traced as u64);
                Ok(check)
            })?;
        }
    }
    for (kind, (leaks, rays)) in kinds.iter().zip(sums) {
        let name = "edges and vertices: all";
        session.measure(name, Some(*kind), |_, _| {
            if rays == 0 {
                return Ok(Check::not_applicable(name, "none of the checks that it sums up was made"));
            }
            let is_ours = *kind == TracerKind::Compute;
            Ok(Check::none_of(name, leaks, "leaks", is_ours).says(format!("of {rays} rays")))
        })?;
    }

    // Rays along axes.
    let name = "zero and negative-zero components";
    let mut axes = analytic::closed_box(1.0, SceneTransform::default());
    axes.meshes[0].geometry = shapes::icosphere(1.0, 5);
    let body = builtin::bake(&axes);
    session.measure_each(name, &kinds, |s, kind, w| {
        let rays = axis_rays(&Oracle::new(&body, body.origin()));
        check(&s.tracer(kind, &body)?, name, &rays, w)
    })
}

const PART: usize = 1_000_000;
