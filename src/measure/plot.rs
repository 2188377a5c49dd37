//! Rates against the number of triangles, drawn: one panel a stream, both axes logarithmic.
//!
//! Drawn with the fonts that this program carries, so that it needs neither a display nor fonts on the machine.

use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

use super::benchmark::{RayBenchmark, family};
use super::stats::Summary;
use crate::error::{Error, Result};

/// Pixels of a panel.
const PANEL: [u32; 2] = [760, 470];
/// Pixels above the panels.
const HEAD: u32 = 64;
/// Pixels of a legend's line.
const LEGEND_LINE: u32 = 26;

/// Colours that the colour-blind can tell apart (Okabe and Ito, "Color Universal Design", 2008), and black; then others, for those who
/// come after.
const COLORS: [RGBColor; 16] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(120, 120, 40),
    RGBColor(0, 0, 0),
    RGBColor(110, 60, 160),
    RGBColor(160, 20, 40),
    RGBColor(0, 80, 60),
    RGBColor(150, 150, 150),
    RGBColor(120, 200, 60),
    RGBColor(230, 60, 170),
    RGBColor(90, 45, 20),
    RGBColor(30, 40, 110),
];

/// A picture of 8-bit RGB.
pub struct Picture {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Rows from the top, three bytes a pixel.
    pub rgb: Vec<u8>,
}

type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;
type LogAxes = Cartesian2d<plotters::coord::combinators::LogCoord<f64>, plotters::coord::combinators::LogCoord<f64>>;

fn fonts() -> Result<()> {
    // registration is global; it happens once
    static DONE: OnceLock<bool> = OnceLock::new();
    let done = *DONE.get_or_init(|| register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_ok());
    if done { Ok(()) } else { Err(failed("the font is broken")) }
}

fn failed(why: impl std::fmt::Display) -> Error {
    Error::CheckFailed(format!("cannot draw the plot: {why}"))
}

