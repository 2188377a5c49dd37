//! Draws plots on any backend of plotters: panels side by side, below a title and one legend.

use plotters::coord::Shift;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::{LogAxis, Tick};
use super::layout::{
    HEAD, INSET, Layout, LegendEntry, MARGINS, NUMBER, PANEL, PANEL_TITLE, SIZES, SUBTITLE, Symbol, TEXT, TITLE, fit, rows_of,
    text_width,
};
use super::panel::{Mark, Panel, Plot, Point, Series};
use crate::error::{Error, Result};
use crate::report::labels::{self, LINE_FROM, Rect};

/// Radius of a point.
const RADIUS: f64 = 4.0;
/// Series of more points have small ones.
const MANY: usize = 12;
/// How much lower than its middle a text is drawn: boxes of text have room for descenders, which numbers do not have.
const DESCENT: f64 = 1.5;

const GRID: RGBColor = RGBColor(205, 205, 205);
const FINE_GRID: RGBColor = RGBColor(236, 236, 236);
const FRAME: RGBColor = RGBColor(110, 110, 110);
/// What is dominated.
const DOMINATED: RGBColor = RGBColor(165, 165, 165);
const QUIET_TEXT: RGBColor = RGBColor(115, 115, 115);
const GUIDE: RGBColor = RGBColor(90, 90, 90);

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
    RGBColor(150, 120, 110),
    RGBColor(120, 200, 60),
    RGBColor(230, 60, 170),
    RGBColor(90, 45, 20),
    RGBColor(30, 40, 110),
];

/// Each name has its own; those beyond the list get its colours again, lighter each time.
fn color(k: usize) -> RGBColor {
    let RGBColor(r, g, b) = COLORS[k % COLORS.len()];
    let lighter = |c: u8| (0..k / COLORS.len()).fold(c, |c, _| c + (230 - c.min(230)) / 2);
    RGBColor(lighter(r), lighter(g), lighter(b))
}

/// An error of drawing; there is no reason for one but a mistake of ours.
pub fn failed(why: impl std::fmt::Display) -> Error {
    Error::CheckFailed(format!("cannot draw the plot: {why}"))
}

type Area<DB> = DrawingArea<DB, Shift>;

/// Draws a plot.
///
/// # Errors
/// Those of the backend.
pub fn plot<DB: DrawingBackend>(plot: &Plot, layout: &Layout, area: &Area<DB>) -> Result<()> {
    let canvas = Canvas { area, scale: f64::from(layout.scale) };
    area.fill(&WHITE).map_err(failed)?;
    let width = f64::from(layout.columns * PANEL[0] - 2 * INSET);
    let left = f64::from(INSET);
    for (text, y, size) in [(&plot.title, 8.0, TITLE), (&plot.subtitle, 39.0, SUBTITLE)] {
        canvas.text(&fit(text, width, SIZES[size]), [left, y], size, BLACK, (HPos::Left, VPos::Top))?;
    }
    for entry in &layout.legend {
        canvas.legend_entry(entry)?;
    }
    let names = plot.colored_names();
    for (row, panels) in rows_of(plot, layout.columns).into_iter().enumerate() {
        for (column, panel) in panels.into_iter().enumerate() {
            let x = f64::from(column as u32 * PANEL[0]);
            let y = f64::from(HEAD + layout.legend_height + row as u32 * PANEL[1]);
            canvas.panel(panel, &names, [x, y])?;
        }
    }
    area.present().map_err(failed)
}

/// A drawing area in units.
struct Canvas<'a, DB: DrawingBackend> {
    area: &'a Area<DB>,
    scale: f64,
}

/// Axes of a panel and its frame, units.
struct Frame {
    x: LogAxis,
    y: LogAxis,
    rect: Rect,
}

impl Frame {
    fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let Rect { x: left, y: top, width, height } = self.rect;
        [left + self.x.clamped(x) * width, top + (1.0 - self.y.clamped(y)) * height]
    }

    fn of(&self, p: &Point) -> [f64; 2] {
        self.at(p.x, p.y)
    }
}

