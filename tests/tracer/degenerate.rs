//! Data that no one should send, through every tracer: no panic, no hang, and the answers of a double-precision tracer that
//! tests every primitive.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::gpu::Device;
use skylit::integrators::rays::Mode;
use skylit::measure::parity::judge_closest;
use skylit::measure::ray_sets::random_rays;
use skylit::oracle::Oracle;
use skylit::oracle::rounding::Rounding;
use skylit::ray::{Hit, Ray};
use skylit::scene::{Geometry, Scene, Sphere, TriangleMesh};
use skylit::stress::degenerate::{self, random, random_point, rays_at_edges, scene_of as scene, triangles};
use skylit::tracer::{Kernel, Tracer, TracerKind};

use crate::common;
use crate::common::{assert_validation_clean, device, hits, tracer, tracers};

const HERE: DAffine3 = DAffine3::IDENTITY;

/// So many rays with `./scripts/test.sh --full`, else a quarter: each goes through every tracer and an oracle without a tree.
fn rays_or_quarter(full: usize) -> usize {
    if common::is_full() { full } else { full / 4 }
}

/// Every tracer against the oracle without its tree; also makes a small image and its outputs, which must be numbers.
fn judge(device: &Arc<Device>, what: &str, scene: &Scene, rays: &[Ray]) {
    let oracle = Oracle::new(scene, scene.origin());
    let truth = degenerate::trace_oracle(&oracle, rays);
    let judged = |what: &str, tracer: &Tracer| {
        let [closest, any] = degenerate::compare_hits(tracer, &oracle, rays, &truth, &mut NoControl)
            .unwrap_or_else(|e| panic!("{what}: {e}"));
        println!("{what}: {closest}; stack of {}", tracer.stats().stack_entries);
        assert_eq!(closest.unexplained, 0, "{what}: {closest}");
        assert_eq!(any.unexplained, 0, "{what} any: {any}");
    };
    for kernel in [Kernel::Nearest, Kernel::Brute] {
        let flat = FlatScene::new(scene);
        // brute force has a bound on the size of scenes
        match Tracer::with_options(device, TracerKind::Compute, &flat, common::ALL, kernel) {
            Ok(tracer) => judged(&format!("{what} {kernel:?}"), &tracer),
            Err(e) => assert!(kernel == Kernel::Brute, "{what} {kernel:?}: {e}"),
        }
    }
    for kind in tracers(device) {
        let tracer = tracer(device, kind, scene);
        judged(&format!("{what} {kind}"), &tracer);
        picture(&tracer, scene, &what);
    }
}

fn picture(tracer: &Tracer, scene: &Scene, what: &dyn std::fmt::Display) {
    let bad = degenerate::unsound_values(tracer, scene, &mut NoControl).unwrap();
    assert_eq!(bad, 0, "{what} {}: values that are no numbers or out of range", tracer.kind());
}

#[test]
fn gpu_degenerate_single_primitives() {
    let device = device();
    let triangle = || triangles([[DVec3::new(-1.0, 0.0, 0.2), DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.3, 0.9, -0.4)]]);
    let ball = || Geometry::Spheres(vec![Sphere { center: Vec3::new(0.3, -0.2, 0.1), radius: 0.7 }]);
    let moved = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 2.0, 0.5),
        glam::DQuat::from_rotation_y(0.6),
        DVec3::new(2.0, 0.0, 1.0),
    );
    let empty = || Geometry::Triangles(TriangleMesh::default());
    for (what, scene) in [
        ("one triangle", scene(vec![(triangle(), vec![HERE])])),
        ("one triangle, moved", scene(vec![(triangle(), vec![moved])])),
        ("one triangle twice", scene(vec![(triangle(), vec![HERE, moved])])),
        ("one sphere", scene(vec![(ball(), vec![HERE])])),
        ("one ellipsoid", scene(vec![(ball(), vec![moved])])),
        ("one sphere twice", scene(vec![(ball(), vec![HERE, moved])])),
        ("a triangle and a sphere", scene(vec![(triangle(), vec![HERE]), (ball(), vec![HERE])])),
        (
            "beside empty meshes",
            scene(vec![
                (empty(), vec![HERE]),
                (triangle(), vec![HERE]),
                (Geometry::Spheres(vec![]), vec![moved, HERE]),
                (empty(), vec![HERE, moved]),
                (ball(), vec![HERE]),
            ]),
        ),
        ("a mesh that is placed nowhere", scene(vec![(ball(), vec![]), (triangle(), vec![HERE])])),
    ] {
        let oracle = Oracle::new(&scene, scene.origin());
        judge(&device, what, &scene, &random_rays(&oracle, rays_or_quarter(20_000), 1));
    }
    assert_validation_clean(&device);
}

