//! Ambient occlusion images by every tracer against what mathematics knows.
//!
//! How an image is compared with a closed form, `skylit::stress::closed_forms` says, which this and the command `skylit stress` share. An image passes when its bias is
//! - within 5e-4 and three of the standard errors that independent samples would have, and
//! - within 4.5 of its true standard errors, which are several times smaller. Seeds are fixed: a build that passes does so always.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, Vec3};
use skylit::film::NoControl;
use skylit::gpu::Device;
use skylit::integrators::ao::{AoOptions, Occlusion};
use skylit::oracle::Oracle;
use skylit::oracle::closed_form as exact;
use skylit::scene::builtin::{self, SceneTransform, analytic, shapes};
use skylit::scene::{Camera, Geometry, Instance, Material, Mesh, Scene, TriangleMesh};
use skylit::stress::closed_forms::{self, Bias, Case, on_plane, options};
use skylit::stress::lengths::Kerb;
use skylit::stress::scale::{can_bake, floor_beside_sphere, places};
use skylit::tracer::TracerKind;

use crate::common;
use crate::common::{assert_validation_clean, device, tracer, tracers};

/// Largest true standard error of an image's mean: a case that does not reach it takes too few samples to say anything.
const PRECISION: f64 = 1.5e-4;

fn check(device: &Arc<Device>, case: &Case) {
    let expected = case.expectations();
    let used = expected.iter().flatten().count();
    let share = used as f64 / expected.len() as f64;
    assert!(share > 0.3, "{}: only {used} of {} pixels can be judged", case.what, expected.len());
    for kind in tracers(device) {
        let what = format!("{} {kind}", case.what);
        let tracer = tracer(device, kind, case.scene);
        let start = std::time::Instant::now();
        let Bias { expected: mean, bias, standard_error, independent_error, uncovered, spp, .. } =
            case.bias(&tracer, &expected, &mut NoControl).unwrap_or_else(|e| panic!("{what}: {e}"));
        println!(
            "{what}: want {mean:.6}, bias {bias:+.1e}, standard error {standard_error:.1e} ({independent_error:.1e} if independent), {used} pixels x {spp} in {:.2} s",
            start.elapsed().as_secs_f64()
        );
        assert_eq!(uncovered, 0, "{what}: pixels see past the surface");
        assert!(standard_error <= PRECISION, "{what}: standard error {standard_error}");
        assert!(
            bias.abs() <= (3.0 * independent_error).min(5e-4),
            "{what}: bias {bias}, standard error {independent_error}"
        );
        // the last term: single precision's own share
        assert!(bias.abs() <= 4.5 * standard_error + 2e-6, "{what}: bias {bias}, true standard error {standard_error}");
    }
}

/// Hits beyond [`Occlusion::reach`] change no sample, so closed forms may have it as their radius.
fn reach(falloff: f64) -> f64 {
    Occlusion::new(f64::INFINITY, falloff).reach()
}

#[test]
fn gpu_ao_v_grooves() {
    let device = device();
    for degrees in [30.0f64, 60.0, 90.0, 120.0] {
        let angle = degrees.to_radians();
        let (sin, cos) = (angle * 0.5).sin_cos();
        // on the right wall, which faces left and up
        let (up, normal) = (DVec3::new(sin, cos, 0.0), DVec3::new(-cos, sin, 0.0));
        let point = up + DVec3::Z * 0.5;
        let eye = point + normal * (0.6 * angle.tan().abs().min(1.0));
        for (name, length, width) in [("finite", 4.0, 6.0), ("nearly infinite", 1e4, 3e4)] {
            let scene = analytic::v_groove(angle, length, width, SceneTransform::default());
            let finite = |p: DVec3| exact::v_groove_finite(angle, p.dot(up), p.z, length, width);
            if length > 50.0 {
                // constant, wherever on the wall
                assert!((finite(point) - exact::v_groove(angle)).abs() < 1e-4);
            }
            check(
                &device,
                &Case {
                    what: &format!("groove of {degrees} degrees, {name}"),
                    scene: &scene,
                    camera: Camera::look_at(eye, point, DVec3::Z, 0.6),
                    options: options(32, 1024, 1.0, f64::INFINITY),
                    surface: &|ray| on_plane(ray, DVec3::ZERO, normal),
                    expected: &finite,
                },
            );
        }
    }
    assert_validation_clean(&device);
}

