//! The panels, used through their accessibility tree.

use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use skylit::integrators::backdrop::Backdrop;
use skylit::realtime::Preset;
use skylit::renderer::RenderSettings;
use skylit::renderer::interactive::{Pick, ViewPicture};
use skylit::scene::Ground;
use skylit::scene::load::{GeometryOptions, NormalSource, Projection};
use skylit::settings::Length;
use skylit::viewer::app::{App, Arrangement, Second};
use skylit::viewer::dialog::{Dialog, RenderWanted, RenderedMotion};
use skylit::viewer::request::{
    Comparison, DeviceSummary, Event, EventSender, Mailbox, ObjectSummary, Outline, PickPurpose, Progress,
    SceneSummary, TRUTH, Task,
};
use skylit::viewer::scene_list::Selection;
use skylit::viewer::technique::Technique;
use skylit::viewer::{FileKind, ViewOptions, panels};

/// The viewer without a renderer: what it requests goes to a mailbox, what it is told comes from the sender.
pub struct Alone {
    pub harness: Harness<'static, App>,
    pub mailbox: Arc<Mailbox>,
    pub events: EventSender,
}

fn alone(scene: Option<&str>) -> Alone {
    alone_with(scene, RenderSettings::default())
}

fn alone_with(scene: Option<&str>, settings: RenderSettings) -> Alone {
    let mailbox = Arc::new(Mailbox::default());
    let (sender, events) = std::sync::mpsc::channel();
    let options = ViewOptions {
        scene: scene.map(str::to_owned),
        gltf_scene: None,
        confine: Default::default(),
        geometry: Default::default(),
        settings,
        device: Default::default(),
        size: Some([1000, 700]),
        frame_rate: Some(10.0),
        painter: Default::default(),
        device_name: None,
    };
    let app = App::new(&options, mailbox.clone(), events);
    let harness = Harness::builder()
        .with_size(egui::vec2(1000.0, 700.0))
        .build_state(|context, app: &mut App| panels::show_frame(app, context), app);
    Alone { harness, mailbox, events: EventSender::new(sender, Arc::new(|| {})) }
}

pub fn loaded() -> Alone {
    loaded_with(RenderSettings::default())
}

/// Three objects: two of one mesh, of which one has a name.
fn objects() -> Vec<ObjectSummary> {
    let object = |name: &str, mesh: usize| ObjectSummary {
        name: name.into(),
        mesh: (mesh, ["chair", "table"][mesh].into()),
        primitives: 12,
        bounds: Some((glam::DVec3::ZERO, glam::DVec3::splat(0.5))),
        ..Default::default()
    };
    vec![object("left", 0), object("", 0), object("table", 1)]
}

/// A point of the first object.
fn a_pick() -> Pick {
    Pick {
        position: glam::DVec3::ONE,
        distance: 1.0,
        instance: (0, "left".into()),
        mesh: (0, "chair".into()),
        primitive: (0, 1),
        material: (0, String::new()),
        textures: Vec::new(),
    }
}

fn loaded_with(settings: RenderSettings) -> Alone {
    let mut alone = alone_with(Some("builtin:stairs"), settings);
    let scene = skylit::scene::builtin::by_name("stairs").unwrap();
    alone.events.send(Event::Loaded(Box::new(SceneSummary {
        load: 1,
        is_complete: true,
        source: "builtin:stairs".into(),
        bounds: scene.bounds().unwrap(),
        cameras: scene.cameras.clone(),
        animations: vec![("turn".into(), 2.0), ("bend".into(), 3.0)],
        materials: Arc::new(scene.materials.clone()),
        objects: Arc::new(objects()),
        counts: [3, 2, scene.materials.len(), 0],
        ..Default::default()
    })));
    alone.events.send(Event::Camera(Box::new(scene.cameras[0].clone()), None));
    alone.harness.run_steps(3);
    alone
}

impl Alone {
    pub fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_steps(3);
    }

    fn press(&mut self, key: egui::Key) {
        self.harness.key_press(key);
        self.harness.run_steps(3);
    }

    pub fn change(&mut self, change: impl FnOnce(&mut App)) -> skylit::viewer::request::Request {
        change(self.harness.state_mut());
        self.harness.run_steps(2);
        self.mailbox.peek()
    }

    pub fn shows(&self, text: &str) -> bool {
        self.harness.query_all_by_label_contains(text).count() > 0
    }
}

#[test]
fn without_a_scene_it_says_what_to_do() {
    let mut alone = alone(None);
    alone.harness.run_steps(3);
    assert!(alone.harness.query_by_label_contains("drop a file here").is_some());
    assert_eq!(alone.mailbox.peek().scene, None);
    alone.click("Open…");
    assert!(alone.harness.query_by_label_contains("builtin:NAME").is_some());
    alone.harness.event(egui::Event::Text("builtin:cornell-box".into()));
    alone.harness.run_steps(2);
    alone.press(egui::Key::Enter);
    assert_eq!(alone.mailbox.peek().scene.as_deref(), Some("builtin:cornell-box"));
}

/// A scene is shown before its images are there; loading can be cancelled; what was cancelled changes nothing any more.
#[test]
fn loading_shows_how_far_it_is_and_can_be_cancelled() {
    let mut alone = loaded();
    alone.harness.state_mut().open("large.glb");
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().load, 2);
    let geometry = |load: u64| SceneSummary { load, source: "large.glb".into(), ..Default::default() };
    alone.click("Cancel loading");
    let request = alone.mailbox.peek();
    assert_eq!((request.load, request.scene.as_deref()), (1, Some("builtin:stairs")));
    alone.events.send(Event::Loaded(Box::new(geometry(2))));
    alone.events.send(Event::LoadFailed(2, "broken".into()));
    alone.harness.run_steps(2);
    assert_eq!(alone.harness.state().scene.as_ref().unwrap().source, "builtin:stairs");
    assert!(alone.harness.query_by_label_contains("broken").is_none());

    alone.harness.state_mut().open("large.glb");
    alone.events.send(Event::Loading("loading large.glb: 1 of 4 images".into(), Some(0.25)));
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().load, 3, "a number of its own");
    assert!(alone.harness.query_by_label_contains("1 of 4 images").is_some());
    // a spinner is one, too
    let bars = alone.harness.query_all_by_role(egui::accesskit::Role::ProgressIndicator);
    assert_eq!(bars.filter_map(|b| b.accesskit_node().numeric_value()).collect::<Vec<_>>(), [25.0]);
    alone.events.send(Event::Loaded(Box::new(geometry(3))));
    alone.events.send(Event::Loading("loading large.glb: 2 of 4 images".into(), Some(0.5)));
    alone.harness.run_steps(2);
    assert_eq!(alone.harness.state().scene.as_ref().unwrap().source, "large.glb");
    assert!(alone.harness.query_by_label_contains("2 of 4 images").is_some());
    assert!(alone.harness.query_by_label("Cancel loading").is_none(), "the scene is there");
    assert!(!alone.harness.state().is_settled());
    alone.events.send(Event::Loaded(Box::new(SceneSummary { is_complete: true, ..geometry(3) })));
    alone.harness.run_steps(2);
    assert!(alone.harness.query_by_label_contains("of 4 images").is_none());
    assert!(alone.harness.query_by_label_contains("loaded the images of large.glb").is_some());
}

#[test]
fn long_names_leave_the_image_its_place() {
    let mut alone = loaded();
    let size = alone.mailbox.peek().size;
    let long = "a_name_without_any_space_as_exporters_make_them_".repeat(4);
    let pick = Pick { instance: (0, long.clone()), mesh: (0, long.clone()), material: (0, long.clone()), ..a_pick() };
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(Some(pick))));
    alone.events.send(Event::Warning(long.clone()));
    alone.events.send(Event::Device(DeviceSummary { name: long.clone(), ..Default::default() }));
    alone.harness.run_steps(3);
    alone.click("What was clicked on");
    alone.harness.run_steps(5);
    assert!(alone.harness.query_all_by_label_contains(&long).count() >= 3, "it is shown");
    assert_eq!(alone.mailbox.peek().size, size);
}

#[test]
fn the_device_is_chosen_among_those_there_are() {
    let mut alone = loaded();
    alone.click("Device");
    assert!(alone.harness.query_by_label("Vulkan device").is_none(), "there is no choice");
    alone.events.send(Event::Devices(vec!["first (a driver)".into(), "second (another)".into()]));
    alone.events.send(Event::Device(DeviceSummary { name: "second (another)".into(), index: 1, ..Default::default() }));
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().device.device, None);
    alone.click("Vulkan device");
    alone.click("first (a driver)");
    assert_eq!(alone.mailbox.peek().device.device.as_deref(), Some("0"));
}

