//! The images, and the mouse and keys that move the camera.

use egui::{
    Align2, Color32, Context, CornerRadius, CursorIcon, FontId, Key, Modifiers, PointerButton, Pos2, Rect, Sense,
    Stroke, Ui, Vec2,
};

use super::hierarchy;
use super::menu::{self, shortcuts};
use crate::realtime::Preset;
use crate::stage;
use crate::viewer::app::{App, Arrangement};
use crate::viewer::camera::AxisView;
use crate::viewer::dialog::Dialog;
use crate::viewer::layer::Layer;
use crate::viewer::remembered::Hint;
use crate::viewer::request::{PickPurpose, Task};
use crate::viewer::technique::Technique;
use crate::viewer::theme;

/// Width of the line between two images that can be dragged, points.
const HANDLE: f32 = 10.0;
/// Smallest share of the width that an image has beside another.
const MIN_SHARE: f32 = 0.05;

/// Commands of single keys, and of keys with Ctrl.
pub fn keys(app: &mut App, context: &Context) {
    // shortcuts work while text is typed; plain keys do not
    for (shortcut, act) in [
        (shortcuts::OPEN, (|app: &mut App| app.dialog = Some(Dialog::Open(String::new()))) as fn(&mut App)),
        (shortcuts::RELOAD, |app| app.reload()),
        (shortcuts::SAVE, |app| app.dialog = Some(Dialog::Save(format!("{}.png", menu::stem(app))))),
        (shortcuts::QUIT, |app| app.closes = true),
    ] {
        if context.input_mut(|i| i.consume_shortcut(&shortcut)) {
            act(app);
        }
    }
    if context.wants_keyboard_input() || app.dialog.is_some() {
        return;
    }
    if context.input(|i| i.events.iter().any(|e| matches!(e, egui::Event::Copy))) {
        menu::copy_command(app);
    }

    // a widget that has the focus takes Space and arrows
    let is_free = context.memory(|m| m.focused().is_none());
    let pressed = |key| context.input(|i| i.key_pressed(key) && i.modifiers.matches_logically(Modifiers::NONE));

    // numbers choose techniques
    let light = |name: &str| name.parse().ok().map(Technique::Frames);
    let techniques = [
        (Key::Num1, Some(Technique::Preset(Preset::Fast))),
        (Key::Num2, Some(Technique::Preset(Preset::Balanced))),
        (Key::Num3, Some(Technique::Preset(Preset::Quality))),
        (Key::Num4, light("path")),
        (Key::Num5, Some(Technique::Converged)),
    ];
    for (key, technique) in techniques {
        if let (true, Some(technique)) = (pressed(key), technique) {
            app.first = technique;
            app.learn(Hint::Technique);
        }
    }

    // images and their comparison
    if pressed(Key::X) {
        menu::toggle_split(app);
    }
    if is_free && pressed(Key::Space) {
        menu::flicker(app);
    }
    if pressed(Key::T) {
        app.compares = !app.compares;
    }
    if pressed(Key::N) {
        app.shows_panel = !app.shows_panel;
    }

    // camera and time
    let shifted = |key| context.input(|i| i.key_pressed(key) && i.modifiers.shift_only());
    match app.selected {
        Some(selected) if shifted(Key::F) => app.frame(selected),
        Some(selected) if shifted(Key::H) && app.settings.scene.only.is_empty() => app.isolate(selected),
        _ if shifted(Key::H) => app.show_all_objects(),
        Some(selected) if pressed(Key::H) && !context.input(|i| i.modifiers.shift) => {
            let is_hidden = app.is_hidden(selected);
            app.hide(selected, !is_hidden);
        }
        _ if pressed(Key::F) => menu::frame_all(app),
        _ => {}
    }
    if pressed(Key::Home) {
        menu::open_view(app);
    }
    for (key, view, opposite) in [
        (Key::Num1, AxisView::Front, AxisView::Back),
        (Key::Num3, AxisView::Right, AxisView::Left),
        (Key::Num7, AxisView::Top, AxisView::Bottom),
    ] {
        if context.input_mut(|i| i.consume_key(Modifiers::COMMAND | Modifiers::SHIFT, key)) {
            menu::view_along(app, opposite);
        } else if context.input_mut(|i| i.consume_key(Modifiers::COMMAND, key)) {
            menu::view_along(app, view);
        }
    }
    if context.input_mut(|i| i.consume_key(Modifiers::COMMAND, Key::Num5)) {
        menu::change_projection(app);
    }
    if pressed(Key::B) {
        menu::keep_camera(app, context);
    }
    if pressed(Key::U) {
        app.turntable = if app.turntable == 0.0 { 0.5 } else { 0.0 };
    }
    if pressed(Key::F5) {
        app.is_paused = !app.is_paused;
    }
    if pressed(Key::P) {
        menu::play(app);
    }

    // help
    if context.input(|i| i.key_pressed(Key::Questionmark) || i.key_pressed(Key::F1)) {
        app.shows_help = !app.shows_help;
    }
    fly(app, context, is_free);
}

