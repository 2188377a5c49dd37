//! Parts of the plots of benchmarks: panels of two logarithmic axes, lines, a legend.
//!
//! Drawn with the fonts that this program carries, so that it needs neither a display nor fonts on the machine.

use std::sync::OnceLock;

use plotters::coord::Shift;
use plotters::coord::combinators::LogCoord;
use plotters::prelude::*;
use plotters::style::register_font;

use crate::error::{Error, Result};

/// Pixels of a panel.
pub(super) const PANEL: [u32; 2] = [760, 470];
/// Pixels above the panels.
pub(super) const HEAD: u32 = 64;
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

pub(super) type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;
pub(super) type Chart<'a, 'b> = ChartContext<'a, BitMapBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;

fn register_fonts() -> Result<()> {
    // registration is global; it happens once
    static DONE: OnceLock<bool> = OnceLock::new();
    let done = *DONE.get_or_init(|| register_font("sans-serif", FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT).is_ok());
    if done { Ok(()) } else { Err(failed("the font is broken")) }
}

pub(super) fn failed(why: impl std::fmt::Display) -> Error {
    Error::CheckFailed(format!("cannot draw the plot: {why}"))
}

/// Each line has its own; those beyond the list get its colours again, lighter each time.
pub(super) fn color(k: usize) -> RGBColor {
    let RGBColor(r, g, b) = COLORS[k % COLORS.len()];
    let lighter = |c: u8| (0..k / COLORS.len()).fold(c, |c, _| c + (230 - c.min(230)) / 2);
    RGBColor(lighter(r), lighter(g), lighter(b))
}

/// An empty panel whose axes hold the given numbers, all of them above 0; `None` for none. `texts`: what stands over it, along x, along y.
pub(super) fn axes<'a, 'b>(
    area: &'a Area<'b>,
    texts: [&str; 3],
    x: impl Iterator<Item = f64>,
    y: impl Iterator<Item = f64>,
) -> Result<Option<Chart<'a, 'b>>> {
    let range = |values: &mut dyn Iterator<Item = f64>| {
        let (lo, hi) = values.fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(v), h.max(v)));
        // air around it, and an axis even for a single point
        (lo / 1.6, hi * 1.6)
    };
    let (x, y) = (range(&mut { x }), range(&mut { y }));
    if x.0 > x.1 || y.0 > y.1 {
        return Ok(None);
    }
    let mut chart = ChartBuilder::on(area)
        .caption(texts[0], ("sans-serif", 20))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(56)
        .build_cartesian_2d((x.0..x.1).log_scale(), (y.0..y.1).log_scale())
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc(texts[1])
        .y_desc(texts[2])
        .x_label_formatter(&|v| short(*v))
        .y_label_formatter(&|v| short(*v))
        .label_style(("sans-serif", 15))
        .light_line_style(RGBColor(238, 238, 238))
        .bold_line_style(RGBColor(205, 205, 205))
        .draw()
        .map_err(failed)?;
    Ok(Some(chart))
}

fn draw_legend(names: &[&str], columns: u32, width: u32, area: &Area) -> Result<()> {
    let text = ("sans-serif", 17).into_font().color(&BLACK);
    for (k, name) in names.iter().enumerate() {
        let (column, row) = (k as u32 % columns, k as u32 / columns);
        let (x, y) = ((column * (width / columns) + 24) as i32, (row * LEGEND_LINE + 4) as i32);
        let line = PathElement::new(vec![(x, y + 9), (x + 26, y + 9)], color(k).stroke_width(3));
        area.draw(&line).map_err(failed)?;
        area.draw(&Circle::new((x + 13, y + 9), 4, color(k).filled())).map_err(failed)?;
        area.draw(&Text::new((*name).to_owned(), (x + 36, y), text.clone())).map_err(failed)?;
    }
    Ok(())
}

/// A line of a panel.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// In the legend; lines of the same name have the same colour in all panels.
    pub name: String,
    /// Points, in the order in which they are joined. Those that are not finite and above 0 have no place and are left out.
    pub points: Vec<(f64, f64)>,
}

/// A panel of lines; both axes are logarithmic.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Over it.
    pub title: String,
    /// Along x.
    pub x: String,
    /// Along y.
    pub y: String,
    /// What is in it.
    pub lines: Vec<Line>,
}

/// Draws panels, two in a row, with one legend.
///
/// # Errors
/// [`Error::Usage`] when there is no panel.
pub fn draw(title: &str, subtitle: &str, panels: &[Panel]) -> Result<Picture> {
    let mut names: Vec<&str> = Vec::new();
    for line in panels.iter().flat_map(|p| &p.lines) {
        if !names.contains(&line.name.as_str()) {
            names.push(&line.name);
        }
    }
    draw_sheet([title, subtitle], &names, panels.len(), |k, area| draw_panel(&panels[k], &names, area))
}

