//! Device time of passes over the last frames, as a stacked plot.

use egui::Ui;
use egui_plot::{Bar, BarChart, Legend, Plot};

use crate::measure::stats::{median, percentile};
use crate::viewer::app::App;

/// Shows plot and figures.
pub fn show(app: &App, ui: &mut Ui) {
    if app.frames.is_empty() {
        ui.label("no frame yet");
        return;
    }

    // the labels of passes are those of pipelines' steps: "ao_trace generate"; a pass is its first
    // word
    let pass = |label: &'static str| label.split(' ').next().unwrap_or(label);
    let mut passes: Vec<&str> = Vec::new();
    for timing in app.frames.iter().flat_map(|f| &f.step.timings) {
        if !passes.contains(&pass(timing.label)) {
            passes.push(pass(timing.label));
        }
    }

    // the time of each pass in each frame, stacked
    let mut charts: Vec<BarChart> = Vec::new();
    let mut rows = Vec::new();
    for name in passes {
        let of_frame = |f: &std::sync::Arc<crate::viewer::request::Progress>| -> f64 {
            1e3 * f.step.timings.iter().filter(|t| pass(t.label) == name).map(|t| t.seconds).sum::<f64>()
        };
        let ms: Vec<f64> = app.frames.iter().map(of_frame).collect();
        let bars = ms.iter().enumerate().map(|(k, v)| Bar::new(k as f64, *v).width(1.0)).collect();
        let chart = BarChart::new(name, bars).stack_on(&charts.iter().collect::<Vec<_>>());
        charts.push(chart);
        let ran: Vec<f64> = ms.iter().copied().filter(|v| *v > 0.0).collect();
        rows.push((name, median(&ran).unwrap_or(0.0), percentile(&ran, 0.95).unwrap_or(0.0)));
    }

    // the chart, and a table of the same passes
    Plot::new("device time")
        .height(140.0)
        .legend(Legend::default())
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show_x(false)
        .y_axis_label("ms")
        .include_y(0.0)
        .show(ui, |plot| charts.into_iter().for_each(|chart| plot.bar_chart(chart)));
    egui::Grid::new("passes").num_columns(3).striped(true).show(ui, |ui| {
        for heading in ["Pass", "Median, ms", "95 %, ms"] {
            ui.strong(heading);
        }
        ui.end_row();
        for (name, median, p95) in rows {
            ui.label(name);
            ui.label(format!("{median:.2}"));
            ui.label(format!("{p95:.2}"));
            ui.end_row();
        }
    });

    // totals
    let mib = app.device.bytes as f64 / f64::from(1 << 20);
    if let Some(figures) = app.figures() {
        ui.label(format!(
            "Frame: {:.1} ms, 95 %: {:.1} ms; {:.2} Mrays/s",
            figures.median,
            figures.p95,
            figures.rays_per_second * 1e-6
        ));
    }
    if let Some(last) = app.frames.back() {
        ui.label(format!("From input to image: {:.0} ms", 1e3 * last.latency.as_secs_f64()));
    }
    ui.label(format!("Scene on the device: {mib:.1} MiB, built in {:.2} s", app.device.build_seconds));
}
