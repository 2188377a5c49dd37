//! Measurements as charts: time against error with its Pareto front, values along an axis, rates
//! against the size of scenes.

use super::record::{Better, FRAME, Measurement, REFERENCE, Record, SIZE, quantity};
use crate::report::pareto::{BEYOND, dominated, front};
use crate::report::{Axis, Chart, Mark, Point, Series};

/// Points of the dashed line of a law.
const LAW_POINTS: u32 = 64;
/// Quantities that have a chart of their own along an axis.
const CHARTED: [&str; 5] = ["time", "RMSE", "corrected RMSE", "unfiltered RMSE", "rate"];

/// Measurements of one part of one scene.
struct Group<'a> {
    title: String,
    all: Vec<&'a Measurement>,
}

/// Charts of a scene, part by part.
pub fn scene_charts(record: &Record, scene: &str) -> Vec<Chart> {
    let here: Vec<&Measurement> = record.measurements.iter().filter(|m| m.scene == scene).collect();
    let mut charts = Vec::new();
    for part in distinct(here.iter().map(|m| m.part.as_str())) {
        let all: Vec<&Measurement> = here.iter().copied().filter(|m| m.part == part).collect();
        let group = Group { title: format!("{scene}, {part}"), all };
        charts.extend(group.time_against_error());
        let over_time = group.error_over_time();
        let is_over_time = over_time.is_some();
        charts.extend(over_time);
        charts.extend(group.curves(is_over_time));
    }
    charts
}

/// Charts over all scenes: a quantity against the size of the scene, a chart for each part.
pub fn size_charts(record: &Record) -> Vec<Chart> {
    let sized =
        |m: &&Measurement| m.at.as_ref().is_some_and(|at| at.axis == SIZE) && CHARTED.contains(&m.quantity.as_str());
    let all: Vec<&Measurement> = record.measurements.iter().filter(sized).collect();
    let keys = distinct(all.iter().map(|m| (m.part.as_str(), m.title())));
    let chart = |(part, title): &(&str, String)| {
        let here: Vec<&Measurement> = all.iter().copied().filter(|m| m.part == *part && m.title() == *title).collect();
        let sizes = distinct(here.iter().filter_map(|m| m.at.as_ref()).map(|at| at.value.to_bits()));
        (sizes.len() > 1).then(|| size_chart(part, title, &here))
    };
    keys.iter().filter_map(chart).collect()
}

/// One quantity against the size of scenes; scenes of a family (`terrain:N`) are joined.
fn size_chart(part: &str, title: &str, here: &[&Measurement]) -> Chart {
    let keys = distinct(here.iter().map(|m| (family(&m.scene), m.contestant.as_str())));
    let mut series = Vec::new();
    for (scenes, contestant) in &keys {
        let of_series = here.iter().filter(|m| family(&m.scene) == *scenes && m.contestant == *contestant);
        let mut points: Vec<Point> = of_series.filter_map(|m| Some(point(m.at.as_ref()?.value.max(1.0), m))).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        let mark = if scenes.is_some() { Mark::LineAndPoints } else { Mark::Points };
        // what falls as 1 / log n from the first point of the first contestant of a family
        let is_rate = here.iter().all(|m| m.better == Better::More);
        if scenes.is_some() && is_rate && keys.first().is_some_and(|k| k.1 == *contestant) {
            series.extend(log_law(&points));
        }
        series.push(Series { name: (*contestant).to_owned(), mark, points });
    }
    // laws lie below what is measured
    series.sort_by_key(|s| s.mark != Mark::Dashed);
    let caption = "By the number of triangles and spheres; scenes of a family are joined.".into();
    Chart { title: part.to_owned(), caption, x: Axis::logarithmic(SIZE), y: Axis::logarithmic(title), series }
}

/// The family of `builtin:NAME:N`: its name.
pub fn family(scene: &str) -> Option<&str> {
    let (family, number) = scene.rsplit_once(':')?;
    number.parse::<u64>().ok().map(|_| family)
}

/// The curve 1 / log n through the first of several points.
fn log_law(points: &[Point]) -> Option<Series> {
    let (from, to) = (points.first()?, points.last()?.x);
    let at = |k: u32| from.x * (to / from.x).powf(f64::from(k) / f64::from(LAW_POINTS));
    let law = (0..=LAW_POINTS).map(|k| Point::from((at(k), from.y * from.x.ln() / at(k).ln())));
    (from.x >= 2.0 && to > from.x && from.y > 0.0).then(|| dashed("as 1 / log n", law.collect()))
}

