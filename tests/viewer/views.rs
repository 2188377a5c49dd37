//! Views of a scene whose camera, time and settings change at any moment ([`skylit::renderer::interactive`]).

use std::time::Duration;

use skylit::Error;
use skylit::film::NoControl;
use skylit::renderer::interactive::{View, camera_settings, render_flags};
use skylit::renderer::{RenderSettings, Renderer};
use skylit::scene::{Camera, Geometry, builtin};
use skylit::tracer::DeviceSettings;
use skylit::viewer::technique::Technique;

use crate::common::{InterruptAt, assert_validation_clean, device, tracers};

const SIZE: [u32; 2] = [48, 32];
const STEP: Duration = Duration::from_millis(20);

fn settings(json: serde_json::Value) -> RenderSettings {
    serde_json::from_value(json).unwrap()
}

fn renderer(scene: &str, tracer: &str) -> Renderer {
    let device_settings: DeviceSettings = serde_json::from_value(serde_json::json!({ "tracer": tracer })).unwrap();
    Renderer::new(device(), builtin::by_name(scene).unwrap(), &device_settings).unwrap()
}

/// At rest a view of frames is, bit for bit, what `render` makes of as many frames; and a still that was taken step by step is the still of that many samples.
#[test]
fn gpu_views_at_rest_are_what_render_makes() {
    for kind in tracers(&device()) {
        let mut renderer = renderer("stairs", kind.name());
        let camera = renderer.scene().cameras[0].clone();
        let frames = settings(
            serde_json::json!({ "image": { "size": SIZE }, "frames": { "preset": "fast", "frames": "0..5" } }),
        );
        let mut sequence = renderer.frames(&frames, true, &mut NoControl).unwrap();
        while sequence.advance().unwrap().is_some() {}
        let expected = sequence.displayed().unwrap().read(0, u64::from(4 * SIZE[0] * SIZE[1])).unwrap();
        drop(sequence);

        let still = settings(serde_json::json!({ "integrator": "ao", "image": { "size": SIZE, "spp": 8 } }));
        let expected_still = renderer.still(&still, &mut NoControl).unwrap().image;

        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        let preset = settings(serde_json::json!({ "frames": { "preset": "fast" } }));
        let mut view = View::new(&mut session, &preset, SIZE, &mut NoControl).unwrap();
        assert!(view.is_realtime() && view.picture().unwrap().is_none());
        for _ in 0..5 {
            view.step(&session, &camera, STEP, &mut NoControl).unwrap();
        }
        assert!(view.picture().unwrap().unwrap().rgba == expected, "{kind}");

        let converging = settings(serde_json::json!({ "integrator": "ao" }));
        let mut view = View::new(&mut session, &converging, SIZE, &mut NoControl).unwrap();
        let mut samples = 0;
        while samples < 8 {
            samples = view.step(&session, &camera, Duration::from_micros(1), &mut NoControl).unwrap().samples;
            assert!(samples <= 8, "{kind}: a step of no time is one sample of each pixel");
        }
        assert_eq!(view.values().unwrap().values, expected_still.f32("Y").unwrap(), "{kind}");
    }
    assert_validation_clean(&device());
}

