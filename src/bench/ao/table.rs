//! The tables of `skylit bench ao`.

use crate::bench::record::ao::{
    AoBenchmark, ChangeRecord, ChangeResult, ImageErrors, SeriesRecord, StructureRecord, TechniqueRecord, Verdict, ViewRecord,
};
use crate::bench::record::cost::FrameCost;
use crate::bench::table::{Block, header, number, optional, thousands};
use crate::measure::stats::Percentiles;

/// Top levels of the reference work, by million triangles and meshes: milliseconds on a GPU that it does not name.
const THEIR_TOPS: &str = "4.9 M in 4 meshes 0.157, 6.7 M in 5 0.160, 8.6 M in 6 0.160, 25.2 M in 15 0.180";
/// And the rest of what it says about structures.
const THEIR_BUILDS: &str = "first build of 25.2 M 230 ms; updating a mesh was guessed at 100 to 200 ms, not measured";

fn error(x: f64) -> String {
    format!("{x:.4}")
}

fn ratio(x: f64) -> String {
    if x.is_infinite() { "inf".to_owned() } else { format!("{x:.3}") }
}

fn ms(s: Percentiles) -> String {
    format!("{}..{}", number(s.median), number(s.p95))
}

fn passes(cost: &FrameCost) -> String {
    cost.passes.iter().map(|p| format!("{} {}", p.pass, number(p.ms.median))).collect::<Vec<_>>().join(", ")
}

/// All tables of a record.
pub fn blocks(record: &AoBenchmark) -> Vec<Block> {
    let tables = record.views.iter().map(view).chain(record.changes.iter().map(change));
    let structures = if record.structures.is_empty() { Vec::new() } else { structures(&record.structures) };
    let series = record.series.iter().map(series);
    [Block::Line(title(record))].into_iter().chain(tables.flatten()).chain(structures).chain(series.flatten()).collect()
}

/// Device and settings.
pub fn title(record: &AoBenchmark) -> String {
    format!(
        "{} ({}), tracer {}, {}x{}, {} frames, references of {} rays a pixel; docs/bench-ao.md explains the columns",
        record.host.device,
        record.host.driver,
        record.tracer,
        record.size[0],
        record.size[1],
        record.frames,
        record.reference_rays
    )
}

/// One view's results.
pub fn view(record: &ViewRecord) -> Vec<Block> {
    let mut blocks = vec![
        Block::gap(),
        Block::line(format!(
            "{}, {}: {} primitives, reach {:.4}; {} pixels show something; reference good to {:.5}",
            record.scene,
            record.view,
            thousands(record.primitives),
            record.reach,
            thousands(record.covered),
            record.reference_rmse
        )),
        Block::Table { title: "Times, ms a frame", rows: times(&record.results), left: 1 },
        Block::gap(),
        Block::Table { title: "Errors", rows: errors(&record.results), left: 1 },
        Block::gap(),
    ];
    for r in &record.results {
        if let Some(s) = &r.still {
            blocks.push(Block::line(format!("  {}, camera rays {}: {} ms", r.preset, r.primary, passes(&s.moving_cost))));
        }
    }
    blocks.extend(verdict(&record.verdict).into_iter().map(Block::Line));
    blocks
}

fn times(results: &[TechniqueRecord]) -> Vec<Vec<String>> {
    let columns =
        ["ms a frame", "still..p95", "+camera rays..p95", "wall", "orbit", "at rest", "after", "rays", "skipped", "camera"];
    let mut rows = vec![header(&columns)];
    rows[0][0] = "preset".into();
    for r in results {
        let still = r.still.as_ref();
        rows.push(vec![
            r.preset.clone(),
            optional(still, |s| ms(s.cost.device_ms)),
            optional(still, |s| ms(s.moving_cost.device_ms)),
            optional(still, |s| number(s.moving_cost.wall_ms.median)),
            optional(r.moving.as_ref(), |m| number(m.cost.ms())),
            optional(r.rest.as_ref(), |s| number(s.cost.ms())),
            optional(r.rest.as_ref().and_then(|s| s.frames), |f| format!("{f} frames")),
            optional(still, |s| thousands(s.cost.rays as u64)),
            optional(still, |s| thousands(s.cost.skipped_rays as u64)),
            optional(still, |s| thousands(s.moving_cost.camera_rays as u64)),
        ]);
    }
    rows
}

