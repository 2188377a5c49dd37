//! Data that no one should send, through every tracer: no panic, no hang, and the answers of a double-precision tracer that
//! tests every primitive.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::film::camera::CameraRecord;
use skylit::gpu::Device;
use skylit::integrators::ao::{self, AoOptions};
use skylit::integrators::aov;
use skylit::integrators::rays::{Mode, trace};
use skylit::measure::parity::{judge_any, judge_closest};
use skylit::measure::ray_sets::{leak_rays, random_rays};
use skylit::oracle::rounding::Rounding;
use skylit::oracle::{Oracle, OracleHit};
use skylit::ray::{Hit, Ray};
use skylit::sampling::sobol::hash_combine;
use skylit::sampling::to_unit;
use skylit::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, Sphere, TriangleMesh};
use skylit::tracer::{Kernel, Tracer, TracerKind};

use crate::common;
use crate::common::{assert_validation_clean, device, hits, tracer, tracers};

fn scene(parts: Vec<(Geometry, Vec<DAffine3>)>) -> Scene {
    let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
    for (geometry, places) in parts {
        scene.meshes.push(Mesh { name: String::new(), geometry, material: 0 });
        let mesh = scene.meshes.len() - 1;
        scene.instances.extend(places.into_iter().map(|object_to_world| Instance {
            name: String::new(),
            mesh,
            object_to_world,
        }));
    }
    scene
}

const HERE: DAffine3 = DAffine3::IDENTITY;

fn triangles(corners: impl IntoIterator<Item = [DVec3; 3]>) -> Geometry {
    let mut mesh = TriangleMesh::default();
    for corner in corners {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corner.map(|p| p.as_vec3()));
        mesh.indices.push([first, first + 1, first + 2]);
    }
    Geometry::Triangles(mesh)
}

/// Uniform in [0, 1): number `k` of `i`.
fn random(i: u32, k: u32) -> f64 {
    to_unit(hash_combine(hash_combine(42, i), k)) as f64
}

fn random_point(i: u32, k: u32) -> DVec3 {
    DVec3::new(random(i, k), random(i, k + 1), random(i, k + 2)) * 2.0 - 1.0
}