/// Keys that are held move the camera.
fn fly(app: &mut App, context: &Context, is_free: bool) {
    let (held, turned, seconds, faster) = context.input(|i| {
        let axis = |up: Key, down: Key| f64::from(i8::from(i.key_down(up)) - i8::from(i.key_down(down)));
        let free = !i.modifiers.command && !i.modifiers.alt;
        let held =
            [axis(Key::D, Key::A), axis(Key::E, Key::Q), axis(Key::W, Key::S)].map(|a| if free { a } else { 0.0 });
        let turned = [axis(Key::ArrowRight, Key::ArrowLeft), axis(Key::ArrowUp, Key::ArrowDown)];
        (held, turned, f64::from(i.stable_dt.min(0.1)), i.modifiers.shift)
    });
    let turned = if is_free { turned } else { [0.0; 2] };
    if held == [0.0; 3] && turned == [0.0; 2] {
        return;
    }
    app.leave_followed();
    if held != [0.0; 3] {
        app.ask_how_near();
    }
    let Some(control) = &mut app.control else { return };
    context.request_repaint();
    if held != [0.0; 3] {
        control.fly(held, seconds * if faster { 4.0 } else { 1.0 });
    }
    if turned != [0.0; 2] {
        control.orbit(turned[0] * 300.0 * seconds, -turned[1] * 300.0 * seconds);
    }
}

/// Shows the images and handles the mouse.
pub fn show(app: &mut App, ui: &mut Ui) {
    let rect = ui.available_rect_before_wrap();
    let scale = ui.ctx().pixels_per_point();
    let pixel = |x: f32| (x * scale).round() as i32;
    let area = [pixel(rect.left()), pixel(rect.top()), pixel(rect.right()), pixel(rect.bottom())];
    let size = [area[2] - area[0], area[3] - area[1]].map(|n| n.max(0) as u32);
    // a window that is minimised has no size: what was there stays
    if size[0] > 0 && size[1] > 0 {
        app.set_size(size);
    }
    let response = ui.interact(rect, ui.id().with("viewport"), Sense::click_and_drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Other, true, "Image"));
    mouse(app, ui, &response);
    let split = match app.arrangement {
        Arrangement::Split(share) => Some(divider(app, ui, rect, share)),
        Arrangement::Single => None,
    };
    let middle = split.map(pixel);
    let layer = |app: &mut App, is_second: bool, clip: [i32; 4]| {
        if let Some(picture) = app.picture(is_second) {
            app.add_layer(Layer { picture, area, clip });
        }
    };
    match middle {
        Some(x) => {
            layer(app, false, [area[0], area[1], x, area[3]]);
            layer(app, true, [x, area[1], area[2], area[3]]);
        }
        None => layer(app, app.shows_second, area),
    }
    hierarchy::overlay(app, ui, rect);
    outline(app, ui, rect, split);
    hierarchy::legend(app, ui, rect);
    titles(app, ui, rect, split);
    hints(app, ui, rect);
    notices(app, ui, rect);
}

/// A line around what is selected.
fn outline(app: &App, ui: &Ui, rect: Rect, split: Option<f32>) {
    let Some(outline) = app.outline() else { return };
    // the second image may be of another moment
    let right = split.unwrap_or(if app.shows_second { rect.left() } else { rect.right() });
    let painter = ui.painter().with_clip_rect(Rect::from_min_max(rect.min, Pos2::new(right, rect.bottom())));
    let at = |[x, y]: [f32; 2]| rect.min + rect.size() * Vec2::new(x, y);
    let accent = theme::accent(ui.ctx());
    for (width, colour) in [(3.5, Color32::from_black_alpha(110)), (1.8, accent)] {
        for line in &outline.lines {
            let points: Vec<Pos2> = line.iter().copied().map(at).collect();
            painter.add(egui::Shape::line(points, Stroke::new(width, colour)));
        }
    }
}

