//! A benchmark of real-time ambient occlusion as a plot: of each view, which presets are worth their time, and how their error falls while frames add up; then
//! what changes in scenes, and the series.

use super::host_line;
use super::panel::{Panel, Plot, Point, Series};
use crate::bench::record::ao::{
    AoBenchmark, ChangeRecord, SeriesLine, SeriesPoint, SeriesRecord, StillRecord, TechniqueRecord, ViewRecord,
};
use crate::bench::record::cost::FrameCost;
use crate::bench::record::without_reference;
use crate::measure::stats::Percentiles;

/// Name of the line at the reference's own error.
const REFERENCE: &str = "reference's own error";
/// What RMSE is of.
const RMSE: &str = "RMSE of ambient visibility";

/// Everything that has a curve.
pub fn plot(benchmark: &AoBenchmark) -> Plot {
    let views = benchmark.views.iter().map(|view| view_panels(view, benchmark.frames));
    let changes = benchmark.changes.iter().filter_map(change).collect();
    let series = benchmark.series.iter().map(series);
    let [width, height] = benchmark.size;
    Plot {
        title: "Real-time ambient occlusion: run time against error".into(),
        subtitle: format!("{}; tracer {}, {width}x{height}", host_line(&benchmark.host), benchmark.tracer),
        groups: views.chain([changes]).chain(series).filter(|g: &Vec<Panel>| !g.is_empty()).collect(),
    }
}

/// Panels of a view: a still camera, an orbiting one, error against the time and the rays that all frames took.
pub fn view_panels(view: &ViewRecord, frames: u32) -> Vec<Panel> {
    let title = format!("{}, {}", view.scene, view.view);
    let still = pareto(
        format!("{title}: still camera"),
        format!("Time of a frame with its camera rays, and error after {frames} frames of a still camera."),
        view.results.iter().filter_map(|r| Some((r.preset.clone(), still_point(r, view.reference_rmse)?))),
        view.reference_rmse,
    );
    let orbit_references = view.results.iter().find_map(|r| Some(r.moving.as_ref()?.reference_rmse));
    let orbit = pareto(
        format!("{title}: orbiting camera"),
        "Time of a frame and error while the camera goes round.".to_owned(),
        view.results.iter().filter_map(|r| Some((r.preset.clone(), orbit_point(r)?))),
        orbit_references.unwrap_or(f64::NAN),
    );
    let spent = "Median time of a frame times the number of frames; the camera stands still.";
    let time = curves(&format!("{title}: error against time"), spent, "ms, all frames until then", view, |still, frame| {
        (frame + 1) as f64 * still.cost.ms()
    });
    // a pixel that shows nothing gets no rays
    let covered = view.covered.max(1) as f64;
    let per_pixel = "Occlusion rays a pixel that shows something; the camera stands still.";
    let rays =
        curves(&format!("{title}: error against rays"), per_pixel, "occlusion rays a pixel, all frames until then", view, {
            |still, frame| still.rays.get(frame).map_or(f64::NAN, |r| *r as f64 / covered)
        });
    [still, orbit, time, rays].into_iter().flatten().collect()
}

/// A panel of presets; `None` if there is none.
fn pareto(title: String, caption: String, points: impl Iterator<Item = (String, Point)>, reference_rmse: f64) -> Option<Panel> {
    let mut panel = Panel { title, caption, x: "ms a frame".into(), y: RMSE.into(), series: Vec::new() };
    panel.add_pareto(points.collect());
    let is_empty = panel.series.is_empty();
    panel.add_level(REFERENCE, reference_rmse);
    (!is_empty).then_some(panel)
}

/// A preset under a still camera. Bars: the 5th to the 95th percentile of the frames that are timed, and of the errors of the same frames.
fn still_point(r: &TechniqueRecord, reference: f64) -> Option<Point> {
    let still = r.still.as_ref()?;
    let settled = still.settled()?;
    let corrected: Vec<f64> = still.timed_rmse().iter().map(|e| without_reference(*e, reference)).collect();
    let errors = Percentiles::from_values(&corrected).filter(|p| p.count > 1);
    // where the reference's error is all there is, the preset's own is at most what was measured
    let is_known = settled.errors.rmse_corrected > 0.0;
    let y = if is_known { settled.errors.rmse_corrected } else { settled.errors.rmse };
    let label = if is_known { r.preset.clone() } else { format!("{}: at most this", r.preset) };
    let y_bar = errors.map(|e| [e.p5.min(y), e.p95.max(y)]).filter(|bar| bar[0] > 0.0);
    let time = still.moving_cost.time();
    Some(Point { x: time.median, y, x_bar: bar(time), y_bar, label, is_dominated: false })
}

