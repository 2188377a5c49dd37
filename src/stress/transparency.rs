//! Section 5, alpha, spheres and glass: cutouts at their threshold, cameras inside of bodies, radii
//! of 1e5 to 1, total internal reflection, nested dielectrics, 64 blended layers.

use glam::{DAffine3, DVec3, Vec3};

use super::degenerate::{compare_hits, parity_check, ray, trace_oracle};
use super::sampling::{add, check_mean, furnace, glass, matte, scene_of};
use super::{Check, Section, StressSession};
use crate::error::Result;
use crate::film::SampleSettings;
use crate::film::{Control, camera};
use crate::integrators::path::PathOptions;
use crate::integrators::rays::{Mode, trace};
use crate::measure::ray_sets::mixed_rays;
use crate::oracle::Oracle;
use crate::ray::Ray;
use crate::scene::builtin::{self, SceneTransform, analytic, shapes};
use crate::scene::{AlphaMode, Camera, Environment, Geometry, Material, Scene, Sphere};
use crate::tracer::Tracer;

pub const SECTION: Section = Section {
    name: "transparency",
    title: "Alpha, spheres, glass",
    about: "cutouts at their threshold, cameras inside of spheres and glass, radii of 1e5 to 1, total internal reflection, nested dielectrics, 64 blended layers",
    of_scene: false,
    run,
};

/// A floor of alpha `alpha` with a cutoff of 0.5: glTF shows it where alpha is at least that.
pub fn cutout(alpha: f32) -> Scene {
    let mut scene = analytic::plane(10.0, SceneTransform::default());
    scene.materials[0].alpha_mode = AlphaMode::Mask { cutoff: 0.5 };
    scene.materials[0].base_color.w = alpha;
    scene
}

/// Counts rays straight down at [`cutout`] that hit.
pub fn cutout_hits(tracer: &Tracer, control: &mut dyn Control) -> Result<usize> {
    let rays: Vec<Ray> = (0..100)
        .map(|i| ray(DVec3::new(f64::from(i % 10) - 4.3, 1.0, f64::from(i / 10) - 4.3), DVec3::NEG_Y))
        .collect();
    Ok(trace(tracer, &rays, Mode::Closest, 1, control)?.0.iter().filter(|h| h.is_hit()).count())
}

/// `count` black layers of this alpha before an environment of 1, and `(1 - alpha)^count`.
pub fn layers(count: u32, alpha: f32) -> (Scene, f64) {
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 0.2);
    let mut scene = Scene { environment: Environment::Uniform(Vec3::ONE), ..scene_of(Vec::new(), camera) };
    let mut material = Material { alpha_mode: AlphaMode::Blend, ..matte(0.0) };
    material.base_color.w = alpha;
    for k in 0..count {
        let height = 1.0 - f64::from(k) * 0.01;
        add(&mut scene, shapes::rectangle(DVec3::Z * height, DVec3::X * 10.0, DVec3::Y * 10.0), material.clone());
    }
    (scene, (1.0 - f64::from(alpha)).powi(count as i32))
}

