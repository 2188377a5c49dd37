//! The page of `skylit bvh`: figures, charts level by level, counts of rays, and the subtrees that
//! cost most.

use std::path::{Path, PathBuf};

use super::bvh::{BvhReport, NamedTree};
use crate::accel::lab::analysis::Level;
use crate::error::Result;
use crate::report::{self, Axis, Cell, Chart, Mark, Page, Part, Point, Row, Section, Series, Table};
use crate::terminal::console::command_line;

/// Writes the page into a folder, and returns its path.
pub fn write(report: &BvhReport, dir: &Path) -> Result<PathBuf> {
    let mut sections = vec![rays(report)];
    sections.extend(report.budget().map(|about| lights(report, about)));
    sections.extend(report.shown().iter().map(|tree| levels(report, tree)));
    let page = Page {
        title: format!("Hierarchy of {}", report.scene),
        summary: format!(
            "Built by {}. Costs are 2.0 an inner node and 1.2 a primitive; a ray that meets the root's box is expected to cost {:.1}.",
            report.build, report.predicted.falcone
        ),
        command: command_line(),
        facts: report.facts(),
        warnings: report.warnings.clone(),
        sections,
    };
    report::write(dir, &page)
}

/// A cell of a whole number.
fn whole(n: u64) -> Cell {
    Cell::number(n as f64, n.to_string())
}

/// Counts of rays.
fn rays(report: &BvhReport) -> Section {
    let mut table = Table::new(&["stream", "query", "kernel", "rays", "hit", "nodes", "boxes", "primitives", "cost"]);
    for s in &report.streams {
        let number = |x: Option<f64>| x.filter(|x| x.is_finite()).map_or_else(|| Cell::from("-"), Cell::from);
        table = table.row(Row::new([
            s.name.as_str().into(),
            s.query.into(),
            s.kernel.into(),
            whole(s.rays as u64),
            number(Some(s.hits)),
            number(Some(s.nodes)),
            number(s.boxes),
            number(Some(s.primitives)),
            number(Some(s.cost)),
        ]));
    }
    let about = "Means over rays. Exhaustive traversal visits every box that a ray meets, hit or no hit: the number that areas predict.";
    Section::new("Rays", vec![Part::Text(about.into()), Part::Table(table)])
}

/// Whether local trees would pay, light by light.
fn lights(report: &BvhReport, about: String) -> Section {
    let columns =
        ["light", "rays", "boxes a ray", "with a local tree", "rules", "build, ms", "pays from, rays", "pays"];
    let mut table = Table::new(&columns);
    for l in &report.lights {
        table = table.row(Row::new([
            l.light.as_str().into(),
            whole(l.rays as u64),
            l.boxes.into(),
            l.local_boxes.into(),
            l.rules.into(),
            l.build_ms.into(),
            l.break_even_rays.map_or_else(|| Cell::from("-"), |rays| whole(rays as u64)),
            if l.pays { "yes" } else { "no" }.into(),
        ]));
    }
    let sentences = report.lights.iter().map(|l| Part::Text(format!("{}.", l.describe())));
    let parts = std::iter::once(Part::Text(about)).chain(sentences).chain([Part::Table(table)]);
    Section::new("Would local trees pay?", parts.collect())
}

/// One tree, level by level.
fn levels(report: &BvhReport, tree: &NamedTree) -> Section {
    let a = &tree.analysis;
    let series = |name: &str, mark, value: &dyn Fn(&Level) -> Option<f64>| {
        let point = |l: &Level| value(l).map(|y| Point::from((f64::from(l.level), y)));
        Series { name: name.into(), mark, points: a.levels.iter().filter_map(point).collect() }
    };
    let chart = |title: &str, y: &str, series: Vec<Series>| Chart {
        title: title.into(),
        x: Axis::linear("level"),
        y: Axis::linear(y),
        series: series.into_iter().filter(|s| !s.points.is_empty()).collect(),
        ..Chart::default()
    };

    // four charts over the levels, and one of leaves
    let counts = chart(
        "Nodes",
        "nodes",
        vec![
            series("inner nodes", Mark::LineAndPoints, &|l| Some((l.nodes - l.leaves) as f64)),
            series("leaves", Mark::LineAndPoints, &|l| Some(l.leaves as f64)),
        ],
    );
    let costs = chart(
        "Cost",
        "expected cost",
        vec![
            series("by surface area", Mark::LineAndPoints, &|l| Some(l.sah)),
            series("by projected area", Mark::LineAndPoints, &|l| l.pah),
        ],
    );
    let has_inner = |l: &Level| l.nodes > l.leaves;
    let share = |x: f64, l: &Level| has_inner(l).then_some(100.0 * x);
    let overlaps = chart(
        "Overlap of siblings",
        "% of the node",
        vec![
            series("volume", Mark::LineAndPoints, &|l| share(l.overlap_volume, l)),
            series("surface area", Mark::LineAndPoints, &|l| share(l.overlap_area, l)),
            series("projected area", Mark::LineAndPoints, &|l| l.overlap_projected.and_then(|x| share(x, l))),
        ],
    );
    let empty = chart(
        "Empty space",
        "% of the node's volume",
        vec![series("in neither child", Mark::LineAndPoints, &|l| share(l.empty, l))],
    );
    let sizes = a.leaf_sizes.iter().map(|(&size, &n)| Point::from((f64::from(size), n as f64))).collect();
    let leaves = Chart {
        title: "Leaves".into(),
        x: Axis::linear("primitives"),
        y: Axis {
            range: Some([0.0, a.leaf_sizes.values().copied().max().unwrap_or(1) as f64]),
            ..Axis::linear("leaves")
        },
        series: vec![Series { name: "leaves".into(), mark: Mark::LineAndPoints, points: sizes }],
        ..Chart::default()
    };

    // the costliest subtrees
    let mut worst =
        Table::new(&["share of cost, %", "cost of a ray in it", "overlap, %", "primitives", "level", "meshes"])
            .titled("Costliest subtrees");
    for s in &a.worst {
        worst = worst.row(Row::new([
            (100.0 * s.share).into(),
            s.cost.into(),
            (100.0 * s.overlap).into(),
            whole(s.primitives),
            whole(u64::from(s.level)),
            report.named_meshes(&s.meshes).into(),
        ]));
    }
    let about = format!(
        "{} primitives in {} leaves, {} levels; {} of it in the scene. Subtrees are the largest of at most a two-hundredth of the primitives; meshes have their material and number of primitives in the subtree.",
        a.primitives,
        a.leaves,
        a.levels.len(),
        tree.instances
    );
    let mut parts = vec![Part::Text(about)];
    parts.extend([counts, costs, overlaps, empty, leaves].map(Part::Chart));
    if !a.worst.is_empty() {
        parts.push(Part::Table(worst));
    }
    Section::new(format!("Tree: {}", tree.name), parts)
}