fn orbit_point(r: &TechniqueRecord) -> Option<Point> {
    let moving = r.moving.as_ref()?;
    let time = moving.cost.time();
    Some(Point { x_bar: bar(time), ..Point::from((time.median, moving.errors.rmse_corrected)) })
}

/// 5th to 95th percentile; `None` where there is only one value, or where a record of an earlier version does not say.
fn bar(p: Percentiles) -> Option<[f64; 2]> {
    (p.count > 1 && p.p5 > 0.0).then_some([p.p5, p.p95])
}

/// Error after each frame against what it took until then; `None` if no preset has that.
fn curves(title: &str, caption: &str, x: &str, view: &ViewRecord, spent: impl Fn(&StillRecord, usize) -> f64) -> Option<Panel> {
    let points = |s: &StillRecord| s.rmse.iter().enumerate().map(|(k, e)| Point::from((spent(s, k), *e))).collect::<Vec<_>>();
    let curve = |r: &TechniqueRecord| Some(Series::curve(&r.preset, points(r.still.as_ref()?)));
    let series: Vec<Series> = view.results.iter().filter_map(curve).filter(|s| s.placed().next().is_some()).collect();
    let is_empty = series.is_empty();
    let mut panel = Panel { title: title.into(), caption: caption.into(), x: x.into(), y: RMSE.into(), series };
    panel.add_level(REFERENCE, view.reference_rmse);
    (!is_empty).then_some(panel)
}

/// Error after something changed.
pub fn change(record: &ChangeRecord) -> Option<Panel> {
    let points = |e: &[f64]| e.iter().enumerate().map(|(k, e)| Point::from((k as f64 + 1.0, *e))).collect::<Vec<_>>();
    let series: Vec<Series> = record.results.iter().map(|r| Series::curve(&r.preset, points(&r.rmse))).collect();
    series.iter().any(|s| s.placed().next().is_some()).then(|| Panel {
        title: format!("{}: {}", record.scene, record.change),
        caption: "Error after the scene or the camera has changed.".into(),
        x: "frames since the change".into(),
        y: RMSE.into(),
        series,
    })
}

