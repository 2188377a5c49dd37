//! The section about the scene: its objects, what is selected, and the values of its material.

use std::collections::{BTreeMap, BTreeSet};

use egui::{Button, CollapsingHeader, ScrollArea, Ui};
use glam::Vec3;

use super::slider::{self, Scale};
use crate::scene::Material;
use crate::scene::material_edit::MaterialEdit;
use crate::settings::Capability;
use crate::viewer::app::App;
use crate::viewer::dialog::Dialog;
use crate::viewer::request::ObjectSummary;

/// Number of objects from which they can be searched.
const MANY: usize = 12;
/// Height of the list, points.
const LIST_HEIGHT: f32 = 170.0;
/// Brightest emission of the slider, linear radiance.
const BRIGHTEST: f32 = 100.0;

/// A line of the list.
enum Row {
    /// A mesh that several objects have: its index, whether they are listed below.
    Mesh(usize, bool),
    /// An object, and whether it is below its mesh.
    Object(usize, bool),
}

/// Lists the objects by their meshes, with what can be done with them.
pub fn objects(app: &mut App, ui: &mut Ui) {
    let Some(scene) = app.scene.as_ref() else {
        ui.label("No scene is open.");
        return;
    };
    let objects = scene.objects.clone();
    let [instances, ..] = scene.counts;
    if objects.is_empty() {
        return;
    }

    // a search, where there are many
    let id = ui.make_persistent_id("objects");
    let (mut search, mut open): (String, BTreeSet<usize>) = ui.data_mut(|d| d.get_temp(id)).unwrap_or_default();
    if objects.len() > MANY {
        ui.horizontal(|ui| {
            let heading = ui.label("Search");
            ui.add(egui::TextEdit::singleline(&mut search).desired_width(160.0)).labelled_by(heading.id);
        });
    }
    let rows = rows(&objects, &search, &open);

    // the list, of which only what is in view is made
    let hidden = app.hidden_objects();
    let height = ui.spacing().interact_size.y;
    ScrollArea::vertical().id_salt("objects").max_height(LIST_HEIGHT).auto_shrink([false, true]).show_rows(
        ui,
        height,
        rows.len(),
        |ui, range| {
            for row in &rows[range] {
                match *row {
                    Row::Mesh(mesh, is_open) => {
                        let count = objects.iter().filter(|o| o.mesh.0 == mesh).count();
                        let name = objects.iter().find(|o| o.mesh.0 == mesh).map_or("", |o| o.mesh.1.as_str());
                        let arrow = if is_open { "⏷" } else { "⏵" };
                        let text = format!("{arrow} {} ({count})", named("mesh", mesh, name));
                        if ui.add(Button::selectable(false, text).truncate()).clicked() && !open.remove(&mesh) {
                            open.insert(mesh);
                        }
                    }
                    Row::Object(k, is_below) => object(app, ui, k, &objects[k], hidden[k], is_below),
                }
            }
        },
    );
    ui.data_mut(|d| d.insert_temp(id, (search, open)));
    if objects.len() < instances {
        ui.weak(format!("The first {} of {instances} objects", objects.len()));
    }

    // what is done with the one that is selected
    ui.add_space(4.0);
    let selected = app.selected.filter(|k| *k < objects.len());
    ui.horizontal_wrapped(|ui| {
        ui.add_enabled_ui(selected.is_some(), |ui| {
            let k = selected.unwrap_or_default();
            if ui.button("Frame").on_hover_text("Look at what is selected").clicked() {
                app.frame_object(k);
            }
            if ui.button("Isolate").on_hover_text("Show what is selected alone\n--only").clicked() {
                app.isolate(k);
            }
            let is_hidden = selected.is_some_and(|k| hidden[k]);
            let text = if is_hidden { "Show again" } else { "Hide" };
            if ui.button(text).on_hover_text("Take it out of the scene and back\n--hide").clicked() {
                app.hide(k, !is_hidden);
            }
        });
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

/// The lines of the list: meshes of one object are that object.
fn rows(objects: &[ObjectSummary], search: &str, open: &BTreeSet<usize>) -> Vec<Row> {
    let search = search.trim().to_lowercase();
    if !search.is_empty() {
        let has = |text: &str| text.to_lowercase().contains(&search);
        let found = objects.iter().enumerate().filter(|(_, o)| has(&o.name) || has(&o.mesh.1));
        return found.map(|(k, _)| Row::Object(k, false)).collect();
    }

    // in the order in which the file first has them
    let mut of_mesh: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (k, object) in objects.iter().enumerate() {
        of_mesh.entry(object.mesh.0).or_default().push(k);
    }
    let mut rows = Vec::new();
    for (k, object) in objects.iter().enumerate() {
        let all = &of_mesh[&object.mesh.0];
        match all[..] {
            [_] => rows.push(Row::Object(k, false)),
            [first, ..] if first == k => {
                let is_open = open.contains(&object.mesh.0);
                rows.push(Row::Mesh(object.mesh.0, is_open));
                rows.extend(all.iter().filter(|_| is_open).map(|k| Row::Object(*k, true)));
            }
            _ => {}
        }
    }
    rows
}

/// An object of the list: whether it is shown, and its name, which selects it.
fn object(app: &mut App, ui: &mut Ui, k: usize, object: &ObjectSummary, is_hidden: bool, is_below: bool) {
    let name = if object.name.is_empty() { object.mesh.1.as_str() } else { object.name.as_str() };
    let name = named("object", k, name);
    ui.horizontal(|ui| {
        if is_below {
            ui.add_space(ui.spacing().indent);
        }
        let mut is_shown = !is_hidden;
        let shown = ui.checkbox(&mut is_shown, "").on_hover_text("Whether it is in the scene");
        shown.widget_info(|| {
            egui::WidgetInfo::selected(egui::WidgetType::Checkbox, true, is_shown, format!("Show {name}"))
        });
        if shown.changed() {
            app.hide(k, !is_shown);
        }
        let text = egui::RichText::new(&name);
        let text = if is_hidden { text.weak() } else { text };
        let line = ui.add(Button::selectable(app.selected == Some(k), text).truncate());
        if line.double_clicked() {
            app.frame_object(k);
        } else if line.clicked() {
            app.select(Some(k));
        }
    });
}

/// The object that is selected: the values of its material, and what a click has met.
pub fn selection(app: &mut App, ui: &mut Ui) {
    let Some(k) = app.selected else {
        ui.weak("Click into the image or the list to select an object.");
        return;
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
