//! Charts of a report, as data: series of points over two axes.

/// A chart of series over two axes, drawn as SVG in the colours of the page's theme.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    pub title: String,
    /// A sentence about the chart, for readers who do not see it and under it for all.
    pub caption: String,
    pub x: Axis,
    pub y: Axis,
    /// The series. One of the same name has the same colour in all charts of a page.
    pub series: Vec<Series>,
}

#[derive(Clone, Debug, Default)]
pub struct Axis {
    pub label: String,
    /// How values lie along it.
    pub scale: Scale,
    /// The values at its ends; `None`: all points fit in.
    pub range: Option<[f64; 2]>,
}

impl Axis {
    /// A linear axis that all points fit in.
    pub fn linear(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// A logarithmic axis that all points fit in.
    pub fn logarithmic(label: impl Into<String>) -> Self {
        Self { label: label.into(), scale: Scale::Logarithmic, range: None }
    }
}

/// How values lie along an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// By their differences.
    #[default]
    Linear,
    /// By their ratios. Values that are not above 0 have no place and are left out.
    Logarithmic,
}

#[derive(Clone, Debug, Default)]
pub struct Series {
    /// The name in the legend.
    pub name: String,
    pub mark: Mark,
    /// The points that lines join, in order. Those that are not finite are left out.
    pub points: Vec<Point>,
}

/// How the points of a series are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    #[default]
    LineAndPoints,
    Line,
    Points,
    /// A line in grey: a border, and no series like the others.
    Border,
    /// A dashed line in grey, to compare with.
    Dashed,
    /// A step from each point to the next, as of a histogram.
    Steps,
}

impl Mark {
    /// Is it drawn in grey, whatever its name?
    pub fn is_neutral(self) -> bool {
        matches!(self, Self::Border | Self::Dashed)
    }

    /// Are points themselves drawn?
    pub fn has_points(self) -> bool {
        matches!(self, Self::LineAndPoints | Self::Points)
    }
}

#[derive(Clone, Debug, Default)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub x_bar: Option<[f64; 2]>,
    pub y_bar: Option<[f64; 2]>,
    /// The name beside it; may be empty. The legend has series with points without names.
    pub name: String,
    /// Explains the point when a pointer rests on it; empty: its numbers do.
    pub label: String,
    /// Draws the point in grey and leaves it out of the line: one that another point dominates.
    pub is_muted: bool,
}

impl From<(f64, f64)> for Point {
    fn from((x, y): (f64, f64)) -> Self {
        Self { x, y, ..Self::default() }
    }
}