fn run(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().tracers(), session.setup().effort());
    for (what, alpha, expected) in [("at", 0.5f32, 100), ("just below", 0.5f32.next_down(), 0)] {
        let name = format!("alpha {what} its cutoff");
        session.measure_each(&name, &kinds, |s, kind, w| {
            let hits = cutout_hits(&s.tracer(kind, &cutout(alpha))?, w)?;
            let off = hits.abs_diff(expected) as f64;
            Ok(Check::at_most(name.as_str(), off, "rays", 0.0).says(format!("of 100: {hits} hit, {expected} expected")))
        })?;
    }
    // as the gate of tests/tracer has it: edges of cutouts are ties
    for what in ["leaf-cards", "cornell-spheres"] {
        let Some(scene) = builtin::by_name(what) else { continue };
        let name = format!("rays of {what} against the f64 oracle");
        let oracle = Oracle::new(&scene, scene.origin());
        let view = camera::choose(&scene, &camera::Choice::Auto, 1.0)?;
        let rays = mixed_rays(&oracle, &view, effort.pick(20_000, 1_000_000), 1);
        let expected = oracle.trace_closest(&rays);
        session.measure_each(&name, &kinds, |s, kind, w| {
            let reports = compare_hits(&s.tracer(kind, &scene)?, &oracle, &rays, &expected, w)?;
            let check = parity_check(&name, &reports);
            let bound = 1e-5 * (reports[0].rays + reports[1].rays) as f64;
            Ok(Check::at_most(name.as_str(), check.value, "unexplained", bound).says(check.sentence))
        })?;
    }
    let name = "inside of a sphere it is dark";
    let mut inside = analytic::closed_box(2.0, SceneTransform::default());
    inside.meshes[0].geometry = shapes::sphere(DVec3::new(0.2, 0.1, -0.1), 1.7);
    session.measure_each(name, &kinds, |s, kind, w| super::scale::check_exact(s, kind, name, &inside, 0.0, w))?;

    let name = "a sphere of radius 1e5 does not occlude itself";
    let mut large = analytic::closed_box(1.0, SceneTransform::default());
    large.meshes[0].geometry = Geometry::Spheres(vec![Sphere { center: Vec3::ZERO, radius: 1e5 }]);
    large.cameras[0] = Camera::look_at(DVec3::new(1.0, 1e5 + 1.0, 0.0), DVec3::new(0.0, 1e5, 0.0), DVec3::X, 0.9);
    session.measure_each(name, &kinds, |s, kind, w| super::scale::check_exact(s, kind, name, &large, 1.0, w))?;

    let name = "spheres of radius 1e5 and 1 side by side";
    let mut pair = large.clone();
    let small = shapes::sphere(DVec3::new(0.3, 1e5 + 1.01, 0.2), 1.0);
    if let (Geometry::Spheres(all), Geometry::Spheres(one)) = (&mut pair.meshes[0].geometry, small) {
        all.extend(one);
    }
    let oracle = Oracle::new(&pair, pair.origin());
    let rays: Vec<Ray> = (0..effort.pick(5000, 500_000u32))
        .map(|i| {
            let [a, b] = [0, 3].map(|k| super::degenerate::random_point(i, k));
            let from = DVec3::new(0.0, 1e5 + 2.0, 0.0) + a * 4.0;
            ray(from, DVec3::new(0.3, 1e5 + 1.0, 0.2) + b * 1.5 - from)
        })
        .collect();
    let expected = trace_oracle(&oracle, &rays);
    session.measure_each(name, &kinds, |s, kind, w| {
        Ok(parity_check(name, &compare_hits(&s.tracer(kind, &pair)?, &oracle, &rays, &expected, w)?))
    })?;
    glasses(session)
}

fn glasses(session: &mut StressSession) -> Result<()> {
    let (kinds, effort) = (session.setup().shading_tracers(), session.setup().effort());
    let options =
        PathOptions { samples: SampleSettings::new([16, 16], effort.pick(64, 16_384), 3), ..Default::default() };
    let mut cases = Vec::new();
    // a camera within glass, and one that looks along a rod in which light is reflected totally
    let mut within = furnace(1.0, glass(0.0, 1.5));
    within.cameras[0] = Camera::look_at(DVec3::new(0.0, 0.0, 0.3), DVec3::ZERO, DVec3::Y, 0.9);
    // radiance within a dielectric is n^2 times that outside (basic radiance)
    cases.push(("furnace, camera inside of glass", within, 1.5 * 1.5));
    let mut rod = furnace(1.0, glass(0.0, 1.5));
    rod.meshes[0].geometry = shapes::cuboid(DVec3::new(-0.1, -0.1, -20.0), DVec3::new(0.1, 0.1, 0.0));
    rod.cameras[0] = Camera::look_at(DVec3::new(0.05, 0.03, 0.1), DVec3::new(0.0, 0.0, -0.2), DVec3::Y, 0.6);
    cases.push(("furnace, total reflection along a rod of 100 widths", rod, 1.0));
    let mut nested = furnace(1.0, glass(0.0, 1.5));
    for (k, radius) in [0.8, 0.6, 0.4].into_iter().enumerate() {
        let material = Material { dielectric_priority: k as i32 + 1, ..glass(0.0, [1.33, 2.4, 1.1][k]) };
        add(&mut nested, shapes::sphere(DVec3::ZERO, radius), material);
    }
    cases.push(("furnace, four nested dielectrics", nested, 1.0));
    let (scene, left) = layers(64, 0.02);
    cases.push(("64 blended layers", scene, left));
    for (name, scene, expected) in &cases {
        debug_assert!(scene.instances.iter().all(|i| i.object_to_world == DAffine3::IDENTITY));
        session
            .measure_each(name, &kinds, |s, kind, w| check_mean(s, kind, name, scene, &options, *expected, 1e-5, w))?;
    }
    Ok(())
}
