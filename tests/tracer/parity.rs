//! The parity gate: one ray set through every tracer and the f64 oracle. Rays per scene: at least a million with `./scripts/test.sh --full` and by itself, a quarter of
//! them in continuous integration.

use skylit::accel::BuildPreset;
use skylit::accel::flatten::FlatScene;
use skylit::accel::lab::influence::{InfluenceArea, Placement, areas_of_scene};
use skylit::accel::lab::{HeuristicChoice, LabRay, RayDistribution};
use skylit::film::{NoControl, camera};
use skylit::gpu::Device;
use skylit::integrators::rays::{Mode, trace};
use skylit::measure::parity::{judge_any, judge_closest, judge_pair, judge_weights};
use skylit::measure::ray_sets::{leak_rays, leak_scenes, mixed_rays, random_rays};
use skylit::oracle::Oracle;
use skylit::oracle::rounding::Rounding;
use skylit::ray::Ray;
use skylit::scene::Scene;
use skylit::tracer::{BuildOptions, ComputeOptions, Kernel, LocalOptions, Tracer, TracerKind, TriangleTest};
use std::sync::Arc;

use crate::common;
use crate::common::{assert_validation_clean, device, scene, tracer, tracers};

/// Unexplained mismatches that the gate lets pass.
const BOUND: f64 = 1e-5;

/// Rays per scene: at least a million, or what `SKYLIT_PARITY_RAYS` says.
fn ray_count() -> usize {
    std::env::var("SKYLIT_PARITY_RAYS").ok().map_or(1_000_000, |n| n.parse().expect("SKYLIT_PARITY_RAYS is a number"))
}

/// A third random, a third from the camera, a third ambient occlusion rays of the camera's hits.
fn ray_set(oracle: &Oracle, scene: &Scene, total: usize) -> Vec<Ray> {
    mixed_rays(oracle, &camera::choose(scene, &camera::Choice::Auto, 1.0).unwrap(), total, 1)
}

/// The compute tracer's kernels that a scene of any size can be sent through.
const TREES: [Kernel; 4] = [Kernel::Wide, Kernel::Packet, Kernel::Nearest, Kernel::Direction];

fn gate(device: &Arc<Device>, name: &str, scene: &Scene, total: usize) {
    // each kernel of the compute tracer is judged as a tracer of its own
    let all = tracers(device).into_iter().flat_map(|kind| match kind {
        TracerKind::Compute => TREES.map(|kernel| (kind, kernel)).to_vec(),
        _ => vec![(kind, Kernel::default())],
    });
    gate_of(device, name, scene, total, &all.collect::<Vec<_>>());
}

fn gate_of(device: &Arc<Device>, name: &str, scene: &Scene, total: usize, all: &[(TracerKind, Kernel)]) {
    let oracle = Oracle::new(scene, scene.origin());
    let rays = ray_set(&oracle, scene, total);
    assert!(rays.len() >= total);
    let (truth, occluded) = (oracle.trace_closest(&rays), oracle.trace_any(&rays));
    let rounding = Rounding::default();
    let mut first: Option<Vec<_>> = None;
    for &(kind, kernel) in all {
        let tracer = Tracer::with_options(device, kind, &FlatScene::new(scene), common::ALL, kernel).unwrap();
        let kind = match tracer.compute_options() {
            Some(o) => format!("{kind} ({})", o.kernel),
            None => kind.to_string(),
        };
        let (hits, _) = trace(&tracer, &rays, Mode::Closest, 1, &mut NoControl).unwrap();
        let report = judge_closest(&oracle, &rays, &hits, &truth, rounding);
        println!("{name} {kind} closest against the oracle: {report}");
        assert!(report.unexplained_fraction() <= BOUND, "{name} {kind}: {report}");
        assert!(report.hits > report.rays / 10, "{name}: the set hardly meets the scene");
        // ties are for edges: were they common, the judge would be too kind
        assert!(report.ties < report.rays / 50, "{name} {kind}: {report}");
        let report = judge_weights(&oracle, &rays, &hits, rounding);
        assert!(report.unexplained_fraction() <= BOUND, "{name} {kind} weights: {report}");
        let (any, _) = trace(&tracer, &rays, Mode::Any, 1, &mut NoControl).unwrap();
        let any: Vec<bool> = any.iter().map(|h| h.is_hit()).collect();
        let report = judge_any(&oracle, &rays, &any, &occluded, rounding);
        println!("{name} {kind} any     against the oracle: {report}");
        assert!(report.unexplained_fraction() <= BOUND, "{name} {kind} any: {report}");
        if let Some(first) = &first {
            let report = judge_pair(&oracle, &rays, &hits, first, rounding);
            println!("{name} {kind} closest against the first tracer: {report}");
            assert!(report.unexplained_fraction() <= BOUND, "{name} {kind} pair: {report}");
        } else {
            first = Some(hits);
        }
    }
    assert_validation_clean(device);
}

