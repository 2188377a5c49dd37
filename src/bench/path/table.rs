//! The tables of `skylit bench path`.

use crate::bench::record::path::{ContestantRecord, PathBenchmark, SceneRecord, TimeEstimate};
use crate::bench::table::{Block, header, number, thousands};

/// All tables of a record.
pub fn blocks(record: &PathBenchmark) -> Vec<Block> {
    [Block::Line(title(record))].into_iter().chain(record.scenes.iter().flat_map(scene)).collect()
}

/// Device and tracer.
pub fn title(record: &PathBenchmark) -> String {
    format!(
        "{} ({}), tracer {}; docs/bench-path.md explains the columns",
        record.host.device, record.host.driver, record.tracer
    )
}

/// One scene's results.
pub fn scene(record: &SceneRecord) -> Vec<Block> {
    let mut what = vec![format!("{}x{}", record.size[0], record.size[1]), format!("{} triangles", thousands(record.triangles))];
    if record.spheres > 0 {
        what.push(format!("{} spheres", thousands(record.spheres)));
    }
    what.push(format!("{} lights", record.lights));
    what.push(format!("environment {}", record.environment));
    let mut blocks = vec![Block::gap(), Block::line(format!("{}: {}", record.scene, what.join(", ")))];
    for r in &record.references {
        blocks.push(Block::line(format!(
            "  reference of {}: {} paths a pixel in {:.0} s, known to {:.2e}, mean {:.4}",
            r.engine,
            thousands(r.spp),
            r.seconds,
            r.rmse,
            r.mean
        )));
    }
    for d in &record.differences {
        blocks.push(Block::line(format!(
            "  {} beside ours: mean {:.4} times, RMSE {:.2e}, of which {:.2e} is noise",
            d.engine, d.mean_ratio, d.rmse, d.explained
        )));
    }
    let target = record.target.as_ref().map(|t| t.rmse);
    let mut rows = vec![header(&["contestant", "spp", "seconds", "RMSE", "bad pixels", "Mpaths/s", "Mrays/s", "1/(MSE s)"])];
    if let Some(rmse) = target {
        rows[0].extend([format!("s to {rmse:.2e}"), "times as long".into()]);
    }
    let base = record.target.as_ref().and_then(|t| record.results.iter().find(|r| r.name == t.set_by)).and_then(seconds);
    rows.extend(record.results.iter().map(|r| row(r, base)));
    blocks.extend([Block::gap(), Block::Table { title: "Greatest sample counts", rows, left: 1 }]);
    blocks
}

fn seconds(r: &ContestantRecord) -> Option<f64> {
    r.seconds_to_target.map(|t| t.seconds)
}

fn row(r: &ContestantRecord, base: Option<f64>) -> Vec<String> {
    let mut out = vec![r.name.clone()];
    let Some(last) = r.points.last() else { return out };
    let median = last.seconds.map_or_else(String::new, |s| format!("{:.2}", s.median));
    let unsure = if last.unsure { "?" } else { "" };
    out.extend([last.spp.to_string(), median, format!("{:.2e}{unsure}", last.rmse)]);
    out.extend([format!("{:.3} %", 100.0 * last.bad_pixels), number(r.mpaths), r.mrays.map_or_else(String::new, number)]);
    out.push(format!("{:.2e}", r.efficiency));
    if let Some(t) = r.seconds_to_target {
        let mark = match t.how {
            TimeEstimate::Between => "",
            TimeEstimate::Less => "<",
            TimeEstimate::Extrapolated => "~",
        };
        out.push(format!("{mark}{}", number(t.seconds)));
        out.extend(base.map(|b| format!("{mark}{}", number(t.seconds / b))));
    }
    out
}