/// The line between two images; returns its position.
fn divider(app: &mut App, ui: &mut Ui, rect: Rect, share: f32) -> f32 {
    let x = rect.left() + share * rect.width();
    let handle = Rect::from_center_size(Pos2::new(x, rect.center().y), Vec2::new(HANDLE, rect.height()));
    let response =
        ui.interact(handle, ui.id().with("divider"), Sense::drag()).on_hover_cursor(CursorIcon::ResizeHorizontal);
    response.widget_info(|| egui::WidgetInfo::labeled(egui::WidgetType::Other, true, "Line between the images"));
    let mut share = share;
    if let (true, Some(pointer)) = (response.dragged(), response.interact_pointer_pos()) {
        share = ((pointer.x - rect.left()) / rect.width().max(1.0)).clamp(MIN_SHARE, 1.0 - MIN_SHARE);
        app.arrangement = Arrangement::Split(share);
    }
    let x = rect.left() + share * rect.width();
    let width = if response.hovered() || response.dragged() { 3.0 } else { 1.0 };
    // seen on white and on black
    for (width, grey) in [(width + 2.0, 40), (width, 230)] {
        let line = [Pos2::new(x, rect.top()), Pos2::new(x, rect.bottom())];
        ui.painter().line_segment(line, Stroke::new(width, Color32::from_gray(grey)));
    }
    x
}

fn mouse(app: &mut App, ui: &Ui, response: &egui::Response) {
    let delta = response.drag_delta();
    let (dx, dy) = (f64::from(delta.x), f64::from(delta.y));
    let shift = ui.input(|i| i.modifiers.shift);
    let (scroll, pinch) = if response.hovered() {
        ui.input(|i| (f64::from(i.smooth_scroll_delta.y), f64::from(i.zoom_delta())))
    } else {
        (0.0, 1.0)
    };
    if delta != Vec2::ZERO || scroll != 0.0 || pinch != 1.0 {
        app.leave_followed();
    }

    let learnt = [(delta != Vec2::ZERO, Hint::Orbit), (scroll != 0.0 || pinch != 1.0, Hint::Zoom)];
    learnt.iter().filter(|(is_done, _)| *is_done).for_each(|(_, hint)| app.learn(*hint));

    // drags and the wheel
    let Some(control) = &mut app.control else { return };
    let mut turned = 0.0;
    if delta != Vec2::ZERO {
        match () {
            () if response.dragged_by(PointerButton::Middle)
                || shift && response.dragged_by(PointerButton::Primary) =>
            {
                control.pan(dx, dy, f64::from(response.rect.height()));
            }
            () if shift && response.dragged_by(PointerButton::Secondary) => turned = 0.5 * dx,
            () if response.dragged_by(PointerButton::Secondary) => control.look(dx, dy),
            () if response.dragged_by(PointerButton::Primary) => control.orbit(-dx, dy),
            () => {}
        }
    }
    if scroll != 0.0 || pinch != 1.0 {
        let middle = response.rect.center();
        let pointer = response.hover_pos().unwrap_or(middle);
        let half = 0.5 * f64::from(response.rect.height()).max(1.0);
        let at = [f64::from(pointer.x - middle.x) / half, f64::from(middle.y - pointer.y) / half];
        control.zoom_at((-0.003 * scroll).exp() / pinch, at);
    }
    if turned != 0.0 && app.lighting.environment.is_some() {
        let turn = app.lighting.environment_turn.unwrap_or(0.0) + turned;
        app.lighting.environment_turn = Some((turn + 180.0).rem_euclid(360.0) - 180.0).filter(|turn| *turn != 0.0);
    }

    // clicks
    let at = response.interact_pointer_pos().map(|p| {
        let p = (p - response.rect.min) / response.rect.size();
        [f64::from(p.x), f64::from(p.y)]
    });
    if let Some(at) = at {
        if response.double_clicked() {
            app.task(Task::Pick { at, purpose: PickPurpose::Focus });
        } else if response.clicked() {
            app.remember_ray(at);
            app.task(Task::Pick { at, purpose: PickPurpose::Describe });
        }
    }
}

/// Names of the images, in their corners.
fn titles(app: &App, ui: &Ui, rect: Rect, split: Option<f32>) {
    let painter = ui.painter();
    let text = |at: Pos2, align: Align2, text: String| {
        let galley = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
        let place = align.anchor_size(at, galley.size());
        painter.rect_filled(place.expand(3.0), CornerRadius::same(3), Color32::from_black_alpha(150));
        painter.galley(place.min, galley, Color32::WHITE);
    };
    let title = |is_second: bool| {
        let name = app.title(is_second);
        if app.is_title_ahead(is_second) { format!("{name}: rendering …") } else { name }
    };
    let margin = Vec2::splat(10.0);
    match split {
        Some(x) => {
            text(rect.left_top() + margin, Align2::LEFT_TOP, title(false));
            text(Pos2::new(x, rect.top()) + margin, Align2::LEFT_TOP, title(true));
        }
        None => text(rect.left_top() + margin, Align2::LEFT_TOP, title(app.shows_second)),
    }
    if let Some(c) = &app.comparison {
        let (first, truth) = (app.first.label(), app.truth().label());
        let error = format!("{first} against {truth}: RMSE {:.4}, bias {:+.4}, FLIP {:.4}", c.rmse, c.bias, c.flip);
        text(rect.left_bottom() + Vec2::new(10.0, -10.0), Align2::LEFT_BOTTOM, error);
    }
}