impl Group<'_> {
    fn scalars<'g>(&'g self, quantity: &'g str) -> impl Iterator<Item = &'g Measurement> {
        self.all.iter().copied().filter(move |m| m.quantity == quantity && m.along().is_none() && is_placed(m))
    }

    fn scalar<'g>(&'g self, contestant: &str, quantity: &'g str) -> Option<&'g Measurement> {
        self.scalars(quantity).find(|m| m.contestant == contestant)
    }

    /// Standard errors of references, as dashed lines across the chart.
    fn levels(&self) -> Vec<Series> {
        let references = self.scalars(quantity::RMSE.name).filter(|m| m.contestant.starts_with(REFERENCE));
        let level = |m: &Measurement| {
            let end =
                |x| Point { label: format!("{}'s own error", m.contestant), ..Point::from((x, m.values.middle())) };
            dashed(&format!("{}'s own error", m.contestant), vec![end(1.0 / BEYOND), end(BEYOND)])
        };
        references.map(level).collect()
    }

    /// Contestants by their time and error, with what is worth its time.
    fn time_against_error(&self) -> Option<Chart> {
        let mut points: Vec<Point> = Vec::new();
        for time in self.scalars(quantity::FRAME_TIME.name) {
            // if the reference's error dominates, the contestant's own is at most the measured one
            let [known, measured] =
                [quantity::CORRECTED, quantity::RMSE].map(|q| self.scalar(&time.contestant, q.name));
            let Some(error) = known.or(measured) else { continue };
            let most = if known.is_some() { "" } else { ": at most this" };
            let name = format!("{}{most}", time.contestant);
            let x = time.values.middle();
            points.push(Point { x_bar: time.values.spread(), name, ..Point::from((x, error.values.middle())) });
        }
        let unit = self.scalars(quantity::FRAME_TIME.name).next()?.title();
        let places: Vec<[f64; 2]> = points.iter().map(|p| [p.x, p.y]).collect();
        points.iter_mut().zip(dominated(&places)).for_each(|(p, is_dominated)| p.is_muted = is_dominated);
        let mut series: Vec<Series> = front(&points).into_iter().collect();
        series.extend(points.iter().map(|p| {
            let name = p.name.trim_end_matches(": at most this").to_owned();
            Series { name, mark: Mark::Points, points: vec![p.clone()] }
        }));
        if points.is_empty() {
            return None;
        }

        // plain accumulation in the same times
        let plain = self.scalars(quantity::PLAIN_CORRECTED.name);
        let plain =
            plain.filter_map(|m| Some((self.scalar(&m.contestant, "time")?.values.middle(), m.values.middle())));
        let mut plain: Vec<Point> = plain.map(Point::from).collect();
        plain.sort_by(|a, b| a.x.total_cmp(&b.x));
        series.extend((!plain.is_empty()).then(|| dashed("plain accumulation", plain)));
        series.extend(self.levels());
        Some(Chart {
            title: format!("{}: time against error", self.title),
            caption:
                "What is to the right of and above the front is dominated: another contestant is quicker and no less exact."
                    .into(),
            x: Axis::logarithmic(unit),
            y: Axis::logarithmic("RMSE"),
            series,
        })
    }

    /// Time of a contestant at a place along an axis: measured there, or that of so many frames.
    fn time_at<'g>(&'g self, m: &Measurement) -> Option<(f64, Option<[f64; 2]>, &'g str)> {
        let at = m.along()?;
        let is_there = |t: &&&Measurement| {
            t.quantity == "time" && t.contestant == m.contestant && t.at.as_ref().is_some_and(|p| p == at)
        };
        if let Some(time) = self.all.iter().find(is_there) {
            return Some((time.values.middle(), time.values.spread(), &time.unit));
        }
        let frame = self.scalar(&m.contestant, "time").filter(|_| at.axis == FRAME)?;
        Some((frame.values.middle() * at.value, None, &frame.unit))
    }

    /// How the error of each contestant falls with the time spent on it.
    fn error_over_time(&self) -> Option<Chart> {
        let curve = |contestant: &str, quantity: &str| -> Vec<Point> {
            let here = self.all.iter().filter(|m| m.contestant == contestant && m.quantity == quantity && is_placed(m));
            let place = |m: &&&Measurement| {
                let (time, x_bar, _) = self.time_at(m)?;
                Some(Point { x_bar, ..point(time, m) })
            };
            here.filter_map(|m| place(&m)).collect()
        };
        let rmse = quantity::RMSE.name;
        let first = self.all.iter().find(|m| m.quantity == rmse && self.time_at(m).is_some())?;
        let unit = self.time_at(first)?.2.to_owned();
        let names = distinct(self.all.iter().map(|m| m.contestant.as_str()));
        let curves: Vec<Series> = names
            .iter()
            .map(|name| Series { name: (*name).to_owned(), points: curve(name, rmse), ..Series::default() })
            .filter(|s| !s.points.is_empty())
            .collect();

        let mut series = Vec::new();
        if curves.len() > 1 {
            series.extend(front(&curves.iter().flat_map(|s| s.points.clone()).collect::<Vec<_>>()));
        }
        // of all contestants the same curve: that of the longest time shows most of it
        let plain = names.iter().map(|name| curve(name, quantity::PLAIN_RMSE.name)).filter(|points| !points.is_empty());
        let end = |points: &[Point]| points.last().map_or(0.0, |p| p.x);
        let longest = plain.max_by(|a, b| end(a).total_cmp(&end(b)));
        series.extend(curves);
        series.extend(longest.map(|points| dashed("plain accumulation", points)));
        series.extend(self.levels());
        Some(Chart {
            title: format!("{}: error over time", self.title),
            caption: "Time spent on an image, and its error.".into(),
            x: Axis::logarithmic(format!("time, {unit}")),
            y: Axis::logarithmic("RMSE"),
            series,
        })
    }

    /// Everything else along an axis, without errors that are shown over time.
    fn curves(&self, is_over_time: bool) -> Vec<Chart> {
        let is_left = |m: &&&Measurement| {
            let is_shown = is_over_time && (m.quantity == "time" || m.quantity.contains("RMSE"));
            m.along().is_some() && is_placed(m) && CHARTED.contains(&m.quantity.as_str()) && !is_shown
        };
        let left: Vec<&Measurement> = self.all.iter().filter(is_left).copied().collect();
        let keys = distinct(left.iter().filter_map(|m| Some((m.title(), m.along()?.axis.as_str()))));
        let chart = |(title, axis): &(String, &str)| {
            let here = || left.iter().filter(|m| m.title() == *title && m.along().is_some_and(|at| at.axis == *axis));
            let series = |name: &str| {
                let own = here().filter(|m| m.contestant == name);
                let points = own.filter_map(|m| Some(point(m.along()?.value, m))).collect();
                Series { name: name.to_owned(), points, ..Series::default() }
            };
            let names = distinct(here().map(|m| m.contestant.as_str()));
            Chart {
                title: format!("{}: {title}", self.title),
                caption: format!("By {axis}."),
                x: Axis::logarithmic(*axis),
                y: Axis::logarithmic(title.as_str()),
                series: names.into_iter().map(series).collect(),
            }
        };
        keys.iter().map(chart).collect()
    }
}