/// Every tracer against the oracle without its tree; also makes a small image and its outputs, which must be numbers.
fn judge(device: &Arc<Device>, what: &str, scene: &Scene, rays: &[Ray]) {
    let oracle = Oracle::new(scene, scene.origin());
    let truth: Vec<OracleHit> = rays.par_iter().map(|r| oracle.brute_force_closest(r)).collect();
    let occluded: Vec<bool> = truth.iter().map(OracleHit::is_hit).collect();
    let judged = |what: &str, tracer: &Tracer| {
        let closest = judge_closest(&oracle, rays, &hits(tracer, rays, Mode::Closest), &truth, Rounding::default());
        println!("{what}: {closest}; stack of {}", tracer.stats().stack_entries);
        assert_eq!(closest.unexplained, 0, "{what}: {closest}");
        let any: Vec<bool> = hits(tracer, rays, Mode::Any).iter().map(Hit::is_hit).collect();
        let any = judge_any(&oracle, rays, &any, &occluded, Rounding::default());
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
    let (lo, hi) = scene.bounds().unwrap_or((DVec3::ZERO, DVec3::ONE));
    let camera = CameraRecord::new(&Camera::framing(lo, hi, 1.0), scene.origin(), 1.0);
    for falloff in [1.0, 4.0] {
        let options = AoOptions { size: [16, 16], spp: 2, falloff, ..Default::default() };
        let image = ao::render(tracer, &camera, &options, &mut NoControl).unwrap();
        let all = image.image.film.mean.iter().chain(&image.image.film.variance);
        assert!(all.clone().all(|x| (0.0..=1.0).contains(x)), "{what} {}: {all:?}", tracer.kind());
    }
    for pixel in aov::render(tracer, &camera, [16, 16], &mut NoControl).unwrap() {
        let numbers = [pixel.position, pixel.ng, pixel.ns, [pixel.red, pixel.green, pixel.blue]];
        assert!(numbers.as_flattened().iter().all(|x| x.is_finite()) && !pixel.depth.is_nan(), "{what}: {pixel:?}");
    }
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
        judge(&device, what, &scene, &random_rays(&oracle, 20_000, 1));
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

/// Rays at corners of the triangles, at points of their edges, and along their edges.
fn rays_at_edges(oracle: &Oracle) -> Vec<Ray> {
    let mut rays = Vec::new();
    for (i, t) in (0u32..).zip(oracle.triangles()) {
        let from = random_point(i, 20) * 2.0;
        for target in [t.v[0], t.v[0].lerp(t.v[1], random(i, 30))] {
            rays.push(ray(from, target - from));
        }
        if t.v[0] != t.v[1] {
            rays.push(ray(t.v[0] * 2.0 - t.v[1], t.v[1] - t.v[0]));
        }
    }
    rays
}

/// Triangles without area, kept on purpose: points, segments, repeated corners; slivers and sound triangles among them.
#[test]
fn gpu_degenerate_triangles_without_area() {
    let device = device();
    let corners = (0..4000).map(|i| {
        let [a, b, c] = [random_point(i, 0), random_point(i, 3), random_point(i, 6)];
        match i % 6 {
            0 => [a, a, a],
            1 => [a, a, b],
            2 => [a, b, a],
            3 => [a, b, a.lerp(b, 0.6) + c * 2e-2],
            _ => [a, a + b * 0.1, a + c * 0.1],
        }
    });
    let scene = scene(vec![(triangles(corners), vec![HERE])]);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = random_rays(&oracle, 20_000, 2);
    rays.extend(rays_at_edges(&oracle));
    judge(&device, "triangles without area", &scene, &rays);
    // nothing but those: bounds are there, hits are not
    let flat = (0..100).map(|i| [random_point(i, 0), random_point(i, 0), random_point(i, 3)]);
    let scene = self::scene(vec![(triangles(flat), vec![HERE])]);
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
            let (lo, hi) = (depth.iter().copied().fold(f64::MAX, f64::min), depth.iter().copied().fold(f64::MIN, f64::max));
            assert!((lo - slack..=hi + slack).contains(&(hit.t as f64)), "{kind}: {r:?} {hit:?}, between {lo} and {hi}");
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

fn ray(origin: DVec3, direction: DVec3) -> Ray {
    Ray { origin: origin.as_vec3().to_array(), tmin: 0.0, direction: direction.as_vec3().to_array(), tmax: f32::INFINITY }
}

/// Triangles from 1e-6 to 1e6 in one mesh, around points that are as far apart.
#[test]
fn gpu_degenerate_scales_together() {
    let device = device();
    let corners: Vec<[DVec3; 3]> = (0..3000)
        .map(|i| {
            let at = random_point(i, 0) * 10f64.powf(random(i, 3) * 12.0 - 6.0);
            let size = 10f64.powf(random(i, 4) * 12.0 - 6.0);
            [at, at + random_point(i, 5) * size, at + random_point(i, 8) * size]
        })
        .collect();
    let scene = scene(vec![(triangles(corners), vec![HERE])]);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = random_rays(&oracle, 10_000, 3);
    for (i, t) in oracle.triangles().iter().enumerate() {
        // at its middle, from as far as it is large, and from as far as the scene is large
        let (i, middle) = (i as u32, (t.v[0] + t.v[1] + t.v[2]) / 3.0);
        for reach in [(t.v[1] - t.v[0]).length(), 1e6] {
            let from = middle + random_point(i, 20) * reach;
            rays.push(ray(from, (middle - from) / reach));
        }
    }
    judge(&device, "scales from 1e-6 to 1e6", &scene, &rays);
    assert_validation_clean(&device);
}

/// As large as the loader lets in, and rays along the axes: nothing overflows.
#[test]
fn gpu_degenerate_largest_coordinates() {
    let device = device();
    let corners: Vec<[DVec3; 3]> = (0..2000)
        .map(|i| {
            let at = random_point(i, 0) * 0.9e12;
            [at, at + random_point(i, 3) * 1e11, at + random_point(i, 6) * 1e11]
        })
        .collect();
    let scene = scene(vec![(triangles(corners), vec![HERE])]);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = random_rays(&oracle, 5000, 3);
    for (i, t) in oracle.triangles().iter().enumerate() {
        let middle = (t.v[0] + t.v[1] + t.v[2]) / 3.0;
        let along = [DVec3::X, DVec3::Y, DVec3::Z][i % 3] * if i % 2 == 0 { 1.0 } else { -1.0 };
        rays.push(ray(middle - along * 4e12, along));
    }
    judge(&device, "the largest coordinates", &scene, &rays);
    assert_validation_clean(&device);
}

/// Many times the same triangle: no plane divides them. The tree must stay shallow, and the answer is any of them.
#[test]
fn gpu_degenerate_coincident_triangles() {
    coincident(3000);
}

#[test]
fn gpu_degenerate_very_many_coincident_triangles() {
    coincident(100_000);
}

fn coincident(count: u32) {
    let device = device();
    let corners = [DVec3::new(-1.0, -0.5, 0.1), DVec3::new(1.0, -0.4, -0.2), DVec3::new(0.1, 1.0, 0.3)];
    let mut mesh = TriangleMesh { positions: corners.map(|p| p.as_vec3()).to_vec(), ..Default::default() };
    mesh.indices = vec![[0, 1, 2]; count as usize];
    let scene = scene(vec![(Geometry::Triangles(mesh), vec![HERE])]);
    let one = self::scene(vec![(triangles([corners]), vec![HERE])]);
    let oracle = Oracle::new(&one, DVec3::ZERO);
    // few: a ray that meets one meets them all
    let rays = random_rays(&oracle, 2000, 4);
    let truth = oracle.trace_closest(&rays);
    for kind in tracers(&device) {
        let start = std::time::Instant::now();
        let tracer = tracer(&device, kind, &scene);
        let built = start.elapsed();
        let traced = trace(&tracer, &rays, Mode::Closest, 1, &mut NoControl);
        // Mesa 22.3 leaves loops after 65,535 iterations: then an error is the right answer
        if let Err(Error::Vulkan(message)) = &traced
            && message.contains("ended the traversal")
            && count > 65_535
            && kind == TracerKind::Compute
        {
            println!("{count} coincident triangles {kind}: {message}");
            continue;
        }
        // which of them is met is not said: as if all had the first's number
        let mut got = traced.unwrap_or_else(|e| panic!("{kind}: {e}")).0;
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
        assert!(report.hits > 200, "{kind}: {report}");
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
    let shape = [DVec3::new(-1.0, -0.6, 0.0), DVec3::new(1.0, -0.6, 0.2), DVec3::new(0.0, 1.0, -0.1)];
    // apart in z by more than rounding, so that there is one answer
    let chain = (0..200).map(|k| {
        let size = 0.5f64.powf(k as f64 * 0.25);
        shape.map(|p| p * size + DVec3::Z * (0.6 * size))
    });
    // a second one whose sizes fall by 2^-1 per level, to the end of the exponent's range where products underflow
    let steep = (0..60).map(|k| shape.map(|p| p * 0.5f64.powi(k) + DVec3::X * 3.0 + DVec3::Z * (0.6 * 0.5f64.powi(k))));
    for (what, geometry) in [
        ("nested triangles", triangles(chain.clone())),
        ("nested steeply", triangles(steep.clone())),
        ("nested, both", triangles(chain.chain(steep))),
    ] {
        let scene = scene(vec![(geometry, vec![HERE])]);
        let oracle = Oracle::new(&scene, scene.origin());
        let mut rays = random_rays(&oracle, 20_000, 5);
        for i in 0..4000 {
            // at a point near the common one, nearer by many scales
            let center = if i % 2 == 0 { DVec3::ZERO } else { DVec3::X * 3.0 };
            let target = center + random_point(i, 0) * 0.5f64.powf(50.0 * random(i, 3));
            let from = center + random_point(i, 4) + DVec3::Z * if i % 4 < 2 { 3.0 } else { -3.0 };
            rays.push(ray(from, target - from));
        }
        judge(&device, what, &scene, &rays);
    }
    assert_validation_clean(&device);
}

/// Many nested spheres, and many of the same place and size.
#[test]
fn gpu_degenerate_spheres() {
    let device = device();
    let balls = (0..500)
        .map(|k| Sphere { center: Vec3::new(0.1, 0.2, 0.3), radius: if k < 300 { 0.97f32.powi(k) } else { 0.5 } })
        .chain(
            (0..100).map(|i| Sphere { center: random_point(i, 0).as_vec3() * 2.0, radius: 1e-5 + 1e-3 * random(i, 3) as f32 }),
        );
    let scene = scene(vec![(Geometry::Spheres(balls.collect()), vec![HERE])]);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = random_rays(&oracle, 20_000, 6);
    for (i, s) in oracle.spheres().iter().enumerate() {
        let from = random_point(i as u32, 20) * 3.0;
        rays.push(ray(from, s.center - from));
        // from inside
        rays.push(ray(s.center, random_point(i as u32, 24)));
    }
    judge(&device, "nested and coincident spheres", &scene, &rays);
    assert_validation_clean(&device);
}

/// A fan of slivers around a point, and a strip of long thin triangles: rays from their own surface outwards meet nothing. A
/// tracer that computes the distance from barycentrics of a sliver is off by more than rays are offset.
#[test]
fn gpu_degenerate_slivers_do_not_meet_themselves() {
    let device = device();
    for (what, geometry) in [
        ("a thin cylinder", skylit::scene::builtin::shapes::cylinder(0.035, 4.0, 20)),
        ("a thick cylinder of many faces", skylit::scene::builtin::shapes::cylinder(0.4, 4.0, 500)),
    ] {
        for turn in [0.0, 0.4, 1.2] {
            let place = DAffine3::from_rotation_z(turn) * DAffine3::from_translation(DVec3::new(0.7, 0.3, 0.2));
            let scene = scene(vec![(geometry.clone(), vec![place])]);
            let (lo, hi) = scene.bounds().unwrap();
            let middle = (lo + hi) * 0.5;
            let camera = Camera::look_at(middle + DVec3::new(0.5, 0.3, 2.0), middle, DVec3::Y, 1.5);
            for kind in tracers(&device) {
                let tracer = tracer(&device, kind, &scene);
                let options = AoOptions { size: [128, 128], spp: 32, ..Default::default() };
                let image =
                    ao::render(&tracer, &CameraRecord::new(&camera, scene.origin(), 1.0), &options, &mut NoControl).unwrap();
                // a convex body does not occlude itself
                let covered: f64 = image.image.film.coverage.iter().map(|&c| c as f64 * 32.0).sum();
                let off: f64 = image
                    .image
                    .film
                    .mean
                    .iter()
                    .zip(&image.image.film.coverage)
                    .map(|(m, c)| ((c - m) as f64 * 32.0).round())
                    .sum();
                println!("{what}, turned {turn}, {kind}: {off} of {covered} rays meet the body they leave");
                assert!(covered > 1000.0, "{what} {kind}: {covered} covered");
                assert!(off == 0.0, "{what}, turned {turn}, {kind}: {off} of {covered} rays meet the body they leave");
            }
        }
    }
    assert_validation_clean(&device);
}

/// Rays at shared edges of a box around coordinates so large that neighbours of a float are apart by a thousandth of its size.
#[test]
fn gpu_degenerate_coarse_coordinates() {
    let device = device();
    let place = skylit::scene::builtin::SceneTransform { scale: 100.0, offset: DVec3::new(1e6, -2e6, 3e6) };
    // baked, then hidden from rebasing by a triangle near the origin
    let mut scene = skylit::scene::builtin::bake(&skylit::scene::builtin::analytic::closed_box(1.0, place));
    let far = self::scene(vec![(triangles([[DVec3::ZERO, DVec3::X, DVec3::Y]]), vec![HERE])]);
    scene.meshes.push(far.meshes.into_iter().next().unwrap());
    scene.instances.push(Instance { name: String::new(), mesh: 1, object_to_world: HERE });
    assert_eq!(scene.origin(), DVec3::ZERO);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = leak_rays(&oracle, 20_000, 7);
    rays.extend(random_rays(&oracle, 5000, 8));
    judge(&device, "coarse coordinates", &scene, &rays);
    assert_validation_clean(&device);
}
