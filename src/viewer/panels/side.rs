//! The panel at the side: the scene, what is shown of it, light, settings, camera, animation,
//! device.

use egui::{CollapsingHeader, ComboBox, Response, Ui};

use super::slider::Scale;
use super::{editor, hierarchy, menu, performance, scene, slider};
use crate::integrators::backdrop::Backdrop;
use crate::integrators::{Integrator, IntegratorName};
use crate::scene::environments::BuiltinEnvironment;
use crate::scene::load::{GeometryOptions, NormalSource, Projection, UpAxis};
use crate::scene::settings::variant_index;
use crate::scene::{Camera, Ground, Projection as CameraProjection};
use crate::settings::{Capability, Length, Level, Setting};
use crate::tracer::TracerChoice;
use crate::viewer::app::{App, Arrangement, Second};
use crate::viewer::dialog::{Dialog, RenderedMotion};
use crate::viewer::rounding::round_length;
use crate::viewer::technique::{GROUPS, Technique};

/// Shows all sections, in the order in which they are used.
pub fn show(app: &mut App, ui: &mut Ui) {
    section(ui, "Scene", true, |ui| {
        scene::objects(app, ui);
        ui.separator();
        scene::selection(app, ui);
        part(ui, "Scene file", |ui| scene_file(app, ui));
    });
    section(ui, "View", true, |ui| view(app, ui));
    section(ui, "Light", false, |ui| light(app, ui));
    section(ui, "Ambient occlusion", true, |ui| occlusion(app, ui));
    section(ui, "Quality", false, |ui| quality(app, ui));
    section(ui, "Camera", false, |ui| camera(app, ui));
    section(ui, "Animation", false, |ui| animation(app, ui));
    section(ui, "Device", false, |ui| {
        device(app, ui);
        part(ui, "Performance", |ui| performance::show(app, ui));
    });
    section(ui, "Messages", false, |ui| {
        for (_, text, is_error) in &app.messages {
            let text = egui::RichText::new(text);
            ui.label(if *is_error { text.color(ui.visuals().warn_fg_color) } else { text });
        }
    });
    section(ui, "Research", false, |ui| research(app, ui));
}

fn section(ui: &mut Ui, title: &str, is_open: bool, content: impl FnOnce(&mut Ui)) {
    let text = egui::RichText::new(title).strong();
    CollapsingHeader::new(text).id_salt(title).default_open(is_open).show(ui, content);
    ui.add_space(2.0);
}

/// A part of a section, which is closed at first.
fn part(ui: &mut Ui, title: &str, content: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(title).default_open(false).show(ui, content);
}

/// The meaning of the file, and which part of it is shown.
fn scene_file(app: &mut App, ui: &mut Ui) {
    let settings = app.settings.scene.editable().into_iter().filter(|s| s.name != "variant").collect();
    editor::edit(ui, settings, &serde_json::json!({ "mtl_dissolve": "alpha" }));
    variant(app, ui);
    scene_of_file(app, ui);
    geometry(app, ui);
}

/// A list of techniques. Returns the one that was chosen.
fn choose_technique(
    ui: &mut Ui,
    label: &str,
    shown: &str,
    current: Option<Technique>,
    holds: &dyn Fn(Technique) -> bool,
) -> Option<Technique> {
    let mut chosen = None;
    ui.horizontal(|ui| {
        let heading = ui.label(label);
        // all of it within the window, also with large text
        let height = (0.6 * ui.ctx().content_rect().height()).min(420.0);
        let combo =
            ComboBox::from_id_salt(label).selected_text(shown).width(ui.available_width().min(170.0)).height(height);
        let response = combo.show_ui(ui, |ui| {
            let all = Technique::all();
            for (k, title) in GROUPS.iter().enumerate() {
                let of_group: Vec<Technique> =
                    all.iter().filter(|(group, t)| *group == k && holds(*t)).map(|(_, t)| *t).collect();
                if !of_group.is_empty() {
                    ui.weak(*title);
                }
                for technique in of_group {
                    let item = ui.selectable_label(current == Some(technique), technique.label());
                    if item.on_hover_text(technique.help()).clicked() {
                        chosen = Some(technique);
                    }
                }
            }
        });
        response.response.labelled_by(heading.id);
    });
    chosen
}