/// A view that comes back to a camera knows nothing of the others; and an interrupted step leaves nothing behind.
#[test]
fn gpu_motion_and_interruptions_leave_nothing_behind() {
    let mut renderer = renderer("stairs", "compute");
    let camera = renderer.scene().cameras[0].clone();
    let other = Camera {
        camera_to_world: glam::DAffine3::from_translation(glam::DVec3::new(0.3, 0.2, 0.5)) * camera.camera_to_world,
        ..camera.clone()
    };
    let mut session = renderer.interactive(&Default::default(), None).unwrap();
    for json in [serde_json::json!({ "integrator": "ao" }), serde_json::json!({ "frames": { "preset": "balanced" } })] {
        let settings = settings(json);
        let image = |view: &mut View, session: &skylit::renderer::Interactive| {
            view.step(session, &camera, Duration::from_micros(1), &mut NoControl).unwrap();
            view.picture().unwrap().unwrap()
        };
        let mut fresh = View::new(&mut session, &settings, SIZE, &mut NoControl).unwrap();
        let expected = image(&mut fresh, &session);
        let mut view = View::new(&mut session, &settings, SIZE, &mut NoControl).unwrap();
        for _ in 0..3 {
            view.step(&session, &other, STEP, &mut NoControl).unwrap();
        }
        if !view.is_realtime() {
            assert!(image(&mut view, &session) == expected, "a still starts anew when the camera moves");
        }
        for launches in 1..6 {
            let outcome = view.step(&session, &other, STEP, &mut InterruptAt { at: launches, asked: 0 });
            assert!(matches!(outcome, Err(Error::Interrupted)) || launches > 1, "{launches}");
        }
        view.reset();
        assert!(image(&mut view, &session) == expected, "{settings:?}");
    }
    assert_validation_clean(&device());
}

/// Materials that are edited while they are shown look as they do when the scene is loaded with these values, on every tracer, in a tracer that is built later, too.
#[test]
fn gpu_edited_materials_are_those_of_a_fresh_scene() {
    use skylit::scene::material_edit;

    let edits = |text: &[&str]| text.iter().map(|text| material_edit::parse(text).unwrap()).collect::<Vec<_>>();
    let wanted = edits(&["0 base_color=0.9,0.1,0.05", "1 base_color=0,0.2,0.9"]);
    let view_settings = settings(serde_json::json!({ "integrator": "albedo" }));
    for kind in tracers(&device()) {
        let mut renderer = renderer("cornell-box", kind.name());
        let camera = renderer.scene().cameras[0].clone();
        let picture = |session: &mut skylit::renderer::Interactive| {
            let mut view = View::new(session, &view_settings, SIZE, &mut NoControl).unwrap();
            view.step(session, &camera, Duration::from_micros(1), &mut NoControl).unwrap();
            view
        };

        // before the first view, and while there is one
        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        let mut view = picture(&mut session);
        let original = view.picture().unwrap().unwrap();
        assert!(session.edit_materials(&wanted).unwrap(), "{kind}");
        view.step(&session, &camera, Duration::from_micros(1), &mut NoControl).unwrap();
        let edited = view.picture().unwrap().unwrap();
        assert!(edited != original, "{kind}");
        // what emits light or begins to transmit it needs the scene anew, and nothing changes
        for text in ["0 emission=1,1,1", "0 transmission=1"] {
            assert!(!session.edit_materials(&edits(&[text])).unwrap(), "{text}");
        }
        assert_eq!(session.edits(), wanted);
        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        assert!(session.edit_materials(&wanted).unwrap());
        assert!(picture(&mut session).picture().unwrap().unwrap() == edited, "{kind}: built later");
        assert!(session.edit_materials(&[]).unwrap());
        assert!(picture(&mut session).picture().unwrap().unwrap() == original, "{kind}: reset");
        drop(session);

        // as `skylit render --material` has it
        let mut with = view_settings.clone();
        with.scene.material = wanted.clone();
        with.image.size = Some(SIZE);
        with.image.spp = Some(1);
        let still = renderer.still(&with, &mut NoControl).unwrap();
        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        let values = picture(&mut session).values().unwrap().values;
        let red = still.image.f32("R").unwrap();
        let samples: Vec<f32> = values.chunks(3).map(|p| p[0]).collect();
        assert_eq!(samples, red, "{kind}");
    }
    assert_validation_clean(&device());
}