/// Shows at the first time how to begin; each line goes once it has been done.
fn hints(app: &mut App, ui: &Ui, rect: Rect) {
    let Some(remembered) = app.remembered.as_mut().filter(|_| app.control.is_some()) else { return };
    let needed: Vec<Hint> = Hint::ALL.into_iter().filter(|hint| remembered.needs(*hint)).collect();
    if needed.is_empty() {
        return;
    }
    let mut is_done = false;
    egui::Area::new("hints".into()).fixed_pos(rect.left_top() + Vec2::new(10.0, 44.0)).show(ui.ctx(), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            egui::Grid::new("hints").num_columns(2).show(ui, |ui| {
                for hint in &needed {
                    let [input, effect] = hint.text();
                    ui.strong(input);
                    ui.label(effect);
                    ui.end_row();
                }
                ui.strong("?");
                ui.label("all keys");
                ui.end_row();
            });
            is_done = ui.button("Got it").clicked();
        });
    });
    if is_done {
        needed.into_iter().for_each(|hint| remembered.learn(hint));
    }
}

/// Shows what there is to say over the images: loading, errors, new messages.
fn notices(app: &mut App, ui: &mut Ui, rect: Rect) {
    // the state of loading and rendering, then what failed
    let mut lines: Vec<(String, bool)> = Vec::new();
    let is_loading = app.loading.is_some() || app.control.is_none() && app.source.is_some() && app.failure.is_none();
    let (mut share, mut is_waiting) = (None, is_loading);
    if let Some((text, part)) = &app.loading {
        lines.push((format!("{text} …"), false));
        share = *part;
    } else if is_loading {
        lines.push(("building acceleration structures and shaders …".into(), false));
    } else if app.is_paused && app.source.is_some() && app.picture(app.shows_second).is_none() {
        lines.push(("Rendering is paused: F5 resumes it.".into(), false));
    } else if app.source.is_some()
        && app.failure.is_none()
        && app.picture(app.shows_second).is_none()
        && app.error(app.shows_second).is_none()
    {
        lines.push(("rendering …".into(), false));
        is_waiting = true;
    }

    // a stage of it that takes long, and how much of that is done
    if let Some(stage) = stage::current().filter(|_| is_waiting) {
        lines.clear();
        lines.push(match &app.loading {
            Some((text, _)) => (format!("{text}: {} …", stage.name), false),
            None => (format!("{} …", stage.name), false),
        });
        share = stage.share.map(|share| share as f32).or(share);
    }
    if app.source.is_none() {
        lines.push((
            "Open a scene (Ctrl+O), drop a file here, or choose a built-in one in the menu File.".into(),
            false,
        ));
    }
    lines.extend(app.failure.iter().map(|t| (t.clone(), true)));
    lines.extend(app.error(app.shows_second).map(|t| (t.clone(), true)));
    if app.failure.is_none() {
        lines.extend(app.black(app.shows_second).map(|t| (t.clone(), false)));
        lines.extend(app.new_message().filter(|m| m.2).map(|m| (m.1.clone(), true)));
    }

    if lines.is_empty() {
        return;
    }
    if is_waiting {
        ui.ctx().request_repaint_after(std::time::Duration::from_millis(100));
    }

    // a box at the bottom, which may offer a remedy
    let width = (rect.width() - 40.0).clamp(120.0, 620.0);
    let (mut dialog_opened, mut cancelled) = (false, false);
    egui::Area::new("notices".into())
        .pivot(Align2::CENTER_BOTTOM)
        .fixed_pos(rect.center_bottom() - Vec2::new(0.0, 30.0))
        .show(ui.ctx(), |ui| {
            egui::Frame::popup(ui.style()).show(ui, |ui| {
                ui.set_max_width(width);
                for (text, is_error) in lines {
                    ui.horizontal_wrapped(|ui| {
                        if is_waiting && !is_error {
                            ui.spinner();
                        }
                        let text = egui::RichText::new(text);
                        ui.label(if is_error { text.color(ui.visuals().error_fg_color) } else { text });
                    });
                }
                if let Some(share) = share {
                    ui.add(egui::ProgressBar::new(share).desired_width(width.min(300.0)));
                }
                if app.can_cancel_loading() {
                    cancelled = ui.button("Cancel loading").clicked();
                }
                if app.source.is_none() {
                    dialog_opened = ui.button("Open…").clicked();
                }
            });
        });

    if cancelled {
        app.cancel_loading();
    }
    if dialog_opened {
        app.dialog = Some(Dialog::Open(String::new()));
    }
}
