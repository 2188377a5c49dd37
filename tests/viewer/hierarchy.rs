//! The hierarchy over the image: its controls, what they say, and what is drawn.

use std::sync::Arc;

use egui::accesskit::{Action, ActionData, Role};
use egui_kittest::kittest::{NodeT, Queryable};
use skylit::interface::DisplayMode;
use skylit::renderer::interactive::ViewStep;
use skylit::scene::{Scene, builtin};
use skylit::tracer::DeviceSettings;
use skylit::viewer::headless;
use skylit::viewer::hierarchy::{FoundHierarchy, HierarchyKey, SceneHierarchy, ShownBoxes, areas};
use skylit::viewer::request::{DeviceSummary, Event, Progress};
use skylit::viewer::technique::Technique;

use super::panels::{Alone, loaded};

/// The stairs with a sun.
fn scene() -> Scene {
    let mut scene = builtin::by_name("stairs").unwrap();
    skylit::scene::light_spec::parse("sun direction=-1,-2,-1 irradiance=3").unwrap().add(&mut scene);
    scene
}

/// Answers what is requested as the renderer does.
fn answer(alone: &mut Alone, tree: Result<Arc<SceneHierarchy>, String>) {
    let key = HierarchyKey::of_request(&alone.mailbox.peek());
    let areas = areas(&scene(), 1.5);
    alone.events.send(Event::Hierarchy(Box::new(FoundHierarchy { key, tree, areas })));
    alone.harness.run_steps(3);
}

/// Shows a picture of the camera that is requested.
fn show_picture(alone: &mut Alone, step: ViewStep) {
    let camera = alone.mailbox.peek().camera;
    alone.events.send(Event::Picture(Box::new(Progress { camera, step, ..Default::default() })));
    alone.harness.run_steps(2);
}

fn set(alone: &mut Alone, label: &str, value: f64) {
    let target = alone.harness.get_by_role_and_label(Role::Slider, label).accesskit_node().id();
    let data = Some(ActionData::NumericValue(value));
    let request = egui::accesskit::ActionRequest { action: Action::SetValue, target, data };
    alone.harness.event(egui::Event::AccessKitActionRequest(request));
    alone.harness.run_steps(3);
}

/// Number of lines that the last frame draws over the image, what is beside the panel: each has a shadow.
fn lines(alone: &Alone) -> usize {
    let shapes = &alone.harness.output().shapes;
    let is_of_image = |s: &&egui::epaint::ClippedShape| s.clip_rect.left() < 100.0;
    shapes.iter().filter(is_of_image).filter(|s| matches!(s.shape, egui::Shape::LineSegment { .. })).count()
}

/// Nothing is requested until something is chosen; each level has its boxes, of which no more are drawn than was chosen.
#[test]
fn boxes_of_a_level_are_chosen_and_counted() {
    let mut alone = loaded();
    show_picture(&mut alone, ViewStep::default());
    alone.click("Research");
    assert!(!alone.mailbox.peek().hierarchy && alone.harness.query_by_label("Level").is_none());
    let before = lines(&alone);
    alone.click("Boxes");
    alone.click("of a level");
    assert!(alone.mailbox.peek().hierarchy);
    assert!(alone.shows("The hierarchy is being built") && lines(&alone) == before);

    let tree = Arc::new(SceneHierarchy::build(&scene(), &DeviceSettings::default()).unwrap());
    answer(&mut alone, Ok(tree.clone()));
    assert!(!alone.shows("is being built"));
    for level in [0, 1, 3, tree.levels.len() - 1] {
        set(&mut alone, "Level", level as f64);
        let row = &tree.levels[level];
        let text =
            format!("Level {level} of {}: {} boxes, {} of them leaves.", tree.levels.len() - 1, row.count, row.leaves);
        assert!(alone.shows(&text), "{text}");
        // what is out of view is not drawn
        let drawn = lines(&alone) - before;
        assert!(drawn <= 2 * 12 * row.count && (level != 3 || drawn >= 2 * 12), "{level}: {drawn}");
    }
    // no more than wanted
    let crowded = (0..tree.levels.len()).find(|k| tree.levels[*k].count > 20).unwrap();
    set(&mut alone, "Level", crowded as f64);
    set(&mut alone, "Most boxes", 10.0);
    assert!(alone.shows("The 10 largest are drawn.") && lines(&alone) <= before + 2 * 120, "{}", lines(&alone));

    // a tree of another build is out of date until the renderer answers
    alone.change(|app| app.device_settings.build = Some(skylit::tracer::BuildMethod::Best));
    alone.harness.run_steps(2);
    assert!(alone.shows("The hierarchy is being built") && lines(&alone) == before);
    answer(&mut alone, Err("The hierarchy is not shown: the scene has no surfaces.".into()));
    assert!(alone.shows("the scene has no surfaces") && lines(&alone) == before);

    alone.change(|app| app.hierarchy.boxes = ShownBoxes::None);
    assert!(!alone.mailbox.peek().hierarchy);
}

