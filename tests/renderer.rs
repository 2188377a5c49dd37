//! The renderer as a library user meets it: settings in, images out, and nothing built or compiled twice.

mod common;

use common::{assert_validation_clean, device, new_device, picked};
use skylit::film::NoControl;
use skylit::measure::comparison::{CompareOptions, compare};
use skylit::output::{Image, Samples};
use skylit::renderer::{RenderSettings, Renderer};
use skylit::scene::builtin;
use skylit::tracer::{DeviceSettings, TracerChoice, TracerKind};

fn settings(json: serde_json::Value) -> RenderSettings {
    serde_json::from_value(json).unwrap()
}

fn small(integrator: &str) -> RenderSettings {
    settings(serde_json::json!({ "integrator": integrator, "image": { "size": [40, 30], "spp": 4 } }))
}

fn bits(image: &Image) -> Vec<(String, Vec<u32>)> {
    let of = |samples: &Samples| match samples {
        Samples::F32(v) => v.iter().map(|x| x.to_bits()).collect(),
        Samples::U32(v) => v.clone(),
    };
    image.channels.iter().map(|c| (c.name.clone(), of(&c.samples))).collect()
}

fn choice(kind: TracerKind) -> DeviceSettings {
    let tracer = match kind {
        TracerKind::Pipeline => TracerChoice::Pipeline,
        TracerKind::Query => TracerChoice::Query,
        TracerKind::Compute => TracerChoice::Compute,
    };
    DeviceSettings { tracer: Some(tracer), ..Default::default() }
}

/// One integrator after another with one renderer: each image is the one that a renderer of its own makes, on every tracer.
#[test]
fn gpu_one_renderer_makes_the_images_of_many() {
    let device = device();
    let scene = || builtin::by_name("cornell-box").unwrap();
    for kind in picked(&device) {
        let mut shared = Renderer::new(device.clone(), scene(), &choice(kind)).unwrap();
        for integrator in ["ao", "path", "ao", "normals", "path"] {
            let image = shared.still(&small(integrator), &mut NoControl).unwrap().image;
            let alone = Renderer::new(device.clone(), scene(), &choice(kind))
                .unwrap()
                .still(&small(integrator), &mut NoControl);
            assert!(bits(&image) == bits(&alone.unwrap().image), "{kind}: {integrator}");
            assert_eq!(image.metadata("integrator"), Some(integrator));
        }
    }
    assert_validation_clean(&device);
}

/// Frames in real time have their samples at the centres of pixels, stills all over them: one filter makes them comparable.
#[test]
fn gpu_a_still_of_pixel_centres_is_the_image_that_frames_approach() {
    let device = device();
    for kind in picked(&device) {
        let mut renderer = Renderer::new(device.clone(), builtin::by_name("stairs").unwrap(), &choice(kind)).unwrap();
        let mut image = |json: serde_json::Value| renderer.image(&settings(json), &mut NoControl).unwrap();
        let frame = image(serde_json::json!({ "image": { "size": [64, 48] }, "frames": { "preset": "reference" } }));
        let mut rmse = |filter: &str| {
            let still = image(serde_json::json!({ "image": { "size": [64, 48], "spp": 256, "pixel_filter": filter } }));
            assert_eq!(still.metadata("pixel_filter"), Some(filter));
            compare(&frame, &still, &CompareOptions::default()).unwrap().rmse
        };
        let (centre, wide) = (rmse("centre"), rmse("box"));
        println!("{kind}: RMSE of a frame against a still of pixel centres {centre:.5}, of a box filter {wide:.5}");
        assert_eq!(frame.metadata("pixel_filter"), Some("centre"));
        assert!(centre < 0.015 && wide > 2.0 * centre, "{kind}: {centre} {wide}");
    }
    assert_validation_clean(&device);
}

/// A renderer keeps its pipelines. Of what it has made once, only the pass that adds samples to a film, which goes with its still, is compiled again.
#[test]
fn gpu_pipelines_are_compiled_once() {
    // of its own: what other tests compile would be counted
    let device = new_device();
    let mut renderer =
        Renderer::new(device.clone(), builtin::by_name("stairs").unwrap(), &choice(TracerKind::Compute)).unwrap();
    let mut compiled = |integrator: &str| {
        renderer.still(&small(integrator), &mut NoControl).unwrap();
        device.compiled_pipelines()
    };
    let first = [compiled("path"), compiled("ao")];
    assert!(first[0] < first[1], "{first:?}");
    let again = [compiled("path"), compiled("ao")];
    assert!(first[0] > 4 && again[0] <= first[1] + 1 && again[1] <= again[0] + 1, "{first:?} {again:?}");
    drop(renderer);
    assert_validation_clean(&device);
}