#[test]
fn every_control_has_a_name() {
    let mut alone = loaded();
    let pick = Pick { material: (0, "white".into()), ..a_pick() };
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(Some(pick))));
    alone.harness.run_steps(3);
    for section in ["Scene file", "Comparison", "Light", "Quality", "Camera", "Device", "Research"] {
        // "Camera" is a menu, too
        alone.harness.get_all_by_label(section).last().unwrap().click();
        alone.harness.run_steps(3);
    }
    use egui::accesskit::Role;
    let names = |role: Role| {
        alone
            .harness
            .query_all_by_role(role)
            .map(|n| (n.accesskit_node().label().unwrap_or_default(), format!("{n:?}")))
    };
    for role in [
        Role::Button,
        Role::CheckBox,
        Role::Slider,
        Role::SpinButton,
        Role::ComboBox,
        Role::TextInput,
        Role::RadioButton,
    ] {
        for (name, node) in names(role) {
            assert!(!name.trim().is_empty(), "{role:?} without a name: {node}");
        }
    }
    assert!(names(Role::ComboBox).count() >= 6 && names(Role::Button).count() >= 6);
}

#[test]
fn controls_change_what_is_requested() {
    let mut alone = loaded();
    let request = alone.mailbox.peek();
    assert!(request.camera.is_some() && request.panes.len() == 1 && request.size[0] > 500, "{request:?}");
    assert_eq!(request.panes[0].frames.preset, Some(skylit::realtime::Preset::Balanced));

    alone.click("Radius");
    let radius = alone.mailbox.peek().panes[0].integrators.ao.radius();
    let size = skylit::scene::builtin::by_name("stairs").unwrap().bounds().map(|(lo, hi)| (hi - lo).length()).unwrap();
    assert!((0.05 * size..0.2 * size).contains(&radius), "{radius} of {size}");

    alone.click("Compare");
    assert_eq!(alone.harness.state().arrangement, Arrangement::Split(0.5));
    let request = alone.mailbox.peek();
    // the truth is a view of its own, with the same radius
    assert!(request.panes.len() == 2 && request.shown == 1 && request.compares);
    assert_eq!(request.panes[1].integrators.ao.radius(), radius);
    assert_eq!(request.panes[1].frames.filter, Some(skylit::realtime::FilterKind::None));
    alone.press(egui::Key::X);
    assert_eq!(alone.mailbox.peek().panes.len(), 1);

    alone.press(egui::Key::Num4);
    assert_eq!(alone.mailbox.peek().panes[0].integrator().name(), "path");
    assert_eq!(alone.mailbox.peek().panes[0].integrators.ao.ao_radius, None, "paths have no AO radius");
    alone.press(egui::Key::Num1);
    alone.press(egui::Key::T);
    assert!(alone.mailbox.peek().compares && alone.harness.state().second == Second::Truth);
}

#[test]
fn the_mouse_and_keys_move_the_camera() {
    let mut alone = loaded();
    let camera = |alone: &Alone| alone.mailbox.peek().camera.unwrap();
    let before = camera(&alone);
    let at = |x: f32, y: f32| egui::pos2(x, y);
    for (button, modifiers) in [
        (egui::PointerButton::Primary, egui::Modifiers::NONE),
        (egui::PointerButton::Primary, egui::Modifiers::SHIFT),
        (egui::PointerButton::Middle, egui::Modifiers::NONE),
        (egui::PointerButton::Secondary, egui::Modifiers::NONE),
    ] {
        let start = camera(&alone);
        alone.harness.event(egui::Event::PointerMoved(at(300.0, 300.0)));
        alone.harness.run_steps(1);
        let press = |pressed, pos| egui::Event::PointerButton { pos, button, pressed, modifiers };
        alone.harness.event_modifiers(press(true, at(300.0, 300.0)), modifiers);
        alone.harness.run_steps(1);
        alone.harness.event_modifiers(egui::Event::PointerMoved(at(360.0, 330.0)), modifiers);
        alone.harness.run_steps(1);
        alone.harness.event_modifiers(press(false, at(360.0, 330.0)), modifiers);
        alone.harness.run_steps(2);
        assert_ne!(camera(&alone), start, "{button:?} {modifiers:?}");
    }
    for key in [egui::Key::W, egui::Key::Q, egui::Key::ArrowLeft] {
        let start = camera(&alone);
        alone.harness.key_down(key);
        alone.harness.run_steps(3);
        alone.harness.key_up(key);
        alone.harness.run_steps(1);
        assert_ne!(camera(&alone), start, "{key:?}");
    }
    alone.press(egui::Key::B);
    assert_eq!(alone.harness.state().bookmarks.len(), 1);
    alone.press(egui::Key::F);
    let framed = camera(&alone);
    assert_ne!(framed, before);
    // at rest nothing is requested
    let number = alone.mailbox.number();
    alone.harness.run_steps(5);
    assert_eq!(alone.mailbox.number(), number);
}

#[test]
fn errors_are_shown_as_the_command_line_says_them() {
    let mut alone = alone(Some("missing.glb"));
    alone.events.send(Event::LoadFailed(1, "missing.glb: no such file".into()));
    alone.harness.run_steps(3);
    assert!(alone.harness.query_all_by_label_contains("missing.glb: no such file").count() >= 1);
    let mut alone = loaded();
    alone.events.send(Event::PaneError(0, Some("the settings do not fit".into())));
    alone.harness.run_steps(3);
    assert!(alone.harness.query_all_by_label_contains("the settings do not fit").count() >= 1);
    alone.press(egui::Key::F1);
    assert!(alone.harness.query_by_label_contains("orbit around the pivot").is_some());
    alone.press(egui::Key::Escape);
    assert!(alone.harness.query_by_label_contains("orbit around the pivot").is_none());
}

#[test]
fn a_tracer_that_is_not_there_yet_is_told() {
    let mut alone = loaded();
    let device = |tracer: &str| DeviceSummary { tracer: (tracer.into(), "a reason".into()), ..Default::default() };
    alone.events.send(Event::Device(device("compute")));
    alone.click("Device");
    assert!(alone.harness.query_by_label("Tracer compute: a reason").is_some());
    alone.click("Tracer");
    alone.click("query");
    assert!(alone.harness.query_by_label("Changing to query…").is_some());
    alone.events.send(Event::Device(device("query")));
    alone.harness.run_steps(2);
    assert!(alone.harness.query_by_label("Tracer query: a reason").is_some());
}

/// Until the first picture of another technique is there, its name says so.
#[test]
fn a_name_is_not_that_of_the_picture_before() {
    let mut alone = loaded();
    let picture = Arc::new(ViewPicture { size: [1, 1], rgba: vec![255; 4] });
    let arrives = |alone: &mut Alone, request: u64| {
        let progress = Progress { picture: picture.clone(), request, ..Default::default() };
        alone.events.send(Event::Picture(Box::new(progress)));
        alone.harness.run_steps(3);
        alone.harness.state().is_title_ahead(false)
    };
    let before = alone.mailbox.number();
    assert!(!arrives(&mut alone, before));
    alone.press(egui::Key::Num4);
    let after = alone.mailbox.number();
    assert!(after > before && alone.harness.state().is_title_ahead(false));
    assert!(arrives(&mut alone, before), "a picture of the technique before came late");
    assert!(!arrives(&mut alone, after));
    alone.press(egui::Key::T);
    assert!(!alone.harness.state().is_title_ahead(false), "the first image has its technique as before");
    // the truth is there, and its heat map needs no other picture
    let number = alone.mailbox.number();
    let progress = Progress { pane: TRUTH, picture: picture.clone(), request: number, ..Default::default() };
    alone.events.send(Event::Picture(Box::new(progress)));
    for second in [Second::Truth, Second::HeatMap, Second::Truth] {
        alone.harness.state_mut().second = second;
        alone.harness.run_steps(3);
        assert!(!alone.harness.state().is_title_ahead(true), "{second:?}");
    }
}