/// Light that an edited surface emits is edited further while it is shown: it lights the scene as it does in a render with these values.
#[test]
fn gpu_edited_emission_lights_the_scene() {
    use skylit::scene::material_edit;

    let mut renderer = renderer("cornell-box", "compute");
    let camera = renderer.scene().cameras[0].clone();
    let mut path = settings(serde_json::json!({ "integrator": "path", "image": { "size": SIZE, "spp": 64 } }));
    let edit = |text: &str| vec![material_edit::parse(text).unwrap()];
    let mean = |values: &[f32], c: usize| values.iter().skip(c).step_by(3).sum::<f32>() / (values.len() / 3) as f32;
    let mut render = |renderer: &mut Renderer, text: &str| {
        path.scene.material = edit(text);
        let image = renderer.still(&path, &mut NoControl).unwrap().image;
        let planes = ["R", "G", "B"].map(|c| image.f32(c).unwrap().to_vec());
        (0..planes[0].len()).flat_map(|k| planes.each_ref().map(|p| p[k])).collect::<Vec<f32>>()
    };
    let expected = render(&mut renderer, "2 emission=0,0,3");
    let first = render(&mut renderer, "2 emission=2,0,0");
    assert!(mean(&expected, 2) > 1.5 * mean(&first, 2), "{} {}", mean(&expected, 2), mean(&first, 2));

    let mut session = renderer.interactive(&Default::default(), None).unwrap();
    let wanted = settings(serde_json::json!({ "integrator": "path" }));
    let mut view = View::new(&mut session, &wanted, SIZE, &mut NoControl).unwrap();
    view.step(&session, &camera, Duration::from_micros(1), &mut NoControl).unwrap();
    assert!(session.edit_materials(&edit("2 emission=0,0,3")).unwrap());
    let mut samples = 0;
    while samples < 64 {
        samples = view.step(&session, &camera, STEP, &mut NoControl).unwrap().samples;
    }
    let values = view.values().unwrap().values;
    for c in 0..3 {
        let (shown, expected) = (mean(&values, c), mean(&expected, c));
        assert!((shown / expected - 1.0).abs() < 0.1, "{c}: {shown} for {expected}");
    }
    // dark again, it has no light in the lists
    assert!(!session.edit_materials(&[]).unwrap());
}

/// Every technique renders on every tracer, one view after another with the same tracers in device memory.
#[test]
fn gpu_every_technique_has_a_picture() {
    let mut compared: Vec<(String, Vec<f32>)> = Vec::new();
    for kind in tracers(&device()) {
        let mut renderer = renderer("stairs", kind.name());
        let camera = renderer.scene().cameras[0].clone();
        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        for (_, technique) in Technique::all() {
            // compiling the kernels of paths takes most of the time: tests/path has them on all tracers
            let is_path = matches!(technique, Technique::Still(i) | Technique::Frames(i) if i.name() != "ao" && i.name() != "ao-sky");
            if is_path && kind != tracers(&device())[0] {
                continue;
            }
            let settings = technique.settings(&RenderSettings::default());
            let label = technique.label();
            let mut view = match View::new(&mut session, &settings, SIZE, &mut NoControl) {
                Ok(view) => view,
                // only the compute tracer counts nodes
                Err(Error::Usage(e)) if label == "nodes" && kind.name() != "compute" => {
                    assert!(e.contains("--tracer compute"), "{e}");
                    continue;
                }
                Err(e) => panic!("{kind}, {label}: {e}"),
            };
            let step = view.step(&session, &camera, Duration::from_micros(1), &mut NoControl).unwrap();
            let picture = view.picture().unwrap().unwrap();
            assert!(picture.size == SIZE && picture.rgba.len() == (4 * SIZE[0] * SIZE[1]) as usize, "{kind}, {label}");
            assert!(picture.rgba.chunks_exact(4).all(|p| p[3] == 255) && step.samples >= 1, "{kind}, {label}");
            let shows = label.starts_with("baked") || ["path", "direct", "whitted"].contains(&label.as_str());
            // the first of 64 frames is dark grey, and one sample has no variance
            let least = if label == "samples" { 2 } else { 40 };
            assert!(
                shows || label == "variance" || picture.rgba.chunks_exact(4).any(|p| p[0] > least),
                "{kind}, {label}: black"
            );
            let values = view.values().unwrap();
            match compared.iter().find(|c| c.0 == label) {
                None => compared.push((label, values.values)),
                // three tracers, one image: rounding at edges apart
                Some((_, before)) => {
                    let differing = before.iter().zip(&values.values).filter(|(a, b)| (*a - *b).abs() > 0.05).count();
                    assert!(differing * 100 <= before.len(), "{kind}, {label}: {differing} of {} pixels", before.len());
                }
            }
        }
        assert!(session.take_warnings().is_empty());
    }
    assert_validation_clean(&device());
}

