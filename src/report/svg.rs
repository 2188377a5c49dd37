//! Charts as one SVG file, which is looked at without a page.

use std::collections::HashMap;
use std::path::Path;

use minijinja::context;
use serde::Serialize;

use super::chart::Chart;
use super::layout::{COLORS, ChartLayout};
use super::page::{broken, templates, write_text};
use crate::error::{Error, Result};

/// Colours of series on white (Okabe and Ito, "Color Universal Design", 2008): those of pages.
const ON_WHITE: [&str; COLORS] =
    ["#0072b2", "#d55e00", "#009e73", "#b4578d", "#b07c00", "#6e3ca0", "#78782a", "#1d2125"];
/// Height of title and subtitle, pixels.
const HEAD: f64 = 92.0;
/// Height of a line of a legend, pixels.
const LEGEND_LINE: f64 = 20.0;
/// Width of a letter of a legend, pixels: a little too much room is no harm.
const LETTER: f64 = 7.6;
/// Space below a chart and its legend, pixels.
const GAP: f64 = 42.0;

#[derive(Serialize)]
struct ChartCell {
    chart: ChartLayout,
    at: [f64; 2],
    legend: Vec<LegendEntry>,
}

#[derive(Serialize)]
struct LegendEntry {
    name: String,
    color: usize,
    is_neutral: bool,
    is_dashed: bool,
    at: [f64; 2],
}

/// Fails unless a file's name ends in .svg. `option` is what the user gave it by.
pub fn check_svg_name(option: &str, path: &Path) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("svg")) {
        return Ok(());
    }
    Err(Error::Usage(format!("{option} {}: the name must end in .svg", path.display())))
}

/// Draws charts below a title, two side by side, and writes them to `path`.
///
/// # Errors
/// [`Error::Usage`] for another name than one in .svg, and for no chart; [`Error::Output`].
pub fn write_svg(path: &Path, title: &str, subtitle: &str, charts: &[Chart]) -> Result<()> {
    check_svg_name("--plot", path)?;
    write_text(path, &draw_svg(title, subtitle, charts)?)
}

/// Draws charts as the text of an SVG.
///
/// # Errors
/// [`Error::Usage`] where there is no chart.
fn draw_svg(title: &str, subtitle: &str, charts: &[Chart]) -> Result<String> {
    if charts.is_empty() {
        return Err(Error::Usage("--plot: nothing was measured that has a curve, so there is nothing to draw".into()));
    }

    // series of the same name have the same colour in all charts
    let mut colors = HashMap::new();
    let mut color = |name: &str| {
        let next = colors.len() % COLORS;
        *colors.entry(name.to_owned()).or_insert(next)
    };
    let layouts: Vec<ChartLayout> = charts.iter().map(|chart| ChartLayout::new(chart, &mut color)).collect();

    // rows of two charts, each as high as its longest legend needs
    let columns = layouts.len().min(2);
    let [cell_width, chart_height] = layouts[0].size;
    let mut cells = Vec::new();
    let mut top = HEAD;
    let mut layouts = layouts.into_iter().peekable();
    while layouts.peek().is_some() {
        let mut row_height = 0.0f64;
        for (column, chart) in layouts.by_ref().take(columns).enumerate() {
            let legend = place_legend(&chart);
            let lines = legend.last().map_or(0.0, |entry| entry.at[1] - chart_height);
            row_height = row_height.max(chart_height + lines + GAP);
            cells.push(ChartCell { chart, at: [column as f64 * cell_width, top], legend });
        }
        top += row_height;
    }

    let template = templates()?;
    let template = template.get_template("plot.xml").map_err(broken)?;
    let width = columns as f64 * cell_width;
    let text = template.render(context! { title, subtitle, cells, width, height => top, colors => ON_WHITE });
    // XML has no place for control characters, not even as references
    Ok(text.map_err(broken)?.replace(|c: char| c.is_control() && c != '\n', " "))
}

/// Puts the entries of a chart's legend below it, in as many lines as they need.
fn place_legend(chart: &ChartLayout) -> Vec<LegendEntry> {
    let [left, _, right, _] = chart.area;
    let (mut x, mut y) = (left, chart.size[1] + LEGEND_LINE);
    let mut entries = Vec::new();
    for series in chart.series.iter().filter(|s| s.is_in_legend) {
        let width = 52.0 + LETTER * series.name.chars().count() as f64;
        if x > left && x + width > right {
            (x, y) = (left, y + LEGEND_LINE);
        }
        let (name, at) = (series.name.clone(), [x, y]);
        let (color, is_neutral, is_dashed) = (series.color, series.is_neutral, series.is_dashed);
        entries.push(LegendEntry { name, color, is_neutral, is_dashed, at });
        x += width;
    }
    entries
}

#[cfg(test)]
mod tests {
    use super::super::chart::{Axis, Series};
    use super::*;

    fn chart(title: &str) -> Chart {
        let series = |name: &str| Series {
            name: name.into(),
            points: vec![(1.0, 2.0).into(), (100.0, 0.001).into()],
            ..Series::default()
        };
        Chart {
            title: title.into(),
            x: Axis::logarithmic("ms"),
            y: Axis::logarithmic("RMSE"),
            series: vec![series("first"), series("second")],
            ..Chart::default()
        }
    }

    #[test]
    fn text_of_an_svg_is_text() {
        let text = draw_svg("A <title>", "sub", &[chart("a\x1b[31m\u{9b}b\x00"), chart("b"), chart("c")]).unwrap();
        assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "{text}");
        for part in ["A &lt;title&gt;", "<text", "first", "polyline", "#0072b2"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{text}");
        // two rows of charts, and what opens is closed
        assert!(text.matches("<g ").count() + text.matches("<g>").count() == text.matches("</g>").count());
        assert!(text.contains("width=\"1440.0\""), "{text}");
    }

    #[test]
    fn what_cannot_be_drawn_is_refused() {
        assert_eq!(draw_svg("", "", &[]).unwrap_err().exit_code(), 64);
        assert!(check_svg_name("--plot", "a.SVG".as_ref()).is_ok());
        let refused = check_svg_name("--plot", "a.png".as_ref()).unwrap_err();
        assert!(refused.exit_code() == 64 && refused.to_string().contains("must end in .svg"), "{refused}");
    }

    #[test]
    fn long_legends_have_several_lines() {
        let mut one = chart("a");
        one.series.iter_mut().for_each(|s| s.name = s.name.repeat(10));
        let entries = place_legend(&ChartLayout::new(&one, &mut |_| 0));
        assert!(entries.len() == 2 && entries[1].at[1] > entries[0].at[1]);
    }
}
