//! The section about the scene: its objects, what is selected, and the values of its material.

use egui::{Button, CollapsingHeader, ScrollArea, Ui};
use glam::Vec3;

use super::slider::{self, Scale};
use crate::scene::Material;
use crate::scene::material_edit::MaterialEdit;
use crate::settings::Capability;
use crate::viewer::app::App;
use crate::viewer::dialog::Dialog;
use crate::viewer::scene_list::{Row, RowKind, Selection};

/// Number of lines from which they can be searched.
const MANY: usize = 12;
/// Height of the list, points.
const LIST_HEIGHT: f32 = 170.0;
/// Height of a tree, points.
const TREE_HEIGHT: f32 = 230.0;
/// Width of a level of a tree, points, and most levels that are told apart.
const LEVEL_WIDTH: f32 = 12.0;
const MAX_LEVELS: u32 = 8;
/// Width of the arrow of a node, points.
const ARROW_WIDTH: f32 = 16.0;
/// Brightest emission of the slider, linear radiance.
const BRIGHTEST: f32 = 100.0;

/// Lists the objects by the nodes of the file or by their meshes, with what can be done with them.
pub fn objects(app: &mut App, ui: &mut Ui) {
    let Some(scene) = app.scene.as_ref() else {
        ui.label("No scene is open.");
        return;
    };
    let [instances, ..] = scene.counts;
    let (listed, is_tree) = (scene.objects.len(), !scene.nodes.is_empty());
    if listed == 0 {
        return;
    }

    // a search, where there are many
    if listed + scene.nodes.len() > MANY {
        let mut search = app.list.search().to_owned();
        ui.horizontal(|ui| {
            let heading = ui.label("Search");
            ui.add(egui::TextEdit::singleline(&mut search).desired_width(160.0)).labelled_by(heading.id);
        });
        app.list.set_search(search);
    }

    // the list, of which only what is in view is made
    let wanted = app.list.take_wanted(scene);
    let rows = app.list.rows(scene);
    let height = ui.spacing().interact_size.y;
    let most = if is_tree { TREE_HEIGHT } else { LIST_HEIGHT };
    let mut list = ScrollArea::vertical().id_salt("objects").max_height(most).auto_shrink([false, true]);
    if let Some(wanted) = wanted {
        // in the middle, unless it is in view
        let step = height + ui.spacing().item_spacing.y;
        let place = wanted as f32 * step;
        if place < app.list.offset || place + step > app.list.offset + most {
            list = list.vertical_scroll_offset((place - 0.5 * (most - step)).max(0.0));
        }
    }
    let shown = list.show_rows(ui, height, rows.len(), |ui, range| {
        rows.get(range).into_iter().flatten().for_each(|row| show_row(app, ui, row, is_tree));
    });
    app.list.offset = shown.state.offset.y;
    if listed < instances {
        ui.weak(format!("The first {listed} of {instances} objects"));
    }
    ui.add_space(4.0);
    actions(app, ui);
}

/// Buttons about what is selected.
fn actions(app: &mut App, ui: &mut Ui) {
    let selected = app.selected.filter(|selected| app.hidden_count(*selected)[0] > 0);
    ui.horizontal_wrapped(|ui| {
        let is_hidden = selected.is_some_and(|selected| app.is_hidden(selected));
        let button = |ui: &mut Ui, text: &str, help: &str| {
            let button = ui.add_enabled(selected.is_some(), Button::new(text)).on_hover_text(help);
            selected.filter(|_| button.clicked())
        };
        if let Some(selected) = button(ui, "Frame", "Look at what is selected") {
            app.frame(selected);
        }
        if let Some(selected) = button(ui, "Isolate", "Show what is selected alone\n--only") {
            app.isolate(selected);
        }
        let text = if is_hidden { "Show again" } else { "Hide" };
        if let Some(selected) = button(ui, text, "Take it out of the scene and back\n--hide") {
            app.hide(selected, !is_hidden);
        }
        let edited = &app.settings.scene;
        let is_changed = !edited.hide.is_empty() || !edited.only.is_empty();
        if ui.add_enabled(is_changed, Button::new("Show all")).clicked() {
            app.show_all_objects();
        }
    });
}

/// Name of an object, mesh or material for people.
pub fn named(kind: &str, index: usize, name: &str) -> String {
    if name.is_empty() { format!("{kind} {index}") } else { name.to_owned() }
}