/// What a moving scene shows while it plays is what `render --frames` makes of the same times.
#[test]
fn gpu_animations_are_those_of_render() {
    let mut renderer = renderer("parade", "compute");
    let camera = renderer.scene().cameras[0].clone();
    let how = serde_json::json!({ "image": { "size": SIZE }, "frames": { "preset": "fast", "frames": "0..6", "animate": "0", "fps": 8.0 } });
    let mut sequence = renderer.frames(&settings(how), true, &mut NoControl).unwrap();
    while sequence.advance().unwrap().is_some() {}
    let expected = sequence.displayed().unwrap().read(0, u64::from(4 * SIZE[0] * SIZE[1])).unwrap();
    drop(sequence);
    // one moment: of frames, and of a still
    let moment = |time: f64| {
        let frames = serde_json::json!({ "preset": "fast", "frames": "0..1", "warm_up": 0, "time": time });
        settings(serde_json::json!({ "image": { "size": SIZE }, "frames": frames }))
    };
    let mut held = |time: f64| {
        let mut sequence = renderer.frames(&moment(time), true, &mut NoControl).unwrap();
        while sequence.advance().unwrap().is_some() {}
        sequence.displayed().unwrap().read(0, u64::from(4 * SIZE[0] * SIZE[1])).unwrap()
    };
    let (moments, end, after) = ([0.0, 0.625].map(&mut held), held(2.0), held(5.0));
    assert!(moments[0] != moments[1] && end == after, "after its end an animation holds its last pose");
    let still =
        serde_json::json!({ "integrator": "ao", "image": { "size": SIZE, "spp": 1 }, "frames": { "time": 0.625 } });
    let still = renderer.still_sequence(&settings(still)).unwrap().render(0, &mut NoControl).unwrap().image;
    let mut session = renderer.interactive(&Default::default(), Some(0)).unwrap();
    let preset = settings(serde_json::json!({ "frames": { "preset": "fast" } }));
    let mut view = View::new(&mut session, &preset, SIZE, &mut NoControl).unwrap();
    for frame in 0..6 {
        session.set_time(f64::from(frame) / 8.0).unwrap();
        let followed = session.animated_camera(0).unwrap_or_else(|| camera.clone());
        view.step(&session, &followed, STEP, &mut NoControl).unwrap();
    }
    assert!(view.picture().unwrap().unwrap().rgba == expected);
    // the last of the six is at 0.625 s
    let followed = session.animated_camera(0).unwrap_or_else(|| camera.clone());
    let mut fresh = View::new(&mut session, &preset, SIZE, &mut NoControl).unwrap();
    fresh.step(&session, &followed, STEP, &mut NoControl).unwrap();
    assert!(fresh.picture().unwrap().unwrap().rgba == moments[1]);
    let mut fresh =
        View::new(&mut session, &settings(serde_json::json!({ "integrator": "ao" })), SIZE, &mut NoControl).unwrap();
    fresh.step(&session, &followed, Duration::from_micros(1), &mut NoControl).unwrap();
    assert_eq!(fresh.values().unwrap().values, still.f32("Y").unwrap());
    assert_validation_clean(&device());
}

