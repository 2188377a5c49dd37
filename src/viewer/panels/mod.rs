//! The user interface: menu, side panel, status line, the images themselves, and windows over them.

mod dialogs;
mod editor;
mod menu;
mod performance;
mod side;
mod status;
mod viewport;

use super::app::App;

/// A length with two significant digits.
pub fn round(x: f64) -> f64 {
    let digits = 1 - x.abs().max(1e-300).log10().floor() as i32;
    // decimal digits, not what is left of dividing by a power of ten
    format!("{x:.*}", digits.max(0) as usize)
        .parse()
        .map_or(x, |r| if digits >= 0 { r } else { (r / 10f64.powi(-digits)).round() * 10f64.powi(-digits) })
}

/// Shows everything, in the order in which it claims space.
pub fn show(app: &mut App, context: &egui::Context) {
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

#[cfg(test)]
mod tests {
    #[test]
    fn lengths_are_rounded_to_two_digits() {
        for (x, expected) in [(2.4531, 2.5), (0.034_49, 0.034), (1234.0, 1200.0), (99.9, 100.0), (5e-5, 5e-5)] {
            assert_eq!(super::round(x), expected);
        }
    }
}
