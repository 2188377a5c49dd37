//! The menu.

use egui::{Button, KeyboardShortcut, Ui};

use super::bake;
use crate::renderer::interactive::ViewPicture;
use crate::scene::{Projection, builtin};
use crate::viewer::app::{App, Arrangement};
use crate::viewer::camera::AxisView;
use crate::viewer::dialog::{Dialog, RenderedMotion};
use crate::viewer::request::Task;

/// Keys of the commands in menus.
pub mod shortcuts {
    use egui::{Key, KeyboardShortcut, Modifiers};

    /// Opens a scene.
    pub const OPEN: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::O);
    /// Loads the scene anew.
    pub const RELOAD: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::R);
    /// Saves the image.
    pub const SAVE: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::S);
    /// Closes the window.
    pub const QUIT: KeyboardShortcut = KeyboardShortcut::new(Modifiers::COMMAND, Key::Q);
}

fn item(ui: &mut Ui, text: &str, shortcut: Option<&KeyboardShortcut>, key: &str) -> bool {
    let mut button = Button::new(text);
    let text = shortcut.map_or_else(|| key.to_owned(), |s| ui.ctx().format_shortcut(s));
    if !text.is_empty() {
        button = button.shortcut_text(text);
    }
    let clicked = ui.add(button).clicked();
    if clicked {
        ui.close();
    }
    clicked
}

/// Base name for files of the scene.
pub fn stem(app: &App) -> String {
    let source = app.scene.as_ref().map_or("image", |s| s.source.as_str());
    let name = source.trim_start_matches("builtin:").replace(':', "-");
    std::path::Path::new(&name).file_stem().map_or_else(|| "image".into(), |s| s.to_string_lossy().into_owned())
}

/// Shows the menu.
pub fn show(app: &mut App, ui: &mut Ui) {
    egui::MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| file(app, ui));
        ui.menu_button("View", |ui| view(app, ui));
        ui.menu_button("Camera", |ui| camera(app, ui));
        ui.menu_button("Help", |ui| {
            if item(ui, "Keys and mouse", None, "?") {
                app.shows_help = true;
            }
        });
    });
}

fn file(app: &mut App, ui: &mut Ui) {
    // scenes
    if item(ui, "Open…", Some(&shortcuts::OPEN), "") {
        app.dialog = Some(Dialog::Open(String::new()));
    }
    let mut opened = None;
    ui.menu_button("Open recent", |ui| {
        for source in &app.recent {
            if item(ui, source, None, "") {
                opened = Some(source.clone());
            }
        }
    });
    ui.menu_button("Built-in scenes", |ui| {
        egui::ScrollArea::vertical().max_height(400.0).show(ui, |ui| {
            for info in builtin::names() {
                if item(ui, info.name, None, "") {
                    opened = Some(format!("builtin:{}", info.name));
                }
            }
        });
    });
    if let Some(source) = opened {
        app.open(&source);
    }
    if item(ui, "Reload", Some(&shortcuts::RELOAD), "") {
        app.reload();
    }
    ui.separator();

    // images of this view
    if item(ui, "Save image…", Some(&shortcuts::SAVE), "") {
        app.dialog = Some(Dialog::Save(format!("{}.png", stem(app))));
    }
    if item(ui, "Render this view…", None, "") {
        app.dialog = Some(render_dialog(app, "exr", RenderedMotion::Nothing));
    }
    ui.add_enabled_ui(app.shown_settings().realtime_setting().is_some(), |ui| {
        if item(ui, "Render a turntable…", None, "") {
            app.dialog = Some(render_dialog(app, "turntable.apng", RenderedMotion::Turntable));
        }
        ui.add_enabled_ui(app.playback.animation.is_some(), |ui| {
            if item(ui, "Render the animation…", None, "") {
                app.dialog = Some(render_dialog(app, "apng", RenderedMotion::Animation));
            }
        });
    });
    if cfg!(feature = "bake") {
        ui.add_enabled_ui(app.scene.is_some(), |ui| {
            if item(ui, "Bake…", None, "") {
                app.dialog = Some(bake::dialog(app));
            }
        });
    }
    if item(ui, "Copy the command that renders this view", None, "Ctrl+C") {
        copy_command(app);
    }
    ui.separator();

    // settings
    if item(ui, "Load settings…", None, "") {
        app.dialog = Some(Dialog::LoadSettings("settings.json".into()));
    }
    if item(ui, "Save settings…", None, "") {
        app.dialog = Some(Dialog::SaveSettings("settings.json".into()));
    }
    ui.separator();
    if item(ui, "Quit", Some(&shortcuts::QUIT), "") {
        app.closes = true;
    }
}