fn errors(results: &[TechniqueRecord]) -> Vec<Vec<String>> {
    let columns = [
        "error",
        "RMSE",
        "corrected",
        "unfiltered",
        "bias",
        "FLIP",
        "Tanimoto",
        "min ratio",
        "frame 1",
        "frame 4",
        "orbit RMSE",
        "unfiltered",
        "FLIP",
    ];
    let mut rows = vec![header(&columns)];
    for r in results {
        let still = r.still.as_ref();
        let settled = still.and_then(|s| s.settled());
        let of = |show: &dyn Fn(&ImageErrors) -> String| optional(settled, |p| show(&p.errors));
        let after =
            |frame: u32| optional(still.and_then(|s| s.curve.iter().find(|p| p.frame == frame)), |p| error(p.errors.rmse));
        let moving = r.moving.as_ref();
        rows.push(vec![
            r.preset.clone(),
            of(&|e| error(e.rmse)),
            of(&|e| error(e.rmse_corrected)),
            optional(settled.and_then(|p| p.unfiltered), |e| error(e.rmse)),
            of(&|e| format!("{:+.4}", e.bias)),
            of(&|e| error(e.flip)),
            of(&|e| format!("{:.6}", e.tanimoto)),
            of(&|e| error(e.minimum_ratio)),
            after(1),
            after(4),
            optional(moving, |m| error(m.errors.rmse)),
            optional(moving.and_then(|m| m.unfiltered), |e| error(e.rmse)),
            optional(moving, |m| error(m.errors.flip)),
        ]);
    }
    rows
}

/// Yes or no.
fn met(holds: bool) -> &'static str {
    if holds { "yes" } else { "NO" }
}

fn verdict(v: &Verdict) -> Vec<String> {
    let mut lines = Vec::new();
    if let (Some(rays), Some(rmse)) = (v.rays_ratio, v.rmse_ratio) {
        let holds = rays <= Verdict::RAYS_AIM && rmse <= 1.0;
        lines.push(format!(
            "  balanced over larsen: {rays:.3} of the rays ({} with camera rays, {} while moving), {rmse:.3} of the settled RMSE \
             ({} on the orbit); a tenth of the rays, no more error: {}",
            optional(v.rays_ratio_with_camera, ratio),
            optional(v.rays_ratio_moving, ratio),
            optional(v.moving_rmse_ratio, ratio),
            met(holds)
        ));
        lines.push(match (v.frames_to_reach, v.rays_to_reach, v.rays_to_reach_ratio) {
            (Some(frames), Some(rays), Some(ratio)) => format!(
                "  balanced reaches larsen's settled RMSE in frame {frames}, after {} rays: {ratio:.3} of what one frame of larsen's traces",
                thousands(rays)
            ),
            _ => "  balanced does not reach larsen's settled RMSE".to_owned(),
        });
    }
    if let Some(e) = v.equal_time {
        lines.push(format!(
            "  equal time: balanced with {} rays a pixel takes {} ms to larsen's {}, and {:.3} of its settled RMSE; a third or less: {}",
            e.rays_per_pixel,
            number(e.ms),
            number(e.their_ms),
            e.rmse_ratio,
            met(e.rmse_ratio <= Verdict::EQUAL_TIME_AIM)
        ));
    }
    if !v.filter_raises.is_empty() {
        lines.push(format!("  the filter raises the settled error of: {}", v.filter_raises.join(", ")));
    }
    lines
}