/// A line of the list: an arrow, whether it is shown, and a name.
fn show_row(app: &mut App, ui: &mut Ui, row: &Row, is_tree: bool) {
    let Some(scene) = app.scene.as_ref() else { return };
    let level = LEVEL_WIDTH * row.level.min(MAX_LEVELS) as f32;
    let indent = |ui: &mut Ui| ui.add_space(level + if is_tree { ARROW_WIDTH } else { 0.0 });
    let arrow = if row.is_open { "⏷" } else { "⏵" };

    // lines that have others below, and those that have none
    match row.kind {
        RowKind::Mesh(mesh, count) => {
            let name = scene.objects.iter().find(|o| o.mesh.0 == mesh).map_or("", |o| &o.mesh.1);
            let text = format!("{arrow} {} ({count})", named("mesh", mesh, name));
            if ui.add(Button::selectable(false, text).truncate()).clicked() {
                app.list.fold(mesh, !row.is_open);
            }
        }
        RowKind::Node(k) => {
            let Some(node) = scene.nodes.get(k) else { return };
            let name = if node.name.is_empty() { "node" } else { &*node.name };
            let count = node.instances().len();
            let name = if count > 0 { format!("{name} ({count})") } else { name.to_owned() };
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 2.0;
                ui.add_space(level);
                let size = egui::vec2(ARROW_WIDTH - 2.0, ui.available_height());
                let fold = ui.add_sized(size, Button::new(arrow).frame(false));
                let verb = if row.is_open { "Fold" } else { "Unfold" };
                fold.widget_info(|| {
                    egui::WidgetInfo::labeled(egui::WidgetType::Button, true, format!("{verb} {name}"))
                });
                if fold.clicked() {
                    app.list.fold(k, !row.is_open);
                }
                part(app, ui, Selection::Node(k), &name);
            });
        }
        RowKind::Object(k) => {
            let Some(object) = scene.objects.get(k) else { return };
            // parts of a node have its name, and meshes or materials of their own
            let node = row.node.and_then(|at| scene.nodes.get(at)).map_or("", |node| &*node.name);
            let material = scene.materials.get(object.material).filter(|_| !node.is_empty());
            let material = material.map_or("", |m| m.name.as_str());
            let names = [object.name.as_str(), &object.mesh.1, material];
            let name = names.iter().find(|name| !name.is_empty() && **name != node);
            let name = named("object", k, name.copied().unwrap_or(node));
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 2.0;
                indent(ui);
                part(app, ui, Selection::Object(k), &name);
            });
        }
        RowKind::Camera(k) => {
            let Some(camera) = scene.cameras.get(k).cloned() else { return };
            let text = format!("📷 {}", named("Camera", k, &camera.name));
            ui.horizontal(|ui| {
                indent(ui);
                let line = ui.add(Button::selectable(app.followed == Some(k), text).truncate());
                if line.on_hover_text("Look through this camera").clicked() {
                    app.set_camera(camera, Some(k));
                }
            });
        }
        RowKind::Light(k) => {
            let text = format!("💡 {}", scene.lights.get(k).map_or("", String::as_str));
            ui.horizontal(|ui| {
                indent(ui);
                ui.add(egui::Label::new(text).truncate()).on_hover_text("A light of the file: Hide leaves it as it is");
            });
        }
    }
}

/// An object or a node: whether it is shown, and its name, which selects it.
fn part(app: &mut App, ui: &mut Ui, selection: Selection, name: &str) {
    let [all, hidden] = app.hidden_count(selection);
    let mut is_shown = hidden < all;
    let is_partly = is_shown && hidden > 0;
    if all > 0 {
        let tick = ui.add(egui::Checkbox::without_text(&mut is_shown).indeterminate(is_partly));
        let shown = tick.on_hover_text("Whether it is in the scene");
        shown.widget_info(|| {
            let label = format!("Show {name}");
            egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, is_shown && !is_partly, label)
        });
        if shown.changed() {
            // a part that is hidden comes back first
            app.hide(selection, !is_shown && !is_partly);
        }
    }
    let text = egui::RichText::new(name);
    let text = if all > 0 && hidden == all { text.weak() } else { text };
    let line = ui.add(Button::selectable(app.selected == Some(selection), text).truncate());
    if line.double_clicked() {
        app.frame(selection);
    } else if line.clicked() {
        app.select(Some(selection));
    }
}

/// The object that is selected: the values of its material, and what a click has met.
pub fn selection(app: &mut App, ui: &mut Ui) {
    let k = match app.selected {
        Some(Selection::Object(k)) => k,
        Some(Selection::Node(_)) => {
            ui.weak("Select one object to change its material.");
            return;
        }
        None => {
            ui.weak("Click into the image or the list to select an object.");
            return;
        }
    };
    let object = app.scene.as_ref().and_then(|s| s.objects.get(k)).cloned();
    let picked = app.pick.as_ref().map(|pick| pick.material.0);
    if let Some(material) = picked.or(object.as_ref().map(|o| o.material)) {
        material_values(app, ui, material);
    }
    if app.pick.is_some() {
        CollapsingHeader::new("What was clicked on").show(ui, |ui| picked_point(app, ui));
    }
}