/// Nothing to hit: every ray misses, an image is empty.
#[test]
fn gpu_degenerate_empty_scenes() {
    let device = device();
    let empty = || Geometry::Triangles(TriangleMesh::default());
    let rays: Vec<Ray> = (0..1000)
        .map(|i| Ray {
            origin: random_point(i, 0).as_vec3().to_array(),
            tmin: 0.0,
            direction: random_point(i, 3).as_vec3().to_array(),
            tmax: f32::INFINITY,
        })
        .collect();
    for (what, scene) in [
        ("no instance", scene(vec![])),
        ("an unplaced mesh", scene(vec![(triangles([[DVec3::ZERO, DVec3::X, DVec3::Y]]), vec![])])),
        ("an empty mesh", scene(vec![(empty(), vec![HERE])])),
        ("an empty mesh twice", scene(vec![(empty(), vec![HERE, HERE])])),
        ("no spheres", scene(vec![(Geometry::Spheres(vec![]), vec![HERE])])),
        ("no spheres twice", scene(vec![(Geometry::Spheres(vec![]), vec![HERE, HERE]), (empty(), vec![HERE])])),
    ] {
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &scene);
            for mode in [Mode::Closest, Mode::Any] {
                let hits = hits(&tracer, &rays, mode);
                assert_eq!(hits.len(), rays.len());
                assert!(hits.iter().all(|h| *h == Hit::MISS), "{what} {kind}: hits");
            }
            assert!(hits(&tracer, &[], Mode::Closest).is_empty());
            picture(&tracer, &scene, &what);
            println!("{what} {kind}: nothing");
        }
    }
    assert_validation_clean(&device);
}

/// Triangles without area, kept on purpose: points, segments, repeated corners; slivers and sound triangles among them.
#[test]
fn gpu_degenerate_triangles_without_area() {
    let device = device();
    let (scene, rays) = degenerate::without_area(if common::is_full() { 4000 } else { 1000 }, rays_or_quarter(20_000));
    judge(&device, "triangles without area", &scene, &rays);
    // nothing but those: bounds are there, hits are not
    let flat = (0..100).map(|i| [random_point(i, 0), random_point(i, 0), random_point(i, 3)]);
    let scene = degenerate::scene_of(vec![(triangles(flat), vec![HERE])]);
    judge(&device, "segments only", &scene, &rays);
    assert_validation_clean(&device);
}

/// Needles whose height is a few roundings of their length. In single precision it is an accident where a ray meets one; but
/// what is met is met between its ends, and nothing that is not there.
#[test]
fn gpu_degenerate_needles() {
    let device = device();
    let corners = (0..2000).map(|i| {
        let [a, b, c] = [random_point(i, 0), random_point(i, 3), random_point(i, 6)];
        // exactly on the segment but for rounding, and a little beside it
        [a, b, a.lerp(b, random(i, 9)) + c * [0.0, 1e-7, 1e-5, 1e-3][i as usize % 4]]
    });
    let scene = scene(vec![(triangles(corners), vec![HERE])]);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = random_rays(&oracle, 20_000, 9);
    rays.extend(rays_at_edges(&oracle));
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        let mut count = 0;
        for (r, hit) in rays.iter().zip(hits(&tracer, &rays, Mode::Closest)) {
            assert!(!hit.t.is_nan(), "{kind}: {r:?} {hit:?}");
            if !hit.is_hit() {
                continue;
            }
            count += 1;
            let wide = skylit::oracle::OracleRay::from(r);
            let corners = oracle.triangles()[hit.primitive as usize].v;
            // depth as tracers weigh it: along the direction's longest axis
            let axis = wide.direction.abs().max_position();
            let depth = corners.map(|v| (v - wide.origin)[axis] / wide.direction[axis]);
            let slack = 1e-4 / wide.direction.length();
            let (lo, hi) =
                (depth.iter().copied().fold(f64::MAX, f64::min), depth.iter().copied().fold(f64::MIN, f64::max));
            assert!(
                (lo - slack..=hi + slack).contains(&(hit.t as f64)),
                "{kind}: {r:?} {hit:?}, between {lo} and {hi}"
            );
            // seen along the ray, the line passes the needle
            let flat = corners.map(|v| {
                let p = v - wide.origin;
                p - wide.direction * (p.dot(wide.direction) / wide.direction.length_squared())
            });
            let distance = [0, 1, 2]
                .map(|k| {
                    let (a, edge) = (flat[k], flat[(k + 1) % 3] - flat[k]);
                    let t = -a.dot(edge) / edge.length_squared();
                    (a + edge * if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) }).length()
                })
                .into_iter()
                .fold(f64::MAX, f64::min);
            // the thickest is a thousandth high
            assert!(distance < 1e-3, "{kind}: {r:?} {hit:?} passes the needle by {distance}");
        }
        println!("needles {kind}: {count} of {} rays meet one", rays.len());
        assert!(count > 10, "{kind}: {count}");
        picture(&tracer, &scene, &"needles");
    }
    assert_validation_clean(&device);
}