/// The image that is shown, and what it is compared with.
fn view(app: &mut App, ui: &mut Ui) {
    let shown = app.first.label();
    if let Some(technique) = choose_technique(ui, "Show", &shown, Some(app.first), &|_| true) {
        app.first = technique;
    }
    let mut split = app.arrangement != Arrangement::Single;
    let help = "Another image beside it (X): the truth, unless another is chosen below";
    if ui.checkbox(&mut split, "Compare").on_hover_text(help).changed() {
        super::menu::toggle_split(app);
    }
    part(ui, "Comparison", |ui| {
        let shown = app.title(true);
        let current = if let Second::Technique(t) = app.second { Some(t) } else { None };
        if let Some(technique) = choose_technique(ui, "Second image", &shown, current, &|_| true) {
            app.second = Second::Technique(technique);
        }
        ui.horizontal(|ui| {
            ui.selectable_value(&mut app.second, Second::Truth, "Truth")
                .on_hover_text("The second image is the truth of the first");
            ui.selectable_value(&mut app.second, Second::HeatMap, "Heat map")
                .on_hover_text("The second image is FLIP of the first against the truth");
        });
        truth(app, ui);
    });
}

/// Returns true for settings that are for research and comparisons.
fn is_research(setting: &Setting) -> bool {
    setting.level == Level::Research
}

/// How much is rendered: of frames in real time, and of paths.
fn quality(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        let mut holds = app.frame_rate.is_some();
        let response = ui.checkbox(&mut holds, "Hold a frame rate").on_hover_text(
            "While something moves, the resolution of the image is reduced so that frames come at this rate. At rest it is full. The controls are always sharp",
        );
        if response.changed() {
            app.frame_rate = holds.then_some(app.default_frame_rate());
        }
        if let Some(rate) = &mut app.frame_rate {
            let drag = egui::DragValue::new(rate).range(1.0..=240.0).clamp_existing_to_range(false).speed(0.5).suffix(" frames/s");
            ui.add(drag).labelled_by(response.id);
        }
    });
    frames(app, ui, &|s| !is_research(s));
    if follows_light(app) {
        ui.separator();
        paths(app, ui, &|s| !is_research(s));
    }
}

/// Settings that are for research and comparisons, of all that is rendered.
fn research(app: &mut App, ui: &mut Ui) {
    ui.weak("For comparisons of methods. The pipelines of Larsen (2019) are in the list of View.");
    hierarchy::show(app, ui);
    ui.separator();
    frames(app, ui, &is_research);
    let ao = app.settings.integrators.ao.editable().into_iter().filter(is_research).collect();
    editor::edit(ui, ao, &serde_json::json!({ "ao_normal": "geometric" }));
    paths(app, ui, &is_research);
    tracer_options(app, ui, &is_research);
}

/// Whether the first image follows light from surface to surface.
fn follows_light(app: &App) -> bool {
    matches!(app.first, Technique::Still(i) | Technique::Frames(i) if !i.can(Capability::AmbientVisibility))
}

fn occlusion(app: &mut App, ui: &mut Ui) {
    let size = app.control.as_ref().map_or(1.0, |c| c.scene_size());
    let ao = &mut app.settings.integrators.ao;

    // radius: none, or a length
    ui.horizontal(|ui| {
        let mut is_limited = ao.radius().is_finite();
        let check = ui.checkbox(&mut is_limited, "Radius").on_hover_text(
            "AO radius in scene units: hits beyond do not occlude. Without it, rays go on to infinity\n--ao-radius",
        );
        if check.changed() {
            // a tenth of the scene: corners are dark, rooms are not
            ao.ao_radius = is_limited.then(|| Length::Units(round_length(0.1 * size)));
        }
        if let (true, Some(Length::Units(radius))) = (is_limited, &mut ao.ao_radius) {
            length(ui, &check, radius, size);
        }
    });
    ui.horizontal(|ui| {
        let mut falls_off = ao.ao_falloff.is_some();
        let check = ui
            .checkbox(&mut falls_off, "Falloff")
            .on_hover_text(format!(
                "Hits occlude by half at this distance, by a quarter at twice the distance; without it wholly at any distance, the cheapest\n--ao-falloff C: a hit at distance d occludes by C^-d{}",
                ao.ao_falloff.map_or(String::new(), |falloff| format!(", C = {}", in_short(falloff)))
            ));
        if check.changed() {
            // corners keep their darkness, what is at the radius has lost most of its own
            let half = if ao.radius().is_finite() { 0.5 * ao.radius() } else { 0.05 * size };
            ao.ao_falloff = falls_off.then(|| falloff_of(round_length(half)));
        }
        if let Some(falloff) = &mut ao.ao_falloff {
            let mut half = half_distance(*falloff).min(1e3 * size);
            if length(ui, &check, &mut half, size) {
                *falloff = falloff_of(half);
            }
        }
    });

    // options that have no control of their own; views have one occlusion ray a camera ray
    let has_control = |s: &Setting| ["ao_radius", "ao_falloff", "ao_rays"].contains(&s.name);
    let rest = ao.editable().into_iter().filter(|s| !has_control(s) && !is_research(s)).collect();
    editor::edit(ui, rest, &serde_json::Value::Null);
}