/// The values of a material, which are changed while it is shown.
fn material_values(app: &mut App, ui: &mut Ui, index: usize) {
    let Some(original) = app.scene.as_ref().and_then(|s| s.materials.get(index)).cloned() else { return };
    let mut edit = app.material_edit(index);
    let before = edit.clone();
    let mut shown = original.clone();
    edit.apply_to(&mut shown);
    ui.strong(format!("Material {}", named("", index, &original.name).trim()));

    // each value is replaced where it differs from the file's
    egui::Grid::new("material").num_columns(2).show(ui, |ui| {
        let [r, g, b, _] = shown.base_color.to_array();
        if let Some(colour) = colour(ui, "Base colour", "Linear; textures multiply it", Vec3::new(r, g, b)) {
            edit.base_color = Some(colour);
        }
        for (label, value, edited) in [
            ("Metallic", shown.metallic, &mut edit.metallic),
            ("Roughness", shown.roughness, &mut edit.roughness),
            ("Transmission", shown.transmission.factor, &mut edit.transmission),
        ] {
            *edited = slid(ui, label, label, value, 1.0).or(*edited);
        }

        // the emission: a colour, and how strong it is
        let strength = shown.emissive.max_element();
        let tint = if strength > 0.0 { shown.emissive / strength } else { Vec3::ONE };
        let help = "Linear radiance of its brightest part";
        if let Some(wanted) = slid(ui, "Emission", help, strength, BRIGHTEST) {
            edit.emission = Some(tint * wanted);
        }
        if strength > 0.0
            && let Some(colour) = colour(ui, "Emitted colour", "Of the light that it emits", tint)
        {
            edit.emission = Some(colour * strength);
        }
    });
    if edit != before {
        app.edit_material(without_effect_removed(edit, &original));
    }

    // back, and out
    ui.horizontal(|ui| {
        let reset = ui.add_enabled(!before.is_empty(), Button::new("Reset material"));
        if reset.on_hover_text("Back to the values of the file").clicked() {
            app.edit_material(MaterialEdit { material: before.material.clone(), ..MaterialEdit::default() });
        }
        if ui.button("Export…").on_hover_text("Write the scene as it is shown as glTF: skylit export").clicked() {
            app.dialog = Some(Dialog::Export(format!("{}-edited.glb", super::menu::stem(app))));
        }
    });
    let capabilities = app.first.integrator().get().capabilities();
    if !capabilities.contains(&Capability::SceneLights) {
        ui.weak("Materials are seen in path, direct, lit and whitted (4).");
    }
}

/// A number from 0 on that is slid or typed; returns it where it was changed.
fn slid(ui: &mut Ui, label: &str, help: &str, value: f32, most: f32) -> Option<f32> {
    let heading = ui.label(label).on_hover_text(help);
    let mut wanted = f64::from(value);
    let scale = if most > 1.0 { Scale::Logarithmic } else { Scale::Linear };
    let slide = |ui: &mut Ui| slider::show(ui, &heading, &mut wanted, 0.0..=f64::from(most), scale, "");
    let has_changed = ui.horizontal(slide).inner;
    ui.end_row();
    // four digits are enough, and fewer to read in a command
    has_changed.then(|| (1e4 * wanted.max(0.0)).round() as f32 / 1e4)
}

/// A colour that is chosen; returns it where it was changed.
fn colour(ui: &mut Ui, label: &str, help: &str, colour: Vec3) -> Option<Vec3> {
    let mut rgb = colour.to_array();
    let heading = ui.label(label).on_hover_text(help);
    let response = ui.color_edit_button_rgb(&mut rgb);
    let has_changed = response.changed();
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::ColorButton, true, label));
    response.labelled_by(heading.id);
    ui.end_row();
    has_changed.then(|| Vec3::from_array(rgb).clamp(Vec3::ZERO, Vec3::ONE))
}

/// The edit without values that are the material's own.
fn without_effect_removed(edit: MaterialEdit, original: &Material) -> MaterialEdit {
    MaterialEdit {
        base_color: edit.base_color.filter(|c| *c != original.base_color.truncate()),
        metallic: edit.metallic.filter(|v| *v != original.metallic),
        roughness: edit.roughness.filter(|v| *v != original.roughness),
        emission: edit.emission.filter(|e| *e != original.emissive),
        transmission: edit.transmission.filter(|v| *v != original.transmission.factor),
        ..edit
    }
}

/// The surface at the point that was clicked on.
fn picked_point(app: &App, ui: &mut Ui) {
    let Some(pick) = &app.pick else { return };
    let name = |(index, name): &(usize, String)| {
        if name.is_empty() { format!("{index}") } else { format!("{index} '{name}'") }
    };
    let textures = app.scene.as_ref().map(|s| s.textures.as_slice()).unwrap_or_default();
    let textures: Vec<_> =
        pick.textures.iter().filter_map(|&t| textures.get(t).map(|n| format!("{t} '{n}'"))).collect();
    // names may be long: they are broken, and do not make the panel wider
    let width = (ui.available_width() - 90.0).max(60.0);
    egui::Grid::new("selection").num_columns(2).striped(true).max_col_width(width).show(ui, |ui| {
        let rows = [
            ("Position", format!("{:.4}, {:.4}, {:.4}", pick.position.x, pick.position.y, pick.position.z)),
            ("Distance", format!("{:.4}", pick.distance)),
            ("Instance", name(&pick.instance)),
            ("Mesh", name(&pick.mesh)),
            ("Primitive", format!("{} of {}", pick.primitive.0, pick.primitive.1)),
            ("Material", name(&pick.material)),
            ("Textures", if textures.is_empty() { "none".into() } else { textures.join(", ") }),
        ];
        for (title, text) in rows {
            ui.label(title);
            ui.add(egui::Label::new(text).wrap());
            ui.end_row();
        }
    });
}
