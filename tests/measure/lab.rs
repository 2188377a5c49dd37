//! Trees of the laboratory against each other: whatever the rules they are built by, and with local trees of influence areas, a
//! ray's hit is the same, bit for bit; and it is the oracle's.

use glam::DVec3;
use skylit::accel::BuildPreset;
use skylit::accel::build::validate;
use skylit::accel::flatten::FlatScene;
use skylit::accel::lab::influence::{InfluenceArea, Placement, PlacementKind, areas_of_scene};
use skylit::accel::lab::local::{FallbackStart, LocalTrees, LocalVisits, TopLevelKind};
use skylit::accel::lab::{
    Body, Builder, HeuristicChoice, Hierarchy, LabHit, LabRay, Query, RayDistribution, Visits, streams,
};
use skylit::measure::ray_sets::random_rays;
use skylit::oracle::Oracle;
use skylit::scene::{Camera, Light, LightKind, Scene, builtin};

/// With `SKYLIT_FULL` set, as by `./scripts/test.sh --full`, ten times as many.
fn ray_count() -> usize {
    if std::env::var_os("SKYLIT_FULL").is_some() { 1_000_000 } else { 100_000 }
}

fn scene(name: &str) -> Scene {
    builtin::by_name(name).unwrap()
}

fn lab_rays(scene: &Scene, oracle: &Oracle, count: usize) -> Vec<LabRay> {
    let corners = streams::corners(scene, oracle.origin()).unwrap();
    let mut rays: Vec<LabRay> = random_rays(oracle, count / 2, 3).iter().map(LabRay::from).collect();
    rays.extend(streams::parallel_rays(DVec3::new(0.4, -1.0, 0.2), &corners, count / 4));
    rays.extend(streams::point_rays(corners[7] * 0.9, &corners, count - count / 2 - count / 4));
    rays
}

/// The first ray whose answers differ.
fn differs(a: &[Option<LabHit>], b: &[Option<LabHit>]) -> Option<usize> {
    (0..a.len()).find(|&k| a[k] != b[k])
}

fn builders(rays: RayDistribution) -> Vec<Builder> {
    let presets = [BuildPreset::Fast, BuildPreset::Default, BuildPreset::Best].map(Builder::Preset);
    presets.into_iter().chain(HeuristicChoice::ALL.map(|h| Builder::Heuristic(h.heuristic(rays)))).collect()
}

/// Triangles, instances, spheres, stretched instances and a scene far from the origin.
#[test]
fn all_builders_give_the_same_hits() {
    for name in ["cornell-box", "grid:4", "spheres:300", "stairs", "terrain:5000", "far-away"] {
        let scene = scene(name);
        let oracle = Oracle::new(&scene, scene.origin());
        let rays = lab_rays(&scene, &oracle, ray_count() / 5);
        let flat = FlatScene::new(&scene);
        let eye = streams::corners(&scene, scene.origin()).unwrap()[7] * 0.9;
        let mut expected: Option<Vec<Option<LabHit>>> = None;
        for distribution in [RayDistribution::Parallel(DVec3::new(0.4, -1.0, 0.2)), RayDistribution::Point(eye)] {
            for builder in builders(distribution) {
                let h = Hierarchy::build(&flat, &builder);
                for (tree, body) in &h.groups {
                    validate(tree, &body.boxes(), None).unwrap_or_else(|e| panic!("{name} {builder:?}: {e}"));
                }
                let closest = |query| -> Vec<Option<LabHit>> {
                    rays.iter().map(|r| h.trace(r, query, &mut Visits::default())).collect()
                };
                let hits = closest(Query::Closest);
                let first = expected.get_or_insert_with(|| hits.clone());
                assert_eq!(differs(&hits, first), None, "{name} {builder:?}");
                let any = closest(Query::Any);
                let wrong = (0..rays.len()).find(|&k| any[k].is_some() != hits[k].is_some());
                assert_eq!(wrong, None, "{name} {builder:?}");
            }
        }

        // the oracle's, but for rounding of transforms and grazing rays
        let expected = expected.unwrap();
        let differ = rays
            .iter()
            .zip(&expected)
            .filter(|(r, hit)| {
                let ray =
                    skylit::oracle::OracleRay { origin: r.origin, direction: r.direction, tmin: r.tmin, tmax: r.tmax };
                let other = oracle.closest(ray);
                other.is_hit() != hit.is_some() || hit.is_some_and(|h| (h.t - other.t).abs() > 1e-3 * other.t.max(1e-3))
            })
            .count();
        assert!(differ * 2000 < rays.len(), "{name}: {differ} of {} rays differ from the oracle's", rays.len());
    }
}

