//! The dialog *Bake*: its controls, the program that it starts, and the model that is shown when it has ended.

use std::path::Path;

use egui::accesskit::{Action, ActionData, ActionRequest, Role};
use egui_kittest::kittest::{NodeT, Queryable};
use skylit::bake::{Map, Target};
use skylit::settings::Length;
use skylit::viewer::app::{Arrangement, Second};
use skylit::viewer::baking::{BakePlace, BakeWanted, BakedMap};
use skylit::viewer::dialog::Dialog;
use skylit::viewer::request::{Event, SceneSummary};
use skylit::viewer::technique::Technique;

use crate::common::command;
#[cfg(unix)]
use crate::panels::write_program;
use crate::panels::{Alone, loaded};

/// The output and the numbers of the open dialog.
fn asked(alone: &Alone) -> (String, BakeWanted) {
    match &alone.harness.state().dialog {
        Some(Dialog::Bake(text, wanted)) => (text.clone(), wanted.clone()),
        other => panic!("{other:?}"),
    }
}

/// The viewer with the dialog, opened by the menu.
fn opened() -> Alone {
    let mut alone = loaded();
    alone.change(|app| app.settings.integrators.ao.ao_radius = Some(Length::Units(0.75)));
    alone.click("File");
    alone.click("Bake…");
    alone
}

fn choose(alone: &mut Alone, list: &str, item: &str) {
    alone.harness.get_by_role_and_label(Role::ComboBox, list).click();
    alone.harness.run_steps(5);
    alone.click(item);
}

fn set(alone: &mut Alone, label: &str, value: f64) {
    // the panel at the side has numbers of the same name, which come first
    let target = alone.harness.query_all_by_role_and_label(Role::SpinButton, label).last().unwrap();
    let target = target.accesskit_node().id();
    let request = ActionRequest { action: Action::SetValue, target, data: Some(ActionData::NumericValue(value)) };
    alone.harness.event(egui::Event::AccessKitActionRequest(request));
    alone.harness.run_steps(3);
}

fn has(alone: &Alone, role: Role, label: &str) -> bool {
    alone.harness.query_all_by_role_and_label(role, label).count() > 0
}

#[test]
fn places_and_maps_have_the_controls_that_apply_to_them() {
    let mut alone = opened();
    let (text, wanted) = asked(&alone);
    assert_eq!((text.as_str(), wanted.place, wanted.radius), ("stairs-ao.glb", BakePlace::Texture, 0.75));
    assert!(wanted.is_shown && !wanted.is_denoised && !wanted.has_ground);

    // a texture: size, samples, filter, ground
    choose(&mut alone, "Texture size", "2048 x 2048");
    assert_eq!(asked(&alone).1.size, 2048);
    set(&mut alone, "Texels", 300.0);
    set(&mut alone, "Samples per texel", 2000.0);
    for label in ["Denoise", "Ground", "Show the model when it is baked"] {
        alone.click(label);
    }
    let (_, wanted) = asked(&alone);
    assert_eq!((wanted.size, wanted.spp, wanted.is_denoised, wanted.has_ground), (300, 2000, true, true));
    assert!(!wanted.is_shown);
    let flags = wanted.flags().join(" ");
    assert_eq!(flags, "--map ao --to texture --size 300 --spp 2000 --denoise --ground");

    // vertices: no texture, and no more samples than the program takes
    alone.click("vertices of the model");
    let (text, wanted) = asked(&alone);
    assert_eq!(text, "stairs-ao-vertices.glb");
    assert_eq!(wanted.flags().join(" "), "--map ao --to vertices --spp 1024 --ground");
    for (role, label) in [(Role::ComboBox, "Texture size"), (Role::SpinButton, "Texels"), (Role::CheckBox, "Denoise")] {
        assert!(!has(&alone, role, label), "{label}");
    }
    assert!(has(&alone, Role::SpinButton, "Samples per corner"));

    // an image: any map, each with its own reach
    alone.click("an image");
    assert!(!has(&alone, Role::CheckBox, "Show the model when it is baked"));
    choose(&mut alone, "Map", "thickness");
    assert_eq!(asked(&alone).0, "stairs-thickness.png");
    assert_eq!(asked(&alone).1.length(), Some(Length::OfDiagonal(0.1)));
    set(&mut alone, "Length of rays", 25.0);
    assert_eq!(asked(&alone).1.length(), Some(Length::OfDiagonal(0.25)));
    choose(&mut alone, "Map", "curvature");
    assert_eq!(asked(&alone).1.length(), Some(Length::OfDiagonal(0.01)), "not that of another map");
    choose(&mut alone, "Map", "normal");
    assert!(!has(&alone, Role::SpinButton, "Samples per texel") && !has(&alone, Role::CheckBox, "Ground"));
    assert_eq!(asked(&alone).1.flags().join(" "), "--map normal --to texture --size 300");

    // the radius: of the view at first, none, or another
    choose(&mut alone, "Map", "bent normal");
    assert_eq!(asked(&alone).1.length(), Some(Length::Units(0.75)));
    let clicked = alone.harness.query_all_by_role_and_label(Role::CheckBox, "Radius").last().unwrap();
    clicked.click();
    alone.harness.run_steps(3);
    assert_eq!(asked(&alone).1.length(), Some(Length::Units(f64::INFINITY)));
    alone.harness.query_all_by_role_and_label(Role::CheckBox, "Radius").last().unwrap().click();
    alone.harness.run_steps(3);
    set(&mut alone, "Radius", 0.5);
    assert_eq!(asked(&alone).1.length(), Some(Length::Units(0.5)));
    assert_eq!(alone.harness.state().settings.integrators.ao.ao_radius, Some(Length::Units(0.75)), "of the view");

    // a name that was typed stays
    alone.change(|app| match &mut app.dialog {
        Some(dialog) => *dialog.text_mut() = "mine.png".into(),
        None => panic!("the dialog is closed"),
    });
    choose(&mut alone, "Map", "position");
    assert_eq!(asked(&alone).0, "mine.png");
}

