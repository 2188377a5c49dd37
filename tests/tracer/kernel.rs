//! What the fast kernel's layout could get wrong: pairs of triangles, the stack that spills from registers, work-groups that are not
//! full, launches that are, and empty ones. Every tracer takes the tests; the oracle judges.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Vec2};
use skylit::film::camera::CameraRecord;
use skylit::film::{NoControl, SampleSettings};
use skylit::gpu::Device;
use skylit::integrators::ao::{self, AoOptions, Occlusion};
use skylit::integrators::rays::Mode;
use skylit::measure::parity::{judge_any, judge_closest, judge_weights};
use skylit::measure::ray_sets::{mixed_rays, narrow, random_rays};
use skylit::oracle::rounding::Rounding;
use skylit::oracle::{Oracle, OracleRay};
use skylit::ray::{Hit, Ray};
use skylit::sampling::sobol::hash_combine;
use skylit::sampling::to_unit;
use skylit::scene::builtin::by_name;
use skylit::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, TriangleMesh};
use skylit::tracer::{Tracer, TracerKind};

use crate::common;
use crate::common::{assert_validation_clean, device, hits, tracer, tracers};

/// Uniform in [0, 1): number `k` of `i`.
fn random(i: u32, k: u32) -> f64 {
    to_unit(hash_combine(hash_combine(91, i), k)) as f64
}

fn random_direction(i: u32, k: u32) -> DVec3 {
    let z = 1.0 - 2.0 * random(i, k);
    let (s, c) = (std::f64::consts::TAU * random(i, k + 1)).sin_cos();
    DVec3::new(c, s, 0.0) * (1.0 - z * z).max(0.0).sqrt() + DVec3::Z * z
}

fn random_turn(i: u32, k: u32) -> DQuat {
    DQuat::from_axis_angle(random_direction(i, k), std::f64::consts::TAU * random(i, k + 2))
}

fn scene(geometry: Geometry, places: impl IntoIterator<Item = DAffine3>) -> Scene {
    let mut scene = Scene { materials: vec![Material::default()], ..Scene::default() };
    scene.meshes.push(Mesh { name: String::new(), geometry, material: 0, source: None });
    let place = |object_to_world| Instance { name: String::new(), mesh: 0, object_to_world };
    scene.instances.extend(places.into_iter().map(place));
    scene
}

fn ray(origin: DVec3, direction: DVec3) -> Ray {
    // the direction from the rounded origin, so that the ray goes where it is aimed
    let rounded = origin.as_vec3().as_dvec3();
    narrow(&OracleRay { origin: rounded, direction: origin + direction - rounded, tmin: 0.0, tmax: f64::INFINITY })
}

/// No tracer's answer to any ray is unexplained: nearest, its weights, any.
fn judge(device: &Arc<Device>, what: &str, scene: &Scene, rays: &[Ray], check: impl Fn(&Tracer)) {
    judge_but(device, what, scene, rays, check, |_, _| false);
}

/// Likewise, but for nearest hits that are excused.
fn judge_but(
    device: &Arc<Device>,
    what: &str,
    scene: &Scene,
    rays: &[Ray],
    check: impl Fn(&Tracer),
    excuse: impl Fn(&Ray, &Hit) -> bool,
) {
    let oracle = Oracle::new(scene, scene.origin());
    let (truth, occluded) = (oracle.trace_closest(rays), oracle.trace_any(rays));
    let rounding = Rounding::default();
    for kind in tracers(device) {
        let tracer = tracer(device, kind, scene);
        let mut closest = hits(&tracer, rays, Mode::Closest);
        let mut excused = 0;
        for ((_, hit), truth) in rays.iter().zip(&mut closest).zip(&truth).filter(|((r, h), _)| excuse(r, h)) {
            *hit = truth.to_hit();
            excused += 1;
        }
        assert!(excused <= rays.len() / 100, "{what} {kind}: {excused} rays are excused");
        let any: Vec<bool> = hits(&tracer, rays, Mode::Any).iter().map(Hit::is_hit).collect();
        let reports = [
            ("nearest", judge_closest(&oracle, rays, &closest, &truth, rounding)),
            ("weights", judge_weights(&oracle, rays, &closest, rounding)),
            ("any", judge_any(&oracle, rays, &any, &occluded, rounding)),
        ];
        println!("{what} {kind}: {}; stack of {}", reports[0].1, tracer.stats().stack_entries);
        for (question, report) in &reports {
            assert_eq!(report.unexplained, 0, "{what} {kind}, {question}: {report}");
        }
        check(&tracer);
    }
}