#[test]
fn gpu_parity_cornell() {
    gate(&device(), "cornell-box", &scene("cornell-box"), ray_count());
}

#[test]
fn gpu_parity_sphere_over_plane() {
    gate(&device(), "sphere-over-plane", &scene("sphere-over-plane"), ray_count());
}

#[test]
fn gpu_parity_instances() {
    gate(&device(), "grid:8", &scene("grid:8"), ray_count());
}

#[test]
fn gpu_parity_alpha_masks() {
    gate(&device(), "leaf-cards", &scene("leaf-cards"), ray_count());
}

#[test]
fn gpu_parity_spheres() {
    gate(&device(), "spheres:500", &scene("spheres:500"), ray_count());
}

#[test]
fn gpu_parity_far_from_the_origin() {
    gate(&device(), "far-away", &scene("far-away"), ray_count());
}

/// Every order of traversal and none at all, on scenes small enough for none: triangles, spheres, instances, alpha.
#[test]
fn gpu_parity_brute_force() {
    let device = device();
    let kernels = Kernel::ALL.map(|kernel| (TracerKind::Compute, kernel));
    for (name, rays) in
        [("cornell-box", 60_000), ("cornell-spheres", 60_000), ("spheres:100", 40_000), ("grid:2", 30_000)]
    {
        gate_of(&device, name, &scene(name), rays.min(ray_count() / 3), &kernels);
    }
    gate_of(&device, "leaf-cards", &scene("leaf-cards"), 30_000.min(ray_count() / 3), &kernels);
}

/// What is too much for brute force is refused, with the number.
#[test]
fn gpu_brute_force_has_a_limit() {
    let scene = scene(&format!("spheres:{}", Kernel::MAX_BRUTE_TESTS + 1));
    let flat = FlatScene::new(&scene);
    let result = Tracer::with_options(&device(), TracerKind::Compute, &flat, common::ALL, Kernel::Brute);
    let Err(e) = result else { panic!("{} primitives were taken", flat.primitive_count()) };
    assert!(e.to_string().contains("--traversal") && e.to_string().contains("40000"), "{e}");
}

#[test]
fn gpu_parity_sponza() {
    let Some(folder) = common::shared_scenes() else { return };
    let path = folder.join("sponza/sponza.glb");
    gate(&device(), "sponza", &skylit::scene::load::load(&path.to_string_lossy()).unwrap(), ray_count());
}

/// Spatial splits leave a triangle in several leaves, cut where it is cut: not one ray may tell. Its nearest hit is at the same
/// distance to the bit, as both trees hold the same triangles.
#[test]
fn gpu_parity_of_builds() {
    let device = device();
    for name in ["leaf-cards", "cornell-box", "spheres:500"] {
        let scene = scene(name);
        let oracle = Oracle::new(&scene, scene.origin());
        let rays = ray_set(&oracle, &scene, 200_000);
        let distances = |preset, on_device, mode| {
            let build = BuildOptions { preset: Some(preset), on_device, ..Default::default() };
            let (flat, options) = (FlatScene::new(&scene), ComputeOptions::default());
            let t = Tracer::with_build(&device, TracerKind::Compute, &flat, common::ALL, options, &build).unwrap();
            let hits = trace(&t, &rays, mode, 1, &mut NoControl).unwrap().0;
            hits.iter().map(|h| if mode == Mode::Any { h.is_hit() as u32 } else { h.t.to_bits() }).collect::<Vec<_>>()
        };
        for mode in [Mode::Closest, Mode::Any] {
            let expected = distances(BuildPreset::Fast, None, mode);
            for (preset, on_device) in
                [(BuildPreset::Default, None), (BuildPreset::Best, None), (BuildPreset::Default, Some(0))]
            {
                assert!(distances(preset, on_device, mode) == expected, "{name} {preset:?} {on_device:?} {mode:?}");
            }
        }
    }
    assert_validation_clean(&device);
}