/// Lights of settings are there for one still and gone for the next.
#[test]
fn gpu_lights_of_settings_come_and_go() {
    let device = device();
    let mut renderer =
        Renderer::new(device.clone(), builtin::by_name("cornell-box").unwrap(), &choice(TracerKind::Compute)).unwrap();
    let plain = renderer.still(&small("direct"), &mut NoControl).unwrap();
    let mut lit = small("direct");
    lit.lighting = serde_json::from_value(serde_json::json!({
        "environment": "1,2,3",
        "light": ["sphere position=0,1,0 radius=0.1 radiance=20"]
    }))
    .unwrap();
    let brighter = renderer.still(&lit, &mut NoControl).unwrap();
    assert!(brighter.report.mean > 1.2 * plain.report.mean, "{} {}", brighter.report.mean, plain.report.mean);
    let after = renderer.still(&small("direct"), &mut NoControl).unwrap();
    assert!(bits(&plain.image) == bits(&after.image));
    assert_validation_clean(&device);
}

/// Antialiasing in time brings frames nearer to antialiased stills, at rest and in motion; presets have it unless settings say otherwise.
#[test]
fn gpu_frames_are_antialiased() {
    let device = device();
    let timelines = [
        serde_json::json!({ "frames": "0..1", "warm_up": 63, "orbit": 720 }),
        serde_json::json!({ "frames": "16..17", "warm_up": 0, "orbit": 720 }),
    ];
    for kind in picked(&device) {
        let mut renderer = Renderer::new(device.clone(), builtin::by_name("stairs").unwrap(), &choice(kind)).unwrap();
        for (at, timeline) in timelines.iter().enumerate() {
            let mut image = |frames: serde_json::Value, spp: Option<u32>| {
                let mut all = timeline.clone();
                all.as_object_mut().unwrap().extend(frames.as_object().unwrap().clone());
                if spp.is_some() {
                    all.as_object_mut().unwrap().remove("warm_up");
                }
                let mut wanted = settings(serde_json::json!({ "image": { "size": [96, 54] }, "frames": all }));
                wanted.image.spp = spp;
                if spp.is_none() && at == 1 {
                    // the way there
                    wanted.frames.frames = Some(skylit::realtime::frame_settings::FrameRange { first: 0, end: 17 });
                }
                renderer.image(&wanted, &mut NoControl).unwrap()
            };
            let truth = image(serde_json::json!({}), Some(64));
            let [off, on, default] = [Some("off"), Some("on"), None].map(|antialias| {
                let frames = serde_json::json!({ "preset": "balanced", "antialias": antialias });
                let image = image(frames, None);
                let error: f64 = std::iter::zip(image.f32("Y").unwrap(), truth.f32("Y").unwrap())
                    .map(|(a, b)| f64::from(a - b).powi(2))
                    .sum();
                (error / (96.0 * 54.0)).sqrt()
            });
            // measured at 320x180: 0.64 and 0.81 (docs/design/real-time.md)
            assert!(
                on < 0.9 * off && on == default,
                "{kind}, {timeline}: RMSE {off} without, {on} with, {default} by default"
            );
        }
    }
    assert_validation_clean(&device);
}

/// Frames before the first are those of the sequence: a part of it begins as the whole goes on, and an orbit has no beginning.
#[test]
fn gpu_sequences_begin_as_they_go_on() {
    let device = device();
    for kind in picked(&device) {
        let mut renderer = Renderer::new(device.clone(), builtin::by_name("stairs").unwrap(), &choice(kind)).unwrap();
        let mut image = |frames: serde_json::Value| {
            let mut all = serde_json::json!({ "preset": "balanced", "orbit": 12 });
            all.as_object_mut().unwrap().extend(frames.as_object().unwrap().clone());
            let wanted = settings(serde_json::json!({ "image": { "size": [48, 32] }, "frames": all }));
            renderer.image(&wanted, &mut NoControl).unwrap()
        };
        let whole = image(serde_json::json!({ "frames": "0..18", "warm_up": 0 }));
        assert!(bits(&image(serde_json::json!({ "frames": "17..18", "lead_in": 17 }))) == bits(&whole), "{kind}");
        // a revolution before and after: the same up to the rounding of an angle
        let after = image(serde_json::json!({ "frames": "0..13", "warm_up": 0 }));
        let before = image(serde_json::json!({ "frames": "0..1", "lead_in": 12 }));
        let cold = image(serde_json::json!({ "frames": "0..1", "warm_up": 0 }));
        let [near, far] = [&before, &cold].map(|image| {
            let difference = std::iter::zip(image.f32("Y").unwrap(), after.f32("Y").unwrap());
            (difference.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / (48.0 * 32.0)).sqrt()
        });
        assert!(near < 0.1 * far, "{kind}: {near} {far}");
    }
    assert_validation_clean(&device);
}

