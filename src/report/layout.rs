//! Where the parts of a chart lie in its picture, in pixels of its view box.

use serde::Serialize;

use super::chart::{Axis, Chart, Mark, Point, Scale, Series};
use super::labels::{self, LINE_FROM, PlacedLabel, Rect};
use super::table::format_number;

/// Size of the picture.
const SIZE: [f64; 2] = [720.0, 400.0];
/// Left, top, right and bottom of the area of the points.
const AREA: [f64; 4] = [96.0, 12.0, 704.0, 346.0];
/// Width of a letter of a point's name, and height of its line, with room for those of phones.
const NAME_WIDTH: f64 = 8.6;
const NAME_HEIGHT: f64 = 15.0;
/// Maximum magnitude on axes, and its inverse, below which numbers are 0: quotients stay numbers.
const MAX_MAGNITUDE: f64 = 1e100;
/// Logarithmic axes of less than this ratio have numbers at even distances.
const MIN_DECADE: f64 = 6.0;
/// Different colours of series; more than these repeat.
pub const COLORS: usize = 8;

#[derive(Clone, Debug, Serialize)]
pub struct ChartLayout {
    pub(super) title: String,
    caption: String,
    pub(super) size: [f64; 2],
    pub(super) area: [f64; 4],
    x_label: String,
    y_label: String,
    x_ticks: Vec<Tick>,
    y_ticks: Vec<Tick>,
    pub(super) series: Vec<SeriesLayout>,
}

#[derive(Clone, Debug, Serialize)]
struct Tick {
    at: f64,
    /// Empty: a fine line without a number.
    text: String,
}

#[derive(Clone, Debug, Serialize)]
pub struct SeriesLayout {
    pub(super) name: String,
    pub(super) color: usize,
    /// Drawn in grey.
    pub(super) is_neutral: bool,
    pub(super) is_dashed: bool,
    /// The legend names it: its points have no names of their own, and it is the first of its name.
    pub(super) is_in_legend: bool,
    /// Points of the line that joins the points, as SVG has them; empty for none.
    line: String,
    points: Vec<PointLayout>,
}

#[derive(Clone, Debug, Serialize)]
struct PointLayout {
    x: f64,
    y: f64,
    x_bar: Option<[f64; 2]>,
    y_bar: Option<[f64; 2]>,
    label: String,
    /// The name beside it and where the middle of it is.
    name: String,
    name_at: Option<[f64; 2]>,
    /// The end of a line from the point to a name that is far from it.
    name_line: Option<[f64; 2]>,
    is_muted: bool,
    /// Only what a pointer rests on: the series has no marks.
    is_hidden: bool,
}

/// An axis with a range, and the pixels that it lies between.
struct Span {
    scale: Scale,
    range: [f64; 2],
    pixels: [f64; 2],
}

impl Span {
    fn new(axis: &Axis, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let scale = axis.scale;
        let fits = |v: &f64| v.abs() <= MAX_MAGNITUDE && (scale == Scale::Linear || *v >= 1.0 / MAX_MAGNITUDE);
        let is_range = |[lo, hi]: &[f64; 2]| fits(lo) && fits(hi) && hi - lo >= 1.0 / MAX_MAGNITUDE;
        let range = axis.range.filter(is_range).unwrap_or_else(|| {
            let rounded = |v: f64| if v.abs() < 1.0 / MAX_MAGNITUDE { 0.0 } else { v };
            let [lo, hi] = values
                .filter(fits)
                .map(rounded)
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
            match scale {
                _ if lo > hi => [1.0, 10.0],
                Scale::Logarithmic => [lo / 1.3, hi * 1.3],
                Scale::Linear if lo == hi => [lo - lo.abs().max(1.0) * 0.5, hi + hi.abs().max(1.0) * 0.5],
                // a quantity that begins at 0 is shown from there
                Scale::Linear => [if lo >= 0.0 { 0.0 } else { lo }, hi + (hi - lo) * 0.04],
            }
        });
        Self { scale, range, pixels }
    }

    fn position(&self, value: f64) -> f64 {
        let of = |v: f64| if self.scale == Scale::Logarithmic { v.log10() } else { v };
        let [lo, hi] = self.range.map(of);
        let t = (of(value) - lo) / (hi - lo);
        let at = self.pixels[0] + t * (self.pixels[1] - self.pixels[0]);
        (at * 100.0).round() / 100.0
    }

    /// Position of a value, clamped to the axis; `None` for one without a place.
    fn place(&self, value: f64) -> Option<f64> {
        let has_place = value.is_finite() && (self.scale == Scale::Linear || value > 0.0);
        has_place.then(|| self.position(value.clamp(self.range[0], self.range[1])))
    }