/// A click chooses the ray; what it visits is counted as the laboratory counts it.
#[test]
fn boxes_that_a_ray_visits() {
    let mut alone = loaded();
    alone.click("Research");
    alone.click("Boxes");
    alone.click("that a ray visits");
    let tree = Arc::new(SceneHierarchy::build(&scene(), &DeviceSettings::default()).unwrap());
    answer(&mut alone, Ok(tree.clone()));
    show_picture(&mut alone, ViewStep::default());
    assert!(alone.shows("Click on the image"));
    let before = lines(&alone);
    let at = egui::pos2(320.0, 380.0);
    for pressed in [true, false] {
        alone.harness.event(egui::Event::PointerMoved(at));
        let (button, modifiers) = (egui::PointerButton::Primary, egui::Modifiers::NONE);
        alone.harness.event(egui::Event::PointerButton { pos: at, button, pressed, modifiers });
        alone.harness.run_steps(2);
    }
    let ray = alone.harness.state().hierarchy.ray.unwrap();
    let visits = tree.visits(ray);
    assert!(visits.boxes.len() > 3 && visits.distance.is_some(), "{visits:?}");
    let text = format!("The ray visits {} boxes, tests {} boxes", visits.boxes.len(), visits.counts.boxes);
    assert!(alone.shows(&text), "{text}");
    assert!(alone.shows(&format!("It ends at a distance of {:.4}.", visits.distance.unwrap())));
    assert!(lines(&alone) > before && lines(&alone) <= before + 2 * 12 * visits.boxes.len() + 2);

    // the ray is one of world space: it stays while the camera moves
    alone.change(|app| app.control.as_mut().unwrap().orbit(120.0, 10.0));
    show_picture(&mut alone, ViewStep::default());
    assert_eq!(alone.harness.state().hierarchy.ray, Some(ray));
    assert!(alone.shows(&text) && lines(&alone) > before);
    // and of this scene
    alone.harness.state_mut().open("builtin:plane");
    alone.harness.run_steps(2);
    let (load, source) = (alone.mailbox.peek().load, "builtin:plane".to_owned());
    let summary = skylit::viewer::request::SceneSummary { load, is_complete: true, source, ..Default::default() };
    alone.events.send(Event::Loaded(Box::new(summary)));
    alone.harness.run_steps(2);
    assert_eq!(alone.harness.state().hierarchy.ray, None);
}