/// Trees by the rules of the laboratory, for rays of a direction and of a point, through the binary kernel: the distances are those
/// of its other builds to the bit, in a scene of one level and in one of two.
#[test]
fn gpu_parity_of_heuristics() {
    let device = device();
    for name in ["cornell-box", "grid:3", "cornell-spheres"] {
        let scene = scene(name);
        let oracle = Oracle::new(&scene, scene.origin());
        let rays = ray_set(&oracle, &scene, 60_000.min(ray_count()));
        let distances = |build: &BuildOptions, mode| {
            let (flat, options) = (FlatScene::new(&scene), ComputeOptions::from(Kernel::Nearest));
            let t = Tracer::with_build(&device, TracerKind::Compute, &flat, common::ALL, options, build).unwrap();
            let hits = trace(&t, &rays, mode, 1, &mut NoControl).unwrap().0;
            hits.iter().map(|h| if mode == Mode::Any { h.is_hit() as u32 } else { h.t.to_bits() }).collect::<Vec<_>>()
        };
        for mode in [Mode::Closest, Mode::Any] {
            let expected = distances(&BuildOptions::default(), mode);
            for (choice, distribution) in [
                (HeuristicChoice::SahLongest, RayDistribution::Uniform),
                (HeuristicChoice::SahSpfh, RayDistribution::Parallel(glam::DVec3::new(0.3, -1.0, 0.2))),
                (HeuristicChoice::Pah, RayDistribution::Point(glam::DVec3::new(0.1, 1.2, 0.3))),
                (HeuristicChoice::PahSpfh, RayDistribution::Parallel(glam::DVec3::NEG_Y)),
            ] {
                let build = BuildOptions { heuristic: Some(choice.heuristic(distribution)), ..Default::default() };
                assert!(distances(&build, mode) == expected, "{name} {choice:?} {mode:?}");
            }
        }
    }
    // no other kernel takes them
    let scene = scene("cornell-box");
    let heuristic = Some(HeuristicChoice::Sah.heuristic(RayDistribution::Uniform));
    let build = BuildOptions { heuristic, ..Default::default() };
    let wide = ComputeOptions::from(Kernel::Wide);
    let refused = Tracer::with_build(&device, TracerKind::Compute, &FlatScene::new(&scene), common::ALL, wide, &build);
    let Err(e) = refused else { panic!("the wide kernel took a heuristic") };
    assert!(e.exit_code() == 64 && e.to_string().contains("--traversal nearest"), "{e}");
    assert_validation_clean(&device);
}

