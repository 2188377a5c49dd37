//! What is shown of frames, against what the host makes of the same numbers.

use glam::{DVec3, Vec2, Vec3, Vec4};
use skylit::Error;
use skylit::accel::flatten::FlatScene;
use skylit::colour::srgb_byte;
use skylit::film::camera::CameraRecord;
use skylit::integrators::ao::Occlusion;
use skylit::output::tone_map::ToneMap;
use skylit::ray::Ray;
use skylit::realtime::display::{Display, DisplayMode};
use skylit::realtime::{FrameStats, Preset, Realtime, Resolution, Settings};
use skylit::scene::Camera;
use skylit::scene::builtin::{SceneTransform, analytic, by_name};
use skylit::tracer::visits::VisitCounter;
use skylit::tracer::{Tracer, TracerKind};

use crate::common::{assert_validation_clean, device, picked, record, tracer, tracers};

const SIZE: [u32; 2] = [93, 50];

fn display(shown: DisplayMode, exposure: f32) -> Display {
    Display { shown, exposure, unit: 2.0, tone_map: ToneMap::Linear }
}

/// A frame as it is shown, after `frames` before it.
fn show(tracer: &Tracer, realtime: &mut Realtime, camera: &CameraRecord, frames: u32, shown: Display) -> Vec<[u8; 4]> {
    for _ in 0..frames {
        realtime.frame(tracer, camera, &[]).unwrap();
    }
    realtime.display(tracer, Some(shown)).unwrap();
    realtime.frame(tracer, camera, &[]).unwrap();
    words(realtime)
}

fn words(realtime: &Realtime) -> Vec<[u8; 4]> {
    let bytes = realtime.displayed().unwrap().read(0, 4 * u64::from(SIZE[0] * SIZE[1])).unwrap();
    bytes.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect()
}

/// Grey within `off` bytes of what the host encodes.
#[track_caller]
fn assert_grey(shown: &[[u8; 4]], linear: &[f32], gain: f32, off: u8) {
    assert_eq!(shown.len(), linear.len());
    for (at, (word, value)) in shown.iter().zip(linear).enumerate() {
        let expected = srgb_byte(value * gain);
        assert!(word[0] == word[1] && word[1] == word[2] && word[3] == 255, "pixel {at}: {word:?}");
        assert!(word[0].abs_diff(expected) <= off, "pixel {at}: {} for {value}, which is {expected}", word[0]);
    }
}

#[test]
fn gpu_displayed_visibility_has_the_bytes_of_a_png() {
    let device = device();
    let scene = by_name("stairs").unwrap();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        for preset in [Preset::Balanced, Preset::Larsen] {
            // with a falloff samples take all values
            let settings = Settings { occlusion: Occlusion::new(f64::INFINITY, 2.0), ..preset.settings() };
            let mut realtime = Realtime::new(&tracer, SIZE, &settings, &[]).unwrap();
            let mut bytes = std::collections::BTreeSet::new();
            for exposure in [0.0, 0.7, -1.6, -3.3f32] {
                let shown = show(&tracer, &mut realtime, &camera, 1, display(DisplayMode::Result, exposure));
                assert_grey(&shown, &realtime.result().unwrap(), exposure.exp2(), 0);
                bytes.extend(shown.iter().map(|w| w[0]));
            }
            assert!(bytes.len() > 120, "{kind}: only {} different bytes", bytes.len());
            let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Unfiltered, 0.0));
            assert_grey(&shown, &realtime.unfiltered().unwrap(), 1.0, 0);
        }
    }
    assert_validation_clean(&device);
}

