//! A benchmark of real-time ambient occlusion, drawn: the error of each view against the rays that were traced for it, and the
//! series against what varies in them. All axes are logarithmic.

use super::chart::{self, Line, Panel, Picture};
use crate::bench::record::ao::{AoBenchmark, FrameCost, SeriesPoint, SeriesRecord, StillRecord, ViewRecord};
use crate::error::Result;

/// Draws everything that has a curve.
///
/// # Errors
/// [`crate::Error::Usage`] when nothing has.
pub fn draw(benchmark: &AoBenchmark) -> Result<Picture> {
    let views = benchmark.views.iter().filter_map(view);
    let changes = benchmark.changes.iter().filter(|c| c.results.iter().any(|r| !r.rmse.is_empty())).map(|c| Panel {
        title: format!("{}: {}", c.scene, c.change),
        x: "frames since".into(),
        y: "RMSE".into(),
        lines: c
            .results
            .iter()
            .map(|r| Line {
                name: r.preset.clone(),
                points: r.rmse.iter().enumerate().map(|(k, e)| (k as f64 + 1.0, *e)).collect(),
            })
            .collect(),
    });
    let panels: Vec<Panel> = views.chain(changes).chain(benchmark.series.iter().flat_map(series)).collect();
    let [width, height] = benchmark.size;
    let subtitle =
        format!("{} ({}), tracer {}, {width}x{height}", benchmark.host.device, benchmark.host.driver, benchmark.tracer);
    chart::draw("Real-time ambient occlusion", &subtitle, &panels)
}

fn view(view: &ViewRecord) -> Option<Panel> {
    // a pixel that shows nothing gets no rays
    let covered = view.covered.max(1) as f64;
    let points = |s: &StillRecord| s.rays.iter().zip(&s.rmse).map(|(r, e)| (*r as f64 / covered, *e)).collect();
    let line = |(name, still)| Line { name, points: points(still) };
    let lines: Vec<Line> = view.results.iter().filter_map(|r| Some((r.preset.clone(), r.still.as_ref()?))).map(line).collect();
    (!lines.is_empty()).then(|| Panel {
        title: format!("{}, {}", view.scene, view.view),
        x: "occlusion rays a pixel, all frames".into(),
        y: "RMSE".into(),
        lines,
    })
}

/// Time, and error where there is one.
fn series(record: &SeriesRecord) -> Vec<Panel> {
    let x = match record.series.as_str() {
        "triangles" => "triangles",
        "rays" => "rays a pixel",
        "resolution" => "pixels",
        _ => "frames",
    };
    let panel = |what: &str, y: &str, of: &dyn Fn(&SeriesPoint) -> Option<f64>| {
        let line = |l: &crate::bench::record::ao::SeriesLine| Line {
            name: l.name.clone(),
            points: l.points.iter().filter_map(|p| Some((p.x, of(p)?))).collect(),
        };
        let lines: Vec<Line> = record.lines.iter().map(line).filter(|l| !l.points.is_empty()).collect();
        let title = format!("{}: {what}, {}", record.series, record.scene);
        (!lines.is_empty()).then(|| Panel { title, x: x.into(), y: y.into(), lines })
    };
    let time = panel("time", "ms a frame", &|p| p.cost.as_ref().map(FrameCost::ms));
    let error = panel("error", "RMSE", &|p| p.rmse);
    let before = panel("before the filter", "RMSE", &|p| p.unfiltered_rmse);
    [time, error, before].into_iter().flatten().collect()
}