/// No early out visits what the closest hit does, and more.
#[test]
fn exhaustive_traversal_visits_no_less() {
    let scene = scene("terrain:5000");
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = lab_rays(&scene, &oracle, 5000);
    let h = Hierarchy::build(&FlatScene::new(&scene), &Builder::Preset(BuildPreset::Default));
    let (mut more, mut sum) = (0, [0u64; 3]);
    for ray in &rays {
        let counts = [Query::Any, Query::Closest, Query::Exhaustive].map(|q| {
            let mut v = Visits::default();
            let hit = h.trace(ray, q, &mut v);
            (v, hit)
        });
        assert_eq!(counts[1].1, counts[2].1);
        assert!(counts[1].0.nodes <= counts[2].0.nodes && counts[1].0.primitives <= counts[2].0.primitives);
        more += usize::from(counts[1].0 != counts[2].0);
        (0..3).for_each(|k| sum[k] += counts[k].0.nodes);
    }
    assert!(more > 500 && sum[0] < sum[1] && sum[1] < sum[2], "{more} {sum:?}");
}

/// A scene with a sun, a lamp and a camera, and the areas that follow, with a small one given by hand.
fn areas(scene: &mut Scene) -> Vec<InfluenceArea> {
    let (lo, hi) = scene.bounds().unwrap();
    let light = |kind, position: DVec3| Light {
        name: String::new(),
        kind,
        intensity: glam::Vec3::ONE,
        position,
        direction: DVec3::new(-0.3, -1.0, 0.25).normalize(),
        range: f64::INFINITY,
    };
    scene.lights = vec![light(LightKind::Point, lo + (hi - lo) * DVec3::new(0.4, 0.8, 0.45))];
    scene.lights.push(light(LightKind::Directional { angle: 0.0 }, DVec3::ZERO));
    let camera = Camera::framing(lo, hi, 1.5);
    let placement = Placement {
        scene: String::new(),
        kind: PlacementKind::Plane,
        orientation: "by hand".into(),
        origin: (lo + (hi - lo) * DVec3::new(0.4, 0.4, 0.0)).to_array(),
        direction: [0.1, 0.05, 1.0],
        half_width: (hi - lo).length() * 0.12,
        half_height: (hi - lo).length() * 0.1,
        fov_x_degrees: 0.0,
        fov_y_degrees: 0.0,
        near: 0.0,
        far: (hi - lo).length() * 0.5,
        rays: 0,
    };
    // the small one first, so that others do not hide it
    let mut out = vec![placement.area(scene.origin())];
    out.extend(areas_of_scene(scene, &[camera], scene.origin()));
    assert_eq!(out.len(), 1 + 6 + 1 + 1);
    out
}

