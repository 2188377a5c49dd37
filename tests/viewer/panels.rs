//! The panels, used through their accessibility tree.

use std::sync::Arc;

use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use skylit::renderer::RenderSettings;
use skylit::renderer::interactive::{Pick, ViewPicture};
use skylit::viewer::ViewOptions;
use skylit::viewer::app::{App, Arrangement, Second};
use skylit::viewer::request::{
    Comparison, DeviceSummary, Event, EventSender, Mailbox, PickPurpose, Progress, SceneSummary, TRUTH, Task,
};

/// The viewer without a renderer: what it requests goes to a mailbox, what it is told comes from the sender.
struct Alone {
    harness: Harness<'static, App>,
    mailbox: Arc<Mailbox>,
    events: EventSender,
}

fn alone(scene: Option<&str>) -> Alone {
    let mailbox = Arc::new(Mailbox::default());
    let (sender, events) = std::sync::mpsc::channel();
    let options = ViewOptions {
        scene: scene.map(str::to_owned),
        settings: RenderSettings::default(),
        device: Default::default(),
        size: [1000, 700],
        frame_rate: Some(10.0),
        painter: Default::default(),
        device_name: None,
    };
    let app = App::new(&options, mailbox.clone(), events);
    let harness =
        Harness::builder().with_size(egui::vec2(1000.0, 700.0)).build_state(|context, app: &mut App| app.frame(context), app);
    Alone { harness, mailbox, events: EventSender::new(sender, Arc::new(|| {})) }
}

fn loaded() -> Alone {
    let mut alone = alone(Some("builtin:stairs"));
    let scene = skylit::scene::builtin::by_name("stairs").unwrap();
    alone.events.send(Event::Loaded(Box::new(SceneSummary {
        load: 1,
        is_complete: true,
        source: "builtin:stairs".into(),
        bounds: scene.bounds().unwrap(),
        cameras: scene.cameras.clone(),
        ..Default::default()
    })));
    alone.events.send(Event::Camera(Box::new(scene.cameras[0].clone()), None));
    alone.harness.run_steps(3);
    alone
}

impl Alone {
    fn click(&mut self, label: &str) {
        self.harness.get_by_label(label).click();
        self.harness.run_steps(3);
    }

    fn press(&mut self, key: egui::Key) {
        self.harness.key_press(key);
        self.harness.run_steps(3);
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
    let pick = Pick {
        position: glam::DVec3::ONE,
        distance: 1.0,
        instance: (0, long.clone()),
        mesh: (0, long.clone()),
        primitive: (0, 1),
        material: (0, long.clone()),
        textures: Vec::new(),
    };
    alone.events.send(Event::Picked(PickPurpose::Describe, Box::new(Some(pick))));
    alone.events.send(Event::Warning(long.clone()));
    alone.events.send(Event::Device(DeviceSummary { name: long.clone(), ..Default::default() }));
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
    for section in ["Comparison with the truth", "Real-time frames", "Paths", "Picture", "Light", "Camera", "Device"] {
        // "Camera" is a menu, too
        alone.harness.get_all_by_label(section).last().unwrap().click();
        alone.harness.run_steps(3);
    }
    use egui::accesskit::Role;
    let names = |role: Role| {
        alone.harness.query_all_by_role(role).map(|n| (n.accesskit_node().label().unwrap_or_default(), format!("{n:?}")))
    };
    for role in
        [Role::Button, Role::CheckBox, Role::Slider, Role::SpinButton, Role::ComboBox, Role::TextInput, Role::RadioButton]
    {
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

    alone.click("Split");
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
    alone.events.send(Event::Compared(Box::new(Comparison { heat_map, ..Default::default() })));
    alone.harness.run_steps(2);
    save(&mut alone, "heat.png");
    let image = skylit::output::load(&path).unwrap();
    assert_eq!((image.width, image.height), (2, 1));
    assert!(alone.mailbox.latest().0.tasks.is_empty());
}