/// Shows a slider of a length in a scene of this size. A value beyond its ends stays as it is until
/// it is changed. Returns true if it was.
fn length(ui: &mut Ui, heading: &Response, value: &mut f64, size: f64) -> bool {
    let range = round_length(1e-3 * size)..=round_length(2.0 * size);
    slider::show(ui, heading, value, range, Scale::Logarithmic, " units")
}

/// The falloff C at which a hit at distance `half` occludes by half: C^-half is 1/2.
fn falloff_of(half: f64) -> f64 {
    // finite also where a scene is small
    let falloff = (1.0 / half.max(1e-300)).min(1000.0).exp2();
    // four digits are enough, and fewer to read in a command
    format!("{falloff:.3e}").parse().unwrap_or(falloff).max(1.0)
}

/// The distance at which a falloff halves occlusion, to four digits.
fn half_distance(falloff: f64) -> f64 {
    let half = 1.0 / falloff.max(1.0).log2();
    format!("{half:.3e}").parse().unwrap_or(half)
}

/// A number as it is typed, or in exponential form if that is shorter.
fn in_short(value: f64) -> String {
    let (plain, short) = (value.to_string(), format!("{value:e}"));
    if short.len() < plain.len() { short } else { plain }
}

fn truth(app: &mut App, ui: &mut Ui) {
    // an image of the truth on the screen is compared, whatever is ticked
    let is_shown = !app.compares && app.compares_now();
    let mut compares = app.compares || is_shown;
    let check = ui.add_enabled(!is_shown, egui::Checkbox::new(&mut compares, "Compare (T)"));
    let check = check.on_disabled_hover_text("The second image is the truth: both are compared while it is shown");
    check.on_hover_text(
        "While the camera rests, the truth converges beside the first image, in half of the time, and the difference is measured",
    );
    if !is_shown {
        app.compares = compares;
    }

    // which truth
    let shown = app.truth().label();
    let is_truth = |t: Technique| matches!(t, Technique::Converged | Technique::Still(_));
    if let Some(technique) = choose_technique(ui, "Truth", &shown, Some(app.truth()), &is_truth) {
        app.choose_truth(Some(technique));
    }
    let mut follows = !app.has_chosen_truth();
    let check = ui.checkbox(&mut follows, "The truth follows the first image");
    check.clone().on_hover_text("What the first image approximates: of the same integrator, converged");
    if check.changed() {
        let truth = (!follows).then(|| app.truth());
        app.choose_truth(truth);
    }

    // figures of the last comparison
    if !app.compares_now() {
        return;
    }
    let Some(c) = &app.comparison else {
        ui.label("the truth is on its way …");
        return;
    };
    egui::Grid::new("comparison").num_columns(2).striped(true).show(ui, |ui| {
        let mut row = |name: &str, text: String, help: &str| {
            ui.label(name).on_hover_text(help);
            ui.label(text).on_hover_text(help);
            ui.end_row();
        };
        row("RMSE", format!("{:.5}", c.rmse), "Root of the mean squared difference, over pixels that show the scene");
        row("Bias", format!("{:+.5}", c.bias), "Mean difference: negative where the image is darker than the truth");
        row("FLIP", format!("{:.5}", c.flip), "How different the two look to someone who flickers between them, 0 to 1");
        let error = c.truth_error.map_or("unknown".into(), |e| format!("{e:.5}"));
        let help = "Standard error of a pixel of the truth, estimated from the variance of its samples. They are stratified, so that it is less: an upper bound";
        row("Truth's own error, at most", error, help);
        row("Samples of the truth", c.truth_samples.to_string(), "Samples per pixel of the truth so far");
    });

    // a truth that is of something else is said to be
    if matches!(app.first, Technique::Buffer(_)) {
        ui.label("The first image is a buffer: the ambient occlusion behind it is compared.");
    } else if app.first.integrator() != app.truth().integrator() {
        ui.label(format!(
            "{} is not what the first image approximates: the difference is not its error.",
            app.truth().label()
        ));
    }
}

/// Settings that apply to frames, by the name of an integrator's capability.
fn applicable<'a>(settings: Vec<Setting<'a>>, integrator: &dyn Integrator, hidden: &[&str]) -> Vec<Setting<'a>> {
    let named = (integrator.name(), integrator.capabilities());
    settings.into_iter().filter(|s| s.applies.includes(&named) && !hidden.contains(&s.name)).collect()
}

fn frames(app: &mut App, ui: &mut Ui, holds: &dyn Fn(&Setting) -> bool) {
    let settings = app.first.settings(&app.settings);
    if settings.realtime_setting().is_none() {
        ui.label("The first image is a still; these settings are for frames in real time.");
    }
    let effective = crate::renderer::frames::frame_settings(&settings).map(|s| {
        let mut values = serde_json::json!(s);
        values["filter_radius"] = values["filter"]["radius"].take();
        values["filter"] = values["filter"]["kind"].take();
        values
    });
    const HIDDEN: [&str; 11] = [
        "preset",
        "frames",
        "fps",
        "animate",
        "time",
        "camera_path",
        "orbit",
        "warm_up",
        "lead_in",
        "technique",
        "show",
    ];
    let mut all = applicable(app.settings.frames.editable(), &crate::integrators::ao::AmbientOcclusion, &HIDDEN);
    all.retain(|s| holds(s));
    editor::edit(ui, all, &effective.unwrap_or_default());
}