/// Falloff in a groove, with the radius beyond which nothing is met: [`exact::v_groove_falloff`] with a limit. In the
/// cross-section the wall is at rho(phi); a direction with elevation beta out of it meets the wall at rho / cos(beta).
fn v_groove_limited(angle: f64, distance: f64, c: f64, radius: f64) -> f64 {
    let midpoints = |a: f64, b: f64, n: usize, f: &dyn Fn(f64) -> f64| {
        let h = (b - a) / n as f64;
        (0..n).map(|k| f(a + (k as f64 + 0.5) * h)).sum::<f64>() * h
    };
    let occlusion = midpoints(0.0, std::f64::consts::PI - angle, 600, &|phi| {
        let rho = distance * angle.sin() / (phi + angle).sin();
        if rho >= radius {
            return 0.0;
        }
        let widest = (rho / radius).acos();
        phi.sin() * midpoints(0.0, widest, 60, &|beta| beta.cos().powi(2) * c.powf(-rho / beta.cos()))
    });
    1.0 - 2.0 / std::f64::consts::PI * occlusion
}

#[test]
fn gpu_ao_falloff_and_radius_in_grooves() {
    let device = device();
    for (distance, angle) in [(0.3, 1.2), (1.1, 2.0)] {
        // the quadrature above, against the one-dimensional one
        let difference = v_groove_limited(angle, distance, 8.0, 1e9) - exact::v_groove_falloff(angle, distance, 8.0);
        assert!(difference.abs() < 1e-6, "{difference}");
    }
    let angle = 75f64.to_radians();
    let (sin, cos) = (angle * 0.5).sin_cos();
    let (up, normal) = (DVec3::new(sin, cos, 0.0), DVec3::new(-cos, sin, 0.0));
    let point = up * 0.4;
    // walls longer than any ray reaches
    let scene = analytic::v_groove(angle, 16.0, 40.0, SceneTransform::default());
    for (c, radius) in [(2.0, f64::INFINITY), (8.0, f64::INFINITY), (32.0, f64::INFINITY), (1.0, 0.9), (8.0, 0.7)] {
        let limit = reach(c).min(radius);
        // the closed form is smooth: a table over the distance from the bottom is exact enough, and quick
        let (first, step) = (0.2, 0.002);
        let table: Vec<f64> = (0..200).map(|k| v_groove_limited(angle, first + step * k as f64, c, limit)).collect();
        check(
            &device,
            &Case {
                what: &format!("groove, falloff {c}, radius {radius}"),
                scene: &scene,
                camera: Camera::look_at(point + normal * 0.3, point, DVec3::Z, 0.5),
                options: options(32, 512, c, radius),
                surface: &|ray| on_plane(ray, DVec3::ZERO, normal),
                expected: &|p| {
                    let x = (p.dot(up) - first) / step;
                    let k = x.floor();
                    let f = x - k;
                    table[k as usize] * (1.0 - f) + table[k as usize + 1] * f
                },
            },
        );
    }
    assert_validation_clean(&device);
}

