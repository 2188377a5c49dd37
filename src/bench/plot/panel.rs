//! Plots as data: panels of series over two logarithmic axes. `picture` draws them, a report shows them in its page.

use super::pareto::dominated;

/// Name of the line along what nothing dominates.
pub const PARETO_FRONT: &str = "Pareto front";

/// A plot: panels under a title.
#[derive(Clone, Debug, Default)]
pub struct Plot {
    /// Title.
    pub title: String,
    /// Host and settings, under the title.
    pub subtitle: String,
    /// Panels that belong together; each group begins a new row.
    pub groups: Vec<Vec<Panel>>,
}

impl Plot {
    /// All panels.
    pub fn panels(&self) -> impl Iterator<Item = &Panel> {
        self.groups.iter().flatten()
    }

    /// Names of the series that have a colour of their own, in the order of their first appearance. A series without a point that can be drawn has none,
    /// and neither has one whose points are dominated everywhere: those are grey.
    pub fn colored_names(&self) -> Vec<&str> {
        let mut names: Vec<(&str, bool)> = Vec::new();
        for series in self.panels().flat_map(|p| &p.series).filter(|s| s.mark.is_colored()) {
            let is_seen = series.placed().any(|p| !p.is_dominated);
            match names.iter_mut().find(|(name, _)| *name == series.name) {
                Some((_, seen)) => *seen |= is_seen,
                None => names.push((&series.name, is_seen)),
            }
        }
        names.into_iter().filter(|(_, is_seen)| *is_seen).map(|(name, _)| name).collect()
    }

    /// Is any series drawn in this way, with a point that can be drawn?
    pub fn has(&self, mark: Mark) -> bool {
        self.panels().flat_map(|p| &p.series).any(|s| s.mark == mark && s.placed().next().is_some())
    }
}

/// A panel; both axes are logarithmic.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Title.
    pub title: String,
    /// What the panel shows, in a sentence.
    pub caption: String,
    /// Quantity and unit along x.
    pub x: String,
    /// Quantity and unit along y.
    pub y: String,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
}

/// A series of points of a panel. Series of the same name have the same colour in all panels.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// Points, in the order in which they are joined. Those that are not finite and above 0 have no place and are left out.
    pub points: Vec<Point>,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// Discs joined by a line.
    #[default]
    Discs,
    /// Triangles joined by a line.
    Triangles,
    /// Crosses joined by a line.
    Crosses,
    /// Circles that nothing joins.
    Circles,
    /// Discs that nothing joins, with their labels.
    Labelled,
    /// The Pareto front through its points, as steps: to the right of and above it everything is dominated.
    Front,
    /// A dashed line to compare with.
    Guide,
    /// A dashed line at the y of its point, from one end of the panel to the other.
    Level,
}

impl Mark {
    /// Is it drawn in the colour of the series' name?
    pub fn is_colored(self) -> bool {
        !matches!(self, Self::Front | Self::Guide | Self::Level)
    }

    /// Does a line join the points?
    pub fn is_joined(self) -> bool {
        !matches!(self, Self::Circles | Self::Labelled | Self::Level)
    }

    /// Are the points themselves drawn?
    pub fn has_points(self) -> bool {
        self.is_colored()
    }
}

/// A point of a series.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Point {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Ends of the bar along x that shows its noise.
    pub x_bar: Option<[f64; 2]>,
    /// Ends of the bar along y.
    pub y_bar: Option<[f64; 2]>,
    /// Label beside it ([`Mark::Labelled`]).
    pub label: String,
    /// Another point of the panel is better in one of x and y and no worse in the other. Drawn in grey.
    pub is_dominated: bool,
}

impl From<(f64, f64)> for Point {
    fn from((x, y): (f64, f64)) -> Self {
        Self { x, y, ..Self::default() }
    }
}

impl Point {
    /// Has it a place on logarithmic axes?
    pub fn is_placed(&self) -> bool {
        [self.x, self.y].iter().all(|v| v.is_finite() && *v > 0.0)
    }
}