/// The maps and places are those of `skylit bake`.
#[test]
fn the_names_are_those_of_the_program() {
    assert_eq!(BakedMap::ALL.map(BakedMap::name), Map::ALL.map(Map::name));
    assert_eq!(BakePlace::ALL.map(BakePlace::name)[..2], Target::ALL.map(Target::name));
    for (own, map) in BakedMap::ALL.into_iter().zip(Map::ALL) {
        assert_eq!((own.has_samples(), own.default_share()), (map.is_sampled(), map.default_radius()), "{own}");
    }
}

/// A program that is `script`, in place of skylit.
#[cfg(unix)]
fn program(folder: &Path, script: &str) -> std::path::PathBuf {
    let program = folder.join("program");
    write_program(&program, script);
    program
}

#[cfg(unix)]
fn wait(alone: &mut Alone, until: impl Fn(&Alone) -> bool) {
    let end = std::time::Instant::now() + std::time::Duration::from_secs(20);
    while !until(alone) {
        let said = || alone.harness.state().messages.iter().map(|m| m.1.clone()).collect::<Vec<_>>();
        assert!(std::time::Instant::now() < end, "{:?}", said());
        std::thread::sleep(std::time::Duration::from_millis(20));
        alone.harness.run_steps(1);
    }
}

/// The program takes what the dialog asks for, whatever is chosen: all that it refuses is where the file would be.
#[cfg(unix)]
#[test]
fn the_program_takes_what_the_dialog_asks_for() {
    let dir = tempfile::tempdir().unwrap();
    let told = dir.path().join("told");
    let program = program(dir.path(), &format!("printf '%s\\n' \"$@\" > {}", told.display()));
    let mut alone = loaded();
    alone.change(|app| {
        app.program = program;
        app.settings.integrators.ao.ao_falloff = Some(2.0);
        app.settings.integrators.path.max_depth = Some(3);
        app.lighting.environment = Some("sky".into());
    });
    let first = BakeWanted { is_denoised: true, has_ground: true, ..alone.harness.state().default_bake() };
    let models = [BakePlace::Texture, BakePlace::Vertices].map(|place| BakeWanted { place, ..first.clone() });
    let image = |image_map| BakeWanted { place: BakePlace::Image, image_map, ..first.clone() };
    let mut flags = Vec::new();
    for wanted in models.into_iter().chain(BakedMap::ALL.map(image)) {
        let output = dir.path().join("no-folder").join(wanted.file_name("a", "a.glb"));
        alone.change(|app| app.bake(&output.to_string_lossy(), &wanted));
        wait(&mut alone, |alone| alone.harness.state().renders.is_empty());
        let line = std::fs::read_to_string(&told).unwrap();
        let args: Vec<&str> = line.lines().collect();
        assert_eq!(args[..2], ["bake", "builtin:stairs"]);
        command::refuses(&args, 4, "no-folder");
        flags.push(args[4..].join(" "));
    }
    // light has the view's light, occlusion its radius and falloff
    assert!(flags[0].contains("--ao-radius inf") && flags[0].contains("--ao-falloff 2"), "{flags:?}");
    assert!(flags[8].contains("--environment sky") && flags[8].contains("--max-depth 3"), "{flags:?}");
    assert!(!flags[8].contains("--ao"), "{flags:?}");
}

