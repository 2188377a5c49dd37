//! Windows over the image: files, help.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::task::Poll;

use egui::{Align2, Context, Key, Ui};

use super::bake;
use crate::error::{Error, Result};
use crate::files::plan::FilePlan;
use crate::viewer::app::{App, Second};
use crate::viewer::baking::BakePlace;
use crate::viewer::browse::Browsing;
use crate::viewer::dialog::{Dialog, RenderWanted, RenderedMotion};
use crate::viewer::request::Task;

/// Keys and mouse, for the help window and docs/guide/viewer.md.
pub const CONTROLS: &[(&str, &str)] = &[
    ("Drag", "orbit around the pivot"),
    ("Shift + drag, middle drag", "move sideways and up"),
    ("Right drag", "look around; with Shift turn the environment"),
    ("Wheel, pinch", "come closer to what is under the pointer, go back"),
    ("W A S D, Q E", "fly forward, left, back, right, down and up (Shift: faster)"),
    ("Arrow keys", "orbit"),
    ("Click", "select what is under the pointer"),
    ("H, Shift + H", "hide what is selected, show it alone; once more: all"),
    ("Double click", "come closer to what is under the pointer, and orbit it"),
    ("F, Home", "frame the whole scene (Shift + F: what is selected), opening view"),
    ("Ctrl + 1, 3, 7", "view from the front, the right, the top (Shift: from the other side)"),
    ("Ctrl + 5", "perspective or parallel rays"),
    ("B", "keep the camera"),
    ("U", "turntable"),
    ("1 to 5", "fast, balanced, quality, path, converged AO"),
    ("X", "two images side by side, with a line to drag"),
    ("Space", "flicker: show the other image"),
    ("T", "compare with the truth"),
    ("P", "play or stop the animation"),
    ("N", "show or hide the panel"),
    ("F5", "pause rendering"),
    ("Ctrl+C", "copy the command that renders this view"),
    ("Ctrl+O, Ctrl+S, Ctrl+R, Ctrl+Q", "open, save, reload, quit"),
    ("Ctrl + plus, Ctrl + minus", "size of the text"),
    ("Tab, Enter", "go through all controls, use them"),
    ("?, Escape", "this help, close a window"),
];

/// Width of a window from which help has two columns, and of a column, points.
const TWO_COLUMNS: f32 = 1100.0;
const HELP_WIDTH: f32 = 510.0;
/// Greatest side of a render, pixels.
const MAX_RENDER_SIDE: u32 = 16_384;