/// A point of the image leads to the surface there.
#[test]
fn gpu_points_are_picked() {
    let mut renderer = renderer("stairs", "compute");
    let camera = renderer.scene().cameras[0].clone();
    let mut session = renderer.interactive(&Default::default(), None).unwrap();
    assert_eq!(session.pick(&camera, [0.5, 0.5], 1.5).unwrap(), None, "before the first view");
    let settings = settings(serde_json::json!({ "image": { "aov": ["depth", "ids"] }, "integrator": "ao" }));
    let mut view = View::new(&mut session, &settings, SIZE, &mut NoControl).unwrap();
    view.step(&session, &camera, STEP, &mut NoControl).unwrap();
    let image = view.image(&session, &mut NoControl).unwrap();
    let depth = image.f32("depth.Z").unwrap();
    for [x, y] in [[5, 6], [24, 16], [40, 30]] {
        let at = [(f64::from(x) + 0.5) / f64::from(SIZE[0]), (f64::from(y) + 0.5) / f64::from(SIZE[1])];
        let picked = session.pick(&camera, at, 1.5).unwrap();
        let expected = f64::from(depth[(y * SIZE[0] + x) as usize]);
        match picked {
            Some(pick) => assert!((pick.distance - expected).abs() < 1e-4 * expected, "{pick:?}, {expected}"),
            None => assert!(!expected.is_finite(), "{expected}"),
        }
    }
    assert!(image.metadata("command").is_some_and(|c| c.starts_with("skylit render") && c.contains("--integrator ao")));
}

/// The command that is copied renders the same image.
#[test]
fn gpu_commands_reproduce_views() {
    let mut renderer = renderer("stairs", "compute");
    let cameras = renderer.scene().cameras.clone();
    let turned = glam::DAffine3::from_rotation_y(0.3) * cameras[0].camera_to_world;
    for camera in [cameras[0].clone(), Camera { camera_to_world: turned, name: String::new(), ..cameras[0].clone() }] {
        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        let how = settings(serde_json::json!({ "integrator": "ao", "integrators": { "ao": { "ao_radius": 0.7 } } }));
        let mut view = View::new(&mut session, &how, SIZE, &mut NoControl).unwrap();
        view.step(&session, &camera, Duration::from_micros(1), &mut NoControl).unwrap();
        let shown = view.values().unwrap().values;
        let command = render_flags("builtin:stairs", session.scene(), &how, &camera, SIZE);
        assert!(command.starts_with("skylit render builtin:stairs -o ao.png --integrator ao"), "{command}");
        drop(session);
        let mut same = RenderSettings { camera: camera_settings(&cameras, &camera), ..how };
        (same.image.size, same.image.spp) = (Some(SIZE), Some(view.samples()));
        let rendered = renderer.still(&same, &mut NoControl).unwrap().image;
        let rendered = rendered.f32("Y").unwrap();
        // the camera goes through text: rounding
        let differing = shown.iter().zip(rendered).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
        assert!(differing * 50 <= shown.len(), "{differing} of {}", shown.len());
    }
}

/// A room without a camera is looked at from inside, an object from outside.
#[test]
fn gpu_rooms_open_inside() {
    for (scene, inside) in [("closed-box", true), ("stairs", false), ("terrain:2000", false), ("spheres:50", false)] {
        let mut loaded = builtin::by_name(scene).unwrap();
        loaded.cameras.clear();
        if let (true, Geometry::Triangles(mesh)) = (inside, &mut loaded.meshes[0].geometry) {
            // walls that face the room
            mesh.indices.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let (lo, hi) = loaded.bounds().unwrap();
        let mut renderer = Renderer::new(device(), loaded, &DeviceSettings::default()).unwrap();
        let mut session = renderer.interactive(&Default::default(), None).unwrap();
        let eye = session.choose_camera(1.5, &mut NoControl).unwrap().camera_to_world.translation;
        assert_eq!(eye.cmpgt(lo).all() && eye.cmplt(hi).all(), inside, "{scene}: {eye}");
    }
}