/// Quads folded along their diagonal by any angle, flat and shut among them, the two triangles' corners in every rotation and
/// winding. Number of a quad's triangles: twice its own, and the next.
fn folded_quads() -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let rotated = |t: [u32; 3], by: u32| [0, 1, 2].map(|k| t[((k + by) % 3) as usize]);
    for (n, angle) in [0.0, 0.7, 1.6, 2.4, 3.0, std::f64::consts::PI].into_iter().enumerate() {
        for combination in 0..36u32 {
            let i = n as u32 * 36 + combination;
            let turn = random_turn(i, 0);
            let at = DVec3::new((i % 6) as f64, (i / 6 % 6) as f64, (i / 36) as f64) * 2.0;
            // the hinge along z; the one wing along x, the other folded back towards it
            let wing = DVec3::new(0.8, 0.0, 0.1);
            let other = DQuat::from_rotation_z(std::f64::consts::PI - angle) * wing;
            let first = mesh.positions.len() as u32;
            mesh.positions.extend([DVec3::Z * -0.5, DVec3::Z * 0.5, wing, other].map(|p| (at + turn * p).as_vec3()));
            let [p, q, r, s] = [0, 1, 2, 3].map(|k| first + k);
            let a = if combination / 9 % 2 == 0 { [p, q, r] } else { [q, p, r] };
            let b = if combination / 18 == 0 { [q, p, s] } else { [p, q, s] };
            mesh.indices.extend([rotated(a, combination % 3), rotated(b, combination / 3 % 3)]);
            // the texture is no reflection of the fold
            mesh.texcoords[0].extend((0..4).map(|k| Vec2::new(random(i, 10 + k) as f32, random(i, 20 + k) as f32)));
        }
    }
    mesh
}

/// Rays at points of all triangles and of their edges, `each` of both for every triangle.
fn rays_at(oracle: &Oracle, each: u32) -> Vec<Ray> {
    let targets = (0u32..).zip(oracle.triangles()).flat_map(|(i, t)| (0..2 * each).map(move |k| (i, t, k)));
    targets
        .map(|(i, t, k)| {
            let k = 100 * k;
            let (a, b) = (random(i, k), if k / 100 < each { random(i, k + 1) } else { 0.0 });
            let s = a.sqrt();
            let target = t.v[0] * (1.0 - s) + t.v[1] * (s * (1.0 - b)) + t.v[2] * (s * b);
            let from = target + random_direction(i, k + 2) * (0.2 + 3.0 * random(i, k + 4));
            ray(from, target - from)
        })
        .collect()
}

/// How many of the rays pass both triangles of a quad.
fn that_pass_both(oracle: &Oracle, rays: &[Ray]) -> usize {
    let passes = |r: &Ray| {
        let r = OracleRay::from(r);
        oracle
            .triangles()
            .chunks_exact(2)
            .any(|quad| quad.iter().all(|t| t.intersect(&r).is_some_and(|(t, _)| t > 0.0)))
    };
    rays.iter().filter(|r| passes(r)).count()
}

/// The nearer triangle of a pair wins, whichever of the two it is, and has its own weights.
#[test]
fn gpu_kernel_pairs() {
    let device = device();
    let mesh = folded_quads();
    let triangles = mesh.indices.len() as f64;
    let scene = self::scene(Geometry::Triangles(mesh), [DAffine3::IDENTITY]);
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = rays_at(&oracle, 12);
    let both = that_pass_both(&oracle, &rays);
    assert!(both > rays.len() / 10, "{both} of {} rays pass both triangles of a quad", rays.len());
    judge(&device, "folded quads", &scene, &rays, |tracer| {
        // the quads are in pairs: half a block a triangle, and a seventh of that again for nodes, would not do for single ones
        let bytes = tracer.stats().bytes_per_primitive();
        assert!(
            tracer.kind() != TracerKind::Compute || bytes < 56.0,
            "{bytes} bytes for each of {triangles} triangles"
        );
    });
    assert_validation_clean(&device);
}

