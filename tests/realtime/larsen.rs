//! Larsen's pipeline (2019) as it was: half the size, no occlusion where light is, half of the frame before, two patterns in turn.

use glam::{DAffine3, DVec3};
use skylit::accel::flatten::FlatScene;
use skylit::film::NoControl;
use skylit::film::camera::CameraRecord;
use skylit::integrators::ao::Occlusion;
use skylit::integrators::aov;
use skylit::oracle::{Oracle, OracleRay};
use skylit::realtime::{Preset, Realtime, Settings};
use skylit::scene::builtin::shapes;
use skylit::scene::{Camera, Motion, Scene};
use skylit::tracer::{Changes, Tracer, TracerKind};

use crate::common::{ALL, assert_validation_clean, device, picked, record};
use crate::{SIZE, frames, mean, one_tracer, scene_of, traced, triangles};

/// A floor that fills the view, and a hall around all of it, which may move away. No normal that is seen lies along z.
fn hall() -> Scene {
    let floor = triangles(shapes::floor(DVec3::ZERO, 6.0));
    let hall = triangles(shapes::cuboid(DVec3::splat(-5.0), DVec3::splat(5.0)));
    scene_of(vec![floor, hall], Camera::look_at(DVec3::new(0.1, 2.5, 0.05), DVec3::ZERO, DVec3::Z, 0.7))
}

fn tracer(device: &std::sync::Arc<skylit::gpu::Device>, kind: TracerKind, scene: &Scene) -> Tracer {
    let motion = Motion { instances: vec![1], meshes: Vec::new(), ..Motion::default() };
    Tracer::new(device, kind, &FlatScene::with_motion(scene, motion).unwrap(), ALL).unwrap()
}

fn larsen(tracer: &Tracer, size: [u32; 2], falloff: f64, lights: &[[f32; 3]]) -> Realtime {
    Realtime::new(
        tracer,
        size,
        &Settings { occlusion: Occlusion::new(f64::INFINITY, falloff), ..traced(Preset::Larsen) },
        lights,
    )
    .unwrap()
}

fn all(values: &[f32], want: f32) -> bool {
    // the box's nine weights of a ninth round
    values.iter().all(|v| (v - want).abs() <= 1e-6)
}

fn view(scene: &Scene, size: [u32; 2]) -> CameraRecord {
    record(scene, &scene.cameras[0], size)
}

