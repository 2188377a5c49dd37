//! A benchmark of frames in real time as a plot: time of a frame against error, presets beside plain accumulation; how the error falls; time by number of bounces.

use super::host_line;
use super::panel::{Panel, Plot, Point, Series};
use crate::bench::record::cost::FrameCost;
use crate::bench::record::frames::{BouncesRecord, FrameErrors, FramesBenchmark, FramesView};

/// Name of the line at the reference's own error.
const REFERENCE: &str = "reference's own error";
/// What RMSE is of.
const RMSE: &str = "RMSE of the displayed image";

/// Everything that has a point.
pub fn plot(benchmark: &FramesBenchmark) -> Plot {
    let [width, height] = benchmark.size;
    let views = benchmark.views.iter().map(|v| view(v, benchmark.frames));
    let bounces = bounces(&benchmark.bounces).into_iter().collect();
    Plot {
        title: format!("Frames in real time, {}: run time against error", benchmark.integrator),
        subtitle: format!("{}; tracer {}, {width}x{height}", host_line(&benchmark.host), benchmark.tracer),
        groups: views.chain([bounces]).filter(|g: &Vec<Panel>| !g.is_empty()).collect(),
    }
}

/// Panels of a scene: the still camera, each motion, and how the error falls while frames add up.
pub fn view(view: &FramesView, frames: u32) -> Vec<Panel> {
    let mut panels = Vec::new();
    let still = view.still.iter().filter_map(|r| Some((r.preset.as_str(), &r.cost, r.curve.last()?)));
    let still = still.map(|(preset, cost, p)| (preset, cost, p.errors, p.plain.errors));
    panels.extend(pareto(
        format!("{}: still camera", view.scene),
        format!("Time of a frame, and error after {frames} frames."),
        still,
        view.reference_rmse,
    ));
    for m in &view.motions {
        let results = m.results.iter().map(|r| (r.preset.as_str(), &r.cost, r.errors, r.plain.errors));
        let caption = "Time of a frame, and error while something moves.".to_owned();
        panels.extend(pareto(format!("{}: {}", view.scene, m.motion), caption, results, m.reference_rmse));
    }
    let mut series = Vec::new();
    for r in &view.still {
        let ms = |frame: u32| f64::from(frame) * r.cost.wall_ms.median;
        series.push(Series::curve(&r.preset, r.curve.iter().map(|p| (ms(p.frame), p.errors.rmse).into())));
    }
    // of all presets the same curve: that of the longest time shows most of it
    let longest = view.still.iter().max_by(|a, b| a.cost.wall_ms.median.total_cmp(&b.cost.wall_ms.median));
    series.extend(longest.map(|r| {
        let ms = |frame: u32| f64::from(frame) * r.cost.wall_ms.median;
        Series::guide("plain accumulation", r.curve.iter().map(|p| (ms(p.frame), p.plain.errors.rmse)))
    }));
    if series.iter().any(|s| s.placed().next().is_some()) {
        let mut panel = Panel {
            title: format!("{}: error against time", view.scene),
            caption: "Median time of a frame times the number of frames; the camera stands still.".into(),
            x: "ms, all frames until then".into(),
            y: RMSE.into(),
            series,
        };
        panel.add_level(REFERENCE, view.reference_rmse);
        panels.push(panel);
    }
    panels
}

/// Presets, each with plain accumulation in the same time; `None` if there is none.
fn pareto<'a>(
    title: String,
    caption: String,
    results: impl Iterator<Item = (&'a str, &'a FrameCost, FrameErrors, FrameErrors)>,
    reference_rmse: f64,
) -> Option<Panel> {
    let mut panel = Panel { title, caption, x: "ms a frame".into(), y: RMSE.into(), series: Vec::new() };
    let (mut points, mut plain) = (Vec::new(), Vec::new());
    for (preset, cost, ours, theirs) in results {
        let ms = cost.wall_ms;
        let x_bar = (ms.count > 1 && ms.p5 > 0.0).then_some([ms.p5, ms.p95]);
        points.push((preset.to_owned(), Point { x_bar, ..Point::from((ms.median, ours.rmse_corrected)) }));
        plain.push((ms.median, theirs.rmse_corrected));
    }
    plain.sort_by(|a, b| a.0.total_cmp(&b.0));
    panel.add_pareto(points);
    let is_empty = panel.series.is_empty();
    panel.series.push(Series::guide("plain accumulation", plain));
    panel.add_level(REFERENCE, reference_rmse);
    (!is_empty).then_some(panel)
}

/// Time of a frame by number of bounces; `None` without any.
pub fn bounces(records: &[BouncesRecord]) -> Option<Panel> {
    let series =
        |b: &BouncesRecord| Series::curve(&b.scene, b.points.iter().map(|p| (f64::from(p.bounces), p.cost.ms()).into()));
    let series: Vec<Series> = records.iter().map(series).filter(|s| s.placed().next().is_some()).collect();
    (!series.is_empty()).then(|| Panel {
        title: "Bounces and time".into(),
        caption: "Time of a frame by the maximum number of bounces.".into(),
        x: "bounces".into(),
        y: "ms a frame".into(),
        series,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::frames::{BouncePoint, FramePoint, PlainImage, StillFrames};
    use crate::measure::stats::Percentiles;

    #[test]
    fn presets_beside_plain_accumulation() {
        let errors = |rmse: f64| FrameErrors { rmse, rmse_corrected: rmse, ..FrameErrors::default() };
        let cost = |ms: f64| FrameCost { wall_ms: Percentiles::from_values(&[ms]).unwrap(), ..FrameCost::default() };
        let point = |frame, rmse| FramePoint {
            frame,
            errors: errors(rmse),
            plain: PlainImage { paths: 1, errors: errors(2.0 * rmse) },
        };
        let still = |preset: &str, ms| StillFrames {
            preset: preset.into(),
            cost: cost(ms),
            curve: vec![point(1, 0.2), point(2, 0.1)],
            ..StillFrames::default()
        };
        let view =
            FramesView { scene: "a".into(), still: vec![still("fast", 1.0), still("quality", 4.0)], ..FramesView::default() };
        let points = vec![BouncePoint { bounces: 1, cost: cost(3.0), ..BouncePoint::default() }];
        let bounces = vec![BouncesRecord { scene: "b".into(), points, ..BouncesRecord::default() }];
        let plot = plot(&FramesBenchmark { views: vec![view], bounces, ..FramesBenchmark::default() });
        let titles: Vec<_> = plot.panels().map(|p| p.title.as_str()).collect();
        assert_eq!(titles, ["a: still camera", "a: error against time", "Bounces and time"]);
        let plain = plot.groups[0][0].series.iter().find(|s| s.name == "plain accumulation").unwrap();
        assert_eq!(plain.points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>(), [(1.0, 0.2), (4.0, 0.2)]);
        let curve = &plot.groups[0][1].series;
        assert_eq!(curve[2].points.iter().map(|p| p.x).collect::<Vec<_>>(), [4.0, 8.0]);
    }
}