/// Pairs with alpha: where the nearer triangle is cut away, the farther one is met. Opaque ones lie just behind.
#[test]
fn gpu_kernel_pairs_with_alpha() {
    let device = device();
    let mut scene = by_name("leaf-cards").unwrap();
    let masked = scene.meshes.iter().find(|m| m.name.contains("tuft 1")).expect("a mesh with a mask").material;
    let name = String::new;
    let mesh = |material| Mesh { name: name(), geometry: Geometry::Triangles(folded_quads()), material, source: None };
    scene.meshes = vec![mesh(masked), mesh(0)];
    let place = |mesh, object_to_world| Instance { name: name(), mesh, object_to_world };
    scene.instances =
        vec![place(0, DAffine3::IDENTITY), place(1, DAffine3::from_translation(DVec3::new(0.05, 0.04, 0.06)))];
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = rays_at(&oracle, 4);
    // a tracer that forgets the mask would be seen: many rays pass what it cuts away
    let mut opaque = scene.clone();
    opaque.meshes[0].material = 0;
    let without = Oracle::new(&opaque, opaque.origin()).trace_closest(&rays);
    let differ = oracle.trace_closest(&rays).iter().zip(&without).filter(|(a, b)| a.t != b.t).count();
    assert!(differ > rays.len() / 20, "the mask matters to {differ} of {} rays", rays.len());
    judge(&device, "folded quads with alpha", &scene, &rays, |_| {});
    assert_validation_clean(&device);
}

/// What pairing has to refuse or to choose from: edges of many triangles, triangles that are there twice (turned, and wound the
/// other way), ones without area beside sound ones, and corners at one place under two numbers.
#[test]
fn gpu_kernel_pairs_of_bad_meshes() {
    let device = device();
    let mut mesh = TriangleMesh::default();
    let mut lines = Vec::new();
    for i in 0..60u32 {
        let at = DVec3::new((i % 5) as f64, (i / 5 % 4) as f64, (i / 20) as f64) * 2.0;
        let mut point = |p: DVec3| {
            mesh.positions.push((at + p).as_vec3());
            mesh.positions.len() as u32 - 1
        };
        let (p, q) = (point(DVec3::Z * -0.5), point(DVec3::Z * 0.5));
        let fan: Vec<u32> = (0..3 + i % 6).map(|k| point(random_direction(i, 5 * k) * 0.8)).collect();
        let middle = point(DVec3::Z * 0.1);
        let (twin_p, twin_q) = (point(DVec3::Z * -0.5), point(DVec3::Z * 0.5));
        mesh.indices.extend(fan.iter().map(|&v| [p, v, q]));
        // again, turned; again, the other way round; again, with corners of other numbers
        mesh.indices.extend([[fan[0], q, p], [q, fan[1], p], [twin_p, fan[2], twin_q]]);
        // without area: a corner twice; three in a line, which shares its edges with all of the fan
        lines.push(mesh.indices.len() as u32 + 1);
        mesh.indices.extend([[p, p, fan[0]], [p, middle, q], [q, p, twin_q], [fan[0], p, fan[0]]]);
    }
    let scene = self::scene(Geometry::Triangles(mesh), [DAffine3::IDENTITY]);
    let oracle = Oracle::new(&scene, scene.origin());
    let mut rays = rays_at(&oracle, 8);
    rays.extend(random_rays(&oracle, 5000, 4));
    // Three corners in a line have no weights: a ray that passes the line within rounding meets it anywhere between its ends, or not
    // at all. Depth is along the direction's longest axis, as tracers weigh it.
    let anywhere = |ray: &Ray, hit: &Hit| {
        let ray = OracleRay::from(ray);
        hit.is_hit() && lines.contains(&hit.primitive) && {
            let axis = ray.direction.abs().max_position();
            let ends =
                oracle.triangles()[hit.primitive as usize].v.map(|v| (v - ray.origin)[axis] / ray.direction[axis]);
            let (lo, hi) = ends.into_iter().fold((f64::MAX, f64::MIN), |(lo, hi), t| (lo.min(t), hi.max(t)));
            (lo - 1e-5..=hi + 1e-5).contains(&(hit.t as f64))
        }
    };
    judge_but(&device, "bad meshes", &scene, &rays, |_| {}, anywhere);
    assert_validation_clean(&device);
}