/// Shows what is open.
pub fn show(app: &mut App, context: &Context) {
    if context.input(|i| i.key_pressed(Key::Escape)) {
        (app.dialog, app.shows_help) = (None, false);
    }

    // keys and mouse
    let mut open = app.shows_help;
    egui::Window::new("Keys and mouse")
        .open(&mut open)
        .collapsible(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .show(context, |ui| {
            // with large text the window is low and narrow
            let screen = context.content_rect();
            let height = (screen.height() - 80.0).clamp(100.0, 600.0);
            let columns = if screen.width() > TWO_COLUMNS { 2 } else { 1 };
            let rows = CONTROLS.len().div_ceil(columns);
            let width = HELP_WIDTH * columns as f32;
            ui.set_min_width(width.min(screen.width() - 60.0));
            egui::ScrollArea::both().max_height(height).show(ui, |ui| {
                egui::Grid::new("controls").num_columns(2 * columns).spacing([16.0, 6.0]).show(ui, |ui| {
                    for row in 0..rows {
                        for (input, effect) in CONTROLS.iter().skip(row).step_by(rows) {
                            ui.strong(*input);
                            ui.label(*effect);
                        }
                        ui.end_row();
                    }
                });
            });
        });
    app.shows_help = open;

    // a file that was chosen, and a dialog that is open
    if let Some(Poll::Ready(chosen)) = app.browsing.as_ref().map(Browsing::poll) {
        app.browsing = None;
        match chosen {
            Some(dialog) => {
                app.dialog = None;
                act(app, dialog);
            }
            // also where there is neither a portal nor zenity
            None => app.report("no file was chosen; a path can be typed", false),
        }
    }
    if let Some(dialog) = app.dialog.clone() {
        show_dialog(app, context, dialog);
    }
}

fn show_dialog(app: &mut App, context: &Context, mut dialog: Dialog) {
    let (title, label, action) = match &dialog {
        Dialog::Open(_) => {
            ("Open a scene", "A file (.gltf, .glb, .obj, .brhan), builtin:NAME, or an environment (.hdr, .exr)", "Open")
        }
        Dialog::Save(_) => ("Save the image", "A file: .png, .jpg or .webp as shown, .exr with all channels", "Save"),
        Dialog::LoadSettings(_) => ("Load settings", "A file of settings (.json)", "Load"),
        Dialog::SaveSettings(_) => ("Save settings", "A file of settings (.json)", "Save"),
        Dialog::Export(_) => ("Export the scene", "A file: .glb, .gltf", "Export"),
        Dialog::Render(..) => (
            "Render this view",
            "A file: .png, .exr, .jpg, .webp, .apng, .mp4, .webm, .gif or frames.####.png",
            "Render",
        ),
        Dialog::Bake(_, wanted) if wanted.place == BakePlace::Image => {
            ("Bake this scene", "A file: .png, .exr", "Bake")
        }
        Dialog::Bake(..) => ("Bake this scene", "A file: .glb, .gltf", "Bake"),
    };

    // its window: a path, and the action as a button
    let (mut open, mut done, mut browses, before) = (true, false, false, app.dialog.clone());
    let mut wants_preview = false;
    egui::Window::new(title)
        .open(&mut open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .show(context, |ui: &mut Ui| {
            let heading = ui.label(label);
            let edit =
                ui.add(egui::TextEdit::singleline(dialog.text_mut()).desired_width(420.0)).labelled_by(heading.id);
            if !edit.has_focus() && !edit.lost_focus() && ui.memory(|m| m.focused().is_none()) {
                edit.request_focus();
            }
            done = edit.lost_focus() && ui.input(|i| i.key_pressed(Key::Enter));
            if let Dialog::Render(_, wanted) = &mut dialog {
                render_numbers(app, ui, wanted);
            }
            if let Dialog::Bake(text, wanted) = &mut dialog {
                bake::numbers(app, ui, text, wanted);
                wants_preview = bake::preview(app, ui, wanted);
            }
            ui.horizontal(|ui| {
                done |= ui.button(action).clicked();
                ui.add_enabled_ui(app.browsing.is_none(), |ui| browses = ui.button("Browse…").clicked());
                if app.browsing.is_some() {
                    ui.label("choose in the window of the system");
                }
            });
        });

    // the system's dialog runs beside; its answer comes later
    if browses {
        let context = context.clone();
        app.browsing = Some(Browsing::start(dialog.clone(), move || context.request_repaint()));
    }

    if let Dialog::Bake(_, wanted) = &dialog
        && wants_preview
    {
        app.preview_bake(wanted);
    }
    if !open || done {
        app.bake_preview = None;
    }
    if !open {
        app.dialog = None;
    } else if done {
        app.dialog = None;
        act(app, dialog);
    } else if app.dialog == before {
        app.dialog = Some(dialog);
    }
}

/// Sizes that are offered beside that of the window, pixels.
const SIZES: [[u32; 2]; 4] = [[640, 360], [1280, 720], [1920, 1080], [3840, 2160]];

/// Size, samples and frames of a render.
fn render_numbers(app: &App, ui: &mut Ui, wanted: &mut RenderWanted) {
    let number = |ui: &mut Ui, label: &str, value: &mut u32, most: u32| {
        ui.horizontal(|ui| {
            let heading = ui.label(label);
            ui.add(egui::DragValue::new(value).range(1..=most)).labelled_by(heading.id);
        });
    };
    ui.horizontal(|ui| {
        let heading = ui.label("Size");
        let name = |[width, height]: [u32; 2]| format!("{width} x {height}");
        let list = egui::ComboBox::from_id_salt("size").selected_text(name(wanted.size)).show_ui(ui, |ui| {
            ui.selectable_value(&mut wanted.size, app.size(), format!("{} (this window)", name(app.size())));
            for size in SIZES {
                ui.selectable_value(&mut wanted.size, size, name(size));
            }
        });
        list.response.labelled_by(heading.id);
        for (side, label) in wanted.size.iter_mut().zip(["Width", "Height"]) {
            let response = ui.add(egui::DragValue::new(side).range(1..=MAX_RENDER_SIDE));
            response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::DragValue, true, label));
        }
    });
    if app.shown_settings().realtime_setting().is_none() {
        number(ui, "Samples per pixel", &mut wanted.spp, 1 << 20);
    }
    if wanted.motion == RenderedMotion::Turntable {
        number(ui, "Frames", &mut wanted.frames, 100_000);
    }
    if wanted.motion != RenderedMotion::Nothing {
        ui.horizontal(|ui| {
            let heading = ui.label("Frames per second");
            ui.add(egui::DragValue::new(&mut wanted.fps).range(1.0..=240.0)).labelled_by(heading.id);
        });
    }
}

