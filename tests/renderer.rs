//! The renderer as a library user meets it: settings in, images out, and nothing built or compiled twice.

mod common;

use std::time::Instant;

use common::{assert_validation_clean, device, tracers};
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
    for kind in tracers(&device) {
        let mut shared = Renderer::new(device.clone(), scene(), &choice(kind)).unwrap();
        for integrator in ["ao", "path", "ao", "normals", "path"] {
            let image = shared.still(&small(integrator), &mut NoControl).unwrap().image;
            let alone =
                Renderer::new(device.clone(), scene(), &choice(kind)).unwrap().still(&small(integrator), &mut NoControl);
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
    for kind in tracers(&device) {
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

/// What was compiled is not compiled again: the second still takes a fraction of the first, whatever lay between them.
#[test]
fn gpu_pipelines_are_compiled_once() {
    let device = device();
    let mut renderer =
        Renderer::new(device.clone(), builtin::by_name("cornell-box").unwrap(), &choice(TracerKind::Compute)).unwrap();
    let mut seconds = |integrator: &str| {
        let start = Instant::now();
        renderer.still(&small(integrator), &mut NoControl).unwrap();
        start.elapsed().as_secs_f64()
    };
    let first = [seconds("path"), seconds("ao")];
    let again = [seconds("path"), seconds("ao")];
    drop(renderer);
    // compiling takes a hundred times as long as tracing these images; a tenth leaves room for a busy machine
    assert!(again[0] < 0.3 * first[0], "{first:?} {again:?}");
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
    assert!(report.mean > 0.0 && report.mean <= 1.0, "{}", report.mean);
    assert!(renderer.still(&timeline, &mut NoControl).is_err_and(|e| e.to_string().contains("--preset is for frames")));
    assert!(renderer.still(&small("ao"), &mut NoControl).is_ok());
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
    let refused = settings(serde_json::json!({ "integrator": "direct", "integrators": { "path": { "max_depth": 3 } } }));
    let text = refused.check().unwrap_err().to_string();
    assert!(text.contains("--max-depth has no effect on --integrator direct"), "{text}");
}
