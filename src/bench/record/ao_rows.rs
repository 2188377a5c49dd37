//! The records as a table: a row a result.

use std::io::Write;

use super::ao::{AoBenchmark, ChangeResult, ImageErrors, SeriesPoint, StillRecord};
use super::cost::FrameCost;
use super::saved::SavedRecord;
use super::{BenchRecord, Completeness};
use crate::measure::stats::Percentiles;

const COLUMNS: [&str; 40] = [
    "part",
    "scene",
    "view",
    "preset",
    "technique",
    "rays per pixel",
    "x",
    "frame",
    "pass",
    "device ms",
    "device ms p95",
    "wall ms",
    "wall ms p95",
    "camera rays",
    "rays",
    "skipped rays",
    "cumulative rays",
    "reference rmse",
    "rmse",
    "rmse corrected",
    "bias",
    "flip",
    "tanimoto",
    "minimum ratio",
    "unfiltered rmse",
    "unfiltered flip",
    "equal-time rmse",
    "half-life",
    "fitted half-life",
    "memory half-life",
    "gone",
    "ghosting",
    "times as quick",
    "recovery",
    "recovery to larsen",
    "stale pixels",
    "stale by chance",
    "update ms",
    "update ms p95",
    "primitives",
];

/// A row; what it does not say is empty.
#[derive(Clone)]
struct Row([String; COLUMNS.len()]);

impl Row {
    fn new(part: &str, scene: &str) -> Self {
        Self(std::array::from_fn(|_| String::new())).text("part", part).text("scene", scene)
    }

    fn text(mut self, column: &str, value: &str) -> Self {
        if let Some(k) = COLUMNS.iter().position(|c| *c == column) {
            self.0[k] = value.to_owned();
        }
        self
    }

    fn number(self, column: &str, value: impl Into<Option<f64>>) -> Self {
        let text = value.into().map(|v| if v.fract() == 0.0 && v.abs() < 1e15 { format!("{v:.0}") } else { format!("{v:.6}") });
        self.text(column, &text.unwrap_or_default())
    }

    fn spread(self, column: &str, value: Option<Percentiles>) -> Self {
        self.number(column, value.map(|s| s.median)).number(&format!("{column} p95"), value.map(|s| s.p95))
    }

    fn errors(self, e: &ImageErrors, unfiltered: Option<&ImageErrors>) -> Self {
        let row = self.number("rmse", e.rmse).number("rmse corrected", e.rmse_corrected).number("bias", e.bias);
        let row = row.number("flip", e.flip).number("tanimoto", e.tanimoto).number("minimum ratio", e.minimum_ratio);
        row.number("unfiltered rmse", unfiltered.map(|u| u.rmse)).number("unfiltered flip", unfiltered.map(|u| u.flip))
    }

    fn cost(self, c: &FrameCost) -> Self {
        let row = self.spread("device ms", Some(c.device_ms)).spread("wall ms", Some(c.wall_ms));
        row.number("camera rays", c.camera_rays).number("rays", c.rays).number("skipped rays", c.skipped_rays)
    }

    /// One row for each pass.
    fn passes(&self, c: &FrameCost) -> Vec<Row> {
        let blank = self.clone();
        c.passes.iter().map(|p| blank.clone().text("pass", &p.pass).spread("device ms", Some(p.ms))).collect()
    }
}

impl BenchRecord for AoBenchmark {
    fn saved(&self) -> SavedRecord {
        SavedRecord::Ao(Box::new(self.clone()))
    }

    fn completeness(&mut self) -> &mut Completeness {
        &mut self.completeness
    }

    fn is_empty(&self) -> bool {
        self.views.is_empty() && self.changes.is_empty() && self.structures.is_empty() && self.series.is_empty()
    }

    fn write_csv(&self, out: &mut dyn Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(COLUMNS)?;
        for row in self.rows() {
            csv.write_record(row.0)?;
        }
        csv.flush()?;
        Ok(())
    }
}

impl AoBenchmark {
    fn rows(&self) -> Vec<Row> {
        let mut rows = Vec::new();
        self.view_rows(&mut rows);
        for change in &self.changes {
            for r in &change.results {
                let head = Row::new(&change.change, &change.scene).number("frame", f64::from(change.frames));
                rows.push(change_row(head.number("reference rmse", change.reference_rmse), r));
            }
        }
        for s in &self.structures {
            let row = |what: &str, ms: Option<Percentiles>| {
                let row = Row::new("structures", &s.scene).text("pass", what).number("primitives", s.primitives as f64);
                row.spread("update ms", ms)
            };
            let once = |ms: f64| Percentiles::from_values(&[ms]);
            rows.push(row("first build", once(s.build_ms)));
            rows.push(row("top level", s.top));
            rows.push(row("mesh refit", s.refit).number("primitives", s.mesh_triangles as f64));
            rows.push(row("mesh rebuild", s.rebuild).number("primitives", s.mesh_triangles as f64));
        }
        for series in &self.series {
            for line in &series.lines {
                rows.extend(line.points.iter().flat_map(|p| series_rows(&series.series, &line.name, p)));
            }
        }
        rows
    }