/// A comb: at each of `levels` scales, each half the one before, slivers all around one point. Each has a box that holds the point,
/// and none comes near it. So a ray through the point enters every box at every level and meets no sliver: whatever the stack
/// loses of what it has put off, it loses of the wall behind.
fn comb(levels: i32, each: u32) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut add = |corners: [DVec3; 3]| {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(corners.map(|p| p.as_vec3()));
        mesh.indices.push([first, first + 1, first + 2]);
    };
    for k in 0..levels {
        let size = 0.5f64.powi(k);
        for j in 0..each {
            let i = k as u32 * each + j;
            // a quarter turn at most keeps the diagonal a diagonal
            let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2 * (j % 4) as f64 + 0.3 * random(i, 0) - 0.15);
            let (a, b) =
                (DVec3::new(-1.0, 0.3 + 0.1 * random(i, 1), -1.0), DVec3::new(0.3 + 0.1 * random(i, 2), -1.0, 1.0));
            add([a, b, a.lerp(b, random(i, 3)) + DVec3::new(0.01, 0.01, 0.0)].map(|p| turn * p * size));
        }
    }
    // a wall behind, in pieces: which piece is known
    for (x, y) in (-4..4).flat_map(|x| (-4..4).map(move |y| (x as f64, y as f64))) {
        let corner = |dx: f64, dy: f64| DVec3::new(x + dx, y + dy, 0.1 * random(x.to_bits() as u32, 7) + 3.0);
        add([corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)]);
        add([corner(0.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)]);
    }
    mesh
}

/// Rays past the common point of a comb, at distances of every scale, half of them against the wall.
fn rays_through(count: u32, places: &[DAffine3]) -> Vec<Ray> {
    (0..count)
        .map(|i| {
            let near = random_direction(i, 0) * 0.5f64.powf(20.0 * random(i, 4));
            let way = DVec3::new(random(i, 5) - 0.5, random(i, 6) - 0.5, if i % 4 == 3 { -1.5 } else { 1.5 });
            let place = places[i as usize % places.len()];
            ray(place.transform_point3(near - way), place.transform_vector3(way))
        })
        .collect()
}

/// Deeper than the six entries in registers: the rest of the stack is in memory, and comes back in order.
#[test]
fn gpu_kernel_deep_stacks() {
    let device = device();
    let shallow = |what: &str, places: Vec<DAffine3>, levels: i32, least: u32| {
        let scene = self::scene(Geometry::Triangles(comb(levels, 24)), places.iter().copied());
        let rays = rays_through(4000 / common::divisor(), &places);
        judge(&device, what, &scene, &rays, |tracer| {
            let entries = tracer.stats().stack_entries;
            assert!(tracer.kind() != TracerKind::Compute || entries >= least, "{what}: a stack of {entries} only");
        });
    };
    shallow("a comb", vec![DAffine3::IDENTITY], 8, 7);
    shallow("a deep comb", vec![DAffine3::IDENTITY], 20, 12);
    // a comb of combs: each half as large as the one before, all around one point
    let places = (0..40).map(|k| {
        let size = 0.8f64.powi(k);
        DAffine3::from_scale_rotation_translation(DVec3::splat(size), DQuat::from_rotation_z(k as f64), DVec3::ZERO)
    });
    shallow("a comb of combs", places.collect(), 16, 16);
    assert_validation_clean(&device);
}