/// It shows how far it is and can be cancelled; a model that was baked is opened beside traced occlusion, seen as before.
#[cfg(unix)]
#[test]
fn a_baked_model_is_shown_beside_traced_occlusion() {
    let dir = tempfile::tempdir().unwrap();
    let mut alone = opened();
    let output = dir.path().join("a.glb").to_string_lossy().into_owned();
    let (_, wanted) = asked(&alone);
    let wanted = BakeWanted { radius: 0.5, ..wanted };
    let ask = |alone: &mut Alone, wanted: &BakeWanted, script: &str| {
        let program = program(dir.path(), script);
        alone.change(|app| {
            app.program = program;
            app.dialog = Some(Dialog::Bake(output.clone(), wanted.clone()));
        });
        alone.harness.get_by_role_and_label(Role::Button, "Bake").click();
        alone.harness.run_steps(2);
        assert!(alone.harness.state().dialog.is_none());
    };

    // cancelled: nothing is opened
    ask(&mut alone, &wanted, "echo 'skylit: baking: 40 % after 2 s, about 3 s left' >&2; exec sleep 30");
    wait(&mut alone, |alone| alone.harness.state().renders.iter().any(|render| render.progress().is_some()));
    assert_eq!(alone.harness.state().renders[0].progress().unwrap().0, 0.4);
    alone.click("✖");
    wait(&mut alone, |alone| alone.harness.state().renders.is_empty());
    assert!(alone.shows("was cancelled"));
    assert_eq!(alone.mailbox.peek().load, 1);

    // failed: it says why
    ask(&mut alone, &wanted, "echo 'skylit: error: a.glb: the disk is full' >&2; exit 4");
    wait(&mut alone, |alone| alone.harness.state().renders.is_empty());
    assert!(alone.shows("the disk is full"));
    assert_eq!(alone.mailbox.peek().load, 1);

    // not wanted, or an image: a message alone
    for wanted in
        [BakeWanted { is_shown: false, ..wanted.clone() }, BakeWanted { place: BakePlace::Image, ..wanted.clone() }]
    {
        ask(&mut alone, &wanted, "exit 0");
        wait(&mut alone, |alone| alone.harness.state().renders.is_empty());
        assert!(alone.shows("baked "));
        assert_eq!(alone.mailbox.peek().load, 1);
    }

    // shown, from where the camera was
    let show = |alone: &mut Alone, wanted: &BakeWanted, load: u64| {
        ask(alone, wanted, "exit 0");
        wait(alone, |alone| alone.mailbox.peek().load == load);
        let summary = SceneSummary { load, is_complete: true, source: output.clone(), ..Default::default() };
        alone.events.send(Event::Loaded(Box::new(summary)));
        alone.harness.run_steps(3);
    };
    alone.change(|app| app.control.as_mut().unwrap().orbit(0.3, 0.1));
    let camera = alone.mailbox.peek().camera.unwrap();
    show(&mut alone, &wanted, 2);
    let request = alone.mailbox.peek();
    assert_eq!((request.scene.as_deref(), request.camera), (Some(output.as_str()), Some(camera)));
    assert_eq!(request.panes[0].integrator().name(), "baked-occlusion");
    let truth = request.panes.last().unwrap();
    assert_eq!(truth.integrators.ao.ao_radius, Some(Length::Units(0.5)), "the radius that was baked");
    let app = alone.harness.state();
    assert_eq!((app.truth(), app.second), (Technique::Converged, Second::Truth));
    assert_eq!((app.arrangement, app.title(false).as_str()), (Arrangement::Split(0.5), "baked occlusion"));

    // colours of vertices are base colours
    let vertices = BakeWanted { place: BakePlace::Vertices, ..wanted.clone() };
    alone.change(|app| app.source = Some("other.glb".into()));
    show_other(&mut alone, "other.glb", 2);
    show(&mut alone, &vertices, 3);
    assert_eq!(alone.mailbox.peek().panes[0].integrator().name(), "albedo");
    assert_eq!(alone.harness.state().second, Second::Technique(Technique::Converged));
    assert!(!alone.harness.state().compares_now());

    // another scene was opened meanwhile: it stays
    show_other(&mut alone, "other.glb", 3);
    ask(&mut alone, &wanted, "sleep 1");
    alone.change(|app| app.open("builtin:cornell-box"));
    wait(&mut alone, |alone| alone.harness.state().renders.is_empty());
    alone.harness.run_steps(3);
    assert_eq!(alone.mailbox.peek().scene.as_deref(), Some("builtin:cornell-box"));
}