/// What is to be saved is requested until it is done, whatever else is requested, but not of another scene; the heat map is saved as it is shown.
#[test]
fn saving_waits_but_not_for_another_scene() {
    let folder = tempfile::tempdir().unwrap();
    let mut alone = loaded();
    let save = |alone: &mut Alone, name: &str| {
        alone.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::S);
        alone.harness.run_steps(3);
        let path = folder.path().join(name);
        *alone.harness.state_mut().dialog.as_mut().unwrap().text_mut() = path.to_string_lossy().into_owned();
        alone.press(egui::Key::Enter);
        path
    };
    let path = save(&mut alone, "image.png");
    let task = Task::Save { pane: 0, path };
    alone.press(egui::Key::Num3);
    assert_eq!(alone.mailbox.latest().0.tasks, std::slice::from_ref(&task), "another technique changes nothing");
    alone.mailbox.done(&task);
    assert!(alone.mailbox.latest().0.tasks.is_empty());
    save(&mut alone, "image.png");
    assert_eq!(alone.mailbox.latest().0.tasks, [task]);
    alone.harness.state_mut().open("builtin:cornell-box");
    alone.harness.run_steps(2);
    assert!(alone.mailbox.latest().0.tasks.is_empty());

    let mut alone = loaded();
    let app = alone.harness.state_mut();
    (app.second, app.shows_second) = (Second::HeatMap, true);
    let path = save(&mut alone, "heat.png");
    assert!(alone.harness.query_all_by_label_contains("there is no comparison").count() > 0);
    let heat_map = Arc::new(ViewPicture { size: [2, 1], rgba: vec![9, 8, 7, 255, 1, 2, 3, 255] });
    let request = alone.mailbox.number();
    alone.events.send(Event::Compared(Box::new(Comparison { request, heat_map, ..Default::default() })));
    alone.harness.run_steps(2);
    save(&mut alone, "heat.png");
    let image = skylit::output::load(&path).unwrap();
    assert_eq!((image.width, image.height), (2, 1));
    assert!(alone.mailbox.latest().0.tasks.is_empty());
}

/// The truth is of the integrator that is shown, with samples of its own, unless another was chosen for it.
#[test]
fn the_truth_is_of_what_is_shown() {
    let mut alone = loaded();
    alone.press(egui::Key::T);
    let truth = |alone: &Alone| alone.mailbox.peek().panes.last().unwrap().clone();
    assert_eq!(alone.harness.state().truth(), Technique::Converged);
    alone.press(egui::Key::Num4);
    let path = truth(&alone);
    assert_eq!(path.integrator().name(), "path");
    assert!(path.realtime_setting().is_none(), "a still, which converges");
    assert_ne!(path.image.seed, alone.mailbox.peek().panes[0].image.seed);
    let sky = Technique::Still("ao-sky".parse().unwrap());
    alone.change(|app| app.first = Technique::Preset(Default::default()));
    alone.change(|app| app.choose_truth(Some(sky)));
    alone.press(egui::Key::Num3);
    assert_eq!(truth(&alone).integrator().name(), "ao-sky", "of every preset");
    for name in ["direct", "lit", "whitted", "ao-sky"] {
        alone.change(|app| app.first = Technique::Frames(name.parse().unwrap()));
        assert_eq!(truth(&alone).integrator().name(), name);
    }
}

/// A comparison is shown as long as it is one of what is requested, and says what with.
#[test]
fn comparisons_go_with_what_they_were_of() {
    let compared = || {
        let mut alone = loaded();
        alone.press(egui::Key::T);
        let request = alone.mailbox.number();
        alone.events.send(Event::Compared(Box::new(Comparison { request, rmse: 0.125, ..Default::default() })));
        alone.harness.run_steps(2);
        assert!(alone.shows("RMSE 0.1250") && alone.shows("against AO converged"));
        (alone, request)
    };
    type Change = (&'static str, fn(&mut App));
    let changes: [Change; 9] = [
        ("light", |app| app.lighting.environment = Some("1,1,1".into())),
        ("animation", |app| app.playback.animation = Some(1)),
        ("technique", |app| app.first = Technique::Gtao),
        ("truth", |app| app.choose_truth(Some(Technique::Still("path".parse().unwrap())))),
        ("radius", |app| app.settings.integrators.ao.ao_radius = Some(Length::Units(0.3))),
        ("camera", |app| app.control.as_mut().unwrap().orbit(10.0, 0.0)),
        ("reload", |app| app.reload()),
        ("tracer", |app| app.device_settings.tracer = Some(skylit::tracer::TracerChoice::Query)),
        ("no comparison", |app| app.compares = false),
    ];
    for (name, change) in changes {
        let (mut alone, before) = compared();
        alone.change(change);
        assert!(!alone.shows("RMSE 0.1250"), "{name}");
        // one that was on its way
        alone.events.send(Event::Compared(Box::new(Comparison { request: before, rmse: 0.125, ..Default::default() })));
        alone.harness.run_steps(2);
        assert!(!alone.shows("RMSE 0.1250"), "{name}: late");
    }
    // the time of an animation
    let (mut alone, _) = compared();
    alone.change(|app| app.playback.animation = Some(0));
    let request = alone.mailbox.number();
    alone.events.send(Event::Compared(Box::new(Comparison { request, rmse: 0.125, ..Default::default() })));
    alone.harness.run_steps(2);
    assert!(alone.shows("RMSE 0.1250"));
    alone.change(|app| app.playback.time = 1.0);
    assert!(!alone.shows("RMSE 0.1250"));
}

/// What is rendered or copied is the moment of the animation that is shown, with the camera and the radius that are.
#[test]
fn what_is_rendered_is_what_is_shown() {
    let mut alone = loaded();
    alone.change(|app| app.playback.animation = Some(1));
    alone.change(|app| app.playback.time = 1.25);
    let app = alone.harness.state();
    let command = app.command().unwrap();
    for part in ["--animate 1", "--time 1.25", "--camera 0", "--ao-radius inf"] {
        assert!(command.contains(part), "{part}: {command}");
    }
    let turntable = app.render_settings(RenderedMotion::Turntable).unwrap().frames;
    assert_eq!((turntable.animation(), turntable.time, turntable.orbit), (Some("1"), Some(1.25), Some(120)));
    let animation = app.render_settings(RenderedMotion::Animation).unwrap().frames;
    assert_eq!((animation.animation(), animation.time), (Some("1"), None));
    assert_eq!(animation.range().end, 90, "three seconds");
    // a still of a moment is one of a sequence of one
    alone.change(|app| app.first = Technique::Still("path".parse().unwrap()));
    let still = alone.harness.state().render_settings(RenderedMotion::Nothing).unwrap();
    assert!(still.is_still_sequence() && still.frames.time == Some(1.25) && still.image.spp.is_some());
    still.check().unwrap();
    // a camera that the user has left where the animation would move it
    alone.change(|app| app.followed = None);
    let command = alone.harness.state().command().unwrap();
    assert!(command.contains("--eye") && !command.contains("--camera"), "{command}");
    // what is saved is what is shown when it is read again
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("settings.json");
    let saved = alone.harness.state().render_settings(RenderedMotion::Nothing).unwrap();
    std::fs::write(&path, serde_json::to_vec(&saved).unwrap()).unwrap();
    let mut other = loaded();
    other.change(|app| app.open_file(&path.to_string_lossy()));
    let app = other.harness.state();
    assert_eq!(app.first, Technique::Still("path".parse().unwrap()));
    assert_eq!((app.playback.animation, app.playback.time, app.control.is_none()), (Some(1), 1.25, true));
    assert_eq!(other.mailbox.peek().first_camera, saved.camera, "the renderer chooses it");
    let started = loaded_with(saved);
    assert_eq!((started.mailbox.peek().animation, started.mailbox.peek().time), (Some(1), 1.25));
}

/// A camera that an animation moves is left where it is, not where it would be without.
#[test]
fn a_followed_camera_is_left_where_it_is() {
    let mut alone = loaded();
    assert_eq!(alone.mailbox.peek().followed_camera, Some(0), "as skylit render does");
    let mut moved = alone.harness.state().control.as_ref().unwrap().camera().clone();
    moved.camera_to_world.translation += glam::DVec3::new(3.0, 4.0, 5.0);
    let number = alone.mailbox.number();
    let progress = Progress { camera: Some(moved.clone()), request: number, ..Default::default() };
    alone.events.send(Event::Picture(Box::new(progress)));
    alone.harness.run_steps(2);
    alone.press(egui::Key::B);
    assert_eq!(alone.harness.state().bookmarks[0].1, moved);
    let request = alone.change(App::leave_followed);
    assert_eq!((request.camera, request.followed_camera), (Some(moved), None));
}

/// Where everything is black a line says why, and F and Ctrl+R have a camera found that sees something.
#[test]
fn black_views_are_explained_and_left() {
    let mut alone = loaded();
    alone.events.send(Event::Black(0, Some("Nothing of the scene is in view".into())));
    alone.harness.run_steps(2);
    assert!(alone.shows("Nothing of the scene is in view"));
    alone.press(egui::Key::F);
    let request = alone.mailbox.peek();
    assert_eq!(request.tasks, [Task::CheckView { frames: true }]);
    let from = request.camera.unwrap();
    let mut to = from.clone();
    to.camera_to_world.translation.x += 1.0;
    alone.events.send(Event::Framed(Box::new([from.clone(), to.clone()])));
    alone.events.send(Event::Black(0, None));
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().camera, Some(to.clone()));
    assert!(!alone.shows("Nothing of the scene is in view"));
    // the user has moved on
    alone.events.send(Event::Framed(Box::new([from.clone(), from])));
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().camera, Some(to));
    alone.mailbox.done(&Task::CheckView { frames: true });
    alone.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::R);
    alone.harness.run_steps(2);
    let request = alone.mailbox.peek();
    assert_eq!((request.load, request.tasks), (2, vec![Task::CheckView { frames: false }]));
}