#[test]
fn influence_areas_are_named_and_drawn() {
    let mut alone = loaded();
    alone.click("Research");
    alone.harness.get_by_label("Influence areas").scroll_to_me();
    alone.harness.run_steps(10);
    alone.click("Influence areas");
    assert!(alone.mailbox.peek().hierarchy);
    let why = "The hierarchy is not shown while an animation is chosen";
    answer(&mut alone, Err(why.into()));
    // from farther away than the areas reach
    alone.change(|app| app.control.as_mut().unwrap().zoom(6.0));
    show_picture(&mut alone, ViewStep::default());
    assert!(alone.shows("light `--light`") && alone.shows("camera `main`"), "one of the sun, one of the camera");
    assert!(alone.shows(why) && lines(&alone) >= 2 * 12);
    alone
        .events
        .send(Event::Device(DeviceSummary { tracer: ("query".into(), "requested".into()), ..Default::default() }));
    alone.harness.run_steps(2);
    assert!(alone.shows("The tracer query has a hierarchy of its own"));
    alone.click("Influence areas");
    assert!(!alone.mailbox.peek().hierarchy && !alone.shows("light `--light`"));
}

/// The legend is there while the view of visited nodes is, first or second, and has its figures.
#[test]
fn the_view_of_visited_nodes_has_a_legend() {
    let mut alone = loaded();
    let legend = "Nodes that the camera ray visits";
    assert!(!alone.shows(legend));
    let nodes = Technique::Buffer(DisplayMode::Nodes);
    alone.change(|app| app.first = nodes);
    show_picture(&mut alone, ViewStep { nodes: Some((12.34, 56)), ..Default::default() });
    assert!(alone.shows(legend) && alone.shows("Colours of 0 to 128 nodes") && alone.shows("Mean 12.3, most 56"));
    alone.change(|app| app.first = Technique::Converged);
    assert!(!alone.shows(legend));
    alone.change(|app| app.second = skylit::viewer::app::Second::Technique(nodes));
    assert!(!alone.shows(legend), "it is not on the screen");
    alone.change(|app| app.shows_second = true);
    assert!(alone.shows(legend) && !alone.shows("Mean"), "no picture of it yet");
}

/// The whole: boxes, the ray of a pixel and areas are painted. Of two clicks one may take too long to count on a machine under load.
#[test]
fn gpu_the_hierarchy_is_drawn_over_the_image() {
    let folder = tempfile::tempdir().unwrap();
    let run = |text: &str| {
        let script = folder.path().join("script.txt");
        std::fs::write(&script, text.replace("FOLDER", &folder.path().to_string_lossy())).unwrap();
        headless::run(&super::script::options(Some("builtin:cornell-box")), &script).unwrap();
    };
    run("wait picture 500
wait settled 500
click Research
wait 0.5
screenshot FOLDER/plain.png
click Boxes
click of a level
set Level = 2
wait text:Level 2 of
wait 0.3
screenshot FOLDER/level.png
click Boxes
click that a ray visits
wait text:Click on the image
press 200 250
wait 1.5
press 200 250
wait text:The ray visits
wait 0.3
screenshot FOLDER/ray.png
click Influence areas
wait text:camera
wait 0.3
screenshot FOLDER/areas.png
expect-no-errors");
    // pixels of the image, not of the panel, that differ from the image without lines
    let open = |name: &str| image::open(folder.path().join(name)).unwrap().into_rgb8();
    let plain = open("plain.png");
    let differing = |name: &str| {
        let other = open(name);
        let is_of_image = |x: u32, y: u32| (10..420).contains(&x) && (60..460).contains(&y);
        plain.enumerate_pixels().filter(|(x, y, p)| is_of_image(*x, *y) && other.get_pixel(*x, *y) != *p).count()
    };
    let counts = ["level.png", "ray.png", "areas.png"].map(differing);
    assert!(counts.iter().all(|n| (150..60_000).contains(n)), "{counts:?}");
}

/// Poses of an animation refit the trees: a line says so in place of boxes that would be wrong.
#[test]
fn gpu_an_animation_has_no_boxes() {
    let folder = tempfile::tempdir().unwrap();
    let script = folder.path().join("script.txt");
    let text = "wait picture 500
click Research
click Boxes
click of a level
wait text:while an animation is chosen
expect-no-errors";
    std::fs::write(&script, text).unwrap();
    let mut options = super::script::options(Some("builtin:parade"));
    options.settings.frames.animate = Some("0".into());
    headless::run(&options, &script).unwrap();
}