#[test]
fn gpu_displayed_numbers() {
    let device = device();
    // a square that does not fill the image
    let scene = analytic::plane(20.0, SceneTransform::default());
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let kind = tracers(&device)[0];
    let tracer = tracer(&device, kind, &scene);
    let settings = Settings { bent: true, filter: Preset::Fast.settings().filter, ..Preset::Balanced.settings() };
    let mut realtime = Realtime::new(&tracer, SIZE, &settings, &[]).unwrap();
    let covered = |realtime: &Realtime| realtime.coverage().unwrap();
    let expect = |shown: Vec<[u8; 4]>, coverage: &[f32], colour: [f32; 3], what: &str| {
        let bytes = colour.map(srgb_byte);
        assert!(coverage.contains(&1.0) && coverage.contains(&0.0));
        for (word, c) in shown.iter().zip(coverage) {
            let expected = if *c == 1.0 { bytes } else { [0; 3] };
            assert!(
                (0..3).all(|k| word[k].abs_diff(expected[k]) <= 1) && word[3] == 255,
                "{what}: {word:?}, not {expected:?}"
            );
        }
    };
    let shown = show(&tracer, &mut realtime, &camera, 3, display(DisplayMode::Samples, 0.0));
    expect(shown, &covered(&realtime), [4.0 / 64.0; 3], "four samples of 64");
    // an open plane has no variance, and its bent normal is two thirds of the normal
    let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Variance, 0.0));
    expect(shown, &covered(&realtime), [0.0; 3], "variance");
    let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Normal, 0.0));
    expect(shown, &covered(&realtime), [0.5, 1.0, 0.5], "normal");
    let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Normal, -1.0));
    expect(shown, &covered(&realtime), [0.25, 0.5, 0.25], "normal, half as bright");
    let shown = show(&tracer, &mut realtime, &camera, 250, display(DisplayMode::Bent, 0.0));
    let middle = shown[(SIZE[1] / 2 * SIZE[0] + SIZE[0] / 2) as usize];
    let expected = [0.5, 5.0 / 6.0, 0.5].map(srgb_byte);
    assert!((0..3).all(|k| middle[k].abs_diff(expected[k]) <= 12), "bent: {middle:?}, not {expected:?}");
    assert_validation_clean(&device);
}

#[test]
fn gpu_displayed_distances() {
    let device = device();
    let scene = analytic::plane(1e3, SceneTransform::default());
    // from above, all at one depth; a metre of the floor is as wide as the image is high
    let camera = Camera::look_at(DVec3::Y * 6.0, DVec3::ZERO, DVec3::NEG_Z, 2.0 * (0.5f64 / 6.0).atan());
    let camera = CameraRecord::new(&camera, scene.origin(), f64::from(SIZE[0]) / f64::from(SIZE[1]));
    let tracer = tracer(&device, tracers(&device)[0], &scene);
    let mut realtime = Realtime::new(&tracer, SIZE, &Preset::Fast.settings(), &[]).unwrap();
    let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Depth, 0.0));
    assert_grey(&shown, &vec![2.0 / 8.0; shown.len()], 1.0, 1);
    let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Position, 0.0));
    for (at, word) in shown.iter().enumerate() {
        let [x, y] = [at as u32 % SIZE[0], at as u32 / SIZE[0]].map(f64::from);
        let side = 1.0 / f64::from(SIZE[1]);
        // the floor's height is 0: white
        let position = [(x + 0.5 - 0.5 * f64::from(SIZE[0])) * side, 0.0, (y + 0.5 - 0.5 * f64::from(SIZE[1])) * side];
        let expected = position.map(|p| srgb_byte((1.0 - p.abs() / 2.0) as f32));
        assert!((0..3).all(|k| word[k].abs_diff(expected[k]) <= 1), "pixel {at}: {word:?}, not {expected:?}");
    }
    assert_validation_clean(&device);
}

/// Camera rays through the centres of pixels.
fn centre_rays(camera: &CameraRecord) -> Vec<Ray> {
    let rows = camera.camera_to_world.map(Vec4::from_array);
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
    let rays = pixels.map(|[x, y]| {
        let ndc = (2.0 * Vec2::new(x as f32, y as f32) + 1.0) / Vec2::new(SIZE[0] as f32, SIZE[1] as f32) - 1.0;
        let d = Vec3::new(ndc.x * camera.view[0], -ndc.y * camera.view[1], -1.0);
        let direction = Vec3::from_array(rows.map(|r| r.truncate().dot(d))).normalize();
        Ray { origin: rows.map(|r| r.w), tmin: 0.0, direction: direction.to_array(), tmax: f32::INFINITY }
    });
    rays.collect()
}

