//! The tables of `skylit bench rays`.

use crate::bench::record::rays::{RayBenchmark, SceneRecord};
use crate::bench::table::{Block, header, number, optional, thousands};

/// All tables of a record.
pub fn blocks(record: &RayBenchmark) -> Vec<Block> {
    let scenes = record.scenes.iter().flat_map(|s| scene(s, &record.baselines));
    [Block::Line(title(record))].into_iter().chain(scenes).chain(scaling(record)).chain(edges(record)).collect()
}

/// Device and settings.
pub fn title(record: &RayBenchmark) -> String {
    format!(
        "{} ({}), {} threads; medians of {} repeats, in turn{}; docs/bench-rays.md explains the columns",
        record.host.device,
        record.host.driver,
        record.host.threads,
        record.repeats,
        record.peers.iter().map(|p| format!("; beside {p}")).collect::<String>()
    )
}

/// One scene's results.
pub fn scene(record: &SceneRecord, baselines: &[String]) -> Vec<Block> {
    let mut what = vec![format!("{} triangles", thousands(record.triangles))];
    if record.spheres > 0 {
        what.push(format!("{} spheres", thousands(record.spheres)));
    }
    if record.stored_primitives != record.primitives() {
        what.push(format!("{} stored, {} instances", thousands(record.stored_primitives), thousands(record.instances as u64)));
    }
    let mut blocks = vec![Block::gap(), Block::line(format!("{}: {}", record.scene, what.join(", ")))];
    let mut builds = vec![header(&["built", "seconds", "bytes/primitive"])];
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
    blocks.extend([Block::Table { title: "Building", rows: builds, left: 1 }, Block::gap()]);
    blocks.push(Block::Table { title: "Tracing", rows: results(record, baselines), left: 2 });
    if !record.checks.is_empty() {
        let mut rows = vec![header(&["checked", "stream", "rays", "agree", "ties", "unexplained"])];
        rows.extend(record.checks.iter().map(|c| {
            let counts = [c.rays, c.agree, c.ties, c.unexplained].map(thousands);
            [vec![c.contestant.clone(), c.stream.clone()], counts.to_vec()].concat()
        }));
        blocks.extend([Block::gap(), Block::Table { title: "Answers compared with the first kernel's", rows, left: 2 }]);
    }
    blocks
}

fn results(record: &SceneRecord, baselines: &[String]) -> Vec<Vec<String>> {
    let runs = || record.streams.iter().flat_map(|t| &t.results);
    // columns that nobody fills stay away
    let (nodes, leaves) = (runs().any(|r| r.nodes_per_ray.is_some()), runs().any(|r| r.leaves_per_ray.is_some()));
    let mut head = header(&["stream", "contestant", "rays", "hit", "Mrays/s", "min..max", "wall"]);
    head.extend(baselines.iter().map(|b| format!("x {b}")));
    if nodes {
        head.push("nodes/ray".into());
    }
    if leaves {
        head.push("leaves/ray".into());
    }
    let mut rows = vec![head];
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
                optional(run.wall.map(|w| w.median), number),
            ];
            row.extend(baselines.iter().map(|b| optional(run.ratio_to(b), number)));
            if nodes {
                row.push(optional(run.nodes_per_ray, number));
            }
            if leaves {
                row.push(optional(run.leaves_per_ray, number));
            }
            rows.push(row);
        }
    }
    rows
}

/// How rates fall with size.
pub fn scaling(benchmark: &RayBenchmark) -> Vec<Block> {
    if benchmark.scaling.is_empty() {
        return Vec::new();
    }
    let titles = ["family", "stream", "contestant", "sizes", "falls as", "worst x log n", "no faster than log n"];
    let mut rows = vec![header(&titles)];
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
    vec![Block::gap(), Block::Table { title: "How rates fall with size", rows, left: 3 }]
}

/// What became of rays at edges.
pub fn edges(benchmark: &RayBenchmark) -> Vec<Block> {
    if benchmark.edges.is_empty() {
        return Vec::new();
    }
    let titles = ["at edges", "meshes", "rays", "leaks, any", "leaks, closest", "agree", "ties", "unexplained"];
    let mut rows = vec![header(&titles)];
    rows.extend(benchmark.edges.iter().map(|e| {
        let counts = [u64::from(e.meshes), e.rays, e.leaks_any, e.leaks_closest, e.agree, e.ties, e.unexplained];
        [vec![e.contestant.clone()], counts.map(thousands).to_vec()].concat()
    }));
    vec![Block::gap(), Block::Table { title: "Rays at shared edges and vertices of closed meshes", rows, left: 1 }]
}
