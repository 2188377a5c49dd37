//! Where panels and legend of a plot lie, and how wide its texts are. Lengths are in units: pixels of an SVG.

use plotters::prelude::*;

use super::panel::{Mark, PARETO_FRONT, Panel, Plot, Series};
use crate::error::{Error, Result};

/// Size of a panel, units.
pub const PANEL: [u32; 2] = [640, 430];
/// Around the frame of a panel: left, top, right, bottom.
pub const MARGINS: [u32; 4] = [78, 42, 18, 62];
/// Height of title and subtitle.
pub const HEAD: u32 = 62;
/// Height of a line of the legend.
pub const LEGEND_LINE: u32 = 24;
/// From the left and right edge of the plot to its text.
pub const INSET: u32 = 18;
/// Font sizes: title, subtitle, title of a panel, text, numbers of axes.
pub const SIZES: [u32; 5] = [26, 16, 19, 16, 15];
/// Size of the title. (index in [`SIZES`])
pub const TITLE: usize = 0;
/// Size of the subtitle. (index in [`SIZES`])
pub const SUBTITLE: usize = 1;
/// Size of the titles of panels. (index in [`SIZES`])
pub const PANEL_TITLE: usize = 2;
/// Size of text. (index in [`SIZES`])
pub const TEXT: usize = 3;
/// Size of numbers beside axes. (index in [`SIZES`])
pub const NUMBER: usize = 4;

/// An entry of the legend.
pub struct LegendEntry {
    /// What it looks like.
    pub symbol: Symbol,
    /// Name.
    pub name: String,
    /// Where it begins, units from the left and below the title.
    pub at: [u32; 2],
}

/// What an entry of the legend looks like.
#[derive(Clone, Copy)]
pub enum Symbol {
    /// In the colour with this number.
    Series(usize),
    /// The line of the Pareto front.
    Front,
    /// A grey point.
    Dominated,
    /// A dashed line.
    Guide,
    /// A bar with ends.
    Bar,
}

/// Where everything lies.
pub struct Layout {
    /// Pixels a unit.
    pub scale: u32,
    /// Panels side by side.
    pub columns: u32,
    rows: u32,
    /// Entries of the legend.
    pub legend: Vec<LegendEntry>,
    /// Height of the legend, units.
    pub legend_height: u32,
}

impl Layout {
    /// Lays out a plot; `scale` is pixels a unit.
    ///
    /// # Errors
    /// [`Error::Usage`] for one without panels.
    pub fn new(plot: &Plot, scale: u32) -> Result<Self> {
        let groups = || plot.groups.iter().map(|g| g.len() as u32).filter(|n| *n > 0);
        let Some(columns) = groups().max().map(|n| n.min(2)) else {
            return Err(Error::Usage("--plot: nothing was measured that has a curve, so there is nothing to draw".into()));
        };
        // groups of single panels lie side by side, too
        let columns = if plot.panels().count() > 1 { 2 } else { columns };
        let mut layout =
            Self { scale, columns, rows: rows_of(plot, columns).len() as u32, legend: Vec::new(), legend_height: 0 };
        layout.lay_legend(plot);
        Ok(layout)
    }

    /// Size in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.columns * PANEL[0] * self.scale, (HEAD + self.legend_height + self.rows * PANEL[1]) * self.scale]
    }

    /// Puts the entries of the legend one after the other, into as many lines as they need.
    fn lay_legend(&mut self, plot: &Plot) {
        let colored = plot.colored_names().into_iter().enumerate().map(|(k, name)| (Symbol::Series(k), name.to_owned()));
        let mut entries: Vec<(Symbol, String)> = colored.collect();
        let points = || plot.panels().flat_map(|p| &p.series).flat_map(Series::placed);
        if plot.has(Mark::Front) {
            entries.push((Symbol::Front, PARETO_FRONT.into()));
        }
        if points().any(|p| p.is_dominated) {
            entries.push((Symbol::Dominated, "dominated".into()));
        }
        let mut guides: Vec<&str> = Vec::new();
        for guide in plot
            .panels()
            .flat_map(|p| &p.series)
            .filter(|s| matches!(s.mark, Mark::Guide | Mark::Level) && s.placed().next().is_some())
        {
            if !guides.contains(&guide.name.as_str()) {
                guides.push(&guide.name);
            }
        }
        entries.extend(guides.into_iter().map(|name| (Symbol::Guide, name.to_owned())));
        if points().any(|p| p.x_bar.is_some() || p.y_bar.is_some()) {
            entries.push((Symbol::Bar, "noise".into()));
        }
        let width = self.columns * PANEL[0] - INSET;
        let (mut x, mut y) = (INSET, 0);
        for (symbol, name) in entries {
            let name = fit(&name, f64::from(width - INSET - 40), SIZES[TEXT]);
            let needs = 36 + text_width(&name, SIZES[TEXT]).ceil() as u32;
            if x > INSET && x + needs > width {
                (x, y) = (INSET, y + LEGEND_LINE);
            }
            self.legend.push(LegendEntry { symbol, name, at: [x, y] });
            x += needs + 22;
        }
        self.legend_height = if self.legend.is_empty() { 0 } else { y + LEGEND_LINE + 6 };
    }
}

/// Panels row by row: a group with several begins a new row, groups of one follow each other.
pub fn rows_of(plot: &Plot, columns: u32) -> Vec<Vec<&Panel>> {
    let mut rows: Vec<Vec<&Panel>> = Vec::new();
    let mut previous_is_alone = false;
    for group in plot.groups.iter().filter(|g| !g.is_empty()) {
        let is_alone = group.len() == 1;
        let has_room = rows.last().is_some_and(|r| r.len() < columns as usize);
        match rows.last_mut() {
            Some(row) if is_alone && previous_is_alone && has_room => row.push(&group[0]),
            _ => rows.extend(group.chunks(columns as usize).map(|c| c.iter().collect())),
        }
        previous_is_alone = is_alone;
    }
    rows
}

/// Width of a text, units.
pub fn text_width(text: &str, size: u32) -> f64 {
    // the size of a text at several times its size: boxes are of whole pixels
    let font = ("sans-serif", f64::from(size) * 4.0).into_font();
    font.box_size(text).map_or(0.0, |(w, _)| f64::from(w) / 4.0)
}

/// The text, or its end after an ellipsis where it is too wide: names of files differ in their ends.
pub fn fit(text: &str, width: f64, size: u32) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let tails = text.char_indices().skip(1).map(|(k, _)| format!("…{}", &text[k..]));
    tails.into_iter().find(|t| text_width(t, size) <= width).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_begin_rows() {
        let panels = |n: usize| vec![Panel::default(); n];
        let rows = |groups: &[usize]| -> Vec<usize> {
            let plot = Plot { groups: groups.iter().map(|n| panels(*n)).collect(), ..Plot::default() };
            rows_of(&plot, 2).iter().map(Vec::len).collect()
        };
        assert_eq!(rows(&[3, 2]), [2, 1, 2]);
        assert_eq!(rows(&[1, 1, 1]), [2, 1]);
        assert_eq!(rows(&[1, 2, 0, 1]), [1, 2, 1]);
    }
}
