//! The tables of `skylit bench frames`.

use crate::bench::record::cost::FrameCost;
use crate::bench::record::frames::{
    BouncePoint, BouncesRecord, ChangedFrames, DenoisedImage, Flicker, FrameErrors, FramePoint, FramesBenchmark, FramesChange,
    FramesView, MotionRecord, PeerPoint, StillFrames,
};
use crate::bench::table::{Block, header, number, optional, thousands};

/// All tables of a record.
pub fn blocks(record: &FramesBenchmark) -> Vec<Block> {
    let mut blocks = vec![Block::Line(title(record))];
    blocks.extend(record.views.iter().flat_map(view));
    if !record.bounces.is_empty() {
        blocks.extend(bounces(&record.bounces));
    }
    blocks
}

/// Device, integrator and size.
pub fn title(record: &FramesBenchmark) -> String {
    format!(
        "{} ({}), tracer {}, integrator {}, {}x{}, {} frames; docs/bench-frames.md explains the columns",
        record.host.device, record.host.driver, record.tracer, record.integrator, record.size[0], record.size[1], record.frames
    )
}

/// Results of a scene.
pub fn view(record: &FramesView) -> Vec<Block> {
    let mut blocks = vec![
        Block::gap(),
        Block::Line(format!(
            "{}: {} primitives, light {}; plain accumulation takes {} ms an image and {} ms a path",
            record.scene,
            thousands(record.primitives),
            record.light,
            number(record.ms_per_image),
            number(record.ms_per_path)
        )),
    ];
    if !record.still.is_empty() {
        blocks.push(Block::line(format!("  still camera; reference good to {}", error(record.reference_rmse))));
        blocks.push(Block::Table { title: "Still camera", rows: still(&record.still), left: 1 });
        let beside = peers(&record.still);
        if beside.len() > 1 {
            blocks.push(Block::line("  still camera, beside other renderers in the same time: error / theirs (their paths)"));
            blocks.push(Block::Table { title: "Still camera, other renderers", rows: beside, left: 2 });
        }
    }
    for m in &record.motions {
        blocks.push(Block::line(format!("  {}; references good to {}", m.motion, error(m.reference_rmse))));
        blocks.push(Block::Table { title: "In motion", rows: motion(m), left: 1 });
    }
    for c in &record.changes {
        blocks.push(Block::line(format!(
            "  {}: {} pixels, {} frames; reference good to {}",
            c.change,
            thousands(c.pixels),
            c.frames,
            error(c.reference_rmse)
        )));
        blocks.push(Block::Table { title: "After a change", rows: change(c), left: 1 });
    }
    let passes = record.still.iter().map(|r| Block::line(format!("  {}: {} ms", r.preset, passes(&r.cost))));
    blocks.extend(passes);
    blocks.extend(verdicts(record).into_iter().map(Block::Line));
    blocks
}

fn error(x: f64) -> String {
    format!("{x:.4}")
}

/// Median of each pass.
fn passes(cost: &FrameCost) -> String {
    cost.passes.iter().map(|p| format!("{} {}", p.pass, number(p.ms.median))).collect::<Vec<_>>().join(", ")
}

/// Columns of errors, those of plain accumulation and of the denoiser beside.
fn errors(ours: &FrameErrors, plain: (u32, &FrameErrors), ratio: Option<f64>, denoised: Option<&DenoisedImage>) -> Vec<String> {
    vec![
        error(ours.rmse),
        error(ours.rmse_corrected),
        format!("{:+.2} %", 100.0 * ours.bias),
        error(ours.flip),
        format!("{:.4}", ours.rel_mse),
        plain.0.to_string(),
        error(plain.1.rmse_corrected),
        error(plain.1.flip),
        optional(ratio, number),
        optional(denoised, |d| format!("{} in {} ms", error(d.errors.rmse_corrected), number(d.ms))),
    ]
}

const ERRORS: [&str; 10] =
    ["RMSE", "corrected", "bias", "FLIP", "rel MSE", "plain paths", "RMSE", "FLIP", "over plain", "oidn RMSE"];

/// Without a column that nobody fills.
fn filled(mut rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    let columns = rows.first().map_or(0, Vec::len);
    for c in (0..columns).rev().filter(|c| *c > 0) {
        if rows[1..].iter().all(|r| r[c] == "-") {
            rows.iter_mut().for_each(|r| {
                r.remove(c);
            });
        }
    }
    rows
}