/// A sphere over a plane, pixel by pixel over the whole floor that is seen, near and far, at several scales and positions.
/// Walls that stand on a floor without common vertices, from ten times to ten million times as long as the distance of the point that sees them.
#[test]
fn gpu_ao_long_walls() {
    let device = device();
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 1.1);
    let (along, lengths) = (DQuat::IDENTITY, [1e1, 1e3, 3e4, 2e5, 1e6]);
    let places = lengths.map(|l| (l, along)).into_iter().chain([(1e3, turn), (1e4, turn)]);
    for (k, (length, turn)) in places.enumerate() {
        let kerb = Kerb::new(length, [0.0, 0.37][k % 2], turn);
        for kind in tracers(&device) {
            let tracer = tracer(&device, kind, &kerb.scene);
            let bias = kerb.bias(&tracer, 256, &mut NoControl).unwrap();
            println!("length {length:e} {kind}: {bias:?}");
            assert_eq!(bias.uncovered, 0, "length {length:e} {kind}");
            assert!(bias.bias.abs() < 1e-3 + 4.5 * bias.standard_error, "length {length:e} {kind}: {bias:?}");
            let [distance, point] = kerb.errors(&tracer, 1000, &mut NoControl).unwrap();
            println!("  hits: {distance:.1e}, {point:.1e}");
            if kind == TracerKind::Compute {
                assert!(
                    distance < 1e-3 + 1e-7 * length && point < 1e-3 + 1e-7 * length,
                    "length {length:e}: {distance} {point}"
                );
            }
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_ao_sphere_over_plane() {
    let device = device();
    let (radius, height) = (1.0, 1.25);
    for place in [
        SceneTransform::default(),
        SceneTransform { scale: 1e-3, offset: DVec3::ZERO },
        SceneTransform { scale: 1e3, offset: DVec3::new(1e6, -2e6, 3e5) },
    ] {
        let scene = analytic::sphere_over_plane(radius, height, 60.0, place);
        let local = |p: DVec3| (p - place.offset) / place.scale;
        check(
            &device,
            &Case {
                what: &format!("sphere over plane, scale {}", place.scale),
                scene: &scene,
                camera: scene.cameras[0].clone(),
                options: options(48, 512, 1.0, f64::INFINITY),
                surface: &|ray| floor_beside_sphere(ray, place, radius, height),
                expected: &|p| {
                    let p = local(p);
                    exact::sphere_over_plane(radius, height, p.x.hypot(p.z)).unwrap()
                },
            },
        );
    }
    assert_validation_clean(&device);
}

/// The same with a sphere of 320 triangles, whose form factor is known exactly too: half the sum over its triangles, because a
/// direction that meets a convex body meets it twice.
#[test]
fn gpu_ao_tessellated_sphere_over_plane() {
    let device = device();
    let (radius, height) = (1.0, 1.25);
    let mut scene = analytic::sphere_over_plane(radius, height, 60.0, SceneTransform::default());
    scene.meshes[1].geometry = shapes::icosphere(radius, 2);
    scene.instances[1].object_to_world = DAffine3::from_translation(DVec3::Y * height);
    let oracle = Oracle::new(&scene, DVec3::ZERO);
    let ball: Vec<_> = oracle.triangles().iter().filter(|t| t.instance == 1).map(|t| t.v).collect();
    assert_eq!(ball.len(), 320);
    let expected = |p: DVec3| {
        let sum: f64 = ball.iter().map(|t| exact::polygon_form_factor(p, DVec3::Y, t)).sum();
        1.0 - 0.5 * sum
    };
    // inscribed: it occludes less than the sphere, by its share of the silhouette
    let (flat, round) = (expected(DVec3::ZERO), exact::sphere_over_plane(radius, height, 0.0).unwrap());
    assert!(flat > round && flat - round < 0.03, "{flat} {round}");
    let case = |scene: &Scene, what: &str| {
        check(
            &device,
            &Case {
                what,
                scene,
                camera: scene.cameras[0].clone(),
                options: options(40, 512, 1.0, f64::INFINITY),
                surface: &|ray| floor_beside_sphere(ray, SceneTransform::default(), radius, height),
                expected: &expected,
            },
        );
    };
    case(&scene, "icosphere over plane");
    // as two placements of one mesh (the second far below), so that the ball has a level of its own
    let mut instanced = scene.clone();
    let mut below = instanced.instances[1].clone();
    below.object_to_world = DAffine3::from_translation(DVec3::Y * -50.0);
    instanced.instances.push(below);
    case(&instanced, "icosphere over plane, instanced");
    assert_validation_clean(&device);
}

#[test]
fn gpu_ao_sphere_with_falloff() {
    let device = device();
    let (radius, height) = (1.0, 1.5);
    let scene = analytic::sphere_over_plane(radius, height, 60.0, SceneTransform::default());
    for c in [2.0, 8.0, 32.0] {
        let want = exact::sphere_over_plane_falloff(radius, height, c).unwrap();
        // no tangent ray is longer than what is traced
        assert!((height * height - radius * radius).sqrt() < reach(c));
        check(
            &device,
            &Case {
                what: &format!("below a sphere, falloff {c}"),
                scene: &scene,
                // under the sphere, a few thousandths around its foot: there the value is stationary
                camera: Camera::look_at(DVec3::new(4.0, 0.3, 0.0), DVec3::ZERO, DVec3::Y, 1e-4),
                options: options(32, 512, c, f64::INFINITY),
                surface: &|ray| on_plane(ray, DVec3::ZERO, DVec3::Y),
                expected: &|p| {
                    assert!(p.length() < 5e-3);
                    want
                },
            },
        );
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_ao_parallel_planes() {
    let device = device();
    let gap = 1.0;
    let scene = analytic::parallel_planes(8.0, 6.0, gap, SceneTransform::default());
    // around a corner and in the middle
    for (x, z) in [(0.0, 0.0), (3.3, 2.4)] {
        let target = DVec3::new(x, 0.0, z);
        check(
            &device,
            &Case {
                what: &format!("parallel rectangles around {x}, {z}"),
                scene: &scene,
                camera: Camera::look_at(target + DVec3::new(-0.2, 0.7 * gap, 0.1), target, DVec3::X, 0.7),
                options: options(32, 1024, 1.0, f64::INFINITY),
                surface: &|ray| on_plane(ray, DVec3::ZERO, DVec3::Y),
                expected: &|p| exact::parallel_rectangle(gap, [-4.0 - p.x, 4.0 - p.x], [-3.0 - p.z, 3.0 - p.z]),
            },
        );
    }
    // wider than any ray reaches
    let gap = 0.5;
    let scene = analytic::parallel_planes(40.0, 40.0, gap, SceneTransform::default());
    for (c, radius) in
        [(2.0, f64::INFINITY), (8.0, f64::INFINITY), (32.0, f64::INFINITY), (8.0, 1.0), (1.0, 0.8), (1.0, 0.49)]
    {
        let want = exact::parallel_disk(gap, f64::INFINITY, c, reach(c).min(radius));
        let case = Case {
            what: &format!("parallel planes, falloff {c}, radius {radius}"),
            scene: &scene,
            camera: Camera::look_at(DVec3::new(0.2, 0.3, 0.1), DVec3::ZERO, DVec3::X, 0.7),
            options: options(32, 512, c, radius),
            surface: &|ray| on_plane(ray, DVec3::ZERO, DVec3::Y),
            expected: &|_| want,
        };
        if radius < gap {
            assert_eq!(want, 1.0);
        }
        check(&device, &case);
    }
    assert_validation_clean(&device);
}

/// Occlusion of half a per cent at most, of which nearly a half is by hits that occlude by less than a five-hundredth each: a still leaves none out.
#[test]
fn gpu_ao_faint_occlusion_counts() {
    let device = device();
    let scene = analytic::parallel_planes(40.0, 40.0, 1.0, SceneTransform::default());
    let occlusion = 1.0 - exact::parallel_disk(1.0, f64::INFINITY, 200.0, f64::INFINITY);
    let case = Case {
        what: "parallel planes, falloff 200",
        scene: &scene,
        camera: Camera::look_at(DVec3::new(0.2, 0.3, 0.1), DVec3::ZERO, DVec3::X, 0.7),
        options: options(32, 256, 200.0, f64::INFINITY),
        surface: &|ray| on_plane(ray, DVec3::ZERO, DVec3::Y),
        expected: &|_| 1.0 - occlusion,
    };
    for kind in tracers(&device) {
        let bias = case.bias(&tracer(&device, kind, &scene), &case.expectations(), &mut NoControl).unwrap();
        println!("{kind}: occlusion {occlusion:.3e}, {bias:?}");
        assert!(bias.bias.abs() < 0.02 * occlusion, "{kind}: {occlusion} {bias:?}");
    }
    assert_validation_clean(&device);
}

/// Every sample of an image has the value `want`, exactly; `spare` samples of a million may not.
fn check_exact(
    device: &Arc<Device>,
    what: &str,
    scene: &Scene,
    camera: &Camera,
    want: f32,
    spare: impl Fn(TracerKind) -> f64,
) {
    let options = options(96, 16_u32.div_ceil(common::divisor()), 1.0, f64::INFINITY);
    for kind in tracers(device) {
        let tracer = tracer(device, kind, scene);
        let image = closed_forms::render(&tracer, scene, camera, &options, &mut NoControl)
            .unwrap_or_else(|e| panic!("{what} {kind}: {e}"));
        let (covered, off) = closed_forms::samples_off(&image.image.film, image.image.spp, want);
        println!("{what} {kind}: {off} of {covered} samples are not {want}");
        assert!(
            covered
                >= 0.25 * options.samples.size[0] as f64 * options.samples.size[1] as f64 * options.samples.spp as f64,
            "{what} {kind}: {covered} covered"
        );
        assert!(off <= spare(kind) * 1e-6 * covered, "{what} {kind}: {off} of {covered} samples are not {want}");
    }
}

/// A plane never occludes itself: not one ray, at any scale, position or tilt.
#[test]
fn gpu_ao_plane_is_one() {
    let device = device();
    for place in places() {
        let what = format!("plane, scale {}, offset {}", place.scale, place.offset);
        let scene = analytic::plane(10.0, place);
        check_exact(&device, &what, &scene, &scene.cameras[0], 1.0, |_| 0.0);
        // all of it in the world's coordinates, which rounds the corners
        if can_bake(&place) {
            let baked = builtin::bake(&scene);
            check_exact(&device, &format!("{what}, baked"), &baked, &baked.cameras[0], 1.0, |_| 0.0);
        }
        // turned by its instance's transform, which is baked into the vertices, or, with a second instance out of sight, is not
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.7, -0.4, 1.1);
        let about = DAffine3::from_translation(place.offset)
            * DAffine3::from_quat(turn)
            * DAffine3::from_translation(-place.offset);
        let mut tilted = scene.clone();
        tilted.instances[0].object_to_world = about * tilted.instances[0].object_to_world;
        tilted.cameras[0].camera_to_world = about * tilted.cameras[0].camera_to_world;
        check_exact(&device, &format!("{what}, tilted"), &tilted, &tilted.cameras[0], 1.0, |_| 0.0);
        let mut two = tilted.clone();
        let mut second = two.instances[0].clone();
        second.object_to_world = DAffine3::from_translation(about.transform_vector3(DVec3::Y) * (-20.0 * place.scale))
            * second.object_to_world;
        two.instances.push(second);
        check_exact(&device, &format!("{what}, tilted, instanced"), &two, &two.cameras[0], 1.0, |_| 0.0);
    }
    assert_validation_clean(&device);
}

fn mesh_scene(mesh: TriangleMesh, camera: Camera) -> Scene {
    Scene {
        meshes: vec![Mesh { name: "mesh".into(), geometry: Geometry::Triangles(mesh), material: 0, source: None }],
        instances: vec![Instance { name: "mesh".into(), mesh: 0, object_to_world: DAffine3::IDENTITY }],
        materials: vec![Material::default()],
        cameras: vec![camera],
        ..Scene::default()
    }
}

/// The square [-1, 1]^2 cut unevenly: `levels` times the quarter around the origin is cut out and filled with a square of half
/// the size, so that triangles of size 1 meet triangles of size 2^-levels. Every corner is a dyadic number: on a plane whose
/// slopes are, too, all corners lie in it exactly.
fn uneven_square(levels: i32) -> (Vec<[f64; 2]>, Vec<[u32; 3]>) {
    let mut points = Vec::new();
    for level in 0..=levels {
        let h = 0.5f64.powi(level);
        points.extend([[-h, -h], [h, -h], [h, h], [-h, h]]);
    }
    let mut triangles = Vec::new();
    for level in 0..levels as u32 {
        let (outer, inner) = (4 * level, 4 * level + 4);
        for k in 0..4 {
            let next = (k + 1) % 4;
            triangles.push([outer + k, outer + next, inner + k]);
            triangles.push([outer + next, inner + next, inner + k]);
        }
    }
    let last = 4 * levels as u32;
    triangles.extend([[last, last + 1, last + 2], [last, last + 2, last + 3]]);
    (points, triangles)
}

/// Huge triangles next to tiny ones, and slivers, exactly in one plane, near the origin and far from it.
#[test]
fn gpu_ao_uneven_plane_is_one() {
    let device = device();
    let levels = 10;
    let (points, triangles) = uneven_square(levels);
    // slopes whose products with the corners are exact
    for (name, slope) in [("flat", [0.0, 0.0]), ("tilted", [0.5, -0.25])] {
        // far: corners keep all their digits
        for (size, offset) in [(1.0, DVec3::ZERO), (1024.0, DVec3::ZERO), (1.0, DVec3::new(2048.0, 512.0, -1024.0))] {
            let place = |p: [f64; 2]| DVec3::new(p[0], slope[0] * p[0] + slope[1] * p[1], p[1]) * size + offset;
            let positions: Vec<Vec3> = points.iter().map(|&p| place(p).as_vec3()).collect();
            for (&p, v) in points.iter().zip(&positions) {
                assert_eq!(place(p), v.as_dvec3(), "a corner is rounded");
            }
            // counter-clockwise seen from above: z is down in the plan
            let indices: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
            let up = DVec3::new(-slope[0], 1.0, -slope[1]).normalize();
            // from far, from near its middle where triangles are tiny, and along the surface
            let views = [(1.5, 1.3), (2.0 * 0.5f64.powi(levels), 1.3), (0.02, 1.0)];
            for (k, (distance, fov)) in views.into_iter().enumerate() {
                let along = if k == 2 { DVec3::new(-0.4, -0.2, 0.1) } else { DVec3::ZERO };
                let target = place([0.0, 0.0]);
                let eye = target + (up * distance + along) * size;
                let camera = Camera::look_at(eye, target, DVec3::X, fov);
                let mesh =
                    TriangleMesh { positions: positions.clone(), indices: indices.clone(), ..Default::default() };
                let scene = mesh_scene(mesh, camera);
                let what = format!("uneven plane, {name}, size {size}, offset {offset}, view {k}");
                check_exact(&device, &what, &scene, &scene.cameras[0], 1.0, |_| 0.0);
            }
        }
    }
    assert_validation_clean(&device);
}

/// From inside a closed box everything is occluded: not one ray gets out through an edge or a corner. The hardware tracers'
/// watertightness is their driver's affair (lavapipe lets a few rays aimed at edges through): they may lose one in 100 000.
#[test]
fn gpu_ao_closed_box_is_zero() {
    let device = device();
    let spare = |kind| if kind == TracerKind::Compute { 0.0 } else { 10.0 };
    for place in places() {
        let what = format!("closed box, scale {}, offset {}", place.scale, place.offset);
        let scene = analytic::closed_box(2.0, place);
        check_exact(&device, &what, &scene, &scene.cameras[0], 0.0, spare);
        if can_bake(&place) {
            let baked = builtin::bake(&scene);
            check_exact(&device, &format!("{what}, baked"), &baked, &baked.cameras[0], 0.0, spare);
        }
        let mut ball = scene.clone();
        // around the camera too
        ball.meshes[0].geometry = shapes::icosphere(1.5, 3);
        check_exact(
            &device,
            &format!("inside of an icosphere, scale {}", place.scale),
            &ball,
            &ball.cameras[0],
            0.0,
            spare,
        );
    }
    assert_validation_clean(&device);
}

/// About a shading normal that leans by an angle from the geometric one, the directions below the surface, (1 - cos) / 2 of
/// them, meet the inside of a closed body; the others leave it.
#[test]
fn gpu_ao_about_shading_normals() {
    use skylit::integrators::ao::Hemisphere;
    let device = device();
    let lean = 40f64.to_radians();
    let mut scene = analytic::closed_box(2.0, SceneTransform::default());
    let Geometry::Triangles(mesh) = &mut scene.meshes[0].geometry else { panic!() };
    mesh.normals = vec![Vec3::new(lean.sin() as f32, lean.cos() as f32, 0.0); mesh.positions.len()];
    let camera = Camera::look_at(DVec3::new(0.1, 2.0, 0.2), DVec3::Y, DVec3::X, 0.8);
    for (hemisphere, want) in [(Hemisphere::Shading, (1.0 + lean.cos()) / 2.0), (Hemisphere::Geometric, 1.0)] {
        check(
            &device,
            &Case {
                what: &format!("top of a box, {hemisphere:?} normal"),
                scene: &scene,
                camera: camera.clone(),
                options: AoOptions {
                    occlusion: Occlusion { hemisphere, ..Default::default() },
                    ..options(32, 512, 1.0, f64::INFINITY)
                },
                surface: &|ray| on_plane(ray, DVec3::Y, DVec3::Y).filter(|p| p.x.abs().max(p.z.abs()) < 0.999),
                expected: &|_| want,
            },
        );
    }
    assert_validation_clean(&device);
}