impl<DB: DrawingBackend> Canvas<'_, DB> {
    fn pixel(&self, [x, y]: [f64; 2]) -> (i32, i32) {
        ((x * self.scale).round() as i32, (y * self.scale).round() as i32)
    }

    fn text(&self, text: &str, at: [f64; 2], size: usize, color: RGBColor, (h, v): (HPos, VPos)) -> Result<()> {
        let style = ("sans-serif", f64::from(SIZES[size]) * self.scale).into_font().color(&color).pos(Pos::new(h, v));
        let at = if matches!(v, VPos::Center) { [at[0], at[1] + DESCENT] } else { at };
        self.area.draw(&Text::new(text.to_owned(), self.pixel(at), style)).map_err(failed)
    }

    fn line(&self, points: &[[f64; 2]], color: RGBColor, width: f64) -> Result<()> {
        let points: Vec<_> = points.iter().map(|p| self.pixel(*p)).collect();
        self.area.draw(&PathElement::new(points, color.stroke_width(self.width(width)))).map_err(failed)
    }

    fn dashed(&self, points: &[[f64; 2]], color: RGBColor, width: f64) -> Result<()> {
        let points: Vec<_> = points.iter().map(|p| self.pixel(*p)).collect();
        let [dash, gap] = [6.0, 5.0].map(|length| (length * self.scale) as u32);
        let style = color.stroke_width(self.width(width));
        self.area.draw(&DashedPathElement::new(points, dash, gap, style)).map_err(failed)
    }

    fn width(&self, width: f64) -> u32 {
        (width * self.scale).round().max(1.0) as u32
    }

    fn point(&self, at: [f64; 2], mark: Mark, color: RGBColor, radius: f64) -> Result<()> {
        let (at, radius) = (self.pixel(at), (radius * self.scale) as i32);
        let stroke = color.stroke_width(self.width(2.0));
        match mark {
            Mark::Triangles => self.area.draw(&TriangleMarker::new(at, radius * 3 / 2, color.filled())),
            Mark::Crosses => self.area.draw(&Cross::new(at, radius, stroke)),
            Mark::Circles => self.area.draw(&Circle::new(at, radius, stroke)),
            Mark::Discs | Mark::Labelled => self.area.draw(&Circle::new(at, radius, color.filled())),
            Mark::Front | Mark::Guide | Mark::Level => Ok(()),
        }
        .map_err(failed)
    }

    fn legend_entry(&self, entry: &LegendEntry) -> Result<()> {
        let (x, y) = (f64::from(entry.at[0]), f64::from(HEAD + entry.at[1]) + 11.0);
        let middle = [x + 13.0, y];
        let stroke = [[x, y], [x + 26.0, y]];
        match entry.symbol {
            Symbol::Series(k) => {
                self.line(&stroke, color(k), 2.5)?;
                self.point(middle, Mark::Discs, color(k), RADIUS)?;
            }
            Symbol::Front => self.line(&stroke, FRAME, 1.5)?,
            Symbol::Dominated => self.point(middle, Mark::Discs, DOMINATED, RADIUS)?,
            Symbol::Guide => self.dashed(&stroke, GUIDE, 1.0)?,
            Symbol::Bar => self.bar([[x + 3.0, y], [x + 23.0, y]], FRAME)?,
        }
        self.text(&entry.name, [x + 34.0, y], TEXT, BLACK, (HPos::Left, VPos::Center))
    }

    /// A bar with its ends, along x or y.
    fn bar(&self, [a, b]: [[f64; 2]; 2], color: RGBColor) -> Result<()> {
        self.line(&[a, b], color, 1.0)?;
        let across = if a[1] == b[1] { [0.0, 3.0] } else { [3.0, 0.0] };
        [a, b].iter().try_for_each(|end| {
            let ends = [-1.0, 1.0].map(|side| [end[0] + side * across[0], end[1] + side * across[1]]);
            self.line(&ends, color, 1.0)
        })
    }

    fn panel(&self, panel: &Panel, names: &[&str], [left, top]: [f64; 2]) -> Result<()> {
        let [ml, mt, mr, mb] = MARGINS.map(f64::from);
        let [width, height] = PANEL.map(f64::from);
        let rect = Rect { x: left + ml, y: top + mt, width: width - ml - mr, height: height - mt - mb };
        let title = fit(&panel.title, width - 2.0 * f64::from(INSET), SIZES[PANEL_TITLE]);
        let middle = rect.x + 0.5 * rect.width;
        self.text(&title, [left + 0.5 * width, top + 22.0], PANEL_TITLE, BLACK, (HPos::Center, VPos::Center))?;
        let points = || panel.series.iter().flat_map(Series::placed);
        let ends = |bar: Option<[f64; 2]>| bar.into_iter().flatten();
        let x = LogAxis::of(points().flat_map(|p| ends(p.x_bar).chain([p.x])));
        let y = LogAxis::of(points().flat_map(|p| ends(p.y_bar).chain([p.y])));
        let (Some(x), Some(y)) = (x, y) else {
            let nothing = [middle, rect.y + 0.5 * rect.height];
            return self.text("nothing that has a place here", nothing, TEXT, QUIET_TEXT, (HPos::Center, VPos::Center));
        };
        let frame = Frame { x, y, rect };
        self.axes(panel, &frame)?;
        // dominated points below the others
        let is_below = |s: &&Series| s.points.iter().all(|p| p.is_dominated);
        let (below, above): (Vec<&Series>, Vec<&Series>) = panel.series.iter().partition(is_below);
        below.into_iter().chain(above).try_for_each(|s| self.series(s, names, &frame))?;
        self.labels(panel, names, &frame)
    }

    fn axes(&self, panel: &Panel, frame: &Frame) -> Result<()> {
        let Rect { x: left, y: top, width, height } = frame.rect;
        let (right, bottom) = (left + width, top + height);
        // numbers side by side keep a space of two digits, numbers below each other half a line
        let beside = |ticks: &[Tick]| {
            let half = |t: &Tick| 0.5 * text_width(&t.text, SIZES[NUMBER]);
            ticks
                .windows(2)
                .all(|w| (frame.x.place(w[1].value) - frame.x.place(w[0].value)) * width > half(&w[0]) + half(&w[1]) + 16.0)
        };
        let below = |ticks: &[Tick]| {
            let least = 1.6 * f64::from(SIZES[NUMBER]);
            ticks.windows(2).all(|w| (frame.y.place(w[1].value) - frame.y.place(w[0].value)) * height > least)
        };
        let (across, up) = (frame.x.ticks(beside), frame.y.ticks(below));
        // fine lines first
        for with_text in [false, true] {
            let color = if with_text { GRID } else { FINE_GRID };
            for t in across.iter().filter(|t| t.text.is_empty() != with_text) {
                let x = left + frame.x.place(t.value) * width;
                self.line(&[[x, top], [x, bottom]], color, 1.0)?;
                self.text(&t.text, [x, bottom + 7.0], NUMBER, BLACK, (HPos::Center, VPos::Top))?;
            }
            for t in up.iter().filter(|t| t.text.is_empty() != with_text) {
                let y = bottom - frame.y.place(t.value) * height;
                self.line(&[[left, y], [right, y]], color, 1.0)?;
                self.text(&t.text, [left - 8.0, y], NUMBER, BLACK, (HPos::Right, VPos::Center))?;
            }
        }
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        self.line(&corners, FRAME, 1.0)?;
        let middle = [left + 0.5 * width, bottom + 42.0];
        self.text(&panel.x, middle, TEXT, BLACK, (HPos::Center, VPos::Center))?;
        let style = ("sans-serif", f64::from(SIZES[TEXT]) * self.scale).into_font().transform(FontTransform::Rotate270);
        let style = style.color(&BLACK).pos(Pos::new(HPos::Center, VPos::Center));
        let at = self.pixel([left - 62.0, top + 0.5 * height]);
        self.area.draw(&Text::new(panel.y.clone(), at, style)).map_err(failed)
    }

    fn series(&self, series: &Series, names: &[&str], frame: &Frame) -> Result<()> {
        let points: Vec<&Point> = series.placed().collect();
        let places: Vec<[f64; 2]> = points.iter().map(|p| frame.of(p)).collect();
        match series.mark {
            Mark::Front => return self.line(&steps(&places, &frame.rect), FRAME, 1.5),
            Mark::Guide => return self.dashed(&places, GUIDE, 1.0),
            Mark::Level => {
                let Rect { x: left, width, .. } = frame.rect;
                return places.first().map_or(Ok(()), |[_, y]| self.dashed(&[[left, *y], [left + width, *y]], GUIDE, 1.0));
            }
            _ => {}
        }
        let own = color_of(&series.name, names);
        // a curve of many points is a line with small ones
        let radius = if points.len() > MANY { 0.5 * RADIUS } else { RADIUS };
        if series.mark.is_joined() && places.len() > 1 {
            self.line(&places, own, 2.0)?;
        }
        for (point, at) in points.iter().zip(&places) {
            let color = if point.is_dominated { DOMINATED } else { own };
            bars(point, frame).into_iter().try_for_each(|bar| self.bar(bar, color))?;
            self.point(*at, series.mark, color, radius)?;
        }
        Ok(())
    }

    /// Names of points beside them.
    fn labels(&self, panel: &Panel, names: &[&str], frame: &Frame) -> Result<()> {
        let labelled: Vec<(&Series, &Point)> =
            panel.series.iter().flat_map(|s| s.placed().filter(|p| !p.label.is_empty()).map(move |p| (s, p))).collect();
        let mut obstacles = Vec::new();
        let radius = RADIUS;
        for series in &panel.series {
            let places: Vec<[f64; 2]> = series.placed().map(|p| frame.of(p)).collect();
            match series.mark {
                Mark::Front => {
                    obstacles.extend(steps(&places, &frame.rect).windows(2).map(|w| Rect::between(w[0], w[1]).grown(1.0)))
                }
                mark if mark.has_points() => obstacles.extend(places.iter().map(|p| Rect::between(*p, *p).grown(radius + 1.0))),
                _ => {}
            }
            // lines, in short pieces
            if series.mark.is_joined() && series.mark != Mark::Front {
                for w in places.windows(2) {
                    let piece = |k: u32| [0, 1].map(|c| w[0][c] + (w[1][c] - w[0][c]) * f64::from(k) / 24.0);
                    obstacles.extend((0..24).map(|k| Rect::between(piece(k), piece(k + 1)).grown(1.0)));
                }
            }
            let bars = series.placed().flat_map(|p| bars(p, frame)).map(|[a, b]| Rect::between(a, b).grown(2.0));
            obstacles.extend(bars);
        }
        // as high as capital letters with some air, not as high as a line
        let size = |p: &Point| [text_width(&p.label, SIZES[TEXT]) + 2.0, f64::from(SIZES[TEXT]) * 0.85];
        let requests: Vec<_> = labelled.iter().map(|(_, p)| (frame.of(p), size(p))).collect();
        let placed = labels::place(&requests, frame.rect.grown(-2.0), &obstacles);
        for ((series, point), label) in labelled.iter().zip(placed) {
            let color = if point.is_dominated { QUIET_TEXT } else { color_of(&series.name, names) };
            let middle = [label.rect.x + 0.5 * label.rect.width, label.rect.y + 0.5 * label.rect.height];
            if label.distance > LINE_FROM {
                let from = frame.of(point);
                let clamp = |k: usize, lo: f64, length: f64| from[k].clamp(lo, lo + length);
                let to = [clamp(0, label.rect.x, label.rect.width), clamp(1, label.rect.y, label.rect.height)];
                self.line(&[from, to], GRID, 1.0)?;
            }
            // lines of the grid do not go through the text
            let [from, to] =
                [[label.rect.x, label.rect.y], [label.rect.x + label.rect.width, label.rect.y + label.rect.height]];
            let corners = [self.pixel(from), self.pixel(to)];
            self.area.draw(&Rectangle::new(corners, WHITE.mix(0.75).filled())).map_err(failed)?;
            self.text(&point.label, middle, TEXT, color, (HPos::Center, VPos::Center))?;
        }
        Ok(())
    }
}