/// The dialog that asks for a render.
fn render_dialog(app: &App, extension: &str, motion: RenderedMotion) -> Dialog {
    Dialog::Render(format!("{}.{extension}", stem(app)), app.default_render(motion))
}

/// Puts the command that renders what is shown on the clipboard.
pub fn copy_command(app: &mut App) {
    match app.command() {
        Ok(command) => {
            app.report(format!("copied: {command}"), false);
            app.copied = Some(command);
        }
        Err(e) => app.report(e.to_string(), true),
    }
}

/// Switches between one image and two.
pub fn toggle_split(app: &mut App) {
    app.arrangement = match app.arrangement {
        Arrangement::Single => Arrangement::Split(0.5),
        Arrangement::Split(_) => Arrangement::Single,
    };
    app.shows_second = false;
}

fn view(app: &mut App, ui: &mut Ui) {
    if item(ui, "Split: one image or two", None, "X") {
        toggle_split(app);
    }
    if item(ui, "Flicker: show the other image", None, "Space") {
        flicker(app);
    }
    if item(ui, "Compare with the truth", None, "T") {
        app.compares = !app.compares;
    }
    if item(ui, "Pause rendering", None, "F5") {
        app.is_paused = !app.is_paused;
    }
    ui.separator();
    if item(ui, "Panel at the side", None, "N") {
        app.shows_panel = !app.shows_panel;
    }
    ui.menu_button("Theme", |ui| {
        let mut theme = ui.ctx().options(|o| o.theme_preference);
        let before = theme;
        for (choice, name) in [
            (egui::ThemePreference::System, "As the system"),
            (egui::ThemePreference::Dark, "Dark"),
            (egui::ThemePreference::Light, "Light"),
        ] {
            ui.radio_value(&mut theme, choice, name);
        }
        if theme != before {
            ui.ctx().set_theme(theme);
        }
    });
    ui.menu_button("Size of text", |ui| {
        for percent in [100u16, 125, 150, 200, 250, 300] {
            let factor = f32::from(percent) / 100.0;
            if ui.radio(ui.ctx().zoom_factor() == factor, format!("{percent} %")).clicked() {
                ui.ctx().set_zoom_factor(factor);
            }
        }
    });
}

fn camera(app: &mut App, ui: &mut Ui) {
    let Some(scene) = app.scene.clone() else {
        ui.label("no scene is loaded");
        return;
    };

    // views of the scene
    if item(ui, "Frame the whole scene", None, "F") {
        frame_all(app);
    }
    if item(ui, "Opening view", None, "Home") {
        open_view(app);
    }
    ui.menu_button("Along an axis", |ui| {
        let keys = ["Ctrl+1", "Ctrl+Shift+1", "Ctrl+3", "Ctrl+Shift+3", "Ctrl+7", "Ctrl+Shift+7"];
        for (view, key) in AxisView::ALL.into_iter().zip(keys) {
            if item(ui, view.label(), None, key) {
                view_along(app, view);
            }
        }
    });
    if item(ui, "Perspective / parallel rays", None, "Ctrl+5") {
        change_projection(app);
    }
    if item(ui, "Turntable", None, "U") {
        app.turntable = if app.turntable == 0.0 { 0.5 } else { 0.0 };
    }

    // cameras of the file, and those that were kept
    if !scene.cameras.is_empty() {
        ui.separator();
        for (k, camera) in scene.cameras.iter().enumerate() {
            let name = if camera.name.is_empty() { format!("Camera {k}") } else { camera.name.clone() };
            if item(ui, &name, None, "") {
                app.set_camera(camera.clone(), Some(k));
            }
        }
    }
    ui.separator();
    if item(ui, "Keep this camera", None, "B") {
        keep_camera(app, ui.ctx());
    }
    for (name, camera, picture) in app.bookmarks.clone() {
        let button = match &picture {
            Some(picture) => Button::image_and_text((picture.id(), picture.size_vec2()), &name),
            None => Button::new(&name),
        };
        if ui.add(button).clicked() {
            ui.close();
            app.set_camera(camera, None);
        }
    }
}