fn paths(app: &mut App, ui: &mut Ui, holds: &dyn Fn(&Setting) -> bool) {
    let integrator = match app.first {
        Technique::Still(integrator) | Technique::Frames(integrator)
            if !integrator.can(Capability::AmbientVisibility) =>
        {
            integrator.get()
        }
        _ => &crate::integrators::path::kinds::PATH as &dyn Integrator,
    };
    let effective = crate::integrators::path::settings::PathSettings::defaults().into();
    let mut all = applicable(app.settings.integrators.path.editable(), integrator, &[]);
    all.retain(|s| holds(s));
    editor::edit(ui, all, &effective);
}

fn light(app: &mut App, ui: &mut Ui) {
    let is_lit = |i: IntegratorName| i.get().capabilities().contains(&Capability::SceneLights);
    if !matches!(app.first, Technique::Still(i) | Technique::Frames(i) if is_lit(i)) {
        ui.label("Light has an effect on path, direct, lit and whitted.");
    }

    environment(app, ui);
    background(app, ui);
    ground(app, ui);
    ui.separator();

    // how bright, and how it becomes colours
    let tone_map = if app.first.is_seen_by_camera() { "agx" } else { "linear" };
    let effective = serde_json::json!({ "tone_map": tone_map, "exposure": 0.0 });
    editor::edit(ui, app.settings.picture.editable(), &effective);
    ui.separator();

    // a light as text
    let heading = ui
        .label("Add a light")
        .on_hover_text(format!("As --light takes it: {}, then key=value", crate::scene::light_spec::kinds()));
    let id = ui.make_persistent_id("light text");
    let mut text =
        ui.data_mut(|d| d.get_temp::<String>(id)).unwrap_or_else(|| "sun direction=-1,-2,-1 irradiance=3".into());
    ui.horizontal(|ui| {
        ui.add(egui::TextEdit::singleline(&mut text).desired_width(200.0)).labelled_by(heading.id);
        if ui.button("Add").clicked() {
            match crate::scene::light_spec::parse(text.trim()) {
                Ok(light) => app.lighting.light.push(light),
                Err(e) => app.report(e, true),
            }
        }
    });
    ui.data_mut(|d| d.insert_temp(id, text));

    // lights that were added
    let mut removed = None;
    for (k, light) in app.lighting.light.iter().enumerate() {
        ui.horizontal(|ui| {
            if ui.small_button("✖").on_hover_text("Remove this light").clicked() {
                removed = Some(k);
            }
            ui.label(light.to_string());
        });
    }
    if let Some(k) = removed {
        app.lighting.light.remove(k);
    }
}