fn color_of(name: &str, names: &[&str]) -> RGBColor {
    names.iter().position(|n| *n == name).map_or(DOMINATED, color)
}

/// Bars of a point that are longer than the point is wide.
fn bars(p: &Point, frame: &Frame) -> Vec<[[f64; 2]; 2]> {
    let x = p.x_bar.map(|[a, b]| [frame.at(a, p.y), frame.at(b, p.y)]);
    let y = p.y_bar.map(|[a, b]| [frame.at(p.x, a), frame.at(p.x, b)]);
    let is_long = |[a, b]: &[[f64; 2]; 2]| (a[0] - b[0]).abs() + (a[1] - b[1]).abs() > 2.0 * RADIUS;
    [x, y].into_iter().flatten().filter(is_long).collect()
}

/// The border of what is dominated by points in the order of their x: down to the first from the top of the frame, then in steps, then to the right.
fn steps(places: &[[f64; 2]], frame: &Rect) -> Vec<[f64; 2]> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return Vec::new() };
    let mut line = vec![[first[0], frame.y], *first];
    line.extend(places.windows(2).flat_map(|w| [[w[1][0], w[0][1]], w[1]]));
    line.push([frame.x + frame.width, last[1]]);
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_have_colors_of_their_own() {
        let apart = |a: RGBColor, b: RGBColor| a.0.abs_diff(b.0) as u32 + a.1.abs_diff(b.1) as u32 + a.2.abs_diff(b.2) as u32;
        for a in 0..2 * COLORS.len() {
            for b in 0..a {
                let least = if a < COLORS.len() { 80 } else { 10 };
                assert!(apart(color(a), color(b)) >= least, "{a} and {b}: {:?} {:?}", color(a), color(b));
            }
        }
    }

    #[test]
    fn the_front_has_steps() {
        let frame = Rect { x: 0.0, y: 0.0, width: 100.0, height: 100.0 };
        let line = steps(&[[10.0, 50.0], [40.0, 80.0]], &frame);
        assert_eq!(line, [[10.0, 0.0], [10.0, 50.0], [40.0, 50.0], [40.0, 80.0], [100.0, 80.0]]);
    }
}