/// Draws all results. Scenes of a family (`terrain:N`) are joined by lines: circles for the first family, triangles for the
/// second, crosses for others; scenes without a family are hollow circles. The dashed line falls as
/// 1 / log n from the first point of the first contestant.
///
/// # Errors
/// [`Error::Usage`] when there is no result to draw.
pub fn draw(benchmark: &RayBenchmark) -> Result<Picture> {
    fonts()?;
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
    if streams.is_empty() {
        return Err(Error::Usage("--plot: nothing was measured, so there is nothing to draw".into()));
    }
    let columns = streams.len().min(2) as u32;
    let rows = (streams.len() as u32).div_ceil(columns);
    let legend = (contestants.len() as u32).div_ceil(2 * columns) * LEGEND_LINE + 16;
    let (width, height) = (columns * PANEL[0], HEAD + rows * PANEL[1] + legend);
    let mut rgb = vec![255u8; 3 * (width * height) as usize];
    {
        let root = BitMapBackend::with_buffer(&mut rgb, (width, height)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let (head, rest) = root.split_vertically(HEAD);
        let (panels, foot) = rest.split_vertically(rows * PANEL[1]);
        let title = format!("{} ({}), {} threads", benchmark.device, benchmark.driver, benchmark.threads);
        let text = |size: f64| ("sans-serif", size).into_font().color(&BLACK);
        head.draw(&Text::new("Mrays/s against triangles and spheres", (16, 8), text(26.0))).map_err(failed)?;
        head.draw(&Text::new(title, (16, 40), text(17.0))).map_err(failed)?;
        for (stream, area) in streams.iter().zip(panels.split_evenly((rows as usize, columns as usize))) {
            panel(benchmark, stream, &contestants, &area)?;
        }
        draw_legend(&contestants, 2 * columns, width, &foot)?;
        root.present().map_err(failed)?;
    }
    Ok(Picture { width, height, rgb })
}

/// One result: size, and median, least and greatest rate.
#[derive(Clone, Copy)]
struct Mark {
    size: f64,
    rate: f64,
    min: f64,
    max: f64,
}

/// Each of a run's contestants has its own; those beyond the list get its colours again, lighter each time.
fn color(k: usize) -> RGBColor {
    let RGBColor(r, g, b) = COLORS[k % COLORS.len()];
    let lighter = |c: u8| (0..k / COLORS.len()).fold(c, |c, _| c + (230 - c.min(230)) / 2);
    RGBColor(lighter(r), lighter(g), lighter(b))
}

fn panel(benchmark: &RayBenchmark, stream: &str, contestants: &[&str], area: &Area) -> Result<()> {
    let here = || benchmark.rows().filter(|(_, t, r)| t.stream == stream && r.device.median > 0.0);
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (lo, hi) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        // air around it, and an axis even for a single point
        (lo / 1.6, hi * 1.6)
    };
    let x = range(&mut here().map(|(s, _, _)| (s.primitives() as f64).max(1.0)));
    let y = range(&mut here().flat_map(|(_, _, r)| [r.device.min, r.device.max]).filter(|v| *v > 0.0));
    if x.0 > x.1 || y.0 > y.1 {
        return Ok(());
    }
    let mut chart = ChartBuilder::on(area)
        .caption(stream, ("sans-serif", 20))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(56)
        .build_cartesian_2d((x.0..x.1).log_scale(), (y.0..y.1).log_scale())
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc("triangles and spheres")
        .y_desc("Mrays/s")
        .x_label_formatter(&|v| short(*v))
        .y_label_formatter(&|v| short(*v))
        .label_style(("sans-serif", 15))
        .light_line_style(RGBColor(238, 238, 238))
        .bold_line_style(RGBColor(205, 205, 205))
        .draw()
        .map_err(failed)?;
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

type Chart<'a, 'b> = ChartContext<'a, BitMapBackend<'b>, LogAxes>;

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

fn draw_legend(contestants: &[&str], columns: u32, width: u32, area: &Area) -> Result<()> {
    let text = ("sans-serif", 17).into_font().color(&BLACK);
    for (k, name) in contestants.iter().enumerate() {
        let (column, row) = (k as u32 % columns, k as u32 / columns);
        let (x, y) = ((column * (width / columns) + 24) as i32, (row * LEGEND_LINE + 4) as i32);
        let line = PathElement::new(vec![(x, y + 9), (x + 26, y + 9)], color(k).stroke_width(3));
        area.draw(&line).map_err(failed)?;
        area.draw(&Circle::new((x + 13, y + 9), 4, color(k).filled())).map_err(failed)?;
        area.draw(&Text::new((*name).to_owned(), (x + 36, y), text.clone())).map_err(failed)?;
    }
    Ok(())
}

/// 10k, 2.5M, 0.3.
fn short(v: f64) -> String {
    let (scaled, unit) = match v {
        v if v >= 1e6 => (v * 1e-6, "M"),
        v if v >= 1e3 => (v * 1e-3, "k"),
        v => (v, ""),
    };
    // three digits at most, no zeros after the point
    let text = format!("{scaled:.2}");
    format!("{}{unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::benchmark::{RunRecord, SceneRecord, StreamRecord};

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
        RayBenchmark { device: "a device".into(), scenes: scenes.collect(), ..Default::default() }
    }

    /// Pixels of the first contestant's colour in a picture of the given results.
    fn colored(rates: &[(&str, u64, f64)]) -> usize {
        let p = draw(&benchmark(rates)).unwrap();
        assert_eq!(p.rgb.len(), 3 * (p.width * p.height) as usize);
        let panel = &p.rgb[3 * (HEAD * p.width) as usize..3 * ((HEAD + PANEL[1]) * p.width) as usize];
        panel.chunks(3).filter(|c| *c == [COLORS[0].0, COLORS[0].1, COLORS[0].2]).count()
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
    fn contestants_have_colors_of_their_own() {
        let apart = |a: RGBColor, b: RGBColor| a.0.abs_diff(b.0) as u32 + a.1.abs_diff(b.1) as u32 + a.2.abs_diff(b.2) as u32;
        for a in 0..2 * COLORS.len() {
            for b in 0..a {
                let least = if a < COLORS.len() { 80 } else { 10 };
                assert!(apart(color(a), color(b)) >= least, "{a} and {b}: {:?} {:?}", color(a), color(b));
            }
        }
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

    #[test]
    fn labels_are_short() {
        assert_eq!([0.5, 10.0, 1e4, 2.5e6, 25e6].map(short), ["0.5", "10", "10k", "2.5M", "25M"]);
    }
}