/// The environment: one from a list, a file, or what is typed; its turn and brightness.
fn environment(app: &mut App, ui: &mut Ui) {
    // one from the list
    let current = app.lighting.environment.clone().unwrap_or_default();
    let builtin = BuiltinEnvironment::ALL.map(|e| (e.name(), e.help()));
    let listed = [("", "The scene's own"), ("none", "None"), ("sky", "A clear sky with its sun"), ("1,1,1", "White")];
    let listed: Vec<(&str, &str)> = listed.into_iter().chain(builtin).collect();
    let label = |(name, help): (&str, &str)| match (BuiltinEnvironment::from_name(name), help) {
        (Some(e), _) => ["Studio", "Soft box", "Overcast"][e as usize].to_owned(),
        (None, help) => help.to_owned(),
    };
    let shown = listed.iter().find(|l| l.0 == current).map_or_else(|| short_name(&current), |l| label(*l));
    let mut chosen = None;
    ui.horizontal(|ui| {
        let heading = ui.label("Environment");
        let list = ComboBox::from_id_salt("environment").selected_text(shown).show_ui(ui, |ui| {
            for &(name, help) in &listed {
                if ui.selectable_label(current == name, label((name, help))).on_hover_text(help).clicked() {
                    chosen = Some(name.to_owned());
                }
            }
            // files that were used before
            for file in app.remembered.iter().flat_map(|remembered| &remembered.environments) {
                if ui.selectable_label(current == *file, short_name(file)).on_hover_text(file).clicked() {
                    chosen = Some(file.clone());
                }
            }
        });
        list.response.labelled_by(heading.id);
        if ui
            .button("Browse…")
            .on_hover_text("A map (.hdr, .exr, .png, .jpg), which can be dropped here, too")
            .clicked()
        {
            app.dialog = Some(Dialog::Open(String::new()));
        }
    });

    // what is typed
    let heading = ui
        .label("A map's path, sky:ELEVATION,AZIMUTH,TURBIDITY or R,G,B")
        .on_hover_text("Enter applies it; empty: the scene's own");
    let id = ui.make_persistent_id("environment text");
    // what is typed is of the environment that there was, unless it has been replaced: by a file
    // that was dropped, say
    let typed = ui.data_mut(|d| d.get_temp::<(String, String)>(id)).filter(|(of, _)| *of == current);
    let mut text = typed.map_or_else(|| current.clone(), |(_, text)| text);
    let edit = ui.text_edit_singleline(&mut text).labelled_by(heading.id);
    if edit.lost_focus() && text.trim() != current {
        chosen = Some(text.trim().to_owned());
    }
    ui.data_mut(|d| d.insert_temp(id, (current, text)));
    if let Some(chosen) = chosen {
        app.lighting.environment = Some(chosen).filter(|text| !text.is_empty());
        app.remember_environment();
        if app.lighting.environment.is_none() {
            (app.lighting.environment_turn, app.lighting.environment_scale) = (None, None);
        }
    }

    // its turn and brightness
    ui.add_enabled_ui(app.lighting.environment.is_some(), |ui| {
        ui.horizontal(|ui| {
            let heading = ui.label("Turn").on_hover_text("Counter-clockwise from above; also Shift + right drag");
            let mut turn = app.lighting.environment_turn.unwrap_or(0.0);
            if slider::show(ui, &heading, &mut turn, -180.0..=180.0, Scale::Linear, "°") {
                app.lighting.environment_turn = Some(turn).filter(|turn| *turn != 0.0);
            }
        });
        ui.horizontal(|ui| {
            let heading = ui.label("Brightness").on_hover_text("Stops: each doubles the environment's radiance");
            let mut stops = app.lighting.environment_scale.unwrap_or(1.0).max(1e-6).log2();
            if slider::show(ui, &heading, &mut stops, -8.0..=8.0, Scale::Linear, " EV") {
                app.lighting.environment_scale = Some(stops.exp2()).filter(|scale| *scale != 1.0);
            }
        });
    });
}

/// The background of the scene, apart from what lights it.
fn background(app: &mut App, ui: &mut Ui) {
    let current = app.settings.image.background.unwrap_or_default();
    let colour = match current {
        Backdrop::Colour(colour) => colour,
        _ => [0.2; 3],
    };
    let listed = [
        (Backdrop::Map, "The environment", "As it is, or black"),
        (Backdrop::Blurred, "Blurred", "The environment, blurred"),
        (Backdrop::Colour(colour), "Colour", "A colour, which no tone mapping changes"),
        (Backdrop::Transparent, "Transparent", "Nothing: saved pictures have alpha; squares are shown in its place"),
    ];
    let shown = listed.iter().find(|l| l.0 == current).map_or("", |l| l.1);
    let mut chosen = current;
    ui.horizontal(|ui| {
        let heading =
            ui.label("Background").on_hover_text("Light, mirrors and glass keep the environment\n--background");
        let list = ComboBox::from_id_salt("background").selected_text(shown).show_ui(ui, |ui| {
            for (backdrop, name, help) in listed {
                ui.selectable_value(&mut chosen, backdrop, name).on_hover_text(help);
            }
        });
        list.response.labelled_by(heading.id);
        if let Backdrop::Colour(linear) = &mut chosen {
            let mut rgb = egui::Rgba::from_rgb(linear[0], linear[1], linear[2]);
            let alpha = egui::color_picker::Alpha::Opaque;
            if egui::color_picker::color_edit_button_rgba(ui, &mut rgb, alpha).changed() {
                *linear = [rgb.r(), rgb.g(), rgb.b()].map(|c| c.clamp(0.0, 1.0));
            }
        }
    });
    if chosen != current {
        app.settings.image.background = Some(chosen).filter(|b| *b != Backdrop::Map);
    }
}

/// The ground under the scene.
fn ground(app: &mut App, ui: &mut Ui) {
    let image = &mut app.settings.image;
    let mut chosen = image.ground.unwrap_or_default();
    ui.horizontal(|ui| {
        let heading = ui.label("Ground").on_hover_text("Under the scene\n--ground");
        let name = |ground: Ground| ["None", "Plane", "Shadow catcher"][ground as usize];
        let list = ComboBox::from_id_salt("ground").selected_text(name(chosen)).show_ui(ui, |ui| {
            for ground in Ground::ALL {
                ui.selectable_value(&mut chosen, ground, name(ground)).on_hover_text(ground.help());
            }
        });
        list.response.labelled_by(heading.id);
        if let (true, Some((low, high))) = (chosen != Ground::None, app.scene.as_ref().map(|scene| scene.bounds)) {
            let mut height = image.ground_height.unwrap_or(low.y);
            let speed = 1e-3 * (high - low).length().max(1e-6);
            let edit = ui.add(egui::DragValue::new(&mut height).speed(speed).prefix("y "));
            if edit.on_hover_text("Height\n--ground-height").changed() {
                image.ground_height = Some(height).filter(|h| *h != low.y);
            }
        }
    });
    image.ground = Some(chosen).filter(|g| *g != Ground::None);
    if chosen == Ground::None {
        image.ground_height = None;
    }
    if chosen == Ground::Catcher && !app.first.catches_shadows() {
        ui.label("What is shown catches no shadows: the ground is a plane.");
    } else if chosen == Ground::Catcher && app.first.is_on_black(app.settings.image.background.unwrap_or_default()) {
        ui.label("On black no occlusion is seen: choose a colour as background.");
    }
}

