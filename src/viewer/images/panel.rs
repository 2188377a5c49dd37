//! The controls of images, and the mouse and keys.

use egui::{CentralPanel, ComboBox, Context, Key, Modifiers, PointerButton, Sense, Slider, SliderClamping, Ui};

use super::{Content, Images};
use crate::interface::ToneMap;
use crate::output;
use crate::viewer::panels::shortcuts;

/// Steps of the zoom by keys.
const ZOOM_STEP: f32 = 2.0;

/// Shows everything, in the order in which it claims space.
pub(super) fn show(app: &mut Images, context: &Context) {
    keys(app, context);
    egui::TopBottomPanel::top("images").show(context, |ui| {
        ui.horizontal(|ui| choice(app, ui));
        ui.horizontal(|ui| look(app, ui));
    });
    egui::TopBottomPanel::bottom("values").show(context, |ui| values(app, ui));
    CentralPanel::default().frame(egui::Frame::NONE).show(context, |ui| viewport(app, ui));
}

fn keys(app: &mut Images, context: &Context) {
    if context.input_mut(|i| i.consume_shortcut(&shortcuts::QUIT)) {
        app.closes = true;
    }
    if context.wants_keyboard_input() {
        return;
    }
    let pressed = |key| context.input(|i| i.key_pressed(key) && i.modifiers.matches_logically(Modifiers::NONE));

    // which image
    let numbers = [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8, Key::Num9];
    for (k, key) in numbers.into_iter().enumerate() {
        if pressed(key) && k < app.images.len() {
            app.show(k);
        }
    }
    let is_free = context.memory(|m| m.focused().is_none());
    if is_free && pressed(Key::Space) {
        let other = if app.shown == app.reference { (app.shown + 1) % app.images.len() } else { app.reference };
        app.reference = app.shown;
        app.show(other);
    }

    // what of it, and how bright
    for (key, content) in [(Key::D, Content::Difference), (Key::L, Content::Flip)] {
        if pressed(key) {
            app.content = if app.content == content { Content::Image } else { content };
        }
    }
    for (key, stops) in [(Key::Plus, 0.5), (Key::Equals, 0.5), (Key::Minus, -0.5)] {
        if pressed(key) {
            app.look.exposure += stops;
        }
    }
    if pressed(Key::Num0) {
        app.look.exposure = 0.0;
    }

    // how large
    if pressed(Key::F) || pressed(Key::Home) {
        app.zoom = 0.0;
    }
}

/// The image, the one that it is compared with, and what of them is shown.
fn choice(app: &mut Images, ui: &mut Ui) {
    let name = |app: &Images, k: usize| {
        let path = &app.images[k].path;
        format!("{} {}", k + 1, path.file_name().unwrap_or_default().to_string_lossy())
    };
    let (mut shown, mut reference) = (app.shown, app.reference);
    let list = |ui: &mut Ui, label: &str, chosen: &mut usize| {
        let heading = ui.label(label);
        let list = ComboBox::from_id_salt(label).selected_text(name(app, *chosen)).show_ui(ui, |ui| {
            for k in 0..app.images.len() {
                ui.selectable_value(chosen, k, name(app, k));
            }
        });
        list.response.labelled_by(heading.id);
    };
    list(ui, "Image", &mut shown);
    if app.images.len() > 1 {
        list(ui, "Reference", &mut reference);
    }
    if shown != app.shown {
        app.show(shown);
    }
    app.reference = reference;
    if app.images.len() > 1 {
        let contents = [("Image", Content::Image), ("Difference", Content::Difference), ("FLIP", Content::Flip)];
        for (label, content) in contents {
            ui.selectable_value(&mut app.content, content, label);
        }
    }
}