/// Rays that are affine to some area and rays that are not, with local trees by every rule, found by a list and by an octree.
#[test]
fn local_trees_give_the_hits_of_the_whole() {
    for name in ["cornell-box", "grid:4", "terrain:5000"] {
        let mut scene = scene(name);
        let areas = areas(&mut scene);
        let oracle = Oracle::new(&scene, scene.origin());
        let flat = FlatScene::new(&scene);
        let body = Body::from_scene(&flat).unwrap();
        let boxes = body.boxes();
        let whole = Builder::Preset(BuildPreset::Default).tree(&boxes, 4);
        let mut rays = lab_rays(&scene, &oracle, ray_count() / 12);
        // from within each area, along its rays, both ways, some of them ending early
        for (k, area) in areas.iter().enumerate() {
            for i in 0..ray_count() / 60 {
                let r = |n| streams::random(i + k * 1_000_003, n);
                let weights: Vec<f64> = (0..8).map(|c| r(c).powi(4)).collect();
                let sum: f64 = weights.iter().sum();
                let at: DVec3 = area.region.corners().iter().zip(&weights).map(|(c, w)| *c * (w / sum)).sum();
                let direction = area.rays.direction_at(at).unwrap() * if i % 2 == 0 { 1.0 } else { -1.0 };
                let tmax = if i % 5 == 0 { r(9) * 2.0 } else { f64::INFINITY };
                rays.push(LabRay::new(at, direction, 0.0, tmax));
            }
        }
        let trace = |r: &LabRay, q| skylit::accel::lab::traverse::trace(&whole, &body, r, q, &mut Visits::default());
        let expected: Vec<Option<LabHit>> = rays.iter().map(|r| trace(r, Query::Closest)).collect();
        for (choice, top, fallback) in [
            (HeuristicChoice::SahLongest, TopLevelKind::List, FallbackStart::Exit),
            (HeuristicChoice::PahSpfh, TopLevelKind::Octree, FallbackStart::Exit),
            (HeuristicChoice::Pah, TopLevelKind::Octree, FallbackStart::Start),
        ] {
            let heuristic = choice.heuristic(RayDistribution::Uniform);
            let local = LocalTrees::build(&body, &whole, areas.clone(), heuristic, (top, fallback));
            let mut visits = LocalVisits::default();
            let hits: Vec<Option<LabHit>> = rays.iter().map(|r| local.trace(r, Query::Closest, &mut visits)).collect();
            assert_eq!(differs(&hits, &expected), None, "{name} {choice:?} {top:?} {fallback:?}");
            let any = |r: &LabRay| local.trace(r, Query::Any, &mut LocalVisits::default()).is_some();
            let wrong = rays.iter().zip(&expected).position(|(r, e)| any(r) != e.is_some());
            assert_eq!(wrong, None, "{name} {choice:?}: any hit");
            // what is tested is there: affine rays, hits in local trees, and rays that went on
            let n = rays.len() as u64;
            assert!(visits.affine > n / 2 && visits.affine < n, "{visits:?}");
            assert!(visits.local_hits > n / 10 && visits.local_hits < visits.affine, "{visits:?}");
        }
    }
}

/// A list and an octree choose the same area.
#[test]
fn list_and_octree_agree() {
    let mut scene = scene("cornell-box");
    let areas = areas(&mut scene);
    let oracle = Oracle::new(&scene, scene.origin());
    let body = Body::from_scene(&FlatScene::new(&scene)).unwrap();
    let whole = Builder::Preset(BuildPreset::Fast).tree(&body.boxes(), 4);
    let rays = lab_rays(&scene, &oracle, 20_000);
    let counts = [TopLevelKind::List, TopLevelKind::Octree].map(|top| {
        let heuristic = HeuristicChoice::PahSpfh.heuristic(RayDistribution::Uniform);
        let local = LocalTrees::build(&body, &whole, areas.clone(), heuristic, (top, FallbackStart::Exit));
        local.visits(&rays, Query::Closest)
    });
    assert_eq!(
        (counts[0].affine, counts[0].local, counts[0].whole),
        (counts[1].affine, counts[1].local, counts[1].whole)
    );
    assert!(counts[0].affine > 100 && counts[0].top > 0 && counts[1].top > 0, "{counts:?}");
}