/// The last part of a path.
fn short_name(path: &str) -> String {
    std::path::Path::new(path).file_name().map_or_else(|| path.to_owned(), |n| n.to_string_lossy().into_owned())
}

fn camera(app: &mut App, ui: &mut Ui) {
    let Some(shown) = app.shown_camera() else { return };
    placement(app, ui, &shown);
    camera_projection(app, ui, shown.projection);

    // how it moves
    let Some(control) = &mut app.control else { return };
    ui.horizontal(|ui| {
        let heading = ui.label("Speed of flight");
        slider::show(ui, &heading, &mut control.speed, 0.01..=10.0, Scale::Logarithmic, "");
    });
    ui.horizontal(|ui| {
        let heading = ui.label("Turntable");
        slider::show(ui, &heading, &mut app.turntable, -2.0..=2.0, Scale::Linear, " rad/s");
    });
    if ui
        .button("Copy the camera")
        .on_hover_text("Copies the options of skylit render that choose this camera")
        .clicked()
    {
        match app.render_settings(RenderedMotion::Nothing) {
            Ok(shown) => {
                let settings = crate::renderer::RenderSettings { camera: shown.camera, ..Default::default() };
                app.copied = Some(settings.flags().join(" "));
                app.report("copied the camera", false);
            }
            Err(e) => app.report(e.to_string(), true),
        }
    }
}

/// The projection of the camera: its field of view, or the height of what parallel rays show.
fn camera_projection(app: &mut App, ui: &mut Ui, shown: CameraProjection) {
    let mut is_orthographic = matches!(shown, CameraProjection::Orthographic { .. });
    let box_of = ui.checkbox(&mut is_orthographic, "Parallel rays");
    let help = "An orthographic view, as plans and elevations have it. Rays start at the camera: what is behind it in a room is not seen\nCtrl + 5";
    if box_of.on_hover_text(help).changed() {
        menu::change_projection(app);
        return;
    }
    ui.horizontal(|ui| match shown {
        CameraProjection::Perspective { fov_y } => {
            let mut degrees = fov_y.to_degrees();
            let heading = ui.label("Field of view");
            // a camera of a file may have another
            if slider::show(ui, &heading, &mut degrees, 5.0..=120.0, Scale::Linear, "°") {
                app.leave_followed();
                app.control.iter_mut().for_each(|control| control.set_fov_y(degrees.to_radians()));
            }
        }
        CameraProjection::Orthographic { half_height } => {
            let (mut height, size) = (2.0 * half_height, app.control.as_ref().map_or(1.0, |c| c.scene_size()));
            let heading = ui
                .label("Height of the view")
                .on_hover_text("In scene units, up to ten times the scene; --orthographic takes any");
            if slider::show(ui, &heading, &mut height, 1e-3 * size..=10.0 * size, Scale::Logarithmic, "") {
                app.leave_followed();
                app.control.iter_mut().for_each(|control| control.set_height(height));
            }
        }
    });
}

/// Where the camera is and what it looks at, as numbers to type or to drag.
fn placement(app: &mut App, ui: &mut Ui, shown: &Camera) {
    let Some(control) = &app.control else { return };
    let size = control.scene_size();
    // an animation may have moved it
    let moved = shown.camera_to_world.translation - control.eye();
    let mut points = [control.eye() + moved, control.pivot() + moved];
    let mut changed = false;
    for (name, point) in ["Eye", "Target"].into_iter().zip(&mut points) {
        ui.horizontal(|ui| {
            ui.label(name);
            for (axis, value) in ["x", "y", "z"].into_iter().zip(point.as_mut()) {
                let drag = egui::DragValue::new(value).speed(1e-3 * size).max_decimals(4);
                let response = ui.add(drag).on_hover_text(format!("{name} {axis}, scene units"));
                response.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::WidgetType::DragValue, true, format!("{name} {axis}"))
                });
                changed |= response.changed();
            }
        });
    }
    if changed {
        app.leave_followed();
        app.control.iter_mut().for_each(|control| control.place(points[0], points[1]));
    }
}