/// An image that is dropped becomes the environment; one that cannot be read leaves the light as it was.
#[test]
fn images_are_environments() {
    for (path, kind) in [
        ("a/sky.hdr", FileKind::Environment),
        ("a/SKY.EXR", FileKind::Environment),
        ("pano.jpg", FileKind::Environment),
        ("settings.json", FileKind::Settings),
        ("builtin:stairs", FileKind::Scene),
        ("scene.glb", FileKind::Scene),
        ("no extension", FileKind::Scene),
    ] {
        assert_eq!(FileKind::from_path(path), kind, "{path}");
    }
    let mut alone = loaded();
    alone.change(|app| app.lighting.environment_turn = Some(90.0));
    let good = alone.change(|app| app.open_file("sky.hdr")).lighting;
    assert_eq!((good.environment.as_deref(), good.environment_turn), (Some("sky.hdr"), None));
    assert_eq!(alone.mailbox.peek().scene.as_deref(), Some("builtin:stairs"), "the scene stays");
    assert!(alone.shows("environment: sky.hdr"));
    let bad = alone.change(|app| app.open_file("broken.exr")).lighting;
    alone.events.send(Event::LightingRefused(Box::new([bad, good.clone()]), "broken.exr: not an image".into()));
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().lighting, good);
    assert!(alone.shows("broken.exr: not an image"));
}

fn path() -> Technique {
    Technique::Still(skylit::integrators::IntegratorName::find("path").unwrap())
}

/// The light of a file is shown at the exposure that it needs: once for a scene, unless there is one, and not for the next scene.
#[test]
fn light_of_a_file_is_exposed_once() {
    let mut alone = loaded();
    alone.change(|app| app.first = path());
    let exposure = |alone: &Alone| alone.mailbox.peek().panes[0].picture.exposure;
    let send = |alone: &mut Alone, load, stops| {
        alone.events.send(Event::Exposure(load, stops));
        alone.harness.run_steps(2);
    };
    send(&mut alone, 7, Some(3.0));
    assert_eq!(exposure(&alone), None, "of another load");
    send(&mut alone, 1, Some(-6.0));
    assert_eq!(exposure(&alone), Some(-6.0));
    assert!(alone.shows("exposure -6 stops, for the light of the scene is far from a display's"));
    send(&mut alone, 1, Some(5.0));
    assert_eq!(exposure(&alone), Some(-6.0), "it does not follow the view");
    alone.change(|app| app.settings.picture.exposure = None);
    send(&mut alone, 1, Some(5.0));
    assert_eq!(exposure(&alone), None, "the user has decided");

    // another scene has its own
    let open = |alone: &mut Alone, load: u64, source: &str| {
        alone.change(|app| app.open(source));
        let summary = SceneSummary { load, is_complete: true, source: source.into(), ..Default::default() };
        alone.events.send(Event::Loaded(Box::new(summary)));
        alone.harness.run_steps(2);
    };
    open(&mut alone, 2, "builtin:cornell-box");
    send(&mut alone, 2, Some(4.0));
    assert_eq!(exposure(&alone), Some(4.0));
    open(&mut alone, 3, "builtin:stairs");
    assert_eq!(exposure(&alone), None);
    // one that needs none keeps none, wherever the camera goes
    send(&mut alone, 3, None);
    send(&mut alone, 3, Some(4.0));
    assert_eq!(exposure(&alone), None);

    let mut settings = RenderSettings::default();
    settings.picture.exposure = Some(1.0);
    let mut given = loaded_with(settings);
    given.change(|app| app.first = path());
    send(&mut given, 1, Some(-6.0));
    assert_eq!(exposure(&given), Some(1.0), "as it was given");
}

/// Lengths start from the scene's size, and those that were given are not changed by being shown.
#[test]
fn lengths_are_sane_and_stay() {
    let mut alone = loaded();
    // its slider has the same name
    let tick = |alone: &mut Alone| {
        alone.harness.get_by_role_and_label(egui::accesskit::Role::CheckBox, "Falloff").click();
        alone.harness.run_steps(3);
    };
    tick(&mut alone);
    let size = alone.harness.state().control.as_ref().unwrap().scene_size();
    let half = |alone: &Alone| 1.0 / alone.mailbox.peek().panes[0].integrators.ao.ao_falloff.unwrap().log2();
    assert!((0.02 * size..0.2 * size).contains(&half(&alone)), "without a radius {} of {size}", half(&alone));
    tick(&mut alone);
    alone.change(|app| app.settings.integrators.ao.ao_radius = Some(Length::Units(0.02)));
    tick(&mut alone);
    assert!((half(&alone) - 0.01).abs() < 1e-4, "half of the radius, {}", half(&alone));
    // a scene of a millimetre has a falloff, too, that can be computed with
    alone.change(|app| app.settings.integrators.ao.ao_falloff = Some(1e300));
    assert_eq!(alone.mailbox.peek().panes[0].integrators.ao.ao_falloff, Some(1e300));

    for radius in [1e-7, 1e7] {
        let mut settings = RenderSettings::default();
        settings.integrators.ao.ao_radius = Some(Length::Units(radius));
        let mut alone = loaded_with(settings);
        alone.harness.get_all_by_label("Camera").last().unwrap().click();
        let request = alone.change(|app| app.control.as_mut().unwrap().set_fov_y(0.01));
        assert_eq!(request.panes[0].integrators.ao.radius(), radius);
        let skylit::scene::Projection::Perspective { fov_y } = request.camera.unwrap().projection else { panic!() };
        assert!((fov_y - 0.01).abs() < 1e-12, "{fov_y}");
    }
}

/// Lengths and places of one scene are not those of the next; what the command line says of all of them is.
#[test]
fn another_scene_starts_afresh() {
    let mut settings = RenderSettings::default();
    settings.camera.eye = Some(glam::DVec3::ONE);
    settings.camera.target = Some(glam::DVec3::ZERO);
    settings.integrators.ao.ao_falloff = Some(2.0);
    let mut alone = loaded_with(settings);
    let light = skylit::scene::light_spec::parse("sphere position=1,2,3 radius=0.5 radiance=4").unwrap();
    alone.change(|app| {
        app.settings.integrators.ao.ao_radius = Some(Length::Units(7.0));
        app.settings.integrators.ao.ao_falloff = Some(9.0);
        app.lighting.light.push(light);
        app.lighting.environment = Some("1,1,1".into());
        app.playback.animation = Some(1);
    });
    alone.change(|app| app.open("builtin:cornell-box"));
    let summary =
        SceneSummary { load: 2, is_complete: true, source: "builtin:cornell-box".into(), ..Default::default() };
    alone.events.send(Event::Loaded(Box::new(summary)));
    alone.harness.run_steps(2);
    let request = alone.mailbox.peek();
    let ao = &request.panes[0].integrators.ao;
    assert_eq!((ao.ao_radius, ao.ao_falloff), (None, Some(2.0)));
    assert_eq!((request.first_camera.eye, request.animation), (None, None));
    assert!(request.lighting.light.is_empty() && request.lighting.environment.is_some());
}