/// What a change left behind.
pub fn change(record: &ChangeRecord) -> Vec<Block> {
    let title = format!(
        "{}, {}: {} pixels looked at, {} frames; reference good to {:.5}",
        record.scene,
        record.change,
        thousands(record.pixels),
        record.frames,
        record.reference_rmse
    );
    type Column = (&'static str, fn(&ChangeResult) -> Option<String>);
    let columns: [Column; 14] = [
        ("left 1", |r| r.residuals.first().map(|g| format!("{g:.3}"))),
        ("left 4", |r| r.residuals.get(3).map(|g| format!("{g:.3}"))),
        ("half-life", |r| r.fitted_half_life.map(ratio)),
        ("memory 1", |r| r.memory.first().map(|g| format!("{g:.3}"))),
        ("half-life", |r| r.memory_half_life.map(ratio)),
        ("x as quick", |r| r.times_as_quick.map(ratio)),
        ("gone in", |r| r.gone.map(|n| n.to_string())),
        ("ghosting", |r| r.ghosting.map(|g| format!("{g:.2e}"))),
        ("stale", |r| r.stale_pixels.map(thousands)),
        ("by chance", |r| r.stale_pixels_by_chance.map(thousands)),
        ("recovered in", |r| r.recovery.map(|n| n.to_string())),
        ("as larsen in", |r| r.recovery_to_larsen.map(|n| n.to_string())),
        ("RMSE", |r| r.errors.map(|e| error(e.rmse))),
        ("update ms", |r| r.update_ms.map(ms)),
    ];
    // columns that nobody fills stay away
    let used: Vec<&Column> = columns.iter().filter(|(_, of)| record.results.iter().any(|r| of(r).is_some())).collect();
    let mut rows = vec![std::iter::once("preset").chain(used.iter().map(|c| c.0)).map(str::to_owned).collect::<Vec<_>>()];
    rows.extend(record.results.iter().map(|r| {
        let cells = used.iter().map(|(_, of)| of(r).unwrap_or_else(|| "-".to_owned()));
        std::iter::once(r.preset.clone()).chain(cells).collect()
    }));
    vec![Block::gap(), Block::Line(title), Block::Table { title: "What is left of the past", rows, left: 1 }]
}

/// What keeping structures up to date took.
pub fn structures(records: &[StructureRecord]) -> Vec<Block> {
    let columns = ["structures, ms", "stored", "placed", "first build", "top level..p95", "mesh", "refit..p95", "rebuild..p95"];
    let mut rows = vec![header(&columns)];
    for r in records {
        rows.push(vec![
            r.scene.clone(),
            format!("{} in {}", thousands(r.stored), r.meshes),
            format!("{} in {}", thousands(r.primitives), r.instances),
            number(r.build_ms),
            optional(r.top, |s| format!("{} {}", ms(s), if r.top_rebuilt { "built" } else { "refitted" })),
            thousands(r.mesh_triangles),
            optional(r.refit, ms),
            optional(r.rebuild, ms),
        ]);
    }
    let theirs = [format!("  Larsen, top level, ms: {THEIR_TOPS}"), format!("  Larsen: {THEIR_BUILDS}")];
    [Block::gap(), Block::Table { title: "Updates, ms", rows, left: 1 }].into_iter().chain(theirs.map(Block::Line)).collect()
}

/// One number varied.
pub fn series(record: &SeriesRecord) -> Vec<Block> {
    let columns = ["", "x", "ms..p95", "frames/s", "RMSE", "unfiltered", "at equal time", "passes, ms"];
    let mut rows = vec![header(&columns)];
    rows[0][0].clone_from(&record.series);
    for line in &record.lines {
        for p in &line.points {
            rows.push(vec![
                format!("{} {}", line.name, p.scene),
                thousands(p.x as u64),
                optional(p.cost.as_ref(), |c| ms(c.device_ms)),
                optional(p.cost.as_ref().map(FrameCost::ms).filter(|ms| *ms > 0.0), |ms| number(1e3 / ms)),
                optional(p.rmse, error),
                optional(p.unfiltered_rmse, error),
                optional(p.equal_time_rmse, error),
                optional(p.cost.as_ref(), passes),
            ]);
        }
    }
    vec![Block::gap(), Block::Table { title: "All points", rows, left: 1 }]
}