/// The variants of the scene's materials, if it has some.
fn variant(app: &mut App, ui: &mut Ui) {
    let Some(names) = app.scene.as_ref().map(|s| s.variants.as_slice()).filter(|names| !names.is_empty()) else {
        return;
    };
    let chosen = &mut app.settings.scene.variant;
    let current = chosen.as_deref().and_then(|text| variant_index(names, text));
    let shown = current.map_or("none", |k| names[k].as_str());
    ui.horizontal(|ui| {
        let heading = ui.label("Variant");
        let combo = ComboBox::from_id_salt("variant").selected_text(shown);
        let response = combo.show_ui(ui, |ui| {
            if ui.selectable_label(current.is_none(), "none").clicked() {
                *chosen = None;
            }
            for (k, name) in names.iter().enumerate() {
                if ui.selectable_label(current == Some(k), name).clicked() {
                    *chosen = Some(name.clone());
                }
            }
        });
        response.response.labelled_by(heading.id);
    });
}

/// The scenes of a glTF file, if it has several.
fn scene_of_file(app: &mut App, ui: &mut Ui) {
    let Some(names) = app.scene.as_ref().map(|s| s.scenes.clone()).filter(|names| names.len() > 1) else { return };
    let shown = app.gltf_scene.clone().unwrap_or_else(|| "the file's choice".to_owned());
    let mut chosen = None;
    ui.horizontal(|ui| {
        let heading = ui.label("Scene of the file");
        let combo = ComboBox::from_id_salt("scene of the file").selected_text(shown);
        let response = combo.show_ui(ui, |ui| {
            for (k, name) in names.iter().enumerate() {
                let number = k.to_string();
                let is_chosen = app.gltf_scene.as_ref().is_some_and(|s| s == name || *s == number);
                if ui.selectable_label(is_chosen, format!("{number} {name}")).clicked() {
                    chosen = Some(number);
                }
            }
        });
        response.response.labelled_by(heading.id);
    });
    if chosen.is_some() {
        app.gltf_scene = chosen;
        app.reload();
    }
}

/// Axis, normals and texture coordinates in place of the file's, for which it is loaded anew.
fn geometry(app: &mut App, ui: &mut Ui) {
    let mut is_editing = false;
    let GeometryOptions { normals, uv, up } = &mut app.geometry;

    // the axis that points up
    ui.horizontal(|ui| {
        let heading = ui.label("Up");
        let list = ComboBox::from_id_salt("up").selected_text(up.name()).show_ui(ui, |ui| {
            for axis in UpAxis::ALL {
                ui.selectable_value(up, axis, axis.name()).on_hover_text(axis.help());
            }
        });
        list.response.labelled_by(heading.id).on_hover_text("Axis of the file that points up\n--up-axis");
    });

    // normals, and the angle of edges that stay sharp
    let angle = if let NormalSource::Smooth(degrees) = *normals { degrees } else { 180.0 };
    let sources = [("file", NormalSource::File), ("flat", NormalSource::Flat), ("smooth", NormalSource::Smooth(angle))];
    let shown = sources.iter().find(|(_, source)| *source == *normals).map_or("file", |(name, _)| *name);
    ui.horizontal(|ui| {
        let heading = ui.label("Normals");
        let combo = ComboBox::from_id_salt("normals").selected_text(shown);
        let response = combo.show_ui(ui, |ui| {
            for (name, source) in sources {
                ui.selectable_value(normals, source, name);
            }
        });
        response.response.labelled_by(heading.id).on_hover_text("Shading normals of all meshes\n--normals");
    });
    if let NormalSource::Smooth(degrees) = normals {
        ui.horizontal(|ui| {
            let heading = ui.label("Sharp edges from");
            let value = egui::DragValue::new(degrees).range(0.0..=180.0).suffix(" degrees");
            let help = "Edges at which the surface bends by more stay sharp\n--normals ANGLE";
            let response = ui.add(value).labelled_by(heading.id).on_hover_text(help);
            is_editing = response.dragged() || response.has_focus();
        });
    }

    // texture coordinates
    ui.horizontal(|ui| {
        let heading = ui.label("Texture coordinates");
        let combo = ComboBox::from_id_salt("uv").selected_text(uv.map_or("of the file", |p| p.name()));
        let response = combo.show_ui(ui, |ui| {
            ui.selectable_value(uv, None, "of the file");
            for projection in Projection::ALL {
                ui.selectable_value(uv, Some(projection), projection.name()).on_hover_text(projection.help());
            }
        });
        let help = "Texture coordinates of meshes that have none and whose material has textures\n--uv";
        response.response.labelled_by(heading.id).on_hover_text(help);
    });
    // not for each value that is passed on the way
    if app.geometry != app.opened_geometry() && !is_editing {
        app.reload();
    }
}