/// A plane is found in few nodes, a dense terrain in more. The heat map changes nothing else of a frame, is compiled and timed on request only, and
/// needs the compute tracer.
#[test]
fn gpu_visited_nodes_are_counted_on_request() {
    let device = device();
    let means = ["plane", "terrain:20000"].map(|name| {
        let scene = by_name(name).unwrap();
        let camera = record(&scene, &scene.cameras[0], SIZE);
        let tracer = tracer(&device, TracerKind::Compute, &scene);
        let mut realtime = Realtime::new(&tracer, SIZE, &Preset::Fast.settings(), &[]).unwrap();
        let mut plain = Realtime::new(&tracer, SIZE, &Preset::Fast.settings(), &[]).unwrap();
        realtime.display(&tracer, Some(display(DisplayMode::Nodes, 0.0))).unwrap();
        let mut nodes = None;
        // camera at rest: the second frame keeps the counts of the first
        for frame in 0..2 {
            let (counted, others) =
                (realtime.frame(&tracer, &camera, &[]).unwrap(), plain.frame(&tracer, &camera, &[]).unwrap());
            let recorded = |stats: &FrameStats| stats.timings.iter().filter(|t| t.label == "nodes").count();
            assert_eq!((recorded(&counted), recorded(&others), others.nodes), (1 - frame, 0, None), "{name}");
            assert!(frame == 0 || counted.nodes == nodes, "{name}: {nodes:?}, then {:?}", counted.nodes);
            nodes = counted.nodes;
            assert_eq!(realtime.result().unwrap(), plain.result().unwrap(), "{name}");
            assert_eq!(realtime.samples().unwrap(), plain.samples().unwrap(), "{name}");
            assert_eq!(realtime.surfaces().unwrap(), plain.surfaces().unwrap(), "{name}");
        }
        let nodes = nodes.unwrap();
        let shown = words(&realtime);
        // every ray visits the root, and no colour of the scale is black
        assert!(shown.iter().all(|w| w[3] == 255 && w[..3].iter().any(|&c| c > 60)), "{name}");
        assert!(f64::from(nodes.max) >= nodes.mean && nodes.mean >= 1.0, "{name}: {nodes:?}");
        let on_host = VisitCounter::new(&FlatScene::new(&scene)).unwrap().mean(&centre_rays(&camera), false).nodes;
        println!("{name}: {nodes:?}, counted on the host {on_host:.3}");
        // other rounding: a few rays pass a box by
        assert!((nodes.mean / on_host - 1.0).abs() < 1e-3, "{name}: {nodes:?}, not {on_host}");
        nodes.mean
    });
    assert!(means[0] < 2.0 && means[1] > 2.0 * means[0], "{means:?}");
    for kind in tracers(&device).into_iter().filter(|k| *k != TracerKind::Compute) {
        let tracer = tracer(&device, kind, &by_name("plane").unwrap());
        let mut realtime = Realtime::new(&tracer, SIZE, &Preset::Fast.settings(), &[]).unwrap();
        let error = realtime.display(&tracer, Some(display(DisplayMode::Nodes, 0.0))).unwrap_err();
        assert!(error.to_string().contains("--show nodes needs the compute tracer"), "{error}");
    }
    assert_validation_clean(&device);
}