/// A set's size is no multiple of anything: the answers are those of the same rays in a larger set, bit for bit. The largest has
/// more rays than the buffers between a launch's steps hold.
#[test]
fn gpu_kernel_sets_of_any_size() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let oracle = Oracle::new(&scene, scene.origin());
    const LAUNCH: usize = 1 << 19;
    // on the floor driver without the sets that fill a launch
    let limit = if common::divisor() == 1 { LAUNCH + 1000 } else { 20_000 };
    let rays = mixed_rays(&oracle, &scene.cameras[0], limit, 5);
    let tracer = tracer(&device, TracerKind::Compute, &scene);
    for mode in [Mode::Closest, Mode::Any] {
        let all = hits(&tracer, &rays, mode);
        assert!(all.iter().filter(|h| h.is_hit()).count() > all.len() / 4);
        let counts =
            [0, 1, 2, 7, 63, 64, 65, 127, 1023, 1024, 1025, 2047, 2049, 16_385, LAUNCH - 1, LAUNCH, LAUNCH + 1];
        for count in counts.into_iter().filter(|&count| count < limit) {
            // from another place each time: rays and lanes go together in other ways
            let from = (count * 7919) % (rays.len() - count);
            let some = hits(&tracer, &rays[from..from + count], mode);
            assert!(some == all[from..from + count], "{mode:?}: {count} rays from {from} have other hits");
        }
    }
    assert_validation_clean(&device);
}

/// A queue that stays empty: nothing is seen, so there is nothing to occlude.
#[test]
fn gpu_kernel_empty_queues() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let (lo, hi) = scene.bounds().unwrap();
    // towards it first, so that results of an earlier launch lie in the buffers; then away
    let target = (lo + hi) * 0.5;
    let eye = target + DVec3::Z * 4.0 * (hi - lo).length();
    for kind in tracers(&device) {
        let tracer = tracer(&device, kind, &scene);
        for falloff in [1.0, 3.0] {
            for (towards, seen) in [(target, true), (eye * 2.0 - target, false)] {
                let camera = CameraRecord::new(&Camera::look_at(eye, towards, DVec3::Y, 0.3), scene.origin(), 1.0);
                let options = AoOptions {
                    samples: SampleSettings::new([70, 33], 3, 0),
                    occlusion: Occlusion::new(f64::INFINITY, falloff),
                    ..Default::default()
                };
                let image = ao::render(&tracer, &camera, &options, &mut NoControl).unwrap();
                let covered = image.image.film.coverage.iter().filter(|&&c| c > 0.0).count();
                assert_eq!(covered > 0, seen, "{kind}: {covered} pixels covered");
                assert_eq!(image.occlusion_rays > 0, seen, "{kind}: {} occlusion rays", image.occlusion_rays);
                assert!(seen || image.image.film.mean.iter().all(|&m| m == 0.0), "{kind}: light where nothing is");
            }
        }
    }
    assert_validation_clean(&device);
}

/// Thousands of instances, overlapping and turned: the way back to the top level is taken at every depth of both stacks.
#[test]
fn gpu_kernel_thousands_of_instances() {
    let device = device();
    let mut torus = skylit::scene::builtin::shapes::torus(0.32, 0.12, 16, 8);
    if let Geometry::Triangles(t) = &mut torus {
        t.normals.clear();
    }
    let places: Vec<DAffine3> = (0..5000u32)
        .map(|i| {
            let at = DVec3::new(random(i, 0), random(i, 1), random(i, 2)) * 5.0;
            let scale = DVec3::new(random(i, 3), random(i, 4), random(i, 5)) + 0.3;
            DAffine3::from_scale_rotation_translation(scale, random_turn(i, 6), at)
        })
        .collect();
    let scene = self::scene(torus, places);
    let oracle = Oracle::new(&scene, scene.origin());
    judge(&device, "instances", &scene, &random_rays(&oracle, 40_000 / common::divisor() as usize, 3), |_| {});
    assert_validation_clean(&device);
}
