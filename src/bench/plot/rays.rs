//! A benchmark of ray tracing as a plot: rates against the number of triangles, a panel a stream.

use super::host_line;
use super::panel::{Mark, Panel, Plot, Point, Series};
use crate::bench::record::rays::{RayBenchmark, family};
use crate::measure::stats::Summary;

/// Name of the dashed line.
const LOG_LAW: &str = "as 1 / log n";
/// Points of the dashed line.
const LOG_LAW_POINTS: u32 = 64;

/// All results. Scenes of a family (`terrain:N`) are joined by lines: discs for the first family, triangles for the second, crosses for others; scenes without
/// a family are circles. The dashed line falls as 1 / log n from the first point of the first contestant.
pub fn plot(benchmark: &RayBenchmark) -> Plot {
    let mut streams: Vec<&str> = Vec::new();
    for (_, stream, _) in benchmark.rows() {
        if !streams.contains(&stream.stream.as_str()) {
            streams.push(&stream.stream);
        }
    }
    Plot {
        title: "Ray tracing: rate against scene size".into(),
        subtitle: host_line(&benchmark.host),
        groups: streams.into_iter().map(|s| vec![stream(benchmark, s)]).collect(),
    }
}

/// One stream of rays.
pub fn stream(benchmark: &RayBenchmark, stream: &str) -> Panel {
    let here = || benchmark.rows().filter(|(_, t, _)| t.stream == stream);
    // in the order of the scenes: each has its mark
    let mut families: Vec<&str> = Vec::new();
    for name in benchmark.scenes.iter().filter_map(|s| family(&s.scene)) {
        if !families.contains(&name) {
            families.push(name);
        }
    }
    let mut series: Vec<(Option<&str>, Series)> = Vec::new();
    for (scene, _, run) in here() {
        let of = family(&scene.scene);
        let Summary { median, min, max } = run.device;
        // from the slowest repeat to the fastest
        let y_bar = Some([min, max]).filter(|_| min > 0.0 && max > min && max.is_finite());
        let point = Point { y_bar, ..Point::from((scene.primitives().max(1) as f64, median)) };
        match series.iter_mut().find(|(f, s)| *f == of && s.name == run.contestant) {
            Some((_, s)) => s.points.push(point),
            None => {
                let mark = match of.and_then(|f| families.iter().position(|g| *g == f)) {
                    None => Mark::Circles,
                    Some(0) => Mark::Discs,
                    Some(1) => Mark::Triangles,
                    Some(_) => Mark::Crosses,
                };
                series.push((of, Series { name: run.contestant.clone(), mark, points: vec![point] }));
            }
        }
    }
    series.iter_mut().for_each(|(_, s)| s.points.sort_by(|a, b| a.x.total_cmp(&b.x)));
    let first = here().next().map(|(_, _, run)| run.contestant.clone()).unwrap_or_default();
    let laws: Vec<Series> =
        series.iter().filter(|(f, s)| f.is_some() && s.name == first).filter_map(|(_, s)| log_law(s)).collect();
    Panel {
        title: stream.to_owned(),
        caption: "Rate by the number of triangles and spheres; scenes of a family are joined.".into(),
        x: "triangles and spheres".into(),
        y: "Mrays/s".into(),
        series: laws.into_iter().chain(series.into_iter().map(|(_, s)| s)).collect(),
    }
}

/// What falls as 1 / log n through the first of several points.
fn log_law(series: &Series) -> Option<Series> {
    let (from, to) = (series.placed().next()?, series.placed().last()?.x);
    let at = |k: u32| from.x * (to / from.x).powf(f64::from(k) / f64::from(LOG_LAW_POINTS));
    let points = (0..=LOG_LAW_POINTS).map(|k| (at(k), from.y * from.x.ln() / at(k).ln()));
    (from.x >= 2.0 && to > from.x).then(|| Series::guide(LOG_LAW, points))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::rays::{RunRecord, SceneRecord, StreamRecord};

    fn benchmark(rates: &[(&str, u64, f64)]) -> RayBenchmark {
        let run = |rate: f64| RunRecord {
            contestant: "wide".into(),
            rays: 1,
            hit_share: 1.0,
            device: Summary { median: rate, min: rate * 0.9, max: rate * 1.1 },
            wall: None,
            seconds: Vec::new(),
            ratios: Vec::new(),
            nodes_per_ray: None,
            leaves_per_ray: None,
        };
        let scenes = rates.iter().map(|&(scene, triangles, rate)| SceneRecord {
            scene: scene.into(),
            triangles,
            streams: vec![StreamRecord { stream: "primary".into(), rays: 1, results: vec![run(rate)] }],
            ..Default::default()
        });
        RayBenchmark { scenes: scenes.collect(), ..Default::default() }
    }

    #[test]
    fn lines_join_families_only() {
        let marks = |rates: &[(&str, u64, f64)]| -> Vec<(Mark, usize)> {
            let plot = plot(&benchmark(rates));
            plot.panels().flat_map(|p| &p.series).map(|s| (s.mark, s.points.len())).collect()
        };
        let law = (Mark::Guide, 65);
        assert_eq!(marks(&[("a:1000", 1000, 3.0), ("a:10", 10, 5.0)]), [law, (Mark::Discs, 2)]);
        assert_eq!(marks(&[("a.glb", 10, 5.0), ("b.glb", 1000, 3.0)]), [(Mark::Circles, 2)]);
        assert_eq!(marks(&[("a:10", 10, 5.0), ("b:10", 10, 4.0)]), [(Mark::Discs, 1), (Mark::Triangles, 1)]);
        assert!(marks(&[]).is_empty());
    }

    #[test]
    fn points_are_in_the_order_of_size_with_their_noise() {
        let series = plot(&benchmark(&[("a:1000", 1000, 3.0), ("a:10", 10, 5.0)])).groups.remove(0).remove(0).series;
        assert_eq!(series[1].points.iter().map(|p| p.x).collect::<Vec<_>>(), [10.0, 1000.0]);
        assert_eq!(series[1].points[0].y_bar, Some([4.5, 5.5]));
        // the law through the first of them: at n^3 a third of the rate
        assert!((series[0].points[64].y - 5.0 / 3.0).abs() < 1e-9);
    }
}