fn animation(app: &mut App, ui: &mut Ui) {
    let animations = app.scene.as_ref().map(|s| s.animations.clone()).unwrap_or_default();
    if animations.is_empty() {
        ui.label("The scene has no animation.");
        return;
    }
    let playback = &mut app.playback;
    let before = playback.animation;
    let name = |k: Option<usize>| k.and_then(|k| animations.get(k)).map_or("none", |a| a.0.as_str());
    ui.horizontal(|ui| {
        let heading = ui.label("Animation");
        let combo = ComboBox::from_id_salt("animation").selected_text(name(playback.animation));
        let response = combo.show_ui(ui, |ui| {
            ui.selectable_value(&mut playback.animation, None, "none");
            for (k, (name, seconds)) in animations.iter().enumerate() {
                ui.selectable_value(&mut playback.animation, Some(k), format!("{name} ({seconds:.2} s)"));
            }
        });
        response.response.labelled_by(heading.id);
    });
    if playback.animation != before {
        // of another one
        (playback.time, playback.runs) = (0.0, playback.runs && playback.animation.is_some());
    }
    let Some(duration) = playback.animation.and_then(|k| animations.get(k)).map(|a| a.1) else { return };
    ui.horizontal(|ui| {
        if ui.button(if playback.runs { "Stop" } else { "Play" }).on_hover_text("P").clicked() {
            playback.toggle(duration);
        }
        ui.checkbox(&mut playback.repeats, "Loop");
    });
    ui.horizontal(|ui| {
        let heading = ui.label("Time");
        slider::show(ui, &heading, &mut playback.time, 0.0..=duration.max(1e-3), Scale::Linear, " s");
    });
    ui.horizontal(|ui| {
        let heading = ui.label("Speed");
        slider::show(ui, &heading, &mut playback.speed, 0.05..=4.0, Scale::Logarithmic, "");
    });
}

fn device(app: &mut App, ui: &mut Ui) {
    // devices
    if app.devices.len() > 1 {
        ui.horizontal(|ui| {
            let label = ui.label("Vulkan device");
            let chosen = app.device.index;
            let mut choice = chosen;
            let combo =
                ComboBox::from_id_salt("device").selected_text(app.devices.get(chosen).map_or("", String::as_str));
            let combo = combo.show_ui(ui, |ui| {
                for (k, name) in app.devices.iter().enumerate() {
                    ui.selectable_value(&mut choice, k, name);
                }
            });
            combo.response.labelled_by(label.id);
            if choice != chosen {
                app.device_settings.device = Some(choice.to_string());
            }
        });
    } else {
        ui.label(&app.device.name);
    }

    // tracers: those that the device lacks say what is missing
    let (tracer, reason) = app.device.tracer.clone();
    let chosen = app.device_settings.tracer.unwrap_or_default();
    // its pipelines take seconds to compile
    let changes = chosen != TracerChoice::Auto && chosen.name() != tracer && !tracer.is_empty() && !app.is_settled();
    ui.label(if changes { format!("Changing to {}…", chosen.name()) } else { format!("Tracer {tracer}: {reason}") });
    ui.horizontal(|ui| {
        let heading = ui.label("Tracer");
        let current = app.device_settings.tracer.unwrap_or_default();
        let combo = ComboBox::from_id_salt("tracer").selected_text(current.name());
        let response = combo.show_ui(ui, |ui| {
            for choice in TracerChoice::ALL {
                let lacks = app.device.unavailable.iter().find(|(name, _)| name == choice.name());
                let item = ui.add_enabled(lacks.is_none(), egui::Button::selectable(current == choice, choice.name()));
                let item = match lacks {
                    Some((_, missing)) => item.on_disabled_hover_text(format!("the device lacks {missing}")),
                    None => item.on_hover_text(choice.help()),
                };
                if item.clicked() {
                    app.device_settings.tracer = Some(choice);
                    if matches!(choice, TracerChoice::Pipeline | TracerChoice::Query) {
                        // options of the compute tracer
                        let d = &mut app.device_settings;
                        (d.traversal, d.triangle_test, d.build, d.bvh_cache) = (None, None, None, None);
                        (d.build_direction, d.build_eye, d.build_areas) = (None, None, None);
                    }
                }
            }
        });
        response.response.labelled_by(heading.id);
    });

    tracer_options(app, ui, &|s| !is_research(s));
}

/// Options of the compute tracer.
fn tracer_options(app: &mut App, ui: &mut Ui, holds: &dyn Fn(&Setting) -> bool) {
    let is_compute = app.device.tracer.0 == "compute";
    let hidden = ["tracer", "device", "validation"];
    let mut rest = app.device_settings.editable();
    rest.retain(|s| !hidden.contains(&s.name) && holds(s));
    ui.add_enabled_ui(is_compute, |ui| editor::edit(ui, rest, &serde_json::json!({})));
}