    fn ticks(&self) -> Vec<Tick> {
        let tick = |v: f64, text: String| Tick { at: self.position(v), text };
        let [lo, hi] = self.range;
        match self.scale {
            // a short piece of a logarithmic axis is all but linear
            _ if self.scale == Scale::Linear || hi / lo < MIN_DECADE => {
                let step = round_step((hi - lo) / 6.0);
                let first = (lo / step - 1e-9).ceil() as i64;
                let last = (hi / step + 1e-9).floor() as i64;
                (first..=last).map(|k| tick(k as f64 * step, short(k as f64 * step))).collect()
            }
            _ => {
                let decades = (lo.log10().floor() as i32)..=(hi.log10().ceil() as i32);
                let few = hi / lo < 300.0;
                let tens = (hi / lo).log10() > 8.0;
                let mut ticks = Vec::new();
                for decade in decades {
                    for k in 1..10 {
                        let value = f64::from(k) * 10f64.powi(decade);
                        if !(lo * (1.0 - 1e-9)..=hi * (1.0 + 1e-9)).contains(&value) {
                            continue;
                        }
                        let has_text =
                            if tens { k == 1 && decade % 2 == 0 } else { k == 1 || few && (k == 2 || k == 5) };
                        ticks.push(tick(value, if has_text { short(value) } else { String::new() }));
                    }
                }
                ticks
            }
        }
    }
}

/// 1, 2 or 5 times a power of ten, at least `step`.
fn round_step(step: f64) -> f64 {
    let power = 10f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0].iter().map(|k| k * power).find(|s| *s >= step * (1.0 - 1e-9)).unwrap_or(10.0 * power)
}

/// 0.25, 10k, 2M, 1e-5.
fn short(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    let (scaled, unit) = match size {
        s if !(1e-3..1e9).contains(&s) => return trimmed(&format!("{value:.1e}")),
        s if s >= 1e6 => (value * 1e-6, "M"),
        s if s >= 1e4 => (value * 1e-3, "k"),
        _ => (value, ""),
    };
    format!("{}{unit}", trimmed(&format!("{scaled:.4}")))
}

/// Without zeros after the point.
fn trimmed(text: &str) -> String {
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}e{exponent}", trimmed(mantissa)),
        None if text.contains('.') => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        None => text.to_owned(),
    }
}

impl ChartLayout {
    /// Lays out a chart. `color` gives the number of the colour of a series by its name.
    pub fn new(chart: &Chart, color: &mut dyn FnMut(&str) -> usize) -> Self {
        let points = || chart.series.iter().flat_map(|s| &s.points);
        let ends = |bar: &Option<[f64; 2]>| bar.map_or([f64::NAN; 2], |b| b);
        let x = Span::new(&chart.x, points().flat_map(|p| [[p.x; 2], ends(&p.x_bar)].concat()), [AREA[0], AREA[2]]);
        let y = Span::new(&chart.y, points().flat_map(|p| [[p.y; 2], ends(&p.y_bar)].concat()), [AREA[3], AREA[1]]);
        let mut color_of = |s: &Series| if s.mark.is_neutral() { 0 } else { color(&s.name) };
        let mut series: Vec<SeriesLayout> =
            chart.series.iter().map(|s| series_layout(s, chart, [&x, &y], color_of(s))).collect();
        let names: Vec<String> = series.iter().map(|s| s.name.clone()).collect();
        for (k, s) in series.iter_mut().enumerate() {
            s.is_in_legend &= !names[..k].contains(&s.name);
        }
        place_names(&mut series);
        Self {
            title: chart.title.clone(),
            caption: chart.caption.clone(),
            size: SIZE,
            area: AREA,
            x_label: chart.x.label.clone(),
            y_label: chart.y.label.clone(),
            x_ticks: x.ticks(),
            y_ticks: y.ticks(),
            series,
        }
    }
}