/// Variants and scenes of a glTF file are lists in the panel; neither is kept for a file that has none of that name.
#[test]
fn variants_and_scenes_of_a_file_are_chosen() {
    let mut alone = alone(Some("shoe.glb"));
    let summary = |load: u64, source: &str, names: [&str; 2]| SceneSummary {
        load,
        is_complete: true,
        source: source.into(),
        scenes: names.map(str::to_owned).to_vec(),
        variants: names.map(str::to_owned).to_vec(),
        ..Default::default()
    };
    alone.events.send(Event::Loaded(Box::new(summary(1, "shoe.glb", ["beach", "street"]))));
    alone.harness.run_steps(3);
    alone.harness.get_all_by_label("Scene file").last().unwrap().click();
    alone.harness.run_steps(10);

    // a variant is a setting, and needs no loading
    let choose = |alone: &mut Alone, list: &str, item: &str| {
        alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, list).click();
        alone.harness.run_steps(5);
        alone.harness.get_all_by_label(item).last().unwrap().click();
        alone.harness.run_steps(5);
    };
    choose(&mut alone, "Variant", "street");
    let request = alone.mailbox.peek();
    assert_eq!((request.meaning.variant.as_deref(), request.load), (Some("street"), 1));

    // another scene of the file does
    choose(&mut alone, "Scene of the file", "1 street");
    let request = alone.mailbox.peek();
    assert_eq!((request.gltf_scene.as_deref(), request.load), (Some("1"), 2));
    alone.events.send(Event::Loaded(Box::new(summary(2, "shoe.glb", ["beach", "street"]))));
    alone.harness.run_steps(3);
    assert_eq!(alone.mailbox.peek().meaning.variant.as_deref(), Some("street"));

    // another file has neither
    alone.change(|app| app.open("lamp.glb"));
    alone.events.send(Event::Loaded(Box::new(summary(3, "lamp.glb", ["on", "off"]))));
    alone.harness.run_steps(3);
    let request = alone.mailbox.peek();
    assert_eq!((request.gltf_scene, request.meaning.variant), (None, None));
}

/// Normals and texture coordinates are lists in the panel; either is for loading, and in the command that renders the view.
#[test]
fn normals_and_texture_coordinates_are_chosen() {
    let mut alone = loaded();
    alone.harness.run_steps(3);
    alone.harness.get_all_by_label("Scene file").last().unwrap().click();
    alone.harness.run_steps(10);
    let choose = |alone: &mut Alone, list: &str, item: &str| {
        alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, list).click();
        alone.harness.run_steps(5);
        alone.harness.get_all_by_label(item).last().unwrap().click();
        alone.harness.run_steps(5);
    };
    choose(&mut alone, "Normals", "flat");
    let request = alone.mailbox.peek();
    assert_eq!((request.geometry.normals, request.load), (NormalSource::Flat, 2));
    choose(&mut alone, "Texture coordinates", "box");
    let request = alone.mailbox.peek();
    assert_eq!((request.geometry.uv, request.load), (Some(Projection::Box), 3));
    let command = alone.harness.state().command().unwrap();
    assert!(command.contains(" --normals flat --uv box "), "{command}");

    // the file's own again
    choose(&mut alone, "Normals", "file");
    choose(&mut alone, "Texture coordinates", "of the file");
    let request = alone.mailbox.peek();
    assert_eq!((request.geometry, request.load), (GeometryOptions::default(), 5));
}

/// Play at the end starts anew; Space shows one image of two.
#[test]
fn play_and_flicker_have_an_effect() {
    let mut alone = loaded();
    alone.change(|app| (app.playback.animation, app.playback.time, app.playback.repeats) = (Some(0), 2.0, false));
    alone.press(egui::Key::P);
    let playback = &alone.harness.state().playback;
    assert!(playback.runs && playback.time < 1.0, "{playback:?}");
    alone.press(egui::Key::X);
    alone.press(egui::Key::Space);
    let app = alone.harness.state();
    assert_eq!((app.arrangement, app.shows_second), (Arrangement::Single, true));
}

/// The opening view is a key away; views along axes, a typed position and the wheel move the camera.
#[test]
fn cameras_are_found_again_and_typed() {
    let mut alone = loaded();
    let opening = alone.mailbox.peek().camera.unwrap();
    let forward = |alone: &Alone| -alone.mailbox.peek().camera.unwrap().camera_to_world.matrix3.z_axis;
    let press = |alone: &mut Alone, modifiers: egui::Modifiers, key: egui::Key| {
        alone.harness.key_press_modifiers(modifiers, key);
        alone.harness.run_steps(3);
    };
    let shifted = egui::Modifiers::COMMAND | egui::Modifiers::SHIFT;
    for (modifiers, key, expected) in [
        (egui::Modifiers::COMMAND, egui::Key::Num7, glam::DVec3::NEG_Y),
        (egui::Modifiers::COMMAND, egui::Key::Num1, glam::DVec3::NEG_Z),
        (shifted, egui::Key::Num1, glam::DVec3::Z),
        (egui::Modifiers::COMMAND, egui::Key::Num3, glam::DVec3::NEG_X),
    ] {
        press(&mut alone, modifiers, key);
        assert!((forward(&alone) - expected).length() < 1e-9, "{key:?}: {}", forward(&alone));
    }
    press(&mut alone, egui::Modifiers::NONE, egui::Key::Home);
    assert_eq!(alone.mailbox.peek().camera.as_ref(), Some(&opening));

    // the wheel comes closer to what is under the pointer: the camera moves to its side, too
    let right = opening.camera_to_world.matrix3.x_axis;
    alone.harness.event(egui::Event::PointerMoved(egui::pos2(100.0, 350.0)));
    let wheel = |y| egui::Event::MouseWheel {
        unit: egui::MouseWheelUnit::Point,
        delta: egui::vec2(0.0, y),
        modifiers: egui::Modifiers::NONE,
    };
    alone.harness.event(wheel(200.0));
    alone.harness.run_steps(40);
    let moved = alone.mailbox.peek().camera.unwrap().camera_to_world.translation - opening.camera_to_world.translation;
    assert!(moved.dot(right) < 0.0 && moved.dot(-opening.camera_to_world.matrix3.z_axis) > 0.0, "{moved}");

    // numbers of the eye, typed
    press(&mut alone, egui::Modifiers::NONE, egui::Key::Home);
    alone.harness.get_all_by_label("Camera").last().unwrap().click();
    alone.harness.run_steps(10);
    let target = alone.harness.state().control.as_ref().unwrap().pivot();
    alone.harness.get_by_label("Eye y").click();
    alone.harness.run_steps(3);
    alone.harness.event(egui::Event::Text("40".into()));
    alone.harness.run_steps(3);
    alone.press(egui::Key::Enter);
    let typed = alone.harness.state().control.as_ref().unwrap();
    assert!((typed.eye().y - 40.0).abs() < 1e-9 && (typed.pivot() - target).length() < 1e-6, "{}", typed.eye());
    assert_eq!(alone.mailbox.peek().camera.unwrap().camera_to_world.translation.y, typed.eye().y);

    // parallel rays, by a box or a key; they can be rendered
    let is_parallel = |alone: &Alone| {
        matches!(alone.mailbox.peek().camera.unwrap().projection, skylit::scene::Projection::Orthographic { .. })
    };
    assert!(!is_parallel(&alone) && alone.shows("Field of view"));
    alone.click("Parallel rays");
    alone.harness.run_steps(5);
    assert!(is_parallel(&alone) && alone.shows("Height of the view") && !alone.shows("Field of view"));
    let settings = alone.harness.state().render_settings(RenderedMotion::Nothing).unwrap();
    assert!(settings.flags().join(" ").contains("--orthographic "), "{:?}", settings.flags());
    press(&mut alone, egui::Modifiers::COMMAND, egui::Key::Num5);
    assert!(!is_parallel(&alone));
}