/// Shows a scene of this name as if it had been the one of this load.
#[cfg(unix)]
fn show_other(alone: &mut Alone, source: &str, load: u64) {
    let summary = SceneSummary { load, is_complete: true, source: source.into(), ..Default::default() };
    alone.events.send(Event::Loaded(Box::new(summary)));
    alone.change(|app| app.source = Some(source.into()));
    alone.harness.run_steps(2);
}

/// The files of the scene are not written over.
#[test]
fn the_scene_is_not_written_over() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("model.glb");
    std::fs::write(&file, "").unwrap();
    let mut alone = loaded();
    alone.change(|app| app.scene.as_mut().unwrap().files = vec![file.clone()]);
    let wanted = alone.harness.state().default_bake();
    alone.change(|app| app.dialog = Some(Dialog::Bake(file.to_string_lossy().into_owned(), wanted)));
    alone.harness.get_by_role_and_label(Role::Button, "Bake").click();
    alone.harness.run_steps(2);
    assert!(alone.harness.state().renders.is_empty() && alone.shows("model.glb"));
}

/// The whole of it: the menu, the dialog, the program, and the model beside traced occlusion, which is close to it.
#[test]
fn gpu_a_scene_is_baked_and_compared() {
    if !command::device() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_string_lossy().into_owned();
    let script = format!(
        "wait picture 500\nclick Radius\nset Radius = 0.6\nclick File\nclick Bake…\nwait text:Bake this scene\nkey Ctrl+A\n\
         type {}\nset Texels = 256\nset Samples per texel = 16\nclick Denoise\nclick Bake\nwait text:baked occlusion\n\
         wait compared 500\nexpect AO converged\nkey Ctrl+S\nwait text:Save the image\nkey Ctrl+A\n\
         type {}\nkey Enter\nwait text:saved\nexpect-no-errors\n",
        at("stairs.glb"),
        at("baked.exr"),
    );
    std::fs::write(at("script"), script).unwrap();
    let args = ["view", "builtin:stairs", "--size", "760x520", "--headless-script", &at("script")];
    let out = command::run(&args);
    assert!(out.status.success(), "{}", command::stderr(&out));
    // what is on the left is occlusion, and not a model without it
    let baked = skylit::output::load(Path::new(&at("baked.exr"))).unwrap();
    let values = baked.f32("Y").or_else(|| baked.f32("R")).unwrap();
    let dark = values.iter().filter(|value| **value > 0.05 && **value < 0.7).count();
    assert!(20 * dark > values.len(), "{dark} of {} pixels", values.len());
}