/// Frames and stills of one renderer, in turn.
#[test]
fn gpu_frames_and_stills_take_turns() {
    let device = device();
    let mut renderer =
        Renderer::new(device.clone(), builtin::by_name("cornell-box").unwrap(), &choice(TracerKind::Compute)).unwrap();
    let timeline = settings(serde_json::json!({
        "image": { "size": [40, 30] },
        "frames": { "preset": "fast", "frames": "3..6", "warm_up": 2, "orbit": 12 }
    }));
    let mut frames = renderer.frames(&timeline, false, &mut NoControl).unwrap();
    let mut seen = Vec::new();
    while let Some(frame) = frames.advance().unwrap() {
        seen.push((frame.number, frame.kept));
    }
    assert_eq!(seen, [(3, false), (3, false), (3, true), (4, true), (5, true)]);
    let image = frames.image(&mut NoControl).unwrap();
    assert_eq!(image.metadata("frame"), Some("5"));
    let report = frames.report();
    // the coverage of antialiased frames has 16 bits
    assert!(report.mean > 0.0 && report.mean <= 1.0 + 1e-5, "{}", report.mean);
    assert!(renderer.still(&timeline, &mut NoControl).is_err_and(|e| e.to_string().contains("--preset is for frames")));
    assert!(renderer.still(&small("ao"), &mut NoControl).is_ok());
    assert_validation_clean(&device);
}

/// A camera path with a cut: from there on frames are those of a path that begins there.
#[test]
fn gpu_a_cut_of_the_camera_path_begins_anew() {
    let device = device();
    let mut renderer =
        Renderer::new(device.clone(), builtin::by_name("cornell-box").unwrap(), &choice(TracerKind::Compute)).unwrap();
    let camera = renderer.scene().cameras[0].clone();
    let (eye, back) = (camera.camera_to_world.translation, camera.camera_to_world.matrix3.z_axis);
    let key = |frame: u32, eye: glam::DVec3, cut: bool| serde_json::json!({ "frame": frame, "eye": eye.to_array(), "target": (eye - back).to_array(), "fov_y_degrees": 40, "cut": cut });
    let last = [key(5, eye - 0.3 * back, true), key(9, eye - 0.4 * back, false)];
    let all = [&[key(0, eye, false), key(4, eye + 0.1 * back, false)][..], &last].concat();
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("path.json");
    for integrator in ["ao", "path"] {
        let mut image = |keys: &[serde_json::Value], frames: &str| {
            std::fs::write(&file, serde_json::json!({ "keys": keys }).to_string()).unwrap();
            let timeline = settings(serde_json::json!({
                "integrator": integrator,
                "image": { "size": [48, 32] },
                "frames": { "preset": "quality", "frames": frames, "camera_path": file }
            }));
            renderer.image(&timeline, &mut NoControl).unwrap()
        };
        let [cut, fresh] = [image(&all, "0..7"), image(&last, "5..7")];
        assert_eq!(cut.channels, fresh.channels, "{integrator}");
    }
    assert_validation_clean(&device);
}