/// Each value once, in the order of its first appearance.
pub fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    values.fold(Vec::new(), |mut all, value| {
        if !all.contains(&value) {
            all.push(value);
        }
        all
    })
}

/// Whether a result has a place on a logarithmic axis.
fn is_placed(m: &Measurement) -> bool {
    m.values.middle().is_finite() && m.values.middle() > 0.0
}

fn point(x: f64, m: &Measurement) -> Point {
    Point { y_bar: m.values.spread(), ..Point::from((x, m.values.middle())) }
}

fn dashed(name: &str, points: Vec<Point>) -> Series {
    Series { name: name.to_owned(), mark: Mark::Dashed, points }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::stats::Percentiles;

    fn times(ms: f64) -> Percentiles {
        Percentiles { median: ms, p5: 0.9 * ms, p25: 0.95 * ms, p75: 1.05 * ms, p95: 1.2 * ms, count: 32 }
    }

    fn titles(charts: &[Chart]) -> Vec<&str> {
        charts.iter().map(|c| c.title.as_str()).collect()
    }

    #[test]
    fn presets_are_points_and_their_errors_curves() {
        let mut record = Record::default();
        for (preset, ms, rmse) in [("larsen", 40.0, 0.2), ("fast", 5.0, 0.1), ("quality", 20.0, 0.0)] {
            let mut row = record.row("a", "still", preset);
            row.repeated(quantity::FRAME_TIME, times(ms));
            row.exact(quantity::RMSE, rmse + 0.01).exact(quantity::CORRECTED, rmse);
            row.exact(quantity::PLAIN_CORRECTED, 2.0 * rmse);
            row.at(FRAME, 1.0).exact(quantity::RMSE, 1.0);
            row.at(FRAME, 2.0).exact(quantity::RMSE, rmse + 0.01);
        }
        record.row("a", "still", REFERENCE).exact(quantity::RMSE, 0.01);
        let charts = scene_charts(&record, "a");
        assert_eq!(titles(&charts), ["a, still: time against error", "a, still: error over time"]);
        let of = |chart: &Chart, name: &str| chart.series.iter().find(|s| s.name == name).unwrap().points.clone();
        let fast = &of(&charts[0], "fast")[0];
        assert_eq!((fast.x, fast.y, fast.x_bar, fast.is_muted), (5.0, 0.1, Some([4.5, 6.0]), false));
        assert!(of(&charts[0], "larsen")[0].is_muted);
        // an error that is all the reference's stands at what was measured
        let quality = &of(&charts[0], "quality")[0];
        assert_eq!((quality.y, quality.name.as_str()), (0.01, "quality: at most this"));
        assert_eq!(of(&charts[0], "plain accumulation").iter().map(|p| p.x).collect::<Vec<_>>(), [5.0, 40.0]);
        assert_eq!(of(&charts[0], "reference's own error")[1].y, 0.01);
        assert_eq!(of(&charts[1], "larsen").iter().map(|p| p.x).collect::<Vec<_>>(), [40.0, 80.0]);
        assert!(scene_charts(&record, "b").is_empty());
    }

    #[test]
    fn images_have_times_of_their_own() {
        let mut record = Record::default();
        for (name, k) in [("mis", 1.0), ("uniform", 8.0)] {
            for (spp, t) in [(1.0, 1.0), (4.0, 4.0)] {
                let mut row = record.row("box", "images", name);
                let mut row = row.at("samples per pixel", spp);
                row.repeated(quantity::IMAGE_TIME, times(t)).exact(quantity::RMSE, k / t);
            }
        }
        let charts = scene_charts(&record, "box");
        assert_eq!(titles(&charts), ["box, images: error over time"]);
        let marks: Vec<Mark> = charts[0].series.iter().map(|s| s.mark).collect();
        assert_eq!(marks, [Mark::Border, Mark::LineAndPoints, Mark::LineAndPoints]);
        assert_eq!(charts[0].series[1].points[1].x_bar, Some([3.6, 4.8]));
    }

    #[test]
    fn other_axes_have_charts_of_their_own() {
        let mut record = Record::default();
        for (bounces, ms) in [(1.0, 3.0), (2.0, 4.0)] {
            record.row("a", "bounces", "fast").at("bounces", bounces).repeated(quantity::FRAME_TIME, times(ms));
            record.row("a", "turn", "fast").at("frame after the change", bounces).exact(quantity::RMSE, 1.0 / bounces);
        }
        assert_eq!(titles(&scene_charts(&record, "a")), ["a, bounces: time, ms", "a, turn: RMSE"]);
    }

    #[test]
    fn lines_join_families_only() {
        assert_eq!(family("builtin:terrain:1000"), Some("builtin:terrain"));
        assert_eq!([family("builtin:terrain"), family("scene.glb")], [None, None]);
        let marks = |rates: &[(&str, f64, f64)]| -> Vec<(Mark, usize)> {
            let mut record = Record::default();
            for (scene, size, rate) in rates {
                record.row(scene, "primary", "wide").at(SIZE, *size).repeated(quantity::RATE, times(*rate));
            }
            size_charts(&record).iter().flat_map(|c| &c.series).map(|s| (s.mark, s.points.len())).collect()
        };
        let law = (Mark::Dashed, 65);
        assert_eq!(marks(&[("a:1000", 1000.0, 3.0), ("a:10", 10.0, 5.0)]), [law, (Mark::LineAndPoints, 2)]);
        assert_eq!(marks(&[("a.glb", 10.0, 5.0), ("b.glb", 1000.0, 3.0)]), [(Mark::Points, 2)]);
        assert!(marks(&[("a.glb", 10.0, 5.0)]).is_empty());
        let law = log_law(&[Point::from((10.0, 5.0)), Point::from((1000.0, 3.0))]).unwrap();
        // at n^3 a third of the rate
        assert!((law.points[64].y - 5.0 / 3.0).abs() < 1e-9);
    }
}