#[test]
fn gpu_larsen_takes_half_of_the_frame_before() {
    let device = device();
    let scene = hall();
    let away = [(1, DAffine3::from_translation(DVec3::X * 1000.0))];
    let back = [(1, DAffine3::IDENTITY)];
    for kind in picked(&device) {
        let mut tracer = tracer(&device, kind, &scene);
        // a hit counts 1, wherever
        let mut realtime = larsen(&tracer, SIZE, 1.0, &[]);
        let mut steps = Vec::new();
        for (changes, want) in [(&back, 0.0), (&away, 0.5), (&away, 0.75), (&away, 0.875), (&back, 0.4375)] {
            let moved = tracer.update(&Changes { instances: changes.to_vec(), ..Changes::default() }).unwrap().moved;
            realtime.frame(&tracer, &view(&scene, SIZE), &moved).unwrap();
            let result = realtime.result().unwrap();
            assert!(realtime.coverage().unwrap().iter().all(|c| *c == 1.0), "{kind}: the floor does not fill the view");
            assert!(all(&result, want), "{kind}: {} where {want} was due", result[7]);
            steps.push(result[7]);
        }
        println!("{kind}: {steps:?}");
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_larsen_traces_a_quarter_of_the_pixels_and_none_that_is_lit() {
    let device = device();
    let mut scene = hall();
    // a screen that throws a shadow over part of the floor
    scene.meshes.push(skylit::scene::Mesh {
        name: "screen".into(),
        geometry: shapes::rectangle(DVec3::new(-1.5, 0.6, 0.0), DVec3::Y * 0.6, DVec3::Z * 0.8),
        material: 0,
        source: None,
    });
    scene.instances.push(skylit::scene::Instance {
        name: "screen".into(),
        mesh: 2,
        object_to_world: DAffine3::IDENTITY,
    });
    let eye = scene.cameras[0].camera_to_world.translation.as_vec3().to_array();
    let lamp = DVec3::new(-3.0, 1.2, 0.1);
    let oracle = Oracle::new(&scene, DVec3::ZERO);
    for kind in one_tracer(&device) {
        let tracer = tracer(&device, kind, &scene);
        for size in [[64u32, 36], [61, 35]] {
            let half = size.map(|n| n.div_ceil(2));
            let quarter = u64::from(half[0] * half[1]);
            let run = |lights: &[[f32; 3]]| {
                let mut realtime = larsen(&tracer, size, 1.0, lights);
                let stats = frames(&mut realtime, &tracer, &view(&scene, size), 2);
                assert_eq!(stats[0].occlusion_rays, stats[1].occlusion_rays);
                (stats[1].occlusion_rays, realtime.result().unwrap())
            };
            // no light, and one that nobody sees
            for lights in [&[][..], &[[100.0, 0.0, 0.0]]] {
                let (rays, result) = run(lights);
                assert_eq!(rays, 64 * quarter, "{kind}");
                assert!(all(&result, 0.0), "{kind}");
            }
            // one that everybody sees, alone and with one that nobody sees
            for lights in [&[eye][..], &[[100.0, 0.0, 0.0], eye]] {
                let (rays, result) = run(lights);
                assert_eq!(rays, 0, "{kind}");
                assert!(result.iter().all(|v| *v == 1.0), "{kind}: occlusion where light is");
            }
            let (rays, result) = run(&[lamp.as_vec3().to_array()]);
            let seen = aov::render(&tracer, &view(&scene, size), size, &mut NoControl).unwrap();
            let dark = |i: usize| {
                let p = DVec3::from_array(seen[i].position.map(f64::from)) + DVec3::Y * 1e-3;
                oracle
                    .closest(OracleRay { origin: p, direction: (lamp - p).normalize(), tmin: 0.0, tmax: f64::INFINITY })
                    .t
                    < (lamp - p).length()
            };
            let at = |x: u32, y: u32| ((2 * y).min(size[1] - 1) * size[0] + (2 * x).min(size[0] - 1)) as usize;
            let want =
                (0..half[1]).flat_map(|y| (0..half[0]).map(move |x| (x, y))).filter(|&(x, y)| dark(at(x, y))).count()
                    as u64;
            assert!(want > quarter / 20 && want < quarter * 19 / 20, "{kind}: {want} of {quarter} are dark");
            // at the shadow's edge rounding decides
            assert!(rays.abs_diff(64 * want) <= 64 * 2, "{kind}: {rays} rays, {want} pixels in the dark");
            let open = result.iter().filter(|v| **v == 1.0).count();
            assert!(open > result.len() / 8 && open < result.len(), "{kind}: {open}");
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_larsen_has_two_patterns_in_turn() {
    let device = device();
    let scene = hall();
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        // distances count, so that directions show
        let mut realtime = larsen(&tracer, SIZE, 1.3, &[]);
        let mut results: Vec<Vec<f32>> = Vec::new();
        for _ in 0..6 {
            let stats = realtime.frame(&tracer, &view(&scene, SIZE), &[]).unwrap();
            // it never rests
            assert_eq!(stats.primary_rays, u64::from(SIZE[0] * SIZE[1]));
            results.push(realtime.result().unwrap());
        }
        // a frame's own part of its half
        let own = |k: usize| {
            results[k]
                .iter()
                .zip(&results[k - 1])
                .map(|(now, before)| f64::from(2.0 * now - before))
                .collect::<Vec<_>>()
        };
        let apart = |a: usize, b: usize| mean(own(a).iter().zip(own(b)).map(|(a, b)| (a - b).abs()));
        println!("{kind}: {:.1e} from frame to frame, {:.1e} over two", apart(2, 3), apart(2, 4));
        assert!(apart(2, 4) < 1e-6 && apart(3, 5) < 1e-6, "{kind}: {} {}", apart(2, 4), apart(3, 5));
        assert!(apart(2, 3) > 1e-4, "{kind}: {}", apart(2, 3));
    }
    assert_validation_clean(&device);
}