fn series_layout(series: &Series, chart: &Chart, [x, y]: [&Span; 2], color: usize) -> SeriesLayout {
    let label = |p: &Point| {
        if p.label.is_empty() {
            let numbers =
                [(&chart.x, p.x), (&chart.y, p.y)].map(|(axis, v)| format!("{} {}", axis.label, format_number(v)));
            format!("{}: {}", series.name, numbers.join(", "))
        } else {
            p.label.clone()
        }
    };
    let bar = |bar: &Option<[f64; 2]>, span: &Span| bar.and_then(|[a, b]| Some([span.place(a)?, span.place(b)?]));
    let points: Vec<PointLayout> = series
        .points
        .iter()
        .filter_map(|p| {
            // a step that is empty lies on the axis
            let height = if series.mark == Mark::Steps { y.place(p.y).unwrap_or(AREA[3]) } else { y.place(p.y)? };
            Some(PointLayout {
                x: x.place(p.x)?,
                y: height,
                x_bar: bar(&p.x_bar, x),
                y_bar: bar(&p.y_bar, y),
                label: label(p),
                name: p.name.clone(),
                name_at: None,
                name_line: None,
                is_muted: p.is_muted,
                is_hidden: !series.mark.has_points(),
            })
        })
        .collect();

    // Joins the points that count to a line.
    let joined: Vec<[f64; 2]> = points.iter().filter(|p| !p.is_muted).map(|p| [p.x, p.y]).collect();
    let corners = match series.mark {
        Mark::Points => Vec::new(),
        Mark::Steps => {
            joined.windows(2).flat_map(|w| [w[0], [w[1][0], w[0][1]]]).chain(joined.last().copied()).collect()
        }
        Mark::Line | Mark::LineAndPoints | Mark::Border | Mark::Dashed => joined,
    };
    let line = corners.iter().map(|[x, y]| format!("{x},{y}")).collect::<Vec<_>>().join(" ");
    SeriesLayout {
        name: series.name.clone(),
        color,
        is_neutral: series.mark.is_neutral(),
        is_dashed: series.mark == Mark::Dashed,
        is_in_legend: points.is_empty() || points.iter().any(|p| p.name.is_empty()),
        line,
        points,
    }
}