/// Environments are chosen from a list, turned in degrees and brightened in stops.
#[test]
fn environments_are_chosen_and_turned() {
    let mut alone = loaded();
    alone.harness.get_by_label("Light").click();
    alone.harness.run_steps(10);
    alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "Environment").click();
    alone.harness.run_steps(5);
    alone.click("Soft box");
    assert_eq!(alone.mailbox.peek().lighting.environment.as_deref(), Some("softbox"));

    // Shift + right drag: half a degree a point, around and around
    let drag = |alone: &mut Alone, by: f32| {
        let (shift, button) = (egui::Modifiers::SHIFT, egui::PointerButton::Secondary);
        let at = |x: f32| egui::pos2(x, 350.0);
        let press = |pressed, pos| egui::Event::PointerButton { pos, button, pressed, modifiers: shift };
        alone.harness.event(egui::Event::PointerMoved(at(200.0)));
        alone.harness.run_steps(1);
        alone.harness.event_modifiers(press(true, at(200.0)), shift);
        alone.harness.run_steps(1);
        alone.harness.event_modifiers(egui::Event::PointerMoved(at(200.0 + by)), shift);
        alone.harness.run_steps(1);
        alone.harness.event_modifiers(press(false, at(200.0 + by)), shift);
        alone.harness.run_steps(2);
    };
    let camera = alone.mailbox.peek().camera;
    drag(&mut alone, 40.0);
    assert_eq!(alone.mailbox.peek().lighting.environment_turn, Some(20.0));
    drag(&mut alone, 330.0);
    assert_eq!(alone.mailbox.peek().lighting.environment_turn, Some(-175.0));
    assert_eq!(alone.mailbox.peek().camera, camera);

    // the scene's own has neither turn nor brightness
    alone.change(|app| app.lighting.environment_scale = Some(2.0));
    alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "Environment").click();
    alone.harness.run_steps(5);
    alone.click("The scene's own");
    let lighting = alone.mailbox.peek().lighting;
    assert_eq!((lighting.environment, lighting.environment_turn, lighting.environment_scale), (None, None, None));
}

/// Background and ground are chosen in the panel of light, and each technique gets what it can show.
#[test]
fn backgrounds_and_grounds_are_chosen() {
    let mut alone = loaded();
    alone.harness.get_by_label("Light").click();
    alone.harness.run_steps(10);
    let choose = |alone: &mut Alone, list: &str, item: &str| {
        alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, list).click();
        alone.harness.run_steps(5);
        alone.click(item);
        alone.mailbox.peek()
    };
    alone.change(|app| app.first = Technique::Still("path".parse().unwrap()));
    let request = choose(&mut alone, "Background", "Blurred");
    assert_eq!(request.panes[0].image.background, Some(Backdrop::Blurred));
    let request = choose(&mut alone, "Ground", "Shadow catcher");
    assert_eq!((request.panes[0].image.ground, request.ground), (Some(Ground::Catcher), (Ground::Catcher, None)));
    let settings = alone.harness.state().render_settings(RenderedMotion::Nothing).unwrap();
    let flags = settings.flags().join(" ");
    assert!(flags.contains("--background blurred") && flags.contains("--ground catcher"), "{flags}");

    // ambient occlusion has no environment to blur; frames in real time catch, too, but Larsen's show a plane
    let plane = "What is shown catches no shadows: the ground is a plane.";
    let frames = Technique::Frames("path".parse().unwrap());
    let caught = [(Technique::Preset(Preset::Balanced), None), (frames, Some(Backdrop::Blurred))];
    for (technique, background) in caught {
        alone.change(|app| app.first = technique);
        let pane = alone.mailbox.peek().panes[0].clone();
        assert_eq!((pane.image.background, pane.image.ground), (background, Some(Ground::Catcher)), "{technique:?}");
        assert!(!alone.shows(plane), "{technique:?}");
        // occlusion is black, and so is what is behind it
        assert_eq!(alone.shows("On black no occlusion is seen"), background.is_none(), "{technique:?}");
        pane.check().unwrap();
    }
    alone.change(|app| app.first = Technique::Preset(Preset::Larsen));
    let pane = alone.mailbox.peek().panes[0].clone();
    assert_eq!((pane.image.background, pane.image.ground), (None, Some(Ground::Plane)));
    assert!(alone.shows(plane));
    pane.check().unwrap();
    alone.change(|app| app.first = Technique::Preset(Preset::Balanced));
    let request = choose(&mut alone, "Background", "Colour");
    assert!(matches!(request.panes[0].image.background, Some(Backdrop::Colour(_))));
    let request = choose(&mut alone, "Background", "The environment");
    assert_eq!(request.panes[0].image.background, None);
    let request = choose(&mut alone, "Ground", "None");
    assert_eq!((request.panes[0].image.ground, request.ground.0), (None, Ground::None));
}

/// Writes a program that is `script`. Another process writes it: a file that this one has open for writing would be so in the programs that other
/// tests start meanwhile, too, and could not be started.
#[cfg(unix)]
pub fn write_program(program: &std::path::Path, script: &str) {
    let mut command = std::process::Command::new("sh");
    command
        .args(["-c", "printf '#!/bin/sh\\n%s\\n' \"$2\" > \"$1\" && chmod +x \"$1\"", "sh"])
        .arg(program)
        .arg(script);
    assert!(command.status().unwrap().success());
}

/// A render is asked for with its size, samples and frames; it shows how far it is, and can be cancelled.
#[cfg(unix)]
#[test]
fn renders_are_asked_for_watched_and_cancelled() {
    let dir = tempfile::tempdir().unwrap();
    let program = dir.path().join("program");
    let is = |script: &str| write_program(&program, script);
    let told = dir.path().join("told");
    let output = dir.path().join("a.apng").to_string_lossy().into_owned();
    let mut alone = loaded();
    alone.change(|app| app.program = program.clone());
    let wait = |alone: &mut Alone, until: &dyn Fn(&mut Alone) -> bool| {
        let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
        while !until(alone) {
            assert!(std::time::Instant::now() < end);
            std::thread::sleep(std::time::Duration::from_millis(20));
            alone.harness.run_steps(1);
        }
    };

    // what it is asked for
    is(&format!(
        "echo $@ > {}; echo 'skylit: rendering: 40 % after 2 s, about 3 s left' >&2; exec sleep 30",
        told.display()
    ));
    alone.change(|app| app.first = Technique::Preset(skylit::realtime::Preset::Fast));
    let wanted = alone.harness.state().default_render(RenderedMotion::Turntable);
    assert_eq!((wanted.size, wanted.frames), (alone.harness.state().size(), 120));
    let wanted = RenderWanted { size: [320, 180], frames: 48, fps: 24.0, ..wanted };
    alone.change(|app| app.render(&output, &wanted));
    wait(&mut alone, &|alone| alone.harness.state().renders.iter().any(|render| render.progress().is_some()));
    let line = std::fs::read_to_string(&told).unwrap();
    for part in
        ["render builtin:stairs", "a.apng", "--size 320x180", "--orbit 48", "--frames 0..48", "--fps 24", "--lead-in"]
    {
        assert!(line.contains(part), "{part}: {line}");
    }
    let progress = alone.harness.state().renders[0].progress().unwrap();
    assert_eq!(progress, (0.4, "after 2 s, about 3 s left".into()));

    // cancelled by its button
    alone.click("✖");
    wait(&mut alone, &|alone| alone.harness.state().renders.is_empty());
    assert!(alone.shows("was cancelled"));

    // what went wrong is said
    is("echo 'skylit: error: a.apng: the disk is full' >&2; exit 4");
    alone.change(|app| app.render(&output, &wanted));
    wait(&mut alone, &|alone| alone.harness.state().renders.is_empty());
    assert!(alone.shows("the disk is full"));

    // in the window: the size from a list
    alone.change(|app| app.dialog = Some(Dialog::Render(output.clone(), wanted.clone())));
    alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "Size").click();
    alone.harness.run_steps(5);
    alone.click("1920 x 1080");
    let Some(Dialog::Render(_, changed)) = &alone.harness.state().dialog else { panic!() };
    assert_eq!(*changed, RenderWanted { size: [1920, 1080], ..wanted });
}