/// A series: time, error, and both against each other where there are both.
pub fn series(record: &SeriesRecord) -> Vec<Panel> {
    let x = match record.series.as_str() {
        "triangles" => "triangles and spheres",
        "rays" => "rays a pixel",
        "resolution" => "pixels",
        _ => "frames",
    };
    let panel = |what: &str, y: &str, of: &dyn Fn(&SeriesPoint) -> Option<Point>| {
        let line = |l: &SeriesLine| Series::curve(&l.name, l.points.iter().filter_map(of));
        let series: Vec<Series> = record.lines.iter().map(line).filter(|s| s.placed().next().is_some()).collect();
        let title = format!("{}: {what}, {}", record.series, record.scene);
        let caption = format!("{} varied, everything else as it is.", record.series);
        (!series.is_empty()).then(|| Panel { title, caption, x: x.into(), y: y.into(), series })
    };
    let cost = |p: &SeriesPoint| p.cost.as_ref().map(FrameCost::time).filter(|t| t.median > 0.0);
    let time = |p: &SeriesPoint| cost(p).map(|t| Point { x_bar: None, y_bar: bar(t), ..Point::from((p.x, t.median)) });
    let against = |p: &SeriesPoint| {
        let t = cost(p)?;
        let label = format!("{} {}", p.x, if p.x == 1.0 { "ray" } else { "rays" });
        Some(Point { x_bar: bar(t), label, ..Point::from((t.median, p.rmse?)) })
    };
    // along frames, errors alone change
    let is_over_frames = record.series == "sampling";
    let time_panel = if is_over_frames { None } else { panel("time of a frame", "ms a frame", &time) };
    let error = panel(if is_over_frames { "error" } else { "settled error" }, RMSE, &|p| Some((p.x, p.rmse?).into()));
    let before = panel("error before the filter", RMSE, &|p| Some((p.x, p.unfiltered_rmse?).into()));
    // of rays alone every point has both
    let both = if record.series == "rays" { panel("error against time", RMSE, &against) } else { None };
    let both = both.map(|p| Panel { x: "ms a frame".into(), ..p });
    [time_panel, error, before, both].into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::super::panel::Mark;
    use super::*;
    use crate::bench::record::ao::{ErrorPoint, ImageErrors, OrbitRecord};

    fn technique(preset: &str, ms: f64, rmse: f64) -> TechniqueRecord {
        let times = Percentiles { median: ms, p5: 0.9 * ms, p25: 0.95 * ms, p75: 1.05 * ms, p95: 1.2 * ms, count: 32 };
        let cost = FrameCost { device_ms: times, ..FrameCost::default() };
        let errors = ImageErrors { rmse: rmse.hypot(0.01), rmse_corrected: rmse, ..ImageErrors::default() };
        let still = StillRecord {
            cost: cost.clone(),
            moving_cost: cost.clone(),
            curve: vec![ErrorPoint { frame: 4, errors, ..ErrorPoint::default() }],
            rmse: [4.0, 2.0, 1.1, 1.0].map(|k| (k * rmse).hypot(0.01)).into(),
            rays: vec![100, 200, 300, 400],
        };
        let moving = OrbitRecord { cost, errors, reference_rmse: 0.02, ..OrbitRecord::default() };
        TechniqueRecord { preset: preset.into(), still: Some(still), moving: Some(moving), ..TechniqueRecord::default() }
    }

    fn benchmark() -> AoBenchmark {
        let results = vec![technique("larsen", 40.0, 0.2), technique("fast", 5.0, 0.1), technique("quality", 20.0, 0.03)];
        let view = ViewRecord {
            scene: "stairs".into(),
            view: "near".into(),
            covered: 100,
            reference_rmse: 0.01,
            results,
            ..ViewRecord::default()
        };
        AoBenchmark { views: vec![view], frames: 4, size: [8, 4], ..AoBenchmark::default() }
    }

    #[test]
    fn run_time_against_error() {
        let plot = plot(&benchmark());
        let titles: Vec<&str> = plot.panels().map(|p| p.title.as_str()).collect();
        let expected = ["still camera", "orbiting camera", "error against time", "error against rays"];
        assert!(titles.iter().zip(expected).all(|(t, e)| t.starts_with("stairs, near: ") && t.ends_with(e)), "{titles:?}");
        let still = &plot.groups[0][0];
        let of = |name: &str| still.series.iter().find(|s| s.name == name).unwrap();
        assert_eq!((of("fast").points[0].x, of("fast").points[0].y), (5.0, 0.1));
        assert!(of("larsen").points[0].is_dominated && !of("quality").points[0].is_dominated);
        assert_eq!((of("fast").points[0].x_bar, of("fast").mark), (Some([4.5, 6.0]), Mark::Labelled));
        // of the second half of the frames
        let [lo, hi] = of("fast").points[0].y_bar.unwrap();
        assert!((lo - 0.1).abs() < 1e-9 && (hi - 0.11).abs() < 1e-9, "{lo} {hi}");
        assert_eq!(of(REFERENCE).points[0].y, 0.01);
        let orbit = plot.groups[0][1].series.iter().find(|s| s.name == REFERENCE).unwrap();
        assert_eq!(orbit.points[0].y, 0.02);
        let time = &plot.groups[0][2].series[1];
        assert_eq!(time.points.iter().map(|p| p.x).collect::<Vec<_>>(), [5.0, 10.0, 15.0, 20.0]);
        assert_eq!(plot.groups[0][3].series[0].points[3].x, 4.0);
    }

    #[test]
    fn an_error_below_the_references_has_a_place() {
        let mut benchmark = benchmark();
        let still = benchmark.views[0].results[2].still.as_mut().unwrap();
        still.curve[0].errors = ImageErrors { rmse: 0.008, rmse_corrected: 0.0, ..ImageErrors::default() };
        let panel = &view_panels(&benchmark.views[0], 4)[0];
        let point = &panel.series.iter().find(|s| s.name == "quality").unwrap().points[0];
        assert_eq!((point.y, point.label.as_str()), (0.008, "quality: at most this"));
    }

    #[test]
    fn what_was_not_measured_has_no_panel() {
        let mut benchmark = benchmark();
        benchmark.views[0].results.iter_mut().for_each(|r| r.moving = None);
        assert_eq!(plot(&benchmark).panels().count(), 3);
        assert_eq!(plot(&AoBenchmark::default()).panels().count(), 0);
        let point = |x: f64, rmse| SeriesPoint {
            x,
            rmse,
            cost: Some(FrameCost { wall_ms: Percentiles::from_values(&[x]).unwrap(), ..FrameCost::default() }),
            ..SeriesPoint::default()
        };
        let of = |name: &str, rmse| {
            let lines = vec![SeriesLine { name: "fast".into(), points: vec![point(1.0, rmse), point(2.0, rmse)] }];
            series(&SeriesRecord { series: name.into(), scene: "near".into(), lines })
        };
        assert_eq!(of("resolution", None).len(), 1);
        let rays = of("rays", Some(0.5));
        assert_eq!(rays.iter().map(|p| p.x.as_str()).collect::<Vec<_>>(), ["rays a pixel", "rays a pixel", "ms a frame"]);
    }
}
