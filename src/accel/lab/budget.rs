//! Whether a local tree for the shadow rays of a light would pay: the box tests that it saves,
//! against the time to build it.

use std::time::Instant;

use glam::DVec3;
use obvhs::bvh2::Bvh2;
use serde::Serialize;

use super::body::Body;
use super::heuristic::{Heuristic, HeuristicChoice};
use super::influence::areas_of_light;
use super::local::{FallbackStart, LocalTrees, LocalVisits, TopLevelKind};
use super::streams::shadow_rays;
use super::traverse::{Hierarchy, Query, Visits};
use crate::scene::Light;

/// Shadow rays within which a local tree has to be worth its build: those of an image of 1280x720
/// with 64 samples a pixel.
pub const IMAGE_RAYS: f64 = 1280.0 * 720.0 * 64.0;

/// Rules that local trees are built by; the one that leaves the fewest box tests counts.
const RULES: [HeuristicChoice; 2] = [HeuristicChoice::Pah, HeuristicChoice::PahSpfh];

/// Repeats of a measurement of time, of which the least counts.
const REPEATS: u32 = 5;

/// The budget of a light: means are over its shadow rays that were sampled.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LightBudget {
    /// The light, in words.
    pub light: String,
    /// Shadow rays that were sampled.
    pub rays: usize,
    /// Box tests a ray in the hierarchy.
    pub boxes: f64,
    /// Box tests a ray with local trees of the light's influence areas, the search for the area
    /// included.
    pub local_boxes: f64,
    /// Rules of the local trees.
    pub rules: &'static str,
    /// References to primitives in the local trees.
    pub references: u64,
    /// Wall-clock time to build the local trees, ms.
    pub build_ms: f64,
    /// Wall-clock time of a box test in the hierarchy, ns: of all threads together.
    pub box_test_ns: f64,
    /// Number of rays whose saving is worth the build; `None` where none is saved.
    pub break_even_rays: Option<f64>,
    /// Whether that is within [`IMAGE_RAYS`].
    pub pays: bool,
}

/// A tree over all primitives, which a light's trees are beside.
pub struct Whole<'b> {
    /// The primitives in world space.
    pub body: &'b Body,
    /// A tree over them.
    pub tree: &'b Bvh2,
}

/// The budget of a light for rays from points that are seen, each with its normal, in a scene with
/// these corners of its bounds. Positions are relative to `origin`. `heuristic` has the constants
/// of local trees. `None` where no ray goes to the light.
pub fn light_budget(
    hierarchy: &Hierarchy,
    whole: &Whole,
    (name, light): (&str, &Light),
    seen: &[(DVec3, DVec3)],
    (corners, origin): (&[DVec3; 8], DVec3),
    heuristic: impl Fn(HeuristicChoice) -> Heuristic,
) -> Option<LightBudget> {
    let rays = shadow_rays(seen, light, origin);
    if rays.is_empty() {
        return None;
    }
    let mean = |n: u64| n as f64 / rays.len() as f64;

    // the hierarchy as it is
    let (visits, seconds) = timed(|| hierarchy.visits(&rays, Query::Any).0);
    let box_test_ns = 1e9 * seconds / visits.boxes.max(1) as f64;

    // local trees by the rules, of which the better ones count
    let built = RULES.map(|choice| {
        let areas = areas_of_light(light, name, corners, origin);
        let start = Instant::now();
        let top = (TopLevelKind::List, FallbackStart::Exit);
        let trees = LocalTrees::build(whole.body, whole.tree, areas, heuristic(choice), top);
        let seconds = start.elapsed().as_secs_f64();
        let visits = trees.visits(&rays, Query::Any);
        let references = trees.locals().iter().map(|l| l.tree.primitive_indices.len() as u64).sum();
        (box_tests(&visits), choice, references, 1e3 * seconds)
    });
    let (boxes, choice, references, build_ms) = built.into_iter().min_by_key(|b| b.0)?;
    let (break_even_rays, pays) = verdict(mean(visits.boxes) - mean(boxes), build_ms, box_test_ns);
    Some(LightBudget {
        light: name.to_owned(),
        rays: rays.len(),
        boxes: mean(visits.boxes),
        local_boxes: mean(boxes),
        rules: choice.name(),
        references,
        build_ms,
        box_test_ns,
        break_even_rays,
        pays,
    })
}

/// Box tests of rays in local trees and the whole one; an area that is looked at is one, too.
fn box_tests(visits: &LocalVisits) -> u64 {
    visits.local.boxes + visits.whole.boxes + visits.top
}

/// The number of rays at which a saving of so many box tests a ray is worth a build, and whether
/// that is within an image.
fn verdict(saved: f64, build_ms: f64, box_test_ns: f64) -> (Option<f64>, bool) {
    let rays = (saved > 0.0).then(|| 1e6 * build_ms / (saved * box_test_ns));
    (rays, rays.is_some_and(|rays| rays <= IMAGE_RAYS))
}

/// The result of a measurement, and the least seconds of its repeats.
fn timed(measure: impl Fn() -> Visits) -> (Visits, f64) {
    let mut least = f64::INFINITY;
    let mut out = Visits::default();
    for _ in 0..REPEATS {
        let start = Instant::now();
        out = measure();
        least = least.min(start.elapsed().as_secs_f64());
    }
    (out, least)
}