/// Settings are files: what was given comes back, a slip in a name is told, and what has no effect is refused by its name.
#[test]
fn settings_are_files() {
    let json = serde_json::json!({
        "integrator": "path",
        "image": { "spp": 9, "aov": ["depth", "ns"] },
        "camera": { "eye": [0.0, 1.0, 5.0], "target": [0.0, 1.0, 0.0] },
        "integrators": { "path": { "max_depth": 3, "sampling": "light" } },
        "film": { "resumable": true }
    });
    let wanted = settings(json.clone());
    assert!(wanted.check().is_ok());
    let text = serde_json::to_value(&wanted).unwrap();
    assert_eq!(text["integrators"]["path"], json["integrators"]["path"]);
    assert_eq!(settings(text), wanted);
    assert!(serde_json::from_str::<RenderSettings>(r#"{"image":{"sppp":3}}"#).is_err());
    let refused =
        settings(serde_json::json!({ "integrator": "direct", "integrators": { "path": { "max_depth": 3 } } }));
    let text = refused.check().unwrap_err().to_string();
    assert!(text.contains("--max-depth has no effect on --integrator direct"), "{text}");
}

/// The mean of the pixels that show surfaces, and what was chosen.
fn still(renderer: &mut Renderer, json: serde_json::Value) -> (f64, String, String, Image) {
    let still = renderer.still(&settings(json), &mut NoControl).unwrap();
    let mean = still.report.surface_mean.unwrap();
    (mean, still.report.setup.choices.join("\n"), still.report.setup.warnings.join("\n"), still.image)
}

#[test]
fn gpu_the_scene_decides_what_settings_leave_open() {
    let device = device();
    let image = || serde_json::json!({ "size": [40, 30], "spp": 8 });
    let open = |name: &str| {
        Renderer::new(device.clone(), builtin::by_name(name).unwrap(), &DeviceSettings::default()).unwrap()
    };

    // a closed room has a radius by itself, and is black without
    let mut room = open("closed-box");
    let (mean, choices, warnings, chosen) = still(&mut room, serde_json::json!({ "image": image() }));
    assert!(
        (0.45..0.75).contains(&mean) && choices.contains("60 % open") && warnings.is_empty(),
        "{mean} {choices} {warnings}"
    );
    let radius: f64 = chosen.metadata("ao.radius").unwrap().parse().unwrap();
    assert!(choices.contains(&format!("AO radius: {radius} ")), "{choices}");
    let ao = |radius: serde_json::Value| serde_json::json!({ "image": image(), "integrators": { "ao": { "ao_radius": radius } } });
    let (mean, choices, warnings, _) = still(&mut room, ao("inf".into()));
    assert!(mean == 0.0 && choices.is_empty() && warnings.contains("--ao-radius auto"), "{mean} {choices} {warnings}");
    let (_, _, _, same) = still(&mut room, ao(radius.into()));
    assert!(bits(&same) == bits(&chosen));
    let (lo, hi) = room.scene().bounds().unwrap();
    let (_, choices, _, fifth) = still(&mut room, ao("20%".into()));
    let of_diagonal: f64 = fifth.metadata("ao.radius").unwrap().parse().unwrap();
    assert!(
        (of_diagonal / (0.2 * (hi - lo).length()) - 1.0).abs() < 5e-6 && choices.contains("20%"),
        "{of_diagonal} {choices}"
    );

    // an open one has none
    let mut stairs = open("stairs");
    let (mean, choices, warnings, _) = still(&mut stairs, serde_json::json!({ "image": image() }));
    assert!(mean > 0.3 && choices.is_empty() && warnings.is_empty(), "{mean} {choices} {warnings}");

    // where nothing emits there is light, which goes when it is not asked for
    let lit = |integrator: &str, environment: Option<&str>| {
        let mut all = serde_json::json!({ "integrator": integrator, "image": image() });
        if let Some(environment) = environment {
            all["lighting"] = serde_json::json!({ "environment": environment });
        }
        all
    };
    let (mean, choices, warnings, path) = still(&mut stairs, lit("path", None));
    assert!((0.05..0.95).contains(&mean) && choices.contains("--environment 0.5,0.5,0.5"), "{mean} {choices}");
    assert_eq!(warnings, "");
    let (mean, _, warnings, _) = still(&mut stairs, lit("path", Some("none")));
    assert!(mean == 0.0 && warnings.contains("no light"), "{mean} {warnings}");
    for integrator in ["lit", "ao-sky", "albedo", "path"] {
        let (_, _, _, shared) = still(&mut stairs, lit(integrator, None));
        let (_, _, _, alone) = still(&mut open("stairs"), lit(integrator, None));
        assert!(bits(&shared) == bits(&alone), "{integrator}");
    }
    let (mean, choices, _, _) = still(&mut room, lit("path", None));
    assert!((0.05..0.95).contains(&mean) && choices.contains("lamp"), "{mean} {choices}");

    // views that have a name
    let top = serde_json::json!({ "image": image(), "camera": { "view": "top" } });
    let (_, _, _, top) = still(&mut stairs, top);
    assert!(top.metadata("camera").unwrap().starts_with("\"top\""), "{:?}", top.metadata("camera"));
    assert!(bits(&top) != bits(&path));
    assert_validation_clean(&device);
}

/// The filter of ambient occlusion takes noise away, on every tracer, and leaves the noisy image beside.
#[test]
fn gpu_ambient_occlusion_is_denoised() {
    let device = device();
    let mut reference = None;
    for kind in picked(&device) {
        let mut renderer = Renderer::new(device.clone(), builtin::by_name("stairs").unwrap(), &choice(kind)).unwrap();
        let ao = |spp: u32, denoise: Option<&str>| {
            let mut all = serde_json::json!({ "image": { "size": [96, 72], "spp": spp, "seed": spp } });
            if let Some(denoise) = denoise {
                all["image"]["denoise"] = denoise.into();
            }
            settings(all)
        };
        let y = |image: &Image, name: &str| match &image.channels.iter().find(|c| c.name == name).unwrap().samples {
            Samples::F32(values) => values.clone(),
            Samples::U32(_) => panic!("{name} has floats"),
        };
        // that of the first tracer is that of all
        let reference =
            reference.get_or_insert_with(|| y(&renderer.still(&ao(512, None), &mut NoControl).unwrap().image, "Y"));
        let denoised = renderer.still(&ao(16, Some("filter")), &mut NoControl).unwrap();
        let (after, before) = (y(&denoised.image, "Y"), y(&denoised.image, "noisy.Y"));
        let error = |image: &[f32]| {
            let sum: f64 = image.iter().zip(&*reference).map(|(a, b)| f64::from(a - b).powi(2)).sum();
            (sum / image.len() as f64).sqrt()
        };
        println!("{kind}: {:.4} before, {:.4} after", error(&before), error(&after));
        assert!(error(&after) < 0.7 * error(&before), "{kind}: {} of {}", error(&after), error(&before));
        assert!(before == y(&renderer.still(&ao(16, None), &mut NoControl).unwrap().image, "Y"), "{kind}");
        assert_eq!(denoised.image.metadata("denoise"), Some("filter"));
        assert!(denoised.report.denoise.is_some());
    }
    assert_validation_clean(&device);
}

/// A floor seen from below a card with `d 0`: it is not there, also for ambient occlusion; where it is set to be glass it is.
#[test]
fn gpu_dissolve_is_coverage_unless_it_is_set_to_be_glass() {
    let device = device();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    std::fs::write(folder.path().join("a.mtl"), "newmtl floor\nnewmtl card\nd 0\n").unwrap();
    let corners = |y: f32| format!("v -50 {y} 50\nv 50 {y} 50\nv 50 {y} -50\nv -50 {y} -50\n");
    let faces = "usemtl floor\nf 1 2 3 4\nusemtl card\nf 5 6 7 8\n";
    std::fs::write(&path, format!("mtllib a.mtl\n{}{}{faces}", corners(0.0), corners(1.0))).unwrap();
    let camera = serde_json::json!({ "eye": [0, 0.5, 0], "target": [0, 0, 0], "up": [0, 0, -1] });
    for kind in picked(&device) {
        let scene = skylit::scene::load::load_file(&path).unwrap();
        let mut renderer = Renderer::new(device.clone(), scene, &choice(kind)).unwrap();
        for (meaning, expected) in [(None, 1.0), (Some("glass"), 0.0), (Some("alpha"), 1.0)] {
            let scene = meaning.map_or_else(|| serde_json::json!({}), |m| serde_json::json!({ "mtl_dissolve": m }));
            let image = serde_json::json!({ "size": [4, 4], "spp": 16 });
            let ao = serde_json::json!({ "ao": { "ao_radius": "inf" } });
            let how =
                settings(serde_json::json!({ "image": image, "scene": scene, "camera": camera, "integrators": ao }));
            let image = renderer.still(&how, &mut NoControl).unwrap().image;
            let values = image.f32("Y").unwrap();
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            assert!((mean - expected).abs() < 0.02, "{kind}, {meaning:?}: {mean}, not {expected}");
        }
    }
    assert_validation_clean(&device);
}