fn act(app: &mut App, dialog: Dialog) {
    if let Dialog::Save(text)
    | Dialog::SaveSettings(text)
    | Dialog::Export(text)
    | Dialog::Render(text, _)
    | Dialog::Bake(text, _) = &dialog
        && let Some(scene) = &app.scene
    {
        let mut plan = FilePlan::default();
        plan.writes("what is saved", text.trim());
        if let Err(e) = plan.check_scene(&scene.files) {
            app.report(e.to_string(), true);
            return;
        }
    }
    match dialog {
        Dialog::Open(text) if text.trim().is_empty() => {}
        Dialog::Open(text) => app.open_file(text.trim()),
        Dialog::Save(text) if app.shows_second && app.second == Second::HeatMap => {
            save_heat_map(app, Path::new(text.trim()))
        }
        Dialog::Save(text) => {
            app.task(Task::Save { pane: usize::from(app.shows_second), path: PathBuf::from(text.trim()) })
        }
        Dialog::Export(text) => app.export(text.trim()),
        Dialog::Render(text, wanted) => app.render(text.trim(), &wanted),
        Dialog::Bake(text, wanted) => app.bake(text.trim(), &wanted),
        Dialog::LoadSettings(text) => match app.load_settings(Path::new(text.trim())) {
            Ok(()) => app.report(format!("loaded {}", text.trim()), false),
            Err(e) => app.report(e.to_string(), true),
        },
        Dialog::SaveSettings(text) => match save_settings(app, Path::new(text.trim())) {
            Ok(()) => app.report(format!("saved {}", text.trim()), false),
            Err(e) => app.report(e.to_string(), true),
        },
    }
}

/// The heat map is made of a comparison: the renderer has no image of it.
fn save_heat_map(app: &mut App, path: &Path) {
    let none = || Error::Usage("there is no comparison to save yet".into());
    match app.picture(true).ok_or_else(none).and_then(|picture| picture.save(path)) {
        Ok(()) => app.report(format!("saved {}", path.display()), false),
        Err(e) => app.report(e.to_string(), true),
    }
}

fn save_settings(app: &App, path: &Path) -> Result<()> {
    // without a scene there is no camera to say
    let settings = app
        .render_settings(RenderedMotion::Nothing)
        .or_else(|e| if app.control.is_none() { Ok(app.shown_settings()) } else { Err(e) })?;
    crate::files::write_atomically(path, |file| {
        let mut text = serde_json::to_vec_pretty(&settings)?;
        text.push(b'\n');
        file.write_all(&text)
    })
}
