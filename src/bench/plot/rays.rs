//! Rates against the number of triangles, drawn: one panel a stream, both axes logarithmic.
//!
//! What it shares with other pictures is in [`super::chart`].

use plotters::prelude::*;

use super::chart::{Area, Chart, Picture, axes, color, draw_sheet, failed};
use crate::bench::record::rays::{RayBenchmark, family};
use crate::error::Result;
use crate::measure::stats::Summary;

/// Draws all results. Scenes of a family (`terrain:N`) are joined by lines: circles for the first family, triangles for the
/// second, crosses for others; scenes without a family are hollow circles. The dashed line falls as
/// 1 / log n from the first point of the first contestant.
///
/// # Errors
/// [`crate::Error::Usage`] when there is no result to draw.
pub fn draw(benchmark: &RayBenchmark) -> Result<Picture> {
    let mut streams: Vec<&str> = Vec::new();
    let mut contestants: Vec<&str> = Vec::new();
    for (_, stream, run) in benchmark.rows() {
        if !streams.contains(&stream.stream.as_str()) {
            streams.push(&stream.stream);
        }
        if !contestants.contains(&run.contestant.as_str()) {
            contestants.push(&run.contestant);
        }
    }
    let subtitle = format!("{} ({}), {} threads", benchmark.host.device, benchmark.host.driver, benchmark.host.threads);
    let titles = ["Mrays/s against triangles and spheres", subtitle.as_str()];
    draw_sheet(titles, &contestants, streams.len(), |k, area| draw_panel(benchmark, streams[k], &contestants, area))
}

/// One result: size, and median, least and greatest rate.
#[derive(Clone, Copy)]
struct Mark {
    size: f64,
    rate: f64,
    min: f64,
    max: f64,
}

fn draw_panel(benchmark: &RayBenchmark, stream: &str, contestants: &[&str], area: &Area) -> Result<()> {
    let here = || benchmark.rows().filter(|(_, t, r)| t.stream == stream && r.device.median > 0.0);
    let x = here().map(|(s, _, _)| (s.primitives() as f64).max(1.0));
    let y = here().flat_map(|(_, _, r)| [r.device.min, r.device.max]).filter(|v| *v > 0.0);
    let Some(mut chart) = axes(area, [stream, "triangles and spheres", "Mrays/s"], x, y)? else { return Ok(()) };
    // families in the order of the scenes: each has its mark
    let mut families: Vec<&str> = Vec::new();
    for name in benchmark.scenes.iter().filter_map(|s| family(&s.scene)) {
        if !families.contains(&name) {
            families.push(name);
        }
    }
    for (k, name) in contestants.iter().enumerate() {
        let mut groups: Vec<(Option<&str>, Vec<Mark>)> = Vec::new();
        for (scene, _, run) in here().filter(|(_, _, r)| r.contestant == *name) {
            let Summary { median: rate, min, max } = run.device;
            let point = Mark { size: scene.primitives().max(1) as f64, rate, min, max };
            let of = family(&scene.scene);
            match groups.iter_mut().find(|g| g.0.is_some() && g.0 == of) {
                Some(g) => g.1.push(point),
                None => groups.push((of, vec![point])),
            }
        }
        for (of, mut points) in groups {
            points.sort_by(|a, b| a.size.total_cmp(&b.size));
            let index = of.and_then(|f| families.iter().position(|g| *g == f));
            draw_points(&mut chart, &points, color(k), index)?;
            if k == 0 && points.len() > 1 {
                draw_log_law(&mut chart, points[0], points[points.len() - 1].size)?;
            }
        }
    }
    Ok(())
}

fn draw_points(chart: &mut Chart, points: &[Mark], color: RGBColor, family: Option<usize>) -> Result<()> {
    if points.len() > 1 {
        let line = points.iter().map(|p| (p.size, p.rate));
        chart.draw_series(LineSeries::new(line, color.stroke_width(2))).map_err(failed)?;
    }
    // from the slowest repeat to the fastest
    let spread = |p: &Mark| PathElement::new(vec![(p.size, p.min), (p.size, p.max)], color.stroke_width(1));
    chart.draw_series(points.iter().filter(|p| p.min > 0.0).map(spread)).map_err(failed)?;
    let at = |p: &Mark| (p.size, p.rate);
    match family {
        None => chart.draw_series(points.iter().map(|p| Circle::new(at(p), 4, color.stroke_width(2)))).map(drop),
        Some(0) => chart.draw_series(points.iter().map(|p| Circle::new(at(p), 4, color.filled()))).map(drop),
        Some(1) => chart.draw_series(points.iter().map(|p| TriangleMarker::new(at(p), 6, color.filled()))).map(drop),
        Some(_) => chart.draw_series(points.iter().map(|p| Cross::new(at(p), 5, color.stroke_width(2)))).map(drop),
    }
    .map_err(failed)?;
    Ok(())
}

/// What falls as 1 / log n through a point.
fn draw_log_law(chart: &mut Chart, from: Mark, to: f64) -> Result<()> {
    if from.size < 2.0 {
        return Ok(());
    }
    let at = |k: u32| from.size * (to / from.size).powf(f64::from(k) / 64.0);
    let curve = (0..=64).map(|k| (at(k), from.rate * from.size.ln() / at(k).ln()));
    chart.draw_series(DashedLineSeries::new(curve, 6, 5, RGBColor(90, 90, 90).stroke_width(1))).map_err(failed)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::plot::chart::{HEAD, PANEL};
    use crate::bench::record::HostInfo;
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
        RayBenchmark {
            host: HostInfo { device: "a device".into(), ..Default::default() },
            scenes: scenes.collect(),
            ..Default::default()
        }
    }

    /// Pixels of the first contestant's colour in a picture of the given results.
    fn colored(rates: &[(&str, u64, f64)]) -> usize {
        let p = draw(&benchmark(rates)).unwrap();
        assert_eq!(p.rgb.len(), 3 * (p.width * p.height) as usize);
        let panel = &p.rgb[3 * (HEAD * p.width) as usize..3 * ((HEAD + PANEL[1]) * p.width) as usize];
        panel.chunks(3).filter(|c| *c == [color(0).0, color(0).1, color(0).2]).count()
    }

    #[test]
    fn lines_join_families_only() {
        let family = colored(&[("a:10", 10, 5.0), ("a:1000", 1000, 3.0)]);
        let single = colored(&[("a.glb", 10, 5.0), ("b.glb", 1000, 3.0)]);
        assert!(single > 20 && family > single + 300, "{family} {single}");
        // one point is no reason to fail
        assert!(colored(&[("a:10", 10, 5.0)]) > 20);
    }

    #[test]
    fn text_is_drawn() {
        let p = draw(&benchmark(&[("a:10", 10, 5.0)])).unwrap();
        let dark = p.rgb[..3 * (HEAD * p.width) as usize].chunks(3).filter(|c| c[0] < 100).count();
        assert!(dark > 300, "{dark} dark pixels in the title");
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        assert_eq!(draw(&RayBenchmark::default()).map(|_| ()).unwrap_err().exit_code(), 64);
    }
}
