//! Charts of a report, as data: series of points over two axes.

/// A chart of series over two axes, drawn as SVG in the colours of the page's theme.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Its title.
    pub title: String,
    /// What it shows, in a sentence, for readers who do not see it and under the chart for all.
    pub caption: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// What is drawn. A series of the same name has the same colour in all charts of a page.
    pub series: Vec<Series>,
}

/// An axis of a [`Chart`].
#[derive(Clone, Debug, Default)]
pub struct Axis {
    /// Quantity and unit.
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

/// A series of points.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// How points are drawn.
    pub mark: Mark,
    /// Its points, in the order in which lines join them. Those that are not finite are left out.
    pub points: Vec<Point>,
}

/// How the points of a series are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// Points joined by a line.
    #[default]
    LineAndPoints,
    /// A line.
    Line,
    /// Points.
    Points,
    /// A line in grey: a border, and no series like the others.
    Border,
    /// A dashed line in grey, to compare with.
    Dashed,
    /// A step from each point to the next, as of a histogram; the last step ends where the series does.
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

/// A point of a series.
#[derive(Clone, Debug, Default)]
pub struct Point {
    /// Along the horizontal axis.
    pub x: f64,
    /// Along the vertical axis.
    pub y: f64,
    /// Ends of an error bar along the horizontal axis.
    pub x_bar: Option<[f64; 2]>,
    /// Ends of an error bar along the vertical axis.
    pub y_bar: Option<[f64; 2]>,
    /// Its name, written beside it; may be empty. A series all of whose points have names is not in the legend.
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
