//! The tables of `skylit bench rays`.

use crate::bench::record::rays::{RayBenchmark, SceneRecord};
use crate::bench::table::{align, number, thousands};

/// One scene's results.
pub fn scene(record: &SceneRecord, baselines: &[String]) -> Vec<String> {
    let mut what = vec![format!("{} triangles", thousands(record.triangles))];
    if record.spheres > 0 {
        what.push(format!("{} spheres", thousands(record.spheres)));
    }
    if record.stored_primitives != record.primitives() {
        what.push(format!("{} stored, {} instances", thousands(record.stored_primitives), thousands(record.instances as u64)));
    }
    let mut lines = vec![String::new(), format!("{}: {}", record.scene, what.join(", "))];
    let mut builds = vec![["built", "seconds", "bytes/primitive"].map(str::to_owned).to_vec()];
    let sah = record.builds.iter().any(|b| b.sah_cost.is_some());
    if sah {
        builds[0].push("SAH cost".into());
    }
    for b in &record.builds {
        let mut row = vec![b.contestant.clone(), format!("{:.3}", b.build_seconds), format!("{:.1}", b.bytes_per_primitive)];
        if sah {
            row.push(b.sah_cost.map_or_else(String::new, number));
        }
        builds.push(row);
    }
    lines.extend(align(&builds, 1).into_iter().map(|l| format!("  {l}")));
    lines.push(String::new());
    lines.extend(align(&results(record, baselines), 2).into_iter().map(|l| format!("  {l}")));
    if !record.checks.is_empty() {
        let mut rows = vec![["checked", "stream", "rays", "agree", "ties", "unexplained"].map(str::to_owned).to_vec()];
        rows.extend(record.checks.iter().map(|c| {
            let counts = [c.rays, c.agree, c.ties, c.unexplained].map(thousands);
            [vec![c.contestant.clone(), c.stream.clone()], counts.to_vec()].concat()
        }));
        lines.push(String::new());
        lines.extend(align(&rows, 2).into_iter().map(|l| format!("  {l}")));
    }
    lines
}

fn results(record: &SceneRecord, baselines: &[String]) -> Vec<Vec<String>> {
    let runs = || record.streams.iter().flat_map(|t| &t.results);
    // columns that nobody fills stay away
    let (nodes, leaves) = (runs().any(|r| r.nodes_per_ray.is_some()), runs().any(|r| r.leaves_per_ray.is_some()));
    let mut head: Vec<String> =
        ["stream", "contestant", "rays", "hit", "Mrays/s", "min..max", "wall"].map(str::to_owned).to_vec();
    head.extend(baselines.iter().map(|b| format!("x {b}")));
    if nodes {
        head.push("nodes/ray".into());
    }
    if leaves {
        head.push("leaves/ray".into());
    }
    let mut rows = vec![head];
    let maybe = |x: Option<f64>| x.map_or_else(|| "-".to_owned(), number);
    for stream in &record.streams {
        for (k, run) in stream.results.iter().enumerate() {
            let d = run.device;
            let mut row = vec![
                if k == 0 { stream.stream.clone() } else { String::new() },
                run.contestant.clone(),
                thousands(run.rays as u64),
                format!("{:.0}%", 100.0 * run.hit_share),
                number(d.median),
                format!("{}..{}", number(d.min), number(d.max)),
                maybe(run.wall.map(|w| w.median)),
            ];
            row.extend(baselines.iter().map(|b| maybe(run.ratio_to(b))));
            if nodes {
                row.push(maybe(run.nodes_per_ray));
            }
            if leaves {
                row.push(maybe(run.leaves_per_ray));
            }
            rows.push(row);
        }
    }
    rows
}

/// How rates fall with size.
pub fn scaling(benchmark: &RayBenchmark) -> Vec<String> {
    if benchmark.scaling.is_empty() {
        return Vec::new();
    }
    let head = ["family", "stream", "contestant", "sizes", "falls as", "worst x log n", "no faster than log n"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for s in &benchmark.scaling {
        let ends = [s.points.first(), s.points.last()].map(|p| p.map_or(0, |p| p.0));
        rows.push(vec![
            s.family.clone(),
            s.stream.clone(),
            s.contestant.clone(),
            format!("{}..{}", thousands(ends[0]), thousands(ends[1])),
            format!("n^{:.3}", s.law.exponent),
            format!("{} at {}", number(s.law.worst), thousands(s.law.worst_at)),
            if s.holds { "yes" } else { "no" }.to_owned(),
        ]);
    }
    [vec![String::new()], align(&rows, 3)].concat()
}
