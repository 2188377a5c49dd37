//! The line at the bottom: what is rendered, how fast, and the last message.

use egui::Ui;

use crate::viewer::app::App;

/// Shows the line.
pub fn show(app: &mut App, ui: &mut Ui) {
    ui.horizontal(|ui| {
        // the first image and its figures
        if let Some(progress) = &app.panes[0].progress {
            let [w, h] = progress.picture.size;
            let full = app.size();
            let scale = if [w, h] == full { String::new() } else { format!(" of {}x{}", full[0], full[1]) };
            ui.label(format!("{w}x{h}{scale}"))
                .on_hover_text("Resolution of the image: reduced while something moves, to hold the frame rate");
            ui.separator();
            let state = if progress.step.is_settled { "settled" } else { "converging" };
            ui.label(format!("{} samples, {state}", progress.step.samples))
                .on_hover_text("Samples per pixel since the camera came to rest, or those of the history");
            ui.separator();
        }
        if let Some(figures) = app.figures() {
            ui.label(format!("{:.0} ms (95 %: {:.0})", figures.median, figures.p95))
                .on_hover_text("Time of a frame: median and 95th percentile");
            ui.separator();
            ui.label(format!("{:.1} Mrays/s", figures.rays_per_second * 1e-6))
                .on_hover_text("Rays per second of the first image");
            ui.separator();
        }
        if let Some(comparison) = &app.comparison {
            ui.label(format!(
                "RMSE {:.4}, FLIP {:.4} against {}",
                comparison.rmse,
                comparison.flip,
                app.truth().label()
            ))
            .on_hover_text("Error against the truth");
            ui.separator();
        }

        // what goes on beside, and the last message
        if app.is_paused {
            ui.strong("paused");
            ui.separator();
        }
        for render in &mut app.renders {
            let (share, rest) = render.progress().unwrap_or_default();
            let bar = egui::ProgressBar::new(share).desired_width(80.0).show_percentage();
            ui.add(bar);
            ui.label(&render.output).on_hover_text(format!("{} {} {rest}", render.verbs()[0], render.output));
            if ui.small_button("✖").on_hover_text(format!("Cancel {}", render.output)).clicked() {
                render.cancel();
            }
            ui.separator();
        }
        if let Some((_, text, is_error)) = app.messages.front() {
            let text = egui::RichText::new(text);
            let text = if *is_error { text.color(ui.visuals().warn_fg_color) } else { text };
            ui.add(egui::Label::new(text).truncate());
        }
    });
}