impl LightBudget {
    /// The budget in a sentence.
    pub fn describe(&self) -> String {
        let saved = self.boxes - self.local_boxes;
        let counts = if saved > 0.0 {
            format!("would save {saved:.1} box tests of {:.1} a ray", self.boxes)
        } else {
            format!("would save no box test of {:.1} a ray, and add {:.1}", self.boxes, -saved)
        };
        let end = match self.break_even_rays {
            Some(rays) if self.pays => format!("does pay, from {} rays on", rounded(rays)),
            Some(rays) => format!("does not pay, but from {} rays on", rounded(rays)),
            None => "does not pay".to_owned(),
        };
        format!("{}: {counts}, build costs {:.1} ms: {end}", self.light, self.build_ms)
    }
}

/// A number in millions or thousands, or as it is.
fn rounded(n: f64) -> String {
    match n {
        _ if n >= 1e6 => format!("{:.1} million", n * 1e-6),
        _ if n >= 1e4 => format!("{:.0} thousand", n * 1e-3),
        _ => format!("{n:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::BuildPreset;
    use crate::accel::flatten::FlatScene;
    use crate::accel::lab::streams::{camera_rays, corners, surfaces};
    use crate::accel::lab::{Builder, LabRay, RayDistribution};
    use crate::scene::{LightKind, Scene, builtin};

    fn light(kind: LightKind, position: DVec3) -> Light {
        let direction = DVec3::new(-0.2, -1.0, 0.1).normalize();
        Light { name: String::new(), kind, intensity: glam::Vec3::ONE, position, direction, range: f64::INFINITY }
    }

    fn budget(scene: &Scene, light: &Light) -> Option<LightBudget> {
        let flat = FlatScene::new(scene);
        // a poor tree, so that there is something to save
        let poor = HeuristicChoice::SahLongest.heuristic(RayDistribution::Uniform);
        let hierarchy = Hierarchy::build(&flat, &Builder::Heuristic(poor));
        let body = Body::from_scene(&flat).unwrap();
        let tree = Builder::Preset(BuildPreset::Fast).tree(&body.boxes(), 4);
        let seen = surfaces(&hierarchy, &camera_rays(&scene.cameras[0], flat.origin, [64, 36]));
        let bounds = corners(scene, flat.origin).unwrap();
        let whole = Whole { body: &body, tree: &tree };
        let rules = |choice: HeuristicChoice| choice.heuristic(RayDistribution::Uniform);
        light_budget(&hierarchy, &whole, ("sun", light), &seen, (&bounds, flat.origin), rules)
    }

    /// Box tests are those that the rays count one by one, and the verdict follows from them.
    #[test]
    fn budgets_are_counted() {
        let scene = builtin::by_name("stairs").unwrap();
        let sun = light(LightKind::Directional { angle: 0.0 }, DVec3::ZERO);
        let found = budget(&scene, &sun).unwrap();
        let flat = FlatScene::new(&scene);
        let poor = HeuristicChoice::SahLongest.heuristic(RayDistribution::Uniform);
        let hierarchy = Hierarchy::build(&flat, &Builder::Heuristic(poor));
        let seen = surfaces(&hierarchy, &camera_rays(&scene.cameras[0], flat.origin, [64, 36]));
        let (mut boxes, mut rays) = (0, 0);
        for (p, _) in seen.iter().filter(|(_, n)| n.dot(-sun.direction) > 0.0) {
            let mut visits = Visits::default();
            let ray = LabRay::new(*p, -sun.direction, 0.0, f64::INFINITY);
            hierarchy.trace(&ray, Query::Any, &mut visits);
            boxes += visits.boxes;
            rays += 1;
        }
        assert!(rays > 500 && found.rays == rays, "{} {rays}", found.rays);
        assert!((found.boxes - boxes as f64 / rays as f64).abs() < 1e-9);
        assert!(found.local_boxes >= 1.0 && found.references > 0 && found.box_test_ns > 0.0);
        assert_eq!(found.break_even_rays.is_some(), found.local_boxes < found.boxes);
        let text = found.describe();
        assert!(
            text.starts_with("sun: would save ") && text.contains(" a ray") && text.contains(" ms: does "),
            "{text}"
        );
    }

    #[test]
    fn what_pays_follows_from_what_is_saved() {
        // a millisecond is a million box tests of a nanosecond
        let (rays, pays) = verdict(10.0, 1.0, 1.0);
        assert!((rays.unwrap() - 1e5).abs() < 1e-6 && pays);
        assert_eq!(verdict(-1.0, 1.0, 1.0), (None, false));
        assert!(!verdict(0.001, 1e5, 1.0).1, "a long build for next to nothing");
    }

    /// A spot lights nothing beside its cone, nor a lamp beyond its range or behind a surface.
    #[test]
    fn lights_that_reach_nothing_have_no_budget() {
        let scene = builtin::by_name("stairs").unwrap();
        let (lo, hi) = scene.bounds().unwrap();
        let above = (lo + hi) * 0.5 + DVec3::Y * (hi.y - lo.y);
        let spot = |outer_angle| light(LightKind::Spot { inner_angle: 0.0, outer_angle }, above);
        assert!(budget(&scene, &spot(1.0)).is_some());
        let up = Light { direction: DVec3::Y, ..spot(1.0) };
        assert_eq!(budget(&scene, &up), None);
        let near = Light { range: 1e-3, ..light(LightKind::Point, above) };
        assert_eq!(budget(&scene, &near), None);
    }
}