/// Finds room for the names of points, which cover no points, bars, lines and names.
fn place_names(series: &mut [SeriesLayout]) {
    let mut obstacles = Vec::new();
    for s in series.iter() {
        let corner = |text: &str| text.split_once(',').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?]));
        let corners: Vec<[f64; 2]> = s.line.split(' ').filter_map(corner).collect();
        for w in corners.windows(2) {
            // in short pieces, so that slanted lines take no more room than they need
            let piece = |k: u32| [0, 1].map(|c| w[0][c] + (w[1][c] - w[0][c]) * f64::from(k) / 16.0);
            obstacles.extend((0..16).map(|k| Rect::between(piece(k), piece(k + 1)).grown(1.0)));
        }
        for p in s.points.iter().filter(|p| !p.is_hidden) {
            obstacles.push(Rect::between([p.x, p.y], [p.x, p.y]).grown(5.0));
            let bars = [p.x_bar.map(|[a, b]| [[a, p.y], [b, p.y]]), p.y_bar.map(|[a, b]| [[p.x, a], [p.x, b]])];
            obstacles.extend(bars.into_iter().flatten().map(|[a, b]| Rect::between(a, b).grown(2.0)));
        }
    }
    let mut named: Vec<&mut PointLayout> =
        series.iter_mut().flat_map(|s| &mut s.points).filter(|p| !p.name.is_empty()).collect();
    let requests: Vec<_> =
        named.iter().map(|p| ([p.x, p.y], [NAME_WIDTH * p.name.chars().count() as f64, NAME_HEIGHT])).collect();
    let frame = Rect::between([AREA[0], AREA[1]], [AREA[2], AREA[3]]).grown(-2.0);
    for (point, PlacedLabel { rect, distance }) in named.iter_mut().zip(labels::place(&requests, frame, &obstacles)) {
        point.name_at = Some([rect.x + 0.5 * rect.width, rect.y + 0.5 * rect.height]);
        let near = [point.x.clamp(rect.x, rect.x + rect.width), point.y.clamp(rect.y, rect.y + rect.height)];
        point.name_line = (distance > LINE_FROM).then_some(near);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(chart: &Chart) -> ChartLayout {
        ChartLayout::new(chart, &mut |_| 0)
    }

    #[test]
    fn points_lie_where_axes_say() {
        let points = [(0.0, 1.0), (10.0, 100.0), (5.0, 10.0), (f64::NAN, 1.0), (1.0, 0.0)].map(Point::from).to_vec();
        let chart = Chart {
            x: Axis { range: Some([0.0, 10.0]), ..Axis::default() },
            y: Axis { range: Some([1.0, 100.0]), ..Axis::logarithmic("y") },
            series: vec![Series { points, ..Series::default() }],
            ..Chart::default()
        };
        let found: Vec<_> = layout(&chart).series[0].points.iter().map(|p| [p.x, p.y]).collect();
        let [left, top, right, bottom] = AREA;
        assert_eq!(found, [[left, bottom], [right, top], [(left + right) / 2.0, (top + bottom) / 2.0]]);
    }

    #[test]
    fn steps_and_muted_points() {
        let mut points = [(0.0, 1.0), (1.0, 3.0), (2.0, 0.0)].map(Point::from).to_vec();
        let chart = |mark, points: &[Point]| {
            let axis = Axis { range: Some([0.0, 2.0]), ..Axis::default() };
            let series = vec![Series { mark, points: points.to_vec(), ..Series::default() }];
            Chart { x: axis.clone(), y: axis, series, ..Chart::default() }
        };
        assert_eq!(layout(&chart(Mark::Steps, &points)).series[0].line.split(' ').count(), 5);
        points[1].is_muted = true;
        assert_eq!(layout(&chart(Mark::Line, &points)).series[0].line.split(' ').count(), 2);
        assert!(layout(&chart(Mark::Points, &points)).series[0].line.is_empty());
    }

    #[test]
    fn names_keep_clear_of_each_other_and_neutral_lines_take_no_color() {
        let named = |name: &str, x| Point { name: name.into(), ..Point::from((x, 1.0)) };
        let series = |name: &str, mark, points| Series { name: name.into(), mark, points };
        let all = vec![
            series("level", Mark::Dashed, vec![(0.0, 1.0).into(), (2.0, 1.0).into()]),
            series("a", Mark::Points, vec![named("first", 1.0)]),
            series("b", Mark::Points, vec![named("second", 1.001)]),
            series("level", Mark::Dashed, vec![(0.0, 2.0).into(), (2.0, 2.0).into()]),
        ];
        let mut colors = Vec::new();
        let layout = ChartLayout::new(&Chart { series: all, ..Chart::default() }, &mut |name| {
            colors.push(name.to_owned());
            0
        });
        assert_eq!(colors, ["a", "b"]);
        assert!(layout.series[0].is_dashed && layout.series[1].is_neutral != layout.series[0].is_neutral);
        assert_eq!(layout.series.iter().map(|s| s.is_in_legend).collect::<Vec<_>>(), [true, false, false, false]);
        let [a, b] = [1, 2].map(|k| layout.series[k].points[0].name_at.unwrap());
        assert!((a[1] - b[1]).abs() >= NAME_HEIGHT || (a[0] - b[0]).abs() > 6.0 * NAME_WIDTH, "{a:?} {b:?}");
        let line = layout.series[0].points[0].y;
        assert!([a, b].iter().all(|n| (n[1] - line).abs() > 0.5 * NAME_HEIGHT), "{a:?} {b:?} {line}");
    }

    #[test]
    fn ticks_are_round_numbers() {
        let texts = |scale: Scale, range: [f64; 2]| -> Vec<String> {
            let span = Span { scale, range, pixels: [0.0, 100.0] };
            span.ticks().into_iter().map(|t| t.text).filter(|t| !t.is_empty()).collect()
        };
        assert_eq!(texts(Scale::Linear, [-0.11, 0.31]), ["-0.1", "0", "0.1", "0.2", "0.3"]);
        assert_eq!(texts(Scale::Logarithmic, [0.9, 30.0]), ["1", "2", "5", "10", "20"]);
        assert_eq!(texts(Scale::Logarithmic, [1e-5, 2e6]).last().unwrap(), "1M");
        // numbers that no axis can hold, alone and beside others
        for extreme in [0.0, 5e-324, -1e-320, f64::MIN_POSITIVE, f64::MAX, f64::MIN, f64::INFINITY, f64::NAN] {
            for scale in [Scale::Linear, Scale::Logarithmic] {
                for beside in [extreme, 1.0, -1e-320, 1e300] {
                    let axis = |range| Axis { scale, range, ..Axis::default() };
                    let points = vec![Point::from((extreme, beside)), Point::from((beside, extreme))];
                    let series = vec![Series { points, ..Series::default() }];
                    let layout =
                        layout(&Chart { x: axis(Some([extreme, beside])), y: axis(None), series, ..Chart::default() });
                    assert!(layout.x_ticks.len() < 2000 && layout.y_ticks.len() < 2000);
                    let drawn =
                        serde_json::to_string(&(&layout.x_ticks, &layout.y_ticks)).unwrap() + &layout.series[0].line;
                    assert!(
                        !drawn.contains("null") && !drawn.contains("NaN") && !drawn.contains("inf"),
                        "{extreme} {beside}: {drawn}"
                    );
                }
            }
        }
        // no points at all
        assert!(!layout(&Chart::default()).x_ticks.is_empty());
    }
}