/// Triangles from 1e-6 to 1e6 in one mesh, around points that are as far apart.
#[test]
fn gpu_degenerate_scales_together() {
    let device = device();
    let (scene, rays) = degenerate::scales_together(3000, rays_or_quarter(10_000));
    judge(&device, "scales from 1e-6 to 1e6", &scene, &rays);
    assert_validation_clean(&device);
}

/// As large as the loader lets in, and rays along the axes: nothing overflows.
#[test]
fn gpu_degenerate_largest_coordinates() {
    let device = device();
    let (scene, rays) = degenerate::largest_coordinates(2000, rays_or_quarter(5000));
    judge(&device, "the largest coordinates", &scene, &rays);
    assert_validation_clean(&device);
}

/// Many times the same triangle: no plane divides them. The tree must stay shallow, and the answer is any of them.
#[test]
fn gpu_degenerate_coincident_triangles() {
    coincident(3000, false);
    coincident(3000, true);
}

#[test]
fn gpu_degenerate_very_many_coincident_triangles() {
    coincident(100_000, false);
}

fn coincident(count: u32, own_vertices: bool) {
    let device = device();
    let [scene, one] = degenerate::coincident(count, own_vertices);
    let oracle = Oracle::new(&one, DVec3::ZERO);
    // few: a ray that meets one meets them all
    let rays = random_rays(&oracle, rays_or_quarter(2000), 4);
    let truth = oracle.trace_closest(&rays);
    for kind in tracers(&device) {
        let start = std::time::Instant::now();
        let tracer = tracer(&device, kind, &scene);
        let built = start.elapsed();
        // which of them is met is not said: as if all had the first's number
        let mut got = hits(&tracer, &rays, Mode::Closest);
        for hit in got.iter_mut().filter(|h| h.is_hit()) {
            assert!(hit.primitive < count, "{kind}: {hit:?}");
            hit.primitive = 0;
        }
        let report = judge_closest(&oracle, &rays, &got, &truth, Rounding::default());
        println!(
            "{count} coincident triangles {kind}: {report}; built in {built:.1?}, stack of {}, all in {:.1?}",
            tracer.stats().stack_entries,
            start.elapsed()
        );
        assert_eq!(report.unexplained, 0, "{kind}: {report}");
        assert!(report.hits > rays.len() as u64 / 10, "{kind}: {report}");
        let any = hits(&tracer, &rays, Mode::Any);
        assert_eq!(any.iter().filter(|h| h.is_hit()).count(), got.iter().filter(|h| h.is_hit()).count(), "{kind}");
    }
    assert_validation_clean(&device);
}

/// Each triangle is half the size of the one that holds it: 200 levels of boxes within boxes, all around one point, down to
/// where single precision ends. A tree that follows the geometry would be as deep.
#[test]
fn gpu_degenerate_nested_triangles() {
    let device = device();
    for (what, gentle, steep) in
        [("nested triangles", true, false), ("nested steeply", false, true), ("nested, both", true, true)]
    {
        let (scene, rays) = degenerate::nested(gentle, steep, rays_or_quarter(20_000));
        judge(&device, what, &scene, &rays);
    }
    assert_validation_clean(&device);
}

/// Many nested spheres, and many of the same place and size.
#[test]
fn gpu_degenerate_spheres() {
    let device = device();
    let (scene, rays) = degenerate::nested_spheres(rays_or_quarter(20_000));
    judge(&device, "nested and coincident spheres", &scene, &rays);
    assert_validation_clean(&device);
}

/// A fan of slivers around a point, and a strip of long thin triangles: rays from their own surface outwards meet nothing. A
/// tracer that computes the distance from barycentrics of a sliver is off by more than rays are offset.
#[test]
fn gpu_degenerate_slivers_do_not_meet_themselves() {
    let device = device();
    for (what, scene) in degenerate::needle_bodies() {
        let spp = if common::divisor() == 1 { 32 } else { 4 };
        for kind in tracers(&device) {
            // a convex body does not occlude itself
            let tracer = tracer(&device, kind, &scene);
            let (covered, off) = degenerate::self_occluded(&tracer, &scene, 128, spp, &mut NoControl).unwrap();
            println!("{what}, {kind}: {off} of {covered} rays meet the body they leave");
            assert!(covered > 1000.0, "{what} {kind}: {covered} covered");
            assert!(off == 0.0, "{what}, {kind}: {off} of {covered} rays meet the body they leave");
        }
    }
    assert_validation_clean(&device);
}

/// Rays at shared edges of a box around coordinates so large that neighbours of a float are apart by a thousandth of its size.
#[test]
fn gpu_degenerate_coarse_coordinates() {
    let device = device();
    let (scene, rays) = degenerate::coarse_coordinates(rays_or_quarter(20_000));
    assert_eq!(scene.origin(), DVec3::ZERO);
    judge(&device, "coarse coordinates", &scene, &rays);
    assert_validation_clean(&device);
}
