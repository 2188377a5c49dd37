//! A benchmark of path tracing as a plot: error against time, a panel a scene.

use super::host_line;
use super::panel::{Panel, Plot, Point, Series};
use super::pareto::dominated;
use crate::bench::record::path::{ContestantRecord, ErrorPoint, PathBenchmark, SceneRecord};

/// Every scene that has results.
pub fn plot(benchmark: &PathBenchmark) -> Plot {
    Plot {
        title: "Path tracing: error against time".into(),
        subtitle: format!("{}; tracer {}", host_line(&benchmark.host), benchmark.tracer),
        groups: benchmark.scenes.iter().filter_map(scene).map(|p| vec![p]).collect(),
    }
}

/// A curve a contestant, with the Pareto front over all of them; `None` without results.
pub fn scene(scene: &SceneRecord) -> Option<Panel> {
    let curves: Vec<Series> = scene.results.iter().map(curve).filter(|s| s.placed().next().is_some()).collect();
    let mut panel = Panel {
        title: format!("{}, {}x{}", scene.scene, scene.size[0], scene.size[1]),
        caption: "Time and error of an image, sample count by sample count. What is to the right of and above the front is dominated.".into(),
        x: "seconds an image".into(),
        y: "RMSE of radiance".into(),
        series: Vec::new(),
    };
    let points: Vec<[f64; 2]> = curves.iter().flat_map(|s| s.placed().map(|p| [p.x, p.y])).collect();
    let front = points.iter().zip(dominated(&points)).filter(|(_, is_dominated)| !is_dominated).map(|([x, y], _)| (*x, *y));
    let is_empty = curves.is_empty();
    // of one curve alone it says nothing
    if curves.len() > 1 {
        panel.add_front(front);
    }
    panel.series.extend(curves);
    for reference in scene.references.iter().filter(|r| r.rmse > 0.0) {
        // errors against references of several engines are in one panel
        let name = if scene.references.len() > 1 {
            format!("own error of {}'s reference", reference.engine)
        } else {
            "reference's own error".into()
        };
        panel.add_level(&name, reference.rmse);
    }
    (!is_empty).then_some(panel)
}

fn curve(result: &ContestantRecord) -> Series {
    let range = |values: &[f64]| {
        let (lo, hi) = values.iter().fold((f64::INFINITY, 0.0f64), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        (values.len() > 1 && lo > 0.0 && hi.is_finite()).then_some([lo, hi])
    };
    let point = |p: &ErrorPoint| {
        let seconds = p.seconds?;
        let x_bar = Some([seconds.min, seconds.max]).filter(|[lo, hi]| *lo > 0.0 && hi > lo);
        Some(Point { x_bar, y_bar: range(&p.rmse_repeats), ..Point::from((seconds.median, p.rmse)) })
    };
    Series::curve(&result.name, result.points.iter().filter_map(point))
}

#[cfg(test)]
mod tests {
    use super::super::panel::Mark;
    use super::*;
    use crate::bench::record::path::ReferenceRecord;
    use crate::measure::stats::Summary;

    #[test]
    fn a_panel_a_scene_with_its_front() {
        let point = |t: f64, rmse| ErrorPoint {
            seconds: Summary::from_values(&[t, 1.1 * t, 1.2 * t]),
            rmse,
            rmse_repeats: vec![0.9 * rmse, rmse, 1.2 * rmse],
            ..ErrorPoint::default()
        };
        let curve = |name: &str, scale: f64| ContestantRecord {
            name: name.into(),
            points: vec![point(1.0, scale), point(4.0, 0.5 * scale)],
            ..ContestantRecord::default()
        };
        let references = vec![ReferenceRecord { engine: "skylit".into(), rmse: 0.01, ..ReferenceRecord::default() }];
        let scene = SceneRecord {
            scene: "box".into(),
            results: vec![curve("mis", 1.0), curve("uniform", 8.0)],
            references,
            ..SceneRecord::default()
        };
        let empty = SceneRecord::default();
        let plot = plot(&PathBenchmark { scenes: vec![scene, empty], ..PathBenchmark::default() });
        assert_eq!(plot.groups.len(), 1);
        let series = &plot.groups[0][0].series;
        let marks: Vec<Mark> = series.iter().map(|s| s.mark).collect();
        assert_eq!(marks, [Mark::Front, Mark::Discs, Mark::Discs, Mark::Level]);
        assert_eq!(series[0].points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>(), [(1.1, 1.0), (4.4, 0.5)]);
        assert_eq!((series[1].points[0].x_bar, series[1].points[0].y_bar), (Some([1.0, 1.2]), Some([0.9, 1.2])));
    }
}