    fn view_rows(&self, rows: &mut Vec<Row>) {
        for view in &self.views {
            for r in &view.results {
                let head = |part: &str| {
                    let row = Row::new(part, &view.scene).text("view", &view.view).text("preset", &r.preset);
                    let row = row.text("technique", &r.technique).number("rays per pixel", f64::from(r.rays_per_pixel));
                    row.number("primitives", view.primitives as f64)
                };
                if let Some(still) = &r.still {
                    let (still_head, moving_head) = (head("still"), head("still, camera rays"));
                    rows.extend(curve(&still_head.clone().number("reference rmse", view.reference_rmse), still));
                    rows.extend(still_head.passes(&still.cost));
                    rows.push(moving_head.clone().cost(&still.moving_cost));
                    rows.extend(moving_head.passes(&still.moving_cost));
                }
                if let Some(rest) = &r.rest {
                    let row = head("rest").number("reference rmse", view.reference_rmse);
                    rows.push(row.number("frame", rest.frames.map(f64::from)).cost(&rest.cost).errors(&rest.errors, None));
                }
                if let Some(m) = &r.moving {
                    let row = head("moving").number("reference rmse", m.reference_rmse);
                    rows.push(row.cost(&m.cost).errors(&m.errors, m.unfiltered.as_ref()));
                    rows.extend(head("moving").passes(&m.cost));
                }
            }
            if let Some(e) = view.verdict.equal_time {
                let row = Row::new("equal time", &view.scene).text("view", &view.view).text("preset", super::ao_verdict::OURS);
                let row = row.number("rays per pixel", f64::from(e.rays_per_pixel)).number("device ms", e.ms);
                rows.push(row.number("rmse corrected", e.rmse).number("primitives", view.primitives as f64));
            }
        }
    }
}

/// Error after each frame that has one; the last also has what a frame costs.
fn curve(head: &Row, still: &StillRecord) -> Vec<Row> {
    let last = still.curve.len().saturating_sub(1);
    let row = |(k, p): (usize, &super::ao::ErrorPoint)| {
        let row = head.clone().number("frame", f64::from(p.frame)).number("cumulative rays", p.rays as f64);
        let row = row.errors(&p.errors, p.unfiltered.as_ref());
        if k == last { row.cost(&still.cost) } else { row }
    };
    still.curve.iter().enumerate().map(row).collect()
}

fn change_row(head: Row, r: &ChangeResult) -> Row {
    let count = |n: Option<u64>| n.map(|n| n as f64);
    let frames = |n: Option<usize>| n.map(|n| n as f64);
    let row = head.text("preset", &r.preset).text("technique", &r.technique);
    let row = row.number("half-life", r.half_life).number("fitted half-life", r.fitted_half_life);
    let row = row.number("memory half-life", r.memory_half_life);
    let row = row.number("gone", frames(r.gone)).number("ghosting", r.ghosting).number("times as quick", r.times_as_quick);
    let row = row.number("recovery", frames(r.recovery)).number("recovery to larsen", frames(r.recovery_to_larsen));
    let row = row.number("stale pixels", count(r.stale_pixels)).number("stale by chance", count(r.stale_pixels_by_chance));
    let row = row.spread("update ms", r.update_ms);
    let row = r.errors.iter().fold(row, |row, e| row.errors(e, None));
    r.cost.iter().fold(row, |row, c| row.cost(c))
}

fn series_rows(series: &str, line: &str, p: &SeriesPoint) -> Vec<Row> {
    let head = Row::new(series, &p.scene).text("preset", line).number("x", p.x);
    let row = head.clone().number("rmse", p.rmse).number("unfiltered rmse", p.unfiltered_rmse);
    let row = row.number("equal-time rmse", p.equal_time_rmse);
    let passes = p.cost.iter().flat_map(|c| head.passes(c)).collect::<Vec<_>>();
    let row = p.cost.iter().fold(row, |row, c| row.cost(c));
    [vec![row], passes].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::ao::{ErrorPoint, TechniqueRecord, ViewRecord};
    use crate::bench::record::cost::PassTime;

    #[test]
    fn a_row_a_result() {
        let ms = Percentiles { median: 2.0, p95: 3.5, ..Default::default() };
        let cost = FrameCost { passes: vec![PassTime { pass: "gbuffer".into(), ms }], device_ms: ms, ..Default::default() };
        let point = |frame| ErrorPoint { frame, ..Default::default() };
        let still =
            StillRecord { cost: cost.clone(), moving_cost: cost, curve: vec![point(1), point(2)], ..Default::default() };
        let results = vec![TechniqueRecord { preset: "fast, or so".into(), still: Some(still), ..Default::default() }];
        let view = ViewRecord { scene: "a.glb".into(), results, ..Default::default() };
        let change = crate::bench::record::ao::ChangeRecord {
            change: "appear".into(),
            results: vec![ChangeResult { half_life: Some(f64::INFINITY), ..Default::default() }],
            ..Default::default()
        };
        let mut text = Vec::new();
        AoBenchmark { views: vec![view], changes: vec![change], ..Default::default() }.write_csv(&mut text).unwrap();
        let mut reader = csv::Reader::from_reader(text.as_slice());
        let head = reader.headers().unwrap().clone();
        let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
        // two frames and a pass; the same with camera rays; a change
        assert_eq!(rows.len(), 2 + 1 + 2 + 1);
        let at = |row: usize, name: &str| rows[row][head.iter().position(|h| h == name).unwrap()].to_owned();
        assert_eq!([at(0, "device ms"), at(1, "device ms"), at(2, "pass")], ["", "2", "gbuffer"]);
        assert_eq!((at(1, "device ms p95"), at(1, "preset")), ("3.500000".into(), "fast, or so".into()));
        assert_eq!(at(5, "half-life"), "inf");
    }
}
