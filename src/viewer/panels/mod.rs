//! The user interface: menu, side panel, status line, the images themselves, and windows over them.

mod bake;
mod dialogs;
mod editor;
mod hierarchy;
mod menu;
mod performance;
mod scene;
mod side;
mod slider;
mod status;
mod viewport;

pub(super) use menu::shortcuts;

use super::app::App;
use super::theme;

/// Runs a frame of the user interface: takes over what has happened, shows everything, requests
/// what has changed.
pub fn show_frame(app: &mut App, context: &egui::Context) {
    theme::apply(context);
    app.begin_frame(context);
    show(app, context);
    app.end_frame(context);
}

/// Shows everything, in the order in which it claims space.
fn show(app: &mut App, context: &egui::Context) {
    viewport::keys(app, context);
    egui::TopBottomPanel::top("menu").show(context, |ui| menu::show(app, ui));
    egui::TopBottomPanel::bottom("status").show(context, |ui| status::show(app, ui));
    if app.shows_panel {
        let most = (0.6 * context.content_rect().width()).max(240.0);
        egui::SidePanel::right("settings").default_width(300.0).min_width(240.0).max_width(most).show(context, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| side::show(app, ui));
        });
    }
    egui::CentralPanel::default().frame(egui::Frame::NONE).show(context, |ui| viewport::show(app, ui));
    dialogs::show(app, context);
}