/// Size that a picture of a bookmark fits into, pixels.
const THUMBNAIL: [usize; 2] = [96, 64];

/// A picture, reduced to what fits into a menu: each pixel is the mean of those that it covers.
fn thumbnail(picture: &ViewPicture) -> Option<egui::ColorImage> {
    let [width, height] = picture.size.map(|n| n as usize);
    let factor = width.div_ceil(THUMBNAIL[0]).max(height.div_ceil(THUMBNAIL[1])).max(1);
    let size = [width / factor, height / factor];
    if size.contains(&0) || picture.rgba.len() < 4 * width * height {
        return None;
    }
    let mean = |k: usize| {
        let (x, y) = (k % size[0] * factor, k / size[0] * factor);
        let covered = (0..factor * factor).map(|i| 4 * ((y + i / factor) * width + x + i % factor));
        let mut sums = [0usize; 3];
        covered.for_each(|at| (0..3).for_each(|c| sums[c] += usize::from(picture.rgba[at + c])));
        let [r, g, b] = sums.map(|sum| (sum / (factor * factor)) as u8);
        egui::Color32::from_rgb(r, g, b)
    };
    Some(egui::ColorImage::new(size, (0..size[0] * size[1]).map(mean).collect()))
}

/// Keeps the camera as a bookmark, with a small picture of what it sees.
pub fn keep_camera(app: &mut App, context: &egui::Context) {
    if let Some(camera) = app.shown_camera() {
        let name = format!("Kept camera {}", app.bookmarks.len() + 1);
        let picture = app.picture(false).and_then(|picture| thumbnail(&picture));
        let picture = picture.map(|image| context.load_texture(&name, image, egui::TextureOptions::LINEAR));
        app.bookmarks.push((name.clone(), camera, picture));
        app.report(format!("{name}: in the menu Camera"), false);
    }
}

/// Returns to the camera at the beginning.
pub fn open_view(app: &mut App) {
    let Some(opening) = app.control.as_ref().map(|control| control.opening().clone()) else { return };
    let followed = app.scene.as_ref().and_then(|scene| scene.cameras.iter().position(|c| *c == opening));
    app.set_camera(opening, followed);
}

/// Changes between perspective and parallel rays.
pub fn change_projection(app: &mut App) {
    app.leave_followed();
    if let Some(control) = &mut app.control {
        let is_orthographic = matches!(control.camera().projection, Projection::Orthographic { .. });
        control.set_orthographic(!is_orthographic);
    }
}

/// Looks along an axis at what the camera looks at.
pub fn view_along(app: &mut App, view: AxisView) {
    app.leave_followed();
    app.control.iter_mut().for_each(|control| control.view(view));
}

/// Shows the other image; of two side by side that one alone.
pub fn flicker(app: &mut App) {
    app.shows_second = match app.arrangement {
        Arrangement::Single => !app.shows_second,
        Arrangement::Split(_) => true,
    };
    app.arrangement = Arrangement::Single;
}

/// Plays or stops the animation, the first one unless another is chosen.
pub fn play(app: &mut App) {
    let Some(scene) = &app.scene else { return };
    let playback = &mut app.playback;
    if playback.animation.is_none() && !scene.animations.is_empty() {
        (playback.animation, playback.time) = (Some(0), 0.0);
    }
    if let Some(animation) = playback.animation.and_then(|k| scene.animations.get(k)) {
        playback.toggle(animation.1);
    }
}

/// Moves the camera to where it sees the whole scene from outside; to another place if that shows
/// nothing.
pub fn frame_all(app: &mut App) {
    let [width, height] = app.size();
    if let Some(scene) = &app.scene {
        let (lo, hi) = scene.bounds;
        app.set_camera(crate::scene::Camera::framing(lo, hi, f64::from(width.max(1)) / f64::from(height.max(1))), None);
        app.task(Task::CheckView { frames: true });
    }
}