/// Lays out panels, two in a row, under a title and a subtitle and over the legend of `names`; `draw_panel` fills one, by its index.
///
/// # Errors
/// [`Error::Usage`] when there is no panel; those of `draw_panel`.
pub(super) fn draw_sheet(
    [title, subtitle]: [&str; 2],
    names: &[&str],
    panels: usize,
    draw_panel: impl Fn(usize, &Area) -> Result<()>,
) -> Result<Picture> {
    register_fonts()?;
    if panels == 0 {
        return Err(Error::Usage("--plot: nothing was measured, so there is nothing to draw".into()));
    }
    let columns = panels.min(2) as u32;
    let rows = (panels as u32).div_ceil(columns);
    let legend = (names.len() as u32).div_ceil(2 * columns) * LEGEND_LINE + 16;
    let (width, height) = (columns * PANEL[0], HEAD + rows * PANEL[1] + legend);
    let mut rgb = vec![255u8; 3 * (width * height) as usize];
    {
        let root = BitMapBackend::with_buffer(&mut rgb, (width, height)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let (head, rest) = root.split_vertically(HEAD);
        let (middle, foot) = rest.split_vertically(rows * PANEL[1]);
        let text = |size: f64| ("sans-serif", size).into_font().color(&BLACK);
        head.draw(&Text::new(title.to_owned(), (16, 8), text(26.0))).map_err(failed)?;
        head.draw(&Text::new(subtitle.to_owned(), (16, 40), text(17.0))).map_err(failed)?;
        for (k, area) in middle.split_evenly((rows as usize, columns as usize)).iter().enumerate().take(panels) {
            draw_panel(k, area)?;
        }
        draw_legend(names, 2 * columns, width, &foot)?;
        root.present().map_err(failed)?;
    }
    Ok(Picture { width, height, rgb })
}

fn draw_panel(panel: &Panel, names: &[&str], area: &Area) -> Result<()> {
    let placed = |(x, y): &&(f64, f64)| x.is_finite() && y.is_finite() && *x > 0.0 && *y > 0.0;
    let all = || panel.lines.iter().flat_map(|l| l.points.iter().filter(placed));
    let texts = [panel.title.as_str(), &panel.x, &panel.y];
    let Some(mut chart) = axes(area, texts, all().map(|p| p.0), all().map(|p| p.1))? else { return Ok(()) };
    for line in &panel.lines {
        let color = color(names.iter().position(|n| *n == line.name).unwrap_or(0));
        let points: Vec<(f64, f64)> = line.points.iter().filter(placed).copied().collect();
        if points.len() > 1 {
            chart.draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2))).map_err(failed)?;
        }
        chart.draw_series(points.iter().map(|p| Circle::new(*p, 4, color.filled()))).map_err(failed)?;
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
    let text = if v < 0.1 { format!("{scaled:.4}") } else { format!("{scaled:.2}") };
    format!("{}{unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_drawn_and_what_has_no_place_is_not() {
        let line = |points: &[(f64, f64)]| Line { name: "a".into(), points: points.to_vec() };
        let colored = |points: &[(f64, f64)]| {
            let p = draw("title", "subtitle", &[Panel { lines: vec![line(points)], ..Default::default() }]).unwrap();
            assert_eq!(p.rgb.len(), 3 * (p.width * p.height) as usize);
            let panel = &p.rgb[3 * (HEAD * p.width) as usize..3 * ((HEAD + PANEL[1]) * p.width) as usize];
            panel.chunks(3).filter(|c| *c == [COLORS[0].0, COLORS[0].1, COLORS[0].2]).count()
        };
        let one = colored(&[(1.0, 2.0), (5.0, 0.0), (f64::NAN, 1.0)]);
        assert!(one > 20 && colored(&[(1.0, 2.0), (100.0, 0.001)]) > one + 300);
        assert_eq!(colored(&[]), 0);
    }

    #[test]
    fn nothing_to_draw_is_an_error() {
        assert_eq!(draw("", "", &[]).map(|_| ()).unwrap_err().exit_code(), 64);
    }

    #[test]
    fn lines_have_colors_of_their_own() {
        let apart = |a: RGBColor, b: RGBColor| a.0.abs_diff(b.0) as u32 + a.1.abs_diff(b.1) as u32 + a.2.abs_diff(b.2) as u32;
        for a in 0..2 * COLORS.len() {
            for b in 0..a {
                let least = if a < COLORS.len() { 80 } else { 10 };
                assert!(apart(color(a), color(b)) >= least, "{a} and {b}: {:?} {:?}", color(a), color(b));
            }
        }
    }

    #[test]
    fn labels_are_short() {
        assert_eq!([0.002, 0.5, 10.0, 1e4, 2.5e6, 25e6].map(short), ["0.002", "0.5", "10", "10k", "2.5M", "25M"]);
    }
}