/// Trees of influence areas change no hit: not of rays that start in an area and agree with its own, of which many hit within the
/// area and many beyond it, and not of any other. The scenes are of one level and of two, with spheres and alpha, some far from
/// the origin, and their areas are found by a list or by an octree.
#[test]
fn gpu_parity_of_influence_areas() {
    use glam::{DAffine3, DVec3};
    let device = device();
    let mut far = scene("grid:3");
    far.cameras.clear();
    far.instances.iter_mut().for_each(|i| {
        i.object_to_world = DAffine3::from_translation(DVec3::new(3e4, -2e3, 5e4)) * i.object_to_world;
    });
    let mut scenes: Vec<(&str, Scene)> =
        ["cornell-box", "grid:3", "cornell-spheres", "leaf-cards"].map(|name| (name, scene(name))).into();
    scenes.push(("grid:3, far away", far));
    for (name, scene) in &scenes {
        let flat = FlatScene::new(scene);
        let (lo, hi) = scene.bounds().unwrap();
        let (middle, size) = ((lo + hi) * 0.5, hi - lo);

        // a box of parallel rays and a frustum that both end within the scene, and those of its lights and camera
        let sun = DVec3::new(0.3, -1.0, 0.2).normalize();
        let placement = |kind: &str, origin: DVec3, direction: DVec3, far: f64| -> Placement {
            let side = size.max_element();
            serde_json::from_value(serde_json::json!({
                "kind": kind, "origin": origin.to_array(), "direction": direction.to_array(), "half_width": 0.6 * side,
                "half_height": 0.3 * side, "fov_x_degrees": 110, "fov_y_degrees": 80, "far": far,
            }))
            .unwrap()
        };
        let lamp = middle + size * DVec3::new(0.1, 0.3, 0.2);
        let given = [
            placement("plane", middle - sun * size.length() * 0.5, sun, 0.6 * size.length()),
            placement("point", lamp, DVec3::new(0.1, -1.0, 0.1), 0.5 * size.length()),
        ];
        let few: Vec<InfluenceArea> = given.iter().map(|p| p.area(DVec3::ZERO)).collect();
        let own = areas_of_scene(scene, &[camera::choose(scene, &camera::Choice::Auto, 1.0).unwrap()], DVec3::ZERO);
        let many: Vec<InfluenceArea> = few.iter().chain(&own).cycle().take(12).cloned().collect();

        // rays of every kind, and half of them turned towards the sun or the lamp
        let oracle = Oracle::new(scene, scene.origin());
        let mut rays = ray_set(&oracle, scene, 60_000.min(ray_count()));
        let at_lamp = (lamp - flat.origin).as_vec3();
        for (k, ray) in rays.iter_mut().enumerate() {
            let origin = glam::Vec3::from_array(ray.origin);
            match k % 4 {
                0 => ray.direction = sun.as_vec3().to_array(),
                1 => ray.direction = (-sun).as_vec3().to_array(),
                2 if origin != at_lamp => ray.direction = (at_lamp - origin).to_array(),
                _ => {}
            }
        }
        let affine =
            rays.iter().filter(|r| few.iter().any(|a| a.relative_to(flat.origin).is_affine(&LabRay::from(*r))));
        assert!(affine.count() > rays.len() / 10, "{name}: hardly a ray is asked for an area");

        let distances = |local: Option<LocalOptions>, kernel, mode| {
            let build = BuildOptions { local, ..Default::default() };
            let areas = build.local.as_ref().map_or(0, |l| l.areas.as_ref().map_or(1, |a| a.len() as u32));
            let t = Tracer::with_build(&device, TracerKind::Compute, &flat, common::ALL, kernel, &build).unwrap();
            assert!(t.stats().areas >= areas && (areas == 0) == (t.stats().area_primitives == 0), "{name}");
            let hits = trace(&t, &rays, mode, 1, &mut NoControl).unwrap().0;
            hits.iter().map(|h| if mode == Mode::Any { h.is_hit() as u32 } else { h.t.to_bits() }).collect::<Vec<_>>()
        };
        let heuristic = HeuristicChoice::PahSpfh.heuristic(RayDistribution::Uniform);
        for mode in [Mode::Closest, Mode::Any] {
            let expected = distances(None, Kernel::Nearest.into(), mode);
            for (kernel, areas) in
                [(Kernel::Nearest, Some(few.clone())), (Kernel::Direction, Some(many.clone())), (Kernel::Nearest, None)]
            {
                let camera = camera::choose(scene, &camera::Choice::Auto, 1.0).ok();
                let count = areas.as_ref().map(Vec::len);
                let found = distances(Some(LocalOptions { areas, camera, heuristic }), kernel.into(), mode);
                let differing = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(differing, 0, "{name} {kernel} {mode:?}, areas: {count:?}");
            }
        }
    }
    assert_validation_clean(&device);
}