/// The preview bakes few texels into a file of its own and shows a picture of it; the scene stays.
#[cfg(unix)]
#[test]
fn a_preview_is_shown_in_the_dialog() {
    let dir = tempfile::tempdir().unwrap();
    let (told, picture) = (dir.path().join("told"), dir.path().join("picture.png"));
    image::RgbaImage::from_pixel(420, 280, image::Rgba([200, 100, 50, 255])).save(&picture).unwrap();
    let script = |render: &str| {
        let told = told.display();
        format!("printf '%s ' \"$@\" >> {told}; printf '\\n' >> {told}; test $1 = bake || {render}")
    };
    let mut alone = opened();
    let shown = |alone: &Alone| has(alone, Role::Image, "Preview of the baked model");
    let copies = program(dir.path(), &script(&format!("cp {} $5", picture.display())));
    alone.change(|app| app.program = copies);
    choose(&mut alone, "Texture size", "2048 x 2048");
    assert!(!shown(&alone));
    alone.click("Preview");
    wait(&mut alone, shown);

    // few texels of the same bake, and then a picture of the model from the view
    let lines: Vec<String> = std::fs::read_to_string(&told).unwrap().lines().map(str::to_owned).collect();
    assert_eq!(lines.len(), 2, "{lines:?}");
    let (bake, render) = (&lines[0], &lines[1]);
    for part in ["bake builtin:stairs -o", "preview.glb", "--size 256", "--spp 8", "--denoise", "--ao-radius 0.75"] {
        assert!(bake.contains(part), "{bake}: {part}");
    }
    for part in ["render ", "preview.glb --no-config -o", "preview.png", "--integrator baked-occlusion", "--camera 0"] {
        assert!(render.contains(part), "{render}: {part}");
    }
    // as wide for its height as the view
    let size = render.split(" --size ").nth(1).unwrap().split(' ').next().unwrap();
    let [width, height] = [0, 1].map(|k| size.split('x').nth(k).unwrap().parse::<f64>().unwrap());
    let [w, h] = alone.harness.state().size().map(|n| f64::from(n.max(1)));
    assert!(width <= 420.0 && height <= 280.0 && (width == 420.0 || height == 280.0), "{size}");
    assert!((width / height - w / h).abs() < 0.02 * w / h, "{size}: {w}x{h}");

    // the title, the picture and the buttons are within a small window
    for [wide, high] in [[700.0, 480.0], [1200.0, 780.0]] {
        alone.harness.set_size(egui::vec2(wide, high));
        alone.harness.run_steps(4);
        let close = alone.harness.get_by_role_and_label(Role::Button, "Close window").rect();
        let bake = alone.harness.get_by_role_and_label(Role::Button, "Bake").rect();
        let image = alone.harness.get_by_role_and_label(Role::Image, "Preview of the baked model").rect();
        assert!(close.top() > 0.0 && bake.bottom() < high, "{wide}x{high}: {close:?} {bake:?}");
        assert!(image.height() > 59.0 && image.bottom() < bake.top(), "{wide}x{high}: {image:?} {bake:?}");
        assert!((image.width() / image.height() - 1.5).abs() < 0.02, "{image:?}");
    }
    let model = bake.split(' ').nth(3).unwrap().to_owned();
    assert!(render.contains(&model));
    command::refuses(&render.split_whitespace().collect::<Vec<_>>(), 3, "preview.glb");
    assert_eq!(alone.mailbox.peek().load, 1);
    assert!(asked(&alone).1.size == 2048 && !alone.shows("of other numbers"));
    set(&mut alone, "Samples per texel", 32.0);
    assert!(asked(&alone).1.spp == 32 && alone.shows("of other numbers"));

    // one that fails says why, and goes with the dialog
    let fails = program(dir.path(), "echo 'skylit: error: charts do not fit' >&2; exit 4");
    alone.change(|app| app.program = fails);
    alone.click("Preview");
    wait(&mut alone, |alone| alone.shows("charts do not fit"));
    assert!(!shown(&alone));
    alone.change(|app| app.dialog = None);
    let image = BakeWanted { place: BakePlace::Image, ..alone.harness.state().default_bake() };
    alone.change(|app| app.dialog = Some(Dialog::Bake("a.png".into(), image)));
    assert!(!has(&alone, Role::Button, "Preview"));
}