/// Objects are listed by their meshes, selected, hidden and shown alone; settings name them so that `skylit render` does the same.
#[test]
fn objects_are_selected_hidden_and_isolated() {
    let mut alone = loaded();
    let file = |alone: &Alone| alone.mailbox.peek().meaning;
    // two of one mesh are below it
    assert!(alone.harness.query_by_label("left").is_none());
    alone.click("⏵ chair (2)");
    alone.click("left");
    assert_eq!(alone.mailbox.peek().selected, Some(0..1));

    // without a name, or one that others have, it is a number
    alone.click("Show chair");
    assert_eq!(file(&alone).hide, ["1"]);
    let command = alone.harness.state().command().unwrap();
    assert!(command.contains(" --hide 1"), "{command}");
    alone.click("Show chair");
    assert!(file(&alone).hide.is_empty());
    alone.click("Hide");
    assert_eq!(file(&alone).hide, ["left"]);
    alone.click("Show again");
    assert!(file(&alone).hide.is_empty());

    // alone, and all again
    alone.click("Isolate");
    assert_eq!((file(&alone).only, file(&alone).hide), (vec!["left".to_owned()], Vec::new()));
    alone.click("Show table");
    assert_eq!(file(&alone).only, ["left", "table"]);
    alone.click("Show left");
    assert_eq!(file(&alone).only, ["table"]);
    alone.click("Show all");
    assert_eq!(file(&alone), Default::default());

    // it is looked at, from the same side
    let before = alone.mailbox.peek().camera.unwrap();
    alone.click("Frame");
    let after = alone.mailbox.peek().camera.unwrap();
    assert_eq!(after.camera_to_world.matrix3, before.camera_to_world.matrix3);
    let pivot = alone.harness.state().control.as_ref().unwrap().pivot();
    assert!((pivot - glam::DVec3::splat(0.25)).length() < 1e-9, "{pivot}");

    // by keys
    let press = |alone: &mut Alone, modifiers: egui::Modifiers, key: egui::Key| {
        alone.harness.key_press_modifiers(modifiers, key);
        alone.harness.run_steps(3);
    };
    press(&mut alone, egui::Modifiers::NONE, egui::Key::H);
    assert_eq!(file(&alone).hide, ["left"]);
    press(&mut alone, egui::Modifiers::SHIFT, egui::Key::H);
    assert_eq!((file(&alone).only, file(&alone).hide), (vec!["left".to_owned()], Vec::new()));
    press(&mut alone, egui::Modifiers::SHIFT, egui::Key::H);
    assert_eq!(file(&alone), Default::default());
    press(&mut alone, egui::Modifiers::NONE, egui::Key::F);
    assert!(alone.harness.state().control.as_ref().unwrap().pivot() != pivot, "all of it");
    press(&mut alone, egui::Modifiers::SHIFT, egui::Key::F);
    assert!((alone.harness.state().control.as_ref().unwrap().pivot() - pivot).length() < 1e-9);

    // another scene has others
    alone.click("Isolate");
    alone.change(|app| app.open("builtin:cornell-box"));
    let summary =
        SceneSummary { load: 2, is_complete: true, source: "builtin:cornell-box".into(), ..Default::default() };
    alone.events.send(Event::Loaded(Box::new(summary)));
    alone.harness.run_steps(3);
    assert_eq!((file(&alone), alone.mailbox.peek().selected), (Default::default(), None));
}

/// A village: a house of a roof and twelve windows, a car of wheels, a lamp and a camera, all below one node.
fn village() -> SceneSummary {
    use serde_json::json;

    let mesh = |name: &str| json!({ "name": name, "mesh": 0 });
    let mut nodes = vec![
        json!({ "name": "village", "children": [1, 2] }),
        json!({ "name": "house", "children": (9..22).collect::<Vec<_>>() }),
        json!({ "name": "car", "children": [3, 4, 7, 8] }),
        json!({ "name": "wheels", "children": [5, 6] }),
        json!({ "name": "lamp", "extensions": { "KHR_lights_punctual": { "light": 0 } } }),
        mesh("left wheel"),
        mesh("right wheel"),
        json!({ "name": "body", "mesh": 0, "translation": [5, 0, 0] }),
        json!({ "name": "driver", "camera": 0 }),
        mesh("roof"),
    ];
    nodes.extend((1..=12).map(|k| mesh(&format!("window {k}"))));
    let file = json!({
        "asset": { "version": "2.0" },
        "scenes": [{ "nodes": [0] }],
        "nodes": nodes,
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 1 } }],
        "extensions": { "KHR_lights_punctual": { "lights": [{ "type": "point" }] } },
        "meshes": [{ "name": "mesh", "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA" }],
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("village.gltf");
    std::fs::write(&path, file.to_string()).unwrap();
    let scene = skylit::scene::load::load(path.to_str().unwrap()).unwrap();
    let object = |i: &skylit::scene::Instance| ObjectSummary {
        name: i.name.clone(),
        mesh: (i.mesh, "mesh".into()),
        bounds: Some((i.object_to_world.translation, i.object_to_world.translation + glam::DVec3::ONE)),
        ..Default::default()
    };
    SceneSummary {
        load: 1,
        is_complete: true,
        source: "village.gltf".into(),
        bounds: scene.bounds().unwrap(),
        cameras: scene.cameras.clone(),
        lights: vec!["point".into()],
        materials: Arc::new(scene.materials.clone()),
        objects: Arc::new(scene.instances.iter().map(object).collect()),
        counts: [scene.instances.len(), scene.meshes.len(), scene.materials.len(), scene.lights.len()],
        nodes: Arc::new(scene.nodes),
        ..Default::default()
    }
}

/// Nodes of a file are a tree: it is folded, searched and scrolled, and all below a node is hidden, isolated and framed.
#[test]
fn nodes_are_folded_selected_hidden_and_searched() {
    let mut alone = alone_with(Some("village.gltf"), RenderSettings::default());
    let scene = village();
    let camera = skylit::scene::Camera::look_at(glam::DVec3::splat(9.0), glam::DVec3::ZERO, glam::DVec3::Y, 0.8);
    alone.events.send(Event::Loaded(Box::new(scene)));
    alone.events.send(Event::Camera(Box::new(camera), None));
    alone.harness.run_steps(3);
    let file = |alone: &Alone| alone.mailbox.peek().meaning;
    let has = |alone: &Alone, label: &str| alone.harness.query_by_label(label).is_some();

    // one node above all is unfolded, what is below it is not
    assert!(has(&alone, "Fold village (16)") && has(&alone, "house (13)") && !has(&alone, "roof"));
    alone.click("Unfold car (3)");
    alone.click("Unfold wheels (2)");
    assert!(has(&alone, "left wheel") && has(&alone, "body") && has(&alone, "💡 point"));
    alone.click("Fold wheels (2)");
    assert!(!has(&alone, "left wheel") && has(&alone, "body"));

    // all below a node, and all but one of it
    alone.click("car (3)");
    assert_eq!(alone.mailbox.peek().selected, Some(13..16));
    assert!(has(&alone, "Select one object to change its material."));
    alone.click("Hide");
    assert_eq!(file(&alone).hide, ["car"]);
    alone.click("Show body");
    assert_eq!(file(&alone).hide, ["wheels"]);
    alone.click("Show car (3)");
    assert!(file(&alone).hide.is_empty(), "a part that is hidden comes back first");
    alone.click("Show car (3)");
    assert_eq!(file(&alone).hide, ["car"]);
    alone.click("Isolate");
    assert_eq!((file(&alone).only, file(&alone).hide), (vec!["car".to_owned()], Vec::new()));
    alone.click("Show house (13)");
    assert_eq!(file(&alone).only, ["car", "house"]);
    alone.click("Show all");
    alone.harness.key_press(egui::Key::H);
    alone.harness.run_steps(3);
    assert_eq!(file(&alone).hide, ["car"]);
    alone.click("Show all");
    alone.click("Frame");
    let pivot = alone.harness.state().control.as_ref().unwrap().pivot();
    assert!((pivot - glam::DVec3::new(3.0, 0.5, 0.5)).length() < 1e-9, "{pivot}");

    // a camera is looked through
    alone.click("📷 driver");
    assert_eq!(alone.mailbox.peek().followed_camera, Some(0));

    // what is clicked on in the image is unfolded, and scrolled to
    let pick = Pick { instance: (12, "window 12".into()), ..a_pick() };
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(Some(pick))));
    alone.harness.run_steps(4);
    assert!(has(&alone, "window 12") && !has(&alone, "roof"), "what is above it is out of view");

    // a search keeps what is above its hits
    let (role, label) = (egui::accesskit::Role::TextInput, "Search");
    alone.harness.get_by_role_and_label(role, label).focus();
    alone.harness.run_steps(2);
    alone.harness.get_by_role_and_label(role, label).type_text("right");
    alone.harness.run_steps(4);
    assert!(has(&alone, "right wheel") && has(&alone, "wheels (2)") && has(&alone, "village (16)"));
    assert!(!has(&alone, "left wheel") && !has(&alone, "window 12") && !has(&alone, "house (13)"));
}