impl Series {
    /// Points joined by a line.
    pub fn curve(name: &str, points: impl IntoIterator<Item = Point>) -> Self {
        Self { name: name.to_owned(), mark: Mark::Discs, points: points.into_iter().collect() }
    }

    /// A dashed line.
    pub fn guide(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.to_owned(), mark: Mark::Guide, points: points.into_iter().map(Point::from).collect() }
    }

    /// The points that can be drawn.
    pub fn placed(&self) -> impl Iterator<Item = &Point> {
        self.points.iter().filter(|p| p.is_placed())
    }
}

impl Panel {
    /// Adds points with their names, each a series: the front in colours, dominated points in grey. Less is better along both axes.
    pub fn add_pareto(&mut self, points: Vec<(String, Point)>) {
        let mut points: Vec<(String, Point)> = points.into_iter().filter(|(_, p)| p.is_placed()).collect();
        let places: Vec<[f64; 2]> = points.iter().map(|(_, p)| [p.x, p.y]).collect();
        points.iter_mut().zip(dominated(&places)).for_each(|((_, p), is_dominated)| p.is_dominated = is_dominated);
        self.add_front(points.iter().filter(|(_, p)| !p.is_dominated).map(|(_, p)| (p.x, p.y)));
        self.series.extend(points.into_iter().map(|(name, p)| {
            let label = if p.label.is_empty() { name.clone() } else { p.label.clone() };
            Series { name, mark: Mark::Labelled, points: vec![Point { label, ..p }] }
        }));
    }

    /// Adds the Pareto front through points that do not dominate each other, if there is any.
    pub fn add_front(&mut self, points: impl IntoIterator<Item = (f64, f64)>) {
        let mut points: Vec<Point> = points.into_iter().map(Point::from).collect();
        points.sort_by(|a, b| a.x.total_cmp(&b.x));
        if !points.is_empty() {
            self.series.push(Series { name: PARETO_FRONT.into(), mark: Mark::Front, points });
        }
    }

    /// Adds a dashed horizontal line at `y`, if anything else is in the panel.
    pub fn add_level(&mut self, name: &str, y: f64) {
        let first = self.series.iter().find_map(|s| s.placed().next().map(|p| p.x));
        let level = first.map(|x| Point::from((x, y))).filter(Point::is_placed);
        self.series.extend(level.map(|p| Series { name: name.to_owned(), mark: Mark::Level, points: vec![p] }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, x: f64, y: f64) -> (String, Point) {
        (name.to_owned(), (x, y).into())
    }

    #[test]
    fn only_what_is_drawn_has_a_legend() {
        let mut panel = Panel::default();
        panel.add_pareto(vec![named("a", 1.0, 1.0), named("worse", 2.0, 2.0), named("nowhere", f64::NAN, 1.0)]);
        panel.add_level("reference", 0.5);
        panel.add_level("unknown", f64::NAN);
        let empty = Series::curve("empty", [(0.0, 1.0).into()]);
        panel.series.push(empty);
        let plot = Plot { groups: vec![vec![panel]], ..Plot::default() };
        assert_eq!(plot.colored_names(), ["a"]);
        assert!(plot.has(Mark::Front) && plot.has(Mark::Level) && !plot.has(Mark::Discs));
        let names: Vec<_> = plot.panels().flat_map(|p| &p.series).map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["Pareto front", "a", "worse", "reference", "empty"]);
    }

    #[test]
    fn the_front_goes_from_quick_to_exact() {
        let mut panel = Panel::default();
        panel.add_pareto(vec![named("c", 3.0, 1.0), named("a", 1.0, 3.0), named("b", 2.0, 2.0), named("d", 3.0, 3.0)]);
        let front: Vec<_> = panel.series[0].points.iter().map(|p| (p.x, p.y)).collect();
        assert_eq!(front, [(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)]);
        assert!(panel.series[4].points[0].is_dominated && panel.series[4].name == "d");
    }
}