/// The 32-bit loads that devices without shaderInt64 take give the same hits, bit for bit.
#[test]
fn gpu_parity_without_int64() {
    let narrow = common::open(skylit::gpu::Options { no_int64: true, ..common::validated() });
    let wide = device();
    assert!(!narrow.info.int64);
    let scene = scene("leaf-cards");
    let oracle = Oracle::new(&scene, scene.origin());
    let rays = ray_set(&oracle, &scene, 100_000);
    let hits = |d: &Arc<Device>| {
        let t = tracer(d, TracerKind::Compute, &scene);
        trace(&t, &rays, Mode::Closest, 1, &mut NoControl).unwrap().0
    };
    assert_eq!(hits(&narrow), hits(&wide));
    assert_validation_clean(&narrow);
}

/// Rays aimed at shared edges and corners of a closed mesh, at scales of 1e-3 to 1e6 and offsets to 1e6: the compute tracer
/// lets none through. What the hardware tracers let through is the driver's affair: Vulkan asks for watertight triangles, but
/// lavapipe 25.0 leaks a few in a thousand of such rays. It is printed, and bounded so that a fault of ours would show.
#[test]
fn gpu_nothing_leaks() {
    let device = device();
    for (what, scene) in leak_scenes() {
        let oracle = Oracle::new(&scene, scene.origin());
        let rays = leak_rays(&oracle, ray_count() / 10, 7);
        let kernels = |kind| if kind == TracerKind::Compute { TREES.to_vec() } else { vec![Kernel::default()] };
        for (kind, kernel) in
            tracers(&device).into_iter().flat_map(|kind| kernels(kind).into_iter().map(move |k| (kind, k)))
        {
            let flat = FlatScene::new(&scene);
            let tracer = Tracer::with_options(&device, kind, &flat, common::ALL, kernel).unwrap();
            let (any, _) = trace(&tracer, &rays, Mode::Any, 1, &mut NoControl).unwrap();
            let (closest, _) = trace(&tracer, &rays, Mode::Closest, 1, &mut NoControl).unwrap();
            let leaks = |hits: &[skylit::ray::Hit]| hits.iter().filter(|h| !h.is_hit()).count();
            let (a, c) = (leaks(&any), leaks(&closest));
            println!("{what}, {kind} ({kernel}): {a} leaks of {} any, {c} closest", rays.len());
            let allowed = if kind == TracerKind::Compute { 0 } else { rays.len() / 50 };
            assert!(a <= allowed && c <= allowed, "{what}, {kind} ({kernel}): {a} and {c} leaks");
        }
    }
    assert_validation_clean(&device);
}

/// The other triangle test finds the same hits but at edges, where rays slip through: it is the other test that runs, and the
/// rays of [`gpu_nothing_leaks`] are such that a leak would show.
#[test]
fn gpu_the_other_triangle_test_leaks() {
    use skylit::scene::builtin;
    let device = device();
    let mut sphere = scene("plane");
    sphere.meshes[0].geometry = builtin::shapes::icosphere(1.0, 5);
    let oracle = Oracle::new(&sphere, sphere.origin());
    let (edges, anywhere) = (leak_rays(&oracle, 200_000, 7), random_rays(&oracle, 100_000, 3));
    let truth = oracle.trace_closest(&anywhere);
    for kernel in TREES {
        let options = ComputeOptions { kernel, triangle_test: TriangleTest::MollerTrumbore };
        let tracer =
            Tracer::with_options(&device, TracerKind::Compute, &FlatScene::new(&sphere), common::ALL, options).unwrap();
        assert_eq!(tracer.compute_options(), Some(options));
        let hits = |rays: &[Ray]| trace(&tracer, rays, Mode::Closest, 1, &mut NoControl).unwrap().0;
        let leaks = hits(&edges).iter().filter(|h| !h.is_hit()).count();
        let differ = hits(&anywhere).iter().zip(&truth).filter(|(h, t)| h.is_hit() != t.is_hit()).count();
        println!("{kernel}: {leaks} of {} rays leak, {differ} of {} others differ", edges.len(), anywhere.len());
        // on a GPU that fuses products into sums it is more: a ninth of them
        let most = edges.len() / if device.info.is_cpu() { 10 } else { 5 };
        assert!(leaks > 0 && leaks < most, "{kernel}: {leaks} leaks");
        assert!(differ < anywhere.len() / 1000, "{kernel}: {differ} differ");
    }
    assert_validation_clean(&device);
}