/// A layer, how its values become colours, and how large they are.
fn look(app: &mut Images, ui: &mut Ui) {
    let names: Vec<String> = output::layers::names(app.image()).into_iter().map(str::to_owned).collect();
    let has_colours = output::layers::colour_planes(app.image()).is_some();
    let heading = ui.label("Layer");
    let label = |layer: &str| if layer.is_empty() { "colours".to_owned() } else { layer.to_owned() };
    let list = ComboBox::from_id_salt("layer").selected_text(label(&app.look.layer)).show_ui(ui, |ui| {
        for layer in has_colours.then(String::new).into_iter().chain(names) {
            let text = label(&layer);
            ui.selectable_value(&mut app.look.layer, layer, text);
        }
    });
    list.response.labelled_by(heading.id);
    let heading = ui.label("Exposure");
    let slider = Slider::new(&mut app.look.exposure, -10.0..=10.0).clamping(SliderClamping::Edits).suffix(" EV");
    ui.add(slider).labelled_by(heading.id);
    let heading = ui.label("Tone map");
    let list = ComboBox::from_id_salt("tone map").selected_text(app.look.tone_map.name()).show_ui(ui, |ui| {
        for tone_map in ToneMap::ALL {
            ui.selectable_value(&mut app.look.tone_map, tone_map, tone_map.name()).on_hover_text(tone_map.help());
        }
    });
    list.response.labelled_by(heading.id);
    ui.separator();

    // how large
    if ui.button("Fit").on_hover_text("As large as the window allows (F)").clicked() {
        app.zoom = 0.0;
    }
    if ui.button("1:1").on_hover_text("A pixel of the image is one of the screen").clicked() {
        app.middle = app.centre();
        app.zoom = 1.0;
    }
}

/// The values under the pointer, and how far the images are apart.
fn values(app: &mut Images, ui: &mut Ui) {
    if let Some(message) = &app.message {
        ui.colored_label(ui.visuals().error_fg_color, message);
    }
    ui.horizontal_wrapped(|ui| {
        let image = app.image();
        ui.label(format!("{} x {}", image.width, image.height));
        if let Some([x, y]) = app.pixel {
            ui.monospace(format!("({x}, {y})"));
            ui.monospace(app.values(app.shown).unwrap_or_default());
            if app.shown != app.reference
                && let Some(values) = app.values(app.reference)
            {
                ui.monospace(format!("| {values}"));
            }
        }
    });
    match app.comparison() {
        Some(Ok(c)) => {
            let flip = c.flip.map_or(String::new(), |flip| format!(", FLIP {flip:.4}"));
            ui.label(format!("against the reference: RMSE {:.3e}, bias {:+.3e}{flip}", c.rmse, c.bias));
        }
        Some(Err(e)) => {
            ui.label(e);
        }
        None if app.is_comparing() => {
            ui.label("comparing with the reference …");
        }
        None => {}
    }
    ui.weak("1 to 9: image   Space: the other one   D: difference   L: FLIP   + and -: exposure   F: fit   wheel: zoom   drag: move");
}

fn viewport(app: &mut Images, ui: &mut Ui) {
    let rect = ui.available_rect_before_wrap();
    let scale = ui.ctx().pixels_per_point();
    let response = ui.interact(rect, ui.id().with("viewport"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Other, true, "Image"));

    // drags move the image, the wheel enlarges it about the pointer
    if response.dragged_by(PointerButton::Primary) || response.dragged_by(PointerButton::Middle) {
        let (zoom, middle) = (app.scale(rect, scale), app.centre());
        app.zoom = zoom;
        app.middle = middle - response.drag_delta() * scale / zoom;
    }
    let (scroll, pinch) =
        if response.hovered() { ui.input(|i| (i.smooth_scroll_delta.y, i.zoom_delta())) } else { (0.0, 1.0) };
    if let (true, Some(pointer)) = (scroll != 0.0 || pinch != 1.0, response.hover_pos()) {
        let (before, point) = (app.scale(rect, scale), app.point_at(pointer, rect, scale));
        let centre = app.centre();
        let most = 64.0 * ZOOM_STEP;
        let zoom = (before * (0.003 * scroll).exp() * pinch).clamp(1e-3, most);
        app.middle = point + (centre - point) * before / zoom;
        app.zoom = zoom;
    }

    // what is under the pointer
    let image = app.image();
    let (width, height) = (image.width, image.height);
    app.pixel = response.hover_pos().map(|pointer| app.point_at(pointer, rect, scale)).and_then(|p| {
        let is_inside = p.x >= 0.0 && p.y >= 0.0 && p.x < width as f32 && p.y < height as f32;
        is_inside.then_some([p.x as u32, p.y as u32])
    });
    app.place(rect, scale);
}