fn cost_columns(cost: &FrameCost) -> Vec<String> {
    let rays = thousands((cost.camera_rays + cost.rays) as u64);
    vec![format!("{}..{}", number(cost.ms()), number(cost.time().p95)), number(cost.wall_ms.median), rays]
}

fn still(results: &[StillFrames]) -> Vec<Vec<String>> {
    let head = [&["preset", "ms..p95", "wall", "rays"][..], &ERRORS, &["frame 1", "frame 8", "flicker", "worst"]].concat();
    let mut rows = vec![header(&head)];
    for r in results {
        let last = r.curve.last().copied().unwrap_or_default();
        let after = |frame: u32| {
            let point: Option<&FramePoint> = r.curve.iter().find(|p| p.frame == frame);
            optional(point, |p| format!("{} / {}", error(p.errors.rmse), error(p.plain.errors.rmse)))
        };
        let plain = (last.plain.paths, &last.plain.errors);
        let flicker = |of: fn(&Flicker) -> f64| optional(r.flicker.as_ref(), |f| format!("{:.5}", of(f)));
        rows.push(
            [
                vec![r.preset.clone()],
                cost_columns(&r.cost),
                errors(&last.errors, plain, r.ratio(), r.denoised.as_ref()),
                vec![after(1), after(8), flicker(|f| f.rms), flicker(|f| f.greatest)],
            ]
            .concat(),
        );
    }
    filled(rows)
}

/// Errors of presets and of peers, after 1, 2, 4, ... frames.
fn peers(results: &[StillFrames]) -> Vec<Vec<String>> {
    let frames: Vec<u32> = results.first().map(|r| r.curve.iter().map(|p| p.frame).collect()).unwrap_or_default();
    let titles: Vec<String> = frames.iter().map(|f| format!("frame {f}")).collect();
    let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
    let mut rows = vec![header(&[&["preset", "peer", "ms an image", "ms a path", "reference"], &titles[..]].concat())];
    for r in results {
        for peer in &r.peers {
            let mut row = vec![r.preset.clone(), peer.peer.clone(), number(peer.ms_per_image), number(peer.ms_per_path)];
            row.push(error(peer.reference_rmse));
            row.extend(frames.iter().map(|f| {
                let ours = r.curve.iter().find(|p| p.frame == *f);
                let theirs = peer.points.iter().find(|p| p.frame == *f);
                optional(ours.zip(theirs), |(ours, theirs): (&FramePoint, &PeerPoint)| {
                    let [ours, of_peer] = [&ours.errors, &theirs.image.errors].map(|e| error(e.rmse_corrected));
                    format!("{ours} / {of_peer} ({})", theirs.image.paths)
                })
            }));
            rows.push(row);
        }
    }
    rows
}

fn motion(record: &MotionRecord) -> Vec<Vec<String>> {
    let mut rows = vec![header(&[&["preset", "ms..p95", "wall", "rays"][..], &ERRORS].concat())];
    for r in &record.results {
        let plain = (r.plain.paths, &r.plain.errors);
        let errors = errors(&r.errors, plain, r.ratio(), r.denoised.as_ref());
        rows.push([vec![r.preset.clone()], cost_columns(&r.cost), errors].concat());
    }
    filled(rows)
}

/// Frames after a change whose errors the table shows.
const AFTER: [u32; 4] = [1, 2, 8, 32];

fn change(record: &FramesChange) -> Vec<Vec<String>> {
    let titles = AFTER.map(|f| format!("frame {f} / plain"));
    let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
    let mut rows =
        vec![header(&[&["preset"], &titles[..], &["left 1", "half-life", "gone in", "ghosting", "recovered in"]].concat())];
    for r in &record.results {
        let at = |frame| optional(r.at(frame), |(ours, plain): (f64, f64)| format!("{} / {}", error(ours), error(plain)));
        let mut row = vec![r.preset.clone()];
        row.extend(AFTER.map(at));
        row.extend(after_effects(r));
        rows.push(row);
    }
    filled(rows)
}