/// The outline of what is selected is shown as long as it is of the view on the screen.
#[test]
fn outlines_are_of_what_is_shown() {
    let mut alone = loaded();
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(Some(a_pick()))));
    alone.harness.run_steps(2);
    let request = alone.mailbox.peek();
    assert_eq!(request.selected, Some(0..1));
    let camera = request.camera.unwrap();
    let progress = |camera: &skylit::scene::Camera| Progress { camera: Some(camera.clone()), ..Default::default() };
    alone.events.send(Event::Picture(Box::new(progress(&camera))));
    let lines = vec![vec![[0.1, 0.1], [0.2, 0.1]]];
    let outline = Outline { objects: 0..1, camera: camera.clone(), time: 0.0, size: request.size, lines };
    alone.events.send(Event::Outline(Arc::new(outline)));
    alone.harness.run_steps(2);
    assert!(alone.harness.state().outline().is_some());
    let mut moved = camera.clone();
    moved.camera_to_world.translation.x += 1.0;
    alone.events.send(Event::Picture(Box::new(progress(&moved))));
    alone.harness.run_steps(2);
    assert!(alone.harness.state().outline().is_none(), "of another camera");
    alone.events.send(Event::Picture(Box::new(progress(&camera))));
    alone.harness.run_steps(2);
    alone.change(|app| app.select(Some(Selection::Object(1))));
    assert!(alone.harness.state().outline().is_none(), "of another object");
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(None)));
    alone.harness.run_steps(2);
    assert_eq!(alone.mailbox.peek().selected, None, "a click into the background");
}

/// Values of the material that is selected are changed, reset, and part of the command and of an export.
#[test]
fn materials_are_edited_reset_and_exported() {
    let mut alone = loaded();
    assert!(alone.harness.query_by_label("Roughness").is_none());
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(Some(a_pick()))));
    alone.harness.run_steps(3);
    let edits = |alone: &Alone| alone.mailbox.peek().meaning.material;
    let original = alone.harness.state().scene.as_ref().unwrap().materials[0].clone();

    // a slider, dragged
    use egui::accesskit::{Action, ActionData, Role};
    let set = |alone: &mut Alone, label: &str, value: f64| {
        let target = alone.harness.get_by_role_and_label(Role::Slider, label).accesskit_node().id();
        let data = Some(ActionData::NumericValue(value));
        let request = egui::accesskit::ActionRequest { action: Action::SetValue, target, data };
        alone.harness.event(egui::Event::AccessKitActionRequest(request));
        alone.harness.run_steps(3);
    };
    set(&mut alone, "Roughness", 0.25);
    set(&mut alone, "Emission", 2.0);
    let [edit] = &edits(&alone)[..] else { panic!("{:?}", edits(&alone)) };
    assert_eq!((edit.roughness, edit.metallic, edit.emission), (Some(0.25), None, Some(glam::Vec3::splat(2.0))));
    let request = alone.mailbox.peek();
    assert!(request.panes[0].scene.material.is_empty(), "the image goes on");
    let command = alone.harness.state().command().unwrap();
    assert!(command.contains("--material") && command.contains("roughness=0.25 emission=2,2,2"), "{command}");

    // the file's value is no edit
    set(&mut alone, "Roughness", f64::from(original.roughness));
    assert_eq!(edits(&alone)[0].roughness, None);
    alone.click("Reset material");
    assert!(edits(&alone).is_empty());

    // written by the program, as the file would have it
    set(&mut alone, "Metallic", 1.0);
    alone.click("Export…");
    let Some(Dialog::Export(name)) = &alone.harness.state().dialog else { panic!() };
    assert_eq!(name, "stairs-edited.glb");
}

/// Hints are shown at the first time, and each goes once it has been followed; environments that were used are offered again.
#[test]
fn hints_go_and_environments_are_remembered() {
    use skylit::viewer::remembered::{Hint, Remembered};

    let mut alone = loaded();
    assert!(!alone.shows("all keys"), "nothing is remembered here");
    alone.change(|app| app.remembered = Some(Remembered::default()));
    assert!(alone.shows("orbit") && alone.shows("all keys"));
    let remembered = |alone: &Alone| alone.harness.state().remembered.clone().unwrap();

    // one that has been followed
    alone.press(egui::Key::Num4);
    assert!(!remembered(&alone).needs(Hint::Technique) && remembered(&alone).needs(Hint::Orbit));
    assert!(!alone.shows("path tracing") && alone.shows("come closer to what is under the pointer"));
    alone.click("Got it");
    assert!(!alone.shows("all keys") && Hint::ALL.iter().all(|hint| !remembered(&alone).needs(*hint)));

    // an environment, which is a file, and one that is refused
    let first = alone.change(|app| app.open_file("sky.hdr")).lighting;
    alone.harness.get_by_label("Light").click();
    alone.harness.run_steps(10);
    let choose = |alone: &mut Alone, item: &str| {
        alone.harness.get_by_role_and_label(egui::accesskit::Role::ComboBox, "Environment").click();
        alone.harness.run_steps(5);
        alone.harness.get_all_by_label(item).last().unwrap().click();
        alone.harness.run_steps(5);
    };
    choose(&mut alone, "Studio");
    assert_eq!(alone.mailbox.peek().lighting.environment.as_deref(), Some("studio"));
    choose(&mut alone, "sky.hdr");
    assert_eq!(alone.mailbox.peek().lighting.environment, first.environment);
    let bad = alone.change(|app| app.open_file("broken.exr")).lighting;
    assert_eq!(remembered(&alone).environments, ["broken.exr", "sky.hdr"]);
    alone.events.send(Event::LightingRefused(Box::new([bad, first]), "broken.exr: not an image".into()));
    alone.harness.run_steps(2);
    assert_eq!(remembered(&alone).environments, ["sky.hdr"]);
}

/// While the camera flies the renderer is asked how near something is, one question at a time.
#[test]
fn flights_ask_how_near_something_is() {
    let mut alone = loaded();
    let question = Task::Pick { at: [0.5; 2], purpose: PickPurpose::Nearness };
    alone.harness.key_down(egui::Key::W);
    alone.harness.run_steps(5);
    assert_eq!(alone.mailbox.latest().0.tasks, std::slice::from_ref(&question), "one, whatever time it takes");
    alone.mailbox.done(&question);
    let pick = Pick { distance: 0.25, ..a_pick() };
    alone.events.send(Event::Picked(PickPurpose::Nearness, Box::new(Some(pick))));
    alone.harness.run_steps(3);
    alone.harness.key_up(egui::Key::W);
    alone.harness.run_steps(2);
    assert_eq!(alone.harness.state().control.as_ref().unwrap().near, Some(0.25));
    assert_eq!((alone.harness.state().selected, alone.mailbox.latest().0.tasks.len()), (None, 1));
}

/// Light is shown by AgX unless another tone map is chosen, and so is what is rendered of it; occlusion stays linear.
#[test]
fn light_is_shown_by_agx() {
    use skylit::interface::ToneMap;

    let mut alone = loaded();
    let tone_map = |alone: &Alone| alone.mailbox.peek().panes[0].picture.tone_map;
    assert_eq!(tone_map(&alone), None);
    alone.press(egui::Key::Num4);
    assert_eq!(tone_map(&alone), Some(ToneMap::Agx));
    assert!(alone.harness.state().command().unwrap().contains("--tone-map agx"));
    alone.change(|app| app.settings.picture.tone_map = Some(ToneMap::Linear));
    assert_eq!(tone_map(&alone), Some(ToneMap::Linear));
    alone.change(|app| app.first = Technique::Still("ao-sky".parse().unwrap()));
    alone.change(|app| app.settings.picture.tone_map = None);
    assert_eq!(tone_map(&alone), None);
}

/// A camera that is kept has a small picture of what it sees.
#[test]
fn kept_cameras_have_pictures() {
    let mut alone = loaded();
    alone.press(egui::Key::B);
    let rgba = (0..300 * 200).flat_map(|k| if k % 300 < 150 { [255, 0, 0, 255] } else { [0, 0, 255, 255] }).collect();
    let picture = Arc::new(ViewPicture { size: [300, 200], rgba });
    alone.events.send(Event::Picture(Box::new(Progress { picture, ..Default::default() })));
    alone.harness.run_steps(2);
    alone.press(egui::Key::B);
    let bookmarks = &alone.harness.state().bookmarks;
    assert!(bookmarks[0].2.is_none(), "there was none yet");
    assert_eq!(bookmarks[1].2.as_ref().unwrap().size(), [75, 50]);
    let before = alone.mailbox.peek().camera;
    alone.change(|app| app.control.as_mut().unwrap().orbit(50.0, 0.0));
    alone.harness.get_all_by_label("Camera").next().unwrap().click();
    alone.harness.run_steps(3);
    alone.click("Kept camera 2");
    assert_eq!(alone.mailbox.peek().camera, before);
}