/// As many rays as the frame says, and where it says: in a pattern. Nothing else of the frame changes.
#[test]
fn gpu_displayed_rays_are_those_of_the_frame() {
    let device = device();
    let scene = by_name("stairs").unwrap();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let decoded: Vec<f32> = (0..256).map(|byte| skylit::colour::srgb_decode(byte as f32 / 255.0)).collect();
    for kind in picked(&device) {
        let tracer = tracer(&device, kind, &scene);
        let settings =
            Settings { rays_per_pixel: 3, resolution: Resolution::Checkerboard, ..Preset::Balanced.settings() };
        let most = settings.rays_per_pixel;
        let [mut realtime, mut plain] = [(); 2].map(|()| Realtime::new(&tracer, SIZE, &settings, &[]).unwrap());
        realtime.display(&tracer, Some(display(DisplayMode::Rays, 0.0))).unwrap();
        let mut counts = std::collections::BTreeMap::new();
        for frame in 0..4 {
            let stats = realtime.frame(&tracer, &camera, &[]).unwrap();
            plain.frame(&tracer, &camera, &[]).unwrap();
            assert_eq!(realtime.result().unwrap(), plain.result().unwrap(), "{kind}: frame {frame}");
            counts.clear();
            for word in words(&realtime) {
                let rays = decoded[usize::from(word[0])] * most as f32;
                assert!((rays - rays.round()).abs() < 0.1, "{kind}: {word:?} is {rays} rays");
                *counts.entry(rays.round() as u64).or_insert(0u64) += 1;
            }
            let sum: u64 = counts.iter().map(|(rays, pixels)| rays * pixels).sum();
            assert_eq!(sum, stats.occlusion_rays, "{kind}: frame {frame}, {counts:?}");
        }
        assert!(counts.len() >= 2 && counts.contains_key(&0), "{kind}: {counts:?}");
        // another buffer, and back: the rays have a pass of their own
        let shown = show(&tracer, &mut realtime, &camera, 0, display(DisplayMode::Result, 0.0));
        assert_grey(&shown, &realtime.result().unwrap(), 1.0, 0);
        let stats = {
            realtime.display(&tracer, Some(display(DisplayMode::Rays, 0.0))).unwrap();
            realtime.frame(&tracer, &camera, &[]).unwrap()
        };
        let sum: f64 =
            words(&realtime).iter().map(|w| f64::from((decoded[usize::from(w[0])] * most as f32).round())).sum();
        assert_eq!(sum as u64, stats.occlusion_rays, "{kind}");
    }
    assert_validation_clean(&device);
}

/// It is recorded with the frame if enabled, and changes nothing else.
#[test]
fn gpu_display_is_a_choice() {
    let device = device();
    let scene = by_name("cornell-box").unwrap();
    let camera = record(&scene, &scene.cameras[0], SIZE);
    let tracer = tracer(&device, tracers(&device)[0], &scene);
    let mut realtime = Realtime::new(&tracer, SIZE, &Preset::Fast.settings(), &[]).unwrap();
    let mut plain = Realtime::new(&tracer, SIZE, &Preset::Fast.settings(), &[]).unwrap();
    let recorded = |stats: &FrameStats| stats.timings.iter().filter(|t| t.label == "display").count();
    assert!(realtime.displayed().is_none());
    let mut last = Vec::new();
    for (frame, shown) in [None, Some(DisplayMode::Result), Some(DisplayMode::Depth), None].into_iter().enumerate() {
        realtime.display(&tracer, shown.map(|s| display(s, 0.0))).unwrap();
        let stats = realtime.frame(&tracer, &camera, &[]).unwrap();
        assert_eq!(recorded(&stats), usize::from(shown.is_some()), "frame {frame}");
        if shown.is_some() {
            assert_eq!(stats.timings.last().unwrap().label, "display");
        }
        plain.frame(&tracer, &camera, &[]).unwrap();
        assert_eq!(realtime.result().unwrap(), plain.result().unwrap());
        if frame == 3 {
            assert_eq!(words(&realtime), last, "what is not recorded stays");
        } else if shown.is_some() {
            last = words(&realtime);
        }
    }
    let refused = |preset: Preset, shown: DisplayMode| {
        let mut realtime = Realtime::new(&tracer, SIZE, &preset.settings(), &[]).unwrap();
        matches!(realtime.display(&tracer, Some(display(shown, 0.0))), Err(Error::Usage(_)))
    };
    assert!(refused(Preset::Fast, DisplayMode::Bent) && refused(Preset::Larsen, DisplayMode::Variance));
    assert!(refused(Preset::Larsen, DisplayMode::Rays));
    assert!(!refused(Preset::Fast, DisplayMode::Variance) && !refused(Preset::Larsen, DisplayMode::Normal));
    assert_validation_clean(&device);
}