fn after_effects(r: &ChangedFrames) -> [String; 5] {
    [
        optional(r.residuals.first(), |g| format!("{g:.3}")),
        optional(r.half_life, number),
        optional(r.gone, |n| n.to_string()),
        optional(r.ghosting, |g| format!("{g:.2e}")),
        optional(r.recovery, |n| n.to_string()),
    ]
}

/// Yes or no.
fn met(holds: bool) -> &'static str {
    if holds { "yes" } else { "NO" }
}

/// What the numbers say about each preset.
fn verdicts(record: &FramesView) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = |preset: &str, what: &str, ratio: Option<f64>| {
        lines.extend(ratio.map(|r| {
            format!(
                "  {preset}, {what}: {} of the error of plain accumulation at equal time; less: {}",
                number(r),
                met(r < 1.0)
            )
        }));
    };
    for r in &record.still {
        line(&r.preset, "still", r.ratio());
    }
    for m in &record.motions {
        for r in &m.results {
            line(&r.preset, &m.motion, r.ratio());
        }
    }
    for r in &record.still {
        lines.extend(r.flicker.map(|f| {
            let below =
                f.is_invisible().map_or_else(String::new, |yes| format!("; below 1/255 = {:.5}: {}", Flicker::LIMIT, met(yes)));
            format!("  {}: flicker after {} frames {:.5} (worst {:.5}){below}", r.preset, f.after, f.rms, f.greatest)
        }));
    }
    lines
}

/// Times by number of bounces.
pub fn bounces(records: &[BouncesRecord]) -> Vec<Block> {
    let titles = [
        "bounces and time",
        "primitives",
        "bounces",
        "ms a frame",
        "x 1 bounce",
        "plain ms",
        "x 1 bounce",
        "Coello ms",
        "x 1 bounce",
    ];
    let mut rows = vec![header(&titles)];
    for b in records {
        let first = b.points.first();
        let times = |of: fn(&BouncePoint) -> Option<f64>, p: &BouncePoint| {
            optional(of(p).zip(first.and_then(of)), |(ms, one)| number(ms / one))
        };
        let theirs = |p: &BouncePoint| p.coello_fps.map(|fps| 1e3 / fps);
        for p in &b.points {
            rows.push(vec![
                b.scene.clone(),
                thousands(b.primitives),
                p.bounces.to_string(),
                number(p.cost.ms()),
                times(|p| Some(p.cost.ms()), p),
                number(p.plain_ms),
                times(|p| Some(p.plain_ms), p),
                optional(theirs(p), number),
                times(theirs, p),
            ]);
        }
    }
    vec![Block::gap(), Block::Table { title: "Bounces and time", rows, left: 1 }]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::record::frames::{MovingFrames, PlainImage};

    #[test]
    fn verdicts_say_what_falls_short() {
        let errors = |rmse: f64| FrameErrors { rmse, rmse_corrected: rmse, ..FrameErrors::default() };
        let plain = |rmse: f64| PlainImage { paths: 3, errors: errors(rmse) };
        let still = StillFrames {
            preset: "fast".into(),
            curve: vec![FramePoint { frame: 4, errors: errors(0.2), plain: plain(0.1) }],
            flicker: Some(Flicker { after: 64, rms: 0.001, greatest: 0.002 }),
            ..StillFrames::default()
        };
        let moving = MovingFrames { preset: "fast".into(), errors: errors(0.1), plain: plain(0.2), ..MovingFrames::default() };
        let motion = MotionRecord { motion: "orbit".into(), results: vec![moving], ..MotionRecord::default() };
        let record = FramesView { scene: "a".into(), still: vec![still], motions: vec![motion], ..FramesView::default() };
        let lines = verdicts(&record);
        assert!(lines[0].contains("fast, still: 2.00") && lines[0].ends_with("NO"), "{lines:?}");
        assert!(lines[1].contains("fast, orbit: 0.50") && lines[1].ends_with("yes"), "{lines:?}");
        assert!(lines[2].contains("after 64 frames 0.00100") && lines[2].ends_with("yes"), "{lines:?}");
        // nobody was denoised
        let Block::Table { rows, .. } = &view(&record)[3] else { panic!("no table") };
        assert!(!rows[0].contains(&"oidn RMSE".to_owned()) && rows[0].contains(&"over plain".to_owned()), "{rows:?}");
    }
}
